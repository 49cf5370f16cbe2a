"""Where do explicit methods give up on a stiff lag, and what does it cost to go on?

    sweep run studies/stiff_lag.toml --allow-import
    sweep run studies/stiff_lag_bounce.toml --allow-import
    python studies/stiff_lag.py stiff_lag.h5 stiff_lag_bounce.h5

draws stiff_lag.png. The first sweep is of a foliot driven by a motor that lags by eps, by each method; truth is the
closed form of its first swing. The second is of a ball whose bounces accumulate: counted to 20 and to 100, and
carried to rest, whose time is sqrt(2 h/g) (1 + e)/(1 - e) without drag. Last, the cost of a digit beside scipy's Radau
and BDF, and diffrax's Kvaerno5 where it is installed (the extra `peers`). Times are noisy and only told.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, cheapest, read_result, report
from _stiff_peers import FOLLOWERS, FRICTION

from kernels.interface import FIRST_REFUSAL, Status

EPS = 1e-6
"""Lag at which the costs are compared, in seconds."""
TOLERANCES = 10.0 ** -np.arange(3.0, 11.5, 2.0)
MU = np.geomspace(0.1, 10.0, 256)
"""Cells of our own; of the others every 32nd."""

GIVEN_UP = 0.5
"""Error of a run that was broken off."""

NOTES = """\
error: of the time of the switch, or of rest, relative to the closed form. Times are of one core, CPU seconds
Others start from rest as ours do, with the exact Jacobian (scipy) and an event that ends the run; absolute tolerance
is a thousandth of the relative one. diffrax does all cells side by side; compiling is not counted"""


def lagged(t: Any, mu: Any, eps: Any) -> Any:
    """Angle and speed of the foliot from rest; the rates of its speed solve eps r^2 + (1 + eps a) r + a + b = 0."""
    both, one = 2.0 * FRICTION, 1.0 + eps * FRICTION
    q = -0.5 * (one + np.sqrt(one**2 - 4.0 * eps * both))
    slow, fast = both / q, q / eps
    of_slow, of_fast = np.expm1(slow * t), np.expm1(fast * t)
    scale = mu / both / (slow - fast)
    angle = fast * (of_slow / slow - t) - slow * (of_fast / fast - t)
    return scale * angle, scale * (fast * of_slow - slow * of_fast)


def first_switch(mu: Any, eps: Any) -> Any:
    """When the angle is 1, by Newton's method: it rises ever faster or evenly, and the start is behind."""
    t = np.sqrt(2.0 / mu) + 4.0 * FRICTION / mu + 3.0 * eps
    for _ in range(60):
        angle, speed = lagged(t, mu, eps)
        t = t - (angle - 1.0) / speed
    return t


def costs(mu: Any, follow: Callable[[Any, float, float], Any]) -> xr.Dataset:
    """Median and worst error, and seconds per cell, at each tolerance."""
    true, rows = first_switch(mu, EPS), []
    for rtol in TOLERANCES:
        follow(mu, EPS, rtol)  # compiled before it is timed
        begin = time.process_time()
        found = follow(mu, EPS, rtol)
        seconds = (time.process_time() - begin) / len(mu)
        off = abs(found / true - 1.0)
        rows.append((np.median(off), off.max(), seconds))
    keys = ("median", "worst", "seconds")
    columns = zip(keys, zip(*rows, strict=True), strict=True)
    return xr.Dataset({key: ("rtol", list(values)) for key, values in columns}, {"rtol": TOLERANCES})


def ours(mu: Any, eps: float, rtol: float) -> Any:
    """Times of the first switch by `rodas5p`; NaN where that is not OK."""
    from lag_scene import KERNEL

    given = {"mu": mu, "phi0": 1.0, "a": FRICTION, "b": FRICTION, "eps": eps, "flips": 1.0}
    columns = [np.broadcast_to(given[field.name], mu.shape).astype(float) for field in KERNEL.parameters]
    outputs = [np.empty(len(mu)) for _ in KERNEL.outputs]
    status = np.empty(len(mu), np.int8)
    KERNEL.method("rodas5p").solve(*columns, np.full(len(mu), rtol), *outputs, status)
    return np.where(status == Status.OK, outputs[0], np.nan)


def maps(ds: xr.Dataset) -> list[Statement]:
    """What each method does over the lag."""
    lines = []
    for method in map(str, ds["method"].values):
        here = ds.sel({"method": method})
        given = here.status < FIRST_REFUSAL
        least = float(here.eps.where(given.all("mu")).min())
        reached = f"unsolved {float((~given).mean()):.0%}; least lag done {least:.1e} s"
        lines.append(Statement(f"{method}: unsolved, and down to which lag it does all", "", reached))
    right = ds.off.where(ds.status == Status.OK)
    worst = float(right.max())
    lines.append(Statement("worst error of what is OK", "<= 1e-9", f"{worst:.1e}", None, worst <= 1e-9))
    stiff = ds.sel({"method": "rodas5p"})
    share = float((stiff.status == Status.OK).mean())
    lines.append(Statement("rodas5p is OK for every lag", "all cells", f"{share:.1%}", None, share == 1.0))
    return lines


