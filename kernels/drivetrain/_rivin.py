"""Rivin's reduction of a chain: partial systems are replaced by their equivalents, one mass less each.

A chain is J_1 -k_1- J_2 - ... - J_n -k_n- ground, dampers h_j beside the springs k_j = 1/e_j. A partial system is
    a: one mass and the springs on both sides of it,  w0^2 = (k_{j-1} + k_j)/J_j,
    b: one spring and the masses at its ends,         w0^2 = k_j (J_j + J_{j+1})/(J_j J_{j+1});      (25)-(27)
the one of the largest w0 is replaced, of equal ones (to 1e-12, so that rounding decides nothing) a before b, and the
one next to the spindle. With K_j = k_j + i w h_j both have an equivalent at one frequency:
    a: J* = J_j K_{j-1}/S to the left, J** = J_j K_j/S to the right, K* = K_{j-1} K_j/S,
       S = K_{j-1} + K_j - w^2 J_j;
    b: J' = J_j + J_{j+1} - w^2 J_j J_{j+1}/K_j between K_left = K_j J'/J_{j+1} and K_right = K_j J'/J_j, in series with
       the springs beyond (what would dangle at the free end carries the spindle's angle: its flexibility is added).
Rivin's rule is w = 0 in these: with (29), (32), (33), (35)-(38) of the source for J and e, and for the dampers
    a: h* = (h_{j-1} e_{j-1}^2 + h_j e_j^2)/(e_{j-1} + e_j)^2,   b: h e as before                       (34)
which holds while (w h e)^2 << 1 for both springs. All keep sum J x, x_j = e_j + ... + e_n, and with it Dunkerley's sum
of 1/w^2; the error is of first order in (w/w0)^2. Only sums, products and quotients of positive numbers: each parameter
is right to a few ulp, whatever the chain.

At any w the equivalents are exact: the chain of p masses has every frequency of the full one. Each step exchanges
unknowns by elimination, so nothing is lost of the signs of its pivots (Sylvester, Haynsworth); with the negative ones
of all of these counted,
    N(w) = pivots of the p masses + those of the steps                                                    (1)
frequencies are below w (Wittrick & Williams). The pivots of a step are
    a: S,   b: K_(j-1) + K_left and K_right + K_(j+1), less that of the mass between, with the sign of K_j J_j J_(j+1).
Every frequency is shut in by N, and then found by the stiffness that is felt at the first of the p masses: regula falsi
as by Illinois, with halving where that is slow. Nothing is taken from the full chain; that both agree is checked, and a
cell where they do not is INACCURATE.
A frequency may be that w0 of a partial system which stands still in its mode, as in a chain of equal masses: there
masses and springs are infinite, and half of the digits are lost, or two thirds where it happens twice. So N is counted
in pairs, which have 32.
Source: Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201, after Rivin (1966), misprints corrected;
Wittrick & Williams, Q. J. Mech. Appl. Math. 24:263 (1971); the pivots of b derived here.
"""

from kernels.drivetrain._chain import CHAIN_POLES, CHAIN_ROUNDING, FREQUENCIES, Model, off_by
from kernels.lanes.addresses import jit_by_address
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths import pairs
from kernels.maths.pairs import two_product
from kernels.maths.small_dense import over

TYPE_A, TYPE_B = 0.0, 1.0
STRICT, PAPER = 0.0, 1.0
TIE, PAPER_TIE = 1.0 + 1e-12, 1.01
"""By how much J e differ that are not equal. The source compares two digits: within 1 % it takes type a (J3 before
spring 2 of the Fu-la)."""
STEP_LIMIT = 400
"""Counts for one frequency; 15 to 25 are usual."""
_DIGITS = 2.0**-51  # relative width at which a frequency is found
_LOWEST = 2.0**-320  # times the highest frequency: below it there is only 0
_NOTHING = 2.0**-120
_TURNS = 0.15915494309189535  # 1/(2 pi)


@jit
def _plus(x, y):
    return x + y


