"""Which axes of a sweep matter: scalings are tried on cells, and dimensionless groups follow from those that hold.

A scaling multiplies field i by s^w_i. It holds if every output j is then multiplied by s^v_j in every cell,

    sum_i w_i dln y_j/dln p_i = v_j                               (1)

Measuring lengths, masses, times or angles in another unit is such a scaling, so outputs depend on products of powers
without units alone (Buckingham). Angles count here: an escapement's swing may be measured in any unit as long as
nothing in it is a sine. The solutions of (1) that units do not tell count alike: a law whose units depend on its
exponent (drag c v^n), or one that no unit tells. None of them is believed before it was tried on other cells.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kernels.interface import FIRST_REFUSAL, Field, Status
from sweep.cells.grid import Cells
from sweep.cells.sample import drawn, multiplied, solved
from sweep.study.model import Study, differs
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.study.units import exponents
from sweep.words import require_dataset

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

TRIED_CELLS, FEWEST_CELLS = 24, 4
"""Cells on which scalings are tried, and as many others of which slopes are taken: where they are cheap; at least."""
SECONDS = 2.0
"""That finding scalings may take; of a dear kernel those of the declared units alone are tried, on the fewest cells."""
LEAST_SOLVED, LEAST_SECONDS = 60, 0.1
"""Cells that are solved at least; a time that may always be taken."""
RTOL, AGREEMENT = 1e-9, 30.0
"""Cells are solved to that at least, for a loose tolerance lets pass what does not hold; outputs may differ by that
multiple of it."""
STEP = 0.01
"""Of logarithms, for slopes: to fourth order, so accurate to about 1e-7."""
JITTER = 0.5
"""Largest logarithm by which axes are moved off their values, so that few values suffice."""
FACTORS = (1.7, 0.4)
LEAST_SLOPE = 1e-4
"""Slopes below count as 0 as weights are looked for; those that hold nearly do not when they are tried."""
LARGEST_DENOMINATOR, NEAR = 200, 2e-5
"""Of a weight, and its distance from the fraction that it is taken for."""
LARGEST_COMMON = 4
"""Denominator by which a group is raised to have whole powers."""


@dataclass(frozen=True)
class Group:
    """A product of powers of parameters that has no unit: `str` of {mu: 1, a: -2, phi0: -1} is "mu/(a^2 phi0)"."""

    powers: tuple[tuple[str, Fraction], ...]

    def __str__(self) -> str:
        def product(sign: int) -> list[str]:
            powers = [(name, sign * power) for name, power in self.powers if sign * power > 0]
            texts = [(name, f"{p}" if p.denominator == 1 else f"({p})") for name, p in powers]
            return [name if text == "1" else f"{name}^{text}" for name, text in texts]

        over, under = product(1), product(-1)
        below = f"({' '.join(under)})" if len(under) > 1 else "".join(under)
        return f"{' '.join(over) or '1'}/{below}" if under else " ".join(over)

    def of(self, values: Mapping[str, xr.DataArray]) -> xr.DataArray:
        """The group's value, from those of its parameters."""
        product: xr.DataArray = 1.0  # type: ignore[assignment]
        for name, power in self.powers:
            product = product * values[name] ** float(power)
        return product


