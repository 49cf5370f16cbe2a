"""Cells and true error of `sweep refine` beside `adaptive`, and how often the error it tells holds the truth.

    python benchmarks/honesty/refine.py [--functions 200] [--axes 1 2 3] [--no-adaptive] [--no-table] [--seed 7]

First a table over fixed functions of one, two and three axes: cells of a refinement to a tolerance, its own time (the
functions cost nothing) and its true error, the largest at many random places; and the cells at which `adaptive`
(`pip install adaptive`, 1.5) has as small an error by straight lines between its points, the better of its losses,
default and curvature; "more" where it has not at as many cells. Of a border between statuses the error is the share of
the box in which neighbours differ in status.
Then a function that goes to infinity at a border of statuses: cells must not run out, and the error told must hold
farther from the border than cells there are wide. Then random functions (sines, peaks, kinks, fronts, bends): the share
in which the error told is at least the true one.
Exit status 1 where more cells are taken than 1.2 times those of `adaptive`, an error does not hold beside infinity, or
the share is below 0.95.
"""

from __future__ import annotations

import argparse
import sys
import time
from types import SimpleNamespace

import numpy as np
import xarray as xr

from kernels.interface import Status
from sweep.cells.schema import ANCILLARY
from sweep.explore.mesh import Mesh, stretch
from sweep.explore.refine import LEVELS, Refinement, Refiner
from sweep.explore.scattered import heights
from sweep.study.model import Axis

NAMES = ("x", "y", "z")
START = {1: 9, 2: 5, 3: 4}
TOLERANCE = {1: 1e-4, 2: 2e-2, 3: 6e-2}
RANDOM_TOLERANCE = {1: 1e-4, 2: 1e-2, 3: 5e-2}
PLACES = {1: 20_000, 2: 40_000, 3: 40_000}
MOST_RATIO, LEAST_COVERAGE = 1.2, 0.95
MOST_CELLS = 20_000
POLE, POLE_TOLERANCE = 0.737, 5e-2

FUNCTIONS = {
    "1 front": lambda p: np.tanh(20 * (p[:, 0] - 0.3)),
    "1 kink": lambda p: abs(p[:, 0] - 0.37) + p[:, 0] ** 2 - 1,
    "1 peak": lambda p: 1 / (1 + ((p[:, 0] - 0.4) / 0.06) ** 2) - 0.5,
    "1 sine": lambda p: np.sin(9 * p[:, 0]),
    "1 border": lambda p: np.where(p[:, 0] < 0.637, p[:, 0] - 2, np.nan),
    "2 front": lambda p: np.tanh((np.hypot(p[:, 0], p[:, 1]) - 0.6) / 0.12),
    "2 kink": lambda p: abs(p[:, 0] + 0.5 * p[:, 1] - 0.7) + p[:, 1] ** 2 - 1,
    "2 peak": lambda p: np.exp(-((p - 0.43) ** 2).sum(axis=1) / 0.2**2) - 0.5,
    "2 sine": lambda p: np.sin(4 * p[:, 0] + 3 * p[:, 1] ** 2),
    "2 one axis": lambda p: np.tanh((p[:, 0] - 0.45) / 0.12) + 0.1 * p[:, 1],
    "2 idle axis": lambda p: np.sin(9 * p[:, 0]),
    "2 border": lambda p: np.where(np.hypot(p[:, 0], p[:, 1]) < 0.737, p[:, 0] - 2, np.nan),
    "3 front": lambda p: np.tanh((p[:, 2] + 0.3 * p[:, 0] - 0.55) / 0.25),
    "3 kink": lambda p: abs(p[:, 0] + 0.5 * p[:, 1] - 0.3 * p[:, 2] - 0.55) - 0.5,
    "3 peak": lambda p: np.exp(-((p - 0.43) ** 2).sum(axis=1) / 0.45**2) - 0.5,
    "3 idle axis": lambda p: np.sin(4 * p[:, 0] + 3 * p[:, 1] ** 2),
    "3 two idle": lambda p: np.tanh((p[:, 0] - 0.45) / 0.12),
    "3 sine": lambda p: np.sin(2 * p[:, 0] + 2 * p[:, 1] ** 2 + p[:, 2]),
}


