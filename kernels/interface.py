"""The contract between physics and engine.

A *cell* is one set of parameters. Cells are independent. A kernel's functions take one float64 column per parameter
(C-contiguous, one value per cell) and fill one column per output, shape `(n_cells,)` or `(n_cells, *dims)`, and an int8
`status` column. They hold no lock (nogil), raise nothing and always end; a `Status` says what went wrong.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, Protocol


class Status(IntEnum):
    """Outcome of a cell: OK, a remark (1..63, with values), or no answer (64..124, every output is NaN).

    The engine sets the last three; FAILED means that the kernel violated its contract. `kind` groups the statuses.
    Numbers are stored in files and never reused.
    """

    OK = 0, "accurate to rtol"
    INACCURATE = 1, "the method's error bound exceeds rtol; values are given"
    NOT_SELF_STARTING = 2, "a limit cycle exists, but the motion from rest at the centre does not reach it"
    COMES_TO_REST = 3, "the motion ends within the time followed; outputs after its end are NaN"
    GRAZING = 4, "the last digits of the input decide whether there is one more swing"
    OVERDAMPED = 5, "damping above critical: the motion creeps, without a turning point or an end"
    TOO_SHORT = 6, "the run is too short for some outputs, which are NaN"
    NEVER_ENDS = 7, "the motion fades without an end; outputs at its end are NaN"
    UNSTABLE = 8, "the cycle exists, but small disturbances of it grow"
    PERIOD_2 = 9, "the motion repeats only after two cycles; the values are of both together"
    NOT_PERIODIC = 10, "the motion never settles; the values are means over the time followed"
    TOOTH_JUMPED = 11, "the wheel advances by more than one tooth per cycle"
    LOCK_UP = 12, "the linkage locks before the crank has turned fully"
    CHANGE_POINT = 13, "the linkage can fold flat, where its arm may change branch"
    DOUBLE_CRANK = 14, "the arm turns fully with the crank and has no extreme angles"
    DAMPERS_OUT_OF_RANGE = 15, "merged dampers hold only up to valid_to, which is below f_max"
    PARTLY_OUT_OF_RANGE = (
        16,
        "some outputs, or entries of them, are outside the range of float64 and NaN; others are accurate",
    )
    BAD_INPUT = 64, "a parameter is NaN, infinite or outside its limits, or two contradict each other"
    NEVER_STARTS = 65, "the drive does not overcome friction"
    NO_LIMIT_CYCLE = 66, "nothing dissipates energy, so no limit cycle exists"
    OUT_OF_RANGE = 67, "a result, or a quantity that it depends on, is outside the range of float64"
    NOT_CONVERGED = 68, "the iteration limit was reached before the stated convergence"
    STEP_LIMIT = 69, "the integrator reached its limit of steps"
    NO_METHOD = 70, "no method of the kernel can reach this rtol here"
    STICKS = 71, "the motion comes to rest before the next switch"
    NO_CYCLE = 72, "a cycle of this kind does not exist here"
    NEVER_MEETS = 73, "the pallets never meet a tooth"
    NO_ASSEMBLY = 74, "the links are too short or too long to be joined"
    UNMESHES = 75, "the recoil throws the crown wheel out of mesh, and the clock stops"
    NOT_ASKED = 125, "the study's condition excludes the cell"
    FAILED = 126, "the kernel raised an exception, crashed, took too long, or gave no number or status"
    PENDING = 127, "not computed yet"

    doc: str

    def __new__(cls, value: int, doc: str) -> Status:
        member = int.__new__(cls, value)
        member._value_ = value
        member.doc = doc
        return member

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        if self in (Status.OK, Status.NOT_ASKED, Status.PENDING):
            return self.name.lower().replace("_", " ")
        if self == Status.FAILED:
            return self.name
        return "unsolved" if self in UNSOLVED else "refused" if self >= FIRST_REFUSAL else "remarked"


FIRST_REFUSAL = 64
"""Every status from here on means NaN in every output."""
UNSOLVED = (Status.NOT_CONVERGED, Status.STEP_LIMIT, Status.NO_METHOD)
"""The method found no answer, but another method, a looser rtol or more steps may.

