"""What studies of a polishing machine share: how uneven a profile is, the best of one and of few settings."""

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from _common import solved
from scipy.optimize import nnls

import sweep

KEPT = 0.5
"""Least wear, over the mean, of the inner half of a workpiece without a hole."""
POINTS = 101
"""Radii of a profile that is optimised: a hole may be a ring of a millimetre beside the centre."""


def area(radius: Any) -> Any:
    """The share of the area at each of evenly spaced radii from the centre to the rim, by trapezoids of 2 pi r."""
    found = np.array(radius, float)
    found[-1] *= 0.5
    return found / found.sum()


def unevenness(profile: Any, weight: Any) -> Any:
    """Standard deviation over the area, over the mean, of profiles (..., radius)."""
    mean = (profile * weight).sum(-1, keepdims=True)
    return np.sqrt((((profile / mean) - 1.0) ** 2 * weight).sum(-1))


def least(profile: Any, weight: Any, radius: Any) -> Any:
    """The least wear of the inner half of the radius, over the mean: a small one is a hole."""
    return profile[..., radius <= 0.5 * radius[-1]].min(-1) / (profile * weight).sum(-1)


@dataclass(frozen=True)
class Setting:
    """One throw and offset [m] with the unevenness, the least wear of the inner half over the mean, and the profile."""

    e: float
    offset: float
    uneven: float
    least: float
    profile: Any

    def __str__(self) -> str:
        place = f"e = {100 * self.e:.2f} cm, offset {1000 * self.offset:.1f} mm"
        return f"{self.uneven:.1%} at {place}, least {self.least:.2f}"


DWELL = 0.05
"""Standard error of a time of dwell: what a hand at a switch keeps."""
WANTED = (0.02, 0.015, 0.012, 0.01)
"""Unevenness to be expected, for which the fewest settings are looked for."""


def machine(ds: xr.Dataset) -> dict[str, float]:
    """What says a result's machine, but for throw and offset."""
    names = ("b", "d", "f", "omega", "b_angle", "L", "Omega", "tool_a", "preston", "pressure")
    return {name: float(ds[name]) for name in names}


def of_machine(function: Callable[..., Any]) -> Callable[..., Any]:
    """Makes once what hangs on the machine of a result alone, and on further arguments."""
    made: dict[Any, Any] = {}

    @functools.wraps(function)
    def found(ds: xr.Dataset, *more: Any) -> Any:
        key = (float(ds.radius[-1]), *machine(ds).values(), *more)
        if key not in made:
            made[key] = function(ds, *more)
        return made[key]

    return found


@of_machine
def disc(ds: xr.Dataset) -> Callable[[Any, Any], Any]:
    """Profiles of a round tool on the machine of a result, as a function of throw and place of the workpiece [m]."""
    fixed = machine(ds)
    axes, along = {"e": [0.1], "w_x": [fixed["L"]]}, {"radius": np.linspace(0.0, float(ds.radius[-1]), POINTS)}
    study = {"kernel": "polisher_wear", "outputs": ["wear"], "rtol": 1e-6, "axes": axes, "along": along}
    solve = sweep.solver({**study, "fixed": {**fixed, "type": "A", "tool_b": fixed["tool_a"], "tool_n": 2.0}})
    return lambda e, w_x: solve(e=e, w_x=w_x).wear


@of_machine
def best_settings(ds: xr.Dataset) -> tuple[Setting, Setting]:
    """The most even setting of a disc, optimised over throw and offset: whatever it leaves, and without a hole.

    An offset evens the wear until the tool no longer reaches the middle, so the best without a hole lies where the
    least of the inner half is `KEPT` of the mean: a root in the offset for each throw, the least over throws of these.
    """
    from scipy.optimize import brentq, minimize, minimize_scalar

    wear, radius = disc(ds), np.linspace(0.0, float(ds.radius[-1]), POINTS)
    weight = area(radius)

    def setting(e: float, offset: float) -> Setting:
        profile = np.asarray(wear(e, float(ds.L) + offset))
        return Setting(e, offset, float(unevenness(profile, weight)), float(least(profile, weight, radius)), profile)

    def border(e: float) -> Setting:
        return setting(e, brentq(lambda offset: setting(e, offset).least - KEPT, 0.02, 0.05, xtol=1e-8))

    free = minimize(lambda x: setting(*x).uneven, (0.09, 0.04), method="Nelder-Mead", options={"xatol": 1e-6})
    throw = minimize_scalar(lambda e: border(e).uneven, bounds=(0.06, 0.12), method="bounded", options={"xatol": 1e-6})
    return setting(*free.x), border(throw.x)


