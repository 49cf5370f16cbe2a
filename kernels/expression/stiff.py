"""Linear equations of the steps of a stiff scene, with the exact Jacobian of its rates.

The Jacobian's entries are derivatives of the recorded expressions (`tangent`); those that are 0 for every motion are
left out. Rows are brought to triangular form one by one, the row with the larger entry becoming the pivot's (pairwise
pivoting), so that no factor exceeds 1.
Source of the pivoting: Sorensen, IEEE Trans. Comput. C-34:274 (1985).
"""

from kernels.expression.series import V


def triangular(matrix, n, zero):
    """The matrix in triangular form: what is above the diagonal, 1 over that, the factors, and which rows were swapped.

    Parameters
    ----------
    matrix : dict from (row, column) to an entry; where there is none it is 0
    n : number of rows
    zero : what stands for those that are 0

    Returns
    -------
    above, over, factors, swaps : dicts from (row, column), from a row, and from the pairs of rows
    """
    a, factors, swaps = dict(matrix), {}, {}
    for k in range(n):
        for r in range(k + 1, n):
            if (r, k) not in a:
                continue
            swap = swaps[k, r] = V.magnitude(a[r, k]) > V.magnitude(a.get((k, k), zero))
            for c in range(k, n):
                if (k, c) in a or (r, c) in a:
                    upper, lower = a.get((k, c), zero), a.get((r, c), zero)
                    a[k, c], a[r, c] = V.where(swap, lower, upper), V.where(swap, upper, lower)
            factor = factors[k, r] = a[r, k] / a[k, k]
            for c in range(k + 1, n):
                if (k, c) in a:
                    a[r, c] = V.fma(-factor, a[k, c], a[r, c])
    above = {place: a[place] for place in sorted(a) if place[1] > place[0]}
    return above, {k: 1.0 / a[k, k] for k in range(n)}, factors, swaps


def solution(above, over, factors, swaps, right):
    """The solution of the equations with what `triangular` gives."""
    x = list(right)
    for (k, r), factor in factors.items():
        up, down = V.where(swaps[k, r], x[r], x[k]), V.where(swaps[k, r], x[k], x[r])
        x[k], x[r] = up, V.fma(-factor, up, down)
    for k in reversed(range(len(x))):
        for (r, c), entry in above.items():
            if r == k:
                x[k] = V.fma(-entry, x[c], x[k])
        x[k] = x[k] * over[k]
    return tuple(x)
