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
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernels.interface import FIRST_REFUSAL, Status
from sweep.analysis.mesh import Array, Indices, edges, interpolation_errors, simplices
from sweep.analysis.metric import stretch
from sweep.analysis.scattered import MOST_AXES, Box, axes_of, heights
from sweep.cells.schema import ANCILLARY, STATUS, cell_schema
from sweep.study.model import Axis, Study, frozen
from sweep.system import disk
from sweep.system.errors import SweepError
from sweep.system.expected import require_dataset
from sweep.system.overwriting import check_target

if TYPE_CHECKING:
    import xarray as xr

LEVELS = {1: 20, 2: 10, 3: 6}
"""How often a step of the first grid may be cut in two, by number of axes; a jump cannot be interpolated."""
FEWEST_LEVELS = 4
BORDER_LEVELS = {1: 10, 2: 5, 3: 3}
"""How often, because a border between statuses passes through it; no value is right inside the last."""
MOST_CELLS = 1_000_000
SAME = 2.0**-40
"""Distance of places along an axis, from 0 to 1, that are the same."""


@dataclass(frozen=True)
class Refinement:
    """What came of it.

    Attributes
    ----------
    dataset : Dataset
        All cells, the first ones and those added, in rising order: along the axis, or of several along `cell`.
    added : int
        Cells beyond the first ones.
    uniform : int
        Cells of an even grid as fine as the finest step.
    error : float
        Largest error left of straight lines between cells, relative, as the cells around tell it; not beside borders
        of statuses, nor in `jumps`.
    tolerance : float
    complete : bool
        Whether the tolerance is met; not so where `most_cells` ran out or an output jumps.
    jumps : int
        Places where the tolerance is not met although edges are cut as often as is allowed.
    unseen : dict of str to str
        How far apart cells are along each axis, at most: nothing tells of a peak narrower than that.
    """

    dataset: xr.Dataset
    added: int
    uniform: int
    error: float
    tolerance: float
    complete: bool
    jumps: int
    unseen: dict[str, str]

    def __str__(self) -> str:
        cells = self.dataset[STATUS].size
        text = f"{cells:,} cells, {self.added:,} of them added; an even grid as fine has {self.uniform:,}"
        text += f"\ninterpolation error left: {self.error:.2g}, as the cells around tell"
        if self.error > self.tolerance:
            text += "; the tolerance is not met everywhere, allow more cells"
        if self.jumps:
            text += f"; not in {self.jumps:,} place{'s' * (self.jumps > 1)} where it jumps or diverges"
        apart = ", ".join(f"{width} in {name}" for name, width in self.unseen.items())
        return f"{text}\ncells are up to {apart} apart; a peak narrower than that is not seen"


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
    study = study or study_of(dataset)
    names = [y] if isinstance(y, str) else list(y)
    _require(dataset, study, names, tolerance)
    options = {"workers": workers, "isolate": isolate, "cell_timeout": cell_timeout}
    output = _Output(study, None if path is None else disk.as_path(path), force, options)
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
            return run(further, progress=False, **self.options)
        name = hashlib.sha256(repr(sorted(fingerprint(further).items())).encode()).hexdigest()[:16]
        with run(further, self.rounds / f"{name}.h5", **self.options) as found:
            return found.load()

    def written(self, axes: dict[str, Axis], arrays: dict[str, Any]) -> xr.Dataset:
        """All cells, with these values of the axes, outputs and statuses."""
        from sweep.results.open import in_memory
        from sweep.runs.run import store_cells

        whole = dataclasses.replace(self._study(axes), design="product" if len(axes) == 1 else "zip")
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
    require_dataset("study_of", dataset)
    if "study_json" not in dataset.attrs:
        raise SweepError("the dataset does not say which study it came from; pass the study")
    return Study.from_json(str(dataset.attrs["study_json"]), allow_import=allow_import)


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


