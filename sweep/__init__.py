"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweep.analysis import crossover as crossover
    from sweep.analysis import exponent as exponent
    from sweep.analysis import fit_exponent as fit_exponent
    from sweep.analysis import local_exponent as local_exponent
    from sweep.errors import StudyError as StudyError
    from sweep.errors import SweepError as SweepError
    from sweep.export import export as export
    from sweep.plan import plan as plan
    from sweep.result import open_result as open_result
    from sweep.runner import run as run
    from sweep.spec import build_study as build_study
    from sweep.spec import read_study as read_study

_HOMES = {
    "read_study": "spec",
    "build_study": "spec",
    "plan": "plan",
    "run": "runner",
    "open_result": "result",
    "local_exponent": "analysis",
    "exponent": "analysis",
    "fit_exponent": "analysis",
    "crossover": "analysis",
    "export": "export",
    "SweepError": "errors",
    "StudyError": "errors",
}
"""Public names and the modules they live in; a module is imported when one of its names is first used."""

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sweep' has no attribute {name!r}")
    return getattr(import_module(f"sweep.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})


class _Package(ModuleType):
    """Keeps `sweep.plan` and `sweep.export` the functions, also once the modules of the same names are imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
