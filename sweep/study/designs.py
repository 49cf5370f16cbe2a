"""How axes make a grid: a product, a zip, a sampled design, or blocks of these.

design = "zip"

design = { kind = "sobol", n = 1024, seed = 7 }           # or latin, random, saltelli, morris; axes without num

[[blocks]]                                                # the grid is the product of all blocks
design = "zip"
axes.mu = [1.0, 2.0]
axes.R = [0.1, 0.3]

[[blocks]]
axes.seed = [1, 2, 3]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from kernels.interface import Field
from sweep.study import samples
from sweep.study.entries import EXAMPLE, NONE, SAMPLED_EXAMPLE, Entries
from sweep.study.mistakes import Mistakes, show
from sweep.study.model import SMALLEST_RTOL, Axis, Block
from sweep.study.spacing import LARGEST_AXIS
from sweep.words import listed

PLAIN = ("product", "zip")
DESIGNS = (*PLAIN, *samples.GENERATORS)
LARGEST_GRID = 10**12
LARGEST_SEED = 2**32 - 1

FieldOf = Callable[[str, str], Field | None]
"""The field of an axis by its name and where that stands; None, and a mistake, where there is none."""


def read_designs(
    keys: Mapping[str, Any], entries: Entries, field_of: FieldOf
) -> tuple[str, dict[str, Axis], tuple[Block, ...]]:
    """The study's design, all its axes, and its blocks; none of a product or zip of all axes."""
    mistakes = entries.mistakes
    axes: dict[str, Axis] = {}
    blocks: list[Block] = []
    if "blocks" not in keys:
        axes, block = _block(keys, "", entries, field_of)
        design, blocks = block.design, [block]
    else:
        design = "blocks"
        for key in (key for key in ("design", "axes") if key in keys):
            mistakes.add(key, "does not go with blocks; write it in one of them")
        found = keys["blocks"]
        if not isinstance(found, list | tuple) or not found:
            mistakes.add("blocks", "expected a list of tables, e.g. [[blocks]] with axes.mu = [1.0, 2.0]")
            found, mistakes.unread = [], True
        for i, entry in enumerate(found):
            where = f"blocks[{i}]"
            table = mistakes.table(entry, where, "[[blocks]] with axes.mu = [1.0, 2.0]")
            if isinstance(entry, Mapping):
                table = mistakes.keys(table, ("design", "axes"), where)
                own, block = _block(table, f"{where}.", entries, field_of)
                for name in own.keys() & axes.keys():
                    mistakes.add(f"{where}.axes.{name}", "is an axis of another block as well; keep one of the two")
                axes |= own
                blocks.append(block)
    lengths = []
    for block in blocks:
        own_lengths = [len(axes[name]) for name in block.axes]
        lengths += own_lengths if block.design == "product" else own_lengths[:1]
    if math.prod(lengths) > LARGEST_GRID:
        mistakes.add("axes", f"{' x '.join(map(str, lengths))} cells; a study may have at most {LARGEST_GRID:.0e}")
    return design, axes, () if design in PLAIN else tuple(blocks)


def axes_named(keys: Mapping[str, Any]) -> set[str]:
    """Names of the axes in the keys of a study, whatever else is wrong with them."""
    blocks = keys.get("blocks", ())
    tables = [keys, *(blocks if isinstance(blocks, list | tuple) else ())]
    found = (table.get("axes") for table in tables if isinstance(table, Mapping))
    return {str(name) for axes in found if isinstance(axes, Mapping) for name in axes}


