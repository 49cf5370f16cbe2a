"""A checked study, and its exact JSON form."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Field, Kernel, Method
from sweep.errors import SweepError

FORMAT = 1
LONGEST_LIST = 1000
"""Longer arrays are written as base64 of little-endian float64."""

AUTO = -1
"""Number of the word "auto" on a method axis."""
SHOWN: dict[str, Callable[[Any], str]] = {}
"""How a notebook shows a study, as "html"; put here by a room above this one, which knows what a run takes."""
SETTINGS = ("method", "rtol")
"""What may be an axis although it is no parameter of the kernel."""


@dataclass(frozen=True, eq=False)
class Axis:
    """Values of one swept quantity.

    Attributes
    ----------
    name : str
        A parameter of the kernel, "method" or "rtol".
    values : ndarray, shape (n,), of an array parameter (n, length), read-only float64
        In the unit of the kernel's field. On a method axis: positions in `kernel.methods`, -1 for "auto".
        Of a parameter with choices: their numbers.
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
    """Axes that are swept by one design.

    Attributes
    ----------
    design : str
        "product": each axis has a dimension of its own; else they run along one, value by value.
    axes : tuple of str
    options : mapping
        Of a sampled design: n, seed, scramble.
    """

    design: str
    axes: tuple[str, ...]
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Summary:
    """What is kept instead of every cell.

    Attributes
    ----------
    over : tuple of str
        Axes that are reduced; the others stay dimensions, and come first in the study's axes.
    outputs : dict of str to tuple of str
        Reductions of every output asked for.
    edges : dict of str to ndarray
        Bounds of the bins of every histogram, ascending.
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
        dims = list(self.dims)
        place = next(place for place, names in enumerate(self.dims.values()) if name in names)
        return math.prod(self.grid_shape[dim] for dim in dims[place + 1 :])

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
        arrays = {p.dims: self.array(p.name) for p in self.kernel.parameters if p.dims}
        found = {
            dim: n for dims, values in arrays.items() for dim, n in zip(dims, values.shape[-len(dims) :], strict=True)
        }
        found |= {name: len(values) for name, values in self.along.items()}
        return found | {dim: found[other] for dim, other in self.kernel.same_length.items()}

    def shape(self, field: Field) -> tuple[int, ...]:
        """Shape of a parameter or output in one cell."""
        lengths = self.lengths if field.dims else {}
        return tuple(lengths[dim] for dim in field.dims)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes in one cell of the outputs asked for."""
        return {field.name: self.shape(field) for field in self.asked}

    def array(self, name: str) -> NDArray[np.float64]:
        """What is given of an array parameter: its values, or those of all cells."""
        source = self.follows.get(name, name)
        return self.axes[source].values if source in self.axes else np.asarray(self.fixed[name])

    def _repr_html_(self) -> str | None:
        """What a notebook shows."""
        return SHOWN["html"](self) if SHOWN else None

    def to_json(self) -> str:
        """The study on one line of JSON: floats exactly, also NaN and infinities; the kernel as it declares itself."""
        keys = {name: getattr(self, name) for name in PLAIN}
        keys |= {"format": FORMAT, "axes": [_axis(axis) for axis in self.axes.values()]}
        keys |= {"kernel": _declaration(self.kernel)}
        keys |= {} if self.summary is None else {"summary": vars(self.summary)}
        keys |= {"blocks": [vars(block) for block in self.blocks]} if self.blocks else {}
        keys |= {"where": self.where} if self.where else {}
        return json.dumps(_plain(keys), allow_nan=False, ensure_ascii=False, separators=(",", ":"))

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
            if keys["format"] != FORMAT:
                raise SweepError(f"study of format {keys['format']}; this version of foliot reads format {FORMAT}")
            axes = {
                a["name"]: Axis(a["name"], frozen(a["values"]), a["spacing"], _words(a["words"]), a.get("entry"))
                for a in keys["axes"]
            }
            along = {name: frozen(values) for name, values in keys["along"].items()}
            known = {name: keys[name] for name in PLAIN} | {"axes": axes, "along": along}
            known["outputs"] = tuple(known["outputs"])
            known["fixed"] = {n: frozen(value) if np.ndim(value) else value for n, value in keys["fixed"].items()}
            known["summary"] = None
            if "summary" in keys:
                given = keys["summary"]
                outputs = {name: tuple(reductions) for name, reductions in given["outputs"].items()}
                edges = {name: frozen(values) for name, values in given["edges"].items()}
                known["summary"] = Summary(tuple(given["over"]), outputs, edges)
            known["blocks"] = tuple(Block(b["design"], tuple(b["axes"]), b["options"]) for b in keys.get("blocks", ()))
            known["where"] = keys.get("where", "")
            _check_words(known)
            kernel = _kernel_as_declared(keys["kernel"])
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
            raise SweepError(f"not the JSON of a study: {type(error).__name__} {error}") from None
        if not declared:
            from sweep.study.kernel_lookup import load_kernel

            kernel = load_kernel(known["kernel_name"], allow_import)
        return cls(kernel=kernel, **known)


