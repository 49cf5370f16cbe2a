"""Rivin's reduction of a chain: partial systems are replaced by their static equivalents, one mass less each.

A chain is J_1 -k_1- J_2 - ... - J_n -k_n- ground, dampers h_j beside the springs k_j = 1/e_j. A partial system is
    a: one mass and the springs on both sides of it,  w0^2 = (k_{j-1} + k_j)/J_j,
    b: one spring and the masses at its ends,         w0^2 = k_j (J_j + J_{j+1})/(J_j J_{j+1});      (25)-(27)
the one of the largest w0 is replaced: type a by two masses and one spring between them,
    J* = J_j e_j/(e_{j-1} + e_j) to the left, J** = J_j e_{j-1}/(e_{j-1} + e_j) to the right,        (29), (32)
    e* = e_{j-1} + e_j,  h* = (h_{j-1} e_{j-1}^2 + h_j e_j^2)/e*^2,                                  (33), (34)
and type b by the sum of its masses between two springs in series with those beyond,
    e_left = e_j J_{j+1}/(J_j + J_{j+1}), e_right = e_j J_j/(J_j + J_{j+1}), h e as before           (35)-(38)
(what would dangle at the free end is dropped). Both keep sum J x, x_j = e_j + ... + e_n, and with it Dunkerley's
sum of 1/w^2. The error is of first order in (w/w0)^2. Equation (34) holds while (w h e)^2 << 1 for both springs.
Source: Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201, after Rivin (1966); misprints corrected.

Only sums, products and quotients of positive numbers: each parameter is right to a few ulp, whatever the chain.
"""

from kernels.lanes.jit import jit, jit_apart

TYPE_A, TYPE_B = 0.0, 1.0
STRICT, PAPER = 0.0, 1.0
PAPER_TIE = 1.01
"""The source compares J e of two digits: within 1 % it takes type a (J3 before spring 2 of the Fu-la)."""


@jit
def in_series(left, right):
    """Stiffness of two springs in series; 0 where one of them is."""
    total = left + right
    return left * (right / total) if total > 0.0 else 0.0


@jit
def damper_in_series(k_left, h_left, k_right, h_right):
    """Damper (34) beside two springs in series: each counts by the square of its share of the flexibility."""
    total = k_left + k_right
    of_left, of_right = (k_right / total, k_left / total) if total > 0.0 else (0.0, 0.0)
    return h_left * of_left * of_left + h_right * of_right * of_right


@jit
def slowness(k, h):
    """h e [s]: the time within which spring and damper relax; inf for a damper without a spring."""
    return h / k if h > 0.0 else 0.0


@jit_apart
def merge(k, h, left, right):
    """Puts the springs `left` and `right` (numbers) in series into `left`; the larger of their h e [s]."""
    slower = max(slowness(k[left], h[left]), slowness(k[right], h[right]))
    h[left] = damper_in_series(k[left], h[left], k[right], h[right])
    k[left] = in_series(k[left], k[right])
    return slower


@jit
def _close_gap(values, gap, m):
    """Moves what is beyond `gap` one place down, of m values."""
    for i in range(gap, m - 1):
        values[i] = values[i + 1]


@jit_apart
def remove_mass(J, k, h, j, m):
    """Type a at mass j > 0 of m: (29), (32)-(34). Returns the larger h e of the merged springs."""
    total = k[j - 1] + k[j]
    J[j - 1] += J[j] * (k[j - 1] / total)
    if j + 1 < m:
        J[j + 1] += J[j] * (k[j] / total)
    slower = merge(k, h, j - 1, j)
    _close_gap(J, j, m)
    _close_gap(k, j, m)
    _close_gap(h, j, m)
    return slower


@jit_apart
def remove_spring(J, k, h, j, m):
    """Type b at spring j < m - 1 of m: (35)-(38). Returns the larger h e of the merged springs."""
    total = J[j] + J[j + 1]
    to_left, to_right = total / J[j + 1], total / J[j]
    k_own, h_own = k[j], h[j]
    k[j], h[j] = k_own * to_right, h_own * to_right
    slower = merge(k, h, j, j + 1)
    if j > 0:
        k[j + 1], h[j + 1] = k_own * to_left, h_own * to_left
        slower = max(slower, merge(k, h, j - 1, j + 1))
    J[j] = total
    _close_gap(J, j + 1, m)
    _close_gap(k, j + 1, m)
    _close_gap(h, j + 1, m)
    return slower


@jit_apart
def fastest(J, k, m, order, springs_too):
    """Type and number of the partial system to be replaced next, of a chain of m > 1 masses; J_1 is never type a."""
    of_mass, mass = -1.0, 1
    for j in range(1, m):
        square = (k[j - 1] + k[j]) / J[j]
        if square > of_mass:
            of_mass, mass = square, j
    of_spring, spring = -1.0, 0
    for j in range(m - 1):
        square = k[j] / J[j] + k[j] / J[j + 1]
        if square > of_spring:
            of_spring, spring = square, j
    favour = PAPER_TIE if order == PAPER else 1.0
    if springs_too and of_spring > favour * of_mass:
        return TYPE_B, spring
    return TYPE_A, mass


@jit_apart
def step(J, k, h, m, order):
    """One mass less. Returns type and number of the system replaced, and the larger h e of the merged springs [s]."""
    kind, place = fastest(J, k, m, order, True)
    if kind == TYPE_A:
        return kind, place, remove_mass(J, k, h, place, m)
    return kind, place, remove_spring(J, k, h, place, m)
