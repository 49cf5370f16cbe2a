"""Tuples of any length: the states and the events of a scene, and records; generic in one cell or lanes."""

import itertools

from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

from kernels.lanes.symbols import fold, symbolic
from kernels.lanes.vectors import _I64, WIDTH, _lanes, dot, fma, magnitude, where


@symbolic
def after(state, h, weights, rates):
    """state + h sum_j weights[j] rates[j]: a Runge-Kutta stage; each of the tuple `rates` is as long as `state`."""
    return tuple(fma(h, dot(weights, tuple(rate[i] for rate in rates)), u) for i, u in enumerate(state))


@symbolic
def paired(first, second):
    """Entries 0, 2, 4 ... of the first tuple, and 1, 3, 5 ... of the second."""
    return tuple(second[i] if i % 2 else first[i] for i in range(len(first)))


@symbolic
def marks(which, like):
    """A tuple as long as `like`: 1 at the index `which`, else 0."""
    return tuple(where((which > i - 0.5) & (which < i + 0.5), 1.0, 0.0) for i in range(len(like)))


@symbolic
def times(x, ys):
    """x times each of a tuple."""
    return tuple(x * y for y in ys)


@symbolic
def joined(xs, ys):
    """One tuple behind the other."""
    return xs + ys


@symbolic
def reached(xs, ys):
    """The larger of each x >= 0 and the magnitude of y."""
    return tuple(where(magnitude(y) > x, magnitude(y), x) for x, y in zip(xs, ys, strict=True))


@symbolic
def boxes(state, new, change):
    """An interval for each entry between two states, `change` being what its rate changes by times the step.

    The parabola through both leaves the interval between them by an eighth of that at most.
    """
    return tuple(
        (where(w < u, w, u) - 0.25 * magnitude(c), where(w > u, w, u) + 0.25 * magnitude(c))
        for u, w, c in zip(state, new, change, strict=True)
    )


@symbolic
def total(xs):
    """The sum of a tuple, from left to right."""
    result = xs[0]
    for x in xs[1:]:
        result = result + x
    return result


@symbolic
def either(x, y):
    """Whether one of two conditions holds."""
    return x | y


@symbolic
def both(x, y):
    """Whether two conditions hold."""
    return x & y


@symbolic
def any_of(conditions):
    """Whether one of a tuple of conditions holds."""
    return fold(either, conditions[0], (), conditions[1:])


@symbolic
def all_of(conditions):
    """Whether all of a tuple of conditions hold."""
    return fold(both, conditions[0], (), conditions[1:])


def flat(record):
    """All numbers of a record of tuples and records, in the order of `write`."""
    return [number for part in record for number in (flat(part) if isinstance(part, tuple) else [part])]


def first_rows(record):
    """The row of a record's first number of each entry, by its name."""
    sizes = [len(flat((part,))) for part in record]
    return dict(zip(record._fields, itertools.accumulate(sizes, initial=0), strict=False))


def read(memory, i, like):
    """A record shaped as `like`, its numbers each from a row of a memory of lanes."""
    rows = iter(memory)

    def taken(part):
        if not isinstance(part, tuple):
            return next(rows)[i]
        found = tuple(map(taken, part))
        return type(part)(*found) if hasattr(part, "_fields") else found

    return taken(like)


def write(memory, i, record):
    """The numbers of such a record into the rows of a memory."""
    for row, value in zip(memory, flat(record), strict=True):
        row[i] = value


def _lanes_like(kind):
    """The type of a record whose numbers are lanes."""
    if not isinstance(kind, types.BaseTuple):
        return _lanes
    return types.BaseTuple.from_types([_lanes_like(part) for part in kind], getattr(kind, "instance_class", None))


def _places(context, builder, memory_type, memory):
    """Pointers to the lanes of one row after the other."""
    data = context.make_array(memory_type)(context, builder, memory).data
    for row in itertools.count():
        first = builder.gep(data, [_I64(row * WIDTH)])
        yield builder.bitcast(first, context.get_value_type(_lanes).as_pointer())


type_callable(read)(lambda context: lambda memory, i, like: _lanes_like(like))
type_callable(write)(lambda context: lambda memory, i, record: types.void)


@lower_builtin(read, types.Array, types.Any, types.Any)
def _lower_read(context, builder, signature, values):
    places = _places(context, builder, signature.args[0], values[0])

    def taken(kind):
        if kind == _lanes:
            return builder.load(next(places), align=8)
        return context.make_tuple(builder, kind, [taken(part) for part in kind])

    return taken(signature.return_type)


@lower_builtin(write, types.Array, types.Any, types.Any)
def _lower_write(context, builder, signature, values):
    places = _places(context, builder, signature.args[0], values[0])

    def put(value, kind):
        if isinstance(kind, types.BaseTuple):
            for part, kind_of_part in zip(cgutils.unpack_tuple(builder, value), kind, strict=True):
                put(part, kind_of_part)
        else:
            builder.store(context.cast(builder, value, kind, _lanes), next(places), align=8)

    put(values[2], signature.args[2])
    return context.get_dummy_value()
