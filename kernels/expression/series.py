"""An expression's values, and its Taylor coefficients by the recurrences of each operation.

With u = sum u_k t^k, and u' = (k + 1) u_{k+1}:
    (u w)_k = sum_j u_j w_{k-j},  (u^2/2)_k = sum_{j<k/2} u_j u_{k-j} + u_{k/2}^2/2
    (u/w)_k = (u_k - sum_{j>0} w_j (u/w)_{k-j})/w_0
    r = sqrt(u):  r_k = (u_k - sum_{0<j<k} r_j r_{k-j})/(2 r_0)
    e = exp(u):   k e_k = sum_{j>0} j u_j e_{k-j}
    l = ln(u):    u_0 l_k = u_k - (1/k) sum_{0<j<k} j l_j u_{k-j}
    k sin(u)_k = sum_{j>0} j u_j cos(u)_{k-j},  k cos(u)_k = -sum_{j>0} j u_j sin(u)_{k-j}
    f(u, ...):    k f_k = sum over the arguments of sum_{j>0} j u_j g_{k-j},  g the derivative of f by u (`partials`)
    b = u^n:      k u_0 b_k = sum_{j>0} ((n + 1) j - k) u_j b_{k-j}                                      (1)
and of a state, whose rate is r: u_{k+1} = r_k/(k + 1).
Source: Jorba & Zou, Exp. Math. 14:99 (2005), proposition 2.1. Sums are chains of multiply-adds (`dot`).
"""

from kernels.expression.graph import INPUT, NUMBER, SCALED
from kernels.expression.tangent import partials
from kernels.lanes import vectors
from kernels.lanes.symbols import taking_symbols
from kernels.maths import elementary

V, F = taking_symbols(vectors), taking_symbols(elementary)


