"""A reduced model against its chain: as few masses as are wanted, and the largest error of the spindle's receptance."""

from kernels.drivetrain import _rivin
from kernels.drivetrain._modal_masses import TURN
from kernels.drivetrain._modal_receptance import least_damping, sample_grid, sample_poles
from kernels.drivetrain._model import CHAIN_ROUNDING, Model, Outcome, Wanted, largest_error
from kernels.drivetrain._reductions import EXACT, chain_poles, damped, poles, receptance, reduce
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, sqrt
from kernels.maths.small_dense import sort_many

NARROWINGS = 40
"""Of an interval around a largest value, by the golden section: to 4e-9 of its width, 2e-17 of the value."""
_GOLDEN = 0.6180339887498949
_WORTH = 0.25  # a local maximum above this share of the largest is followed to its top
_BEYOND = 4.0  # times the highest frequency: from there on receptances only fall
_ROUNDING = 4e-16


@jit_apart
def _reduce_enough(wanted, scene):
    """The model that is wanted.

    Its masses are those before the first number, from all of them downwards, with which `largest_error` exceeds tol.
    """
    n, given = scene.full.J.size, wanted.n_keep > 0.0
    p = int(wanted.n_keep) if given else n
    model = Model(p, 0.0, 0.0, 0.0, 0.0)
    for _ in range(2 * n + 1):
        model = reduce(wanted.reduction, p, wanted.order, scene)
        if given:
            break
        holds = model.status == 0.0 and largest_error(scene.full, scene.kept, p, wanted.f_max) <= wanted.tol
        if holds and p > 1:
            p -= 1
        elif holds:
            break
        else:
            p, given = min(p + 1, n), True
    return model


@jit_apart
def _value_at(w, of_error, model, scene, reduction):
    """abs(dH) or abs(H); 0 where it is no number: exactly on a pole of a partial system."""
    full = scene.full
    value = _rivin.receptance_of_chain(w, full.J, full.k, full.h, full.J.size)
    if of_error > 0:
        value -= receptance(reduction, w, model, scene)
    size = sqrt(fma(value.real, value.real, value.imag * value.imag))
    return size if size >= 0.0 else 0.0


@jit_apart
def _top(low, high, of_error, model, scene, reduction):
    """Largest value between two frequencies, by the golden section."""
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a = _value_at(a, of_error, model, scene, reduction)
    at_b = _value_at(b, of_error, model, scene, reduction)
    for _ in range(NARROWINGS):
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _value_at(a, of_error, model, scene, reduction)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _value_at(b, of_error, model, scene, reduction)
    return max(at_a, at_b)


@jit_apart
def _largest(count, of_error, model, scene, reduction):
    """Largest value in the band: of those at the samples, and of the tops between them."""
    at, value = scene.spare.at, scene.spare.off
    most = 0.0
    for i in range(count):
        value[i] = _value_at(at[i], of_error, model, scene, reduction)
        most = max(most, value[i])
    worth = _WORTH * most
    for i in range(count):
        before, after = max(i - 1, 0), min(i + 1, count - 1)
        if value[i] >= worth and value[i] >= value[before] and value[i] >= value[after]:
            most = max(most, _top(at[before], at[after], of_error, model, scene, reduction))
    return most


@jit_apart
def _sample(w_max, own_poles, full, kept, at):
    """Fills `at` with frequencies of the band, rising, close to one another around the poles; how many there are."""
    count = sample_grid(at, w_max, TURN * full.f[0])
    count = sample_poles(at, count, w_max, full.s, 2 * full.J.size)
    count = sample_poles(at, count, w_max, kept.s, own_poles)
    sort_many(at, count)
    return count


@jit_apart
def _receptance_error(f_max, own_poles, model, scene, reduction):
    """Largest abs(dH) up to f_max over the largest abs(H), and a bound on its rounding.

    NaN where H is infinite in the band: with a free end, or with a resonance that nothing damps.
    """
    full, kept = scene.full, scene.kept
    n = full.J.size
    w_max = TURN * min(f_max, _BEYOND * max(full.f[n - 1], kept.f[model.p - 1]))
    zeta = least_damping(full.s, w_max, 2 * n)
    zeta = min(zeta, least_damping(kept.s, w_max, 2 * model.p))
    if not (zeta > 0.0 and full.k[n - 1] > 0.0 and w_max > 0.0):
        return float("nan"), 0.0
    count = _sample(w_max, own_poles, full, kept, scene.spare.at)
    off, size = 0.0, 0.0
    for of_error in range(2):
        off, size = size, _largest(count, 1 - of_error, model, scene, reduction)
    return off / size, _ROUNDING * n / zeta


@jit
def _known(error):
    """A bound on an error; inf for NaN."""
    return error if error >= 0.0 else float("inf")


@jit_apart
def reduced(wanted, scene):
    """The reduced model of a chain, and how far it is off.

    An exact one has all frequencies however few its masses: where `tol` is to be met, one.
    """
    is_exact = wanted.reduction == EXACT
    n_keep = 1.0 if is_exact and not wanted.n_keep > 0.0 else wanted.n_keep
    wanted = Wanted(wanted.reduction, n_keep, wanted.tol, wanted.f_max, wanted.order)
    model = _reduce_enough(wanted, scene)
    off, error, blur, rounding = float("nan"), _known(model.error), float("inf"), float("inf")
    if model.status == 0.0:
        blur, own_poles = poles(wanted.reduction, model.p, scene)
        blur = max(error, _known(blur))
        if blur < float("inf"):
            off, rounding = _receptance_error(wanted.f_max, own_poles, model, scene, wanted.reduction)
            rounding = max(blur, _known(rounding))
    count, choice = scene.full.J.size if is_exact else model.p, 0.0 if n_keep > 0.0 else error
    return Outcome(model.p, count, model.slower, off, error, blur, rounding, choice, model.status)


@jit_apart
def whole(wanted, scene):
    """As `reduced`, of a chain that stays as it is."""
    n = scene.full.J.size
    blur = chain_poles(scene.full, n, damped(scene.full), scene.spare)
    blur = max(CHAIN_ROUNDING, _known(blur))
    off = 0.0 if blur < float("inf") else float("nan")
    return Outcome(n, n, 0.0, off, CHAIN_ROUNDING, blur, blur, 0.0, 0.0)
