"""How does van der Pol's oscillator go over from a sine to a relaxation oscillation?

    python studies/relaxation.py relaxation.h5

Weak friction leaves a sine of amplitude 2 and period T = 2 pi (1 + mu^2/16), with the largest x = 2 + mu^2/96 and the
multiplier exp(-2 pi mu). Strong friction makes x creep and jump, with a period T = (3 - 2 ln 2) mu + 7.0143 mu^-1/3
(Dorodnicyn 1947).
"""

import math

import numpy as np
from _common import Claims, all_ok, compared, differing, script
from _figures import COLOURS, Log, direct_label, page, panel

SLOW = 3.0 - 2.0 * math.log(2.0)
"""Period over mu of strong friction."""
NEXT = 7.0143
"""What comes next, times mu^-1/3: 3 times the first zero of Ai, 2.33811."""


def claims(ds) -> Claims:
    yield "Cells"
    near = float(ds.period.sel(mu=1.0, method="nearest"))
    yield all_ok(ds)
    # by a Taylor series of order 24 at 25 digits
    yield compared("T at mu = 1", "6.66328686", near, 6.663286859323130, 1e-8)

    yield "Weak friction"
    here, near = ds.isel(mu=0), ds.sel(mu=0.018, method="nearest")
    mu, larger = float(here.mu), (near.x_size - 2.0) / near.mu**2
    yield compared("(T/2 pi - 1)/mu^2", "1/16", (here.period / (2.0 * math.pi) - 1.0) / mu**2, 1.0 / 16.0, 1e-3)
    yield compared("(largest x - 2)/mu^2 at mu = 0.018", "1/96", larger, 1.0 / 96.0, 1e-3)
    yield compared("multiplier at the weakest", "exp(-2 pi mu)", here.multiplier, math.exp(-2 * math.pi * mu), 1e-4)

    yield "Strong friction"
    late, last, mu = ds.where(ds.mu >= 1e3, drop=True), ds.isel(mu=-1), float(ds.mu[-1])
    slope = np.polyfit(np.log(late.mu), np.log(late.period - SLOW * late.mu), 1)[0]
    theory = SLOW * mu + NEXT * mu ** (-1 / 3)
    yield compared("T at the strongest", "(3 - 2 ln 2) mu + 7.0143 mu^-1/3", last.period, theory, 1e-7)
    yield differing("exponent of T - (3 - 2 ln 2) mu", "-1/3", slope, -1.0 / 3.0, 0.02)
    yield differing("d ln T/d ln mu at the strongest", "1", last.period_by_mu, 1.0, 1e-4)


@panel(Log(), Log("period $T$ [1]", (3.0, 3e4)))
@panel(Log(r"friction $\mu$ [1]"), Log(r"$T-(3-2\,\ln 2)\,\mu$ [1]"))
@page(120.0, sharex=True)
def figure(period, rest, ds):
    """Period with its limits; what is left of it beyond the strong one."""
    limit = {"color": "0.5", "linewidth": 0.8}
    period.plot(ds.mu, ds.period, color=COLOURS[0])
    period.plot(ds.mu, SLOW * ds.mu, "--", **limit)
    period.axhline(2.0 * math.pi, linestyle=":", **limit)
    direct_label(period, 1500.0, 200.0, r"$(3-2\,\ln 2)\,\mu$", "0.4")
    direct_label(period, 0.1, 4.4, r"$2\pi$", "0.4")
    rest.plot(ds.mu, ds.period - SLOW * ds.mu, color=COLOURS[0])
    rest.plot(ds.mu, NEXT * ds.mu ** (-1 / 3), "--", **limit)
    direct_label(rest, 400.0, 4.0, r"$7.0143\,\mu^{-1/3}$", "0.4")


main = script(__name__, "relaxation.h5", claims, figure)
