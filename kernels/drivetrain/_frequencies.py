"""Natural frequencies of a chain, or of a group of chains, every one of them relatively right.

K = B^T diag(k) B with the difference matrix B (`_chain`, (1)), so the squares of the natural frequencies are those of
the singular values of diag(sqrt k) B diag(1/sqrt J). It is bidiagonal, with the squared entries
    q_j = k_j/J_j on the diagonal,  e_j = k_j/J_(j+1) beside it,                                        (1)
each one rounding off; a relative change of an entry moves every frequency by no larger share, however small it is, and
dqds keeps that. Digits were lost neither over 12 decades of J and k nor over 80: 3e-15 at 64 inertias, 1e-15 at 8.

A step of dqds goes on to q', e' with all eigenvalues less by s,
    d_1 = q_1 - s;  q'_j = d_j + e_j,  t = q_(j+1)/q'_j,  e'_j = e_j t,  d_(j+1) = d_j t - s;  q'_n = d_n,  (2)
and is exact for entries a few roundings off at its start and its end. s is Laguerre's bound from below of the smallest
eigenvalue, from the traces T_1, T_2 of the inverse and of its square, which need no subtraction:
    u_1 = 1/q_1,  f = e_j/q_(j+1),  u_(j+1) = f u_j + 1/q_(j+1),  h_(j+1) = u_(j+1)^2 + f (h_j + u_j^2),
    T_1 = sum of u_j,  T_2 = sum of h_j,  s = n/(T_1 + sqrt((n - 1) (n T_2 - T_1^2))).                  (3)
The last q is an eigenvalue as soon as it and the e before it hardly feel each other. What is left without it is not
the step's L U but the next one's U L, with q_(n-1) + e_(n-1) as its last diagonal entry: so the next step ends with
    q'_(n-1) = d_(n-1) + e_(n-1).                                                                       (4)
By that no eigenvalue is off by more than 2 q_n e_(n-1) T_1 (of the n - 1 rows, q_n T_1 < 1/2), the square of what ties
them in U L over the least distance. A step is saved, of four, against waiting for e itself to vanish.
Every chain of a group drops its rows when it can. Its rows move down then, so that all chains end at row n - 1, and a
row (q, e) = (_BLANK, 0) comes in above: in (2) and (3) that changes no digit of what follows. Waiting for one another,
eigenvalue for eigenvalue, chains would take 1.2 to 1.9 times the steps.
Source: Fernando & Parlett, Numer. Math. 67:191 (1994), sections 4 and 6; (3) and (4) derived here.
"""

import math

from kernels.drivetrain._chain import spread_is_normal
from kernels.lanes.addresses import jit_by_address
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.columns import FEW, few_at
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, nearest, not_, sqrt, where

SWEEP_LIMIT = 200
"""Steps for one eigenvalue; 3 to 6 are usual, 60 where two agree to the last digits."""
PATIENCE = 8
"""Steps after which the smallest eigenvalue is looked for in another part."""
_SQUARE_TURNS = 0.025330295910584444  # 1/(2 pi)^2
_NEGLIGIBLE = 2.0**-106  # a squared entry, so 2^-53 of a frequency
_TINY = 2.0**-60  # 63 of them are less than the last digit
_SPENT = 2.0**-120
_ROUNDING = 2.0**-53
_BLANK = 2.0**360
"""More than 2^54 eigenvalues of entries up to 2^301; what is multiplied by its inverse stays normal down to 2^-662."""


@jit
def row_at(j):
    """Where the j-th row of a buffer of a group begins."""
    return few_at(j * FEW)


@jit
def _same(j):
    """Where entry j of one chain is kept: at j."""
    return j


@jit
def _next_traces(e, inverse, u, h):
    """u and h of (3) one row on, e before it and 1/q in it."""
    f = e * inverse
    g = f * fma(u, u, h)
    u = fma(f, u, inverse)
    return u, fma(u, u, g)


