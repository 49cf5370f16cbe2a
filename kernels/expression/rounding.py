"""Rounding error of a surface's value at the start of a scene.

For sums and products the error is known exactly (Knuth's two-sum, a fused multiply-add), so that a value computed
without rounding has none, and a start on the surface is recognised as such. For a function it is an ulp. Errors
propagate to first order. Along a motion a rough estimate suffices: an ulp of the terms of every sum.
"""

from kernels.expression.graph import ADD, CHOSEN, DIV, HALF_SQUARE, INPUT, MUL, NUMBER, SCALED, needed
from kernels.expression.series import V, Values, added, product
from kernels.expression.tangent import partials
from kernels.lanes.symbols import taking_symbols
from kernels.maths import pairs

P = taking_symbols(pairs)
ULP = 2.0**-52


def slopes(values, x):
    """The arguments of a function that its rounding comes from, each with what it changes by per unit."""
    u = x.args[0]
    if x.kind in ("sin", "cos", "abs"):
        return [(u, 1.0)]
    if x.kind in ("sign", "floor"):
        return [(u, 0.0)]
    if x.kind in ("sqrt", "exp"):
        size = V.magnitude(values.value(x))
        return [(u, size if x.kind == "exp" else 0.5 / size)]
    if x.kind == "log":
        return [(u, 1.0 / V.magnitude(values.value(u)))]
    if x.kind in ("power", "power_of_side"):
        return [(u, V.magnitude(values.value(x.args[1]) * V.magnitude(values.value(x)) / values.value(u)))]
    return [(u, V.magnitude(values.value(slope))) for u, slope in partials(x)[0]]


class Losses:
    """What rounding takes from expressions; None where that is nothing.

    Parameters
    ----------
    inputs : dict from the name of an input to its value
    started : dict from the name of a state to the expression of its value at the start
    """

    def __init__(self, inputs, started):
        self._values, self._started, self._reused = Values(inputs), started, {}

    def lost(self, x):
        """What the value of an expression has lost."""
        if x.index not in self._reused:
            self._reused[x.index] = None
            self._reused[x.index] = added(*self._terms(x))
        return self._reused[x.index]

    def _terms(self, x):
        if x.kind == NUMBER:
            return []
        if x.kind == INPUT:
            return [self.lost(self._started[x.args[0]])] if x.args[0] in self._started else []
        value = self._values.value
        if x.kind == ADD:
            return [V.magnitude(P.two_sum(*map(value, x.args))[1]), *map(self.lost, x.args)]
        if x.kind == HALF_SQUARE:
            (u,), (a,) = x.args, map(value, x.args)
            return [V.magnitude(V.fma(0.5 * a, a, -value(x))), product(self.lost(u), V.magnitude(a))]
        if x.kind in (MUL, SCALED, DIV):
            (u, w), (a, b) = x.args, map(value, x.args)
            if x.kind == DIV:
                of_w = product(self.lost(w), V.magnitude(value(x)))
                rest = added(V.magnitude(V.fma(value(x), b, -a)), self.lost(u), of_w)
                return [rest / V.magnitude(b)]
            losses = [product(self.lost(y), V.magnitude(c)) for y, c in ((u, b), (w, a))]
            return [V.magnitude(V.fma(a, b, -value(x))), *losses]
        rounded = None if x.kind in ("abs", "sign", "floor") else ULP * V.magnitude(value(x))
        return [rounded, *(product(self.lost(u), slope) for u, slope in slopes(self._values, x))]


class Sizes:
    """What an expression is made of, in size: an ulp of it is about what rounding takes."""

    def __init__(self, inputs):
        self.values, self._reused = Values(inputs), {}

    def of(self, x):
        """The size: of a sum that of its terms, of a function also what its argument's changes."""
        if x.index not in self._reused:
            self._reused[x.index] = V.magnitude(self.values.value(x)) if _whole(x) else self._made(x)
        return self._reused[x.index]

    def _made(self, x):
        if x.kind in (ADD, MUL, SCALED, DIV):
            u, w = map(self.of, x.args)
            if x.kind == DIV:
                return u * w / (self.values.value(x.args[1]) * self.values.value(x.args[1]))
            return u + w if x.kind == ADD else u * w
        if x.kind == HALF_SQUARE:
            return 0.5 * self.of(x.args[0]) * self.of(x.args[0])
        if x.kind == CHOSEN:
            return V.where(self.values.value(x.args[0]) > 0.0, *map(self.of, x.args[1:]))
        total = V.magnitude(self.values.value(x))
        for u, slope in slopes(self.values, x):
            total = V.fma(slope, self.of(u), total)
        return total


def _whole(x):
    """Whether an expression has no sum and no function in it, but of signs: then it is right to some ulps of itself."""
    if x.kind in (NUMBER, INPUT, "abs", "sign", "power_of_side"):
        return True
    if not x.varies and all(str(n.args[0]).startswith(".sign_") for n in needed(x) if n.kind == INPUT):
        return True
    return x.kind in (MUL, SCALED, HALF_SQUARE, DIV, "sqrt") and all(_whole(u) for u in x.args)
