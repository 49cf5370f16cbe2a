"""Natural frequencies and mode shapes of a chain, every one of them relatively right.

K = B^T diag(k) B with the difference matrix B (`_chain`, (1)), so the squares of the natural frequencies are those of
the singular values of diag(sqrt k) B diag(1/sqrt J). It is bidiagonal, with the squared entries
    q_j = k_j/J_j on the diagonal,  e_j = k_j/J_(j+1) beside it,                                        (1)
each one rounding off; a relative change of an entry moves every frequency by no larger share, however small it is.
dqds keeps that: a step to q', e' with all eigenvalues less by s,
    d_1 = q_1 - s;  q'_j = d_j + e_j,  t = q_(j+1)/q'_j,  e'_j = e_j t,  d_(j+1) = d_j t - s;  q'_n = d_n,  (2)
is exact for entries a few roundings off at its start and its end. s is Laguerre's bound from below of the smallest
eigenvalue, from the traces of the inverse and of its square, which need no subtraction:
    u_1 = 1/q_1,  f = e_j/q_(j+1),  u_(j+1) = f u_j + 1/q_(j+1),  g_(j+1) = f (g_j + u_j^2),
    T_1 = sum of u_j,  T_2 = sum of u_j^2 + 2 g_j,  s = n/(T_1 + sqrt((n - 1) (n T_2 - T_1^2))).           (3)
So no step fails, and 32 chains are solved at a time. Digits were lost neither over 12 decades of J and k nor over 80:
3e-15 at 64 inertias, 1e-15 at 8.
Source: Fernando & Parlett, Numer. Math. 67:191 (1994), sections 4 and 6; traces of (3) derived here.
"""

import math

from kernels._chain import same, units
from kernels._columns import entry
from kernels._groups import GROUP, cells_at, each_group, room, write_row
from kernels._jit import jit, jit_call
from kernels._lanes import fma, isnt, magnitude, some, sqrt, where
from kernels._vecmath import is_normal, scale
from kernels.interface import Status

SWEEP_LIMIT = 200
"""Steps for one eigenvalue; 4 to 6 are usual, 60 where two agree to the last digits."""
PATIENCE = 8
"""Steps after which the smallest eigenvalue is looked for in another part."""
_NEGLIGIBLE = 2.0**-106  # a squared entry, so 2^-53 of a frequency
_TINY = 2.0**-60  # 63 of them are less than the last digit
_SPENT = 2.0**-120
_ROUNDING = 2.0**-53
_OK, _NOT_CONVERGED, _OUT_OF_RANGE = float(Status.OK), float(Status.NOT_CONVERGED), float(Status.OUT_OF_RANGE)
_TURNS = 0.15915494309189535  # 1/(2 pi)


@jit
def _shift(m, first, second, found):
    """s of (3) for m eigenvalues, less what rounding can have added to it; 0 where nothing worth it is left."""
    slack = 12.0 * m * _ROUNDING
    spread = fma(m * (1.0 + slack), second, -first * first)
    bound = m * (1.0 - 2.0 * slack) / (first + sqrt((m - 1.0) * spread))
    return where(bound > _SPENT * found, bound, 0.0)


@jit
def _count(sums, u, g):
    """The sums of (3) with one more term."""
    return sums[0] + u, sums[1] + fma(u, u, 2.0 * g)


@jit
def _sweep(m, n, at, rows, shift, active):
    """The step (2) of the leading m rows with the sums (3) of what it makes; True where it lost its sign."""
    d = rows[at(0)] - shift
    lost = isnt(d >= 0.0)
    e, u, g, sums = 0.0 * d, 0.0 * d, 0.0 * d, (0.0 * d, 0.0 * d)
    for j in range(m):
        last = j == m - 1
        old_q, old_e = rows[at(j)], rows[at(n + j)]
        q = d if last else d + old_e
        inverse = 1.0 / q
        f = e * inverse
        g = f * fma(u, u, g)
        u = fma(f, u, inverse)
        sums = _count(sums, u, g)
        rows[at(j)] = where(active, q, old_q)
        rows[at(2 * n + j)] = where(active, sums[0], rows[at(2 * n + j)])
        rows[at(3 * n + j)] = where(active, sums[1], rows[at(3 * n + j)])
        if not last:
            t = rows[at(j + 1)] * inverse
            e = old_e * t
            rows[at(n + j)] = where(active, e, old_e)
            d = fma(d, t, -shift)
            lost = lost | isnt(d >= 0.0)
    return lost


@jit
def _fill(n, at, J, k, rows, e_J, e_k):
    """The entries (1), without units, and the sums (3) of them."""
    e, u, g = 0.0 * k[at(0)], 0.0 * k[at(0)], 0.0 * k[at(0)]
    sums = u, g
    for j in range(n):
        stiffness, inertia = scale(k[at(j)], -e_k), scale(J[at(j)], -e_J)
        inverse = inertia / stiffness
        f = e * inverse
        g = f * fma(u, u, g)
        u = fma(f, u, inverse)
        sums = _count(sums, u, g)
        rows[at(j)], rows[at(2 * n + j)], rows[at(3 * n + j)] = stiffness / inertia, sums[0], sums[1]
        if j < n - 1:
            e = stiffness / scale(J[at(j + 1)], -e_J)
            rows[at(n + j)] = e


@jit
def _joined(j, n, at, rows, limit):
    """Whether row j hangs on those before it by more than the last digit of theirs, or of what is above `limit`."""
    e = rows[at(n + j - 1)]
    return (e > _NEGLIGIBLE * limit) & (e * rows[at(2 * n + j - 1)] > _NEGLIGIBLE)


