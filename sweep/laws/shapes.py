"""The table of laws: each a curve ln y(ln x) that is linear in all but a few of its numbers.

    z = shift(q) + columns(q) b,   s = (ln x - first) / span from 0 to 1                            (1)

q are those few; positions and widths are parts of the window, exponents per window.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sweep.laws.loglog import Array

Parts = Callable[[Array, Array, float], tuple[Array | float, ...]]
"""Of q, one behind the other (k, g, 1), s and the span: shift and columns of (1) for each q, (g, n) each; what is the
same for all q, or at all points, may be less."""


class Number(NamedTuple):
    """One of the q: the least and largest that it may have, and values to start from."""

    least: float
    most: float
    starts: Any


class Law(NamedTuple):
    """One of the curves."""

    name: str
    formula: str
    parts: Parts
    columns: int
    q: tuple[Number, ...] = ()
    exponents: tuple[str, ...] = ()
    """Names of the exponents, which are the last numbers b."""
    power: bool = True
    """Whether it is a power law or several, and not another function."""

    @property
    def numbers(self) -> int:
        """That are fitted."""
        return len(self.q) + self.columns


def _offset(q: Array, s: Array, span: float) -> Any:
    """q: exponent per window, and the arc tangent of offset over prefactor at the middle."""
    return np.log(np.exp(q[0] * (s - 0.5)) + np.tan(q[1])), 1.0


def _correction(q: Array, s: Array, span: float) -> Any:
    """q: logarithm of 1 + the correction where it is largest, and how fast it fades from there."""
    return np.log(1 + np.expm1(q[0]) * np.exp(-q[1] * (s - (q[1] < 0)))), 1.0, s


def _log_correction(q: Array, s: Array, span: float) -> Any:
    """q: logarithm of B per window."""
    return 0.0, 1.0, np.log1p(np.exp(q[0]) * s), s


def _logarithm(q: Array, s: Array, span: float) -> Any:
    """q: B per window, over what the brackets are at its middle."""
    return np.log(1 + q[0] * (s - 0.5)), 1.0, s


def _stretched_exponential(q: Array, s: Array, span: float) -> Any:
    """q: b per window; the exponent is of size 1 at its large end."""
    return 0.0, 1.0, np.exp(q[0] * (s - (q[0] > 0)))


def _two_exponentials(q: Array, s: Array, span: float) -> Any:
    """Two laws over x instead of ln x; among them 1/cosh(x/X)."""
    return TWO.parts(q, np.exp(span * (s - 1)), span)


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


def _integrated(slope: Bend, k_of: Number) -> Bend:
    """The bend of a slope that rises from 0 to 1, as k says."""

    @functools.cache
    def surface() -> Any:
        """b - ln(1 + e^v) over asinh v and k, by trapezia of the slope, moved so that b tends to v."""
        from scipy.interpolate import CubicHermiteSpline, RectBivariateSpline

        shapes, rows = np.linspace(k_of.least, k_of.most, 41), []
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


PLACE = Number(-1.0, 2.0, np.linspace(0.1, 0.9, 7))
WIDTH = Number(-7.0, 1.0, np.log((0.01, 0.04, 0.12, 0.3)))
POWER = Number(-60.0, 60.0, (-12.0, -6.0, -2.5, 2.5, 6.0, 12.0))
SKEW, WIDTHS, FADING = Number(-2.5, 2.5, [0.0]), Number(-2.0, 2.0, [0.0]), Number(-1.2, 0.8, [0.0])


def _two(name: str, formula: str, bend: Bend, *shape: Number) -> Law:
    """Two power laws with a bend."""
    return Law(name, formula, _bent(bend), 3, (PLACE, WIDTH, *shape), ("p low", "p high"))


ONE = Law("one law", "A x^p", lambda q, s, span: (0.0, 1.0, s), 2, exponents=("p",))
TWO = _two("two laws", "bend fading exponentially", lambda v, k: np.logaddexp(0, v))
BENDS = (
    TWO,
    _two("two laws, hyperbola", "bend fading as 1/ln x", lambda v, k: 0.5 * (v + np.hypot(v, 1))),
    _two("two laws, asymmetric bend", "fading faster on one side", _integrated(_powered, SKEW), SKEW),
    _two("two laws, two widths", "one width below, another above", _uneven, WIDTHS),
    _two("two laws, stretched bend", "fading as exp(-(ln x)^b)", _integrated(_stretched, FADING), FADING),
)
SECOND = Number(0.02, 0.9, (0.15, 0.3, 0.45, 0.6)), Number(-2.5, 0.0, np.log((0.2, 0.35, 0.5)))
THREE_Q = (*SECOND, WIDTH._replace(starts=WIDTH.starts[:3]))
THREE = Law("three laws", "two bends of one width", _three, 4, THREE_Q, ("p low", "p middle", "p high"))
OFFSET = Law("offset", "A x^p + C", _offset, 1, (POWER, Number(-1.57, 1.57, (-1.2, -0.3, 0.1, 0.8, 1.4))))
CORRECTION_Q = Number(-30.0, 60.0, (-2.5, -0.7, -0.1, 0.1, 0.7, 2.5, 6.0)), POWER._replace(least=-80.0, most=80.0)
CORRECTION = Law("correction to scaling", "A x^p (1 + B x^-D)", _correction, 2, CORRECTION_Q, ("p",))
LOG_Q = (Number(-3.0, 8.0, (-1.0, 1.0, 3.0, 5.0)),)
LOG_CORRECTION = Law("logarithmic correction", "A x^p (1 + B ln(x/x0))^c", _log_correction, 3, LOG_Q, ("p",))
LOGARITHM = Number(-2 + 1e-9, 2 - 1e-9, (-1.9, -1.5, -0.5, 0.5, 1.5, 1.9))
OTHER_FUNCTIONS = (
    Law("logarithm", "A x^p (1 + B ln x)", _logarithm, 2, (LOGARITHM,), ("p",), power=False),
    Law("exponential", "A exp(-x/X)", lambda q, s, span: (0.0, 1.0, np.exp(span * (s - 1))), 2, power=False),
    Law("stretched exponential", "A exp(-(x/X)^b)", _stretched_exponential, 2, (POWER,), power=False),
    Law("cut-off", "A exp(-x/X) x^p", lambda q, s, span: (0.0, 1.0, np.exp(span * (s - 1)), s), 3, (), ("p",), False),
    Law("lognormal", "A exp(-B ln(x/X)^2)", lambda q, s, span: (0.0, 1.0, s, s**2), 3, power=False),
    Law("two exponentials", "A exp(-x/X), with a bend to exp(-x/Y)", _two_exponentials, 3, TWO.q, power=False),
)
LAWS = (ONE, *OTHER_FUNCTIONS, OFFSET, CORRECTION, *BENDS, THREE)