@jit
def _product(x, y):
    return x * y


@jit
def _ratio(x, y):
    return x / y


@jit_apart
def _pair_plus(x, y):
    """x + y; in the place of 0, what rounding leaves of it."""
    high, low = pairs.add((x.real, x.imag), (y.real, y.imag))
    return complex(high, low) if magnitude(high) > 0.0 else complex(_NOTHING * magnitude(x.real), 0.0)


@jit_apart
def _pair_product(x, y):
    high, low = pairs.times((x.real, x.imag), (y.real, y.imag))
    return complex(high, low)


@jit_apart
def _pair_ratio(x, y):
    high, low = pairs.over((x.real, x.imag), (y.real, y.imag))
    return complex(high, low)


@jit_apart
def _without_mass(plus, times, over, J, K, w_square, j, m):
    """Type a at mass j > 0 of m, of real or complex numbers or pairs (high + i low), as their operations say; its S."""
    own, left, right = J[j], K[j - 1], K[j]
    pivot = plus(plus(left, right), -times(w_square, own))
    to_left, to_right = over(left, pivot), over(right, pivot)
    J[j - 1] = plus(J[j - 1], times(own, to_left))
    if j + 1 < m:
        J[j + 1] = plus(J[j + 1], times(own, to_right))
    K[j - 1] = times(left, to_right)
    for i in range(j, m - 1):
        J[i], K[i] = J[i + 1], K[i + 1]
    return pivot


@jit_apart
def _without_spring(plus, times, over, J, K, w_square, j, m):
    """Type b at spring j < m - 1 of m; its pivots: at the free end the first one is what dangles, K_left."""
    own, first, second, beyond = K[j], J[j], J[j + 1], K[j + 1]
    both = plus(plus(first, second), -times(times(w_square, first), over(second, own)))
    K_left, K_right = times(own, over(both, second)), times(own, over(both, first))
    left, right = K_left, plus(K_right, beyond)
    if j > 0:
        before = K[j - 1]
        left = plus(K_left, before)
        K[j - 1] = times(before, over(K_left, left))
    J[j], K[j] = both, times(K_right, over(beyond, right))
    for i in range(j + 1, m - 1):
        J[i], K[i] = J[i + 1], K[i + 1]
    return left, right


@jit
def _damper_in_series(k_left, h_left, k_right, h_right):
    """Damper (34) beside two springs in series: each counts by the square of its share of the flexibility."""
    total = k_left + k_right
    of_left, of_right = (k_right / total, k_left / total) if total > 0.0 else (0.0, 0.0)
    return h_left * of_left * of_left + h_right * of_right * of_right


@jit
def _slowness(k, h):
    """h e [s]: the time within which spring and damper relax; inf for a damper without a spring."""
    return h / k if h > 0.0 else 0.0


@jit_apart
def step(J, k, h, m, order, springs_too):
    """One mass less of m > 1. Returns type and number of the system replaced, and the larger h e of the merged springs.

    J_1 is never of type a. Without `springs_too` all are of type a.
    """
    of_mass, mass, of_spring, spring = -1.0, 1, -1.0, 0
    for j in range(m):
        if j > 0 and (k[j - 1] + k[j]) / J[j] > TIE * of_mass:
            of_mass, mass = (k[j - 1] + k[j]) / J[j], j
        if j < m - 1 and k[j] / J[j] + k[j] / J[j + 1] > TIE * of_spring:
            of_spring, spring = k[j] / J[j] + k[j] / J[j + 1], j
    if springs_too and of_spring > (PAPER_TIE if order == PAPER else TIE) * of_mass:
        j, total = spring, J[spring] + J[spring + 1]
        to_left, to_right = total / J[j + 1], total / J[j]
        k_left, h_left, k_right, h_right = k[j] * to_left, h[j] * to_left, k[j] * to_right, h[j] * to_right
        slower = max(_slowness(k_right, h_right), _slowness(k[j + 1], h[j + 1]))
        if j > 0:
            slower = max(slower, _slowness(k[j - 1], h[j - 1]), _slowness(k_left, h_left))
            h[j - 1] = _damper_in_series(k[j - 1], h[j - 1], k_left, h_left)
        h[j] = _damper_in_series(k_right, h_right, k[j + 1], h[j + 1])
        _without_spring(_plus, _product, _ratio, J, k, 0.0, j, m)
        kind, gap = TYPE_B, j + 1
    else:
        j = mass
        slower = max(_slowness(k[j - 1], h[j - 1]), _slowness(k[j], h[j]))
        h[j - 1] = _damper_in_series(k[j - 1], h[j - 1], k[j], h[j])
        _without_mass(_plus, _product, _ratio, J, k, 0.0, j, m)
        kind, gap = TYPE_A, j
    for i in range(gap, m - 1):
        h[i] = h[i + 1]
    return kind, j, slower


