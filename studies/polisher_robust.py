"""Which settings polish evenly when each time of dwell is off by some per cent, and how few of them are enough?

    python studies/polisher_robust.py polisher_robust.h5

By docs/theory/polishing.md the square of the unevenness to be expected of shares t_i of settings with profiles h_i,
    U^2 = |sum of t_i h_i - 1|^2 + delta^2 sum of t_i^2 |h_i - 1|^2,                                                 (1)
is what is left with exact times, and what errors add; non-negative least squares make it least at once. The best set of
k settings is that of all pairs and threes, and of more it is looked for by exchanging one setting at a time, from 25
starts. The unevenness is the standard deviation over the area, over the mean; the expected one a root of mean squares.
"""

import numpy as np
from _common import Claims, Statement, compared, held, most, said, script
from _figures import COLOURS, Axis, page, panel, points
from _polishing import DWELL, KEPT, WANTED, fewest, of_sets, profiles, reached, squares


def claims(p, sets) -> Claims:
    yield f"All settings, errors of {DWELL:.0%}"
    everything = range(len(p.rows))
    exact, robust = p.times(everything, 0.0), p.times(everything)
    yield most("  conditions of an optimum of (1)", "0", p.breach(robust), 1e-6, "largest breach")
    for name, times in (("exact times", exact), ("expected", robust)):
        theory, (here, below) = p.expected(everything, times), p.drawn(everything, times)
        nominal = p.nominal(everything, times)
        what = f"least {name}, {np.sum(times > 1e-9)} settings: {nominal:.2%} with exact times, with errors"
        yield compared(what, f"(1) {theory:.3%}", here, theory, 0.03)
        yield Statement("  19 of 20 pieces below", "", f"{below:.2%}")
    ratio = p.expected(everything, exact) / p.expected(everything, robust)
    yield held("  the one over the other", ratio, "> 1.2", "{:.3f}")

    yield "Few settings"
    for n, chosen in sets.items():
        nominal, best = p.nominal(chosen, p.times(chosen)), p.best(chosen)
        yield Statement(f"{n} settings: with exact times, with errors", "", f"{nominal:.2%}, {best:.3%}")
    needed, kept, drawn = reached(p, sets)
    known = [4, 5, 7, 9]  # of three and four all sets were tried, for more there may be better ones
    wanted = ", ".join(f"{100 * x:g}" for x in WANTED)
    equal = min(n for n, chosen in sets.items() if p.best(chosen) < p.expected(everything, exact))
    off = max(abs(float(of_sets(squares(p), chosen)) / p.best(chosen) - 1.0) for chosen in sets.values())
    yield most("  errors drawn: largest deviation from (1)", "3 %", drawn, 0.03)
    yield held("  fewest that are as good as the best for exact times", equal, "< 11", "{:.0f}")
    yield said(f"  fewest for {wanted} % with errors", needed == known, ", ".join(map(str, needed)), f"{known}")
    yield held("  least wear of the inner half of each", kept, f"> {KEPT}", "{:.2f} or more")
    yield most("  the least square of each set, by non-negative least squares", "0", off, 1e-9)


@panel(Axis("settings [1]"), Axis("unevenness [%]", (0, 3.5)), "best")
@panel(Axis("error of a time of dwell [%]"), Axis("expected unevenness [%]", (0, 3.5)), "best")
@page(124.0)
def figure(number, errors, p, sets):
    """Unevenness by the number of settings and by the errors of dwell."""
    everything, delta = range(len(p.rows)), np.linspace(0.0, 0.15, 31)
    exact = [100 * p.nominal(s, p.times(s)) for s in sets.values()]
    number.plot(list(sets), [100 * p.best(s) for s in sets.values()], "o-", color=COLOURS[0], label="expected")
    number.plot(list(sets), exact, "s--", color=COLOURS[1], markersize=3, label="with exact times")
    number.axhline(100 * p.best(everything), color="0.5", linewidth=0.8, label="expected, all settings")
    made = {"exact times": p.times(everything, 0.0), "errors of 5 %": p.times(everything)}
    for k, (name, times) in enumerate(made.items()):
        expected = [100 * p.expected(everything, times, d) for d in delta]
        errors.plot(100 * delta, expected, color=COLOURS[k], label=f"all settings, best for {name}")
        drawn = [100 * p.drawn(everything, times, d)[0] for d in (0.0, 0.05, 0.1)]
        points(errors, (0, 5, 10), drawn, k, marker="o", markersize=3.5)
    best = [100 * p.best(everything, d) for d in delta]
    errors.plot(100 * delta, best, "k--", linewidth=0.8, label="all settings, best for each error")


main = script(__name__, "polisher_robust.h5", claims, figure, lambda ds: (p := profiles(ds), fewest(p)))
