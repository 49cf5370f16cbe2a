"""Source text of what a scene's rates may hide in a step from one who knows them at its beginning.

A pulse such as exp(-((t - 20)/w)^2) is 0 to all digits at t = 0, and so are its derivatives: no series tells of it, and
points within the step can miss it. Intervals (`intervals`) of the graph's operations over the box of states that a
step passes cannot. Of the operations that a polynomial does not follow for ever, each may change by a factor within the
step (`CHANGE`); where it may change by more, all of it counts as hidden. By the mean value theorem that goes on to
    u + w: E_u + E_w,  u w: |w| E_u + |u| E_w,  u/w: (E_u + |u/w| E_w)/|w|,  f(u): |f'(u)| E_u            (1)
over the box. So what is small enough may stay hidden, and what is large is come up to by shorter steps.
"""

from kernels.source_text.expression import INPUT
from kernels.source_text.series import Lines
from kernels.source_text.tangent import Tangents, along
from kernels.source_text.template import filled, listed

HIDDEN = '''
@jit_call
def hidden(state, boxes, mode):
    """How far each rate, and each event, may be in the box from what the state tells, by (1)."""
    {unpack}
    {boxes} = boxes
    {lines}
    return ({rates}), ({events})
'''


class Enclosures:
    """Statements that enclose expressions in a box, and what these hide; each is written when first asked for."""

    def __init__(self, names):
        self.lines = Lines(names)
        self._names, self._reused = names, {}

    def interval(self, x):
        """The name of an expression's interval."""
        return self._once(x, "box", self._interval)

    def excess(self, x):
        """The name of what an expression hides; None where that is nothing."""
        return self._once(x, "excess", self._excess)

    def _once(self, x, what, write):
        if (x.index, what) not in self._reused:
            text = write(x)
            self._reused[x.index, what] = text and self._named(f"{what}_{x.index}", text)
        return self._reused[x.index, what]

    def _named(self, name, text):
        self.lines.text.append(f"{name} = {text}")
        return name

    def _interval(self, x):
        if x.kind == INPUT and x.varies:
            return f"box_{self._names[x.args[0]]}"
        if not x.varies:
            return f"({self.lines.value(x)}, {self.lines.value(x)})"
        plain, excess = self._plain(x), self.excess(x)
        return f"widened({plain}, {excess})" if excess else plain

    def _plain(self, x):
        """The name of the interval of an operation, but for what the operation itself hides."""
        return self._once(x, "plain", lambda x: getattr(self, f"_interval_of_{x.kind}")(x))

    def _interval_of_add(self, x):
        return f"added({self.interval(x.args[0])}, {self.interval(x.args[1])})"

    def _interval_of_mul(self, x):
        return f"multiplied({self.interval(x.args[0])}, {self.interval(x.args[1])})"

    _interval_of_scaled = _interval_of_mul

    def _interval_of_half_square(self, x):
        return f"half_squared({self.interval(x.args[0])})"

    def _interval_of_div(self, x):
        return f"multiplied({self.interval(x.args[0])}, over({self.interval(x.args[1])}))"

    def _interval_of_power(self, x):
        return f"of_power({self.interval(x.args[0])}, {self.lines.value(x.args[1])})"

    _interval_of_power_of_side = _interval_of_power

    def _interval_of_sin(self, x):
        return f"of_{x.kind}({', '.join(map(self.interval, x.args))})"

    _interval_of_cos = _interval_of_sqrt = _interval_of_exp = _interval_of_log = _interval_of_sin
    _interval_of_arcsin = _interval_of_arccos = _interval_of_cosh = _interval_of_hypot = _interval_of_sin

    def _interval_of_tanh(self, x):
        u = self.interval(x.args[0])
        return f"({x.kind}({u}[0]), {x.kind}({u}[1]))"

    _interval_of_arctan = _interval_of_sinh = _interval_of_tanh

    def _interval_of_power_over_base(self, x):
        return "(-math.inf, math.inf)"

    def _excess(self, x):
        # powers are for `integrate.powers`, from kink to kink
        if not x.varies or x.kind in (INPUT, "power_of_side", "power_over_base"):
            return None
        return " + ".join(filter(None, getattr(self, f"_excess_of_{x.kind}")(x))) or None

    def _passed_on(self, x, factor):
        """What x hides times what the result changes by per unit of x; None where x hides nothing."""
        return self.excess(x) and f"times({self.excess(x)}, {factor})"

    def _largest(self, x):
        return f"largest({self.interval(x)})"

    def _excess_of_add(self, x):
        return [self.excess(u) for u in x.args]

    def excess_scaled(self, constant, u):
        """What a constant times an expression hides, as text."""
        return self._passed_on(u, f"magnitude({self.lines.value(constant)})")

    def _excess_of_scaled(self, x):
        return [self.excess_scaled(*x.args)]

    def _excess_of_mul(self, x):
        u, w = x.args
        return [self._passed_on(u, self._largest(w)), self._passed_on(w, self._largest(u))]

    def _excess_of_half_square(self, x):
        return [self._passed_on(x.args[0], self._largest(x.args[0]))]

    def _excess_of_div(self, x):
        u, w = x.args
        divisor, plain = self.interval(w), self._plain(x)
        moved = self.excess(w) and f"times({self.excess(w)}, largest({plain}))"
        moved = " + ".join(filter(None, (self.excess(u), moved)))
        return [
            f"hidden_by_over({self.lines.value(w)}, {divisor}, {plain})",
            moved and f"times({moved}, 1.0 / smallest({divisor}))",
        ]

    def _excess_of_sqrt(self, x):
        return self._excess_of_root(x, "0.5 / sqrt({})")

    def _excess_of_log(self, x):
        return self._excess_of_root(x, "1.0 / {}")

    def _excess_of_root(self, x, slope):
        u = x.args[0]
        inside = self.interval(u)
        own = f"hidden_by_root({self.lines.value(u)}, {inside}, {self._plain(x)})"
        return [own, self._passed_on(u, slope.format(f"above({inside})[0]"))]

    def _excess_of_exp(self, x):
        u = x.args[0]
        own = f"hidden_by_exp({self.lines.value(u)}, {self.interval(u)})"
        return [own, self._passed_on(u, f"{self._plain(x)}[1]")]

    def _excess_of_power(self, x):
        u, n = x.args
        inside, plain = self.interval(u), self._plain(x)
        own = f"hidden_by_power({self.lines.value(u)}, {self.lines.value(x)}, {inside}, {plain})"
        return [own, self._passed_on(u, f"magnitude({self.lines.value(n)}) * {plain}[1] / above({inside})[0]")]

    def _excess_of_steep(self, x, kind=None):
        """Of a function with steep places; its slope is largest where its interval is widest."""
        u = x.args[0]
        own = f"hidden_by_{kind or x.kind}({self.lines.value(u)}, {self.interval(u)}, {self._plain(x)})"
        return [own, *self._by_slopes(x)]

    _excess_of_tanh = _excess_of_arctan = _excess_of_arcsin = _excess_of_steep

    def _excess_of_arccos(self, x):
        return self._excess_of_steep(x, "arcsin")

    def _excess_of_sinh(self, x):
        u = x.args[0]
        return [f"hidden_by_sinh({self.lines.value(u)}, {self.interval(u)})", *self._by_slopes(x)]

    _excess_of_cosh = _excess_of_sinh

    def _excess_of_hypot(self, x):
        return [f"hidden_by_hypot({self.lines.value(x)}, {self._plain(x)})", *map(self.excess, x.args)]

    def _by_slopes(self, x):
        """What the arguments hide, by the largest slope."""
        return [self.excess(u) and self._passed_on(u, self._largest(slope)) for u, slope in x.graph.slopes(x)]

    def _excess_of_wave(self, x):
        return [self.excess(x.args[0])]

    _excess_of_sin = _excess_of_cos = _excess_of_wave


