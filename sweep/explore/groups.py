"""Dimensionless groups: which axes of a sweep matter, by the scalings that `symmetries` finds and tries on its cells.

Measuring lengths, masses, times or angles in another unit changes the numbers and not the scene, so outputs depend on
products of powers without units alone (Buckingham). Angles count here: an escapement's swing may be measured in any
unit as long as nothing in it is a sine. Scalings that units do not tell count alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from sweep.explore.symmetries import scalings
from sweep.study.model import Study
from sweep.study.read import Given
from sweep.study.read import study as as_study
from sweep.words import require_dataset

if TYPE_CHECKING:
    import xarray as xr

LARGEST_COMMON = 4
"""Denominator by which a group is raised to have whole powers."""

Powers = Mapping[str, Fraction]


@dataclass(frozen=True)
class Group:
    """A product of powers of parameters that has no unit: `str` of {mu: 1, a: -2, phi0: -1} is "mu/(a^2 phi0)"."""

    powers: tuple[tuple[str, Fraction], ...]

    def __str__(self) -> str:
        def product(factors: list[tuple[str, Fraction]]) -> str:
            exponents = (f"{power}" if power.denominator == 1 else f"({power})" for _, power in factors)
            pairs = zip(factors, exponents, strict=True)
            return " ".join(name if power == 1 else f"{name}^{text}" for (name, power), text in pairs)

        over = product([(name, power) for name, power in self.powers if power > 0])
        under = [(name, -power) for name, power in self.powers if power < 0]
        below = f"({product(under)})" if len(under) > 1 else product(under)
        return f"{over or '1'}/{below}" if under else over

    def of(self, values: Mapping[str, xr.DataArray]) -> xr.DataArray:
        """The group's value, from those of its parameters."""
        product: xr.DataArray = 1.0  # type: ignore[assignment]
        for name, power in self.powers:
            product = product * values[name] ** float(power)
        return product


@dataclass(frozen=True)
class Scaling:
    """What units say about a study.

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
    follows : dict of parameter to axis
        Parameters that take the values of an axis of another name.
    """

    groups: tuple[Group, ...]
    scales: dict[str, Group]
    axes: tuple[str, ...]
    free: int

    others: tuple[str, ...] = ()
    hidden: int = 0
    tried: int = 0
    follows: Mapping[str, str] = field(default_factory=dict)

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
        values |= {name: values[axis] for name, axis in self.follows.items()}
        for number, group in enumerate(self.groups, 1):
            coordinate = group.of(values)
            coordinate.attrs = {"units": "1", "long_name": str(group)}
            dataset = dataset.assign_coords({f"group_{number}": coordinate})
        for name, group in self.scales.items():
            output = dataset[name] * group.of(values)
            long_name = f"{name}{str(group)[1:]}" if str(group).startswith("1/") else f"{name} {group}".strip()
            output.attrs = {**dataset[name].attrs, "units": "1", "long_name": long_name}
            dataset[name] = output
        return dataset


def scaling(study: Given, seconds: float | None = None) -> Scaling:
    """Groups of a study's parameters, and how many of its axes are superfluous.

    Parameters
    ----------
    study : Study, path, mapping of its keys, or Dataset that came from it
    seconds : float, optional
        What trying scalings on cells may take, else none is found. Default: about two, and longer for dear kernels, of
        which those of the declared units alone are tried, on four cells.

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
    found = scalings(study, seconds)
    fields = {f.name: f for f in (*study.kernel.parameters, *study.kernel.along)}
    scaled = [name for name in fields if any(found.weights(name))]
    arrays = any(field.dims for field in study.kernel.parameters)
    present = [] if arrays else [name for name in scaled if name not in study.along]
    leading = [name for name in found.leading if name in present]

    def against(name: str) -> Powers:
        """Powers of the leading parameters whose product scales against a field."""
        weights = dict(zip(found.leading, found.weights(name), strict=True))
        return {lead: -weights[lead] for lead in leading}

    def group(powers: Powers) -> Group:
        return Group(tuple((name, powers[name]) for name in present if powers.get(name)))

    groups = []
    for i, name in enumerate(present):
        like = next((n for n in present[:i] if found.weights(n) == found.weights(name)), None)
        if like is not None:  # R/mu rather than R/(a^2 phi0)
            groups.append(group({name: Fraction(1), like: Fraction(-1)}))
        elif name not in leading:
            powers = {name: Fraction(1), **against(name)}
            common = math.lcm(*(power.denominator for power in powers.values()))
            groups.append(group({n: p * (common if common <= LARGEST_COMMON else 1) for n, p in powers.items()}))
    # an output that scales with what does not lead cannot be freed of units
    elsewhere = [k for k, lead in enumerate(found.leading) if lead not in leading]
    freed = [o.name for o in study.asked if not any(found.weights(o.name)[k] for k in elsewhere)]
    axes = tuple(name for name in study.axes if name in scaled)
    fixed = [name for name in scaled if name not in axes]
    return Scaling(
        groups=tuple(groups),
        scales={name: group(against(name)) for name in freed},
        axes=axes,
        free=found.rank([*fixed, *axes]) - found.rank(fixed),
        others=tuple(name for name in study.axes if name in fields and name not in axes),
        hidden=found.hidden,
        tried=found.cells,
        follows=study.follows,
    )


def advice_on(study: Study | str, seconds: float) -> str:
    """The advice on a study, which may be JSON, as far as there is any in some seconds."""
    given = Study.from_json(study, allow_import=True) if isinstance(study, str) else study
    found = scaling(given, seconds)
    late = "superfluous axes are not looked for, which would take as long as the run; sweep.scaling(study) does"
    return found.advice if found.tried else late
