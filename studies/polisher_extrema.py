"""How do middle and amplitude of a polishing arm go with the motor's eccentricity, and up to which does the motor turn?

    sweep run studies/polisher_extrema.toml
    python studies/polisher_extrema.py polisher_extrema.h5

draws polisher_extrema.png, the paper's figures 4, 6 and 7 in one, and prints its statements beside what comes out.
b = (49, -38) cm has the length and makes the range of angles of the paper's figure 4, which does not give it.
"""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, read_result, report

import sweep
from kernels.interface import Status
from sweep.show import charts
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


def turning(ds: xr.Dataset) -> xr.Dataset:
    """The cells whose crank turns."""
    return ds.where(ds.status == Status.OK, drop=True)


def at(ds: xr.Dataset, e: float) -> xr.Dataset:
    """The cell of one eccentricity [m]."""
    return ds.sel(e=e, method="nearest")


def degrees(x: Any) -> float:
    return math.degrees(float(x))


def swung(ds: xr.Dataset, e: float, sign: float) -> float:
    """The largest (sign 1) or least angle of the arm over a turn of the crank, by a search along the motion."""
    from scipy.optimize import minimize_scalar

    b, d, f = float(ds.b), float(ds.d), float(ds.f)

    def angle(crank: float) -> float:
        x, y = b + e * math.cos(crank), e * math.sin(crank)
        return math.atan2(y, x) + math.acos((x * x + y * y + d * d - f * f) / (2 * d * math.hypot(x, y)))

    turn = max(np.linspace(0.0, 2.0 * math.pi, 360), key=lambda crank: sign * angle(crank))
    found = minimize_scalar(lambda crank: -sign * angle(crank), bracket=(turn - 0.02, turn, turn + 0.02), tol=1e-8)
    return angle(found.x)


def size(ds: xr.Dataset) -> list[Statement]:
    """Amplitude and middle against e."""
    last, start = at(ds, LAST), ds.isel(e=0)
    b, d, f = float(ds.b), float(ds.d), float(ds.f)
    slope = f / (b * d * math.sin(float(start.A0)))
    middle = math.acos((b * b + d * d - f * f) / (2 * b * d))
    half = 0.5 * (swung(ds, LAST, 1.0) - swung(ds, LAST, -1.0))
    grown = float(last.A1) / (LAST * slope) - 1
    full = turning(ds)
    closure = float(abs(np.sin(full.A0) * np.sin(full.A1) * b * d - full.e * f).max()) / (b * d)
    return [
        compared(
            f"A1/e at e -> 0 by f/(b d sin A0) = {slope / 100:.6f} rad/cm", "-", float(start.A1_e) / 100, slope / 100,
            1e-12,
        ),
        Statement("A1 is proportional to e", "only nearly", f"{grown:+.1%} at 15 cm", None, 0.05 < grown < 0.2),
        differing("A1 at e = 15 cm by the motion's own extremes, rad", "-", float(last.A1), half, 1e-10, 5),
        Statement(
            "  beyond the last tick, below the next", "0.4", f"whole difference {2 * half:.3f}", None,
            bool(0.4 < float(last.A1) < 0.6 < 2 * half),
        ),
        Statement(
            "A0 is constant", "only nearly", f"falls {degrees(start.A0 - last.A0):.2f} degree to 15 cm", None,
            degrees(start.A0 - last.A0) > 1,
        ),
        differing("A0 at e -> 0 by (39), degree", "-", degrees(start.A0), degrees(middle), 1e-8, 6),
        Statement("sin A0 sin A1 = e f/(b d)", "-", f"off by {closure:.0e} at most", None, closure < 1e-14),
    ]  # fmt: skip


def times(ds: xr.Dataset) -> list[Statement]:
    """When the extremes come, as crank angles."""
    paper = ds.sel(e=slice(0, LAST + 1e-6))
    plus = degrees(paper.theta_plus.max() - paper.theta_plus.min())
    minus = degrees(at(ds, LAST).theta_minus - ds.theta_minus[0])
    later = bool((paper.theta_minus.diff("e") > 0).all())
    value = degrees(ds.eta_minus[0] - at(ds, LAST).eta_minus), degrees(at(ds, LAST).eta_plus - ds.eta_plus[0])
    maxima = degrees(at(ds, LAST).theta_plus - ds.theta_plus[0])
    return [
        Statement(
            "figure 4: maxima move to the right as e grows", "yes", f"by {maxima:.1f} degree", None, maxima > 10, True
        ),
        Statement("figure 4: minima do not move", "yes", f"by {minus:.1f} degree", None, minus < 1.5, True),
        Statement(
            "with alpha counted clockwise: maxima, the minima here", "yes", f"{minus:.1f} degree", None,
            later and minus > 10,
        ),
        Statement("  minima, the maxima here, do not move", "yes", f"within {plus:.2f} degree", None, plus < 1.5),
        Statement("  in value both move", "-", f"{value[1]:+.1f} and {-value[0]:+.1f} degree", None, min(value) > 20),
    ]  # fmt: skip


