"""By how much does a balance spring steady a foliot against changes of its drive torque, and at what price?

    python studies/hairspring.py hairspring.h5

kappa = k phi0/mu is the spring's torque at the switching angle over the drive, alpha = mu/(a^2 phi0) the drive as
Hoyng & Nieuwenhuizen have it, Q = sqrt(k)/a.

Theory, to first order in the torque: phi = A sin wt, w = sqrt(k), and the torque, which lags by asin(phi0/A), pushes
against the displacement with first harmonic (4 mu/pi) cos(asin(phi0/A)), while friction pi a w A^2/2 takes 2 mu phi0:
    P = (2 pi/w) (1 - (2 mu/(pi k A)) sqrt(1 - y)),  y = (phi0/A)^2 = (pi/4) a sqrt(k) phi0/mu,
    s = kappa^(-3/4) alpha^(-1/4) / (2 sqrt(pi)) / sqrt(1 - y).                                        (1)
At given drive and friction (1) is least at y = 3/4; at given Q it is least at y = 1/2; y = 1 is the end. Derived here.

Here s = -dlnP/dlnmu. The theory is of first order in the torque, and exact for large alpha and kappa. A number holds if
the next order in 1/alpha^(1/2) or 1/kappa, or interpolation, explains its deviation. The paper, Hoyng & Nieuwenhuizen,
arXiv:1604.06681, says "if they had only mounted some kind of a spring on the foliot".
"""

import math

import numpy as np
import xarray as xr
from _common import DAY, Claims, compared, count, held, most, nearest, never, script, solved
from _figures import COLOURS, DRIVE, Log, LogNorm, contours, direct_label, hatch, page, panel

import sweep
from kernels.interface import Status

