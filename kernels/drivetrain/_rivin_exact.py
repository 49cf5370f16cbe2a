"""Rivin's reduction without error: partial systems are replaced by what acts alike at one frequency.

With K_j = k_j + i w h_j and mu = 1 - (w/w0)^2 the static equivalents of `_rivin_merging` become exact:
    a: J* = J K_{j-1}/S, J** = J K_j/S, K* = K_{j-1} K_j/S,  S = K_{j-1} + K_j - w^2 J,
    b: mu times J_j + J_{j+1}, K_left and K_right.
Rivin's rule is mu = 1. The chain of p masses has every frequency of the full one; its masses and springs are
complex, and infinite where w is the frequency w0 of an undamped partial system.
What dangles at the free end carries the spindle's angle: its flexibility is added to that of the chain.

The natural frequencies are those of the chain without dampers. Each step exchanges unknowns by elimination, so nothing
is lost of the signs of its pivots (Sylvester, Haynsworth); with the negative ones of all of these counted,
    N(w) = pivots of the p masses + those of the steps
frequencies are below w (Wittrick & Williams). The pivots of a step are
    a: K_(j-1) + K_j - w^2 J_j,                                                                      (1)
    b: K_(j-1) + K_left and K_right + K_(j+1), less that of the mass between, K_left + K_right - w^2 J', whose sign is
       that of K_j J_j J_(j+1).                                                                      (2)
Every frequency is shut in by N, and then found by the stiffness that is felt at the first of the p masses: regula falsi
as by Illinois, with halving where that is slow. Nothing is taken from the full chain; that both agree is checked, and a
cell where they do not is INACCURATE.
A frequency may be that w0 of a partial system which stands still in its mode, as in a chain of equal masses: there
masses and springs are infinite, and half of the digits are lost, or two thirds where it happens twice. So N is counted
in pairs, which have 32.
Source: Wittrick & Williams, Q. J. Mech. Appl. Math. 24:263 (1971); (2) derived here.
"""

from kernels.drivetrain._modal_receptance import spindle_receptance
from kernels.drivetrain._rivin_merging import TYPE_A
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths import pairs
from kernels.maths.pairs import add, negative, times, two_product
from kernels.maths.small_dense import over

STEP_LIMIT = 400
"""Counts for one frequency; 15 to 25 are usual."""
_DIGITS = 2.0**-51  # relative width at which a frequency is found
_LOWEST = 2.0**-320  # times the highest frequency: below it there is only 0
_NOTHING = 2.0**-120
_TURNS = 0.15915494309189535  # 1/(2 pi)


@jit
def _take(values, j):
    return values[2 * j], values[2 * j + 1]


@jit
def _put(values, j, x):
    values[2 * j], values[2 * j + 1] = x[0], x[1]


@jit_apart
def _sum(x, y):
    """x + y; in the place of 0, what rounding leaves of it."""
    total = add(x, y)
    return total if magnitude(total[0]) > 0.0 else (_NOTHING * magnitude(x[0]), 0.0)


@jit
def _negatives(x):
    return 1 if x[0] < 0.0 else 0


@jit
def _close_gap(J, K, j, m):
    for i in range(2 * j, 2 * m - 2):
        J[i], K[i] = J[i + 2], K[i + 2]


@jit_apart
def _without_mass(J, K, square, j, m):
    """Type a at mass j of m; how many of its pivots (1) are negative."""
    own, left, right = _take(J, j), _take(K, j - 1), _take(K, j)
    pivot = _sum(add(left, right), negative(times(square, own)))
    to_left, to_right = pairs.over(left, pivot), pairs.over(right, pivot)
    _put(J, j - 1, add(_take(J, j - 1), times(own, to_left)))
    if j + 1 < m:
        _put(J, j + 1, add(_take(J, j + 1), times(own, to_right)))
    _put(K, j - 1, times(left, to_right))
    _close_gap(J, K, j, m)
    return _negatives(pivot)


@jit_apart
def _without_spring(J, K, square, j, m):
    """Type b at spring j of m; how many of its pivots (2) are negative."""
    own, first, second, beyond = _take(K, j), _take(J, j), _take(J, j + 1), _take(K, j + 1)
    between = _negatives(own) + _negatives(first) + _negatives(second)
    both = _sum(add(first, second), negative(times(times(square, first), pairs.over(second, own))))
    K_left, K_right = times(own, pairs.over(both, second)), times(own, pairs.over(both, first))
    left, right = K_left, _sum(K_right, beyond)
    if j > 0:
        before = _take(K, j - 1)
        left = _sum(K_left, before)
        _put(K, j - 1, times(before, pairs.over(K_left, left)))
    _put(K, j + 1, times(beyond, pairs.over(K_right, right)))
    _put(J, j + 1, both)
    _close_gap(J, K, j, m)
    return _negatives(left) + _negatives(right) - between % 2


