"""Makes the functions that the engine calls from the physics of one cell; all loops over columns are made here.

An author writes functions of one cell, with the same source for numbers and for lanes, and declares them by `kernel`:

    check(p) -> status                            p: a record of the parameters, within the limits of their fields
    solve(p, rtol, *buffers) -> outputs, status   outputs: a record of those that the method gives, or a tuple in order
    solve(...) -> outputs, errors, status         of a method that estimates; `errors` as of a bound. Additional results
                                                  may precede the status, for functions of its own room
    bound(p) -> error                             a number, or a record with one for each output that the method gives
    fill(i, columns, *buffers)                    for traces, instead of `solve`: writes the rows of cell i itself

This adds loops, entries with one column per parameter, copies that fill incomplete lanes, the largest bound over the
requested outputs, removal of units, and NaN for outputs that a method lacks. Names that do not match the fields are
refused: those of parameters when a kernel is declared, those of outputs when a method is first compiled.
Records are read and written by name (`records`), so the order of columns is known nowhere else.
"""

import inspect
import math
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np

from kernels.interface import BoundCell, CheckCell, Field, FillCells, Kernel, Method, OnColumns, SolveCell
from kernels.lanes import columns as loops
from kernels.lanes.cache import is_ours
from kernels.lanes.codes import BAD_INPUT, OK
from kernels.lanes.jit import jit
from kernels.lanes.records import largest, named, read, write
from kernels.lanes.vectors import nearest, where

Loop = Callable[..., None]
Record = Callable[..., Any]
"""A NamedTuple class."""


@jit
def nothing() -> tuple[()]:
    """No buffers."""
    return ()


@jit
def _as_it_is(p: Any) -> Any:
    return p, 0.0


@jit
def _with_none(units: Any, outputs: Any, status: Any) -> Any:
    return outputs, status


@dataclass(frozen=True)
class method(Method):
    """A `Method` as its author writes it, of one cell; `kernel` makes functions of columns of it.

    Parameters
    ----------
    solve : `solve(p, rtol, *buffers())`; `fill(i, columns, *buffers())` where `fills`
    bound : what `solve` is right to: a number, or one for each output, or `bound(p)`; None where its status says so
    sooner : `sooner(p, rtol)` of columns, uncompiled
    name, doc, excludes, lacks, estimates : as in `kernels.interface.Method`
    buffers : makes a tuple of arrays that a thread's cells use one after the other: `buffers()`, or `buffers(columns)`
    loop : `in_lanes`; `in_few_lanes`, of what takes many steps; `cell_by_cell`, where every search goes its own way
    units : (take, put_back) of a method whose scene has no units. `scene, units = take(p)` is what `solve` and `bound`
        get in place of p, and `put_back(units, outputs, status)` makes outputs and status of what is solved.
    fills : whether it writes the rows of its cells itself
    parts : of a record of the parameters' columns, the addresses that `fill` finds as `columns.parts` (`addresses`)
    """

    solve: SolveCell | FillCells  # type: ignore[assignment]
    bound: BoundCell | float | tuple[float, ...] | None = None  # type: ignore[assignment]
    _: KW_ONLY
    buffers: Callable[..., tuple[Any, ...]] = nothing
    loop: Loop = loops.in_lanes
    units: tuple[Callable[..., Any], Callable[..., Any]] = (_as_it_is, _with_none)
    fills: bool = False
    parts: Callable[[Any], Any] | None = None


tracing = partial(method, fills=True, loop=loops.in_groups)
"""A method by `fill(i, columns, *buffers())`: `i` is the first cell of a group, or by `cell_by_cell` a cell."""


