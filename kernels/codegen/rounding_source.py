"""Source text of what rounding takes from a surface's value at the start of a scene.

Of a sum and of a product the loss is known exactly (Knuth's two-sum, a fused multiply-add), so what is computed without
rounding loses nothing, and a start on the surface lies there for sure. Of a function it is an ulp. To first order
losses go on as errors do.
"""

from kernels.codegen.expression import ADD, DIV, HALF_SQUARE, INPUT, MUL, NUMBER, SCALED
from kernels.codegen.series_source import Lines
from kernels.codegen.template import filled

ULP = 2.0**-52
SLOPES = {
    "sqrt": "0.5 / {value}", "exp": "{value}", "log": "1.0 / magnitude({u})", "sin": "1.0", "cos": "1.0",
    "abs": "1.0", "sign": "0.0",
}  # fmt: skip

LOST = '''
@jit
def lost_by_surface(state, side, signs, parameters):
    """What rounding takes from the surface's value at the start, at most."""
    {unpack}
    {lines}
    return {lost}
'''


class Losses:
    """Statements for what rounding takes from expressions, as text; None where that is nothing.

    `started` is a dict from the name of a state to the expression of its value at the start.
    """

    def __init__(self, names, started):
        self.lines = Lines(names)
        self._started, self._reused = started, {}

    def lost(self, x):
        """The name of what the value of an expression has lost."""
        if x.index not in self._reused:
            self._reused[x.index] = None
            text = " + ".join(filter(None, self._terms(x)))
            if text:
                self.lines.text.append(f"lost_{x.index} = {text}")
                self._reused[x.index] = f"lost_{x.index}"
        return self._reused[x.index]

    def _terms(self, x):
        if x.kind == NUMBER:
            return []
        if x.kind == INPUT:
            return [self.lost(self._started[x.args[0]])] if x.args[0] in self._started else []
        value, u = self.lines.value(x), x.args[0]
        if x.kind == ADD:
            a, b = (self.lines.value(term) for term in x.args)
            return [f"magnitude(two_sum({a}, {b})[1])", *(self.lost(term) for term in x.args)]
        if x.kind in (MUL, SCALED, HALF_SQUARE, DIV):
            return self._terms_of_product(x, value)
        slope = SLOPES.get(x.kind, "magnitude({n} * {value} / {u})")
        n = self.lines.value(x.args[1]) if len(x.args) > 1 else ""
        slope = slope.format(value=f"magnitude({value})", u=self.lines.value(u), n=n)
        rounded = None if x.kind in ("abs", "sign") else f"{ULP!r} * magnitude({value})"
        return [rounded, self.lost(u) and f"{self.lost(u)} * {slope}"]

    def _terms_of_product(self, x, value):
        u, w = x.args if len(x.args) == 2 else (x.args[0], x.args[0])
        a, b = self.lines.value(u), self.lines.value(w)
        if x.kind == HALF_SQUARE:
            return [f"magnitude(fma(0.5 * {a}, {a}, -{value}))", self.lost(u) and f"{self.lost(u)} * magnitude({a})"]
        if x.kind == DIV:
            rest = [f"magnitude(fma({value}, {b}, -{a}))", self.lost(u)]
            rest.append(self.lost(w) and f"{self.lost(w)} * magnitude({value})")
            return [f"({' + '.join(filter(None, rest))}) / magnitude({b})"]
        rest = [f"magnitude(fma({a}, {b}, -{value}))"]
        return rest + [self.lost(y) and f"{self.lost(y)} * magnitude({c})" for y, c in ((u, b), (w, a))]


def lost_by_surface(writer):
    """The text of `lost_by_surface`."""
    recorded = writer.recorded
    losses = Losses(writer.names, dict(zip(writer.scene.states, recorded.started, strict=True)))
    lost = losses.lost(recorded.surface)
    return filled(LOST, unpack=writer.all_unpacked, lines="\n".join(losses.lines.text), lost=lost or "0.0 * side")