@jit_apart
def count_below(w, J, k, kinds, places, p, J_w, K_w):
    """N at an angular frequency, and the stiffness at the first mass of the p; room for n pairs in J_w and K_w."""
    n, square, count = J.size, two_product(w, w), 0
    for j in range(n):
        _put(J_w, j, (J[j], 0.0))
        _put(K_w, j, (k[j], 0.0))
    for m in range(n, p, -1):
        place = int(places[n - m])
        if kinds[n - m] == TYPE_A:
            count += _without_mass(J_w, K_w, square, place, m)
        else:
            count += _without_spring(J_w, K_w, square, place, m)
    below = 0.0, 0.0
    for j in range(p - 1, -1, -1):
        spring = _take(K_w, j)
        if j < p - 1:
            pivot = _sum(spring, below)
            count += _negatives(pivot)
            spring = times(spring, pairs.over(below, pivot))
        below = add(spring, negative(times(square, _take(J_w, j))))
    return count + _negatives(below), below[0]


@jit
def _next(low, high, at_low, at_high, halve):
    """The frequency to look at next: where the stiffness seems to vanish, at least a digit from either end."""
    if high > 2.0 * low:
        return sqrt(low) * sqrt(high)
    w = low + (high - low) * (at_low / (at_low - at_high))
    w = min(max(w, low + _DIGITS * low), high - _DIGITS * low)
    return 0.5 * (low + high) if halve or not (w > low and w < high) else w


@jit
def _opposite(x, y):
    return x < 0.0 < y or y < 0.0 < x


@jit_apart
def _find(i, low, high, J, k, kinds, places, p, J_w, K_w):
    """The i-th angular frequency from 0, between two others, and one below it and all later ones."""
    at_low, at_high, side = float("nan"), float("nan"), 0
    for step in range(STEP_LIMIT):
        if high - low <= _DIGITS * high:
            break
        w = _next(low, high, at_low, at_high, step % 4 == 3 or not _opposite(at_low, at_high))
        count, stiffness = count_below(w, J, k, kinds, places, p, J_w, K_w)
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
def exact_frequencies(J, k, kinds, places, p, frequency, J_w, K_w):
    """Fills `frequency` [Hz] with all of them, rising; free at both ends the first is exactly 0.

    `kinds`, `places` : the systems replaced, in order; J_w and K_w have room for n pairs each
    """
    n, most = J.size, 0.0
    for j in range(n):
        most = max(most, 2.0 * (k[j] + (k[j - 1] if j > 0 else 0.0)) / J[j])
    high = 1.0001 * sqrt(most)  # Gershgorin
    low = _LOWEST * high
    for i in range(n):
        if i == 0 and not k[n - 1] > 0.0:
            frequency[i] = 0.0
        else:
            w, low = _find(i, low, high, J, k, kinds, places, p, J_w, K_w)
            frequency[i] = _TURNS * w


@jit
def _remove_mass(J, K, w_square, j, m):
    """Type a at mass j of m."""
    total = K[j - 1] + K[j] - w_square * J[j]
    J[j - 1] += J[j] * over(K[j - 1], total)
    if j + 1 < m:
        J[j + 1] += J[j] * over(K[j], total)
    K[j - 1] = K[j - 1] * over(K[j], total)
    for i in range(j, m - 1):
        J[i], K[i] = J[i + 1], K[i + 1]


@jit
def _remove_spring(J, K, w_square, j, m):
    """Type b at spring j of m; the flexibility that dangles at the free end."""
    total = J[j] + J[j + 1]
    reduced = J[j] * over(J[j + 1], total)
    mu = 1.0 - w_square * over(reduced, K[j])
    K_left, K_right = mu * K[j] * over(total, J[j + 1]), mu * K[j] * over(total, J[j])
    J[j], K[j] = mu * total, K_right * over(K[j + 1], K_right + K[j + 1])
    if j > 0:
        K[j - 1] = K[j - 1] * over(K_left, K[j - 1] + K_left)
    for i in range(j + 1, m - 1):
        J[i], K[i] = J[i + 1], K[i + 1]
    return over(1.0 + 0.0j, K_left) if j == 0 else 0.0j


@jit_apart
def receptance(w, J, k, h, kinds, places, n_kept, J_w, K_w):
    """Receptance of the spindle from the chain of n_kept masses at the angular frequency w.

    `kinds`, `places` : the systems replaced, in order; `J_w`, `K_w` : complex buffers
    """
    n = J.size
    for j in range(n):
        J_w[j], K_w[j] = complex(J[j], 0.0), complex(k[j], w * h[j])
    dangling = 0.0j
    for m in range(n, n_kept, -1):
        if kinds[n - m] == TYPE_A:
            _remove_mass(J_w, K_w, w * w, int(places[n - m]), m)
        else:
            dangling += _remove_spring(J_w, K_w, w * w, int(places[n - m]), m)
    return dangling + spindle_receptance(J_w, K_w, w * w, n_kept)
