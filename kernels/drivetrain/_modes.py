"""A modal model: p modes of a chain within the span of a basis of shapes, their damping, and the spindle's receptance.

Vectors are rows. Shape i of the basis enters as W_i = sqrt(J) u_i and G_i = sqrt(k) (its strains), so that its mass
is W_i W_i and its stiffness G_i G_i. By Ritz's method, W and G always alike, the W_i are made orthonormal by Gram and
Schmidt, then the G_i orthogonal, too, by rotations of pairs of rows (one-sided Jacobi): then w_i = |G_i|, and
W_i/sqrt(J) are the modes. No product K or M is ever formed, so graded masses and springs lose no digits but those that
the basis itself has lost.
With the shape at the spindle phi_i and the damping c_ij = sum_l h_l d_il d_jl of strains d it moves by
    q_i'' + sum_j c_ij q_j' + w_i^2 q_i = phi_i M.                                                      (1)
Source: Demmel & Veselic, SIAM J. Matrix Anal. Appl. 13:1204 (1992).
"""

from kernels.drivetrain._chain import CHAIN_POLES, ROUNDING, TURN, extremes
from kernels.drivetrain._poles import modal_poles, undamped_poles
from kernels.lanes.addresses import jit_by_address
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, magnitude, sqrt
from kernels.maths.small_dense import eliminate, substitute_back

SWEEP_LIMIT = 40
_ORTHOGONAL = 2e-16  # cosine below which two rows are orthogonal, times the root of their length


@jit
def _product(x, y, n):
    """x y of two rows of n numbers."""
    total = 0.0
    for j in range(n):
        total = fma(x[j], y[j], total)
    return total


@jit_apart
def _scale_rows(x, y, factor, n):
    """Two rows times a number, in place."""
    for j in range(n):
        x[j] *= factor
        y[j] *= factor


@jit_apart
def _orthogonalise(rows, others, first, p, n):
    """Rotates rows first .. p - 1 until they are orthogonal, and `others` alike. Whether that was reached."""
    small = _ORTHOGONAL * sqrt(1.0 * n)
    for _ in range(SWEEP_LIMIT):
        turned = False
        for i in range(first, p - 1):
            for j in range(i + 1, p):
                a, b = _product(rows[i], rows[i], n), _product(rows[j], rows[j], n)
                d = _product(rows[i], rows[j], n)
                if magnitude(d) > small * sqrt(a) * sqrt(b):
                    cotangent = 0.5 * (b - a) / d  # of twice the smaller angle that makes them orthogonal
                    tangent = 1.0 / (magnitude(cotangent) + sqrt(fma(cotangent, cotangent, 1.0)))
                    tangent = -tangent if cotangent < 0.0 else tangent
                    cosine = 1.0 / sqrt(fma(tangent, tangent, 1.0))
                    sine = cosine * tangent
                    for both in (rows, others):
                        for c in range(n):
                            x, y = both[i, c], both[j, c]
                            both[i, c] = fma(cosine, x, -(sine * y))
                            both[j, c] = fma(sine, x, cosine * y)
                    turned = True
        if not turned:
            return True
    return False


@jit_apart
def _swap(i, j, scene):
    """Exchanges two rows."""
    modes = scene.modes
    for rows in (modes.W, modes.G):
        for c in range(scene.full.J.size):
            rows[i, c], rows[j, c] = rows[j, c], rows[i, c]
    modes.blur[i], modes.blur[j] = modes.blur[j], modes.blur[i]


@jit_apart
def _make_orthonormal(first, p, scene):
    """W to orthonormal rows, G alike, by Gram and Schmidt; the condition of W's rows as they were.

    From soft rows to stiff ones, so that soft ones, of which the low modes are, take no stiff strains in.
    """
    W, G, size, n, least = scene.modes.W, scene.modes.G, scene.modes.spindle, scene.full.J.size, 1.0
    for i in range(p):
        _scale_rows(W[i], G[i], 1.0 / sqrt(_product(W[i], W[i], n)), n)
        size[i], j = _product(G[i], G[i], n), i
        while j > first and size[j - 1] > size[j]:
            size[j - 1], size[j] = size[j], size[j - 1]
            _swap(j - 1, j, scene)
            j -= 1
    for i in range(first, p):
        for j in range(2 * i):
            one = j % i
            d = _product(W[one], W[i], n)
            for c in range(n):
                W[i, c], G[i, c] = fma(-d, W[one, c], W[i, c]), fma(-d, G[one, c], G[i, c])
        left = sqrt(_product(W[i], W[i], n))
        least = min(least, left)
        _scale_rows(W[i], G[i], 1.0 / left, n)
    return 1.0 / least if least > 0.0 else float("inf")


