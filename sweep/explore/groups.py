"""Dimensionless groups: which axes of a sweep matter, found from the units a kernel declares and tried on its cells.

Measuring lengths, masses, times or angles in another unit changes the numbers and not the scene, so outputs depend on
products of powers without units alone (Buckingham). Angles count here: an escapement's swing may be measured in any
unit as long as nothing in it is a sine. Whether that holds is tried, not believed: some cells of the study are solved
again in other units, and only a unit that changes nothing but the numbers counts as one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from kernels.interface import FIRST_REFUSAL, Field, Status
from sweep.cells.sample import sampled, solved
from sweep.study.model import Study, differs
from sweep.study.units import exponents

if TYPE_CHECKING:
    import xarray as xr

TRIED_CELLS = 5
FACTOR = 1.7
"""By which units are changed to see whether anything else changes."""
AGREEMENT = 30.0
"""Times rtol that outputs in other units may differ from the same outputs in the old ones."""

Powers = Mapping[str, Fraction]
Units = dict[str, dict[str, Fraction]]


@dataclass(frozen=True)
class Group:
    """A product of powers of parameters that has no unit: `str` of {mu: 1, a: -2, phi0: -1} is "mu/(a^2 phi0)"."""

    powers: tuple[tuple[str, Fraction], ...]

    def __str__(self) -> str:
        over = [_power(name, p) for name, p in self.powers if p > 0]
        under = [_power(name, -p) for name, p in self.powers if p < 0]
        below = f"({' '.join(under)})" if len(under) > 1 else "".join(under)
        return f"{' '.join(over) or '1'}/{below}" if under else " ".join(over)

    def of(self, values: Mapping[str, xr.DataArray]) -> xr.DataArray:
        """The group's value, from those of its parameters."""
        product: xr.DataArray = 1.0  # type: ignore[assignment]
        for name, power in self.powers:
            product = product * values[name] ** float(power)
        return product


def _power(name: str, power: Fraction) -> str:
    if power == 1:
        return name
    return f"{name}^{power}" if power.denominator == 1 else f"{name}^({power})"


@dataclass(frozen=True)
class Scaling:
    """What units say about a study.

    Attributes
    ----------
    groups : tuple of Group
        All that its cells depend on, beside parameters that have no unit. None of a kernel with array parameters.
    scales : dict of output to Group
        What an output is multiplied by to have no unit.
    axes : tuple of str
        The axes that have a unit that counts.
    free : int
        How many of the study's axes change nothing but the numbers.
    """

    groups: tuple[Group, ...]
    scales: dict[str, Group]
    axes: tuple[str, ...]
    free: int

    @property
    def advice(self) -> str:
        """What `sweep plan` says of superfluous axes; "" where there are none."""
        if not self.free:
            return ""
        left = len(self.axes) - self.free
        names, varied = ", ".join(self.axes), [str(g) for g in self.groups if self._varies(g)]
        if left == 0:
            return f"every output is a power of {names} times a constant; a single cell tells all"
        matter = f"only {', '.join(varied)} matter{'s' * (len(varied) == 1)}; " if varied else ""
        kind = "one-dimensional" if left == 1 else f"{left}-dimensional"
        return f"{kind} in {names}: {matter}{self.free} of these axes can be left out"

    def _varies(self, group: Group) -> bool:
        return any(name in self.axes for name, _ in group.powers)


def scaling(study: Study) -> Scaling:
    """Groups of a study's parameters, and how many of its axes are superfluous.

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
    one-dimensional in mu, a: only mu/(phi0 a^2) matters; 1 of these axes can be left out
    """
    units = _units(study)
    counting = [base for base in _bases(units) if _is_a_matter_of_units(study, units, base)]
    units = {name: {b: p for b, p in powers.items() if b in counting} for name, powers in units.items()}
    present = [f.name for f in study.kernel.parameters if _present(study, f)]
    repeating, groups = _groups(present if not any(f.dims for f in study.kernel.parameters) else [], units)
    scales = {o.name: group for o in study.asked if (group := _scale(o.name, repeating, units)) is not None}
    axes = tuple(name for name in study.axes if units.get(name))
    return Scaling(tuple(groups), scales, axes, _free(study, units, present, counting))


