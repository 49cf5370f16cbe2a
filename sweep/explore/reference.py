"""What the methods of a kernel are measured against: values given, or the best method's own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.grid import Grid
from sweep.cells.sample import solved, with_method
from sweep.cells.solve import GIVEN_UP, among
from sweep.errors import SweepError
from sweep.study.model import Study
from sweep.words import did_you_mean, listed

FINE = tuple(10.0**-k for k in range(14, 5, -1))
"""Values of rtol that a reference is tried at: in each cell the least at which it says OK counts."""
GIVEN = "the truth given"
ROUNDING = 2.0**-53


@dataclass(frozen=True, eq=False)
class Reference:
    """Values by output, and in each cell what they are right to.

    Attributes
    ----------
    floor : ndarray
        Relative error of the values; inf where they are not known to be right.
    sound : ndarray of bool
        Cells that have values which are right to `floor`.
    void : ndarray of bool
        Cells of which it is known that there is nothing to give.
    """

    source: str
    values: Mapping[str, Any]
    floor: Any
    sound: Any
    void: Any

    @property
    def judged(self) -> int:
        """Number of cells in which a method can be told right or wrong."""
        return int((self.sound | self.void).sum())


def given_reference(study: Study, values: Mapping[str, Any]) -> Reference:
    """Values of some outputs in all cells of a study; NaN in all of them: there is nothing to give."""
    size = Grid(study).size
    shapes = {name: (size, *shape) for name, shape in study.shapes.items()}
    taken = {}
    for name, column in values.items():
        if name not in shapes:
            hint = did_you_mean(name, shapes) or f"; the study asks for {listed(shapes, word='and')}"
            raise SweepError(f"truth: the study does not ask for {name}{hint}")
        taken[name] = np.asarray(column, np.float64)
        if taken[name].shape != shapes[name]:
            raise SweepError(f"truth: {name} has the shape {taken[name].shape}, its cells {shapes[name]}")
    if not taken:
        raise SweepError("truth: no output is given")
    void = np.all([np.isnan(column).reshape(size, -1).all(axis=1) for column in taken.values()], axis=0)
    return Reference(GIVEN, taken, np.full(size, ROUNDING), ~void, void)


def best_reference(study: Study, able: Sequence[str], asked: str | None) -> Reference:
    """Of the method asked for, or of the one that leaves the fewest cells open; then: states a bound, is right to less.

    Raises
    ------
    SweepError
        There is no such method, or none that solves a cell.
    """
    if asked is not None and asked not in able:
        raise SweepError(f"no method {asked} that can do this study; there are {', '.join(able)}")
    names = [asked] if asked else sorted(able, key=lambda name: study.kernel.method(name).bound is None)
    found: list[Reference] = []
    for name in names:
        if study.kernel.method(name).bound is None and any(t.judged == len(t.floor) for t in found):
            break  # those that state a bound suffice
        found.append(reference_by(study, name))

    def rank(t: Reference) -> tuple[int, bool, float]:
        lost = np.log10(t.floor[t.sound]).mean() if t.sound.any() else math.inf
        return -t.judged, study.kernel.method(t.source).bound is None, float(lost)

    best = min(found, key=rank)
    if not best.sound.any():
        raise SweepError(f"{best.source} solves none of the cells, so there is nothing to measure against")
    return best


def reference_by(study: Study, name: str) -> Reference:
    """The values of a method at the least rtol at which it says of a cell that it is right."""
    size = Grid(study).size
    floor, sound, void = np.full(size, np.inf), np.zeros(size, bool), np.zeros(size, bool)
    values: dict[str, Any] = {}
    for rtol in FINE:
        outputs, status, *_ = solved(with_method(study, name, rtol))
        values = values or dict(outputs)
        refused = status >= FIRST_REFUSAL
        void |= refused & ~among(status, GIVEN_UP)
        now = ~refused & (status != Status.INACCURATE) & ~sound
        for output, column in outputs.items():
            values[output][now] = column[now]
        floor[now], sound = rtol, sound | now
        if (sound | void).all():
            break
    return Reference(name, values, floor, sound, void)


def errors(outputs: Mapping[str, Any], reference: Mapping[str, Any]) -> Any:
    """Largest relative error of each cell over its outputs, of traces relative to their largest value."""
    worst = np.zeros(len(next(iter(reference.values()))))
    for name, true in reference.items():
        values, rest = outputs[name], tuple(range(1, true.ndim))
        size = np.nanmax(np.abs(true), axis=rest, keepdims=True, initial=0.0) if rest else np.abs(true)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            off = np.abs(values - true) / size
        off = np.where((values == true) | (np.isnan(values) & np.isnan(true)), 0.0, off)
        off = np.where(np.isnan(off), np.inf, off)
        worst = np.maximum(worst, off.max(axis=rest, initial=0.0) if rest else off)
    return worst
