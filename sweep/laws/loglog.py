"""Slopes and roots of curves given at the points of an uneven grid; plain arrays, the curve along the last axis.

A missing point is NaN, and no stencil reaches across one: each run of neighbours stands for itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 3
"""Points that a slope needs: through two it says nothing about its own error."""

BEYOND_NOISE = 4.0
"""Standard errors that noise does not reach."""

MEMORY = 0.9
"""Autocorrelation of the noise that error bars of slopes are for; of independent noise they are wider, by half."""
NEAR, WIDEST = 6, 6
"""Points to each side that tell the size of the noise, and over which a stencil of seven points reaches at most."""

FEW = 20
"""Points below which noise is not told from a bend."""

EPSILON = float(np.finfo(np.float64).eps)


def slopes(t: Array, z: Array, points: int) -> Array:
    """dz/dt at every point, by the polynomial through `points` neighbours: order points - 1.

    Parameters
    ----------
    t : (n,) array
        Strictly monotone.
    z : (..., n) array
        NaN where missing; the result is NaN there, and in runs shorter than three. A run shorter than `points`
        is differentiated with what it has.
    """
    return _by_runs(t, z, lambda s, y: _derivative(s, y, points))


def slope_errors(t: Array, z: Array, bound: Array | None = None) -> Array:
    """Half the 95 % interval of the slope by five points, with noise; without, more than its error.

    What the polynomial through seven points says otherwise tells the error. Noise makes it alike at neighbours, over
    the weights of both: the median near a point gives its size. Where it is far larger, the curve bends: it counts
    itself there, and where a bend is within a step, so that more points do not tell more, the slopes of the steps
    beside the point. What errors up to `bound` (..., n) in the values can do is added.
    """
    found = _by_runs(t, z, _derivative_errors)
    if bound is None or not bound.any():
        return found
    missing = np.where(np.isfinite(z), np.broadcast_to(bound, z.shape), np.nan)
    return found + _by_runs(t, missing, lambda s, b: slope_bounds(s, b, 5))


def _by_runs(t: Array, z: Array, function: Callable[[Array, Array], Array]) -> Array:
    """`function` of each unbroken run of at least three neighbours; lines with the same gaps at once."""
    if np.isfinite(z).all():
        return function(t, z)
    rows = z.reshape(-1, t.size)
    found = np.full(rows.shape, np.nan)
    patterns, which = np.unique(np.isfinite(rows), axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        alike = np.flatnonzero(which.reshape(-1) == number)
        for start, stop in runs(pattern):
            if stop - start >= FEWEST:
                found[alike, start:stop] = function(t[start:stop], rows[alike, start:stop])
    return found.reshape(z.shape)


def runs(present: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and past-the-last index of each unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], present, [False]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _derivative(t: Array, z: Array, points: int) -> Array:
    nodes, weights = _stencils(t, points)
    slope = np.zeros(z.shape)
    for k in range(nodes.shape[1]):  # differences from the home point: a constant has slope zero exactly
        slope += weights[:, k] * (z[..., nodes[:, k]] - z)
    return slope


def _derivative_errors(t: Array, z: Array) -> Array:
    fine, middle, rough = (7, 5, 3) if t.size > 5 else (t.size, max(2, t.size - 2), 2)  # beside few points lower orders
    slope = _derivative(t, z, middle)
    apart, coarse = abs(_derivative(t, z, fine) - slope), abs(_derivative(t, z, rough) - slope)
    sharp = 4.0 * apart > coarse  # orders that do not tell: a bend within a step, about which the steps beside it do
    steps = np.diff(z, axis=-1) / np.diff(t)
    beside = np.maximum(
        abs(steps[..., np.r_[0, : t.size - 1]] - slope), abs(steps[..., np.r_[: t.size - 1, -1]] - slope)
    )
    weights, between = _dense(t, middle), _dense(t, fine)
    apart_by_noise = apart / _norm(between - weights)
    noise = 1.4826 * _median_near(apart_by_noise)
    least = np.minimum(noise, 1.4826 * np.median(apart_by_noise, axis=-1, keepdims=True))
    by_noise = noise * _norm(weights)
    few = t.size < FEW
    by_bend = _largest_near(np.where(sharp, np.maximum(apart, beside), np.maximum(apart, coarse) if few else apart))
    bends = few | (_largest_near(apart_by_noise) > BEYOND_NOISE * least)
    error = np.where(bends, np.maximum(by_noise, by_bend), by_noise)
    rounding = EPSILON * (1.0 + abs(z).max(axis=-1, keepdims=True)) * np.sqrt((weights**2).sum(axis=1))
    found: Array = 2.3 * error + rounding  # 1.96 and what the median, of few points, is too small
    pole = _beside_pole(steps) & (_largest_near(apart_by_noise) > BEYOND_NOISE * least)
    return np.where(pole, np.inf, found)


def _beside_pole(steps: Array) -> NDArray[np.bool_]:
    """Points between which, or at which, steps (..., n - 1) change sign, and towards which they grow on both sides.

    Nothing at the points says how near the pole is.
    """
    size, sign = abs(steps), np.sign(steps)
    found = np.zeros((*steps.shape[:-1], steps.shape[-1] + 1), dtype=bool)
    if steps.shape[-1] < 6:
        return found
    up, down = size[..., :-1] < size[..., 1:], size[..., :-1] > size[..., 1:]
    same = sign[..., :-1] == sign[..., 1:]
    before = up[..., :-1] & up[..., 1:] & same[..., :-1] & same[..., 1:]  # [i]: steps i to i + 2 grow
    after = down[..., :-1] & down[..., 1:] & same[..., :-1] & same[..., 1:]  # [i]: steps i to i + 2 shrink
    last, first = sign[..., 2:], sign[..., :-2]
    at = before[..., :-3] & after[..., 3:] & (last[..., :-3] == -first[..., 3:])
    found[..., 3:-3] |= at
    within = before[..., :-4] & after[..., 4:] & (last[..., :-4] == -first[..., 4:])
    found[..., 3:-4] |= within
    found[..., 4:-3] |= within
    return found


def slope_bounds(t: Array, bound: Array, points: int) -> Array:
    """How far errors up to `bound` (..., n) in the values can move each slope of `slopes`; lines without gaps."""
    nodes, weights = _stencils(t, points)
    found: Array = (abs(weights) * bound[..., nodes]).sum(axis=-1) + abs(weights.sum(axis=1)) * bound
    return found


def _largest_near(values: Array) -> Array:
    """The largest of each value and its two neighbours on both sides."""
    padded = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(2, 2)], mode="edge")
    found: Array = np.lib.stride_tricks.sliding_window_view(padded, 5, axis=-1).max(axis=-1)
    return found


def _median_near(values: Array) -> Array:
    """The median of each value and its NEAR neighbours on both sides, which a bend or a spike does not change."""
    reach = min(NEAR, (values.shape[-1] - 1) // 2)
    padded = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(reach, reach)], mode="reflect")
    found: Array = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=-1), axis=-1)
    return found


def _dense(t: Array, points: int) -> Array:
    """Weights of the slopes (n, 2 WIDEST + 1), the home point in the middle."""
    nodes, weights = _stencils(t, points)
    found, home = np.zeros((t.size, 2 * WIDEST + 1)), np.arange(t.size)[:, None]
    np.put_along_axis(found, nodes - home + WIDEST, weights, axis=1)
    found[:, WIDEST] = -weights.sum(axis=1)
    return found


def _norm(weights: Array) -> Array:
    """Standard error of each slope for values with autocorrelated errors of size 1."""
    places = np.arange(weights.shape[1])
    size: Array = np.sqrt(np.einsum("ij,jk,ik->i", weights, MEMORY ** abs(np.subtract.outer(places, places)), weights))
    return size


def _stencils(t: Array, points: int) -> tuple[NDArray[np.intp], Array]:
    """Neighbours (n, points) of each point, and their weights in its slope; that of the point itself is left zero."""
    points = min(points, t.size)
    home = np.arange(t.size)
    first = np.clip(home - points // 2, 0, t.size - points)
    nodes = first[:, None] + np.arange(points)
    return nodes, _weights(t[nodes], home - first)


def _weights(nodes: Array, home: NDArray[np.intp]) -> Array:
    """Weights (n, points) of the derivative at nodes[i, home[i]]; that of the home point itself is left zero."""
    row = np.arange(len(nodes))
    apart = nodes[:, :, None] - nodes[:, None, :]
    apart[:, np.arange(nodes.shape[1]), np.arange(nodes.shape[1])] = 1.0
    barycentric = 1.0 / apart.prod(axis=2)
    weights: Array = barycentric / barycentric[row, home][:, None] / apart[row, home]
    weights[row, home] = 0.0
    return weights


def interpolations(t: Array, z: Array, count: int) -> list[Array]:
    """How far each point inside (..., n - count) is off the polynomial through `count` neighbours, half on either side,
    and how far it would be if all points were independent noise.

    In units that give noise of size 1 the size 1.
    """
    nodes = np.arange(t.size - count)[:, None] + np.arange(count + 1)
    apart = t[nodes][:, :, None] - t[nodes][:, None, :]
    apart[:, np.arange(count + 1), np.arange(count + 1)] = 1.0
    weights = 1.0 / apart.prod(axis=2)
    weights /= np.sqrt((weights**2).sum(axis=1, keepdims=True))
    parts = weights * z[..., nodes]
    return [parts.sum(axis=-1), np.sqrt((parts**2).sum(axis=-1))]


def tends(t: Array, local: Array, doubt: float) -> tuple[float, float]:
    """The exponent at the start of a window, and the limit beyond it, three times over.

    Its change from third to second to first of three points a step apart goes on geometrically, which is a third of the
    way for a bend that fades as 1/ln^2; where it does not slow down towards the end, ten times the last change stands
    for an unknown limit. What is within `doubt` is no change.
    """
    step = min(np.log(10), (t[-1] - t[0]) / 8)
    first, second, third = np.interp(t[0] + step * np.arange(3), t, local)
    last, before = first - second, second - third
    left = last * last / (before - last) if abs(last) < abs(before) and last * before > 0 else 10 * last
    return float(first), float(first + 3 * left) if abs(last) > doubt else float(first)


def brackets(c: Array, value: float) -> list[int]:
    """Indices i such that a curve passes `value` in [c[i], c[i + 1]), or meets it at either end of a run."""
    present, above, on = np.isfinite(c), c >= value, c == value
    alone = np.concatenate([[True], ~present, [True]])  # whether the point before is missing; shifted by 2: after
    starts, ends = alone[:-2][:-1] & on[:-1] & above[1:], alone[2:][1:] & on[1:] & above[:-1]
    passes = (above[:-1] != above[1:]) | starts | ends
    found: list[int] = np.flatnonzero(present[:-1] & present[1:] & passes).tolist()
    return found


def root(t: Array, c: Array, bracket: int, value: float, points: int) -> float:
    """Where the polynomial through `points` neighbours of t[bracket], t[bracket + 1] passes `value` between these."""
    start, stop = next((a, b) for a, b in runs(np.isfinite(c)) if a <= bracket < b)
    first = min(max(bracket - points // 2 + 1, start), max(stop - points, start))
    near = slice(first, min(first + points, stop))
    nodes, heights = t[near], c[near] - value
    apart = nodes[:, None] - nodes[None, :]
    np.fill_diagonal(apart, 1.0)
    weights = 1.0 / apart.prod(axis=1)
    left, right = float(t[bracket]), float(t[bracket + 1])
    rising = bool(c[bracket + 1] > c[bracket])
    for _ in range(64):  # halves down to the last bit
        middle = left + (right - left) / 2
        if middle in (left, right):
            break
        if (_polynomial(nodes, weights, heights, middle) >= 0) == rising:
            right = middle
        else:
            left = middle
    return left + (right - left) / 2


def _polynomial(nodes: Array, weights: Array, heights: Array, at: float) -> float:
    away = at - nodes
    if not away.all():
        return float(heights[away == 0][0])
    share = weights / away
    return float((share * heights).sum() / share.sum())


def is_logarithmic(grid: Any) -> bool:
    """Whether an axis of these values is drawn in logarithms: steps of equal ratio, or two decades and more."""
    numbers = np.asarray(grid, dtype=np.float64)
    if numbers.size < 3 or not (np.isfinite(numbers).all() and numbers.min() > 0):
        return spans_decades(numbers)
    steps = np.diff(np.log(numbers))
    return bool(np.ptp(steps) < 1e-6 * abs(steps).max()) or spans_decades(numbers)


def spans_decades(values: Any) -> bool:
    """Whether the finite values are positive and reach over two decades and more."""
    numbers = np.asarray(values, dtype=np.float64)
    numbers = numbers[np.isfinite(numbers)]
    return bool(numbers.size and numbers.min() > 0 and numbers.max() / numbers.min() >= 99.9)