def rescaled(dataset: xr.Dataset, study: Study | None = None) -> xr.Dataset:
    """The Dataset with its outputs freed of units, and a coordinate for each dimensionless group.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`.
    study : Study, optional
        Default: the one in the Dataset's attributes, of a kernel in the catalogue.

    Returns
    -------
    Dataset
        Outputs whose unit is 1 and whose `long_name` says the product; coordinates `group_1`, `group_2` ..., likewise.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> foliot = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> ds = sweep.run(**foliot | {"fixed": {"phi0": 1.0}}, axes={"mu": [0.5, 1.0], "a": [1.0, 2.0]})
    >>> sorted(set(sweep.rescaled(ds).variables) - set(ds.variables))
    ['group_1']
    """
    study = study or Study.from_json(str(dataset.attrs["study_json"]))
    found = scaling(study)
    values = {str(name): dataset[name] for name in dataset.coords}
    values |= {name: values[axis] for name, axis in study.follows.items()}
    for number, group in enumerate(found.groups, 1):
        coordinate = group.of(values)
        coordinate.attrs = {"units": "1", "long_name": str(group)}
        dataset = dataset.assign_coords({f"group_{number}": coordinate})
    for name, group in found.scales.items():
        output = dataset[name] * group.of(values)
        output.attrs = {**dataset[name].attrs, "units": "1", "long_name": _product(name, group)}
        dataset[name] = output
    return dataset


def collapse_quality(x: xr.DataArray, y: xr.DataArray) -> float:
    """How far points lie off one common curve y(x): root mean square of the relative distance of each from the straight
    line, in logarithms, between its two neighbours in x.

    Points that fall on one curve leave what the curve bends between neighbours, which shrinks as the square of their
    distance; others leave the scatter of the curves.

    Examples
    --------
    >>> import numpy as np
    >>> import sweep
    >>> import xarray as xr
    >>> x = xr.DataArray(np.geomspace(1.0, 100.0, 21), dims="x")
    >>> sweep.collapse_quality(x, x**-0.5) < 1e-12
    True
    """
    import xarray as xr

    x, y = xr.broadcast(x, y)
    t, z = np.log(x.values.ravel()), np.log(y.values.ravel())
    fine = np.isfinite(t) & np.isfinite(z)
    order = np.argsort(t[fine], kind="stable")
    t, z = t[fine][order], z[fine][order]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(t[2:] > t[:-2], (t[1:-1] - t[:-2]) / (t[2:] - t[:-2]), 0.5)
    off = z[1:-1] - (1 - share) * z[:-2] - share * z[2:]
    return float(np.sqrt(np.mean(off**2)))


def _product(name: str, group: Group) -> str:
    return f"{name}{str(group)[1:]}" if str(group).startswith("1/") else f"{name} {group}".strip()


def _units(study: Study) -> Units:
    fields: Sequence[Field] = (*study.kernel.parameters, *study.kernel.outputs, *study.kernel.along)
    return {f.name: {b: p for b, p in exponents(f.unit).items() if p} for f in fields}


def _bases(units: Units) -> list[str]:
    return sorted({base for powers in units.values() for base in powers})


def _present(study: Study, field: Field) -> bool:
    """Whether a number takes part in the cells on its own: it is an axis, or neither 0 nor left as another one."""
    if field.choices or field.dims or field.name in study.follows:
        return False
    as_another = isinstance(field.default, str) and not differs(field, study.fixed)
    return field.name in study.axes or (not as_another and bool(study.fixed[field.name]))


