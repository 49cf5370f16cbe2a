"""Does the reduction of a milling machine's drive move the speeds and cuts at which it chatters?

    sweep run studies/chatter_lobes.toml
    python studies/chatter_lobes.py chatter_lobes.h5

draws chatter_lobes.png and prints theory beside what comes out. A tooth cuts what the tooth before it left, a time tau
ago, so the cut's torque at the spindle is -K (theta(t) - theta(t - tau)), and with the spindle's receptance H

    1 + K (1 - exp(-i w tau)) H(w) = 0                                                                  (1)

is the border of stability. With Tobias and Tlusty: K = -1/(2 Re H), wherever Re H < 0, at the tooth frequencies
1/tau = f/(k + eps), k = 0, 1, ..., eps = atan2(-Re H, Im H)/pi. A cut is stable below the lowest of these lobes. Of one
mode of stiffness c and damping zeta alone the least K is 2 c zeta (1 + zeta).
"""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, direct_label, page_of, plain_ticks, read_result, report
from fula_milling_machine import receptance

import sweep
from sweep.show.charts import COLOURS

FREQUENCIES = np.concatenate([np.geomspace(15, 60, 6001), np.geomspace(60, 3000, 12001)[1:]])
"""Where H is taken [Hz]."""
TEETH = np.geomspace(2.0, 1000.0, 6001)
"""Tooth frequencies of the border [Hz]."""
LOBES = 40
SPAN = 1000 / (2 * math.pi)
"""1000 rad/s in Hz, up to which the source calls five masses good."""
HELD = 0.05

LEAST = {8: (536.3851607, 248658.0543), 5: (535.0468402, 172129.8010)}
"""Least K [N m/rad] of the lobes of the main mode and of the fifth, of eight and five masses, once in 50 digits."""
COUNTED = (5.3, 13.0, 24.0, 30.0, 90.0, 300.0)
"""Tooth frequencies [Hz] at which roots are counted on both sides of the border."""
TURNS, CUTTER = 3.0, 8
"""Turns of the spindle a second in the source, 180 a minute; teeth of a cutter, chosen here."""

NOTES = """\
tooth frequency: teeth of the cutter times its turns a second; K in N m/rad; the border is the lowest of all lobes
allowed: 1e-9 in (1), where H is found once more by the script; 1e-5 of the least K had to 50 digits, of which the grid
of frequencies takes 1e-6; 1 % and 5 % of K where the reduction is said to hold it. Roots are counted 1 % below and
above the border, by the turns of the left side of (1) about 0 (Nyquist): none below, two or more above\
"""


def chains(ds: xr.Dataset) -> dict[int, dict[str, np.ndarray]]:
    """J, k and h of each chain, by its number of masses."""
    return {
        int(n): {name: ds[f"{name}_kept"].sel(n_keep=n).values[: int(n)] for name in "Jkh"} for n in ds.n_keep.values
    }


def spindle(chain: dict[str, np.ndarray]) -> np.ndarray:
    """Receptance of the spindle at `FREQUENCIES` [rad/(N m)]."""
    study = sweep.study(
        kernel="drivetrain_frf", axes={"drive_mass": [1]}, fixed={name: list(v) for name, v in chain.items()},
        along={"frequency": FREQUENCIES}, outputs=["receptance_re", "receptance_im"], rtol=1e-12,
    )  # fmt: skip
    made = sweep.run(study).isel(drive_mass=0)
    return made.receptance_re.values + 1j * made.receptance_im.values


