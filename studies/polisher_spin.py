"""Does a tool that spins polish more evenly, and how many settings does it need where times of dwell are off by 5 %?

    python studies/polisher_spin.py polisher_spin.h5

By docs/theory/polishing.md, a point of the work at w + r n moves under a disc at the arm's end c, that turns at the
rate k Omega, Omega that of the work about w, with
    v = J ((alpha' - k Omega) c + k Omega w + (k - 1) Omega r n),                                             (1)
J a right angle; rigid on the arm it turns as the arm does. A free tool turns as the work, k = 1, while it lies wholly
on the work. Where it hangs over the rim it turns otherwise, which is left out here, as is friction of its bearing.
Times of dwell, their errors, the unevenness and the search for settings are those of `polisher_robust`. Wear is
compared from 2 mm on, with 720 crank angles.
"""

import numpy as np
import xarray as xr
from _common import Claims, compared, differing, most, said, script
from _figures import COLOURS, DASHES, Axis, page, panel
from _polishing import KEPT, WANTED, Profiles, disc_points, fewest, of_machine, profiles, reached, swings, tool_wear
from scipy.optimize import brentq

SPINS = {"as the work": 1.0, "5 times": 5.0, "20 times": 20.0}
"""k of the tools whose sets of settings are looked for."""
FEWEST = {
    "rigid": ([4, 5, 7, 9], 0.865), "as the work": ([3, 5, 5, 7], 0.766), "5 times": ([3, 4, 5, 6], 0.498),
    "20 times": ([3, 4, 5, 5], 0.410),
}  # fmt: skip
"""Settings for `WANTED`, and what all settings reach [%], by twice as many crank angles."""


def wear(ds: xr.Dataset, motion: xr.Dataset, w: float, k: float | None, radius):
    """Mean wear of rings [m/s] by (1), over the arc of each that the disc covers, at one throw; k None: rigid."""
    a, work, rate = float(ds.tool_a), float(ds.Omega), motion.alpha_rate.values
    turn, centre = rate if k is None else k * work + 0 * rate, float(ds.L) * np.exp(1j * motion.alpha.values)
    way = abs(centre - w)[:, None]
    ahead = ((rate - turn) * centre + turn * w) * np.exp(-1j * np.angle(centre - w))  # from the work's centre on
    cosine = (radius**2 + way**2 - a * a) / (2 * np.maximum(radius, 1e-9) * way)
    half = np.arccos(np.clip(cosine, -1, 1))
    speed, (angle, ring) = np.zeros(half.shape), np.nonzero(half)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    turned, around = half[angle, ring][:, None] * nodes, ((turn - work)[angle] * radius[ring])[:, None]
    along, across = (part[angle][:, None] for part in (ahead.real, ahead.imag))
    speed[angle, ring] = np.hypot(along + around * np.cos(turned), across + around * np.sin(turned)) @ weights
    return float(ds.preston * ds.pressure) * (speed * half).mean(0) / (2 * np.pi)


@of_machine
def spun(ds: xr.Dataset, k: float | None) -> Profiles:
    """Profiles of all settings by a tool that spins so."""
    motion = swings(ds, ds.e.values)
    rows = [[wear(ds, motion.sel(e=e), w, k, ds.radius.values) for w in ds.w_x.values] for e in ds.e.values]
    return profiles(ds.assign(wear=(("e", "w_x", "radius"), np.array(rows))))


@of_machine
def spun_sets(ds: xr.Dataset) -> dict[str, dict[int, list[int]]]:
    """The best sets of settings (`fewest`) of those that spin."""
    return {name: fewest(spun(ds, k)) for name, k in SPINS.items()}


def prepared(ds):
    """The sweep, and by tool the profiles of all settings and the best few of them."""
    tools = {"rigid": profiles(ds)} | {name: spun(ds, k) for name, k in SPINS.items()}
    return ds, tools, {"rigid": fewest(tools["rigid"])} | spun_sets(ds)


def claims(ds, tools, sets) -> Claims:
    yield "A tool that spins"
    kernel = tools["rigid"]
    off = abs(spun(ds, None).rows - kernel.rows)[:, 1:] / kernel.rows.max(1, keepdims=True)
    yield most("rigid tool by (1), against the kernel: profiles", "0.5 %", off, 0.005)
    # what the work loses in all is what the points of the tool lose
    motion, work, fine = swings(ds, [0.1]), ds.sel(w_x=ds.L + 0.03, method="nearest"), np.linspace(0, 0.3, 601)
    places, share = disc_points(float(ds.tool_a))
    for name, k in SPINS.items():
        points = tool_wear(work, motion, places.real, places.imag, spin=k)[0]
        theory = np.pi * float(ds.tool_a) ** 2 * float((points * share).sum())
        ring = wear(ds, motion.isel(e=0), float(work.w_x), k, fine)
        here = 2 * np.pi * np.trapezoid(ring * fine, fine)
        yield compared(f"turns {name}: wear in all by the tool's points", f"{theory:.5g}", here, theory, 2e-3)
    # friction has no moment about the centre of a free disc on the work, here at 0.3 m/s

    def moment(k: float) -> float:
        v = 0.3 + 1j * (k - 1) * float(ds.Omega) * places
        return float(((np.conj(places) * v / abs(v)).imag * share).sum())

    yield differing("free disc wholly on the work: k", "1", brentq(moment, -3, 6), 1.0, 1e-6)

    yield "Few settings"
    wanted, errors = ", ".join(f"{100 * x:g}" for x in WANTED), []
    for name, p in tools.items():
        (needed, kept, drawn), (known, everything) = reached(p, sets[name]), FEWEST[name]
        here = ", ".join(map(str, needed)) + f"; least of the inner half {kept:.2f}"
        best = 100 * p.best(range(len(p.rows)))
        yield said(f"{name}: settings for {wanted} %, no hole", needed == known and kept > KEPT, here, f"{known}")
        yield compared("  all settings: expected [%]", f"{everything}", best, everything, 0.005)
        errors.append(drawn)
    yield most("errors drawn: largest deviation", "3 %", max(errors, key=abs), 0.03)


@panel(Axis("settings [1]"), Axis("expected unevenness [%]", (0, 4)), "best")
@panel(Axis(r"rate of the tool over $\Omega$, $k$ [1]"), Axis("unevenness, all settings [%]", (0, 1)), "best")
@page(124.0)
def figure(number, spin, ds, tools, sets):
    """Unevenness over the number of settings and over the spin."""
    for colour, dash, (name, p) in zip(COLOURS, DASHES, tools.items(), strict=False):
        few, look = sets[name], {"linestyle": dash, "markersize": 3, "color": colour, "label": name}
        number.plot(list(few), [100 * p.best(s) for s in few.values()], "o", **look)
    turns = (-20.0, -10.0, -5.0, -2.0, 0.0, 1.0, 2.0, 5.0, 10.0, 20.0)
    for delta, look, colour in ((0.05, "o-", COLOURS[0]), (0.0, "s--", COLOURS[1])):
        made = [(p, p.times(range(len(p.rows)), delta)) for p in (spun(ds, k) for k in turns)]
        found = [100 * p.expected(range(len(p.rows)), times, delta) for p, times in made]
        name = f"errors of {100 * delta:g} %" if delta else "exact times"
        spin.plot(turns, found, look, color=colour, markersize=3, label=name)


main = script(__name__, "polisher_spin.h5", claims, figure, prepared)
