"""Laws that data may follow, each a curve ln y(ln x) that is linear in all but a few of its numbers.

    z = shift(q) + columns(q) b                                                                     (1)

q are those few.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sweep.laws.loglog import Array

Parts = tuple[Array | float, Array]
"""Shift and columns of (1)."""


@dataclass(frozen=True)
class Law:
    """One of the curves.

    Attributes
    ----------
    parts : function of (q, t)
        With t from 0 to 1 over the window: positions and widths in q are parts of it.
    grids : sequence of sequences
        Values of each q to start from.
    slopes : int
        How many of the last numbers b are exponents; they are per unit of t.
    """

    name: str
    formula: str
    parts: Callable[[Array, Array], Parts]
    grids: Sequence[Sequence[float]]
    numbers: int
    exponents: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.name


def _line(q: Array, t: Array) -> Parts:
    return 0.0, np.stack([np.ones_like(t), t], axis=1)


def _logarithm(q: Array, t: Array) -> Parts:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.log1p(q[0] * (t - 0.5)), np.stack([np.ones_like(t), t], axis=1)


def _offset(q: Array, t: Array) -> Parts:
    """q: exponent per window, and the arc tangent of offset over prefactor at the middle."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return np.log(np.exp(q[0] * (t - 0.5)) + math.tan(q[1])), np.ones((t.size, 1))


