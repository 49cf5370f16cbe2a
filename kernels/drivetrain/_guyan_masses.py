"""Guyan's static condensation of a chain, and its improvement (IRS): the angles of some masses carry all others along.

Masses that are kept are masters. Between two of them the chain follows as it does at rest,
    u_i = (r_i u_left + l_i u_right)/(l_i + r_i),  l_i, r_i: flexibility from i to either master,    (1)
so the springs between them are in series, and the full mass matrix T^T J T has masses between neighbours, too. (Its
row sums are Rivin's type a.) IRS adds what the inertia of the others does at the frequency that (1) gives each mode,
    u_i += w^2 sum_m g_im J_m u_m,  g_im = l_min r_max/(l_i + r_i).                                  (2)
Both are upper bounds of the frequencies. Masters are what Rivin's rule leaves if it only takes masses (type a): the
spindle always, then those of small (k_left + k_right)/J. Rows are as in `_ritz`.
Source: Guyan, AIAA J. 3:380 (1965); O'Callahan, Proc. 7th IMAC (1989) 17.
"""

from kernels.drivetrain._rivin import step
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import sqrt


@jit_apart
def choose_masters(J, k, h, masters, n, p, order):
    """Fills `masters` with the numbers of the p masses to be kept, rising; uses up J, k and h.

    Returns the largest h e [s] of the springs that come in series: both their strains are in phase while w h e << 1.
    """
    slower = 0.0
    for i in range(n):
        masters[i] = i
    for m in range(n, p, -1):
        _, place, late = step(J, k, h, m, order, False)
        slower = max(slower, late)
        for i in range(place, m - 1):
            masters[i] = masters[i + 1]
    return slower


@jit
def _flexibility(k, start, end):
    """Sum of 1/k of the springs start .. end - 1; inf for one of stiffness 0."""
    total = 0.0
    for j in range(start, end):
        total += 1.0 / k[j]
    return total


@jit
def _share(part, whole):
    """part/whole, for a part that is finite; 0 of an infinite whole."""
    return part / whole if whole < float("inf") else 0.0


@jit_apart
def static_shapes(W, G, J, k, masters, n, p):
    """The basis (1): each master turned by 1 while the others stand; with free ends, row 0 is all turned by 1."""
    for i in range(p):
        for j in range(n):
            W[i, j], G[i, j] = 0.0, 0.0
    for i in range(p):
        left, right = int(masters[i]), int(masters[i + 1]) if i + 1 < p else n
        whole = _flexibility(k, left, right)
        along = 0.0
        for j in range(left, right):
            share = _share(along, whole)  # of the flexibility between the masters, up to mass j
            W[i, j] = (
                (1.0 - share) * sqrt(J[j]) if share < 0.5 else _share(_flexibility(k, j, right), whole) * sqrt(J[j])
            )
            G[i, j] = _share(1.0 / sqrt(k[j]), whole) if k[j] > 0.0 else 0.0
            if i + 1 < p:
                W[i + 1, j] = share * sqrt(J[j])
                G[i + 1, j] = -G[i, j]
            along += 1.0 / k[j]
    if not k[n - 1] > 0.0:
        for j in range(n):
            W[0, j], G[0, j] = sqrt(J[j]), 0.0


@jit_apart
def add_inertia(W, G, J, k, masters, w, p, n, angle):
    """Adds (2) to the modes W, G of frequencies w; `angle` is a buffer."""
    for mode in range(p):
        for j in range(n):
            angle[j] = W[mode, j] / sqrt(J[j])
        for i in range(p):
            left, right = int(masters[i]), int(masters[i + 1]) if i + 1 < p else n
            _add_span(W[mode], G[mode], J, k, angle, w[mode] * w[mode], left, right)


@jit
def _add_span(W, G, J, k, angle, square, left, right):
    """(2) between the masters `left` and `right`, and its strains: those of each torque on both sides of it."""
    whole = _flexibility(k, left, right)
    for m in range(left + 1, right):
        torque = square * J[m] * angle[m]
        to_left, to_right = _flexibility(k, left, m), _flexibility(k, m, right)
        held_left = to_right / whole if whole < float("inf") else 1.0  # share of the torque that the left master bears
        held_right = _share(to_left, whole)
        at_m = torque * to_left * held_left
        turned = 0.0
        for j in range(left, m):
            G[j] -= torque * held_left / sqrt(k[j])
            turned += 1.0 / k[j]
            W[j + 1] += sqrt(J[j + 1]) * torque * held_left * turned
        turned = 0.0
        for j in range(right - 1, m - 1, -1):
            if held_right > 0.0:
                G[j] += torque * held_right / sqrt(k[j])
                turned += 1.0 / k[j]
            if j > m:
                W[j] += sqrt(J[j]) * (torque * held_right * turned if held_right > 0.0 else at_m)