class Values:
    """Values of expressions, numbers or symbols (`lanes.symbols`); each is computed once, when it is first asked for.

    A coefficient that is 0 for every motion is None.

    Parameters
    ----------
    inputs : dict from the name of an input to its value
    rates : dict from the name of a state to the expression of its rate, for coefficients above the 0th; None: 0
    cores : constants that stand for the powers of a state's abs, where they are not below 0; () where there are none
    precomputed : dict from an expression to its value, where there is one

    `known` holds what has been computed, `asked` what has been asked for, by the number of the node and which of it.
    """

    def __init__(self, inputs, rates=None, cores=(), precomputed=None):
        self.inputs, self._rates, self._cores = inputs, rates or {}, cores
        self.known = {(x.index, 0): value for x, value in (precomputed or {}).items()}
        self.asked = set()

    def value(self, x):
        """An expression's value."""
        return self.coefficient(x, 0)

    def in_every_lane(self, x):
        """The value; a plain number is repeated in every lane, or a tuple of both could not be looped over."""
        value = self.value(x)
        return 0.0 * self.inputs["side"] + value if x.of_numbers else value

    def coefficient(self, x, k):
        """The k-th Taylor coefficient; None where it is 0 for every motion."""
        return self._once((x.index, k), lambda: None if k and not x.varies else self._computed(x, k))

    def coefficients(self, x, order):
        """A tuple of the coefficients up to `order`."""
        found = (self.coefficient(x, k) for k in range(order + 1))
        return tuple(0.0 if c is None else c for c in found)

    def _once(self, key, compute):
        self.asked.add(key)
        if key not in self.known:
            self.known[key] = None
            self.known[key] = compute()
        return self.known[key]

    def _computed(self, x, k):
        if x.kind == NUMBER:
            return x.args[0]
        if x.kind != INPUT:
            return getattr(self, f"_{x.kind}")(x, k)
        if k == 0:
            return self.inputs[x.args[0]]
        rate = self._rates[x.args[0]]  # 1/k goes into its constants, which are multiplied once for many steps
        return None if rate is None else self.coefficient(x.graph.timed(rate, x.graph.of(1.0 / k)), k - 1)

    def _add(self, x, k):
        u, w = x.args
        if u.kind != SCALED:
            u, w = w, u
        if u.kind == SCALED:
            scaled, other = self.coefficient(u.args[1], k), self.coefficient(w, k)
            if scaled is not None and other is not None:
                return V.fma(self.value(u.args[0]), scaled, other)
            return other if scaled is None else self.value(u.args[0]) * scaled
        return added(self.coefficient(u, k), self.coefficient(w, k))

    def _scaled(self, x, k):
        return product(self.coefficient(x.args[1], k), self.value(x.args[0]))

    def _mul(self, x, k):
        u, w = x.args
        return self._sum((self.coefficient(u, j), self.coefficient(w, k - j)) for j in _oldest_first(0, k, k))

    def _half_square(self, x, k):
        u = x.args[0]
        pairs = []
        if k % 2 == 0 and (middle := self.coefficient(u, k // 2)) is not None:
            pairs.append((self._once((u.index, k // 2, "half"), lambda: 0.5 * middle), middle))
        pairs += [(self.coefficient(u, j), self.coefficient(u, k - j)) for j in reversed(range((k + 1) // 2))]
        return self._sum(pairs)

    def _div(self, x, k):
        u, w = x.args
        if not w.varies:
            return self.value(u) / self.value(w)
        over = self._over(w)
        if k == 0:
            return self.value(u) * over
        rest = self._sum((self.coefficient(w, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k, k))
        return product(difference(self.coefficient(u, k), rest), over)

    def _sqrt(self, x, k):
        u = x.args[0]
        if k == 0:
            return V.sqrt(self.value(u))
        own = self._sum((self.coefficient(x, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k - 1, k))
        half_over = self._once((x.index, "half over"), lambda: 0.5 / self.value(x))
        return product(difference(self.coefficient(u, k), own), half_over)

    def _exp(self, x, k):
        return product(self._rate_sum(x.args[0], x, k), 1.0 / k) if k else F.exp_or_nan(self.value(x.args[0]))

    def _log(self, x, k):
        u = x.args[0]
        if k == 0:
            return F.log(self.value(u))
        own = self._sum((self._rate(x, j), self.coefficient(u, k - j)) for j in _oldest_first(1, k - 1, k))
        return product(difference(self.coefficient(u, k), product(own, 1.0 / k)), self._over(u))

    def _sin(self, x, k):
        if k == 0:
            return F.sincos(self.value(x.args[0]))[0]
        return product(self._rate_sum(x.args[0], x.graph.function("cos", x.args[0]), k), 1.0 / k)

    def _cos(self, x, k):
        if k == 0:
            return F.sincos(self.value(x.args[0]))[1]
        return product(self._rate_sum(x.args[0], x.graph.function("sin", x.args[0]), k), -1.0 / k)

    def _of_slopes(self, x, k):
        if k == 0:
            return getattr(F, x.kind)(*map(self.value, x.args))
        sums = [self._rate_sum(u, slope, k) for u, slope in partials(x)[0] if u.varies]
        return product(added(*sums), 1.0 / k)

    _tanh = _arctan = _arcsin = _arccos = _sinh = _cosh = _hypot = _of_slopes

    def _floor(self, x, k):
        values = map(self.value, x.args)
        return F.floor_between(*values) if len(x.args) > 1 else F.floor(*values)

    def _power(self, x, k):
        u, n = x.args
        return self._power_by_parts(x, u, k, self._over(u)) if k else F.power(self.value(u), self.value(n))

    def _power_of_side(self, x, k):
        """abs(u)^n, of which the sign of u leaves the recurrence as it is; constant in its core, and at u = 0."""
        (_, u), i = x.args[0].args, x.graph.powers[x]
        if k:
            return self._power_by_parts(x, u, k, self._over_base(x))
        plain = F.power(*map(self.value, x.args))
        return V.where(self._cores[i] < 0.0, plain, self._cores[i]) if self._cores else plain

    def _power_over_base(self, x, k):
        """abs(u)^n/u by the recurrence of a quotient; 0 in its core, and at u = 0."""
        (power,) = x.args
        u = power.args[0].args[1]
        over, top = self._over_base(power), self.coefficient(power, k)
        rest = self._sum((self.coefficient(u, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k, k))
        return product(difference(top, rest), over)

    def _over(self, u):
        return self._once((u.index, "over"), lambda: 1.0 / self.value(u))

    def _over_base(self, x):
        """1/u of a power of abs(u), 0 where the power is a constant."""
        (_, u), i = x.args[0].args, x.graph.powers[x]

        def over():
            moves = self._cores[i] < 0.0 if self._cores else self.value(x.args[0]) > 0.0
            return V.where(moves, 1.0 / self.value(u), 0.0)

        return self._once((u.index, f"over {i}"), over)

    def _power_by_parts(self, x, u, k, over):
        """b_k of (1): what u_k and b_{k-1} bring is added last, so that the recurrence waits for two sums a step."""
        first, between = self.coefficient(u, 1), _oldest_first(2, k - 1, k)

        def one_more():
            return self._once((x.args[1].index, "and one"), lambda: self.value(x.args[1]) + 1.0)

        rates = self._sum((self._rate(u, j), self.coefficient(x, k - j)) for j in between)
        plain = self._sum((self.coefficient(u, j), self.coefficient(x, k - j)) for j in between)
        total = None if rates is None else V.fma(one_more() * (1.0 / k), rates, -plain) * over
        if k > 1 and first is not None and (before := self.coefficient(x, k - 1)) is not None:
            slope = self._once((x.index, "slope"), lambda: first * over)
            steep = self._once((x.index, "steep"), lambda: one_more() * slope)
            factor = V.fma(steep, 1.0 / k, -slope)  # ((n + 1)/k - 1) u_1/u_0
            total = factor * before if total is None else V.fma(factor, before, total)
        per_base = self._once((x.index, "per base"), lambda: self.value(x.args[1]) * self.value(x) * over)
        if (newest := self.coefficient(u, k)) is not None:
            total = per_base * newest if total is None else V.fma(per_base, newest, total)
        return total

    def _abs(self, x, k):
        return V.magnitude(self.value(x.args[0]))

    def _sign(self, x, k):
        value = self.value(x.args[0])
        return V.where(value < 0.0, -1.0, V.where(value > 0.0, 1.0, 0.0))

    def _chosen(self, x, k):
        sign, this, other = map(self.value, x.args)
        return V.where(sign > 0.0, this, other)

    def _rate(self, x, j):
        """j x_j."""
        if j == 1:
            return self.coefficient(x, 1)
        return self._once((x.index, j, "rate"), lambda: product(self.coefficient(x, j), float(j)))

    def _rate_sum(self, u, x, k):
        """sum over j > 0 of j u_j x_{k-j}."""
        return self._sum((self._rate(u, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k, k))

    @staticmethod
    def _sum(pairs):
        """The sum of products; None where every product is 0."""
        pairs = [pair for pair in pairs if pair[0] is not None and pair[1] is not None]
        if len(pairs) < 2:
            return pairs[0][0] * pairs[0][1] if pairs else None
        return V.dot(*zip(*pairs, strict=True))


def added(*terms):
    """The sum of what is not None; None where there is nothing."""
    total, *others = [x for x in terms if x is not None] or [None]
    for x in others:
        total = total + x
    return total


def difference(x, y):
    """x - y, either of which may be None: 0."""
    return x if y is None else -y if x is None else x - y


def product(x, factor):
    """x times a factor; None where x is."""
    return None if x is None else x * factor


def _oldest_first(first, last, k):
    """Indices j of u_j w_{k-j}: of coefficients long known first, so that no sum waits for the newest."""
    return sorted(range(first, last + 1), key=lambda j: max(j, k - j))
