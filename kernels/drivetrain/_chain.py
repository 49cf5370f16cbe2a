"""A drivetrain as a chain of inertias: what may be asked of it, and its units.

    J_1 -k_1- J_2 -k_2- ... - J_n -k_n- ground,  with a damper h_j beside every spring k_j              (1)
Its left end is free, its right end is held by k_n; k_n = 0 leaves it free. With x_(n+1) = 0 it moves by
    J_j x_j'' = k_(j-1) (x_(j-1) - x_j) - k_j (x_j - x_(j+1)) + the same with h and x'.                 (2)
Source: the drivetrain of a milling machine, type-a and type-b partial systems after Rivin; layout checked there.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.lanes.codes import BAD_INPUT, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, nearest, not_, where
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW

MASS_LIMIT = 64
"""Inertias of the longest chain."""
SPREAD = 2.0**300
"""Largest ratio of two inertias, or of two stiffnesses, of one chain: what leaves room for inverse squares."""


class Scaled(NamedTuple):
    """A chain, and the exponents of the units that its inertias and stiffnesses are taken in."""

    J: np.ndarray
    k: np.ndarray
    h: np.ndarray
    e_J: float
    e_k: float


@jit
def same(j):
    """Where entry j of one chain is kept: at j."""
    return j


@jit
def extremes(n, at, column):
    """Smallest and largest of n positive numbers; zeros and NaN are passed over."""
    low, high = math.inf + 0.0 * column[at(0)], 0.0 * column[at(0)]
    for j in range(n):
        value = column[at(j)]
        low = where((value > 0.0) & (value < low), value, low)
        high = where(value > high, value, high)
    return low, high


@jit
def units(n, at, J, k):
    """Exponents e_J, e_k of 2^e near the largest inertia and stiffness, both even; and whether all is in range."""
    low_J, high_J = extremes(n, at, J)
    low_k, high_k = extremes(n, at, k)
    free = not_(high_k > 0.0)  # one inertia alone
    sound = normal_spread(low_J, high_J) & (free | normal_spread(low_k, high_k))
    e_J, e_k = exponent(where(sound, high_J, 1.0)), exponent(where(sound & not_(free), high_k, 1.0))
    return 2.0 * nearest(0.5 * e_J), 2.0 * nearest(0.5 * e_k), sound


@jit
def normal_spread(low, high):
    """Whether positive numbers from `low` to `high` are normal and within SPREAD of each other."""
    return (low >= NORMAL_LOW) & (high <= NORMAL_HIGH) & (low >= high / SPREAD)


@jit_apart
def refusal(n, J, k):
    """BAD_INPUT, OUT_OF_RANGE or OK of one chain of n inertias, each within its limits."""
    if not (1 <= n <= MASS_LIMIT):
        return BAD_INPUT
    for j in range(n - 1):
        if not k[j] > 0.0:
            return BAD_INPUT
    return OK if units(n, same, J, k)[2] else OUT_OF_RANGE
