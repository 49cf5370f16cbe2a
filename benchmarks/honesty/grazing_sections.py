"""Is a section, or a limit cycle, right that says OK where the motion touches its surface almost tangentially?

Prints by family and method the seconds of CPU time, how many OK cells are off by more than rtol or pass a surface that
is never met, how many others, but for GRAZING ones, by more than the error that they state, and the statuses; exit
status 1 where any is:

nice python benchmarks/honesty/grazing_sections.py [FAMILY ...] [--cells 200] [--seed 1] [--methods taylor dop853]

- `passes`: x'' = -x from 1, at x = -1 - d in passages 1, 2, 5 and 20, which it meets only where d < 0
- `fades`: the same with damping, in passages 1 to 4, of which the last one, or the next, is nearly missed
- `round`: a limit cycle, the circle of radius 1, which is met at x = -1 - d
- `stopped`: a driven oscillator that touches a stop once a period, and its multiplier
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).parents[2] / "tests" / room) for room in ("helpers", "oracles")]
from columns import estimated
from family import PI, REAL
from forced_scene import STOPPED
from scene_oracles import one_impact_a_period

from kernels.cycle import cycle_kernel
from kernels.interface import FIRST_REFUSAL, Status
from kernels.scene import Field
from kernels.trajectory import section_kernel

OSCILLATOR = section_kernel(
    name="grazing_section", doc="oscillator that just meets a level", states=(Field("x", "1", ""), Field("v", "1", "")),
    parameters=(Field("d", "1", ""), Field("zeta", "1", "")), rates=lambda x, v, zeta: (v, -x - 2.0 * zeta * v),
    surface=lambda x, d: x + 1.0 + d, start=lambda: (1.0, 0.0),
)  # fmt: skip
ROUND = cycle_kernel(
    name="grazing_cycle", doc="circle that just meets a level", states=(Field("x", "1", ""), Field("y", "1", "")),
    parameters=(Field("d", "1", ""), Field("k", "1", "")), start=lambda: (1.1, 0.0), surface=lambda x, d: x + 1.0 + d,
    rates=lambda x, y, k: (k * x * (1.0 - x * x - y * y) - y, k * y * (1.0 - x * x - y * y) + x),
)  # fmt: skip


def near(random, n, least=-16.0):
    """Mostly below 0, by 1 down to a rounding."""
    return -(10.0 ** random.uniform(least, 0, n)) * random.choice([1.0, 1.0, 1.0, -1.0], n)


def passes(random, n):
    """Kernel, cells, coordinate, names of outputs, and their truth over their sizes."""
    d, stops = near(random, n), np.array([1.0, 2.0, 5.0, 20.0])
    depth = np.where(d < 0.0, -REAL(1) * d, np.nan)[:, None]
    first = PI - 2 * np.arcsin(np.sqrt(depth / 2))
    times = first + 2 * PI * (stops - 1)
    speed = -np.sqrt(depth * (2 - depth)) + 0 * times
    true = {"time": (times, times), "x": (-1 - d[:, None] + 0 * times, 1), "v": (speed, 1)}
    return OSCILLATOR, {"d": d, "zeta": np.zeros(n)}, [stops], true


def fades(random, n):
    zeta, last, stops = 10.0 ** random.uniform(-3, -1, n), random.integers(1, 5, n), np.arange(1.0, 5.0)
    turn = np.sqrt(1 - REAL(1) * zeta**2)
    d = np.asarray((1 + near(random, n)) * np.exp(-REAL(1) * zeta * PI * (2 * last - 1) / turn) - 1, float)

    def place(t):
        return np.exp(-zeta[:, None] * t) * (np.cos(angle(t)) + zeta[:, None] / turn[:, None] * np.sin(angle(t)))

    def angle(t):
        return turn[:, None] * t

    bottom = PI * (2 * stops - 1) / turn[:, None]
    low, high = bottom - PI / turn[:, None], bottom
    meets = place(bottom) < -1 - REAL(1) * d[:, None]
    for _ in range(80):
        middle = (low + high) / 2
        above = place(middle) > -1 - REAL(1) * d[:, None]
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    times = np.where(meets, high, np.nan)
    true = {"time": (times, times), "x": (-1 - d[:, None] + 0 * times, 1)}
    return OSCILLATOR, {"d": d, "zeta": zeta}, [stops], true


def round_cycle(random, n):
    d, k = near(random, n, -14.0), 10.0 ** random.uniform(-3, 0.5, n)
    depth = np.where(d < 0.0, -REAL(1) * d, np.nan)
    nothing, multiplier = 0 * depth, np.exp(-4 * PI * k)
    true = {"period": (2 * PI + nothing, 2 * PI), "x": (-1 - d + nothing, 1), "y": (np.sqrt(depth * (2 - depth)), 1)}
    return ROUND, {"d": d, "k": k}, [], true | {"multiplier": (multiplier + nothing, np.maximum(1, multiplier))}


def stopped(random, n):
    drawn, true = [], []
    while len(true) < n:
        zeta, w, e, speed = 10.0 ** random.uniform([-2.0, -0.7, -3.0, -7.0], [0.3, 0.8, 0.0, 0.0])
        if (found := one_impact_a_period(zeta, w, e, speed)) is not None:
            drawn.append((zeta, w, e))
            true.append(found)
    cells = dict(zip(("zeta", "w", "e"), np.transpose(drawn), strict=True))
    stop, x, v, x_size, v_size, multiplier = np.array(true, REAL).T
    cells |= {"stop": stop, "x0": x, "v0": v, "settle": np.zeros(n), "flips": np.ones(n)}
    cells = {name: np.asarray(column, float) for name, column in cells.items()}
    true = {"x": (x, x_size), "v": (v, v_size), "multiplier": (multiplier, np.maximum(1.0, abs(multiplier)))}
    return STOPPED, cells, [np.array([1.0, 2.0])], true


FAMILIES = {"passes": passes, "fades": fades, "round": round_cycle, "stopped": stopped}


def worst(found, true):
    """Of each cell the largest error of what is given; infinite where there is none such."""
    off = []
    for name, (value, size) in true.items():
        given = found[name]
        error = np.where(np.isnan(given), 0.0, abs(given - value) / size)
        off.append(np.nan_to_num(error.astype(float), nan=np.inf).reshape(len(given), -1).max(axis=1))
    return np.max(off, axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("families", nargs="*", metavar="FAMILY")
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--methods", nargs="*", default=["taylor", "dop853", "rodas5p"])
    options = parser.parse_args()
    failed = 0
    for name in options.families or FAMILIES:
        random = np.random.default_rng([options.seed, len(name)])
        kernel, cells, along, true = FAMILIES[name](random, options.cells)
        rtol = 10.0 ** random.uniform(-12, -3, options.cells)
        for method in options.methods:
            begin = time.process_time()
            found, status, error = estimated(kernel, method, **cells, rtol=rtol, along=along, asked=tuple(true))
            seconds, good, refused = time.process_time() - begin, status == Status.OK, status >= FIRST_REFUSAL
            off = worst(found, true)
            wrong, sure = good & ~(off <= rtol), ~good & ~refused & (status != Status.GRAZING)
            unstated = sure & ~(off <= np.maximum(error, rtol))
            failed += wrong.sum() + unstated.sum()
            counts = ", ".join(f"{Status(s).name} {count}" for s, count in Counter(status.tolist()).most_common())
            said = f"{wrong.sum()} wrong, {unstated.sum()} above their error"
            print(f"{name:8}{method:9}{seconds:6.1f} s: {said}; {counts}", flush=True)
            for i in np.flatnonzero(wrong | unstated)[:3]:
                cell = {key: float(column[i]) for key, column in cells.items()}
                print(f"    {cell} rtol {rtol[i]:.3g}: off by {off[i]:.3g}, said {error[i]:.3g}", flush=True)
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
