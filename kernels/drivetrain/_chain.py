"""A drivetrain as a chain of inertias: what may be asked of it, its units, and where it is kept while it is solved.

    J_1 -k_1- J_2 -k_2- ... - J_n -k_n- ground,  with a damper h_j beside every spring k_j              (1)
Its left end is free, its right end is held by k_n; k_n = 0 leaves it free. With x_(n+1) = 0 it moves by
    J_j x_j'' = k_(j-1) (x_(j-1) - x_j) - k_j (x_j - x_(j+1)) + the same with h and x'.                 (2)
While a cell is solved all is without units: J and k over powers of two near their largest, w over 2^e of the two, so
that nothing leaves float64. Frequencies f are w/2 pi.
Source: the drivetrain of a milling machine, type-a and type-b partial systems after Rivin; layout checked there.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.drivetrain._holzer import ROWS
from kernels.lanes.codes import BAD_INPUT, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_apart, jit_shared
from kernels.lanes.vectors import exponent, magnitude, nearest
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW, in_unit

MASS_LIMIT = 64
"""Inertias of the longest chain."""
CHAIN_ROUNDING = 5e-14
"""Relative error of a frequency of a chain."""
SPREAD = 2.0**300
"""Largest ratio of two inertias, or of two stiffnesses, of one chain: what leaves room for inverse squares."""
TURN = 6.283185307179586
SAMPLES, GRID = 13, 98
"""Frequencies at which a receptance is looked at: beside each pole, and from 0 to the end of the band."""


class Chain(NamedTuple):
    """Inertias, stiffnesses, dampers, natural frequencies f, and the 2 n poles s."""

    J: np.ndarray
    k: np.ndarray
    h: np.ndarray
    f: np.ndarray
    s: np.ndarray


class Modes(NamedTuple):
    """Rows W and G of modes (`_modes`), their w, damping C and shape at the spindle, and buffers of their size."""

    W: np.ndarray
    G: np.ndarray
    w: np.ndarray
    C: np.ndarray
    spindle: np.ndarray
    before: np.ndarray
    angle: np.ndarray
    A: np.ndarray
    B: np.ndarray


class Room(NamedTuple):
    """Buffers of frequencies (`work`), of the walk from both ends, real and complex, and of poles."""

    work: np.ndarray
    ways: np.ndarray
    waves: np.ndarray
    e: np.ndarray
    errors: np.ndarray
    pairs: np.ndarray


class Scene(NamedTuple):
    """A chain, and what it is reduced to: a chain, or modes with their frequencies and poles in `kept`.

    `steps` are types and places of the systems replaced, or the masters; `samples` frequencies and values there.
    """

    full: Chain
    kept: Chain
    room: Room
    steps: np.ndarray
    samples: np.ndarray
    modes: Modes


class Model(NamedTuple):
    """A reduced model: its masses, a bound on the relative error of its frequencies, the largest h e of merged springs,
    what is added to a modal model's receptance, and a status.
    """

    p: int
    error: float
    slower: float
    residual: float
    status: float


@jit_shared
def new_chain(n):
    """Room for a chain of n inertias."""
    return Chain(np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(2 * n, np.complex128))


@jit_shared
def new_room(n):
    """Buffers of a chain of n inertias."""
    ways, waves, pairs = np.empty((ROWS, n)), np.empty((ROWS, n), np.complex128), np.empty(2 * n, np.complex128)
    return Room(np.empty(3 * n + 2), ways, waves, np.empty((2, n)), np.empty(2 * n), pairs)


@jit_shared
def new_scene(n):
    """Room for a chain of n inertias and what it is reduced to."""
    squares, waves, rows = np.empty((4, n, n)), np.empty((2, n, n), np.complex128), np.empty((3, n))
    modes = Modes(squares[0], squares[1], rows[0], squares[2], rows[1], squares[3], rows[2], waves[0], waves[1])
    samples = np.empty((2, 2 * SAMPLES * n + GRID))
    return Scene(new_chain(n), new_chain(n), new_room(n), np.empty((2, n)), samples, modes)


@jit_apart
def extremes(n, column):
    """Smallest and largest of n numbers; zeros and NaN are passed over."""
    low, high = math.inf, 0.0
    for j in range(n):
        low = column[j] if 0.0 < column[j] < low else low
        high = max(high, column[j])
    return low, high


@jit_apart
def spread_is_normal(n, column):
    """Whether the positive numbers are normal and within SPREAD of each other."""
    low, high = extremes(n, column)
    return high == 0.0 or (low >= NORMAL_LOW and high <= NORMAL_HIGH and low >= high / SPREAD)


@jit_apart
def refusal(n, J, k):
    """BAD_INPUT, OUT_OF_RANGE or OK of one chain of n inertias, each within its limits."""
    if not (1 <= n <= MASS_LIMIT):
        return BAD_INPUT
    for j in range(n - 1):
        if not k[j] > 0.0:
            return BAD_INPUT
    return OK if spread_is_normal(n, J) and spread_is_normal(n, k) else OUT_OF_RANGE


@jit
def off_by(value, true):
    """value/true - 1; 0 for a free motion that is kept."""
    return (value - true) / true if true > 0.0 else 0.0 * value


@jit_apart
def take_units(J, k, h, chain):
    """Fills `chain` with J, k and h in units of 2^e_J and 2^e_k, their difference even. Returns e_J, e_k."""
    e_J, e_k = exponent(extremes(J.size, J)[1]), extremes(k.size, k)[1]
    e_k = exponent(e_k) if e_k > 0.0 else e_J
    e_k -= magnitude((e_k - e_J) - 2.0 * nearest(0.5 * (e_k - e_J)))
    for j in range(J.size):
        chain.J[j], chain.k[j] = in_unit(J[j], e_J), in_unit(k[j], e_k)
        chain.h[j] = in_unit(h[j], 0.5 * (e_J + e_k))
    return e_J, e_k
