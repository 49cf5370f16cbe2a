"""How far is what `sweep plan`, and then the run itself, forecast from what the run takes?

    python benchmarks/speed/forecast.py [FOLDER] [--seconds 5] [--kinds even summary ...]

Ten kinds of grids. For each: what `plan` said to what the run took; and when 10, 25, 50 and 75 % of the cells were
done, the time left that was told to the time that was left. 1.00 is right, 1.30 is 30 % too long. Also the bytes that
`plan` forecast to those of the output. Of runs that are continued, extended or elsewhere, the plan knows nothing.

Where others use the same machine, what they will do is known to nobody. So the time left is compared twice: with the
clock, and, in the second table, with the processors' seconds that were left, at as many of them a second as the run
had got till then.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil

import sweep
from sweep.cells.timing import sampled_study
from sweep.explore.plan import plan
from sweep.runs.loop import cores
from sweep.runs.progress import Progress
from sweep.runs.run import complete
from sweep.study.model import Study

STUDIES = Path(__file__).parents[2] / "studies"
SHARES = (0.10, 0.25, 0.50, 0.75)
FIXED = {"a": 1.0, "phi0": 1.0, "k": 0.3}
FRICTION = np.linspace(0.0, 0.4, 64)
Build = Callable[[int], Study]


def foliot(**keys: Any) -> Study:
    """A study of the foliot's period."""
    rtol = {} if "rtol" in keys["axes"] else {"rtol": 1e-6}
    return sweep.study(**{"kernel": "foliot", "outputs": ["period"], "fixed": FIXED, **rtol, **keys})


def drives(count: int) -> Any:
    """Accelerations at which the foliot goes."""
    return np.geomspace(0.8, 1e3, count)


def tolerances(*values: float) -> dict[str, Any]:
    """An axis of tolerances, the first of the axes."""
    return {"values": list(values)}


STEEP = tuple(np.geomspace(1e-3, 1e-12, 32))
RARE = (*np.geomspace(1e-3, 2e-3, 62), 1e-12, 2e-12)

MOST_CELLS = 64_000_000
"""Cells of a study at most, lest its output fill the disk."""

KINDS: dict[str, Build] = {
    "even": lambda n: foliot(method="segments", axes={"mu": drives(n), "R": FRICTION}),
    "dear last": lambda n: foliot(method="dopri5", axes={"rtol": tolerances(*STEEP), "mu": drives(n)}),
    "mixed methods": lambda n: foliot(
        axes={"method": {"values": ["closed", "segments", "dopri5"]}, "mu": drives(n)}, fixed={"a": 1.0, "phi0": 1.0}
    ),
    "few dear": lambda n: foliot(method="dopri5", axes={"rtol": tolerances(*RARE), "mu": drives(n)}),
    "storage": lambda n: foliot(
        method="closed", axes={"mu": drives(n), "a": np.geomspace(0.1, 10.0, 64)}, fixed={"phi0": 1.0}
    ),
    "summary": lambda n: foliot(
        method="segments",
        axes={"mu": drives(n), "R": FRICTION},
        summary={"outputs": {"period": ["min", "max", "mean"]}},
    ),
    "own scene": lambda n: sweep.study(
        kernel="own_scene:KERNEL",
        allow_import=True,
        axes={"mu": drives(n), "b": np.geomspace(0.1, 10.0, 8)},
        fixed={"phi0": 1.0, "a": 0.1},
    ),
    "continued": lambda n: foliot(method="dopri5", axes={"mu": drives(n), "R": FRICTION}),
    "extended": lambda n: foliot(method="dopri5", axes={"mu": drives(n), "R": FRICTION}),
    "cluster": lambda n: foliot(method="dopri5", axes={"mu": drives(n), "R": FRICTION}),
}


class Told(NamedTuple):
    """What was told at one moment of a run."""

    share: float
    at: float
    processors: float
    left: float


