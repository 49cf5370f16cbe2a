"""Natural frequencies and mode shapes of a chain, every one of them relatively right.

K = B^T diag(k) B with the difference matrix B (`_chain`, (1)), so the squares of the natural frequencies are those of
the singular values of diag(sqrt k) B diag(1/sqrt J). It is bidiagonal, with the squared entries
    q_j = k_j/J_j on the diagonal,  e_j = k_j/J_(j+1) beside it,                                        (1)
each one rounding off; a relative change of an entry moves every frequency by no larger share, however small it is.
dqds keeps that: a step to q', e' with all eigenvalues less by s,
    d_1 = q_1 - s;  q'_j = d_j + e_j,  t = q_(j+1)/q'_j,  e'_j = e_j t,  d_(j+1) = d_j t - s;  q'_n = d_n,  (2)
is exact for entries a few roundings off at its start and its end. s is Laguerre's bound from below of the smallest
eigenvalue, from the traces of the inverse and of its square, which need no subtraction:
    u_1 = 1/q_1,  f = e_j/q_(j+1),  u_(j+1) = f u_j + 1/q_(j+1),  h_(j+1) = u_(j+1)^2 + f (h_j + u_j^2),
    T_1 = sum of u_j,  T_2 = sum of h_j,  s = n/(T_1 + sqrt((n - 1) (n T_2 - T_1^2))).                  (3)
The last q is an eigenvalue as soon as it and the e before it hardly feel each other. What is left without it is not
the step's L U but the next one's U L, with q_(n-1) + e_(n-1) as its last diagonal entry: so the next step ends with
    q'_(n-1) = d_(n-1) + e_(n-1).                                                                       (4)
By that no eigenvalue is off by more than 2 q_n e_(n-1) T_1 (of the n - 1 rows, q_n T_1 < 1/2), the square of what ties
them in U L over the least distance. A step is saved, of four, against waiting for e itself to vanish.
So no step fails, and 32 chains are solved at a time. Digits were lost neither over 12 decades of J and k nor over 80:
3e-15 at 64 inertias, 1e-15 at 8.
Source: Fernando & Parlett, Numer. Math. 67:191 (1994), sections 4 and 6; (3) and (4) derived here.
"""

import math
from typing import NamedTuple

from kernels.drivetrain._chain import same, units
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.columns import entry, in_groups
from kernels.lanes.groups import GROUP, cells_at, room
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.maths.elementary import is_normal, scale

SWEEP_LIMIT = 200
"""Steps for one eigenvalue; 3 to 6 are usual, 60 where two agree to the last digits."""
PATIENCE = 8
"""Steps after which the smallest eigenvalue is looked for in another part."""
_NEGLIGIBLE = 2.0**-106  # a squared entry, so 2^-53 of a frequency
_TINY = 2.0**-60  # 63 of them are less than the last digit
_SPENT = 2.0**-120
_ROUNDING = 2.0**-53
_SQUARE_TURNS = 0.025330295910584444  # 1/(2 pi)^2


class _Row(NamedTuple):
    """The next row's q before the step (2) and its d, the e between, and u and h of (3)."""

    q: float
    d: float
    e: float
    u: float
    h: float


@jit
def _shift(m, first, second, found):
    """s of (3) for m eigenvalues, less what rounding can have added to it; 0 where nothing worth it is left."""
    slack = 12.0 * m * _ROUNDING
    spread = fma(m * (1.0 + slack), second, -first * first)
    bound = m * (1.0 - 2.0 * slack) / (first + sqrt((m - 1.0) * spread))
    return where(bound > _SPENT * found, bound, 0.0)


@jit
def _next(e, inverse, u, h):
    """u and h of (3) one row on."""
    f = e * inverse
    g = f * fma(u, u, h)
    u = fma(f, u, inverse)
    return u, fma(u, u, g)


@jit
def _sweep(m, n, at, rows, shift, active):
    """The step (2) of the leading m > 1 rows, ended by (4): where it lost its sign, and the sums (3) of what it makes.

    T_1 and T_2 of all rows, of all but the last, and of all but the last two.
    """
    old_q = rows[at(0)]
    d = old_q - shift
    nothing = 0.0 * d
    row = _Row(old_q, d, nothing, nothing, nothing)
    lost, sums = not_(d >= 0.0), (nothing, nothing)
    for j in range(m - 2):
        row = _next_row(j, n, at, rows, shift, active, row)
        sums, lost = (sums[0] + row.u, sums[1] + row.h), lost | not_(row.d >= 0.0)
    fewest = sums
    row = _next_row(m - 2, n, at, rows, shift, active, row)
    sums, lost = (sums[0] + row.u, sums[1] + row.h), lost | not_(row.d >= 0.0)
    left = rows[at(n + m - 1)]
    q = row.d + left
    u, h = _next(row.e, 1.0 / q, row.u, row.h)
    rows[at(m - 1)], rows[at(n + m - 1)] = where(active, q, row.q), where(active, 0.0, left)
    return lost, (sums[0] + u, sums[1] + h, *sums, *fewest)


