"""Tuples of any length: the states and the events of a scene, and records; generic in one cell or lanes."""

import itertools
import operator

from kernels.lanes.symbols import fold, symbolic
from kernels.lanes.vectors import dot, fma, magnitude, where


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
    return fold(operator.add, xs[0], (), xs[1:])


@symbolic
def any_of(conditions):
    """Whether one of a tuple of conditions holds."""
    return fold(operator.or_, conditions[0], (), conditions[1:])


@symbolic
def all_of(conditions):
    """Whether all of a tuple of conditions hold."""
    return fold(operator.and_, conditions[0], (), conditions[1:])


@symbolic
def flat(record):
    """All numbers of a record of tuples and records, in the order of `write`."""
    return [number for part in record for number in (flat(part) if isinstance(part, tuple) else [part])]


def first_rows(record):
    """The row of a record's first number of each entry, by its name."""
    sizes = [len(flat((part,))) for part in record]
    return dict(zip(record._fields, itertools.accumulate(sizes, initial=0), strict=False))


@symbolic
def read(memory, i, like):
    """A record shaped as `like`, its numbers each from a row of a memory of lanes."""
    rows = itertools.count()

    def taken(part):
        if not isinstance(part, tuple):
            return memory[next(rows), i]
        found = tuple(map(taken, part))
        return type(part)(*found) if hasattr(part, "_fields") else found

    return taken(like)


@symbolic
def write(memory, i, record):
    """The numbers of such a record into the rows of a memory."""
    for row, value in enumerate(flat(record)):
        memory[row, i] = value
