"""The limit cycle of a foliot without spring, for any friction law that is a sum of powers: integrals over the speed.

    x'' = -1 - f(v) sgn v,  f(v) = rho + d v + gamma v^n,  v -> e v at the switch                  (1)
From a switch to the next, at speed v1 just before each, with E = abs(e) and sigma = +1 for e > 0, -1 for e <= 0 (then
the half swing starts inward at once and has no turning point), dx = v dv/v' and dt = dv/v' give
    2 = int_0^v1 v/(1 - f(v)) dv - int_0^Ev1 v/(1 + sigma f(v)) dv,                                (2)
    half period = int_0^v1 dv/(1 - f(v)) + sigma int_0^Ev1 dv/(1 + sigma f(v)).                    (3)
With v = v1 s, F = 1 - f(v1 s), B = 1 + sigma f(E v1 s) and M = B - F, a sum of friction terms of one sign, (2) is
    2 = v1^2 int_0^1 s N/(F B) ds,  N = (1 - e^2) F + M;  (3) has (1 + sigma E) F + M for s N,      (4)
in which nothing cancels however weak the friction. Friction holds v1 below V, where f(V) = 1. At weak drive 1 - v1/V
may be exp(-1e12), so the unknown is z = -ln(1 - v1/V), and the pole of 1/F at v = V, of strength 1/f'(V), is taken out:
its integral is z/f'(V). Everything is taken at y with z = exp(y)/V, so that exp(y) is v1 at strong drive.

Notation: D = d V and G = gamma V^n are the shares of 1 - rho at V; far = v1/V, near = 1 - v1/V; a = d v1 and
b = gamma v1^n; f = rho + a s + b s^n, f_B = rho + a E s + b E^n s^n and M = m0 + m1 s + m2 s^n; W and T are the
integrals of (4) and of (3) over v1, so that v1^2 W = 2 and half period = v1 T. Units and records: see `_units`. Derived
here.
"""

import math
from collections import namedtuple

import numpy as np

from kernels.foliot._units import Cycle, errors
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import symbolic
from kernels.lanes.tuples import total
from kernels.lanes.vectors import any_lane, fma, magnitude, not_, sqrt, where
from kernels.maths.decimals import legendre, precise
from kernels.maths.elementary import exp, expm1, is_normal, log, log1p
from kernels.maths.roots import by_steps, in_bracket

NEWTON_LIMIT, SETTLED = 60, 1e-8
"""Newton steps or bisections for (2), and Newton steps for V, about five being usual; and a Newton step in ln v1 below
which the next one, about its square, would be below rounding."""

_NEAR = 1.1  # from this z on the pole is taken out; below, where V > 1.5 v1, the rule does without
_FAR = 1e300  # ln V where there is no drag
_WIDEST = 750.0  # no ln v1 of a float64 is beyond
_POWER, _NODES = 5, 32


with precise():
    _RULE = [(u**_POWER, _POWER * u ** (_POWER - 1) * weight) for u, weight in legendre(_NODES)]
    _RULE = [tuple(map(float, (s, 1 - s, s.ln(), weight))) for s, weight in _RULE]
_S, _REST, _LOG_S, _WEIGHT = map(np.array, zip(*_RULE, strict=True))
"""s, 1 - s, ln s and weights of Gauss-Legendre in s^(1/5), where s^n and ln s are smooth enough for any n >= 0."""

Terminal = namedtuple("Terminal", "log_V D G")
"""ln V of f(V) = 1, and the shares D and G of 1 - rho there; without drag V is infinite and D = 0."""

Speeds = namedtuple("Speeds", "v1 log_v1 z far near F1 slope friction kept power lost m")
"""v1, ln v1, z, far, near; F1 = 1 - f(v1), and that over `near`, which tends to V f'(V); rho, a, b; 1 - far^n, far^n;
1 - e^2; and m0, m1, m2."""


@jit
def _terminal_step(u, scene):
    """Newton's step for ln(D + G) in u = ln V, and whether it is the last.

    It is convex: from above the root, where each share alone is at most 1 - rho, the steps are monotone.
    """
    log_d, log_gamma, n, left = scene
    D, G = exp(u + log_d), exp(fma(n, u, log_gamma))
    step = (log(D + G) - left) * (D + G) / fma(n, G, D)
    return step, not_(magnitude(step) > 1e-9)