def _is_a_matter_of_units(study: Study, units: Units, base: str) -> bool:
    """Whether solving some cells with another unit of `base` changes nothing but the numbers."""
    factors = {name: FACTOR ** float(powers.get(base, 0)) for name, powers in units.items()}
    old, new = solved(sampled(study, TRIED_CELLS)), solved(sampled(study, TRIED_CELLS, factors))
    fine = (old.status < FIRST_REFUSAL) & (old.status != Status.PENDING)
    if not fine.any() or (old.status != new.status).any():
        return False
    rtol = AGREEMENT * study.rtol
    return all(
        np.allclose(new.outputs[name][fine], factors[name] * values[fine], rtol=rtol, atol=0, equal_nan=True)
        for name, values in old.outputs.items()
    )


def _groups(names: Sequence[str], units: Units) -> tuple[list[str], list[Group]]:
    """Repeating parameters, the simplest in unit first, and the groups of the others with them.

    A parameter of the same unit as one before it is divided by that: R/mu rather than R/(a^2 phi0).
    """
    with_unit = [name for name in names if units[name]]
    repeating: list[str] = []
    for name in sorted(with_unit, key=lambda n: sum(abs(p) for p in units[n].values())):
        if _solve(repeating, units, name) is None:
            repeating.append(name)
    groups: list[Group] = []
    for i, name in enumerate(with_unit):
        like = next((n for n in with_unit[:i] if units[n] == units[name]), None)
        if like is not None:
            groups.append(_ordered({name: Fraction(1), like: Fraction(-1)}, names))
        elif name not in repeating:
            powers = _solve(repeating, units, name) or {}
            groups.append(_ordered({name: Fraction(1)} | {n: -p for n, p in powers.items()}, names))
    return repeating, groups


def _ordered(powers: Powers, names: Sequence[str]) -> Group:
    return Group(tuple((name, powers[name]) for name in names if powers.get(name)))


def _scale(output: str, repeating: Sequence[str], units: Units) -> Group | None:
    """Powers of the repeating parameters that free an output of its unit."""
    powers = _solve(repeating, units, output)
    return None if powers is None else _ordered({name: -p for name, p in powers.items()}, repeating)


def _solve(columns: Sequence[str], units: Units, name: str) -> dict[str, Fraction] | None:
    """Powers of `columns` whose product has the unit of `name`; None where there are none. Exact elimination."""
    bases = _bases({n: units[n] for n in (*columns, name)})
    rows = [[units[c].get(b, Fraction(0)) for c in columns] + [units[name].get(b, Fraction(0))] for b in bases]
    pivots: list[int] = []
    for column in range(len(columns)):
        pivot = next((r for r in range(len(pivots), len(rows)) if rows[r][column]), None)
        if pivot is None:
            return None  # columns are kept independent, so this does not happen
        rows[len(pivots)], rows[pivot] = rows[pivot], rows[len(pivots)]
        row = rows[len(pivots)] = [v / rows[len(pivots)][column] for v in rows[len(pivots)]]
        for r in range(len(rows)):
            if r != len(pivots) and rows[r][column]:
                factor = rows[r][column]
                rows[r] = [a - factor * b for a, b in zip(rows[r], row, strict=True)]
        pivots.append(column)
    if any(row[-1] for row in rows[len(pivots) :]):
        return None
    return {columns[c]: rows[i][-1] for i, c in enumerate(pivots)}


def _free(study: Study, units: Units, present: Sequence[str], counting: Sequence[str]) -> int:
    """Axes less the dimension of what they span once units may be chosen so that fixed parameters keep their values."""
    swept = [n for n in study.axes if units.get(n)]
    arrays = [f.name for f in study.kernel.parameters if f.dims and f.name not in study.axes]
    shared = [name for name, values in study.along.items() if len(values)]
    fixed = [n for n in (*present, *arrays, *shared) if n not in study.axes]

    def rank(names: Sequence[str]) -> int:
        matrix = [[float(units[n].get(b, 0)) for b in counting] for n in names]
        return int(np.linalg.matrix_rank(np.array(matrix))) if matrix and counting else 0

    return rank([*fixed, *swept]) - rank(fixed)
