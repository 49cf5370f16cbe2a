"""Eigenvalues of a positive bidiagonal matrix's square, every one relatively right, of a chain or a group of them.

From the squared entries q on the diagonal and e beside it, dqds goes on to q', e' with all eigenvalues less by s,
    d_1 = q_1 - s;  q'_j = d_j + e_j,  t = q_(j+1)/q'_j,  e'_j = e_j t,  d_(j+1) = d_j t - s;  q'_n = d_n,  (1)
a step that is exact for entries a few roundings off at its start and its end. s is Laguerre's bound from below of the
smallest eigenvalue, from the traces of the inverse and of its square, which need no subtraction:
    u_1 = 1/q_1,  f = e_j/q_(j+1),  u_(j+1) = f u_j + 1/q_(j+1),  h_(j+1) = u_(j+1)^2 + f (h_j + u_j^2),
    T_1 = sum of u_j,  T_2 = sum of h_j,  s = n/(T_1 + sqrt((n - 1) (n T_2 - T_1^2))).                  (2)
The last q is an eigenvalue as soon as it and the e before it hardly feel each other. What is left without it is not
the step's L U but the next one's U L, with q_(n-1) + e_(n-1) as its last diagonal entry: so the next step ends with
    q'_(n-1) = d_(n-1) + e_(n-1).                                                                       (3)
By that no eigenvalue is off by more than 2 q_n e_(n-1) T_1 (of the n - 1 rows, q_n T_1 < 1/2), the square of what ties
them in U L over the least distance. A step is saved, of four, against waiting for e itself to vanish.
Every chain of a group drops its rows when it can. Its rows move down then, so that all chains end at row n - 1, and a
row (q, e) = (_BLANK, 0) comes in above: in (1) and (2) that changes no digit of what follows. Waiting for one another,
eigenvalue for eigenvalue, chains would take 1.2 to 1.9 times the steps.
Source: Fernando & Parlett, Numer. Math. 67:191 (1994), sections 4 and 6; (2) and (3) derived here.
"""

import math
from typing import NamedTuple

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, nearest, not_, sqrt, where

SWEEP_LIMIT = 200
"""Steps for one eigenvalue; 3 to 6 are usual, 60 where two agree to the last digits."""
PATIENCE = 8
"""Steps after which the smallest eigenvalue is looked for in another part."""
_NEGLIGIBLE = 2.0**-106  # a squared entry, so 2^-53 of a frequency
_TINY = 2.0**-60  # 63 of them are less than the last digit
_SPENT = 2.0**-120
_ROUNDING = 2.0**-53
_BLANK = 2.0**360
"""More than 2^54 eigenvalues of entries up to 2^301; what is multiplied by its inverse stays normal down to 2^-662."""


class _Row(NamedTuple):
    """The next row's d in the step (1), the e before it, and u and h of (2)."""

    d: float
    e: float
    u: float
    h: float


@jit
def _shift(m, first, second, found):
    """s of (2) for m eigenvalues, less what rounding can have added to it; 0 where nothing worth it is left."""
    slack = 12.0 * m * _ROUNDING
    spread = fma(m * (1.0 + slack), second, -first * first)
    bound = m * (1.0 - 2.0 * slack) / (first + sqrt((m - 1.0) * spread))
    return where(bound > _SPENT * found, bound, 0.0)


@jit
def next_traces(e, inverse, u, h):
    """u and h of (2) one row on."""
    f = e * inverse
    g = f * fma(u, u, h)
    u = fma(f, u, inverse)
    return u, fma(u, u, g)


class _Group(NamedTuple):
    """Of each chain: rows left, steps for its last one, sums (2), what was found in all as two numbers, and failure.

    The sums are those of `_sweep`.
    """

    left: float
    steps: float
    sums: tuple
    found: float
    rest: float
    failed: bool


@jit
def _is(number, j):
    """Whether a whole number is j."""
    return magnitude(number - j) < 0.5