@jit_call
def _terminal(scene):
    """The terminal speed."""
    d, gamma, n, slack = scene.d, scene.gamma, scene.n, scene.slack
    left, log_d, log_gamma = log(slack), log(d), log(gamma)
    by_d, by_gamma = log(slack / d), log(slack / gamma) / n
    u = where(by_d < by_gamma, by_d, by_gamma)
    drag = u < _FAR
    u = where(drag, u, 0.0)
    u, _ = by_steps(_terminal_step, u, drag & (d > 0.0) & (gamma > 0.0), (log_d, log_gamma, n, left), NEWTON_LIMIT)
    D, G = exp(u + log_d), exp(fma(n, u, log_gamma))
    share = where(drag, D / (D + G), 0.0)
    rest = where(drag, G / (D + G), 1.0)
    return Terminal(where(drag, u, _FAR), slack * share, slack * rest)


@jit
def _leg(scene, a, b):
    """1 - e^2, and m0, m1, m2."""
    n, e = scene.n, scene.e
    outward = e > 0.0
    less = -expm1(n * log(magnitude(e)))  # 1 - E^n
    m1, m2 = a * (1.0 + e), b * where(outward, 2.0 - less, less)
    return (1.0 - e) * (1.0 + e), (where(outward, 2.0 * scene.rho, 0.0), m1, m2)


@symbolic
def _law(terms, s, p):
    """constant + linear s + powered p, of three terms."""
    constant, linear, powered = terms
    return fma(linear, s, fma(powered, p, constant))


@jit
def _speeds(scene, terminal, y):
    """The speeds at y."""
    n, (log_V, D, G) = scene.n, terminal
    log_z = y - log_V
    z = exp(log_z)
    near, far = exp(-z), -expm1(-z)
    ratio = where(z > 1e-300, far / where(z > 1e-300, z, 1.0), 1.0)
    log_ratio = log(ratio)
    log_far = where(z < 1.0, log_z + log_ratio, log1p(-near))
    power, kept = exp(n * log_far), -expm1(n * log_far)
    slope = fma(G, where(near > 1e-290, kept / near, n), D)
    v1 = exp(y) * ratio
    F1, log_v1 = fma(G, kept, D * near), y + log_ratio
    a, b = scene.d * v1, G * power
    lost, m = _leg(scene, a, b)
    return Speeds(v1, log_v1, z, far, near, F1, slope, (scene.rho, a, b), kept, power, lost, m)


@jit
def _pole(e, speeds, rest, s):
    """1/x - E/x' of the poles of 1/F and of 1/B: x = 1 - s v1/V, x' = 1 - s E v1/V; the second only for e <= 0."""
    far, near = speeds.far, speeds.near
    x = fma(far, rest, near)
    E = where(e > 0.0, 0.0, -e)
    beside = fma(far, fma(1.0 - E, s, rest), near)
    return fma(-E, x, beside) / (x * beside)


@jit
def _defect(e, speeds, rule):
    """What the rule misses of the integral of `_pole` over s; 0 where it is far enough for the rule to miss nothing.

    The integral is ln((1 - E v1/V)/(1 - v1/V)) V/v1.
    """
    z, near, close = speeds.z, speeds.near, speeds.z > _NEAR
    far = where(close, speeds.far, 1.0)
    gap = where(e > 0.0, 0.0, 1.0 + e) * far
    mild = z < 600.0
    inward = where(mild, log1p(gap / where(mild, near, 1.0)), z + log(near + gap))
    return where(close, where(e > 0.0, z, inward) / far - rule, 0.0)


