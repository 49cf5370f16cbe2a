"""The two exponents of a collapse, by which curves of a second parameter are one.

    y = L^b f(x / L^a)                                                                              (1)

In logarithms the curves of all L are one, ln y = b ln L + g(ln x - a ln L). With g a polynomial, b and g are linear
for given a, and (1) is a law with one number that is not (`shapes`), searched over all of its range, so there is no
start to be stuck at.
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
from sweep.laws.fits import Found, fitted
from sweep.laws.loglog import Array
from sweep.laws.noise import regress
from sweep.laws.shapes import Law, Number, Parts

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
    start = points.fit(*np.linspace(-most, most, 81)).numbers[0]
    inside, far = points.shared(start), 0.3 * (1 + abs(start))
    if (among := int(inside.sum())) < FEWEST_POINTS:
        raise SweepError(
            f"of {count} points {among} lie among those of another curve; at least {FEWEST_POINTS} are needed"
        )
    points = Points(*(column[inside] for column in points))
    found = points.fit(*np.linspace(start - far, start + far, 41))
    off, columns, exact = found.off, found.jacobian, 1e-6 * (1 + np.ptp(points.z)) if sigma is None else 0.0
    moved = [points.fit(found.numbers[0] + by) for by in (-0.25, 0.25)]
    if any(one.deviance < found.deviance + 12 or abs(one.off).max() < 1e-4 * exact for one in moved):
        raise SweepError(
            "the curves collapse for any exponents of x: f is a power law, so a and b are not determined apart"
        )
    # whether a level, a slope and a bow of each curve describe the points far better than the common one
    u, k = points.t - points.t.mean(), columns.shape[1]
    own = [here * u**power for here in points.size == np.unique(points.size)[1:, None] for power in range(3)]
    basis, beside = np.linalg.qr(columns)[0], np.column_stack(own)
    left, moves, _ = np.linalg.svd(beside - basis @ (basis.T @ beside), full_matrices=False)
    beside = left[:, moves > 1e-6 * moves.max()][:, : max(0, off.size - k - 3)]
    every, places = np.column_stack([columns, beside]), np.arange(float(off.size))
    denied = regress(places, every, off[None], "correlated", k, found.sigma).denied[0]
    fits, ends = not denied or abs(off).max() <= exact, found.beside(places, "correlated", confidence)[0]
    result = xr.Dataset({"scatter": np.sqrt(np.mean(off**2)), "points": off.size, "dropped": count - off.size})
    for number, name in enumerate(("x_exponent", "y_exponent")):
        low, high = ends[:, number] if fits else (math.nan, math.nan)
        result = result.assign({name: found.numbers[number], f"{name}_low": low, f"{name}_high": high})
    result = result.assign(fits=int(fits), verdict="one curve" if fits else "not one curve")
    law = f"{title(y)} = {over}^b f({dim} / {over}^a)"
    return described(result.assign_attrs(law=law, y=title(y), x=dim, over=over, confidence=confidence), y[dim], y)


class Points(NamedTuple):
    """Logarithms of all points, one curve behind the other."""

    t: Array
    z: Array
    size: Array
    """ln L."""
    errors: Array
    """Standard errors of z; NaN where they are not known."""

    def fit(self, *a: float) -> Found:
        """The common curve, a polynomial in ln(x / L^a), for the best a between the first and last of tries."""
        degree, size = min(MOST_DEGREE, max(3, self.z.size // 7)), self.size - self.size.mean()

        def curve(q: Array, s: Array, span: float) -> Parts:
            u = self.t - q[0] * self.size
            v = u - u.min(axis=1, keepdims=True)
            v /= np.maximum(v.max(axis=1, keepdims=True) / 2, 1e-300)
            return 0.0, size, *np.moveaxis(chebyshev.chebvander(v - 1, degree), -1, 0)

        law = Law("collapse", "", curve, 2 + degree, (Number(a[0], a[-1], a),))
        errors = self.errors[None] if np.isfinite(self.errors).all() else None
        return fitted((law,), np.arange(float(self.z.size)), self.z[None], errors, law)[0][law.name]

    def shared(self, a: float) -> NDArray[np.bool_]:
        """Which points lie, in x / L^a, between the first and the last of another curve."""
        u, found = self.t - a * self.size, np.zeros(self.t.size, dtype=bool)
        for size in np.unique(self.size):
            here = self.size == size
            found |= ~here & (u >= u[here].min()) & (u <= u[here].max())
        return found


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
    return Points(t[order][place], z[fine], np.log(sizes)[curve], errors[fine]), z.size
