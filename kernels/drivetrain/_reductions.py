"""The ways in which a chain is reduced, each as how its model is made, its poles found, and its spindle's receptance.

reduce(reduction, p, order, scene) -> Model   of p masses, into `scene`
poles(reduction, p, scene) -> error, count    of the chain and of the model, and how many the model has of its own
receptance(reduction, w, model, scene)        of the spindle, by the model
The choice is made while a cell is solved: what reductions have in common takes longest to compile, so it is compiled
once for all of them.
"""

from kernels.drivetrain import _guyan_masses, _modal_masses, _rivin
from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._modal_masses import TURN
from kernels.drivetrain._modal_receptance import damping_matrix, modal_receptance
from kernels.drivetrain._model import CHAIN_ROUNDING, Model, off_by
from kernels.drivetrain._poles import damped_poles, modal_poles
from kernels.drivetrain._ritz import ritz
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, sqrt

NONE, RIVIN, GUYAN, IRS, CRAIG_BAMPTON, MODAL, EXACT = range(7)
_ROUNDING = 4e-16


@jit
def leaves_chain(reduction):
    """Whether what is left is a chain."""
    return reduction in (NONE, RIVIN, EXACT)


@jit_apart
def damped(chain):
    """Whether a chain has a damper."""
    most = 0.0
    for j in range(chain.h.size):
        most = max(most, chain.h[j])
    return most > 0.0


@jit_apart
def _undamped_poles(chain):
    """Poles on the imaginary axis."""
    for i in range(chain.f.size):
        chain.s[2 * i], chain.s[2 * i + 1] = complex(0.0, TURN * chain.f[i]), complex(0.0, -TURN * chain.f[i])


@jit_apart
def chain_poles(chain, m, is_damped, room):
    """Poles of a chain of m masses; a bound on their relative error, inf where they did not come."""
    if not is_damped:
        _undamped_poles(chain)
        return 0.0
    return damped_poles(m, chain.J, chain.k, chain.h, chain.f, chain.s[: 2 * m], room)


@jit_apart
def _copy(full, kept):
    for j in range(full.J.size):
        kept.J[j], kept.k[j], kept.h[j] = full.J[j], full.k[j], full.h[j]


@jit_apart
def _merge(p, order, full, kept, spare):
    """The chain of p masses by Rivin's steps; the largest h e of merged springs."""
    n, slower = full.J.size, 0.0
    _copy(full, kept)
    for m in range(n, p, -1):
        kind, place, late = _rivin.step(kept.J, kept.k, kept.h, m, order, True)
        spare.kinds[n - m], spare.places[n - m], slower = kind, place, max(slower, late)
    return slower


@jit_apart
def _reduce_rivin(p, order, scene):
    kept = scene.kept
    slower = _merge(p, order, scene.full, kept, scene.spare)
    status = natural_frequencies(p, kept.J, kept.k, kept.f, scene.spare.work)
    return Model(p, CHAIN_ROUNDING, slower, 0.0, status)


@jit_apart
def _poles_of_both(p, scene):
    full, kept, work = scene.full, scene.kept, scene.spare
    is_damped, error = damped(full), 0.0
    error = max(error, chain_poles(full, full.J.size, is_damped, work))
    return max(error, chain_poles(kept, p, is_damped, work)), 2 * p


@jit_apart
def _chain_receptance(w, model, scene):
    return _rivin.receptance_of_chain(w, scene.kept.J, scene.kept.k, scene.kept.h, model.p)


@jit_apart
def _reduce_exactly(p, order, scene):
    """All frequencies, from p masses that depend on the frequency; how far they are from the full chain's is error."""
    full, kept, spare = scene.full, scene.kept, scene.spare
    _merge(p, order, full, kept, spare)
    n, apart = full.J.size, 0.0
    _rivin.exact_frequencies(full.J, full.k, spare.kinds, spare.places, p, kept.f, spare.J_w, spare.K_w)
    for i in range(n):
        off = magnitude(off_by(kept.f[i], full.f[i]))
        apart = max(apart, off if off >= 0.0 else float("inf"))
    return Model(p, CHAIN_ROUNDING + apart, 0.0, 0.0, 0.0)


@jit_apart
def _poles_of_full(p, scene):
    full, kept = scene.full, scene.kept
    error = max(0.0, chain_poles(full, full.J.size, damped(full), scene.spare))
    for i in range(2 * full.J.size):
        kept.s[i] = full.s[i]
    return error, 0


@jit_apart
def _exact_receptance(w, model, scene):
    full, spare = scene.full, scene.spare
    p = model.p
    return _rivin.exact_receptance(w, full.J, full.k, full.h, spare.kinds, spare.places, p, spare.J_w, spare.K_w)


