"""Where do explicit methods give up on a stiff lag, and what does it cost to go on?

    python studies/stiff_lag.py stiff_lag.h5 stiff_lag_bounce.h5

The first sweep is of a foliot driven by a motor that lags by eps, by each method; truth is the closed form of its
first swing. The second is of a ball whose bounces accumulate: counted to 20 and to 100, and carried to rest, whose
time is sqrt(2 h/g) (1 + e)/(1 - e) without drag. Last, the cost of a digit beside scipy's Radau and BDF, and diffrax's
Kvaerno5 where it is installed (the extra `peers`). Timings are noisy and for information only.

The error is that of the time of the switch, or of rest, relative to the closed form. Times are CPU seconds of one core.
Other programs start from rest too, with the exact Jacobian (scipy) and an event that ends the run; their absolute
tolerance is a thousandth of the relative one. diffrax does all cells side by side; its compilation is not counted.
"""

from functools import partial

import numpy as np
import xarray as xr
from _common import Claims, Statement, cheapest, measured, said, script, solved_by
from _figures import draw_costs, method_look, panels
from _stiff_peers import FOLLOWERS, FRICTION
from lag_scene import KERNEL

from kernels.interface import FIRST_REFUSAL, Status

EPS = 1e-6
"""Lag at which the costs are compared, in seconds."""
TOLERANCES = 10.0 ** -np.arange(3.0, 11.5, 2.0)
MU = np.geomspace(0.1, 10.0, 256)
"""Cells of our own; of the others every 32nd."""


def lagged(t, mu, eps):
    """Angle and speed of the foliot from rest; the rates of its speed solve eps r^2 + (1 + eps a) r + a + b = 0."""
    both, one = 2.0 * FRICTION, 1.0 + eps * FRICTION
    q = -0.5 * (one + np.sqrt(one**2 - 4.0 * eps * both))
    slow, fast = both / q, q / eps
    of_slow, of_fast = np.expm1(slow * t), np.expm1(fast * t)
    scale = mu / both / (slow - fast)
    angle = fast * (of_slow / slow - t) - slow * (of_fast / fast - t)
    return scale * angle, scale * (fast * of_slow - slow * of_fast)


def first_switch(mu, eps):
    """When the angle is 1, by Newton's method: it rises ever faster or evenly, and the start is behind."""
    t = np.sqrt(2.0 / mu) + 4.0 * FRICTION / mu + 3.0 * eps
    for _ in range(60):
        angle, speed = lagged(t, mu, eps)
        t = t - (angle - 1.0) / speed
    return t


def ours(mu, eps: float, rtol: float):
    """Times of the first switch by `rodas5p`; NaN where that is not OK."""
    cells = {"mu": mu, "phi0": 1.0, "a": FRICTION, "b": FRICTION, "eps": eps, "flips": 1.0}
    time, status = solved_by(KERNEL, "rodas5p", rtol, **cells)
    return np.where(status == Status.OK, time, np.nan)


def errors(follow, mu, true, rtol: float):
    """Of the time of the first switch, relative."""
    return abs(follow(mu, EPS, rtol) / true - 1.0)


def costs(tell: bool) -> dict[str, xr.Dataset]:
    """What a digit costs, of ours and of others where these are to be told."""
    found = {"rodas5p": measured(partial(errors, ours, MU, first_switch(MU, EPS)), TOLERANCES)}
    for name, follow in FOLLOWERS.items() if tell else ():
        found[name] = measured(partial(errors, follow, MU[::32], first_switch(MU[::32], EPS)), TOLERANCES)
    return found


def prepared(lag, bounce, tell=True):
    """The sweeps, the first with its errors, and costs, of ours alone where others are not to be told."""
    lag = lag.assign(off=abs(lag.time / first_switch(lag.mu, lag.eps) - 1.0))
    return lag, costs(tell), bounce


def claims(lag, found, bounce) -> Claims:
    """What theory says, and what comes out."""
    yield "Lag"
    ok = lag.status == Status.OK
    for method in map(str, lag["method"].values):
        here = lag.sel({"method": method})
        given = here.status < FIRST_REFUSAL
        least = float(here.eps.where(given.all("mu")).min())
        reached = f"unsolved {float((~given).mean()):.0%}; least lag done {least:.1e} s"
        yield Statement(f"{method}: unsolved, and down to which lag it does all", "", reached)
    worst, share = float(lag.off.where(ok).max()), float(ok.sel({"method": "rodas5p"}).mean())
    yield said("worst error of what is OK", worst <= 1e-9, f"{worst:.1e}", "<= 1e-9")
    yield said("rodas5p is OK for every lag", share == 1.0, f"{share:.1%}", "all cells")

    yield "Bounces"
    last = bounce.isel(flips=-1)
    came = last.status == Status.COMES_TO_REST
    at_rest = np.sqrt(2.0 * bounce.above / bounce.g) * (1.0 + bounce.e) / (1.0 - bounce.e)
    worst = float(abs(last.time / at_rest - 1.0).where(came).sel(d=0.0).max())
    later = (last.time >= bounce.isel(flips=1).time * (1 - 1e-9)).where(came, True).all()
    yield Statement("balls carried to rest", "", f"{int(came.sum())} of {came.size}; others INACCURATE")
    yield said("worst error of the time of rest, without drag", worst <= 1e-9, f"{worst:.1e}", "<= 1e-9")
    yield said("rest is later than the 100th bounce", later, "", "always")

    yield f"Cost at a lag of {EPS:g} s"
    yield from cheapest(found)


@panels(130.0, 2)
def figure(share, cost, lag, found, *_):
    """How many drives each method solves over the lag; what a digit costs."""
    for method in map(str, lag["method"].values):
        given = lag.status.sel({"method": method}) < FIRST_REFUSAL
        share.plot(lag.eps, 100 * given.mean("mu"), markersize=3.5, label=method, **method_look(method))
    share.set(xscale="log", ylim=(-4, 108), xlabel=r"lag, $\varepsilon$ [s]", ylabel="drives solved [%]")
    share.legend(loc="center left", bbox_to_anchor=(0.0, 0.55))
    places = {"rodas5p": (2.5, 4.0), "scipy Radau": (55.0, 3e-7), "scipy BDF": (3.0, 4.0)}
    draw_costs(cost, found, places | {"diffrax Kvaerno5": (3.0, 6.0)})
    cost.set(xlim=(2e-6, 1.0), ylim=(1e-15, 1))


main = script(__name__, "stiff_lag.h5 stiff_lag_bounce.h5", claims, figure, prepared)
