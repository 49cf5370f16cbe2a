"""How does the period of a foliot fall with its drive torque, from weak to strong drive?

    python studies/foliot_scaling.py foliot_scaling.h5

Compares what Hoyng & Nieuwenhuizen ("the paper", arXiv:1604.06681) say with what comes out here. Only
alpha = mu/(a^2 phi0) counts: a P and A = phi_max/phi0 are functions of it alone.

What stands in (...) is exact, and not in the paper; * marks what is masked in the text at hand, and follows here from
the paper's equations. A limit holds if the next term of its series accounts for the deviation; torques hold to 1e-3 of
the rate they change. After ± stands the standard error of least squares. Nothing here is noisy, so it measures the
curvature of the truth in the window, and is no bound on the distance to the limit.

Why the exponents are -1 and -1/3 is said in docs/theory/weak_drive.md and strong_drive.md.
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, Statement, compared, most, nearest, said, script, solved
from _figures import COLOURS, DRIVE, HOLLOW, SLOPE, Log, page, panel

import sweep

WEAK: tuple[float | None, float | None] = (None, 1e-5)
STRONG: tuple[float | None, float | None] = (1e5, None)
"""Windows of alpha for the straight lines."""
SHOWN = np.array([0.1, 1.463, 100.0])
"""alpha of the motions whose shape is told."""
HALF = (1.46299058758010465706, 6.42446119521106945636, 1.39341841440363426389)
"""alpha, a P and A of the exponent -1/2, once in 50 digits."""
STRONG_P, STRONG_A = 4 * 3 ** (1 / 3), 3 ** (2 / 3) / 2
"""At strong drive a P = STRONG_P alpha^(-1/3) and A = STRONG_A alpha^(1/3)."""
QUARTER = 15 / (24 * 60)
"""A rate of 15 min/day."""


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with its dimensionless groups: coordinate `alpha`, variables `aP`, `A` and `s`."""
    ds = ds.assign_coords(alpha=ds.mu / (ds.a**2 * ds.phi0))
    return ds.assign(aP=ds.a * ds.period, A=ds.amplitude / ds.phi0, s=ds.sensitivity)


def sweep_of_alpha(ds: xr.Dataset, alpha) -> xr.Dataset:
    """`foliot` at other alpha, with the friction and the switching angle of `ds`."""
    mu = float(ds.a**2 * ds.phi0) * np.asarray(alpha, float)
    return scaled(solved("foliot", method="closed", mu=mu, a=ds.a, phi0=ds.phi0))


def prepared(ds):
    """The sweep with its groups, and where s = 1/2: bracketed on the sweep, refined by one of its neighbourhood."""
    ds = scaled(ds)
    near = float(sweep.where_exponent(ds.s, "alpha", 0.5, values=True).abscissa)
    close = sweep_of_alpha(ds, near * np.geomspace(0.99, 1.01, 21))
    found = sweep.where_exponent(close.s, "alpha", 0.5, values=True)
    return ds, sweep_of_alpha(ds, [float(found.abscissa)]).isel(mu=0)


