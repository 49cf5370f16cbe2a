"""Is the period of a foliot blind to the fine structure of its torque?

    python studies/torque_ripple.py torque_ripple.h5

The torque is mu (1 + depth f), f = cos(h pi s), s the way along the drive over 2 phi0 (0 at the last switch, 1 at the
next, below 0 on the recoil), h the harmonic; it does the same work at any depth. alpha = mu/(a^2 phi0),
A = phi_max/phi0 and q = a P/4 as in Hoyng & Nieuwenhuizen.

To first order in the depth, with a = 1 the force -f(t) along the swing without ripple shifts its speed by
-int exp(t' - t) f dt'; speed and angle at the next switch close the cycle if, T = 2q being the half period,
    dlnP/ddepth = -1/(q tanh(q)^2) int_0^T (1 - cosh(t - q)/cosh q) f dt = K.                         (1)
High harmonics are felt only where s(t) stands still: at the turning point, s = -(A - 1)/2, where s'' = alpha/2. There
stationary phase gives
    K -> -cos(pi/4 - h pi (A - 1)/2)/(q sqrt(h alpha)),                                              (2)
and ds/ddepth = -dK/dlnalpha grows as sqrt(h) by dA/dlnalpha = A - 1/tanh q. For weak drive, alpha h << 1, the speed
follows the torque: P/P0 = 1/sqrt(1 - depth^2), K = -2 alpha for odd h, and K = -(5/24) alpha (h pi alpha)^2 for even h
by inertia behind the switches. Derived here; allowed is what the next order in the depth, in 1/h or in alpha explains.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, power, script
from _figures import COLOURS, Log, direct_label, page, panel, points
from _losses import of_quarter, quarter

DRIVES = ("weak", "middle", "strong")


def first_order(alpha: float, harmonics, pieces: int = 1000):
    """K of (1) for all harmonics, by 16-point Gauss rules."""
    q = quarter(alpha)
    x, w = np.polynomial.legendre.leggauss(16)
    width = 2 * q / pieces
    t = (width * (np.arange(pieces)[:, None] + (x + 1) / 2)).ravel()
    s = alpha / 2 * (t + (1 + math.tanh(q)) * np.expm1(-t))
    weight = np.tile(w, pieces) * (width / 2) * (1 - np.cosh(t - q) / math.cosh(q))
    return np.array([-(weight * np.cos(h * math.pi * s)).sum() for h in harmonics]) / (q * math.tanh(q) ** 2)


def first_order_sensitivity(alpha: float, harmonics, step: float = 1e-4):
    """-dK/dlnalpha."""
    return (first_order(alpha * (1 - step), harmonics) - first_order(alpha * (1 + step), harmonics)) / (2 * step)


def envelopes(alpha: float, harmonics) -> tuple[Any, Any]:
    """Amplitude of K in (2), and that of ds/ddepth where the harmonic is high."""
    q = quarter(alpha)
    of_period = 1 / (q * np.sqrt(harmonics * alpha))
    return of_period, of_period * harmonics * math.pi / 2 * (of_quarter(q)[2] - 1 / math.tanh(q))


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with alpha, changes of period and s, their slopes `K` and `L` at depth 0, and the period's `curvature`."""
    change, moved = ds.period / ds.period.sel(depth=0) - 1, ds.sensitivity - ds.sensitivity.sel(depth=0)
    first, second = (float(x) for x in ds.depth[1:3])
    (low, high), rates = ((y / ds.depth).isel(depth=[1, 2]).transpose("depth", ...) for y in (change, moved))
    K, L = ((x * second - y * first) / (second - first) for x, y in ((low, high), rates))
    ds = ds.assign_coords(alpha=ds.mu / (ds.a**2 * ds.phi0))
    return ds.assign(change=change, K=K, L=L, curvature=(high - low) / (second - first))


