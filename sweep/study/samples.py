"""Points of a sampled design in the unit cube, by the generators of scipy.stats.qmc and SALib.

| design | points | what for |
|---|---|---|
| `sobol` | n, a power of 2 | Sobol' sequence: evenly spread in all dimensions together |
| `latin` | n | Latin hypercube: evenly spread along each axis |
| `random` | n | independent |
| `saltelli` | n (d + 2), n a power of 2 | for Sobol' indices of d axes |
| `morris` | n (d + 1) | n one-at-a-time trajectories, for Morris' elementary effects |
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweep.errors import missing

GENERATORS = ("sobol", "latin", "random", "saltelli", "morris")
SCRAMBLED = ("sobol", "latin", "saltelli")
POWERS_OF_TWO = ("sobol", "saltelli")
LEVELS = 4
"""Values that a Morris trajectory may take along each axis."""


def unit_points(design: str, axes: int, n: int, seed: int, scramble: bool = True) -> NDArray[np.float64]:
    """The points of a design, shape (points, axes), from 0 to 1. Raises SweepError where a package is missing."""
    if design == "random":
        return np.random.default_rng(seed).random((n, axes))
    if design in ("sobol", "latin"):
        from scipy.stats import qmc

        generator = qmc.Sobol if design == "sobol" else qmc.LatinHypercube
        points = generator(axes, scramble=scramble, rng=np.random.default_rng(seed)).random(n)
    else:
        require_salib()
        from SALib.sample import morris, sobol

        given = problem(tuple(map(str, range(axes))))
        if design == "saltelli":
            points = sobol.sample(given, n, calc_second_order=False, scramble=scramble, seed=seed)
        else:
            points = morris.sample(given, n, num_levels=LEVELS, seed=seed)
    return np.ascontiguousarray(points, np.float64)


def count(design: str, axes: int, n: int) -> int:
    """How many points a design has."""
    return n * {"saltelli": axes + 2, "morris": axes + 1}.get(design, 1)


def problem(names: tuple[str, ...]) -> dict[str, Any]:
    """Axes from 0 to 1, as SALib wants them."""
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


def require_salib() -> None:
    """Raises SweepError where SALib is missing."""
    try:
        import SALib  # noqa: F401
    except ImportError:
        raise missing("needs the package SALib", "sensitivity") from None
