"""Receptance of the spindle by a reduced model, and how far it is off within a band.

A *modal model* is p modes: w_i, the shape at the spindle phi_i, and the damping c_ij = sum_l h_l d_il d_jl of their
strains d. It moves as x = sum phi_i q_i,
    q_i'' + sum_j c_ij q_j' + w_i^2 q_i = phi_i M.                                                   (1)
"""

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, sqrt
from kernels.maths.elementary import exp, log
from kernels.maths.small_dense import eliminate, over, substitute_back

AROUND = (-16.0, -8.0, -4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Where a resonance is looked at, in its half widths."""
GRID = 96
"""Further frequencies, evenly over the logarithm of the band."""


@jit_apart
def damping_matrix(C, W, G, chain, p):
    """c_ij of (1) from rows W, G; a damper without a spring, at a free end, is strained by its mass's angle."""
    J, k, h = chain.J, chain.k, chain.h
    for i in range(p):
        for j in range(i, p):
            total = 0.0
            for c in range(J.size):
                if h[c] > 0.0:
                    by_spring = k[c] > 0.0
                    strains = G[i, c] * G[j, c] if by_spring else W[i, c] * W[j, c]
                    total = fma(h[c] / (k[c] if by_spring else J[c]), strains, total)
            C[i, j] = C[j, i] = total


@jit_apart
def modal_receptance(w, modes, p, A, B):
    """Receptance of the spindle by (1); `A` and `B` are square complex buffers."""
    for i in range(p):
        for j in range(p):
            A[i, j] = complex(0.0, w * modes.C[i, j])
        A[i, i] += (modes.w[i] - w) * (modes.w[i] + w)
        B[i, 0] = complex(modes.spindle[i], 0.0)
    eliminate(A, B, p, 1)
    substitute_back(A, B, 0, 0, p)
    total = 0.0j
    for i in range(p):
        total += modes.spindle[i] * B[i, 0]
    return total


@jit
def spindle_receptance(J, K, w_square, m):
    """Angle of the first of m masses over a torque on it, the other end held by K_m."""
    below = K[m - 1] - w_square * J[m - 1]
    for j in range(m - 2, -1, -1):
        below = K[j] * over(below, K[j] + below) - w_square * J[j]
    return over(1.0 + 0.0j, below)


@jit_apart
def chain_receptance(w, J, k, h, m, J_w, K_w):
    """Receptance of the first of m masses of a chain; `J_w` and `K_w` are complex buffers."""
    for j in range(m):
        J_w[j], K_w[j] = complex(J[j], 0.0), complex(k[j], w * h[j])
    return spindle_receptance(J_w, K_w, w * w, m)


@jit_apart
def sample_grid(at, w_max, lowest):
    """Fills `at` with 0, w_max and frequencies between, even on a log scale; how many there are."""
    at[0], at[1] = 0.0, w_max
    w = min(lowest, w_max) / 32.0
    ratio = exp(log(w_max / w) / GRID)
    for i in range(GRID):
        at[2 + i] = w
        w *= ratio
    return 2 + GRID


@jit_apart
def sample_poles(at, filled, w_max, pole_re, pole_im, count):
    """Adds frequencies close around each of `count` poles; how many there are then."""
    for i in range(count):
        if pole_im[i] > 0.0:
            for t in AROUND:
                w = fma(-t, pole_re[i], pole_im[i])
                if w > 0.0 and w < w_max:
                    at[filled] = w
                    filled += 1
    return filled


@jit
def least_damping(pole_re, pole_im, w_max, count):
    """Smallest zeta of the poles in the band; 1 where there are none."""
    least = 1.0
    for i in range(count):
        size = sqrt(fma(pole_re[i], pole_re[i], pole_im[i] * pole_im[i]))
        if pole_im[i] > 0.0 and pole_im[i] <= w_max:
            least = min(least, -pole_re[i] / size)
    return least
