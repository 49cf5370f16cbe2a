"""Parts of kernels: called from Python, inlined into others, and the arrays that they make, hand over and borrow."""

import resource
from typing import NamedTuple

import numpy as np
import pytest
from columns import printed_both_ways

from kernels.lanes.jit import COMPILED, jit_call

DEEP = """
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, sqrt

@jit
def squared(x):
    return fma(x, x, 1.0)

@jit
def root(x):
    return sqrt(squared(x))

@jit_call
def both(x):
    return root(x) + squared(x)

@jit
def whole(x):
    return both(x)

print(whole(0.0), both(0.0), root(0.0), squared(0.0))
"""


def test_what_is_meant_to_be_inlined_can_be_called_from_python_however_deep_it_calls():
    """In a process of its own, since code that is not linked in is a fault of the whole process."""
    assert printed_both_ways(DEEP) == ("2.0 2.0 1.0 1.0\n",) * 2


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
