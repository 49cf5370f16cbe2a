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

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweep.errors import missing

Points = NDArray[np.float64]

LEVELS = 4
"""Values that a Morris trajectory may take along each axis."""
SCRAMBLED = ("sobol", "latin", "saltelli")
POWERS_OF_TWO = ("sobol", "saltelli")


def unit_points(design: str, axes: int, options: Mapping[str, Any]) -> Points:
    """The points of a design, shape (points, axes), from 0 to 1.

    Parameters
    ----------
    options : mapping
        n, seed and scramble.

    Raises
    ------
    SweepError
        A package is missing.
    """
    points = GENERATORS[design](axes, options["n"], options["seed"], options.get("scramble", True))
    return np.ascontiguousarray(points, np.float64)


def count(design: str, axes: int, n: int) -> int:
    """How many points a design has."""
    return n * {"saltelli": axes + 2, "morris": axes + 1}.get(design, 1)


def problem(names: tuple[str, ...]) -> dict[str, Any]:
    """Axes from 0 to 1, as SALib wants them."""
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


def _sobol(axes: int, n: int, seed: int, scramble: bool) -> Any:
    from scipy.stats import qmc

    return qmc.Sobol(axes, scramble=scramble, rng=np.random.default_rng(seed)).random(n)


def _latin(axes: int, n: int, seed: int, scramble: bool) -> Any:
    from scipy.stats import qmc

    return qmc.LatinHypercube(axes, scramble=scramble, rng=np.random.default_rng(seed)).random(n)


def _random(axes: int, n: int, seed: int, scramble: bool) -> Any:
    return np.random.default_rng(seed).random((n, axes))


def _saltelli(axes: int, n: int, seed: int, scramble: bool) -> Any:
    require_salib()
    from SALib.sample import sobol

    given = problem(tuple(map(str, range(axes))))
    return sobol.sample(given, n, calc_second_order=False, scramble=scramble, seed=seed)


def _morris(axes: int, n: int, seed: int, scramble: bool) -> Any:
    require_salib()
    from SALib.sample import morris

    return morris.sample(problem(tuple(map(str, range(axes)))), n, num_levels=LEVELS, seed=seed)


def require_salib() -> None:
    """Raises SweepError where SALib is missing."""
    try:
        import SALib  # noqa: F401
    except ImportError:
        raise missing("needs the package SALib", "sensitivity") from None


GENERATORS: Mapping[str, Callable[[int, int, int, bool], Any]] = {
    "sobol": _sobol,
    "latin": _latin,
    "random": _random,
    "saltelli": _saltelli,
    "morris": _morris,
}
