"""The expression graph of a right-hand side: the recorded operations of a plain Python function on scalars.

A function called once with recording objects instead of numbers leaves a graph of its operations; equal operations
are recorded once. An expression is a *series* where it varies along the motion, else a *constant*, computed once. A
product keeps its constants apart, `scaled(constant, series)`: c v abs(v) is (2 c s)(v v/2) with the sign s of v, and
half a square needs the fewest operations.

abs(u) and sign(u) bend or jump where u = 0: each such u is a *kink*. Between kinks the sign of u is a constant, an
input of the graph; an integrator stops at a kink and changes the sign. floor(u) has kinks where sin(pi u) = 0, whose
sign tells whether the integer is even. States whose rates are 0 are *held*: they are constant between two switches and
have no kinks, and abs, sign and floor of them are those of a number, also at 0.
"""

import functools
import math
import sys
from dataclasses import dataclass
from numbers import Real

FLOAT_MAX = sys.float_info.max
NUMBER, INPUT, ADD, MUL, HALF_SQUARE, SCALED, DIV = "number", "input", "add", "mul", "half_square", "scaled", "div"
CHOSEN = "chosen"


FUNCTIONS = (
    "use + - * / ** % // abs and sqrt, exp, log, sin, cos, tan, arcsin, arccos, arctan, sinh, cosh, tanh, hypot, "
    "power, sign, floor, mod, maximum, minimum, where of kernels.scene or numpy"
)
INSTEAD = "say it with where(x > y, a, b), maximum, minimum, abs, sign or side"


class SceneError(ValueError):
    """A scene that cannot be compiled, and why."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """That an expression is above 0, or that it is not, for `where`."""

    above: "Expression"
    negated: bool = False

    def __array_function__(self, function, types, arguments, named):
        return self.above.__array_function__(function, types, arguments, named)

    def __bool__(self):
        raise SceneError(f"it compares values to branch on them, which is not recorded; {INSTEAD}")


@dataclass(frozen=True, eq=False, repr=False)
class Expression:
    """One operation; `args` are expressions, a number, or a name."""

    graph: "Graph"
    kind: str
    args: tuple
    varies: bool
    index: int

    @functools.cached_property
    def of_numbers(self):
        """Whether no input is in it."""
        return self.kind != INPUT and all(a.of_numbers for a in self.args if isinstance(a, Expression))

    def __repr__(self):
        return self.args[0] if self.kind == INPUT else f"<an expression: {self.kind}>"

    __hash__ = object.__hash__

    def __eq__(self, other):
        raise SceneError(f"it tests two values for equality, which cannot be recorded; {INSTEAD}")

    def __bool__(self):
        raise SceneError(f"it branches on a value, which is not recorded; {INSTEAD}")

    def __float__(self):
        raise SceneError("it calls a function of plain numbers (a cast, or math's) with a value; " + FUNCTIONS)

    def __array_ufunc__(self, ufunc, method, *inputs, **named):
        """numpy's functions that have a counterpart here; also what numpy makes of a product with its numbers."""
        return _of_numpy(ufunc, method != "__call__" or named)(*map(self.graph.of, inputs))

    def __array_function__(self, function, types, arguments, named):
        """numpy's functions that are none of single numbers: where, clip."""
        return _of_numpy(function, named)(*arguments)


for _name, _operator in {
    "add": lambda x, y: x.graph.add(x, y),
    "sub": lambda x, y: x.graph.add(x, -x.graph.of(y)),
    "rsub": lambda x, y: x.graph.add(y, -x),
    "mul": lambda x, y: x.graph.multiply(x, y),
    "truediv": lambda x, y: x.graph.divide(x, y),
    "rtruediv": lambda x, y: x.graph.divide(y, x),
    "mod": lambda x, y: mod(x, y),
    "rmod": lambda x, y: mod(y, x),
    "floordiv": lambda x, y: floor(x / y),
    "rfloordiv": lambda x, y: floor(y / x),
    "pow": lambda x, y: x.graph.power(x, y),
    "rpow": lambda x, y: x.graph.power(y, x),
    "neg": lambda x: x.graph.multiply(-1.0, x),
    "pos": lambda x: x,
    "abs": lambda x: x.graph.magnitude(x),
    "floor": lambda x: floor(x),
    "gt": lambda x, y: Comparison(x - y),
    "lt": lambda x, y: Comparison(y - x),
    "ge": lambda x, y: Comparison(y - x, negated=True),
    "le": lambda x, y: Comparison(x - y, negated=True),
}.items():
    setattr(Expression, f"__{_name}__", _operator)
