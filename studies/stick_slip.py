"""Where do methods that do not slide along a switch fail on stick and slip, and what does it cost to slide?

    python studies/stick_slip.py stick_slip.h5

A mass on a spring is dragged by a belt: it rides on the belt until the spring is stronger than friction, slips back,
and is caught again. Truth is the closed form of both phases. The sweep follows twenty cycles by each method; others,
which know nothing of the kink, follow two, and so does our dopri5 at a fixed step that locates no kink.

The error is that of the time of the last count, relative to the closed form; for other programs it is that of where
they are at the true time. These get the sign as it is and 5 000 calls of the rates a cell; their absolute tolerance is
a thousandth of the relative one. Times are CPU seconds of one core, noisy and for information only.
"""

from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, Statement, by_method, cheapest, held, measured, script, solved_by
from _figures import COST, ERROR, Log, direct_label, draw_costs, method_look, page, panel
from _peers import SLIDING
from belt_scene import KERNEL, SCENE
from scipy.optimize.elementwise import find_root

from kernels.interface import FIRST_REFUSAL, Status
from kernels.stepping import stepped_kernel

TOLERANCES = 10.0 ** -np.arange(3.0, 10.5, 3.0)
FLIPS, LOOSE = 5.0, 1e-6
"""Counts of the mass for others, two cycles, and their tolerance."""


def slipping(t, fall) -> tuple[Any, Any]:
    """Place and speed of the mass over the speed of the belt, a time after it was torn off."""
    turn = np.sqrt(1.0 - 0.25 * fall**2)
    grown, wave, other = np.exp(0.5 * fall * t), np.cos(turn * t), np.sin(turn * t) / turn
    return grown * (fall * wave + (1.0 - 0.5 * fall**2) * other), grown * (wave - 0.5 * fall * other)


def last_count(flips: float, mu, belt, fall):
    """The time of that count, an odd one: the mass rides past x = mu once a cycle."""
    fall = np.asarray(fall, float)
    slip = find_root(lambda t, fall: slipping(t, fall)[1] - 1.0, (np.pi, 2.0 * np.pi), args=(fall,)).x
    return mu / belt + 0.5 * (flips - 1.0) * (slip + fall - slipping(slip, fall)[0])


def errors_of_ours(kernel, method: str, belt, fall, rtol: float, **more):
    """Of the time of the last count, relative; NaN where there is none."""
    time, status = solved_by(kernel, method, rtol, mu=1.0, flips=FLIPS, belt=belt, fall=fall, **more)
    given = status < FIRST_REFUSAL if more else status == Status.OK
    return abs(np.where(given, time, np.nan) / last_count(FLIPS, 1.0, belt, fall) - 1.0)


def prepared(ds, tell=True):
    """The sweep with its errors; those of others over belt and fall; and costs, of others where these are to be told.

    Others are late by how far the mass is from where it rides past, relative to the time; NaN: no answer.
    """

    def errors(name: str, belt, fall, rtol: float):
        true = last_count(FLIPS, 1.0, belt, fall)
        return abs(SLIDING[name](belt, fall, true, rtol) - 1.0) / (belt * true)

    true = xr.apply_ufunc(last_count, float(ds.flips), 1.0, ds.belt, ds.fall)
    some = xr.Dataset(coords={"belt": ds.belt[::3], "fall": ds.fall[::3]})
    belt, fall = (x.values.ravel() for x in xr.broadcast(some.belt, some.fall))
    steps = stepped_kernel(**{**SCENE, "name": "belt_steps"})
    late = {"fixed step": errors_of_ours(steps, "dopri5", belt, fall, LOOSE, step=0.01, location=0.0)}
    late |= {name: errors(name, belt, fall, LOOSE) for name in ("scipy Radau", "scipy LSODA")}
    unslid = some.assign({name: (("belt", "fall"), off.reshape(some.belt.size, -1)) for name, off in late.items()})

    random = np.random.default_rng(1)
    belt, fall = 10.0 ** random.uniform(-1.0, -0.4, 256), 10.0 ** random.uniform(-1.5, -0.4, 256)
    costs = {"dop853 (slides)": measured(partial(errors_of_ours, KERNEL, "dop853", belt, fall), TOLERANCES)}
    for name in SLIDING if tell else ():
        costs[name] = measured(partial(errors, name, belt[::64], fall[::64]), TOLERANCES)
    return ds.assign(off=abs(ds.time / true - 1.0)), unslid, costs


def claims(ds, unslid, found) -> Claims:
    yield "Twenty cycles"
    for method, one in by_method(ds).items():
        yield held(f"{method} is OK", (one.status == Status.OK).mean(), ">= 99 %", "{:.1%}")
    yield held("worst error of what is OK", ds.off.where(ds.status == Status.OK).max(), "<= 1e-9", "{:.1e}")

    yield f"Two cycles without sliding, rtol {LOOSE:g}"
    for name, off in unslid.items():
        here = f"{1.0 - float(off.notnull().mean()):.0%}, {float((off <= 1e-4).mean()):.0%}"
        yield Statement(f"{name}: cells given up, cells right to 1e-4", "", here)

    yield "Cost of two cycles"
    yield from cheapest(found)


BELT = Log("speed of the belt [1]", (0.01, 0.4), (0.01, 0.03, 0.1, 0.3))


@panel(BELT, Log("relative error of the time [1]", (1e-16, 1e4)))
@panel(COST.to(5e-6, 2e-2), ERROR.to(1e-16, 10), "beside")
@page(130.0)
def figure(error, cost, ds, unslid, found):
    """The error over the belt's speed, of a method that slides and of those that do not; costs."""
    slides = ds.sel({"method": "taylor"})
    shown = {"taylor, slides": slides.off.where(slides.status < FIRST_REFUSAL), "fixed step": unslid["fixed step"]}
    looks, heights = (method_look("taylor")["color"], method_look("dopri5")["color"]), (1e-9, 3e-4)
    for (name, off), colour, height in zip(shown.items(), looks, heights, strict=True):
        off = off.clip(1e-16)
        error.fill_between(off.belt, off.min("fall"), off.max("fall"), color=colour, alpha=0.25, linewidth=0)
        error.plot(off.belt, off.median("fall"), color=colour)
        direct_label(error, 0.06, height, name, colour)
    for k, name in enumerate(("scipy Radau", "scipy LSODA")):
        given = float(unslid[name].notnull().mean())
        text = "no value in any cell" if given == 0 else f"a value in {given:.0%} of the cells"
        direct_label(error, 0.063, 10.0 ** (2.6 - 1.9 * k), f"{name}: {text}", "0.35")
    draw_costs(cost, found, ["dop853 (slides)", "scipy DOP853, modes by hand"])
    none = "scipy Radau, BDF, LSODA,\ndiffrax Kvaerno5:\nno value in any cell"
    direct_label(cost, 0.95, 0.2, none, "0.35", ha="right", transform=cost.transAxes)


main = script(__name__, "stick_slip.h5", claims, figure, prepared)
