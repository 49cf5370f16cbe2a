"""The two exponents of a scaling collapse, which maps the curves of a second parameter onto one.

    y = L^b f(x / L^a)                                                                              (1)

In logarithms, ln y = b ln L + g(ln x - a ln L) for all L. With g a polynomial, b and g enter linearly for given a, so
that (1) is a law with one nonlinear parameter (`shapes`). It is searched over its complete range, and needs no initial
guess.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from numpy.polynomial import chebyshev

from sweep.errors import SweepError
from sweep.laws.curves import check_options, check_output, described, log_of, positive_axis, relative_sigma, title
from sweep.laws.fits import Fit, fitted
from sweep.laws.loglog import Array
from sweep.laws.shapes import Law, Number, Parts

FEWEST_POINTS, MOST_DEGREE = 10, 18
DETERMINED = 30.0
"""Difference in -2 ln likelihood from exponents that are off by 0.25, from which on the points determine them: the best
of many curves about a power law comes to 18 by even noise, and to 32 by that of a moving mean of three points (to 61
if there are but two curves)."""


def fit_collapse(y: xr.DataArray, dim: str, over: str, *, sigma: Any = None, confidence: float = 0.95) -> xr.Dataset:
    """Exponents a, b that collapse all curves y(x; L) onto one, equation (1), and whether they do collapse.

    Parameters
    ----------
    y : DataArray
        Along `dim` and `over`.
    dim, over : str
        Dimensions of x and of L, whose values are positive.
    sigma : number or DataArray, optional
        Standard errors of the values, in the unit of y.
    confidence : float
        Of the intervals.

    Returns
    -------
    Dataset
        `x_exponent` (a), `y_exponent` (b), each with `_low`, `_high`; `verdict`, in words; `scatter`; `points`,
        `dropped`; `fits`. The intervals allow for noise about the common curve, autocorrelated along each curve, or for
        `sigma`; without noise, for the error of the polynomial. There are none where the curves do not collapse, that
        is where a level, slope and curvature for each of them fit far better.

    Raises
    ------
    SweepError
        An axis is unknown or unsuitable; there are fewer than two curves or ten points; or a and b are not both
        determined, as where y is constant, f is a power law, or L has no influence.

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
    t, size, _, _ = points = _points(y, dim, over, sigma)
    # exponents that leave neighbours in L with something in common, and no more than 8
    most = min(8.0, 0.9 * float(np.ptp(t)) / float(np.diff(np.unique(size)).min()))
    start = _common(points, *np.linspace(-most, most, 81)).numbers[0]
    # the points that lie, in x / L^a, between the first and the last of another curve
    u, inside = t - start * size, np.zeros(t.size, dtype=bool)
    for own in (size == one for one in np.unique(size)):
        inside |= ~own & (u >= u[own].min()) & (u <= u[own].max())
    if (among := int(inside.sum())) < FEWEST_POINTS:
        raise SweepError(
            f"of {y.size} points {among} lie among those of another curve; at least {FEWEST_POINTS} are needed"
        )
    t, size, z, _ = points = points[:, inside]
    far = 0.3 * (1 + abs(start))
    fit = _common(points, *np.linspace(start - far, start + far, 41))
    off, exact = fit.off, 1e-6 * (1 + np.ptp(z)) if sigma is None else 0.0
    # whether a level, a slope and a bow of each curve describe the points far better than the common one
    u, sizes = t - t.mean(), np.unique(size)[1:, None]
    own = np.concatenate([(size == sizes) * u**power for power in range(3)]).T
    basis = np.linalg.qr(fit.jacobian)[0]
    left, moves, _ = np.linalg.svd(own - basis @ (basis.T @ own), full_matrices=False)
    own = left[:, moves > 1e-6 * moves.max()][:, : max(0, off.size - basis.shape[1] - 3)]
    ends, _, denied = fit.beside(np.arange(float(off.size)), "correlated", confidence, own)
    fits = not denied or abs(off).max() <= exact
    moved = [_common(points, fit.numbers[0] + by) for by in (-0.25, 0.25)]
    if fits and any(one.deviance < fit.deviance + DETERMINED or abs(one.off).max() < 1e-4 * exact for one in moved):
        raise SweepError(
            "the curves collapse for any exponents of x: f appears to be a power law, so a and b are not determined "
            "separately"
        )
    result: dict[str, Any] = {"scatter": np.sqrt(np.mean(off**2)), "points": off.size, "dropped": y.size - off.size}
    result |= {"fits": int(fits), "verdict": "one curve" if fits else "not one curve"}
    for number, name in enumerate(("x_exponent", "y_exponent")):
        low, high = ends[:, number] if fits else (math.nan, math.nan)
        result |= {name: fit.numbers[number], f"{name}_low": low, f"{name}_high": high}
    attrs = {"law": f"{title(y)} = {over}^b f({dim} / {over}^a)", "y": title(y), "x": dim, "over": over}
    return described(xr.Dataset(result, attrs=attrs | {"confidence": confidence}), y[dim], y)


def _points(y: xr.DataArray, dim: str, over: str, sigma: Any) -> Array:
    """Of the points that are there, one curve behind the other, ln x, ln L, ln y and its standard error, NaN where that
    is not known (4, n)."""
    check_output(y)
    if sorted(map(str, (dim, over))) != sorted(map(str, y.dims)):
        raise SweepError(f"a collapse needs an output along {dim} and {over} only; select with .sel")
    t, sizes = np.log(positive_axis(y, dim)[1]), y[over].values
    if sizes.dtype.kind not in "fiu" or np.unique(sizes).size < 2 or not (np.isfinite(sizes) & (sizes > 0)).all():
        raise SweepError(f"{over}: a collapse needs at least two values, all positive numbers")
    order = np.argsort(t)
    z, errors = (part.transpose(over, dim).values[:, order] for part in (log_of(y), relative_sigma(y, sigma)))
    curve, place = np.nonzero(np.isfinite(z) & (np.isfinite(errors) | (sigma is None)))
    if place.size < FEWEST_POINTS:
        raise SweepError(f"a collapse needs at least {FEWEST_POINTS} positive points of {title(y)}, found {place.size}")
    return np.stack([t[order][place], np.log(sizes.astype(np.float64))[curve], z[curve, place], errors[curve, place]])


def _common(points: Array, *a: float) -> Fit:
    """The common curve, a polynomial in ln(x / L^a), for the best a between the first and last of tries."""
    t, size, z, errors = points
    degree, about = min(MOST_DEGREE, max(3, z.size // 7)), size - size.mean()

    def curve(q: Array, s: Array, span: float) -> Parts:
        place = np.rint(s * span).astype(int)  # which of the points
        u = t[place] - q[0] * size[place]
        u -= u.min(axis=1, keepdims=True)
        u /= np.maximum(u.max(axis=1, keepdims=True) / 2, 1e-300)
        return 0.0, about[place], *np.moveaxis(chebyshev.chebvander(u - 1, degree), -1, 0)

    law = Law("collapse", "", curve, 2 + degree, (Number(a[0], a[-1], a),))
    known = errors[None] if np.isfinite(errors).all() else None
    return fitted((law,), np.arange(float(z.size)), z[None], known)[0][law.name]
