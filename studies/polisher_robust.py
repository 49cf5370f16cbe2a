"""Which settings polish evenly when each time of dwell is off by some per cent, and how few of them are enough?

    sweep run studies/polisher_robust.toml
    python studies/polisher_robust.py polisher_robust.h5

draws polisher_robust.png and prints what comes out. Let h_i(r) be the profile of setting i over its own mean, t_i >= 0
its share of the wear, of sum 1, and each time of dwell off by a factor 1 + delta z_i, z_i independent of variance 1.
To the order of delta^2 the square of the unevenness to be expected is
    U^2 = |sum of t_i h_i - 1|^2 + delta^2 sum of t_i^2 |h_i - 1|^2,                                                 (1)
|f|^2 the mean of f^2 over the area: what is left with exact times, and what errors add. Both are squares that are
linear in t, so the t >= 0 that make U least are found by non-negative least squares at once. The best set of k settings
is looked for by exchanging one setting at a time, in sets that grow from a pair and in large ones that shrink.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from _common import Conclusion, Statement, compared, most, read_result, said, script
from _figures import page_of
from _polishing import KEPT, POINTS, area, disc, least, unevenness
from scipy.optimize import nnls

from sweep.show.charts import COLOURS

DWELL = 0.05
"""delta: what a hand at a switch keeps."""
SEVERAL = (2, 3, 4, 5, 6, 7, 8, 10)
"""Numbers of settings."""
DRAWS = 4000

NOTES = """\
unevenness: standard deviation over the area, over the mean; expected: root of its mean square. Allowed: 3 % of (1) for
4000 draws of the errors, 1e-6 of the conditions of an optimum
"""


class Profiles(NamedTuple):
    """Profiles of mean 1, (setting, radius), weights of the radii, |h_i - 1|, radii and settings."""

    rows: Any
    weight: Any
    rough: Any
    radius: Any
    places: list[tuple[float, float]]

    def times(self, chosen: Any, delta: float = DWELL) -> Any:
        """The shares of these settings that make (1) least."""
        chosen, root = list(chosen), np.sqrt(self.weight)
        kept = delta * np.diag(self.rough[chosen])
        found, _ = nnls(np.vstack([self.rows[chosen].T * root[:, None], kept]), np.append(root, np.zeros(len(chosen))))
        return found / found.sum()

    def nominal(self, chosen: Any, times: Any) -> float:
        """Unevenness with exact times."""
        return float(unevenness(times @ self.rows[list(chosen)], self.weight))

    def expected(self, chosen: Any, times: Any, delta: float = DWELL) -> float:
        """U of (1)."""
        return float(np.hypot(self.nominal(chosen, times), delta * np.linalg.norm(times * self.rough[list(chosen)])))

    def best(self, chosen: Any, delta: float = DWELL) -> float:
        """U of these settings at their best."""
        return self.expected(chosen, self.times(chosen, delta), delta)

    def drawn(self, chosen: Any, times: Any, delta: float = DWELL) -> Any:
        """Unevenness with drawn errors of dwell: root of the mean square, and below which 19 of 20 pieces are."""
        errors = 1.0 + delta * np.random.default_rng(1).standard_normal((DRAWS, len(times)))
        found = unevenness((times * errors) @ self.rows[list(chosen)], self.weight)
        return float(np.sqrt(np.mean(found**2))), np.quantile(found, 0.95)


def profiles(ds: xr.Dataset) -> Profiles:
    """Of a result over e and w_x."""
    weight, stacked = area(ds.radius), ds.wear.stack(setting=("e", "w_x")).transpose("setting", "radius")
    rows = stacked.values / (stacked.values * weight).sum(1, keepdims=True)
    places = [(float(e), float(w) - float(ds.L)) for e, w in stacked.setting.values]
    return Profiles(rows, weight, unevenness(rows, weight), ds.radius.values, places)


def exchanged(p: Profiles, chosen: list[int]) -> list[int]:
    """The set with one setting after another exchanged as long as that helps."""
    least_yet = np.inf
    while p.best(chosen) < least_yet - 1e-9:
        least_yet = p.best(chosen)
        for i in range(len(chosen)):
            rest = chosen[:i] + chosen[i + 1 :]
            chosen = [*rest, min((k for k in range(len(p.rows)) if k not in rest), key=lambda k: p.best([*rest, k]))]
    return chosen


def fewest(p: Profiles) -> dict[int, list[int]]:
    """The best set for each number of settings that was found: grown from a pair, and shrunk from a large one."""
    everything = list(range(len(p.rows)))
    grown: dict[int, list[int]] = {}
    chosen = exchanged(p, everything[:2])
    for n in range(2, SEVERAL[-1] + 1):
        grown[n] = chosen if n == 2 else exchanged(p, chosen)
        chosen = [*grown[n], min((k for k in everything if k not in grown[n]), key=lambda k: p.best([*grown[n], k]))]
    chosen = grown[SEVERAL[-1]]
    for n in range(SEVERAL[-1] - 1, 1, -1):
        chosen = min((chosen[:i] + chosen[i + 1 :] for i in range(len(chosen))), key=p.best)
        grown[n] = min(grown[n], exchanged(p, chosen), key=p.best)
    return {n: grown[n] for n in SEVERAL}


def optimum(p: Profiles) -> list[Statement]:
    """The best of all settings, beside the best with exact times."""
    everything = range(len(p.rows))
    exact, robust = p.times(everything, 0.0), p.times(everything)
    mixed = robust @ p.rows
    scale = 1.0 / float(p.weight @ mixed**2 + DWELL**2 * robust**2 @ p.rough**2)  # the least squares' own size
    slope = p.rows @ ((scale * mixed - 1.0) * p.weight) + DWELL**2 * p.rough**2 * scale * robust
    breach = max(abs(slope[robust > 1e-9]).max(), -slope[robust <= 1e-9].min())
    lines = [most("  conditions of an optimum of (1)", "0", breach, 1e-6, "largest breach")]
    for name, times in (("exact times", exact), ("expected", robust)):
        theory, (here, below) = p.expected(everything, times), p.drawn(everything, times)
        nominal = p.nominal(everything, times)
        what = f"least {name}, {np.sum(times > 1e-9)} settings: {nominal:.2%} with exact times, with errors"
        lines.append(compared(what, f"(1) {theory:.3%}", here, theory, 0.03, 4))
        lines.append(Statement("  19 of 20 pieces below", "", f"{below:.2%}"))
    gain = p.expected(everything, exact) / p.expected(everything, robust)
    kept = float(least(mixed, p.weight, p.radius))
    return [
        *lines,
        Statement("  the one over the other", "> 1.2", f"{gain:.3f}", gain, gain > 1.2),
        Statement("  least wear of the inner half over the mean", f"> {KEPT}", f"{kept:.2f}", kept, kept > KEPT),
    ]


def few(ds: xr.Dataset, p: Profiles, sets: dict[int, list[int]]) -> list[Statement]:
    """What a few settings reach, three of them solved once more."""
    everything, lines = range(len(p.rows)), []
    for n, chosen in sets.items():
        times = p.times(chosen)
        theory, what = p.expected(chosen, times), f"{n} settings: {p.nominal(chosen, times):.2%}"
        here = p.drawn(chosen, times)[0]
        lines.append(compared(f"{what} with exact times, with errors", f"(1) {theory:.3%}", here, theory, 0.03, 4))
    exact = p.expected(everything, p.times(everything, 0.0))
    enough = min(n for n, chosen in sets.items() if p.best(chosen) < exact)
    worst = min(p.best(chosen) for chosen in sets.values()) / p.best(everything)
    pair = min(p.best([i, k]) for i in everything for k in range(i))
    throw, offset = np.array([p.places[i] for i in sets[3]]).T
    solved = ds.wear.stack(setting=("e", "w_x")).transpose("setting", "radius").values[sets[3]]
    again = np.asarray(disc(ds)(throw, float(ds.L) + offset))[:, :: (POINTS - 1) // (ds.radius.size - 1)]
    off = abs(solved - again).max() / again.max()
    return [
        *lines,
        said("  fewest that are as good as the best for exact times", enough < 11, f"{enough}"),
        Statement("  no set is better than all settings", ">= 1", f"{worst:.3f}", worst - 1, worst >= 1),
        compared("  the best pair, of all pairs", f"{pair:.5f}", p.best(sets[2]), pair, 1e-9, 5),
        most("  profiles of the three settings, solved again", "1e-4", off, 1e-4),
    ]


def figure(p: Profiles, sets: dict[int, list[int]]) -> Any:
    """Unevenness by the number of settings, by the errors of dwell, and profiles; for two columns of print."""
    everything, delta = range(len(p.rows)), np.linspace(0.0, 0.15, 31)
    with page_of(62.0, 1, 3) as (page, (number, errors, mixed)):
        exact = [100 * p.nominal(s, p.times(s)) for s in sets.values()]
        number.plot(list(sets), [100 * p.best(s) for s in sets.values()], "o-", color=COLOURS[0], label="expected")
        number.plot(list(sets), exact, "s--", color=COLOURS[1], markersize=3, label="with exact times")
        number.axhline(100 * p.best(everything), color="0.5", linewidth=0.8, label="expected, all settings")
        number.set(xlabel="settings [1]", ylabel="unevenness [%]", ylim=(0, 3.5))
        made = {"exact times": p.times(everything, 0.0), "errors of 5 %": p.times(everything)}
        for colour, (name, times) in zip(COLOURS, made.items(), strict=False):
            expected = [100 * p.expected(everything, times, d) for d in delta]
            errors.plot(100 * delta, expected, color=colour, label=f"best for {name}")
            for d in (0.0, 0.05, 0.1):
                drawn, look = 100 * p.drawn(everything, times, d)[0], {"markerfacecolor": "white", "markersize": 3.5}
                errors.plot(100 * d, drawn, "o", color=colour, **look)
        best = [100 * p.best(everything, d) for d in delta]
        errors.plot(100 * delta, best, "k--", linewidth=0.8, label="best for each error")
        errors.set(xlabel="error of a time of dwell [%]", ylabel="expected unevenness [%]", ylim=(0, 3.5))
        shown = {"3 settings": sets[3], "8 settings": sets[8], "all settings": list(everything)}
        for colour, (name, chosen) in zip(COLOURS, shown.items(), strict=False):
            mixed.plot(1e3 * p.radius, p.times(chosen) @ p.rows[chosen], color=colour, label=name)
        mixed.set(xlabel="radius [mm]", ylabel="wear over its mean [1]", ylim=(0.8, 1.12), xlim=(0, 1e3 * p.radius[-1]))
        for axes in (number, errors, mixed):
            axes.legend(fontsize=6.5)
    return page


def conclude(path: str) -> Conclusion:
    """Statements and the figure."""
    ds = read_result(path, "polisher_wear", ["e", "w_x"], "polisher_robust.toml")
    p = profiles(ds)
    sets = fewest(p)
    groups = {f"All settings, errors of {DWELL:.0%}": optimum(p), "Few settings": few(ds, p, sets)}
    return groups, [NOTES], lambda: figure(p, sets)


main = script(__name__, "polisher_robust.h5", conclude)
