"""Machine code on the disk, for the entry functions of this package only.

numba's own cache is stale when a *called* module changes. Ours lives in a folder named by a digest of all kernel
sources, numba, llvmlite and the CPU, so what is found there was compiled from these very sources. A function from
elsewhere (a user's kernel) is never cached: what it calls is not known here. A cache that cannot be read or written
is no fault: the function is compiled again. Of processes that need a function at a time one compiles it.

What is read here runs with the user's rights. So nothing is read that is not the user's alone: neither from a folder
that belongs to somebody else or that others may write to, nor from such a file. Whoever may rename the folder can put
nothing in its place that is read.
"""

import contextlib
import fcntl
import functools
import hashlib
import itertools
import multiprocessing
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
import time
from pathlib import Path

import llvmlite
import numba
from llvmlite import binding
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, _CacheLocator

PACKAGE = Path(__file__).parents[1]
OLD_SECONDS = 30 * 24 * 3600
"""Folders of other sources, versions or CPUs that were not used for so long are removed."""
MOST_COMPILE_SECONDS = 120
"""What a process waits for another one that compiles the same."""


def _numbered_apart():
    """Numbers functions apart from those of other processes.

    numba tells functions of one name apart by numbers, also in the machine code that it keeps. Counted from 1 in every
    process, as it does, two functions of one name that two processes have compiled may have one number, and a third
    process that loads both files takes one function for the other: wrong numbers, without a word.
    """
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6)))


_numbered_apart()
os.register_at_fork(after_in_child=_numbered_apart)


def _ours_alone(info, path):
    """Whether a file or folder of that `os.stat` belongs to the user, and nobody else may write to it."""
    alone = info.st_uid == os.geteuid() and not info.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if not alone:
        _refuse(path)
    return alone


@functools.cache
def _refuse(path):
    """Says once, and not in every worker, that something is not used."""
    if multiprocessing.parent_process() is None:
        print(
            f"foliot compiles without {path}: it belongs to somebody else, or others may write to it", file=sys.stderr
        )


def _own_folder(folder):
    """Whether a folder, made where there is none, is the user's alone, and so is the link that may lead to it."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.lstat().st_uid != os.geteuid():
        _refuse(folder)
        return False
    return _ours_alone(folder.stat(), folder)


def _folder():
    """The folder of these sources, made and marked as used; None where there can be none."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(str(path.relative_to(PACKAGE)).encode() + path.read_bytes())
    cpu = f"{binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {llvmlite.__version__} {cpu}".encode())
    home = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        base = (Path(home) if home else Path.home() / ".cache") / "foliot"
        folder = base / digest.hexdigest()[:20]
        fresh = not folder.is_dir()
        if not (_own_folder(base) and _own_folder(folder)):
            return None
        os.utime(folder)
        for other in base.iterdir() if fresh else ():
            ours = re.fullmatch("[0-9a-f]{20}", other.name)
            if ours and time.time() - other.stat().st_mtime > OLD_SECONDS:
                shutil.rmtree(other, ignore_errors=True)
    except (OSError, RuntimeError):
        return None
    return folder if os.access(folder, os.W_OK) else None


FOLDER = _folder()


class _Locator(_CacheLocator):
    """Says that everything is in FOLDER and never out of date: the folder's name says what it was made from."""

    def __init__(self, py_func):
        self._py_file, self._lineno = py_func.__code__.co_filename, py_func.__code__.co_firstlineno

    def ensure_cache_path(self):
        """Whoever takes the folder away while we run has compiled code not kept."""

    def get_cache_path(self):
        return str(FOLDER)

    def get_source_stamp(self):
        return FOLDER.name

    def get_disambiguator(self):
        return str(self._lineno)

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_func)


class _Implementation(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _Files(IndexDataCacheFile):
    """The files of one function. One that is damaged, or not the user's alone, is as good as none."""

    def _load_index(self):
        stamp, overloads = _unpickled(self._index_path) or (None, {})
        return overloads if stamp == self._source_stamp else {}

    def _load_data(self, name):
        return _unpickled(self._data_path(name))

    def _save_index(self, overloads):
        _write(self._index_path, self._dump((self._source_stamp, overloads)))

    def _save_data(self, name, data):
        _write(self._data_path(name), self._dump(data))


def _unpickled(path):
    """What a file of the user's holds; None where there is none, or it is damaged."""
    with contextlib.suppress(Exception), Path(path).open("rb") as file:  # whatever comes of a damaged pickle
        if _ours_alone(os.fstat(file.fileno()), path):
            return pickle.load(file)
    return None


def _write(path, content):
    """A file that only the user may read and write, in one piece."""
    handle, draft = tempfile.mkstemp(dir=FOLDER, suffix=".draft")
    with os.fdopen(handle, "wb") as file:
        file.write(content)
    Path(draft).replace(path)


class _Cache(FunctionCache):
    """numba's cache of one function, in FOLDER; a fault of the disk or a damaged file only means to compile."""

    _impl_class = _Implementation

    def __init__(self, py_func):
        super().__init__(py_func)
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, FOLDER.name)

    @contextlib.contextmanager
    def alone(self):
        """Has other processes wait while this one compiles what is not kept yet, for they can load it then.

        Gives up where its holder takes longer than anything takes to compile, and where who had it could keep nothing:
        then none need wait for another. In a folder without locks each compiles for itself.
        """
        index, file = Path(self._cache_file._index_path), None
        if not index.exists():
            with contextlib.suppress(OSError):
                file = os.open(f"{index}.lock", os.O_CREAT | os.O_WRONLY, 0o600)
                for trial in range(round(MOST_COMPILE_SECONDS / 0.05)):
                    with contextlib.suppress(BlockingIOError):
                        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        if trial and not index.exists():
                            fcntl.flock(file, fcntl.LOCK_UN)
                        break
                    time.sleep(0.05)
        try:
            yield
        finally:
            if file is not None:
                with contextlib.suppress(OSError):  # also for processes that were forked meanwhile and have it open
                    fcntl.flock(file, fcntl.LOCK_UN)
                os.close(file)

    def load_overload(self, sig, target_context):
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # code that is there, but is none
            return None

    def save_overload(self, sig, data):
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


def enable(dispatcher):
    """Keeps the compiled versions of a function of this package, or of what it wrote into FOLDER, on the disk."""
    if is_ours(dispatcher) and FOLDER is not None:
        dispatcher._cache = _Cache(dispatcher.py_func)
    return dispatcher


def is_ours(function):
    """Whether a function, compiled or not, is of this package, or written by it."""
    file = Path(getattr(function, "py_func", function).__code__.co_filename)
    return PACKAGE in file.parents or file.parent == FOLDER