Expression.__radd__, Expression.__rmul__ = Expression.__add__, Expression.__mul__


class Graph:
    """Expressions over named inputs, each recorded once, in the order in which they can be computed.

    `kinks` are the series whose signs are inputs ".sign_0", ".sign_1", ..., with their numbers; `powers` are those of
    abs(u), u a state, which have no series at u = 0, with theirs. `held` are the names of the states that are held, of
    which constants are inputs ".held_u"; `judged` what the signs of such constants are taken of; `surfaces` the numbers
    of the kinks that are further surfaces, once these are recorded.
    """

    def __init__(self, held=()):
        self.nodes = []
        self.kinks = {}
        self.powers = {}
        self.held = held
        self.judged = {}
        self.surfaces = ()
        self._known = {}

    def _node(self, kind, args, varies):
        key = (kind, *(a.index if isinstance(a, Expression) else repr(a) for a in args))
        if key not in self._known:
            self._known[key] = Expression(self, kind, args, varies, len(self.nodes))
            self.nodes.append(self._known[key])
        return self._known[key]

    def series(self, name):
        """An input that varies along the motion: a state."""
        return self._node(INPUT, (name,), True)

    def constant(self, name):
        """An input that does not vary between two events: a parameter, the side, a sign."""
        return self._node(INPUT, (name,), False)

    def of(self, value):
        """The value as an expression. Raises SceneError for what is none."""
        if isinstance(value, Expression):
            if value.graph is not self:
                raise SceneError(f"{value!r} belongs to another call of the scene's functions")
            return value
        if getattr(value, "shape", None) == ():
            value = value.item()  # a number of numpy's
        if not isinstance(value, Real):
            raise SceneError(f"expected a number or an expression, found {value!r}")
        if not abs(value) <= FLOAT_MAX:
            raise SceneError(f"{str(value)[:40]} is outside the range of float64")
        return self._node(NUMBER, (float(value),), False)

    def parts(self, x):
        """The constant and the series of a product: x = constant * series; the series is 1 where x is constant."""
        if x.kind == SCALED:
            return x.args
        return (self.of(1.0), x) if x.varies else (x, self.of(1.0))

    def add(self, x, y):
        x, y = self.of(x), self.of(y)
        if x.kind == y.kind == NUMBER:
            return self.of(x.args[0] + y.args[0])
        if _is(x, 0.0) or _is(y, 0.0):
            return y if _is(x, 0.0) else x
        return self._node(ADD, _ordered(x, y), x.varies or y.varies)

    def multiply(self, x, y):
        x, y = self.of(x), self.of(y)
        if x.varies or y.varies:
            (c, u), (d, w) = self.parts(x), self.parts(y)
            if u is w and u.varies:
                return self._scaled(self._plain(self._plain(c, d), self.of(2.0)), self._node(HALF_SQUARE, (u,), True))
            return self._scaled(self._plain(c, d), self._plain(u, w))
        return self._plain(x, y)

    def _plain(self, x, y):
        """A product of two constants, or of two series without constants."""
        if x.kind == y.kind == NUMBER:
            return self.of(x.args[0] * y.args[0])
        if _is(x, 1.0) or _is(y, 1.0):
            return y if _is(x, 1.0) else x
        return self._node(MUL, _ordered(x, y), x.varies)

    def _scaled(self, constant, series):
        if not series.varies:
            return self._plain(constant, series)
        return series if _is(constant, 1.0) else self._node(SCALED, (constant, series), True)

    def divide(self, x, y):
        x, y = self.of(x), self.of(y)
        if _is(y, 0.0):
            raise SceneError("it divides by 0")
        if x.kind == y.kind == NUMBER:
            return self.of(x.args[0] / y.args[0])
        (c, u), (d, w) = self.parts(x), self.parts(y)
        constant = c if _is(d, 1.0) else self._node(DIV, (c, d), False)
        return self._scaled(constant, u if _is(w, 1.0) else self._node(DIV, (u, w), True))

    def function(self, name, *args):
        """A function that has its name as its kind."""
        args = tuple(map(self.of, args))
        if name == "sqrt" and self._is_side(args[0]):
            return self.power(args[0], 0.5)
        return self._node(name, args, name != "floor" and any(x.varies for x in args))

    def chosen(self, sign, x, y):
        """x where a constant sign is above 0, else y, whatever the other one is; no series is taken of it."""
        return x if x is y else self.function(CHOSEN, sign, x, y)

    def floor(self, x):
        """The largest integer not above x: between two kinks a constant."""
        x = self.of(x)
        constant = self._constant_if_held(x)
        if constant is not x:  # how far from a whole number
            self._judge(constant - self.function("floor", constant + 0.5))
        if not constant.varies:
            return self.function("floor", constant)
        return self.function("floor", x, self.side_of(self.function("sin", math.pi * x)))

    def power(self, x, exponent):
        """x^exponent, the exponent a constant; by products where it is a small integer. x > 0 otherwise."""
        x = self.of(x)
        if isinstance(exponent, int) and abs(exponent) <= 8:
            product = self.of(1.0)
            for _ in range(abs(exponent)):
                product = product * x
            return product if exponent >= 0 else 1.0 / product
        exponent = self.of(exponent)
        if exponent.varies:
            raise SceneError("the exponent of a power must not vary along the motion; use exp and log")
        if self._is_side(x):
            return self._power_of_side(x, exponent)
        return self._node("power", (x, exponent), x.varies)

    def _is_side(self, x):
        """Whether it is a constant times a state that has a kink, as abs(state) is."""
        return x.kind == SCALED and x.args[1].kind == INPUT and x.args[1] in self.kinks

    def _power_of_side(self, x, exponent):
        """(c s u)^n = c^n (s u)^n, s the sign of u."""
        constant, u = x.args
        side = self.side_of(u)
        node = self._node("power_of_side", (self._scaled(side, u), exponent), True)
        self.powers.setdefault(node, len(self.powers))
        if constant is side:
            return node
        return self.multiply(self._node("power", (self._plain(constant, side), exponent), False), node)

    def over_base(self, power):
        """abs(u)^n/u of a power of a state's abs; 0 where that is a constant (`integrate.powers`)."""
        return self._node("power_over_base", (power,), True)

    def magnitude(self, x):
        c, u = self.parts(self.of(x))
        if not u.varies:
            return self._node("abs", (c,), False)
        return self._node("abs", (c,), False) * self.side_of(u) * u if not _is(c, 1.0) else self.side_of(u) * u

    def sign(self, x):
        c, u = self.parts(self.of(x))
        if not u.varies:
            return self._node("sign", (c,), False)
        return self.side_of(u) if _is(c, 1.0) else self._node("sign", (c,), False) * self.side_of(u)

    def side_of(self, u):
        """The sign of a series, constant between kinks."""
        constant = self._constant_if_held(u)
        if constant is u:
            opposite = self.add(*map(self._opposite, u.args)) if u.kind == ADD else None  # y - x, of x - y
            return -self.kink(opposite) if opposite in self.kinks else self.kink(u)
        return self.function("sign", self._judge(constant))

    def _opposite(self, x):
        """-x, of which the opposite is x again."""
        if x.kind == MUL and any(_is(factor, -1.0) for factor in x.args):
            return x.args[_is(x.args[0], -1.0)]
        return self._opposite(x.args[0]) * x.args[1] if x.kind == SCALED else -x

    def kink(self, u):
        """The sign of a series, whose 0 is located; of a further surface, in a switch, by its value where not met."""
        number = self.kinks.setdefault(u, len(self.kinks))
        sign = self.constant(f".sign_{number}")
        if number in self.surfaces:
            return self.chosen(sign, self.of(1.0), self.function("sign", self._at_once(u)))
        return sign

    def _at_once(self, x):
        """A constant: what varies, as it is at this moment."""
        states = [s.args[0] for s in needed(x) if s.kind == INPUT and s.varies]
        return self.again(x, {name: self.constant(f".held_{name}") for name in states})

    def _judge(self, constant):
        return self.judged.setdefault(constant, constant)

    def _constant_if_held(self, x):
        """A constant in the place of what varies by states alone that are held."""
        if not (self.held and x.varies and holds(x, self.held)):
            return x
        return self.again(x, {name: self.constant(f".held_{name}") for name in self.held})

    def again(self, x, inputs, done=None):
        """An expression, of any graph, with what is in the dict `inputs` in the place of inputs of these names.

        `done` : a dict of what has been replaced already, by the node's number
        """
        done = {} if done is None else done
        made = {ADD: self.add, MUL: self.multiply, SCALED: self.multiply, DIV: self.divide, "power": self.power}
        made |= {"abs": self.magnitude, "sign": self.sign, HALF_SQUARE: lambda u: 0.5 * u * u}
        if x.index not in done:
            if x.kind in (NUMBER, INPUT):
                done[x.index] = self.of(inputs.get(x.args[0], x) if x.kind == INPUT else x.args[0])
            else:
                args = [self.again(a, inputs, done) for a in x.args]
                done[x.index] = made[x.kind](*args) if x.kind in made else self.function(x.kind, *args)
        return done[x.index]

    def timed(self, x, unit):
        """x times a constant, which in a sum of series goes into their constants and costs nothing there."""
        if x.kind == ADD and x.varies:
            return self.add(*(self.timed(term, unit) for term in x.args))
        return self.multiply(unit, x)


