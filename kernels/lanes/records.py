"""Records of columns and of cells: a cell's numbers are read from columns, and written to them, by name.

A *record* is a NamedTuple. Of arrays, it holds columns; of numbers (or lanes), one cell (or WIDTH of them).
"""

import math
import operator
from functools import partial

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import lower_builtin, overload, type_callable

from kernels.lanes.jit import jit
from kernels.lanes.vectors import isnt, where


def named(record, values):
    """A plain tuple as a record of that class; what is a record already stays one."""
    return values if hasattr(values, "_fields") else record(*values)


def read(record, columns, i):
    """Cell i of the columns that have the names of the record's fields; an array's row."""
    return record(*(getattr(columns, name)[i] for name in record._fields))


def write(columns, i, values):
    """Puts each value into cell i of the column of its name; a record within the record likewise."""
    for name, value in _flat(values):
        getattr(columns, name)[i] = value


def _flat(values):
    for name, value in zip(values._fields, values, strict=True):
        if hasattr(value, "_fields"):
            yield from _flat(value)
        else:
            yield name, value


named.borrows = read.borrows = True  # their arrays are their caller's: `kernels.lanes.inlining`


@type_callable(named)
def _type_named(context):
    def typer(record, values):
        if isinstance(values, types.BaseNamedTuple):
            return values
        return types.BaseTuple.from_types(tuple(values), record.instance_class)

    return typer


@lower_builtin(named, types.Any, types.Any)
def _lower_named(context, builder, signature, values):
    record = context.make_tuple(builder, signature.return_type, cgutils.unpack_tuple(builder, values[1]))
    return impl_ret_borrowed(context, builder, signature.return_type, record)


def _column(columns, name):
    return columns.types[columns.fields.index(name)]


def _item(context, columns, name, i):
    return context.resolve_function_type(operator.getitem, (_column(columns, name), i), {})


@type_callable(read)
def _type_read(context):
    def typer(record, columns, i):
        item = partial(_item, context, columns)
        found = [item(name, i).return_type for name in record.instance_class._fields]
        return types.BaseTuple.from_types(tuple(found), record.instance_class)

    return typer


@lower_builtin(read, types.Any, types.Any, types.Any)
def _lower_read(context, builder, signature, values):
    _, columns, i = signature.args
    typing, arrays = context.typing_context, cgutils.unpack_tuple(builder, values[1])
    found = []
    for name in signature.return_type.fields:
        of_item = _item(typing, columns, name, i)
        get = context.get_function(typing.resolve_value_type(operator.getitem), of_item)
        array = arrays[columns.fields.index(name)]
        found.append(get(builder, (array, context.cast(builder, values[2], i, of_item.args[1]))))
    return context.make_tuple(builder, signature.return_type, found)


@type_callable(write)
def _type_write(context):
    return lambda columns, i, values: types.void


@lower_builtin(write, types.Any, types.Any, types.Any)
def _lower_write(context, builder, signature, values):
    columns, i, record = signature.args
    typing, arrays = context.typing_context, cgutils.unpack_tuple(builder, values[0])
    for name, kind, value in _flat_values(builder, record, values[2]):
        of_set = typing.resolve_function_type(operator.setitem, (_column(columns, name), i, kind), {})
        put = context.get_function(typing.resolve_value_type(operator.setitem), of_set)
        array = arrays[columns.fields.index(name)]
        index = context.cast(builder, values[1], i, of_set.args[1])
        put(builder, (array, index, context.cast(builder, value, kind, of_set.args[2])))
    return context.get_dummy_value()


def _flat_values(builder, record, value):
    for name, kind, item in zip(record.fields, record, cgutils.unpack_tuple(builder, value), strict=True):
        if isinstance(kind, types.BaseNamedTuple):
            yield from _flat_values(builder, kind, item)
        else:
            yield name, kind, item


@jit
def _worse(worst, wanted, error):
    """The larger of two errors where the second is wanted; inf for NaN."""
    return where(wanted & isnt(error <= worst), where(error > worst, error, math.inf), worst)


def largest(errors, asked, order):
    """The largest of the errors that were asked for; a number stands for all.

    Parameters
    ----------
    errors : a number, or a record (of records) with one for each output
    asked : ndarray, 1 for each output that counts
    order : NamedTuple class whose fields are the outputs in their order
    """
    if not hasattr(errors, "_fields"):
        return errors
    worst = 0.0
    for name, error in _flat(errors):
        worst = _worse(worst, asked[order._fields.index(name)] > 0, error)
    return worst


@overload(largest, jit_options={"forceinline": True, "error_model": "numpy"})
def _typed_largest(errors, asked, order):
    if not isinstance(errors, types.BaseNamedTuple):
        return lambda errors, asked, order: errors
    text = "0.0"
    for name, place in _places(errors, "errors"):
        text = f"_worse({text}, asked[{order.instance_class._fields.index(name)}] > 0, {place})"
    return eval(f"lambda errors, asked, order: {text}", {"_worse": _worse})


def _places(record, text):
    """The name of each number in a record of records, and how to get at it."""
    for j, (name, kind) in enumerate(zip(record.fields, record, strict=True)):
        if isinstance(kind, types.BaseNamedTuple):
            yield from _places(kind, f"{text}[{j}]")
        else:
            yield name, f"{text}[{j}]"