@jit
def _next_row(j, n, at, rows, shift, active, row):
    """One row but the last of (2), and u and h of (3): its d becomes that of the next row."""
    d = row.d
    next_q, old_e = rows[at(j + 1)], rows[at(n + j)]
    q = d + old_e
    inverse = 1.0 / q
    u, h = _next(row.e, inverse, row.u, row.h)
    t = next_q * inverse
    e = old_e * t
    rows[at(j)], rows[at(n + j)] = where(active, q, row.q), where(active, e, old_e)
    return _Row(next_q, fma(d, t, -shift), e, u, h)


@jit
def _fill(n, at, J, k, rows, e_J, e_k):
    """The entries (1), without units; and the sums (3) of them, as of `_sweep`."""
    nothing = 0.0 * k[at(0)]
    e, u, h, sums = nothing, nothing, nothing, (nothing, nothing)
    before, fewest = sums, sums
    for j in range(n):
        stiffness, inertia = scale(k[at(j)], -e_k), scale(J[at(j)], -e_J)
        u, h = _next(e, inertia / stiffness, u, h)
        sums, before, fewest = (sums[0] + u, sums[1] + h), sums, before
        e = stiffness / scale(J[at(j + 1)], -e_J) if j < n - 1 else nothing
        rows[at(j)], rows[at(n + j)] = stiffness / inertia, e
    return *sums, *before, *fewest


@jit
def _traces(m, n, at, rows):
    """T_1 of the leading rows, each after each, for `_split`."""
    f, u, total = 0.0 * rows[at(0)], 0.0 * rows[at(0)], 0.0 * rows[at(0)]
    for j in range(m):
        inverse = 1.0 / rows[at(j)]
        u = fma(f * inverse, u, inverse)
        total = total + u
        rows[at(2 * n + j)] = total
        f = rows[at(n + j)]


@jit
def _joined(e, before, limit):
    """Whether rows hang together by e, more than the last digit of those before it, or of what is above `limit`, tells.

    `before` is T_1 of those before it.
    """
    return (e > _NEGLIGIBLE * limit) & (e * before > _NEGLIGIBLE)


@jit
def _tied(m, n, at, rows, before, found):
    """Whether the e before the last of m > 1 rows cannot be dropped; `found` is how far all have been shifted.

    Without it the others are off by no more than e + sqrt(q e).
    """
    q, e = rows[at(m - 1)], rows[at(n + m - 2)]
    felt = (e > _TINY * found) | (e * q > _NEGLIGIBLE * _TINY * found * found)
    return felt & _joined(e, before, found + q)


@jit
def _unfinished(m, n, at, rows, before, found):
    """Whether the last of m > 1 rows is not an eigenvalue yet.

    It is where it can be dropped with e kept for the next step, as in (4): then all are off by less than 2 q e T_1.
    """
    q, e = rows[at(m - 1)], rows[at(n + m - 2)]
    apart = (q * before < 0.5) & (e * (q * before) <= 0.5 * _TINY * (found + q))
    return _tied(m, n, at, rows, before, found) & not_(apart)


