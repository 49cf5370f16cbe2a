"""A few complex linear equations, and sorting, of one cell."""

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude


@jit
def over(x, y):
    """x/y of complex numbers, by the square of abs(y); NaN for y = 0."""
    square = y.real * y.real + y.imag * y.imag
    scaled = complex(y.real / square, -y.imag / square) if square > 0.0 else complex(float("nan"), 0.0)
    return x * scaled


@jit
def size(z):
    """Modulus of a complex number, or up to sqrt 2 more."""
    return magnitude(z.real) + magnitude(z.imag)


@jit
def _swap(rows, i, j, n):
    for c in range(n):
        rows[i, c], rows[j, c] = rows[j, c], rows[i, c]


@jit
def _pivot(A, i, p):
    """The row from i on that has the largest entry in column i."""
    best = i
    for r in range(i + 1, p):
        if size(A[r, i]) > size(A[best, i]):
            best = r
    return best


@jit_apart
def eliminate(A, B, p, q):
    """Brings the (p, p) matrix A to upper triangular form, by the largest pivots, and (p, q) B along."""
    for i in range(p):
        best = _pivot(A, i, p)
        if best != i:
            _swap(A, i, best, p)
            _swap(B, i, best, q)
        for r in range(i + 1, p):
            factor = over(A[r, i], A[i, i])
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


@jit
def sort(first, count, exceeds, swap, items, gap=1):
    """Rising order of what stands at first .. count - 1 by insertion: what is alike keeps its order.

    Parameters
    ----------
    exceeds : exceeds(items, i, j), whether what stands at i comes after what stands at j
    swap : swap(items, i, j)
    gap : only things that far apart are compared
    """
    for i in range(first + gap, count):
        j = i
        while j >= first + gap and exceeds(items, j - gap, j):
            swap(items, j - gap, j)
            j -= gap


@jit
def _larger(values, i, j):
    return values[i] > values[j]


@jit
def _swap_values(values, i, j):
    values[i], values[j] = values[j], values[i]


@jit_apart
def sort_many(values, count):
    """Rising order of `count` numbers; by Shell's gaps, so that a thousand take some ten thousand steps."""
    gap = count // 2
    while gap > 0:
        sort(0, count, _larger, _swap_values, values, gap)
        gap //= 2
