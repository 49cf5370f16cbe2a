"""The foliot with one loss alone: limit cycles in closed form.

Dry friction rho: A = 1/rho, T = 2 sqrt(2/(rho (1 - rho^2))), v^2 = 2 (1 - rho^2)/rho, s = rho^2/(1 - rho^2).        (1)
Drag gamma v^2, lambda = v/V: lambda^4 = 1 - exp(-4 gamma), T = (artanh lambda + arctan lambda)/sqrt(gamma), s = 1/2 (2)
Restitution e: A = (1 + e^2)/(1 - e^2), or 1 for e < 0, T = 2 sqrt((1 + e)/(1 - e)), s = 1/2.                        (3)
T is half the period; units and records as in `_units`. Derived from the general law of friction.
"""

import math
from typing import NamedTuple

from kernels.foliot._units import Cycle, errors
from kernels.lanes.jit import jit
from kernels.lanes.vectors import any_lane, choose, fma, not_, sqrt, where
from kernels.maths.elementary import arctan, exp, expm1, log1p

ROUNDING = 2e-15
"""What the closed forms are right to; the multiplier to twice that."""


class Law(NamedTuple):
    """A scene without spring: drag of degree 0 is dry friction, and the degree does no harm where there is no drag."""

    d: float
    rho: float
    gamma: float
    n: float
    e: float
    slack: float


@jit
def without_degree_0(scene):
    """The law of friction of a scene."""
    dry = not_(scene.n > 0.0)
    rho, slack = where(dry, scene.rho + scene.gamma, scene.rho), where(dry, scene.slack - scene.gamma, scene.slack)
    gamma = where(dry, 0.0, scene.gamma)
    return Law(scene.d, rho, gamma, where(gamma > 0.0, scene.n, 1.0), scene.e, slack)


@jit
def _acting(d, rho, gamma, n, e, kappa):
    """Whether dry friction, quadratic drag or restitution acts alone: one of three, or none."""
    smooth, elastic = not_(d > 0.0) & not_(kappa > 0.0), e >= 1.0
    solid, drag = rho > 0.0, gamma > 0.0
    square = drag & (n >= 2.0) & (n <= 2.0)
    return (
        smooth & elastic & solid & not_(drag),
        smooth & elastic & not_(solid) & square,
        smooth & not_(elastic) & not_(solid) & not_(drag),
    )


@jit
def pure(scene):
    """The cycle where one loss acts alone, and whether one does."""
    d, rho, gamma, n, e, slack = without_degree_0(scene)
    alone, drag, switch = _acting(d, rho, gamma, n, e, scene.kappa)
    cycle = choose(alone, dry(where(alone, rho, 0.5), where(alone, slack, 0.5)), _switch(where(switch, e, 0.0)))
    if any_lane(drag):
        cycle = choose(drag, _drag(where(drag, gamma, 1.0)), cycle)
    return cycle, alone | drag | switch


@jit
def bound(p):
    """Relative errors of `pure` for a `Foliot`: rounding, and infinite where no loss acts alone."""
    degree_0 = not_(p.n > 0.0)
    alone, drag, switch = _acting(p.a, p.R + where(degree_0, p.c, 0.0), where(degree_0, 0.0, p.c), p.n, p.e, p.k)
    rounding = where(alone | drag | switch, ROUNDING, math.inf)
    return errors(rounding, rounding, 2.0 * rounding)


@jit
def dry(rho, slack):
    """The cycle (1)."""
    left = slack * (1.0 + rho)  # 1 - rho^2
    half = 2.0 * sqrt(2.0 / (rho * left))
    return Cycle(half, 1.0 / rho, sqrt(2.0 * left / rho), rho * rho / left, slack / (1.0 + rho))


@jit
def _switch(e):
    """The cycle (3)."""
    lost = (1.0 - e) * (1.0 + e)
    amplitude = where(e > 0.0, fma(e, e, 1.0) / lost, 1.0)
    return Cycle(2.0 * sqrt((1.0 + e) / (1.0 - e)), amplitude, 2.0 / sqrt(lost), 0.5, e * e)


@jit
def _drag(gamma):
    """The cycle (2); artanh lambda = 2 gamma + ln(1 + lambda) + ln(1 + lambda^2)/2 has all digits up to lambda = 1."""
    square = sqrt(-expm1(-4.0 * gamma))
    lam, root, swell = sqrt(square), sqrt(gamma), log1p(square)
    half = (2.0 * gamma + log1p(lam) + 0.5 * swell + arctan(lam)) / root
    kept = exp(-2.0 * gamma) / (1.0 + square)
    return Cycle(half, 1.0 + swell / (2.0 * gamma), lam / root, 0.5, kept * kept)
