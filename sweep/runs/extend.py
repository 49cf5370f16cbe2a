"""Extending a finished result: a study with more values on its axes takes the cells it shares over, bit for bit.

A result that another version of foliot or of the compiler has computed is taken over where a sample of its cells, some
of every status and method, comes out with the same bits again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from kernels.interface import Status
from sweep.cells.block import block_solver
from sweep.cells.fingerprint import is_of_program
from sweep.cells.grid import Grid
from sweep.cells.partition import box_slices
from sweep.cells.schema import METHOD_USED, STATUS, Column, columns
from sweep.errors import SweepError
from sweep.file.layout import DAMAGE
from sweep.file.open import unreadable
from sweep.file.reading import StoredFile
from sweep.results.statuses import flat_pieces
from sweep.study.model import Axis, Study

SAMPLE = 8
"""Cells of every status and method that are computed again where another version has computed the result."""
TAKEN_OVER = "taken_over"
"""Attribute of a result that says which of its cells another version has computed."""


def obstacle(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Why a result of one fingerprint cannot be extended to that of another, in a word; "" where it may be."""
    changed = _changed(old, new)
    others = sorted(name for name in changed if not name.startswith("axes.") and not is_of_program(name))
    if others:
        return f"{others[0]} differs, too"
    if new.get("design") != "product":
        return 'its design is not "product"'
    if "summary.over" in new:
        return "it holds a summary, not cells"
    return "" if changed else "nothing differs but words"


def is_of_another_version(old: Mapping[str, str], new: Mapping[str, str]) -> bool:
    """Whether the program differs that two fingerprints tell of."""
    return any(map(is_of_program, _changed(old, new)))


def _changed(old: Mapping[str, str], new: Mapping[str, str]) -> set[str]:
    return {name for name in {*old, *new} if old.get(name) != new.get(name)} - {"study"}


class Reused:
    """The cells of a finished result, in the grid of an extended study.

    Parameters
    ----------
    output : Path
        The finished result.
    study : Study
        Whose axes have all values of the result's, in the same order, and more.
    retry : bool
        It is the same study, and cells that FAILED are computed again.

    Raises
    ------
    SweepError
        The result cannot be read, or an axis lacks some of its values.
    """

    def __init__(self, output: Path, study: Study, retry: bool = False) -> None:
        self._output, self._study, self._grid, self._retry = output, study, Grid(study), retry
        self._columns: tuple[Column, ...] = columns(study)
        try:
            self._stored = StoredFile(output)
            old = Study.from_json(self._stored.attrs["study_json"], declared=True)
            self.taken_over = str(self._stored.attrs.get(TAKEN_OVER, ""))
        except DAMAGE as fault:
            raise unreadable(output, fault) from None
        self._numbers: dict[str, Any] = dict(self._stored.columns())
        self._positions = [_positions(old.axes[name], axis) for name, axis in study.axes.items()]

    @property
    def attrs(self) -> dict[str, str]:
        """Further attributes of what is extended."""
        return {TAKEN_OVER: self.taken_over} if self.taken_over else {}

    def close(self) -> None:
        """Gives the file back."""
        self._stored.close()

    def missing(self, start: int, stop: int) -> Any:
        """Of the cells `start` to `stop`, which have to be computed."""
        return ~self._known(start, stop)[1]

    def fill(self, start: int, stop: int, arrays: Mapping[str, Any]) -> None:
        """Writes the known ones among the cells `start` to `stop`. Raises SweepError where the file fails."""
        shared, known = self._known(start, stop)
        if not known.any():
            return
        # values of the result that are neighbours there have none of its values between them here
        parts = [p[s] for p, s in zip(self._positions, box_slices(self._grid.shape, start, stop), strict=True)]
        old = tuple(slice(int(part[part >= 0].min()), int(part.max()) + 1) for part in parts)
        for column in self._columns:
            values = self.values(column.name, old)
            arrays[column.name][known] = values.reshape(-1, *column.shape)[known[shared]]

    def _known(self, start: int, stop: int) -> tuple[Any, Any]:
        """Which of some cells the result has; and which of these did not FAIL, where those are computed again."""
        box = box_slices(self._grid.shape, start, stop)
        axes = [positions[s] >= 0 for positions, s in zip(self._positions, box, strict=True)]
        shared = reduce(np.logical_and.outer, axes).ravel()
        return shared, shared & np.ravel(self.values(STATUS, box) != Status.FAILED) if self._retry else shared

    def values(self, name: str, slices: tuple[slice, ...]) -> Any:
        """Those of a piece of the result. Raises SweepError where the file fails."""
        try:
            return self._numbers[name][slices]
        except DAMAGE as fault:
            raise unreadable(self._output, fault) from None

    def check_sample(self) -> None:
        """Computes some cells of every status and method again. Raises SweepError where one has other bits now."""
        solve, cells = block_solver(self._study), self._sample()
        for cell in cells:
            old, new = ({c.name: c.empty(1) for c in self._columns} for _ in range(2))
            self.fill(cell, cell + 1, old)
            solve(cell, cell + 1, new, None)
            for name in old:
                if old[name].tobytes() != new[name].tobytes():
                    raise SweepError(
                        f"{self._output}: cannot be extended, for another version has computed it: {name} of a cell "
                        f"was {old[name][0]}, and comes out as {new[name][0]} now; choose another name, or overwrite "
                        "it with --force"
                    )
        known = math.prod(int((positions >= 0).sum()) for positions in self._positions)
        said = f"{known} cells of another version, {len(cells)} of which came out with the same bits again"
        self.taken_over = "\n".join(filter(None, [self.taken_over, said]))

    def _sample(self) -> list[int]:
        """Some cells of every status and method, by their numbers in the grid of the extended study."""
        kinds: dict[tuple[int, int], list[Any]] = {}
        done = 0
        for status, used in zip(*(flat_pieces(self._numbers[name]) for name in (STATUS, METHOD_USED)), strict=True):
            for kind in np.unique(np.stack([status, used]), axis=1).T.tolist():
                cells = np.flatnonzero((status == kind[0]) & (used == kind[1]))
                kinds.setdefault((kind[0], kind[1]), []).append(done + _spread(cells))
            done += len(status)
        chosen = np.concatenate([_spread(np.concatenate(cells)) for cells in kinds.values()])
        places = np.unravel_index(chosen, self._numbers[STATUS].shape)
        # the old values keep their order among the new ones
        new = [np.flatnonzero(p >= 0)[place] for p, place in zip(self._positions, places, strict=True)]
        return list(map(int, np.ravel_multi_index(new, self._grid.shape)))


