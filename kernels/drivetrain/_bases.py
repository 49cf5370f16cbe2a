"""Shapes as a basis of reduced models (`_modes`): Guyan's and IRS, Craig & Bampton's, and modes.

Guyan: the angles of some masses, the masters, carry all others along. Between two of them the chain follows as it does
at rest,
    u_i = (r_i u_left + l_i u_right)/(l_i + r_i),  l_i, r_i: flexibility from i to either master,      (1)
so the springs between them are in series, and the full mass matrix T^T J T has masses between neighbours, too. (Its
row sums are Rivin's type a.) Masters are what Rivin's rule leaves if it only takes masses (type a): the spindle always,
then those of small (k_left + k_right)/J.
IRS adds what the inertia of the others does at the frequency that (1) gives each mode,
    u_i += w^2 sum_m g_im J_m u_m,  g_im = l_min r_max/(l_i + r_i).                                    (2)
Craig & Bampton: the shape at rest of a turned spindle, u_j = x_j/x_1, and the lowest p - 1 modes of the chain whose
spindle is held. Held is a spindle of 2^80 times the largest inertia: it moves the other modes by less than 2^-74.
Modal (SEREP): the lowest p modes of the whole chain, so their frequencies are exact; what the others give way at rest
stays,
    H(w) = sum_p phi_1^2/(w_i^2 - w^2 + damping) + sum_rest phi_1^2/w_i^2.                             (3)
All but the last are upper bounds of the frequencies.
Source: Guyan, AIAA J. 3:380 (1965); O'Callahan, Proc. 7th IMAC (1989) 17; Craig & Bampton, AIAA J. 6:1313 (1968);
O'Callahan et al., 7th IMAC (1989).
"""

from kernels.drivetrain._chain import FREQUENCIES, RITZ, ROUNDING, STATIC, TURN, Model, extremes
from kernels.drivetrain._holzer import SHAPE, mode, mode_rows
from kernels.drivetrain._rivin import step
from kernels.lanes.addresses import jit_by_address
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import sqrt
from kernels.maths.small_dense import square

HOLD = 2.0**80
"""Inertia of a held spindle, over the largest one."""


@jit_apart
def _flexibility(k, start, end):
    """Sum of 1/k of the springs start .. end - 1; inf for one of stiffness 0."""
    total = 0.0
    for j in range(start, end):
        total += 1.0 / k[j]
    return total


@jit
def _share(part, whole):
    """part/whole, for a part that is finite; 0 of an infinite whole."""
    return part / whole if whole < float("inf") else 0.0


@jit_apart
def _mix_in(i, first, p, f, scene):
    """What rounding brings of mode i, of p or later, into the strains of those from `first` on; its sum J abs x^2."""
    chain, room, blur = scene.full, scene.room, scene.modes.blur
    n = chain.J.size
    solid, viscous, _ = mode(n, chain.J, chain.k, chain.h, TURN * f[i], room.ways, room.e)
    for j in range(first, p):
        blur[j] += ROUNDING * n * f[j] / (f[i] - f[j]) * sqrt(viscous / solid)
    return solid


@jit_by_address
def guyan(p, order, scene):
    """The basis (1): each master turned by 1 while the others stand; with free ends, row 0 is all turned by 1.

    The model's `slower` is the largest h e [s] of the springs that come in series.
    """
    full, kept, masters, n, slower = scene.full, scene.kept, scene.steps[0], scene.full.J.size, 0.0
    J, k, W, G = full.J, full.k, scene.modes.W, scene.modes.G
    for i in range(n):
        masters[i] = i
        kept.J[i], kept.k[i], kept.h[i] = J[i], k[i], full.h[i]
    for m in range(n, p, -1):
        _, place, late = step(kept.J, kept.k, kept.h, m, order, False)
        slower = max(slower, late)
        for i in range(place, m - 1):
            masters[i] = masters[i + 1]
    for i in range(p):
        scene.modes.blur[i] = 0.0
        for j in range(n):
            W[i, j], G[i, j] = 0.0, 0.0
    for i in range(p):
        left, right = int(masters[i]), int(masters[i + 1]) if i + 1 < p else n
        whole, along = _flexibility(k, left, right), 0.0
        for j in range(left, right):
            share = _share(along, whole)  # of the flexibility between the masters, up to mass j
            rest = 1.0 - share if share < 0.5 else _share(_flexibility(k, j, right), whole)
            W[i, j] = rest * sqrt(J[j])
            G[i, j] = _share(1.0 / sqrt(k[j]), whole) if k[j] > 0.0 else 0.0
            if i + 1 < p:
                W[i + 1, j] = share * sqrt(J[j])
                G[i + 1, j] = -G[i, j]
            along += 1.0 / k[j]
    if not k[n - 1] > 0.0:
        for j in range(n):
            W[0, j], G[0, j] = sqrt(J[j]), 0.0
    return Model(p, RITZ(scene.parts, p, scene), slower, 0.0, 0.0)


