"""A checked study, its exact JSON form, and its kernel, found by name."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kernels import catalogue
from kernels.interface import Field, Kernel, Method, load
from sweep.errors import SweepError
from sweep.study.mistakes import show
from sweep.units import UnitMistake, exponents
from sweep.words import did_you_mean, flag, kind, listed

if TYPE_CHECKING:
    import xarray as xr

FORMAT = 2
AUTO = -1
"""Number of the word "auto" on a method axis."""
SETTINGS = ("method", "rtol")
"""Settings that can be axes although they are not parameters of the kernel."""
SMALLEST_RTOL = 1e-15
RESERVED = ("status", "method_used", "error_bound", "method", "rtol", "cell")
"""Names that every result uses."""
ARRAY = '"float64":"%s"'
"""An array in the JSON of a study: as hexadecimal digits; in a file also @ and the name of a coordinate."""
DECLARED = {
    Kernel: ("name", "doc", "source", "parameters", "outputs", "methods", "along", "same_length"),
    Method: ("name", "doc", "excludes", "lacks"),
}
"""Parts of the kernel's declaration that a study stores, so that it can be read without the kernel."""


@dataclass(frozen=True, eq=False)
class Axis:
    """Values of one swept quantity.

    Attributes
    ----------
    name : str
        A parameter of the kernel, "method" or "rtol".
    values : ndarray, shape (n,), of an array parameter (n, length), read-only float64
        In the unit of the kernel's field. Of words: their numbers; of methods their positions, -1 for "auto".
    spacing : str
        "linear", "log", "values" or "file".
    words : tuple of str, optional
        What the study calls the values of a method axis or of a parameter with choices.
    entry : mapping, optional
        How the study says it where it does not list the values: start, stop, num, unit.
    """

    name: str
    values: NDArray[np.float64]
    spacing: str
    words: tuple[str, ...] | None = None
    entry: Mapping[str, Any] | None = None

    def __len__(self) -> int:
        return len(self.values)

    def label(self, index: int) -> str:
        """Value number `index`, as people write it."""
        return self.words[index] if self.words else short(self.values[index])


