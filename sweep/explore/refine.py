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
from collections.abc import Sequence
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
from sweep.system.overwriting import check_target

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
        text = f"{cells:,} cells, {self.added:,} of them added, {self.tried:,} tried; an even grid as fine has "
        text += f"{self.uniform:,}\nlargest interpolation error left: {self.error:.2g}"
        if not self.complete:
            text += "; not all boxes meet the tolerance, allow more cells, or leave out where it diverges"
        return text


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

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(0.1, 10.0, 5)})
    >>> sweep.refine(ds, "period", 1e-3).complete
    True
    """
    study = study or study_of(dataset)
    names = [y] if isinstance(y, str) else list(y)
    _require(dataset, study, names, tolerance)
    output = _Output(study, None if path is None else Path(path), force, workers)
    output.prepare(dataset)
    found = _Refiner(dataset, output, names, tolerance, most_cells).refined()
    output.tidy()
    return found


@dataclass(frozen=True)
class _Output:
    """Solves further cells of a study, each round into a file in a folder, and writes all cells at the end.

    `path`: None: everything stays in memory.
    """

    study: Study
    path: Path | None
    force: bool
    workers: int | None

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
            raise SweepError(f"{self.rounds} cannot be made: {error.strerror}") from None

    def _check_earlier(self, path: Path) -> None:
        from sweep.results.open import open_result

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
            return run(further, workers=self.workers, progress=False)
        name = hashlib.sha256(repr(sorted(fingerprint(further).items())).encode()).hexdigest()[:16]
        with run(further, self.rounds / f"{name}.h5", workers=self.workers) as found:
            return found.load()

    def written(self, axes: dict[str, Axis], arrays: dict[str, Any]) -> xr.Dataset:
        """All cells, with these values of the axes, outputs and statuses."""
        from sweep.results.open import in_memory
        from sweep.runs.run import store_cells

        whole = self._study(axes)
        if self.path is None:
            return in_memory(cell_schema(whole, {}), arrays)
        return store_cells(whole, self.path, arrays, self.force)

    def _study(self, axes: dict[str, Axis]) -> Study:
        return dataclasses.replace(self.study, design="zip", blocks=(), axes=axes, title=self.title)

    def tidy(self) -> None:
        """Removes what was computed on the way."""
        if self.rounds is not None:
            shutil.rmtree(self.rounds, ignore_errors=True)


def study_of(dataset: xr.Dataset, allow_import: bool = False) -> Study:
    """The study that a result came from. Raises SweepError.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.study_of(ds)
    <Study 'foliot over mu': foliot over mu (3)>
    """
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
    """Boxes of a grid, tried and cut until outputs can be interpolated in them."""

    def __init__(
        self, dataset: xr.Dataset, output: _Output, names: Sequence[str], tolerance: float, most_cells: int
    ) -> None:
        self.output, self.names, self.tolerance, self.most = output, names, tolerance, most_cells
        self.axes = {name: axis.values for name, axis in output.study.axes.items()}
        self.logarithmic = {name: is_logarithmic(values) for name, values in self.axes.items()}
        self.first = dataset.load()
        self.parts: list[xr.Dataset] = []
        self.rows: dict[Index, int] = {}
        """Rows of the cells solved, those of the first grid before the others."""
        self.kept: set[int] = set()
        self.values: list[Array] = []
        self.size = np.array([float(abs(self.first[name]).max()) or 1.0 for name in names])
        self.error, self.left, self.deepest = 0.0, 0.0, 0

    def refined(self) -> Refinement:
        """Boxes of one level at a time, coarse ones first."""
        self._learn(self._corners(0), _flat(self.first))
        self.kept.update(self.rows.values())
        boxes = self._corners(1)
        for level in range(LEVELS):
            half = 2 ** (LEVELS - level - 1)
            if not boxes or not self._try(boxes, half):
                break
            boxes = self._cut(boxes, half)
            if level >= BORDER_LEVELS:
                boxes = [box for box in boxes if self._of_one_status(box, half)]
            self.deepest = level + bool(boxes)
        return self._joined(complete=not boxes)

    def _corners(self, less: int) -> list[Index]:
        """Places of the first grid's cells, without the last `less` of every axis."""
        places = (range(len(values) - less) for values in self.axes.values())
        return [tuple(i * 2**LEVELS for i in index) for index in itertools.product(*places)]

    def _try(self, boxes: Sequence[Index], half: int) -> bool:
        """Solves the middles of boxes; False where that would be too many cells."""
        wanted = {p for box in boxes for p in self._points(box, half)} - self.rows.keys()
        if len(self.rows) + len(wanted) > self.most:
            return False
        self._solve(sorted(wanted))
        return True

    def _cut(self, boxes: Sequence[Index], half: int) -> list[Index]:
        """The parts of boxes that are off by more than the tolerance."""
        off = {box: self._off(box, half) for box in boxes}
        self.error = max([self.error, *(e for e in off.values() if e <= self.tolerance)])
        self.left = max((e for e in off.values() if math.inf > e > self.tolerance), default=0.0)
        cut = [box for box in boxes if off[box] > self.tolerance]
        self.kept.update(self.rows[p] for box in cut for p in self._points(box, half))
        return [part for box in cut for part in _parts(box, half)]

    def _points(self, corner: Index, half: int) -> list[Index]:
        """Corners and middles of a box, 3^D of them in C order."""
        return list(itertools.product(*((i, i + half, i + 2 * half) for i in corner)))

    def _of_one_status(self, corner: Index, side: int) -> bool:
        """Whether a box has the same status in all its corners; no border is known to pass through it."""
        corners = itertools.product(*((i, i + side) for i in corner))
        return len({self.values[self.rows[p]][0] for p in corners}) == 1

    def _off(self, corner: Index, half: int) -> float:
        """How far a middle of the box is off the interpolation from its corners, infinite if it has another status."""
        rows = np.array([self.values[self.rows[p]] for p in self._points(corner, half)])
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
        places = zip(self.axes, np.array(points).T, strict=True)
        axes = {name: Axis(name, frozen(self._values(name, column)), "values") for name, column in places}
        found = self.output.solved(axes)
        self.parts.append(found)
        self._learn(points, found)

    def _values(self, name: str, places: NDArray[np.int64]) -> Array:
        """Axis values at places in the grid; those of the first grid exactly."""
        grid, unit = self.axes[name], 2**LEVELS
        low = np.minimum(places // unit, len(grid) - 2)
        share = (places - low * unit) / unit
        if self.logarithmic[name]:
            between = np.exp((1 - share) * np.log(grid[low]) + share * np.log(grid[low + 1]))
        else:
            between = grid[low] + share * (grid[low + 1] - grid[low])
        found: Array = np.where(share == 0, grid[low], np.where(share == 1, grid[low + 1], between))
        return found

    def _learn(self, points: Sequence[Index], solved: xr.Dataset) -> None:
        columns = [solved[STATUS].values.ravel().astype(float), *(solved[name].values.ravel() for name in self.names)]
        rows = np.stack(columns, axis=1)
        for point, row in zip(points, rows, strict=True):
            self.rows[point] = len(self.values)
            self.values.append(row)

    def _joined(self, complete: bool) -> Refinement:
        parts, rows = [_flat(self.first), *self.parts], sorted(self.kept)

        def joined(name: str) -> Any:
            return np.concatenate([part[name].values for part in parts])[rows]

        axes = {name: Axis(name, frozen(joined(name)), "values") for name in self.axes}
        arrays = {name: joined(name) for name in (*self.output.study.outputs, *ANCILLARY)}
        finest = math.prod(float((len(values) - 1) * 2**self.deepest + 1) for values in self.axes.values())
        first = self.first[STATUS].size
        return Refinement(
            dataset=self.output.written(axes, arrays),
            added=len(rows) - first,
            tried=len(self.values) - first,
            uniform=int(finest),
            error=self.error if complete else max(self.error, self.left),
            complete=complete,
        )


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
