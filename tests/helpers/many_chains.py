"""Natural frequencies of many chains, a group of them at a time."""

from kernels.drivetrain._chain_frequencies import frequencies, row_at
from kernels.lanes.columns import entry, in_groups
from kernels.lanes.groups import GROUP, cells_at, room
from kernels.lanes.jit import jit


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
    status[cells_at(first)] = frequencies(n, row_at, GROUP, inertias, springs, found, entries)
    for cell in range(GROUP):
        for j in range(n):
            frequency[first + cell, j] = found[j * GROUP + cell]


@entry()
def natural_frequencies_of_all(J, k, frequency, status):
    """`natural_frequencies` of every row of J, k and frequency, of shape (n_cells, n); and every status."""
    in_groups(_group, (J, k, frequency, status), (room(6 * J.shape[1] + 2),))