def dataset_of(function, values, dims):
    """Cells of a function, refused where it is NaN."""
    found = function(np.stack([v.ravel() for v in values], axis=1)).reshape(values[0].shape)
    status = np.where(np.isfinite(found), Status.OK, Status.NEVER_STARTS).astype(np.int8)
    columns = {name: (dims, np.zeros(found.shape)) for name in ANCILLARY}
    return xr.Dataset(columns | {"value": (dims, found), "status": (dims, status)})


def refined(function, axes, tolerance):
    """A refinement of a function over the unit box, by what `sweep.refine` does after a first even grid."""
    grid = [np.linspace(0.0, 1.0, START[axes])] * axes
    names = NAMES[:axes]

    def solved(values):
        found = dataset_of(function, list(values.values()), ("cell",))
        return found.assign_coords({name: ("cell", column) for name, column in values.items()})

    gridded = {n: Axis(n, g, "values") for n, g in zip(names, grid, strict=True)}
    study = SimpleNamespace(axes=gridded, outputs=("value",), design="product")
    first = dataset_of(function, np.meshgrid(*grid, indexing="ij"), names)
    first = first.assign_coords(dict(zip(names, grid, strict=True)))
    cells = Refiner(first, study, ["value"], tolerance, MOST_CELLS, solved)
    cells.refine()
    return cells.points, cells.cells["value"], Refinement(cells, first)


def true_error(function, points, values):
    """Largest error of straight lines, over the largest value; of borders the share of places beside unlike corners."""
    places = np.random.default_rng(5).random((PLACES[points.shape[1]], points.shape[1]))
    border = np.isnan(values).any()
    drawn = np.isnan(values).astype(float) if border else values
    if points.shape[1] == 1:
        order = np.argsort(points[:, 0])
        found = np.interp(places[:, 0], points[order, 0], drawn[order])
    else:
        found = Mesh(points, drawn, matrix=stretch(points, heights(values))).between(places)[0]
    if border:
        return float(np.mean((found > 0) & (found < 1)))
    return float(np.nanmax(abs(found - function(places))) / abs(values).max())


def adaptive_cells(function, axes, wanted, most):
    """Least points at which `adaptive` has an error as small; None where it has not at `most`."""
    found = [_adaptive_cells(function, axes, wanted, most, curved) for curved in (False, True)]
    return min((n for n in found if n is not None), default=None)


