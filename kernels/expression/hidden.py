"""Bounds, by interval arithmetic, on variations of the rates within a step that neither series nor stages may see.

A pulse such as exp(-((t - 20)/w)^2) is 0 to all digits at t = 0, and so are its derivatives: a series at t = 0 does not
contain it, and stages within the step can miss it. Interval arithmetic (`intervals`) over the box of states that a step
passes cannot. Operations other than polynomials may change by the factor `CHANGE` within the step; if one may change by
more, its complete variation E counts as hidden. By the mean value theorem it propagates as
    u + w: E_u + E_w,  u w: |w| E_u + |u| E_w,  u/w: (E_u + |u/w| E_w)/|w|,  f(u): |f'(u)| E_u            (1)
over the box. Small hidden variations are accepted; large ones are approached by shorter steps.
"""

import math

from kernels.expression.graph import ADD, DIV, HALF_SQUARE, INPUT, MUL, SCALED
from kernels.expression.series import F, V, Values, added
from kernels.expression.tangent import partials
from kernels.lanes.symbols import taking_symbols
from kernels.maths import intervals

OF = taking_symbols(intervals)
BY_ENDS = "tanh", "arctan", "sinh"
"""Functions that rise everywhere."""


class Enclosures:
    """Intervals of expressions in a box, and what these hide; each is computed when it is first asked for.

    Parameters
    ----------
    inputs : dict from the name of an input to its value
    boxes : dict from the name of a state to its interval
    """

    def __init__(self, inputs, boxes):
        self.values, self._boxes, self._reused = Values(inputs), boxes, {}

    def interval(self, x):
        """An expression's interval."""
        return self._once(x, self._interval)

    def excess(self, x):
        """What an expression hides; None where that is nothing."""
        return self._once(x, self._excess)

    def _once(self, x, compute):
        key = x.index, compute.__name__
        if key not in self._reused:
            self._reused[key] = compute(x)
        return self._reused[key]

    def _interval(self, x):
        if x.kind == INPUT and x.varies:
            return self._boxes[x.args[0]]
        if not x.varies:
            return self.values.value(x), self.values.value(x)
        plain, excess = self._once(x, self._plain), self.excess(x)
        return plain if excess is None else OF.widened(plain, excess)

    def _plain(self, x):
        """The interval of an operation, but for what the operation itself hides."""
        if x.kind == "power_over_base":
            return -math.inf, math.inf
        first = self.interval(x.args[0])
        if x.kind in ("power", "power_of_side"):
            return OF.of_power(first, self.values.value(x.args[1]))
        if x.kind in BY_ENDS:
            return tuple(getattr(F, x.kind)(first[end]) for end in (0, 1))
        others = [self.interval(u) for u in x.args[1:]]
        if x.kind == DIV:
            return OF.multiplied(first, OF.over(*others))
        of_kind = {ADD: OF.added, MUL: OF.multiplied, SCALED: OF.multiplied, HALF_SQUARE: OF.half_squared}
        return (of_kind[x.kind] if x.kind in of_kind else getattr(OF, f"of_{x.kind}"))(first, *others)

    def _excess(self, x):
        # powers are for `integrate.powers`, from kink to kink
        if not x.varies or x.kind in (INPUT, "power_of_side", "power_over_base"):
            return None
        u, *others = x.args
        if x.kind in (ADD, "sin", "cos"):
            return added(*map(self.excess, x.args))
        if x.kind == SCALED:
            return self.excess_scaled(*x.args)
        if x.kind == MUL:
            return added(self._passed_on(u, self._largest(*others)), self._passed_on(*others, self._largest(u)))
        if x.kind == HALF_SQUARE:
            return self._passed_on(u, self._largest(u))
        if x.kind == "hypot":
            own = OF.hidden_by_hypot(self.values.value(x), self._once(x, self._plain))
            return added(own, *map(self.excess, x.args))
        if x.kind == DIV:
            divisor, plain = self.interval(*others), self._once(x, self._plain)
            moved = added(self.excess(u), self._passed_on(*others, OF.largest(plain)))
            own = OF.hidden_by_over(self.values.value(*others), divisor, plain)
            return added(own, moved if moved is None else OF.times(moved, 1.0 / OF.smallest(divisor)))
        return self._excess_of_function(x, u, self.values.value(u), self.interval(u), *others)

    def _excess_of_function(self, x, u, value, inside, n=None):
        """Its own, and what its argument's comes to by the slope where that is largest."""
        if x.kind == "exp":
            return added(OF.hidden_by_exp(value, inside), self._passed_on(u, self._once(x, self._plain)[1]))
        if x.kind in ("sqrt", "log"):
            own, least = OF.hidden_by_root(value, inside, self._once(x, self._plain)), OF.above(inside)[0]
            return added(own, self._passed_on(u, 0.5 / V.sqrt(least) if x.kind == "sqrt" else 1.0 / least))
        if x.kind == "power":
            plain, n = self._once(x, self._plain), self.values.value(n)
            own = OF.hidden_by_power(value, self.values.value(x), inside, plain)
            return added(own, self._passed_on(u, V.magnitude(n) * plain[1] / OF.above(inside)[0]))
        if x.kind in ("sinh", "cosh"):
            own = OF.hidden_by_sinh(value, inside)
        else:
            kind = "arcsin" if x.kind == "arccos" else x.kind
            own = getattr(OF, f"hidden_by_{kind}")(value, inside, self._once(x, self._plain))
        slopes = partials(x)[0]
        return added(
            own, *(self._passed_on(u, self._largest(slope)) for u, slope in slopes if self.excess(u) is not None)
        )

    def _passed_on(self, x, factor):
        """What x hides times what the result changes by per unit of x; None where x hides nothing."""
        return None if self.excess(x) is None else OF.times(self.excess(x), factor)

    def _largest(self, x):
        return OF.largest(self.interval(x))

    def excess_scaled(self, constant, u):
        """What a constant times an expression hides."""
        return self._passed_on(u, V.magnitude(self.values.value(constant)))
