"""Which law? Power laws with bends, offsets and corrections, exponentials and others, judged by AICc and BIC."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import gammaincc

from sweep.errors import SweepError
from sweep.laws.curves import Window, check_output, described, fit_lines, title
from sweep.laws.fits import Found, fitted
from sweep.laws.lines import rounding
from sweep.laws.loglog import Array
from sweep.laws.noise import BEYOND_DOUBT
from sweep.laws.shapes import LAWS


def compare_laws(y: xr.DataArray, dim: str, window: Window | None = None, *, sigma: Any = None) -> xr.Dataset:
    """What laws say of one line, which of them are ruled out, and the simplest that is not.

    A law with more numbers is believed only where AICc and BIC prefer it by more than 10 to every law with fewer: so
    many times e^5 more likely, and a margin that correlated, uneven or outlying noise does not bridge, which one law is
    tried with. Beside a function that is no power law, a power law with as few numbers is taken where it is not ruled
    out. The laws are one, two (with bends of four shapes) and three power laws, an offset, a correction to
    scaling; and functions that are none: logarithm, exponential, stretched exponential, cut-off, lognormal, two
    exponentials.

    Parameters
    ----------
    y, dim, window, sigma
        As of `fit_exponent`; y has one dimension. Without `sigma` errors are the same share of y for all points.

    Returns
    -------
    Dataset
        Along `law`, the best first: `aicc`, `bic`, `worse` (AICc or BIC above the least), `numbers`, `scatter`,
        `residual`, `chi_squared`, `formula`, `exponents`; `fitted` (law, point), the law at the points, whose
        places are `x` and values `y`. Attributes `chosen`, `margin` (AICc to the next law; negative where a law with
        more numbers is nearer), and `verdict`, a sentence.

    Raises
    ------
    SweepError
        y has further dimensions, or fewer than 8 points, or is not positive in the window.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> import xarray as xr
    >>> x = np.geomspace(1, 1e4, 41)
    >>> y = xr.DataArray(1 / x + 0.01, {"x": x}, "x", name="y")
    >>> sweep.compare_laws(y, "x").attrs["chosen"]
    'offset'
    """
    check_output(y)
    if y.ndim != 1:
        raise SweepError(
            f"{title(y)} runs along {', '.join(map(str, y.dims))}; compare laws of one line, choose with .sel"
        )
    found = xr.Dataset()

    def compared(t: Array, z: Array, sigma: Array | None, bounds: None) -> dict[str, Any]:
        nonlocal found
        found = _table(t, z[0], sorted(fitted(LAWS, t, z, sigma)[0].values(), key=lambda fit: fit.aicc))
        return {"regimes": np.zeros(1)}

    fit_lines(compared, "", y, dim, window, sigma)
    return described(found.assign_attrs(y=title(y), x=dim), y.coords[dim], y)


def _table(t: Array, z: Array, tried: list[Found]) -> xr.Dataset:
    """All that `compare_laws` says of laws, the best first."""
    off, aicc, bic = (np.array(one) for one in zip(*((f.off, f.aicc, f.bic) for f in tried), strict=True))
    worse, span = np.minimum(aicc - aicc.min(), bic - bic.min()), t[-1] - t[0]
    columns: dict[str, Any] = {"aicc": aicc, "bic": bic, "worse": worse, "scatter": np.sqrt((off**2).mean(axis=1))}
    columns |= {"numbers": [f.law.numbers for f in tried], "residual": [f.residual for f in tried]}
    chances = [float(gammaincc((t.size - f.law.numbers) / 2, f.deviance / 2)) for f in tried if f.sigma is not None]
    columns |= {"chi_squared": chances or [math.nan] * len(tried), "formula": [f.law.formula for f in tried]}
    columns["exponents"] = [
        ", ".join(f"{name} = {f.numbers[k] / span:.4g} +- {f.errors[k] / span:.1g}" for name, k in f.law.exponents)
        or "none"
        for f in tried
    ]
    alive = [f for f, by in zip(tried, worse, strict=True) if by <= BEYOND_DOUBT]
    chosen = min(alive, key=lambda f: (f.law.numbers, not f.law.power, f.aicc))
    margin = min((f.aicc for f in tried if f is not chosen), default=math.inf) - chosen.aicc
    text = f"{chosen.law.name} ({chosen.law.formula}): " + "no power law; " * (not any(f.law.power for f in alive))
    if rivals := [f.law.name for f in alive if f is not chosen]:
        text += f"not ruled out beside it: {', '.join(rivals)}"
    else:
        text += f"all others are ruled out, the next by {margin:.3g} in AICc"
    if chosen.residual > 8 * rounding(t, z) and chosen.denied(t, "even"):
        text += "; but what it leaves has a shape, so that none of them is the law"
    variables: dict[str, Any] = {name: ("law", column) for name, column in columns.items()}
    variables |= {"fitted": (("law", "point"), np.exp(z - off)), "x": ("point", np.exp(t)), "y": ("point", np.exp(z))}
    attrs = {"chosen": chosen.law.name, "margin": margin, "verdict": text}
    return xr.Dataset(variables, {"law": [f.law.name for f in tried]}, attrs)
