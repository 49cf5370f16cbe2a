"""Machine code on the disk, for the entry functions of this package only.

numba's own cache is stale when a *called* module changes. This one is in a folder named by a digest of all kernel
sources, numba, llvmlite and the CPU, so its contents were compiled from the same sources. Functions from elsewhere (a
user's kernel) are never cached, since the functions that they call are not known here. If the cache cannot be read or
written, the function is compiled again. If several processes need a function at once, one of them compiles it.

Cached code runs with the user's rights. So nothing is read from folders or files that belong to somebody else or that
others may write to. Even someone who can rename the folder cannot put another in its place that is read.
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
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

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


class _Cache(NullCache):
    """Machine code of a function, in FOLDER a file for each signature.

    A fault of the disk, and a file that is damaged or not the user's alone, only mean to compile.
    """

    def __init__(self, function):
        code, version = function.__code__, "".join(map(str, sys.version_info[:2]))
        name = f"{Path(code.co_filename).stem}.{function.__qualname__}-{code.co_firstlineno}.py{version}"
        self._name = name.replace("<", "").replace(">", "")

    def _path(self, signature):
        return FOLDER / f"{self._name}.{hashlib.sha256(repr(signature).encode()).hexdigest()[:16]}.nbc"

    @contextlib.contextmanager
    def alone(self, signature):
        """Has other processes wait while this one compiles what is not kept yet, for they can load it then.

        Gives up where its holder takes longer than anything takes to compile, and where who had it could keep nothing:
        then none need wait for another. In a folder without locks each compiles for itself.
        """
        path, file = self._path(signature), None
        if not path.exists():
            with contextlib.suppress(OSError):
                file = os.open(f"{path}.lock", os.O_CREAT | os.O_WRONLY, 0o600)
                for trial in range(round(MOST_COMPILE_SECONDS / 0.05)):
                    with contextlib.suppress(BlockingIOError):
                        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        if trial and not path.exists():
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

    def load_overload(self, signature, context):
        context.refresh()
        path = self._path(signature)
        with contextlib.suppress(Exception), path.open("rb") as file:  # whatever comes of a damaged pickle
            if _ours_alone(os.fstat(file.fileno()), path):
                return CompileResult._rebuild(context, *pickle.load(file))

    def save_overload(self, signature, compiled):
        if compiled.library.has_dynamic_globals:
            return
        with contextlib.suppress(OSError):
            handle, draft = tempfile.mkstemp(dir=FOLDER, suffix=".draft")  # only the user may read and write it
            with os.fdopen(handle, "wb") as file:
                file.write(dumps(compiled._reduce()))
            Path(draft).replace(self._path(signature))


def enable(dispatcher):
    """Keeps the compiled versions of a function of this package on the disk."""
    if is_ours(dispatcher) and FOLDER is not None:
        dispatcher._cache = _Cache(dispatcher.py_func)
    return dispatcher


def is_ours(function):
    """Whether a function, compiled or not, is of this package."""
    return PACKAGE in Path(getattr(function, "py_func", function).__code__.co_filename).parents