@jit
def _sweep(first, n, at, rows, shift):
    """The step (2) of two rows or more, ended by (4): where it lost its sign, and the sums (3) of what it makes.

    T_1 and T_2 of all rows, of all but the last, and of all but the last two; T_1 of the leading rows is left in `rows`
    behind q and e. Of a chain with one row left it only adds what is kept behind that, as `frequencies` would.
    """
    d = rows[at(first)] - shift
    nothing = 0.0 * d
    e_before, u, h, first_sum, second_sum, lost = nothing, nothing, nothing, nothing, nothing, not_(d >= 0.0)
    fewest = nothing, nothing
    for j in range(first, n - 1):
        fewest = first_sum, second_sum
        e = rows[at(n + j)]
        q = d + e
        inverse = 1.0 / q
        u, h = _next_traces(e_before, inverse, u, h)
        t = rows[at(j + 1)] * inverse
        e_before, d = e * t, fma(d, t, -shift)
        rows[at(j)], rows[at(n + j)] = q, e_before
        first_sum, second_sum, lost = first_sum + u, second_sum + h, lost | not_(d >= 0.0)
        rows[at(2 * n + j)] = first_sum
    q = d + rows[at(2 * n - 1)]
    u, h = _next_traces(e_before, 1.0 / q, u, h)
    rows[at(n - 1)], rows[at(2 * n - 1)], rows[at(3 * n - 1)] = q, nothing, first_sum + u
    return lost, (first_sum + u, second_sum + h, first_sum, second_sum, *fewest)


@jit
def _joined(e, before, limit):
    """Whether rows hang together by e, more than the last digit of those before it, or of what is above `limit`, tells.

    `before` is T_1 of those before it.
    """
    return (e > _NEGLIGIBLE * limit) & (e * before > _NEGLIGIBLE)