def border(ds: xr.Dataset) -> list[Statement]:
    """Up to which eccentricity the motor turns."""
    limit = float(ds.d + ds.f - ds.b)
    there = ds.where(ds.status == Status.CHANGE_POINT, drop=True).isel(e=0)
    locked = ds.e.where(ds.status == Status.LOCK_UP, drop=True)
    flat = ds.e.where(ds.status == Status.CHANGE_POINT, drop=True)
    full = turning(ds)
    near = full.isel(e=-1)
    return [
        compared("largest e of a motor that turns, cm", "-", 100 * float(flat[0]), 100 * limit, 1e-12, 6),
        Statement(
            "all smaller turn, all larger lock", "-", f"locks from {100 * float(locked[0]):.2f} cm on", None,
            bool((full.e < limit).all() and (locked > limit).all()) and flat.size == 1,
        ),
        differing("A0 = A1 there, degree", "-", degrees(there.A1), degrees(there.A0), 1e-5, 6),
        Statement(
            "angle of coupler and arm falls to 0 at the border", "-",
            f"{degrees(at(ds, LAST).transmission_angle):.1f} at 15 cm, {degrees(near.transmission_angle):.2f} degree "
            f"{1e3 * (limit - float(near.e)):.1f} mm before", None,
            bool(near.transmission_angle < 0.3 * at(ds, LAST).transmission_angle),
        ),
        Statement(
            "harmonic motion", "held so elsewhere", f"distortion {100 * float(at(ds, LAST).thd):.1f} % at 15 cm", None,
            float(at(ds, LAST).thd) < 0.01, True,
        ),
    ]  # fmt: skip


def statements(ds: xr.Dataset) -> Groups:
    """Every line of the table, by heading."""
    return {"Size of the swing": size(ds), "Times of the extremes (figure 4)": times(ds), "The border": border(ds)}


def motions(ds: xr.Dataset) -> xr.Dataset:
    """The arm's angle from the x axis over a turn, for the eccentricities shown."""
    study = sweep.study(
        kernel="polisher_motion",
        axes={"e": list(SHOWN)},
        fixed={name: float(ds[name]) for name in "bdf"} | {"omega": 1.0, "b_angle": B_ANGLE},
        along={"crank_angle": np.linspace(B_ANGLE - math.pi, B_ANGLE + math.pi, 721)},
        outputs=["alpha"],
    )
    return sweep.run(study)


def figure(ds: xr.Dataset) -> Any:
    """alpha over a turn, A0 and A1 against e, with the border; for two columns of print."""
    with charts.style():
        page = charts.new_figure(charts.PAGE, 88.0)
        left, right = page.subfigures(1, 2, width_ratios=(1.12, 1))
        whole = left.subplots()
        upper, lower = right.subplots(2, 1, sharex=True)
        draw_motion(whole, ds)
        draw_middle(upper, ds)
        draw_amplitude(lower, ds)
        for axes, text in ((whole, "a"), (upper, "b"), (lower, "c")):
            charts.letter(axes, text)
    return page


def draw_motion(axes: Any, ds: xr.Dataset) -> None:
    """The paper's figure 4 over the crank's angle from b, with the path of the extremes."""
    motion = motions(ds)
    turn = np.degrees(motion.crank_angle.values - B_ANGLE)
    for k, e in enumerate(SHOWN):
        axes.plot(turn, motion.alpha.isel(e=k), color=COLOURS[k], label=f"{100 * e:g} cm")
    paper = ds.sel(e=slice(0, LAST + 1e-6))
    for theta, eta in (("theta_plus", "eta_plus"), ("theta_minus", "eta_minus")):
        axes.plot(np.degrees(paper[theta]), paper[eta] + B_ANGLE, color="black", linewidth=0.9, linestyle=(0, (4, 2)))
    axes.set(xlabel="crank angle from $b$ [degree]", ylabel=r"angle of the arm, $\alpha$ [rad]", xlim=(-180, 180))
    axes.set_xticks(range(-180, 181, 90))
    axes.plot([], [], color="black", linewidth=0.9, linestyle=(0, (4, 2)), label="extremes")
    axes.legend(title="eccentricity, $e$", loc="lower right")


def draw_middle(axes: Any, ds: xr.Dataset) -> None:
    """The paper's figure 6."""
    full = ds.where(ds.A0.notnull(), drop=True)
    axes.plot(100 * full.e, np.degrees(full.A0), color="black")
    axes.axhline(degrees(ds.A0[0]), color="0.5", linestyle=(0, (4, 2)), linewidth=0.9, label="first order in $e$")
    axes.set(ylabel="middle, $A_0$ [degree]", ylim=(31, 41))
    _locked(axes, ds)


def draw_amplitude(axes: Any, ds: xr.Dataset) -> None:
    """The paper's figure 7, with the tangent at e = 0."""
    full = ds.where(ds.A1.notnull(), drop=True)
    axes.plot(100 * full.e, full.A1, color="black")
    tangent = {"color": "0.5", "linestyle": (0, (4, 2)), "linewidth": 0.9, "label": "first order in $e$"}
    axes.plot(100 * full.e, float(ds.A1_e[0]) * full.e, **tangent)
    axes.set(xlabel="eccentricity, $e$ [cm]", ylabel="amplitude, $A_1$ [rad]", xlim=(0, 18), ylim=(0, 0.62))
    _locked(axes, ds)


def _locked(axes: Any, ds: xr.Dataset) -> None:
    """Hatches the eccentricities at which the motor locks, and marks where the paper ends."""
    limit = 100 * float(ds.d + ds.f - ds.b)
    axes.axvspan(limit, 18, facecolor="none", edgecolor="0.6", hatch="////", linewidth=0)
    axes.axvline(limit, color="0.45", linewidth=0.8)
    axes.axvline(100 * LAST, color="0.5", linewidth=0.8, linestyle=":", label="the paper ends")
    middle = sum(axes.get_ylim()) / 2
    direct_label(axes, (limit + 18) / 2, middle, "motor locks", fontsize=7.5, rotation=90)
    axes.legend(fontsize=7, loc="best")


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read_result(path, "polisher", ["e"], "polisher_extrema.toml")
    return statements(ds), [NOTES], lambda: figure(ds)


main = partial(report, __file__, ["polisher_extrema.h5"], conclude=conclude, source="paper")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
