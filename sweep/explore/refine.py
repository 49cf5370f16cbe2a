"""Cells where they are needed: a finished sweep refined until straight lines between cells are right to a tolerance.

Cells are joined to simplices, intervals along one axis, in a box stretched to where an output bends (see
`analysis.metric`). What is there is judged first: the cells around a simplex tell how far straight lines are off in it
(`analysis.mesh`). Where that is more than the tolerance, the edge that bends most is cut in the middle, and the cells
around are judged again. So is the edge across a border between statuses, down to a fixed share of the first grid's
step. What is judged is logarithmic where values are positive, as a scaling law wants it; elsewhere errors are relative
to the largest value.

Cells of one axis are a sweep over its values like any other. Cells of more axes lie anywhere, as those of a zip design.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kernels.interface import Status
from sweep.cells.schema import STATUS, cell_schema
from sweep.errors import SweepError
from sweep.explore.mesh import Array
from sweep.explore.refiner import Refinement, Refiner
from sweep.explore.scattered import MOST_AXES, axes_of
from sweep.file import disk
from sweep.file.overwriting import check_target
from sweep.study.model import Axis, Study
from sweep.study.read import study as as_study
from sweep.words import as_path, require_dataset

if TYPE_CHECKING:
    import xarray as xr

MOST_CELLS = 1_000_000


def refine(
    dataset: xr.Dataset,
    y: str | Sequence[str],
    tolerance: float,
    *,
    path: str | os.PathLike[str] | None = None,
    study: Study | None = None,
    most_cells: int = MOST_CELLS,
    workers: int | None = None,
    force: bool = False,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
) -> Refinement:
    """Add cells to a finished sweep until outputs can be interpolated to a tolerance.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`, of a product of at most five number axes; or refined before.
    y : str or sequence of str
        Outputs, one value a cell.
    tolerance : float
        Relative error of the interpolation.
    path : path, optional
        Where all cells are written at the end, an HDF5 file as of `run`; the rounds on the way are kept beside it until
        then, so that what was computed is not lost. None: in memory.
    study : Study, optional
        That of the dataset; default: the one in its attributes.
    most_cells : int
        Largest number of cells altogether.
    workers, isolate, cell_timeout
        As of `run`.
    force : bool
        Overwrite the result of another study.

    Raises
    ------
    SweepError
        The dataset is no finished product of one to five number axes, nor refined before; an output is not there or
        runs along something; `path` is not to be written.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(0.1, 10.0, 5)})
    >>> sweep.refine(ds, "period", 1e-3).complete
    True
    """
    require_dataset("refine", dataset)
    study = study or as_study(dataset)
    names = [y] if isinstance(y, str) else list(y)
    _require(dataset, study, names, tolerance)
    options = {"workers": workers, "isolate": isolate, "cell_timeout": cell_timeout}
    output = _Output(study, None if path is None else as_path(path), force, options)
    output.prepare(dataset)
    found = Refiner(dataset, output, names, tolerance, most_cells).refined()
    output.tidy()
    return found


@dataclass(frozen=True)
class _Output:
    """Solves further cells of a study, each round into a file in a folder, and writes all cells at the end.

    `path`: None: everything stays in memory. `options`: of `run`.
    """

    study: Study
    path: Path | None
    force: bool
    options: Mapping[str, Any]

    @property
    def title(self) -> str:
        return f"{self.study.title}, refined"

    @property
    def rounds(self) -> Path | None:
        """The folder of what is computed on the way."""
        return None if self.path is None else self.path.with_name(f"{self.path.name}.rounds")

    def prepare(self, dataset: xr.Dataset) -> None:
        """Raises SweepError, before anything is computed, where all cells are not to be written there."""
        if self.path is None or self.rounds is None:
            return
        source = dataset.encoding.get("source")
        check_target(self.path, "result", read=[Path(source)] if source else [])
        self._check_earlier(self.path)
        try:
            self.rounds.mkdir(exist_ok=True)
        except OSError as error:
            raise disk.refusal(error, self.path) from None

    def _check_earlier(self, path: Path) -> None:
        from sweep.file.open import open_result

        if path.exists() and not self.force:
            with open_result(path) as there:
                if there.attrs["title"] != self.title:
                    raise SweepError(f"{path}: holds another result; name another file, or overwrite it with --force")

    def solved(self, axes: dict[str, Axis]) -> xr.Dataset:
        """Cells with these values."""
        from sweep.cells.fingerprint import fingerprint
        from sweep.runs.run import run

        further = self._study(axes)
        if self.rounds is None:
            return run(further, progress=False, **self.options)
        name = hashlib.sha256(repr(sorted(fingerprint(further).items())).encode()).hexdigest()[:16]
        with run(further, self.rounds / f"{name}.h5", **self.options) as found:
            return found.load()

    def written(self, axes: dict[str, Axis], arrays: dict[str, Any], attrs: dict[str, str]) -> xr.Dataset:
        """All cells, with these values of the axes, outputs and statuses, and further attributes."""
        from sweep.file.open import in_memory
        from sweep.runs.run import store_cells

        whole = dataclasses.replace(self._study(axes), design="product" if len(axes) == 1 else "zip")
        if self.path is None:
            return in_memory(cell_schema(whole, {}), arrays).assign_attrs(attrs)
        return store_cells(whole, self.path, arrays, self.force, attrs=attrs)

    def _study(self, axes: dict[str, Axis]) -> Study:
        return dataclasses.replace(self.study, design="zip", blocks=(), axes=axes, title=self.title)

    def tidy(self) -> None:
        """Removes what was computed on the way."""
        if self.rounds is not None:
            shutil.rmtree(self.rounds, ignore_errors=True)


def _require(dataset: xr.Dataset, study: Study, names: Sequence[str], tolerance: float) -> None:
    if not 0 < tolerance < 1:
        raise SweepError(f"tolerance: expected a number between 0 and 1, found {tolerance}")
    if STATUS not in dataset:
        raise SweepError("a summary keeps no cells; refine a result that has them")
    if any(axis.words is not None or axis.values.ndim > 1 for axis in study.axes.values()):
        raise SweepError("only number axes can be refined")
    if study.design != "product" and not axes_of(dataset):
        raise SweepError("only a product of axes can be refined, or what was refined before")
    if len(study.axes) > MOST_AXES:
        raise SweepError(f"at most {MOST_AXES} axes can be refined, found {len(study.axes)}; fix the others")
    if study.design == "product" and any(_unordered(axis.values) for axis in study.axes.values()):
        raise SweepError("an axis to be refined needs at least two values, in rising order")
    for name in names:
        if name not in dataset or dataset[name].dims != dataset[STATUS].dims:
            raise SweepError(f"{name}: is no output of one value a cell")
    if bool((dataset[STATUS] == Status.PENDING).any()):
        raise SweepError("the sweep is not finished; run it to its end first")


def _unordered(values: Array) -> bool:
    return len(values) < 2 or bool((np.diff(values) <= 0).any())