@jit
def _negatives(x):
    return 1 if x.real < 0.0 else 0


@jit_apart
def _count_below(w, p, scene):
    """N of (1) at an angular frequency, and the stiffness at the first mass of the p."""
    J, k, n, count, below = scene.full.J, scene.full.k, scene.full.J.size, 0, 0.0j
    kinds, places, J_w, K_w = scene.steps[0], scene.steps[1], scene.room.waves[0], scene.room.waves[1]
    high, low = two_product(w, w)
    w_square = complex(high, low)
    for j in range(n):
        J_w[j], K_w[j] = complex(J[j], 0.0), complex(k[j], 0.0)
    for m in range(n, p, -1):
        j = int(places[n - m])
        if kinds[n - m] == TYPE_A:
            count += _negatives(_without_mass(_pair_plus, _pair_product, _pair_ratio, J_w, K_w, w_square, j, m))
        else:
            between = _negatives(K_w[j]) + _negatives(J_w[j]) + _negatives(J_w[j + 1])
            left, right = _without_spring(_pair_plus, _pair_product, _pair_ratio, J_w, K_w, w_square, j, m)
            count += _negatives(left) + _negatives(right) - between % 2
    for j in range(p - 1, -1, -1):
        spring = K_w[j]
        if j < p - 1:
            pivot = _pair_plus(spring, below)
            count += _negatives(pivot)
            spring = _pair_product(spring, _pair_ratio(below, pivot))
        below = _pair_plus(spring, -_pair_product(w_square, J_w[j]))
    return count + _negatives(below), below.real


@jit_apart
def _find(i, low, high, p, scene):
    """The i-th angular frequency from 0, between two others, and one below it and all later ones."""
    at_low, at_high, side = float("nan"), float("nan"), 0
    for attempt in range(STEP_LIMIT):
        if high - low <= _DIGITS * high:
            break
        if high > 2.0 * low:
            w = sqrt(low) * sqrt(high)
        else:  # where the stiffness seems to vanish, at least a digit from either end
            w = low + (high - low) * (at_low / (at_low - at_high))
            w = min(max(w, low + _DIGITS * low), high - _DIGITS * low)
            apart = at_low < 0.0 < at_high or at_high < 0.0 < at_low
            if attempt % 4 == 3 or not apart or not low < w < high:
                w = 0.5 * (low + high)
        count, stiffness = _count_below(w, p, scene)
        if count > i:
            high, at_high = w, stiffness
            at_low *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            low, at_low = w, stiffness
            at_high *= 0.5 if side < 0 else 1.0
            side = -1
    return 0.5 * (low + high), low


@jit_apart
def _merge(p, order, scene):
    """The chain of p masses by Rivin's steps, which `scene.steps` keeps; the largest h e of merged springs."""
    full, kept, n, slower = scene.full, scene.kept, scene.full.J.size, 0.0
    for j in range(n):
        kept.J[j], kept.k[j], kept.h[j] = full.J[j], full.k[j], full.h[j]
    for m in range(n, p, -1):
        scene.steps[0, n - m], scene.steps[1, n - m], late = step(kept.J, kept.k, kept.h, m, order, True)
        slower = max(slower, late)
    return slower