The other statuses from `FIRST_REFUSAL` on are results: there is no such answer, or none in float64, by any method.
"""
KINDS = {
    "ok": "accurate to rtol",
    "remarked": "values are given, and the status says what is special about them",
    "refused": "the model has no such answer, or none that float64 can represent; every output is NaN",
    "unsolved": "no method found an answer, though there may be one; every output is NaN",
    "FAILED": "the kernel raised an exception, crashed, took too long, or gave no number or status; outputs are NaN",
    "pending": "not computed yet",
    "not asked": "excluded by the study's condition",
}
"""Groups of statuses, in the order in which they are counted."""


OnColumns = Callable[..., None]
"""A function on columns, in the order that `Kernel` and `Method` specify; it fills the last ones."""
CheckCell = Callable[[Any], Any]
"""`check(p) -> status`: OK or a refusal of a cell, before any method is called; p is a record of the parameters."""
BoundCell = Callable[[Any], Any]
"""`bound(p) -> error`: relative, a number for all outputs, or a record with one for each."""


class SolveCell(Protocol):
    """`solve(p, rtol, *buffers) -> outputs, status`; of a method that estimates, `-> outputs, errors, status`."""

    def __call__(self, p: Any, rtol: Any, /, *buffers: Any, **named: Any) -> tuple[Any, Any] | tuple[Any, Any, Any]: ...


class FillCells(Protocol):
    """`fill(i, columns, *buffers)`: writes the rows of cell i, or of the group that begins with it, itself."""

    def __call__(self, i: Any, columns: Any, /, *buffers: Any, **named: Any) -> None: ...


@dataclass(frozen=True)
class Field:
    """A parameter, an output, or a coordinate that all cells share.

    `default`: None makes a parameter required; a str means "equal to that parameter"; for a coordinate it is the number
    of integers, beginning at `lower`, that are used if a study gives no values. `lower` and `upper` are inclusive,
    unless `open_lower`; the kernel's `check` enforces them cell by cell (for `along` the study is checked).
    `dims` names the axes of an array: coordinates of `Kernel.along` ("phase",), or an axis that array parameters share
    ("mass",), whose length follows from their values in a study; a column then has the shape `(n_cells, *dims)`.
    `choices` maps words of a study to the numbers in the column.
    `gaps`: an output that may be NaN or infinite in an OK cell, because it need not exist there.
    `of_method`: an output about the solution process, such as an error or a number of steps, which depends on the
    method.
    `sized`: an output whose accuracy is relative to the largest size it had so far, not to itself.
    """

    name: str
    unit: str
    doc: str
    default: float | str | None = None
    lower: float = -math.inf
    upper: float = math.inf
    open_lower: bool = False
    dims: tuple[str, ...] = ()
    choices: Mapping[str, int] = field(default_factory=dict)
    integer: bool = False
    gaps: bool = False
    of_method: bool = False
    sized: bool = False


@dataclass(frozen=True)
class Method:
    """One way to solve a cell.

    `solve(*parameters, rtol, *along, *outputs, status)` fills every output column of the kernel and the status of
    every cell; OK cells are finite except for `gaps`. Cells that `check` refused are not passed to it.

    `bound(*parameters, rtol, *along, asked, out)` fills `out` with a bound on the largest relative error (of traces:
    relative to the amplitude) over the outputs whose entry in the uint8 array `asked` is 1. None: the method itself
    meets `rtol` or sets a status that says it cannot.

    `estimates`: the method knows its error only after solving. It is called as
    `solve(*parameters, rtol, *along, asked, *outputs, error, status)` and fills `error` as a bound would; where that
    exceeds `rtol` the engine sets INACCURATE instead of any status but GRAZING, and `auto` goes on after both.

    `excludes` are parameters that it does not support: `auto` does not use it in cells where one differs from its
    default; it cannot be chosen by name for a study that sets one to another value or as an axis. `lacks` are outputs
    that it does not compute: it fills them with NaN, and cannot be used in a study that requests one of them.

    `sooner(*parameters, rtol)`, an array of bool, is True in cells where `auto` tries it before the method declared
    ahead of it, because it is faster there at that rtol.
    """

    name: str
    doc: str
    solve: OnColumns
    bound: OnColumns | None = None
    excludes: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()
    estimates: bool = False
    sooner: Callable[..., Any] | None = None


@dataclass(frozen=True)
class Kernel:
    """A model: its parameters, its outputs, and its methods from the fastest to the slowest.

    `check(*parameters, status)` writes OK or a refusal for every cell, before any method is called.
    `along` are coordinates shared by all cells (phase, frequency); a study gives their values.
    `example` has values of the parameters for an example study.
    `same_length` maps further dims of outputs to a dim of array parameters of equal length: {"mode": "mass"}.
    """

    name: str
    doc: str
    source: str
    parameters: tuple[Field, ...]
    outputs: tuple[Field, ...]
    check: OnColumns
    methods: tuple[Method, ...]
    along: tuple[Field, ...] = ()
    example: Mapping[str, float | Sequence[float]] = field(default_factory=dict)
    same_length: Mapping[str, str] = field(default_factory=dict)

    def method(self, name: str) -> Method:
        """The method of that name. Raises KeyError."""
        return {m.name: m for m in self.methods}[name]

    def parameter(self, name: str) -> Field:
        """The parameter of that name. Raises KeyError."""
        return {p.name: p for p in self.parameters}[name]


def load(entry: str) -> Any:
    """The object that "package.module:NAME" names. Raises ImportError, AttributeError."""
    from importlib import import_module

    module, _, name = entry.partition(":")
    return getattr(import_module(module), name)


def machine_code_folder() -> Path | None:
    """Where machine code of kernels is kept; None: nowhere, or none has been loaded."""
    return getattr(sys.modules.get("kernels.lanes.cache"), "FOLDER", None)
