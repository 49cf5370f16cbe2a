"""Complex quotients, a few complex linear equations, and sorting, of one cell."""

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, magnitude


@jit
def size(z):
    """Modulus of a complex number, or up to sqrt 2 more."""
    return magnitude(z.real) + magnitude(z.imag)


@jit
def square(z):
    """Squared modulus."""
    return fma(z.real, z.real, z.imag * z.imag)


@jit
def over(x, y):
    """x/y of complex numbers, abs(y) between 1e-150 and 1e150; NaN for y = 0."""
    inverse = 1.0 / square(y)
    return x * complex(y.real * inverse, -y.imag * inverse)


@jit_apart
def eliminate(A, B, p, q):
    """Brings the (p, p) matrix A to upper triangular form, by the largest pivots, and (p, q) B along."""
    for i in range(p):
        best = i
        for r in range(i + 1, p):
            if size(A[r, i]) > size(A[best, i]):
                best = r
        if best != i:
            for c in range(p):
                A[i, c], A[best, c] = A[best, c], A[i, c]
            for c in range(q):
                B[i, c], B[best, c] = B[best, c], B[i, c]
        inverse = over(1.0 + 0.0j, A[i, i])
        for r in range(i + 1, p):
            factor = A[r, i] * inverse
            for c in range(i + 1, p):
                A[r, c] -= factor * A[i, c]
            for c in range(q):
                B[r, c] -= factor * B[i, c]


@jit
def substitute_back(A, B, column, first, p):
    """Entries first .. p - 1 of that column of A^-1 B in the place of B's, after `eliminate`."""
    for i in range(p - 1, first - 1, -1):
        for c in range(i + 1, p):
            B[i, column] -= A[i, c] * B[c, column]
        B[i, column] = over(B[i, column], A[i, i])


@jit_apart
def sort(values, count):
    """Rising order of the first `count` numbers; by Shell's gaps, so that a thousand take some ten thousand steps."""
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            j = i
            while j >= gap and values[j - gap] > values[j]:
                values[j - gap], values[j] = values[j], values[j - gap]
                j -= gap
        gap //= 2