def _adaptive_cells(function, axes, wanted, most, curved):
    from adaptive import Learner1D, LearnerND
    from adaptive.learner.learner1D import curvature_loss_function as curvature_1d
    from adaptive.learner.learnerND import curvature_loss_function as curvature

    def value(place):
        # there are no statuses: a refused cell is a jump
        return float(np.nan_to_num(function(np.reshape(place, (1, axes)).astype(float))[0]))

    if axes == 1:
        learner = Learner1D(value, (0, 1), **({"loss_per_interval": curvature_1d()} if curved else {}))
    else:
        learner = LearnerND(value, [(0, 1)] * axes, **({"loss_per_simplex": curvature()} if curved else {}))
    while learner.npoints < most:
        for _ in range(max(4, learner.npoints // 25)):
            for place in learner.ask(1)[0]:
                learner.tell(place, value(place))
        points = np.array([np.atleast_1d(place) for place in learner.data])
        if len(points) > 2**axes and true_error(function, points, function(points)) <= wanted:
            return len(points)
    return None


def random_function(axes, rng):
    """One of five kinds, and its name."""
    kind = rng.choice(["sines", "peaks", "kink", "front", "bend"])
    normal = rng.normal(size=axes)
    normal /= np.linalg.norm(normal)
    place, width, sharp = normal @ rng.random(axes), rng.uniform(0.08, 0.3), rng.uniform(3, 20)
    waves, phases, sizes = rng.uniform(-8, 8, (4, axes)) / axes**0.5, rng.uniform(0, 6.28, 4), rng.normal(size=4)
    centres, widths, bow = rng.random((2, axes)), rng.uniform(0.15, 0.5, 2), rng.normal(size=axes) / 2
    return kind, {
        "sines": lambda p: (sizes * np.sin(p @ waves.T + phases)).sum(axis=1),
        "peaks": lambda p: sum(
            np.exp(-((p - c) ** 2).sum(axis=1) / w**2) for c, w in zip(centres, widths, strict=True)
        ),
        "kink": lambda p: abs(p @ normal - place) + p**2 @ bow,
        "front": lambda p: np.tanh((p @ normal - place) / width),
        "bend": lambda p: np.logaddexp(0, sharp * (p @ normal - place)) / sharp,
    }[kind]


def compare(axes, with_adaptive):
    """Prints the table; the largest ratio of cells."""
    worst = 0.0
    for name, function in FUNCTIONS.items():
        if int(name[0]) not in axes:
            continue
        start = time.process_time()
        points, values, found = refined(function, int(name[0]), TOLERANCE[int(name[0])])
        spent = time.process_time() - start
        error, cells = true_error(function, points, values), len(points)
        line = f"{name:11} {cells:6} cells, {1e3 * spent / cells:.2f} ms each; "
        line += f"error told {found.error:.1e}, true {error:.1e}"
        if with_adaptive:
            other = adaptive_cells(function, int(name[0]), error, cells)
            ratio = cells / other if other else 1.0
            worst = max(worst, ratio)
            line += f"; adaptive {other or f'more than {cells}'}" + (f", ratio {ratio:.2f}" if other else "")
        print(line, flush=True)
    return worst


def pole(p):
    """Infinite on a sphere, refused beyond it."""
    left = POLE - np.linalg.norm(p, axis=1)
    return np.where(left > 0, 1 / np.maximum(left, 1e-300), np.nan)


def holds_beside_infinity(axes):
    """Prints whether the error told holds inside the cells along the border; returns it."""
    start = time.process_time()
    points, values, found = refined(pole, axes, POLE_TOLERANCE)
    spent = time.process_time() - start
    places = np.random.default_rng(5).random((PLACES[axes], axes))
    wide = axes**0.5 * 2.0 ** -(LEVELS[axes] // 2) / (START[axes] - 1)
    places = places[np.linalg.norm(places, axis=1) < POLE - 2 * wide]
    logs = heights(values)
    error = abs(Mesh(points, logs).between(places)[0] - np.log(pole(places))).max()
    cells = f"{axes} pole      {len(points):6} cells, {1e3 * spent / len(points):.2f} ms each"
    cells += f"; {found.jumps} left beside the border"
    print(f"{cells}; error told {found.error:.1e}, true {error:.1e}", flush=True)
    return error <= found.error and len(points) < MOST_CELLS and found.jumps > 0


def coverage(axes, number, seed):
    """Prints the share of random functions in which the error told holds; returns it."""
    rng, found = np.random.default_rng(seed), {}
    for _ in range(number):
        kind, raw = random_function(axes, rng)
        # of one sign nowhere, so that errors are relative to the largest value
        places = np.random.default_rng(5).random((PLACES[axes], axes))
        low, high = raw(places).min(), raw(places).max()

        def function(p, raw=raw, low=low, high=high):
            return (2 * raw(p) - low - high) / (high - low)

        points, values, result = refined(function, axes, RANDOM_TOLERANCE[axes])
        found.setdefault(kind, []).append(true_error(function, points, values) / result.error)
    every = np.concatenate(list(found.values()))
    for kind, ratios in sorted(found.items()):
        held = sum(r <= 1 for r in ratios)
        told = f"true over told {np.median(ratios):.2f}, at most {max(ratios):.2f}"
        print(f"  {axes} {kind:6} {held} of {len(ratios)} held; {told}")
    share = float(np.mean(every <= 1))
    print(f"  {axes} all    {100 * share:.1f} % of {number}", flush=True)
    return share


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--functions", type=int, default=200)
    parser.add_argument("--axes", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--no-adaptive", action="store_true")
    parser.add_argument("--no-table", action="store_true")
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    worst, held = 0.0, []
    if not arguments.no_table:
        worst = compare(arguments.axes, not arguments.no_adaptive)
        held = [holds_beside_infinity(axes) for axes in arguments.axes if axes > 1]
    shares = [1.0]
    if arguments.functions:
        shares = [coverage(axes, arguments.functions, arguments.seed) for axes in arguments.axes]
    return int(worst > MOST_RATIO or not all(held) or min(shares) < LEAST_COVERAGE)


if __name__ == "__main__":
    sys.exit(main())
