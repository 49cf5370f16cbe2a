"""A reduced model against its chain: damping of the modes, and the largest error of the spindle's receptance."""

from kernels.drivetrain._chain_poles import damped_poles
from kernels.drivetrain._modal_masses import TURN
from kernels.drivetrain._modal_poles import modal_poles
from kernels.drivetrain._modal_receptance import (
    chain_receptance,
    damping_matrix,
    least_damping,
    modal_receptance,
    sample_grid,
    sample_poles,
    sort,
)
from kernels.drivetrain._model import CHAIN_ROUNDING, EXACT, RIVIN, is_chain, reduce_enough
from kernels.drivetrain._rivin_exact_model import receptance as exact_receptance
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, sqrt

NARROWINGS = 40
"""Of an interval around a largest value, by the golden section: to 4e-9 of its width, 2e-17 of the value."""
_GOLDEN = 0.6180339887498949
_WORTH = 0.25  # a local maximum above this share of the largest is followed to its top
_BEYOND = 4.0  # times the highest frequency: from there on receptances only fall
_ROUNDING = 4e-16


@jit
def damped(chain, m):
    """Whether one of m dampers of a chain is there."""
    most = 0.0
    for j in range(m):
        most = max(most, chain.h[j])
    return most > 0.0


@jit_call
def all_poles(code, p, full, kept, modes, rooms):
    """Poles of both, and the damping of a modal model; a bound on the error, inf where they did not come."""
    n, error = full.J.size, 0.0
    for reduced in range(2 if code == RIVIN else 1):
        m, chain = (p, kept) if reduced > 0 else (n, full)
        blur, status = damped_poles(m, chain.J, chain.k, chain.h, chain.f, chain.re, chain.im, rooms.work)
        error = max(error, blur if status == 0.0 else float("inf"))
    if code == EXACT:
        _same_poles(full, kept)
    elif code != RIVIN:
        damping_matrix(modes.C, modes.W, modes.G, full.J, full.k, full.h, p, n)
        free = not full.k[n - 1] > 0.0
        blur = modal_poles(modes.w, modes.C, p, free, kept.re, kept.im, rooms.s, rooms.A, rooms.B, rooms.b)
        error = max(error, blur, _ROUNDING * n / least_gap(kept.f, p))
    return error


@jit
def _same_poles(full, kept):
    for i in range(2 * full.f.size):
        kept.re[i], kept.im[i] = full.re[i], full.im[i]


@jit
def least_gap(f, p):
    """Smallest relative distance of two of p frequencies: shapes are right to rounding over it."""
    gap = 1.0
    for i in range(1, p):
        gap = min(gap, (f[i] - f[i - 1]) / f[i])
    return gap


@jit_call
def reduced_receptance(w, code, p, residual, full, kept, modes, rooms):
    """Receptance of the spindle by the reduced model."""
    if code == RIVIN:
        return chain_receptance(w, kept.J, kept.k, kept.h, p, rooms.J_w, rooms.K_w)
    if code == EXACT:
        return exact_receptance(w, full.J, full.k, full.h, rooms.kinds, rooms.places, p, rooms.J_w, rooms.K_w)
    return residual + modal_receptance(w, modes.w, modes.spindle, modes.C, p, rooms.A, rooms.b)


@jit_call
def value_at(w, of_error, code, p, residual, full, kept, modes, rooms):
    """abs(dH) or abs(H); 0 where it is no number: exactly on a pole of a partial system."""
    value = chain_receptance(w, full.J, full.k, full.h, full.J.size, rooms.J_w, rooms.K_w)
    if of_error > 0:
        value -= reduced_receptance(w, code, p, residual, full, kept, modes, rooms)
    size = sqrt(fma(value.real, value.real, value.imag * value.imag))
    return size if size >= 0.0 else 0.0


@jit_call
def _top(low, high, of_error, code, p, residual, full, kept, modes, rooms):
    """Largest value between two frequencies, by the golden section."""
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a = value_at(a, of_error, code, p, residual, full, kept, modes, rooms)
    at_b = value_at(b, of_error, code, p, residual, full, kept, modes, rooms)
    for _ in range(NARROWINGS):
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = value_at(a, of_error, code, p, residual, full, kept, modes, rooms)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = value_at(b, of_error, code, p, residual, full, kept, modes, rooms)
    return max(at_a, at_b)