@dataclass(frozen=True)
class Scaling:
    """What scalings say about a study.

    Attributes
    ----------
    groups : tuple of Group
        All that its cells depend on, beside parameters that do not scale. None of a kernel with array parameters.
    scales : dict of output to Group
        What an output is multiplied by to have no unit.
    axes : tuple of str
        The axes that scale with others, or with outputs.
    free : int
        How many of the study's axes change nothing but the numbers.
    others : tuple of str
        The other axes of parameters.
    hidden : int
        Scalings that do not follow from the units a kernel declares.
    tried : int
        Cells on which all this was tried.
    """

    groups: tuple[Group, ...]
    scales: dict[str, Group]
    axes: tuple[str, ...]
    free: int
    others: tuple[str, ...] = ()
    hidden: int = 0
    tried: int = 0

    @property
    def advice(self) -> str:
        """What `sweep plan` says of superfluous axes; "" where there are none."""
        if not self.free:
            return ""
        basis = f"tried on {self.tried} cells at random"
        if self.hidden:
            basis += f"; {self.hidden} of the scalings used do not follow from declared units"
        left = len(self.axes) - self.free
        names = ", ".join(self.axes)
        where = f" for each {', '.join(self.others)}" if self.others else ""
        if left == 0:
            return f"every output is a power of {names} times a constant; a single cell tells all{where}; {basis}"
        varied = [str(group) for group in self.groups if any(name in self.axes for name, _ in group.powers)]
        matter = f"only {', '.join(varied)} matter{'s' * (len(varied) == 1)}; " if varied else ""
        kind = "one-dimensional" if left == 1 else f"{left}-dimensional"
        return f"{kind} in {names}{where}: {matter}{self.free} of these axes can be left out; {basis}"

    def rescaled(self, dataset: xr.Dataset) -> xr.Dataset:
        """A result of the study with its outputs freed of units, and a coordinate for each dimensionless group.

        Parameters
        ----------
        dataset : Dataset
            From `run` or `open_result`.

        Returns
        -------
        Dataset
            Outputs whose unit is 1 and whose `long_name` says the product; coordinates `group_1`, `group_2` ...,
            likewise.

        Examples
        --------
        >>> import sweep
        >>> axes = {"mu": [0.5, 1.0], "a": [1.0, 2.0]}
        >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes=axes, fixed={"phi0": 1.0})
        >>> sorted(set(sweep.scaling(ds).rescaled(ds).variables) - set(ds.variables))
        ['group_1']
        """
        require_dataset("scaling(...).rescaled", dataset)
        values = {str(name): dataset[name] for name in dataset.coords}
        for number, group in enumerate(self.groups, 1):
            coordinate = group.of(values).assign_attrs(units="1", long_name=str(group))
            dataset = dataset.assign_coords({f"group_{number}": coordinate})
        for name, group in self.scales.items():
            long_name = f"{name}{str(group)[1:]}" if str(group).startswith("1/") else f"{name} {group}".strip()
            output = dataset[name] * group.of(values)
            dataset[name] = output.assign_attrs({**dataset[name].attrs, "units": "1", "long_name": long_name})
        return dataset


def scaling(study: Given, seconds: float | None = None) -> Scaling:
    """Groups of a study's parameters, and how many of its axes are superfluous.

    Parameters
    ----------
    study : Study, path, mapping of its keys, or Dataset that came from it
    seconds : float, optional
        Time for the test of scalings on cells; with less time than needed none is found. Default: about two seconds. Of
        slow kernels only the scalings of the declared units are tested, on four cells, which may take longer.

    Raises
    ------
    SweepError
        The kernel fails.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> study = sweep.study(**foliot | {"fixed": {"phi0": 1.0}}, axes={"mu": [0.5, 1.0], "a": [1.0, 2.0]})
    >>> print(sweep.scaling(study).advice)
    one-dimensional in mu, a: only mu/(phi0 a^2) matters; 1 of these axes can be left out; tried on ... cells at random
    """
    study = as_study(study)
    held, leads, hidden, tried = _held(study, seconds)
    none = [Fraction(0)] * len(leads)
    weights = {name: row for name, row in held.items() if any(row)}
    fields = [f.name for f in (*study.kernel.parameters, *study.kernel.along)]
    scaled = [name for name in fields if name in weights]
    arrays = any(field.dims for field in study.kernel.parameters)
    present = [] if arrays else [name for name in scaled if name not in study.along]
    leading = [name for name in leads if name in present]

    def against(name: str) -> dict[str, Fraction]:
        """Powers of the leading parameters whose product scales against a field."""
        return {k: -w for k, w in zip(leads, weights.get(name, none), strict=True) if k in leading}

    def group(powers: Mapping[str, Fraction]) -> Group:
        return Group(tuple((name, powers[name]) for name in present if powers.get(name)))

    groups = []
    for i, name in enumerate(present):
        if name in leading:
            continue
        like = next((other for other in present[:i] if weights[other] == weights[name]), None)
        # R/mu rather than R/(a^2 phi0)
        powers = {name: Fraction(1), **({like: Fraction(-1)} if like else against(name))}
        common = math.lcm(*(power.denominator for power in powers.values()))
        groups.append(group({n: p * (common if common <= LARGEST_COMMON else 1) for n, p in powers.items()}))
    # an output that scales with what does not lead cannot be freed of units
    elsewhere = [k for k, name in enumerate(leads) if name not in leading]
    freed = [o.name for o in study.asked if not any(weights.get(o.name, none)[k] for k in elsewhere)]
    axes = tuple(name for name in study.axes if name in scaled)

    def rank(names: Sequence[str]) -> int:
        """Dimension of what scalings do to some fields."""
        return int(np.linalg.matrix_rank(np.array([weights[name] for name in names], float))) if names else 0

    return Scaling(
        groups=tuple(groups),
        scales={name: group(against(name)) for name in freed},
        axes=axes,
        free=rank(scaled) - rank([name for name in scaled if name not in axes]),
        others=tuple(name for name in study.axes if name in fields and name not in axes),
        hidden=hidden,
        tried=tried,
    )