class Recorder:
    """What the progress line tells while a run goes on."""

    def __init__(self) -> None:
        self.told: list[Told] = []
        self.begun = self.end = self.processors = 0.0

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Every run within is listened to."""
        real, told = Progress.add, self.told

        def add(progress: Progress, cells: int, work: float, seconds: float) -> None:
            real(progress, cells, work, seconds)
            left = progress.left
            if left is not None:
                told.append(Told(progress.done / progress.total, time.perf_counter(), processors(), left))

        Progress.add = add  # type: ignore[method-assign]
        self.begun = time.perf_counter()
        try:
            yield
        finally:
            self.end, self.processors = time.perf_counter(), processors()
            Progress.add = real  # type: ignore[method-assign]

    @property
    def taken(self) -> float:
        """Seconds of the run."""
        return self.end - self.begun

    def moments(self) -> list[Told]:
        """When each of `SHARES` of the cells that this run computed was done."""
        first = self.told[0].share
        return [next(t for t in self.told if t.share >= first + share * (1 - first)) for share in SHARES]

    def by_clock(self) -> list[float]:
        """Time left as told to what it was."""
        return [t.left / max(self.end - t.at, 1e-3) for t in self.moments()]

    def by_processors(self) -> list[float]:
        """The same, had the run got as much of the machine later as it had got till then."""
        first, found = self.told[0], []
        for t in self.moments():
            pace = (t.processors - first.processors) / max(t.at - first.at, 1e-3)
            found.append(t.left * pace / max(self.processors - t.processors, 1e-3))
        return found


def processors() -> float:
    """Seconds that all processors have spent on this process, and on those that it has begun and that live."""
    here = psutil.Process()
    times = [p.cpu_times() for p in (here, *here.children(recursive=True))]
    return sum(t.user + t.system for t in times)


def sized(build: Build, seconds: float) -> Study:
    """The study with as many values on its longest axis as take about so many seconds."""
    trial, count = build(256), 256
    cells = np.prod([len(axis) for axis in trial.axes.values()])
    cost = sampled_study(trial).cost * cells
    return build(int(np.clip(count * seconds * cores() / cost, 16, MOST_CELLS * count // cells)))


def halfway(study: Study) -> Study:
    """The study with the first third of the values of its first axis."""
    first, *others = study.axes
    values = study.axes[first].values
    axes = {first: values[: len(values) // 3], **{name: study.axes[name].values for name in others}}
    return foliot(method=study.method, axes=axes)


def stopped(study: Study, path: Path) -> None:
    """A run that is stopped when a third is done."""
    real = Progress.add

    def add(progress: Progress, cells: int, work: float, seconds: float) -> None:
        real(progress, cells, work, seconds)
        if progress.done > progress.total / 3:
            raise KeyboardInterrupt

    Progress.add = add  # type: ignore[method-assign]
    try:
        with contextlib.suppress(KeyboardInterrupt):
            sweep.run(study, path, progress=False)
    finally:
        Progress.add = real  # type: ignore[method-assign]


@contextlib.contextmanager
def prepared(kind: str, study: Study, path: Path) -> Iterator[dict[str, Any]]:
    """What was there before, and how the run is called."""
    if kind == "continued":
        stopped(study, path)
    if kind == "extended":
        sweep.run(halfway(study), path, progress=False).close()
        yield {"extend": True}
    elif kind == "cluster":
        from distributed import Client

        with Client(n_workers=cores(), threads_per_worker=1, dashboard_address=None) as client:
            yield {"cluster": client}
    else:
        yield {}


def compared(kind: str, seconds: float, path: Path) -> list[list[float]]:
    """Forecasts of one kind to what came, at `SHARES`: by the clock, and by what processors did."""
    study = sized(KINDS[kind], seconds)
    planned = plan(study, path=path)
    recorder = Recorder()
    with prepared(kind, study, path) as options, recorder.listening():
        complete(study, path, progress=io.StringIO(), **options)
    size = path.stat().st_size
    path.unlink()
    found = [recorder.by_clock(), recorder.by_processors()]
    whole = kind not in ("continued", "extended", "cluster")
    told = f"{planned.seconds / recorder.taken:5.2f}" if whole else "    -"
    columns = "   |".join("  ".join(f"{ratio:5.2f}" for ratio in ratios) for ratios in found)
    print(f"{kind:14} {recorder.taken:6.1f} s  {told}  {columns}  {planned.output_bytes / size:5.3f}", flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    given = parser.parse_args()
    sys.path.append(str(STUDIES))
    print("kind              run   plan    10 %   25 %   50 %   75 %   |10 %   25 %   50 %   75 %   bytes")
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        found = np.array([compared(kind, given.seconds, Path(folder) / "out.h5") for kind in given.kinds])
    for way, ratios in zip(("by the clock", "by the processors' seconds"), np.moveaxis(found, 1, 0), strict=True):
        near, half = np.mean(abs(ratios - 1) <= 0.3), np.mean((ratios >= 0.5) & (ratios <= 2.0))
        print(f"{way}: within 30 %: {near:.0%}; within a factor of two: {half:.0%}")


if __name__ == "__main__":
    main()
