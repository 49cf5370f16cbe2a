"""Selects what a figure of a result shows, and its labels; independent of how it is drawn."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweep.cells.schema import ANCILLARY
from sweep.errors import SweepError
from sweep.explore.scattered import MOST_AXES, Box, axes_of, interpolated
from sweep.laws.loglog import is_logarithmic
from sweep.results.statuses import flag_words, is_summary
from sweep.study.model import Study
from sweep.words import a_name, did_you_mean, listed

GREEK = frozenset(
    (
        *("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi"),
        *("rho", "sigma", "tau", "phi", "chi", "psi", "omega", "Gamma", "Delta", "Theta", "Phi", "Psi", "Omega"),
    )
)
FAMILY = 8
"""Largest number of lines in one figure; more values of an axis of numbers make a map."""
POINTS, PIXELS = 20_000, 2_000
"""Points along a line and cells along the side of a map that are drawn; beyond, every second, third ... one."""
PASSAGE = "passage"
"""Coordinate of a section: its values are separate points, which are drawn over a parameter."""
SAME, ROUNDING = 1e-9, 1e-14
"""A state of a section that changes by less than this share of its size, or whose size is less than that share of the
largest state's, is kept by the surface."""
HARD_SPACE = "\u00a0"
"""A space at which lines are not broken."""
SIDE = 201
"""Cells along the sides of a map of cells that lie anywhere; of more axes as many cells altogether."""
LONGEST = 50
"""Longest description used as an axis label; for a longer one the name is used."""
OWN = {"INACCURATE": "#D55E00", "NOT_CONVERGED": "#B2182B", "FAILED": "#000000", "PENDING": "#999999"}
"""Colours of statuses that any kernel may give, none of them a map's own."""
OTHERS = (
    *("#CC79A7", "#E69F00", "#8C510A", "#FF9DA7", "#444444"),
    *("#FF7F50", "#E7298A", "#D9D9D9", "#7F0000", "#FFD8B1"),
)
"""Colours of the other statuses; one keeps its colour in all pictures of a result, and no kernel remarks on two of one
colour."""