@jit_call
def _largest(count, of_error, code, p, residual, full, kept, modes, rooms):
    """Largest value in the band: of those at the samples, and of the tops between them."""
    at, value = rooms.at, rooms.off
    most = 0.0
    for i in range(count):
        value[i] = value_at(at[i], of_error, code, p, residual, full, kept, modes, rooms)
        most = max(most, value[i])
    worth = _WORTH * most
    for i in range(count):
        before, after = max(i - 1, 0), min(i + 1, count - 1)
        if value[i] >= worth and value[i] >= value[before] and value[i] >= value[after]:
            most = max(most, _top(at[before], at[after], of_error, code, p, residual, full, kept, modes, rooms))
    return most


@jit_call
def receptance_error(f_max, code, p, residual, full, kept, modes, rooms):
    """Largest abs(dH) up to f_max over the largest abs(H), and a bound on its rounding.

    NaN where H is infinite in the band: with a free end, or with a resonance that nothing damps.
    """
    n = full.J.size
    w_max = TURN * min(f_max, _BEYOND * max(full.f[n - 1], kept.f[p - 1]))
    zeta = min(least_damping(full.re, full.im, w_max, 2 * n), least_damping(kept.re, kept.im, w_max, 2 * p))
    if not (zeta > 0.0 and full.k[n - 1] > 0.0 and w_max > 0.0):
        return float("nan"), 0.0
    for i in range(0 if is_chain(code) else p):
        modes.spindle[i] = modes.W[i, 0] / sqrt(full.J[0])
    count = sample_grid(rooms.at, w_max, TURN * full.f[0])
    count = sample_poles(rooms.at, count, w_max, full.re, full.im, 2 * n)
    if code != EXACT:
        count = sample_poles(rooms.at, count, w_max, kept.re, kept.im, 2 * p)
    sort(rooms.at, count)
    off, size = 0.0, 0.0
    for of_error in range(2):
        off, size = size, _largest(count, 1 - of_error, code, p, residual, full, kept, modes, rooms)
    return off / size, _ROUNDING * n / zeta


@jit_call
def undamped_poles(chain):
    """Poles on the imaginary axis."""
    for i in range(chain.f.size):
        chain.re[2 * i], chain.re[2 * i + 1] = 0.0, 0.0
        chain.im[2 * i], chain.im[2 * i + 1] = TURN * chain.f[i], -TURN * chain.f[i]


@jit_call
def compare(f_max, code, p, residual, full, kept, modes, rooms):
    """Poles of both, and `receptance_error`: that, its rounding, and the bound on the error of the poles."""
    n = full.J.size
    blur = 0.0
    if damped(full, n):
        blur = all_poles(code, p, full, kept, modes, rooms)
    else:
        undamped_poles(full)
        undamped_poles(kept)
        for i in range(p):
            for j in range(p):
                modes.C[i, j] = 0.0
    if not blur < float("inf"):
        return float("nan"), float("inf"), blur
    off, rounding = receptance_error(f_max, code, p, residual, full, kept, modes, rooms)
    return off, rounding, blur


@jit_call
def reduced(code, n_keep, tol, f_max, order, full, kept, modes, rooms):
    """The reduced model of a chain, and how far it is off.

    Returns
    -------
    p : number of its masses
    slower : largest h e of merged springs
    off : error of the receptance
    error : bound on the relative error of all that is told
    status : of what it hangs on
    """
    p, error, slower, residual, status = reduce_enough(code, n_keep, tol, f_max, order, full, kept, modes, rooms)
    if status > 0.0:
        return p, slower, 0.0, error, status
    off, rounding, blur = compare(f_max, code, p, residual, full, kept, modes, rooms)
    known = error >= 0.0 and rounding >= 0.0 and blur >= 0.0
    return p, slower, off, max(error, rounding, blur) if known else float("inf"), status


@jit_call
def whole(code, n_keep, tol, f_max, order, full, kept, modes, rooms):
    """As `reduced`, of a chain that stays as it is."""
    n, blur, status = full.J.size, 0.0, 0.0
    if damped(full, n):
        blur, status = damped_poles(n, full.J, full.k, full.h, full.f, full.re, full.im, rooms.work)
    else:
        undamped_poles(full)
    for i in range(n):
        kept.J[i], kept.k[i], kept.h[i], kept.f[i] = full.J[i], full.k[i], full.h[i], full.f[i]
    _same_poles(full, kept)
    known = status == 0.0 and blur >= 0.0
    return n, 0.0, 0.0 if known else float("nan"), max(CHAIN_ROUNDING, blur) if known else float("inf"), 0.0