@jit_by_address
def rivin(p, order, scene):
    """The chain at rest alike, of p masses."""
    slower, kept = _merge(p, order, scene), scene.kept
    status = FREQUENCIES(scene.parts, p, kept.J, kept.k, kept.f, scene.room.work)
    return Model(p, CHAIN_ROUNDING, slower, 0.0, status)


@jit_by_address
def poles_of_both(model, scene):
    """Those of chain and reduced chain: bounds on the errors of their damping, and how many the latter has."""
    error = CHAIN_POLES(scene.parts, scene.full, scene.full.J.size, scene.room)
    return error, CHAIN_POLES(scene.parts, scene.kept, model.p, scene.room), 2 * model.p


@jit_apart
def receptance_of_kept(w, model, scene):
    """Of the spindle, by the reduced chain."""
    return receptance_of_chain(w, scene.kept, model.p)


@jit_by_address
def exact(p, order, scene):
    """All frequencies, from p masses that depend on the frequency; how far they are from the full chain's is error.

    They rise; free at both ends the first is exactly 0.
    """
    _merge(p, order, scene)
    J, k, n, most, apart = scene.full.J, scene.full.k, scene.full.J.size, 0.0, 0.0
    for j in range(n):
        most = max(most, 2.0 * (k[j] + (k[j - 1] if j > 0 else 0.0)) / J[j])
    high = 1.0001 * sqrt(most)  # Gershgorin
    w, low = 0.0, _LOWEST * high
    for i in range(n):
        if i > 0 or k[n - 1] > 0.0:
            w, low = _find(i, low, high, p, scene)
        scene.kept.f[i] = _TURNS * w
        off = magnitude(off_by(scene.kept.f[i], scene.full.f[i]))
        apart = max(apart, off if off >= 0.0 else float("inf"))
    return Model(p, CHAIN_ROUNDING + apart, 0.0, 0.0, 0.0)


@jit_by_address
def poles_of_full(model, scene):
    """Those of the chain, which are the model's too; a bound for either, and 0: it has none more."""
    error = CHAIN_POLES(scene.parts, scene.full, scene.full.J.size, scene.room)
    for i in range(scene.full.s.size):
        scene.kept.s[i] = scene.full.s[i]
    return error, error, 0


@jit_apart
def receptance_of_chain(w, chain, n):
    """Angle of the first of n masses over a torque on it, at the angular frequency w."""
    J, k, h, _, _ = chain
    below = complex(k[n - 1] - w * w * J[n - 1], w * h[n - 1])
    for j in range(n - 2, -1, -1):
        spring = complex(k[j], w * h[j])
        below = spring * over(below, spring + below) - w * w * J[j]
    return over(1.0 + 0.0j, below)


@jit_apart
def receptance_of_exact(w, model, scene):
    """Of the spindle, by the p masses that are left at the angular frequency w."""
    J, k, h, _, _ = scene.full
    n, p, dangling, w_square = J.size, model.p, 0.0j, complex(w * w, 0.0)
    kinds, places, J_w, K_w = scene.steps[0], scene.steps[1], scene.room.waves[0], scene.room.waves[1]
    for j in range(n):
        J_w[j], K_w[j] = complex(J[j], 0.0), complex(k[j], w * h[j])
    for m in range(n, p, -1):
        j = int(places[n - m])
        if kinds[n - m] == TYPE_A:
            _without_mass(_plus, _product, over, J_w, K_w, w_square, j, m)
        else:
            left, _ = _without_spring(_plus, _product, over, J_w, K_w, w_square, j, m)
            dangling += over(1.0 + 0.0j, left) if j == 0 else 0.0j
    below = K_w[p - 1] - w_square * J_w[p - 1]
    for j in range(p - 2, -1, -1):
        below = K_w[j] * over(below, K_w[j] + below) - w_square * J_w[j]
    return dangling + over(1.0 + 0.0j, below)
