"""Extends a finished result: a study with more values on its axes reuses the common cells, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from kernels.interface import Status
from sweep.cells.grid import Grid
from sweep.cells.partition import box_slices
from sweep.cells.schema import STATUS
from sweep.errors import SweepError
from sweep.file.reading import StoredFile
from sweep.results.statuses import flat_pieces
from sweep.study.model import Axis, Study


def obstacle(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Why a result of one fingerprint cannot be extended to that of another, in a word; "" where it may be."""
    changed = {name for name in {*old, *new} - {"study"} if old.get(name) != new.get(name)}
    if others := sorted(name for name in changed if not name.startswith("axes.")):
        return f"{others[0]} differs, too"
    if new.get("design") != "product":
        return 'its design is not "product"'
    if "summary.over" in new:
        return "it holds a summary, not cells"
    return "" if changed else "nothing differs but words"


def has_failed(file: StoredFile) -> bool:
    """Whether a cell of a finished result FAILED. Raises SweepError where it keeps no cells."""
    if STATUS not in (columns := file.tables["cells"].columns):
        raise SweepError(f"{file.path}: a summary does not keep the cells that FAILED; compute it anew with --force")
    return any((piece == Status.FAILED).any() for piece in flat_pieces(columns[STATUS]))


class Reused(StoredFile):
    """The cells of a finished result, in the grid of a study whose axes have all its values, in order, and more.

    To `retry`, it is the same study, and cells that FAILED are not known. Raises SweepError where the result cannot be
    read, or an axis lacks some of its values.
    """

    def __init__(self, output: Path, study: Study, retry: bool = False) -> None:
        super().__init__(output)
        self._shape, self._retry, old = Grid(study).shape, retry, self.study
        self._positions = [_positions(old.axes[name], axis) for name, axis in study.axes.items()]

    def wanted(self, start: int, stop: int) -> Any:
        """Of the cells `start` to `stop`, which have to be computed."""
        return ~self._known(start, stop)[1]

    def filled(self, start: int, stop: int, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        """The cells `start` to `stop`, with the known ones among them. Raises SweepError where the file fails."""
        shared, known = self._known(start, stop)
        if not known.any():
            return arrays
        # what came from elsewhere may be read only
        arrays = {name: column if column.flags.writeable else column.copy() for name, column in arrays.items()}
        # values of the result that are neighbours there have none of its values between them here
        parts = [p[s] for p, s in zip(self._positions, box_slices(self._shape, start, stop), strict=True)]
        old = tuple(slice(int(part[part >= 0].min()), int(part.max()) + 1) for part in parts)
        for name, column in self.tables["cells"].columns.items():
            arrays[name][known] = column[old].reshape(-1, *column.own)[known[shared]]
        return arrays

    def _known(self, start: int, stop: int) -> tuple[Any, Any]:
        """Which of some cells the result has; and which of these did not FAIL, where those are computed again."""
        box = box_slices(self._shape, start, stop)
        axes = [positions[s] >= 0 for positions, s in zip(self._positions, box, strict=True)]
        shared = reduce(np.logical_and.outer, axes).ravel()
        return shared, shared & np.ravel(self[STATUS][box] != Status.FAILED) if self._retry else shared


def _positions(old: Axis, new: Axis) -> Any:
    """For every value of an axis its position among the old ones, -1 where it is new; compared to the last bit."""
    places = {value.hex(): place for place, value in enumerate(map(float, new.values))}
    found = np.array([places.get(float(value).hex(), -1) for value in old.values])
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
