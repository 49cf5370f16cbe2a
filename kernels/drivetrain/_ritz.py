"""Ritz's method on a basis of shapes: frequencies and modes of what a chain can do within their span.

Vectors are rows. Shape i of the basis enters as W_i = sqrt(J) u_i and G_i = sqrt(k) (its strains), so that its mass
is W_i W_i and its stiffness G_i G_i. Rotations of pairs of rows, the same in W and G, make first the W_i orthonormal,
then the G_i orthogonal too (one-sided Jacobi): then w_i = |G_i|, and W_i/sqrt(J) are the modes. No product K or M is
ever formed, so graded masses and springs lose no digits but those that the basis itself has lost.
Source: Demmel & Veselic, SIAM J. Matrix Anal. Appl. 13:1204 (1992).
"""

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, magnitude, sqrt
from kernels.maths.small_dense import sort

SWEEP_LIMIT = 40
_ORTHOGONAL = 2e-16  # cosine below which two rows are orthogonal, times the root of their length
_ROUNDING = 4e-16


@jit
def product(x, y, n):
    """x y of two rows of n numbers."""
    total = 0.0
    for j in range(n):
        total = fma(x[j], y[j], total)
    return total


@jit
def length(x, n):
    """The length of a row of n numbers."""
    return sqrt(product(x, x, n))


@jit_apart
def scale_row(x, factor, n):
    """x times a number, in place."""
    for j in range(n):
        x[j] *= factor


@jit
def _rotate(x, y, c, s, n):
    for j in range(n):
        x_j = x[j]
        x[j] = fma(c, x_j, -(s * y[j]))
        y[j] = fma(s, x_j, c * y[j])


@jit
def _angle(a, b, d):
    """Cosine and sine of the smaller rotation that makes two rows orthogonal; a, b their squares, d their product."""
    cotangent = 0.5 * (b - a) / d
    tangent = 1.0 / (magnitude(cotangent) + sqrt(fma(cotangent, cotangent, 1.0)))
    tangent = -tangent if cotangent < 0.0 else tangent
    c = 1.0 / sqrt(fma(tangent, tangent, 1.0))
    return c, c * tangent


@jit_apart
def orthogonalise(rows, others, first, p, n):
    """Rotates rows first .. p - 1 until they are orthogonal, and `others` alike. Whether that was reached."""
    small = _ORTHOGONAL * sqrt(1.0 * n)
    for _ in range(SWEEP_LIMIT):
        turned = False
        for i in range(first, p - 1):
            for j in range(i + 1, p):
                a, b = product(rows[i], rows[i], n), product(rows[j], rows[j], n)
                d = product(rows[i], rows[j], n)
                if magnitude(d) > small * sqrt(a) * sqrt(b):
                    c, s = _angle(a, b, d)
                    _rotate(rows[i], rows[j], c, s, n)
                    _rotate(others[i], others[j], c, s, n)
                    turned = True
        if not turned:
            return True
    return False


@jit_apart
def _make_orthonormal(W, G, first, p, n):
    """W to orthonormal rows, G alike; the condition of W's rows as they were, inf if it failed."""
    for i in range(p):
        size = 1.0 / length(W[i], n)
        scale_row(W[i], size, n)
        scale_row(G[i], size, n)
    for _ in range(2 * first):  # away from the free motion, which strains nothing
        for i in range(1, p):
            d = product(W[0], W[i], n)
            for j in range(n):
                W[i, j] = fma(-d, W[0, j], W[i, j])
    reached = orthogonalise(W, G, first, p, n)
    least, most = 1.0, 1.0
    for i in range(first, p):
        size = length(W[i], n)
        least, most = min(least, size), max(most, size)
        scale_row(W[i], 1.0 / size, n)
        scale_row(G[i], 1.0 / size, n)
    return most / least if reached and least > 0.0 else float("inf")


@jit
def _is_higher(modes, i, j):
    return modes[0][i] > modes[0][j]


@jit
def _swap_modes(modes, i, j):
    w, W, G = modes
    w[i], w[j] = w[j], w[i]
    for c in range(W.shape[1]):
        W[i, c], W[j, c] = W[j, c], W[i, c]
        G[i, c], G[j, c] = G[j, c], G[i, c]


@jit_apart
def _worst(condition, w, before, sizes, W, first, p, n):
    """Largest relative error of a frequency: rounding of each row G_j, of size |G_j|, by its share in mode i."""
    worst = 0.0
    for i in range(first, p):
        blur = 0.0
        for j in range(first, p):
            blur = fma(sizes[j], magnitude(product(before[j], W[i], n)), blur)
        worst = max(worst, blur / w[i] if w[i] > 0.0 else float("inf"))
    return _ROUNDING * condition * worst * sqrt(1.0 * n)


@jit_apart
def ritz(W, G, p, n, free, w, before, sizes):
    """Angular frequencies w of p modes, rising; W and G become those of the modes. Returns a bound on their error.

    `free` : whether row 0 is a motion that strains nothing (and G[0] is 0); it is then mode 0, w = 0
    `before`, `sizes` : buffers, of the shape of W and of w
    """
    first = 1 if free else 0
    condition = _make_orthonormal(W, G, first, p, n)
    for i in range(p):
        sizes[i] = length(G[i], n)
        for j in range(n):
            before[i, j] = W[i, j]
    reached = orthogonalise(G, W, first, p, n)
    w[0] = 0.0
    for i in range(first, p):
        w[i] = length(G[i], n)
    sort(first, p, _is_higher, _swap_modes, (w, W, G))
    return _worst(condition, w, before, sizes, W, first, p, n) if reached else float("inf")