def _block(keys: Mapping[str, Any], at: str, entries: Entries, field_of: FieldOf) -> tuple[dict[str, Axis], Block]:
    """The axes of one `design` and `axes`, and how they make a grid."""
    mistakes, at_axes = entries.mistakes, f"{at}axes"
    given = mistakes.table(keys.get("axes", {}), at_axes, f"[axes.mu] with {EXAMPLE}")
    if isinstance(keys.get("axes", {}), Mapping) and not given:
        mistakes.add(at_axes, f"missing; give at least one, e.g. axes.mu = {EXAMPLE}")
    design, options = _design(keys.get("design", "product"), f"{at}design", len(given), mistakes)
    sampled = design in samples.GENERATORS
    shares = np.full((len(given), 1), 0.5)  # anywhere, where the design has a mistake
    if options and given:
        shares = mistakes.tried("design", lambda: samples.unit_points(design, len(given), options).T, shares)
    axes: dict[str, Axis] = {}
    for i, (name, entry) in enumerate(given.items()):
        where = f"{at_axes}.{name}"
        field = field_of(name, where)
        without = isinstance(entry, Mapping) and {"values", "file", "num"}.isdisjoint(entry)
        axes[name] = Axis(name, NONE, "values")
        if sampled and not without:
            mistakes.add(where, f"the design chooses the values; write e.g. {SAMPLED_EXAMPLE}")
        if field is None or (sampled and not without):
            continue
        # where the design cannot be read, an axis may be meant for a sampled one
        between = sampled or (not design and without and not {"start", "stop"}.isdisjoint(entry))
        axes[name] = entries.axis(name, entry, field, where, shares[i] if between else None)
        values = axes[name].values
        if name == "rtol" and not all(SMALLEST_RTOL <= value < 1 for value in values):
            mistakes.add(where, f"expected {SMALLEST_RTOL:g} <= rtol < 1 everywhere")
        if design == "product" and values.ndim > 1:
            mistakes.add(where, f'{name} is an array; as an axis it needs design = "zip"')
        elif design == "product":
            _, first, counts = np.unique(values, return_index=True, return_counts=True)
            if (counts > 1).any():
                label = axes[name].label(int(first[counts > 1][0]))
                mistakes.add(where, f"{label} stands more than once; give every value once")
    lengths = {name: len(axis) for name, axis in axes.items()}
    if design == "zip" and all(lengths.values()) and len(set(lengths.values())) > 1:
        counted = listed((f"{name} has {n}" for name, n in lengths.items()), word="and")
        mistakes.add(at_axes, f'design "zip" needs axes of equal length; {counted} values')
    return axes, Block(design, tuple(axes), options)


def _design(found: Any, where: str, axes: int, mistakes: Mistakes) -> tuple[str, dict[str, Any]]:
    """Name and options of a design; no options of one that has a mistake."""
    if not isinstance(found, Mapping):
        design = mistakes.word(found, where, DESIGNS) or ""
        if design in samples.GENERATORS:
            cure = f'{{ kind = "{design}", n = 1024, seed = 0 }}'
            mistakes.add(where, f"how many points? Write design = {cure}")
        return design, {}
    before, kind = len(mistakes), found.get("kind")
    allowed = ("kind",) if kind in PLAIN else ("kind", "n", "seed")
    # scramble is no mistake where the kind is
    scrambled = kind in samples.SCRAMBLED or kind not in DESIGNS
    found = mistakes.keys(found, (*allowed, *["scramble"] * scrambled), where)
    design = mistakes.word(found.get("kind"), f"{where}.kind", DESIGNS) or ""
    if design in PLAIN or not design:
        return design, {}
    n, scramble = mistakes.whole(found.get("n"), f"{where}.n", 2, LARGEST_AXIS), True
    if design in samples.POWERS_OF_TWO and n & (n - 1):
        lower = 1 << (n.bit_length() - 1)
        mistakes.add(f"{where}.n", f"a Sobol' sequence needs a power of 2; write {lower} or {2 * lower}")
    if (points := samples.count(design, axes, n)) > LARGEST_AXIS:
        mistakes.add(f"{where}.n", f"makes {points:,} points; expected at most {LARGEST_AXIS:,}")
    seed = mistakes.whole(found.get("seed", 0), f"{where}.seed", 0, LARGEST_SEED)
    if scrambled and not isinstance(scramble := found.get("scramble", True), bool):
        mistakes.add(f"{where}.scramble", f"expected true or false, found {show(scramble)}")
    if len(mistakes) > before:
        return design, {}
    return design, {"n": n, "seed": seed} | ({"scramble": scramble} if scrambled else {})
