"""Records of columns and of cells: a cell's numbers are read from columns, and written to them, by name.

A *record* is a NamedTuple. Of arrays, it holds columns; of numbers (or lanes), one cell (or WIDTH of them). With

    Columns(a=array, b=array, total=array, status=array)
    p = read(Pair, columns, i)                            # Pair(a=columns.a[i], b=columns.b[i])
    write(columns, i, Sum(total=p.a + p.b))               # columns.total[i] = p.a + p.b

physics knows names and no order of columns. numba compiles no getattr by a name in a variable, so each function stands
here twice: as plain Python, which says what it does, and below it as a typing (which names, which types) and a lowering
(what is loaded and stored) of the same.
"""

import math
import operator
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.core.imputils import impl_ret_borrowed
from numba.extending import lower_builtin, overload, type_callable

from kernels.lanes.jit import jit
from kernels.lanes.vectors import not_, where


def named(record: Any, values: Any) -> Any:
    """A plain tuple as a record of that class; what is a record already stays one, if it has the same names.

    Raises
    ------
    TypeError
        Compiled, a TypingError: for other names, or more or fewer.
    """
    if not hasattr(values, "_fields"):
        return record(*values)
    wrong = _mistake(record, [name for name, _ in _flat(values)])
    if wrong:
        raise TypeError(wrong)
    return values


def _mistake(record: Any, names: Sequence[str]) -> str:
    """What is wrong with names that should be those of a record, in any order; "" where nothing is."""
    same = sorted(names) == sorted(record._fields)
    return "" if same else f"found {', '.join(names)}; expected {', '.join(record._fields)}"


def read(record: Any, columns: Any, i: Any) -> Any:
    """Cell i of the columns that have the names of the record's fields; an array's row."""
    return record(*(getattr(columns, name)[i] for name in record._fields))


def write(columns: Any, i: Any, values: Any) -> None:
    """Puts each value into cell i of the column of its name; a record within the record likewise."""
    for name, value in _flat(values):
        getattr(columns, name)[i] = value


def _flat(values: Any) -> Iterator[tuple[str, Any]]:
    for name, value in zip(values._fields, values, strict=True):
        if hasattr(value, "_fields"):
            yield from _flat(value)
        else:
            yield name, value


named.borrows = read.borrows = True  # type: ignore[attr-defined]  # arrays are their caller's: `kernels.lanes.inlining`


@type_callable(named)
def _type_named(context):
    def typer(record, values):
        if isinstance(values, types.BaseNamedTuple):
            _check_names(record, values)
            return values
        fields = record.instance_class._fields
        if not isinstance(values, types.BaseTuple) or len(values) != len(fields):
            raise TypingError(f"found {values}; expected {', '.join(fields)}")
        return types.BaseTuple.from_types(tuple(values), record.instance_class)

    return typer


def _check_names(record, values):
    wrong = _mistake(record.instance_class, [name for name, _ in _places(values, "")])
    if wrong:
        raise TypingError(wrong)


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
    return where(wanted & not_(error <= worst), where(error > worst, error, math.inf), worst)


def largest(errors: Any, asked: Any, order: Any, given: Any) -> Any:
    """The largest of the errors that were asked for; a number stands for all.

    Parameters
    ----------
    errors : a number, or a record (of records) with one for each output
    asked : ndarray, 1 for each output that counts
    order : NamedTuple class whose fields are the outputs in their order
    given : NamedTuple class of the outputs that a record must have an error for
    """
    if not hasattr(errors, "_fields"):
        return errors
    named(given, errors)
    worst = 0.0
    for name, error in _flat(errors):
        worst = _worse(worst, asked[order._fields.index(name)] > 0, error)
    return worst


@overload(largest, jit_options={"forceinline": True, "error_model": "numpy"})
def _typed_largest(errors, asked, order, given):
    if not isinstance(errors, types.BaseNamedTuple):
        return lambda errors, asked, order, given: errors
    _check_names(given, errors)
    text = "0.0"
    for name, place in _places(errors, "errors"):
        text = f"_worse({text}, asked[{order.instance_class._fields.index(name)}] > 0, {place})"
    return eval(f"lambda errors, asked, order, given: {text}", {"_worse": _worse})


def _places(record, text):
    """The name of each number in a record of records, and how to get at it."""
    for j, (name, kind) in enumerate(zip(record.fields, record, strict=True)):
        if isinstance(kind, types.BaseNamedTuple):
            yield from _places(kind, f"{text}[{j}]")
        else:
            yield name, f"{text}[{j}]"