def has_failed(output: Path) -> bool:
    """Whether a cell of a finished result FAILED. Raises SweepError where it keeps no cells."""
    with StoredFile(output) as file:
        columns = file.columns()
        if STATUS not in columns:
            raise SweepError(f"{output}: a summary does not keep the cells that FAILED; compute it anew with --force")
        return any((piece == Status.FAILED).any() for piece in flat_pieces(columns[STATUS]))


class Precomputed:
    """All cells of a study, solved before: what `Reused` is, without a file to look them up in.

    Parameters
    ----------
    arrays : mapping of outputs and of `schema.ANCILLARY` to ndarray, shape (cells, ...)
    attrs : mapping
        Further attributes of the file.
    """

    def __init__(self, arrays: Mapping[str, Any], attrs: Mapping[str, str]) -> None:
        self._arrays, self.attrs = arrays, attrs

    def missing(self, start: int, stop: int) -> Any:
        return np.zeros(stop - start, bool)

    def fill(self, start: int, stop: int, arrays: Mapping[str, Any]) -> None:
        for name, values in self._arrays.items():
            arrays[name][...] = values[start:stop]


def _spread(cells: Any) -> Any:
    """No more than `SAMPLE` of some cells, evenly spread among them."""
    return cells[np.unique(np.linspace(0, len(cells) - 1, min(SAMPLE, len(cells))).astype(np.intp))]


def _positions(old: Axis, new: Axis) -> Any:
    """For every value of an axis its position among the old ones, -1 where it is new."""
    places = {_exactly(value): place for place, value in enumerate(new.values.tolist())}
    found = np.array([places.get(_exactly(value), -1) for value in old.values.tolist()])
    lost = np.flatnonzero(found < 0)
    if len(lost):
        raise SweepError(
            f"axes.{new.name}: {len(lost)} of its {len(old)} values so far are not among the new ones, e.g. "
            f"{old.label(int(lost[0]))} is not; extended, an axis keeps every value to the last digit"
        )
    if (np.diff(found) <= 0).any():
        raise SweepError(f"axes.{new.name}: its values so far stand in another order now; keep their order")
    positions = np.full(len(new), -1)
    positions[found] = np.arange(len(old))
    return positions


def _exactly(value: float) -> str:
    """A value to the last digit and the sign of its zero, which numbers that are equal may differ in."""
    return float(value).hex()
