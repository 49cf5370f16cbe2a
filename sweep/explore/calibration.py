"""How long a run will take, from a run of some of its cells: kernel, disk and what any run costs, as they are now."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sweep.study.model import Axis, Study
from sweep.system.errors import SweepError

REHEARSAL_SECONDS = 0.5
"""What the longer of two rehearsals is meant to take."""
LEAST_CELLS = 16
"""With fewer than so many cells in that time, what any run costs does not matter."""
MOST_BYTES = 128 << 20
USUAL_SPEED = 3e8
"""Bytes a second that a disk may take; only to choose the size of a rehearsal."""
SHORTER = 8
"""Of the two rehearsals one has so many times fewer cells."""
LEAST_VALUES = 8
"""An axis keeps so many of its values as long as others have more."""


@dataclass(frozen=True)
class Timed:
    """Seconds that a run of so many cells took."""

    cells: int
    seconds: float


def rehearsed(
    study: Study, cells: int, block: int, cell_seconds: float, cell_bytes: float, folder: Path, workers: int
) -> float:
    """Seconds that a run into this folder will take; NaN where that cannot be tried.

    Parameters
    ----------
    cells, block : of the study, and of a block of it
    cell_seconds, cell_bytes : about what one costs on one core, and on the disk
    """
    guess = cell_seconds / workers + cell_bytes / USUAL_SPEED
    some = int(min(cells, REHEARSAL_SECONDS / guess, MOST_BYTES / cell_bytes))
    if some < min(cells, LEAST_CELLS) or cell_seconds > REHEARSAL_SECONDS / 4:
        return math.nan
    try:
        with tempfile.TemporaryDirectory(prefix="plan.", dir=folder) as name:
            stage = _Stage(Path(name) / "rehearsal.h5", workers, cells, block)
            return _forecast(study, stage, some, guess)
    except (OSError, SweepError):
        return math.nan


@dataclass(frozen=True)
class _Stage:
    """Where rehearsals are held, and for what: so many cells in such blocks."""

    path: Path
    workers: int
    cells: int
    block: int

    def timed(self, study: Study) -> Timed:
        """A run. Raises SweepError, OSError."""
        from sweep.runs.run import run

        cells = math.prod(_lengths(study).values())
        block = self.block if cells == self.cells else max(1, min(self.block, cells // (2 * self.workers)))
        begun = time.perf_counter()
        run(study, self.path, workers=self.workers, progress=False, block_cells=block).close()
        seconds = time.perf_counter() - begun
        self.path.unlink()
        return Timed(cells, seconds)


def _forecast(study: Study, stage: _Stage, some: int, guess: float) -> float:
    few = thinned(study, max(1, some // SHORTER))
    # the first run imports and compiles
    stage.timed(few)
    short, long = stage.timed(few), stage.timed(thinned(study, some))
    if long.cells >= stage.cells or long.cells <= short.cells:
        return long.seconds * stage.cells / long.cells
    slope = max((long.seconds - short.seconds) / (long.cells - short.cells), 0.5 * guess)
    return long.seconds + slope * (stage.cells - long.cells)


def _lengths(study: Study) -> dict[str, int]:
    """Values of every axis; of axes that go together, of the first alone."""
    lengths = {name: len(axis) for name, axis in study.axes.items()}
    return lengths if study.design == "product" else dict(list(lengths.items())[:1])


def thinned(study: Study, cells: int) -> Study:
    """The study with about so many cells, spread over its axes; at least one, at most all."""
    lengths = _lengths(study)
    for name in sorted(lengths, key=lambda name: -lengths[name]):
        others = math.prod(lengths.values()) // lengths[name]
        least = 1 if others * LEAST_VALUES > cells and others <= 1 else min(LEAST_VALUES, lengths[name])
        lengths[name] = max(least, min(lengths[name], cells // others))
    if study.design != "product":
        lengths = dict.fromkeys(study.axes, next(iter(lengths.values())))
    return replace(study, axes=_cut(study.axes, lengths))


def _cut(axes: Mapping[str, Axis], lengths: Mapping[str, int]) -> dict[str, Axis]:
    return {name: _some(axis, lengths[name]) for name, axis in axes.items()}


def _some(axis: Axis, count: int) -> Axis:
    """So many of its values, each from the middle of an equal share of them."""
    places = (2 * np.arange(count) + 1) * len(axis) // (2 * count)
    words = tuple(axis.words[i] for i in places) if axis.words else axis.words
    return replace(axis, values=axis.values[places], words=words)
