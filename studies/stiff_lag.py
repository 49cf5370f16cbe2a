"""Where do explicit methods give up on a stiff lag, and what does it cost to go on?

    python studies/stiff_lag.py stiff_lag.h5 stiff_lag_bounce.h5

The first sweep is of a foliot driven by a motor that lags by eps, by each method; truth is the closed form of its
first swing. The second is of a ball whose bounces accumulate: counted to 20 and to 100, and carried to rest, whose
time is sqrt(2 h/g) (1 + e)/(1 - e) without drag. Last, the cost of a digit beside other programs (the extra `peers`).

The error is that of the time of the switch, or of rest, relative to the closed form. Times are CPU seconds of one core,
noisy and for information only. Other programs have the exact Jacobian (scipy) and an event that ends the run; their
absolute tolerance is a thousandth of the relative one. diffrax does all cells side by side, compiled before.
"""

import numpy as np
import xarray as xr
from _common import Claims, Statement, by_method, cheapest, held, measured, never, script, solved_by
from _figures import COST, ERROR, Axis, Log, draw_costs, method_look, page, panel
from _peers import FRICTION, STIFF
from lag_scene import KERNEL

from kernels.interface import FIRST_REFUSAL, Status

EPS = 1e-6
"""Lag at which the costs are compared, in seconds."""


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


def prepared(lag, bounce, tell=True):
    """The sweeps, the first with its errors, and what a digit costs, of others where these are to be told."""

    def ours(mu, eps: float, rtol: float):
        time, status = solved_by(KERNEL, "rodas5p", rtol, mu=mu, a=FRICTION, b=FRICTION, eps=eps, flips=1.0)
        return np.where(status == Status.OK, time, np.nan)

    def cost(follow, mu) -> xr.Dataset:
        tolerances, true = 10.0 ** -np.arange(3.0, 11.5, 2.0), first_switch(mu, EPS)
        return measured(lambda rtol: abs(follow(mu, EPS, rtol) / true - 1.0), tolerances)

    mu = np.geomspace(0.1, 10.0, 256)
    costs = {"rodas5p": cost(ours, mu)} | {name: cost(follow, mu[::32]) for name, follow in STIFF.items() if tell}
    return lag.assign(off=abs(lag.time / first_switch(lag.mu, lag.eps) - 1.0)), costs, bounce


def claims(lag, found, bounce) -> Claims:
    yield "Lag"
    ok = lag.status == Status.OK
    for method, here in by_method(lag).items():
        given = here.status < FIRST_REFUSAL
        reached = f"unsolved {(~given).mean():.0%}; least lag done {here.eps.where(given.all('mu')).min():.1e} s"
        yield Statement(f"{method}: unsolved, and down to which lag it does all", "", reached)
    yield held("worst error of what is OK", lag.off.where(ok).max(), "<= 1e-9", "{:.1e}")
    yield never("rodas5p: lags at which it is not OK", ~ok.sel({"method": "rodas5p"}))

    yield "Bounces"
    last = bounce.isel(flips=-1)
    came = last.status == Status.COMES_TO_REST
    at_rest = np.sqrt(2.0 * bounce.above / bounce.g) * (1.0 + bounce.e) / (1.0 - bounce.e)
    worst = abs(last.time / at_rest - 1.0).where(came).sel(d=0.0).max()
    earlier = (last.time < bounce.isel(flips=1).time * (1 - 1e-9)) & came
    yield Statement("balls carried to rest", "", f"{int(came.sum())} of {came.size}; others INACCURATE")
    yield held("worst error of the time of rest, without drag", worst, "<= 1e-9", "{:.1e}")
    yield never("rest that is earlier than the 100th bounce", earlier)

    yield f"Cost at a lag of {EPS:g} s"
    yield from cheapest(found)


@panel(Log(r"lag, $\varepsilon$ [s]"), Axis("drives solved [%]", (-4, 108)), "center left", bbox_to_anchor=(0.0, 0.55))
@panel(COST.to(2e-6, 1.0), ERROR.to(1e-15, 1), "beside")
@page(130.0)
def figure(share, cost, lag, found, *_):
    """How many drives each method solves over the lag; what a digit costs."""
    for method, here in by_method(lag).items():
        given = here.status < FIRST_REFUSAL
        share.plot(lag.eps, 100 * given.mean("mu"), markersize=3.5, label=method, **method_look(method))
    draw_costs(cost, found, ["rodas5p", "scipy Radau", "scipy BDF", "diffrax Kvaerno5"])


main = script(__name__, "stiff_lag.h5 stiff_lag_bounce.h5", claims, figure, prepared)