@jit_apart
def _solve_basis(p, scene):
    """Modes of the basis in `modes`; a bound on the error of their frequencies."""
    full, modes, dense = scene.full, scene.modes, scene.dense
    n = full.J.size
    free = not full.k[n - 1] > 0.0
    error = ritz(modes.W, modes.G, p, n, free, modes.w, dense.square, dense.angle)
    for i in range(p):
        scene.kept.f[i] = modes.w[i] / TURN
    return error


@jit_apart
def _take_masters(p, order, scene):
    """Guyan's basis; the largest h e of springs that come in series."""
    full, kept, modes, masters = scene.full, scene.kept, scene.modes, scene.dense.masters
    _copy(full, kept)
    slower = _guyan_masses.choose_masters(kept.J, kept.k, kept.h, masters, full.J.size, p, order)
    _guyan_masses.static_shapes(modes.W, modes.G, full.J, full.k, masters, full.J.size, p)
    return slower


@jit_apart
def _reduce_guyan(p, order, scene):
    slower = _take_masters(p, order, scene)
    return Model(p, _solve_basis(p, scene), slower, 0.0, 0.0)


@jit_apart
def _reduce_irs(p, order, scene):
    full, modes, dense = scene.full, scene.modes, scene.dense
    slower, error = _take_masters(p, order, scene), 0.0
    for improved in range(2):
        if improved > 0:
            _guyan_masses.add_inertia(
                modes.W, modes.G, full.J, full.k, dense.masters, modes.w, p, full.J.size, dense.angle
            )
        error += _solve_basis(p, scene)
    return Model(p, error, slower, 0.0, 0.0)


@jit_apart
def _reduce_craig_bampton(p, order, scene):
    full, modes = scene.full, scene.modes
    status = _modal_masses.craig_bampton(
        modes.W, modes.G, full.J, full.k, full.h, scene.kept.f, p, full.J.size, scene.spare
    )
    return Model(p, _solve_basis(p, scene), 0.0, 0.0, status)


@jit_apart
def _reduce_modal(p, order, scene):
    full = scene.full
    for i in range(full.J.size):
        scene.kept.f[i] = full.f[i]
    return Model(p, CHAIN_ROUNDING, 0.0, _modal_masses.modal(scene.modes, full, p, scene.spare), 0.0)


@jit_apart
def _least_gap(f, p):
    """Smallest relative distance of two of p frequencies: shapes are right to rounding over it."""
    gap = 1.0
    for i in range(1, p):
        gap = min(gap, (f[i] - f[i - 1]) / f[i])
    return gap


@jit_apart
def _poles_of_modes(p, scene):
    full, kept, modes, dense = scene.full, scene.kept, scene.modes, scene.dense
    n, is_damped, error = full.J.size, damped(full), 0.0
    for i in range(p):
        modes.spindle[i] = modes.W[i, 0] / sqrt(full.J[0])
    damping_matrix(modes.C, modes.W, modes.G, full, p)
    error = max(error, chain_poles(full, n, is_damped, scene.spare))
    if is_damped:
        free = not full.k[n - 1] > 0.0
        blur = modal_poles(modes.w, modes.C, p, free, kept.s[: 2 * p], scene.spare, dense.A, dense.B)
        error = max(error, blur, _ROUNDING * n / _least_gap(kept.f, p))
    else:
        _undamped_poles(kept)
    return error, 2 * p


@jit_apart
def _modal_receptance(w, model, scene):
    return model.residual + modal_receptance(w, scene.modes, model.p, scene.dense.A, scene.dense.B)


@jit_apart
def reduce(reduction, p, order, scene):
    """The model of p masses."""
    if reduction == RIVIN:
        return _reduce_rivin(p, order, scene)
    if reduction == GUYAN:
        return _reduce_guyan(p, order, scene)
    if reduction == IRS:
        return _reduce_irs(p, order, scene)
    if reduction == CRAIG_BAMPTON:
        return _reduce_craig_bampton(p, order, scene)
    if reduction == MODAL:
        return _reduce_modal(p, order, scene)
    return _reduce_exactly(p, order, scene)


@jit_apart
def poles(reduction, p, scene):
    """A bound on the relative error of the poles of the chain and of the model, and how many are the model's own."""
    if reduction == RIVIN:
        return _poles_of_both(p, scene)
    if reduction == EXACT:
        return _poles_of_full(p, scene)
    return _poles_of_modes(p, scene)


@jit_apart
def receptance(reduction, w, model, scene):
    """The spindle's, by the model."""
    if reduction == RIVIN:
        return _chain_receptance(w, model, scene)
    if reduction == EXACT:
        return _exact_receptance(w, model, scene)
    return _modal_receptance(w, model, scene)
