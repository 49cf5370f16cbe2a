"""Laws that data may follow, each a curve ln y(ln x) that is linear in all but a few of its numbers.

    z = shift(q) + columns(q) b                                                                     (1)

For given q, b is a linear least-squares fit (variable projection): a grid over q gives the start, scipy's
Levenberg-Marquardt the end.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from sweep.analysis.correlated import corrected
from sweep.analysis.loglog import EPSILON, Array

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


class Found(NamedTuple):
    """A law fitted to points; `numbers` are q and then b, their standard errors `errors` for noise of the size of
    `off`."""

    law: Law
    numbers: Array
    errors: Array
    off: Array
    deviance: float
    aicc: float
    bic: float


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


def fitted(law: Law, t: Array, z: Array, weights: Array | None = None, known: bool = False) -> Found | None:
    """The law that is nearest to the points, t rising; None where there are not more points than numbers, and two.

    `known` weights are one over the variance of each point; others tell only how these compare.
    """
    from scipy.optimize import leastsq

    if t.size < law.numbers + 2:
        return None
    s = (t - t[0]) / (t[-1] - t[0])
    root = np.ones_like(z) if weights is None else np.sqrt(weights if known else weights / weights.mean())
    q = _start(law, s, z, root)
    if law.grids:
        options: dict[str, Any] = {"xtol": 1e-8, "ftol": 1e-10, "maxfev": 200, "full_output": True}
        q = leastsq(lambda p: _project(law, p, s, z, root)[1], q, diag=np.ones(q.size), **options)[0]
    b, off = _project(law, q, s, z, root)
    numbers = np.concatenate([q, b])
    errors = _errors(law, numbers, s, off, root)
    if known:
        errors = errors * math.sqrt((s.size - law.numbers) / max(float(off @ off), 1e-300))
    floor = (4 * EPSILON * (1 + abs(z).max())) ** 2  # what rounding leaves
    deviance = z.size * math.log(float(off @ off) / z.size + floor) - 2 * float(np.log(root).sum())
    deviance = float(off @ off) if known else deviance
    k = law.numbers + (not known)
    return Found(
        law, numbers, errors, off / root, deviance, corrected(deviance, z.size, k), deviance + k * math.log(z.size)
    )


def curve(found: Found, t: Array, first: float, last: float) -> Array:
    """ln y of a fitted law at ln x = t; first and last are those of the points that it was fitted to."""
    s = (t - first) / (last - first)
    q, b = np.split(found.numbers, [len(found.law.grids)])
    shift, columns = found.law.parts(q, s)
    value: Array = shift + columns @ b
    return value


def _start(law: Law, s: Array, z: Array, root: Array) -> Array:
    tries, shifts, bases = _grid(law, s.tobytes(), root.tobytes())
    wanted = (z - shifts) * root
    off = wanted - np.einsum("gnk,gmk,gm->gn", bases, bases, wanted, optimize=True)
    best: Array = tries[int(np.nanargmin((off**2).sum(axis=1)))]
    return best


@functools.lru_cache(maxsize=128)
def _grid(law: Law, places: bytes, roots: bytes) -> tuple[Array, Array, Array]:
    """All q to start from (g, q), their shifts (g, n), and orthonormal bases (g, n, columns); NaN where there is no
    such curve. Lines of one array share them."""
    s, root = np.frombuffer(places), np.frombuffer(roots)
    tries = np.array(list(itertools.product(*law.grids)), dtype=np.float64)
    parts = [law.parts(q, s) for q in tries]
    shifts = np.stack([np.broadcast_to(shift, s.shape) for shift, _ in parts])
    columns = np.stack([columns for _, columns in parts])
    exist = np.isfinite(columns).all(axis=(1, 2)) & np.isfinite(shifts).all(axis=1)
    bases = np.linalg.qr(np.where(exist[:, None, None], columns, 0.0) * root[:, None])[0]
    return tries, np.where(exist[:, None], shifts, np.nan), bases


FAR = 1e6
"""Distance of points from a curve that does not exist there."""


def _project(law: Law, q: Array, s: Array, z: Array, root: Array) -> tuple[Array, Array]:
    """Linear numbers and weighted distances for given q."""
    from scipy.linalg.lapack import dgelsd

    shift, columns = law.parts(q, s)
    if not math.isfinite(columns.sum() + np.sum(shift)):
        return np.zeros(columns.shape[1]), np.full(s.size, FAR)
    wanted, columns = (z - shift) * root, columns * root[:, None]
    b = dgelsd(columns, wanted, *_workspace(*columns.shape), EPSILON * s.size)[0][: columns.shape[1]]
    return b, wanted - columns @ b


@functools.lru_cache(maxsize=128)
def _workspace(points: int, columns: int) -> tuple[int, int]:
    """What dgelsd is to be given; numpy asks for it in each of its thousands of calls."""
    from scipy.linalg.lapack import dgelsd_lwork

    most, whole, _ = dgelsd_lwork(points, columns, 1)
    return int(most), int(whole)


STEP = 3e-6
"""Of derivatives by q, which are of a size like one."""
DOUBT = 3 * EPSILON / STEP
"""Part of the largest column that no derivative is sure of, by rounding."""
SEEN = 10.0
"""Doubts of the Jacobian from which on points are seen to move."""


def _errors(law: Law, numbers: Array, s: Array, off: Array, root: Array) -> Array:
    """Standard errors by the Jacobian; inf of what the points do not determine.

    Directions of the numbers in which points are not seen to move are lost. Numbers of which they are a part, beyond
    what the doubt of the Jacobian makes so, are not determined; errors of others are as if those were known.
    """
    slopes, doubt, level = _jacobian(law, numbers, s)
    if not np.isfinite(slopes).all():
        return np.full(numbers.size, np.inf)
    least = np.sqrt(((doubt * root[:, None]) ** 2).sum(axis=0)) + 1e-100
    _, moved, directions = np.linalg.svd(slopes * root[:, None] / least, full_matrices=False)
    seen = moved > SEEN
    change = directions.T / least[:, None] / np.where(seen, moved, 1.0)
    change[len(law.grids)] -= level @ change
    known, lost = ((change[:, which] ** 2).sum(axis=1) for which in (seen, ~seen))
    found: Array = np.sqrt(known * float(off @ off) / (s.size - law.numbers))
    return np.where(lost > SEEN * known, np.inf, found)


def _jacobian(law: Law, numbers: Array, s: Array) -> tuple[Array, Array, Array]:
    """Derivatives of (1), how far they are in doubt by rounding and steps, and the level that each number adds.

    Columns of exponents add up to t less a place. So of the exponent that most points have, q moves the level alone,
    which is told apart: beside it a bend between exponents that are nearly alike would be lost.
    """
    q, b = np.split(numbers, [len(law.grids)])
    columns = law.parts(q, s)[1]
    most = b[1:][np.argmax((columns[:, 1:] ** 2).sum(axis=0))] if b.size > 1 else 0.0
    rest = np.array([0.0, *(b[1:] - most)])
    slopes = np.concatenate([np.empty((s.size, q.size)), columns], axis=1)
    doubt, level = np.full(slopes.shape, DOUBT * abs(columns).max()), np.zeros(numbers.size)
    for j, step in enumerate(STEP * np.maximum(1.0, abs(q))):
        (shift, by_q), (rough_shift, rough) = (_derivative(law, q, j, times * step, s) for times in (1, 2))
        slopes[:, j] = shift + by_q @ rest
        doubt[:, j] = doubt[:, j] * abs(rest).sum() + 3 * abs(rough_shift + rough @ rest - slopes[:, j])
        level[j] = most * by_q[:, 1:].sum(axis=1).mean() if b.size > 1 else 0.0
    return slopes, doubt, level


def _derivative(law: Law, q: Array, j: int, step: float, s: Array) -> Parts:
    """Of shift and columns by one q."""
    by = np.where(np.arange(q.size) == j, step, 0.0)
    with np.errstate(invalid="ignore"):
        (shift, columns), (less, below) = law.parts(q + by, s), law.parts(q - by, s)
        return (shift - less) / (2 * step), (columns - below) / (2 * step)