def advice_on(study: Study | str, seconds: float) -> str:
    """The advice on a study, which may be JSON, as far as there is any in some seconds."""
    given = Study.from_json(study, allow_import=True) if isinstance(study, str) else study
    found = scaling(given, seconds)
    late = "superfluous axes are not looked for, which would take as long as the run; sweep.scaling(study) does"
    return found.advice if found.tried else late


def _held(study: Study, seconds: float | None) -> tuple[dict[str, list[Fraction]], list[str], int, int]:
    """A basis of the scalings that hold on random cells: every name's weight in each, and the names that lead them,
    whose weight is 1 in one and 0 in the others; how many do not follow from declared units; on how many cells they
    were tried: none where that takes longer than some seconds."""
    study = dataclasses.replace(study, rtol=min(study.rtol, RTOL))
    along = [field for field in study.kernel.along if len(study.along[field.name])]
    fields = [*(field for field in study.kernel.parameters if _is_scalable(study, field)), *along]
    units = {f.name: {base: p for base, p in exponents(f.unit).items() if p} for f in (*fields, *study.asked)}
    # fields of the simplest unit lead; numbers without one, and what is no number of a cell, come last
    fields.sort(key=lambda f: (f in along, bool(f.dims), not units[f.name], sum(map(abs, units[f.name].values()))))
    leading = [field.name for field in fields]
    names = [*leading, *(output.name for output in study.asked)]

    few = drawn(study, FEWEST_CELLS, np.random.default_rng(0))
    solved(few)
    begun = time.perf_counter()
    solved(few)
    cost = (time.perf_counter() - begun) / FEWEST_CELLS
    if seconds is not None and LEAST_SOLVED * cost > max(seconds, LEAST_SECONDS):
        return {}, [], 0, 0
    affordable = int(max(seconds or SECONDS, LEAST_SECONDS) / (cost * (4 * len(leading) + 16)))
    number = min(TRIED_CELLS, max(FEWEST_CELLS, affordable))

    # another unit of each kind is tried; then what slopes tell, where there is the time
    cells, old = _at_random(study, leading, number, seed=2)
    bases = sorted({base for powers in units.values() for base in powers})
    declared = [np.array([units[name].get(base, 0) for name in names], float) for base in bases]
    rows, leads = _echelon(np.reshape([row for row in declared if _holds(cells, old, names, row)], (-1, len(names))))
    by_units = len(rows)
    if affordable >= FEWEST_CELLS:
        slopes = _slopes(*_at_random(study, leading, number, seed=1), leading)
        more, more_leads = _echelon(np.concatenate([rows, _null_space(slopes, len(leading))]))
        if len(more) > by_units and all(_holds(cells, old, names, row) for row in more):
            rows, leads = more, more_leads
    weights = {name: [_fraction(w) for w in row] for name, row in zip(names, rows.T.tolist(), strict=True)}
    return weights, [names[k] for k in leads], len(rows) - by_units, int(_valued(old).sum())


def _is_scalable(study: Study, field: Field) -> bool:
    """Not words, whole numbers, zeros, what follows another, nor a plain number left at its default."""
    if field.choices or field.integer or field.name in study.follows:
        return False
    if field.name in study.axes:
        return True
    at_default = field.default is not None and not differs(field, study.fixed)
    if at_default and (isinstance(field.default, str) or not any(exponents(field.unit).values())):
        return False
    return bool(np.any(study.fixed[field.name]))


def _at_random(study: Study, fields: Sequence[str], number: int, seed: int) -> tuple[Study, Cells]:
    """Cells of a study at random, beside its own values as far as they are not refused there, and what they give."""
    rng = np.random.default_rng(seed)
    own = drawn(study, number, rng)
    jitter = {name: np.exp(rng.uniform(-JITTER, JITTER, number)) for name in own.axes if name in fields}
    refused = ~_valued(solved(multiplied(own, jitter)))
    moved = multiplied(own, {name: np.where(refused, 1.0, by) for name, by in jitter.items()})
    return moved, solved(moved)


