"""Where does each integrator grow, decay, or miss a switch, and does it say so?

    sweep run studies/stability_maps.toml
    sweep run studies/stability_maps_oscillator.toml --allow-import
    sweep run studies/stability_maps_sticking.toml
    sweep run studies/stability_maps_spring.toml
    python studies/stability_maps.py stability_maps.h5 stability_maps_oscillator.h5 stability_maps_sticking.h5 \\
        stability_maps_spring.h5

draws stability_maps.png. The second sweep is of a damped oscillator x'' = -a x' - w^2 x, which a method makes grow
where the largest eigenvalue of its step exceeds 1: for Runge-Kutta methods that is abs(R(z)), z the scene's
eigenvalues times h, R(z) the result of one step of x' = z x. Of semi-implicit Euler and Verlet it is that of a 2 by 2
matrix. The others are of a foliot's first flips from rest: a step h against its drive, against dry friction close to
sticking, and against a hairspring that it hardly overcomes; truth is the kernel foliot_start.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, read_result, report
from scipy.integrate import DOP853, RK45

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


RUNGE_KUTTA = {
    "euler": (np.zeros((1, 1)), np.ones(1)),
    "rk4": (np.diag([0.5, 0.5, 1.0], -1), np.array([1, 2, 2, 1]) / 6),
    "dopri5": (RK45.A, RK45.B),
    "dop853": (DOP853.A, DOP853.B),
}
"""Weights of stages and result, the longer ones by scipy."""


def stability_function(z: Any, method: str) -> Any:
    """What a step of x' = z x, of size 1 from x = 1, comes to."""
    weights, result = RUNGE_KUTTA[method]
    stages: list[Any] = []
    for row in weights:
        stages.append(z * (1 + sum(w * k for w, k in zip(row, stages, strict=False))))
    return 1 + sum(w * k for w, k in zip(result, stages, strict=True))


def eigenvalue(method: str, ah: Any, wh: Any) -> Any:
    """Modulus of the largest eigenvalue of a step, by theory."""
    ah, wh = np.broadcast_arrays(ah, wh)
    root = np.sqrt((ah**2 / 4 - wh**2).astype(complex))
    z = np.stack([-ah / 2 + root, -ah / 2 - root])
    if method in RUNGE_KUTTA:
        return abs(stability_function(z, method)).max(axis=0)
    if method == "semi_implicit":
        trace, product = 2 - ah - wh**2, 1 - ah
    else:  # Verlet: (x, v h) -> x1 = x + v - (w^2 x + a v)/2, v1 = v - (f0 + w^2 x1 + a (v - f0))/2
        m11, m12 = 1 - wh**2 / 2, 1 - ah / 2
        m21 = -(wh**2 + wh**2 * m11 - ah * wh**2) / 2
        m22 = 1 - (ah + wh**2 * m12 + ah * (1 - ah)) / 2
        trace, product = m11 + m22, m11 * m22 - m12 * m21
    part = np.sqrt((trace**2 / 4 - product).astype(complex))
    return abs(np.stack([trace / 2 + part, trace / 2 - part])).max(axis=0)


def grown(ds: xr.Dataset) -> xr.DataArray:
    """Growth per step of the oscillator's amplitude; inf where it left the numbers."""
    size = np.hypot(ds.angle, ds.speed / np.maximum(ds.w, 1e-3))
    growth = size ** (1 / STEPS)
    return growth.where(ds.status < FIRST_REFUSAL, np.inf)


def with_truth(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the true relative error `off` of the period; inf where the foliot does not flip at all.

    A period here is twice the time between the last two flips.
    """
    axis = swept(ds)
    study = sweep.study(
        kernel="foliot_start",
        rtol=1e-11,
        outputs=["flip_time"],
        axes={axis: ds[axis].values},
        fixed={name: float(ds[name]) for name in ("mu", "a", "phi0", "R", "k") if name != axis and name in ds},
        along={"flip": [float(ds.flips) - 1, float(ds.flips)]},
    )
    truth = sweep.run(study, progress=False)
    period = 2 * truth.flip_time.diff("flip").isel(flip=0, drop=True)
    return ds.assign(off=abs(ds.period / period - 1).where(truth.status < FIRST_REFUSAL, np.inf))


def swept(ds: xr.Dataset) -> str:
    """The foliot's parameter that a sweep is over."""
    return next(str(name) for name in ds.status.dims if name not in ("method", "step"))


def foliots(ds: xr.Dataset) -> list[Statement]:
    """What becomes of a foliot's cells."""
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
        sweep.study(kernel="foliot_steps", method=method, rtol=1e-6, design="zip", axes=axes, fixed=fixed),
        progress=False,
    )
    return [
        f"{name:<26}{method:<10}{Status(int(status)).name:<14}stated error {float(error):.1e}"
        for name, status, error in zip(CASES, ds.status.values, ds.error.values, strict=True)
    ]


