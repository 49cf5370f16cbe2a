"""The table of laws: each a curve ln y(ln x) that is linear in all but a few of its parameters.

    z = shift(q) + columns(q) b,   s = (ln x - first) / span from 0 to 1                            (1)

q are those few; positions and widths are in units of the window, exponents per window.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sweep.laws.loglog import Array

Parts = tuple[Array | float, ...]
"""Shift and columns of (1), each at all points (g, n) of all q, or less where it is the same."""
Curve = Callable[[Array, Array, float], Parts]
"""Of q (k, g, 1), s and the span."""


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
    case: str = ""
    """Law that it is if its last q is 0, and is never further from the points than."""

    @property
    def numbers(self) -> int:
        """That are fitted."""
        return sum(one.most > one.least for one in self.q) + self.columns


def _offset(q: Array, s: Array, span: float) -> Parts:
    """q: exponent per window, and the arc tangent of offset over prefactor at the middle."""
    return np.log(np.exp(q[0] * (s - 0.5)) + np.tan(q[1])), 1.0


def _correction(q: Array, s: Array, span: float) -> Parts:
    """q: logarithm of 1 + the correction where it is largest, and how fast it fades from there."""
    return np.log1p(np.expm1(q[0]) * np.exp(-q[1] * (s - (q[1] < 0)))), 1.0, s


def _between(q: Array, s: Array, span: float) -> Parts:
    """q: b per window; both exponents are of size 1 at their own end."""
    return 0.0, 1.0, np.exp(q[0] * (s - 1)), np.exp(-q[0] * s), s


def _stretched(q: Array, s: Array, span: float) -> Parts:
    """q: b per window; the exponent is of size 1 at its large end."""
    return 0.0, 1.0, np.exp(q[0] * (s - (q[0] > 0)))


def _ramp(v: Any, width: Any = 1.0) -> Any:
    """max(0, v) with a bend that fades exponentially."""
    return width * np.logaddexp(0, v / width)


def _two_widths(v: Any, k: Any) -> Any:
    """Widths exp(k) below and exp(-k) above."""
    shift = 2 * math.log(2) * np.sinh(k)
    above = v >= shift
    return _ramp(v - shift, np.exp(np.where(above, -k, k))) + shift * above


def _three_scales(v: Any, k: Any) -> Any:
    """A third of it of each width exp(k), 1, exp(-k), so that it begins sharply and fades slowly."""
    return (_ramp(v, np.exp(k)) + _ramp(v) + _ramp(v, np.exp(-k))) / 3


def _bent(bend: Callable[[Any, Any], Any], over_x: bool = False) -> Curve:
    """Two laws whose asymptotes meet at q0, with a bend of width exp(q1), of shape q2.

    With `over_x` they are straight over x instead of ln x: exponentials, among them 1/cosh(x/X).
    """

    def curve(q: Array, s: Array, span: float) -> Parts:
        u, width = (np.exp(span * (s - 1)) if over_x else s) - q[0], np.exp(q[1])
        b = width * bend(u / width, q[2])
        return 0.0, 1.0, u - b, b

    return curve


def _peak(q: Array, s: Array, span: float) -> Parts:
    """q: where it is, the logarithm of the mean of its two widths, and that of the upper over the lower one."""
    return 0.0, 1.0, np.exp(-0.5 * ((s - q[0]) / np.exp(q[1] + q[2] * ((s > q[0]) - 0.5))) ** 2), s


def _step(q: Array, s: Array, span: float) -> Parts:
    """q: where it is, and the logarithm of its width."""
    return 0.0, 1.0, np.tanh((s - q[0]) / np.exp(q[1])), s


def _three(q: Array, s: Array, span: float) -> Parts:
    """q: where the first two laws meet, the logarithm of how much further the other two do, and of the width."""
    first, second = (_ramp(s - q[0] - further, np.exp(q[2])) for further in (0.0, np.exp(q[1])))
    return 0.0, 1.0, s - first, first - second, second


PLACE = Number(-1.0, 2.0, tuple(np.linspace(0.1, 0.9, 7)))
WIDTH = Number(-7.0, 1.0, tuple(np.log((0.01, 0.04, 0.12, 0.3))))
SKEWED, SCALES = (PLACE, WIDTH, Number(-2.0, 2.0, (0.0,))), (PLACE, WIDTH, Number(0.0, 2.5, (0.1, 0.8)))
POWER = Number(-60.0, 60.0, (-12.0, -6.0, -2.5, -1.0, 1.0, 2.5, 6.0, 12.0))
P, P_TWO = (("p", -1),), (("p low", -2), ("p high", -1))
ONE = Law("one law", "A x^p", lambda q, s, span: (0.0, 1.0, s), 2, exponents=P)
ONE_WIDTH, HYPERBOLA = (lambda v, k: _ramp(v)), (lambda v, k: 0.5 * (v + np.hypot(v, 1)))
TWO = Law("two laws", "bend fading exponentially", _bent(ONE_WIDTH), 3, (PLACE, WIDTH), P_TWO)
BENDS = (
    TWO,
    Law("two laws, two widths", "one width below, one above", _bent(_two_widths), 3, SKEWED, P_TWO, case="two laws"),
    Law("two laws, hyperbola", "bend fading as 1/ln x", _bent(HYPERBOLA), 3, TWO.q, P_TWO),
    Law("two laws, three scales", "bend of three widths", _bent(_three_scales), 3, SCALES, P_TWO, case="two laws"),
)
SECOND = Number(0.02, 0.9, (0.15, 0.3, 0.45, 0.6)), Number(-2.5, 0.0, tuple(np.log((0.2, 0.35, 0.5))))
THREE_Q = (*SECOND, WIDTH._replace(starts=WIDTH.starts[:3]))
P_THREE = (("p low", -3), ("p middle", -2), ("p high", -1))
THREE = Law("three laws", "two bends of one width", _three, 4, THREE_Q, P_THREE)
OFFSET = Law("offset", "A x^p + C", _offset, 1, (POWER, Number(-1.57, 1.57, (-1.2, -0.3, 0.1, 0.8, 1.4))), (("p", 0),))
CORRECTION_Q = Number(-30.0, 60.0, (-2.5, -0.7, -0.1, 0.1, 0.7, 2.5, 6.0, 14.0)), POWER._replace(least=-80.0, most=80.0)
CORRECTION = Law("correction to scaling", "A x^p (1 + B x^-D)", _correction, 2, CORRECTION_Q, (*P, ("D", 1)))
FADING = CORRECTION._replace(q=(CORRECTION_Q[0], Number(0.0, 80.0, POWER.starts[4:])))
LOG_Q = (Number(-3.0, 8.0, (-1.0, 1.0, 3.0, 5.0)),)  # the logarithm of B per window
LOG_NAMES = "logarithmic correction", "A x^p (1 + B ln(x/x0))^c"
LOG_CORRECTION = Law(*LOG_NAMES, lambda q, s, _: (0.0, 1.0, np.log1p(np.exp(q[0]) * s), s), 3, LOG_Q, P)
LOG_B = (Number(-2 + 1e-9, 2 - 1e-9, (-1.9, -1.5, -0.5, 0.5, 1.5, 1.9)),)  # B over (1 + B ln x) at the middle
BOTH = Number(0.5, 60.0, (1.0, 2.5, 6.0, 12.0))
FLANK = Number(math.log(0.05), math.log(1 / 3), tuple(np.log((0.07, 0.14, 0.24))))
NO_SHAPE, TWO_FLANKS = Number(0.0, 0.0, (0.0,)), Number(-1.5, 1.5, (-0.7, 0.7))
STEP_Q = PLACE._replace(least=0.1, most=0.9), WIDTH._replace(most=math.log(0.15), starts=WIDTH.starts[:3])
OTHER_FUNCTIONS = (
    Law("logarithm", "A x^p (1 + B ln x)", lambda q, s, _: (np.log(1 + q[0] * (s - 0.5)), 1.0, s), 2, LOG_B, P, False),
    Law("exponential", "A exp(-x/X)", lambda _, s, span: (0.0, 1.0, np.exp(span * (s - 1))), 2, power=False),
    Law("stretched exponential", "A exp(-(x/X)^b)", _stretched, 2, (POWER,), power=False),
    Law("cut-off", "A exp(-x/X) x^p", lambda _, s, span: (0.0, 1.0, np.exp(span * (s - 1)), s), 3, (), P, False),
    Law("cut-off at both ends", "A exp(-(x/X)^b - (Y/x)^b) x^p", _between, 4, (BOTH,), P, power=False),
    Law("peak", "A x^p exp(B exp(-ln(x/X)^2 / C))", _peak, 3, (PLACE, FLANK, NO_SHAPE), P),
    Law("lopsided peak", "a peak of two widths", _peak, 3, (PLACE, FLANK, TWO_FLANKS), P, case="peak"),
    Law("step", "A x^p exp(B tanh(ln(x/X) / C))", _step, 3, STEP_Q, P),
    Law("lognormal", "A exp(-B ln(x/X)^2)", lambda q, s, span: (0.0, 1.0, s, s**2), 3, power=False),
    Law("two exponentials", "A exp(-x/X), with a bend to exp(-x/Y)", _bent(ONE_WIDTH, True), 3, TWO.q, power=False),
)
LAWS = (ONE, *OTHER_FUNCTIONS, OFFSET, CORRECTION, *BENDS, THREE)
