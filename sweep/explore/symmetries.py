"""Scalings of a kernel: powers by which parameters may be multiplied so that outputs are multiplied by powers, too.

A field i times s^w_i takes every output j to s^v_j times itself if, in every cell,

    sum_i w_i dln y_j/dln p_i = v_j                               (1)

The declared units tell some of them (Buckingham). What satisfies (1) beside these, by elimination, is a law whose units
depend on its exponent (drag c v^n), or one that no unit tells. All are made rational, and count only once they have
been tried on other cells.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kernels.interface import FIRST_REFUSAL, Field, Status
from sweep.cells.grid import Cells
from sweep.cells.sample import drawn, multiplied, solved
from sweep.study.model import Study, differs
from sweep.study.units import exponents

Array = NDArray[np.float64]
Weights = dict[str, Fraction]

TRIED_CELLS = 24
"""Cells of which derivatives are taken, and as many others on which what is found is tried, where they are cheap."""
FEWEST_CELLS = 4
SECONDS = 2.0
"""That finding scalings may take; a dear kernel is asked for its declared units alone, in the fewest cells."""
LEAST_SOLVED, LEAST_SECONDS = 60, 0.1
"""Cells that are solved at least; a time that may always be taken."""
RTOL = 1e-9
"""Cells are solved to that at least, for a loose tolerance lets pass what is none."""
AGREEMENT = 30.0
"""Times that rtol that outputs may differ."""
STEP = 0.01
"""Of logarithms, for derivatives: to fourth order, so right to about 1e-7."""
JITTER = 0.5
"""Largest logarithm by which axes are moved off their values, so that few values suffice."""
FACTORS = (1.7, 0.4)
MOST_ELEMENTS = 16
"""Of an output with many values a cell."""
LEAST_PIVOTS = (1e-3, 1e-5)
"""Slopes below are taken for 0, tried in turn: with the larger one more may be found, and be none."""
LARGEST_DENOMINATOR = 200
NEAR = 2e-5
"""Distance of a weight from the fraction that it is taken for."""


class Scalings(NamedTuple):
    """A basis of the scalings of a study that hold: weights of fields and outputs, each row led by one field, whose
    weight is 1 there and 0 in the others; how many do not follow from declared units; on how many cells they were
    tried."""

    rows: list[Weights]
    leading: list[str]
    hidden: int
    cells: int

    def weights(self, name: str) -> tuple[Fraction, ...]:
        """A field's weight in every row."""
        return tuple(row.get(name, Fraction(0)) for row in self.rows)

    def rank(self, names: Sequence[str]) -> int:
        """Dimension of what scalings do to some fields."""
        return len(_basis(self.rows, names)[1])


def powers(field: Field) -> Weights:
    """Of base units in a field's unit."""
    return {base: power for base, power in exponents(field.unit).items() if power}


def scalings(study: Study, seconds: float | None = None) -> Scalings:
    """Those that hold on random cells of a study; none, on no cells, where trying them takes longer than some seconds.

    Raises SweepError where the kernel fails.
    """
    study = dataclasses.replace(study, rtol=min(study.rtol, RTOL))
    along = [field for field in study.kernel.along if len(study.along[field.name])]
    fields = [*(field for field in study.kernel.parameters if _is_scalable(study, field)), *along]
    # fields of the simplest unit lead; numbers without one, and what is no number of a cell, come last
    order = {field.name: (field in along, bool(field.dims), not (p := powers(field)), sum(map(abs, p.values())))
             for field in fields}  # fmt: skip
    leading = sorted(order, key=lambda name: order[name])
    names = [*leading, *(output.name for output in study.asked)]
    units = {field.name: powers(field) for field in (*fields, *study.asked)}

    few = drawn(study, FEWEST_CELLS, np.random.default_rng(0))
    solved(few)
    begun = time.perf_counter()
    solved(few)
    cost = (time.perf_counter() - begun) / FEWEST_CELLS
    if seconds is not None and LEAST_SOLVED * cost > max(seconds, LEAST_SECONDS):
        return Scalings([], [], 0, 0)
    affordable = int(max(seconds or SECONDS, LEAST_SECONDS) / (cost * (4 * len(leading) + 16)))
    cells = min(TRIED_CELLS, max(FEWEST_CELLS, affordable))

    trial = _Trial(study, leading, cells, seed=2)
    bases = sorted({base for of_one in units.values() for base in of_one})
    declared = [{name: units[name][base] for name in names if base in units[name]} for base in bases]
    rows, leads = _basis([row for row in declared if trial.holds(row)], names)
    by_units = len(rows)
    if affordable >= FEWEST_CELLS:
        slopes = _Trial(study, leading, cells, seed=1).slopes(leading)
        for least in LEAST_PIVOTS:
            more, more_leads = _basis([*rows, *_null_space(slopes, leading, names, least)], names)
            if len(more) > by_units and all(trial.holds(row) for row in more):
                rows, leads = more, more_leads
                break
    return Scalings(rows, leads, len(rows) - by_units, trial.number)


def _is_scalable(study: Study, field: Field) -> bool:
    """Not words, whole numbers, zeros, what follows another, nor a plain number left at its default."""
    if field.choices or field.integer or field.name in study.follows:
        return False
    if field.name in study.axes:
        return True
    at_default = field.default is not None and not differs(field, study.fixed)
    if at_default and (isinstance(field.default, str) or not powers(field)):
        return False
    return bool(np.any(study.fixed[field.name]))