def figure(linear: xr.Dataset, foliot: Sequence[xr.Dataset]) -> Any:
    """Growth of the oscillator above, errors of the foliot's period below."""
    from matplotlib.colors import LogNorm

    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 200.0)
        names = [str(m) for m in linear.method.values]
        axes = page.subplots(1 + len(foliot), len(names), squeeze=False)
        for k, method in enumerate(names):
            draw_growth(axes[0, k], linear, method)
            for row, ds in zip(axes[1:], foliot, strict=True):
                mesh = draw_error(row[k], ds, method, LogNorm(1e-8, 1))
        for one in axes[:, 1:].flat:
            one.set(ylabel="", yticklabels=[])
        for one, text in zip(axes[:, 0], ROWS, strict=False):
            one.set_title(text, loc="left", fontsize=8)
        page.legend(handles=keys(), loc="outside lower center", ncols=4)
        page.colorbar(mesh, ax=axes[1:].ravel().tolist(), label="relative error of the period", pad=0.01, aspect=40)
    return page


ROWS = ("(a)", "(b) foliot over its drive", "(c) foliot close to sticking", "(d) foliot close to grazing its switch")
"""Headings; that of the oscillator leaves room for the names of the methods."""


def keys() -> list[Any]:
    """What colours and lines mean."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        Patch(color="#b04a3a", label="(a) the amplitude grows"),
        Line2D([], [], color="black", linestyle="--", linewidth=0.9, label="its border by theory"),
        Patch(color="0.8", label="(b-d) refused, with the reason"),
        Line2D([], [], color="#b04a3a", linewidth=0.9, label=f"error of {WRONG:.0%}"),
    ]


def draw_growth(axes: Any, ds: xr.Dataset, method: str) -> None:
    """Where the oscillator grows (dark), and theory's border."""
    growth = grown(ds.sel({"method": method})).transpose("w", "a")
    axes.contourf(ds.a, ds.w, np.minimum(growth, 1e3), levels=[0, 1, 2e3], colors=["#e8eef5", "#b04a3a"])
    theory = eigenvalue(method, ds.a.values[None, :], ds.w.values[:, None])
    axes.contour(ds.a, ds.w, theory, levels=[1], colors="black", linewidths=0.9, linestyles="--")
    axes.set(title=method, xlabel="$ah$ [1]", ylabel=r"$\omega h$ [1]")
    axes.title.set_size(8)


MARGIN = {
    "mu": (r"$\mu$ [rad/s$^2$]", lambda mu: mu),
    "R": (r"$1 - R/\mu$", lambda R: 1 - R),
    "k": (r"$1 - k\varphi_0/2\mu$", lambda k: 1 - k / 2),
}
"""How far a foliot is from not flipping, where mu = phi0 = 1 in the last two."""


def draw_error(axes: Any, ds: xr.Dataset, method: str, norm: Any) -> Any:
    """The true error over step and margin; grey where the method refuses."""
    label, margin = MARGIN[swept(ds)]
    across = margin(ds[swept(ds)].values)
    here = ds.sel({"method": method}).transpose("step", swept(ds))
    axes.set_facecolor("0.8")
    off = np.clip(here.off.where(here.status < FIRST_REFUSAL), 1e-8, 1)
    mesh = axes.pcolormesh(across, ds.step, off, norm=norm, cmap="cividis_r", shading="nearest", rasterized=True)
    axes.contour(across, ds.step, off.fillna(1.0), levels=[WRONG], colors="#b04a3a", linewidths=0.9)
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="step $h$ [s]")
    return mesh


def conclude(path: str, oscillator: str, *paths: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    linear = read_result(oscillator, "stability_maps:KERNEL", ["method", "a", "w"], "stability_maps_oscillator.toml")
    grids = [
        with_truth(read_result(one, "foliot_steps", ["method", axis, "step"], f"{name}.toml"))
        for one, (name, axis) in zip((path, *paths), GRIDS.items(), strict=True)
    ]
    groups = {"Oscillator": oscillators(linear)}
    groups |= {name: foliots(ds) for name, ds in zip(("Drive", "Near sticking", "Spring"), grids, strict=True)}
    notes = [NOTES, "", *(line for m in ("euler", "verlet", "rk4", "dop853", "moreau") for line in hard(m))]
    return groups, notes, lambda: figure(linear, grids)


GRIDS = {"stability_maps": "mu", "stability_maps_sticking": "R", "stability_maps_spring": "k"}
"""Studies of a foliot, and what each is over."""


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the results that are named; 1 if a statement does not hold."""
    return report(
        __file__,
        ["stability_maps.h5", "stability_maps_oscillator.h5", "stability_maps_sticking.h5", "stability_maps_spring.h5"],
        arguments,
        conclude,
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
