"""Functions that are called by their address: compiled once, by themselves, when a cell asks for them first, and kept.

An entry that could go several ways compiles all of them, and what several entries call is compiled for each. Here the
functions of a way stand in a row of addresses, and a *part* calls what stands at its place:

    SOLVE = part(0, 0.0, 1, like)                    # a number, of an integer and a record of the types of `like`
    x = SOLVE(row, n, record)                        # in compiled code: what row[0] is the address of
    ways = table("way", {0: {SOLVE: quickly}, 1: {SOLVE: slowly}})

makes the rows of those ways that a column of the parameter asks for (`wiring.method` with `parts=ways`). In plain
Python a row holds the functions themselves.
"""

import functools
import inspect

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core.typing import signature
from numba.extending import lower_builtin, type_callable

from kernels.lanes.cache import enable
from kernels.lanes.inlining import aligned
from kernels.lanes.jit import COMPILED, OPTIONS


def jit_by_address(function):
    """Compiled by itself, without what Python would need to call it; its calls are parts."""
    if not COMPILED:
        return function
    made = aligned(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=False, **OPTIONS)
    made._insert = lambda *overload: None  # there is nothing that Python could call
    return enable(made)


def part(place, result, *arguments):
    """What calls the function whose address stands at that place of a row; values of its types are examples."""

    def call(row, *values):
        return row[place](*values)

    call.place, call.gives, call.kinds = place, typeof(result), tuple(map(typeof, arguments))
    if COMPILED:
        type_callable(call)(functools.partial(_typer, call))
        lower_builtin(call, *[types.Any] * (1 + len(arguments)))(functools.partial(_lower, call))
    return call


def _typer(call, context):
    def typer(row, *values):
        return signature(call.gives, row, *call.kinds)

    kind = inspect.Parameter.POSITIONAL_ONLY
    typer.pysig = inspect.Signature([inspect.Parameter(f"x{i}", kind) for i in range(1 + len(call.kinds))])
    return typer


def _lower(call, context, builder, signature, values):
    row = context.make_array(signature.args[0])(context, builder, values[0])
    address = builder.load(builder.gep(row.data, [ir.IntType(64)(call.place)]))
    convention = context.call_conv
    function = convention.get_function_type(call.gives, call.kinds).as_pointer()
    _, result = convention.call_function(
        builder, builder.inttoptr(address, function), call.gives, call.kinds, values[1:]
    )
    return result


def _address(call, function):
    """Where the compiled function is."""
    if not COMPILED:
        return function
    function.compile(call.kinds)
    made = function.overloads[call.kinds]
    if types.unliteral(made.signature.return_type) != call.gives:
        raise TypeError(f"{function.__name__} gives {made.signature.return_type}; expected {call.gives}")
    return made.library.get_pointer_to_function(made.fndesc.llvm_func_name)


def table(parameter, ways):
    """A function of the columns: one row for each way, in whole numbers from 0, of what these cells ask for.

    `ways[value]` has the function for each part.
    """
    places = 1 + max(call.place for way in ways.values() for call in way)
    rows = np.zeros((len(ways), places), np.int64 if COMPILED else object)

    @functools.cache
    def fill(value):
        for call, function in ways[value].items():
            rows[value, call.place] = _address(call, function)

    def of(columns):
        for value in np.unique(getattr(columns, parameter)):
            fill(int(value))
        return rows

    return of
