"""Adaptive Gauss-Kronrod quadrature of a pool of panels of one or several integrals, with an error estimate.

A panel is an interval x0 .. x0 + h, mapped from y in 0..1 by x = x0 + h y^2 (3 - 2 y), which smooths square roots at
either end. Panels are halved in y, the worst first, until the sum of errors meets the tolerance, except panels whose
error is within rounding, which only grows as nodes approach the ends. The error of a panel is three times the
difference of the 21- and the 10-point rule, far more than the error of the 21-point rule for a smooth integrand; for
nearly kinked ones, the difference alone was half of the error in 1 of 5000.
An integrand fills the values at all nodes of a panel together, `integrand(kind, nodes, count, scene)`, in lanes if it
can: there is room for full lanes.
Nodes: Piessens et al., QUADPACK (1983).
"""

from typing import NamedTuple

import numpy as np

from kernels.lanes.columns import GROUP
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude

PANEL_LIMIT = 1000
COUNT = 21
"""Nodes of a panel."""
KIND, START, LENGTH, LOW, HIGH, VALUE, ERROR, NOISE = range(8)
POOL = (2 * PANEL_LIMIT, 8)
_CAUTION = 3.0
_JUMP = 0.125  # of a panel's change when it is halved: the least error of its halves, where theirs is small by chance
_LEAST = 1.25  # of rtol
ROOM = -(-COUNT // GROUP) * GROUP
"""Nodes of whole groups of lanes."""

_NODES = np.array([
    0.995657163025808080735527280689003, 0.973906528517171720077964012084452, 0.930157491355708226001207180059508,
    0.865063366688984510732096688423493, 0.780817726586416897063717578345042, 0.679409568299024406234327365114874,
    0.562757134668604683339000099272694, 0.433395394129247190799265943165784, 0.294392862701460198131126603103866,
    0.148874338981631210884826001129720, 0.0,
])  # fmt: skip
_KRONROD = np.array([
    0.011694638867371874278064396062192, 0.032558162307964727478818972459390, 0.054755896574351996031381300244580,
    0.075039674810919952767043140916190, 0.093125454583697605535065465083366, 0.109387158802297641899210590325805,
    0.123491976262065851077958109831074, 0.134709217311473325928054001771707, 0.142775938577060080797094273138717,
    0.147739104901338491374841515972068, 0.149445554002916905664936468389821,
])  # fmt: skip
_GAUSS = np.array([
    0.0, 0.066671344308688137593568809893332, 0.0, 0.149451349150580593145776339657697, 0.0,
    0.219086362515982043995534934228163, 0.0, 0.269266719309996355091226921569469, 0.0,
    0.295524224714752870173892994651338, 0.0,
])  # fmt: skip


class Nodes(NamedTuple):
    """Of a panel: x, dx/dy, values of the integrand and what they may be wrong by."""

    x: np.ndarray
    growth: np.ndarray
    value: np.ndarray
    doubt: np.ndarray


@jit_call
def nodes():
    """Room for the `Nodes` of a panel, and to the end of its last lane."""
    return Nodes(np.empty(ROOM), np.empty(ROOM), np.empty(ROOM), np.empty(ROOM))


@jit_call
def integrate(integrand, scene, pool, k, nodes):
    """Value, error and noise of panel k by 21 nodes; behind them the last is repeated."""
    middle, half = 0.5 * (pool[k, LOW] + pool[k, HIGH]), 0.5 * (pool[k, HIGH] - pool[k, LOW])
    for j in range(ROOM):
        y = middle - half * _NODES[j] if j < 11 else middle + half * _NODES[max(20 - j, 0)]
        nodes.x[j] = pool[k, START] + pool[k, LENGTH] * (y * y * (3.0 - 2.0 * y))
        nodes.growth[j] = pool[k, LENGTH] * 6.0 * y * (1.0 - y)
    integrand(pool[k, KIND], nodes, COUNT, scene)
    kronrod, gauss, noise, size = 0.0, 0.0, 0.0, 0.0
    for j in range(COUNT):
        i = j if j < 11 else 20 - j
        value, growth = nodes.value[j], nodes.growth[j]
        kronrod += _KRONROD[i] * value * growth
        gauss += _GAUSS[i] * value * growth
        noise += _KRONROD[i] * nodes.doubt[j] * growth
        size += _KRONROD[i] * magnitude(value * growth)
    error = _CAUTION * magnitude(kronrod - gauss)
    pool[k, VALUE], pool[k, ERROR] = half * kronrod, half * error
    pool[k, NOISE] = half * noise + 4e-16 * half * size


@jit
def open_panel(pool, k, kind, start, length):
    """Makes panel k the whole of a stretch."""
    pool[k, KIND], pool[k, START], pool[k, LENGTH], pool[k, LOW], pool[k, HIGH] = kind, start, length, 0.0, 1.0


@jit_call
def totals(pool, count):
    """Sums of values, errors and noises, and the panel whose error is farthest above its noise, and by how much."""
    value, error, noise, worst, excess = 0.0, 0.0, 0.0, 0, 0.0
    for k in range(count):
        value += pool[k, VALUE]
        error += pool[k, ERROR]
        noise += pool[k, NOISE]
        if pool[k, ERROR] - pool[k, NOISE] > excess:
            worst, excess = k, pool[k, ERROR] - pool[k, NOISE]
    return value, error, noise, worst, excess


@jit_call
def adapt(integrand, scene, pool, nodes, count, rtol):
    """Value and error of the pool's `count` opened panels, to `rtol` or as near as rounding or PANEL_LIMIT let it.

    The error is stated to be no less than rtol: on one panel in some 1e5 two rules agree by chance a hundred times
    better than they are right.
    """
    for k in range(count):
        integrate(integrand, scene, pool, k, nodes)
    value, error, noise, worst, excess = totals(pool, count)
    for new in range(count, PANEL_LIMIT):
        if not (error > max(rtol * magnitude(value), noise) and excess > 0.0):
            break
        whole, middle = pool[worst, VALUE], 0.5 * (pool[worst, LOW] + pool[worst, HIGH])
        for j in range(VALUE):  # the worst panel keeps its first half, the second one becomes the new panel
            pool[new, j] = pool[worst, j]
        pool[worst, HIGH], pool[new, LOW] = middle, middle
        integrate(integrand, scene, pool, worst, nodes)
        integrate(integrand, scene, pool, new, nodes)
        jump = _JUMP * magnitude(whole - (pool[worst, VALUE] + pool[new, VALUE]))
        pool[worst, ERROR], pool[new, ERROR] = max(pool[worst, ERROR], jump), max(pool[new, ERROR], jump)
        value, error, noise, worst, excess = totals(pool, new + 1)
    return value, max(error + noise, _LEAST * rtol * magnitude(value))
