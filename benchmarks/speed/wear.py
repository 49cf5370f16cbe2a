# How fast is the wear along a radius against nested scipy.integrate.quad of the same integral, and how right?
"""Prints ratios measured in this run, processor time of one thread, and what both are off by (needs scipy):

python benchmarks/speed/wear.py

The rival integrates over time with quad, and at each instant over arcs of the ring with quad. Arcs are found on a grid
of the ring and refined by brentq; of the instants at which they appear or vanish quad is told nothing, as one would
write it. Errors are against the kernel at rtol 1e-11. `profile`: our time a radius, of a profile of 40 radii.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from kernels.wear.ring import POLISHER_WEAR

try:
    from scipy.integrate import IntegrationWarning, quad
    from scipy.optimize import brentq
except ImportError:
    sys.exit("this benchmark needs scipy: python -m pip install scipy")

GRID = 180
"""Points of the ring at which the rival looks for arcs."""
CELLS = 64
CASES = {
    "round tool": {},
    "rhombus": {"tool_n": 1.0, "tool_m": 1.0, "tool_b": 0.08},
    "square": {"tool_n": 100.0, "tool_m": 100.0},
}
RADIUS = 0.06
PROFILE = np.linspace(0.005, 0.1, 40)


def columns(case, n):
    """One column per parameter."""
    cell = {p.name: p.default for p in POLISHER_WEAR.parameters} | dict(POLISHER_WEAR.example) | case
    return [np.full(n, float(value)) for value in cell.values()]


def ours(case, n, rtol, radii=(RADIUS,)):
    """Wear at the first radius and its error of n equal cells, and seconds per radius."""
    shape = n, len(radii)
    wear, error, status = np.empty(shape), np.empty(shape), np.empty(n, np.int8)
    start = time.thread_time()
    POLISHER_WEAR.method("contour").solve(*columns(case, n), np.full(n, rtol), np.array(radii), wear, error, status)
    return wear[0, 0], error[0, 0], (time.thread_time() - start) / wear.size


class Rival:
    """The integral as one would write it with scipy."""

    def __init__(self, case):
        self.p = dict(POLISHER_WEAR.example) | case
        p = self.p
        self.w = complex(p["w_x"], p["w_y"])
        self.links = p["b"], p["d"], p["f"], p["e"]

    def arm(self, theta):
        b, d, f, e = self.links
        crank = complex(e * math.cos(theta), e * math.sin(theta))
        far = b + crank
        length = abs(far)
        psi = math.acos((length * length + d * d - f * f) / (2 * d * length))
        alpha = math.atan2(far.imag, far.real) + psi
        arm = complex(d * math.cos(alpha), d * math.sin(alpha))
        coupler = far - arm
        rate = self.p["omega"] * (crank.conjugate() * coupler).imag / (arm.conjugate() * coupler).imag
        return alpha + self.p["b_angle"] + self.p["beta"], rate

    def at(self, theta, rtol):
        """The integral over the arcs in contact at one instant."""
        p, (phi, rate) = self.p, self.arm(theta)
        turn = complex(math.cos(phi), -math.sin(phi))

        def excess(psi):
            z = (self.w + RADIUS * complex(math.cos(psi), math.sin(psi))) * turn - p["L"]
            return abs(z.real / p["tool_a"]) ** p["tool_n"] + abs(z.imag / p["tool_b"]) ** p["tool_m"] - 1.0

        def speed(psi):
            out = RADIUS * complex(math.cos(psi), math.sin(psi))
            return abs(rate * (self.w + out) - p["Omega"] * out)

        grid = np.linspace(-math.pi, math.pi, GRID + 1)
        z = (self.w + RADIUS * np.exp(1j * grid)) * turn - p["L"]
        with np.errstate(over="ignore"):
            value = abs(z.real / p["tool_a"]) ** p["tool_n"] + abs(z.imag / p["tool_b"]) ** p["tool_m"] - 1.0
        ends = [-math.pi]
        ends += [brentq(excess, grid[k], grid[k + 1]) for k in np.nonzero((value[1:] > 0) != (value[:-1] > 0))[0]]
        ends.append(math.pi)
        first = 0 if value[0] < 0 else 1
        arcs = zip(ends[first:-1:2], ends[first + 1 :: 2], strict=False)
        return sum(quad(speed, low, high, epsabs=0.0, epsrel=rtol)[0] for low, high in arcs)

    def wear(self, rtol):
        """Wear, and seconds."""
        start = time.thread_time()
        total, _ = quad(self.at, 0.0, 2 * math.pi, args=(rtol,), epsabs=0.0, epsrel=rtol, limit=2000)
        value = self.p["preston"] * self.p["pressure"] * total / (4 * math.pi**2)
        return value, time.thread_time() - start


def main():
    """Measure and print."""
    import warnings

    warnings.simplefilter("ignore", IntegrationWarning)
    ours({}, CELLS, 1e-3)
    head = (
        ("rtol", 6),
        ("ours us", 9),
        ("off", 8),
        ("stated", 8),
        ("quad s", 8),
        ("off", 8),
        ("ratio", 8),
        ("profile us", 10),
    )
    print(f"{'one radius':22} " + " ".join(f"{text:>{width}}" for text, width in head))
    for name, case in CASES.items():
        exact = ours(case, CELLS, 1e-11)[0]
        for rtol in (1e-5, 1e-9):
            ours(case, CELLS, rtol)
            found = [ours(case, CELLS, rtol) for _ in range(3)]
            shared = ours(case, 2, rtol, PROFILE)[2]
            value, error, seconds = found[0][0], found[0][1], min(f[2] for f in found)
            theirs, spent = Rival(case).wear(rtol)
            print(
                f"{name:22} {rtol:6.0e} {seconds * 1e6:9.1f} {abs(value / exact - 1):8.1e} {error / value:8.1e}"
                f" {spent:8.2f} {abs(theirs / exact - 1):8.1e} {spent / seconds:8.0f} {shared * 1e6:8.1f}"
            )


if __name__ == "__main__":
    main()