SHOWN = {1e6: "10^6", 1e4: "10^4", 1e2: "10^2", 1.0: "1"}
"""alpha of the lines in the figure."""


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` over kappa and alpha, with `s`, amplitude `A` in phi0, and Q."""
    alpha, kappa = ds.mu / (ds.a**2 * ds.phi0), ds.k * ds.phi0 / ds.mu
    ds = ds.assign_coords(alpha=alpha, kappa=kappa, Q=np.sqrt(ds.k) / ds.a)
    return ds.assign(s=ds.sensitivity, A=ds.amplitude / ds.phi0)


def at(alpha, kappa, design: str = "product") -> xr.Dataset:
    """The same foliot at other alpha and kappa, by one method: near the last spring with a cycle it is INACCURATE."""
    cells = {"a": np.atleast_1d(alpha) ** -0.5, "k": np.atleast_1d(kappa)}
    return scaled(solved("foliot", method="segments", rtol=1e-7, design=design, **cells, mu=1, phi0=1))


def line_of(ds: xr.Dataset, alpha) -> xr.Dataset:
    """The sweep of the spring at the drive next to `alpha`."""
    return ds.isel(nearest(np.log(ds.alpha), math.log(alpha)))


def first_order(alpha, kappa):
    """Equation (1); NaN where the spring cannot be thrown over."""
    y = math.pi / 4 * np.sqrt(kappa / alpha)
    return kappa**-0.75 * alpha**-0.25 / np.sqrt(4 * math.pi * np.where(y < 1, 1 - y, np.nan))


def prepared(ds):
    """The sweep with its groups, and the springs of least s at the drives of the grid from alpha = 10 on, with what
    their kappa is off by interpolation, relative, `blur`."""
    ds = scaled(ds)
    strong = ds.where(ds.alpha > 9.99, drop=True)
    place = sweep.where_exponent(strong.s, "kappa", 0.0)
    found = at(strong.alpha.values, place.abscissa.values, "zip")
    return ds, found.assign(blur=("cell", (place.abscissa_error / place.abscissa).values))


def claims(ds, springs) -> Claims:
    yield "The law"
    strong, (low, high) = line_of(ds, ds.alpha.max()), (10.0, 1000.0)
    bare = at(strong.alpha.values, 0.0).s.item()
    part = ds.where((ds.alpha > 0.99e5) & (ds.kappa > low) & (ds.kappa < high), drop=True)
    slack = 1 / math.sqrt(1e5) + 1 / low**2  # the next order
    # P sqrt(mu/phi0) is a function of a sqrt(phi0/mu) and kappa; differences are of fourth order
    inner = ds.where((ds.alpha > 99) & (ds.kappa < 10), drop=True)
    by_a, by_k = (sweep.local_exponent(inner.period, name) for name in "ak")
    rough = float(np.diff(np.log(ds.k)).max() ** 4) / 4
    what = f"s, kappa = {low:g} to {high:g}, alpha from 1e5 on: {count(part.s)}"
    yield compared(f"s at kappa = {ds.kappa[0]:.0e}: still the foliot's", f"{bare:.6f}", strong.s[0], bare, 1e-2)
    yield most(what, "(1)", part.s / first_order(part.alpha, part.kappa) - 1, slack)
    yield most("differences of ln P against the exact s", "0", 0.5 + by_a / 2 + by_k - inner.s, rough)

    yield "How far it goes"
    for alpha in (1e6, 1e4, 1e2):
        best, line = line_of(springs, alpha), line_of(ds, alpha)
        last = int(np.flatnonzero(line.s.notnull())[-1])  # the strongest spring with a cycle, to one part in 2000
        fine = at(line.alpha.item(), np.geomspace(*line.kappa.values[last : last + 2], 201)).isel(a=0)
        end, near = fine.kappa[fine.s.notnull()][-1], 1e-4 + 1 / alpha + float(best.blur)
        what = f"alpha = {alpha:.0e}: best spring, kappa/alpha"
        yield compared(what, "9/pi^2 = 0.91189", best.kappa / best.alpha, 9 / math.pi**2, near)
        yield compared("  s alpha there", "pi/27^(1/2) = 0.60460", best.s * best.alpha, math.pi / 27**0.5, near)
        yield compared("  A/phi0 there", "2/3^(1/2) = 1.15470", best.A, 2 / 3**0.5, near)
        yield compared("  strongest with a cycle", "16/pi^2 = 1.6211", end / alpha, 16 / math.pi**2, 1e-3 + 4 / alpha)
    Q = 1000.0
    kappa = np.geomspace(Q / 10, Q, 61)
    place = sweep.where_exponent(at(Q**2 / kappa, kappa, "zip").s, "kappa", 0.0).abscissa.item()
    cell = at(Q**2 / place, place).isel(a=0, k=0)
    yield compared(f"least s Q at Q = {Q:g}, kappa/Q = {place / Q:.4f}", "1/2", cell.s * cell.Q, 0.5, 3 / Q)
    # self-starting is where the first swing of a free balance under constant torque passes phi0
    zeta = np.minimum(1 / (2 * ds.Q), 1 - 1e-15)
    reach = (1 + np.exp(-math.pi * zeta / np.sqrt(1 - zeta**2))) / ds.kappa
    wrong = ((ds.status == Status.NOT_SELF_STARTING) != (reach < 1)) & ds.s.notnull()
    yield never("not self-starting unless kappa < 1 + e^(-pi zeta/(1-zeta^2)^(1/2)): exceptions", wrong)

    yield "The paper's spring"
    for alpha, least, word in ((1e4, 10, "dramatically"), (1e2, 10, "dramatically"), (1.0, 1, ""), (1e-2, 1, "")):
        gain = at(alpha, 0.0).s.item() / line_of(ds, alpha).s.min()
        yield held(f"best spring, s of alpha = {alpha:g} falls by", gain, f"> {least}", "{:.4g}", word)


SPRING = Log(r"spring, $\kappa = k\varphi_0/\mu$ [1]")
PUSHED = {"linestyle": (0, (2.5, 1))}
KEY = {"self-starting": "-", "not self-starting": PUSHED, "theory of first order": "x", "best spring": "o"}


@panel(SPRING, Log(r"sensitivity to torque, $s$ [1]", (2e-7, 1.5)), "lower left", KEY)
@panel(SPRING, DRIVE)
@page(150.0)
def figure(lines, plane, ds, springs):
    """Sensitivity against the spring, and a map of it over spring and drive."""
    for (alpha, text), colour in zip(SHOWN.items(), COLOURS, strict=False):
        line, cell = line_of(ds, alpha), line_of(springs, alpha)
        started, x, y = line.status == Status.OK, 3.0, 0.45
        lines.plot(line.kappa, line.s.where(started), color=colour)
        lines.plot(line.kappa, line.s.where(~started), color=colour, **PUSHED)
        if alpha > 1:
            few, x, y = line.kappa.values[::10], 2.4 * cell.kappa, cell.s
            few = few[(few > alpha ** (-1 / 3)) & (few < 1.6 * alpha)]
            lines.plot(few, first_order(alpha, few), "x", color="black", markersize=3.5, markeredgewidth=0.7)
            lines.plot(cell.kappa, cell.s, "o", color=colour)
        direct_label(lines, x, y, rf"$\alpha = {text}$", colour, ha="left")
    lines.set(xlim=(ds.kappa.min(), 10 * ds.kappa.max()))
    day = lines.secondary_yaxis("right", functions=(lambda s: 0.01 * DAY * s, lambda rate: rate / (0.01 * DAY)))
    day.set_ylabel("rate [s/day] by 1 % of torque")
    lines.tick_params(axis="y", which="both", right=False)
    kappa, alpha, rate = ds.kappa.values, ds.alpha.values, np.ma.masked_invalid(0.01 * DAY * ds.s.values)
    plane.set(ylim=(alpha.min(), alpha.max()))
    plane.set_title("rate [s/day] by 1 % of torque", loc="right")
    plane.pcolormesh(kappa, alpha, rate, norm=LogNorm(1e-4, 1e3), cmap="viridis", alpha=0.75, rasterized=True)
    contours(plane, kappa, alpha, rate, (1e-3, 1e-2, 0.1, 1, 10, 100, 400), "black")
    hatch(plane, kappa, alpha, (ds.status == Status.STICKS).values, "////")
    hatch(plane, kappa, alpha, (ds.status == Status.NOT_SELF_STARTING).values, "..", "white")
    line = alpha[alpha > 9.9]
    plane.plot(9 / math.pi**2 * line, line, color="white", linestyle=(0, (5, 1.5)))
    direct_label(plane, 3e4, 0.3, "sticks: no cycle")
    direct_label(plane, 3e5, 3e2, "best spring (dashed)")
    direct_label(plane, 3e2, 4e3, "not self-starting")


main = script(__name__, "hairspring.h5", claims, figure, prepared)
