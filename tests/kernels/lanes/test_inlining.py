"""Parts of kernels: called from Python, inlined into others, and the arrays that they make, hand over and borrow."""

import resource
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit
from numba.extending import overload

from kernels.lanes.jit import COMPILED, jit_call


class Pair(NamedTuple):
    """A record of arrays."""

    a: np.ndarray
    b: np.ndarray


@jit_call
def ones_and_zeros(n):
    """A part that makes arrays, and hands them over."""
    return Pair(np.ones(n), np.zeros(n))


@jit_call
def add(pair):
    """A part that borrows arrays, and a record made of them."""
    again = Pair(pair.a, pair.b)
    for j in range(again.a.size):
        again.b[j] += again.a[j]


@jit_call
def added_twice(n):
    """A part that makes arrays for itself alone."""
    pair = ones_and_zeros(n)
    add(pair)
    add(pair)
    return pair.b.sum()


@pytest.mark.skipif(not COMPILED, reason="plain Python counts by itself")
def test_arrays_that_parts_borrow_are_kept_and_those_they_make_are_freed():
    lent, n = Pair(np.ones(4), np.zeros(4)), 100_000
    assert added_twice(n) == 2.0 * n
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(300):  # half a gigabyte in all
        assert added_twice(n) == 2.0 * n
        add(lent)
    assert (lent.b == 300.0).all()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 1.5 * before


def is_nan(x):
    """Given a meaning below."""


@overload(is_nan)
def _(x):
    return lambda x: x != x


def test_a_function_of_numba_beside_ours_has_the_flags_that_it_asks_for():
    ones_and_zeros(2)
    fast, strict = njit(fastmath=True)(lambda x: is_nan(x)), njit(lambda x: is_nan(x))
    fast(1.0)
    assert strict(np.nan)