class View:
    """An output `y` along coordinate `x` of dimension `along`, once for each value of dimension `across`.

    By default the `preferred` output, along what a trace runs along, else the longest axis. `y` and `status` have the
    dimensions (across, along), or (along,) where `across` is None; `held` says where the other axes stand, and what
    parameters of one value are, unless it is their default.

    Raises
    ------
    SweepError
        If there is no such output or axis.
    """

    def __init__(self, dataset: xr.Dataset, y: str | None = None, x: str | None = None) -> None:
        y, x = (name if name is None else a_name(what, name) for what, name in (("y", y), ("x", x)))
        known = outputs(dataset)
        if not known:
            raise SweepError("there is nothing to draw: no output varies along an axis")
        name = one_of(y or preferred(dataset, known), known, f"there is no output {y!r} to draw")
        if not dataset[name].size:
            raise SweepError(f"there is nothing to draw: an axis of {name} has no values")
        fixed = [dataset[name] for name in given(dataset) if name in dataset.coords and not dataset[name].dims]
        if x is None:
            dataset = evened(dataset, axes=2)
        output, cells = dataset[name], dataset["status"].dims if "status" in dataset else ()
        known = lines_of(output)
        if x is None:
            along_it = [str(dim) for dim in output.dims if dim in known]
            traces = [dim for dim in along_it if cells and dim not in cells and dim != PASSAGE]
            axes = traces or [dim for dim in along_it if dim != PASSAGE] or known
            if not axes:
                raise SweepError(f"{name} has no number axis to draw it along")
            x = max(axes, key=lambda axis: output[axis].size)
        self.x = one_of(x, known, f"there is no number axis {x!r} to draw {name} along")
        self.along = along = str(output[x].dims[0])
        others = sorted((str(d) for d in output.dims if d != along), key=lambda d: -dataset.sizes[d])
        self.across = across = others[0] if others else None
        held = {dim: dataset.sizes[dim] // 2 for dim in others[1:]}
        single = [coordinate(output, dim)[index] for dim, index in held.items()]
        self.held = ", ".join(map(setting, [*single, *fixed]))
        shown = dataset[[name] + (["status"] if "status" in dataset else [])].isel(held)
        # no more cells than a picture can show
        mapped = across is not None and shown.sizes[across] > FAMILY
        most = dict.fromkeys((across, along), PIXELS) if mapped else {along: POINTS}
        shown = shown.isel({d: slice(None, None, -(-shown.sizes[d] // n)) for d, n in most.items() if d}).compute()
        for dim in (along, across):
            if dim is not None and is_number_axis(shown[name], dim) and dim in shown.coords:
                shown = shown.sortby(dim)
        self.y = values = shown[name].transpose(*([across] if across else []), along)
        status = shown["status"] if "status" in shown else xr.zeros_like(values, int)
        # what ds.where has left out has no value either
        self.status = status.fillna(0).broadcast_like(values).transpose(*values.dims).values.astype(int)
        self.meanings = flag_words(status)

    @property
    def mapped(self) -> bool:
        """Whether it is a map, and no line or family of lines."""
        return self.across is not None and self.y.sizes[self.across] > FAMILY and is_number_axis(self.y, self.across)

    @property
    def passed(self) -> bool:
        """Whether it is a section over a parameter: many points at each of its values."""
        return self.across == PASSAGE

    @property
    def joined(self) -> bool:
        """Whether neighbours along x are neighbours in the study, so that a line may join them."""
        return self.x == self.along

    def axis(self, name: str) -> xr.DataArray:
        """The coordinate of that name."""
        return coordinate(self.y, name)

    def values(self, name: str) -> NDArray[Any]:
        """Those of a coordinate."""
        return self.axis(name).values

    def name(self, code: int) -> str:
        """What a status is called."""
        return self.meanings.get(code, str(code))

    def colour(self, code: int) -> str:
        """The colour of a status, the same in a picture and in the viewer."""
        rest = sorted(number for number, name in self.meanings.items() if name not in OWN)
        return OWN.get(self.name(code)) or dict(zip(rest, cycle(OTHERS), strict=False)).get(code, OTHERS[0])

    def codes(self) -> list[int]:
        """Statuses other than OK that occur."""
        return [int(code) for code in np.unique(self.status) if code != 0]


def outputs(dataset: xr.Dataset) -> list[str]:
    """The outputs that run along an axis."""
    columns = dataset.data_vars.items()
    return [str(name) for name, v in columns if v.ndim and name not in ANCILLARY and v.dtype.kind in "fiu"]


def lines_of(output: xr.DataArray) -> list[str]:
    """Coordinates of numbers that an output can be drawn along."""
    return [str(name) for name, c in output.coords.items() if c.ndim == 1 and c.dtype.kind in "fiu"]


def one_of(name: str, known: Sequence[str], fault: str) -> str:
    """The name. Raises SweepError where it is not known: the fault, and a name that is."""
    if name not in known:
        raise SweepError(fault + (did_you_mean(name, known) or f"; known: {listed(known, word='and') or 'none'}"))
    return name


def evened(dataset: xr.Dataset, axes: int = MOST_AXES) -> xr.Dataset:
    """Cells of a refined result, which lie anywhere, as an even grid of its first axes; the others at their middle."""
    names = axes_of(dataset)
    if not names:
        return dataset
    box = Box.of(dataset, names)
    axes = min(axes, len(names))
    even, middle = np.linspace(0.0, 1.0, round(SIDE ** (2 / axes))), np.array([0.5])
    return interpolated(dataset, {name: box.values(k, even if k < axes else middle) for k, name in enumerate(names)})


def preferred(dataset: xr.Dataset, outputs: Sequence[str]) -> str:
    """The output that is shown where none is asked for: the first, but no `time` and no number of cells.

    Of a section the first state that its surface does not keep the same at every passage.
    """
    states = [name for name in outputs if PASSAGE in dataset[name].dims and name != "time"]
    largest = max((float(abs(dataset[name]).max()) for name in states), default=0.0)
    for name in outputs:
        column = dataset[name]
        if name == "time" or (is_summary(dataset) and name.endswith("_count")):
            continue
        if name not in states:
            return name
        if float(column.max() - column.min()) > max(SAME * float(abs(column).max()), ROUNDING * largest):
            return name
    return outputs[0]


def given(dataset: xr.Dataset) -> list[str]:
    """Axes, and parameters that are fixed to something else than their default, as the study of a result has them."""
    if "study_json" not in dataset.attrs:
        return []
    study = Study.of(dataset, declared=True)
    return [p.name for p in study.kernel.parameters if p.default is None or p.name in study.terms]


def coordinate(y: xr.DataArray, name: str) -> xr.DataArray:
    """Coordinate of that name; of bins their middle; a dimension that has none is counted from 0."""
    if name not in y.coords and f"{name}_lower" in y.coords:
        ends = [y[f"{name}_{end}"] for end in ("lower", "upper")]
        product, total = ends[0] * ends[1].values, ends[0] + ends[1].values
        middle = product**0.5 if is_logarithmic(ends[0]) else total / 2
        what = str(y.attrs.get("long_name", "")).partition(": ")[2]
        return middle.assign_attrs({**ends[0].attrs, "long_name": what}).rename(name)
    return y[name] if name in y.coords else xr.DataArray(np.arange(y.sizes[name]), dims=name, name=name)


def is_number_axis(y: xr.DataArray, name: str) -> bool:
    """Whether the values of a coordinate are numbers, not words."""
    return coordinate(y, name).dtype.kind in "fiu"


def edges(grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges of the cells around the points of a grid, (n + 1,): halfway; of a logarithmic grid in logarithms."""
    if grid.size == 1:
        return np.array([grid[0] - 0.5, grid[0] + 0.5])
    at = np.log(grid) if is_logarithmic(grid) else grid
    middle = (at[1:] + at[:-1]) / 2
    around = np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])
    return np.exp(around) if is_logarithmic(grid) else around


def symbol(name: str) -> str:
    """Mathematical form of a parameter's name, "" if it is a word: mu, phi0 and R_s, but not period."""
    letter, _, index = name.partition("_")
    digits = re.fullmatch(r"([A-Za-z]+?)(\d+)", letter)
    if digits and not index:
        letter, index = digits.groups()
    if letter not in GREEK and len(letter) > 1:
        return ""
    sign = "\\varphi" if letter == "phi" else f"\\{letter}" if letter in GREEK else letter
    return f"${sign}_{{\\mathrm{{{index}}}}}$" if index else f"${sign}$"


def unit_text(unit: str) -> str:
    """Unit with its powers raised, "" for a pure number; a number cannot stand before 1/s."""
    unit = re.sub(r"^1/([A-Za-z]+)(?:\^(\d+))?$", lambda found: f"{found[1]}^-{found[2] or 1}", unit)
    return "" if unit in ("", "1") else re.sub(r"\^(-?\d+)", r"$^{\1}$", unit)


def meaning(variable: xr.DataArray) -> str:
    """What a variable is: its long name up to the first break; "" where that is too long for an axis."""
    words = re.split(r"[;:]| \(|, |\. ", str(variable.attrs.get("long_name", "")).strip())[0].strip(" .\n")
    return words if len(words) <= LONGEST and "\n" not in words else ""


def label(variable: xr.DataArray, width: int = 44) -> str:
    """Text for an axis: meaning, symbol, unit; in lines of so many letters, none of which begins with the unit."""
    name = str(variable.name)
    sign, unit = symbol(name), unit_text(str(variable.attrs.get("units", "")))
    words = meaning(variable) or ("" if sign else name.replace("_", " "))
    text = ", ".join(part for part in (words, sign) if part)
    text = f"{text}{HARD_SPACE}[{unit.replace(' ', HARD_SPACE)}]" if unit else text
    signs = re.findall(r"\$.*?\$", text)
    for sign in signs:  # a few letters in print, whatever they are in writing
        text = text.replace(sign, "\0\0", 1)
    wrapped = "\n".join(textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False))
    for sign in signs:
        wrapped = wrapped.replace("\0\0", sign, 1)
    return wrapped.replace(HARD_SPACE, " ")


def setting(value: xr.DataArray) -> str:
    """One value of an axis, e.g. "a = 0.5 1/s"."""
    name, unit = str(value.name), unit_text(str(value.attrs.get("units", "")))
    number = f"{value.item():.4g}" if value.dtype.kind in "fiu" else str(value.item())
    number = flag_words(value).get(value.item(), number)
    return f"{symbol(name) or name.replace('_', ' ')} = {number}" + (f" {unit}" if unit else "")
