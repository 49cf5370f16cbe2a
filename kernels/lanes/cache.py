"""Machine code on the disk, for the entry functions of this package only.

numba's own cache is stale when a *called* module changes. Ours lives in a folder named by a digest of all kernel
sources, numba, llvmlite and the CPU, so what is found there was compiled from these very sources. A function from
elsewhere (a user's kernel) is never cached: what it calls is not known here. A cache that cannot be read or written
is no fault: the function is compiled again.
"""

import contextlib
import hashlib
import os
import shutil
import time
from pathlib import Path

import llvmlite
import numba
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

PACKAGE = Path(__file__).parents[1]
OLD_SECONDS = 30 * 24 * 3600
"""Folders of other sources, versions or CPUs that were not used for so long are removed."""


def _digest():
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(str(path.relative_to(PACKAGE)).encode() + path.read_bytes())
    cpu = f"{binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"
    digest.update(f"{numba.__version__} {llvmlite.__version__} {cpu}".encode())
    return digest.hexdigest()[:20]


def _folder():
    """The folder of these sources, made and marked as used; None where there can be none."""
    home = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        base = (Path(home) if home else Path.home() / ".cache") / "foliot"
        folder = base / _digest()
        fresh = not folder.is_dir()
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        if fresh:
            _remove_old(base)
    except (OSError, RuntimeError):
        return None
    return folder if os.access(folder, os.W_OK) else None


def _remove_old(base):
    for folder in base.iterdir():
        if time.time() - folder.stat().st_mtime > OLD_SECONDS:
            shutil.rmtree(folder, ignore_errors=True)


FOLDER = _folder()


class _Locator(_CacheLocator):
    """Says that everything is in FOLDER and never out of date: the folder's name says what it was made from."""

    def __init__(self, py_func):
        self._lineno = py_func.__code__.co_firstlineno

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


class _Cache(FunctionCache):
    """numba's cache of one function, in FOLDER; a fault of the disk or a damaged file only means to compile."""

    _impl_class = _Implementation

    def load_overload(self, sig, target_context):
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # whatever comes of reading a damaged file
            with contextlib.suppress(Exception):
                self.flush()
            return None

    def save_overload(self, sig, data):
        with contextlib.suppress(Exception):
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
