"""The two exponents of a collapse, by which curves of a second parameter are one.

    y = L^b f(x / L^a)                                                                              (1)

In logarithms the curves of all L are one, ln y = b ln L + g(ln x - a ln L). With g a polynomial, b and g are linear
for given a: a is searched over all of its range, so there is no start to be stuck at.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from sweep.errors import SweepError
from sweep.laws.curves import check_options, check_output, described, log_of, positive_axis, relative_sigma, title
from sweep.laws.loglog import Array
from sweep.laws.noise import ROUNDING, regress

FEWEST_POINTS, MOST_DEGREE = 10, 18


def fit_collapse(y: xr.DataArray, dim: str, over: str, *, sigma: Any = None, confidence: float = 0.95) -> xr.Dataset:
    """Exponents a, b for which all curves y(x; L) fall on one, equation (1), and whether they do.

    Parameters
    ----------
    y : DataArray
        Along `dim` and `over`.
    dim, over : str
        Dimensions of x and L; positive.
    sigma : number or DataArray, optional
        Standard errors of the values, in the unit of y.
    confidence : float
        Of the intervals.

    Returns
    -------
    Dataset
        `x_exponent` (a), `y_exponent` (b), each with `_low`, `_high`; `verdict`, words; `scatter`; `points`,
        `dropped`; `fits`. The intervals are of noise about the common curve that may be autocorrelated along each
        curve, or of `sigma`; without noise of how well a polynomial follows the curve. There are none where the curves
        do not fall on one another: where levels, slopes and bows of their own describe them far better.

    Raises
    ------
    SweepError
        An axis is unknown or unfit, there are fewer than two curves or ten points, or y does not change, f is a power
        law or L does not matter, so that a and b are not both determined.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> import xarray as xr
    >>> x, size = np.geomspace(0.01, 100, 25), np.array([1.0, 2.0, 4.0, 8.0])
    >>> u = x / size[:, None] ** 1.5
    >>> y = xr.DataArray(size[:, None] ** 0.7 / (u + u**0.2), {"L": size, "x": x}, ("L", "x"), name="y")
    >>> print(f"{float(sweep.fit_collapse(y, 'x', 'L').x_exponent):.3f}")
    1.500
    """
    check_options(confidence)
    points, count = _points(y, dim, over, sigma)
    # exponents that leave neighbours in L with something in common, and no more than 8
    most = min(8.0, 0.9 * float(np.ptp(points.t)) / float(np.diff(np.unique(points.size)).min()))
    a = points.best(-most, most, 81)
    inside = points.shared(a)
    if (among := int(inside.sum())) < FEWEST_POINTS:
        raise SweepError(
            f"of {count} points {among} lie among those of another curve; at least {FEWEST_POINTS} are needed"
        )
    points = Points(*(column[inside] for column in points))
    a = points.best(a - 0.3 * (1 + abs(a)), a + 0.3 * (1 + abs(a)), 41)
    columns, b, off = points.curve(a)
    k, rounding = columns.shape[1], ROUNDING * (1 + abs(points.z).max())
    least = points.square(a) + float((points.root**2).sum()) * (rounding**2 + 1e-20 * float(np.ptp(points.z)) ** 2)
    if min(points.square(a + step) for step in (-0.25, 0.25)) < least * (1 + 12.0 / max(1, points.z.size - k)):
        raise SweepError(
            "the curves collapse for any exponents of x: f is a power law, so a and b are not determined apart"
        )
    found = {"x_exponent": a, "y_exponent": b, "scatter": float(np.sqrt(np.mean(off**2))), "points": points.t.size}
    # whether a level, a slope and a bow of each curve describe the points far better than the common one
    u = points.t - points.t.mean()
    own = [here * u**power for here in points.size == np.unique(points.size)[1:, None] for power in range(3)]
    basis, beside = np.linalg.qr(columns)[0], np.column_stack(own)
    left, moved, _ = np.linalg.svd(beside - basis @ (basis.T @ beside), full_matrices=False)
    beside = left[:, moved > 1e-6 * moved.max()][:, : max(0, off.size - k - 3)]
    every, places = np.column_stack([columns, beside]), np.arange(float(off.size))
    told = regress(places, every, off[None], "correlated", k, None if sigma is None else 1 / points.root)
    fits = bool(not told.denied[0] or (sigma is None and abs(off).max() <= 1e-6 * (1 + np.ptp(points.z))))
    for name, ends in zip(("x_exponent", "y_exponent"), told.interval([0, 1], confidence)[:, :, 0].T, strict=True):
        low, high = ends if fits else (math.nan, math.nan)
        found |= {f"{name}_low": found[name] + min(low, 0.0), f"{name}_high": found[name] + max(high, 0.0)}
    found |= {"dropped": count - points.t.size, "fits": int(fits)}
    result = xr.Dataset(found).assign(verdict="one curve" if fits else "not one curve")
    law = f"{title(y)} = {over}^b f({dim} / {over}^a)"
    return described(result.assign_attrs(law=law, y=title(y), x=dim, over=over, confidence=confidence), y[dim], y)


class Points(NamedTuple):
    """Logarithms of all points, one curve behind the other."""

    t: Array
    z: Array
    size: Array
    """ln L."""
    root: Array
    """One over the standard error of z; 1 where it is not known."""

    def curve(self, a: float) -> tuple[Array, float, Array]:
        """Derivatives of z by a, b and the numbers of g, a polynomial; b; and the distances of the points, for an a."""
        u = self.t - a * self.size
        half = max(float(np.ptp(u)) / 2, 1e-300)
        basis = chebyshev.chebvander((u - u.min()) / half - 1, min(MOST_DEGREE, max(3, u.size // 7)))
        columns = np.column_stack([self.size - self.size.mean(), basis])
        numbers = np.linalg.lstsq(columns * self.root[:, None], self.z * self.root, rcond=1e-10)[0]
        steep = chebyshev.chebval((u - u.min()) / half - 1, chebyshev.chebder(numbers[1:])) / half
        off: Array = self.z - columns @ numbers
        return np.column_stack([-self.size * steep, columns]), float(numbers[0]), off

    def square(self, a: float) -> float:
        """Sum of squares about the common curve."""
        return float(((self.root * self.curve(a)[2]) ** 2).sum())

    def shared(self, a: float) -> NDArray[np.bool_]:
        """Which points lie, in x / L^a, between the first and the last of another curve."""
        u, found = self.t - a * self.size, np.zeros(self.t.size, dtype=bool)
        for size in np.unique(self.size):
            here = self.size == size
            found |= ~here & (u >= u[here].min()) & (u <= u[here].max())
        return found

    def best(self, low: float, high: float, tries: int) -> float:
        """The a of the least square between two, from the best of some tries."""
        from scipy.optimize import minimize_scalar

        grid = np.linspace(low, high, tries)
        # weight against exponents that pull curves apart until nothing is compared
        squares = [self.square(a) / max(float(self.shared(a).mean()), 1e-3) ** 4 for a in grid]
        k = int(np.argmin(squares))
        around = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, tries - 1)])
        return float(minimize_scalar(self.square, bounds=around, method="bounded", options={"xatol": 1e-9}).x)


def _points(y: xr.DataArray, dim: str, over: str, sigma: Any) -> tuple[Points, int]:
    """Points that are there, and how many could be."""
    check_output(y)
    if y.ndim != 2 or {dim, over} != {str(d) for d in y.dims}:
        raise SweepError(f"a collapse takes one output along {dim} and {over}, and nothing else; choose with .sel")
    t, sizes = np.log(positive_axis(y, dim)[1]), y[over].values.astype(np.float64)
    if sizes.size < 2 or not (np.isfinite(sizes) & (sizes > 0)).all():
        raise SweepError(f"{over}: a collapse needs at least two values, all positive")
    order = np.argsort(t)
    z, errors = (part.transpose(over, dim).values[:, order] for part in (log_of(y), relative_sigma(y, sigma)))
    fine = np.isfinite(z) & (np.isfinite(errors) | (sigma is None))
    curve, place = np.nonzero(fine)
    if place.size < FEWEST_POINTS:
        few = f"a collapse needs at least {FEWEST_POINTS} positive points of {title(y)}, found {place.size}"
        raise SweepError(few)
    root = np.ones(place.size) if sigma is None else 1 / errors[fine]
    return Points(t[order][place], z[fine], np.log(sizes)[curve], root), z.size
