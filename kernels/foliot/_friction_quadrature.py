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
b = gamma v1^n; M = m0 + m1 s + m2 s^n. Units and records: see `_units`. Derived here.
"""

import math
from collections import namedtuple

import numpy as np

from kernels.foliot._units import Cycle, errors
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_call
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

Speeds = namedtuple("Speeds", "v1 log_v1 z far near F1 slope a b kept power terms")
"""v1, ln v1, z, far, near; F1 = 1 - f(v1), and that over `near`, which tends to V f'(V); a, b; 1 - far^n, far^n; and
1 - e^2, m0, m1, m2."""


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
    """1 - e^2, and the coefficients m0, m1, m2 of M for friction rho + a s + b s^n."""
    n, e = scene.n, scene.e
    outward = e > 0.0
    less = -expm1(n * log(magnitude(e)))  # 1 - E^n
    m1, m2 = a * (1.0 + e), b * where(outward, 2.0 - less, less)
    return (1.0 - e) * (1.0 + e), where(outward, 2.0 * scene.rho, 0.0), m1, m2


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
    return Speeds(v1, log_v1, z, far, near, F1, slope, a, b, kept, power, _leg(scene, a, b))


@jit
def _pole(e, far, near, rest, s):
    """1/x - E/x' of the poles of 1/F and of 1/B: x = 1 - s v1/V, x' = 1 - s E v1/V; the second only for e <= 0."""
    x = fma(far, rest, near)
    E = where(e > 0.0, 0.0, -e)
    beside = fma(far, fma(1.0 - E, s, rest), near)
    return fma(-E, x, beside) / (x * beside)


@jit
def _defect(z, rule, e, far, near):
    """What the rule misses of the integral of `_pole` over s; 0 where it is far enough for the rule to miss nothing.

    The integral is ln((1 - E v1/V)/(1 - v1/V)) V/v1.
    """
    close = z > _NEAR
    far = where(close, far, 1.0)
    gap = where(e > 0.0, 0.0, 1.0 + e) * far
    mild = z < 600.0
    inward = where(mild, log1p(gap / where(mild, near, 1.0)), z + log(near + gap))
    return where(close, where(e > 0.0, z, inward) / far - rule, 0.0)


@jit
def _way(y, scene):
    """Whether the right side of (2) is below its left at y; Newton's step by logarithms; which one is the last."""
    scene, terminal = scene
    n, e, (_, D, G) = scene.n, scene.e, terminal
    _, log_v1, z, far, near, F1, v_slope, a, b, _, _, (lost, m0, m1, m2) = _speeds(scene, terminal, y)
    total, rule = 0.0 * y, 0.0 * y
    for j in range(_NODES):
        q = -expm1(n * _LOG_S[j])
        F = fma(a, _REST[j], fma(b, q, F1))
        M = fma(m1, _S[j], fma(m2, 1.0 - q, m0))
        total = fma(_WEIGHT[j] * _S[j], fma(lost, F, M) / (F * (F + M)), total)
        rule = fma(_WEIGHT[j], _pole(e, far, near, _REST[j], _S[j]), rule)
    total = total + _defect(z, rule, e, far, near) / (where(z > _NEAR, far, 1.0) * fma(n, G, D))
    M1 = m0 + m1 + m2
    rate = fma(lost, F1, M1) / (v_slope * (F1 + M1))
    stretch = where(z > 1e-300, z / where(z > 1e-300, far, 1.0), 1.0)
    excess, slope = fma(2.0, log_v1, log(0.5 * total)), stretch * rate / total
    step = -excess / slope
    # only Newton's own step ends the search: a bracket that has shrunk to a point holds no root for that
    return excess < 0.0, step, where(magnitude(step) <= SETTLED, math.inf, math.nan)


