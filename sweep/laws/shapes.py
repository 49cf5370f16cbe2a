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

from sweep.laws.loglog import Array

Parts = Callable[[Array, Array, float], tuple[Array | float, ...]]
"""Of q, one behind the other (k, g, 1), s and the span: shift and columns of (1) for each q, (g, n) each; what is the
same for all q, or at all points, may be less."""


class Law(NamedTuple):
    """One of the curves."""

    name: str
    formula: str
    parts: Parts
    columns: int
    starts: Sequence[Any] = ()
    """Values of each q to start from,"""
    limits: Sequence[tuple[float, float]] = ()
    """and the least and largest that it may have."""
    exponents: tuple[str, ...] = ()
    """Names of the exponents, which are the last numbers b."""
    power: bool = True
    """Whether it is a power law or several, and not another function."""

    @property
    def numbers(self) -> int:
        """That are fitted."""
        return len(self.starts) + self.columns


def _offset(q: Array, s: Array, span: float) -> Any:
    """q: exponent per window, and the arc tangent of offset over prefactor at the middle."""
    return np.log(np.exp(q[0] * (s - 0.5)) + np.tan(q[1])), 1.0


def _correction(q: Array, s: Array, span: float) -> Any:
    """q: logarithm of 1 + the correction where it is largest, and how fast it fades from there."""
    return np.log(1 + np.expm1(q[0]) * np.exp(-q[1] * (s - (q[1] < 0)))), 1.0, s


def _three(q: Array, s: Array, span: float) -> Any:
    """q: where the first two laws meet, the logarithm of how much further the other two do, and of the width."""
    width, place = np.exp(q[2]), q[0] + np.exp(q[1])
    a, b = (width * np.logaddexp(0, (s - at) / width) for at in (q[0], place))
    return 0.0, 1.0, s - a, a - b, b


Bend = Callable[[Any, Any], Any]
"""b(v; k), which tends to 0 far below and to v far above."""


def _bent(bend: Bend) -> Parts:
    """Two laws that meet at q0 with a bend of width exp(q1), of shape q2 where it has one."""

    def parts(q: Array, s: Array, span: float) -> Any:
        u, width = s - q[0], np.exp(q[1])
        b = width * bend(u / width, q[2] if len(q) > 2 else 0.0)
        return 0.0, 1.0, u - b, b

    return parts


def _uneven(v: Any, k: Any) -> Any:
    """Widths exp(k) below and exp(-k) above."""
    below, above = np.exp(k), np.exp(-k)
    moved = v + (above - below) * math.log(2)
    width = np.where(moved < 0, below, above)
    return width * np.logaddexp(0, moved / width) + np.where(moved < 0, 0.0, (below - above) * math.log(2))


GRID = np.sinh(np.linspace(-9.0, 9.0, 361))
"""Where slopes of bends without a closed form are integrated, in widths."""


def _integrated(slope: Bend, least: float, most: float) -> Bend:
    """The bend of a slope that rises from 0 to 1, as k between two values says."""

    @functools.cache
    def surface() -> Any:
        """b - ln(1 + e^v) over asinh v and k, by trapezia of the slope, moved so that b tends to v."""
        from scipy.interpolate import CubicHermiteSpline, RectBivariateSpline

        shapes, rows = np.linspace(least, most, 41), []
        for k in shapes:
            steep = slope(GRID, k)
            rise = np.append(0.0, np.cumsum(0.5 * (steep[1:] + steep[:-1]) * np.diff(GRID)))
            moved = GRID + GRID[-1] - rise[-1]
            inside = np.clip(moved, GRID[0], GRID[-1])
            rows.append(CubicHermiteSpline(GRID, rise, steep)(inside) + moved - inside - np.logaddexp(0, GRID))
        return RectBivariateSpline(np.arcsinh(GRID), shapes, np.array(rows).T)

    return lambda v, k: np.logaddexp(0, v) + surface().ev(np.arcsinh(np.clip(v, GRID[0], GRID[-1])), k)


def _powered(v: Any, k: Any) -> Any:
    """A logistic slope to the power exp(k): it fades so many times faster below than above."""
    return np.exp(-np.exp(k) * np.logaddexp(0, -v))


def _stretched(v: Any, k: Any) -> Any:
    """A slope that fades as the exponential of the power exp(k) of v."""
    return np.exp(-np.logaddexp(0, -np.sign(v) * abs(v) ** np.exp(k)))


PLACE, WIDTH, AT, WIDE = np.linspace(0.1, 0.9, 7), np.log((0.01, 0.04, 0.12, 0.3)), (-1.0, 2.0), (-7.0, 1.0)
FADES, POWER = (-12.0, -6.0, -2.5, 2.5, 6.0, 12.0), (-60.0, 60.0)
SKEW, FADING = (-2.5, 2.5), (-1.2, 0.8)


