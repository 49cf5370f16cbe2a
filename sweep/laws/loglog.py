"""Slopes and roots of curves on a nonuniform grid; plain arrays, with the curve along the last axis.

A missing point is NaN, and no stencil extends across one: each run of neighbours is treated separately.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 3
"""Least number of points for a slope; two points give no error estimate."""
LINES, VALUES = 250, 100_000
"""Lines, and values of lines, that are taken at once, so that what is held stays below some 50 MB."""
EPSILON = float(np.finfo(np.float64).eps)


def slopes(t: Array, z: Array, points: int) -> Array:
    """dz/dt at every point of lines (..., n), t strictly monotone, by the polynomial through `points` neighbours: order
    points - 1. NaN where a point is missing, and in runs shorter than three; shorter ones than `points` take what there
    is."""
    # differences from one point: a constant has slope zero exactly
    return by_runs(t, lambda s, y: (y - y[:, :1]) @ _matrix(s, points).T, z)


def slope_bounds(t: Array, bound: Array, points: int) -> Array:
    """How far errors up to `bound` (..., n) in the values can move each slope of `slopes`; lines without gaps."""
    return np.asarray(bound @ abs(_matrix(t, points)).T)


def by_runs(t: Array, function: Callable[..., Array], *lines: Array) -> Array:
    """`function` of each unbroken run of at least three neighbours; lines (..., n) with the same gaps at once."""
    rows = [np.broadcast_to(one, lines[0].shape).reshape(-1, t.size) for one in lines]
    result = np.full(rows[0].shape, np.nan)
    for pattern, which in alike(np.isfinite(rows[0])):
        for start, stop in runs(pattern):
            if stop - start >= FEWEST:
                result[which, start:stop] = function(t[start:stop], *(one[which, start:stop] for one in rows))
    return result.reshape(lines[0].shape)


def alike(present: NDArray[np.bool_], most: int = LINES) -> list[tuple[NDArray[np.bool_], NDArray[np.intp]]]:
    """Patterns among rows (m, n), and which rows have each, so many at most at once."""
    patterns, which = present[:1], np.zeros(len(present), dtype=np.intp)
    if not present.all():
        patterns, which = np.unique(present, axis=0, return_inverse=True)
    parts = [(p, np.flatnonzero(which.reshape(-1) == number)) for number, p in enumerate(patterns)]
    return [(p, rows[i : i + most]) for p, rows in parts for i in range(0, rows.size, most)]


def once(t: Array, *lines: Array) -> tuple[Array, ...]:
    """Abscissae, and lines (..., n), without repetitions, which are alike where there is no noise."""
    first = np.append(True, np.diff(t) > 0)
    return t[first], *(one[..., first] for one in lines)


def runs(present: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and past-the-last index of each unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], present, [False]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def slope_errors(t: Array, z: Array, bound: Array) -> Array:
    """Half the 95 % interval of the slope by five points, with noise; without, more than its error; of lines (m, n)
    without gaps.

    What the polynomial through seven points says otherwise tells the error. Noise makes it alike at neighbours, over
    the weights of both: the median near a point gives its size. Where it is far larger, the curve bends: it counts
    itself there, and where a bend is within a step, so that more points do not tell more, the slopes of the steps
    beside the point. What errors up to `bound` (m, n) in the values can do is added.
    """
    from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d
    from scipy.sparse import diags_array

    orders = (7, 5, 3) if t.size > 5 else (t.size, max(2, t.size - 2), 2)  # beside few points lower orders
    fine, middle, rough = (_matrix(t, points) for points in orders)
    level = z - z[:, :1]
    slope = level @ middle.T
    apart, coarse = abs(level @ fine.T - slope), abs(level @ rough.T - slope)
    rounding = EPSILON * (1.0 + abs(z).max(axis=-1, keepdims=True)) * np.sqrt((middle**2).sum(axis=1))
    # orders that do not tell: a bend within a step, about which the steps beside it do
    sharp = 4.0 * apart > coarse + 8.0 * rounding
    steps = np.diff(z, axis=-1) / np.diff(t)
    both = [abs(steps[..., np.clip(np.arange(t.size) - k, 0, t.size - 2)] - slope) for k in (0, 1)]
    # standard errors for values with errors of size 1 and autocorrelation 0.9; of independent noise they are wider, by
    # half. A stencil of seven points reaches over six steps
    steps_apart = np.arange(-min(6, t.size - 1), min(7, t.size))
    noises = diags_array(0.9 ** abs(steps_apart), offsets=steps_apart, shape=(t.size, t.size))
    size, size_apart = (np.sqrt(((one @ noises) * one).sum(axis=1)) for one in (middle, fine - middle))
    apart_by_noise = apart / size_apart
    # the median over six points to each side, which a bend or a spike does not change
    noise = 1.4826 * median_filter(apart_by_noise, (1, 1 + 2 * min(6, (t.size - 1) // 2)), mode="mirror")
    least = np.minimum(noise, 1.4826 * np.median(apart_by_noise, axis=-1, keepdims=True))
    # noise changes the sign of what seven points say otherwise from point to point, a smooth curve does not; on an
    # uneven grid that is then no measure of the error, which differs from point to point by far more than that of noise
    row, rounded = np.arange(t.size), 8.0 * EPSILON * (1.0 + abs(z).max(axis=-1, keepdims=True))
    signs = np.sign(level @ fine.T - slope) * (-1.0) ** (row - np.clip(row - 2, 0, max(0, t.size - 5)))
    same = (np.diff(signs, prepend=signs[:, :1]) == 0) | (apart_by_noise <= rounded)
    smooth = maximum_filter1d(uniform_filter1d(1.0 * same, 13, mode="mirror"), 5, mode="nearest") > 0.7
    # a bend beyond four standard errors, which noise does not reach; few points do not tell it from noise
    few, rises = t.size < 20, maximum_filter1d(apart_by_noise, 5, mode="nearest") > 4.0 * least
    by_bend = np.where(smooth, np.sqrt(apart * coarse), 0.0)
    by_bend = np.maximum(np.maximum(apart, by_bend), np.where(sharp, np.maximum(*both), coarse if few else 0.0))
    error = np.maximum(noise * size, np.where(few | rises | smooth, maximum_filter1d(by_bend, 5, mode="nearest"), 0.0))
    bar: Array = 2.3 * error + rounding  # 1.96 and what the median, of few points, is too small
    return np.where(_beside_pole(steps) & rises, np.inf, bar) + slope_bounds(t, bound, 5)


def _beside_pole(steps: Array) -> NDArray[np.bool_]:
    """Points between which, or at which, steps (..., n - 1) change sign, and towards which they grow on both sides.

    Nothing at the points says how near the pole is.
    """
    beside = np.zeros((*steps.shape[:-1], steps.shape[-1] + 1), dtype=bool)
    for between in range(min(2, max(0, steps.shape[-1] - 5))):  # steps over the pole
        window = sliding_window_view(steps, 6 + between, axis=-1)
        towards = np.stack([window[..., :3], -window[..., :-4:-1]]) * np.sign(window[..., 2])[..., None]
        pole = ((np.diff(towards, axis=-1) > 0).all(axis=-1) & (towards[..., 0] > 0)).all(axis=0)
        for k in range(3, 4 + between):
            beside[..., k : k + pole.shape[-1]] |= pole
    return beside


def _matrix(t: Array, points: int) -> Any:
    """Weights of all values (sparse, n x n) in the slope at each point, by the polynomial through its neighbours."""
    from scipy.sparse import csr_array

    points, row = min(points, t.size), np.arange(t.size)
    first = np.clip(row - points // 2, 0, t.size - points)
    nodes, home = first[:, None] + np.arange(points), row - first
    apart, weights = t[:, None] - t[nodes], barycentric(t[nodes])
    apart[row, home] = 1.0
    weights = weights / weights[row, home][:, None] / apart
    weights[row, home] = 0.0
    weights[row, home] = -weights.sum(axis=1)
    return csr_array((weights.ravel(), (row.repeat(points), nodes.ravel())), shape=(t.size, t.size))


def barycentric(nodes: Array) -> Array:
    """Barycentric weights of nodes (m, k)."""
    columns = np.ascontiguousarray(nodes.T)
    weights = np.empty_like(columns)
    for k, own in enumerate(columns):
        apart = own - columns
        apart[k] = 1.0
        weights[k] = 1.0 / apart.prod(axis=0)
    return np.ascontiguousarray(weights.T)


def tends(t: Array, local: Array, doubts: Any) -> list[tuple[float, float, bool]]:
    """At each end of a window the exponent there, the limit beyond it, three times over, and whether there is one.

    Its change from third to second to first of three points a step apart goes on geometrically, which is a third of the
    way for a bend that fades as 1/ln^2; where it does not slow down towards the end, ten times the last change stands
    for an unknown limit. What is within the doubt of that end is no change.
    """
    step, limits = min(np.log(10), (t[-1] - t[0]) / 8), []
    for end, inwards, doubt in zip(t[[0, -1]], (step, -step), doubts, strict=True):
        first, second, third = np.interp(end + inwards * np.arange(3), t, local).tolist()
        last, before = first - second, second - third
        slows = last * before > 0 and abs(last) < (1 - 1e-6) * abs(before)  # by more than rounding
        left = last * last / (before - last) if slows else 10 * last
        still = bool(abs(last) <= doubt)
        limits.append((first, first if still else first + 3 * left, still or slows))
    return limits


def brackets(c: Array, value: float) -> list[int]:
    """Indices i such that a curve passes `value` in [c[i], c[i + 1]), or meets it at either end of a run."""
    present, above, on = np.isfinite(c), c >= value, c == value
    alone = np.concatenate([[True], ~present, [True]])  # whether the point before is missing; shifted by 2: after
    starts, ends = alone[:-2][:-1] & on[:-1] & (c > value)[1:], alone[2:][1:] & on[1:] & (c > value)[:-1]
    passes = (above[:-1] != above[1:]) | starts | ends
    result: list[int] = np.flatnonzero(present[:-1] & present[1:] & passes).tolist()
    return result


def root(t: Array, c: Array, bracket: int, value: float, points: int) -> float:
    """Where the polynomial through `points` neighbours of t[bracket], t[bracket + 1] passes `value` between these."""
    from scipy.interpolate import BarycentricInterpolator
    from scipy.optimize import brentq

    start, stop = next((a, b) for a, b in runs(np.isfinite(c)) if a <= bracket < b)
    first = min(max(bracket - points // 2 + 1, start), max(stop - points, start))
    near, ends = slice(first, min(first + points, stop)), t[bracket : bracket + 2]
    polynomial = BarycentricInterpolator(t[near], c[near] - value, rng=0)  # it takes the points in a random order
    return float(brentq(lambda at: float(polynomial(at)), *ends, xtol=4 * EPSILON * np.ptp(ends), rtol=4 * EPSILON))


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