class _Trial:
    """Cells of a study at random, beside its own values, solved again with some of its numbers multiplied."""

    def __init__(self, study: Study, scalable: Sequence[str], cells: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        own = drawn(study, cells, rng)
        jitter = {name: np.exp(rng.uniform(-JITTER, JITTER, cells)) for name in own.axes if name in scalable}
        refused = ~_valued(solved(multiplied(own, jitter)))
        self._study = multiplied(own, {name: np.where(refused, 1.0, by) for name, by in jitter.items()})
        self._old = solved(self._study)

    @property
    def number(self) -> int:
        """How many of the cells have values."""
        return int(_valued(self._old).sum())

    def holds(self, row: Weights) -> bool:
        """Whether fields and outputs may be multiplied like this; statuses may change as rounding decides."""
        old, fine, rtol = self._old, _valued(self._old), AGREEMENT * self._study.rtol
        for factor in FACTORS:
            factors = {name: factor ** float(weight) for name, weight in row.items()}
            new = solved(multiplied(self._study, factors))
            was, now = (np.where(c.status == Status.INACCURATE, Status.OK, c.status) for c in (old, new))
            if not row or not fine.any() or (was != now).any():
                return False
            for name, values in old.outputs.items():
                expected = factors.get(name, 1.0) * values[fine]
                if not np.allclose(new.outputs[name][fine], expected, rtol, 0, equal_nan=True):
                    return False
        return True

    def slopes(self, fields: Sequence[str]) -> dict[str, Array]:
        """dln y/dln p of all outputs in all cells by p, and -1 of each output by itself, so that sums w s are 0.

        Fields of which a kernel does not take other numbers are left out.
        """
        found = {}
        for name in fields:
            moved = [solved(multiplied(self._study, {name: math.exp(k * STEP)})) for k in (-2, -1, 1, 2)]
            if all(_valued(cells).sum() >= self.number / 2 for cells in moved):
                logs = [np.concatenate([_logs(cells, output) for output in cells.outputs]) for cells in moved]
                with np.errstate(invalid="ignore"):  # of an output that is 0 there is no slope
                    found[name] = (logs[0] - 8 * logs[1] + 8 * logs[2] - logs[3]) / (12 * STEP)
        outputs = list(self._old.outputs)
        owner = np.concatenate([np.full(_logs(self._old, name).size, i) for i, name in enumerate(outputs)])
        return found | {name: -1.0 * (owner == i) for i, name in enumerate(outputs)}


def _valued(cells: Cells) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = (cells.status < FIRST_REFUSAL) & (cells.status != Status.PENDING)
    return found


def _logs(cells: Cells, output: str) -> Array:
    """Logarithms of an output's size, one cell after the other; NaN where it has none."""
    values = cells.outputs[output].reshape(cells.number, -1)
    values = values[:, :: -(-values.shape[1] // MOST_ELEMENTS)]
    there = _valued(cells)[:, None] & (values != 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(there, np.log(abs(values)), np.nan)).ravel()


def _null_space(slopes: dict[str, Array], fields: Sequence[str], names: Sequence[str], least: float) -> list[Weights]:
    """What satisfies (1): a row for each field that elimination leaves free; [] where weights are no fractions."""
    finite = np.isfinite(np.column_stack(list(slopes.values()))).all(axis=1)
    # an output that is never there is no unknown
    known = [name for name in reversed(names) if name in slopes and (name in fields or slopes[name][finite].any())]
    matrix = np.column_stack([slopes[name][finite] for name in known])
    if len(matrix) < len(known):
        return []
    reduced, pivots = _reduced(matrix / np.maximum(1.0, abs(matrix).max(axis=1, keepdims=True)), least)
    found = []
    for free in set(range(len(known))) - set(pivots):
        row = {known[free]: Fraction(1)}
        for pivot, weight in zip(pivots, -reduced[:, free], strict=True):
            near = (Fraction(round(weight * d), d) for d in range(1, LARGEST_DENOMINATOR + 1))
            simplest = next((f for f in near if abs(weight - f) < NEAR), None)
            if simplest is None:
                return []
            row[known[pivot]] = simplest
        found.append(row)
    return found


def _basis(rows: Sequence[Weights], names: Sequence[str]) -> tuple[list[Weights], list[str]]:
    """The same scalings as a reduced basis, and the fields that lead its rows."""
    whole = np.array([[row.get(name, Fraction(0)) for name in names] for row in rows], object)
    matrix, pivots = _reduced(whole.reshape(len(rows), len(names)))
    return [{name: w for name, w in zip(names, row, strict=True) if w} for row in matrix], [names[k] for k in pivots]


def _reduced(matrix: Any, least: float = 0.0) -> tuple[Any, list[int]]:
    """Reduced row echelon form, of fractions or of floats of at least some size, and its leading columns."""
    rows = matrix.copy()
    leading: list[int] = []
    for column in range(rows.shape[1]):
        done = len(leading)
        if done == len(rows):
            break
        pivot = done + int(abs(rows[done:, column]).argmax())
        if abs(rows[pivot, column]) <= least:
            rows[done:, column] = 0
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] = rows[done] / rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] = rows[others] - rows[others, column : column + 1] * rows[done]
        leading.append(column)
    return rows[: len(leading)], leading