@jit_apart
def _viscous(i, j, scene):
    """c_ij of (1); a damper without a spring, at a free end, is strained by its mass's angle."""
    J, k, h, total = scene.full.J, scene.full.k, scene.full.h, 0.0
    for c in range(J.size):
        if h[c] > 0.0:
            rows, e = (scene.modes.G, k[c]) if k[c] > 0.0 else (scene.modes.W, J[c])
            total = fma(h[c] / e, rows[i, c] * rows[j, c], total)
    return total


@jit_by_address
def ritz(p, scene):
    """Rows W and G of p shapes to those of modes, frequencies rising; a bound on the relative error of these.

    With a free end row 0 is a motion that strains nothing (and G[0] is 0); it is then mode 0, w = 0. Of the others each
    is off by the rounding of every row G_j, of size |G_j|, by its share in the mode; so are the dampers' strains.
    """
    W, G, w, before, size = scene.modes.W, scene.modes.G, scene.modes.w, scene.modes.C, scene.modes.spindle
    n, felt, blurs = scene.full.J.size, scene.room.work, scene.modes.blur
    first = 0 if scene.full.k[n - 1] > 0.0 else 1
    condition = _make_orthonormal(first, p, scene)
    for i in range(p):
        size[i] = sqrt(_product(G[i], G[i], n))
        felt[i] = blurs[i] + 4.0 * ROUNDING * condition * sqrt(n * _viscous(i, i, scene))
        for j in range(n):
            before[i, j] = W[i, j]
    reached = _orthogonalise(G, W, first, p, n)
    w[0], worst = 0.0, 0.0
    for i in range(first, p):
        w[i], j = sqrt(_product(G[i], G[i], n)), i
        while j > first and w[j - 1] > w[j]:
            w[j - 1], w[j] = w[j], w[j - 1]
            _swap(j - 1, j, scene)
            j -= 1
    for i in range(p):
        scene.kept.f[i] = w[i] / TURN
    for i in range(p):
        blur, blurs[i] = 0.0, 0.0
        for j in range(p):
            share = magnitude(_product(before[j], W[i], n))
            blur, blurs[i] = fma(size[j], share, blur), fma(felt[j], share, blurs[i])
        if i >= first:
            worst = max(worst, blur / w[i] if w[i] > 0.0 else float("inf"))
    return ROUNDING * condition * worst * sqrt(1.0 * n) if reached else float("inf")


@jit_by_address
def poles_of_modes(model, scene):
    """Those of chain and model: bounds on the errors of their damping, and how many the model has of its own."""
    full, kept, modes, p = scene.full, scene.kept, scene.modes, model.p
    n = full.J.size
    for i in range(p):
        modes.spindle[i] = modes.W[i, 0] / sqrt(full.J[0])
        for j in range(i, p):
            modes.C[i, j] = modes.C[j, i] = _viscous(i, j, scene)
    error = CHAIN_POLES(scene.parts, full, n, scene.room)
    if not extremes(n, full.h)[1] > 0.0:
        undamped_poles(kept)
        return error, error, 2 * p
    free = not full.k[n - 1] > 0.0
    return error, modal_poles(p, modes, free, model.error, kept.s[: 2 * p], scene.room), 2 * p


@jit_apart
def receptance_of_modes(w, model, scene):
    """Receptance of the spindle by (1), and what the other modes give way at rest."""
    p, modes, total = model.p, scene.modes, 0.0j
    A, B = modes.A, modes.B
    for i in range(p):
        for j in range(p):
            A[i, j] = complex(0.0, w * modes.C[i, j])
        A[i, i] += (modes.w[i] - w) * (modes.w[i] + w)
        B[i, 0] = complex(modes.spindle[i], 0.0)
    eliminate(A, B, p, 1)
    substitute_back(A, B, 0, 0, p)
    for i in range(p):
        total += modes.spindle[i] * B[i, 0]
    return model.residual + total
