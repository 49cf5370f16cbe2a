"""The foliot with one loss alone: limit cycles in closed form.

Dry friction rho: A = 1/rho, T = 2 sqrt(2/(rho (1 - rho^2))), v^2 = 2 (1 - rho^2)/rho, s = rho^2/(1 - rho^2).        (1)
Drag gamma v^2, lambda = v/V: lambda^4 = 1 - exp(-4 gamma), T = (artanh lambda + arctan lambda)/sqrt(gamma), s = 1/2 (2)
Restitution e: A = (1 + e^2)/(1 - e^2), or 1 for e < 0, T = 2 sqrt((1 + e)/(1 - e)), s = 1/2.                        (3)
T is half the period; units and records as in `_units`. Derived from the general law of friction.
"""

import math

from kernels.foliot._units import Cycle, errors
from kernels.lanes.codes import NO_METHOD, OK
from kernels.lanes.jit import jit
from kernels.lanes.vectors import any_lane, choose, fma, not_, sqrt, where
from kernels.maths.elementary import arctan, exp, expm1, log1p

ROUNDING = 2e-15
"""What the closed forms are right to; the multiplier to twice that."""


@jit
def _acting(scene):
    """Whether dry friction, quadratic drag or restitution acts alone: one of three, or none."""
    smooth, elastic = not_(scene.d > 0.0) & not_(scene.kappa > 0.0), scene.e >= 1.0
    solid, drag = scene.rho > 0.0, scene.gamma > 0.0
    square = drag & (scene.n >= 2.0) & (scene.n <= 2.0)
    return (
        smooth & elastic & solid & not_(drag),
        smooth & elastic & not_(solid) & square,
        smooth & not_(elastic) & not_(solid) & not_(drag),
    )


@jit
def pure(scene, rtol):
    """The cycle where one loss acts alone; else NO_METHOD."""
    rho, slack, gamma, e = scene.rho, scene.slack, scene.gamma, scene.e
    alone, drag, switch = _acting(scene)

    # (3) and (1)
    e = where(switch, e, 0.0)
    lost = (1.0 - e) * (1.0 + e)
    amplitude = where(e > 0.0, fma(e, e, 1.0) / lost, 1.0)
    elastic = Cycle(2.0 * sqrt((1.0 + e) / (1.0 - e)), amplitude, 2.0 / sqrt(lost), 0.5, e * e)
    cycle = choose(alone, dry(where(alone, rho, 0.5), where(alone, slack, 0.5)), elastic)

    # (2); artanh lambda = 2 gamma + ln(1 + lambda) + ln(1 + lambda^2)/2 has all digits up to lambda = 1
    if any_lane(drag):
        gamma = where(drag, gamma, 1.0)
        square = sqrt(-expm1(-4.0 * gamma))
        lam, root, swell = sqrt(square), sqrt(gamma), log1p(square)
        half = (2.0 * gamma + log1p(lam) + 0.5 * swell + arctan(lam)) / root
        kept = exp(-2.0 * gamma) / (1.0 + square)
        cycle = choose(drag, Cycle(half, 1.0 + swell / (2.0 * gamma), lam / root, 0.5, kept * kept), cycle)
    return cycle, where(alone | drag | switch, OK, NO_METHOD)


@jit
def dry(rho, slack):
    """The cycle (1)."""
    left = slack * (1.0 + rho)  # 1 - rho^2
    half = 2.0 * sqrt(2.0 / (rho * left))
    return Cycle(half, 1.0 / rho, sqrt(2.0 * left / rho), rho * rho / left, slack / (1.0 + rho))


@jit
def bound(scene):
    """Relative errors of `pure`: rounding, and infinite where no loss acts alone."""
    alone, drag, switch = _acting(scene)
    rounding = where(alone | drag | switch, ROUNDING, math.inf)
    return errors(rounding, rounding, 2.0 * rounding)
