"""How axes make a grid: a product, a zip, a sampled design, or blocks of these.

design = "zip"

design = { kind = "sobol", n = 1024, seed = 7 }           # axes without num

[[blocks]]                                                # the grid is the product of all blocks
design = "zip"
axes.mu = [1.0, 2.0]
axes.R = [0.1, 0.3]

[[blocks]]
axes.seed = [1, 2, 3]

Points of a sampled design are those of scipy.stats.qmc and SALib:

| kind | points | what for |
|---|---|---|
| `sobol` | n, a power of 2 | Sobol' sequence: evenly spread in all dimensions together |
| `latin` | n | Latin hypercube: evenly spread along each axis |
| `random` | n | independent |
| `saltelli` | n (d + 2), n a power of 2 | for Sobol' indices of d axes |
| `morris` | n (d + 1) | n one-at-a-time trajectories, for Morris' elementary effects |
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from kernels.interface import Field, Kernel
from sweep.errors import missing
from sweep.study.mistakes import Entry, check_limits, one_of, show, whole
from sweep.study.model import SETTINGS, Axis, Block, setting
from sweep.study.values import EXAMPLE, LARGEST_AXIS, NONE, SAMPLED_EXAMPLE, Floats, axis
from sweep.words import listed, nearest

PLAIN = ("product", "zip")
GENERATORS = ("sobol", "latin", "random", "saltelli", "morris")
DESIGNS = (*PLAIN, *GENERATORS)
SCRAMBLED = ("sobol", "latin", "saltelli")
LARGEST_GRID = 10**12
LEVELS = 4
"""Values that a Morris trajectory may take along each axis."""


def read_designs(keys: Entry, kernel: Kernel) -> tuple[str, dict[str, Axis], tuple[Block, ...]]:
    """The study's design, all its axes, and its blocks; none of a product or zip of all axes."""
    axes: dict[str, Axis] = {}
    tables, blocks = [keys], list[Block]()
    if "blocks" in keys:
        for key in (key for key in ("design", "axes") if key in keys):
            keys[key].wrong("cannot be combined with blocks; write it in one of them")
        given, example = keys["blocks"], "[[blocks]] with axes.mu = [1.0, 2.0]"
        tables = []
        if isinstance(given.value, list | tuple) and given.value:
            tables = [given.table(i, example) for i in range(len(given.value))]
            tables = [table.keys("design", "axes") for table in tables if table.good()]
        else:
            given.wrong(f"expected a list of tables, e.g. {example}")
            given.mistakes.unread = True
    for table in tables:
        own, block = _block(table, kernel)
        for name in own.keys() & axes.keys():
            table["axes"][name].wrong("is an axis of another block as well; keep one of the two")
        axes |= own
        blocks.append(block)
    lengths = [[len(axes[name]) for name in block.axes][: None if block.design == "product" else 1] for block in blocks]
    sizes = list(itertools.chain(*lengths))
    if math.prod(sizes) > LARGEST_GRID:
        cells = " x ".join(map(str, sizes))
        keys["axes"].wrong(f"{cells} cells; a study may have at most {LARGEST_GRID:.0e}")
    design = "blocks" if "blocks" in keys else blocks[0].design
    return design, axes, () if design in PLAIN else tuple(blocks)


def field_of(entry: Entry, name: str, kernel: Kernel) -> Field | None:
    """What may be an axis: a parameter, method or rtol. A mistake where it is none, and what it is taken for."""
    known = {p.name: p for p in kernel.parameters}
    if name in SETTINGS:
        return setting(name, kernel)
    if name not in known:
        cure = f"; it has {listed(known, word='and')}"
        entry.unknown(name, [*known, *SETTINGS], f"kernel {kernel.name} has no such parameter", cure)
        entry.mistakes.meant.add(name := nearest(name, known))
    return known.get(name)


