"""What small changes of a scene's states change: the tangent of its motion.

The derivative of an expression along changes `delta` of the states is an expression again, so that the changes' own
Taylor series, of delta' = (D rates) delta, come from the recurrences of the motion's (`series`). Signs of kinks do not
change between events.
"""

from collections import defaultdict

from kernels.source_text.expression import ADD, INPUT, SCALED, needed

SHORT, FED_BACK, LONG = {12: 4, 18: 4}, {12: 6, 18: 6}, {12: 9, 18: 12}
"""Order of the changes' series on a step of the motion's: terms fall by about a quarter each, so to some 1e-3. Those of
exp, sin, cos, sinh, cosh and linear rates first grow, as x^k/k!; those of states that feed back on one another may."""


def short(rates, feeds_back, order):
    """Order of the changes' series beside one of the motion of that order; `feeds_back` : whether a state's does."""
    kinds = {x.kind for x in needed(*rates) if x.varies}
    grow_first = kinds & {"exp", "sin", "cos", "sinh", "cosh"} or kinds <= {INPUT, ADD, SCALED}
    return (LONG if grow_first else FED_BACK if feeds_back else SHORT)[order]


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
            plain = x.kind == INPUT
            self._reused[x.index] = self.deltas[x.args[0]] if plain else getattr(self, f"_{x.kind}")(x, *x.args)
        return self._reused[x.index]

    def _by(self, factor, u):
        """A factor times the derivative of u."""
        delta = self.of(u)
        return None if delta is None else self._graph.multiply(factor, delta)

    def _sum(self, *terms):
        present = [x for x in terms if x is not None]
        return self._graph.add(*present) if len(present) == 2 else next(iter(present), None)

    def _over(self, x, divisor):
        return None if x is None else self._graph.divide(x, divisor)

    def _add(self, x, u, w):
        return self._sum(self.of(u), self.of(w))

    def _scaled(self, x, constant, u):
        return self._by(constant, u)

    def _mul(self, x, u, w):
        return self._sum(self._by(w, u), self._by(u, w))

    def _half_square(self, x, u):
        return self._by(u, u)

    def _div(self, x, u, w):
        return self._over(self._sum(self.of(u), self._by(-x, w)), w)

    def _sqrt(self, x, u):
        return self._over(self.of(u), 2.0 * x)

    def _exp(self, x, u):
        return self._by(x, u)

    def _log(self, x, u):
        return self._over(self.of(u), u)

    def _sin(self, x, u):
        return self._by(self._graph.function("cos", u), u)

    def _cos(self, x, u):
        return self._by(-self._graph.function("sin", u), u)

    def _of_slopes(self, x, *_):
        return self._sum(*(self._by(slope, u) for u, slope in self._graph.slopes(x)))

    _tanh = _arctan = _arcsin = _arccos = _sinh = _cosh = _hypot = _of_slopes

    def _power(self, x, u, n):
        return self._by(n * (x / u), u)

    def _power_of_side(self, x, base, n):
        return self._by(n * self._graph.over_base(x), base.args[1])


def along(graph, gradient, rates):
    """The rate of what has that gradient, a list whose entries may be None."""
    products = [slope * rate for slope, rate in zip(gradient, rates, strict=True) if slope is not None]
    return sum(products, graph.of(0.0))
