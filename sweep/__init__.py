"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweep.analysis.asymptote import exponent_by_window as exponent_by_window
    from sweep.analysis.asymptote import fit_correction as fit_correction
    from sweep.analysis.collapse import fit_collapse as fit_collapse
    from sweep.analysis.compare import compare_laws as compare_laws
    from sweep.analysis.curves import stated_error as stated_error
    from sweep.analysis.exponents import exponent as exponent
    from sweep.analysis.exponents import local_exponent as local_exponent
    from sweep.analysis.exponents import local_exponent_error as local_exponent_error
    from sweep.analysis.exponents import where_exponent as where_exponent
    from sweep.analysis.exponents import where_value as where_value
    from sweep.analysis.formula import fit_over as fit_over
    from sweep.analysis.lines import crossover as crossover
    from sweep.analysis.lines import fit_exponent as fit_exponent
    from sweep.analysis.maps import contours as contours
    from sweep.analysis.maps import exponent_map as exponent_map
    from sweep.analysis.scattered import interpolated as interpolated
    from sweep.analysis.two_laws import fit_two_laws as fit_two_laws
    from sweep.explore.groups import collapse_quality as collapse_quality
    from sweep.explore.groups import rescaled as rescaled
    from sweep.explore.groups import scaling as scaling
    from sweep.explore.join import join as join
    from sweep.explore.notebook import kernels as kernels
    from sweep.explore.plan import plan as plan
    from sweep.explore.refine import refine as refine
    from sweep.explore.sensitivity import sensitivity as sensitivity
    from sweep.explore.solver import solver as solver
    from sweep.explore.work_precision import work_precision as work_precision
    from sweep.results.diff import diff as diff
    from sweep.results.export import export as export
    from sweep.results.filter import where as where
    from sweep.results.listing import list_results as list_results
    from sweep.results.open import open_result as open_result
    from sweep.results.units import in_units as in_units
    from sweep.results.verify import verify as verify
    from sweep.runs.run import run as run
    from sweep.show.charts import plot as plot
    from sweep.show.charts import plot_precision as plot_precision
    from sweep.show.law_charts import plot_laws as plot_laws
    from sweep.study.read import build_study as build_study
    from sweep.study.read import read_study as read_study
    from sweep.study.read import study_of as study_of
    from sweep.study.toml import to_toml as to_toml
    from sweep.system.errors import StudyError as StudyError
    from sweep.system.errors import SweepError as SweepError

_PUBLIC = {
    "study.toml": ("to_toml",),
    "study.read": ("study", "read_study", "build_study", "study_of"),
    "runs.run": ("run",),
    "results.open": ("open_result",),
    "results.verify": ("verify",),
    "results.filter": ("where",),
    "results.units": ("in_units",),
    "results.export": ("export",),
    "analysis.exponents": (
        *("local_exponent", "local_exponent_error", "exponent"),
        *("where_exponent", "where_value"),
    ),
    "analysis.lines": ("fit_exponent", "crossover"),
    "analysis.asymptote": ("fit_correction", "exponent_by_window"),
    "analysis.compare": ("compare_laws",),
    "analysis.collapse": ("fit_collapse",),
    "analysis.formula": ("fit_over",),
    "analysis.curves": ("stated_error",),
    "analysis.two_laws": ("fit_two_laws",),
    "analysis.maps": ("contours", "exponent_map"),
    "results.diff": ("diff",),
    "results.listing": ("list_results",),
    "explore.join": ("join",),
    "explore.solver": ("solver",),
    "explore.sensitivity": ("sensitivity",),
    "analysis.scattered": ("interpolated",),
    "explore.plan": ("plan",),
    "explore.notebook": ("kernels",),
    "explore.groups": ("scaling", "rescaled", "collapse_quality"),
    "explore.work_precision": ("work_precision",),
    "explore.refine": ("refine",),
    "show.charts": ("plot", "plot_precision"),
    "show.law_charts": ("plot_laws",),
    "system.errors": ("SweepError", "StudyError"),
}
_HOMES = {name: home for home, names in _PUBLIC.items() for name in names}
"""Public names and the modules they live in; a module is imported when one of its names is first used."""

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sweep' has no attribute {name!r}")
    import_module("sweep.study.model").SHOWN["html"] = _study_html
    # the room of that name is the function as well, and stays what `sweep.study.read` and its like begin with
    return import_module("sweep.study") if name == "study" else getattr(import_module(f"sweep.{_HOMES[name]}"), name)


def _study_html(study: Any) -> str:
    """How a notebook shows a study; imported when one does."""
    found: str = import_module("sweep.explore.notebook").study_html(study)
    return found


def __dir__() -> list[str]:
    return sorted(_HOMES)
