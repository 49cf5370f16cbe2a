"""From the physics of one cell to what the engine calls: the one place where columns are listed and looped over.

An author writes functions of one cell, the same source for numbers and for lanes, and declares them by `kernel`:

    check(p) -> status                            p: a record of the parameters
    solve(p, rtol, *buffers) -> outputs, status   outputs: a record of those that the method gives, or a tuple in order
    solve(...) -> outputs, errors, status         of a method that estimates; `errors` as of a bound
    bound(p) -> error                             a number, or a record with one for each output
    fill(i, columns, *buffers)                    for traces, instead of `solve`: writes the rows of cell i itself

Loops, entries with one column a parameter, copies that fill up few cells, the largest bound of what was asked for, and
NaN for outputs that a method lacks are made here.
"""

import inspect
import math
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType

import numpy as np

from kernels.interface import Kernel, Method
from kernels.lanes import columns as loops
from kernels.lanes.cache import is_ours
from kernels.lanes.columns import entry_of
from kernels.lanes.jit import jit
from kernels.lanes.records import largest, named, read, write


@dataclass(frozen=True)
class Solver:
    """A method as its author writes it; `kernel` makes a `Method` of it."""

    name: str
    doc: str
    function: Callable
    bound: Callable | float | None
    excludes: tuple[str, ...]
    lacks: tuple[str, ...]
    buffers: Callable | None
    loop: Callable
    fills: bool
    estimates: bool


def method(
    name, doc, solve, bound=None, *, excludes=(), lacks=(), buffers=None, loop=loops.in_lanes, estimates=False
):  # fmt: skip
    """A method by `solve(p, rtol, *buffers())`.

    Parameters
    ----------
    bound : what `solve` is right to: a number, or `bound(p)`; None where its status says so
    excludes, lacks, estimates : as in `kernels.interface.Method`
    buffers : makes a tuple of arrays that a thread's cells use one after the other: `buffers()`, or `buffers(columns)`
    loop : `in_lanes`; `cell_by_cell`, where every search goes its own way
    """
    return Solver(name, doc, solve, bound, excludes, lacks, buffers, loop, False, estimates)


def tracing(
    name, doc, fill, bound=None, *, excludes=(), lacks=(), buffers=None, loop=loops.in_groups, estimates=False
):  # fmt: skip
    """A method by `fill(i, columns, *buffers())`: `i` is a cell, or by `in_groups` the first of a group."""
    return Solver(name, doc, fill, bound, excludes, lacks, buffers, loop, True, estimates)


@dataclass(frozen=True)
class Split:
    """A method that is several: the value of one parameter says which of them solves a cell."""

    name: str
    doc: str
    parameter: str
    solvers: dict[float, Solver]


def split(name, doc, parameter, solvers):
    """A method by {value of a parameter: `method` or `tracing`}; each is compiled when a cell asks for it first."""
    return Split(name, doc, parameter, solvers)


def kernel(
    name, *, doc, source, parameters, outputs, check, methods, along=(), example=(), same_length=(), record=None,
    loop=loops.in_lanes,
):  # fmt: skip
    """The declaration that the engine reads.

    Parameters
    ----------
    record : NamedTuple class whose fields are the parameters, in their order; None: one is made of their names
    check : `check(p)`, the status of a cell before any method is asked
    methods : of `method` or `tracing`, the cheapest first
    loop : how `check` and bounds are looped, `in_lanes`; `cell_by_cell` where parameters are arrays
    The others as in `kernels.interface.Kernel`.
    """
    names = [field.name for field in parameters], [field.name for field in along], [field.name for field in outputs]
    wiring = _Wiring(name, record, *names, loop)
    return Kernel(
        name=name,
        doc=doc,
        source=source,
        parameters=tuple(parameters),
        outputs=tuple(outputs),
        check=wiring.check(check),
        methods=tuple(wiring.method(solver) for solver in methods),
        along=tuple(along),
        example=dict(example),
        same_length=dict(same_length),
    )


@jit
def nothing():
    """No buffers."""
    return ()