def _holds(study: Study, old: Cells, names: Sequence[str], row: Array) -> bool:
    """Whether fields and outputs may be multiplied like this; statuses may change as rounding decides."""
    fine = _valued(old)
    for factor in FACTORS:
        factors = {name: factor**weight for name, weight in zip(names, row.tolist(), strict=True) if weight}
        new = solved(multiplied(study, factors))
        was, now = (np.where(c.status == Status.INACCURATE, Status.OK, c.status) for c in (old, new))
        if not factors or not fine.any() or (was != now).any():
            return False
        for name, values in old.outputs.items():
            expected = factors.get(name, 1.0) * values[fine]
            if not np.allclose(new.outputs[name][fine], expected, AGREEMENT * study.rtol, 0, equal_nan=True):
                return False
    return True


def _slopes(study: Study, old: Cells, fields: Sequence[str]) -> Array:
    """dln y/dln p of all outputs in all cells by every field, and -1 of each output by itself: what times weights is 0
    in (1). Infinite by fields of which a kernel does not take other numbers; shape (values, fields and outputs)."""
    lengths = [_logs(old, name).size for name in old.outputs]
    found = np.full((sum(lengths), len(fields)), np.inf)
    for k, name in enumerate(fields):
        moved = [solved(multiplied(study, {name: math.exp(j * STEP)})) for j in (-2, -1, 1, 2)]
        if all(_valued(cells).sum() >= int(_valued(old).sum()) / 2 for cells in moved):
            logs = [np.concatenate([_logs(cells, output) for output in old.outputs]) for cells in moved]
            found[:, k] = (logs[0] - 8 * logs[1] + 8 * logs[2] - logs[3]) / (12 * STEP)
    return np.column_stack([found, -np.repeat(np.eye(len(lengths)), lengths, axis=0)])


def _valued(cells: Cells) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = (cells.status < FIRST_REFUSAL) & (cells.status != Status.PENDING)
    return found


def _logs(cells: Cells, output: str) -> Array:
    """Logarithms of an output's size, one cell after the other; NaN where it has none."""
    values = cells.outputs[output].reshape(cells.number, -1)
    there = _valued(cells)[:, None] & (values != 0)
    found: Array = np.log(abs(values), out=np.full(values.shape, np.nan), where=there).ravel()
    return found


def _null_space(slopes: Array, fields: int) -> Array:
    """What satisfies (1), a row for each name that elimination leaves free; none where weights are no fractions."""
    width, taken = slopes.shape[1], ~np.isinf(slopes).any(axis=0)
    finite = np.isfinite(slopes[:, taken]).all(axis=1)
    # names that lead are to be left free; an output that is never there is no unknown
    known = np.flatnonzero(taken & (slopes[finite].any(axis=0) | (np.arange(width) < fields)))[::-1]
    matrix = slopes[np.ix_(finite, known)]
    if len(matrix) < len(known):
        return np.empty((0, width))
    reduced, pivots = _echelon(matrix / np.maximum(1.0, abs(matrix).max(axis=1, keepdims=True)), LEAST_SLOPE)
    free = np.setdiff1d(np.arange(len(known)), pivots)
    weights = -reduced[:, free].T
    near = np.vectorize(lambda weight: float(_fraction(weight)), otypes=[float])(weights)
    found = np.zeros((len(free), width))
    found[:, known[pivots]], found[np.arange(len(free)), known[free]] = near, 1.0
    return found if (abs(near - weights) < NEAR).all() else found[:0]


def _fraction(weight: float) -> Fraction:
    return Fraction(weight).limit_denominator(LARGEST_DENOMINATOR)


def _echelon(matrix: Array, least: float = 1e-9) -> tuple[Array, list[int]]:
    """Reduced row echelon form, of pivots of at least some size, and their columns."""
    rows = matrix.copy()
    pivots: list[int] = []
    for column in range(rows.shape[1]):
        done = len(pivots)
        if done == len(rows):
            break
        pivot = done + int(abs(rows[done:, column]).argmax())
        if abs(rows[pivot, column]) <= least:
            rows[done:, column] = 0
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= rows[others, column : column + 1] * rows[done]
        pivots.append(column)
    return rows[: len(pivots)], pivots