@jit_call
def _strong(scene, speeds):
    """The integrals of (3) over v1 and of s/B, and the sensitivity, by scaling speeds with v1.

    Write W for the integral in (4) and T for that of (3) over v1; then v1^2 W = 2 mu and half period = v1 T/mu, where W
    and T depend on rho, a and b over mu. With the logarithmic derivatives of W and the derivatives of T
        W g_a = a int s^2 (1/F^2 + e^3/B^2) ds,  g_b with b s^(n+1) and e E^n e, g_rho alike;  g their sum,
        h_a = int s (1/F^2 - E^2/B^2) ds,  h_b with s^n and E^(n+1), h_rho with 1 and E,
    w = dln v1/dln mu is (1 + g)/(2 + g_a + n g_b), and s = 1 - w + (rho h_rho + (1 - w) a h_a + (1 - n w) b h_b)/T.
    Where friction is weak 1 - w and h are small, so differences are taken as products of what does not cancel:
        1 - g = int s ((1 - e^2) - (f/F)^2 + (E f_B/B)^2) ds/W,  f = rho + a s + b s^n, f_B that at E s,
        1/F^2 - E^2/B^2 = ((1 - E) F + M)(E F + B)/(F B)^2,  for each term with its own power of E.
    """
    rho, n, e = scene.rho, scene.n, scene.e
    F1, a, b, (lost, m0, m1, m2) = speeds.F1, speeds.a, speeds.b, speeds.terms
    E = magnitude(e)
    log_E = log(E)
    root, root_n = sqrt(E), exp(0.5 * n * log_E)  # sqrt(E), E^(n/2)
    j0, j1, j2 = (1.0 - E) / (1.0 + root), 1.0 - E, -expm1((0.5 * n + 0.5) * log_E)  # 1 - sqrt(E), 1 - E ...
    k0, k1, k2 = rho * (1.0 - E), a * (1.0 - E) * (1.0 + E), -b * expm1((n + 1.0) * log_E)  # f - E f_B
    back = e * (E * E)
    way = time = rise = excess = g_a = g_b = h_rho = h_a = h_b = 0.0 * F1
    for j in range(_NODES):
        s, w, ws = _S[j], _WEIGHT[j], _WEIGHT[j] * _S[j]
        q = -expm1(n * _LOG_S[j])
        p = 1.0 - q  # s^n
        F = fma(a, _REST[j], fma(b, q, F1))
        M = fma(m1, s, fma(m2, p, m0))
        B = F + M
        both = 1.0 / (F * B)
        way = fma(ws * fma(lost, F, M), both, way)
        time = fma(w * fma(1.0 + e, F, M), both, time)
        rise = fma(ws * F, both, rise)
        f, f_B = fma(a, s, fma(b, p, rho)), fma(a * E, s, fma(b * (root_n * root_n), p, rho))
        less, more = fma(fma(k1, s, fma(k2, p, k0)), F, f * M), fma(f, B, E * f_B * F)  # f/F -+ E f_B/B
        both = both * both
        excess = fma(ws * both, less * more, excess)
        g_a = fma(ws * s * both, fma(back, F * F, B * B), g_a)
        g_b = fma(ws * p * both, fma(e * E * (root_n * root_n), F * F, B * B), g_b)
        h_rho = fma(w * both, fma(j0, F, M) * fma(root, F, B), h_rho)
        h_a = fma(ws * both, fma(j1, F, M) * fma(E, F, B), h_a)
        h_b = fma(w * p * both, fma(j2, F, M) * fma(root * root_n, F, B), h_b)
    g_a, g_b = a * g_a / way, b * g_b / way
    slower = ((lost * 0.5 - excess) / way + g_a + n * g_b) / (2.0 + g_a + n * g_b)  # 1 - w
    h = rho * h_rho + slower * (a * h_a) + fma(n, slower, 1.0 - n) * (b * h_b)
    return time, rise, slower + h / time


