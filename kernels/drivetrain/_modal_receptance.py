"""Receptance of the spindle by a reduced model, and how far it is off within a band.

A *modal model* is p modes: w_i, the shape at the spindle phi_i, and the damping c_ij = sum_l h_l d_il d_jl of their
strains d. It moves as x = sum phi_i q_i,
    q_i'' + sum_j c_ij q_j' + w_i^2 q_i = phi_i M.                                                   (1)
"""

from kernels.drivetrain._rivin_exact_model import over, spindle_receptance
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, magnitude, sqrt
from kernels.maths.elementary import exp, log

AROUND = (-16.0, -8.0, -4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Where a resonance is looked at, in its half widths."""
GRID = 96
"""Further frequencies, evenly over the logarithm of the band."""


@jit_call
def damping_matrix(C, W, G, J, k, h, p, n):
    """c_ij of (1) from rows W, G; a damper without a spring, at a free end, is strained by its mass's angle."""
    for i in range(p):
        for j in range(i, p):
            total = 0.0
            for c in range(n):
                if h[c] > 0.0:
                    by_spring = k[c] > 0.0
                    strains = G[i, c] * G[j, c] if by_spring else W[i, c] * W[j, c]
                    total = fma(h[c] / (k[c] if by_spring else J[c]), strains, total)
            C[i, j] = C[j, i] = total


@jit
def _swap_rows(A, b, i, j, p):
    for c in range(p):
        A[i, c], A[j, c] = A[j, c], A[i, c]
    b[i], b[j] = b[j], b[i]


@jit_call
def solve_in_place(A, b, p):
    """b := A^-1 b for complex A, by elimination with the largest pivot of each column."""
    for i in range(p):
        best, largest = i, 0.0
        for r in range(i, p):
            size = magnitude(A[r, i].real) + magnitude(A[r, i].imag)
            if size > largest:
                best, largest = r, size
        if best != i:
            _swap_rows(A, b, i, best, p)
        for r in range(i + 1, p):
            factor = over(A[r, i], A[i, i])
            for c in range(i + 1, p):
                A[r, c] -= factor * A[i, c]
            b[r] -= factor * b[i]
    for i in range(p - 1, -1, -1):
        for c in range(i + 1, p):
            b[i] -= A[i, c] * b[c]
        b[i] = over(b[i], A[i, i])


@jit_call
def modal_receptance(w, frequencies, shape, C, p, A, b):
    """Receptance of the spindle by (1); `A` and `b` are complex buffers."""
    for i in range(p):
        for j in range(p):
            A[i, j] = complex(0.0, w * C[i, j])
        A[i, i] += (frequencies[i] - w) * (frequencies[i] + w)
        b[i] = complex(shape[i], 0.0)
    solve_in_place(A, b, p)
    total = 0.0j
    for i in range(p):
        total += shape[i] * b[i]
    return total


@jit_call
def chain_receptance(w, J, k, h, m, J_w, K_w):
    """Receptance of the first of m masses of a chain; `J_w` and `K_w` are complex buffers."""
    for j in range(m):
        J_w[j], K_w[j] = complex(J[j], 0.0), complex(k[j], w * h[j])
    return spindle_receptance(J_w, K_w, w * w, m)


@jit_call
def sample_grid(at, w_max, lowest):
    """Fills `at` with 0, w_max and frequencies between, even on a log scale; how many there are."""
    at[0], at[1] = 0.0, w_max
    w = min(lowest, w_max) / 32.0
    ratio = exp(log(w_max / w) / GRID)
    for i in range(GRID):
        at[2 + i] = w
        w *= ratio
    return 2 + GRID


@jit_call
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


@jit_call
def sort(values, count):
    """Rising order of `count` values; Shell's gaps, so that a thousand take some ten thousand steps."""
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            value, j = values[i], i
            while j >= gap and values[j - gap] > value:
                values[j] = values[j - gap]
                j -= gap
            values[j] = value
        gap //= 2


@jit
def least_damping(pole_re, pole_im, w_max, count):
    """Smallest zeta of the poles in the band; 1 where there are none."""
    least = 1.0
    for i in range(count):
        size = sqrt(fma(pole_re[i], pole_re[i], pole_im[i] * pole_im[i]))
        if pole_im[i] > 0.0 and pole_im[i] <= w_max:
            least = min(least, -pole_re[i] / size)
    return least