@jit
def _way(y, scene):
    """Whether the right side of (2) is below its left at y; Newton's step by logarithms; which one is the last."""
    scene, terminal = scene
    speeds = _speeds(scene, terminal, y)
    n, e, z, far, F1, lost, m = scene.n, scene.e, speeds.z, speeds.far, speeds.F1, speeds.lost, speeds.m
    _, a, b = speeds.friction
    W, rule = 0.0 * y, 0.0 * y
    for j in range(_NODES):
        q = -expm1(n * _LOG_S[j])
        F, M = _law((F1, a, b), _REST[j], q), _law(m, _S[j], 1.0 - q)
        W = fma(_WEIGHT[j] * _S[j], fma(lost, F, M) / (F * (F + M)), W)
        rule = fma(_WEIGHT[j], _pole(e, speeds, _REST[j], _S[j]), rule)
    W = W + _defect(e, speeds, rule) / (where(z > _NEAR, far, 1.0) * fma(n, terminal.G, terminal.D))
    M1 = total(m)
    rate = fma(lost, F1, M1) / (speeds.slope * (F1 + M1))
    stretch = where(z > 1e-300, z / where(z > 1e-300, far, 1.0), 1.0)
    excess, slope = fma(2.0, speeds.log_v1, log(0.5 * W)), stretch * rate / W
    step = -excess / slope
    # only Newton's own step ends the search: a bracket that has shrunk to a point holds no root for that
    return excess < 0.0, step, where(magnitude(step) <= SETTLED, math.inf, math.nan)


@jit_call
def _strong(scene, speeds):
    """T, the integral of s/B, and the sensitivity, by scaling speeds with v1.

    W and T depend on the terms of friction over mu, c_k = rho, a, b of degrees n_k = 0, 1, n:
        g_k = dlnW/dln c_k = c_k/W int s^(n_k+1) (1/F^2 + e E^(n_k+1)/B^2) ds,                       (5)
        h_k = dT/dc_k = int s^n_k (1/F^2 - E^(n_k+1)/B^2) ds.                                       (6)
    a grows as v1 does, b as v1^n. So with v1^2 W = 2 mu and half period = v1 T/mu, g being the sum of g_k,
        w = dln v1/dln mu = (1 + g)/(2 + g_1 + n g_2),                                              (7)
        s = 1 - w + (rho h_0 + (1 - w) a h_1 + (1 - n w) b h_2)/T.                                  (8)
    Where friction is weak 1 - w and h are small, and summed of products that do not cancel: with i = (n_k + 1)/2
        (1 - g) W = (1 - e^2)/2 - int s (f/F - E f_B/B) (f/F + E f_B/B) ds,                         (9)
        f/F - E f_B/B = ((f - E f_B) F + f M)/(F B),
        1/F^2 - E^(2i)/B^2 = ((1 - E^i) F + M) (E^i F + B)/(F B)^2.                                (10)
    """
    rho, n, e, F1, lost, m = scene.rho, scene.n, scene.e, speeds.F1, speeds.lost, speeds.m
    friction, (_, a, b) = speeds.friction, speeds.friction

    # of each term: E^i and 1 - E^i of (10), e E^(n_k+1) of (5), and f_B and f - E f_B
    E = magnitude(e)
    log_E = log(E)
    root, root_n = sqrt(E), exp(0.5 * n * log_E)  # E^(1/2), E^(n/2)
    E_n, i0, i1, i2 = root_n * root_n, root, E, root * root_n
    rest0, rest1, rest2 = (1.0 - E) / (1.0 + root), 1.0 - E, -expm1((0.5 * n + 0.5) * log_E)
    back1, back2 = e * (E * E), e * E * E_n
    behind = rho, a * E, b * E_n
    apart = rho * (1.0 - E), a * (1.0 - E) * (1.0 + E), -b * expm1((n + 1.0) * log_E)

    W = T = rise = excess = g1 = g2 = h0 = h1 = h2 = 0.0 * F1
    for j in range(_NODES):
        s, w, ws = _S[j], _WEIGHT[j], _WEIGHT[j] * _S[j]
        q = -expm1(n * _LOG_S[j])
        p = 1.0 - q  # s^n
        F, M = _law((F1, a, b), _REST[j], q), _law(m, s, p)
        B, f, f_B = F + M, _law(friction, s, p), _law(behind, s, p)
        both = 1.0 / (F * B)
        W = fma(ws * fma(lost, F, M), both, W)
        T = fma(w * fma(1.0 + e, F, M), both, T)
        rise = fma(ws * F, both, rise)
        less, more = fma(_law(apart, s, p), F, f * M), fma(f, B, E * f_B * F)
        both = both * both
        excess = fma(ws * both, less * more, excess)
        g1 = fma(ws * s * both, fma(back1, F * F, B * B), g1)
        g2 = fma(ws * p * both, fma(back2, F * F, B * B), g2)
        h0 = fma(w * both, fma(rest0, F, M) * fma(i0, F, B), h0)
        h1 = fma(ws * both, fma(rest1, F, M) * fma(i1, F, B), h1)
        h2 = fma(w * p * both, fma(rest2, F, M) * fma(i2, F, B), h2)

    g1, g2 = a * g1 / W, b * g2 / W
    slower = ((lost * 0.5 - excess) / W + g1 + n * g2) / (2.0 + g1 + n * g2)  # 1 - w, by (7)
    h = rho * h0 + slower * (a * h1) + fma(n, slower, 1.0 - n) * (b * h2)
    return T, rise, slower + h / T