def claims(ds) -> Claims:
    yield "First order in the depth"
    # rtol over the depths that the slopes are taken from is 5e-5; the rest is of third order
    for i, name in enumerate(DRIVES):
        line, h, text = ds.isel(a=i), ds.harmonic.values, f"{ds.harmonic.size} harmonics"
        alpha = float(line.alpha)
        expected = first_order_sensitivity(alpha, h)
        off = (line.L - expected) / np.maximum(abs(expected), 1)
        yield most(f"{name}, alpha = {alpha:.4g}: worst of K", "(1)", line.K - first_order(alpha, h), 1e-3, text)
        yield most("  worst of ds/ddepth, over 1 or itself", "(1)", off, 1e-2, text)
    small = abs(ds.change.sel(depth=slice(0.01, 0.05)))
    for i in (1, 2):
        degree = power(small.isel(a=i).sel(harmonic=1))
        yield differing(f"{DRIVES[i]}: power of the depth, h = 1", "1", degree, 1, 0.05)

    yield "High harmonics"
    # K and ds/ddepth over cosine and sine of the phase in (2), away from zeros; the power is NaN if signs differ
    for i in (1, 2):
        line, h, alpha = ds.isel(a=i), ds.harmonic, float(ds.alpha[i])
        phase = math.pi / 4 - h * math.pi * (of_quarter(quarter(alpha))[2] - 1) / 2
        of_period, of_rate = envelopes(alpha, h)
        for what, y, wave, envelope, expected in (
            (f"{DRIVES[i]}: power of the harmonic in K", line.K, -np.cos(phase), of_period, -0.5),
            ("  power of the harmonic in ds/ddepth", line.L, np.sin(phase), of_rate, 0.5),
        ):
            size = (y / wave).where((h >= 16) & (abs(wave) > 0.7), drop=True)
            exponent = power(size) if abs(np.sign(size).sum()) == size.size else math.nan
            yield differing(what, f"{expected:+}", exponent, expected, 0.05)
            yield compared(f"  {what.split()[-1]} over its envelope", "1", (size / envelope).mean(), 1, 0.05)

    yield "Weak drive"
    line = ds.isel(a=0)
    alpha, even, whole = float(line.alpha), line.sel(harmonic=2), 1 / 0.75**0.5 - 1
    layers = -5 / 24 * (2 * math.pi * alpha) ** 2
    yield differing("power of the depth, h = 2", "2", power(small.isel(a=0).sel(harmonic=2)), 2, 0.1)
    yield compared("P/P0 - 1 over depth^2, h = 2", "1/2", even.curvature, 0.5, 2 * alpha)
    yield compared("P/P0 - 1 at depth 0.5, h = 2", f"{whole:.4f}", even.change.sel(depth=0.5), whole, 3 * alpha)
    yield compared("K/alpha, h = 1", "-2", line.K.sel(harmonic=1) / alpha, -2, 2 * alpha)
    yield compared("K/alpha, h = 2", f"-5/24 (2 pi alpha)^2 = {layers:.4f}", even.K / alpha, layers, 0.1)


DOT, ENVELOPE = {"marker": ".", "linestyle": ""}, {"linestyle": "--", "linewidth": 0.8}
KEY = {"theory of first order": {**DOT, "markersize": 3}, "its envelope": {**ENVELOPE, "color": "0.3"}}
HARMONIC = Log("harmonic, $h$ [1]", (0.9, 72))
RATE = Log(r"$|\mathrm{d}s/\mathrm{d}\,\mathrm{depth}|$ at depth 0 [1]", (2e-3, 20))


@panel(Log(), Log(r"$|\mathrm{d}\ln P/\mathrm{d}\,\mathrm{depth}|$ at depth 0 [1]", (2e-5, 2)))
@panel(HARMONIC, RATE, "outside upper center", KEY, ncols=3, columnspacing=1.0)
@page(142.0, sharex=True)
def figure(of_period, of_rate, ds):
    """First-order coefficients of period and sensitivity against the harmonic, with theory and the envelopes of (2)."""
    some = np.intersect1d(ds.harmonic, np.geomspace(1, 64, 30).round())
    for i, mark in enumerate("os^"):
        alpha, name = float(ds.alpha[i]), rf"{DRIVES[i]}, $\alpha = {float(ds.alpha[i]):.3g}$"
        theory, envelope = (first_order(alpha, some), first_order_sensitivity(alpha, some)), envelopes(alpha, some)
        for k, (axes, found) in enumerate(((of_period, ds.K), (of_rate, ds.L))):
            points(axes, some, abs(found.isel(a=i).sel(harmonic=some)), i, name, marker=mark)
            axes.plot(some, abs(theory[k]), color="black", markersize=1.5, **DOT)
            if i:
                axes.plot(some, envelope[k], color=COLOURS[i], **ENVELOPE)
    direct_label(of_period, 20, 0.25, "$h^{-1/2}$")
    direct_label(of_rate, 3, 2.6, "$h^{1/2}$")


main = script(__name__, "torque_ripple.h5", claims, figure, scaled)