def _is(x, number):
    return x.kind == NUMBER and x.args[0] == number


def _ordered(x, y):
    return (x, y) if x.index <= y.index else (y, x)


def needed(*roots):
    """The nodes that the roots hang on, themselves included, in the order of computation."""
    found, waiting = {}, list(roots)
    while waiting:
        node = waiting.pop()
        if node.index not in found:
            found[node.index] = node
            waiting += [a for a in node.args if isinstance(a, Expression)]
    return [found[i] for i in sorted(found)]


def holds(x, held):
    """Whether of the states in an expression all are among those that are held."""
    return all(node.args[0] in held for node in needed(x) if node.kind == INPUT and node.varies)


def _function(name, of_number):
    def call(*args):
        graph = next((x.graph for x in args if isinstance(x, Expression)), None)
        return graph.function(name, *args) if graph else of_number(*args)

    call.__name__ = name
    call.__doc__ = f"{name} of numbers or of what a scene's function is called with."
    return call


sqrt, exp, log, sin, cos, sinh, cosh, tanh, hypot = (
    _function(name, getattr(math, name))
    for name in ("sqrt", "exp", "log", "sin", "cos", "sinh", "cosh", "tanh", "hypot")
)
arcsin, arccos, arctan = (_function(f"arc{name}", getattr(math, f"a{name}")) for name in ("sin", "cos", "tan"))
pi = math.pi


