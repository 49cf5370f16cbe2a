"""Interval arithmetic (low, high) on a scene's operations over a box of states; generic in one cell or lanes.

Without outward rounding, intervals are too narrow by a few roundings, which does not matter for their purpose: to bound
the variation between two points. NaN is kept, so that comparisons with it fail.
"""

import math

from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, not_, sqrt, where
from kernels.maths.elementary import arccos, arcsin, cosh, exp, hypot, log, power, sincos

CHANGE, LOG_CHANGE = 8.0, 2.0
"""Factor by which what has no polynomial (exp u, 1/u, sqrt u, ln u, u^n) may change and still be seen where a step
begins. Within it, a series that leaves out more than some hundred tolerances has a last term above the tolerance."""


@jit
def least(x, y):
    """The smaller one; NaN stays."""
    return where(x < y, x, where(y <= x, y, x + y))


@jit
def most(x, y):
    """The larger one; NaN stays."""
    return where(x > y, x, where(y >= x, y, x + y))


@jit
def largest(u):
    """The largest magnitude in an interval."""
    return most(magnitude(u[0]), magnitude(u[1]))


@jit
def smallest(u):
    """The smallest magnitude in an interval."""
    return where(u[0] > 0.0, u[0], where(u[1] < 0.0, -u[1], 0.0))


@jit
def widened(u, by):
    """An interval with a margin on both sides."""
    return u[0] - by, u[1] + by


@jit
def added(u, w):
    """u + w."""
    return u[0] + w[0], u[1] + w[1]


@jit
def times(x, y):
    """x y, where 0 times whatever is 0: a term that a parameter switches off."""
    nothing = ((x <= 0.0) & (x >= 0.0)) | ((y <= 0.0) & (y >= 0.0))
    return where(nothing, 0.0, x * y)


@jit
def multiplied(u, w):
    """u w."""
    a, b, c, d = times(u[0], w[0]), times(u[0], w[1]), times(u[1], w[0]), times(u[1], w[1])
    return least(least(a, b), least(c, d)), most(most(a, b), most(c, d))


@jit
def half_squared(u):
    """u^2/2."""
    return 0.5 * (smallest(u) * smallest(u)), 0.5 * (largest(u) * largest(u))


@jit
def over(w):
    """1/w; everything where w may be 0."""
    apart = (w[0] > 0.0) | (w[1] < 0.0)
    return where(apart, 1.0 / w[1], -math.inf), where(apart, 1.0 / w[0], math.inf)


@jit
def above(u):
    """The part of an interval that is not below 0."""
    return where(u[0] < 0.0, 0.0, u[0]), u[1]


@jit
def within_one(u):
    """The part of an interval in [-1, 1]; NaN stays."""
    return where(u[0] < -1.0, -1.0, u[0]), where(u[1] > 1.0, 1.0, u[1])


@jit
def _all(u):
    return u


def _rising(function, part=_all):
    """A rising function of the part of an interval where it is defined."""

    @jit
    def of_interval(u):
        low, high = part(u)
        return function(low), function(high)

    return of_interval


of_sqrt, of_log = _rising(sqrt, above), _rising(log, above)
of_exp, of_arcsin = _rising(exp), _rising(arcsin, within_one)


@jit
def of_arccos(u):
    """arccos u."""
    low, high = within_one(u)
    return arccos(high), arccos(low)


@jit
def of_sin(u):
    """sin u."""
    (low, low_slope), (high, high_slope) = sincos(u[0]), sincos(u[1])
    return _of_wave(u[1] - u[0], low, high, low_slope, high_slope)


@jit
def of_cos(u):
    """cos u."""
    (low_slope, low), (high_slope, high) = sincos(u[0]), sincos(u[1])
    return _of_wave(u[1] - u[0], low, high, -low_slope, -high_slope)


@jit
def _of_wave(wide, low, high, low_slope, high_slope):
    """From values and slopes at both ends: within half a wave it turns once at most."""
    short = wide < 3.14
    top = (low_slope >= 0.0) & (high_slope <= 0.0)
    bottom = (low_slope <= 0.0) & (high_slope >= 0.0)
    least_of, most_of = least(low, high), most(low, high)
    return where(bottom | not_(short), 0.0 * wide - 1.0, least_of), where(top | not_(short), 0.0 * wide + 1.0, most_of)


@jit
def of_cosh(u):
    """cosh u."""
    return cosh(smallest(u)), cosh(largest(u))


@jit
def of_hypot(u, w):
    """sqrt(u^2 + w^2)."""
    return hypot(smallest(u), smallest(w)), hypot(largest(u), largest(w))


@jit
def of_power(u, n):
    """u^n."""
    low, high = above(u)
    at_low = where(low > 0.0, power(where(low > 0.0, low, 1.0), n), where(n > 0.0, 0.0, math.inf))
    at_high = power(high, n)
    return least(at_low, at_high), most(at_low, at_high)


@jit
def hidden_by_exp(value, u):
    """What of e^u cannot be seen at a point where u has that value: all, where it grows too much."""
    return where(u[1] - value <= LOG_CHANGE, 0.0, exp(u[1]))


@jit
def hidden_by_over(value, w, quotient):
    """What of a quotient cannot be seen where its divisor w has that value: all, where w comes too close to 0."""
    return where(smallest(w) * CHANGE >= magnitude(value), 0.0, largest(quotient))


@jit
def hidden_by_root(value, u, root):
    """What of sqrt u or ln u cannot be seen where u has that value: all, where u comes too close to 0."""
    return where(u[0] * CHANGE >= value, 0.0, root[1] - root[0])


@jit
def hidden_by_power(value, of_value, u, raised):
    """What of u^n cannot be seen where u has that value: all, where u comes too close to 0, or u^n grows too much."""
    return where((u[0] * CHANGE >= value) & (raised[1] <= CHANGE * of_value), 0.0, raised[1])


@jit
def hidden_by_step(nearer, further, of_u):
    """What of a function with steep places cannot be seen: all that it changes by, where its slope may grow too much.

    `nearer` and `further` are 1 over the slope, where it is steepest and where the function is known.
    """
    return where(nearer * CHANGE >= further, 0.0, of_u[1] - of_u[0])


@jit
def hidden_by_tanh(value, u, of_u):
    """What of tanh u cannot be seen where u has that value."""
    near, far = cosh(smallest(u)), cosh(value)
    return where(near <= 1e150, hidden_by_step(near * near, far * far, of_u), of_u[1] - of_u[0])


@jit
def hidden_by_arctan(value, u, of_u):
    """What of arctan u cannot be seen where u has that value."""
    return hidden_by_step(1.0 + smallest(u) * smallest(u), 1.0 + value * value, of_u)


@jit
def hidden_by_arcsin(value, u, of_u):
    """What of arcsin u and arccos u cannot be seen where u has that value."""
    return hidden_by_step(1.0 - largest(u) * largest(u), 1.0 - value * value, of_u)


@jit
def hidden_by_sinh(value, u):
    """What of sinh u and cosh u cannot be seen where u has that value: all, where they grow too much."""
    return where(largest(u) - magnitude(value) <= LOG_CHANGE, 0.0, cosh(largest(u)))


@jit
def hidden_by_hypot(value, of_u):
    """What of a root of squares cannot be seen where it has that value: all, where it comes too close to 0."""
    return hidden_by_step(of_u[0] * of_u[0], value * value, of_u)
