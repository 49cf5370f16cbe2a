"""Exponents over a second parameter, by a formula for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from sweep.analysis.correlated import student
from sweep.analysis.curves import check_confidence, check_dataset
from sweep.analysis.loglog import Array
from sweep.analysis.scatter import library
from sweep.system.errors import SweepError


def fit_over(
    fits: xr.Dataset, dim: str, formula: str, start: Mapping[str, float] | None = None, *, confidence: float = 0.95
) -> xr.Dataset:
    """Exponents against a second parameter, P ~ mu^p(n), by a formula for p.

    Parameters
    ----------
    fits : Dataset
        From `fit_exponent` of an output over two parameters: its exponents run along `dim`.
    dim : str
        The second parameter.
    formula : str
        Of `dim` and numbers to be found, e.g. "-1/(a + b*n)"; whatever lmfit's ExpressionModel takes.
    start : mapping, optional
        Where to start; default 1.

    Returns
    -------
    Dataset
        Along `number`, its names: `value`, `low`, `high`, by the bars of the exponents; along `dim`: `exponent`,
        `fitted`. Attributes `fits`, 1 where the formula goes through all bars, or as many as chance has, and
        `verdict`; where it does not, low and high are NaN.

    Raises
    ------
    SweepError
        There are no such exponents, the formula is none, or lmfit (extra `fit`) is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> import xarray as xr
    >>> mu, n = np.geomspace(1, 1e3, 30), np.linspace(0.5, 3, 9)
    >>> y = xr.DataArray(mu[:, None] ** (-1 / (n + 1)), {"mu": mu, "n": n}, ("mu", "n"), name="P")
    >>> found = sweep.fit_over(sweep.fit_exponent(y, "mu"), "n", "-1/(a + b*n)")
    >>> print(f"{float(found.value.sel(number='b')):.6f}")
    1.000000
    """
    check_confidence(confidence)
    check_dataset("fit_over", fits, "fit_exponent", ["exponent", "exponent_low", "exponent_high"])
    at, value, bar = _bars(fits, dim)
    model = _model(library("lmfit"), formula, dim)
    if value.size <= len(model.param_names):
        raise SweepError(f"{formula}: {len(model.param_names)} numbers need more than {value.size} exponents")
    parameters = model.make_params(**dict.fromkeys(model.param_names, 1.0) | dict(start or {}))
    reach = student(10**6, 0.95)
    found = model.fit(value, parameters, weights=reach / bar, scale_covar=False, **{dim: at})
    off = abs(value - found.best_fit) / bar
    fits_all = bool((off > 1).sum() <= max(1, 0.15 * off.size) and off.max() < 2)
    result = _intervals(found, student(10**6, confidence) if fits_all else math.nan).assign_coords({dim: (dim, at)})
    result["exponent"], result["fitted"] = (dim, value), (dim, np.asarray(found.best_fit))
    text = "goes through the bars" if fits_all else f"misses the bars, by {off.max():.3g} of them: no intervals"
    result.attrs = {"formula": formula, "fits": int(fits_all), "verdict": f"p = {formula} {text}"}
    return result


def _bars(fits: xr.Dataset, dim: str) -> tuple[Array, Array, Array]:
    """Abscissas, exponents and half the widths of their intervals, where both are known."""
    p = fits["exponent"]
    if p.dims != (dim,):
        raise SweepError(f"exponents run along {', '.join(map(str, p.dims)) or 'nothing'}, expected {dim} alone")
    width = fits.exponent_high - fits.exponent_low
    fine = (p.notnull() & np.isfinite(width)).values
    value = p.values[fine]
    return p[dim].values[fine].astype(np.float64), value, np.maximum(width.values[fine] / 2, 1e-14 * (1 + abs(value)))


def _intervals(found: Any, reach: float) -> xr.Dataset:
    """Numbers of a fit of lmfit, and `reach` standard errors to either side."""
    names = list(found.model.param_names)
    best = np.array([found.params[name].value for name in names])
    error = np.array([found.params[name].stderr or math.inf for name in names]) * reach
    numbers = {"value": best, "low": best - error, "high": best + error}
    return xr.Dataset({key: ("number", column) for key, column in numbers.items()}, coords={"number": names})


def _model(lmfit: Any, formula: str, dim: str) -> Any:
    try:
        return lmfit.models.ExpressionModel(formula, independent_vars=[dim])
    except (ValueError, SyntaxError, NameError) as error:
        raise SweepError(f'formula: expected one of {dim}, e.g. "a + b*{dim}"; found {formula!r} ({error})') from None
