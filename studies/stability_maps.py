"""Where does each integrator grow, decay, or miss a switch, and does it say so?

    python studies/stability_maps.py stability_maps.h5 stability_maps_oscillator.h5 stability_maps_sticking.h5 \\
        stability_maps_spring.h5

The second sweep is of a damped oscillator x'' = -a x' - w^2 x, which a method makes grow where the largest eigenvalue
of its step exceeds 1: for Runge-Kutta methods that is abs(R(z)), z the scene's eigenvalues times h, R(z) the result of
one step of x' = z x. The others are of a foliot's first flips from rest: a step h against its drive, against dry
friction close to sticking, and against a hairspring that it hardly overcomes; truth is the kernel foliot_start. A value
is silently wrong if it is off by more than ten times the larger of 1e-9 and the error that the method states.
"""

import numpy as np
import xarray as xr
from _common import Claims, Statement, by_method, never, said, script, solved
from _figures import Axis, Log, direct_label, method_look, page, panel
from scipy.integrate import DOP853, RK45

from kernels.interface import FIRST_REFUSAL

STEPS = 64
"""Of the oscillator, after which it is seen whether it has grown."""
WRONG = 0.1
"""Relative error of a period from which on it is no measurement any more: a switch missed, or found too soon."""
RUNGE_KUTTA = {
    "euler": (np.zeros((1, 1)), np.ones(1)),
    "rk4": (np.diag([0.5, 0.5, 1.0], -1), np.array([1, 2, 2, 1]) / 6),
    "dopri5": (np.pad(RK45.A, ((0, 0), (0, 1))), RK45.B),
    "dop853": (DOP853.A, DOP853.B),
}
"""Weights of stages and result, the longer ones by scipy."""


def stability_function(z, method: str):
    """What a step of x' = z x, of size 1 from x = 1, comes to: 1 + z b (1 - z A)^-1 1."""
    A, b = RUNGE_KUTTA[method]
    stages = np.linalg.solve(np.eye(len(b)) - np.multiply.outer(z, A), np.ones((len(b), 1)))
    return 1 + z * (b @ stages)[..., 0]


def eigenvalue(method: str, ah, wh):
    """Modulus of the largest eigenvalue of a step, by theory."""
    ah, wh = np.broadcast_arrays(ah, wh)

    def force(x, v):
        return -(wh**2) * x - ah * v

    columns = []  # what becomes of (x, v) = (1, 0) and (0, 1): of a Runge-Kutta method the rates, of others a step
    for x, v in ((1.0, 0.0), (0.0, 1.0)):
        f, v1 = force(x, v), v + force(x, v)
        behind = x + v + f / 2
        made = {"semi_implicit": (x + v1, v1), "verlet": (behind, v + (f + force(behind, v1)) / 2)}
        columns.append(np.stack(np.broadcast_arrays(*made.get(method, (v, f))), -1))
    found = np.linalg.eigvals(np.stack(columns, -1))
    return abs(stability_function(found, method) if method in RUNGE_KUTTA else found).max(-1)


def grown(ds: xr.Dataset) -> xr.DataArray:
    """Growth per step of the oscillator's amplitude; inf where it left the numbers."""
    size = np.hypot(ds.angle, ds.speed / np.maximum(ds.w, 1e-3))
    return (size ** (1 / STEPS)).where(ds.status < FIRST_REFUSAL, np.inf).transpose("a", "w")


def with_truth(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the true relative error `off` of the period, whether it is `told`, and whether that is `wrong`.

    A period here is twice the time between the last two flips; `off` is inf where the foliot does not flip at all.
    """
    clock = {name: ds[name] for name in ("mu", "a", "phi0", "R", "k") if name in ds}
    along = {"flip": [float(ds.flips) - 1, float(ds.flips)]}
    truth = solved("foliot_start", **clock, along=along, outputs=["flip_time"], rtol=1e-11)
    period = 2 * truth.flip_time.diff("flip").isel(flip=0, drop=True)
    off = abs(ds.period / period - 1).where(truth.status < FIRST_REFUSAL, np.inf)
    told = ds.status < FIRST_REFUSAL
    return ds.assign(off=off, told=told, wrong=told & (off > WRONG))


def claims(linear, foliots) -> Claims:
    """Growth against theory, well away from the border; what becomes of a foliot's cells."""
    yield "Oscillator"
    for method, one in by_method(linear).items():
        theory = eigenvalue(method, linear.a.values[:, None], linear.w.values)
        agrees = ((grown(one).values > 1) == (theory > 1))[abs(theory - 1) > 0.1].mean()
        yield said(f"{method} grows where abs(R) > 1", agrees == 1, f"{agrees:.4f} of them", "all cells")
    for name, ds in foliots.items():
        yield name
        silent = ds.told & (ds.off > 10 * np.maximum(1e-9, ds.error))
        yield never("values off by more than ten times what is stated", silent)
        for method, one in by_method(ds).items():
            here = f"{one.wrong.mean():.1%}; {1 - one.told.mean():.1%}"
            yield Statement(f"{method}: off by {WRONG:.0%} and more, told; refused", "", here)


TRIED, LONGEST = Log(r"torque, $\mu$ [rad/s$^2$]"), Log("longest step for 10 %, $h$ [s]", (0.015, 80))
DAMPING, FREQUENCY = Axis("damping, $ah$ [1]", (0, 8)), Axis(r"frequency, $\omega h$ [1]", (0, 8))
BORDER = {"(a) border by theory": {"color": "0.3", "linewidth": 0.9}}


@panel(DAMPING, FREQUENCY, "outside lower center", BORDER, ncols=4, columnspacing=1.0)
@panel(TRIED, LONGEST)
@page(148.0)
def figure(growth, steps, linear, foliots):
    """Where the oscillator grows; the longest step that holds a foliot's period to 10 %."""
    for method, one in by_method(linear).items():
        look, theory = method_look(method), eigenvalue(method, linear.a.values, linear.w.values[:, None])
        growth.contour(linear.a, linear.w, theory, levels=[1], colors=[look["color"]], linewidths=0.9)
        grows = (grown(one) > 1).isel(a=slice(2, None, max(1, linear.a.size // 10)))
        seen = linear.w.where(grows).min("w").where(~grows.isel(w=0))
        growth.plot(seen.a, seen, **{**look, "linestyle": ""}, markersize=4, label=method)
    ds = foliots["Drive"].sortby("step")
    for method, one in by_method(ds).items():
        right = one.told & (one.off <= WRONG)
        fails = ~right & (right.cumsum("step") > 0)  # the first after one that holds ends it
        longest = one.step.where(right & (fails.cumsum("step") == 0)).max("step")
        look = {**method_look(method), "markersize": 4, "linewidth": 0.9, "markevery": max(1, ds.mu.size // 10)}
        steps.plot(ds.mu, longest, **look)
    steps.axhline(float(ds.step.max()), color="0.7", linewidth=4.0, zorder=0)
    direct_label(steps, 0.03, 0.93, "longest step tried", "0.35", ha="left", transform=steps.transAxes)


def prepared(foliot, linear, sticking, spring):
    """The oscillator, and the foliots with the truth."""
    foliots = {"Drive": foliot, "Near sticking": sticking, "Spring": spring}
    return linear, {name: with_truth(ds) for name, ds in foliots.items()}


INPUTS = "stability_maps.h5 stability_maps_oscillator.h5 stability_maps_sticking.h5 stability_maps_spring.h5"
main = script(__name__, INPUTS, claims, figure, prepared)
