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
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import (
    Groups,
    Statement,
    cheapest,
    direct_label,
    draw_costs,
    measured,
    page_of,
    read_result,
    report,
    solved_by,
)
from _stiff_peers import FOLLOWERS, FRICTION

from kernels.interface import FIRST_REFUSAL, Status
from sweep.show.charts import COLOURS, method_look

EPS = 1e-6
"""Lag at which the costs are compared, in seconds."""
TOLERANCES = 10.0 ** -np.arange(3.0, 11.5, 2.0)
MU = np.geomspace(0.1, 10.0, 256)
"""Cells of our own; of the others every 32nd."""


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
    """Worst error, and seconds per cell, at each tolerance."""
    true = first_switch(mu, EPS)
    return measured(lambda rtol: abs(follow(mu, EPS, rtol) / true - 1.0), TOLERANCES)


def ours(mu: Any, eps: float, rtol: float) -> Any:
    """Times of the first switch by `rodas5p`; NaN where that is not OK."""
    from lag_scene import KERNEL

    cells = {"mu": mu, "phi0": 1.0, "a": FRICTION, "b": FRICTION, "eps": eps, "flips": 1.0}
    time, status = solved_by(KERNEL, "rodas5p", rtol, **cells)
    return np.where(status == Status.OK, time, np.nan)


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
    """How many drives each method solves over the lag, and how well; the ball; what a digit costs."""
    with page_of(112.0, 2, 2) as (page, ((share, error), (ball, cost))):
        draw_lags(share, error, lag)
        draw_bounces(ball, bounce)
        places = {
            "rodas5p": (2.5, 4.0),
            "scipy Radau": (55.0, 3e-7),
            "scipy BDF": (3.0, 4.0),
            "diffrax Kvaerno5": (3.0, 6.0),
        }
        draw_costs(cost, found, places)
        cost.set(xlim=(2e-6, 1.0), ylim=(1e-15, 1))
    return page


def draw_lags(share: Any, error: Any, ds: xr.Dataset) -> None:
    """Share of the drives that a method solves over the lag, and the largest error of what it solves."""
    for method in map(str, ds["method"].values):
        here, look = ds.sel({"method": method}), {**method_look(method), "markersize": 3.5, "label": method}
        given = here.status < FIRST_REFUSAL
        share.plot(here.eps, 100 * given.mean("mu"), **look)
        error.plot(here.eps, here.off.where(given).max("mu").clip(1e-16), **look)
    share.set(xscale="log", ylim=(-4, 108), xlabel=r"lag, $\varepsilon$ [s]", ylabel="drives solved [%]")
    error.set(xscale="log", yscale="log", ylim=(1e-16, 1e-7), xlabel=r"lag, $\varepsilon$ [s]")
    error.axhline(1e-9, color="0.5", linewidth=0.7)
    direct_label(error, 1e-8, 1e-9, "tolerance", "0.35", fontsize=7)
    error.set_ylabel("largest relative error [1]")
    share.legend(loc="center left", fontsize=7, bbox_to_anchor=(0.0, 0.55))


def draw_bounces(axes: Any, ds: xr.Dataset) -> None:
    """What is left of the time until rest after 20 and 100 bounces."""
    rest = ds.isel(flips=-1).time
    for i, flips in enumerate(ds.flips.values[:-1]):
        left = 1.0 - ds.sel(flips=flips).time / rest
        for d, dashes, name in zip(ds.d.values, ("-", ":"), ("without drag", "with drag"), strict=True):
            line = left.sel(d=d).where(left.sel(d=d) > 1e-12)
            axes.plot(1 - ds.e, line, color=COLOURS[i], linestyle=dashes, label=f"{flips:.0f} bounces, {name}")
    axes.set(xscale="log", yscale="log", xlabel="one less restitution, $1 - e$ [1]", ylim=(1e-12, 30))
    axes.set_ylabel("part of the time to rest left [1]")
    axes.legend(loc="lower left", fontsize=7)


def conclude(path: str, bounces: str, tell: bool = True) -> tuple[Groups, list[str], Any]:
    """Statements and the figure; without costs where these are not to be told."""
    lag = read_result(path, "lag_scene:KERNEL", ["method", "mu", "eps"], "stiff_lag.toml")
    lag = lag.assign(off=abs(lag.time / first_switch(lag.mu, lag.eps) - 1.0))
    bounce = read_result(bounces, "bounce_scene:KERNEL", ["d", "flips", "e"], "stiff_lag_bounce.toml")
    found = {"rodas5p": costs(MU, ours)}
    found |= {name: costs(MU[::32], follow) for name, follow in FOLLOWERS.items()} if tell else {}
    groups = {"Lag": maps(lag), "Bounces": rests(bounce), f"Cost at a lag of {EPS:g} s": cheapest(found)}
    return groups, NOTES.splitlines(), lambda: figure(lag, bounce, found)


main = partial(report, __file__, ["stiff_lag.h5", "stiff_lag_bounce.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