def lobe(H: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Tooth frequency [Hz] and K of lobe k at `FREQUENCIES`; NaN where Re H >= 0."""
    there = np.where(H.real < 0, H, np.nan)
    eps = np.arctan2(-there.real, there.imag) / np.pi
    return FREQUENCIES / (k + eps), -0.5 / there.real


def border(H: np.ndarray) -> np.ndarray:
    """The least K over all lobes, at `TEETH`. A lobe that turns back counts with each of its branches."""
    least = np.full(TEETH.shape, math.inf)
    for k in range(LOBES):
        x, K = (v[H.real < 0] for v in lobe(H, k))
        turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
        for first, last in zip([0, *turns], [*turns, len(x) - 1], strict=True):
            branch = slice(first, last + 1)
            way = np.argsort(x[branch])
            found = np.interp(TEETH, x[branch][way], K[branch][way], left=math.inf, right=math.inf)
            least = np.minimum(least, found)
    return least


def own(chain: dict[str, np.ndarray], f: np.ndarray) -> np.ndarray:
    """Receptance of the spindle by the script, spring by spring from the ground."""
    w = 2 * np.pi * f
    return receptance(chain["J"], chain["k"][:, None] + 1j * w * chain["h"][:, None], w)


def unstable_roots(chain: dict[str, np.ndarray], tooth: float, K: float) -> int:
    """Roots of (1) to the right of the imaginary axis: half turns of its left side about 0, clockwise."""
    f = np.linspace(0.0, 3000.0, 60001)
    left = 1 + K * (1 - np.exp(-2j * np.pi * f / tooth)) * own(chain, f)
    return round(-float(np.angle(left[1:] / left[:-1]).sum()) / math.pi)


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """H over (n_keep, f), the border over (n_keep, tooth), and K over f."""
    H = np.array([spindle(chain) for chain in chains(ds).values()])
    made = {
        "H": (("n_keep", "f"), H),
        "border": (("n_keep", "tooth"), np.array([border(row) for row in H])),
        "K": (("n_keep", "f"), -0.5 / np.where(H.real < 0, H.real, np.nan)),
    }
    return ds.assign_coords(f=FREQUENCIES, tooth=TEETH).assign(made)


def whole_chain(ds: xr.Dataset) -> list[Statement]:
    """The least K, and whether the lobes are the border of stability."""
    breach, below, above = 0.0, 0, 99
    for n, chain in chains(ds).items():
        H = ds.H.sel(n_keep=n).values
        there = H.real < 0
        true = own(chain, FREQUENCIES[there])
        for k in (0, 1, 7):
            tooth, K = (v[there] for v in lobe(H, k))
            left = 1 + K * (1 - np.exp(-2j * np.pi * FREQUENCIES[there] / tooth)) * true
            breach = max(breach, float(abs(left).max()))
        for tooth in COUNTED:
            K = float(np.interp(tooth, TEETH, ds.border.sel(n_keep=n)))
            below = max(below, unstable_roots(chain, tooth, 0.99 * K))
            above = min(above, unstable_roots(chain, tooth, 1.01 * K))
    cells = f"{ds.n_keep.size} chains, {len(COUNTED)} tooth frequencies"
    lines = [
        compared(f"least K, {n} masses: {name}", f"{K:.6g}", least(ds, n, band)[1], K, 1e-5, 7)
        for n, known in LEAST.items() for name, K, band in zip(("main mode", "fifth mode"), known, BANDS, strict=True)
    ]  # fmt: skip
    return [
        *lines,
        one_mode(ds),
        Statement("(1) on the lobes, H by the script", "0", "largest breach", breach, breach < 1e-9),
        Statement("roots to the right, 1 % below the border", "none", f"{below}; {cells}", None, below == 0),
        Statement("  1 % above it", "2 or more", f"{above} at least", None, above >= 2),
    ]


def one_mode(ds: xr.Dataset) -> Statement:
    """The rule of a single mode, for the main one: its neighbour at 10.6 Hz is too near."""
    chain = chains(ds)[8]
    J, k = chain["J"], chain["k"]
    springs = np.diag(k + np.concatenate([[0.0], k[:-1]])) - np.diag(k[:-1], 1) - np.diag(k[:-1], -1)
    squares, shapes = np.linalg.eigh(springs / np.sqrt(np.outer(J, J)))
    stiffness = float(squares[1] / (shapes[0, 1] ** 2 / J[0]))
    zeta = float(ds.damping.sel(n_keep=8)[1])
    rule = 2 * stiffness * zeta * (1 + zeta)
    off = rule / LEAST[8][0] - 1
    what = "  main mode alone, 2 c zeta (1 + zeta)"
    return Statement(what, f"beyond 5 % of {LEAST[8][0]:.6g}", f"{rule:.4g}", off, abs(off) > 0.05)


BANDS = ((15.0, 60.0), (150.0, 300.0))
"""Where the main and the fifth mode chatter [Hz]."""


def least(ds: xr.Dataset, n: int, band: tuple[float, float]) -> tuple[float, float]:
    """Frequency [Hz] and K [N m/rad] of the lobes' lowest point in a band; a lobe of the fifth mode is a minimum."""
    part = ds.K.sel(n_keep=n, f=slice(*band))
    inner = part.isel(f=slice(1, -1))
    low = (inner.values <= part.values[:-2]) & (inner.values <= part.values[2:])
    there = inner.where(xr.DataArray(low, dims="f"), math.inf)
    i = int(there.argmin("f"))
    return float(there.f[i]), float(there[i])


def moved(ds: xr.Dataset) -> list[Statement]:
    """What five masses make of the lobes of eight."""
    (f8, K8), (f5, K5) = (least(ds, n, BANDS[0]) for n in (8, 5))
    off = ds.border.sel(n_keep=5) / ds.border.sel(n_keep=8) - 1
    used = off.where(off.tooth <= SPAN, drop=True)
    worst = used.isel(tooth=int(abs(used).argmax("tooth")))
    here = off.interp(tooth=CUTTER * TURNS)
    (g8, M8), (g5, M5) = (least(ds, n, BANDS[1]) for n in (8, 5))
    high = ds.border.sel(n_keep=8)
    reached = float(high.tooth[int((high > min(M5, M8)).argmax("tooth"))])
    return [
        Statement("least K: five masses against eight", "< 1 %", f"{K5 / K8 - 1:+.2%}", None, abs(K5 / K8 - 1) < 0.01),
        Statement("  tooth frequencies of the lobes", "< 1 %", f"{f5 / f8 - 1:+.2%}", None, abs(f5 / f8 - 1) < 0.01),
        Statement(f"border at 180 rev/min, {CUTTER} teeth", "< 1 %", f"{float(here):+.2%}", None, abs(here) < 0.01),
        Statement("border, tooth frequencies of 2 to 159 Hz", "< 5 %",
                  f"{float(worst):+.1%} at most, at {float(worst.tooth):.1f} Hz", None, bool(abs(worst) < HELD)),
        Statement("lobes of the fifth mode: K, frequency", "> 5 %", f"{M5 / M8 - 1:+.1%}, {g5 / g8 - 1:+.1%}", None,
                  abs(M5 / M8 - 1) > HELD),
        Statement("  of which tooth frequencies below these see nothing", "159 Hz", f"{reached:.0f} Hz", None,
                  reached > 2 * SPAN),
        *by_masses(ds),
    ]  # fmt: skip


def held(ds: xr.Dataset, n: int) -> float:
    """Tooth frequency [Hz] from 2 Hz up to which n masses hold the border to `HELD`; 0 if not at all."""
    off = abs(ds.border.sel(n_keep=n) / ds.border.sel(n_keep=8) - 1) > HELD
    first = int(off.argmax("tooth"))
    return float(off.tooth[first - 1]) if first else 0.0 if bool(off[0]) else float(off.tooth[-1])


def by_masses(ds: xr.Dataset) -> list[Statement]:
    """How far each chain holds the border."""
    reach = [held(ds, n) for n in (7, 6, 5, 4)]
    told = ", ".join(f"{n}: {x:.0f} Hz" for n, x in zip((7, 6, 5, 4), reach, strict=True))
    falls = bool((np.diff(reach) < 0).all())
    return [Statement("border held to 5 % up to a tooth frequency of, by masses", "more with more", told, None, falls)]


def figure(ds: xr.Dataset) -> Any:
    """-Re H, the lobes at usual and at high tooth frequencies, and what the reductions do; for two columns of print."""
    with page_of(118.0, 2, 2) as (page, ((real, usual), (high, error))):
        draw_real(real, ds)
        draw_usual(usual, ds)
        draw_high(high, ds)
        draw_error(error, ds)
    return page


LOOK = {8: ("-", 0), 7: ("-", 2), 6: ((0, (6, 1.5, 1.2, 1.5)), 3), 5: ((0, (5, 1.5)), 1), 4: ((0, (1.2, 1.2)), 4)}
"""Dashes and colour of a chain, by its masses."""


def draw_line(axes: Any, x: Any, y: Any, n: int) -> None:
    """The line of a chain of n masses."""
    dashes, colour = LOOK[n]
    axes.plot(x, y, color=COLOURS[colour], linestyle=dashes, label=f"{n} masses")


def draw_real(axes: Any, ds: xr.Dataset) -> None:
    """What limits a cut: the negative real part."""
    for n in (8, 5, 4):
        draw_line(axes, ds.f, 0.5e6 / ds.K.sel(n_keep=n), n)
    axes.set(xscale="log", yscale="log", xlabel="chatter frequency, $f$ [Hz]", xlim=(18, 600), ylim=(0.5, 2000))
    axes.set_ylabel(r"$-\mathrm{Re}\,H$ [$10^{-6}$ rad/(N m)]")
    plain_ticks(axes.xaxis, (20, 50, 100, 200, 500))
    axes.legend(loc="upper right")


def draw_usual(axes: Any, ds: xr.Dataset) -> None:
    """The lowest of all lobes, with the number of roots to the right on both sides of it."""
    for n in (8, 5, 4):
        draw_line(axes, ds.tooth, ds.border.sel(n_keep=n), n)
    look = {"color": "black", "linestyle": "", "markersize": 4}
    chain = chains(ds)[8]
    for tooth in COUNTED[:4]:
        for share in (0.8, 1.25):
            K = share * float(ds.border.sel(n_keep=8).interp(tooth=tooth))
            unstable = unstable_roots(chain, tooth, K) > 0
            axes.plot(tooth, K, "o", markerfacecolor="black" if unstable else "white", **look)
    axes.plot([], [], "o", markerfacecolor="white", label="no root to the right", **look)
    axes.plot([], [], "o", label="two", **look)
    axes.axvline(CUTTER * TURNS, color="0.5", linewidth=0.7)
    direct_label(axes, CUTTER * TURNS, 2300, "180 rev/min,\n8 teeth", fontsize=7, ha="left")
    axes.set(xscale="log", yscale="log", xlim=(2, 60), ylim=(350, 9000), xlabel="tooth frequency [Hz]")
    axes.set_ylabel("torque by thickness, $K$ [N m/rad]")
    plain_ticks(axes.xaxis, (2, 5, 10, 20, 50))
    plain_ticks(axes.yaxis, (500, 1000, 2000, 5000))
    axes.legend(loc="upper left", fontsize=7, ncols=2)


def draw_high(axes: Any, ds: xr.Dataset) -> None:
    """The border over the square of the tooth frequency, where it is nearly that of the spindle's inertia alone."""
    for n in (8, 5, 4):
        draw_line(axes, ds.tooth, ds.border.sel(n_keep=n) / ds.tooth**2, n)
    axes.axvline(SPAN, color="0.5", linewidth=0.7)
    direct_label(axes, SPAN, 1.9, "1000 rad/s", fontsize=7)
    axes.set(xscale="log", xlim=(100, 1000), ylim=(0.9, 2.0), xlabel="tooth frequency, $1/\\tau$ [Hz]")
    axes.set_ylabel(r"$K\tau^2$ [N m s$^2$/rad]")
    plain_ticks(axes.xaxis, (100, 200, 500, 1000))
    axes.legend(loc="upper right", fontsize=7)


def draw_error(axes: Any, ds: xr.Dataset) -> None:
    """How far the border is moved."""
    for n in (7, 6, 5, 4):
        draw_line(axes, ds.tooth, 100 * (ds.border.sel(n_keep=n) / ds.border.sel(n_keep=8) - 1), n)
    axes.axhspan(-100 * HELD, 100 * HELD, color="0.92", linewidth=0, zorder=0, label="5 %")
    axes.axvline(SPAN, color="0.5", linewidth=0.7)
    axes.set(xscale="log", xlim=(2, 1000), ylim=(-25, 25), xlabel="tooth frequency [Hz]")
    axes.set_ylabel("border moved by [%]")
    plain_ticks(axes.xaxis, (2, 5, 10, 20, 50, 100, 200, 500, 1000))
    axes.legend(loc="upper left", fontsize=7, ncols=2)


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = prepared(read_result(path, "drivetrain", ["n_keep"], "chatter_lobes.toml"))
    groups = {"Lobes of the chains": whole_chain(ds), "What the reduction moves": moved(ds)}
    return groups, [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["chatter_lobes.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