@dataclass(frozen=True, eq=False)
class Block:
    """Axes that are swept by one design, and the options of a sampled one: n, seed, scramble.

    In a "product" each axis has a dimension of its own; else they run along one, value by value.
    """

    design: str
    axes: tuple[str, ...]
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Summary:
    """What is kept instead of every cell.

    The axes `over` are reduced; the others stay dimensions, and come first in the study's axes. `outputs` has the
    reductions of every output asked for, `edges` the bounds of the bins of every histogram, ascending.
    """

    over: tuple[str, ...]
    outputs: dict[str, tuple[str, ...]]
    edges: dict[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Study:
    """One sweep, complete and free of mistakes. Made by `sweep.study`.

    Attributes
    ----------
    question : str
        First comment line of the study file.
    kernel_name : str
        As the study names it: of the catalogue, or "module:NAME".
    method, rtol : str, float
        Used where they are not an axis.
    outputs : tuple of str
        In the kernel's order.
    design : str
        "product", "zip", the name of a sampled design, or "blocks".
    axes : dict of str to Axis
        In the study's order, which is the order of the dataset's dimensions.
    fixed : dict of str to float, or to read-only float64 ndarray of an array parameter
        Every parameter of the kernel that neither is nor follows an axis, defaults filled in.
    follows : dict of str to str
        Parameters that are not given and by default equal another one, which is an axis.
    along : dict of str to ndarray
        Every coordinate of the kernel; of length 0 where no output asked for needs it.
    text : str
        The study file, or "" of a study built in Python.
    summary : Summary, optional
        None: every cell is kept.
    blocks : tuple of Block
        The grid is their product; empty of a product or zip of all axes.
    where : str
        Condition on the parameters; cells for which it does not hold are NOT_ASKED. "": all are asked.
    """

    title: str
    question: str
    kernel_name: str
    kernel: Kernel
    method: str
    rtol: float
    outputs: tuple[str, ...]
    design: str
    axes: dict[str, Axis]
    fixed: dict[str, float | NDArray[np.float64]]
    follows: dict[str, str]
    along: dict[str, NDArray[np.float64]]
    text: str = ""
    summary: Summary | None = None
    blocks: tuple[Block, ...] = ()
    where: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Study) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.to_json())

    def __reduce__(self) -> Any:
        return functools.partial(Study.from_json, allow_import=True), (self.to_json(),)

    def __repr__(self) -> str:
        axes = ", ".join(f"{name} ({len(axis)})" for name, axis in self.axes.items())
        return f"<Study {self.title!r}: {self.kernel_name} over {axes}>"

    @property
    def dims(self) -> dict[str, tuple[str, ...]]:
        """Dimensions of the grid, slowest first, and the axes along each; those that a summary reduces come last."""
        blocks = self.blocks or (Block(self.design, tuple(self.axes)),)
        together = "cell" if len(blocks) == 1 else "point"
        found: dict[str, tuple[str, ...]] = {}
        for block in blocks:
            if block.design == "product":
                found |= {name: (name,) for name in block.axes}
            else:
                before = sum(name.startswith(together) for name in found)
                found[f"{together}_{before + 1}" if before else together] = block.axes
        over = () if self.summary is None else self.summary.over
        return dict(sorted(found.items(), key=lambda item: item[1][0] in over))

    @property
    def grid_shape(self) -> dict[str, int]:
        """Length of every dimension of the grid."""
        return {dim: len(self.axes[names[0]]) for dim, names in self.dims.items()}

    def run(self, name: str) -> int:
        """Cells in a row that share one value of an axis."""
        behind = itertools.dropwhile(lambda names: name not in names, self.dims.values())
        return math.prod(len(self.axes[names[0]]) for names in list(behind)[1:])

    @property
    def asked(self) -> tuple[Field, ...]:
        """The output fields asked for."""
        return tuple(o for o in self.kernel.outputs if o.name in self.outputs)

    @property
    def terms(self) -> frozenset[str]:
        """Parameters that are an axis or differ from their default: what a method must be able to do."""
        return frozenset(p.name for p in self.kernel.parameters if p.name in self.axes or differs(p, self.fixed))

    @property
    def lengths(self) -> dict[str, int]:
        """Length of every dimension that a column may have behind the cells'."""
        found: dict[str, int] = {}
        for parameter in (p for p in self.kernel.parameters if p.dims):
            source = self.follows.get(parameter.name, parameter.name)
            values = self.axes[source].values if source in self.axes else np.asarray(self.fixed[source])
            found |= zip(parameter.dims, values.shape[-len(parameter.dims) :], strict=True)
        found |= {name: len(values) for name, values in self.along.items()}
        return found | {dim: found[other] for dim, other in self.kernel.same_length.items()}

    def shape(self, field: Field) -> tuple[int, ...]:
        """Shape of a parameter or output in one cell."""
        return tuple(self.lengths[dim] for dim in field.dims)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes in one cell of the outputs asked for."""
        return {field.name: self.shape(field) for field in self.asked}

    def to_json(self) -> str:
        """The study on one line of JSON: arrays exactly, as their bytes; the kernel as it declares itself."""
        return json.dumps({"format": FORMAT, **vars(self)}, default=_plain, ensure_ascii=False, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str, *, allow_import: bool = False, declared: bool = False) -> Study:
        """The study that `to_json` wrote.

        Parameters
        ----------
        allow_import : bool
            Allow a kernel named "module:NAME", whose module is imported.
        declared : bool
            Do not import the kernel: take what it declared at the time of writing, which suffices to read results.
            Its functions are missing.

        Raises
        ------
        SweepError
            The text is not a study of ours, or its kernel cannot be loaded.
        """
        try:
            keys = json.loads(text, object_hook=_decode)
            if (written := keys.pop("format")) != FORMAT:
                raise SweepError(f"study of format {written}; this version of foliot reads format {FORMAT}")
            keys["axes"] = {name: Axis(**axis) for name, axis in keys["axes"].items()}
            keys["summary"] = keys["summary"] and Summary(**keys["summary"])
            keys["blocks"] = tuple(Block(**block) for block in keys["blocks"])
            kernel = {"check": _missing, **keys["kernel"]}
            kernel |= {group: tuple(Field(**f) for f in kernel[group]) for group in ("parameters", "outputs", "along")}
            kernel["methods"] = tuple(Method(solve=_missing, **method) for method in kernel["methods"])
            study = cls(**keys | {"kernel": Kernel(**kernel)})
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
            what = f"study_json is not the JSON of a study ({type(error).__name__}: {error})"
            raise SweepError(f"{what}; take the result as it was read") from None
        return study if declared else dataclasses.replace(study, kernel=load_kernel(study.kernel_name, allow_import))

    @classmethod
    def of(cls, dataset: xr.Dataset, *, allow_import: bool = False, declared: bool = False) -> Study:
        """The study that a Dataset came from; keywords and SweepError as of `from_json`."""
        if (text := dataset.attrs.get("study_json")) is None:
            raise SweepError("the Dataset does not say which study it came from; take the result as it was read")
        return cls.from_json(study_together(str(text), dataset.coords), allow_import=allow_import, declared=declared)


def study_together(text: str, coords: Mapping[Any, Any]) -> str:
    """The JSON of a study, with the numbers of the coordinates to which it refers in a file.

    Raises
    ------
    SweepError
        A coordinate is shorter than the study has it.
    """
    for name, coordinate in coords.items():
        if (named := ARRAY % f"@{name}") in text:
            length = len(np.atleast_1d(coordinate.values))
            if not any(f'{named},"shape":[{length}{end}' in text for end in "],"):
                raise SweepError(f"{name}: a part of this axis is missing; open the file with sweep.open_result")
            text = text.replace(named, ARRAY % coordinate.values.astype("<f8").tobytes().hex())
    return text


def load_kernel(name: object, allow_import: bool = False, folders: Iterable[Path] = (Path(),)) -> Kernel:
    """The kernel called `name` in the catalogue, or, where allowed, found at "module:NAME".

    Parameters
    ----------
    folders : iterable of Path
        Where to look for the module after Python's own path; default: the current one.

    Raises
    ------
    SweepError
        There is no such kernel, it may not be imported, importing it fails, or it declares a name twice or a unit that
        is none.
    """
    known = list(catalogue.KERNELS)
    there = f'there are {listed(known)}, and those of your own as "module:KERNEL"'
    if not isinstance(name, str) or not name:
        raise SweepError(f"expected the name of a kernel, found {show(name)}; {there}")
    if ":" not in name and name not in known:
        raise SweepError(f"no kernel {show(name)}{did_you_mean(name, known) or ';'} {there}")
    if ":" in name and not flag("allow_import", allow_import):
        cure = "allow it with --allow-import (Python: allow_import=True)"
        raise SweepError(f"{show(name)} runs code of your own; {cure}")
    try:
        if ":" in name:
            # for good: a kernel may import modules beside it later
            sys.path.extend(folder for f in folders if (folder := str(f.resolve())) not in sys.path)
        kernel = load(name) if ":" in name else catalogue.get(name)
    except (Exception, SystemExit) as error:
        raise SweepError(f"{show(name)} cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(kernel, Kernel):
        raise SweepError(f"{show(name)} is {kind(kernel)}, not a kernels.interface.Kernel")
    # no result could hold it otherwise
    fields = (*kernel.parameters, *kernel.outputs, *kernel.along)
    names = [*RESERVED, *(field.name for field in fields)]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise SweepError(f"kernel {name} declares {listed(twice)} more than once, or takes a name of the result's own")
    dims = {*kernel.same_length, *(f.name for f in kernel.along), *(d for p in kernel.parameters for d in p.dims)}
    if lost := sorted({dim for field in kernel.outputs for dim in field.dims} - dims):
        cure = "neither in `along` nor a dim of array parameters"
        raise SweepError(f"kernel {name} has outputs along {listed(lost)}, {cure}")
    for each in fields if ":" in name else ():
        try:
            exponents(each.unit)
        except UnitMistake as fault:
            raise SweepError(f"kernel {name}: unit of {each.name}: {fault}") from None
    return kernel


def setting(name: str, kernel: Kernel) -> Field:
    """Method or rtol as a field: what may be an axis although it is no parameter."""
    if name == "rtol":
        return Field("rtol", "1", "relative error asked for", lower=SMALLEST_RTOL, upper=math.nextafter(1.0, 0.0))
    choices = {"auto": AUTO} | {m.name: i for i, m in enumerate(kernel.methods)}
    return Field("method", "1", "method asked for", choices=choices)


def short(value: Any) -> str:
    """A value as people write it: `0.9`, or of an array `(25.7, 0.22, ...)`."""
    if np.ndim(value) == 0:
        return f"{value:.6g}"
    return f"({', '.join(f'{v:.6g}' for v in value[:3])}{', ...' * (len(value) > 3)})"


def differs(field: Field, fixed: Mapping[str, float | NDArray[np.float64]]) -> bool:
    """Whether a parameter is fixed to something else than its default."""
    if field.default is None or field.name not in fixed:
        return False
    default = fixed.get(field.default) if isinstance(field.default, str) else field.default
    return not np.array_equal(fixed[field.name], np.broadcast_to(np.asarray(default), np.shape(fixed[field.name])))


def frozen(values: Any) -> NDArray[np.float64]:
    """A read-only float64 copy; NaN has one bit pattern only."""
    array = np.array(values, dtype=np.float64)
    array[np.isnan(array)] = math.nan
    array.flags.writeable = False
    return array


def _plain(value: Any) -> Any:
    """What JSON has no word for: arrays, and the records of a study; of a kernel what it declares beyond defaults."""
    if isinstance(value, np.ndarray):
        return {"float64": value.astype("<f8").tobytes().hex(), "shape": value.shape}
    if isinstance(value, Field):
        return {f.name: said for f in dataclasses.fields(value) if (said := getattr(value, f.name)) != f.default}
    names = DECLARED.get(type(value))
    return (
        dict(value) if isinstance(value, Mapping) else {n: getattr(value, n) for n in names} if names else vars(value)
    )


def _decode(item: dict[str, Any]) -> Any:
    """An array, or a record, in which lists were tuples."""
    if item.keys() == {"float64", "shape"}:
        return frozen(np.frombuffer(bytes.fromhex(item["float64"]), "<f8").reshape(item["shape"]))
    return {key: tuple(value) if isinstance(value, list) else value for key, value in item.items()}


def _missing(*columns: Any) -> None:
    raise SweepError("this study was read without its kernel, so it cannot be run")
