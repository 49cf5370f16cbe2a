"""Receptance of the spindle by a reduced model, and how far it is off within a band.

A *modal model* is p modes: w_i, the shape at the spindle phi_i, and the damping c_ij = sum_l h_l d_il d_jl of their
strains d. It moves as x = sum phi_i q_i,
    q_i'' + sum_j c_ij q_j' + w_i^2 q_i = phi_i M.                                                   (1)
"""

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, sqrt
from kernels.maths.elementary import exp, log
from kernels.maths.small_dense import eliminate, square, substitute_back

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
def sample_poles(at, filled, w_max, s, count):
    """Adds frequencies close around each of `count` poles; how many there are then."""
    for i in range(count):
        if s[i].imag > 0.0:
            for t in AROUND:
                w = fma(-t, s[i].real, s[i].imag)
                if w > 0.0 and w < w_max:
                    at[filled] = w
                    filled += 1
    return filled


@jit
def least_damping(s, w_max, count):
    """Smallest zeta of the poles in the band; 1 where there are none."""
    least = 1.0
    for i in range(count):
        if s[i].imag > 0.0 and s[i].imag <= w_max:
            least = min(least, -s[i].real / sqrt(square(s[i])))
    return least