def kernel(
    name: str,
    *,
    doc: str,
    source: str,
    parameters: Sequence[Field],
    outputs: Sequence[Field],
    methods: Sequence[Method],
    check: CheckCell | None = None,
    along: Sequence[Field] = (),
    example: Mapping[str, float | Sequence[float]] | None = None,
    same_length: Mapping[str, str] | None = None,
    record: Record | None = None,
    loop: Loop = loops.in_lanes,
) -> Kernel:
    """The declaration that the engine reads.

    Parameters
    ----------
    record : NamedTuple class whose fields are the parameters, in their order; None: one is made of their names
    check : `check(p)`, OK or a refusal of a cell whose parameters are within the limits of their fields; what is NaN,
        infinite or beyond them is BAD_INPUT without it
    methods : of `method` or `tracing`, or whole ones that loop over the columns themselves; the cheapest first
    loop : how `check` and bounds are looped, `in_lanes`; `cell_by_cell` where parameters are arrays
    The others as in `kernels.interface.Kernel`.

    Raises
    ------
    TypeError
        Where the record's fields are not the parameters, or a method lacks what is no output.
    """
    names = [field.name for field in parameters]
    record = record or namedtuple("Parameters", names)
    if (found := list(getattr(record, "_fields", ()))) != names:
        raise TypeError(f"{name}: the record has {found}, the parameters are {names}")
    wiring = _Wiring(name, record, names, [f.name for f in along], [f.name for f in outputs], loop)
    owner = check or methods[0].solve
    return Kernel(
        name=name,
        doc=doc,
        source=source,
        parameters=tuple(parameters),
        outputs=tuple(outputs),
        check=wiring.check(check or _no_more, within(parameters), owner),
        methods=tuple(wiring.solved_by(solver) for solver in methods),
        along=tuple(along),
        example=dict(example or {}),
        same_length=dict(same_length or {}),
    )


@jit
def _no_more(p: Any) -> float:
    """The check of a kernel that has nothing to refuse within the limits of its parameters."""
    return OK


def within(fields: Sequence[Field], compiled: bool = True) -> Callable[[Any], Any]:
    """A function of a record of parameters, or of lanes of them: whether each is a number within its field's limits.

    NaN and infinite numbers never are; a default always is, at a limit that is open, too. One that is not compiled
    takes a record of columns, none of which has several numbers a cell.
    """
    names, tests = {"nearest": nearest if compiled else np.rint, "inf": math.inf}, []
    for field in fields:
        above = ">" if field.open_lower or field.lower == -math.inf else ">="
        below = "<" if field.upper == math.inf else "<="
        test = f"({{x}} {above} {field.lower!r}) & ({{x}} {below} {field.upper!r})"
        if field.open_lower and field.default is not None:
            default = f"p.{field.default}" if isinstance(field.default, str) else repr(float(field.default))
            test = f"({test} | ({{x}} >= {default}) & ({{x}} <= {default}))"
        if field.integer or field.choices:
            test += " & ({x} >= nearest({x})) & ({x} <= nearest({x}))"
        if field.dims:
            names[f"all_{field.name}"] = _every(jit(eval(f"lambda x: {test.format(x='x')}", names)))
            test = f"all_{field.name}({{x}})"
        tests.append(test.format(x=f"p.{field.name}"))
    made: Callable[[Any], Any] = eval(f"lambda p: {' & '.join(tests)}", names)
    return jit(made) if compiled else made


def _every(test: Any) -> Any:
    """Whether a test of a number holds for each of a row."""

    @jit
    def all_of(row: Any) -> Any:
        good = True
        for x in row:
            good = good & test(x)
        return good

    return all_of


