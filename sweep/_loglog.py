"""Slopes, lines and roots of curves given at the points of an uneven grid; plain arrays, the curve along the last axis.

A missing point is NaN, and no stencil reaches across one: each run of neighbours stands for itself.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 3
"""Points that a slope needs: through two it says nothing about its own error."""

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
    if np.isfinite(z).all():
        return _derivative(t, z, points)
    rows = z.reshape(-1, t.size)
    found = np.full(rows.shape, np.nan)
    patterns, which = np.unique(np.isfinite(rows), axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        alike = np.flatnonzero(which.reshape(-1) == number)
        for start, stop in runs(pattern):
            if stop - start >= FEWEST:
                found[alike, start:stop] = _derivative(t[start:stop], rows[alike, start:stop], points)
    return found.reshape(z.shape)


def runs(present: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and past-the-last index of each unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], present, [False]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _derivative(t: Array, z: Array, points: int) -> Array:
    points = min(points, t.size)
    home = np.arange(t.size)
    first = np.clip(home - points // 2, 0, t.size - points)
    nodes = first[:, None] + np.arange(points)
    weights = _weights(t[nodes], home - first)
    slope = np.zeros(z.shape)
    for k in range(points):  # differences from the home point: a constant has slope zero exactly
        slope += weights[:, k] * (z[..., nodes[:, k]] - z)
    return slope


def _weights(nodes: Array, home: NDArray[np.intp]) -> Array:
    """Weights (n, points) of the derivative at nodes[i, home[i]]; that of the home point itself is left zero."""
    row = np.arange(len(nodes))
    apart = nodes[:, :, None] - nodes[:, None, :]
    apart[:, np.arange(nodes.shape[1]), np.arange(nodes.shape[1])] = 1.0
    barycentric = 1.0 / apart.prod(axis=2)
    weights: Array = barycentric / barycentric[row, home][:, None] / apart[row, home]
    weights[row, home] = 0.0
    return weights


LINE = (
    "exponent", "exponent_error", "prefactor", "prefactor_error", "drift", "residual",
    "points", "low", "high", "centre", "level", "level_error",
)  # fmt: skip
"""What `line` puts along its last axis."""


def line(t: Array, z: Array) -> Array:
    """Least-squares line z = level + exponent (t - centre), (..., n) to (..., 12) in the order of `LINE`.

    Sums run over deviations from the means, so a narrow window far from t = 0 costs no digits. `prefactor`,
    `low`, `high`, `centre` and `level` are turned back from logarithms. NaN where fewer than three points are left.
    """
    present = np.isfinite(z)
    n = present.sum(axis=-1)
    enough = n >= FEWEST
    with np.errstate(invalid="ignore", divide="ignore", over="ignore", under="ignore"):
        count = np.where(enough, n, np.nan)
        centre = _sum(present, t) / count
        u = np.where(present, t - centre[..., None], 0.0)
        level = _sum(present, z) / count
        rise = np.where(present, z - level[..., None], 0.0)
        spread = (u * u).sum(axis=-1)
        slope = (u * rise).sum(axis=-1) / spread
        off = rise - slope[..., None] * u
        variance = (off * off).sum(axis=-1) / (count - 2)
        at_one = np.sqrt(variance * (1 / count + centre**2 / spread))
        prefactor = np.exp(level - slope * centre)
        low = np.where(present, t, np.inf).min(axis=-1, initial=np.inf)
        high = np.where(present, t, -np.inf).max(axis=-1, initial=-np.inf)
        columns = (
            slope, np.sqrt(variance / spread), prefactor, prefactor * at_one,
            _drift(u, off, present, high - low), np.expm1(abs(off).max(axis=-1, initial=0.0)),
            n, np.exp(low), np.exp(high), np.exp(centre), np.exp(level), np.sqrt(variance / count),
        )  # fmt: skip
    found = np.stack([np.where(enough, column, np.nan) for column in columns], axis=-1)
    found[..., LINE.index("points")] = n
    return found


def _sum(present: NDArray[np.bool_], values: Array) -> Array:
    total: Array = np.where(present, values, 0.0).sum(axis=-1)
    return total


def _drift(u: Array, off: Array, present: NDArray[np.bool_], width: Array) -> Array:
    """Change of slope over `width` by the parabola that fits best; `u` is centred, `off` the distance to the line."""
    n = present.sum(axis=-1)[..., None]
    square = u * u
    spread = square.sum(axis=-1)[..., None]
    bow = np.where(present, square - spread / n - (square * u).sum(axis=-1)[..., None] / spread * u, 0.0)
    change: Array = 2.0 * (bow * off).sum(axis=-1) / (bow * bow).sum(axis=-1) * width
    return change


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
