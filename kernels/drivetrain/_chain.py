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
from kernels.lanes.addresses import part
from kernels.lanes.codes import BAD_INPUT, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, magnitude, nearest
from kernels.maths.elementary import NORMAL_HIGH, NORMAL_LOW, in_unit

MASS_LIMIT = 64
"""Inertias of the longest chain."""
CHAIN_ROUNDING = 5e-14
"""Relative error of a frequency of a chain."""
ROUNDING = 4e-16
"""Relative error per mass of what is summed over a chain."""
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
    """Rows W and G of modes (`_modes`), their w, damping C and shape at the spindle, and complex A and B of C's size.

    `blur` is what the dampers' strains of a row may be off by, over the root of C's entry.

    Until modes are made, C and `spindle` are room for anything.
    """

    W: np.ndarray
    G: np.ndarray
    w: np.ndarray
    C: np.ndarray
    spindle: np.ndarray
    A: np.ndarray
    B: np.ndarray
    blur: np.ndarray


class Room(NamedTuple):
    """Buffers of frequencies and of the errors of poles (`work`), of both ways, real and complex, and of poles."""

    work: np.ndarray
    ways: np.ndarray
    waves: np.ndarray
    e: np.ndarray
    pairs: np.ndarray


class Scene(NamedTuple):
    """A chain, and what it is reduced to: a chain, or modes with their frequencies and poles in `kept`.

    `steps` are types and places of the systems replaced, or the masters; `samples` frequencies and values there;
    `parts` the addresses of what its reduction alone does, or of what all of them do.
    """

    full: Chain
    kept: Chain
    room: Room
    steps: np.ndarray
    samples: np.ndarray
    modes: Modes
    parts: np.ndarray


class Model(NamedTuple):
    """A reduced model: its masses, a bound on the relative error of its frequencies, the largest h e of merged springs,
    what is added to a modal model's receptance, and a status.
    """

    p: int
    error: float
    slower: float
    residual: float
    status: float


@jit
def new_scene(n, parts):
    """Room for a chain of n inertias and what it is reduced to."""
    rows, squares = np.empty((11, n)), np.empty((3, n, n))
    roots, waves = np.empty((3, 2 * n), np.complex128), np.empty((2, n, n), np.complex128)
    full = Chain(rows[0], rows[1], rows[2], rows[3], roots[0])
    kept = Chain(rows[4], rows[5], rows[6], rows[7], roots[1])
    both = np.empty((ROWS, n), np.complex128)
    room = Room(np.empty(3 * n + 2), np.empty((ROWS, n)), both, np.empty((2, n)), roots[2])
    modes = Modes(squares[0], squares[1], rows[8], squares[2], rows[9], waves[0], waves[1], rows[10])
    return Scene(full, kept, room, np.empty((2, n)), np.empty((2, 2 * SAMPLES * n + GRID)), modes, parts)


_LIKE = getattr(new_scene, "py_func", new_scene)(2, np.zeros(1, np.int64))
_MODEL = Model(1, 0.0, 0.0, 0.0, 0.0)

MAKE = part(0, _MODEL, 1, 0.0, _LIKE)
"""make(p, order, scene) -> the `Model` of p masses, made in the scene."""
POLES = part(1, (0.0, 0.0, 1), _MODEL, _LIKE)
"""poles(model, scene) -> bounds on the error of the damping of chain and of model, how many poles the latter has."""
ERROR = part(2, (0.0, 0.0), 0.0, 1, _MODEL, _LIKE)
"""receptance_error(f_max, number of the model's poles, model, scene) of the model, as in `_error`."""
FREQUENCIES = part(3, 0.0, 1, *_LIKE.full[:2], _LIKE.full.f, _LIKE.room.work)
"""natural_frequencies(n, J, k, f, work) -> status, as in `_frequencies`."""
CHAIN_POLES = part(4, 0.0, _LIKE.full, 1, _LIKE.room)
"""poles_of_chain(chain, n, room) -> a bound on their relative error, as in `_poles`."""
STATIC = part(5, _MODEL, 1, 0.0, _LIKE)
"""What another reduction begins with, as MAKE."""
RITZ = part(6, 0.0, 1, _LIKE)
"""ritz(p, scene) -> a bound on the relative error of the frequencies, as in `_modes`."""
PARTS = 7


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
