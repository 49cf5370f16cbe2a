"""How does the period of a foliot fall with its drive torque, from weak to strong drive?

    python studies/foliot_scaling.py foliot_scaling.h5

Compares what Hoyng & Nieuwenhuizen ("the paper", arXiv:1604.06681) say with what comes out here. Only
alpha = mu/(a^2 phi0) counts: a P and A = phi_max/phi0 are functions of it alone.

What stands in (...) is exact, and not in the paper; * marks what is masked in the text at hand, and follows here from
the paper's equations. A limit holds if the next term of its series accounts for the deviation; torques hold to 1e-3 of
the rate they change. After ± stands the standard error of least squares. Nothing here is noisy, so it measures the
curvature of the truth in the window, and is no bound on the distance to the limit. Why the exponents are -1 and -1/3 is
said in docs/theory/weak_drive.md and strong_drive.md.
"""

import math
from fractions import Fraction

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, held, most, nearest, never, said, script, solved
from _figures import COLOURS, DRIVE, LAWS, SLOPE, Log, page, panel, points

import sweep

WEAK, STRONG = (None, 1e-5), (1e5, None)
"""Windows of alpha for the straight lines."""
HALF = {"alpha": 1.46299058758010465706, "aP": 6.42446119521106945636, "A": 1.39341841440363426389}
"""Where the exponent is -1/2, once in 50 digits."""
STRONG_P, STRONG_A = 4 * 3 ** (1 / 3), 3 ** (2 / 3) / 2
"""At strong drive a P = STRONG_P alpha^(-1/3) and A = STRONG_A alpha^(1/3)."""


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
    weak, strong = ds.isel(mu=0), ds.isel(mu=-1)
    low, third, b2 = float(weak.alpha), strong.alpha ** (1 / 3), float(3 / strong.alpha) ** (2 / 3)
    yield compared(f"alpha = {low:.2g}: aP alpha", "4 *", weak.aP * low, 4.0, 1.01 * low)
    yield compared("  A", "1 *", weak.A, 1.0, 0.31 * low)
    yield compared(f"alpha = {strong.alpha:.2g}: aP alpha^(1/3)", "4 3^(1/3) *", strong.aP * third, STRONG_P, 0.14 * b2)
    yield compared("  A alpha^(-1/3)", "3^(2/3)/2 *", strong.A / third, STRONG_A, 0.11 * b2)
    for name, window, limit in (("aP", WEAK, "-1"), ("aP", STRONG, "-1/3"), ("A", WEAK, "0"), ("A", STRONG, "1/3")):
        fit = sweep.fit_exponent(ds[name], "alpha", window)
        # the local exponent at the inner end of a window is farthest from its limit
        farthest = float(fit.high if window == WEAK else 4 / 45 * (3 / fit.low) ** (2 / 3))
        here = f"{fit.exponent:.7f} ± {fit.exponent_error:.1g}, prefactor {fit.prefactor:.5f}"
        what = f"exponent of {name}, alpha = {fit.low:.1e} to {fit.high:.1e} ({fit.points:d} points)"
        yield most(what, f"{limit} *", fit.exponent - float(Fraction(limit)), farthest, here)
    meet = sweep.fit_two_laws(ds.aP, "alpha", windows=(WEAK, STRONG))
    here = f"alpha = {meet.crossover:.5f} ± {meet.crossover_error:.1g}, a P = {meet.level:.4f}"
    yield most("the two laws of a P meet at", "3^(-1/2), 6.9282", meet.crossover * math.sqrt(3) - 1, 0.01, here)

    yield "In between"
    slope = sweep.local_exponent(ds.aP, "alpha")
    rough = float(np.diff(np.log(ds.alpha)).max() ** 4)  # differences are of fourth order
    roup = "exponent within 0.01 of -1/2 (Roup et al. and Denny: at all torques)"
    yield never("exponent of P changes gradually from -1 to -1/3: drives at which it falls", slope.diff("mu") <= -rough)
    yield held(roup, (abs(slope + 0.5) < 0.01).mean(), "< 2 %", "{:.1%} of alpha", "at one alpha")
    yield from (
        compared(f"  {name} there", "read off a figure", half[name], true, 1e-12) for name, true in HALF.items()
    )

    yield "At every drive"
    # a weak drive is followed from rest in SI units; weaker ones take steps in proportion to 1/alpha
    light = ds.isel(nearest(np.log(ds.alpha), math.log(1e-3)))
    rest = solved("foliot_scene:KERNEL", mu=[float(light.mu)], a=ds.a, phi0=ds.phi0, flips=4, rtol=1e-10)
    friction, mu = float(ds.a) * np.exp(np.linspace(-0.02, 0.02, 9)), half.alpha * ds.a**2 * ds.phi0
    near = solved("foliot", method="closed", outputs=["period"], a=friction, mu=mu, phi0=ds.phi0)
    off = 2 * rest.interval[0] / light.period - 1
    yield most(f"self-starting, followed from rest at alpha = {light.alpha:.1e}: P", "yes", off, 1e-8)
    yield held("smallest A - 1", ds.A.min() - 1, "> 0", "{:.2g}", "A > 1")
    blind = sweep.local_exponent(near.period, "a")[4]
    yield most("at exponent -1/2 friction does not count: dlnP/dlna", "0", blind, 1e-8)

    yield "Torque"
    quarter = 15 / (24 * 60)  # a rate of 15 min/day
    for drive, alpha, percent in (("weak", weak.alpha, 1), ("strong", strong.alpha, 3)):
        part = quarter / float(sweep_of_alpha(ds, [alpha]).s[0])
        slow, fast = sweep_of_alpha(ds, float(alpha) * np.exp([-part / 2, part / 2])).period.values
        what = f"change of the torque for 15 min/day, {drive} drive [%]"
        yield differing(what, f"{percent} *", 100 * part, percent, 0.5)
        yield most("  the rate by it", "15 min/day", math.log(slow / fast) / quarter - 1, 1e-3)

    yield "Shape of the swing"
    mu, along = [alpha * float(ds.a**2 * ds.phi0) for alpha in (0.1, 1.463, 100.0)], {"phase": np.linspace(0, 1, 8001)}
    motion = solved("foliot_motion", method="closed", along=along, mu=mu, a=ds.a, phi0=ds.phi0)
    top, again = motion.angle.argmax("phase"), (motion.angle > ds.phi0).sum("phase")
    faster = motion.speed.isel(phase=0).values / -motion.speed.isel(phase=again).values
    out, back = (motion.phase.values[k] for k in (top, again - top))
    sooner = ", ".join(f"{x:.3f} and {y:.3f} P" for x, y in zip(out, back, strict=True))
    high = (abs(motion.angle[-1]) > 0.5 * motion.angle[-1].max()).mean()
    yield held("faster at the switch than back there after the turn", min(faster), "> 1", "{:.4f} times or more")
    yield said("time from the switch to the peak, shorter than back", np.all(out < back), sooner, "yes")
    yield held("strong drive: rounder than a sine, time over A/2 [P]", high, "> 0.677", "{:.3f}", "sine 0.667")

    yield "Energy"
    kept, final = ds.multiplier.where(ds.alpha < 0.1).max(), weak.crossing_speed * weak.a / weak.mu
    cube = strong.crossing_speed**3 * strong.a / (strong.mu**2 * strong.phi0)
    yield held("what a swing keeps of the one before it, alpha < 0.1", kept, "< 1e-8", "{:.0e}")
    yield compared("why -1: v a/mu, v at the switch, weak drive", "1 *", final, 1.0, 1e-6)
    yield compared("why -1/3: v^3 a/(mu^2 phi0), strong drive", "(3) order 1", cube, 3.0, b2)


@panel(Log(), Log(r"$aP$ and $\varphi_{\max}/\varphi_0$ [1]"), "upper right")
@panel(DRIVE, SLOPE._replace(ends=(-1.06, -0.27), ticks=LAWS), "center right", bbox_to_anchor=(1, 0.35))
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
    for value in (-1, -1 / 2, -1 / 3):
        exponent.axhline(value, color="0.6", linewidth=0.6, linestyle=(0, (4, 2)))
    exponent.plot(ds.alpha, -ds.s, color=COLOURS[0], label=r"exact, $-s$")
    points(exponent, ds.alpha[::25], slope[::25], 1, r"differences of $\ln P$", marker="o", markersize=3)
    exponent.plot(half.alpha, -0.5, "o", color="black")
    exponent.annotate(rf"$\alpha = {float(half.alpha):.6f}$", (half.alpha, -0.5), (8, -12), textcoords="offset points")


main = script(__name__, "foliot_scaling.h5", claims, figure, prepared, source="paper")
