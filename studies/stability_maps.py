"""Where does each integrator grow, decay, or miss a switch, and does it say so?

    sweep run studies/stability_maps.toml
    sweep run studies/stability_maps_oscillator.toml --allow-import
    python studies/stability_maps.py stability_maps.h5 stability_maps_oscillator.h5

draws stability_maps.png. The first sweep is of a foliot's first flips from rest, a step h against its drive; truth is
the kernel foliot_start. The second is of a damped oscillator x'' = -a x' - w^2 x, which a method makes grow where the
largest eigenvalue of its step exceeds 1: for Runge-Kutta methods that is abs(R(z)), z the scene's eigenvalues times h,
R the series of exp to the order, with one term more for Dormand-Prince. Of semi-implicit Euler and Verlet it is that of
a 2 by 2 matrix.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, direct_label, read_result, report

import sweep
from kernels.interface import FIRST_REFUSAL, Field, Status
from kernels.stepping import stepped_kernel

STEPS = 64
"""Of the oscillator, after which it is seen whether it has grown."""
WRONG = 0.1
"""Relative error of a period from which on it is no measurement any more: a switch missed, or found too soon."""


def rates(angle, speed, clock, pace, a, w):
    return speed, -a * speed - w * w * angle, pace, 0.0


def surface(clock, end):
    return end - clock


def start():
    return 1.0, 0.0, 0.0, 1.0


KERNEL = stepped_kernel(
    name="oscillator_steps",
    doc="damped oscillator at a fixed step, followed for a time",
    states=(
        Field("angle", "rad", "angle at the end"),
        Field("speed", "rad/s", "speed at the end"),
        Field("clock", "s", "time by the clock"),
        Field("pace", "1", "of the clock"),
    ),
    parameters=(
        Field("a", "1/s", "damping per moment of inertia", lower=0.0),
        Field("w", "rad/s", "angular frequency without damping", lower=0.0),
        Field("end", "s", "time to follow it", lower=0.0, open_lower=True),
    ),
    rates=rates,
    surface=surface,
    start=start,
    source="the linear test equation, Hairer & Wanner, Solving ODEs II, section IV.2",
    example={"a": 0.1, "w": 1.0, "end": 6.35, "flips": 1.0, "step": 0.1, "location": 0.0},
)

CASES = {
    "weak drive": {"mu": 1e-3, "a": 1.0},
    "dry friction, mu near R": {"mu": 1.0, "R": 0.99, "a": 0.1},
    "strong drag": {"mu": 1.0, "a": 30.0, "c": 30.0},
    "hairspring resonance": {"mu": 1.0, "a": 0.1, "k": 30.0},
    "near-grazing overshoot": {"mu": 1.0, "a": 0.1, "k": 1.8},
}
"""Hard foliots, of phi0 = 1 rad."""

NOTES = """\
theory: the largest eigenvalue of one step of the linear oscillator; stated: what a method gives as its error
truth: kernel foliot_start. A value is wrong in silence if it is off by more than ten times the larger of 1e-9
and what is stated\
"""


def taylor(z: Any, order: int) -> Any:
    """exp(z) to that order."""
    total, term = np.ones_like(z), np.ones_like(z)
    for n in range(1, order + 1):
        term = term * z / n
        total = total + term
    return total


def eigenvalue(method: str, ah: Any, wh: Any) -> Any:
    """Modulus of the largest eigenvalue of a step, by theory; NaN for methods whose theory is not told here."""
    ah, wh = np.broadcast_arrays(ah, wh)
    root = np.sqrt((ah**2 / 4 - wh**2).astype(complex))
    z = np.stack([-ah / 2 + root, -ah / 2 - root])
    if method in ("euler", "rk4"):
        return abs(taylor(z, {"euler": 1, "rk4": 4}[method])).max(axis=0)
    if method == "dopri5":
        return abs(taylor(z, 5) + z**6 / 600).max(axis=0)
    if method == "semi_implicit":
        trace, product = 2 - ah - wh**2, 1 - ah
    elif method == "verlet":  # (x, v h) -> x1 = x + v - (w^2 x + a v)/2, v1 = v - (f0 + w^2 x1 + a (v - f0))/2
        m11, m12 = 1 - wh**2 / 2, 1 - ah / 2
        m21 = -(wh**2 + wh**2 * m11 - ah * wh**2) / 2
        m22 = 1 - (ah + wh**2 * m12 + ah * (1 - ah)) / 2
        trace, product = m11 + m22, m11 * m22 - m12 * m21
    else:
        return np.full(ah.shape, np.nan)
    part = np.sqrt((trace**2 / 4 - product).astype(complex))
    return abs(np.stack([trace / 2 + part, trace / 2 - part])).max(axis=0)


def grown(ds: xr.Dataset) -> xr.DataArray:
    """Growth per step of the oscillator's amplitude; inf where it left the numbers."""
    size = np.hypot(ds.angle, ds.speed / np.maximum(ds.w, 1e-3))
    growth = size ** (1 / STEPS)
    return growth.where(ds.status < FIRST_REFUSAL, np.inf)