def _two(name: str, formula: str, bend: Bend, *shape: tuple[float, float]) -> Law:
    """Two power laws with a bend, whose shape has these limits."""
    starts = (PLACE, WIDTH, (0.0,))
    return Law(name, formula, _bent(bend), 3, starts[: 2 + len(shape)], (AT, WIDE, *shape), ("p low", "p high"))


ONE = Law("one law", "A x^p", lambda q, s, span: (0.0, 1.0, s), 2, exponents=("p",))
TWO = _two("two laws", "bend fading exponentially", lambda v, k: np.logaddexp(0, v))
BENDS = (
    TWO,
    _two("two laws, hyperbola", "bend fading as 1/ln x", lambda v, k: 0.5 * (v + np.hypot(v, 1))),
    _two("two laws, asymmetric bend", "fading faster on one side", _integrated(_powered, *SKEW), SKEW),
    _two("two laws, two widths", "one width below, another above", _uneven, (-2.0, 2.0)),
    _two("two laws, stretched bend", "fading as exp(-(ln x)^b)", _integrated(_stretched, *FADING), FADING),
)
THREE = Law(
    "three laws",
    "two bends of one width",
    _three,
    columns=4,
    starts=((0.15, 0.3, 0.45, 0.6), np.log((0.2, 0.35, 0.5)), WIDTH[:3]),
    limits=((0.02, 0.9), (-2.5, 0.0), WIDE),
    exponents=("p low", "p middle", "p high"),
)
OFFSET = Law("offset", "A x^p + C", _offset, 1, (FADES, (-1.2, -0.3, 0.1, 0.8, 1.4)), (POWER, (-1.57, 1.57)))
CORRECTION = Law(
    "correction to scaling",
    "A x^p (1 + B x^-D)",
    _correction,
    columns=2,
    starts=((-2.5, -0.7, -0.1, 0.1, 0.7, 2.5, 6.0), FADES),
    limits=((-30.0, 60.0), (-80.0, 80.0)),
    exponents=("p",),
)
LOG_CORRECTION = Law(  # q: logarithm of B per window
    "logarithmic correction",
    "A x^p (1 + B ln(x/x0))^c",
    lambda q, s, span: (0.0, 1.0, np.log1p(np.exp(q[0]) * s), s),
    columns=3,
    starts=((-1.0, 1.0, 3.0, 5.0),),
    limits=((-3.0, 8.0),),
    exponents=("p",),
)
LOGARITHM = Law(
    "logarithm",
    "A x^p (1 + B ln x)",
    lambda q, s, span: (np.log(1 + q[0] * (s - 0.5)), 1.0, s),
    columns=2,
    starts=((-1.9, -1.5, -0.5, 0.5, 1.5, 1.9),),
    limits=((-2 + 1e-9, 2 - 1e-9),),
    exponents=("p",),
    power=False,
)
STRETCHED = Law(  # q: power per window; the exponent is of size 1 at its large end
    "stretched exponential",
    "A exp(-(x/X)^b)",
    lambda q, s, span: (0.0, 1.0, np.exp(q[0] * (s - (q[0] > 0)))),
    columns=2,
    starts=(FADES,),
    limits=(POWER,),
    power=False,
)
EXPONENTIAL = Law("exponential", "A exp(-x/X)", lambda q, s, span: (0.0, 1.0, np.exp(span * (s - 1))), 2, power=False)
CUT_OFF = Law(
    "cut-off",
    "A exp(-x/X) x^p",
    lambda q, s, span: (0.0, 1.0, np.exp(span * (s - 1)), s),
    columns=3,
    exponents=("p",),
    power=False,
)
LOGNORMAL = Law("lognormal", "A exp(-B ln(x/X)^2)", lambda q, s, span: (0.0, 1.0, s, s**2), 3, power=False)
TWO_EXPONENTIALS = Law(  # (1) of two laws over x instead of ln x; among them 1/cosh(x/X)
    "two exponentials",
    "A exp(-x/X), with a bend to exp(-x/Y)",
    lambda q, s, span: TWO.parts(q, np.exp(span * (s - 1)), span),
    columns=3,
    starts=TWO.starts,
    limits=TWO.limits,
    power=False,
)
OTHER_FUNCTIONS = (LOGARITHM, EXPONENTIAL, STRETCHED, CUT_OFF, LOGNORMAL, TWO_EXPONENTIALS)
LAWS = (ONE, *OTHER_FUNCTIONS, OFFSET, CORRECTION, *BENDS, THREE)
