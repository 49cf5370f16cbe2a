"""Does the reduction of a milling machine's drive move the speeds and cuts at which it chatters?

    python studies/chatter_lobes.py chatter_lobes.h5

A tooth cuts what the tooth before it left, a time tau ago, so the cut's torque at the spindle is -K
(theta(t) - theta(t - tau)), and with the spindle's receptance H

    1 + K (1 - exp(-i w tau)) H(w) = 0                                                                  (1)

is the border of stability. With Tobias and Tlusty: K = -1/(2 Re H), wherever Re H < 0, at the tooth frequencies
1/tau = f/(k + eps), k = 0, 1, ..., eps = atan2(-Re H, Im H)/pi. A cut is stable below the lowest of these lobes.

The tooth frequency is the number of teeth of the cutter times its turns a second, K is in N m/rad, and the border is
the lowest of all lobes. Of the least K, had to 50 digits, the grid of frequencies takes 1e-6. Roots are counted 1 %
below and above the border, by the turns of the left side of (1) about 0 (Nyquist): none below, two or more above.
"""

import math

import numpy as np
import xarray as xr
from _common import Claims, compared, held, most, said, script, solved
from _figures import COLOURS, Axis, Log, direct_label, page, panel
from fula_milling_machine import SPAN, chain, response
from scipy.signal import find_peaks

FREQUENCIES = np.concatenate([np.geomspace(15, 60, 6001), np.geomspace(60, 3000, 12001)[1:]])
"""Where H is taken [Hz]."""
TEETH = np.geomspace(2.0, 1000.0, 6001)
"""Tooth frequencies of the border [Hz]."""
HELD = 0.05
LEAST = {8: (536.3851607, 248658.0543), 5: (535.0468402, 172129.8010)}
"""Least K [N m/rad] of the lobes of the main mode and of the fifth, of eight and five masses, once in 50 digits."""
BANDS = {"main mode": (15.0, 60.0), "fifth mode": (150.0, 300.0)}
"""Where these modes chatter [Hz]."""
TURNS, CUTTER = 3.0, 8
"""Turns of the spindle a second in the source, 180 a minute; teeth of a cutter, chosen here."""
LOOK = {8: ("-", 0), 7: ("-", 2), 6: ((0, (6, 1.5, 1.2, 1.5)), 3), 5: ((0, (5, 1.5)), 1), 4: ((0, (1.2, 1.2)), 4)}
"""Dashes and colour of a chain, by its masses."""


