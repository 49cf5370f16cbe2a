"""Which methods are tried on which cells, and in which order.

A method that is named must do every term of its study. `auto` asks it of each cell alone: what becomes of a cell does
not hang on the others of its study. Only where every method lacks some term of a study is the study refused whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Kernel
from sweep.cells.grid import Grid
from sweep.study.model import Study

Mask = NDArray[np.bool_]


class Absent(NamedTuple):
    """That a term is absent: a parameter has its default.

    Attributes
    ----------
    place : int
        Position of the parameter.
    default : float
    like : int or None
        Position of the parameter whose value is the default, if it is one's.
    """

    place: int
    default: float
    like: int | None

    def holds(self, columns: Sequence[Any] | Mapping[int, Any]) -> Mask:
        """In which cells."""
        same: Mask = columns[self.place] == (self.default if self.like is None else columns[self.like])
        return same if same.ndim == 1 else np.logical_and.reduce(same, axis=1)

    def everywhere(self, grid: Grid) -> bool | None:
        """Whether it holds in all cells of a grid, or in none; None: that hangs on the cell."""
        columns = {place: grid.spread(place) for place in (self.place, self.like) if place is not None}
        varying = [column is None or len(column) > 1 for column in columns.values()]
        if any(column is None for column in columns.values()) or sum(varying) > 1:
            return None
        found = self.holds(columns)
        return bool(found[0]) if found.all() or not found.any() else None


class Turn(NamedTuple):
    """A method's turn.

    Attributes
    ----------
    number : int
        Position of the method.
    absent : tuple of Absent
        What must hold in a cell for the method to do it; what holds in all cells is left out.
    sooner : callable or None
        `Method.sooner`, where the method has two turns.
    early : bool
        Whether it is the first of the two.
    """

    number: int
    absent: tuple[Absent, ...] = ()
    sooner: Callable[..., Any] | None = None
    early: bool = False

    def comes(self, inputs: Sequence[Any]) -> bool:
        """Whether it comes to the first of some cells, by columns of the parameters and of rtol."""
        able = all(term.holds(inputs)[0] for term in self.absent)
        return able and (self.sooner is None or bool(self.sooner(*inputs)[0] == self.early))


def turns(study: Study, grid: Grid) -> tuple[Turn, ...]:
    """Turns of the methods that give every output asked for and can do some cell of the grid."""
    found: dict[float, Turn] = {}
    for number, method in enumerate(study.kernel.methods):
        terms = [_absent(study.kernel, name) for name in method.excludes]
        known = [term.everywhere(grid) for term in terms]
        if False in known or not set(study.outputs).isdisjoint(method.lacks):
            continue
        open_ = tuple(term for term, holds in zip(terms, known, strict=True) if holds is None)
        found[number] = Turn(number, open_, method.sooner)
        if method.sooner is not None:
            found[number - 1.5] = found[number]._replace(early=True)
    return tuple(found[place] for place in sorted(found))


def _absent(kernel: Kernel, name: str) -> Absent:
    places = {field.name: place for place, field in enumerate(kernel.parameters)}
    default = kernel.parameter(name).default
    if isinstance(default, str):
        return Absent(places[name], np.nan, places[default])
    return Absent(places[name], np.nan if default is None else default, None)


def usable_methods(study: Study) -> tuple[int, ...]:
    """Numbers of the methods that can do every term the study sets and give every output it asks for."""
    methods = enumerate(study.kernel.methods)
    return tuple(
        number
        for number, method in methods
        if study.terms.isdisjoint(method.excludes) and set(study.outputs).isdisjoint(method.lacks)
    )
