"""A block that rocks on its two corners, as a scene of one's own: without losses, and forced, against closed forms.

theta'' = p^2 (theta - corner alpha) + p^2 alpha beta cos(w t), small angles; it stands on the corner of its tilt's
sign, and an impact, theta = 0, leaves the share e of its speed (Housner, Bull. Seismol. Soc. Am. 53:403 (1963)).
"""

import numpy as np
import pytest
from columns import estimated, solve
from mpmath import mp, mpf

from kernels.cycle import cycle_kernel
from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, cos, pi

pytestmark = pytest.mark.skipif(not COMPILED, reason="a cycle takes minutes as plain Python")
BLOCK = {
    "doc": "block that rocks on its two corners",
    "states": (
        Field("theta", "rad", "tilt"), Field("omega", "rad/s", "its rate"), Field("corner", "1", "that it stands on"),
    ),
    "parameters": (
        Field("p", "rad/s", "of the block's size", default=2.0), Field("alpha", "rad", "slenderness", default=0.2),
        Field("e", "1", "share of its speed that an impact leaves", default=1.0),
        Field("beta", "1", "force over the least one that tilts", default=0.0), Field("w", "rad/s", "", default=1.0),
        Field("theta0", "rad", "tilt at the start", default=0.1), Field("omega0", "rad/s", "", default=0.0),
        Field("corner0", "1", "", default=1.0),
    ),
    "start": lambda theta0, omega0, corner0: (theta0, omega0, corner0),
    "surface": {"impact": lambda theta, corner: corner * theta},
    "switch": {"impact": lambda theta, omega, corner, e: (theta, e * omega, -corner)},
}  # fmt: skip


def forced(theta, omega, corner, t, p, alpha, beta, w):
    return omega, p * p * (theta - corner * alpha + alpha * beta * cos(w * t)), 0.0


BY_SIDE = BLOCK | {
    "states": BLOCK["states"][:2], "rates": lambda theta, omega, side, p, alpha: (omega, p**2 * (theta - side * alpha)),
    "start": lambda theta0, omega0: (theta0, omega0), "surface": lambda theta, side: side * theta,
    "switch": lambda theta, omega, e: (theta, e * omega),
}  # fmt: skip
DRIVEN = cycle_kernel(name="rocking_driven", **BLOCK, rates=forced, drive=lambda w: 2.0 * pi / w)


def test_without_losses_every_rocking_is_a_cycle_and_with_them_none():
    block = cycle_kernel(name="rocking_cycle", **BY_SIDE)
    assert solve(block, "taylor", e=[1.0, 0.9], asked=("period",))[1].tolist() == [
        Status.NO_CYCLE,
        Status.COMES_TO_REST,
    ]


def symmetric(p, alpha, e, w, beta):
    """Of the forced block, the cycle of two impacts a period: states at t = 0, largest tilt, both multipliers.

    From an impact at the phase f on, theta = alpha + A cos(w t + f) + c exp(p t) + d exp(-p t), 0 again half a period
    later; there the speed, times e, is that of the impact before, turned round. Both are linear in a = A cos(f).
    """
    A, E, half = -p * p * alpha * beta / (w * w + p * p), mp.exp(p * mp.pi / w), mp.pi / w

    def ends(a):
        c = (alpha - a - (alpha + a) / E) / (1 / E - E)
        return c, -(alpha + a) - c

    def slope(a):
        c, d = ends(a)
        return -p * (c - d + e * (c * E - d / E)) / (1 - e)

    low, rise = slope(mpf(0)), slope(mpf(1)) - slope(mpf(0))
    square, line, rest = 1 + (rise / w) ** 2, low * rise / w**2, (low / w) ** 2 - A * A
    a = (-line - mp.sqrt(line * line - square * rest)) / square
    (c, d), f = ends(a), mp.atan2(-(low + rise * a) / (A * w), a / A)

    def tilt(t):
        return alpha + A * mp.cos(w * t + f) + c * mp.exp(p * t) + d * mp.exp(-p * t)

    def speed(t):
        return -A * w * mp.sin(w * t + f) + p * (c * mp.exp(p * t) - d * mp.exp(-p * t))

    at = (mp.pi - f) / w  # the impact before t = 0 is on the other side
    top = mp.findroot(speed, (0.2 * half, 0.8 * half), solver="anderson")
    force, before = a * (w * w + p * p), speed(half)
    saltation = mp.matrix([[e, 0], [(p * p * alpha * (1 + e) + force * (1 - e)) / before, e]])
    flow = mp.matrix([[mp.cosh(p * half), mp.sinh(p * half) / p], [p * mp.sinh(p * half), mp.cosh(p * half)]])
    powers = mp.eig((flow * saltation) ** 2)[0]
    return -tilt(at), -speed(at), tilt(top), sorted(powers, key=lambda one: -abs(one))


def test_a_forced_block_has_the_cycle_and_the_multipliers_of_the_closed_form():
    e, w, beta = np.array([0.9, 0.8, 0.7, 0.9]), np.array([10.0, 6.0, 10.0, 15.0]), np.array([3.0, 3.0, 6.0, 10.0])
    with mp.workdps(50):
        true = [symmetric(*map(mpf, (2.0, 0.2, *cell))) for cell in zip(e, w, beta, strict=True)]
        guess = np.array([[float(x) for x in cell[:2]] for cell in true]).T
        size = np.array([float(cell[2]) for cell in true])
        powers = np.array([[complex(x) for x in cell[3]] for cell in true])
    found, status, error = estimated(
        DRIVEN, "taylor", e=e, w=w, beta=beta, flips=1.0, settle=0.0, theta0=1.001 * guess[0], omega0=guess[1],
        corner0=-1.0, along=[np.array([1.0, 2.0, 3.0])], rtol=1e-8,
    )  # fmt: skip
    stable = abs(powers[:, 0]) < 1.0
    assert (status == np.where(stable, Status.OK, Status.UNSTABLE)).all()
    assert (error <= 1e-8).all()
    assert abs(found["theta"] / guess[0] - 1.0).max() < 1e-9
    assert abs(found["omega"] / guess[1] - 1.0).max() < 1e-9
    assert abs(found["theta_size"] / size - 1.0).max() < 1e-9
    parts = found["multipliers_real"][:, :2] + 1j * found["multipliers_imaginary"][:, :2]
    assert abs(parts - (powers.real + 1j * abs(powers.imag))).max() < 1e-9 * max(1.0, abs(powers).max())