def claims(ds, half) -> Claims:
    yield "Limits"
    first, last = ds.isel(mu=0), ds.isel(mu=-1)
    weak, strong = float(first.alpha), float(last.alpha)
    third, b2 = strong ** (1 / 3), (3 / strong) ** (2 / 3)  # b2: square of the strong drive's small parameter
    at, period, swing = f"at alpha = {strong:.2g}", f"4 3^(1/3) = {STRONG_P:.5f} *", f"3^(2/3)/2 = {STRONG_A:.5f} *"
    yield compared(f"weak drive: a P alpha at alpha = {weak:.2g}", "4 *", first.aP * weak, 4.0, 1.01 * weak)
    yield compared(f"weak drive: A at alpha = {weak:.2g}", "1 *", first.A, 1.0, 0.31 * weak)
    yield compared(f"strong drive: a P alpha^(1/3) {at}", period, last.aP * third, STRONG_P, 0.14 * b2)
    yield compared(f"strong drive: A alpha^(-1/3) {at}", swing, last.A / third, STRONG_A, 0.11 * b2)
    # A limit is allowed the distance of the local exponent at the inner end of its window, by the series' next term.
    for name, y, window, paper, limit in (
        ("a P", ds.aP, WEAK, "-1 *", -1.0),
        ("a P", ds.aP, STRONG, "-1/3 *", -1 / 3),
        ("A", ds.A, WEAK, "0 *", 0.0),
        ("A", ds.A, STRONG, "1/3 *", 1 / 3),
    ):
        fit = sweep.fit_exponent(y, "alpha", window)
        off, next_term = fit.exponent - limit, fit.high if window == WEAK else 4 / 45 * (3 / fit.low) ** (2 / 3)
        here = f"{fit.exponent:.7f} ± {fit.exponent_error:.1g}, prefactor {fit.prefactor:.5f}"
        what = f"exponent of {name}, alpha = {fit.low:.1e} to {fit.high:.1e} ({fit.points:d} points)"
        yield most(what, paper, off, next_term, here)
    meet = sweep.fit_two_laws(ds.aP, "alpha", windows=(WEAK, STRONG))
    here = f"alpha = {meet.crossover:.5f} ± {meet.crossover_error:.1g}, a P = {meet.level:.4f}"
    exact = "(3^(-1/2) = 0.57735, 6.9282)"
    yield most("the two laws of a P meet at", exact, meet.crossover * math.sqrt(3) - 1, 0.01, here)

    yield "In between"
    slope = sweep.local_exponent(ds.aP, "alpha")
    rough = float(np.diff(np.log(ds.alpha)).max() ** 4)  # differences are of fourth order
    low, high = float(slope.min()), float(slope.max())
    slides = (slope.diff("mu") > -rough).all() and abs(low + 1) < 0.01 and abs(high + 1 / 3) < 0.01
    near, roup = (abs(slope + 0.5) < 0.01).mean(), "exponent -1/2 (Roup et al. and Denny: at all torques)"
    yield said("exponent of P changes gradually", slides, f"{low:.7f} to {high:.7f}", "-1 to -1/3 *")
    yield said(roup, near < 0.02, f"{near:.1%} of alpha within 0.01", "at one alpha")
    for name, here, true in zip(("at alpha", "a P there", "A there"), (half.alpha, half.aP, half.A), HALF, strict=True):
        yield compared(f"  {name}", "read off a figure", here, true, 1e-12)

    yield "At every drive"
    # a weak drive is followed from rest in SI units; weaker ones take steps in proportion to 1/alpha
    weak = ds.isel(nearest(np.log(ds.alpha), math.log(1e-3)))
    rest = solved("foliot_scene:KERNEL", mu=[float(weak.mu)], a=ds.a, phi0=ds.phi0, flips=4, rtol=1e-10)
    friction, mu = float(ds.a) * np.exp(np.linspace(-0.02, 0.02, 9)), half.alpha * ds.a**2 * ds.phi0
    near = solved("foliot", method="closed", outputs=["period"], a=friction, mu=mu, phi0=ds.phi0)
    blind, least = sweep.local_exponent(near.period, "a")[4], ds.A.min() - 1
    followed = f"from rest to 4 switches at alpha = {weak.alpha:.1e}: P"
    yield most("self-starting, no least torque", "yes", 2 * rest.interval[0] / weak.period - 1, 1e-8, followed)
    yield said("A is always larger than 1", least > 0, f"smallest A - 1 = {least:.2g}", "yes")
    yield most("at exponent -1/2 friction does not count", "yes *", blind, 1e-8, "dlnP/dlna = 0")

    yield "Torque"
    for drive, alpha, percent in (("weak", float(ds.alpha[0]), 1), ("strong", float(ds.alpha[-1]), 3)):
        part = QUARTER / float(sweep_of_alpha(ds, [alpha]).s[0])
        slow, fast = sweep_of_alpha(ds, [alpha * math.exp(-part / 2), alpha * math.exp(part / 2)]).period.values
        off, what = math.log(slow / fast) / QUARTER - 1, f"change of the torque for 15 min/day, {drive} drive"
        holds = abs(off) < 1e-3 and round(100 * part) == percent
        yield Statement(what, f"{percent} % *", f"{100 * part:.4g} %", off, holds)

    yield "Shape of the swing"
    phase, faster, out, back = np.linspace(0, 1, 8001), [], [], []
    mu, how = SHOWN * float(ds.a**2 * ds.phi0), {"method": "closed", "outputs": ["angle", "speed"]}
    motion = solved("foliot_motion", **how, along={"phase": phase}, mu=mu, a=ds.a, phi0=ds.phi0)
    turned = motion.angle / ds.phi0
    for angle, speed in zip(turned.values, motion.speed.values, strict=True):
        top = int(angle.argmax())  # falling from there, the angle passes the switch once more
        falling = slice(top, phase.size // 2 + 1)
        faster.append(speed[0] / float(np.interp(-1.0, -angle[falling], -speed[falling])))
        out.append(phase[top])
        back.append(float(np.interp(-1.0, -angle[falling], phase[falling])) - phase[top])
    strong = abs(turned.isel(mu=-1))
    high, rounder = (strong > 0.5 * strong.max()).mean(), "strong drive: rounder than a sine, time over A/2"
    times = ", ".join(f"{x:.4f}" for x in faster) + " times"
    sooner = ", ".join(f"{x:.3f} and {y:.3f} P" for x, y in zip(out, back, strict=True))
    yield said("faster at the switch than back there after the turn", min(faster) > 1, times, "yes")
    yield said("time from the switch to the peak, shorter than back", np.all(np.less(out, back)), sooner, "yes")
    yield said(rounder, high > 2 / 3 + 0.01, f"{high:.3f} P, sine 0.667", "yes")

    yield "Energy"
    weak, strong = ds.isel(mu=0), ds.isel(mu=-1)
    kept = float(ds.multiplier.where(ds.alpha < 0.1).max())
    cube = strong.crossing_speed**3 * strong.a / (strong.mu**2 * strong.phi0)
    final = weak.crossing_speed * weak.a / weak.mu
    yield said("a swing forgets the one before it, alpha < 0.1", kept < 1e-8, f"kept: {kept:.0e}")
    yield compared("why -1: v a/mu, v at the switch, weak drive", "1 *", final, 1.0, 1e-6)
    yield compared("why -1/3: v^3 a/(mu^2 phi0), strong drive", "(3) order 1", cube, 3.0, b2)


@panel(Log(), Log(r"$aP$ and $\varphi_{\max}/\varphi_0$ [1]"), "upper right")
@panel(DRIVE, SLOPE.to(-1.06, -0.27), "center right", bbox_to_anchor=(1, 0.35))
@page(118.0, sharex=True, height_ratios=(1.15, 1))
def figure(scaling, exponent, ds, half):
    """Period and amplitude over the drive, and the exponent that slides."""
    alpha, swing = ds.alpha.values, r"amplitude, $\varphi_{\max}/\varphi_0$"
    scaling.plot(alpha, ds.aP, color=COLOURS[0], label=r"period, $aP$")
    scaling.plot(alpha, ds.A, color=COLOURS[1], linestyle=(0, (6, 1.5)), label=swing)
    weak, strong = alpha[alpha < 30], alpha[alpha > 0.02]
    for x, prefactor, power, place, text in (
        (weak, 4, -1, (2e-5, 1.5e6), r"$4/\alpha$"),
        (strong, STRONG_P, -1 / 3, (2e4, 0.9), r"$4\,(3/\alpha)^{1/3}$"),
        (weak, 1, 0, (2e-5, 2.2), "1"),
        (strong, STRONG_A, 1 / 3, (1e4, 1.2e2), r"$\frac{1}{2}\,3^{2/3}\,\alpha^{1/3}$"),
    ):
        (line,) = scaling.plot(x, prefactor * x**power, color="black", linewidth=0.8, linestyle=(0, (1, 1.5)))
        scaling.text(*place, text)
    line.set_label("asymptotes")
    scaling.plot(half.alpha, half.aP, "o", color="black", label=r"exponent $-1/2$")
    slope = sweep.local_exponent(ds.aP, "alpha")
    few = slice(None, None, max(1, slope.size // 56))
    for value in (-1, -1 / 2, -1 / 3):
        exponent.axhline(value, color="0.6", linewidth=0.6, linestyle=(0, (4, 2)))
    exponent.plot(ds.alpha, -ds.s, color=COLOURS[0], label=r"exact, $-s$")
    how = {"marker": "o", "color": COLOURS[1], "markersize": 3, "label": r"differences of $\ln P$"}
    exponent.plot(ds.alpha[few], slope[few], **{**HOLLOW, **how})
    exponent.plot(half.alpha, -0.5, "o", color="black")
    exponent.annotate(rf"$\alpha = {float(half.alpha):.6f}$", (half.alpha, -0.5), (8, -12), textcoords="offset points")
    exponent.set_yticks([-1, -1 / 2, -1 / 3], labels=["$-1$", r"$-\frac{1}{2}$", r"$-\frac{1}{3}$"])
    exponent.set_yticks([-0.9, -0.8, -0.7, -0.6, -0.4], minor=True)


main = script(__name__, "foliot_scaling.h5", claims, figure, prepared, source="paper")
