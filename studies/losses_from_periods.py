"""What does a clock's period at twelve torques, to a per cent, say of the shares of its losses?

    python studies/losses_from_periods.py losses_from_periods.h5

`clock_losses` fits the kernel to measured periods, and to amplitudes where there are any; here it is tried on clocks
whose losses are known. What noise can do at all follows from the sensitivity matrix J, dlnP/du and dlnA/du over the
noise, of the losses u: (J^T J)^-1 is the covariance of u, and a direction of small singular value cannot be measured.
At large swings drag of degree 2 and impacts have the same exponent, 1/2, and half dry friction, half of these nearly
that of viscous friction, so a period tells dry friction from the rest, and the amplitude, v^2/(2 mu), has to tell these
apart.

The noise is 1 % of each period and amplitude. Errors are standard errors of shares, predicted by J. An interval of
95 % misses the truth where the best fit with the true share is more than 3.84 worse than the best of all;
benchmarks/honesty/losses_coverage.py counts this for a thousand clocks.
"""

from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, differing, held, most, said, script, solved
from _figures import COLOURS, Log, page, panel
from clock_losses import SHARES, SUM, THRESHOLD, Measured, forecast

NOISE = 0.01


def measured(ds: xr.Dataset, clock: int, noise: float = 0.0) -> Measured:
    """What is measured of a clock of the result."""
    one, dice = ds.isel(point=clock), np.random.default_rng([1, clock])
    numbers = (np.exp(np.log(x) + noise * dice.standard_normal(x.size)).values for x in (one.period, one.amplitude))
    return Measured(ds.mu.values, *numbers, float(ds.phi0), NOISE)


def losses(ds: xr.Dataset, clock: int, like: Measured):
    """The true losses, in the units of a measurement."""
    one = ds.isel(point=clock)
    return np.array([one.R, one.a, one.c, 1.0 - one.e**2], float) / like.units


def matrices(ds: xr.Dataset, over: float, amplitude: bool, number: int = 12) -> tuple[Any, Any, Any]:
    """Torques spread evenly in ln mu over this factor about the middle, and `Measured.matrix` of the first clock."""
    one, middle = ds.isel(point=0), measured(ds, 0).middle
    least = max(middle / np.sqrt(over), 1.05 * float(one.R))
    mu = np.append(np.geomspace(least, least * over, number), middle)  # at which the shares are meant
    clock = {name: one[name] for name in ("R", "a", "c", "n", "e", "phi0")}
    cells = solved("foliot", mu=mu, **clock, rtol=1e-10)
    swing = cells.amplitude.values if amplitude else None
    there = Measured(mu, cells.period.values, swing, float(one.phi0), NOISE)
    J, by_u = there.matrix(losses(ds, 0, there))
    return mu[:-1], np.delete(J, range(number, len(J), number + 1), axis=0), by_u


def claims(ds, clocks) -> Claims:
    yield "What can be known"
    for over in (3.0, 10.0, 30.0):
        (alone, weak), (both, strong) = (forecast(*matrices(ds, over, amplitude)[1:]) for amplitude in (False, True))
        if over < 20.0:
            unknown, theory = alone[:4].min() > 0.5, "all > .5"
        else:
            unknown, theory = alone[0] < 0.125 and alone[2:4].min() > 0.5, "dry < 1/8, drag and impacts > .5"
        texts = (", ".join(f"{x:.2g}" for x in errors) for errors in (alone[:4], both))
        what = f"torques over a factor {over:g}: error of dry, viscous, drag, impacts"
        yield said(what, unknown, next(texts), theory)
        yield most("  with amplitudes, and of drag with impacts", "< .3", both.max(), 0.3, next(texts))
        least = "  least singular value, by periods alone, over that with amplitudes"
        yield most(least, "< 1/5", weak[-1] / strong[-1], 0.2, f"{weak[-1]:.3g} / {strong[-1]:.3g}")

    yield "Which torques to measure"
    # compared are the sums of the variances of the four shares, square rooted, and 12 torques spread evenly
    mu, J, by_u = matrices(ds, 10.0, True, 25)
    pairs = J.reshape(2, 25, 4).transpose(1, 0, 2)

    def error(places) -> float:
        return float(np.linalg.norm(forecast(pairs[places].reshape(-1, 4), by_u)[0][:4]))

    even = places = [*np.round(np.linspace(0, 24, 12)).astype(int)]
    for _ in range(60):  # each place in turn goes for the best of all: five rounds
        places = min(([*places[1:], k] for k in range(25)), key=error)
    values, counts = np.unique(np.round(mu[places], 1), return_counts=True)
    text = ", ".join(f"{n} x {x:g}" for x, n in zip(values, counts, strict=True))
    together, ratio = "  error of the four shares together, over that of even ones", error(places) / error(even)
    yield said("12 best torques within a factor 10, by exchange", len(values) < 7, text)
    yield held(together, ratio, "< 0.95")

    yield "Clocks of known losses"
    kept, off, sums = [], [], []
    for clock in range(clocks):
        exact, noisy = measured(ds, clock), measured(ds, clock, NOISE)
        true, found = (SUM @ exact.predicted(u[None])[1][0] for u in (losses(ds, clock, exact), exact.fit()[0]))
        off.append(found - true)
        best, least = noisy.fit()
        sums.append(least)
        shares = range(len(SHARES)) if clocks > 1 else (0, 4)
        kept += [noisy.fit(share, true[share], best)[1] - least < THRESHOLD for share in shares]
    over = "  sum of squares over the noise, mean; 24 numbers, 4 losses"
    hold = "  with noise: intervals of 95 % that hold the true share"
    yield most(f"{clocks} clocks without noise: shares fitted", "1e-3", np.array(off), 1e-3)
    yield held(hold, np.mean(kept), ">= 4/5", f"{{:.0%}} of {len(kept)}")
    yield differing(over, "20", np.mean(sums), 20.0, 3.0 * np.sqrt(40.0 / clocks))


SPREAD = Log("largest over least torque [1]", None, (2, 5, 10, 20, 50))


@panel(SPREAD, Log("standard error of a share [1]", (2e-3, 5)), "lower left", {"periods alone": "--"}, ncols=2)
@page(84.0)
def figure(axes, ds, *_):
    """Forecast errors of the shares over the spread of the torques."""
    spreads = np.geomspace(2.0, 60.0, 12)
    for dashes, amplitude in (("--", False), ("-", True)):
        errors = np.array([forecast(*matrices(ds, over, amplitude)[1:])[0] for over in spreads])
        for k, name in enumerate(SHARES):
            axes.plot(spreads, errors[:, k], dashes, color=COLOURS[k], label=name if amplitude else None)
    axes.axhline(0.25, color="0.6", linewidth=0.6)


main = script(
    __name__, "losses_from_periods.h5", claims, figure, lambda ds, tell=True: (ds, ds.sizes["point"] if tell else 1)
)
