"""What does a clock's period at twelve torques, to a per cent, say of the shares of its losses?

    sweep run studies/losses_from_periods.toml
    python studies/losses_from_periods.py losses_from_periods.h5

draws losses_from_periods.png and prints what comes out. `clock_losses` fits the kernel to measured periods, and to
amplitudes where there are any, and gives intervals of the shares; here it is tried on clocks whose losses are known.
What noise can do at all follows from the sensitivity matrix J, dlnP/du and dlnA/du over the noise, of the losses u:
what the numbers say of u is worth the singular values of J, and (J^T J)^-1 is the covariance of u; a direction of small
singular value cannot be measured. With s by the shares alone, L = (N + lambda_e)/(N + 2) at large swings, drag of
degree 2 and impacts have the same exponent, 1/2, and half dry friction, half of these nearly that of viscous friction,
so a period tells dry friction from the rest, and the amplitude, v^2/(2 mu), has to tell these apart.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, page_of, plain_ticks, read_result, report
from clock_losses import SHARES, SUM, THRESHOLD, Measured, forecast

import sweep
from sweep.show.charts import COLOURS

CLOCKS = ("equal shares", "mostly dry", "mostly viscous", "mostly drag", "mostly impacts")
NOISE = 0.01
SPREADS = (3.0, 10.0, 30.0)
"""Largest over least torque."""
SEED = 1

NOTES = """\
noise of 1 % of each period and amplitude; errors are standard errors of shares, forecast by the sensitivity matrix. An
interval of 95 % misses where the best fit with the true share is more than 3.84 worse than the best of all; counted for
a thousand clocks by benchmarks/honesty/losses_coverage.py
"""


def measured(ds: xr.Dataset, clock: int, amplitude: bool, noise: float = 0.0, seed: int = SEED) -> Measured:
    """What is measured of a clock of the result."""
    one, dice = ds.isel(point=clock), np.random.default_rng([seed, clock])
    period, swing = (np.exp(np.log(x) + noise * dice.standard_normal(x.size)) for x in (one.period, one.amplitude))
    return Measured(ds.mu.values, period.values, swing.values if amplitude else None, float(ds.phi0), NOISE)


def losses(ds: xr.Dataset, clock: int, like: Measured) -> Any:
    """The true losses, in the units of a measurement."""
    one = ds.isel(point=clock)
    return np.array([one.R, one.a, one.c, 1.0 - one.e**2], float) / like.units


def matrices(ds: xr.Dataset, clock: int, over: float, amplitude: bool, count: int = 12) -> tuple[Any, Any, Any]:
    """Torques spread evenly in ln mu over this factor about the middle, and `Measured.matrix` of a clock there."""
    middle, one = measured(ds, clock, False).middle, ds.isel(point=clock)
    least = max(middle / np.sqrt(over), 1.05 * float(one.R))
    mu = np.append(np.geomspace(least, least * over, count), middle)
    fixed = {name: float(one[name]) for name in ("R", "a", "c", "n", "e", "phi0")}
    cells = sweep.run(sweep.study(kernel="foliot", axes={"mu": mu}, fixed=fixed, rtol=1e-10))
    there = Measured(mu, cells.period.values, cells.amplitude.values if amplitude else None, fixed["phi0"], NOISE)
    J, by_u = there.matrix(losses(ds, clock, there))
    return mu[:-1], np.delete(J, [count, 2 * count + 1] if amplitude else [count], axis=0), by_u


def best_torques(ds: xr.Dataset, over: float = 10.0) -> tuple[Any, float, float]:
    """12 torques of 25, some of them more than once, at which the shares vary least, by exchange.

    And the sum of the variances of the four shares there, and at 12 torques spread evenly, both square rooted.
    """
    mu, J, by_u = matrices(ds, 0, over, True, 25)
    pairs = J.reshape(2, 25, 4).transpose(1, 0, 2)

    def error(places: Any) -> float:
        return float(np.linalg.norm(forecast(pairs[places].reshape(-1, 4), by_u)[0][:4]))

    places, least = np.round(np.linspace(0, 24, 12)).astype(int), np.inf
    even = error(places)
    while error(places) < least - 1e-12:
        least = error(places)
        for i in range(12):
            trials = [np.append(np.delete(places, i), k) for k in range(25)]
            places = min(trials, key=error)
    return np.sort(mu[places]), error(places), even


def knowable(ds: xr.Dataset) -> list[Statement]:
    """Forecast errors by spread of the torques, with and without amplitudes, for the clock of equal shares."""
    lines = []
    for over in SPREADS:
        (alone, weak), (both, strong) = (forecast(*matrices(ds, 0, over, amplitude)[1:]) for amplitude in (False, True))
        what = f"torques over a factor {over:g}: "
        lines += [
            Statement(what + "error of dry, viscous, drag, impacts", "", _row(alone[:4])),
            Statement("  with amplitudes, and of drag with impacts", "< .3", _row(both), float(both.max()),
                      bool(both.max() < 0.3)),
            Statement("  singular values, by periods; with amplitudes", "", f"{_row(weak, 3)}; {_row(strong, 3)}"),
        ]  # fmt: skip
        if over == 10.0:
            worth = float(weak[-1] / strong[-1])
            lines.append(Statement("  the least, by periods alone, over that with amplitudes", "< 1/10", f"{worth:.3f}",
                                   worth, worth < 0.1))  # fmt: skip
            off = float(alone[3] / alone[0])
            lines.append(Statement("  by periods alone: error of impacts over that of dry", "> 3", f"{off:.1f}", off,
                                   off > 3.0))  # fmt: skip
    return lines


def _row(values: Any, digits: int = 2) -> str:
    return ", ".join(f"{x:.{digits}g}" for x in values)


def covered(ds: xr.Dataset, clocks: int) -> list[Statement]:
    """One noisy measurement of each clock: whether the best fit comes back, and intervals hold the true shares."""
    held, worst, sums = [], 0.0, []
    for clock in range(clocks):
        exact, noisy = measured(ds, clock, True), measured(ds, clock, True, NOISE)
        u = losses(ds, clock, exact)
        true = SUM @ exact.predicted(u[None])[1][0]
        worst = max(worst, float(abs(SUM @ exact.predicted(exact.fit()[0][None])[1][0] - true).max()))
        best, least = noisy.fit()
        sums.append(least)
        shares = range(len(SHARES)) if clocks > 1 else (0, 4)
        held += [noisy.fit(share, true[share], best)[1] - least < THRESHOLD for share in shares]
    mean = float(np.mean(sums))
    enough = 20.0 - 3.0 * np.sqrt(40.0 / clocks) < mean < 20.0 + 3.0 * np.sqrt(40.0 / clocks)
    count = f"{sum(held)} of {len(held)}"
    return [
        Statement(f"{clocks} clocks without noise: shares fitted", "1e-3", "largest deviation", worst, worst < 1e-3),
        Statement("  with noise: intervals of 95 % that hold the true share", "> 4/5", count, float(np.mean(held)),
                  bool(np.mean(held) >= 0.8)),
        Statement("  sum of squares over the noise, mean; 24 numbers, 4 losses", "20", f"{mean:.1f}", mean / 20 - 1,
                  bool(enough)),
    ]  # fmt: skip


def chosen(ds: xr.Dataset) -> list[Statement]:
    """Which torques to measure."""
    mu, least, even = best_torques(ds)
    values, counts = np.unique(np.round(mu, 1), return_counts=True)
    text = ", ".join(f"{n} x {x:g}" for x, n in zip(values, counts, strict=True))
    return [
        Statement("12 best torques within a factor 10, by exchange", "", text, None, bool(len(values) < 7)),
        Statement("  error of the four shares together, over that of even ones", "< 0.95", f"{least:.3f} / {even:.3f}",
                  least / even, bool(least < 0.95 * even)),
    ]  # fmt: skip


def figure(ds: xr.Dataset, clocks: int) -> Any:
    """What can be known by the spread of the torques, and intervals of known clocks; for two columns of print."""
    with page_of(72.0, 1, 2) as (page, (left, right)):
        draw_spread(left, ds)
        draw_intervals(right, ds, clocks)
    return page


def draw_spread(axes: Any, ds: xr.Dataset) -> None:
    """Forecast errors over the spread of the torques, by periods alone and with amplitudes."""
    spreads = np.geomspace(2.0, 60.0, 12)
    for dashes, amplitude in (("--", False), ("-", True)):
        errors = np.array([forecast(*matrices(ds, 0, over, amplitude)[1:])[0] for over in spreads])
        for k, name in enumerate(SHARES):
            label = name if amplitude else None
            axes.loglog(spreads, errors[:, k], dashes, color=COLOURS[k], label=label)
    axes.plot([], [], "--", color="black", label="periods alone")
    axes.axhline(0.25, color="0.6", linewidth=0.6)
    axes.set(xlabel="largest over least torque [1]", ylabel="standard error of a share [1]", ylim=(2e-3, 5))
    plain_ticks(axes.xaxis, (2, 5, 10, 20, 50))
    axes.legend(fontsize=6.5, ncols=2, loc="lower left")


def draw_intervals(axes: Any, ds: xr.Dataset, clocks: int) -> None:
    """Intervals of 95 % of each clock, beside the true shares."""
    for clock in range(clocks):
        noisy = measured(ds, clock, True, NOISE)
        true = SUM @ noisy.predicted(losses(ds, clock, noisy)[None])[1][0]
        best = noisy.fit()
        for k, name in enumerate(SHARES):
            low, here, high = noisy.interval(k, best)
            x = clock + 0.16 * (k - 2)
            axes.plot(
                [x, x],
                [low, high],
                color=COLOURS[k],
                linewidth=2.2,
                solid_capstyle="butt",
                label=None if clock else name,
            )
            axes.plot(x, here, "_", color=COLOURS[k], markersize=5)
            axes.plot(x, true[k], "o", color="black", markerfacecolor="white", markersize=3)
    axes.plot([], [], "o", color="black", markerfacecolor="white", markersize=3, label="true")
    axes.tick_params(axis="x", which="minor", bottom=False, top=False)
    axes.set_xticks(range(len(CLOCKS)), [name.replace(" ", "\n") for name in CLOCKS], fontsize=7)
    axes.set(ylabel="share of the loss [1]", ylim=(-0.03, 1.35))
    axes.legend(fontsize=6.5, ncols=3, loc="upper left")


def conclude(path: str, tell: bool = True) -> tuple[Groups, list[str], Any]:
    """Statements and the figure; `tell`: all shares of all clocks are fitted, not two of the first."""
    clocks = len(CLOCKS) if tell else 1
    ds = read_result(path, "foliot", ["point", "mu"], "losses_from_periods.toml")
    groups = {
        "What can be known": knowable(ds),
        "Which torques to measure": chosen(ds),
        "Clocks of known losses": covered(ds, clocks),
    }
    return groups, [NOTES], lambda: figure(ds, clocks if tell else 0)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the result that is named; 1 if a statement does not hold."""
    return report(__file__, ["losses_from_periods.h5"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
