"""Scalings of a kernel: powers by which parameters may be multiplied so that outputs are multiplied by powers, too.

A field i times s^w_i takes every output j to s^v_j times itself if, in every cell,

    sum_i w_i dln y_j/dln p_i = v_j                               (1)

so all scalings of a study are the null space of the matrix of these derivatives over its cells, whether they come from
units (Buckingham), from a law whose units depend on its exponent (drag c v^n), or from neither. The null space is made
rational, and what is found there, or among the declared units, counts only once it has been tried on other cells.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

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
LARGEST_SINGULAR = 1e-3
LARGEST_DENOMINATOR = 200
NEAR = 2e-5
"""Distance of a weight from the fraction that it is taken for."""


@dataclass(frozen=True)
class Scalings:
    """A basis of the scalings of a study that were tried and hold.

    Attributes
    ----------
    rows : tuple of dict of field to Fraction
        Weights of parameters, coordinates and outputs; reduced, so that each of `leading` has weight 1 in one row and
        0 in the others.
    leading : tuple of str
        One field a row.
    hidden : int
        How many rows there are beyond what the declared units say.
    cells : int
        On how many cells each was tried.
    """

    rows: tuple[Weights, ...]
    leading: tuple[str, ...]
    hidden: int
    cells: int

    def weights(self, name: str) -> tuple[Fraction, ...]:
        """A field's weight in every row."""
        return tuple(row.get(name, Fraction(0)) for row in self.rows)

    def rank(self, names: Sequence[str]) -> int:
        """Dimension of what scalings do to some fields."""
        matrix = np.array([[float(weight) for weight in self.weights(name)] for name in names])
        return int(np.linalg.matrix_rank(matrix)) if matrix.size else 0


def scalings(study: Study) -> Scalings:
    """Those that hold on random cells of a study. Raises SweepError where the kernel fails."""
    study = dataclasses.replace(study, rtol=min(study.rtol, RTOL))
    fields = _scalable(study)
    order = sorted(fields, key=lambda field: _simplicity(study, field))
    names = [field.name for field in order] + [output.name for output in study.asked]
    cells, affordable = _affordable(study, len(order))
    trial = _Trial(study, cells, seed=2)
    declared = [row for row in _declared(study, names) if trial.holds(row)]
    basis, leading = _reduced(_matrix(declared, names), len(names))
    by_units = len(basis)
    if affordable:
        for more in _Trial(study, cells, seed=1).candidates(names[: len(order)]):
            found, leads = _reduced(np.vstack([_matrix(declared, names), _matrix(more, names)]), len(names))
            rows = _rational(found, names)
            if len(rows) > by_units and all(trial.holds(row) for row in rows):
                basis, leading = found, leads
                break
    rows = _rational(basis, names)
    return Scalings(tuple(rows), tuple(names[i] for i in leading), len(rows) - by_units, trial.number)


def _scalable(study: Study) -> list[Field]:
    """Parameters and coordinates whose numbers may be multiplied."""
    parameters = [field for field in study.kernel.parameters if _is_scalable(study, field)]
    return parameters + [field for field in study.kernel.along if len(study.along[field.name])]


def _is_scalable(study: Study, field: Field) -> bool:
    """Not words, whole numbers, zeros, what follows another, nor a plain number left at its default."""
    if field.choices or field.integer or field.name in study.follows:
        return False
    if field.name in study.axes:
        return True
    as_another = isinstance(field.default, str) and not differs(field, study.fixed)
    plain = field.default is not None and not differs(field, study.fixed) and not _powers(field)
    return not as_another and not plain and bool(np.any(study.fixed[field.name]))


def _powers(field: Field) -> dict[str, Fraction]:
    return {base: power for base, power in exponents(field.unit).items() if power}


def _simplicity(study: Study, field: Field) -> tuple[bool, bool, bool, Fraction]:
    """Fields of the simplest unit lead; numbers without one, and what is no number of a cell, come last."""
    powers = _powers(field)
    shared = field in study.kernel.along
    return shared, bool(field.dims), not powers, Fraction(sum(abs(power) for power in powers.values()))


def _declared(study: Study, names: Sequence[str]) -> list[Weights]:
    """A row for each base unit."""
    fields = {f.name: f for f in (*study.kernel.parameters, *study.kernel.along, *study.asked)}
    powers = {name: _powers(fields[name]) for name in names}
    bases = sorted({base for of_one in powers.values() for base in of_one})
    return [{name: powers[name][base] for name in names if base in powers[name]} for base in bases]


def _affordable(study: Study, fields: int) -> tuple[int, bool]:
    """How many cells to take, and whether derivatives of them can be taken in time."""
    few = drawn(study, FEWEST_CELLS, np.random.default_rng(0))
    solved(few)
    begun = time.perf_counter()
    solved(few)
    cost = (time.perf_counter() - begun) / FEWEST_CELLS
    cells = int(SECONDS / (cost * (4 * fields + 16)))
    return min(TRIED_CELLS, max(FEWEST_CELLS, cells)), cells >= FEWEST_CELLS


