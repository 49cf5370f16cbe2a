"""A kernel by the name that a study gives it."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from kernels import catalogue
from kernels.interface import Kernel, load
from sweep.errors import SweepError
from sweep.study.mistakes import show
from sweep.words import did_you_mean, listed

RESERVED = ("status", "method_used", "error_bound", "method", "rtol", "cell")
"""Names that a result has in any case."""


def load_kernel(name: object, allow_import: bool = False, folders: Iterable[Path] = (Path(),)) -> Kernel:
    """The kernel called `name` in the catalogue, or, where allowed, found at "module:NAME".

    Parameters
    ----------
    folders : iterable of Path
        Where to look for the module after Python's own path; default: the current one.

    Raises
    ------
    SweepError
        There is no such kernel, it may not be imported, importing it fails, or it declares a name twice.
    """
    known, there = list(catalogue.KERNELS), f"there are {listed(catalogue.KERNELS)}"
    if not isinstance(name, str) or not name:
        raise SweepError(f"expected the name of a kernel, found {show(name)}; {there}")
    if ":" not in name and name not in known:
        raise SweepError(f"no kernel {show(name)}{did_you_mean(name, known) or ';'} {there}")
    if ":" in name and not allow_import:
        cure = "allow it with --allow-import (Python: allow_import=True)"
        raise SweepError(f"{show(name)} runs code of your own; {cure}")
    try:
        if ":" in name:
            # for good: a kernel may import modules beside it later
            sys.path.extend(folder for f in folders if (folder := str(f.resolve())) not in sys.path)
        kernel = load(name) if ":" in name else catalogue.get(name)
    except (Exception, SystemExit) as error:
        raise SweepError(f"{show(name)} cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(kernel, Kernel):
        raise SweepError(f"{show(name)} is a {type(kernel).__name__}, not a kernels.interface.Kernel")
    # no result could hold it otherwise
    fields = (*kernel.parameters, *kernel.outputs, *kernel.along)
    names = [*RESERVED, *(field.name for field in fields)]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise SweepError(f"kernel {name} declares {listed(twice)} more than once, or takes a name of the result's own")
    dims = {*kernel.same_length, *(f.name for f in kernel.along), *(d for p in kernel.parameters for d in p.dims)}
    if lost := sorted({dim for field in kernel.outputs for dim in field.dims} - dims):
        cure = "neither in `along` nor a dim of array parameters"
        raise SweepError(f"kernel {name} has outputs along {listed(lost)}, {cure}")
    return kernel
