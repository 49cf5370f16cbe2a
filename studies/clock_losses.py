"""What losses does a clock have whose periods, and amplitudes if you can, were measured at some torques?

    python studies/clock_losses.py clock.csv 0.6

prints the share of each loss at the middle torque with its interval of 95 %. The table has a heading and the columns
torque over moment of inertia [rad/s^2], period [s] and, if there is a third one, amplitude [rad]; the number is the
switching angle [rad]; noise is taken as 1 %. The kernel `foliot` is fitted to the logarithms by scipy's least squares:
dry friction R, viscous friction a, drag c v^2 and impacts e, all at least 0. The interval of a share holds the values x
at which the best fit whose share is x has a sum of squares, over the noise, at most 3.84 above the least.
"""

import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from _losses import taken
from scipy.optimize import brentq, least_squares

import sweep

SHARES = ("dry", "viscous", "drag", "impacts", "drag and impacts")
SUM = np.vstack([np.eye(4), [0, 0, 1, 1]])
"""What makes `SHARES` of the four."""
THRESHOLD = 3.8415
"""Of chi squared with one degree of freedom, 95 %."""
TIE = 1e3
"""Weight that ties a share to a value: a thousandth off counts as much as a number that is off by its noise."""


@functools.cache
def _clock() -> Callable[..., Any]:
    study = {"kernel": "foliot", "outputs": ["period", "amplitude", "crossing_speed"], "rtol": 1e-9}
    axes = {name: [0.5] for name in ("mu", "phi0", "R", "a", "c", "e")}
    return sweep.solver({**study, "axes": axes, "fixed": {"n": 2.0}})


@dataclass(frozen=True, eq=False)
class Measured:
    """Torques [rad/s^2], periods [s], amplitudes [rad] or None, switching angle [rad]; relative noise of each number.

    Losses are u >= 0, each nearly the share of its loss at the middle torque: with the speed v = mu P/4 they say R, a,
    c and e as if the swing were large; the shares themselves follow from the kernel's speed at that torque.
    """

    mu: Any
    period: Any
    amplitude: Any = None
    phi0: float = 1.0
    noise: float = 0.01

    @property
    def middle(self) -> float:
        """The torque whose shares are wanted, the one nearest the geometric mean."""
        return float(self.mu[np.argmin(abs(np.log(self.mu) - np.log(self.mu).mean()))])

    @functools.cached_property
    def units(self) -> Any:
        """What u = 1 means: R, a, c and 1 - e^2."""
        work, v = self.middle * self.phi0, self.middle * float(self.period[list(self.mu).index(self.middle)]) / 4.0
        return self.middle * work * np.array([2.0 / v**2, 3.0 / v**3, 4.0 / v**4, 4.0 / (self.middle * v**2)])

    @property
    def most(self) -> Any:
        """The largest u: a foliot that still goes at the least torque, and impacts that leave some speed."""
        return np.array([0.999 * min(self.mu), np.inf, np.inf, 0.999]) / self.units

    def predicted(self, u: Any) -> tuple[Any, Any]:
        """Logarithms of what is measured, (k, numbers), and the shares, (k, 4), of losses u, (k, 4)."""
        R, a, c, lost = (np.maximum(u, 0.0) * self.units).T[:, :, None]
        e = np.sqrt(np.maximum(1.0 - lost, 0.0))
        found = _clock()(np.append(self.mu, self.middle)[None, :], self.phi0, R, a, c, e)
        shown = [found.period] if self.amplitude is None else [found.period, found.amplitude]
        share, _ = taken(self.middle, self.phi0, R, a, c, 2.0, e, found.crossing_speed[:, -1:])
        return np.concatenate([np.log(x[:, :-1]) for x in shown], 1), share[..., 0].T

    def matrix(self, u: Any) -> tuple[Any, Any]:
        """Derivatives of both by u, (numbers, 4) over the noise and (4, 4)."""
        above, below = u + 1e-5 * np.eye(4), np.maximum(u - 1e-5 * np.eye(4), 0.0)
        (up, share_up), (down, share_down) = self.predicted(above), self.predicted(below)
        apart = np.diag(above - below)[:, None]
        return ((up - down) / apart).T / self.noise, ((share_up - share_down) / apart).T

    def fit(self, tied: int | None = None, at: float = 0.0, start: Any = (0.25, 0.25, 0.25, 0.25)) -> tuple[Any, float]:
        """The best losses and their sum of squares; with the share (of `SHARES`) numbered `tied` at a value."""
        exact = {"ftol": 1e-7, "xtol": 1e-7, "gtol": 1e-7, "max_nfev": 60}
        seen = np.log(np.concatenate([x for x in (self.period, self.amplitude) if x is not None]))
        bond = TIE * SUM[[] if tied is None else [tied]]

        def off(u: Any) -> Any:
            shown, share = self.predicted(u[None])
            return np.concatenate([(shown[0] - seen) / self.noise, bond @ share[0] - TIE * at])

        def slopes(u: Any) -> Any:
            shown, share = self.matrix(u)
            return np.vstack([shown, bond @ share])

        start = np.clip(start, 1e-3, 0.9 * self.most)
        found = least_squares(off, start, slopes, bounds=(np.zeros(4), self.most), x_scale=0.3, **exact)
        return found.x, 2.0 * float(found.cost)

    def interval(self, share: int, best: tuple[Any, float] | None = None) -> tuple[float, float, float]:
        """The least, best and largest value of a share (of `SHARES`); `best`: what `fit` gave, if it is at hand."""
        u, least = self.fit() if best is None else best
        place = float(SUM[share] @ self.predicted(u[None])[1][0])

        def above(x: float) -> float:
            return self.fit(share, x, u)[1] - least - THRESHOLD

        ends = [brentq(above, end, place, xtol=3e-3) if above(end) > 0.0 else end for end in (0.0, 1.0)]
        return ends[0], place, ends[1]


def forecast(J: Any, by_u: Any) -> tuple[Any, Any]:
    """Standard errors of `SHARES`, and singular values of the matrix, the largest first, from `Measured.matrix`."""
    _, values, rows = np.linalg.svd(J, full_matrices=False)
    return np.linalg.norm(SUM @ by_u @ rows.T / values, axis=1), values


def main(path: str, phi0: str) -> None:
    """Prints the shares of a clock's losses from a table of comma-separated values."""
    clock = Measured(*np.loadtxt(path, delimiter=",", skiprows=1, unpack=True), phi0=float(phi0))
    best = clock.fit()
    print(f"at {clock.middle:g} rad/s^2; sum of squares over the noise: {best[1]:.1f}")
    for share, name in enumerate(SHARES):
        low, here, high = clock.interval(share, best)
        print(f"{name:17} {here:4.0%}, from {low:4.0%} to {high:4.0%}")


if __name__ == "__main__":
    main(*sys.argv[1:])