@dataclass(frozen=True)
class _Wiring:
    """Makes a kernel's entries; each is a function of its own name, for its machine code is kept by it."""

    name: str
    record: Record
    parameters: list[str]
    along: list[str]
    outputs: list[str]
    loop: Loop

    def check(self, special: CheckCell, allowed: Callable[[Any], Any], owner: Any) -> OnColumns:
        """Machine code of a check is kept where that of its owner is."""
        record = self.record

        @jit
        def body(i: Any, columns: Any) -> None:
            p = read(record, columns, i)
            columns.status[i] = where(allowed(p), special(p), BAD_INPUT)

        return self._entry("check", owner, body, [*self.parameters, "status"], self.loop)

    def solved_by(self, solver: Method) -> Method:
        """The method of columns."""
        if not isinstance(solver, method):
            return solver
        strange = set(solver.lacks) - set(self.outputs) | set(solver.excludes) - set(self.parameters)
        if strange:
            raise TypeError(f"{self.name}.{solver.name} lacks or excludes what there is not: {sorted(strange)}")
        body = solver.solve if solver.fills else self._body(solver)
        asked, error = (["asked"], ["error"]) if solver.estimates else ([], [])
        names = [*self.parameters, "rtol", *self.along, *asked, *self.outputs, *error, "status"]
        sooner, parts, hidden = solver.sooner, solver.parts, ["parts"] if solver.parts else []
        solve = self._entry(solver.name, solver.solve, body, names + hidden, solver.loop, solver.buffers)
        if parts is not None:
            entry, own = solve, len(self.parameters)
            solve = signed(lambda *columns: entry(*columns, parts(self.record(*columns[:own]))), names)
        of_record = sooner and (lambda *columns: sooner(self.record(*columns[:-1]), columns[-1]))
        of_columns = {"solve": solve, "bound": self._bound(solver), "sooner": of_record}
        return Method(**{field.name: getattr(solver, field.name) for field in fields(Method)} | of_columns)

    def _given(self, solver: method, gives: bool = True) -> Record:
        """A record of the outputs that the method gives, or of those that it does not."""
        return namedtuple("Given", [name for name in self.outputs if (name in solver.lacks) != gives])

    def _body(self, solver: method) -> FillCells:
        """The work of a method on cell i, or on the cells that i means."""
        record, given, order = self.record, self._given(solver), namedtuple("Order", self.outputs)
        none = self._given(solver, False)(*(math.nan for _ in solver.lacks))
        inner: Any = solver.solve
        (take, put_back), estimates = solver.units, solver.estimates

        @jit
        def body(i: Any, columns: Any, *buffers: Any) -> None:
            scene, units = take(read(record, columns, i))
            found = inner(scene, columns.rtol[i], *buffers)  # outputs, errors if it estimates, ..., status
            outputs, status = put_back(units, found[0], found[-1])
            write(columns, i, named(given, outputs))
            write(columns, i, none)
            if estimates:
                columns.error[i] = largest(found[1], columns.asked, order, given)
            columns.status[i] = status

        return body

    def _bound(self, solver: method) -> OnColumns | None:
        if solver.bound is None:
            return None
        names, bound = [*self.parameters, "rtol", *self.along, "asked", "out"], solver.bound
        if isinstance(bound, float | tuple):
            return signed(lambda *columns: columns[-1].fill(np.max(columns[-2] * np.array(bound))), names)
        record, order, given = self.record, namedtuple("Order", self.outputs), self._given(solver)
        take, _ = solver.units

        @jit
        def body(i: Any, columns: Any) -> None:
            scene, _ = take(read(record, columns, i))
            columns.out[i] = largest(bound(scene), columns.asked, order, given)

        return self._entry(f"{solver.name}_bound", bound, body, names, self.loop)

    def _entry(
        self, name: str, function: Any, body: Any, names: list[str], loop: Loop, buffers: Any = nothing
    ) -> OnColumns:
        """A function of columns that loops a body over their cells, called and kept by a name of its own."""
        of_columns = buffers
        if not inspect.signature(buffers).parameters:

            @jit
            def of_columns(columns: Any) -> Any:
                return buffers()

        scope = {"named": named, "COLUMNS": namedtuple("Columns", names), "BODY": body, "LOOP": loop}
        made = FunctionType(_all_cells.__code__, scope | {"BUFFERS": of_columns}, name)
        made.__qualname__, made.__module__ = f"{self.name}.{name}", function.__module__
        per_cell = None if loop is loops.cell_by_cell else [n not in self.along and n != "asked" for n in names]
        return signed(loops.entry_of(made, per_cell, is_ours(function), len(self.parameters)), names)


def signed(function: Any, names: Sequence[str]) -> OnColumns:
    """The function with the names of its columns, as the contract of a kernel has them."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    function.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])
    made: OnColumns = function
    return made


def _all_cells(*columns: Any) -> None:
    record = named(COLUMNS, columns)  # type: ignore[name-defined]  # noqa: F821  names of `_Wiring._entry`
    LOOP(BODY, record, BUFFERS(record))  # type: ignore[name-defined]  # noqa: F821