@jit_call
def _weak(scene, terminal, speeds):
    """As `_strong`, by scaling speeds with V, so that nothing is divided by 1 - v1/V.

    At fixed z all integrands change smoothly with -ln mu: ln V by `stretch`, which keeps D + G + rho = 1, and with it D
    by D_, G by G_ and rho by rho. A name with _ is a derivative by -ln mu at fixed z: way_ of the integral
    of (4), time_ of (3) over v1, miss_ of what the rule misses of the pole, 1/K times its integral, K = V f'(V).
    The change of z that keeps (2) is then worth `ratio`, the way's share over the time's at the end v = v1 of both
    integrals, where their integrands are infinitely steep at weak drive and their ratio is not.
    """
    rho, n, e, (_, D, G) = scene.rho, scene.n, scene.e, terminal
    z, far, near, F1 = speeds.z, speeds.far, speeds.near, speeds.F1
    b, kept, power = speeds.b, speeds.kept, speeds.power
    lost, m0, m1, m2 = _leg(scene, D * far, b)
    _, _, m1_D, m2_G = _leg(scene, far, power)
    K = fma(n, G, D)
    stretch = -(0.5 * D + rho + (1.0 - 0.5 * n) * G) / K
    D_, G_ = D * (0.5 + stretch), G * fma(n, stretch - 0.5, 1.0)
    way = time = rise = rule = way_ = time_ = 0.0 * z
    for j in range(_NODES):
        w, ws = _WEIGHT[j], _WEIGHT[j] * _S[j]
        q = -expm1(n * _LOG_S[j])
        p = 1.0 - q
        x, x_n = fma(far, _REST[j], near), fma(power, q, kept)
        F, F_ = fma(D, x, G * x_n), fma(D_, x, G_ * x_n)
        M = fma(m1, _S[j], fma(m2, p, m0))
        B = F + M
        B_ = F_ + fma(D_ * m1_D, _S[j], fma(G_ * m2_G, p, m0))
        both = 1.0 / (F * B)
        inverse_F, inverse_B = B * both, F * both
        way = fma(ws * fma(lost, F, M), both, way)
        time = fma(w * fma(1.0 + e, F, M), both, time)
        rise = fma(ws, inverse_B, rise)
        change_F, change_B = F_ * inverse_F * inverse_F, e * (B_ * inverse_B * inverse_B)
        way_ = fma(ws, fma(e, change_B, -change_F), way_)
        time_ = fma(-w, change_F + change_B, time_)
        rule = fma(w, _pole(e, far, near, _REST[j], _S[j]), rule)
    miss = _defect(z, rule, e, far, near) / K
    miss_ = -miss * fma(n, G_, D_) / K
    far = where(z > _NEAR, far, 1.0)
    way, time = way + miss / far, time + miss
    way_, time_ = way_ + miss_ / far, time_ + miss_
    M1 = m0 + m1 + m2
    ratio = fma(1.0 + e, F1, M1) * way / (fma(lost, F1, M1) * time)
    return time, rise, 0.5 + (stretch + time_ / time) - (2.0 * stretch + way_ / way) * ratio


@jit
def quadrature(scene, rtol):
    """The cycle of a scene with kappa = 0, accurate to `bound` whatever rtol, and its verdict.

    The right side of (2) grows with y, on logarithmic scales with a slope between about 1 and n + 2: Newton, within the
    bracket that every evaluation narrows; it begins with all float64 and is halved where a step leaves it. The start is
    from the strong limit of each friction term alone and from the weak limit V z = 2 V f'(V)/V.
    """
    d, gamma, n, slack, e, terminal = scene.d, scene.gamma, scene.n, scene.slack, scene.e, _terminal(scene)
    lost, m0, m1, m2 = _leg(scene, d, gamma)
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
    v1, F1, (_, m0, m1, m2) = speeds.v1, speeds.F1, speeds.terms
    near = speeds.z > _NEAR
    time, rise, s = 0.0 * y, 0.0 * y, 0.0 * y
    if any_lane(not_(near)):
        time, rise, s = _strong(scene, speeds)
    if any_lane(near):
        late, high, weak = _weak(scene, terminal, speeds)
        time, rise, s = where(near, late, time), where(near, high, rise), where(near, weak, s)
    amplitude = 1.0 + where(e > 0.0, v1 * v1 * (e * e) * rise, 0.0)
    half = v1 * time
    cycle = Cycle(half, amplitude, v1, s, e * e * (F1 / (F1 + (m0 + m1 + m2))))
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