PLAIN = (
    "title", "question", "kernel_name", "method", "rtol", "outputs", "design", "fixed", "follows", "along", "text",
)  # fmt: skip
"""Attributes that are written as they are."""


def _check_words(known: Mapping[str, Any]) -> None:
    """Raises TypeError, ValueError where something else stands for a word, or for rtol."""
    words = [known[name] for name in PLAIN if name not in ("rtol", "outputs", "fixed", "follows", "along")]
    if not all(isinstance(word, str) for word in (*words, *known["outputs"], *known["follows"].values())):
        raise TypeError("words are expected")
    float(known["rtol"])


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


def _axis(axis: Axis) -> dict[str, Any]:
    found = {"name": axis.name, "values": axis.values, "spacing": axis.spacing, "words": axis.words}
    return found if axis.entry is None else found | {"entry": axis.entry}


def _words(words: list[str] | None) -> tuple[str, ...] | None:
    return None if words is None else tuple(words)


def _plain(value: Any) -> Any:
    """`value` as what JSON has; `_decode` undoes it."""
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": repr(float(value))}
    if isinstance(value, np.ndarray):
        if value.size > LONGEST_LIST:
            text = base64.b64encode(value.astype("<f8").tobytes()).decode("ascii")
            return {"float64": text} | ({"shape": list(value.shape)} if value.ndim > 1 else {})
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _decode(item: dict[str, Any]) -> Any:
    if item.keys() == {"float"} and isinstance(item["float"], str):
        return float(item["float"])
    if "float64" in item and item.keys() <= {"float64", "shape"} and isinstance(item["float64"], str):
        return np.frombuffer(base64.b64decode(item["float64"]), dtype="<f8").reshape(item.get("shape", -1))
    return item


def _declaration(kernel: Kernel) -> dict[str, Any]:
    """All of a kernel but its functions."""
    fields = {group: [asdict(f) for f in getattr(kernel, group)] for group in ("parameters", "outputs", "along")}
    methods = [{key: getattr(m, key) for key in ("name", "doc", "excludes", "lacks")} for m in kernel.methods]
    plain = {key: getattr(kernel, key) for key in ("name", "doc", "source", "same_length")}
    return {**plain, **fields, "methods": methods}


def _kernel_as_declared(keys: dict[str, Any]) -> Kernel:
    parameters, outputs, along = (
        tuple(Field(**{**f, "dims": tuple(f["dims"])}) for f in keys[group])
        for group in ("parameters", "outputs", "along")
    )
    methods = tuple(
        Method(m["name"], m["doc"], _missing, excludes=tuple(m["excludes"]), lacks=tuple(m.get("lacks", ())))
        for m in keys["methods"]
    )
    plain = {key: keys[key] for key in ("name", "doc", "source")}
    return Kernel(
        **plain,
        parameters=parameters,
        outputs=outputs,
        check=_missing,
        methods=methods,
        along=along,
        same_length=keys.get("same_length", {}),
    )


def _missing(*columns: Any) -> None:
    raise SweepError("this study was read without its kernel, so it cannot be run")
