"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweep.analysis.asymptote import fit_correction as fit_correction
    from sweep.analysis.collapse import fit_collapse as fit_collapse
    from sweep.analysis.compare import compare_laws as compare_laws
    from sweep.analysis.exponents import local_exponent as local_exponent
    from sweep.analysis.exponents import where_exponent as where_exponent
    from sweep.analysis.lines import fit_exponent as fit_exponent
    from sweep.analysis.maps import exponent_map as exponent_map
    from sweep.analysis.scattered import interpolated as interpolated
    from sweep.analysis.two_laws import fit_two_laws as fit_two_laws
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
    from sweep.show.plot import plot as plot
    from sweep.study.toml import to_toml as to_toml
    from sweep.system.errors import StudyError as StudyError
    from sweep.system.errors import SweepError as SweepError

_PUBLIC = {
    "study.read": ("study",),
    "study.toml": ("to_toml",),
    "explore.plan": ("plan",),
    "runs.run": ("run",),
    "results.open": ("open_result",),
    "results.verify": ("verify",),
    "results.filter": ("where",),
    "results.units": ("in_units",),
    "results.export": ("export",),
    "results.diff": ("diff",),
    "results.listing": ("list_results",),
    "explore.join": ("join",),
    "explore.notebook": ("kernels",),
    "explore.solver": ("solver",),
    "explore.refine": ("refine",),
    "analysis.scattered": ("interpolated",),
    "explore.work_precision": ("work_precision",),
    "explore.sensitivity": ("sensitivity",),
    "explore.groups": ("scaling",),
    "analysis.exponents": ("local_exponent", "where_exponent"),
    "analysis.maps": ("exponent_map",),
    "analysis.lines": ("fit_exponent",),
    "analysis.two_laws": ("fit_two_laws",),
    "analysis.asymptote": ("fit_correction",),
    "analysis.compare": ("compare_laws",),
    "analysis.collapse": ("fit_collapse",),
    "show.plot": ("plot",),
    "system.errors": ("StudyError", "SweepError"),
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
