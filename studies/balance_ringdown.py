"""How many half swings does a balance make before friction holds it, and does friction change its period?

    python studies/balance_ringdown.py balance_ringdown.h5

For light damping theory is one function: with x = pi zeta theta0/(2 r), what viscous friction takes from the first
half swing over what solid friction takes, N = ln(1 + x)/(pi zeta). The kernel counts half swings of pi/omega_d each,
as the page has it, and cannot say otherwise; the time of a half swing and the motion are therefore measured by DOP853
on the page's (3). What is said of the period is so of the free balance alone: driven, it loses
(study `balance_isochronism`).

By theory the balance rests at the first turning point within r of the spring's zero; x = pi zeta theta0/(2 r). Counts
are whole numbers, so they hold to one half swing, and to the next term of the theory, 0.5 zeta^2 and r/theta0 of
themselves. "The page" says "vibration stops when A = theta +- r becomes smaller than r", where A is the amplitude about
the shifted centre.
"""

import math

import numpy as np
import xarray as xr
from _common import DAY, Claims, compared, held, most, said, script
from _figures import Log, LogNorm, colour_map, contours, direct_label, hatch, page, panel, points
from _peers import ended

from kernels.interface import Status

LIGHT = 0.01
"""Damping up to which delta = pi zeta to 5e-5."""
CELLS = ((0.005, 0.002), (0.02, 0.06), (0.1, 0.02), (0.3, 0.1), (1e-3, 0.14))
"""zeta, r [rad] that are followed by DOP853 from 1 rad, with omega_n = 1/s."""


def turning_points(zeta: float, r: float, start: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Times of rest and the angles there, by integrating (3) from rest to rest; `omega_n` is 1/s."""
    times, angles, small = [0.0], [start], 1e-6
    for _ in range(count):
        friction = -math.copysign(r, angles[-1])
        push = -angles[-1] - friction
        # the first step by its series, off the zero of the speed
        y = [angles[-1] + push * small**2 / 2, push * small * (1 - zeta * small)]
        time, (angle, _) = ended(
            lambda _, y, f=friction: (y[1], -2 * zeta * y[1] - y[0] - f), y, (small, 10.0), 1e-12, lambda _, y: y[1]
        )
        times.append(times[-1] + time)
        angles.append(angle)
    return np.array(times), np.array(angles)


def scaled(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with `x`, where it `creeps`, count `N`, its `law`, and `slow` = period over 2 pi/omega_n, minus 1."""
    x = math.pi * ds.zeta * abs(ds.theta0) / (2 * ds.r)
    creeps = ds.status == Status.OVERDAMPED
    slow, N = ds.period * ds.omega_n / (2 * math.pi) - 1, ds.half_swings.where(~creeps & (ds.half_swings > 0))
    return ds.assign(x=x, N=N, slow=slow, creeps=creeps, law=np.log1p(x) / (math.pi * ds.zeta))


def claims(ds) -> Claims:
    yield "Half swings"
    light = ds.where(ds.zeta <= LIGHT)
    off = abs(light.N - light.law)
    allowed = 1 + light.law * (0.5 * light.zeta**2 + light.r / abs(ds.theta0))
    what = f"N off ln(1 + x)/(pi zeta), zeta <= {LIGHT:g}, over the next order"
    yield most(what, "0", off / allowed, 1, f"off by {float(off.max()):.2f} at most")

    yield "Rest"
    # Where and when, also by the page's rule as it stands: at the first rest with abs(theta) - r < r.
    E = np.exp(-math.pi * ds.zeta / np.sqrt(1 - ds.zeta.where(ds.zeta < 1) ** 2))
    C = (1 + E) / (1 - E)
    need = np.ceil(np.log((abs(ds.theta0) + ds.r * C) / (2 * ds.r + ds.r * C)) / -np.log(E))
    early = (ds.N - np.maximum(need, 0)).where(ds.N > 0)
    zeta, r = CELLS[-1]
    third, fourth = abs(turning_points(zeta, r, 1.0, 4)[1][3:])
    words = f"rests at {fourth:.3f} rad, after 4; by the page at {third:.3f} > r, after 3"
    yield held(
        "it rests within r of the spring's zero: abs(theta)/r", (abs(ds.stop_angle) / ds.r).max(), "<= 1", "{:.6f}"
    )
    yield held("the page's rule stops too early, of cells", (early > 0).sum() / early.count(), "20 to 80 %", "{:.0%}")
    yield held("  by half swings, at most", early.max(), "1", "{:.0f}")
    yield said(f"  zeta = {zeta:g}, r = {r:g} rad, DOP853", fourth <= r < third < 2 * r, words, "abs(theta) <= r")

    yield "Isochronism of the free balance"
    half = [np.diff(turning_points(zeta, r, 1.0, 3)[0]) * math.sqrt(1 - zeta**2) / math.pi for zeta, r in CELLS]
    radii = [r for _, r in CELLS]
    light = ds.sel(zeta=LIGHT, method="nearest")
    damped, same = float(light.zeta), light.period.max() / light.period.min() - 1
    what = f"free half swing, r = {min(radii):g} to {max(radii):g} rad, DOP853"
    yield most(what, "pi/omega_d at any r", np.array(half) - 1, 1e-8)
    yield most("  the kernel's period, over all r", "the same", same, 1e-13, "largest spread")
    loses = f"viscous damping loses, zeta = {damped:.3g} [s/day]"
    yield compared(loses, "86400 zeta^2/2", DAY * light.slow[0], DAY / 2 * damped**2, 1e-3)


X = Log(r"viscous over solid friction, $x=\pi\zeta\theta_0/(2r)$ [1]", (1e-4, 1e4))


@panel(Log(r"viscous damping, $\zeta$ [1]"), Log(r"solid friction, $r/\theta_0$ [1]"))
@panel(X, Log(r"$\pi\zeta N$ [1]"), "lower right", borderaxespad=0.3, labelspacing=0.25)
@page(138.0, height_ratios=(1.4, 1))
def figure(plane, law, ds):
    """The count over both frictions, and its collapse on one law."""
    n = ds.N.transpose("r", "zeta")
    zeta, r = ds.zeta.values, ds.r.values / abs(float(ds.theta0))
    colour_map(plane, zeta, r, n, r"half swings until rest, $N$ [1]", norm=LogNorm(1, 1e4))
    contours(plane, zeta, r, n, [10, 100, 1000])
    hatch(plane, zeta, r, ds.creeps.transpose("r", "zeta").values, "////")
    plane.plot(zeta, math.pi * zeta / 2, color="white", linestyle=(0, (4, 2)), linewidth=0.9)
    plane.text(3e-2, 6e-2, r"$x=1$", color="white", fontsize=8, ha="right")
    direct_label(plane, 1.41, 9e-3, "creeps", fontsize=7.5, rotation=90)
    plane.set(xlim=(zeta[0], zeta[-1]), ylim=(r[0], r[-1]))
    x = np.geomspace(1e-4, 1e4, 200)
    law.plot(x, np.log1p(x), color="black", label=r"$\ln(1+x)$")
    for k, (text, zeta) in enumerate({"10^{-4}": 1e-4, "10^{-3}": 1e-3, "10^{-2}": 1e-2, "0.3": 0.3}.items()):
        row = ds.sel(zeta=zeta, method="nearest")
        row = row.isel(r=slice(None, None, 8))
        points(law, row.x, math.pi * row.zeta * row.N, k, rf"$\zeta={text}$")


main = script(__name__, "balance_ringdown.h5", claims, figure, scaled)
