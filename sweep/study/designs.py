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
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from kernels.interface import Field
from sweep.errors import SweepError
from sweep.study import samples
from sweep.study.field_parser import EXAMPLE, SAMPLED_EXAMPLE, FieldParser
from sweep.study.mistakes import Mistakes, listed, show
from sweep.study.model import Axis, Block
from sweep.study.spacing import LARGEST_AXIS

PLAIN = ("product", "zip")
DESIGNS = (*PLAIN, *samples.GENERATORS)
SMALLEST_RTOL = 1e-15
LARGEST_GRID = 10**12
LARGEST_SEED = 2**32 - 1

FieldOf = Callable[[str, str], Field | None]
Read = tuple[str, dict[str, Axis], tuple[Block, ...]]


class DesignParser:
    """Reads `design`, `axes` and `blocks` of one study.

    Parameters
    ----------
    fields : FieldParser
    field_of : callable
        The field of an axis by its name and where that stands; None, and a mistake, where there is none.
    """

    def __init__(self, fields: FieldParser, field_of: FieldOf) -> None:
        self.fields, self.field_of = fields, field_of

    @property
    def mistakes(self) -> Mistakes:
        """Where mistakes gather."""
        return self.fields.mistakes

    def read(self, keys: Mapping[str, Any]) -> Read:
        """The study's design, all its axes, and its blocks; none of a product or zip of all axes."""
        if "blocks" in keys:
            design, (axes, blocks) = "blocks", self._blocks(keys)
        else:
            axes, block = self._block(keys, "")
            design, blocks = block.design, () if block.design in PLAIN else (block,)
        self._check_size(axes, blocks or (Block(design, tuple(axes)),))
        return design, axes, blocks

    def _blocks(self, keys: Mapping[str, Any]) -> tuple[dict[str, Axis], tuple[Block, ...]]:
        for key in ("design", "axes"):
            if key in keys:
                self.mistakes.add(key, "does not go with blocks; write it in one of them")
        found = keys["blocks"]
        if not isinstance(found, list | tuple) or not found:
            self.mistakes.add("blocks", "expected a list of tables, e.g. [[blocks]] with axes.mu = [1.0, 2.0]")
            self.mistakes.unread = True
            found = []
        axes: dict[str, Axis] = {}
        blocks = []
        for i, entry in enumerate(found):
            where = f"blocks[{i}]"
            table = self.mistakes.table(entry, where, "[[blocks]] with axes.mu = [1.0, 2.0]")
            table = self.mistakes.keys(table, ("design", "axes"), where)
            if not isinstance(entry, Mapping):
                continue
            own, block = self._block(table, f"{where}.")
            for name in own.keys() & axes.keys():
                self.mistakes.add(f"{where}.axes.{name}", "is an axis of another block as well; keep one of the two")
            axes |= own
            blocks.append(block)
        return axes, tuple(blocks)

    def _block(self, keys: Mapping[str, Any], at: str) -> tuple[dict[str, Axis], Block]:
        entries = self.mistakes.table(keys.get("axes", {}), f"{at}axes", f"[axes.mu] with {EXAMPLE}")
        if not keys.get("axes"):
            self.mistakes.add(f"{at}axes", f"missing; give at least one, e.g. axes.mu = {EXAMPLE}")
        design, options = self._design(keys.get("design", "product"), f"{at}design", len(entries))
        fields: dict[str, Field | None] = {}
        axes = {axis.name: axis for axis in self._axes(entries, fields, design, options, f"{at}axes")}
        self._check_axes(axes, fields, design, f"{at}axes")
        return axes, Block(design, tuple(axes), options)

    def _axes(
        self,
        entries: Mapping[str, Any],
        fields: dict[str, Field | None],
        design: str,
        options: Mapping[str, Any],
        at: str,
    ) -> Iterator[Axis]:
        """Every axis; its field is put into `fields`."""
        sampled = design in samples.GENERATORS
        shares = self._shares(design, options, len(entries))
        for i, (name, entry) in enumerate(entries.items()):
            where = f"{at}.{name}"
            fields[name] = self.field_of(name, where)
            without = isinstance(entry, Mapping) and {"values", "file", "num"}.isdisjoint(entry)
            if not sampled and (design or not without or {"start", "stop"}.isdisjoint(entry)):
                yield self.fields.axis(name, entry, fields[name], where)
            elif without:
                yield self.fields.sampled(name, entry, fields[name], where, shares[i])
            else:
                self.mistakes.add(where, f"the design chooses the values; write e.g. {SAMPLED_EXAMPLE}")
                yield Axis(name, np.empty(0), "values")

    def _shares(self, design: str, options: Mapping[str, Any], axes: int) -> Any:
        """Where the points lie along each axis, from 0 to 1; anywhere where the design has a mistake."""
        if not options or not axes:
            return np.full((axes, 1), 0.5)
        try:
            return samples.unit_points(design, axes, options).T
        except SweepError as error:
            self.mistakes.add("design", str(error))
            return np.full((axes, 1), 0.5)

    def _design(self, found: Any, where: str, axes: int) -> tuple[str, dict[str, Any]]:
        """Name and options of a design; no options of one that has a mistake."""
        if not isinstance(found, Mapping):
            design = self.mistakes.word(found, where, DESIGNS) or ""
            if design in samples.GENERATORS:
                cure = f'{{ kind = "{design}", n = 1024, seed = 0 }}'
                self.mistakes.add(where, f"how many points? Write design = {cure}")
            return design, {}
        before, kind = len(self.mistakes), found.get("kind")
        others = [name for name in DESIGNS if name not in samples.SCRAMBLED]
        scrambled = () if kind in others else ("scramble",)
        found = self.mistakes.keys(found, ("kind", *(() if kind in PLAIN else ("n", "seed", *scrambled))), where)
        design = self.mistakes.word(found.get("kind"), f"{where}.kind", DESIGNS) or ""
        if design in PLAIN or not design:
            return design, {}
        options = {"n": self._count(found.get("n"), design, f"{where}.n", axes)}
        options["seed"] = seed = found.get("seed", 0)
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed <= LARGEST_SEED:
            self.mistakes.add(f"{where}.seed", f"expected a whole number from 0 to {LARGEST_SEED}, found {show(seed)}")
        else:
            options["seed"] = int(seed)
        if scrambled:
            options["scramble"] = found.get("scramble", True)
            if not isinstance(options["scramble"], bool):
                text = f"expected true or false, found {show(options['scramble'])}"
                self.mistakes.add(f"{where}.scramble", text)
        return design, options if len(self.mistakes) == before else {}

    def _count(self, found: Any, design: str, where: str, axes: int) -> int | None:
        n = self.mistakes.count(found, where, LARGEST_AXIS)
        if n is None:
            return None
        if design in samples.POWERS_OF_TWO and n & (n - 1):
            lower = 1 << (n.bit_length() - 1)
            self.mistakes.add(where, f"a Sobol' sequence needs a power of 2; write {lower} or {2 * lower}")
        points = samples.count(design, axes, n)
        if points > LARGEST_AXIS:
            self.mistakes.add(where, f"makes {points:,} points; expected at most {LARGEST_AXIS:,}")
        return n

    def _check_axes(self, axes: Mapping[str, Axis], fields: Mapping[str, Field | None], design: str, at: str) -> None:
        """What concerns several values or several axes; axes without values have been complained about."""
        if "rtol" in axes and not all(SMALLEST_RTOL <= value < 1 for value in axes["rtol"].values):
            self.mistakes.add(f"{at}.rtol", f"expected {SMALLEST_RTOL:g} <= rtol < 1 everywhere")
        lengths = {name: len(axis) for name, axis in axes.items()}
        if not all(lengths.values()):
            return
        if design == "zip" and len(set(lengths.values())) > 1:
            found = listed((f"{name} has {n}" for name, n in lengths.items()), word="and")
            self.mistakes.add(at, f'design "zip" needs axes of equal length; {found} values')
        for name, axis in axes.items() if design == "product" else ():
            if axis.values.ndim > 1:
                self.mistakes.add(f"{at}.{name}", f'{name} is an array; as an axis it needs design = "zip"')
                continue
            _, first, counts = np.unique(axis.values, return_index=True, return_counts=True)
            # NaN may stand once, too; but the words of a field that is not known are all NaN
            twice = first[(counts > 1) & ((fields[name] is not None) | ~np.isnan(axis.values[first]))]
            if len(twice):
                text = f"{axis.label(int(twice[0]))} stands more than once; give every value once"
                self.mistakes.add(f"{at}.{name}", text)

    def _check_size(self, axes: Mapping[str, Axis], blocks: Sequence[Block]) -> None:
        lengths = []
        for block in blocks:
            own = [len(axes[name]) for name in block.axes]
            lengths += own if block.design == "product" else own[:1]
        if math.prod(lengths) > LARGEST_GRID:
            product = " x ".join(map(str, lengths))
            self.mistakes.add("axes", f"{product} cells; a study may have at most {LARGEST_GRID:.0e}")


def axes_named(keys: Mapping[str, Any]) -> set[str]:
    """Names of the axes in the keys of a study, whatever else is wrong with them."""
    blocks = keys.get("blocks", ())
    tables = [keys, *(blocks if isinstance(blocks, list | tuple) else ())]
    found = (table.get("axes") for table in tables if isinstance(table, Mapping))
    return {str(name) for axes in found if isinstance(axes, Mapping) for name in axes}
