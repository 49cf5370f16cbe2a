"""Which methods are tried on which cells, and in which order.

A method that is named must do every term of its study. `auto` asks it of each cell alone: what becomes of a cell does
not depend on the others of its study. Only where every method lacks some term of a study is the study refused whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweep.cells.grid import Grid
from sweep.study.model import Study


class Absent(NamedTuple):
    """That a term is absent: the parameter at position `place` has its default, a number or that at position `like`."""

    place: int
    default: float
    like: int | None

    def holds(self, columns: Sequence[Any] | Mapping[int, Any]) -> NDArray[np.bool_]:
        """In which cells."""
        same = columns[self.place] == (self.default if self.like is None else columns[self.like])
        return np.asarray(same if same.ndim == 1 else same.all(axis=1))

    def everywhere(self, spreads: Mapping[int, Any]) -> bool | None:
        """Whether it holds in all cells of a grid, or in none; None: that depends on the cell."""
        columns = {place: spreads[place] for place in (self.place, self.like) if place is not None}
        if sum(2 if column is None else len(column) > 1 for column in columns.values()) > 1:
            return None
        found = self.holds(columns)
        return bool(found[0]) if found.all() or not found.any() else None


class Turn(NamedTuple):
    """A method's turn: its position, and what must hold in a cell for it, but for what holds in all cells.

    Where it has two turns, by `Method.sooner`, also whether this is the first of the two.
    """

    number: int
    absent: tuple[Absent, ...] = ()
    sooner: Callable[..., Any] | None = None
    early: bool = False


def turns(study: Study, grid: Grid) -> tuple[Turn, ...]:
    """Turns of the methods that give every output asked for and can do some cell of the grid."""
    places = {field.name: place for place, field in enumerate(study.kernel.parameters)}
    spreads, found = grid.spreads(), dict[float, Turn]()
    for number, method in enumerate(study.kernel.methods):
        defaults = {name: study.kernel.parameter(name).default for name in method.excludes}
        terms = [
            Absent(places[name], np.nan, places[d]) if isinstance(d, str)
            else Absent(places[name], np.nan if d is None else d, None)
            for name, d in defaults.items()
        ]  # fmt: skip
        known = [term.everywhere(spreads) for term in terms]
        if False in known or not set(study.outputs).isdisjoint(method.lacks):
            continue
        open_ = tuple(term for term, holds in zip(terms, known, strict=True) if holds is None)
        found[number] = Turn(number, open_, method.sooner)
        if method.sooner is not None:
            found[number - 1.5] = found[number]._replace(early=True)
    return tuple(found[place] for place in sorted(found))


def usable_methods(study: Study) -> tuple[int, ...]:
    """Numbers of the methods that can do every term the study sets and give every output it asks for."""
    terms, outputs = study.terms, set(study.outputs)
    methods = enumerate(study.kernel.methods)
    return tuple(k for k, m in methods if terms.isdisjoint(m.excludes) and outputs.isdisjoint(m.lacks))