class Refiner:
    """Cells joined to simplices, whose edges are cut until outputs can be interpolated."""

    def __init__(
        self, dataset: xr.Dataset, output: _Output, names: Sequence[str], tolerance: float, most_cells: int
    ) -> None:
        self.output, self.names, self.tolerance, self.most = output, names, tolerance, most_cells
        self.parts = [_flat(dataset.load())]
        self.axes = list(output.study.axes)
        first = {name: self.parts[0][name].values for name in self.axes}
        self.box = Box.of(first)
        self.values = np.stack(list(first.values()), axis=1)
        self.points = self.box.points(first)
        self.known = [dict(zip(_keys(t), v, strict=True)) for t, v in zip(self.points.T, self.values.T, strict=True)]
        self.first = len(self.points)
        product = output.study.design == "product"
        self.steps = np.array([len(k) - 1 if product else self.first ** (1 / len(self.axes)) for k in self.known])

    def refined(self) -> Refinement:
        """Rounds of cuts, each of edges that share no end."""
        self._give_every_axis_a_middle()
        while True:
            found = self._judged()
            cuts = self._cuts(found)[: max(0, self.most - len(self.points))]
            if not len(cuts):
                return self._joined(found, complete=not (found.size > self.tolerance).any())
            self._solve(*self._middles(cuts))

    def _give_every_axis_a_middle(self) -> None:
        """Between two values nothing tells whether an output bends."""
        for k, known in enumerate(self.known):
            if len(known) == 2:
                points = self.points[self.points[:, k] == 0]
                values = self.values[self.points[:, k] == 0]
                points[:, k], values[:, k] = 0.5, self.box.values(k, np.array([0.5]))
                self._solve(points, values)

    def _judged(self) -> _Judged:
        """Errors over the simplices of each output, and borders between statuses that are to be cut."""
        kind = self._kinds()
        found = [self._judged_output(kind, heights(self._column(name))) for name in self.names]
        return _Judged(*(np.concatenate(columns) for columns in zip(*found, strict=True)))

    def _judged_output(self, kind: Indices, height: Array) -> _Judged:
        """Errors over the simplices that have one status, in the box stretched to where the output bends."""
        points = self.points @ stretch(self.points, height)
        corners = simplices(points)
        kinds = kind[corners]
        alike = (kinds == kinds[:, :1]).all(axis=1)
        size = np.zeros(len(corners))
        ends = corners[:, :2].copy()
        for number in np.unique(kind[kind >= 0]):
            members, here = np.flatnonzero(kind == number), np.flatnonzero(alike & (kinds[:, 0] == number))
            renumbered = np.searchsorted(members, corners[here])
            errors = interpolation_errors(points[members], height[members, None], renumbered)
            size[here] = errors.size
            ends[here, 0] = corners[here, errors.first]
            ends[here, 1] = corners[here, errors.second]
        mixed = np.flatnonzero(~alike & (kinds >= 0).any(axis=1))
        size[mixed], ends[mixed] = self._borders(corners[mixed], kinds[mixed])
        finest = self._extent(ends) <= 2.0 ** -LEVELS.get(len(self.axes), FEWEST_LEVELS)
        return _Judged(corners, size, ends, finest, alike & (kinds[:, 0] >= 0))

    def _borders(self, corners: Indices, kinds: Indices) -> tuple[Array, Indices]:
        """Infinite where a border between statuses has longer edges than are left there; and these edges."""
        pairs = edges(len(self.axes))
        ends = corners[:, pairs]
        length = np.where(kinds[:, pairs[:, 0]] != kinds[:, pairs[:, 1]], self._extent(ends), -1.0)
        longest = length.argmax(axis=1)[:, None]
        wide = np.take_along_axis(length, longest, 1)[:, 0] > 2.0 ** -BORDER_LEVELS.get(len(self.axes), 2)
        return np.where(wide, math.inf, 0.0), np.take_along_axis(ends, longest[:, :, None], 1)[:, 0]

    def _extent(self, ends: Indices) -> Array:
        """Of edges (..., 2), in steps of the first grid along the axis where they are longest."""
        apart = abs(self.points[ends[..., 0]] - self.points[ends[..., 1]]) * self.steps
        found: Array = apart.max(axis=-1)
        return found

    def _kinds(self) -> Indices:
        """Statuses, with those that rounding decides alike; -1 without a value."""
        status = self._column(STATUS).astype(np.intp)
        finite = np.isfinite(np.stack([self._column(name) for name in self.names])).all(axis=0)
        kind = np.where(status == Status.INACCURATE, int(Status.OK), status)
        return np.where((status < FIRST_REFUSAL) & finite, kind, -1)

    def _column(self, name: str) -> Any:
        return np.concatenate([part[name].values for part in self.parts])

    def _cuts(self, found: _Judged) -> Indices:
        """Edges to cut, worst first; none shares an end with one before, for a cut changes what is known there."""
        wanted = np.flatnonzero((found.size > self.tolerance) & ~found.finest)
        used = np.zeros(len(self.points), dtype=bool)
        cuts = []
        for first, second in found.ends[wanted[np.argsort(-found.size[wanted], kind="stable")]].tolist():
            if not (used[first] or used[second]):
                used[first] = used[second] = True
                cuts.append((first, second))
        return np.array(cuts, dtype=np.intp).reshape(-1, 2)

    def _middles(self, cuts: Indices) -> tuple[Array, Array]:
        """Places and axis values in the middles of edges; a value that an axis has already is taken again."""
        points = self.points[cuts].mean(axis=1)
        values = np.empty(points.shape)
        for k, known in enumerate(self.known):
            between = self.box.values(k, points[:, k])
            values[:, k] = [known.setdefault(t, v) for t, v in zip(_keys(points[:, k]), between, strict=True)]
        return points, values

    def _solve(self, points: Array, values: Array) -> None:
        axes = {name: Axis(name, frozen(column), "values") for name, column in zip(self.axes, values.T, strict=True)}
        self.parts.append(_flat(self.output.solved(axes)))
        self.points, self.values = np.concatenate([self.points, points]), np.concatenate([self.values, values])

    def _joined(self, found: _Judged, complete: bool) -> Refinement:
        order = np.lexsort(self.values.T[::-1])
        axes = {
            name: Axis(name, frozen(column[order]), "values")
            for name, column in zip(self.axes, self.values.T, strict=True)
        }
        arrays = {name: self._column(name)[order] for name in (*self.output.study.outputs, *ANCILLARY)}
        jumps = found.valued & found.finest & (found.size > self.tolerance)
        finest = [np.diff(np.unique(t)) for t in self.points.T]
        return Refinement(
            dataset=self.output.written(axes, arrays),
            added=len(self.points) - self.first,
            uniform=int(math.prod(round(1 / step[step > SAME].min()) + 1 for step in finest)),
            error=float(found.size[found.valued & ~jumps].max(initial=0.0)),
            tolerance=self.tolerance,
            complete=complete,
            jumps=int(jumps.sum()),
            unseen=self._widest(found.corners[found.valued]),
        )

    def _widest(self, corners: Indices) -> dict[str, str]:
        """How far cells are apart, at most, along each axis; a factor where it is taken in logarithms."""
        width = np.ptp(self.points[corners], axis=1).max(axis=0, initial=0.0)
        ratio, span = (
            (self.box.high / np.where(self.box.logarithmic, self.box.low, 1.0)) ** width,
            self.box.high - self.box.low,
        )
        return {
            name: f"a factor {ratio[k]:.3g}" if self.box.logarithmic[k] else f"{width[k] * span[k]:.3g}"
            for k, name in enumerate(self.axes)
        }


class _Judged(NamedTuple):
    """Simplices: their corners, errors, the edges (m, 2) to cut, whether these are the finest allowed, whether all
    corners have values and one status."""

    corners: Indices
    size: Array
    ends: Indices
    finest: NDArray[np.bool_]
    valued: NDArray[np.bool_]


def _keys(places: Array) -> list[float]:
    """Places along an axis, alike where rounding alone tells them apart."""
    found: list[float] = np.round(places / SAME).tolist()
    return found


def _flat(dataset: xr.Dataset) -> xr.Dataset:
    return dataset if dataset[STATUS].ndim == 1 else dataset.stack(cell=list(dataset[STATUS].dims), create_index=False)
