"""Which settings polish evenly when each time of dwell is off by some per cent, and how few of them are enough?

    python studies/polisher_robust.py polisher_robust.h5

Let h_i(r) be the profile of setting i over its own mean, t_i >= 0 its share of the wear, of sum 1, and each time of
dwell off by a factor 1 + delta z_i, z_i independent of variance 1. To the order of delta^2 the square of the
unevenness to be expected is
    U^2 = |sum of t_i h_i - 1|^2 + delta^2 sum of t_i^2 |h_i - 1|^2,                                                 (1)
|f|^2 the mean of f^2 over the area: what is left with exact times, and what errors add. Both are squares that are
linear in t, so the t >= 0 that make U least are found by non-negative least squares at once. The best set of k settings
is that of all pairs and threes, and of more it is looked for by exchanging one setting at a time, from 25 starts.

The unevenness is the standard deviation over the area, over the mean; the expected one is the root of its mean square.
Allowed are 3 % of (1) for 4000 draws of the errors, and 1e-6 of the conditions of an optimum.
"""

import numpy as np
from _common import Claims, Statement, compared, most, said, script
from _figures import COLOURS, panels
from _polishing import DWELL, KEPT, WANTED, fewest, of_sets, profiles, reached

FEWEST = [4, 5, 7, 9]
"""Settings for 2, 1.5, 1.2 and 1 %; of three and four all sets were tried, for more there may be better ones."""


def prepared(ds):
    """Profiles of all settings, and the best few of them."""
    p = profiles(ds)
    return p, fewest(p)


def claims(p, sets) -> Claims:
    """What theory says, and what comes out."""
    yield f"All settings, errors of {DWELL:.0%}"
    everything = range(len(p.rows))
    exact, robust = p.times(everything, 0.0), p.times(everything)
    yield most("  conditions of an optimum of (1)", "0", p.breach(robust), 1e-6, "largest breach")
    for name, times in (("exact times", exact), ("expected", robust)):
        theory, (here, below) = p.expected(everything, times), p.drawn(everything, times)
        nominal = p.nominal(everything, times)
        what = f"least {name}, {np.sum(times > 1e-9)} settings: {nominal:.2%} with exact times, with errors"
        yield compared(what, f"(1) {theory:.3%}", here, theory, 0.03, 4)
        yield Statement("  19 of 20 pieces below", "", f"{below:.2%}")
    gain = p.expected(everything, exact) / p.expected(everything, robust)
    yield said("  the one over the other", gain > 1.2, f"{gain:.3f}", "> 1.2")

    yield "Few settings"
    everything = range(len(p.rows))
    for n, chosen in sets.items():
        nominal, best = p.nominal(chosen, p.times(chosen)), p.best(chosen)
        yield Statement(f"{n} settings: with exact times, with errors", "", f"{nominal:.2%}, {best:.3%}")
    needed, kept, drawn = reached(p, sets)
    exact, wanted = p.expected(everything, p.times(everything, 0.0)), ", ".join(f"{100 * x:g}" for x in WANTED)
    equal = min(n for n, chosen in sets.items() if p.best(chosen) < exact)
    off = max(abs(float(of_sets(p, chosen)) / p.best(chosen) - 1.0) for chosen in sets.values())
    yield most("  errors drawn: largest deviation from (1)", "3 %", drawn, 0.03)
    yield said("  fewest that are as good as the best for exact times", equal < 11, f"{equal}")
    yield said(f"  fewest for {wanted} % with errors", needed == FEWEST, ", ".join(map(str, needed)), f"{FEWEST}")
    yield said("  least wear of the inner half of each", kept > KEPT, f"{kept:.2f} or more", f"> {KEPT}")
    yield most("  the least square of each set, by non-negative least squares", "0", off, 1e-9)


@panels(124.0, 2)
def figure(number, errors, p, sets):
    """Unevenness by the number of settings and by the errors of dwell."""
    everything, delta = range(len(p.rows)), np.linspace(0.0, 0.15, 31)
    exact = [100 * p.nominal(s, p.times(s)) for s in sets.values()]
    number.plot(list(sets), [100 * p.best(s) for s in sets.values()], "o-", color=COLOURS[0], label="expected")
    number.plot(list(sets), exact, "s--", color=COLOURS[1], markersize=3, label="with exact times")
    number.axhline(100 * p.best(everything), color="0.5", linewidth=0.8, label="expected, all settings")
    number.set(xlabel="settings [1]", ylabel="unevenness [%]", ylim=(0, 3.5))
    made = {"exact times": p.times(everything, 0.0), "errors of 5 %": p.times(everything)}
    for colour, (name, times) in zip(COLOURS, made.items(), strict=False):
        expected = [100 * p.expected(everything, times, d) for d in delta]
        errors.plot(100 * delta, expected, color=colour, label=f"all settings, best for {name}")
        drawn = [100 * p.drawn(everything, times, d)[0] for d in (0.0, 0.05, 0.1)]
        errors.plot((0, 5, 10), drawn, "o", color=colour, markerfacecolor="white", markersize=3.5)
    best = [100 * p.best(everything, d) for d in delta]
    errors.plot(100 * delta, best, "k--", linewidth=0.8, label="all settings, best for each error")
    errors.set(xlabel="error of a time of dwell [%]", ylabel="expected unevenness [%]", ylim=(0, 3.5))
    for axes in (number, errors):
        axes.legend()


main = script(__name__, "polisher_robust.h5", claims, figure, prepared)