def _of_columns(buffers):
    """`buffers` as a function of the columns."""
    if inspect.signature(buffers).parameters:
        return buffers

    @jit
    def made(columns):
        return buffers()

    return made


class _Wiring:
    """Makes a kernel's entries; each is a function of its own name, for its machine code is kept by it."""

    def __init__(self, name, record, parameters, along, outputs, loop):
        if record is not None and list(record._fields) != parameters:
            raise TypeError(f"{name}: the record has {record._fields}, the parameters are {parameters}")
        self.name, self.record, self.loop = name, record or namedtuple("Parameters", parameters), loop
        self.parameters, self.along, self.outputs = parameters, along, outputs

    def check(self, check):
        record = self.record

        @jit
        def body(i, columns):
            columns.status[i] = check(read(record, columns, i))

        return self._entry("check", check, body, [*self.parameters, "status"], self.loop)

    def method(self, solver):
        if isinstance(solver, Split):
            return Method(solver.name, solver.doc, self._split(solver))
        body = solver.function if solver.fills else self._body(solver)
        asked, error = (["asked"], ["error"]) if solver.estimates else ([], [])
        names = [*self.parameters, "rtol", *self.along, *asked, *self.outputs, *error, "status"]
        solve = self._entry(solver.name, solver.function, body, names, solver.loop, solver.buffers or nothing)
        bound = self._bound(solver)
        return Method(solver.name, solver.doc, solve, bound, solver.excludes, solver.lacks, solver.estimates)

    def _split(self, split):
        solvers = {value: self.method(solver).solve for value, solver in split.solvers.items()}
        chosen, first_output = self.parameters.index(split.parameter), len(self.parameters) + 1

        def solve(*columns):
            for value in np.unique(columns[chosen]):
                rows = columns[chosen] == value
                if rows.all():
                    return solvers[value](*columns)
                part = [column[rows] for column in columns]
                solvers[value](*part)
                for column, result in zip(columns[first_output:], part[first_output:], strict=True):
                    column[rows] = result

        return solve

    def _body(self, solver):
        record, solve = self.record, solver.function
        given = namedtuple("Given", [name for name in self.outputs if name not in solver.lacks])
        none = namedtuple("Lacking", solver.lacks)(*(math.nan for _ in solver.lacks))

        @jit
        def body(i, columns, *buffers):
            outputs, status = solve(read(record, columns, i), columns.rtol[i], *buffers)
            write(columns, i, named(given, outputs))
            write(columns, i, none)
            columns.status[i] = status

        order = namedtuple("Order", self.outputs)

        @jit
        def estimating(i, columns, *buffers):
            outputs, errors, status = solve(read(record, columns, i), columns.rtol[i], *buffers)
            write(columns, i, named(given, outputs))
            write(columns, i, none)
            columns.error[i] = largest(errors, columns.asked, order)
            columns.status[i] = status

        return estimating if solver.estimates else body

    def _bound(self, solver):
        if solver.bound is None:
            return None
        names = [*self.parameters, "rtol", *self.along, "asked", "out"]
        if isinstance(solver.bound, float):
            return lambda *columns: columns[-1].fill(solver.bound)
        record, bound, order = self.record, solver.bound, namedtuple("Order", self.outputs)

        @jit
        def body(i, columns):
            columns.out[i] = largest(bound(read(record, columns, i)), columns.asked, order)

        return self._entry(f"{solver.name}_bound", bound, body, names, self.loop)

    def _entry(self, name, function, body, names, loop, buffers=nothing):
        columns = namedtuple("Columns", names)
        scope = {"named": named, "COLUMNS": columns, "BODY": body, "LOOP": loop, "BUFFERS": _of_columns(buffers)}
        made = FunctionType(_all_cells.__code__, scope, name)
        made.__qualname__, made.__module__ = f"{self.name}.{name}", function.__module__
        per_cell = None if loop is loops.cell_by_cell else [n not in self.along and n != "asked" for n in names]
        return entry_of(made, per_cell, kept=is_ours(function))


def _all_cells(*columns):
    columns = named(COLUMNS, columns)  # noqa: F821  the names of `_Wiring._entry`
    LOOP(BODY, columns, BUFFERS(columns))  # noqa: F821
