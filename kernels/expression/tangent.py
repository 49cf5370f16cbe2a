"""The tangent of a motion: the effect of small changes of a scene's states.

The derivative of an expression along changes `delta` of the states is an expression again, so that the changes' own
Taylor series, of delta' = (D rates) delta, come from the recurrences of the motion's (`series`). Signs of kinks do not
change between events.
"""

from collections import defaultdict

from kernels.expression.graph import ADD, CHOSEN, DIV, HALF_SQUARE, INPUT, MUL, SCALED, needed

ROUGH, SHORT, LONG = {12: 4, 18: 4}, {12: 10, 18: 8}, {12: 10, 18: 12}
"""Order of the changes' series on a step of the motion's. ROUGH is to some 1e-3 where terms fall by about a quarter
each. Where a motion grows as e^t its steps are the longest, up to 3.4 and 2.3; SHORT ones then lose at most 0.1 % of an
error a step, so that it is seen to add up over the three hundred steps from 1e-308 to 1. Terms of exp, sin, cos, sinh,
cosh and linear rates grow first, as x^k/k!, on all steps."""


def short(rates, order):
    """Order of the changes' series beside one of the motion of that order."""
    kinds = {x.kind for x in needed(*rates) if x.varies}
    grow_first = kinds & {"exp", "sin", "cos", "sinh", "cosh"} or kinds <= {INPUT, ADD, SCALED}
    return (LONG if grow_first else SHORT)[order]


def partials(x):
    """The derivative of an operation: each argument with a factor, None for 1; and what their sum is divided by."""
    u, w = (*x.args, None)[:2]
    of = x.graph.function
    found = {
        ADD: lambda: ([(u, None), (w, None)], None),
        SCALED: lambda: ([(w, u)], None),
        MUL: lambda: ([(u, w), (w, u)], None),
        HALF_SQUARE: lambda: ([(u, u)], None),
        DIV: lambda: ([(u, None), (w, -x)], w),
        "sqrt": lambda: ([(u, None)], 2.0 * x),
        "exp": lambda: ([(u, x)], None),
        "log": lambda: ([(u, None)], u),
        "sin": lambda: ([(u, of("cos", u))], None),
        "cos": lambda: ([(u, -of("sin", u))], None),
        "power": lambda: ([(u, w * (x / u))], None),
        "power_of_side": lambda: ([(u.args[1], w * x.graph.over_base(x))], None),
        "tanh": lambda: ([(u, 1.0 - x * x)], None),
        "arctan": lambda: ([(u, 1.0 / (1.0 + u * u))], None),
        "arcsin": lambda: ([(u, 1.0 / of("sqrt", (1.0 - u) * (1.0 + u)))], None),
        "arccos": lambda: ([(u, -1.0 / of("sqrt", (1.0 - u) * (1.0 + u)))], None),
        "sinh": lambda: ([(u, of("cosh", u))], None),
        "cosh": lambda: ([(u, of("sinh", u))], None),
        "hypot": lambda: ([(u, u / x), (w, w / x)], None),
    }
    return found[x.kind]()


class Tangents:
    """Derivatives of a graph's expressions along changes of its states; None where that is 0.

    Parameters
    ----------
    graph : to which the derivatives are added
    states : names; the change of each is an input ".delta_NAME" of the graph
    """

    def __init__(self, graph, states):
        self._graph, self._reused = graph, {}
        self.deltas = {s: graph.series(f".delta_{s}") for s in states}

    @classmethod
    def along(cls, graph, state):
        """Derivatives with respect to one state."""
        found = cls(graph, [])
        found.deltas = defaultdict(lambda: None, {state: graph.of(1.0)})
        return found

    def of(self, x):
        """The derivative of an expression."""
        if not x.varies:
            return None
        if x.index not in self._reused:
            self._reused[x.index] = self.deltas[x.args[0]] if x.kind == INPUT else self._of_operation(x)
        return self._reused[x.index]

    def _of_operation(self, x):
        if x.kind == CHOSEN:
            changes = (self._graph.of(0.0) if d is None else d for d in map(self.of, x.args[1:]))
            return self._graph.chosen(x.args[0], *changes)
        parts, divisor = partials(x)
        deltas = [(self.of(u), factor) for u, factor in parts]
        terms = [d if factor is None else self._graph.multiply(factor, d) for d, factor in deltas if d is not None]
        if not terms:
            return None
        total = sum(terms[1:], terms[0])
        return total if divisor is None else self._graph.divide(total, divisor)


def along(graph, gradient, rates):
    """The rate of what has that gradient, a list whose entries may be None."""
    products = [slope * rate for slope, rate in zip(gradient, rates, strict=True) if slope is not None]
    return sum(products, graph.of(0.0))
