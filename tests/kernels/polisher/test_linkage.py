"""Sums of lengths, and of their squares, of which next to nothing is left, against fractions; lengths without units."""

import math
from fractions import Fraction

import numpy as np
from loops import each_cell

from kernels.lanes.columns import entry
from kernels.lanes.jit import COMPILED, jit
from kernels.lanes.vectors import where
from kernels.polisher.extremes import square_sums
from kernels.polisher.linkage import SPAN_LIMIT, Lengths, in_units, margins

N = 640 if COMPILED else 160
ULP = 2.0**-52


@jit
def _solve(i, b, d, f, e, m1, m2, m3, z1, z2, b_own, d_own, f_own, e_own, unit, fine):
    lengths = Lengths(b[i], d[i], f[i], e[i])
    m1[i], m2[i], m3[i] = margins(lengths)
    z1[i], z2[i] = square_sums(lengths)
    own, power, even = in_units(lengths)
    b_own[i], d_own[i], f_own[i], e_own[i] = own
    unit[i], fine[i] = power, where(even, 1.0, 0.0)


@entry()
def _solved(b, d, f, e, m1, m2, m3, z1, z2, b_own, d_own, f_own, e_own, unit, fine):
    each_cell(_solve, (b, d, f, e, m1, m2, m3, z1, z2, b_own, d_own, f_own, e_own, unit, fine))


def solved(cells):
    """Margins, sums of squares, lengths in units, unit, and whether they are fine: a row each."""
    found = np.full((11, len(cells)), np.nan)
    _solved(*np.ascontiguousarray(np.transpose(cells)), *found)
    return found


def sums(b, d, f, e):
    """The margins and the sums of squares."""
    b, d, f, e = (Fraction(float(x)) for x in (b, d, f, e))
    arm, coupler = d * d - b * b, f * f - e * e
    return d + f - b - e, b + f - e - d, b + d - e - f, coupler + arm, coupler - arm


def all_but_flat(random, squares, longest):
    """b, d, f, e with longest^p + e^p - near^p = short^p but for little; p is 2 for squares, else 1."""
    e, share = 10 ** random.uniform(-12, 0, 2)
    long = random.uniform(0.5, 1.0)
    near = long * (1.0 - 0.9 * share)
    p = 2 if squares else 1
    short = Fraction(long) ** p + Fraction(e) ** p - Fraction(near) ** p
    short = (math.sqrt(short) if squares else float(short)) * (
        1.0 + random.choice([0.0, 2.0 ** random.uniform(-60, -30)])
    )
    return {"b": (long, near, short, e), "d": (near, long, short, e), "f": (near, short, long, e)}[longest]


def test_margins_and_sums_of_squares_have_their_digits_where_nearly_all_of_them_cancel():
    random = np.random.default_rng(1)
    kinds = (False, "b"), (False, "d"), (False, "f"), (True, "b"), (True, "d")
    for k, kind in enumerate(kinds):
        cells = [all_but_flat(random, *kind) for _ in range(N)]
        exact = [sums(*cell) for cell in cells]
        for found, true in zip(solved(cells)[:5], np.transpose(exact), strict=True):
            for x, t in zip(found, true, strict=True):
                assert abs(Fraction(x) - t) <= 2 * ULP * abs(t), kind
        left = [math.log2(abs(t[k]) / max(cell)) for t, cell in zip(exact, cells, strict=True) if t[k]]
        assert min(left) < -80
        assert np.histogram(left, [-200, -60, -50, -40])[0].min() > N // 40


def test_lengths_without_units_are_exact_or_refused_over_the_range_of_float64():
    random = np.random.default_rng(2)
    powers = random.choice([-1060, 1024, *range(-900, 900)], (N, 1), p=[0.1, 0.1, *np.full(1800, 0.8 / 1800)])
    cells = np.ldexp(random.uniform(0.5, 1.0, (N, 4)), powers - random.integers(-160, 160, (N, 4)).clip(0))
    cells[: N // 4, 3] = 0.0
    *lengths, unit, fine = solved(cells)[5:]
    for j, cell in enumerate(cells):
        longest = max(cell)
        assert unit[j] == math.frexp(longest)[1] - 1 if longest else not fine[j]
        own = [Fraction(float(x)) / Fraction(2) ** int(unit[j]) for x in cell]
        assert fine[j] == all(x > SPAN_LIMIT or x == 0 == k - 3 for k, x in enumerate(own)), cell
        assert not fine[j] or [Fraction(float(x[j])) for x in lengths] == own
    assert 0.2 < fine.mean() < 0.8
