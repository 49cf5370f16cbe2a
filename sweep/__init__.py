"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out.

Its public names, and the modules they live in, are those of `__init__.pyi`; each is imported when it is first used.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_MODULES = {name: module for module, name in re.findall(r"^from (\S+) import \w+ as (\w+)$", _STUB, re.MULTILINE)}
_WITHOUT_DATASETS = ("study", "to_toml", "plan", "kernels", "solver", "list_results", "verify")
"""Functions that take and give no Dataset; for any other one xarray is needed, and Datasets get `ds.sweep`."""

__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'sweep' has no attribute {name!r}")
    if name == "study":  # the room of that name is the function as well
        return import_module("sweep.study")
    module = import_module(_MODULES[name])
    if name not in _WITHOUT_DATASETS and module.__name__ != "sweep.errors":
        import_module("sweep.show.accessor")
    return getattr(module, name)


def __dir__() -> list[str]:
    return sorted(_MODULES)
