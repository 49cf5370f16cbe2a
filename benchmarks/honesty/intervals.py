"""How often confidence intervals hold the truth: power laws with noise, one law and two, nominal 95 %.

python benchmarks/honesty/intervals.py [SETS]      default 10000; a standard error of 0.2 % each
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import xarray as xr

import sweep

SETS = 10_000
AT_ONCE = 500

CASES = {
    # name: exponents below and above, width of the bend in decades, points a decade, noise
    "weak and strong drive": (-1.0, -1 / 3, 0.3, 10, 0.01),
    "much noise": (-1.0, -1 / 3, 0.3, 10, 0.05),
    "little noise": (-1.0, -1 / 3, 0.3, 10, 1e-4),
    "sharp bend": (-1.0, -1 / 3, 0.05, 10, 0.02),
    "wide bend": (0.0, -0.5, 0.6, 10, 0.01),
    "few points": (2.0, 0.5, 0.2, 4, 0.02),
    "a slight change": (0.5, 0.6, 0.3, 10, 0.01),
    "a kink": (0.5, 2.0, 0.001, 10, 0.02),
}
"""Six decades, the crossover at 1.6."""

CROSSOVER = 1.6


def curve(case: tuple[float, ...], sets: int, rng: np.random.Generator) -> xr.DataArray:
    """`sets` lines of y over mu with independent relative noise."""
    low, high, width, points, noise = case
    mu = np.geomspace(1e-3, 1e3, int(6 * points) + 1)
    u, w = np.log(mu / CROSSOVER), width * np.log(10)
    z = low * u + (high - low) * w * np.logaddexp(0, u / w)
    values = np.exp(z + noise * rng.standard_normal((sets, mu.size)))
    return xr.DataArray(values, {"mu": mu}, ("set", "mu"), name="y")


def holds(found: xr.Dataset, name: str, truth: Any) -> float:
    """Share of the intervals that hold the truth."""
    return float(((found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])).mean())


def two_laws(case: tuple[float, ...], sets: int, rng: np.random.Generator) -> tuple[float, ...]:
    """Coverage of both exponents and the crossover; shares said to be two laws, and noisy."""
    y = curve(case, sets, rng)
    found = sweep.fit_two_laws(y, "mu")
    laws = [holds(found.sel(law=law), "exponent", p) for law, p in zip(("low", "high"), case[:2], strict=True)]
    return *laws, holds(found, "crossover", CROSSOVER), float((found.regimes == 2).mean()), float(found.noisy.mean())


def any_laws(sets: int, rng: np.random.Generator) -> tuple[float, ...]:
    """As `two_laws`, for sets of which each has exponents, crossover, width and noise of its own, at random places."""
    points = rng.integers(20, 80)
    mu = np.sort(np.exp(rng.uniform(-7, 7, points)))
    low, change, place, width = (
        rng.uniform(a, b, (sets, 1)) for a, b in ((-2.0, 2.0), (0.5, 2.0), (-2.0, 2.0), (0.1, 1.2))
    )
    high = low + change * rng.choice([-1.0, 1.0], (sets, 1))
    u = np.log(mu) - place
    noise = np.exp(rng.uniform(np.log(1e-3), np.log(0.03), (sets, 1))) * rng.standard_normal((sets, points))
    z = low * u + (high - low) * width * np.logaddexp(0, u / width) + noise
    found = sweep.fit_two_laws(xr.DataArray(np.exp(z), {"mu": mu}, ("set", "mu"), name="y"), "mu")
    laws = [holds(found.sel(law=law), "exponent", p[:, 0]) for law, p in (("low", low), ("high", high))]
    x0 = holds(found, "crossover", np.exp(place[:, 0]))
    return *laws, x0, float((found.regimes == 2).mean()), float(found.noisy.mean())


def one_law(sets: int, rng: np.random.Generator) -> tuple[float, ...]:
    """Coverage of the exponent of a straight line; shares said to be two laws, and noisy."""
    y = curve((-0.5, -0.5, 0.3, 10, 0.01), sets, rng)
    found, two = sweep.fit_exponent(y, "mu"), sweep.fit_two_laws(y, "mu")
    return holds(found, "exponent", -0.5), float((two.regimes == 2).mean()), float(found.noisy.mean())


def local(mu: np.ndarray, sets: int, rng: np.random.Generator) -> float:
    """Coverage of the error bar of the local exponent, at all points of a bend with 1 % of noise."""
    u, w = np.log(mu / CROSSOVER), 0.3 * np.log(10)
    z = -u + 2 / 3 * w * np.logaddexp(0, u / w) + 0.01 * rng.standard_normal((sets, mu.size))
    y = xr.DataArray(np.exp(z), {"mu": mu}, ("set", "mu"), name="y")
    off = abs(sweep.local_exponent(y, "mu") - (-1 + 2 / 3 / (1 + np.exp(-u / w))))
    return float((off <= sweep.local_exponent_error(y, "mu")).mean())


def main(sets: int) -> None:
    rng = np.random.default_rng(20)
    print(f"{sets} sets each; share of 95 % intervals that hold the truth")
    print(f"{'two laws':24}{'low p':>8}{'high p':>8}{'x0':>8}{'two':>8}{'noisy':>8}")
    for name, case in CASES.items():
        parts = [two_laws(case, AT_ONCE, rng) for _ in range(max(1, sets // AT_ONCE))]
        print(f"{name:24}" + "".join(f"{share:8.4f}" for share in np.mean(parts, axis=0)), flush=True)
    parts = [any_laws(AT_ONCE, rng) for _ in range(max(1, sets // AT_ONCE))]
    print(f"{'all at random':24}" + "".join(f"{share:8.4f}" for share in np.mean(parts, axis=0)), flush=True)
    parts = [one_law(AT_ONCE, rng) for _ in range(max(1, sets // AT_ONCE))]
    share, two, noisy = np.mean(parts, axis=0)
    print(f"{'one law':24}{share:8.4f}{'':16}{two:8.4f}{noisy:8.4f}")

    for points in (25, 61, 241):
        print(f"{f'local, {points} points':24}{local(np.geomspace(1e-3, 1e3, points), sets, rng):8.4f}")
    places = (np.sort(np.exp(rng.uniform(-7, 7, 60))) for _ in range(20))
    print(f"{'local, 60 at random':24}{np.mean([local(mu, sets // 20, rng) for mu in places]):8.4f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SETS)
