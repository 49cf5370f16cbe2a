"""Where do methods that do not slide along a switch fail on stick and slip, and what does it cost to slide?

    sweep run studies/stick_slip.toml --allow-import
    python studies/stick_slip.py stick_slip.h5

draws stick_slip.png. A mass on a spring is dragged by a belt: it rides on the belt until the spring is stronger than
friction, slips back, and is caught again. Truth is the closed form of both phases. The sweep follows twenty cycles by
each method; others, which know nothing of the kink, are mapped over two cycles, and so is our dopri5 at a fixed step
that locates no kink. Last, the cost of a digit. Times are noisy and only told.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, cheapest, read_result, report
from _sliding_peers import FOLLOWERS, motion

from kernels.interface import FIRST_REFUSAL, Status

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


def ours(belt: Any, fall: Any, rtol: float) -> Any:
    """Times of the last count by `dop853`; NaN where that is not OK."""
    from belt_scene import KERNEL

    outputs, status = solved(KERNEL, "dop853", rtol, belt=belt, fall=fall)
    return np.where(status == Status.OK, outputs, np.nan)


def chattering(belt: Any, fall: Any) -> Any:
    """The same by dopri5 at a fixed step that locates no kink, which chatters about it."""
    from belt_scene import SCENE

    from kernels.stepping import stepped_kernel

    kernel = stepped_kernel(**{**SCENE, "name": "belt_steps"})
    outputs, status = solved(kernel, "dopri5", LOOSE, belt=belt, fall=fall, step=STEP, location=0.0)
    return np.where(status < FIRST_REFUSAL, outputs, np.nan)


def solved(kernel: Any, method: str, rtol: float, **given: Any) -> tuple[Any, Any]:
    """The times and the statuses of cells."""
    cells = {"mu": 1.0, "flips": FLIPS, **given}
    shape = np.shape(given["belt"])
    columns = [np.broadcast_to(cells[field.name], shape).astype(float) for field in kernel.parameters]
    outputs, status = [np.empty(shape) for _ in kernel.outputs], np.empty(shape, np.int8)
    kernel.method(method).solve(*columns, np.full(shape, rtol), *outputs, status)
    return outputs[0], status


def errors(follow: Callable[..., Any], belt: Any, fall: Any, rtol: float) -> Any:
    """How late others are, relative to the time: by how far the mass is from where it rides past."""
    true = last_count(FLIPS, 1.0, belt, fall)
    return abs(follow(belt, fall, true, rtol) - 1.0) / (belt * true)


def others(ds: xr.Dataset) -> xr.Dataset:
    """Maps of the errors of those that do not slide, NaN where they give up."""
    some = ds.isel({"belt": slice(None, None, COARSE), "fall": slice(None, None, COARSE)})
    belt, fall = (np.ravel(x) for x in np.meshgrid(some.belt, some.fall, indexing="ij"))
    found = {"fixed step": abs(chattering(belt, fall) / last_count(FLIPS, 1.0, belt, fall) - 1.0)}
    for name in ("scipy Radau", "scipy LSODA"):
        found[name] = errors(FOLLOWERS[name], belt, fall, LOOSE)
    shape = (some.belt.size, some.fall.size)
    return xr.Dataset(
        {name: (("belt", "fall"), off.reshape(shape)) for name, off in found.items()},
        {"belt": some.belt, "fall": some.fall},
    )


def costs(follow: Callable[[Any, Any, float], Any], belt: Any, fall: Any) -> xr.Dataset:
    """Worst error, infinite where a cell is given up, and seconds per cell, at each tolerance."""
    rows = []
    for rtol in TOLERANCES:
        follow(belt, fall, rtol)  # compiled before it is timed
        begin = time.process_time()
        off = follow(belt, fall, rtol)
        seconds = (time.process_time() - begin) / len(belt)
        rows.append((np.where(np.isnan(off), np.inf, off).max(), seconds))
    worst, seconds = zip(*rows, strict=True)
    return xr.Dataset({"worst": ("rtol", list(worst)), "seconds": ("rtol", list(seconds))}, {"rtol": TOLERANCES})


def all_costs(tell: bool) -> dict[str, xr.Dataset]:
    """What a digit costs, of ours and of others where these are to be told."""
    random = np.random.default_rng(1)
    belt, fall = 10.0 ** random.uniform(-1.0, -0.4, CELLS), 10.0 ** random.uniform(-1.5, -0.4, CELLS)

    def late(belt: Any, fall: Any, rtol: float) -> Any:
        return abs(ours(belt, fall, rtol) / last_count(FLIPS, 1.0, belt, fall) - 1.0)

    found = {"dop853, slides": costs(late, belt, fall)}
    for name, follow in FOLLOWERS.items() if tell else ():
        found[name] = costs(lambda b, f, r, follow=follow: errors(follow, b, f, r), belt[::FEW], fall[::FEW])
    return found


def maps(ds: xr.Dataset) -> list[Statement]:
    """What our methods do over twenty cycles."""
    lines = []
    for method in map(str, ds["method"].values):
        here = ds.sel({"method": method})
        share = float((here.status == Status.OK).mean())
        lines.append(Statement(f"{method} is OK", ">= 99 %", f"{share:.1%}", None, share >= 0.99))
    worst = float(ds.off.where(ds.status == Status.OK).max())
    return [*lines, Statement("worst error of what is OK", "<= 1e-9", f"{worst:.1e}", None, worst <= 1e-9)]


def failures(found: xr.Dataset) -> list[Statement]:
    """What those do that do not slide."""
    lines = []
    for name, off in found.items():
        given, right = float(off.notnull().mean()), float((off <= 1e-4).mean())
        what = f"{name}: cells given up, cells right to 1e-4"
        lines.append(Statement(what, "", f"{1.0 - given:.0%}, {right:.0%}"))
    return lines


def figure(ds: xr.Dataset, unslid: xr.Dataset, found: dict[str, xr.Dataset]) -> Any:
    """The motion; maps of the error over the belt's speed and the fall of friction; what a digit costs."""
    from matplotlib.colors import LogNorm

    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 118.0)
        panels = page.subplots(2, 3)
        draw_motion(panels[0, 0])
        slides = ds.sel({"method": "taylor"})
        shown = {"taylor, slides": slides.off.where(slides.status < FIRST_REFUSAL)}
        shown |= dict(unslid.data_vars)
        for axes, (name, off) in zip(panels.flat[1:], shown.items(), strict=False):
            mesh = draw_map(axes, off, LogNorm(1e-16, 1.0))
            axes.set_title(name, loc="center")
        page.colorbar(mesh, ax=panels.ravel().tolist(), label="relative error", location="right", aspect=40)
        draw_costs(panels[1, 2], found)
        for axes, letter in zip(panels.flat, "abcdef", strict=True):
            charts.letter(axes, letter)
    return page


