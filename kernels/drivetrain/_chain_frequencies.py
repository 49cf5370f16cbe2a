"""Natural frequencies of a chain, every one of them relatively right.

K = B^T diag(k) B with the difference matrix B (`_chain`, (1)), so the squares of the natural frequencies are those of
the singular values of diag(sqrt k) B diag(1/sqrt J). It is bidiagonal, with the squared entries
    q_j = k_j/J_j on the diagonal,  e_j = k_j/J_(j+1) beside it,                                        (1)
each one rounding off; a relative change of an entry moves every frequency by no larger share, however small it is, and
`_dqds` keeps that. So no step fails, and 32 chains are solved at a time. Digits were lost neither over 12 decades of J
and k nor over 80: 3e-15 at 64 inertias, 1e-15 at 8.
Source: as `_dqds`.
"""

from kernels.drivetrain._chain import same, units
from kernels.drivetrain._dqds import eigenvalues, next_traces
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.groups import GROUP, cells_at
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import not_, sqrt, where
from kernels.maths.elementary import is_normal, scale

_SQUARE_TURNS = 0.025330295910584444  # 1/(2 pi)^2


@jit
def _fill(n, at, J, k, rows, e_J, e_k):
    """The entries (1), without units; and the sums of them that `eigenvalues` wants."""
    nothing = 0.0 * k[at(0)]
    e, u, h, sums = nothing, nothing, nothing, (nothing, nothing)
    before, fewest = sums, sums
    for j in range(n):
        stiffness, inertia = scale(k[at(j)], -e_k), scale(J[at(j)], -e_J)
        u, h = next_traces(e, inertia / stiffness, u, h)
        sums, before, fewest = (sums[0] + u, sums[1] + h), sums, before
        e = stiffness / scale(J[at(j + 1)], -e_J) if j < n - 1 else nothing
        rows[at(j)], rows[at(n + j)] = stiffness / inertia, e
    return sums + before + fewest


@jit
def frequencies(n, at, lanes, J, k, frequency, rows):
    """Natural frequencies [Hz], ascending, of one chain or of a group, as `at` says; and its status.

    `rows` has room for 3 n + 2 entries. Free at both ends the first is exactly 0.
    """
    e_J, e_k, sound = units(n, at, J, k)
    sums = _fill(n, at, J, k, rows, e_J, e_k)
    failed = eigenvalues(n, at, lanes, rows, sums, _SQUARE_TURNS, frequency)
    for j in range(n):
        f = scale(sqrt(frequency[at(j)]), 0.5 * (e_k - e_J))
        sound = sound & (is_normal(f) | (not_(k[at(n - 1)] > 0.0) & (j == 0)))
        frequency[at(j)] = f
    return where(sound, where(failed, NOT_CONVERGED, OK), OUT_OF_RANGE)


@jit_apart
def natural_frequencies(n, J, k, frequency, work):
    """`frequencies` of one chain: the first n entries of J [kg m^2], k [N m/rad] and frequency [Hz]."""
    return frequencies(n, same, 1, J, k, frequency, work)


@jit
def row_at(j):
    """Where the j-th row of a buffer of a group begins."""
    return cells_at(j * GROUP)
