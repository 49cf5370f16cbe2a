"""Cells where they are needed: a finished sweep refined until straight lines between cells are right to a tolerance.

A box of the grid, with a cell in each corner, is tried by solving the middles of its edges, faces and itself. Where one
of them is off the multilinear interpolation from the corners, or has another status, the box is cut in two along every
axis, and its parts are tried in turn; middles of boxes that pass are not kept. What is tried is logarithmic where the
grid is, and in the output where that is positive in all of the box, as a scaling law wants it; elsewhere distances are
relative to the largest value.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import FIRST_REFUSAL, Status
from sweep.analysis.loglog import Array, is_logarithmic
from sweep.cells.schema import ANCILLARY, STATUS, cell_schema
from sweep.study.model import Axis, Study, frozen
from sweep.system.errors import SweepError

if TYPE_CHECKING:
    import xarray as xr

LEVELS = 16
"""How often a box may be cut."""
BORDER_LEVELS = 5
"""How often a box may be cut because a border between statuses passes through it; no value is right inside the last."""
MOST_CELLS = 1_000_000

Index = tuple[int, ...]
"""A place in the grid, in units of the finest box: 2^LEVELS to a box of the first grid."""


@dataclass(frozen=True)
class Refinement:
    """What came of it.

    Attributes
    ----------
    dataset : Dataset
        All cells, the first ones and those added, along `cell`.
    added : int
        Cells kept beyond the first grid.
    tried : int
        Cells solved beyond the first grid.
    uniform : int
        Cells of an even grid as fine as the finest box.
    error : float
        Largest distance left between an output and its interpolation, relative; at the middles that were tried, of
        boxes that were cut and not tried since also before the cut.
    complete : bool
        Whether all boxes meet the tolerance; not so where `most_cells` or the levels ran out.
    """

    dataset: xr.Dataset
    added: int
    tried: int
    uniform: int
    error: float
    complete: bool

    def __str__(self) -> str:
        cells = self.dataset.sizes["cell"]
        told = (
            ""
            if self.complete
            else "; not all boxes meet the tolerance, allow more cells, or leave out where it diverges"
        )
        return (
            f"{cells:,} cells, {self.added:,} of them added, {self.tried:,} tried; an even grid as fine has "
            f"{self.uniform:,}\n"
            f"largest interpolation error left: {self.error:.2g}{told}"
        )


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
) -> Refinement:
    """Add cells to a finished sweep until outputs can be interpolated to a tolerance.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`, of a product of number axes.
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
        Largest number of cells altogether, with those that are tried and not kept.
    workers : int, optional
        As of `run`.
    force : bool
        Overwrite the result of another study.

    Raises
    ------
    SweepError
        The dataset is no finished product of number axes, an output is not there or runs along something, or `path` is
        not to be written.
    """
    study = study or study_of(dataset)
    names = [y] if isinstance(y, str) else list(y)
    _require(dataset, study, names, tolerance)
    rounds = None if path is None else Path(path).with_name(f"{Path(path).name}.rounds")
    if path is not None and rounds is not None:
        _check_output(dataset, study, Path(path), force)
        _make(rounds)
    found = _Refiner(dataset, study, names, tolerance, _Runs(rounds, workers), most_cells, path, force).refined()
    if rounds is not None:
        shutil.rmtree(rounds, ignore_errors=True)
    return found


def _check_output(dataset: xr.Dataset, study: Study, path: Path, force: bool) -> None:
    """Raises SweepError, before anything is computed, where all cells are not to be written there."""
    from sweep.results.open import open_result
    from sweep.system.overwriting import check_target

    source = dataset.encoding.get("source")
    check_target(path, "result", read=[Path(source)] if source else [])
    if path.exists():
        with open_result(path) as there:
            if not force and there.attrs["title"] != _title(study):
                raise SweepError(f"{path}: holds another result; name another file, or overwrite it with --force")


def _title(study: Study) -> str:
    return f"{study.title}, refined"


def _make(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise SweepError(f"{folder} cannot be made: {error.strerror}") from None


@dataclass
class _Runs:
    """Solves studies of further cells, each into its file in a folder, or in memory."""

    folder: Path | None
    workers: int | None

    def __call__(self, further: Study) -> xr.Dataset:
        from sweep.cells.fingerprint import fingerprint
        from sweep.runs.run import run

        if self.folder is None:
            return run(further, workers=self.workers, progress=False)
        mark = hashlib.sha256(repr(sorted(fingerprint(further).items())).encode()).hexdigest()[:16]
        with run(further, self.folder / f"{mark}.h5", workers=self.workers) as found:
            return found.load()


def study_of(dataset: xr.Dataset, allow_import: bool = False) -> Study:
    """The study that a result came from. Raises SweepError."""
    if "study_json" not in dataset.attrs:
        raise SweepError("the dataset does not say which study it came from; pass the study")
    return Study.from_json(str(dataset.attrs["study_json"]), allow_import=allow_import)


def _require(dataset: xr.Dataset, study: Study, names: Sequence[str], tolerance: float) -> None:
    if not 0 < tolerance < 1:
        raise SweepError(f"tolerance: expected a number between 0 and 1, found {tolerance}")
    if STATUS not in dataset:
        raise SweepError("a summary keeps no cells; refine a result that has them")
    if study.design != "product" or any(axis.words is not None for axis in study.axes.values()):
        raise SweepError("only a product of number axes can be refined")
    if any(len(axis) < 2 or (np.diff(axis.values) <= 0).any() for axis in study.axes.values()):
        raise SweepError("an axis to be refined needs at least two values, in rising order")
    for name in names:
        if name not in dataset or dataset[name].dims != dataset[STATUS].dims:
            raise SweepError(f"{name}: is no output of one value a cell")
    if bool((dataset[STATUS] == Status.PENDING).any()):
        raise SweepError("the sweep is not finished; run it to its end first")


class _Refiner:
    def __init__(
        self,
        dataset: xr.Dataset,
        study: Study,
        names: Sequence[str],
        tolerance: float,
        run: Callable[[Study], xr.Dataset],
        most_cells: int,
        path: str | os.PathLike[str] | None,
        force: bool,
    ) -> None:
        self.path, self.force = path, force
        self.study, self.names, self.tolerance, self.run, self.most = study, names, tolerance, run, most_cells
        self.axes = [axis.values for axis in study.axes.values()]
        self.logarithmic = [is_logarithmic(values) for values in self.axes]
        self.first = dataset.load()
        self.parts: list[xr.Dataset] = []
        self.known: dict[Index, int] = {}
        """Rows of the cells solved, those of the first grid before the others."""
        self.kept: set[int] = set()
        self.values: list[Array] = []
        self.size = np.array([float(abs(self.first[name]).max()) or 1.0 for name in names])
        self.error, self.deepest = 0.0, 0
        self.complete = True

    def refined(self) -> Refinement:
        """Boxes of one level at a time, coarse ones first."""
        steps = [range(len(values)) for values in self.axes]
        unit = 2**LEVELS
        self._learn([tuple(i * unit for i in index) for index in itertools.product(*steps)], _flat(self.first))
        self.kept.update(self.known.values())
        boxes = [tuple(i * unit for i in index) for index in itertools.product(*(range(len(s) - 1) for s in steps))]
        left = 0.0
        for level in range(LEVELS):
            half = 2 ** (LEVELS - level - 1)
            wanted = {p for box in boxes for p in self._points(box, half)} - self.known.keys()
            if len(self.known) + len(wanted) > self.most:
                self.complete = False
                break
            self._solve(sorted(wanted))
            off = {box: self._off(box, half) for box in boxes}
            self.error = max([self.error, *(e for e in off.values() if e <= self.tolerance)])
            left = max((e for e in off.values() if math.inf > e > self.tolerance), default=0.0)
            cut = [box for box in boxes if off[box] > self.tolerance]
            self.kept.update(self.known[p] for box in cut for p in self._points(box, half))
            boxes = [part for box in cut for part in _parts(box, half)]
            if level >= BORDER_LEVELS:
                boxes = [box for box in boxes if self._of_one_status(box, half)]
            if not boxes:
                break
            self.deepest = level + 1
        else:
            self.complete = not boxes
        self.error = max(self.error, 0.0 if self.complete else left)
        return self._joined()

    def _points(self, corner: Index, half: int) -> list[Index]:
        """Corners and middles of a box, 3^D of them in C order."""
        return list(itertools.product(*((i, i + half, i + 2 * half) for i in corner)))

    def _of_one_status(self, corner: Index, side: int) -> bool:
        """Whether a box has the same status in all its corners; no border is known to pass through it."""
        corners = itertools.product(*((i, i + side) for i in corner))
        return len({self.values[self.known[p]][0] for p in corners}) == 1

    def _off(self, corner: Index, half: int) -> float:
        """How far a middle of the box is off the interpolation from its corners, infinite if it has another status."""
        rows = np.array([self.values[self.known[p]] for p in self._points(corner, half)])
        rows = rows.reshape(*[3] * len(corner), -1)
        if (rows[..., 0] != rows[..., 0].flat[0]).any():
            return math.inf
        if rows[..., 0].flat[0] >= FIRST_REFUSAL:
            return 0.0
        values = rows[..., 1:] / self.size
        positive = (values > 0).all(axis=tuple(range(len(corner))))
        values[..., positive] = np.log(rows[..., 1:][..., positive])
        return float(np.nanmax(abs(values - _multilinear(values)), initial=0.0))

    def _solve(self, points: list[Index]) -> None:
        if not points:
            return
        columns = [self._values(k, np.array([p[k] for p in points])) for k in range(len(self.axes))]
        axes = {
            name: Axis(name, frozen(column), "values") for name, column in zip(self.study.axes, columns, strict=True)
        }
        further = dataclasses.replace(self.study, design="zip", axes=axes, title=_title(self.study))
        found = self.run(further)
        self.parts.append(found)
        self._learn(points, found)

    def _values(self, k: int, places: NDArray[np.int64]) -> Array:
        """Axis values at places in the grid; those of the first grid exactly."""
        grid, unit = self.axes[k], 2**LEVELS
        low = np.minimum(places // unit, len(grid) - 2)
        share = (places - low * unit) / unit
        found: Array
        if not self.logarithmic[k]:
            found = np.where(share == 1, grid[low + 1], grid[low] + share * (grid[low + 1] - grid[low]))
            return found
        between = np.exp((1 - share) * np.log(grid[low]) + share * np.log(grid[low + 1]))
        found = np.where(share == 0, grid[low], np.where(share == 1, grid[low + 1], between))
        return found

    def _learn(self, points: Sequence[Index], solved: xr.Dataset) -> None:
        columns = [solved[STATUS].values.ravel().astype(float), *(solved[name].values.ravel() for name in self.names)]
        rows = np.stack(columns, axis=1)
        for point, row in zip(points, rows, strict=True):
            self.known[point] = len(self.values)
            self.values.append(row)

    def _joined(self) -> Refinement:
        from sweep.results.open import in_memory
        from sweep.runs.run import store_cells

        parts, rows = [_flat(self.first), *self.parts], sorted(self.kept)
        names = list(self.study.axes)
        axes = {n: Axis(n, frozen(np.concatenate([p[n].values for p in parts])[rows]), "values") for n in names}
        whole = dataclasses.replace(self.study, design="zip", axes=axes, title=_title(self.study))
        columns = [*self.study.outputs, *ANCILLARY]
        arrays = {name: np.concatenate([part[name].values for part in parts])[rows] for name in columns}
        dataset = (
            store_cells(whole, self.path, arrays, self.force)
            if self.path
            else in_memory(cell_schema(whole, {}), arrays)
        )
        finest = [(len(values) - 1) * 2**self.deepest + 1 for values in self.axes]
        uniform = int(np.prod([float(n) for n in finest]))
        first = self.first[STATUS].size
        return Refinement(dataset, len(rows) - first, len(self.values) - first, uniform, self.error, self.complete)


def _flat(dataset: xr.Dataset) -> xr.Dataset:
    return dataset.stack(cell=list(dataset[STATUS].dims), create_index=False)


def _parts(corner: Index, half: int) -> list[Index]:
    return list(itertools.product(*((i, i + half) for i in corner)))


def _multilinear(rows: NDArray[Any]) -> NDArray[Any]:
    """Corners of a box (3, 3, ..., columns) interpolated to its middles."""
    found = rows.copy()
    for axis in range(rows.ndim - 1):
        along = np.moveaxis(found, axis, 0)
        along[1] = (along[0] + along[2]) / 2
    return found
