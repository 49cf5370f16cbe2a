"""The table of laws: each a curve ln y(ln x) that is linear in all but a few of its numbers.

    z = shift(q) + columns(q) b,   s = (ln x - first) / span from 0 to 1                            (1)

q are those few; positions and widths are parts of the window, exponents per window.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.special import expit

from sweep.laws.loglog import Array

Parts = tuple[Array | float, ...]
"""Shift and columns of (1), each at all points (g, n) of all q, or less where it is the same; what is left out is 0."""
Curve = Callable[[Array, Array, float], Iterator[Parts]]
"""Of q (k, g, 1), s and the span: the parts of (1), then their derivatives by each of the q."""


class Number(NamedTuple):
    """One of the q: the least and largest that it may have, and values to start from."""

    least: float
    most: float
    starts: tuple[float, ...]


class Law(NamedTuple):
    """One of the curves."""

    name: str
    formula: str
    curve: Curve
    columns: int
    q: tuple[Number, ...] = ()
    exponents: tuple[tuple[str, int], ...] = ()
    """Names of the exponents, and which of q and then b each is."""
    power: bool = True
    """Whether it is a power law or several, and not another function."""
    starts_as: str = ""
    """Law that it is if its last q is 0, and is never further from the points than."""

    @property
    def numbers(self) -> int:
        """That are fitted."""
        return len(self.q) + self.columns


def _offset(q: Array, s: Array, span: float) -> Iterator[Parts]:
    """q: exponent per window, and the arc tangent of offset over prefactor at the middle."""
    power, level = np.exp(q[0] * (s - 0.5)), np.tan(q[1])
    yield np.log(power + level), 1.0
    yield ((s - 0.5) * power / (power + level),)
    yield ((1 + level**2) / (power + level),)


def _correction(q: Array, s: Array, span: float) -> Iterator[Parts]:
    """q: logarithm of 1 + the correction where it is largest, and how fast it fades from there."""
    way = s - (q[1] < 0)
    left = np.exp(-q[1] * way)
    correction = np.expm1(q[0]) * left
    yield np.log(1 + correction), 1.0, s
    yield (np.exp(q[0]) * left / (1 + correction),)
    yield (-way * correction / (1 + correction),)


def _log_correction(q: Array, s: Array, span: float) -> Iterator[Parts]:
    """q: logarithm of B per window."""
    rise = np.exp(q[0]) * s
    yield 0.0, 1.0, np.log1p(rise), s
    yield 0.0, 0.0, rise / (1 + rise)


def _logarithm(q: Array, s: Array, span: float) -> Iterator[Parts]:
    """q: B per window, over what the brackets are at its middle."""
    brackets = 1 + q[0] * (s - 0.5)
    yield np.log(brackets), 1.0, s
    yield ((s - 0.5) / brackets,)


def _stretched(q: Array, s: Array, span: float) -> Iterator[Parts]:
    """q: b per window; the exponent is of size 1 at its large end."""
    way = s - (q[0] > 0)
    yield 0.0, 1.0, np.exp(q[0] * way)
    yield 0.0, 0.0, way * np.exp(q[0] * way)


Bend = Callable[[Any, Any], tuple[Any, Any, Any]]
"""Of v and k: b, which tends to 0 far below and to v far above, and its derivatives by v and k."""


def _ramp(v: Any, width: Any) -> tuple[Any, Any, Any]:
    """width ln(1 + exp(v/width)), max(0, v) with a bend; its slope, and derivative by the logarithm of the width."""
    b, slope = width * np.logaddexp(0, v / width), expit(v / width)
    return b, slope, b - v * slope


def _logistic(v: Any, k: Any) -> tuple[Any, Any, Any]:
    """Widths exp(k) below and exp(-k) above."""
    shift = 2 * math.log(2) * np.sinh(k)
    above = v >= shift
    sign = np.where(above, -1.0, 1.0)
    b, slope, by_width = _ramp(v - shift, np.exp(sign * k))
    return b + shift * above, slope, sign * by_width + 2 * math.log(2) * np.cosh(k) * (above - slope)


def _three_scales(v: Any, k: Any) -> tuple[Any, Any, Any]:
    """A third of it of each width exp(k), 1, exp(-k), so that it begins sharply and fades slowly."""
    parts = [_ramp(v, np.exp(sign * k)) for sign in (-1, 0, 1)]
    b, slope, _ = (sum(part) / 3 for part in zip(*parts, strict=True))
    return b, slope, (parts[2][2] - parts[0][2]) / 3


def _hyperbola(v: Any, k: Any) -> tuple[Any, Any, Any]:
    root = np.hypot(v, 1)
    return 0.5 * (v + root), 0.5 * (1 + v / root), 0.0


def _bent(bend: Bend, over_x: bool = False) -> Curve:
    """Two laws whose asymptotes meet at q0, with a bend of width exp(q1), of shape q2.

    With `over_x` they are straight over x instead of ln x: exponentials, among them 1/cosh(x/X).
    """

    def curve(q: Array, s: Array, span: float) -> Iterator[Parts]:
        u, width = (np.exp(span * (s - 1)) if over_x else s) - q[0], np.exp(q[1])
        b, slope, by_k = bend(u / width, q[2])
        b = width * b
        yield 0.0, 1.0, u - b, b
        yield 0.0, 0.0, slope - 1, -slope
        yield 0.0, 0.0, u * slope - b, b - u * slope
        yield 0.0, 0.0, -width * by_k, width * by_k

    return curve


def _three(q: Array, s: Array, span: float) -> Iterator[Parts]:
    """q: where the first two laws meet, the logarithm of how much further the other two do, and of the width."""
    further, width = np.exp(q[1]), np.exp(q[2])
    (a, of_a, a_by_width), (b, of_b, b_by_width) = (_ramp(s - q[0] - place, width) for place in (0.0, further))
    yield 0.0, 1.0, s - a, a - b, b
    yield 0.0, 0.0, of_a, of_b - of_a, -of_b
    yield 0.0, 0.0, 0.0, further * of_b, -further * of_b
    yield 0.0, 0.0, -a_by_width, a_by_width - b_by_width, b_by_width


PLACE = Number(-1.0, 2.0, tuple(np.linspace(0.1, 0.9, 7)))
WIDTH = Number(-7.0, 1.0, tuple(np.log((0.01, 0.04, 0.12, 0.3))))
SKEWED, SCALES = (PLACE, WIDTH, Number(-2.0, 2.0, (0.0,))), (PLACE, WIDTH, Number(0.0, 2.5, (0.8,)))
POWER = Number(-60.0, 60.0, (-12.0, -6.0, -2.5, -1.0, 1.0, 2.5, 6.0, 12.0))
P, P_TWO = (("p", -1),), (("p low", -2), ("p high", -1))
ONE = Law("one law", "A x^p", lambda q, s, span: iter([(0.0, 1.0, s)]), 2, exponents=P)
TWO = Law("two laws", "bend fading exponentially", _bent(_logistic), 3, (PLACE, WIDTH), P_TWO)
SHAPED = TWO._replace(q=SKEWED, starts_as=TWO.name)
BENDS = (
    TWO,
    SHAPED._replace(name="two laws, two widths", formula="one width below, another above"),
    TWO._replace(name="two laws, hyperbola", formula="bend fading as 1/ln x", curve=_bent(_hyperbola)),
    SHAPED._replace(
        name="two laws, three scales",
        formula="bend of three widths, one in the other",
        curve=_bent(_three_scales),
        q=SCALES,
    ),
)
SECOND = Number(0.02, 0.9, (0.15, 0.3, 0.45, 0.6)), Number(-2.5, 0.0, tuple(np.log((0.2, 0.35, 0.5))))
THREE_Q = (*SECOND, WIDTH._replace(starts=WIDTH.starts[:3]))
P_THREE = (("p low", -3), ("p middle", -2), ("p high", -1))
THREE = Law("three laws", "two bends of one width", _three, 4, THREE_Q, P_THREE)
OFFSET = Law("offset", "A x^p + C", _offset, 1, (POWER, Number(-1.57, 1.57, (-1.2, -0.3, 0.1, 0.8, 1.4))), (("p", 0),))
CORRECTION_Q = Number(-30.0, 60.0, (-2.5, -0.7, -0.1, 0.1, 0.7, 2.5, 6.0, 14.0)), POWER._replace(least=-80.0, most=80.0)
CORRECTION = Law("correction to scaling", "A x^p (1 + B x^-D)", _correction, 2, CORRECTION_Q, (*P, ("D", 1)))
LOG_Q = (Number(-3.0, 8.0, (-1.0, 1.0, 3.0, 5.0)),)
LOG_CORRECTION = Law("logarithmic correction", "A x^p (1 + B ln(x/x0))^c", _log_correction, 3, LOG_Q, P)
LOGARITHM = Number(-2 + 1e-9, 2 - 1e-9, (-1.9, -1.5, -0.5, 0.5, 1.5, 1.9))
OTHER_FUNCTIONS = (
    Law("logarithm", "A x^p (1 + B ln x)", _logarithm, 2, (LOGARITHM,), P, power=False),
    Law("exponential", "A exp(-x/X)", lambda q, s, span: iter([(0.0, 1.0, np.exp(span * (s - 1)))]), 2, power=False),
    Law("stretched exponential", "A exp(-(x/X)^b)", _stretched, 2, (POWER,), power=False),
    Law(
        "cut-off", "A exp(-x/X) x^p", lambda q, s, span: iter([(0.0, 1.0, np.exp(span * (s - 1)), s)]), 3, (), P, False
    ),
    Law("lognormal", "A exp(-B ln(x/X)^2)", lambda q, s, span: iter([(0.0, 1.0, s, s**2)]), 3, power=False),
    Law("two exponentials", "A exp(-x/X), with a bend to exp(-x/Y)", _bent(_logistic, True), 3, TWO.q, power=False),
)
LAWS = (ONE, *OTHER_FUNCTIONS, OFFSET, CORRECTION, *BENDS, THREE)
