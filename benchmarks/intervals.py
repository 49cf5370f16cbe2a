"""How often confidence intervals hold the truth: power laws with noise, one law and two, nominal 95 %.

python benchmarks/intervals.py [SETS]      default 10000; a standard error of 0.2 % each
"""

from __future__ import annotations

import sys

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


def holds(found: xr.Dataset, name: str, truth: float) -> float:
    """Share of the intervals that hold the truth."""
    return float(((found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])).mean())


def two_laws(case: tuple[float, ...], sets: int, rng: np.random.Generator) -> tuple[float, ...]:
    """Coverage of both exponents and the crossover; shares said to be two laws, and noisy."""
    y = curve(case, sets, rng)
    found = sweep.fit_two_laws(y, "mu")
    laws = [holds(found.sel(law=law), "exponent", p) for law, p in zip(("low", "high"), case[:2], strict=True)]
    return *laws, holds(found, "crossover", CROSSOVER), float((found.regimes == 2).mean()), float(found.noisy.mean())


def one_law(sets: int, rng: np.random.Generator) -> tuple[float, ...]:
    """Coverage of the exponent of a straight line; shares said to be two laws, and noisy."""
    y = curve((-0.5, -0.5, 0.3, 10, 0.01), sets, rng)
    found, two = sweep.fit_exponent(y, "mu"), sweep.fit_two_laws(y, "mu")
    return holds(found, "exponent", -0.5), float((two.regimes == 2).mean()), float(found.noisy.mean())


def main(sets: int) -> None:
    rng = np.random.default_rng(20)
    print(f"{sets} sets each; share of 95 % intervals that hold the truth")
    print(f"{'two laws':24}{'low p':>8}{'high p':>8}{'x0':>8}{'two':>8}{'noisy':>8}")
    for name, case in CASES.items():
        parts = [two_laws(case, AT_ONCE, rng) for _ in range(max(1, sets // AT_ONCE))]
        print(f"{name:24}" + "".join(f"{share:8.4f}" for share in np.mean(parts, axis=0)), flush=True)
    parts = [one_law(AT_ONCE, rng) for _ in range(max(1, sets // AT_ONCE))]
    share, two, noisy = np.mean(parts, axis=0)
    print(f"{'one law':24}{share:8.4f}{'':16}{two:8.4f}{noisy:8.4f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SETS)