def rests(ds: xr.Dataset) -> list[Statement]:
    """The ball at rest."""
    last = ds.isel(flips=-1)
    came = last.status == Status.COMES_TO_REST
    without = last.sel(d=0.0)
    off = abs(without.time / at_rest(without) - 1.0).where(without.status == Status.COMES_TO_REST)
    worst = float(off.max())
    return [
        Statement("balls carried to rest", "", f"{int(came.sum())} of {came.size}; others INACCURATE"),
        Statement("worst error of the time of rest, without drag", "<= 1e-9", f"{worst:.1e}", None, worst <= 1e-9),
        Statement(
            "rest is later than the 100th bounce",
            "always",
            "",
            None,
            bool((last.time >= ds.isel(flips=1).time * (1 - 1e-9)).where(came, True).all()),
        ),
    ]


def at_rest(ds: xr.Dataset) -> Any:
    """Time of rest without drag."""
    return np.sqrt(2.0 * ds.above / ds.g) * (1.0 + ds.e) / (1.0 - ds.e)


def figure(lag: xr.Dataset, bounce: xr.Dataset, found: dict[str, xr.Dataset]) -> Any:
    """Four maps of the error over lag and drive; the ball; what a digit costs."""
    from matplotlib.colors import LogNorm

    from sweep.show import charts

    with charts.style():
        page = charts.new_figure(charts.PAGE, 118.0)
        panels = page.subplots(2, 3)
        for axes, letter, method in zip(panels.flat, "abcd", lag["method"].values, strict=False):
            mesh = draw_map(axes, lag.sel({"method": method}), LogNorm(1e-16, 1e-8))
            axes.set_title(f"({letter}) {method}", loc="left")
        page.colorbar(mesh, ax=panels[:, 0].tolist(), label="relative error", location="left", aspect=40)
        draw_bounces(panels[1, 1], bounce)
        draw_costs(panels[1, 2], found)
        charts.letter(panels[1, 1], "e")
        charts.letter(panels[1, 2], "f")
    return page


def draw_map(axes: Any, ds: xr.Dataset, norm: Any) -> Any:
    """Error over lag and drive; grey where the method gives up."""
    axes.set_facecolor("0.8")
    off = np.maximum(ds.off.where(ds.status < FIRST_REFUSAL), 1e-16).transpose("mu", "eps")
    mesh = axes.pcolormesh(ds.eps, ds.mu, off, norm=norm, cmap="cividis_r", shading="nearest", rasterized=True)
    axes.set(xscale="log", yscale="log", xlabel=r"lag $\varepsilon$ [s]", ylabel=r"$\mu$ [rad/s$^2$]")
    return mesh


def draw_bounces(axes: Any, ds: xr.Dataset) -> None:
    """What is left of the time of rest after 20 and 100 bounces, and the error of the time of rest."""
    from sweep.show.charts import COLOURS

    rest = ds.isel(flips=-1).time
    for i, flips in enumerate(ds.flips.values[:-1]):
        left = 1.0 - ds.sel(flips=flips) / rest
        for d, line in zip(ds.d.values, "-:", strict=True):
            label = f"after {flips:.0f}" if line == "-" else None
            axes.plot(1 - ds.e, left.time.sel(d=d).clip(1e-16), line, color=COLOURS[i], label=label)
    without = ds.isel(flips=-1).sel(d=0.0)
    off = abs(without.time / at_rest(without) - 1).clip(1e-16)
    axes.plot(1 - ds.e, off, "o", color=COLOURS[2], markersize=3, label="at rest: error")
    axes.set(xscale="log", yscale="log", xlabel="$1 - e$", ylabel="share of the time of rest", ylim=(5e-17, 30.0))
    axes.legend(loc="center left", borderpad=0.1, fontsize=6)


def draw_costs(axes: Any, found: dict[str, xr.Dataset]) -> None:
    """Worst error over time per cell."""
    from sweep.show.charts import COLOURS, DASHES, MARKS

    for i, (name, row) in enumerate(found.items()):
        look = {"color": COLOURS[i], "marker": MARKS[i], "linestyle": DASHES[i], "markersize": 3}
        axes.plot(row.seconds, row.worst.where(row.worst < GIVEN_UP).clip(1e-16), label=name, **look)
    axes.set(xscale="log", yscale="log", xlabel="time per cell on one core [s]", ylabel="relative error, worst cell")
    axes.legend(loc="lower center", fontsize=6)


def conclude(path: str, bounces: str, tell: bool = True) -> tuple[Groups, list[str], Any]:
    """Statements and the figure; without costs where these are not to be told."""
    lag = read_result(path, "lag_scene:KERNEL", ["method", "mu", "eps"], "stiff_lag.toml")
    lag = lag.assign(off=abs(lag.time / first_switch(lag.mu, lag.eps) - 1.0))
    bounce = read_result(bounces, "bounce_scene:KERNEL", ["d", "flips", "e"], "stiff_lag_bounce.toml")
    found = {"rodas5p": costs(MU, ours)}
    found |= {name: costs(MU[::32], follow) for name, follow in FOLLOWERS.items()} if tell else {}
    groups = {"Lag": maps(lag), "Bounces": rests(bounce), f"Cost at a lag of {EPS:g} s": cheapest(found)}
    return groups, NOTES.splitlines(), lambda: figure(lag, bounce, found)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the results that are named; 1 if a statement does not hold."""
    return report(__file__, ["stiff_lag.h5", "stiff_lag_bounce.h5"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