class Profiles(NamedTuple):
    """Profiles of mean 1, (setting, radius), weights of the radii, |h_i - 1|, radii and settings."""

    rows: Any
    weight: Any
    rough: Any
    radius: Any
    places: list[tuple[float, float]]

    def times(self, chosen: Any, delta: float = DWELL) -> Any:
        """The shares of these settings that make U of (1) of `polisher_robust` least."""
        chosen, root = list(chosen), np.sqrt(self.weight)
        kept = delta * np.diag(self.rough[chosen])
        found, _ = nnls(np.vstack([self.rows[chosen].T * root[:, None], kept]), np.append(root, np.zeros(len(chosen))))
        return found / found.sum()

    def breach(self, times: Any, delta: float = DWELL) -> float:
        """By how much the conditions of an optimum of U are not met: its slope is 0 where a share is above 0."""
        mixed = times @ self.rows
        scale = 1.0 / float(self.weight @ mixed**2 + delta**2 * times**2 @ self.rough**2)  # the least squares' own size
        slope = self.rows @ ((scale * mixed - 1.0) * self.weight) + delta**2 * self.rough**2 * scale * times
        return max(abs(slope[times > 1e-9]).max(), -slope[times <= 1e-9].min())

    def nominal(self, chosen: Any, times: Any) -> float:
        """Unevenness with exact times."""
        return float(unevenness(times @ self.rows[list(chosen)], self.weight))

    def expected(self, chosen: Any, times: Any, delta: float = DWELL) -> float:
        """U of (1) of `polisher_robust`."""
        return float(np.hypot(self.nominal(chosen, times), delta * np.linalg.norm(times * self.rough[list(chosen)])))

    def best(self, chosen: Any, delta: float = DWELL) -> float:
        """U of these settings at their best."""
        return self.expected(chosen, self.times(chosen, delta), delta)

    def drawn(self, chosen: Any, times: Any, delta: float = DWELL) -> Any:
        """Unevenness with 4000 draws of errors of dwell: root of the mean square; below which 19 of 20 pieces are."""
        errors = 1.0 + delta * np.random.default_rng(1).standard_normal((4000, len(times)))
        found = unevenness((times * errors) @ self.rows[list(chosen)], self.weight)
        return float(np.sqrt(np.mean(found**2))), np.quantile(found, 0.95)


def profiles(ds: xr.Dataset) -> Profiles:
    """Of a result over e and w_x."""
    weight, stacked = area(ds.radius), ds.wear.stack(setting=("e", "w_x")).transpose("setting", "radius")
    rows = stacked.values / (stacked.values * weight).sum(1, keepdims=True)
    places = [(float(e), float(w) - float(ds.L)) for e, w in stacked.setting.values]
    return Profiles(rows, weight, unevenness(rows, weight), ds.radius.values, places)


def squares(p: Profiles) -> Any:
    """M over settings by (1) of `polisher_robust`: shares t that come to 1 leave t M t = 1 + U^2."""
    return (p.rows * p.weight) @ p.rows.T + DWELL**2 * np.diag(p.rough**2)