def lobe(H: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Tooth frequency [Hz] and K of lobe k at `FREQUENCIES`; NaN where Re H >= 0."""
    there = np.where(H.real < 0, H, np.nan)
    eps = np.arctan2(-there.real, there.imag) / np.pi
    return FREQUENCIES / (k + eps), -0.5 / there.real


def border(H: np.ndarray) -> np.ndarray:
    """The least K over 40 lobes, at `TEETH`. A lobe that turns back counts with each of its branches."""
    lowest = np.full(TEETH.shape, math.inf)
    for k in range(40):
        x, K = (v[H.real < 0] for v in lobe(H, k))
        turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
        for first, last in zip([0, *turns], [*turns, len(x) - 1], strict=True):
            branch = slice(first, last + 1)
            way = np.argsort(x[branch])
            found = np.interp(TEETH, x[branch][way], K[branch][way], left=math.inf, right=math.inf)
            lowest = np.minimum(lowest, found)
    return lowest


def prepared(ds: xr.Dataset) -> xr.Dataset:
    """H [rad/(N m)] over (n_keep, f) by the kernel, the border over (n_keep, tooth), and K over f."""
    asked = {"design": "zip", "along": {"frequency": FREQUENCIES}, "rtol": 1e-12, "drive_mass": [1]}
    rows = []
    for n in ds.n_keep.values:
        cell = {name: values[None] for name, values in chain(ds, n).items()}
        made = solved("drivetrain_frf", outputs=["receptance_re", "receptance_im"], **asked, **cell)
        rows.append((made.receptance_re + 1j * made.receptance_im).values[0])
    H = xr.DataArray(rows, dims=("n_keep", "f"))
    lowest = ("n_keep", "tooth"), np.array([border(row) for row in rows])
    return ds.assign_coords(f=FREQUENCIES, tooth=TEETH).assign(H=H, border=lowest, K=-0.5 / H.real.where(H.real < 0))


def unstable_roots(of: dict[str, np.ndarray], tooth: float, K: float) -> int:
    """Roots of (1) to the right of the imaginary axis: half turns of its left side about 0, clockwise.

    H is by the script, spring by spring from the ground.
    """
    f = np.linspace(0.0, 3000.0, 60001)
    left = 1 + K * (1 - np.exp(-2j * np.pi * f / tooth)) * response(of, f)
    return round(-float(np.angle(left[1:] / left[:-1]).sum()) / math.pi)


def least(ds: xr.Dataset, n: int, mode: str) -> tuple[float, float]:
    """Frequency [Hz] and K [N m/rad] of the lobes' lowest point in a band; a lobe of the fifth mode is a minimum."""
    part = ds.K.sel(n_keep=n, f=slice(*BANDS[mode])).dropna("f")
    low = part.isel(f=find_peaks(-part.values)[0])
    best = low.isel(f=int(low.argmin("f")))
    return float(best.f), float(best)


def claims(ds) -> Claims:
    yield "Lobes of the chains"
    for n, known in LEAST.items():
        for mode, K in zip(BANDS, known, strict=True):
            yield compared(f"least K, {n} masses: {mode}", f"{K:.6g}", least(ds, n, mode)[1], K, 1e-5)
    roots = {0.99: [], 1.01: []}
    for n in ds.n_keep.values:
        edge = ds.border.sel(n_keep=n).interp(tooth=[5.3, 13.0, 24.0, 30.0, 90.0, 300.0])
        for part, found in roots.items():
            found += [unstable_roots(chain(ds, n), float(K.tooth), part * float(K)) for K in edge]
    yield held(f"roots to the right, 1 % below the border, {len(roots[0.99])} places", max(roots[0.99]), "0", "{:.0f}")
    yield held("  1 % above it", min(roots[1.01]), ">= 2", "{:.0f} at least")

    yield "What the reduction moves"
    (f8, K8), (f5, K5) = (least(ds, n, "main mode") for n in (8, 5))
    (g8, M8), (g5, M5) = (least(ds, n, "fifth mode") for n in (8, 5))
    off = ds.border / ds.border.sel(n_keep=8) - 1
    five = off.sel(n_keep=5, tooth=slice(None, SPAN))
    usual, worst = five.interp(tooth=CUTTER * TURNS), five.isel(abs(five).argmax(...))
    reached = ds.tooth[int((ds.border.sel(n_keep=8) > min(M5, M8)).argmax("tooth"))]
    yield most("least K: five masses against eight", "0", K5 / K8 - 1, 0.01, "moved by")
    yield most("  tooth frequencies of the lobes", "0", f5 / f8 - 1, 0.01, "moved by")
    yield most(f"border at 180 rev/min, {CUTTER} teeth", "0", usual, 0.01, "moved by")
    yield most("border, tooth frequencies of 2 to 159 Hz", "0", worst, HELD, f"at {float(worst.tooth):.1f} Hz")
    here = f"{{:.1%}}, frequency {g5 / g8 - 1:+.1%}"
    yield held("lobes of the fifth mode: K moved by", abs(M5 / M8 - 1), f"> {HELD:.0%}", here)
    yield held("  of which teeth slower than these see nothing [Hz]", reached, f"> {2 * SPAN:.0f}", "{:.0f}")
    # tooth frequency from 2 Hz up to which a chain holds the border to HELD; 0 if not at all
    late = (abs(off.sel(n_keep=[7, 6, 5, 4])) > HELD).pad(tooth=(0, 1), constant_values=True)
    reach = [float(TEETH[first - 1]) if first else 0.0 for first in late.argmax("tooth").values]
    text, falls = ", ".join(f"{n}: {x:.0f} Hz" for n, x in zip((7, 6, 5, 4), reach, strict=True)), np.diff(reach) < 0
    yield said("border held to 5 % up to a tooth frequency of, by masses", falls.all(), text, "more with more")


TOOTH, TICKS = "tooth frequency [Hz]", (2, 5, 10, 20, 50, 100, 200, 500, 1000)
K_AXIS = Log("torque by thickness, $K$ [N m/rad]", (350, 9000), (500, 1000, 2000, 5000))


@panel(Log(TOOTH, (2, 60), TICKS), K_AXIS, "upper left", ncols=2)
@panel(Log(TOOTH, (2, 1000), TICKS), Axis("border moved by [%]", (-25, 25)), "upper left", ncols=2)
@page(140.0)
def figure(usual, error, ds):
    """The lobes at usual tooth frequencies, and by how much the reductions move the border."""
    moved_by = 100 * (ds.border / ds.border.sel(n_keep=8) - 1)
    for axes, lines, chains in ((usual, ds.border, (8, 5, 4)), (error, moved_by, (7, 6, 5, 4))):
        for n in chains:
            dashes, colour = LOOK[n]
            axes.plot(ds.tooth, lines.sel(n_keep=n), label=f"{n} masses", color=COLOURS[colour], linestyle=dashes)
    usual.axvline(CUTTER * TURNS, color="0.5", linewidth=0.7)
    direct_label(usual, CUTTER * TURNS, 4300, "180 rev/min,\n8 teeth", ha="left")
    error.axhspan(-100 * HELD, 100 * HELD, color="0.92", linewidth=0, zorder=0, label="5 %")
    error.axvline(SPAN, color="0.5", linewidth=0.7)
    direct_label(error, SPAN, -20, "1000 rad/s")


main = script(__name__, "chatter_lobes.h5", claims, figure, prepared)