def draw_motion(axes: Any) -> None:
    """Speed over place, for three falls of friction."""
    from sweep.show.charts import COLOURS

    for i, fall in enumerate((0.02, 0.1, 0.4)):
        until = float(last_count(FLIPS, 1.0, 0.3, fall))
        place, speed = motion(0.3, fall, until, 1e-8, SHOWN)
        axes.plot(place, speed, color=COLOURS[i], label=f"fall {fall:g}")
    axes.set(xlabel="place $x$", ylabel="speed $x'$", ylim=(-0.95, 0.45))
    axes.legend(loc="lower left", fontsize=6)


def draw_map(axes: Any, off: xr.DataArray, norm: Any) -> Any:
    """Error over the belt's speed and the fall of friction; grey where a method gives up."""
    axes.set_facecolor("0.8")
    values = np.maximum(off, 1e-16).transpose("fall", "belt")
    mesh = axes.pcolormesh(off.belt, off.fall, values, norm=norm, cmap="cividis_r", shading="nearest", rasterized=True)
    axes.set(xscale="log", yscale="log", xlabel="speed of the belt", ylabel="fall of friction")
    return mesh


def draw_costs(axes: Any, found: dict[str, xr.Dataset]) -> None:
    """Worst error over time per cell."""
    from sweep.show.charts import COLOURS, DASHES, MARKS

    for i, (name, row) in enumerate(found.items()):
        look = {"color": COLOURS[i], "marker": MARKS[i], "linestyle": DASHES[i % len(DASHES)], "markersize": 3}
        ends = row.worst < np.inf
        label = name if bool(ends.any()) else f"{name}: gives up"
        axes.plot(row.seconds, row.worst.where(ends).clip(1e-16), label=label, **look)
    axes.set(xscale="log", yscale="log", xlabel="time per cell on one core [s]", ylabel="relative error, worst cell")
    axes.legend(loc="best", fontsize=5)


def conclude(path: str, tell: bool = True) -> tuple[Groups, list[str], Any]:
    """Statements and the figure; costs of ours alone where those of others are not to be told."""
    ds = read_result(path, "belt_scene:KERNEL", ["method", "belt", "fall"], "stick_slip.toml")
    true = xr.apply_ufunc(last_count, float(ds.flips), 1.0, ds.belt, ds.fall)
    ds = ds.assign(off=abs(ds.time / true - 1.0))
    unslid, found = others(ds), all_costs(tell)
    groups = {
        "Twenty cycles": maps(ds),
        f"Two cycles without sliding, rtol {LOOSE:g}": failures(unslid),
        "Cost of two cycles": cheapest(found),
    }
    return groups, NOTES.splitlines(), lambda: figure(ds, unslid, found)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the result that is named; 1 if a statement does not hold."""
    return report(__file__, ["stick_slip.h5"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
