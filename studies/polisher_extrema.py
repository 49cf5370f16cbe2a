"""How do middle and amplitude of a polishing arm go with the motor's eccentricity, and up to which does the motor turn?

    sweep run studies/polisher_extrema.toml
    python studies/polisher_extrema.py polisher_extrema.h5

draws polisher_extrema.png, the paper's figures 4, 6 and 7 in one, and compares its statements with what comes out.
b = (49, -38) cm has the length and makes the range of angles of the paper's figure 4, which does not give it.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Conclusion, compared, differing, most, read_result, said, script, solved
from _figures import columns_of, direct_label
from scipy.optimize import minimize_scalar

from kernels.interface import Status
from sweep.show.charts import COLOURS

SHOWN = (0.01, 0.05, 0.1, 0.15)
"""Eccentricities in m whose motion is drawn."""
LAST = 0.15
"""Where the paper's figures end, in m."""
B_ANGLE = math.atan2(-38.0, 49.0)

NOTES = """\
paper: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011); of figures 6 and 7 the text has the ticks only, 10
to 30 degree and 0.2, 0.4 rad; where "-" stands it says nothing, and the formula is named in the line. Allowed: 1e-12
of a formula, 1e-10 rad of an angle, 1.5 degree for "does not move"; "no, known" is a statement of the source that its
own equations refute; degrees of the crank count from b, against the clock which extreme moves: with the paper's own
equations for type A (upper signs) it is the minimum of alpha, and later. Its figure 4 has the maxima move to the
right: that is the same arm with alpha counted clockwise. In value both move.
"""


def at(ds: xr.Dataset, e: float) -> xr.Dataset:
    """The cell of one eccentricity [m]."""
    return ds.sel(e=e, method="nearest")


def degrees(x: Any) -> float:
    return math.degrees(float(x))


def swung(ds: xr.Dataset, e: float, sign: float) -> float:
    """The largest (sign 1) or least angle of the arm over a turn of the crank, by a search along the motion."""
    b, d, f = float(ds.b), float(ds.d), float(ds.f)

    def angle(crank: float) -> float:
        x, y = b + e * math.cos(crank), e * math.sin(crank)
        return math.atan2(y, x) + math.acos((x * x + y * y + d * d - f * f) / (2 * d * math.hypot(x, y)))

    turn = max(np.linspace(0.0, 2.0 * math.pi, 360), key=lambda crank: sign * angle(crank))
    found = minimize_scalar(lambda crank: -sign * angle(crank), bracket=(turn - 0.02, turn, turn + 0.02), tol=1e-8)
    return angle(found.x)


def aligned(ds: xr.Dataset) -> Any:
    """e x f over e f at both extremes: crank and coupler lie on one line there, the paper's theorem."""
    found = []
    for turn, eta in ((ds.theta_plus, ds.eta_plus), (ds.theta_minus, ds.eta_minus)):
        crank = ds.e * np.exp(1j * turn)
        coupler = ds.d * np.exp(1j * eta) - ds.b - crank
        found.append(((np.conj(crank) * coupler).imag / (ds.e * ds.f)).where(ds.e > 0))
    return xr.concat(found, "extreme")


def size(ds: xr.Dataset) -> Claims:
    """Amplitude and middle against e."""
    last, start, b, d, f = at(ds, LAST), ds.isel(e=0), float(ds.b), float(ds.d), float(ds.f)
    slope = f / (b * d * math.sin(float(start.A0)))
    middle = math.acos((b * b + d * d - f * f) / (2 * b * d))
    half = 0.5 * (swung(ds, LAST, 1.0) - swung(ds, LAST, -1.0))
    A1, fall = float(last.A1), degrees(start.A0 - last.A0)
    grown, first = A1 / (LAST * slope) - 1, f"A1/e at e -> 0 by f/(b d sin A0) = {slope / 100:.6f} rad/cm"
    full = ds.where(ds.status == Status.OK, drop=True)
    closure = float(abs(np.sin(full.A0) * np.sin(full.A1) * b * d - full.e * f).max()) / (b * d)
    beyond = 0.4 < A1 < 0.6 < 2 * half
    yield compared(first, "-", float(start.A1_e) / 100, slope / 100, 1e-12)
    yield said("A1 is proportional to e", 0.05 < grown < 0.2, f"{grown:+.1%} at 15 cm", "only nearly")
    yield differing("A1 at e = 15 cm by the motion's own extremes, rad", "-", A1, half, 1e-10, 5)
    yield said("  beyond the last tick, below the next", beyond, f"whole difference {2 * half:.3f}", "0.4")
    yield said("A0 is constant", fall > 1, f"falls {fall:.2f} degree to 15 cm", "only nearly")
    yield differing("A0 at e -> 0 by (39), degree", "-", degrees(start.A0), degrees(middle), 1e-8, 6)
    yield most("alignment: the extremes have e x f = 0, over e f", "0", aligned(full), 1e-9, "largest of both")
    yield said("sin A0 sin A1 = e f/(b d)", closure < 1e-14, f"off by {closure:.0e} at most", "-")


