"""Machine code of parts and entries, and where vectors lie in memory."""

import gc
import re
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from columns import printed_both_ways
from loops import each_cell
from numba import float64, njit
from numba.core.runtime import _nrt_python, rtsys

from kernels.lanes.columns import entry, entry_of
from kernels.lanes.groups import GROUP, room
from kernels.lanes.inlining import LINE
from kernels.lanes.jit import COMPILED, jit, jit_call
from kernels.lanes.vectors import fma, sqrt


@jit_call
def _root(x, y):
    return sqrt(fma(x, y, 1.0))


@jit
def _cell(i, x, y, z):
    z[i] = _root(x[i], y[i]) + _root(y[i], y[i])


@entry()
def roots(x, y, z):
    """sqrt(x y + 1) + sqrt(y^2 + 1)."""
    each_cell(_cell, (x, y, z))


@jit
def _offsets(counts, found):
    for i in range(counts.size):
        space = room(counts[i])
        found[i, 0], found[i, 1] = np.int64(space.ctypes.data) % LINE, space.size


@entry("counts", "found")
def offsets(counts, found):
    """Of rooms: bytes from the last border of a cache line, and size."""
    _offsets(counts, found)


def test_rooms_begin_on_the_border_of_a_cache_line():
    counts = np.repeat(np.arange(1, 30), 3)
    found = np.full((counts.size, 2), -1)
    offsets(counts, found)
    assert (found[:, 0] == 0).all()
    assert (found[:, 1] == counts * GROUP).all()


@pytest.mark.skipif(not COMPILED, reason="plain Python has no stack of ours")
def test_the_stack_of_machine_code_begins_on_such_a_border():
    columns = np.linspace(0.0, 1.0, 40), np.ones(40), np.empty(40)
    roots(*columns)
    assert (columns[2] == np.sqrt(columns[0] + 1.0) + np.sqrt(2.0)).all()
    (text,) = roots.compiled.inspect_llvm().values()
    wide = re.findall(r"^attributes (#\d+) = \{.* alignstack=64 ", text, re.M)
    defined = [line.split()[-2] for line in text.splitlines() if line.startswith("define") and "NRT" not in line]
    assert set(defined) <= set(wide) != set()


@jit_call
def _applied(function, x):
    return function(x, x)


@jit
def _apply(i, x, z):
    z[i] = _applied(_root, x[i])


@entry()
def apply(x, z):
    """sqrt(x^2 + 1), by a function that is given one."""
    each_cell(_apply, (x, z))


@pytest.mark.skipif(not COMPILED, reason="plain Python has no machine code")
def test_machine_code_holds_no_address_of_a_function_that_is_given_to_another():
    columns = np.arange(40.0), np.empty(40)
    apply(*columns)
    assert (columns[1] == np.sqrt(columns[0] ** 2 + 1.0)).all()
    (result,) = _apply.overloads.values()
    assert "dynamic.globals" not in result.library.get_llvm_str()


@pytest.mark.skipif(not COMPILED, reason="plain Python has no machine code")
@pytest.mark.parametrize("wanted", [True, False])
def test_garbage_is_collected_after_compiling_as_before(wanted):
    (gc.enable if wanted else gc.disable)()
    try:
        apply.compiled.compile((float64[::1], float64[::1]))
        assert gc.isenabled() == wanted
    finally:
        gc.enable()


def seen(count, total):
    """total = how many cells one call is given."""
    for i in range(count.size):
        total[i] = count.size


@pytest.mark.parametrize("n", [1, 3, 40])
def test_what_takes_one_cell_at_a_time_is_not_given_more(n):
    count, total = np.ones(n), np.zeros(n)
    count.flags.writeable = False
    entry_of(seen, None, kept=False)(count, total)
    assert (total == n).all()


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


@jit_call
def sums_added(n):
    """Calls a part that keeps no array."""
    total = 0.0
    for m in range(1, n):
        total += added_twice(m)
    return total


def allocated():
    """How many arrays of compiled code are not freed yet."""
    stats = rtsys.get_allocation_stats()
    return stats.alloc - stats.free


@pytest.mark.skipif(not COMPILED, reason="plain Python counts by itself")
def test_arrays_that_parts_borrow_are_kept_and_those_they_make_are_freed():
    _nrt_python.memsys_enable_stats()
    assert sums_added(3) == 6.0  # parts of parts, called from Python
    held, lent = allocated(), Pair(np.ones(4), np.zeros(4))
    for n in range(1, 40):
        assert sums_added(n) == n * (n - 1.0)
        add(lent)
    assert allocated() == held
    assert (lent.b == 39.0).all()


@pytest.mark.skipif(not COMPILED, reason="plain Python loads no compiler")
def test_a_kernel_runs_without_scipys_linear_algebra():
    lines = (
        "import sys, numpy as np",
        "from kernels import catalogue",
        "kernel = catalogue.get('polisher')",
        "kernel.check(*(np.ones(40) for _ in kernel.parameters), np.zeros(40, np.int8))",
        "assert 'numba.np.arraymath' in sys.modules and 'scipy.linalg' not in sys.modules",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True)


def _numbers_and_arrays(a, x, y):
    """Sums that numba gives different meanings."""
    return (1 + 2) + (a[0] + x) + (a + y)[1] + (a + a)[0]


@pytest.mark.skipif(not COMPILED, reason="of the compiler's own")
def test_operators_keep_their_meaning_for_numbers_and_arrays():
    a = np.array([0.5, 1.5])
    roots(np.ones(40), np.ones(40), np.empty(40))  # from here on what operators make of numbers is remembered
    compiled = njit(_numbers_and_arrays)
    for x, y in ((1, 2.0), (1.0, 2), (True, 2.0), (1j, 2.0)):
        assert compiled(a, x, y) == _numbers_and_arrays(a, x, y)
