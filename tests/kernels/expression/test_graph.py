"""Recurrences of an expression graph, against mpmath's Taylor coefficients of the same function."""

import math

import mpmath
import pytest
from mpmath import mp

from kernels.expression import graph as E
from kernels.expression.series import Values
from kernels.expression.tangent import Tangents

ORDER = 9


def side(graph, kink):
    """1, as everything is above 0 here, or for the kink of a floor, sin(pi x), the sign of that."""
    return math.copysign(1.0, Values({"u": 0.7}).value(kink))


def coefficients(function, order=ORDER, **constants):
    """Taylor coefficients of function(u) for u = 0.7 + t - t^2/2 + t^3/5."""
    graph = E.Graph()
    u, rate, inner = graph.series("u"), graph.series("r"), graph.series("s")
    result = function(u, **{name: graph.constant(name) for name in constants})
    # u' = r, r' = s, s' = 6/5: a cubic
    rates = {"u": rate, "r": inner, "s": graph.of(1.2)}
    signs = {f".sign_{j}": side(graph, kink) for j, kink in enumerate(graph.kinks)}
    return Values({"u": 0.7, "r": 1.0, "s": -1.0} | constants | signs, rates).coefficients(result, order)


def true_coefficients(function, order=ORDER):
    with mp.workdps(40):
        return mpmath.taylor(lambda t: function(mp.mpf(0.7) + t - t * t / 2 + t**3 * mp.mpf(1.2) / 6), 0, order)


CASES = {
    "product": (lambda u: u * (3.0 - u) * 0.5, lambda u: u * (3 - u) / 2),
    "square": (lambda u: u * u - 2.0 * u, lambda u: u**2 - 2 * u),
    "cube": (lambda u: u**3 / 7.0, lambda u: u**3 / 7),
    "inverse": (lambda u: 1.0 / u, lambda u: 1 / u),
    "quotient": (lambda u: (u + 1.0) / (u * u + 2.0), lambda u: (u + 1) / (u * u + 2)),
    "negative power": (lambda u: u**-2, lambda u: u**-2),
    "sqrt": (lambda u: E.sqrt(u * u + 0.25), lambda u: mp.sqrt(u * u + 0.25)),
    "exp": (lambda u: E.exp(-0.5 * u), lambda u: mp.exp(-u / 2)),
    "log": (lambda u: E.log(u + u * u), lambda u: mp.log(u + u * u)),
    "sin": (lambda u: E.sin(3.0 * u), lambda u: mp.sin(3 * u)),
    "cos": (lambda u: E.cos(u * u) * E.sin(u * u), lambda u: mp.cos(u * u) * mp.sin(u * u)),
    "power": (lambda u: E.power(u, 1.7), lambda u: u ** mp.mpf(1.7)),
    "tan": (lambda u: E.tan(0.5 * u), lambda u: mp.tan(u / 2)),
    "tanh": (lambda u: E.tanh(2.0 * u), lambda u: mp.tanh(2 * u)),
    "arctan": (lambda u: E.arctan(2.0 * u), lambda u: mp.atan(2 * u)),
    "arcsin": (lambda u: E.arcsin(0.5 * u), lambda u: mp.asin(u / 2)),
    "arccos": (lambda u: E.arccos(0.5 * u), lambda u: mp.acos(u / 2)),
    "sinh": (lambda u: E.sinh(u * u), lambda u: mp.sinh(u * u)),
    "cosh": (lambda u: E.cosh(3.0 * u), lambda u: mp.cosh(3 * u)),
    "hypot": (lambda u: E.hypot(u, 2.0 - u * u), lambda u: mp.sqrt(u * u + (2 - u * u) ** 2)),
    "hypot of a constant": (lambda u: E.hypot(3.0, u), lambda u: mp.sqrt(9 + u * u)),
    "floor": (lambda u: u * E.floor(5.0 * u), lambda u: 3 * u),
    "mod": (lambda u: E.mod(u, 0.25), lambda u: u - mp.mpf(0.5)),
    "abs": (lambda u: u * abs(u) - 2.0 * abs(-3.0 * u), lambda u: u * u - 6 * u),
    "sign": (lambda u: E.sign(-2.0 * u) * u, lambda u: -u),
    "all": (
        lambda u: E.exp(E.sin(u)) / E.sqrt(1.0 + E.power(u, 0.5)) - u / (2.0 - E.log(u)),
        lambda u: mp.exp(mp.sin(u)) / mp.sqrt(1 + mp.sqrt(u)) - u / (2 - mp.log(u)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_recurrences_give_the_taylor_coefficients_of_every_operation(name):
    ours, truth = CASES[name]
    for k, (found, true) in enumerate(zip(coefficients(ours), true_coefficients(truth), strict=True)):
        assert abs(found - true) < 3e-14 * max(1, abs(true)), k


def test_a_power_of_abs_keeps_its_constant_apart_and_its_series_is_that_of_both_signs():
    graph = E.Graph()
    u, n = graph.series("u"), graph.constant("n")
    assert E.power(abs(-3.0 * u), n).args[1] is E.power(abs(u), n)
    assert E.sqrt(abs(u)) is E.power(abs(u), 0.5)
    assert len(graph.powers) == 2
    true = true_coefficients(lambda u: u ** mp.mpf(1.7))
    for side in (1.0, -1.0):  # u and its rates with the other sign
        graph = E.Graph()
        u, rate, inner = graph.series("u"), graph.series("r"), graph.series("s")
        result = E.power(abs(u), 1.7)
        inputs = {"u": side * 0.7, "r": side, "s": -side, ".sign_0": side}
        found = Values(inputs, {"u": rate, "r": inner, "s": graph.of(side * 1.2)}).coefficients(result, ORDER)
        assert max(abs(float(f) - t) for f, t in zip(found, true, strict=True)) < 3e-14


@pytest.mark.parametrize("name", CASES)
def test_a_derivative_along_a_change_is_that_of_the_function(name):
    ours, truth = CASES[name]
    graph = E.Graph()
    u = graph.series("u")
    result = ours(u)
    change = Tangents(graph, ["u"]).of(result)
    signs = {f".sign_{j}": side(graph, kink) for j, kink in enumerate(graph.kinks)}
    value = Values({"u": 0.7, ".delta_u": 0.3} | signs).value(change)
    with mp.workdps(40):
        true = mpmath.diff(truth, mp.mpf(0.7)) * 0.3
    assert abs(value - true) < 1e-14 * max(1, abs(true))
