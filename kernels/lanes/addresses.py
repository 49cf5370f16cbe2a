"""Functions that are called by address: compiled once, separately, on first use by a cell, and cached.

An entry with several variants would compile all of them, and a function that several entries call is compiled for each.
Here the functions of a variant (a *way*) form a row of addresses, and a *part* calls the one at its place:

    SOLVE = part(0, 0.0, 1, like)                    # a number, of an integer and a record of the types of `like`
    x = SOLVE(row, n, record)                        # in compiled code: calls the function at row[0]
    ways = table("way", {0: {SOLVE: quickly}, 1: {SOLVE: slowly}})

makes the rows of those ways whose numbers occur in a column of the parameter (`wiring.method` with `parts=ways`). In
plain Python a row holds the functions themselves.
"""

import functools

import numpy as np
from llvmlite import ir
from numba import typeof, types

from kernels.lanes.cache import enable
from kernels.lanes.inlining import aligned
from kernels.lanes.jit import COMPILED, OPTIONS
from kernels.lanes.vectors import in_place


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
        in_place(call, 1 + len(arguments), lambda *kinds: call.gives, functools.partial(_lower, call))
    return call


def _lower(call, context, builder, signature, values):
    row = context.make_array(signature.args[0])(context, builder, values[0])
    convention, address = context.call_conv, builder.load(builder.gep(row.data, [ir.IntType(64)(call.place)]))
    function = builder.inttoptr(address, convention.get_function_type(call.gives, call.kinds).as_pointer())
    given = zip(values[1:], signature.args[1:], call.kinds, strict=True)
    values = [context.cast(builder, value, one, kind) for value, one, kind in given]
    return convention.call_function(builder, function, call.gives, call.kinds, values)[1]


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
