"""Source text from an expression graph: its values, and its Taylor coefficients by the recurrences of each operation.

With u = sum u_k t^k, and u' = (k + 1) u_{k+1}:
    (u w)_k = sum_j u_j w_{k-j},  (u^2/2)_k = sum_{j<k/2} u_j u_{k-j} + u_{k/2}^2/2
    (u/w)_k = (u_k - sum_{j>0} w_j (u/w)_{k-j})/w_0
    r = sqrt(u):  r_k = (u_k - sum_{0<j<k} r_j r_{k-j})/(2 r_0)
    e = exp(u):   k e_k = sum_{j>0} j u_j e_{k-j}
    l = ln(u):    u_0 l_k = u_k - (1/k) sum_{0<j<k} j l_j u_{k-j}
    k sin(u)_k = sum_{j>0} j u_j cos(u)_{k-j},  k cos(u)_k = -sum_{j>0} j u_j sin(u)_{k-j}
    f(u, ...):    k f_k = sum over the arguments of sum_{j>0} j u_j g_{k-j},  g the derivative of f by u (`slopes`)
    b = u^n:      k u_0 b_k = sum_{j>0} ((n + 1) j - k) u_j b_{k-j}                                      (1)
and of a state, whose rate is r: u_{k+1} = r_k/(k + 1).
Source: Jorba & Zou, Exp. Math. 14:99 (2005), proposition 2.1. Sums are chains of multiply-adds (`dot`).
"""

from kernels.source_text.expression import INPUT, NUMBER, SCALED


