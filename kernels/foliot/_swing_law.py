"""What acts over a half swing, the law (1) and (2) of `_half_swing`, and the records that go along."""

import math
from typing import NamedTuple

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, fma, magnitude, nearest, not_, sqrt, where
from kernels.maths.elementary import power, sincos

_SHARE = 0.3
"""Of rtol that a single step may take; the rest is left to their sum."""
_ROUGH_SHARE, _SHARP_SHARE = 0.1, 0.03
"""The same for friction whose slope is not smooth at rest, near which estimates of the error are too low; and where its
degree is below 2 or torque varies: errors of v count more there."""
_SMOOTHER = 4.0
"""Degree of drag from which a step that begins or ends at rest has an error below its estimate."""
_FLOOR = 1e-4
"""Of rtol and the clock's speed: the speed below which drag of a degree below 1 is constant."""


class Swing(NamedTuple):
    """A state: way and speed, their tangents by ln mu and by v0, and Y."""

    x: float
    v: float
    x_mu: float
    v_mu: float
    x_start: float
    v_start: float
    decay: float


class Power(NamedTuple):
    """Friction gamma abs(x')^n, taken as constant below the speed `floor`."""

    gamma: float
    n: float
    floor: float


class Ripple(NamedTuple):
    """Of the torque, by (2); wave = harmonic pi/2."""

    depth: float
    wave: float


class Scales(NamedTuple):
    """What a step's errors are relative to, at least: of speed, of its tangent by ln mu, of those by v0."""

    speed: float
    weak: float
    pace: float


class Terms(NamedTuple):
    """Of (1), all but dry friction."""

    drag: float
    power: Power
    kappa: float
    ripple: Ripple
    scales: Scales


class Dry(NamedTuple):
    """1 + rho, with which dry friction helps outwards, and 1 - rho, inwards."""

    outwards: float
    inwards: float


class Leg(NamedTuple):
    """From a reversal to the next: sign of the speed, constant force; the Y after which it is uniform, and Y's rate.

    stop : speed at which it ends
    slow : speed above which power-law friction is not smooth, 0 if it is smooth
    """

    sign: float
    steady: float
    forgotten: float
    forgetting: float
    stop: float
    slow: float


class Law(NamedTuple):
    """What a right-hand side hangs on beside the state."""

    leg: Leg
    terms: Terms


class Problem(NamedTuple):
    """A cell.

    share : of rtol that a single step may take
    rough : whether friction's slope is not smooth at rest
    stiffness, pace : f'(V) and 1/V for the speed V at which friction balances the drive, within a factor of 2
    first : step
    """

    e: float
    rho_s: float
    rtol: float
    share: float
    rough: bool
    rippled: bool
    dry: Dry
    terms: Terms
    stiffness: float
    pace: float
    first: float


@jit_call
def _ripple(x, depth, wave):
    """tau(x) - 1 of (2), and its slope."""
    sine, cosine = sincos(wave * (1.0 - x))
    return depth * cosine, depth * wave * sine


@jit_call
def _drag(speed, gamma, n, floor):
    """gamma speed^n and its slope, n > 0, taken as constant below the speed `floor`."""
    within = speed > floor
    speed = where(within, speed, floor)
    slope = gamma * power(speed, n - 1.0)
    return slope * speed, where(within, n * slope, 0.0)


@jit
def held_at(friction, speed):
    """Power-law friction at a speed, 0 at rest."""
    held = 0.0 * speed
    if any_lane((friction.gamma > 0.0) & (speed > 0.0)):
        held = where(speed > 0.0, friction.gamma * power(speed, friction.n), 0.0)
    return held


@jit
def _forces(x, v, leg, terms):
    """Force towards the switch with that of friction, tau - 1, and the slopes of the force by x and by v."""
    extra, by_x = 0.0 * x, 0.0 * x
    if any_lane(terms.ripple.depth > 0.0):
        extra, by_x = _ripple(x, terms.ripple.depth, terms.ripple.wave)
    lost, by_v = 0.0 * x, 0.0 * x
    if any_lane(terms.power.gamma > 0.0):
        lost, by_v = _drag(magnitude(v), terms.power.gamma, terms.power.n, terms.power.floor)
    force = fma(terms.kappa, x, leg.steady + extra) + fma(terms.drag, v, leg.sign * lost)
    return force, extra, terms.kappa + by_x, terms.drag + by_v


@jit
def accelerations(state, law):
    """Right-hand side (1), its tangents by ln mu and by v0, and f'."""
    x, v, x_mu, v_mu, x_start, v_start, _ = state
    force, extra, by_x, by_v = _forces(x, v, law.leg, law.terms)
    by_mu = fma(by_x, x_mu, fma(by_v, v_mu, 1.0 + extra))
    return -force, -by_mu, -fma(by_x, x_start, by_v * v_start), by_v


@jit
def pull(x, terms):
    """Force of torque and spring towards the switch, tau + kappa x, less 1."""
    extra = 0.0 * x
    if any_lane(terms.ripple.depth > 0.0):
        extra, _ = _ripple(x, terms.ripple.depth, terms.ripple.wave)
    return fma(terms.kappa, x, extra)


@jit
def problem_of(scene, ripple, rtol):
    """The cell's terms.

    Friction of degree 0 is dry, of degree 1 viscous. Of a degree between, the slope at rest is infinite: below the
    floor friction is held constant.
    """
    d, rho, rho_s, gamma, n, kappa, e, slack = scene
    depth, harmonic = ripple
    dry, viscous = where(n > 0.0, 0.0, gamma), where((n > 0.0) & not_(n < 1.0) & not_(n > 1.0), gamma, 0.0)
    rho, slack, d = rho + dry, slack - dry, d + viscous
    other = dry + viscous < gamma
    gamma, n = where(other, gamma, 0.0), where(other, n, 1.0)
    by_drag, by_power = d / slack, 0.0 * d
    if any_lane(other):
        by_power = where(other, power(gamma / slack, 1.0 / n), 0.0)
    pace = by_drag + by_power
    stiffness = d + n * slack * by_power
    floor = where(n < 1.0, _FLOOR * rtol / (1.0 + pace), 0.0)
    scales = Scales(1.0 / (1.0 + pace), 1.0 / (1.0 + kappa), 1.0 / (1.0 + pace + sqrt(kappa)))
    terms = Terms(d, Power(gamma, n, floor), kappa, Ripple(depth, harmonic * (0.5 * math.pi)), scales)
    rippled = depth > 0.0
    whole = not_(nearest(n) > n) & not_(nearest(n) < n)
    rough = (gamma > 0.0) & (n < _SMOOTHER) & not_(whole)
    share = where(rippled | ((gamma > 0.0) & (n < 2.0)), _SHARP_SHARE, where(rough, _ROUGH_SHARE, _SHARE))
    first = 0.1 / (1.0 + stiffness + sqrt(kappa))
    return Problem(e, rho_s, rtol, share, rough, rippled, Dry(1.0 + rho, slack), terms, stiffness, pace, first)
