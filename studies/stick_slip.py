"""Where do methods that do not slide along a switch fail on stick and slip, and what does it cost to slide?

    sweep run studies/stick_slip.toml --allow-import
    python studies/stick_slip.py stick_slip.h5

draws stick_slip.png. A mass on a spring is dragged by a belt: it rides on the belt until the spring is stronger than
friction, slips back, and is caught again. Truth is the closed form of both phases. The sweep follows twenty cycles by
each method; others, which know nothing of the kink, are mapped over two cycles, and so is our dopri5 at a fixed step
that locates no kink. Last, the cost of a digit. Times are noisy and only told.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Conclusion, Statement, cheapest, measured, read_result, said, script, solved_by
from _figures import direct_label, draw_costs, page_of, plain_ticks
from _sliding_peers import FOLLOWERS, motion
from belt_scene import KERNEL, SCENE

from kernels.interface import FIRST_REFUSAL, Status
from kernels.stepping import stepped_kernel
from sweep.show.charts import COLOURS, DASHES, method_look

TOLERANCES = 10.0 ** -np.arange(3.0, 10.5, 3.0)
FLIPS = 5.0
"""Counts of the mass in the maps and costs of others: two cycles."""
COARSE = 3
"""Every so many-th cell of the sweep's axes is one of the others' maps."""
STEP = 0.01
LOOSE = 1e-6
"""The others' tolerance in their maps."""
SHOWN = 0.05
"""The longest step of a motion that is drawn."""
CELLS = 256
FEW = 64
"""Cells of our own in the cost; of the others every so many-th."""

NOTES = f"""\
error: of the time of the last count, relative to the closed form; of others by where they are at the true time
Others get the sign as it is and 5 000 calls of the rates a cell; absolute tolerance is a thousandth of the relative
one. Their maps, and the fixed step of {STEP:g}, are of two cycles. Times are of one core, CPU seconds"""


def slipped(fall: Any) -> tuple[Any, Any]:
    """How long a slip takes, and how far it carries the mass, over the speed of the belt: one root, by bisection."""
    turn = np.sqrt(1.0 - 0.25 * fall**2)

    def motion(t: Any) -> tuple[Any, Any]:
        grown, wave, other = np.exp(0.5 * fall * t), np.cos(turn * t), np.sin(turn * t) / turn
        return grown * (fall * wave + (1.0 - 0.5 * fall**2) * other), grown * (wave - 0.5 * fall * other)

    low, high = np.pi + 0.0 * fall, 2.0 * np.pi + 0.0 * fall
    for _ in range(60):
        middle = 0.5 * (low + high)
        early = motion(middle)[1] < 1.0
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    return low, motion(low)[0]


def last_count(flips: float, mu: Any, belt: Any, fall: Any) -> Any:
    """The time of that count, an odd one: the mass rides past x = mu once a cycle."""
    fall = np.asarray(fall, float)
    slip, place = slipped(fall)
    return mu / belt + 0.5 * (flips - 1.0) * (slip + fall - place)


def errors(follow: Callable[..., Any], belt: Any, fall: Any, rtol: float) -> Any:
    """How late others are, relative to the time: by how far the mass is from where it rides past."""
    true = last_count(FLIPS, 1.0, belt, fall)
    return abs(follow(belt, fall, true, rtol) - 1.0) / (belt * true)


def errors_of_ours(kernel: Any, belt: Any, fall: Any, rtol: float, method: str = "dop853", **more: Any) -> Any:
    """Of the time of the last count, relative; NaN where there is none."""
    time, status = solved_by(kernel, method, rtol, mu=1.0, flips=FLIPS, belt=belt, fall=fall, **more)
    given = status == Status.OK if not more else status < FIRST_REFUSAL
    return abs(np.where(given, time, np.nan) / last_count(FLIPS, 1.0, belt, fall) - 1.0)


def others(ds: xr.Dataset) -> xr.Dataset:
    """Maps of the errors of those that do not slide, NaN where they give up; our dopri5 chatters about the kink."""
    some = ds.isel({"belt": slice(None, None, COARSE), "fall": slice(None, None, COARSE)})
    belt, fall = (np.ravel(x) for x in np.meshgrid(some.belt, some.fall, indexing="ij"))
    steps = stepped_kernel(**{**SCENE, "name": "belt_steps"})
    found = {"fixed step": errors_of_ours(steps, belt, fall, LOOSE, "dopri5", step=STEP, location=0.0)}
    for name in ("scipy Radau", "scipy LSODA"):
        found[name] = errors(FOLLOWERS[name], belt, fall, LOOSE)
    shape = (some.belt.size, some.fall.size)
    made = {name: (("belt", "fall"), off.reshape(shape)) for name, off in found.items()}
    return xr.Dataset(made, {"belt": some.belt, "fall": some.fall})


