"""Positive numbers and 0 with an exponent of their own: pairs (m, e) for m 2^e, whose products never leave the range.

They serve to remove and restore a scene's units: `size` reports where a result is not a normal float64.
"""

from kernels.lanes.symbols import symbolic
from kernels.lanes.vectors import where
from kernels.maths.elementary import mantissa_exponent, measured, scale, scaled_root


@symbolic
def wide(numbers):
    """Each of a tuple of numbers with an exponent of its own; 0 where it is not above 0."""
    return tuple(mantissa_exponent(where(x > 0.0, x, 0.0)) for x in numbers)


@symbolic
def times(x, y):
    """x y."""
    return x[0] * y[0], x[1] + y[1]


@symbolic
def over(x, y):
    """x/y."""
    return x[0] / y[0], x[1] - y[1]


@symbolic
def root(x):
    """The square root."""
    return scaled_root(x[0], x[1])


@symbolic
def number(x):
    """As a float64, inf or 0 where that has no room for it."""
    return scale(x[0], x[1])


@symbolic
def size(x, unit):
    """x times a unit, as a float64; NaN where that is no normal one."""
    return measured(unit[0] * x, unit[1])