class _Trial:
    """Cells of a study at random, beside its own values, solved again with some of its numbers multiplied."""

    def __init__(self, study: Study, cells: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        scalable = [field.name for field in _scalable(study)]
        self._study = drawn(study, cells, rng)
        jitter = {name: np.exp(rng.uniform(-JITTER, JITTER, cells)) for name in self._study.axes if name in scalable}
        moved = multiplied(self._study, jitter)
        refused = ~_valued(solved(moved))
        self._study = multiplied(self._study, {name: np.where(refused, 1.0, by) for name, by in jitter.items()})
        self._old = solved(self._study)
        self._tried: dict[tuple[tuple[str, Fraction], ...], bool] = {}

    @property
    def number(self) -> int:
        """How many of the cells have values."""
        return int(_valued(self._old).sum())

    def holds(self, row: Weights) -> bool:
        """Whether fields and outputs may be multiplied like this."""
        key = tuple(row.items())
        if key not in self._tried:
            self._tried[key] = bool(row) and self.number > 0 and all(self._holds(row, factor) for factor in FACTORS)
        return self._tried[key]

    def _holds(self, row: Weights, factor: float) -> bool:
        factors = {name: factor ** float(weight) for name, weight in row.items()}
        new, old = solved(multiplied(self._study, factors)), self._old
        if (_settled(new) != _settled(old)).any():
            return False
        fine, rtol = _valued(old), AGREEMENT * self._study.rtol
        return all(
            np.allclose(new.outputs[name][fine], factors.get(name, 1.0) * values[fine], rtol, 0, equal_nan=True)
            for name, values in old.outputs.items()
        )

    def candidates(self, fields: Sequence[str]) -> list[list[Weights]]:
        """Bases of what may be scalings by (1), larger ones first."""
        slopes = {name: slope for name in fields if (slope := self._slopes(name)) is not None}
        outputs = list(self._old.outputs)
        owner = np.concatenate([np.full(_logs(self._old, name).size, i) for i, name in enumerate(outputs)])
        matrix = np.column_stack([*slopes.values(), -np.eye(len(outputs))[owner]])
        matrix = matrix[np.isfinite(matrix).all(axis=1)]
        if len(matrix) < matrix.shape[1]:
            return []
        there = [
            *range(len(slopes)),
            *(len(slopes) + i for i in range(len(outputs)) if matrix[:, len(slopes) + i].any()),
        ]
        matrix = matrix[:, there] / np.maximum(1.0, abs(matrix).max(axis=1))[:, None]
        names = [[*slopes, *outputs][i] for i in there]
        _, sizes, vectors = np.linalg.svd(matrix, full_matrices=False)
        most = int((sizes < LARGEST_SINGULAR * math.sqrt(len(matrix))).sum())
        return [_named(vectors[len(vectors) - n :], names) for n in range(most, 0, -1)]

    def _slopes(self, name: str) -> Array | None:
        """dln y/dln p of all outputs in all cells; None where a kernel does not take other numbers."""
        logs = []
        for steps in (-2, -1, 1, 2):
            found = solved(multiplied(self._study, {name: math.exp(steps * STEP)}))
            if _valued(found).sum() < self.number / 2:
                return None
            logs.append(np.concatenate([_logs(found, output).ravel() for output in found.outputs]))
        with np.errstate(invalid="ignore"):  # of an output that is 0 there is no slope
            slope: Array = (logs[0] - 8 * logs[1] + 8 * logs[2] - logs[3]) / (12 * STEP)
        return slope


def _valued(cells: Cells) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = (cells.status < FIRST_REFUSAL) & (cells.status != Status.PENDING)
    return found


def _settled(cells: Cells) -> NDArray[np.int8]:
    """Statuses, without what rounding decides."""
    found: NDArray[np.int8] = np.where(cells.status == Status.INACCURATE, Status.OK, cells.status)
    return found


def _logs(cells: Cells, output: str) -> Array:
    """Logarithms of an output's size, (cells, elements); NaN where it has none."""
    values = cells.outputs[output].reshape(cells.number, -1)
    values = values[:, :: -(-values.shape[1] // MOST_ELEMENTS)]
    there = _valued(cells)[:, None] & (values != 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        found: Array = np.where(there, np.log(abs(values)), np.nan)
    return found


def _named(vectors: Array, names: Sequence[str]) -> list[Weights]:
    return [{name: Fraction(float(w)) for name, w in zip(names, row, strict=True)} for row in vectors]


def _matrix(rows: Sequence[Mapping[str, Fraction]], names: Sequence[str]) -> Array:
    return np.array([[float(row.get(name, 0)) for name in names] for row in rows]).reshape(len(rows), len(names))


def _reduced(matrix: Array, columns: int) -> tuple[Array, list[int]]:
    """Reduced row echelon form and its leading columns, first columns first."""
    rows = matrix.copy()
    leading: list[int] = []
    for column in range(columns):
        done = len(leading)
        if done == len(rows):
            break
        pivot = done + int(abs(rows[done:, column]).argmax())
        if abs(rows[pivot, column]) < 1e-4:
            rows[done:, column] = 0.0
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= rows[others, column : column + 1] * rows[done]
        leading.append(column)
    return rows[: len(leading)], leading


def _rational(rows: Array, names: Sequence[str]) -> list[Weights]:
    """Rows with the simplest fractions near their numbers; [] where there are none."""
    found = []
    for row in rows:
        fractions = [_simplest(float(value)) for value in row]
        if None in fractions:
            return []
        found.append({name: w for name, w in zip(names, fractions, strict=True) if w})
    return found


def _simplest(value: float) -> Fraction | None:
    for denominator in range(1, LARGEST_DENOMINATOR + 1):
        near = Fraction(round(value * denominator), denominator)
        if abs(value - near) < NEAR:
            return near
    return None