def all_costs(tell: bool) -> dict[str, xr.Dataset]:
    """What a digit costs, of ours and of others where these are to be told."""
    random = np.random.default_rng(1)
    belt, fall = 10.0 ** random.uniform(-1.0, -0.4, CELLS), 10.0 ** random.uniform(-1.5, -0.4, CELLS)
    found = {"dop853 (slides)": measured(partial(errors_of_ours, KERNEL, belt, fall), TOLERANCES)}
    for name, follow in FOLLOWERS.items() if tell else ():
        found[name] = measured(partial(errors, follow, belt[::FEW], fall[::FEW]), TOLERANCES)
    return found


def statements(ds: xr.Dataset, unslid: xr.Dataset) -> tuple[list[Statement], list[Statement]]:
    """What our methods do over twenty cycles, and what those do that do not slide."""
    lines, failures, ok = [], [], ds.status == Status.OK
    for method in map(str, ds["method"].values):
        share = float(ok.sel({"method": method}).mean())
        lines.append(said(f"{method} is OK", share >= 0.99, f"{share:.1%}", ">= 99 %"))
    worst = float(ds.off.where(ok).max())
    for name, off in unslid.items():
        here = f"{1.0 - float(off.notnull().mean()):.0%}, {float((off <= 1e-4).mean()):.0%}"
        failures.append(Statement(f"{name}: cells given up, cells right to 1e-4", "", here))
    return [*lines, said("worst error of what is OK", worst <= 1e-9, f"{worst:.1e}", "<= 1e-9")], failures


def figure(ds: xr.Dataset, unslid: xr.Dataset, found: dict[str, xr.Dataset]) -> Any:
    """The motion; the error over the belt's speed, of a method that slides and of those that do not; costs."""
    with page_of(72.0, 1, 3) as (page, (left, middle, right)):
        for i, fall in enumerate((0.02, 0.1, 0.4)):
            place, speed = motion(0.3, fall, float(last_count(FLIPS, 1.0, 0.3, fall)), 1e-8, SHOWN)
            left.plot(place, speed, color=COLOURS[i], linestyle=DASHES[i], label=f"{fall:g}")
        left.set(xlabel="place, $x$ [1]", ylabel="speed, $x'$ [1]", ylim=(-1.25, 0.45))
        small = {"fontsize": 7, "title_fontsize": 7, "ncols": 3, "columnspacing": 0.9}
        left.legend(loc="lower left", title="fall of friction [1]", **small)
        draw_errors(middle, ds.sel({"method": "taylor"}), unslid)
        places = {"dop853 (slides)": (2.0, 15.0), "scipy DOP853, modes by hand": (0.45, 20.0)}
        draw_costs(right, found, places)
        none = "scipy Radau, BDF, LSODA,\ndiffrax Kvaerno5:\nno value in any cell"
        direct_label(right, 0.95, 0.13, none, "0.35", fontsize=7, ha="right", transform=right.transAxes)
        right.set(xlim=(5e-6, 2e-2), ylim=(1e-16, 10))
    return page


def draw_errors(axes: Any, slides: xr.Dataset, unslid: xr.Dataset) -> None:
    """Median and range of the error over the falls of friction; those that give up every cell stand on the rim."""
    shown = {"taylor, slides": slides.off.where(slides.status < FIRST_REFUSAL), "fixed step": unslid["fixed step"]}
    for (name, off), look in zip(shown.items(), (method_look("taylor"), method_look("dopri5")), strict=True):
        off = off.clip(1e-16)
        axes.fill_between(off.belt, off.min("fall"), off.max("fall"), color=look["color"], alpha=0.25, linewidth=0)
        axes.plot(off.belt, off.median("fall"), color=look["color"])
        direct_label(axes, 0.06, 30 * float(off.max()) if name != "fixed step" else 3e-4, name, look["color"])
    for k, name in enumerate(("scipy Radau", "scipy LSODA")):
        given = float(unslid[name].notnull().mean())
        text = "no value in any cell" if given == 0 else f"a value in {given:.0%} of the cells"
        direct_label(axes, 0.063, 10.0 ** (2.6 - 1.9 * k), f"{name}: {text}", "0.35", fontsize=7)
    axes.set(xscale="log", yscale="log", xlim=(0.01, 0.4), ylim=(1e-16, 1e4))
    axes.set(xlabel="speed of the belt [1]", ylabel="relative error of the time [1]")
    plain_ticks(axes.xaxis, (0.01, 0.03, 0.1, 0.3))


def conclude(path: str, tell: bool = True) -> Conclusion:
    """Statements and the figure; costs of ours alone where those of others are not to be told."""
    ds = read_result(path, "belt_scene:KERNEL", ["method", "belt", "fall"], "stick_slip.toml")
    true = xr.apply_ufunc(last_count, float(ds.flips), 1.0, ds.belt, ds.fall)
    ds = ds.assign(off=abs(ds.time / true - 1.0))
    unslid, found = others(ds), all_costs(tell)
    cycles, failures = statements(ds, unslid)
    groups = {"Twenty cycles": cycles, f"Two cycles without sliding, rtol {LOOSE:g}": failures}
    return groups | {"Cost of two cycles": cheapest(found)}, [NOTES], lambda: figure(ds, unslid, found)


main = script(__name__, "stick_slip.h5", conclude)