@jit
def _unfinished(m, n, at, rows, found):
    """Whether the last of m > 1 rows is not an eigenvalue yet; `found` is how far all of them have been shifted.

    Without e the others are off by no more than e + sqrt(q e).
    """
    q, e = rows[at(m - 1)], rows[at(n + m - 2)]
    felt = (e > _TINY * found) | (e * q > _NEGLIGIBLE * _TINY * found * found)
    return felt & _joined(m - 1, n, at, rows, found + q)


@jit
def _split(m, n, at, rows, found):
    """How many rows end with the part that has the smallest eigenvalue; m where that part is the last.

    It is where the inverse is largest; there is no second part unless an e is negligible.
    """
    largest, before, row = -1.0 + 0.0 * found, 0.0 * found, 0.0 * found
    for j in range(m):
        total = rows[at(2 * n + j)]
        row = where(total - before > largest, j, row)
        largest = where(total - before > largest, total - before, largest)
        before = total
    end = 0.0 * found + m
    for j in range(m - 1, 0, -1):
        limit = found * (found / (found + rows[at(j)]))
        end = where(isnt(_joined(j, n, at, rows, limit)) & (row < j), j, end)
    return end


@jit_call
def _rotate(m, n, at, rows, found, active):
    """Brings the part with the smallest eigenvalue to the end, where steps can find it; parts have no order."""
    end = _split(m, n, at, rows, found)
    left = where(active & (end < m), end, 0.0)
    rows[at(n + m - 1)] = 0.0 * found
    for j in range(1, m):
        rows[at(n + j - 1)] = where(magnitude(left - j) < 0.5, 0.0, rows[at(n + j - 1)])
    while some(left > 0.0):
        q, e = rows[at(0)], rows[at(n)]
        for j in range(m):
            next_q, next_e = (q, e) if j == m - 1 else (rows[at(j + 1)], rows[at(n + j + 1)])
            rows[at(j)] = where(left > 0.0, next_q, rows[at(j)])
            rows[at(n + j)] = where(left > 0.0, next_e, rows[at(n + j)])
        left = left - 1.0
    for j in range(m):  # sums of another order
        rows[at(2 * n + j)] = where(active, math.inf, rows[at(2 * n + j)])


@jit
def _insert(m, n, at, value, frequency):
    """Puts a value before those that are kept, in ascending order, from m on."""
    frequency[at(m)] = value
    for j in range(m, n - 1):
        low, high = frequency[at(j)], frequency[at(j + 1)]
        if not some(low > high):
            return
        frequency[at(j)], frequency[at(j + 1)] = where(low > high, high, low), where(low > high, low, high)


@jit
def _eigenvalues(n, at, rows, frequency):
    """Eigenvalues of the entries in `rows`, ascending; True where one did not come."""
    found, rest = 0.0 * rows[at(0)], 0.0 * rows[at(0)]
    failed = found < 0.0
    for m in range(n, 0, -1):
        active = isnt(failed) & (_unfinished(m, n, at, rows, found) if m > 1 else failed)
        steps = 0
        while some(active) and steps < SWEEP_LIMIT:
            shift = where(active, _shift(m, rows[at(2 * n + m - 1)], rows[at(3 * n + m - 1)], found), 0.0)
            lost = _sweep(m, n, at, rows, shift, active)
            total = found + shift
            rest = rest + (shift - (total - found))
            found = total
            failed = failed | (active & lost)
            active = active & isnt(lost) & _unfinished(m, n, at, rows, found)
            steps += 1
            if steps % PATIENCE == 0:
                _rotate(m, n, at, rows, found, active)
        failed = failed | active
        _insert(m - 1, n, at, found + (rest + rows[at(m - 1)]), frequency)
    return failed


@jit
def frequencies(n, at, J, k, frequency, rows):
    """Natural frequencies [Hz], ascending, of one chain or of a group, as `at` says; and its status.

    `rows` has room for 4 n entries. Free at both ends the first is exactly 0.
    """
    e_J, e_k, sound = units(n, at, J, k)
    _fill(n, at, J, k, rows, e_J, e_k)
    failed = _eigenvalues(n, at, rows, frequency)
    for j in range(n):
        f = scale(sqrt(frequency[at(j)]) * _TURNS, 0.5 * (e_k - e_J))
        sound = sound & (is_normal(f) | (isnt(k[at(n - 1)] > 0.0) & (j == 0)))
        frequency[at(j)] = f
    return where(sound, where(failed, _NOT_CONVERGED, _OK), _OUT_OF_RANGE)


@jit_call
def natural_frequencies(n, J, k, frequency, work):
    """`frequencies` of one chain: the first n entries of J [kg m^2], k [N m/rad] and frequency [Hz]."""
    return frequencies(n, same, J, k, frequency, work)


@jit
def row_at(j):
    """Where the j-th row of a buffer of a group begins."""
    return cells_at(j * GROUP)


@jit
def _group(first, J, k, frequency, status, rows):
    n = J.shape[1]
    part = GROUP * n
    inertias, springs, found, entries = rows, rows[part:], rows[2 * part :], rows[3 * part :]
    for j in range(n):
        for cell in range(GROUP):
            inertias[j * GROUP + cell] = J[first + cell, j]
            springs[j * GROUP + cell] = k[first + cell, j]
    verdict = frequencies(n, row_at, inertias, springs, found, entries)
    for j in range(n):
        write_row(first, j, found[row_at(j)], entries, frequency)
    entries[row_at(0)] = verdict
    for cell in range(GROUP):
        status[first + cell] = entries[cell]


@entry()
def natural_frequencies_of_all(J, k, frequency, status):
    """`natural_frequencies` of every row of J, k and frequency, of shape (n_cells, n); and every status."""
    each_group(_group, (J, k, frequency, status, room(7 * J.shape[1])))
