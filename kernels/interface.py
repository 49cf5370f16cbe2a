"""The whole contract between physics and engine.

A *cell* is one scene. Cells are independent. A kernel's functions take one float64 column per parameter (C-contiguous,
one value per cell) and fill one column per output, shape `(n_cells,)` or `(n_cells, *dims)`, and an int8 `status`
column. They hold no lock (nogil), raise nothing and always end; what goes wrong is said by a `Status`.
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
    """What became of a cell: OK, a remark (1..63, values are given) or none of these (64..124, every output is NaN).

    The last three are the engine's words: FAILED is for what no kernel may do. `kind` says it in one of a few words.
    Numbers are stored in files and never reused.
    """

    OK = 0, "accurate to rtol"
    INACCURATE = 1, "the method's error bound exceeds rtol; values are given"
    NOT_SELF_STARTING = 2, "a limit cycle exists, but the motion from rest at the centre does not reach it"
    COMES_TO_REST = 3, "the motion ends within the time followed; outputs after its end are NaN"
    GRAZING = 4, "the last digits of the input decide whether there is one more swing"
    OVERDAMPED = 5, "damping beyond critical: the motion creeps, without a turning point or an end"
    TOO_SHORT = 6, "too short a run for some outputs, which are NaN"
    NEVER_ENDS = 7, "the motion fades without an end; outputs at its end are NaN"
    UNSTABLE = 8, "the cycle exists, but small disturbances of it grow"
    PERIOD_2 = 9, "the motion repeats only after two cycles; the values are of both together"
    NOT_PERIODIC = 10, "the motion never settles; the values are means over the time followed"
    TOOTH_JUMPED = 11, "the wheel goes on by more than one tooth a cycle"
    LOCK_UP = 12, "the linkage locks before the crank has turned fully"
    CHANGE_POINT = 13, "the linkage can be folded flat, where its arm may leave its branch"
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
    NOT_ASKED = 125, "the study's condition leaves the cell out"
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
"""Nothing is known of the scene then: another method, a looser rtol or more steps may find an answer.

The others from `FIRST_REFUSAL` on are findings: by any method the scene has no such answer, or none in float64.
"""
KINDS = {
    "ok": "accurate to rtol",
    "remarked": "values are given, and the status says what is special about them",
    "refused": "the model has no such answer, or none that float64 can represent; every output is NaN",
    "unsolved": "no method found an answer, though there may be one; every output is NaN",
    "FAILED": "the kernel raised an exception, crashed, took too long, or gave no number or status; outputs are NaN",
    "pending": "not computed yet",
    "not asked": "left out by the study's condition",
}
"""Words for what became of a cell, in the order of an account, in which each cell is counted under one of them."""


OnColumns = Callable[..., None]
"""What the engine calls: takes columns in the order that `Kernel` and `Method` say, and fills the last ones."""
CheckCell = Callable[[Any], Any]
"""`check(p) -> status`: OK or a refusal of a cell, before any method is asked; p is a record of the parameters."""
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

    `default`: None makes a parameter required; a str means "as that parameter"; of a coordinate it is how many numbers
    from `lower` on are taken where a study gives none. `lower`, `upper` are inclusive
    unless `open_lower`; the kernel's `check` enforces them cell by cell (those of `along` are checked in the study).
    `dims` names the axes of an array: coordinates of `Kernel.along` ("phase",), or what array parameters share
    ("mass",), whose length a study gives with their values; a column then has the shape `(n_cells, *dims)`.
    `choices` maps words of a study to the numbers in the column.
    `gaps`: an output that may be NaN or infinite in a cell that is OK, as what it names need not exist there.
    `of_method`: an output that tells how a cell was solved, such as an error or a number of steps, so that another
    method gives another value.
    `sized`: an output that is accurate to a share of the largest size it had on the way, not of itself.
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
    every cell; what is OK is finite but for `gaps`. It gets no cell that `check` refused.

    `bound(*parameters, rtol, *along, asked, out)` fills `out` with a bound on the largest relative error (of traces:
    relative to the amplitude) over the outputs whose entry in the uint8 array `asked` is 1. None: the method itself
    holds `rtol` or says by its status that it cannot.

    `estimates`: the method knows only afterwards what its values are right to. It is called as
    `solve(*parameters, rtol, *along, asked, *outputs, error, status)`, fills `error` as a bound would, and leaves it to
    the engine to call INACCURATE what is not GRAZING where that exceeds `rtol`; `auto` goes on after both.

    `excludes` are parameters it cannot do: `auto` gives it no cell where one is away from its default; by name it is
    not to be had for a study that sets one, away from its default or as an axis. `lacks` are outputs it does not give:
    it cannot be had where one of them is asked for, and fills them with NaN.

    `sooner(*parameters, rtol)`, an array of bool, is True in cells that `auto` tries it on ahead of the method declared
    before it: there, at that rtol, it takes less time.
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
    """A scene: what may be swept, what comes out, and the methods from the cheapest to the dearest.

    `check(*parameters, status)` writes OK or a refusal for every cell, before any method is asked.
    `along` are coordinates shared by all cells (phase, frequency); a study gives their values.
    `example` has the values of parameters at which the scene runs well: a study to begin with.
    `same_length` maps further dims of outputs to the array parameters' dim that is as long: {"mode": "mass"}.
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
