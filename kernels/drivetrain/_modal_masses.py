"""Modes of a chain as a basis: modal reduction (SEREP) and Craig & Bampton's.

Modal: the lowest p modes of the whole chain, so their frequencies are exact; what the others give way at rest stays,
    H(w) = sum_p phi_1^2/(w_i^2 - w^2 + damping) + sum_rest phi_1^2/w_i^2.                           (1)
Craig & Bampton: the shape at rest of a turned spindle, u_j = x_j/x_1, and the lowest p - 1 modes of the chain whose
spindle is held. Held is a spindle of 2^80 times the largest inertia: it moves the other modes by less than 2^-74.
Rows are as in `_ritz`. Source: Craig & Bampton, AIAA J. 6:1313 (1968); O'Callahan et al., 7th IMAC (1989).
"""

from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._holzer import SHAPE, mode, mode_rows
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import sqrt
from kernels.maths.small_dense import square

TURN = 6.283185307179586
HOLD = 2.0**80
"""Inertia of a held spindle, over the largest one."""


@jit_apart
def modal(modes, chain, p, room):
    """The lowest p modes as rows; what the others give way at rest [rad/(N m)]."""
    n, residual = chain.J.size, 0.0
    for i in range(n):
        modes.w[i] = TURN * chain.f[i]
        if i < p:
            mode_rows(n, chain.J, chain.k, chain.h, modes.w[i], modes.W[i], modes.G[i], room.ways, room.e)
        else:
            solid, _, _ = mode(n, chain.J, chain.k, chain.h, modes.w[i], room.ways, room.e)
            residual += square(room.ways[SHAPE, 0] / modes.w[i]) / solid
    return residual


@jit_apart
def craig_bampton(W, G, J, k, h, frequency, p, n, room):
    """Basis of the spindle at rest and p - 1 modes with the spindle held, and a status."""
    at_rest(W[0], G[0], J, k, n)
    if p == 1:
        return 0.0
    own, largest = J[0], 0.0
    for j in range(n):
        largest = max(largest, J[j])
    J[0] = HOLD * largest
    status = natural_frequencies(n, J, k, frequency, room.work)
    for i in range(1, p):
        mode_rows(n, J, k, h, TURN * frequency[i], W[i], G[i], room.ways, room.e)
        W[i, 0] = 0.0
    J[0] = own
    return status


@jit
def at_rest(W, G, J, k, n):
    """Rows of the chain at rest with the spindle turned by 1: u_j = x_j/x_1, all 1 where the last end is free."""
    whole, along = 0.0, 0.0
    for j in range(n):
        whole += 1.0 / k[j]
    for j in range(n - 1, -1, -1):
        along += 1.0 / k[j]
        held = whole < float("inf")
        W[j] = sqrt(J[j]) * (along / whole if held else 1.0)
        G[j] = 1.0 / (sqrt(k[j]) * whole) if held else 0.0