BOUNDS = '''
@jit_call
def bounds(state, boxes, mode):
    """The least value of each event over the box, and the least and the largest rate of each."""
    {unpack}
    {boxes} = boxes
    {lines}
    return ({least}), ({slowest}), ({fastest})
'''


def bounds(writer):
    """The text of `bounds`."""
    recorded, enclosures = writer.recorded, Enclosures(writer.names)
    graph, states = recorded.graph, writer.scene.states
    values = [graph.add(offset, graph.multiply(factor, u)) for offset, factor, u in recorded.events]
    gradients = [[Tangents.along(graph, s).of(value) for s in states] for value in values]
    rates = [along(graph, gradient, recorded.rates) for gradient in gradients]
    found = {"least": (values, 0), "slowest": (rates, 0), "fastest": (rates, 1)}
    texts = {
        name: listed(f"{enclosures.interval(x)}[{end}] + 0.0 * side" for x in part)
        for name, (part, end) in found.items()
    }
    return filled(
        BOUNDS, unpack=writer.all_unpacked, boxes=listed(f"box_{s}" for s in writer.states),
        lines="\n".join(enclosures.lines.text), **texts,
    )  # fmt: skip


def hidden(writer):
    """The text of `hidden`, and whether each rate and each event can hide anything."""
    recorded, enclosures = writer.recorded, Enclosures(writer.names)
    rates = [enclosures.excess(rate) for rate in recorded.rates]
    events = [enclosures.excess_scaled(factor, u) for _, factor, u in recorded.events]
    text = filled(
        HIDDEN, unpack=writer.all_unpacked, boxes=listed(f"box_{s}" for s in writer.states),
        lines="\n".join(enclosures.lines.text),
        rates=listed(e or "0.0 * side" for e in rates), events=listed(e or "0.0 * side" for e in events),
    )  # fmt: skip
    return text, [e is not None for e in rates], [e is not None for e in events]
