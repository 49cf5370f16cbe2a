"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweep._scaling import collapse_quality as collapse_quality
    from sweep._scaling import rescaled as rescaled
    from sweep._scaling import scaling as scaling
    from sweep.analysis import crossover as crossover
    from sweep.analysis import exponent as exponent
    from sweep.analysis import fit_exponent as fit_exponent
    from sweep.analysis import local_exponent as local_exponent
    from sweep.analysis import local_exponent_error as local_exponent_error
    from sweep.analysis import where_exponent as where_exponent
    from sweep.analysis import where_value as where_value
    from sweep.charts import plot as plot
    from sweep.charts import plot_precision as plot_precision
    from sweep.customary import in_units as in_units
    from sweep.errors import StudyError as StudyError
    from sweep.errors import SweepError as SweepError
    from sweep.exporting import export as export
    from sweep.filtering import where as where
    from sweep.mapping import contours as contours
    from sweep.mapping import exponent_map as exponent_map
    from sweep.planning import plan as plan
    from sweep.precision import work_precision as work_precision
    from sweep.refining import refine as refine
    from sweep.refining import study_of as study_of
    from sweep.regimes import fit_two_laws as fit_two_laws
    from sweep.result import open_result as open_result
    from sweep.runner import run as run
    from sweep.spec import build_study as build_study
    from sweep.spec import read_study as read_study
    from sweep.verifying import verify as verify

_HOMES = {
    "read_study": "spec",
    "build_study": "spec",
    "plan": "planning",
    "run": "runner",
    "open_result": "result",
    "verify": "verifying",
    "local_exponent": "analysis",
    "local_exponent_error": "analysis",
    "exponent": "analysis",
    "fit_exponent": "analysis",
    "crossover": "analysis",
    "fit_two_laws": "regimes",
    "where_exponent": "analysis",
    "where_value": "analysis",
    "scaling": "_scaling",
    "rescaled": "_scaling",
    "collapse_quality": "_scaling",
    "plot": "charts",
    "plot_precision": "charts",
    "work_precision": "precision",
    "in_units": "customary",
    "contours": "mapping",
    "exponent_map": "mapping",
    "refine": "refining",
    "study_of": "refining",
    "where": "filtering",
    "export": "exporting",
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
