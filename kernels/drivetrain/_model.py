"""A chain, its reduced model, and the rooms in which both are kept while one cell is solved.

Everything here is without units: J, k in powers of two near their largest, w in 2^e of the two, so that nothing leaves
float64. Frequencies f are w/2 pi.
"""

from typing import NamedTuple

import numpy as np

from kernels.drivetrain._chain import extremes, same
from kernels.drivetrain._holzer import ROWS
from kernels.drivetrain._modal_receptance import AROUND, GRID
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, magnitude, nearest
from kernels.maths.elementary import in_unit

CHAIN_ROUNDING = 5e-14
"""Relative error of a frequency of a chain."""


class Chain(NamedTuple):
    """Inertias, stiffnesses, dampers, and the frequencies f, and poles s."""

    J: np.ndarray
    k: np.ndarray
    h: np.ndarray
    f: np.ndarray
    s: np.ndarray


class Modes(NamedTuple):
    """A modal model: rows W and G (`_ritz`), w, the damping C, and the shape at the spindle."""

    W: np.ndarray
    G: np.ndarray
    w: np.ndarray
    C: np.ndarray
    spindle: np.ndarray


class Spare(NamedTuple):
    """Buffers of every reduction: 3 n + 2 numbers, those of the walk and of poles, the types and places of systems
    replaced, K and J at one frequency.
    """

    work: np.ndarray
    ways: np.ndarray
    waves: np.ndarray
    e: np.ndarray
    errors: np.ndarray
    pairs: np.ndarray
    kinds: np.ndarray
    places: np.ndarray
    J_w: np.ndarray
    K_w: np.ndarray
    at: np.ndarray
    off: np.ndarray


class Dense(NamedTuple):
    """Buffers of modal models: `square` of real numbers, A and B of complex ones."""

    square: np.ndarray
    angle: np.ndarray
    masters: np.ndarray
    A: np.ndarray
    B: np.ndarray


class WholeScene(NamedTuple):
    """A chain that stays as it is: `kept` is `full`."""

    full: Chain
    kept: Chain
    spare: Spare


class ReducedScene(NamedTuple):
    """A chain, and the chain that it is reduced to; or the modes, with their frequencies and poles in `kept`."""

    full: Chain
    kept: Chain
    spare: Spare
    modes: Modes
    dense: Dense


class Wanted(NamedTuple):
    """What a reduced model is to be: of n_keep masses or, where that is 0, of as many as `tol` needs up to f_max."""

    reduction: float
    n_keep: float
    tol: float
    f_max: float
    order: float


class Model(NamedTuple):
    """A reduced model: its masses, a bound on the relative error of its frequencies, the largest h e of merged springs,
    what is added to a modal model's receptance, and a status.
    """

    p: int
    error: float
    slower: float
    residual: float
    status: float


class Outcome(NamedTuple):
    """What a cell tells: masses, how many frequencies, the largest h e, the error of the receptance, and a status.

    Bounds on relative errors: `error` of frequencies, `blur` of damping, `rounding` of the receptance's error, `choice`
    of the number of masses.
    """

    p: int
    count: int
    slower: float
    off: float
    error: float
    blur: float
    rounding: float
    choice: float
    status: float


@jit_apart
def _new_chain(n):
    return Chain(np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(2 * n, np.complex128))


@jit_apart
def _new_spare(n):
    points, waves = 2 * len(AROUND) * n + GRID + 2, np.empty((2, n), np.complex128)
    ways, chain_ways = np.empty((ROWS, n)), np.empty((ROWS, n), np.complex128)
    work, e, errors, pairs = np.empty(3 * n + 2), np.empty((2, n)), np.empty(2 * n), np.empty(2 * n, np.complex128)
    kinds, places, at, off = np.empty(n), np.empty(n), np.empty(points), np.empty(points)
    return Spare(work, ways, chain_ways, e, errors, pairs, kinds, places, waves[0], waves[1], at, off)


@jit_apart
def _new_modes(n):
    return Modes(np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty(n))


@jit_apart
def _new_dense(n):
    A, B = np.empty((n, n), np.complex128), np.empty((n, n), np.complex128)
    return Dense(np.empty((n, n)), np.empty(n), np.empty(n), A, B)


@jit
def whole_scene(columns):
    """Room for a chain that stays as it is."""
    n = columns.J.shape[1]
    chain = _new_chain(n)
    return (WholeScene(chain, chain, _new_spare(n)),)


@jit
def reduced_scene(columns):
    """Room for a chain and what it is reduced to."""
    n = columns.J.shape[1]
    return (ReducedScene(_new_chain(n), _new_chain(n), _new_spare(n), _new_modes(n), _new_dense(n)),)


@jit_apart
def take_units(J, k, h, full):
    """Fills `full` with a chain in units of 2^e_J and 2^e_k, their difference even. Returns e_J, e_k."""
    e_J, e_k = exponent(extremes(J.size, same, J)[1]), extremes(k.size, same, k)[1]
    e_k = exponent(e_k) if e_k > 0.0 else e_J
    e_k -= magnitude((e_k - e_J) - 2.0 * nearest(0.5 * (e_k - e_J)))
    for j in range(J.size):
        full.J[j], full.k[j] = in_unit(J[j], e_J), in_unit(k[j], e_k)
        full.h[j] = in_unit(h[j], 0.5 * (e_J + e_k))
    return e_J, e_k


@jit
def largest_error(full, kept, p, f_max):
    """Largest relative error of a frequency of the full chain up to f_max; inf where the p kept ones lack one."""
    worst = 0.0
    for i in range(full.f.size):
        if full.f[i] <= f_max:
            if i >= p:
                return float("inf")
            worst = max(worst, magnitude(off_by(kept.f[i], full.f[i])))
    return worst


@jit
def off_by(value, true):
    """value/true - 1; 0 for a free motion that is kept."""
    return (value - true) / true if true > 0.0 else 0.0 * value
