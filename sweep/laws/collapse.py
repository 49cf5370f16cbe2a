"""The two exponents of a collapse, by which curves of a second parameter are one.

    y = L^b f(x / L^a)                                                                              (1)

In logarithms the curves of all L are one, ln y = b ln L + g(ln x - a ln L). With g a spline, b and g are linear for
given a: a is searched over all of its range, so there is no start to be stuck at.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.special import stdtrit

from sweep.errors import SweepError
from sweep.laws.curves import check_confidence, check_output, log_of, positive_axis, title
from sweep.laws.loglog import Array


class Points(NamedTuple):
    """Logarithms of all points."""

    t: Array
    z: Array
    size: Array
    """ln L."""
    curve: Array
    """Number of the L that a point is of."""


COLLAPSED = {
    "x_exponent": "a of x / L^a",
    "y_exponent": "b of y / L^b",
    "residual": "relative distance of the points from the common curve, root mean square",
    "points": "points that lie among those of another curve",
    "dropped": "points that are missing or not positive, or lie where no other curve has any",
    "fits": "1 where the curves fall on one another within their own scatter",
}

FEWEST_POINTS = 10
TRIES = 41
"""Exponents that are tried near the best."""


def fit_collapse(
    y: xr.DataArray, dim: str, over: str, *, bootstrap: int = 200, seed: int = 0, confidence: float = 0.95
) -> xr.Dataset:
    """Exponents a, b for which all curves y(x; L) fall on one, equation (1), with bootstrap errors.

    Parameters
    ----------
    y : DataArray
        Along `dim` and `over`.
    dim, over : str
        Dimensions of x and L; positive.
    bootstrap : int
        Times that residuals are drawn anew, for the intervals.
    seed : int
        Of these draws.
    confidence : float
        Of the intervals.

    Returns
    -------
    Dataset
        `x_exponent` (a), `y_exponent` (b), each with `_low`, `_high`; `residual`; `points`, `dropped`; `fits`. The
        intervals are of independent scatter about the common curve; without scatter of how well a spline follows
        that.

    Raises
    ------
    SweepError
        An axis is unknown or unfit, there are fewer than two curves or ten points, or f is a power law or L does not
        matter, so that a and b are not both determined.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> import xarray as xr
    >>> x, size = np.geomspace(0.01, 100, 25), np.array([1.0, 2.0, 4.0, 8.0])
    >>> u = x / size[:, None] ** 1.5
    >>> y = xr.DataArray(size[:, None] ** 0.7 / (u + u**0.2), {"L": size, "x": x}, ("L", "x"), name="y")
    >>> print(f"{float(sweep.fit_collapse(y, 'x', 'L', bootstrap=20).x_exponent):.3f}")
    1.500
    """
    check_confidence(confidence)
    points, count = _points(y, dim, over)
    # exponents that leave neighbours in L with something in common, and no more than 8
    most = min(8.0, 0.9 * float(np.ptp(points.t)) / float(np.diff(np.unique(points.size)).min()))
    a = _best(points, (-most, most))
    inside = _shared(points, a)
    if (among := int(inside.sum())) < FEWEST_POINTS:
        raise SweepError(
            f"of {count} points {among} lie among those of another curve; at least {FEWEST_POINTS} are needed"
        )
    points = Points(*(column[inside] for column in points))
    near = (a - 0.3 * (1 + abs(a)), a + 0.3 * (1 + abs(a)))
    a = _best(points, near, TRIES)
    b, fitted, numbers = _spline(points, a)
    off = points.z - fitted
    _require_determined(points, a, off, numbers)
    draws = _bootstrap(points, fitted, off * math.sqrt(off.size / (off.size - numbers)), near, bootstrap, seed)
    reach = float(stdtrit(off.size - numbers, (1 + confidence) / 2)) * draws.std(axis=0, ddof=1)
    result = xr.Dataset({"x_exponent": a, "y_exponent": b})
    for name, middle, wide in zip(("x_exponent", "y_exponent"), (a, b), reach, strict=True):
        result[f"{name}_low"], result[f"{name}_high"] = middle - wide, middle + wide
    result["residual"], result["points"] = float(np.sqrt(np.mean(off**2))), points.t.size
    result["dropped"], result["fits"] = count - points.t.size, int(_one_curve(points, a, off))
    law = f"{title(y)} = {over}^b f({dim} / {over}^a)"
    for key in map(str, result.data_vars):
        text = COLLAPSED.get(key) or f"{'lower' if key.endswith('low') else 'upper'} end of its interval"
        result[key].attrs = {"units": "1", "long_name": text}
    return result.assign_attrs(y=title(y), x=dim, over=over, law=law)


def _points(y: xr.DataArray, dim: str, over: str) -> tuple[Points, int]:
    check_output(y)
    if y.ndim != 2 or {dim, over} != {str(d) for d in y.dims}:
        raise SweepError(f"a collapse takes one output along {dim} and {over}, and nothing else; choose with .sel")
    t, sizes = np.log(positive_axis(y, dim)[1]), y[over].values.astype(np.float64)
    if sizes.size < 2 or not (np.isfinite(sizes) & (sizes > 0)).all():
        raise SweepError(f"{over}: a collapse needs at least two values, all positive")
    z = log_of(y).transpose(over, dim).values
    fine = np.isfinite(z)
    which = np.nonzero(fine)
    found = Points(t[which[1]], z[fine], np.log(sizes)[which[0]], which[0].astype(np.float64))
    if found.t.size < FEWEST_POINTS:
        few = f"a collapse needs at least {FEWEST_POINTS} positive points of {title(y)}, found {found.t.size}"
        raise SweepError(few)
    return found, z.size


def _columns(points: Points, a: float) -> Array:
    """ln L, then a cubic spline of ln x - a ln L."""
    from scipy.interpolate import BSpline

    u = points.t - a * points.size
    pieces = int(min(20, max(1, u.size // 8)))
    inner = np.interp(np.linspace(0, u.size - 1, pieces + 1), np.arange(u.size), np.sort(u))  # quantiles
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    knots[-4:] += 1e-9 * (1 + abs(knots[-1]))
    basis = BSpline.design_matrix(u, knots, 3).toarray()
    return np.column_stack([points.size - points.size.mean(), basis])


def _spline(points: Points, a: float) -> tuple[float, Array, int]:
    """b, the common curve at the points, and how many numbers it took."""
    columns = _columns(points, a)
    numbers, _, rank, _ = np.linalg.lstsq(columns, points.z, rcond=1e-10)
    return float(numbers[0]), columns @ numbers, int(rank) + 1


def _square(points: Points, a: float) -> float:
    return float(((points.z - _spline(points, a)[1]) ** 2).sum())


def _best(points: Points, ends: tuple[float, float], tries: int = 81) -> float:
    from scipy.optimize import minimize_scalar

    grid = np.linspace(*ends, tries)
    squares = [_square(points, a) * _overlap(points, a) for a in grid]
    k = int(np.argmin(squares))
    around = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, tries - 1)])
    return float(
        minimize_scalar(lambda a: _square(points, a), bounds=around, method="bounded", options={"xatol": 1e-9}).x
    )


def _overlap(points: Points, a: float) -> float:
    """Weight against exponents that pull curves apart until nothing is compared."""
    share = float(_shared(points, a).mean())
    return 1.0 / max(share, 1e-3) ** 4


def _shared(points: Points, a: float) -> Any:
    """Which points lie, in x / L^a, between the first and the last of another curve."""
    u = points.t - a * points.size
    found = np.zeros(u.size, dtype=bool)
    for number in np.unique(points.curve):
        here = points.curve == number
        found |= ~here & (u >= u[here].min()) & (u <= u[here].max())
    return found


def _require_determined(points: Points, a: float, off: Array, numbers: int) -> None:
    """Raises SweepError where another a, far off, does as well: of a power law f any does."""
    least = float(off @ off) + 1e-20 * float(np.ptp(points.z)) ** 2
    worst = min(_square(points, a + step) for step in (-0.25, 0.25))
    if worst < least * (1 + 12.0 / max(1, off.size - numbers)):
        raise SweepError(
            "the curves collapse for any exponents of x: f is a power law, so a and b are not determined apart"
        )


def _bootstrap(points: Points, fitted: Array, off: Array, near: tuple[float, float], times: int, seed: int) -> Array:
    """a and b of so many sets with residuals drawn anew.

    All sets share the splines of a grid of a, which closes in on what they say.
    """
    z = fitted + np.random.default_rng(seed).choice(off, (times, off.size))
    low, high = near
    overlap = np.array([_overlap(points, a) for a in np.linspace(low, high, TRIES)])
    for _ in range(12):
        grid = np.linspace(low, high, TRIES)
        step, found = grid[1] - grid[0], _least_on(points, grid, z, overlap)
        if step < max(found[:, 0].std() / 4, 1e-9 * (1 + abs(low))):
            break
        low, high, overlap = found[:, 0].min() - 2 * step, found[:, 0].max() + 2 * step, np.ones(TRIES)
    return found


def _least_on(points: Points, grid: Array, z: Array, overlap: Array) -> Array:
    """a and b of the least sum of squares of each set (sets, n), by the parabola through three points of a grid."""
    squares, slopes = np.empty((2, len(z), grid.size))
    for k, a in enumerate(grid):
        columns = _columns(points, a)
        numbers = z @ np.linalg.pinv(columns, rcond=1e-10).T
        squares[:, k] = ((z - numbers @ columns.T) ** 2).sum(axis=1) * overlap[k]
        slopes[:, k] = numbers[:, 0]
    k, row = np.clip(squares.argmin(axis=1), 1, grid.size - 2), np.arange(len(z))
    before, here, after = (squares[row, k + side] for side in (-1, 0, 1))
    bow = before - 2 * here + after
    share = np.clip(np.where(bow > 0, (before - after) / (2 * np.where(bow > 0, bow, 1.0)), 0.0), -1.0, 1.0)
    rise = (slopes[row, k + 1] - slopes[row, k - 1]) / 2
    return np.column_stack([grid[k] + share * (grid[1] - grid[0]), slopes[row, k] + share * rise])


def _one_curve(points: Points, a: float, off: Array) -> bool:
    """Whether residuals have no more to do with the curve they are of than chance has: analysis of variance of a
    cubic along each curve."""
    from scipy.special import fdtrc

    u = points.t - a * points.size
    columns = []
    for number in np.unique(points.curve)[1:]:
        here = (points.curve == number).astype(np.float64)
        away = (u - u[here > 0].mean()) / np.ptp(u)
        columns += [here * away**k for k in range(4)]
    matrix = np.column_stack(columns)
    explained = matrix @ np.linalg.lstsq(matrix, off, rcond=None)[0]
    rest = float(((off - explained) ** 2).sum())
    left = off.size - matrix.shape[1]
    if left < 1 or float(off @ off) < 1e-24 * off.size or rest == 0:
        return True
    ratio = float(explained @ explained) / matrix.shape[1] / (rest / left)
    return bool(fdtrc(matrix.shape[1], left, ratio) > 1e-3)
