"""The table of laws: each a curve ln y(ln x) that is linear in all but a few of its numbers.

    z = shift(q) + columns(q) b,   s = (ln x - first) / span from 0 to 1                            (1)

q are those few; positions and widths are parts of the window, exponents per window.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import expit

from sweep.laws.loglog import Array


class Parts(NamedTuple):
    """Shift (n,) and columns (n, k) of (1), and their derivatives by each q: (n, q) and (n, q, k)."""

    shift: Array | float
    columns: Array
    shift_by_q: Array
    columns_by_q: Array


class Law(NamedTuple):
    """One of the curves."""

    name: str
    formula: str
    parts: Callable[[Array, Array, float], Parts]
    """Of (q, s, span), with derivatives."""
    starts: Sequence[Sequence[float]] = ()
    """Values of each q to start from,"""
    limits: Sequence[tuple[float, float]] = ()
    """and the least and largest that it may have."""
    numbers: int = 2
    exponents: tuple[str, ...] = ()
    """Names of the exponents, which are the last numbers b."""
    power: bool = True
    """Whether it is a power law or several, and not another function."""


def _linear(*functions: Callable[[Array, float], Array]) -> Callable[[Array, Array, float], Parts]:
    """A law that is linear in all its numbers: a constant and these functions of s and the span."""

    def parts(q: Array, s: Array, span: float) -> Parts:
        columns = np.stack([np.ones_like(s), *(one(s, span) for one in functions)], axis=1)
        return Parts(0.0, columns, np.empty((s.size, 0)), np.empty((s.size, 0, columns.shape[1])))

    return parts


def _slope(s: Array, span: float) -> Array:
    return s


def _beside_line(shift: Array, *by_q: Array, s: Array) -> Parts:
    """A power law times a factor whose logarithm is the shift."""
    columns = np.stack([np.ones_like(s), s], axis=1)
    return Parts(shift, columns, np.stack(by_q, axis=1), np.zeros((s.size, len(by_q), 2)))


def _logarithm(q: Array, s: Array, span: float) -> Parts:
    factor = 1 + q[0] * (s - 0.5)
    return _beside_line(np.log(factor), (s - 0.5) / factor, s=s)


def _offset(q: Array, s: Array, span: float) -> Parts:
    """q: exponent per window, and the arc tangent of offset over prefactor at the middle."""
    power, offset = np.exp(q[0] * (s - 0.5)), math.tan(q[1])
    both = power + offset
    by_q = np.stack([power * (s - 0.5) / both, (1 + offset**2) / both], axis=1)
    return Parts(np.log(both), np.ones((s.size, 1)), by_q, np.zeros((s.size, 2, 1)))


def _correction(q: Array, s: Array, span: float) -> Parts:
    """q: logarithm of 1 + the correction where it is largest, and how fast it fades from there."""
    at = s - (q[1] < 0)
    fading, strength = np.exp(-q[1] * at), math.expm1(q[0])
    factor = 1 + strength * fading
    return _beside_line(np.log(factor), (1 + strength) * fading / factor, -strength * at * fading / factor, s=s)


def _log_correction(q: Array, s: Array, span: float) -> Parts:
    """q: logarithm of B per window."""
    rate = math.exp(q[0])
    columns, by_q = np.stack([np.ones_like(s), np.log1p(rate * s), s], axis=1), np.zeros((s.size, 1, 3))
    by_q[:, 0, 1] = rate * s / (1 + rate * s)
    return Parts(0.0, columns, np.zeros((s.size, 1)), by_q)


def _stretched_exponential(q: Array, s: Array, span: float) -> Parts:
    """q: power per window; the exponent is of size 1 at its large end."""
    at = s - (q[0] > 0)
    power = np.exp(q[0] * at)
    columns, by_q = np.stack([np.ones_like(s), power], axis=1), np.zeros((s.size, 1, 2))
    by_q[:, 0, 1] = at * power
    return Parts(0.0, columns, np.zeros((s.size, 1)), by_q)


Bend = Callable[[Array, float], tuple[Array, Array, Array]]
"""b(v; k), its slope from 0 to 1, and its derivative by k; b tends to 0 far below and to v far above."""


def _bent(bend: Bend, shaped: bool = False) -> Callable[[Array, Array, float], Parts]:
    """Two laws that meet at q0 with a bend of width exp(q1); `shaped`, of shape q2."""

    def parts(q: Array, s: Array, span: float) -> Parts:
        width = math.exp(q[1])
        u = s - q[0]
        b, share, by_shape = bend(u / width, q[2] if shaped else 0.0)
        columns, by_q = np.ones((s.size, 3)), np.zeros((s.size, len(q), 3))
        columns[:, 2] = width * b
        columns[:, 1] = u - columns[:, 2]
        by_q[:, 0, 2], by_q[:, 1, 2] = -share, columns[:, 2] - u * share
        if shaped:
            by_q[:, 2, 2] = width * by_shape
        by_q[:, :, 1] = -by_q[:, :, 2]
        by_q[:, 0, 1] -= 1.0
        return Parts(0.0, columns, np.zeros((s.size, len(q))), by_q)

    return parts


def _exponential(v: Array, k: float) -> tuple[Array, Array, Array]:
    return np.logaddexp(0, v), expit(v), v


def _hyperbola(v: Array, k: float) -> tuple[Array, Array, Array]:
    return 0.5 * (v + np.hypot(v, 1)), 0.5 * (1 + v / np.hypot(v, 1)), v


def _uneven(v: Array, k: float) -> tuple[Array, Array, Array]:
    """Widths exp(k) below and exp(-k) above."""
    below, above = math.exp(k), math.exp(-k)
    moved = v + (above - below) * math.log(2)
    width = np.where(moved < 0, below, above)
    x, further = moved / width, np.where(moved < 0, 0.0, (below - above) * math.log(2))
    b, share = width * np.logaddexp(0, x), expit(x)
    by_moved = -(above + below) * math.log(2)
    by_width = np.where(moved < 0, b - moved * share, moved * share - b + (above + below) * math.log(2))
    return b + further, share, by_width + share * by_moved


GRID = np.sinh(np.linspace(-9.0, 9.0, 361))
"""Where slopes of bends without a closed form are integrated, in widths."""


@functools.cache
def _surface(slope: Callable[[Array, float], Array], least: float, most: float) -> Any:
    """b - ln(1 + e^v) over asinh v and k, by trapezia of the slope, moved so that b tends to v."""
    from scipy.interpolate import CubicHermiteSpline, RectBivariateSpline

    shapes, rows = np.linspace(least, most, 41), []
    for k in shapes:
        steep = slope(GRID, k)
        rise = np.concatenate([[0.0], np.cumsum(0.5 * (steep[1:] + steep[:-1]) * np.diff(GRID))])
        moved = GRID + GRID[-1] - rise[-1]
        inside = np.clip(moved, GRID[0], GRID[-1])
        b = CubicHermiteSpline(GRID, rise, steep)(inside) + np.maximum(moved - inside, 0.0)
        rows.append(b - np.logaddexp(0, GRID))
    return RectBivariateSpline(np.arcsinh(GRID), shapes, np.array(rows).T)


def _integrated(slope: Callable[[Array, float], Array], least: float, most: float) -> Bend:
    """The bend of a slope that rises from 0 to 1, as k says."""

    def bend(v: Array, k: float) -> tuple[Array, Array, Array]:
        table, x = _surface(slope, least, most), np.arcsinh(np.clip(v, GRID[0], GRID[-1]))
        share = expit(v) + table.ev(x, k, dx=1) / np.hypot(v, 1)
        return np.logaddexp(0, v) + table.ev(x, k), share, table.ev(x, k, dy=1)

    return bend


def _powered(v: Array, k: float) -> Array:
    """A logistic slope to the power exp(k): it fades so many times faster below than above."""
    return np.asarray(np.exp(-math.exp(k) * np.logaddexp(0, -v)))


def _stretched(v: Array, k: float) -> Array:
    """A slope that fades as the exponential of the power exp(k) of v."""
    return np.asarray(expit(np.sign(v) * abs(v) ** math.exp(k)))


def _three(q: Array, s: Array, span: float) -> Parts:
    """q: where the first two laws meet, the logarithm of how much further the other two do, and of the width."""
    width, further = math.exp(q[2]), math.exp(q[1])
    u = [s - q[0], s - q[0] - further]
    a, b = (width * np.logaddexp(0, one / width) for one in u)
    share_a, share_b = expit(u[0] / width), expit(u[1] / width)
    columns, by_q = np.stack([np.ones_like(s), s - a, a - b, b], axis=1), np.zeros((s.size, 3, 4))
    by_a = np.stack([-share_a, np.zeros_like(s), a - u[0] * share_a], axis=1)
    by_b = np.stack([-share_b, -further * share_b, b - u[1] * share_b], axis=1)
    by_q[:, :, 1], by_q[:, :, 2], by_q[:, :, 3] = -by_a, by_a - by_b, by_b
    return Parts(0.0, columns, np.zeros((s.size, 3)), by_q)


PLACE, WIDTH = tuple(np.linspace(0.1, 0.9, 7)), tuple(np.log((0.01, 0.04, 0.12, 0.3)))
FADES = (-12.0, -6.0, -2.5, 2.5, 6.0, 12.0)
AT, WIDE = (-1.0, 2.0), (-7.0, 1.0)
LOW_HIGH = ("p low", "p high")


def _two(name: str, formula: str, bend: Bend, *shapes: float, limits: tuple[float, float] = (0.0, 0.0)) -> Law:
    """Two power laws with a bend."""
    parts, starts, all_limits = _bent(bend, bool(shapes)), [PLACE, WIDTH], [AT, WIDE]
    if shapes:
        starts, all_limits = [*starts, shapes], [*all_limits, limits]
    return Law(name, formula, parts, tuple(starts), tuple(all_limits), 3 + len(starts), LOW_HIGH)


ONE = Law("one law", "A x^p", _linear(_slope), exponents=("p",))
LOGARITHM = Law(
    "logarithm",
    "A x^p (1 + B ln x)",
    _logarithm,
    ((-1.9, -1.5, -0.5, 0.5, 1.5, 1.9),),
    ((-2.0, 2.0),),
    3,
    ("p",),
    False,
)
EXPONENTIAL = Law("exponential", "A exp(-x/X)", _linear(lambda s, span: np.exp(span * (s - 1))), power=False)
STRETCHED_EXPONENTIAL = Law(
    "stretched exponential", "A exp(-(x/X)^b)", _stretched_exponential, (FADES,), ((-60.0, 60.0),), 3, power=False
)
CUT_OFF = Law(
    "cut-off",
    "A exp(-x/X) x^p",
    _linear(lambda s, span: np.exp(span * (s - 1)), _slope),
    numbers=3,
    exponents=("p",),
    power=False,
)
LOGNORMAL = Law("lognormal", "A exp(-B ln(x/X)^2)", _linear(_slope, lambda s, span: s**2), numbers=3, power=False)
OFFSET = Law("offset", "A x^p + C", _offset, (FADES, (-1.2, -0.3, 0.1, 0.8, 1.4)), ((-60.0, 60.0), (-1.57, 1.57)), 3)
CORRECTION = Law(
    "correction to scaling",
    "A x^p (1 + B x^-D)",
    _correction,
    ((-2.5, -0.7, -0.1, 0.1, 0.7, 2.5, 6.0), FADES),
    ((-30.0, 60.0), (-80.0, 80.0)),
    4,
    ("p",),
)
LOG_CORRECTION = Law(
    "logarithmic correction",
    "A x^p (1 + B ln(x/x0))^c",
    _log_correction,
    ((-1.0, 1.0, 3.0, 5.0),),
    ((-3.0, 8.0),),
    4,
    ("p",),
)
TWO = _two("two laws", "bend fading exponentially", _exponential)
HYPERBOLA = _two("two laws, hyperbola", "bend fading as 1/ln x", _hyperbola)
ASYMMETRIC = _two(
    "two laws, asymmetric bend",
    "fading faster on one side",
    _integrated(_powered, -2.5, 2.5),
    *(-1.0, 1.0),
    limits=(-2.5, 2.5),
)
UNEVEN = _two("two laws, two widths", "one width below, another above", _uneven, -0.7, 0.7, limits=(-2.0, 2.0))
STRETCHED = _two(
    "two laws, stretched bend",
    "fading as exp(-(ln x)^b)",
    _integrated(_stretched, -1.2, 0.8),
    *(-0.5, 0.3),
    limits=(-1.2, 0.8),
)
THREE = Law(
    "three laws",
    "two bends of one width",
    _three,
    ((0.15, 0.3, 0.45, 0.6), tuple(np.log((0.2, 0.35, 0.5))), WIDTH[:3]),
    ((0.02, 0.9), (-2.5, 0.0), WIDE),
    7,
    ("p low", "p middle", "p high"),
)
BENDS = (TWO, HYPERBOLA, ASYMMETRIC, UNEVEN, STRETCHED)
OTHER_FUNCTIONS = (LOGARITHM, EXPONENTIAL, STRETCHED_EXPONENTIAL, CUT_OFF, LOGNORMAL)
LAWS = (ONE, *OTHER_FUNCTIONS, OFFSET, CORRECTION, *BENDS, THREE)