def _block(keys: Entry, kernel: Kernel) -> tuple[dict[str, Axis], Block]:
    """The axes of one `design` and `axes`, and how they make a grid."""
    given = keys.table("axes", f"[axes.mu] with {EXAMPLE}")
    if not given.value and given.good():
        given.wrong(f"missing; give at least one, e.g. axes.mu = {EXAMPLE}")
    design, options = _design(keys["design"], len(given.value)) if "design" in keys else ("product", {})
    said = [entry.get("num") for entry in given.value.values() if isinstance(entry, Mapping)] * (design == "product")
    nums = (num for num in said if isinstance(num, int) and 0 < num <= LARGEST_AXIS)
    if (cells := math.prod(nums, start=1.0)) > LARGEST_GRID:
        given.wrong(f"{cells:.3g} cells; a study may have at most {LARGEST_GRID:.0e}")
        given.mistakes.unread = True
        return {}, Block(design, ())
    sampled, shares = design in GENERATORS, np.full((len(given.value), 1), 0.5)
    if options and given.value:  # else anywhere: the design has a mistake
        shares = keys["design"].read(shares, lambda _: _unit_points(design, len(given.value), **options).T)
    axes: dict[str, Axis] = {}
    for name, own in zip(given.value, shares, strict=True):
        entry = given[name]
        field, axes[name] = field_of(entry, name, kernel), Axis(name, NONE, "values")
        without = isinstance(entry.value, Mapping) and {"values", "file", "num"}.isdisjoint(entry.value)
        if sampled and not without:
            entry.wrong(f"the design chooses the values; write e.g. {SAMPLED_EXAMPLE}")
        elif field is not None:
            # where the design cannot be read, an axis may be meant for a sampled one
            between = sampled or (not design and without and not {"start", "stop"}.isdisjoint(entry.value))
            axes[name] = found = axis(entry, field, own if between else None)
            if name == "rtol":
                check_limits(entry, found.values, field)
            if design == "product" and found.values.ndim > 1:
                entry.wrong(f'{name} is an array; as an axis it needs design = "zip"')
            elif design == "product":
                _, first, counts = np.unique(found.values, return_index=True, return_counts=True)
                if (counts > 1).any():
                    label = found.label(int(first[counts > 1][0]))
                    entry.wrong(f"{label} occurs more than once; give every value once")
    lengths = {name: len(axis) for name, axis in axes.items()}
    if design == "zip" and all(lengths.values()) and len(set(lengths.values())) > 1:
        counted = listed((f"{name} has {n}" for name, n in lengths.items()), word="and")
        given.wrong(f'design "zip" needs axes of equal length; {counted} values')
    return axes, Block(design, tuple(axes), options)


def _design(entry: Entry, axes: int) -> tuple[str, dict[str, Any]]:
    """Name and options of a design; no options of one that has a mistake."""
    if not isinstance(entry.value, Mapping):
        design = entry.read("", one_of, DESIGNS)
        if design in GENERATORS:
            entry.wrong(f'how many points? Write design = {{ kind = "{design}", n = 1024, seed = 0 }}')
        return design, {}
    before, kind = len(entry.mistakes), str(entry["kind"].value)
    design = kind if kind in DESIGNS else ""
    # an option is no mistake where the kind is
    scrambled = design in SCRAMBLED or not design
    entry = entry.keys("kind", *["n", "seed"] * (design not in PLAIN), *["scramble"] * scrambled)
    design = entry["kind"].read("", one_of, DESIGNS)
    if design in PLAIN or not design:
        return design, {}
    n = entry["n"].read(2, whole, 2, LARGEST_AXIS)
    options = {"n": n, "seed": entry.get("seed", 0, whole, 0, 2**32 - 1)}
    if design in ("sobol", "saltelli") and n & (n - 1):
        lower = 1 << (n.bit_length() - 1)
        entry["n"].wrong(f"a Sobol' sequence needs a power of 2; write {lower} or {2 * lower}")
    if (points := n * {"saltelli": axes + 2, "morris": axes + 1}.get(design, 1)) > LARGEST_AXIS:
        entry["n"].wrong(f"makes {points:,} points; expected at most {LARGEST_AXIS:,}")
    if scrambled:
        options["scramble"] = entry["scramble"].value if "scramble" in entry else True
        if not isinstance(options["scramble"], bool):
            entry["scramble"].wrong(f"expected true or false, found {show(options['scramble'])}")
    return design, options if len(entry.mistakes) == before else {}


def _unit_points(design: str, axes: int, n: int, seed: int, scramble: bool = True) -> Floats:
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


def problem(names: tuple[str, ...]) -> dict[str, Any]:
    """Axes from 0 to 1, as SALib wants them."""
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


def require_salib() -> None:
    """Raises SweepError where SALib is missing."""
    try:
        import SALib  # noqa: F401
    except ImportError:
        raise missing("needs the package SALib", "sensitivity") from None
