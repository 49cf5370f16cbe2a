"""The impact clock without dimensions, and back: crown wheel and foliot, free between inelastic impacts.

x = r_c th_c is the way of the wheel's rim, y = r_v th_v that of the pallets, M = I_c/r_c^2 and m = I_v/r_v^2 their
masses there, kappa = M/m. The torque pushes the rim with F = torque/r_c, g = F/M. In units of the tooth pitch
p = 2 pi r_c/teeth and of T0 = sqrt(p/g)
    free flight         x'' = 1,  y'' = 0                                                              (1)
    upper pallet meets  x - U(y) = j          while y < eta,  eta = h/p                                 (2)
    lower pallet meets  x - U(-y) = j + 1/2   while y > -eta,  for every integer j                      (3)
    impact              speed of closing times -e, with M x' + m y'/U' kept                             (4)
The reflection y -> -y, x -> x - 1/2 turns (3) into (2); (4) is for the upper pallet, the lower one is its reflection.
The lever is flat, U(y) = y, or bent about the place y_i = -Y of impact of the symmetric cycle:
    U(y) = y + (c/2) (y - y_i)^2,  c = nu/T^2,                                                         (5)
    T^2 = (1 + e)/((1 - e)(1 + kappa)),  Y = kappa T^2/4.                                              (6)
So nu = (U''/U'^2) g T^2 leaves that cycle as it is and bends what is beside it, and flights stay parabolas.

Leaves out friction, play of the pivots, and the width of teeth and pallets. Derived here.
"""

import math
from typing import NamedTuple

from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged, or_none
from kernels.lanes.vectors import choose, magnitude, not_, where
from kernels.maths import pairs as _pairs
from kernels.maths.elementary import in_unit, is_normal, mantissa_exponent, measured, scale, scaled_root

HALF_PITCH = 2e-15
"""Share of p/4 within which h is p/4."""
MOST_TEETH = 2.0**31 - 1.0
MOST_E = math.nextafter(1.0, 0.0)

_TWO_PI = (2.0 * math.pi, 2.0 * 1.2246467991473532e-16)
_KAPPA_LIMIT = 900.0
"""log2 of kappa beyond which products would leave float64."""


class Scene(NamedTuple):
    """The clock without dimensions; all but e and nu are pairs of `pairs`.

    wheel = M/(M + m), pallet = m/(M + m); slack = 1 - 4 eta is exactly 0 at h = p/4 (within HALF_PITCH): no drop.
    """

    wheel: tuple
    pallet: tuple
    kappa: tuple
    eta: tuple
    slack: tuple
    e: float
    nu: float


class Cycle(NamedTuple):
    """A cycle without dimensions: speeds are those just after impact, `back` is the way the rim is thrown back.

    `held` is the share of time in contact, `impacts` are those in half a period, `offset` is how far the middle of the
    swing is off.
    """

    half_period: float
    travel: float
    rim: float
    pallet: float
    multiplier: float
    back: float
    held: float
    impacts: float
    offset: float


class Units(NamedTuple):
    """T0, p, and the share r_c/r_v, each a mantissa and an exponent; 2 pi/teeth; and whether kappa is in range."""

    time: float
    e_time: float
    pitch: float
    e_pitch: float
    arm: float
    e_arm: float
    step: float
    fine: bool


@jit
def escape(r_c, teeth, h):
    """eta = h teeth/(2 pi r_c) and slack = 1 - 4 eta, as pairs."""
    m, e = mantissa_exponent(r_c)
    high = where(h < 4.0 * r_c, h, 4.0 * r_c)  # beyond p/4 for any number of teeth
    eta = _pairs.over(_pairs.two_product(in_unit(high, e), teeth), _pairs.scaled(_TWO_PI, m))
    slack = _pairs.shifted((-4.0 * eta[0], -4.0 * eta[1]), 1.0)
    there = magnitude(slack[0]) <= HALF_PITCH
    return eta, choose(there, (0.0, 0.0), slack)


@jit
def without_dimensions(p):
    """The scene and its units.

    M/m = I_c r_v^2/(I_v r_c^2), both masses pairs in a common unit, the larger in [1/2, 8). T0^2 = p M/F =
    2 pi I_c/(teeth torque) has no r_c in it.
    """
    (m_c, e_c), (m_v, e_v) = mantissa_exponent(p.I_c), mantissa_exponent(p.I_v)
    (s_c, f_c), (s_v, f_v) = mantissa_exponent(p.r_c), mantissa_exponent(p.r_v)
    wheel = _pairs.times((m_c, 0.0 * m_c), _pairs.two_product(s_v, s_v))
    pallet = _pairs.times((m_v, 0.0 * m_v), _pairs.two_product(s_c, s_c))
    e = (e_c + 2.0 * f_v) - (e_v + 2.0 * f_c)
    fine = magnitude(e) < _KAPPA_LIMIT
    e = where(fine, e, 0.0)
    light, heavy = where(e < 0.0, e, 0.0), where(e > 0.0, -e, 0.0)
    wheel, pallet = (scale(wheel[0], light), scale(wheel[1], light)), (scale(pallet[0], heavy), scale(pallet[1], heavy))
    both = _pairs.add(wheel, pallet)
    eta, slack = escape(p.r_c, p.teeth, p.h)
    shares = _pairs.over(wheel, both), _pairs.over(pallet, both)
    scene = Scene(shares[0], shares[1], _pairs.over(wheel, pallet), eta, slack, p.e, p.nu)

    m_tau, e_tau = mantissa_exponent(p.torque)
    step = _TWO_PI[0] / p.teeth
    time, e_time = scaled_root(step * (m_c / m_tau), e_c - e_tau)
    return scene, Units(time, e_time, step * s_c, f_c, s_c / s_v, f_c - f_v, step, fine)


@jit
def given(units, cycle, verdict):
    """The outputs, each size NaN where it is no normal number nor 0, and the status."""
    rate = units.step / units.time
    period = measured(2.0 * units.time * cycle.half_period, units.e_time)
    swing = measured(units.pitch * cycle.travel, units.e_pitch)
    wheel_speed = scale(rate * cycle.rim, -units.e_time)
    pallet_speed = scale(rate * units.arm * cycle.pallet, units.e_arm - units.e_time)
    rolls, beats = _normal_or_none(cycle.rim, wheel_speed), _normal_or_none(cycle.pallet, pallet_speed)
    whole = (period > 0.0) & (swing > 0.0) & rolls & beats
    speeds, recoil = (or_none(wheel_speed, rolls), or_none(pallet_speed, beats)), units.step * cycle.back
    middle = scale(units.pitch * cycle.offset, units.e_pitch)
    outputs = period, swing, *speeds, cycle.multiplier, recoil, cycle.held, cycle.impacts, middle
    return outputs, judged(units.fine, whole, verdict)


@jit
def _normal_or_none(x, result):
    """Whether a result is a normal number where what it comes from is not 0."""
    return not_(magnitude(x) > 0.0) | is_normal(magnitude(result))


UNITS = without_dimensions, given