@jit_apart
def _rotate(first, n, rows, found):
    """Brings the part of a chain with the smallest eigenvalue to its end, where steps can find it.

    Parts have no order and end at a negligible e. The smallest eigenvalue is where the inverse is largest: where T_1 of
    the leading rows, as `_sweep` leaves it behind q and e, grows most.
    """
    largest, before, row = -1.0, 0.0, first
    for j in range(first, n):
        if rows[2 * n + j] - before > largest:
            row, largest = j, rows[2 * n + j] - before
        before = rows[2 * n + j]
    end = n
    for j in range(n - 1, row, -1):
        if not _joined(rows[n + j - 1], rows[2 * n + j - 1], found * (found / (found + rows[j]))):
            end = j
    if end == n:
        return
    rows[n + end - 1] = 0.0
    for offset in (0, n):
        for low, high in ((first, end), (end, n), (first, n)):  # reversed: each part, then both
            for j in range((high - low) // 2):
                one, other = offset + low + j, offset + high - 1 - j
                rows[one], rows[other] = rows[other], rows[one]


@jit
def frequencies(n, at, lanes, J, k, frequency, rows):
    """Natural frequencies, ascending, of one chain or of `lanes` side by side, as `at` says; where one did not come.

    J and k are without units. Free at both ends the first frequency is exactly 0. `rows` has room for 3 n + 2 entries:
    n of q, n of e, n of T_1 of the leading rows, and two numbers of each chain.
    """
    nothing = 0.0 * k[at(0)]
    e, u, h, sums = nothing, nothing, nothing, (nothing, nothing)
    before, fewest = sums, sums
    for j in range(n):  # the entries (1) and their sums (3)
        u, h = _next_traces(e, J[at(j)] / k[at(j)], u, h)
        sums, before, fewest = (sums[0] + u, sums[1] + h), sums, before
        e = k[at(j)] / J[at(j + 1)] if j < n - 1 else nothing
        rows[at(j)], rows[at(n + j)] = k[at(j)] / J[at(j)], e
    sums = sums + before + fewest
    endless = nothing + math.inf  # a sum of which nothing is known: no shift is taken from it
    # rows left, steps for the last one, what all have been shifted by as two numbers, failure
    left, steps, found, rest, failed, first = nothing + n, nothing, nothing, nothing, nothing < 0.0, 0
    while first < n - 1:
        # of which chains the last row is an eigenvalue
        q, e, traced = rows[at(n - 1)], rows[at(2 * n - 2)], sums[2]
        # whether e cannot be dropped: without it the others are off by no more than e + sqrt(q e)
        tied = (e > _TINY * found) | (e * q > _NEGLIGIBLE * _TINY * found * found)
        tied = tied & _joined(e, traced, found + q)
        # whether q can be with e kept for the next step, as in (4): then all are off by less than 2 q e T_1
        apart = (q * traced < 0.5) & (e * (q * traced) <= 0.5 * _TINY * (found + q))
        done = not_(rows[at(2 * n - 1)] > 0.0) & (not_(tied) | apart)
        ready = (left > 1.5) & (failed | done)
        if any_lane(ready):
            value, j, place = fma(_SQUARE_TURNS, found, _SQUARE_TURNS * (rest + q)), first, where(ready, n - left, -1.0)
            while any_lane(place - j > -0.5):
                frequency[at(j)] = where(magnitude(place - j) < 0.5, value, frequency[at(j)])
                j += 1
            rows[at(2 * n - 2)] = where(ready & not_(tied), 0.0, e)
            for j in range(n - 1, first, -1):
                rows[at(j)] = where(ready, rows[at(j - 1)], rows[at(j)])
                rows[at(n + j)] = where(ready, rows[at(n + j - 1)], rows[at(n + j)])
            rows[at(first)] = where(ready, _BLANK, rows[at(first)])
            rows[at(n + first)] = where(ready, 0.0, rows[at(n + first)])
            sums = choose(ready, (*sums[2:], endless, endless), sums)
            left, steps = where(ready, left - 1.0, left), where(ready, 0.0, steps)
            while first < n - 1 and not any_lane(left > n - first - 0.5):
                first += 1
        if first < n - 1 and not any_lane(ready & not_(tied)):
            # a step of all chains of which more than one row is left; those that are late look elsewhere
            active = left > 1.5
            late = active & (steps > 0.5) & (magnitude(steps - PATIENCE * nearest(steps / PATIENCE)) < 0.5)
            if any_lane(late):
                rows[at(3 * n)], rows[at(3 * n + 1)] = where(late, left, 0.0), found
                for lane in range(lanes):
                    chain = rows[lane::lanes]
                    if chain[3 * n] > 0.0:
                        _rotate(n - int(chain[3 * n]), n, chain, chain[3 * n + 1])
                sums = choose(late, (endless, endless, endless, endless, endless, endless), sums)
            # s of (3), less what rounding can have added to it; 0 where nothing worth it is left
            slack = 12.0 * left * _ROUNDING
            spread = fma(left * (1.0 + slack), sums[1], -sums[0] * sums[0])
            bound = left * (1.0 - 2.0 * slack) / (sums[0] + sqrt((left - 1.0) * spread))
            shift = where(active & (bound > _SPENT * found), bound, 0.0)
            lost, sums = _sweep(first, n, at, rows, shift)
            total = found + shift
            rest, found = rest + (shift - (total - found)), total
            steps = where(active, steps + 1.0, 0.0)
            failed = failed | (active & lost) | (steps > SWEEP_LIMIT - 0.5)
    value = _SQUARE_TURNS * (rest + (rows[at(n - 1)] + rows[at(2 * n - 1)]))
    frequency[at(n - 1)] = fma(_SQUARE_TURNS, found, value)
    for count in range(1, n):  # sorts the squares, which are nearly in order
        j = count
        while j > 0 and any_lane(frequency[at(j - 1)] > frequency[at(j)]):
            one, other = frequency[at(j - 1)], frequency[at(j)]
            frequency[at(j - 1)], frequency[at(j)] = where(one > other, other, one), where(one > other, one, other)
            j -= 1
    for j in range(n):
        frequency[at(j)] = sqrt(frequency[at(j)])
    return failed


@jit_by_address
def natural_frequencies(n, J, k, frequency, work):
    """Status of the n `frequencies` of one chain: OK, OUT_OF_RANGE beyond SPREAD, NOT_CONVERGED."""
    if not (spread_is_normal(n, J) and spread_is_normal(n, k)):
        return OUT_OF_RANGE
    return NOT_CONVERGED if frequencies(n, _same, 1, J, k, frequency, work) else OK