def of_sets(square: Any, sets: Any) -> Any:
    """U of sets of settings, (..., n), by the least t M t of shares that come to 1; infinite if one is below 0."""
    sets = np.asarray(sets)
    times = np.linalg.solve(square[sets[..., :, None], sets[..., None, :]], np.ones((*sets.shape, 1)))[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where((times >= 0.0).all(-1), np.sqrt(1.0 / times.sum(-1) - 1.0), np.inf)


def exchanged(square: Any, chosen: list[int]) -> list[int]:
    """The set with one setting after another exchanged as long as that helps."""
    least_yet, here = np.inf, float(of_sets(square, chosen))
    while here < least_yet - 1e-9 or not np.isfinite(least_yet):
        least_yet = here if np.isfinite(here) else 1.0
        for i in range(len(chosen)):
            rest = chosen[:i] + chosen[i + 1 :]
            others = [k for k in range(len(square)) if k not in rest]
            found = of_sets(square, [[*rest, k] for k in others])
            chosen, here = [*rest, others[int(found.argmin())]], float(found.min())
    return chosen


def fewest(p: Profiles) -> dict[int, list[int]]:
    """The best sets of 2 to 10 settings: of all pairs and threes; of more, by exchange, from 24 random starts and one
    that grows the set before."""
    random, sets, square = np.random.default_rng(1), {}, squares(p)
    for n in range(2, 11):
        if n < 4:
            starts = np.array(list(itertools.combinations(range(len(p.rows)), n)))
            sets[n] = starts[int(of_sets(square, starts).argmin())].tolist()
            continue
        starts = [random.choice(len(p.rows), n, replace=False).tolist() for _ in range(24)]
        grown = [[*sets[n - 1], k] for k in range(len(p.rows)) if k not in sets[n - 1]]
        starts.append(grown[int(of_sets(square, grown).argmin())])
        sets[n] = min((exchanged(square, start) for start in starts), key=lambda chosen: float(of_sets(square, chosen)))
    return sets


def reached(p: Profiles, sets: dict[int, list[int]]) -> tuple[list[int], float, float]:
    """What the best sets are good for.

    Returns
    -------
    tuple
        The fewest settings that are expected to be as even as each of `WANTED`, with errors of dwell (0: none); of all
        sets the least wear of the inner half over the mean, and by how much drawn errors deviate from U at most.
    """
    made = [(chosen, p.times(chosen)) for chosen in sets.values()]
    enough = [min((n for n, chosen in sets.items() if p.best(chosen) <= wanted), default=0) for wanted in WANTED]
    kept = min(float(least(times @ p.rows[chosen], p.weight, p.radius)) for chosen, times in made)
    off = (p.drawn(chosen, times)[0] / p.expected(chosen, times) - 1.0 for chosen, times in made)
    return enough, kept, max(off, key=abs)


def swings(ds: xr.Dataset, e: Any) -> xr.Dataset:
    """alpha [rad] and its rate [rad/s] at 720 angles of the crank, by throw."""
    along = {"crank_angle": np.linspace(0, 2 * np.pi, 720, endpoint=False)}
    known = {name: ds[name] for name in ("b", "d", "f", "omega", "b_angle")}
    return solved("polisher_motion", e=e, along=along, outputs=["alpha", "alpha_rate"], rtol=1e-12, **known)


def disc_points(radius: float, rings: int = 24, spokes: int = 48) -> tuple[Any, Any]:
    """Points x + i y of a disc and their shares of its area: Gauss in the square of the radius, evenly around."""
    x, share = np.polynomial.legendre.leggauss(rings)
    places = radius * np.sqrt(0.5 * (x + 1))[:, None] * np.exp(2j * np.pi * np.arange(spokes) / spokes)
    return places.ravel(), np.repeat(0.5 * share / spokes, spokes)


def tool_wear(ds: xr.Dataset, motion: xr.Dataset, X: Any, Y: Any, beta: float = 0.0, spin: float | None = None) -> Any:
    """Wear [m/s] of points X along and Y across the tool, by throw: by their mean speed against the work.

    The tool turns `spin` times as fast as the work; None: as the arm, on which it is rigid.
    """
    turned, rate = np.exp(1j * (motion.alpha.values + beta))[:, :, None], motion.alpha_rate.values[:, :, None]
    centre, place = turned * float(ds.L), turned * (np.ravel(X) + 1j * np.ravel(Y))
    work, turn = float(ds.Omega), rate if spin is None else spin * float(ds.Omega)
    speed = abs(rate * centre + turn * place - work * (centre + place - float(ds.w_x)))
    mean = speed.mean(axis=1).reshape(motion.sizes["e"], *np.shape(X))
    return float(ds.preston) * float(ds.pressure) * mean
