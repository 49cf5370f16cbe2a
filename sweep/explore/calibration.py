"""How long a run will take, from a run of some of its cells: kernel, disk and what any run costs, as they are now."""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sweep.study.model import Axis, Study
from sweep.system.errors import SweepError

CALIBRATION_SECONDS = 0.5
"""What the longer of two trial runs is meant to take."""
LEAST_CELLS = 16
"""With fewer than so many cells in that time, what any run costs does not matter."""
MOST_BYTES = 128 << 20
USUAL_SPEED = 3e8
"""Bytes a second that a disk may take; only to choose the size of a trial run."""
SHORTER = 8
"""Of the two trial runs one has so many times fewer cells."""
LEAST_VALUES = 8
"""An axis keeps so many of its values as long as others have more."""


@dataclass(frozen=True)
class Timed:
    """Seconds that a run of so many cells took."""

    cells: int
    seconds: float


@dataclass(frozen=True)
class Calibration:
    """What a run of a study into a folder will take, from runs of some of its cells.

    Attributes
    ----------
    cells, block : of the study, and of a block of it
    cell_seconds, cell_bytes : about what one costs on one core, and on the disk
    cell_timeout : what one may take in a process of its own; None: in this one
    """

    study: Study
    cells: int
    block: int
    cell_seconds: float
    cell_bytes: float
    workers: int
    cell_timeout: float | None = None

    @property
    def _guess(self) -> float:
        """Seconds a cell."""
        return self.cell_seconds / self.workers + self.cell_bytes / USUAL_SPEED

    def seconds(self, folder: Path) -> float:
        """NaN where that cannot be tried."""
        some = int(min(self.cells, CALIBRATION_SECONDS / self._guess, MOST_BYTES / self.cell_bytes))
        if some < min(self.cells, LEAST_CELLS) or self.cell_seconds > CALIBRATION_SECONDS / 4:
            return math.nan
        try:
            with tempfile.TemporaryDirectory(prefix="plan.", dir=folder) as name:
                return self._forecast(Path(name) / "trial.h5", some)
        except (OSError, SweepError):
            return math.nan

    def _forecast(self, path: Path, some: int) -> float:
        few = thinned(self.study, max(1, some // SHORTER))
        # the first run imports and compiles
        self._timed(few, path)
        short, long = self._timed(few, path), self._timed(thinned(self.study, some), path)
        if long.cells >= self.cells or long.cells <= short.cells:
            return long.seconds * self.cells / long.cells
        slope = max((long.seconds - short.seconds) / (long.cells - short.cells), 0.5 * self._guess)
        return long.seconds + slope * (self.cells - long.cells)

    def _timed(self, study: Study, path: Path) -> Timed:
        """A run. Raises SweepError, OSError."""
        from sweep.runs.run import run

        cells = math.prod(study.grid_shape.values())
        block = self.block if cells == self.cells else max(1, min(self.block, cells // (2 * self.workers)))
        begun = time.perf_counter()
        limit = self.cell_timeout
        run(study, path, workers=self.workers, progress=False, block_cells=block, cell_timeout=limit).close()
        seconds = time.perf_counter() - begun
        path.unlink()
        return Timed(cells, seconds)


def thinned(study: Study, cells: int) -> Study:
    """The study with about so many cells, spread over its axes; at least one, at most all."""
    lengths = study.grid_shape
    for name in sorted(lengths, key=lambda name: -lengths[name]):
        others = math.prod(lengths.values()) // lengths[name]
        least = 1 if others * LEAST_VALUES > cells and others <= 1 else min(LEAST_VALUES, lengths[name])
        lengths[name] = max(least, min(lengths[name], cells // others))
    axes = {name: _some(study.axes[name], lengths[dim]) for dim, names in study.dims.items() for name in names}
    return replace(study, axes={name: axes[name] for name in study.axes})


def _some(axis: Axis, count: int) -> Axis:
    """So many of its values, each from the middle of an equal share of them."""
    places = (2 * np.arange(count) + 1) * len(axis) // (2 * count)
    words = tuple(axis.words[i] for i in places) if axis.words else axis.words
    return replace(axis, values=axis.values[places], words=words, entry=None)