def with_truth(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the true relative error `off` of the period, twice the time between its last two flips."""
    study = sweep.build_study(
        kernel="foliot_start",
        rtol=1e-11,
        outputs=["flip_time"],
        axes={"mu": ds.mu.values},
        fixed={"a": float(ds.a), "phi0": float(ds.phi0)},
        along={"flip": [float(ds.flips) - 1, float(ds.flips)]},
    )
    truth = 2 * sweep.run(study, progress=False).flip_time.diff("flip").isel(flip=0, drop=True)
    return ds.assign(off=abs(ds.period / truth - 1))


def foliots(ds: xr.Dataset) -> list[Statement]:
    """What becomes of the foliot's cells."""
    given = ds.status < FIRST_REFUSAL
    silent = given & (ds.off > 10 * np.maximum(1e-9, ds.error))
    lines = [
        Statement(
            "values off by more than ten times what is stated",
            "none",
            f"{int(silent.sum())} of {ds.status.size}",
            None,
            not silent.any(),
        )
    ]
    for method in map(str, ds.method.values):
        here = ds.sel({"method": method})
        wrong = float(((here.off > WRONG) & (here.status < FIRST_REFUSAL)).mean())
        refused = float((here.status >= FIRST_REFUSAL).mean())
        lines.append(
            Statement(f"{method}: off by {WRONG:.0%} and more, told; refused", "", f"{wrong:.1%}; {refused:.1%}")
        )
    return lines


def oscillators(ds: xr.Dataset) -> list[Statement]:
    """Growth against theory, well away from the border."""
    growth = grown(ds)
    lines = []
    for method in map(str, ds.method.values):
        theory = xr.DataArray(eigenvalue(method, ds.a.values[:, None], ds.w.values[None, :]), dims=("a", "w"))
        clear = abs(theory.values - 1) > 0.1
        if np.isnan(theory).all():
            continue
        here = growth.sel({"method": method}).transpose("a", "w").values
        agrees = ((here > 1) == (theory.values > 1))[clear].mean()
        lines.append(
            Statement(f"{method} grows where abs(R) > 1", "all cells", f"{agrees:.4f} of them", None, bool(agrees == 1))
        )
    return lines


def hard(method: str, step: float = 0.02) -> list[str]:
    """Status and stated error of the hard cases."""
    names = ("mu", "a", "R", "c", "k")
    axes = {name: [cell.get(name, 0.0) for cell in CASES.values()] for name in names}
    fixed = {"phi0": 1.0, "step": step, "flips": 60.0}
    ds = sweep.run(
        sweep.build_study(kernel="foliot_steps", method=method, rtol=1e-6, design="zip", axes=axes, fixed=fixed),
        progress=False,
    )
    return [
        f"{name:<26}{method:<10}{Status(int(status)).name:<14}stated error {float(error):.1e}"
        for name, status, error in zip(CASES, ds.status.values, ds.error.values, strict=True)
    ]


def figure(ds: xr.Dataset, linear: xr.Dataset) -> Any:
    """Growth of the oscillator above, error of the foliot's period below."""
    from matplotlib.colors import LogNorm

    from sweep import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 110.0)
        names = [str(m) for m in linear.method.values]
        axes = page.subplots(2, len(names), squeeze=False)
        for k, method in enumerate(names):
            draw_growth(axes[0, k], linear, method, k)
            mesh = draw_error(axes[1, k], ds, method, k, LogNorm(1e-8, 1))
        page.colorbar(mesh, ax=axes[1, :].tolist(), label="relative error of the period", pad=0.01)
    return page


def draw_growth(axes: Any, ds: xr.Dataset, method: str, k: int) -> None:
    """Where the oscillator grows (dark), and theory's border."""
    growth = grown(ds.sel({"method": method})).transpose("w", "a")
    axes.contourf(ds.a, ds.w, np.minimum(growth, 1e3), levels=[0, 1, 2e3], colors=["#e8eef5", "#b04a3a"])
    theory = eigenvalue(method, ds.a.values[None, :], ds.w.values[:, None])
    if not np.isnan(theory).all():
        axes.contour(ds.a, ds.w, theory, levels=[1], colors="black", linewidths=0.9, linestyles="--")
    axes.set(title=method, xlabel="$ah$", ylabel=r"$\omega h$" if k == 0 else "")
    axes.title.set_size(8)
    if k:
        axes.set_yticklabels([])


def draw_error(axes: Any, ds: xr.Dataset, method: str, k: int, norm: Any) -> Any:
    """The true error over step and drive; grey where the method refuses."""
    here = ds.sel({"method": method}).transpose("step", "mu")
    axes.set_facecolor("0.8")
    off = np.clip(here.off.where(here.status < FIRST_REFUSAL), 1e-8, 1)
    mesh = axes.pcolormesh(ds.mu, ds.step, off, norm=norm, cmap="cividis_r", shading="nearest", rasterized=True)
    axes.contour(ds.mu, ds.step, off.fillna(1.0), levels=[WRONG], colors="#b04a3a", linewidths=0.9)
    axes.set(xscale="log", yscale="log", xlabel=r"$\mu$", ylabel="step $h$ [s]" if k == 0 else "")
    if k:
        axes.set_yticklabels([])
    if k == 0:
        direct_label(axes, 10.0, 5.0, "refused", fontsize=7)
    return mesh


def conclude(path: str, oscillator: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = with_truth(read_result(path, "foliot_steps", ["method", "mu", "step"], "stability_maps.toml"))
    linear = read_result(oscillator, "stability_maps:KERNEL", ["method", "a", "w"], "stability_maps_oscillator.toml")
    groups = {"Oscillator": oscillators(linear), "Foliot": foliots(ds)}
    notes = [NOTES, "", *(line for m in ("euler", "verlet", "rk4", "dop853", "moreau") for line in hard(m))]
    return groups, notes, figure(ds, linear)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the results that are named; 1 if a statement does not hold."""
    return report(__file__, ["stability_maps.h5", "stability_maps_oscillator.h5"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