@jit
def _split(m, n, at, rows, found):
    """How many rows end with the part that has the smallest eigenvalue; m where that part is the last.

    By `_traces`: it is where the inverse is largest; there is no second part unless an e is negligible.
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
        joined = _joined(rows[at(n + j - 1)], rows[at(2 * n + j - 1)], limit)
        end = where(not_(joined) & (row < j), j, end)
    return end


@jit
def _unknown(like):
    """Sums of which nothing is known: no shift is taken from them."""
    endless = 0.0 * like + math.inf
    return endless, endless, endless, endless, endless, endless


@jit_apart
def _rotate(m, n, at, rows, found, active, sums):
    """Brings the part with the smallest eigenvalue to the end, where steps can find it; parts have no order.

    The sums of another order are not known: infinite.
    """
    _traces(m, n, at, rows)
    end = _split(m, n, at, rows, found)
    left = where(active & (end < m), end, 0.0)
    rows[at(n + m - 1)] = 0.0 * found
    for j in range(1, m):
        rows[at(n + j - 1)] = where(magnitude(left - j) < 0.5, 0.0, rows[at(n + j - 1)])
    while any_lane(left > 0.0):
        q, e = rows[at(0)], rows[at(n)]
        for j in range(m):
            next_q, next_e = (q, e) if j == m - 1 else (rows[at(j + 1)], rows[at(n + j + 1)])
            rows[at(j)] = where(left > 0.0, next_q, rows[at(j)])
            rows[at(n + j)] = where(left > 0.0, next_e, rows[at(n + j)])
        left = left - 1.0
    return choose(active, _unknown(found), sums)


@jit
def _in_turns(found, more):
    """(found + more)/(2 pi)^2, rounded once."""
    return fma(_SQUARE_TURNS, found, _SQUARE_TURNS * more)


@jit
def _insert(m, n, at, value, frequency):
    """Puts a value before those that are kept, in ascending order, from m on."""
    frequency[at(m)] = value
    for j in range(m, n - 1):
        low, high = frequency[at(j)], frequency[at(j + 1)]
        if not any_lane(low > high):
            return
        frequency[at(j)], frequency[at(j + 1)] = where(low > high, high, low), where(low > high, low, high)


@jit
def _isolate(m, n, at, rows, sums, found, rest, failed):
    """Steps until the last of m > 1 rows is an eigenvalue: the sums, what was found in all as two numbers, failures."""
    active = not_(failed) & ((rows[at(n + m - 1)] > 0.0) | _unfinished(m, n, at, rows, sums[2], found))
    steps = 0
    while any_lane(active) and steps < SWEEP_LIMIT:
        shift = where(active, _shift(m, sums[0], sums[1], found), 0.0)
        lost, new_sums = _sweep(m, n, at, rows, shift, active)
        sums = choose(active, new_sums, sums)
        total = found + shift
        rest = rest + (shift - (total - found))
        found = total
        failed = failed | (active & lost)
        active = active & not_(lost) & _unfinished(m, n, at, rows, sums[2], found)
        steps += 1
        if steps % PATIENCE == 0:
            sums = _rotate(m, n, at, rows, found, active, sums)
    return sums, found, rest, failed | active


@jit
def _eigenvalues(n, at, rows, sums, frequency):
    """Squares of the frequencies, ascending, of the entries in `rows`; True where one did not come.

    `sums` are those of `_sweep`: what is left of them serves the next eigenvalue, without the last row.
    """
    found, rest = 0.0 * rows[at(0)], 0.0 * rows[at(0)]
    failed = found < 0.0
    for m in range(n, 1, -1):
        sums, found, rest, failed = _isolate(m, n, at, rows, sums, found, rest, failed)
        _insert(m - 1, n, at, _in_turns(found, rest + rows[at(m - 1)]), frequency)
        e = rows[at(n + m - 2)]
        rows[at(n + m - 2)] = where(_tied(m, n, at, rows, sums[2], found), e, 0.0)
        sums = sums[2:] + _unknown(found)[:2]
    _insert(0, n, at, _in_turns(found, rest + (rows[at(0)] + rows[at(n)])), frequency)
    return failed


@jit
def frequencies(n, at, J, k, frequency, rows):
    """Natural frequencies [Hz], ascending, of one chain or of a group, as `at` says; and its status.

    `rows` has room for 3 n entries. Free at both ends the first is exactly 0.
    """
    e_J, e_k, sound = units(n, at, J, k)
    sums = _fill(n, at, J, k, rows, e_J, e_k)
    failed = _eigenvalues(n, at, rows, sums, frequency)
    for j in range(n):
        f = scale(sqrt(frequency[at(j)]), 0.5 * (e_k - e_J))
        sound = sound & (is_normal(f) | (not_(k[at(n - 1)] > 0.0) & (j == 0)))
        frequency[at(j)] = f
    return where(sound, where(failed, NOT_CONVERGED, OK), OUT_OF_RANGE)


@jit_apart
def natural_frequencies(n, J, k, frequency, work):
    """`frequencies` of one chain: the first n entries of J [kg m^2], k [N m/rad] and frequency [Hz]."""
    return frequencies(n, same, J, k, frequency, work)


@jit
def row_at(j):
    """Where the j-th row of a buffer of a group begins."""
    return cells_at(j * GROUP)


@jit
def _group(first, columns, rows):
    J, k, frequency, status = columns
    n = J.shape[1]
    part = GROUP * n
    inertias, springs, found, entries = rows, rows[part:], rows[2 * part :], rows[3 * part :]
    for cell in range(GROUP):
        for j in range(n):
            inertias[j * GROUP + cell] = J[first + cell, j]
            springs[j * GROUP + cell] = k[first + cell, j]
    status[cells_at(first)] = frequencies(n, row_at, inertias, springs, found, entries)
    for cell in range(GROUP):
        for j in range(n):
            frequency[first + cell, j] = found[j * GROUP + cell]


@entry()
def natural_frequencies_of_all(J, k, frequency, status):
    """`natural_frequencies` of every row of J, k and frequency, of shape (n_cells, n); and every status."""
    in_groups(_group, (J, k, frequency, status), (room(6 * J.shape[1]),))
