"""Small linear equations and eigenvalues for columns of cells, by explicit sums and products: same bits everywhere.

A matrix has the shape (n, n, n_cells); numpy's own linear algebra calls a library whose bits depend on the CPU.
"""

import numpy as np

ROUNDS = 60
"""Of corrections of all roots of a polynomial: simple ones settle in ten, double ones to half of their digits."""


def times(A, B):
    """The product of matrices (n, m, cells) and (m, k, cells)."""
    total = np.zeros((len(A), *B.shape[1:]))
    for j in range(A.shape[1]):
        total = total + A[:, j : j + 1] * B[j : j + 1]
    return total


def solved(A, B):
    """The solution X (n, m, cells) of A X = B, by the largest pivots; NaN or infinite where there is none."""
    n, rows = len(A), np.arange(len(A))[:, None]
    M = np.concatenate([A, B], axis=1)
    for k in range(n):
        best = k + np.argmax(abs(M[k:, k]), axis=0)
        order = np.where(rows == k, best, np.where(rows == best, k, rows))
        M = np.take_along_axis(M, order[:, None], 0)
        M[k] = M[k] / M[k, k]
        for r in range(n):
            if r != k:
                M[r] = M[r] - M[r, k] * M[k]
    return M[:, n:]


def most(A):
    """The largest of each column."""
    return np.maximum.reduce(A, axis=0, initial=0.0)


def identity(n, cells):
    return np.broadcast_to(np.eye(n)[:, :, None], (n, n, cells))


def eigenvalues(A, *others):
    """Real parts and sizes of imaginary ones (n, cells), the largest first; and what they differ by from the others'.

    The differences are sums, over other matrices, of distances to the next root of each.
    """
    real, imaginary = _roots(A)
    squares, unsure = real * real + imaginary * imaginary, 0.0 * real
    for B in others:
        x, y = _roots(B)
        apart = (real[:, None] - x[None]) ** 2 + (imaginary[:, None] - y[None]) ** 2
        unsure = unsure + np.sqrt(np.minimum.reduce(apart, axis=1, initial=np.inf))
    order = np.argsort(np.where(np.isnan(squares), 0.0, -squares), axis=0, kind="stable")
    return tuple(np.take_along_axis(part, order, 0) for part in (real, abs(imaginary), unsure))


def largest(real, imaginary):
    """Of those, the first: itself where it is real, else its modulus; 0 where there is none."""
    if not len(real):
        return np.zeros(real.shape[1])
    modulus = np.sqrt(real[0] * real[0] + imaginary[0] * imaginary[0])
    return np.where(imaginary[0] <= 1e-7 * modulus, real[0], modulus)


def _roots(A):
    """Real and imaginary parts of the eigenvalues, in no order: the roots of the characteristic polynomial.

    Its coefficients are those of Faddeev and Le Verrier, c_k = -trace(A M_k)/k, M_(k+1) = A M_k + c_k, good for the few
    states that a scene has; its roots are found at once by the corrections of Durand and Kerner, from within a bound
    of Fujiwara's, a power of two, whatever the units of the states.
    """
    n, one = len(A), identity(len(A), A.shape[-1])
    M, coefficients, bound = one, [np.ones(A.shape[-1])], np.full(A.shape[-1], 1e-300)
    for k in range(1, n + 1):
        AM = times(A, M)
        c = -sum(AM[i, i] for i in range(n)) / k
        bound = np.maximum(bound, np.where(c == 0.0, 0.0, np.ldexp(2.0, -(-np.frexp(c)[1] // k))))
        M = AM + c * one
        coefficients.append(c)
    (real, imaginary), start = np.empty((2, *A.shape[1:])), (1.0, 0.0)
    for j in range(n):  # powers of a number of no symmetry
        real[j], imaginary[j] = start[0] * bound, start[1] * bound
        start = _product(*start, 0.4, 0.9)
    for _ in range(ROUNDS if n > 1 else 1):
        for j in range(n):
            value = coefficients[0], 0.0 * bound
            for c in coefficients[1:]:
                x, y = _product(*value, real[j], imaginary[j])
                value = x + c, y
            for i in range(n):
                if i != j:  # 0 where both are 0, as at two roots that have met
                    (a, b), (c, d) = value, (real[j] - real[i], imaginary[j] - imaginary[i])
                    square = c * c + d * d
                    over, apart = np.where(square > 0.0, square, 1.0), square > 0.0
                    value = np.where(apart, (a * c + b * d) / over, 0.0), np.where(apart, (b * c - a * d) / over, 0.0)
            real[j], imaginary[j] = real[j] - value[0], imaginary[j] - value[1]
    return real, imaginary


def _product(a, b, c, d):
    return a * c - b * d, a * d + b * c
