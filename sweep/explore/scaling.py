"""Superfluous axes and dimensionless groups, from scalings that are tried on a few cells.

A scaling multiplies each field i by a power s^w_i of a factor s. It holds if every output j is then multiplied by some
power s^v_j, the same in every cell. Measuring lengths, masses, times or angles in another unit is such a scaling, so
outputs depend on products of powers without units alone (Buckingham). Angles count here: an escapement's swing may be
measured in any unit as long as nothing in it is a sine. Where a unit does not hold as declared, a number without unit
may have one, as the strength of a drag c v^n has, which depends on n: a few powers of it are tried.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from kernels.interface import FIRST_REFUSAL, Field, Status
from sweep.cells.sample import drawn, multiplied, solved
from sweep.cells.schema import STATUS, Columns
from sweep.results.statuses import require_as_read
from sweep.study.model import Study, differs
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.units import exponents
from sweep.words import Table, require_dataset

if TYPE_CHECKING:
    import xarray as xr

CELLS, FEW = 24, 4
"""Number of cells for tests of scalings; a few come first, since scalings that do not hold may make cells slow."""
RTOL, AGREEMENT = 1e-9, 30.0
"""Cells are solved to that at least, for a loose tolerance lets pass what does not hold; outputs may differ by that
multiple of it."""
FACTORS = (2.0, 0.25)
"""Powers of two change no digit, so that chaotic motions stay the same."""
POWERS = tuple(Fraction(power, 2) for power in (-2, -1, 1, 2))
"""Powers that are tried for a dimensionless number."""
LARGEST_DENOMINATOR, LARGEST_COMMON = 200, 4
"""Of an output's weight; and the largest by which a group is raised to have whole powers."""

Weights = Mapping[str, Fraction]
ONE = Fraction(1)


class Group(dict[str, Fraction]):
    """Powers of parameters whose product has no unit: `str` of {mu: 1, a: -2, phi0: -1} is "mu/(a^2 phi0)"."""

    def __str__(self) -> str:
        def product(sign: int) -> list[str]:
            powers = [(name, sign * power) for name, power in self.items() if sign * power > 0]
            return [name if p == 1 else f"{name}^{p}" if p.denominator == 1 else f"{name}^({p})" for name, p in powers]

        over, under = " ".join(product(1)), product(-1)
        below = f"({' '.join(under)})" if len(under) > 1 else "".join(under)
        return f"{over or '1'}/{below}" if under else over

    def of(self, values: Mapping[str, xr.DataArray]) -> xr.DataArray:
        """The group's value, from those of its parameters."""
        return math.prod(values[name] ** float(power) for name, power in self.items())  # type: ignore[return-value]


