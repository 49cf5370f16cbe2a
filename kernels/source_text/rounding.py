"""Source text of what rounding takes from a surface's value at the start of a scene.

Of a sum and of a product the loss is known exactly (Knuth's two-sum, a fused multiply-add), so what is computed without
rounding loses nothing, and a start on the surface lies there for sure. Of a function it is an ulp. To first order
losses go on as errors do. Along a motion it is enough to know them roughly, an ulp of the terms of every sum.
"""

from kernels.source_text.expression import ADD, DIV, HALF_SQUARE, INPUT, MUL, NUMBER, SCALED, needed
from kernels.source_text.series import Lines
from kernels.source_text.tangent import Tangents, along
from kernels.source_text.template import filled, listed

ULP = 2.0**-52
SLOPES = {
    "sqrt": "0.5 / {value}", "exp": "{value}", "log": "1.0 / magnitude({u})", "sin": "1.0", "cos": "1.0",
    "abs": "1.0", "sign": "0.0", "floor": "0.0", "power": "magnitude({n} * {value} / {u})",
    "power_of_side": "magnitude({n} * {value} / {u})",
}  # fmt: skip

LOST = '''
@jit
def lost(state, mode):
    """What rounding takes from the surface's value at the start, at most."""
    {unpack}
    {lines}
    return {lost}
'''

SIZES = '''
@jit
def {name}(state, mode):
    """{doc}"""
    {unpack}
    {lines}
    return {sizes}
'''


def slopes(lines, x):
    """The arguments of a function that its rounding comes from, each with what it changes by per unit, as text."""
    if x.kind not in SLOPES:
        return [(u, f"magnitude({lines.value(slope)})") for u, slope in x.graph.slopes(x)]
    value, u, *n = map(lines.value, (x, *x.args))
    return [(x.args[0], SLOPES[x.kind].format(value=f"magnitude({value})", u=u, n=n[0] if n else ""))]


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
        value = self.lines.value(x)
        if x.kind == ADD:
            a, b = (self.lines.value(term) for term in x.args)
            return [f"magnitude(two_sum({a}, {b})[1])", *(self.lost(term) for term in x.args)]
        if x.kind in (MUL, SCALED, HALF_SQUARE, DIV):
            return self._terms_of_product(x, value)
        rounded = None if x.kind in ("abs", "sign", "floor") else f"{ULP!r} * magnitude({value})"
        return [rounded, *(self.lost(u) and f"{self.lost(u)} * {slope}" for u, slope in slopes(self.lines, x))]

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


class Sizes:
    """Statements for what an expression is made of, in size: an ulp of it is about what rounding takes."""

    def __init__(self, names):
        self.lines = Lines(names)
        self._reused = {}

    def of(self, x):
        """The size, as text: of a sum that of its terms, of a function also what its argument's changes."""
        if x.index not in self._reused:
            text = f"magnitude({self.lines.value(x)})" if _whole(x) else self._made(x)
            self._reused[x.index] = text
            if x.kind not in (NUMBER, INPUT):
                self.lines.text.append(f"made_{x.index} = {text}")
                self._reused[x.index] = f"made_{x.index}"
        return self._reused[x.index]

    def _made(self, x):
        if x.kind not in (ADD, MUL, SCALED, HALF_SQUARE, DIV):
            return self._made_by_function(x)
        parts = [self.of(u) for u in x.args]
        if x.kind == ADD:
            return " + ".join(parts)
        if x.kind in (MUL, SCALED):
            return " * ".join(parts)
        if x.kind == HALF_SQUARE:
            return f"0.5 * {parts[0]} * {parts[0]}"
        w = self.lines.value(x.args[1])
        return f"{parts[0]} * {parts[1]} / ({w} * {w})"

    def _made_by_function(self, x):
        total = f"magnitude({self.lines.value(x)})"
        for u, slope in slopes(self.lines, x):
            total = f"fma({slope}, {self.of(u)}, {total})"
        return total


def made(writer):
    """The text of `made`: what each event's value is made of, in size, and its rate."""
    recorded, found, pairs = writer.recorded, Sizes(writer.names), []
    graph, states = recorded.graph, writer.scene.states
    for offset, factor, u in recorded.events:
        value = graph.multiply(factor, u)
        rate = along(graph, [Tangents.along(graph, s).of(value) for s in states], recorded.rates)
        size = f"{found.of(value)} + magnitude({found.lines.value(offset)})"
        pairs.append(f"({size}, {found.lines.value(rate)})")
    doc = "What each event's value is made of, in size, and its rate."
    return filled(
        SIZES, name="made", doc=doc, unpack=writer.all_unpacked, lines="\n".join(found.lines.text),
        sizes=f"({listed(pairs)})",
    )  # fmt: skip


def _whole(x):
    """Whether an expression has no sum and no function in it, but of signs: then it is right to some ulps of itself."""
    if x.kind in (NUMBER, INPUT, "abs", "sign", "power_of_side"):
        return True
    if not x.varies and all(str(n.args[0]).startswith(".sign_") for n in needed(x) if n.kind == INPUT):
        return True
    return x.kind in (MUL, SCALED, HALF_SQUARE, DIV, "sqrt") and all(_whole(u) for u in x.args)


def sizes(writer, name, doc, expressions):
    """The text of a function of the sizes of what expressions are made of."""
    made = Sizes(writer.names)
    of_each = [made.of(x) for x in expressions]
    each = [text if x.varies else f"0.0 * side + {text}" for text, x in zip(of_each, expressions, strict=True)]
    return filled(
        SIZES,
        name=name,
        doc=doc,
        unpack=writer.all_unpacked,
        lines="\n".join(made.lines.text),
        sizes=f"({listed(each)})",
    )