class Lines:
    """Statements that compute expressions; each is written when it is first asked for.

    An expression's coefficient is told by a name, a literal, or None where it is 0.

    Parameters
    ----------
    names : dict from the name of an input to its name in the text
    rates : dict from the name of a state to the expression of its rate, for coefficients above the 0th; None: 0
    cores : whether constants core_0, core_1, ... stand for the powers of a state's abs, where they are not below 0
    precomputed : dict from an expression to the name of its value, where there is one
    """

    def __init__(self, names, rates=None, cores=False, precomputed=None):
        self.text = []
        self._names, self._rates, self._cores = names, rates or {}, cores
        self._reused = {(x.index, 0): name for x, name in (precomputed or {}).items()}

    def branch(self):
        """Further lines, apart from these, that take from them what they have."""
        other = Lines(self._names, self._rates, self._cores)
        other._reused = dict(self._reused)
        return other

    def value(self, x):
        """The name of an expression's value."""
        return self.coefficient(x, 0)

    def coefficient(self, x, k):
        """The name of the k-th Taylor coefficient; None where it is 0 for every motion."""
        if (x.index, k) not in self._reused:
            self._reused[x.index, k] = None if k and not x.varies else self._write(x, k)
        return self._reused[x.index, k]

    def coefficients(self, x, order):
        """A tuple of the coefficients up to `order`, as text."""
        names = [self.coefficient(x, k) or "0.0" for k in range(order + 1)]
        return f"({', '.join(names)},)"

    def _write(self, x, k):
        if x.kind == NUMBER:
            return repr(x.args[0])
        if x.kind == INPUT:
            return self._state(x, k) if k else self._names[x.args[0]]
        text = getattr(self, f"_{x.kind}")(x, k)
        return self._named(f"n{x.index}_{k}" if x.varies else f"n{x.index}", text) if text else None

    def _named(self, name, text):
        self.text.append(f"{name} = {text}")
        return name

    def _state(self, x, k):
        """1/k goes into the constants of the rate, which are multiplied once for many steps."""
        rate = self._rates[x.args[0]]
        rate = None if rate is None else self.coefficient(x.graph.timed(rate, x.graph.of(1.0 / k)), k - 1)
        return rate and self._named(f"{self._names[x.args[0]]}_{k}", rate)

    def _add(self, x, k):
        u, w = x.args
        if u.kind != SCALED:
            u, w = w, u
        if u.kind == SCALED:
            scaled, other = self.coefficient(u.args[1], k), self.coefficient(w, k)
            if scaled and other:
                return f"fma({self.value(u.args[0])}, {scaled}, {other})"
            return f"{self.value(u.args[0])} * {scaled}" if scaled else other
        return " + ".join(filter(None, (self.coefficient(u, k), self.coefficient(w, k))))

    def _scaled(self, x, k):
        series = self.coefficient(x.args[1], k)
        return series and f"{self.value(x.args[0])} * {series}"

    def _mul(self, x, k):
        u, w = x.args
        return self._sum((self.coefficient(u, j), self.coefficient(w, k - j)) for j in _oldest_first(0, k, k))

    def _half_square(self, x, k):
        u = x.args[0]
        pairs = []
        if k % 2 == 0 and self.coefficient(u, k // 2):
            middle = self.coefficient(u, k // 2)
            pairs.append((self._named(f"half_{middle}", f"0.5 * {middle}"), middle))
        pairs += [(self.coefficient(u, j), self.coefficient(u, k - j)) for j in reversed(range((k + 1) // 2))]
        return self._sum(pairs)

    def _div(self, x, k):
        u, w = x.args
        if not w.varies:
            return f"{self.value(u)} / {self.value(w)}"
        over = self._once(w, "over", "1.0 / {}")
        if k == 0:
            return f"{self.value(u)} * {over}"
        rest = self._sum((self.coefficient(w, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k, k))
        return self._times(self._difference(self.coefficient(u, k), rest), over)

    def _sqrt(self, x, k):
        u = x.args[0]
        if k == 0:
            return f"sqrt({self.value(u)})"
        own = self._sum((self.coefficient(x, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k - 1, k))
        return self._times(self._difference(self.coefficient(u, k), own), self._once(x, "half_over", "0.5 / {}"))

    def _exp(self, x, k):
        if k == 0:
            return f"exp({self.value(x.args[0])})"
        return self._times(self._rate_sum(x.args[0], x, k), repr(1.0 / k))

    def _log(self, x, k):
        u = x.args[0]
        if k == 0:
            return f"log({self.value(u)})"
        own = self._sum((self._rate(x, j), self.coefficient(u, k - j)) for j in _oldest_first(1, k - 1, k))
        own = own and f"{own} * {1.0 / k!r}"
        return self._times(self._difference(self.coefficient(u, k), own), self._once(u, "over", "1.0 / {}"))

    def _sin(self, x, k):
        if k == 0:
            return f"sincos({self.value(x.args[0])})[0]"
        return self._times(self._rate_sum(x.args[0], self._twin(x, "cos"), k), repr(1.0 / k))

    def _cos(self, x, k):
        if k == 0:
            return f"sincos({self.value(x.args[0])})[1]"
        return self._times(self._rate_sum(x.args[0], self._twin(x, "sin"), k), repr(-1.0 / k))

    @staticmethod
    def _twin(x, name):
        return x.graph.function(name, x.args[0])

    def _of_slopes(self, x, k):
        if k == 0:
            return f"{x.kind}({', '.join(map(self.value, x.args))})"
        sums = [self._rate_sum(u, slope, k) for u, slope in x.graph.slopes(x) if u.varies]
        return self._times(" + ".join(filter(None, sums)), repr(1.0 / k))

    _tanh = _arctan = _arcsin = _arccos = _sinh = _cosh = _hypot = _of_slopes

    def _floor(self, x, k):
        values = ", ".join(map(self.value, x.args))
        return f"floor_between({values})" if len(x.args) > 1 else f"floor({values})"

    def _power(self, x, k):
        u, n = x.args
        if k == 0:
            return f"power({self.value(u)}, {self.value(n)})"
        return self._power_by_parts(x, u, k, self._once(u, "over", "1.0 / {}"))

    def _power_of_side(self, x, k):
        """abs(u)^n, of which the sign of u leaves the recurrence as it is; constant in its core, and at u = 0."""
        (_, u), i = x.args[0].args, x.graph.powers[x]
        if k == 0:
            plain = f"power({self.value(x.args[0])}, {self.value(x.args[1])})"
            return f"where(core_{i} < 0.0, {plain}, core_{i})" if self._cores else plain
        return self._power_by_parts(x, u, k, self._over_base(x))

    def _power_over_base(self, x, k):
        """abs(u)^n/u by the recurrence of a quotient; 0 in its core, and at u = 0."""
        (power,) = x.args
        u = power.args[0].args[1]
        over, top = self._over_base(power), self.coefficient(power, k)
        rest = self._sum((self.coefficient(u, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k, k))
        return self._times(self._difference(top, rest), over)

    def _over_base(self, x):
        """1/u of a power of abs(u), 0 where the power is a constant."""
        (_, u), i = x.args[0].args, x.graph.powers[x]
        moves = f"core_{i} < 0.0" if self._cores else f"{self.value(x.args[0])} > 0.0"
        return self._once(u, f"over_{i}", f"where({moves}, 1.0 / {{}}, 0.0)")

    def _power_by_parts(self, x, u, k, over):
        """b_k of (1): what u_k and b_{k-1} bring is added last, so that the recurrence waits for two sums a step."""
        parts = [(self._once(x, "per_base", f"{self.value(x.args[1])} * {{}} * {over}"), self.coefficient(u, k))]
        if k > 1:
            parts.append((self._of_one_before(x, u, k, over), self.coefficient(x, k - 1)))
        total = self._times(self._power_between(x, u, k), over)
        for factor, term in reversed([(f, t) for f, t in parts if f and t]):
            total = f"fma({factor}, {term}, {total})" if total else f"{factor} * {term}"
        return total

    def _of_one_before(self, x, u, k, over):
        """The factor ((n + 1)/k - 1) u_1/u_0 of b_{k-1}; None where u_1 is 0."""
        first = self.coefficient(u, 1)
        if not first:
            return None
        slope = self._once(x, "slope", f"{first} * {over}")
        steep = self._once(x, "steep", f"{self._one_more(x)} * {slope}")
        return self._named(f"before_{x.index}_{k}", f"fma({steep}, {1.0 / k!r}, -{slope})")

    def _power_between(self, x, u, k):
        """The terms 1 < j < k of u_0 b_k."""
        between = _oldest_first(2, k - 1, k)
        rates = self._sum((self._rate(u, j), self.coefficient(x, k - j)) for j in between)
        plain = self._sum((self.coefficient(u, j), self.coefficient(x, k - j)) for j in between)
        return rates and f"fma({self._one_more(x)} * {1.0 / k!r}, {rates}, -({plain}))"

    def _one_more(self, x):
        """n + 1."""
        return self._once(x.args[1], "and_one", "{} + 1.0")

    def _abs(self, x, k):
        return f"magnitude({self.value(x.args[0])})"

    def _sign(self, x, k):
        value = self.value(x.args[0])
        return f"where({value} < 0.0, -1.0, where({value} > 0.0, 1.0, 0.0))"

    def _once(self, x, what, text):
        """A quantity of a value, written once."""
        if (x.index, what) not in self._reused:
            self._reused[x.index, what] = self._named(f"{what}_{x.index}", text.format(self.value(x)))
        return self._reused[x.index, what]

    def _rate(self, x, j):
        """j x_j."""
        if (x.index, j, "rate") not in self._reused:
            name = self.coefficient(x, j)
            self._reused[x.index, j, "rate"] = name and (
                name if j == 1 else self._named(f"{name}_rate", f"{float(j)!r} * {name}")
            )
        return self._reused[x.index, j, "rate"]

    def _rate_sum(self, u, x, k):
        """sum over j > 0 of j u_j x_{k-j}."""
        return self._sum((self._rate(u, j), self.coefficient(x, k - j)) for j in _oldest_first(1, k, k))

    @staticmethod
    def _sum(pairs):
        """The sum of products of names, as text; None where every product is 0."""
        pairs = [pair for pair in pairs if pair[0] and pair[1]]
        if len(pairs) < 2:
            return f"{pairs[0][0]} * {pairs[0][1]}" if pairs else None
        first, second = (", ".join(names) for names in zip(*pairs, strict=True))
        return f"dot(({first}), ({second}))"

    @staticmethod
    def _difference(x, y):
        return f"{x} - {y}" if x and y else x or (y and f"-({y})")

    @staticmethod
    def _times(x, factor):
        return x and f"({x}) * {factor}"


def _oldest_first(first, last, k):
    """Indices j of u_j w_{k-j}: of coefficients long known first, so that no sum waits for the newest."""
    return sorted(range(first, last + 1), key=lambda j: max(j, k - j))
