"""Records of columns and of cells: a cell's numbers are read from columns, and written to them, by name.

A *record* is a NamedTuple. Of arrays, it holds columns; of numbers, one cell; of lanes, the cells side by side. With

    Columns(a=array, b=array, total=array, status=array)
    p = read(Pair, columns, i)                            # Pair(a=columns.a[i], b=columns.b[i])
    write(columns, i, Sum(total=p.a + p.b))               # columns.total[i] = p.a + p.b

physics knows names and no order of columns. Compiled code has these functions as `symbols` writes them.
"""

import math
from collections.abc import Iterator
from typing import Any

from kernels.lanes.symbols import symbolic
from kernels.lanes.vectors import not_, where


@symbolic
def named(record: Any, values: Any) -> Any:
    """A plain tuple as a record of that class; what is a record already stays one, if it has the same names.

    Raises
    ------
    TypeError
        For other names, or more or fewer; also while code is compiled.
    """
    fields = ", ".join(record._fields)
    if hasattr(values, "_fields"):
        names = [name for name, _ in _flat(values)]
        if sorted(names) != sorted(record._fields):
            raise TypeError(f"found {', '.join(names)}; expected {fields}")
        return values
    if not isinstance(values, tuple) or len(values) != len(record._fields):
        raise TypeError(f"found {values}; expected {fields}")
    return record(*values)


@symbolic
def read(record: Any, columns: Any, i: Any) -> Any:
    """Cell i of the columns that have the names of the record's fields; an array's row."""
    return record(*(getattr(columns, name)[i] for name in record._fields))


@symbolic
def write(columns: Any, i: Any, values: Any) -> None:
    """Puts each value into cell i of the column of its name; a record within the record likewise."""
    for name, value in _flat(values):
        getattr(columns, name)[i] = value


@symbolic
def _flat(values: Any) -> Iterator[tuple[str, Any]]:
    """The name of each number in a record of records, and the number."""
    for name, value in zip(values._fields, values, strict=True):
        if hasattr(value, "_fields"):
            yield from _flat(value)
        else:
            yield name, value


named.borrows = read.borrows = True  # type: ignore[attr-defined]  # arrays are their caller's: `kernels.lanes.inlining`


@symbolic
def largest(errors: Any, asked: Any, order: Any, given: Any) -> Any:
    """The largest of the errors that were asked for; a number stands for all.

    Parameters
    ----------
    errors : a number; a record (of records) with one for each output, or a tuple in their order
    asked : ndarray, 1 for each output that counts
    order : NamedTuple class whose fields are the outputs in their order
    given : NamedTuple class of the outputs that a record must have an error for
    """
    if not isinstance(errors, tuple):
        return errors
    worst = 0.0
    for name, error in _flat(named(given, errors)):
        wanted = asked[order._fields.index(name)] > 0
        worst = where(wanted & not_(error <= worst), where(error > worst, error, math.inf), worst)  # inf for NaN
    return worst