@jit
def _sweep(first, n, at, rows, shift):
    """The step (1) of two rows or more, ended by (3): where it lost its sign, and the sums (2) of what it makes.

    T_1 and T_2 of all rows, of all but the last, and of all but the last two. Of a chain with one row left it only adds
    what is kept behind that, as `eigenvalues` would.
    """
    d = rows[at(first)] - shift
    nothing = 0.0 * d
    row, lost, sums = _Row(d, nothing, nothing, nothing), not_(d >= 0.0), (nothing, nothing)
    for j in range(first, n - 2):
        row = _next_row(j, n, at, rows, shift, row)
        sums, lost = (sums[0] + row.u, sums[1] + row.h), lost | not_(row.d >= 0.0)
        rows[at(2 * n + j)] = sums[0]
    fewest = sums
    row = _next_row(n - 2, n, at, rows, shift, row)
    sums, lost = (sums[0] + row.u, sums[1] + row.h), lost | not_(row.d >= 0.0)
    q = row.d + rows[at(2 * n - 1)]
    u, h = next_traces(row.e, 1.0 / q, row.u, row.h)
    rows[at(n - 1)], rows[at(2 * n - 1)] = q, nothing
    rows[at(3 * n - 2)], rows[at(3 * n - 1)] = sums[0], sums[0] + u
    return lost, (sums[0] + u, sums[1] + h, *(sums + fewest))


@jit
def _next_row(j, n, at, rows, shift, row):
    """One row but the last of (1), and u and h of (2): its d becomes that of the next row."""
    old_e = rows[at(n + j)]
    q = row.d + old_e
    inverse = 1.0 / q
    u, h = next_traces(row.e, inverse, row.u, row.h)
    t = rows[at(j + 1)] * inverse
    e = old_e * t
    rows[at(j)], rows[at(n + j)] = q, e
    return _Row(fma(row.d, t, -shift), e, u, h)


@jit
def _joined(e, before, limit):
    """Whether rows hang together by e, more than the last digit of those before it, or of what is above `limit`, tells.

    `before` is T_1 of those before it.
    """
    return (e > _NEGLIGIBLE * limit) & (e * before > _NEGLIGIBLE)


@jit
def _tied(q, e, before, found):
    """Whether the e before the last of m > 1 rows cannot be dropped; `found` is how far all have been shifted.

    Without it the others are off by no more than e + sqrt(q e).
    """
    felt = (e > _TINY * found) | (e * q > _NEGLIGIBLE * _TINY * found * found)
    return felt & _joined(e, before, found + q)


@jit
def _apart(q, e, before, found):
    """Whether the last of m > 1 rows can be dropped with e kept for the next step, as in (3).

    Then all are off by less than 2 q e T_1.
    """
    return (q * before < 0.5) & (e * (q * before) <= 0.5 * _TINY * (found + q))


@jit
def _split(first, n, rows, found):
    """The row before which the part ends that has the smallest eigenvalue; n where that part is the last.

    It is where the inverse is largest; there is no second part unless an e is negligible.
    """
    largest, before, row = -1.0, 0.0, first
    for j in range(first, n):
        if rows[2 * n + j] - before > largest:
            row, largest = j, rows[2 * n + j] - before
        before = rows[2 * n + j]
    for j in range(row + 1, n):
        limit = found * (found / (found + rows[j]))
        if not _joined(rows[n + j - 1], rows[2 * n + j - 1], limit):
            return j
    return n


@jit_apart
def _rotate(first, n, rows, found):
    """Brings the part of a chain with the smallest eigenvalue to its end, where steps can find it.

    Parts have no order. `rows` are q, e and, as `_sweep` leaves them, T_1 of the leading rows.
    """
    end = _split(first, n, rows, found)
    if end == n:
        return
    rows[n + end - 1] = 0.0
    for offset in (0, n):
        _reverse(rows, offset + first, offset + end)
        _reverse(rows, offset + end, offset + n)
        _reverse(rows, offset + first, offset + n)


