"""Extending a finished result: a study with more values on its axes takes the cells it shares over, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from sweep.cells.grid import Grid
from sweep.cells.schema import STATUS, Column, columns
from sweep.results.open import unreadable
from sweep.store.parts import DAMAGE
from sweep.study.model import Axis, Study
from sweep.system.errors import SweepError

Slab = tuple[tuple[slice, ...], list[Any], int, int]


def obstacle(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Why a result of one fingerprint cannot be extended to that of another, in a word; "" where it may be."""
    changed = {name for name in {*old, *new} if old.get(name) != new.get(name)} - {"study"}
    others = sorted((name for name in changed if not name.startswith("axes.")), key=lambda name: (" " in name, name))
    if others:
        return f"{others[0]} differs, too"
    if new.get("design") != "product":
        return 'its design is not "product"'
    if "summary.over" in new:
        return "it holds a summary, not cells"
    return "" if changed else "nothing differs but words"


class Reused:
    """The cells of a finished result, in the grid of an extended study. To be used in a `with` statement.

    Parameters
    ----------
    output : Path
        The finished result.
    study : Study
        Whose axes have all values of the result's, in the same order, and more.

    Raises
    ------
    SweepError
        The result cannot be read, or an axis lacks some of its values.
    """

    def __init__(self, output: Path, study: Study) -> None:
        import h5py

        self._output, self._grid = output, Grid(study)
        self._columns: tuple[Column, ...] = columns(study)
        try:
            self._file = h5py.File(output, "r")
            old = Study.from_json(str(self._file.attrs["study_json"]), declared=True)
        except DAMAGE as fault:
            raise unreadable(output, fault) from None
        self._positions = [_positions(old.axes[name], axis) for name, axis in study.axes.items()]

    def __enter__(self) -> Reused:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, at: TracebackType | None) -> None:
        self._file.close()

    @property
    def cells(self) -> int:
        """How many of the cells are known."""
        return int(np.prod([(positions >= 0).sum() for positions in self._positions], dtype=np.int64))

    def missing(self, start: int, stop: int) -> Any:
        """Of the cells `start` to `stop`, which have to be computed."""
        missing = np.ones(stop - start, bool)
        for slices, known, begin, end in self._slabs(start, stop):
            missing[begin:end].reshape([s.stop - s.start for s in slices])[np.ix_(*known)] = False
        return missing

    def fill(self, start: int, stop: int, arrays: Mapping[str, Any]) -> None:
        """Writes the known ones among the cells `start` to `stop`. Raises SweepError where the file fails."""
        for slices, known, begin, end in self._slabs(start, stop):
            shape = [s.stop - s.start for s in slices]
            # values of the result that are neighbours there have none of its values between them here
            old = tuple(
                slice(int(p[s][k].min()), int(p[s][k].max()) + 1)
                for p, s, k in zip(self._positions, slices, known, strict=True)
            )
            for column in self._columns:
                try:
                    values = self._file[column.name][old]
                except DAMAGE as fault:
                    raise unreadable(self._output, fault) from None
                arrays[column.name][begin:end].reshape(*shape, *column.shape)[np.ix_(*known)] = values

    def _slabs(self, start: int, stop: int) -> Iterator[Slab]:
        """Hyperslabs with known cells: which of its positions along each axis are known, and where its cells lie."""
        for slices, begin, end in self._grid.pieces(start, stop):
            known = [positions[s] >= 0 for positions, s in zip(self._positions, slices, strict=True)]
            if all(k.any() for k in known):
                yield slices, known, begin, end


class Precomputed:
    """All cells of a study, solved before: what `Reused` is, without a file to look them up in.

    Parameters
    ----------
    arrays : mapping of outputs and of `schema.ANCILLARY` to ndarray, shape (cells, ...)
    """

    def __init__(self, arrays: Mapping[str, Any]) -> None:
        self._arrays = arrays

    def __enter__(self) -> Precomputed:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, at: TracebackType | None) -> None:
        pass

    @property
    def cells(self) -> int:
        return len(self._arrays[STATUS])

    def missing(self, start: int, stop: int) -> Any:
        return np.zeros(stop - start, bool)

    def fill(self, start: int, stop: int, arrays: Mapping[str, Any]) -> None:
        for name, values in self._arrays.items():
            arrays[name][...] = values[start:stop]


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
