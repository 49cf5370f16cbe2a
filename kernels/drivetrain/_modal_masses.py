"""Modes of a chain as a basis: modal reduction (SEREP) and Craig & Bampton's.

Modal: the lowest p modes of the whole chain, so their frequencies are exact; what the others give way at rest stays,
    H(w) = sum_p phi_1^2/(w_i^2 - w^2 + damping) + sum_rest phi_1^2/w_i^2.                           (1)
Craig & Bampton: the shape at rest of a turned spindle, u_j = x_j/x_1, and the lowest p - 1 modes of the chain whose
spindle is held. Held is a spindle of 2^80 times the largest inertia: it moves the other modes by less than 2^-74.
Rows are as in `_ritz`. Source: Craig & Bampton, AIAA J. 6:1313 (1968); O'Callahan et al., 7th IMAC (1989).
"""

from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._chain_shapes import mode_shapes
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, magnitude, sqrt

TURN = 6.283185307179586
HOLD = 2.0**80
"""Inertia of a held spindle, over the largest one."""


@jit_apart
def fill_rows(W, G, J, k, angle, square, n):
    """W and G of a mode u of squared frequency w^2.

    A strain is the difference of two angles, or the torque w^2 sum J u up to there over k: whichever is rounded less.
    """
    torque, rough = 0.0, 0.0
    for j in range(n):
        torque = fma(square * J[j], angle[j], torque)
        rough += magnitude(square * J[j] * angle[j])
        beyond = angle[j + 1] if j + 1 < n else 0.0
        by_torque = rough < k[j] * (magnitude(angle[j]) + magnitude(beyond))
        W[j] = sqrt(J[j]) * angle[j]
        G[j] = torque / sqrt(k[j]) if by_torque and j + 1 < n else sqrt(k[j]) * (angle[j] - beyond)


@jit_apart
def modal(modes, chain, p, shapes, angle, work):
    """The lowest p modes as rows; what the others give way at rest [rad/(N m)] and a status.

    `shapes`, `angle`, `work` : buffers of n n, n and 6 n
    """
    n, residual = chain.J.size, 0.0
    status = mode_shapes(n, chain.J, chain.k, chain.f, shapes, work)
    for i in range(n):
        modes.w[i] = TURN * chain.f[i]
        if i < p:
            for j in range(n):
                angle[j] = shapes[j, i]
            fill_rows(modes.W[i], modes.G[i], chain.J, chain.k, angle, modes.w[i] * modes.w[i], n)
        else:
            residual += (shapes[0, i] / modes.w[i]) * (shapes[0, i] / modes.w[i])
    return residual, status


@jit_apart
def craig_bampton(W, G, J, k, frequency, shapes, angle, p, n, work):
    """Basis of the spindle at rest and p - 1 modes with the spindle held, and a status."""
    at_rest(W[0], G[0], J, k, n)
    if p == 1:
        return 0.0
    own, largest = J[0], 0.0
    for j in range(n):
        largest = max(largest, J[j])
    J[0] = HOLD * largest
    status = natural_frequencies(n, J, k, frequency, work)
    if status == 0.0:
        status = mode_shapes(n, J, k, frequency, shapes, work)
    for i in range(1, p):
        for j in range(n):
            angle[j] = shapes[j, i] if j > 0 else 0.0
        _held_rows(W[i], G[i], J, k, angle, n)
    J[0] = own
    return status


@jit
def _held_rows(W, G, J, k, angle, n):
    """Rows of a mode with the spindle held."""
    for j in range(n):
        beyond = angle[j + 1] if j + 1 < n else 0.0
        W[j], G[j] = sqrt(J[j]) * angle[j], sqrt(k[j]) * (angle[j] - beyond)


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