@jit
def _reverse(rows, low, high):
    for j in range((high - low) // 2):
        rows[low + j], rows[high - 1 - j] = rows[high - 1 - j], rows[low + j]


@jit
def _unknown(like):
    """Sums of which nothing is known: no shift is taken from them."""
    endless = 0.0 * like + math.inf
    return endless, endless, endless, endless, endless, endless


@jit
def _rotate_each(late, left, found, n, at, lanes, rows):
    """`_rotate` of the chains that are late, one by one."""
    rows[at(3 * n)], rows[at(3 * n + 1)] = where(late, left, 0.0), found
    for lane in range(lanes):
        chain = rows[lane::lanes]
        if chain[3 * n] > 0.0:
            _rotate(n - int(chain[3 * n]), n, chain, chain[3 * n + 1])


@jit
def _write(value, place, first, at, values):
    """Puts a value of each chain at its own place; from `first` on, and not where it is beyond."""
    k = first
    left = place - k
    while any_lane(left > -0.5):
        values[at(k)] = where(magnitude(left) < 0.5, value, values[at(k)])
        left = left - 1.0
        k += 1


@jit
def _drop(group, first, ready, tied, n, at, rows):
    """Takes the last row of chains that are ready for it; the `_Group` without it."""
    left, steps, sums, found, rest, failed = group
    rows[at(2 * n - 2)] = where(ready & not_(tied), 0.0, rows[at(2 * n - 2)])
    for j in range(n - 1, first, -1):
        rows[at(j)] = where(ready, rows[at(j - 1)], rows[at(j)])
        rows[at(n + j)] = where(ready, rows[at(n + j - 1)], rows[at(n + j)])
    rows[at(first)] = where(ready, _BLANK, rows[at(first)])
    rows[at(n + first)] = where(ready, 0.0, rows[at(n + first)])
    sums = choose(ready, sums[2:] + _unknown(found)[:2], sums)
    return _Group(where(ready, left - 1.0, left), where(ready, 0.0, steps), sums, found, rest, failed)


@jit
def _ready(group, n, at, rows):
    """Of which chains the last row is an eigenvalue, and where the e before it cannot be dropped."""
    q, e, before, found = rows[at(n - 1)], rows[at(2 * n - 2)], group.sums[2], group.found
    tied = _tied(q, e, before, found)
    done = not_(rows[at(2 * n - 1)] > 0.0) & (not_(tied) | _apart(q, e, before, found))
    return (group.left > 1.5) & (group.failed | done), tied


@jit
def _stepped(group, first, n, at, lanes, rows):
    """The `_Group` after a step of all chains of which more than one row is left."""
    left, steps, sums, found, rest, failed = group
    active = left > 1.5
    late = active & (steps > 0.5) & _is(steps, PATIENCE * nearest(steps / PATIENCE))
    if any_lane(late):
        _rotate_each(late, left, found, n, at, lanes, rows)
        sums = choose(late, _unknown(found), sums)  # those of another order are not known
    shift = where(active, _shift(left, sums[0], sums[1], found), 0.0)
    lost, made = _sweep(first, n, at, rows, shift)
    total = found + shift
    rest = rest + (shift - (total - found))
    steps = where(active, steps + 1.0, 0.0)
    failed = failed | (active & lost) | (steps > SWEEP_LIMIT - 0.5)
    return _Group(left, steps, made, total, rest, failed)


@jit
def _put_in_order(n, at, values):
    """Sorts them, which they nearly are."""
    for k in range(1, n):
        j = k
        while j > 0 and any_lane(values[at(j - 1)] > values[at(j)]):
            one, two = values[at(j - 1)], values[at(j)]
            values[at(j - 1)], values[at(j)] = where(one > two, two, one), where(one > two, one, two)
            j -= 1


@jit
def eigenvalues(n, at, lanes, rows, sums, unit, values):
    """unit times the eigenvalues, ascending, of the entries in `rows`: n of q, n of e; True where one did not come.

    `sums` are those of `_sweep`; `rows` has room for n + 2 more; `lanes` chains are in it side by side.
    """
    nothing = 0.0 * rows[at(0)]
    group, first = _Group(nothing + n, nothing, sums, nothing, nothing, nothing < 0.0), 0
    while first < n - 1:
        ready, tied = _ready(group, n, at, rows)
        if any_lane(ready):
            value = fma(unit, group.found, unit * (group.rest + rows[at(n - 1)]))
            _write(value, where(ready, n - group.left, -1.0), first, at, values)
            group = _drop(group, first, ready, tied, n, at, rows)
            while first < n - 1 and not any_lane(group.left > n - first - 0.5):
                first += 1
        if first < n - 1 and not any_lane(ready & not_(tied)):
            group = _stepped(group, first, n, at, lanes, rows)
    values[at(n - 1)] = fma(unit, group.found, unit * (group.rest + (rows[at(n - 1)] + rows[at(2 * n - 1)])))
    _put_in_order(n, at, values)
    return group.failed
