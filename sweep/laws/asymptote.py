"""The exponent far out, by a correction to scaling.

    y = A x^p (1 + B x^-D)                                                                          (1)

D > 0 where p holds at large x, D < 0 where it holds at small x. B and D are hardly told apart, so the interval reaches
over those of every D that the points do not rule out.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.curves import Window, fit_lines
from sweep.laws.fits import Found, fitted, union
from sweep.laws.lines import rounding
from sweep.laws.loglog import Array, slope_bounds, slopes
from sweep.laws.noise import BEYOND_DOUBT, roughness
from sweep.laws.shapes import CORRECTION, LOG_CORRECTION, ONE, Law

SCATTERS = 0.3
"""Share of the distances from (1) that is noise between neighbours, from which on they are noise."""
AS_WELL = 10.0
"""Difference of AICc up to which another D is not ruled out; half of it for one law and for a logarithmic
correction, whose exponent is far harder to tell."""
FADES = np.exp([0, -6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]), 0.3, 80.0
"""How fast a correction may fade, per window: those tried about the best, to the power of its relative error, and the
least and largest."""
VERDICTS = ("a power law with a correction", "no power law with a correction", "no law at this end")


def fit_correction(
    y: xr.DataArray,
    dim: str,
    window: Window | None = None,
    *,
    end: str = "high",
    confidence: float = 0.95,
    noise: bool | str | None = None,
    sigma: Any = None,
) -> xr.Dataset:
    """Asymptotic exponent by a correction to scaling, equation (1), and whether the points follow it.

    Where there is noise, the interval is that of a mixture of noises as of `fit_exponent`, and reaches over those of
    all D, of a logarithmic correction (1 + B ln x)^c and of one law that the points do not rule out. Where there is no
    noise, it is three times as far as the fit to the outer half of the window moves the
    exponent. There is no interval where the points deny (1): by polynomials beside it that describe them far better;
    where `noise="even"` or `sigma` is given, by a shape of the distances; where `sigma` is, by chi-squared.

    Parameters
    ----------
    y, dim, window, confidence, noise, sigma
        As of `fit_exponent`.
    end : "high" or "low"
        Where (1) tends to a power law.

    Returns
    -------
    Dataset
        `exponent` with `exponent_low`, `exponent_high`; `verdict`, words; `correction_exponent` (D) [1];
        `correction`, B x^-D at the outer end; `residual`; `noisy`; `fits`. The dimensions are those of `y` but `dim`.
        NaN of fewer than eight points.

    Raises
    ------
    SweepError
        If `dim` or `end` is unknown or unfit, y is nowhere positive in the window, or no line has eight points.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot, axes={"mu": np.geomspace(10, 1e5, 41)})
    >>> print(f"{float(sweep.fit_correction(ds.period, 'mu').exponent):.4f}")
    -0.3334
    """
    if end not in ("low", "high"):
        raise SweepError(f'end: expected "low" or "high", found {end!r}')
    law, each = f"{{y}} = A {{x}}^p (1 + B {{x}}^-D), {end} end", functools.partial(_corrected, low=end == "low")
    return fit_lines(each, law, y, dim, window, sigma, confidence=confidence, noise=noise)


def _corrected(
    t: Array, z: Array, sigma: Array | None, bound: None, low: bool, confidence: float, noise: bool | str | None
) -> list[dict[str, Any]]:
    """Numbers of each line; at the low end by (1) of 1/x."""
    if low:
        t, z, sigma = -t[::-1], z[:, ::-1], None if sigma is None else sigma[:, ::-1]
    every, sign, word = [], -1.0 if low else 1.0, noise if isinstance(noise, str) else "noise"
    for row, tried in zip(z, fitted((ONE, CORRECTION, LOG_CORRECTION), t, z, sigma, CORRECTION), strict=True):
        found, one, fits, ends = tried[CORRECTION.name], tried[ONE.name], True, [math.nan, math.nan]
        exponent, fade, left = _outer(found, t)
        if abs(left) >= 1 and one.aicc <= found.aicc + BEYOND_DOUBT:  # a correction that is none
            exponent, fade, left = float(one.numbers[1] / (t[-1] - t[0])), math.nan, 0.0
        size = float(np.sqrt(np.mean(found.off**2)))
        scatters = bool(roughness(t, found.off)[0] > SCATTERS * size if noise is None else noise)
        if not (noisy := sigma is not None or (scatters and size > float(8 * rounding(t, row)))):
            reach = _by_half(t, row, exponent)
            ends = [exponent - reach, exponent + reach]
        elif fits := not found.denied(t, word):
            steps, least, most = FADES
            best, known = float(np.clip(abs(found.numbers[1]), least, most)), found.sigma
            far = np.clip(2 * np.nan_to_num(found.errors[1], posinf=most) / best, 0.02, 0.6)
            laws = [_fading(fade) for fade in np.clip(best * steps**far, least, most)]
            own, *others = fitted(laws, t, row[None], None if known is None else known[None])[0].values()
            others += [law for law in (one, tried[LOG_CORRECTION.name]) if law.aicc < found.aicc + AS_WELL / 2]
            ends = [*union(t, own, others, [-1], word, confidence, AS_WELL)[1][:, 0] / np.ptp(t), exponent]
        verdict = VERDICTS[1 if not fits else 0 if abs(left) < 1 else 2]
        of = {"exponent": sign * exponent, "correction_exponent": sign * fade, "correction": left, "verdict": verdict}
        of |= {"exponent_low": min(sign * end for end in ends), "exponent_high": max(sign * end for end in ends)}
        every.append(of | {"residual": found.residual, "noisy": noisy, "fits": verdict == VERDICTS[0]})
    return every


def _outer(found: Found, t: Array) -> tuple[float, float, float]:
    """p and D of the law that is left at the last point, and the correction there.

    (1) is a sum of two powers; whichever is larger there is the law, and the other one the correction.
    """
    log_strength, fade, _, exponent = found.numbers
    span = float(t[-1] - t[0])
    last = math.expm1(log_strength) * math.exp(min(-fade, 0.0))
    if fade > 0:
        return exponent / span, fade / span, last
    return (exponent - fade) / span, -fade / span, 1 / last if last else math.inf


def _by_half(t: Array, z: Array, exponent: float) -> float:
    """Three times as far as the outer half of the window moves the exponent."""
    first = np.append(True, np.diff(t) > 0)
    t, z = t[first], z[first]
    half = t >= (t[0] + t[-1]) / 2
    other = fitted((CORRECTION,), t[half], z[None, half])[0]
    local = _outer(other[CORRECTION.name], t[half])[0] if other else slopes(t, z, 5)[-1]
    return 3 * abs(float(local) - exponent) + float(slope_bounds(t, np.full(t.size, 8 * rounding(t, z)), 5)[-1])


def _fading(fade: float) -> Law:
    """(1) with a given D."""

    def curve(q: Array, s: Array, span: float) -> Any:
        return CORRECTION.curve(np.stack([q[0], np.full_like(q[0], fade)]), s, span)

    return CORRECTION._replace(name=str(fade), curve=curve, q=CORRECTION.q[:1])