def tan(x):
    """sin(x)/cos(x)."""
    return sin(x) / cos(x)


def floor(x):
    """The largest integer that is not above x; where x passes an integer a kink."""
    return x.graph.floor(x) if isinstance(x, Expression) else math.floor(x)


def mod(x, divisor):
    """x - divisor floor(x/divisor), between 0 and the divisor; a kink where it jumps."""
    return x - divisor * floor(x / divisor)


def power(x, exponent):
    """x^exponent for x > 0 and an exponent that does not vary along the motion; also abs(u)^exponent of a state u."""
    graph = next((part.graph for part in (x, exponent) if isinstance(part, Expression)), None)
    return graph.power(x, exponent) if graph else x**exponent


def sign(x):
    """-1 or 1: the side of 0 on which x is; where x passes 0 a kink. 0 only for a constant 0."""
    return x.graph.sign(x) if isinstance(x, Expression) else math.copysign(1.0, x) if x else 0.0


def where(condition, x, y):
    """x where the condition, `a > b` or the like, holds, else y; a kink where a is b. x and y must be finite."""
    if not isinstance(condition, Comparison):
        return x if condition else y
    return _chosen(condition.above, y, x) if condition.negated else _chosen(condition.above, x, y)


def maximum(x, y):
    """The larger of two values; where they are equal a kink."""
    return _chosen(x - y, x, y)


def minimum(x, y):
    """The smaller of two values; where they are equal a kink."""
    return _chosen(y - x, x, y)


def _chosen(above, x, y):
    """x where `above` is above 0, else y: exact, for the share of each is 0 or 1."""
    side = sign(above)
    share = 0.5 * side * (1.0 + side)
    return share * x + (1.0 - share) * y


NAMED = {
    f.__name__: f
    for f in (sqrt, exp, log, sin, cos, tan, arcsin, arccos, arctan, sinh, cosh, tanh, hypot, floor, maximum, minimum)
}
_OF_NUMPY = NAMED | {
    "add": lambda x, y: x + y, "subtract": lambda x, y: x - y, "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y, "power": power, "float_power": power, "negative": lambda x: -x, "absolute": abs,
    "fabs": abs, "square": lambda x: x * x, "sign": sign, "ceil": lambda x: -floor(-x), "remainder": mod,
    "floor_divide": lambda x, y: floor(x / y), "reciprocal": lambda x: 1.0 / x,
    "greater": lambda x, y: x > y, "less": lambda x, y: x < y,
    "greater_equal": lambda x, y: x >= y, "less_equal": lambda x, y: x <= y,
    "where": where, "clip": lambda x, low, high: minimum(maximum(x, low), high),
}  # fmt: skip


def _of_numpy(function, options):
    """What stands for a function of numpy's, which is called with no options."""
    if options or function.__name__ not in _OF_NUMPY:
        raise SceneError(f"numpy's {function.__name__} is not recorded; {FUNCTIONS}")
    return _OF_NUMPY[function.__name__]