@jit_call
def _weak(scene, terminal, speeds):
    """As `_strong`, by scaling speeds with V, so that nothing is divided by 1 - v1/V.

    At fixed z all integrands change smoothly with -ln mu; a name with _ is a derivative by that. As rho + D + G = 1,
        stretch = -dln(V/sqrt(mu))/dln mu = -(D/2 + rho + (1 - n/2) G)/K,  K = D + n G = V f'(V),   (11)
        D_ = D (1/2 + stretch),  G_ = G (1 + n (stretch - 1/2)).                                    (12)
    The change of z that keeps (2) is worth `ratio`, the way's share over the time's at the end v = v1 of both
    integrals, where their integrands are infinitely steep at weak drive and their ratio is not; hence
        s = 1/2 + stretch + T_/T - (2 stretch + W_/W) ratio.                                        (13)
    `miss`, 1/K times what the rule misses of `_pole`, is what it misses of T.
    """
    rho, n, e, (_, D, G) = scene.rho, scene.n, scene.e, terminal
    far, near, F1, kept, power = speeds.far, speeds.near, speeds.F1, speeds.kept, speeds.power
    K = fma(n, G, D)
    stretch = -(0.5 * D + rho + (1.0 - 0.5 * n) * G) / K
    D_, G_ = D * (0.5 + stretch), G * fma(n, stretch - 0.5, 1.0)
    lost, m = _leg(scene, D * far, speeds.friction[2])
    _, (m0, m1_D, m2_G) = _leg(scene, far, power)
    m_ = m0, D_ * m1_D, G_ * m2_G
    W = T = rise = rule = W_ = T_ = 0.0 * far
    for j in range(_NODES):
        s, w, ws = _S[j], _WEIGHT[j], _WEIGHT[j] * _S[j]
        q = -expm1(n * _LOG_S[j])
        x, x_n = fma(far, _REST[j], near), fma(power, q, kept)  # 1 - s v1/V, 1 - (s v1/V)^n
        F, F_, M, M_ = fma(D, x, G * x_n), fma(D_, x, G_ * x_n), _law(m, s, 1.0 - q), _law(m_, s, 1.0 - q)
        B, B_ = F + M, F_ + M_
        both = 1.0 / (F * B)
        inverse_F, inverse_B = B * both, F * both
        W = fma(ws * fma(lost, F, M), both, W)
        T = fma(w * fma(1.0 + e, F, M), both, T)
        rise = fma(ws, inverse_B, rise)
        change_F, change_B = F_ * inverse_F * inverse_F, e * (B_ * inverse_B * inverse_B)
        W_ = fma(ws, fma(e, change_B, -change_F), W_)
        T_ = fma(-w, change_F + change_B, T_)
        rule = fma(w, _pole(e, speeds, _REST[j], s), rule)
    miss = _defect(e, speeds, rule) / K
    miss_ = -miss * fma(n, G_, D_) / K
    far = where(speeds.z > _NEAR, far, 1.0)
    W, T, W_, T_ = W + miss / far, T + miss, W_ + miss_ / far, T_ + miss_
    M1 = total(m)
    ratio = fma(1.0 + e, F1, M1) * W / (fma(lost, F1, M1) * T)
    return T, rise, 0.5 + (stretch + T_ / T) - (2.0 * stretch + W_ / W) * ratio


