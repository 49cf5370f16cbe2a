"""The sweep engine: a study in, an xarray Dataset in an HDF5 file out."""

from importlib import import_module
from typing import Any

_MODULES = {
    "study": "study",
    "StudyError": "errors",
    "SweepError": "errors",
    "plan": "explore.plan",
    "refine": "explore.refine",
    "scaling": "explore.scaling",
    "interpolated": "explore.scattered",
    "sensitivity": "explore.sensitivity",
    "solver": "explore.solver",
    "work_precision": "explore.work_precision",
    "open_result": "file.open",
    "verify": "file.open",
    "fit_correction": "laws.lines",
    "fit_collapse": "laws.collapse",
    "compare_laws": "laws.two_laws",
    "exponent_map": "laws.exponents",
    "local_exponent": "laws.exponents",
    "where_exponent": "laws.exponents",
    "fit_exponent": "laws.lines",
    "fit_two_laws": "laws.two_laws",
    "diff": "results.diff",
    "export": "results.export",
    "where": "results.filter",
    "join": "results.join",
    "list_results": "results.listing",
    "in_units": "results.units",
    "run": "runs.run",
    "plot": "show.figures",
    "kernels": "show.kernels",
    "to_toml": "study.read",
}
"""Public names and the modules they live in, each imported when one of its names is first used."""
_WITHOUT_DATASETS = {
    "study",
    "to_toml",
    "plan",
    "kernels",
    "solver",
    "list_results",
    "verify",
    "StudyError",
    "SweepError",
}
"""Names that take and give no Dataset; with any other one xarray is needed, and Datasets get `ds.sweep`."""

__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'sweep' has no attribute {name!r}")
    if name not in _WITHOUT_DATASETS:
        import_module("sweep.show.accessor")
    module = import_module(f"sweep.{_MODULES[name]}")
    # the room of that name is the function as well, and stays what `sweep.study.read` and its like begin with
    return module if name == "study" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(_MODULES)
