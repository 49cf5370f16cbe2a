"""Tuples of any length in one expression: the states and the events of a scene; generic in one cell or lanes.

numba compiles no loop that builds a tuple. Each function here has a plain Python form, and a spelling of it for the
lengths that it is compiled for, of the same bits.
"""

import inspect

from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, overload, type_callable

from kernels.lanes.vectors import _called, _items, _number, dot, fma, magnitude, where


def _spelled(spell):
    """Gives a function its compiled meaning: the expression that `spell` writes out for its arguments' types."""

    def decorate(function):
        names = list(inspect.signature(function).parameters)
        scope = {"fma": fma, "dot": dot, "where": where, "magnitude": magnitude}

        def meaning(*types):
            text = spell(*types)
            return eval(f"lambda {', '.join(names)}: {text}", scope)

        typer = eval(f"lambda {', '.join(names)}: meaning({', '.join(names)})", {"meaning": meaning})
        overload(function, jit_options={"forceinline": True, "error_model": "numpy"})(typer)
        return function

    return decorate


def _tuple(items):
    return f"({', '.join(items)}{',' if items else ''})"


def after(state, h, weights, rates):
    """state + h sum_j weights[j] rates[j]: a Runge-Kutta stage; each of the tuple `rates` is as long as `state`."""
    return tuple(fma(h, dot(weights, tuple(rate[i] for rate in rates)), u) for i, u in enumerate(state))


@type_callable(after)
def _type_after(context):
    return lambda state, h, weights, rates: types.Tuple([_number(h, *state, *rates[0])] * len(state))


@lower_builtin(after, types.Any, types.Any, types.Any, types.Any)
def _lower_after(context, builder, signature, values):
    """Emitted where it is called: a function of its own for each number of stages would take long to compile."""
    of_state, of_h, of_weights, of_rates = signature.args
    target, call = signature.return_type[0], _called("fma")
    state, weights = (
        _items(context, builder, t, v, target) for t, v in ((of_state, values[0]), (of_weights, values[2]))
    )
    h = context.cast(builder, values[1], of_h, target)
    unpacked = zip(of_rates, cgutils.unpack_tuple(builder, values[3]), strict=True)
    rates = [_items(context, builder, t, v, target) for t, v in unpacked]
    found = []
    for i, u in enumerate(state):
        total = builder.fmul(weights[0], rates[0][i])
        for weight, rate in zip(weights[1:], rates[1:], strict=True):
            total = call(builder, weight, rate[i], total)
        found.append(call(builder, h, total, u))
    return context.make_tuple(builder, signature.return_type, found)


@_spelled(lambda first, second: _tuple([f"{'second' if i % 2 else 'first'}[{i}]" for i in range(len(first))]))
def paired(first, second):
    """Entries 0, 2, 4 ... of the first tuple, and 1, 3, 5 ... of the second."""
    return tuple(second[i] if i % 2 else first[i] for i in range(len(first)))


@_spelled(
    lambda which, like: _tuple(
        [f"where((which > {i} - 0.5) & (which < {i} + 0.5), 1.0, 0.0)" for i in range(len(like))]
    )
)
def marks(which, like):
    """A tuple as long as `like`: 1 at the index `which`, else 0."""
    return tuple(where((which > i - 0.5) & (which < i + 0.5), 1.0, 0.0) for i in range(len(like)))


@_spelled(lambda x, ys: _tuple([f"x * ys[{i}]" for i in range(len(ys))]))
def times(x, ys):
    """x times each of a tuple."""
    return tuple(x * y for y in ys)


@_spelled(lambda signs, on: _tuple([f"where(on[{i + 1}] > 0.5, -signs[{i}], signs[{i}])" for i in range(len(signs))]))
def turned(signs, on):
    """The signs, turned round where the mark behind is set: of event 1 for sign 0."""
    return tuple(where(on[i + 1] > 0.5, -sign, sign) for i, sign in enumerate(signs))


@_spelled(lambda first, rest: _tuple(["first", *(f"rest[{i}]" for i in range(len(rest)))]))
def joined(first, rest):
    """A tuple with one more in front."""
    return (first, *rest)


@_spelled(lambda xs: _tuple([f"xs[{i}]" for i in range(len(xs) - 1)]))
def but_last(xs):
    """A tuple without its last."""
    return xs[:-1]


@_spelled(lambda xs, last: _tuple([*(f"xs[{i}]" for i in range(len(xs))), "last"]))
def with_last(xs, last):
    """A tuple with one more behind."""
    return (*xs, last)


@_spelled(
    lambda xs, ys: _tuple([f"where(magnitude(ys[{i}]) > xs[{i}], magnitude(ys[{i}]), xs[{i}])" for i in range(len(xs))])
)
def reached(xs, ys):
    """The larger of each x >= 0 and abs(y)."""
    return tuple(where(abs(y) > x, abs(y), x) for x, y in zip(xs, ys, strict=True))


@_spelled(
    lambda state, new, change: _tuple(
        [
            f"(where(new[{i}] < state[{i}], new[{i}], state[{i}]) - 0.25 * magnitude(change[{i}]), "
            f"where(new[{i}] > state[{i}], new[{i}], state[{i}]) + 0.25 * magnitude(change[{i}]))"
            for i in range(len(state))
        ]
    )
)
def boxes(state, new, change):
    """An interval for each entry between two states, `change` being what its rate changes by times the step.

    The parabola through both leaves the interval between them by an eighth of that at most.
    """
    return tuple(
        (min(u, w) - 0.25 * abs(c), max(u, w) + 0.25 * abs(c)) for u, w, c in zip(state, new, change, strict=True)
    )