def times(ds: xr.Dataset) -> Claims:
    """When the extremes come, as crank angles."""
    paper, last, start = ds.sel(e=slice(0, LAST + 1e-6)), at(ds, LAST), ds.isel(e=0)
    plus = degrees(paper.theta_plus.max() - paper.theta_plus.min())
    minus = degrees(last.theta_minus - start.theta_minus)
    later = bool((paper.theta_minus.diff("e") > 0).all())
    up, down = degrees(last.eta_plus - start.eta_plus), degrees(start.eta_minus - last.eta_minus)
    maxima, here = degrees(last.theta_plus - start.theta_plus), f"{up:+.1f} and {-down:+.1f} degree"
    clockwise = "with alpha counted clockwise: maxima, the minima here"
    yield said("figure 4: maxima move to the right as e grows", maxima > 10, f"by {maxima:.1f} degree", "yes", True)
    yield said("figure 4: minima do not move", minus < 1.5, f"by {minus:.1f} degree", "yes", True)
    yield said(clockwise, later and minus > 10, f"{minus:.1f} degree", "yes")
    yield said("  minima, the maxima here, do not move", plus < 1.5, f"within {plus:.2f} degree", "yes")
    yield said("  in value both move", min(up, down) > 20, here, "-")


def border(ds: xr.Dataset) -> Claims:
    """Up to which eccentricity the motor turns."""
    limit, last = float(ds.d + ds.f - ds.b), at(ds, LAST)
    turns, flat, locked = (
        ds.where(ds.status == status, drop=True) for status in (Status.OK, Status.CHANGE_POINT, Status.LOCK_UP)
    )
    there, near, angle = flat.isel(e=0), turns.isel(e=-1), last.transmission_angle
    sharp = (turns.e < limit).all() and (locked.e > limit).all() and flat.e.size == 1
    cases = f"locks from {100 * float(locked.e[0]):.2f} cm on"
    text = f"{degrees(angle):.1f} at 15 cm, {degrees(near.transmission_angle):.2f} degree "
    text += f"{1e3 * (limit - float(near.e)):.1f} mm before"
    thd, what = float(last.thd), "angle of coupler and arm falls to 0 at the border"
    yield compared("largest e of a motor that turns, cm", "-", 100 * float(flat.e[0]), 100 * limit, 1e-12, 6)
    yield said("all smaller turn, all larger lock", sharp, cases, "-")
    yield differing("A0 = A1 there, degree", "-", degrees(there.A1), degrees(there.A0), 1e-5, 6)
    yield said(what, near.transmission_angle < 0.3 * angle, text, "-")
    yield said("harmonic motion", thd < 0.01, f"distortion {100 * thd:.1f} % at 15 cm", "held so elsewhere", True)


def figure(ds: xr.Dataset) -> Any:
    """alpha over a turn, A0 and A1 against e, with the border; for two columns of print."""
    dashed, first = {"linewidth": 0.9, "linestyle": (0, (4, 2))}, {"color": "0.5", "label": "first order in $e$"}
    with columns_of(88.0, {}, {"nrows": 2, "sharex": True}) as (page, _, (motion, middle, amplitude)):
        draw_motion(motion, ds, dashed)
        full = ds.where(ds.A0.notnull(), drop=True)
        middle.plot(100 * full.e, np.degrees(full.A0), color="black")
        middle.axhline(degrees(ds.A0[0]), **first, **dashed)
        middle.set(ylabel="middle, $A_0$ [degree]", ylim=(31, 41))
        amplitude.plot(100 * full.e, full.A1, color="black")
        amplitude.plot(100 * full.e, float(ds.A1_e[0]) * full.e, **first, **dashed)
        amplitude.set(xlabel="eccentricity, $e$ [cm]", ylabel="amplitude, $A_1$ [rad]", xlim=(0, 18), ylim=(0, 0.62))
        limit = 100 * float(ds.d + ds.f - ds.b)
        for axes in (middle, amplitude):  # where the motor locks, and where the paper ends
            axes.axvspan(limit, 18, facecolor="none", edgecolor="0.6", hatch="////", linewidth=0)
            axes.axvline(limit, color="0.45", linewidth=0.8)
            axes.axvline(100 * LAST, color="0.5", linewidth=0.8, linestyle=":", label="the paper ends")
            direct_label(axes, (limit + 18) / 2, sum(axes.get_ylim()) / 2, "motor locks", fontsize=7.5, rotation=90)
            axes.legend(fontsize=7, loc="best")
    return page


def draw_motion(axes: Any, ds: xr.Dataset, dashed: dict[str, Any]) -> None:
    """The arm's angle from the x axis over the crank's angle from b, with the path of the extremes."""
    turn = np.linspace(-180.0, 180.0, 721)
    machine = {name: float(ds[name]) for name in "bdf"} | {"omega": 1.0, "b_angle": B_ANGLE}
    along = {"crank_angle": np.linspace(B_ANGLE - math.pi, B_ANGLE + math.pi, 721)}
    motion = solved("polisher_motion", e=SHOWN, along=along, outputs=["alpha"], **machine)
    for k, e in enumerate(SHOWN):
        axes.plot(turn, motion.alpha.isel(e=k), color=COLOURS[k], label=f"{100 * e:g} cm")
    paper = ds.sel(e=slice(0, LAST + 1e-6))
    for end in ("plus", "minus"):
        axes.plot(np.degrees(paper[f"theta_{end}"]), paper[f"eta_{end}"] + B_ANGLE, color="black", **dashed)
    axes.set(xlabel="crank angle from $b$ [degree]", ylabel=r"angle of the arm, $\alpha$ [rad]", xlim=(-180, 180))
    axes.set_xticks(range(-180, 181, 90))
    axes.plot([], [], color="black", label="extremes", **dashed)
    axes.legend(title="eccentricity, $e$", loc="lower right")


def conclude(path: str) -> Conclusion:
    """Statements and the figure."""
    ds = read_result(path, "polisher", ["e"], "polisher_extrema.toml")
    groups = {"Size of the swing": size(ds), "Times of the extremes (figure 4)": times(ds), "The border": border(ds)}
    return groups, [NOTES], lambda: figure(ds)


main = script(__name__, "polisher_extrema.h5", conclude, "paper")
