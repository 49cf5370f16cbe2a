"""Accumulating switches, as the bounces of a ball: their limit, where the motion comes to rest.

If a motion ends, or becomes smaller than the method can resolve, before the wanted number of switches, the last
accurate switches are extrapolated. In the limit their intervals d_n shrink by a constant factor; taken in pairs, since
two surfaces may alternate, the time of rest is by Aitken's formula
    t = t_n + D q/(1 - q),  D = d_n + d_{n-1},  q = D/(d_{n-2} + d_{n-3}),                                 (1)
and likewise every state. The change of this limit from the previous switch gives the error: with q near 1, the limit
may change as much in each of LEFT/(1 - q) more switches, as it does where intervals shrink like a power of their
number.
"""

import numpy as np

from kernels.interface import Status
from kernels.lanes.columns import to_eight_bits

ENDED = Status.STICKS, Status.OUT_OF_RANGE, Status.STEP_LIMIT
FAINT = Status.GRAZING, Status.INACCURATE
"""Statuses of what may have come to rest; of the latter, where intervals have become short."""
SHORT = 0.01
"""The last interval over the mean one, below which switches may accumulate."""
LEAST = 6
"""Switches of which the last five are looked at: the first interval is of another kind."""
NEAR = 1e-2
"""Of the time of rest, what may be left to it: then the intervals are believed to go on as they do. Where the last one
before a motion ended is longer, its switches do not accumulate, and it is not followed again to see."""
TINY = 1e-12
"""Of the time, an interval that is not worth to be followed: by less, rounding tells on what intervals shrink."""
STILL = 1e-16
"""Of the time, an interval that does not move it any more."""
FINE = 1e-9
"""The tolerance at most: a wide one takes bounces for grazing that are still large."""
AWAY, TRIES = 0.9, 3
"""Of the last switches that are right, to be away from those that are so by chance; how often, where some are not."""
SLOWEST = 1.0 - 1e-5
"""The largest q."""
LEFT = 4.0
"""Enough where intervals shrink as n^-p, p > 4/3, where (1) misses D n/(2 p (p - 1)) and moves by D/(2 p) a switch."""


def to_rest(how, columns, rtol, results, status):
    """Puts (1) into the results, where a motion does not reach the wanted number of switches.

    `how` : (columns, rtol) -> results, status, error; what has followed them
    """
    flips, outputs = columns[-1], (len(results) + 1) // 2
    time, interval = results[:2]
    ended = np.isin(status, ENDED) & (interval <= NEAR * time)
    faint = (np.isin(status, FAINT) & ~(interval * flips > SHORT * time)) | (interval <= STILL * time)
    cells = np.flatnonzero((flips >= LEAST) & (ended | faint))
    if not len(cells):
        return
    tolerance = np.minimum(0.5 * rtol[cells], FINE)

    def solved(those, flips):
        """Rows of results, and which cells are right to half of the tolerance."""
        rows, verdict, _ = how([*(c[cells[those]] for c in columns[:-1]), flips.astype(float)], tolerance[those])
        return rows, verdict == Status.OK

    last = _last_right(solved, flips[cells])
    those = np.flatnonzero(last >= LEAST)
    sizes = solved(those, np.full(len(those), 2.0))[0][outputs:-1]
    for _ in range(TRIES):
        if not len(those):
            break
        last[those] = np.maximum(np.floor(AWAY * last[those]), LEAST)
        rests, values, error, left = _limits(solved, those, last[those], flips[cells[those]], sizes)
        rests &= left <= 0.5 * rtol[cells[those]]
        good = cells[those[rests]]
        results[:outputs, good] = values[:, rests]
        status[good] = np.where(error[rests] <= 0.5 * rtol[good], Status.COMES_TO_REST, Status.INACCURATE)
        those, sizes = those[~rests], sizes[:, ~rests]


def _last_right(solved, flips):
    """The last number of switches, or nearly, that are right and move the time; 0 where it is less than `LEAST`."""
    right, wrong = np.zeros(len(flips)), flips.copy()
    trial = np.full(len(flips), float(LEAST))
    while True:
        going = np.flatnonzero((trial < wrong) & (trial - right >= np.maximum(1.0, 0.01 * right)))
        if not len(going):
            return right
        (time, interval, *_), good = solved(going, trial[going])
        good &= interval > TINY * time
        right[going[good]], wrong[going[~good]] = trial[going[good]], trial[going[~good]]
        middle = np.floor(0.5 * (right + wrong))
        trial = np.where(right > 0, np.minimum(2.0 * right, middle), wrong)


def _limits(solved, those, last, flips, sizes):
    """Which cells come to rest; their outputs there; their error, of states relative to their sizes at the start.

    And what is left of the way to rest after the wanted number of switches, as the error is.
    """
    runs = [solved(those, last - k) for k in (0, 1, 2, 3, 4)]
    rows, good = (np.array(part) for part in zip(*runs, strict=True))  # (5, results, cells), (5, cells)
    rows = rows[:, : 2 + len(sizes)]
    with np.errstate(all="ignore"):
        (values, q), (before, q_before) = (_limit(rows[k:]) for k in (0, 1))
        scale = abs(rows).max(axis=0)
        scale[0], scale[2:] = values[0], np.fmax(scale[2:], sizes)
        moved = (abs(values - before) / np.where(scale > 0, scale, 1.0)).max(axis=0)
        error = moved * (1.0 + LEFT * (q * q) ** 2 / (1.0 - q))
        shrinks = (q < SLOWEST) & (q_before < SLOWEST) & (values[0] - rows[0, 0] <= NEAR * values[0])
        settles = abs(values - rows[0]) <= abs(before - rows[1]) + 1e-9 * scale
        far = np.delete(abs(values - rows[0]) / np.where(scale > 0, scale, 1.0), 1, axis=0).max(axis=0)
        left = far * to_eight_bits(q ** (0.5 * (flips - last)))
    return good.all(axis=0) & shrinks & settles.all(axis=0) & np.isfinite(values).all(axis=0), values, error, left


def _limit(rows):
    """Outputs at rest by (1), from those at four switches, the last one first; and q."""
    pairs = [rows[k, 1] + rows[k + 1, 1] for k in (0, 2)]
    q = pairs[0] / pairs[1]
    values = rows[0] + (rows[0] - rows[2]) * q / (1.0 - q)
    values[0] = rows[0, 0] + pairs[0] * q / (1.0 - q)
    values[1] = 0.0
    return values, q
