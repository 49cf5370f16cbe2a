"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweep.errors import StudyError as StudyError
    from sweep.errors import SweepError as SweepError
    from sweep.explore.join import join as join
    from sweep.explore.plan import plan as plan
    from sweep.explore.refine import refine as refine
    from sweep.explore.scaling import scaling as scaling
    from sweep.explore.scattered import interpolated as interpolated
    from sweep.explore.sensitivity import sensitivity as sensitivity
    from sweep.explore.solver import solver as solver
    from sweep.explore.work_precision import work_precision as work_precision
    from sweep.file.open import open_result as open_result
    from sweep.file.verify import verify as verify
    from sweep.laws.asymptote import fit_correction as fit_correction
    from sweep.laws.collapse import fit_collapse as fit_collapse
    from sweep.laws.compare import compare_laws as compare_laws
    from sweep.laws.exponents import exponent_map as exponent_map
    from sweep.laws.exponents import local_exponent as local_exponent
    from sweep.laws.exponents import where_exponent as where_exponent
    from sweep.laws.lines import fit_exponent as fit_exponent
    from sweep.laws.two_laws import fit_two_laws as fit_two_laws
    from sweep.results.diff import diff as diff
    from sweep.results.export import export as export
    from sweep.results.filter import where as where
    from sweep.results.listing import list_results as list_results
    from sweep.results.units import in_units as in_units
    from sweep.runs.run import run as run
    from sweep.show.charts import plot as plot
    from sweep.show.kernels import kernels as kernels
    from sweep.study.toml import to_toml as to_toml

_HOMES = {"study": "sweep.study"} | {
    name: home
    for home, name in re.findall(r"^    from ([\w.]+) import (\w+) as", Path(__file__).read_text(), re.MULTILINE)
}
"""Public names and the modules they live in: the lines above, which only type checkers run; a module is imported when
one of its names is first used."""
_WITHOUT_DATASETS = {"study", "to_toml", "plan", "kernels", "solver", "StudyError", "SweepError"}
"""Names that take and give no Dataset; with any other one xarray is needed, and Datasets get `ds.sweep`."""

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sweep' has no attribute {name!r}")
    if name not in _WITHOUT_DATASETS:
        import_module("sweep.show.accessor")
    # what a notebook shows of a study needs to know its cells, which is above the study
    import_module("sweep.study.model").Study._repr_html_ = lambda study: import_module(
        "sweep.show.notebook"
    ).study_html(study)
    # the room of that name is the function as well, and stays what `sweep.study.read` and its like begin with
    return import_module("sweep.study") if name == "study" else getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(_HOMES)