@jit_apart
def _add_span(W, G, chain, angle, w_square, left, right):
    """(2) between the masters `left` and `right`, and its strains: those of each torque on both sides of it.

    Returns what angles of 1/sqrt(J) that rounding leaves come to in that: sum w^2 J_m g_mm, and strains of dampers.
    """
    J, k, h, _, _ = chain
    whole, grown, felt = _flexibility(k, left, right), 0.0, 0.0
    for m in range(left + 1, right):
        torque = w_square * J[m] * angle[m]
        to_left, to_right = _flexibility(k, left, m), _flexibility(k, m, right)
        held_left = to_right / whole if whole < float("inf") else 1.0  # share of the torque that the left master bears
        held_right = _share(to_left, whole)
        at_m = torque * to_left * held_left
        grown += w_square * J[m] * to_left * held_left
        turned, viscous = 0.0, 0.0
        for j in range(left, m):
            G[j] -= torque * held_left / sqrt(k[j])
            viscous += h[j] * square(held_left / k[j])
            turned += 1.0 / k[j]
            W[j + 1] += sqrt(J[j + 1]) * torque * held_left * turned
        turned = 0.0
        for j in range(right - 1, m - 1, -1):
            if held_right > 0.0:
                G[j] += torque * held_right / sqrt(k[j])
                viscous += h[j] * square(held_right / k[j])
                turned += 1.0 / k[j]
            if j > m:
                W[j] += sqrt(J[j]) * (torque * held_right * turned if held_right > 0.0 else at_m)
        felt += w_square * sqrt(J[m] * viscous)
    return grown, felt


@jit_by_address
def irs(p, order, scene):
    """Guyan's modes with (2) added to each, as a basis."""
    static = STATIC(scene.parts, p, order, scene)
    J, masters, modes, most = scene.full.J, scene.steps[0], scene.modes, 0.0
    for i in range(p):
        grown = 0.0
        for j in range(J.size):
            modes.spindle[j] = modes.W[i, j] / sqrt(J[j])
        for span in range(p):
            left, right = int(masters[span]), int(masters[span + 1]) if span + 1 < p else J.size
            w_square = modes.w[i] * modes.w[i]
            more, felt = _add_span(modes.W[i], modes.G[i], scene.full, modes.spindle, w_square, left, right)
            grown += more
            modes.blur[i] += static.error * felt
        most = max(most, grown)
    error = (1.0 + most) * static.error + 3.0 * RITZ(scene.parts, p, scene)  # rows of sums
    return Model(p, error, static.slower, 0.0, 0.0)


@jit_by_address
def craig_bampton(p, order, scene):
    """The spindle at rest, all turned by 1 where the last end is free, and p - 1 modes with the spindle held."""
    J, k, h, modes, room, status = scene.full.J, scene.full.k, scene.full.h, scene.modes, scene.room, 0.0
    n, whole, along = J.size, _flexibility(k, 0, J.size), 0.0
    held = whole < float("inf")
    for j in range(n - 1, -1, -1):
        along += 1.0 / k[j]
        modes.blur[j], modes.W[0, j] = 0.0, sqrt(J[j]) * (along / whole if held else 1.0)
        modes.G[0, j] = 1.0 / (sqrt(k[j]) * whole) if held else 0.0
    if p > 1:
        own, J[0] = J[0], HOLD * extremes(n, J)[1]
        status = FREQUENCIES(scene.parts, n, J, k, scene.kept.f, room.work)
        for i in range(1, p):
            mode_rows(n, J, k, h, TURN * scene.kept.f[i], modes.W[i], modes.G[i], room.ways, room.e)
            modes.W[i, 0] = 0.0
        for i in range(p, n):
            _mix_in(i, 1, p, scene.kept.f, scene)
        J[0] = own
    return Model(p, RITZ(scene.parts, p, scene), 0.0, 0.0, status)


@jit_by_address
def modal(p, order, scene):
    """The lowest p modes, and what the others give way at rest (3)."""
    full, modes, room, residual = scene.full, scene.modes, scene.room, 0.0
    for i in range(full.J.size):
        scene.kept.f[i], modes.w[i], modes.blur[i] = full.f[i], TURN * full.f[i], 0.0
        if i < p:
            mode_rows(full.J.size, full.J, full.k, full.h, modes.w[i], modes.W[i], modes.G[i], room.ways, room.e)
        else:
            solid = _mix_in(i, 0, p, full.f, scene)
            residual += square(room.ways[SHAPE, 0] / modes.w[i]) / solid
    error = max(RITZ(scene.parts, p, scene), ROUNDING * full.J.size)  # makes close modes orthogonal
    for i in range(p):
        scene.kept.f[i], modes.w[i] = full.f[i], TURN * full.f[i]
    return Model(p, error, 0.0, residual, 0.0)
