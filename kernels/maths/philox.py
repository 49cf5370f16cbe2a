"""Counter-based random numbers: those at place `counter` in the stream of `key`, without computing earlier ones.

Philox-4x32-10 of Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11 (2011): ten rounds
that multiply, swap and mix four words of 32 bits. Integers only, so the bits are the same everywhere.
"""

from kernels.lanes.columns import GROUP
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import sqrt
from kernels.maths.elementary import log, sincos

ROUNDS = 10
SEED_LIMIT = 2.0**50
"""Seeds are whole numbers up to here, exact in a column."""

_WORD = 0xFFFFFFFF
_MULTIPLIER_0, _MULTIPLIER_1 = 0xD2511F53, 0xCD9E8D57
_WEYL_0, _WEYL_1 = 0x9E3779B9, 0xBB67AE85
_TWO_PI = 6.283185307179586


@jit
def philox(counter, key):
    """Four words of 32 bits from four words of counter and two of key."""
    c0, c1, c2, c3 = counter
    k0, k1 = key
    for _ in range(ROUNDS):
        p0, p1 = _MULTIPLIER_0 * c0, _MULTIPLIER_1 * c2
        c0, c1 = ((p1 >> 32) & _WORD) ^ c1 ^ k0, p1 & _WORD
        c2, c3 = ((p0 >> 32) & _WORD) ^ c3 ^ k1, p0 & _WORD
        k0, k1 = (k0 + _WEYL_0) & _WORD, (k1 + _WEYL_1) & _WORD
    return c0, c1, c2, c3


@jit
def _uniform(high, low):
    """A number in (0, 1) from two words: the middle of one of 2^53 equal parts."""
    return ((high << 21) + (low >> 11) + 0.5) * 2.0**-53


@jit_call
def fill(first, seed, place, n, stream, radii, turns):
    """Two uniform numbers for each of n places from `place` on, for each cell of a group, into rows of two buffers.

    Cells with the same seed have the same numbers; beside each other they are made once. A seed has as many
    independent streams as are wanted.
    """
    for cell in range(GROUP):
        same = cell > 0 and seed[first + cell] == seed[first + cell - 1]
        key = int(seed[first + cell])
        for j in range(n):
            at = j * GROUP + cell
            if same:
                radii[at], turns[at] = radii[at - 1], turns[at - 1]
            else:
                count = place + j
                words = philox((count & _WORD, count >> 32, stream, 0), (key & _WORD, key >> 32))
                radii[at], turns[at] = _uniform(words[0], words[1]), _uniform(words[2], words[3])


@jit_call
def gaussians(radius, turn):
    """Two independent numbers of the standard normal distribution from two uniform ones (Box & Muller, 1958)."""
    r = sqrt(-2.0 * log(radius))
    sine, cosine = sincos(_TWO_PI * turn)
    return r * cosine, r * sine