@jit
def quadrature(scene, rtol):
    """The cycle of a scene with kappa = 0, accurate to `bound` whatever rtol, and its verdict.

    The right side of (2) grows with y, on logarithmic scales with a slope between about 1 and n + 2: Newton, within the
    bracket that every evaluation narrows; it begins with all float64 and is halved where a step leaves it. The start is
    from the strong limit of each friction term alone and from the weak limit V z = 2 V f'(V)/V.
    """
    d, gamma, n, slack, e, terminal = scene.d, scene.gamma, scene.n, scene.slack, scene.e, _terminal(scene)
    lost, (m0, m1, m2) = _leg(scene, d, gamma)
    product = slack * (slack + m0)
    steady = 0.5 * log(4.0 * product / fma(lost, slack, m0))
    viscous = (1.0 / 3.0) * log(6.0 * product / m1)
    drag = log(2.0 * (n + 2.0) * product / m2) / (n + 2.0)
    strong = where(steady < viscous, steady, viscous)
    strong = where(strong < drag, strong, drag)
    y = log(exp(strong) + 2.0 * fma(n, terminal.G, terminal.D) * exp(-terminal.log_V))
    y = where((y > -_WIDEST) & (y < _WIDEST), y, 0.0)
    low, high = 0.0 * y - _WIDEST, 0.0 * y + _WIDEST
    y, unsettled = in_bracket(_way, y, low, high, y > low, (scene, terminal), NEWTON_LIMIT, SETTLED)

    # what comes of it, where the pole is far and where it is near
    speeds = _speeds(scene, terminal, y)
    v1, F1 = speeds.v1, speeds.F1
    near = speeds.z > _NEAR
    time, rise, s = 0.0 * y, 0.0 * y, 0.0 * y
    if any_lane(not_(near)):
        time, rise, s = _strong(scene, speeds)
    if any_lane(near):
        late, high, weak = _weak(scene, terminal, speeds)
        time, rise, s = where(near, late, time), where(near, high, rise), where(near, weak, s)
    amplitude = 1.0 + where(e > 0.0, v1 * v1 * (e * e) * rise, 0.0)
    half = v1 * time
    cycle = Cycle(half, amplitude, v1, s, e * e * (F1 / (F1 + total(speeds.m))))
    fine = is_normal(half) & is_normal(v1)
    return cycle, where(unsettled, NOT_CONVERGED, where(fine, OK, OUT_OF_RANGE))


@jit
def bound(scene):
    """Relative errors of `quadrature`: 1e-14 to 1e-13 for drag of degree 0.05 to 4.

    Measured: 1e-14 everywhere, 1e-16/(1 + e) where the switch gives almost all speed back inward. Beyond that, what
    rounding of gamma leaves of V = ((1 - rho)/gamma)^(1/n), 1/n ulp; of its logarithm; and of z, 2 V f'(V)/V^2 + 2, in
    the multiplier exp(-z). For n > 4 singularities at v = V exp(+-i pi/n) come near: the rule misses (n/4)^11 4e-14.
    """
    log_V, D, G = _terminal(scene)
    n, e = scene.n, scene.e
    high, deep = where(log_V > 0.0, log_V, 0.0), where(log_V < 0.0, -log_V, 0.0)
    shape = 1.0 / (n * where(high > 1.0, high, 1.0)) + where(high < _FAR, n * high, 0.0) + deep
    steep = where(n > 4.0, 0.25 * n, 0.0)
    square = steep * steep
    missed = 4e-14 * (square * square) * (square * square) * square * steep
    cycle = 1e-14 + 4e-16 * shape + missed + where(e > 0.0, 0.0, 1e-16 / (1.0 + e))
    cycle = where((scene.kappa > 0.0) | (n > 16.0) | (log_V < -350.0), math.inf, cycle)
    z = 2.0 * fma(n, G, D) * exp(-2.0 * log_V) + 2.0
    return errors(cycle, 2.0 * cycle, 10.0 * cycle + where(z < 800.0, 4e-15 * z, 0.0))
