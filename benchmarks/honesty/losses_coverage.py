"""How often 95 % intervals of a clock's shares of loss, by `studies/clock_losses.py`, hold the true share.

python benchmarks/honesty/losses_coverage.py [--clocks 1000]

Clocks of random shares of dry, viscous, drag and impact losses (uniform over all), that swing to 1.5 to 10 times the
switching angle at the middle of 12 torques over a factor 10, least torque 1.2 R; noise of 1 % on each period, and on
each amplitude or with none measured. An interval by profile likelihood holds a share exactly if the best fit tied to it
is at most 3.84 worse than the best of all, so each costs one fit. Columns: share of intervals that hold the truth. Its
standard error is 0.7 % for 1000 clocks; at a bound of a share intervals are wider than they need be.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "studies"))

from clock_losses import SHARES, SUM, THRESHOLD, Measured, _clock

MIDDLE, PHI0 = 9.0, 0.6


def clock(dice: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """R, a, c, 1 - e^2 for random shares at large swings, and torques; a clock that goes at them all."""
    share = dice.dirichlet(np.ones(4))
    swing = np.exp(dice.uniform(np.log(1.5), np.log(10.0)))
    v = np.sqrt(2.0 * swing * MIDDLE * PHI0)
    work = MIDDLE * PHI0
    losses = share * MIDDLE * work * np.array([2 / v**2, 3 / v**3, 4 / v**4, 4 / (MIDDLE * v**2)])
    losses[3] = min(losses[3], 0.99)
    least = max(MIDDLE / np.sqrt(10.0), 1.2 * losses[0])
    return losses, np.geomspace(least, 10.0 * least, 12)


def held(dice: np.random.Generator, amplitude: bool) -> np.ndarray:
    """Whether the interval of each share of `SHARES` holds the truth, for one clock."""
    losses, mu = clock(dice)
    R, a, c, lost = losses
    cells = _clock()(mu, PHI0, R, a, c, np.sqrt(1.0 - lost))
    period, swing = (np.exp(np.log(x) + 0.01 * dice.standard_normal(12)) for x in (cells.period, cells.amplitude))
    here = Measured(mu, period, swing if amplitude else None, PHI0)
    true = SUM @ here.predicted((losses / here.units)[None])[1][0]
    best, least = here.fit()
    return np.array([here.fit(k, true[k], best)[1] - least < THRESHOLD for k in range(len(SHARES))])


def main() -> int:
    """Prints the table; 1 where an interval holds less than 93 %, by more than two standard errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clocks", type=int, default=1000)
    clocks = parser.parse_args().clocks
    narrow = False
    print("measured               " + "".join(f"{name:>18}" for name in SHARES))
    for amplitude in (True, False):
        dice = np.random.default_rng(7)
        share = np.mean([held(dice, amplitude) for _ in range(clocks)], axis=0)
        narrow |= bool((share + 2 * np.sqrt(share * (1 - share) / clocks) < 0.93).any())
        name = "periods and amplitudes" if amplitude else "periods alone"
        print(f"{name:23}" + "".join(f"{x:18.1%}" for x in share), flush=True)
    return int(narrow)


if __name__ == "__main__":
    sys.exit(main())
