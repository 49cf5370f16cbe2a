"""A chain, its reduced model, and the rooms in which both are kept while one cell is solved.

Everything here is without units: J, k in powers of two near their largest, w in 2^e of the two, so that nothing leaves
float64. Frequencies f are w/2 pi.
"""

from typing import NamedTuple

import numpy as np

from kernels.drivetrain import _guyan_masses, _modal_masses, _rivin_merging
from kernels.drivetrain._chain import extremes, same
from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._modal_masses import TURN
from kernels.drivetrain._modal_receptance import AROUND, GRID
from kernels.drivetrain._ritz import ritz
from kernels.drivetrain._rivin_exact import exact_frequencies
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import exponent, magnitude, nearest
from kernels.maths.elementary import in_unit

RIVIN, GUYAN, IRS, CRAIG_BAMPTON, MODAL, EXACT = range(1, 7)
CHAIN_ROUNDING = 5e-14
"""Relative error of a frequency of a chain."""


class Chain(NamedTuple):
    """Inertias, stiffnesses, dampers, and the frequencies f; `re` and `im` are the parts of its poles."""

    J: np.ndarray
    k: np.ndarray
    h: np.ndarray
    f: np.ndarray
    re: np.ndarray
    im: np.ndarray


class Modes(NamedTuple):
    """A modal model: rows W and G (`_ritz`), w, the damping C, and the shape at the spindle."""

    W: np.ndarray
    G: np.ndarray
    w: np.ndarray
    C: np.ndarray
    spindle: np.ndarray


class Rooms(NamedTuple):
    """Buffers of one chain's length: `rows`, `shapes` square, A and B complex square, b, J_w and K_w complex."""

    rows: np.ndarray
    shapes: np.ndarray
    masters: np.ndarray
    kinds: np.ndarray
    places: np.ndarray
    angle: np.ndarray
    work: np.ndarray
    A: np.ndarray
    B: np.ndarray
    b: np.ndarray
    s: np.ndarray
    J_w: np.ndarray
    K_w: np.ndarray
    at: np.ndarray
    off: np.ndarray


@jit_call
def new_chain(n):
    """An empty chain of n masses."""
    return Chain(np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(2 * n), np.empty(2 * n))


@jit_call
def new_modes(n):
    """An empty modal model of up to n modes."""
    return Modes(np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty(n))


@jit_call
def new_rooms(n):
    """Buffers for chains of n masses."""
    square, points = np.empty((n, n), np.complex128), 2 * len(AROUND) * n + GRID + 2
    return Rooms(
        np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(16 * n),
        square, np.empty_like(square), np.empty(n, np.complex128), np.empty(2 * n, np.complex128),
        np.empty(n, np.complex128), np.empty(n, np.complex128), np.empty(points), np.empty(points),
    )  # fmt: skip


@jit_call
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
def _copy(full, kept):
    for j in range(full.J.size):
        kept.J[j], kept.k[j], kept.h[j] = full.J[j], full.k[j], full.h[j]


@jit_call
def _rivin(p, order, full, kept, rooms):
    """The chain of p masses; the largest h e of merged springs."""
    n, slower = full.J.size, 0.0
    _copy(full, kept)
    for m in range(n, p, -1):
        kind, place, late = _rivin_merging.step(kept.J, kept.k, kept.h, m, order)
        rooms.kinds[n - m], rooms.places[n - m], slower = kind, place, max(slower, late)
    return slower


@jit_call
def _modal(p, full, kept, modes, rooms):
    """The lowest p modes; what the others give way at rest, and a status."""
    for i in range(full.J.size):
        kept.f[i] = full.f[i]
    return _modal_masses.modal(
        modes.W, modes.G, modes.w, full.J, full.k, full.f, rooms.shapes, rooms.angle, p, full.J.size, rooms.work
    )


@jit_call
def _basis(code, p, order, full, kept, modes, rooms):
    """Shapes of `guyan` and `irs`, or of `craig_bampton`; the largest h e of springs that come in series, a status."""
    n, slower, status = full.J.size, 0.0, 0.0
    if code == CRAIG_BAMPTON:
        status = _modal_masses.craig_bampton(
            modes.W, modes.G, full.J, full.k, kept.f, rooms.shapes, rooms.angle, p, n, rooms.work
        )
    else:
        _copy(full, kept)
        slower = _guyan_masses.choose_masters(kept.J, kept.k, kept.h, rooms.masters, n, p, order)
        _guyan_masses.static_shapes(modes.W, modes.G, full.J, full.k, rooms.masters, n, p)
    return slower, status


@jit_call
def _ritz(code, p, full, kept, modes, rooms):
    """Modes of a basis, for `irs` once more with the inertia of what follows; a bound on the error."""
    n, error = full.J.size, 0.0
    for improved in range(2 if code == IRS else 1):
        if improved > 0:
            _guyan_masses.add_inertia(modes.W, modes.G, full.J, full.k, rooms.masters, modes.w, p, n, rooms.angle)
        free = not full.k[n - 1] > 0.0
        error += ritz(modes.W, modes.G, p, n, free, modes.w, rooms.rows, rooms.angle)
    for i in range(p):
        kept.f[i] = modes.w[i] / TURN
    return error


@jit_call
def _exact(p, full, kept, rooms):
    """All frequencies from p masses that depend on the frequency; how far they are from those of the full chain."""
    n, apart = full.J.size, 0.0
    exact_frequencies(full.J, full.k, rooms.kinds, rooms.places, p, kept.f, rooms.work, rooms.work[2 * n :])
    for i in range(n):
        off = magnitude(off_by(kept.f[i], full.f[i]))
        apart = max(apart, off if off >= 0.0 else float("inf"))
    return apart


@jit
def is_chain(code):
    """Whether a reduction's poles are those of a chain."""
    return code in (RIVIN, EXACT)


@jit_call
def reduce(code, p, order, full, kept, modes, rooms):
    """The reduced model of p masses.

    Returns
    -------
    error : bound on the relative error of its frequencies
    slower : largest h e of merged springs
    residual : what is added to a modal model's receptance
    status : of what it hangs on
    """
    error, slower, residual, status = CHAIN_ROUNDING, 0.0, 0.0, 0.0
    if is_chain(code):
        late = _rivin(p, order, full, kept, rooms)
        if code == RIVIN:
            slower, status = late, natural_frequencies(p, kept.J, kept.k, kept.f, rooms.work)
        else:
            error += _exact(p, full, kept, rooms)
    elif code == MODAL:
        residual, status = _modal(p, full, kept, modes, rooms)
    else:
        slower, status = _basis(code, p, order, full, kept, modes, rooms)
        error = _ritz(code, p, full, kept, modes, rooms)
    return error, slower, residual, status


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


@jit_call
def reduce_enough(code, n_keep, tol, f_max, order, full, kept, modes, rooms):
    """The model of n_keep masses or, where that is 0, of as many as `tol` needs.

    That is the number before the first, from all of them downwards, with which `largest_error` exceeds tol.
    Exact reductions need one. Returns the number, and as `reduce`.
    """
    n = full.J.size
    given = code == EXACT or n_keep > 0.0
    p = int(n_keep) if n_keep > 0.0 else 1 if code == EXACT else n
    model = (0.0, 0.0, 0.0, 0.0)
    for _ in range(2 * n + 1):
        model = reduce(code, p, order, full, kept, modes, rooms)
        if given:
            break
        holds = model[3] == 0.0 and largest_error(full, kept, p, f_max) <= tol
        if holds and p > 1:
            p -= 1
        elif holds:
            break
        else:
            p, given = min(p + 1, n), True
    return p, model[0], model[1], model[2], model[3]