class Scaling:
    """Result of `scaling`.

    Attributes
    ----------
    groups : tuple of Group
        Groups that determine the outputs, together with parameters that do not scale; none for array parameters.
    scales : dict of output to Group
        Factor that makes an output dimensionless.
    free : int
        Number of axes that only rescale the outputs.
    advice : str
        What `sweep plan` says about superfluous axes; "" if there are none.
    """

    def __init__(self, study: Study) -> None:
        self._study, (held, tried) = study, _held(study)
        fields = [f.name for f in (*study.kernel.parameters, *study.kernel.along)]
        weights = {f: [row[f] for row in held.values()] for f in fields if any(row.get(f) for row in held.values())}
        arrays = any(field.dims for field in study.kernel.parameters)
        present = [] if arrays else [name for name in weights if name not in study.along]

        def group(powers: Weights, most: int = 1) -> Group:
            """Their product, raised to whole powers where their denominator is no larger."""
            common = math.lcm(*(power.denominator for power in powers.values()))
            factor = common if common <= most else 1
            return Group({name: factor * powers[name] for name in present if powers.get(name)})

        groups = list[Group]()
        for i, name in enumerate(present):
            if name not in held:
                # R/mu rather than R/(a^2 phi0)
                like = next((other for other in present[:i] if weights[other] == weights[name]), None)
                against = {like: -ONE} if like else {lead: -row[name] for lead, row in held.items()}
                groups.append(group({**against, name: ONE}, LARGEST_COMMON))
        # an output that scales with what is in no group cannot be freed of units
        stuck = [row for lead, row in held.items() if lead not in present]
        free_outputs = [output.name for output in study.asked if not any(row[output.name] for row in stuck)]
        self.scales = {name: group({lead: -row[name] for lead, row in held.items()}) for name in free_outputs}
        self.groups = tuple(groups)

        axes = [name for name in study.axes if name in weights]
        unswept = np.array([row for name, row in weights.items() if name not in axes], float)
        self.free = free = len(held) - int(np.linalg.matrix_rank(unswept) if unswept.size else 0)
        left, swept = len(axes) - free, ", ".join(axes)
        others = ", ".join(name for name in study.axes if name in fields and name not in axes)
        where, basis = f" for each {others}" if others else "", f"tried on {tried} cells at random"
        varied = [str(group) for group in groups if not group.keys().isdisjoint(axes)]
        matter = f"only {', '.join(varied)} matter{'s' * (len(varied) == 1)}; " if varied else ""
        kind = "one-dimensional" if left == 1 else f"{left}-dimensional"
        advice = f"{kind} in {swept}{where}: {matter}{free} of these axes can be left out; {basis}"
        if left == 0:
            advice = f"every output is a power of {swept} times a constant; a single cell tells all{where}; {basis}"
        self.advice = advice if free else ""

    def __repr__(self) -> str:
        rows = [
            ("groups", ", ".join(map(str, self.groups)) or "none"),
            ("scales", ", ".join(f"{name}: {group or 1}" for name, group in self.scales.items()) or "none"),
            ("axes", self.advice or "none of them can be left out"),
        ]
        return Table(rows).text()

    def rescaled(self, dataset: xr.Dataset) -> xr.Dataset:
        """A result of the study with dimensionless outputs, and a coordinate for each dimensionless group.

        Parameters
        ----------
        dataset : Dataset
            From `run` or `open_result`.

        Returns
        -------
        Dataset
            Outputs in the unit 1, with their definition as `long_name`; coordinates `group_1`, `group_2` ...,
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
        require_as_read(dataset, self._study, self.scales)
        values = {str(name): dataset[name] for name in dataset.coords}
        for number, group in enumerate(self.groups, 1):
            coordinate = group.of(values).assign_attrs(units="1", long_name=str(group))
            dataset = dataset.assign_coords({f"group_{number}": coordinate})
        for name, group in self.scales.items():
            long_name = f"{name}{str(group)[1:]}" if str(group).startswith("1/") else f"{name} {group}".strip()
            output = dataset[name] * group.of(values)
            attrs = {**dataset[name].attrs, "units": "1", "long_name": long_name}
            dataset = dataset.assign({name: (output.dims, output.data, attrs)})
        return dataset


def scaling(study: Given) -> Scaling:
    """Dimensionless groups of a study's parameters, and the number of superfluous axes.

    Scalings are tested on four cells, and those that hold there on 24.

    Parameters
    ----------
    study : Study, path of a study file, mapping of its keys, or Dataset that `run` made of it

    Raises
    ------
    SweepError
        The kernel fails.

    Examples
    --------
    >>> import sweep
    >>> axes = {"mu": [0.5, 1.0], "a": [1.0, 2.0]}
    >>> study = sweep.study(kernel="foliot", outputs=["period"], fixed={"phi0": 1.0}, axes=axes)
    >>> print(sweep.scaling(study).advice)
    one-dimensional in mu, a: only mu/(phi0 a^2) matters; 1 of these axes can be left out; tried on ... cells at random
    """
    return Scaling(as_study(study))


def _held(study: Study) -> tuple[dict[str, Weights], int]:
    """Scalings that hold on random cells, weights of fields and outputs, by the field that leads each: its weight is 1,
    and 0 in the others. And the number of cells."""
    study = dataclasses.replace(study, rtol=min(study.rtol, RTOL))
    along = [field for field in study.kernel.along if len(study.along[field.name])]
    fields = [*(field for field in study.kernel.parameters if _is_scalable(study, field)), *along]
    units = {f.name: {base: p for base, p in exponents(f.unit).items() if p} for f in fields}
    # fields of the simplest unit lead; numbers without one, and what is no number of a cell, come last
    fields.sort(key=lambda f: (f in along, bool(f.dims), not units[f.name], sum(map(abs, units[f.name].values()))))
    few, cells = (drawn(study, number, np.random.default_rng(2)) for number in (FEW, CELLS))
    old_few, old = solved(few), solved(cells)
    valued = old[STATUS] < FIRST_REFUSAL
    # a coordinate may be a share of something, whatever its unit
    changes: list[Weights] = [{}, *({field.name: 0 * ONE} for field in along)]
    changes += [{field.name: power} for field in fields if not units[field.name] for power in POWERS]
    held = dict[str, Weights]()
    for base in sorted({base for powers in units.values() for base in powers}) if valued.any() else ():
        declared = {field.name: Fraction(units[field.name].get(base, 0)) for field in fields}
        for change in changes:
            weights = {**declared, **change}
            if _tried(few, old_few, weights) and (row := _tried(cells, old, weights)):
                held[base] = row
                break
    led = dict[str, Weights]()
    for field in fields:  # their reduced echelon form
        if first := next((base for base, row in held.items() if row[field.name]), None):
            row = held.pop(first)
            led[field.name] = lead = {name: weight / row[field.name] for name, weight in row.items()}
            for rows, key in [*((held, key) for key in held), *((led, key) for key in led if key != field.name)]:
                factor = rows[key][field.name]
                rows[key] = {name: weight - factor * lead[name] for name, weight in rows[key].items()}
    return led, int(valued.sum())


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


def _tried(study: Study, old: Columns, weights: Weights) -> Weights | None:
    """Weights of fields, and of outputs as they come out, if these scale; statuses may change as rounding decides."""
    fine, found = old[STATUS] < FIRST_REFUSAL, dict.fromkeys(study.outputs, 0 * ONE)
    for factor in FACTORS:
        new = solved(multiplied(study, {name: factor ** float(weight) for name, weight in weights.items() if weight}))
        was, now = (np.where(c[STATUS] == Status.INACCURATE, Status.OK, c[STATUS]) for c in (old, new))
        if (was != now).any():
            return None
        for name in study.outputs:
            before, after = old[name][fine], new[name][fine]
            usable = np.isfinite(before) & (before * after > 0)
            if factor == FACTORS[0] and usable.any():
                weight = math.log(np.median(after[usable] / before[usable])) / math.log(factor)
                found[name] = Fraction(weight).limit_denominator(LARGEST_DENOMINATOR)
            expected = factor ** float(found[name]) * before
            if not np.allclose(after, expected, AGREEMENT * study.rtol, 0, equal_nan=True):
                return None
    return {**weights, **found}
