"""Which polishing machine swings its arm by a wanted amount, as harmonically as its motor allows?

    python studies/inverse_design.py

A worked example of `sweep.solver`: the kernel as a function of the crank and the coupler, found by scipy's optimisers.
"""

import math

import numpy as np
from scipy.optimize import brentq, minimize_scalar

import sweep

ARM = 0.380
"""d [m]."""
MOTOR = 0.620
"""b, from the arm's pivot to the motor's shaft [m]."""
AMPLITUDE = math.radians(15.0)
CRANKS = np.linspace(1e-3, 0.3, 300)
"""e [m], among which the right one is looked for."""
STUDY = {"kernel": "polisher", "rtol": 1e-10, "outputs": ["A1", "thd"], "axes": {"f": [0.5], "e": [0.08]}}
machine = sweep.solver({**STUDY, "fixed": {"b": MOTOR, "d": ARM}})
"""A machine's half amplitude [rad] and distortion [1], of coupler f and crank e [m]."""


def crank(f: float, amplitude: float = AMPLITUDE) -> float:
    """The crank [m] that swings the arm by the amplitude [rad], for a coupler f [m]; NaN where none does.

    Many cranks at once tell where the amplitude is passed, single ones to the last digit where.
    """
    beyond = amplitude < machine(f, CRANKS).A1
    if not beyond.any() or beyond[0]:
        return math.nan
    first = int(beyond.argmax())
    return float(brentq(lambda e: machine(f, e).A1 - amplitude, CRANKS[first - 1], CRANKS[first], xtol=1e-15))


def distortion(f: float, amplitude: float = AMPLITUDE) -> float:
    """Of the machine with the coupler f; infinite where no crank gives the amplitude."""
    e = crank(f, amplitude)
    return float(machine(f, e).thd) if math.isfinite(e) else math.inf


def best(shortest: float = 0.30, longest: float = 0.70) -> tuple[float, float, float]:
    """Coupler and crank [m] of the least distorted machine of the amplitude, and its distortion; couplers in bounds."""
    found = minimize_scalar(distortion, bounds=(shortest, longest), method="bounded", options={"xatol": 1e-9})
    return found.x, crank(found.x), found.fun


if __name__ == "__main__":
    f, e, distorted = best()
    print(f"coupler {1e3 * f:.3f} mm, crank {1e3 * e:.4f} mm: distortion {100 * distorted:.4f} %")
