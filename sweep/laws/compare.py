"""Which law? Power laws with bends, offsets and corrections, exponentials and others, judged by AICc and BIC."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from sweep.laws.curves import FEWEST_OF_LINE, Window, fit_lines, one_line, title
from sweep.laws.fits import Found, fitted
from sweep.laws.loglog import Array
from sweep.laws.noise import BEYOND_DOUBT, RARE, runs_chance
from sweep.laws.shapes import CORRECTION, LAWS, OFFSET
from sweep.words import Table

NAMES = {
    "aicc": "Akaike's criterion, corrected for few points; of one law with the noise that suits it best",
    "bic": "Bayes' criterion, likewise",
    "worse": "AICc above that of the best law; beyond 10 a law is ruled out",
    "numbers": "numbers that are fitted",
    "scatter": "relative distance of the points from the law, root mean square",
    "residual": "largest relative distance of a point from the law",
    "runs": "chance that independent scatter has so few runs of signs; NaN of fewer than 12 points",
    "chi_squared": "chance that noise of the given sigma has so large a chi-squared; NaN without sigma",
}


def compare_laws(y: xr.DataArray, dim: str, window: Window | None = None, *, sigma: Any = None) -> xr.Dataset:
    """What laws say of one line, which of them are ruled out, and the simplest that is not.

    A law with more numbers is believed only where AICc prefers it by more than 10 to every law with fewer: so many
    times e^5 more likely, and a margin that correlated, uneven or outlying noise does not bridge, which one law is
    tried with. The laws are one, two (with bends of five shapes) and three power laws, an offset, a correction to
    scaling; and functions that are none: logarithm, exponential, stretched exponential, cut-off, lognormal.

    Parameters
    ----------
    y, dim, window, sigma
        As of `fit_exponent`; y has one dimension. Without `sigma` errors are the same share of y for all points.

    Returns
    -------
    Dataset
        Along `law`, the best first: `aicc`, `bic`, `worse` (AICc above the best), `numbers`, `scatter`, `residual`,
        `runs`, `chi_squared`, `formula`, `exponents`; `fitted` (law, point), the law at the points, whose places are
        `x` and values `y`. Attributes `chosen`, `margin` (AICc to the next law; negative where a law with more
        numbers is nearer), `verdict`, a sentence, and `summary`, a table for printing.

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
    one_line(y, "compare laws of")
    found: list[xr.Dataset] = []

    def compared(t: Array, z: Array, errors: Array | None, bounds: Array | None) -> Array:
        fits = sorted(fitted(LAWS, t, z, errors)[0].values(), key=lambda fit: fit.aicc)
        found.append(_table(t, z[0], fits))
        return np.zeros((1, 1))

    fit_lines(("kind",), ("kind", ("compared",)), compared, y, dim, window, sigma, fewest=FEWEST_OF_LINE)
    for name, of in (("x", y[dim]), ("y", y), ("fitted", y)):
        found[0][name].attrs = {"units": str(of.attrs.get("units", "1"))}
    return found[0].assign_attrs({"y": title(y), "x": dim} | found[0].attrs)


def _table(t: Array, z: Array, tried: list[Found]) -> xr.Dataset:
    """All that `compare_laws` says of laws, the best first."""
    columns: dict[str, list[Any]] = {
        "aicc": [f.aicc for f in tried],
        "bic": [f.bic for f in tried],
        "worse": [f.aicc - tried[0].aicc for f in tried],
        "numbers": [f.law.numbers for f in tried],
        "scatter": [math.sqrt(float(np.mean(f.off**2))) for f in tried],
        "residual": [math.expm1(min(float(abs(f.off).max()), 700.0)) for f in tried],
        "runs": [float(runs_chance(f.off)) for f in tried],
        "chi_squared": [f.chi_squared() for f in tried],
        "formula": [f.law.formula for f in tried],
        "exponents": [_exponents(f, float(t[-1] - t[0])) for f in tried],
    }
    about = {name: {"units": "1", "long_name": words} for name, words in NAMES.items()}
    variables: dict[str, Any] = {name: ("law", column, about.get(name)) for name, column in columns.items()}
    variables |= {"fitted": (("law", "point"), np.exp([z - f.off for f in tried]))}
    variables |= {"x": ("point", np.exp(t)), "y": ("point", np.exp(z)), "law": [f.law.name for f in tried]}
    alive = [f for f in tried if f.aicc <= tried[0].aicc + BEYOND_DOUBT]
    chosen = min(alive, key=lambda f: (f.law.numbers, f.aicc))
    margin = min((f.aicc for f in tried if f is not chosen), default=math.inf) - chosen.aicc
    rivals = [f.law.name for f in alive if f is not chosen]
    text = f"{chosen.law.name} ({chosen.law.formula}): "
    if not chosen.law.power:
        text += "no power law; "
    alone = f"all others are worse by {margin:.3g} and more in AICc"
    text += f"not ruled out beside it: {', '.join(rivals)}" if rivals else alone
    if float(runs_chance(chosen.off)) < RARE or chosen.chi_squared() < RARE:
        text += "; but what it leaves has a shape, so that none of them is the law"
    rows = [
        (f.law.name, f"{f.aicc - tried[0].aicc:.3g}", of) for f, of in zip(tried, columns["exponents"], strict=True)
    ]
    summary = Table(rows, ("law", "worse in AICc", "exponents")).text(indent="", wide=True)
    return xr.Dataset(
        variables, attrs={"chosen": chosen.law.name, "margin": margin, "verdict": text, "summary": summary}
    )


def _exponents(found: Found, span: float) -> str:
    """The exponents with their standard errors, as of independent noise."""
    law = found.law
    names = law.exponents or ("p",) * (law is OFFSET)
    places = range(len(names)) if law is OFFSET else range(found.numbers.size - len(names), found.numbers.size)
    doubt = found.errors()
    parts = [
        f"{name} = {found.numbers[k] / span:.4g} +- {doubt[k] / span:.1g}"
        for name, k in zip(names, places, strict=True)
    ]
    if law is CORRECTION:
        parts.append(f"D = {found.numbers[1] / span:.3g}")
    return ", ".join(parts) or "none"
