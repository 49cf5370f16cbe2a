"""Rivin's reduction without error: partial systems are replaced by what acts alike at one frequency.

With K_j = k_j + i w h_j and mu = 1 - (w/w0)^2 the static equivalents of `_rivin_merging` become exact:
    a: J* = J K_{j-1}/S, J** = J K_j/S, K* = K_{j-1} K_j/S,  S = K_{j-1} + K_j - w^2 J,
    b: mu times J_j + J_{j+1}, K_left and K_right.
Rivin's rule is mu = 1. The chain of p masses has every frequency of the full one; its masses and springs are
complex, and infinite where w is the frequency w0 of an undamped partial system.
What dangles at the free end carries the spindle's angle: its flexibility is added to that of the chain.
"""

from kernels.drivetrain._rivin_merging import TYPE_A
from kernels.lanes.jit import jit, jit_call


@jit
def over(x, y):
    """x/y of complex numbers, by the square of abs(y); NaN for y = 0."""
    square = y.real * y.real + y.imag * y.imag
    scaled = complex(y.real / square, -y.imag / square) if square > 0.0 else complex(float("nan"), 0.0)
    return x * scaled


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


@jit
def spindle_receptance(J, K, w_square, m):
    """Angle of the first of m masses over a torque on it, the other end held by K_m."""
    below = K[m - 1] - w_square * J[m - 1]
    for j in range(m - 2, -1, -1):
        below = K[j] * over(below, K[j] + below) - w_square * J[j]
    return over(1.0 + 0.0j, below)


@jit_call
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