def _correction(q: Array, t: Array) -> Parts:
    """q: correction at the middle, and how fast it fades."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return np.log1p(q[0] * np.exp(-q[1] * (t - 0.5))), np.stack([np.ones_like(t), t], axis=1)


def _bent(bend: Callable[[Array, Array], Array]) -> Callable[[Array, Array], Parts]:
    """Two laws from a bend B(u) that is 0 far below and u far above 0; q: place, logarithm of the width, shape."""

    def parts(q: Array, t: Array) -> Parts:
        u, columns = t - q[0], np.ones((t.size, 3))
        columns[:, 2] = bend(u, q[1:])
        columns[:, 1] = u - columns[:, 2]
        return 0.0, columns

    return parts


def _softplus(u: Array, width: float) -> Array:
    found: Array = width * np.logaddexp(0, u / width)
    return found


def _width(log_width: float) -> float:
    return math.exp(min(max(log_width, -7.0), 1.0))


def _exponential(u: Array, q: Array) -> Array:
    return _softplus(u, _width(q[0]))


def _hyperbola(u: Array, q: Array) -> Array:
    return 0.5 * (u + np.hypot(u, _width(q[0])))


GRID = np.sinh(np.linspace(-9.0, 9.0, 361))
"""Where slopes of bends without a closed form are integrated, in widths."""
STEPS, INNER = np.diff(GRID), GRID[1:-1]


def _integrated(slope: Callable[[Array, float], Array], power: float, u: Array, width: float) -> Array:
    """Bend of a slope of that power that rises from 0 to 1, moved so that it tends to u."""
    cubics, moved = _cubics(slope, power)
    wanted = u / width + moved
    v = np.minimum(np.maximum(wanted, GRID[0]), GRID[-1])
    found: Array = width * (_on_grid(cubics, v) + (wanted - v))
    found[wanted < GRID[0]] = 0.0
    return found


@functools.lru_cache(maxsize=256)
def _cubics(slope: Callable[[Array, float], Array], power: float) -> tuple[Array, float]:
    """Integral of a slope over GRID, as `_hermite` has it, and how far it is moved. Fits ask for one power many
    times."""
    steep = slope(GRID, power)
    rise = np.concatenate([[0.0], np.cumsum(0.5 * (steep[1:] + steep[:-1]) * STEPS)])
    return _hermite(rise, steep), float(GRID[-1] - rise[-1])


def _hermite(rise: Array, steep: Array) -> Array:
    """Cubics (4, steps) between points of GRID, the highest power first; scipy's spline takes ten times as long to make
    as it is used here."""
    mean, first, last = np.diff(rise) / STEPS, steep[:-1], steep[1:]
    return np.stack([(first + last - 2 * mean) / STEPS**2, (3 * mean - 2 * first - last) / STEPS, first, rise[:-1]])


def _on_grid(cubics: Array, v: Array) -> Array:
    k = INNER.searchsorted(v)
    third, second, first, level = cubics[:, k]
    x = v - GRID[k]
    found: Array = ((third * x + second) * x + first) * x + level
    return found


def _powered(v: Array, power: float) -> Array:
    found: Array = np.exp(-power * np.logaddexp(0, -v))
    return found


def _stretched_slope(v: Array, power: float) -> Array:
    found: Array = 0.5 * (1 + np.tanh(0.5 * np.sign(v) * abs(v) ** power))
    return found


def _asymmetric(u: Array, q: Array) -> Array:
    """A logistic slope to the power exp(q1): it fades so many times faster below than above."""
    power = math.exp(min(max(q[1], -2.5), 2.5))
    return _integrated(_powered, power, u, _width(q[0]))


def _uneven(u: Array, q: Array) -> Array:
    """Widths exp(q0 + q1) below and exp(q0 - q1) above."""
    below, above = _width(q[0] + q[1]), _width(q[0] - q[1])
    v = u + (above - below) * math.log(2)
    return np.where(v < 0, _softplus(v, below), _softplus(v, above) + (below - above) * math.log(2))


def _stretched(u: Array, q: Array) -> Array:
    """A slope that fades as the exponential of the power exp(q1) of u."""
    power = math.exp(min(max(q[1], -1.2), 0.8))
    return _integrated(_stretched_slope, power, u, _width(q[0]))


def _three(q: Array, t: Array) -> Parts:
    first, second, width = min(q[0], q[1]), max(q[0], q[1]), _width(q[2])
    if not (0 < first < second < 1 and second - first > 2 * width):  # the middle law would be seen nowhere
        return 0.0, np.full((t.size, 4), np.nan)
    a, b = _softplus(t - first, width), _softplus(t - second, width)
    return 0.0, np.stack([np.ones_like(t), t - a, a - b, b], axis=1)


PLACES, WIDTHS = tuple(np.linspace(0.1, 0.9, 7)), tuple(np.log((0.01, 0.04, 0.12, 0.3)))
FADES = (-12.0, -6.0, -2.5, 2.5, 6.0, 12.0)
LOW_HIGH = ("p low", "p high")

ONE = Law("one law", "A x^p", _line, (), 2, ("p",))
LOGARITHM = Law("logarithm", "A x^p (1 + B ln x)", _logarithm, ((-1.9, -1.5, -0.5, 0.5, 1.5, 1.9),), 3, ("p",))
OFFSET = Law("offset", "A x^p + C", _offset, (FADES, (-1.2, -0.3, 0.1, 0.8, 1.4)), 3)
CORRECTION = Law(
    "correction to scaling", "A x^p (1 + B x^-D)", _correction, ((-0.5, -0.05, 0.05, 0.5, 3.0), FADES), 4, ("p",)
)
TWO = Law("two laws", "bend fading exponentially", _bent(_exponential), (PLACES, WIDTHS), 5, LOW_HIGH)
HYPERBOLA = Law("two laws, hyperbola", "bend fading as 1/ln x", _bent(_hyperbola), (PLACES, WIDTHS), 5, LOW_HIGH)
ASYMMETRIC = Law(
    "two laws, asymmetric bend",
    "fading faster on one side",
    _bent(_asymmetric),
    (PLACES, WIDTHS, (-1.0, 1.0)),
    6,
    LOW_HIGH,
)
UNEVEN = Law(
    "two laws, two widths", "one width below, another above", _bent(_uneven), (PLACES, WIDTHS, (-0.7, 0.7)), 6, LOW_HIGH
)
STRETCHED = Law(
    "two laws, stretched bend",
    "fading as exp(-(ln x)^b)",
    _bent(_stretched),
    (PLACES, WIDTHS, (-0.5, 0.3)),
    6,
    LOW_HIGH,
)


def _of_power(power: float) -> Law:
    """That bend with one power alone."""
    parts = _bent(lambda u, q: _stretched(u, np.array([q[0], power])))
    return replace(STRETCHED, parts=parts, grids=STRETCHED.grids[:2], numbers=5)


POWERS = {float(power): _of_power(power) for power in np.linspace(-1.2, 0.8, 17)}
"""By the logarithm of the power."""
THREE = Law(
    "three laws",
    "two bends of one width",
    _three,
    ((0.2, 0.35, 0.5), (0.5, 0.65, 0.8), WIDTHS),
    7,
    ("p low", "p middle", "p high"),
)
BENDS = (TWO, HYPERBOLA, ASYMMETRIC, UNEVEN, STRETCHED)
LAWS = (ONE, LOGARITHM, OFFSET, CORRECTION, *BENDS, THREE)
