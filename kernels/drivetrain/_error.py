"""A reduced model against its chain: as few masses as are wanted, and the largest error of the spindle's receptance.

receptance(w, model, scene)             of the spindle, by the model
"""

from kernels.drivetrain._chain import CHAIN_ROUNDING, GRID, MAKE, ROUNDING, TURN, Model, off_by
from kernels.drivetrain._rivin import receptance_of_chain
from kernels.lanes.jit import jit_apart
from kernels.lanes.vectors import fma, magnitude, sqrt
from kernels.maths.elementary import exp, log
from kernels.maths.small_dense import size, sort, square

AROUND = (-16.0, -8.0, -4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Where a resonance is looked at, in its half widths: `_chain.SAMPLES` of them."""
OVERDAMPED = (0.5, 2.0, 8.0)
"""Those at a real pole."""
NARROWINGS = 40
"""Of an interval around a largest value, by the golden section: to 4e-9 of its width, 2e-17 of the value."""
_GOLDEN = 0.6180339887498949
_WORTH = 0.25  # a local maximum above this share of the largest is followed to its top
_BEYOND = 4.0  # times the highest frequency: from there on receptances only fall
_TWIN = 0.1  # of a half width


@jit_apart
def reduce_enough(n_keep, tol, f_max, order, scene):
    """The model of n_keep masses.

    Where that is 0, its masses are those before the first number, from all of them downwards, with which a frequency of
    the full chain up to f_max, which counts itself, rounded or not, is off by more than tol, or missing.
    """
    full, kept, n, fixed = scene.full, scene.kept, scene.full.J.size, n_keep > 0.0
    p = int(n_keep) if fixed else n
    model = Model(p, 0.0, 0.0, 0.0, 0.0)
    for _ in range(2 * n + 1):
        model, worst = MAKE(scene.parts, p, order, scene), 0.0
        if fixed:
            break
        for i in range(n):
            if full.f[i] <= (1.0 + CHAIN_ROUNDING) * f_max:
                worst = max(worst, magnitude(off_by(kept.f[i], full.f[i])) if i < p else float("inf"))
        holds = model.status == 0.0 and worst <= tol
        if holds and p > 1:
            p -= 1
        elif holds:
            break
        else:
            p, fixed = min(p + 1, n), True
    return model


@jit_apart
def _value_at(w, of_error, receptance, model, scene):
    """abs(dH) or abs(H); 0 where it is no number: exactly on a pole of a partial system."""
    value = receptance_of_chain(w, scene.full, scene.full.J.size)
    if of_error > 0:
        value -= receptance(w, model, scene)
    size = sqrt(square(value))
    return size if size >= 0.0 else 0.0


@jit_apart
def _largest(count, of_error, receptance, model, scene):
    """Largest value in the band: of those at the samples, and of the tops between them, by the golden section."""
    at, value = scene.samples[0], scene.samples[1]
    most = 0.0
    for i in range(count):
        value[i] = _value_at(at[i], of_error, receptance, model, scene)
        most = max(most, value[i])
    worth = _WORTH * most
    for i in range(count):
        before, after = max(i - 1, 0), min(i + 1, count - 1)
        if value[i] >= worth and value[i] >= value[before] and value[i] >= value[after]:
            low, high = at[before], at[after]
            a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            at_a, at_b, next_is_a = 0.0, 0.0, True
            for narrowing in range(NARROWINGS + 2):
                found = _value_at(a if next_is_a else b, of_error, receptance, model, scene)
                at_a, at_b = (found, at_b) if next_is_a else (at_a, found)
                next_is_a = narrowing > 0 and at_a > at_b
                if next_is_a:
                    high, b, at_b = b, a, at_a
                    a = high - _GOLDEN * (high - low)
                elif narrowing > 0:
                    low, a, at_a = a, b, at_b
                    b = low + _GOLDEN * (high - low)
            most = max(most, at_a, at_b)
    return most


@jit_apart
def _sampled(f_max, own_poles, p, scene):
    """How many frequencies are looked at, into `scene.samples`, and the least damping; none where H is infinite.

    They are 0, the end of the band, frequencies between even on a log scale, and those around every pole.
    """
    full, kept, at = scene.full, scene.kept, scene.samples[0]
    n = full.J.size
    w_max = TURN * min(f_max, _BEYOND * max(full.f[n - 1], kept.f[p - 1]))
    zeta, count = 1.0, GRID
    for s, poles, own, known in ((full.s, 2 * n, 2 * n, 0), (kept.s, 2 * p, own_poles, 2 * n)):
        for i in range(poles):
            new = i < own
            for j in range(known):  # beside a pole of the chain, samples would only differ by rounding
                new = new and size(s[i] - full.s[j]) > _TWIN * magnitude(s[i].real)
            if s[i].imag > 0.0 and s[i].imag <= w_max:
                zeta = min(zeta, -s[i].real / sqrt(square(s[i])))
            if s[i].imag >= 0.0 and new:
                for width in AROUND:
                    w = fma(-width, s[i].real, s[i].imag)
                    if w > 0.0 and w < w_max and (s[i].imag > 0.0 or width in OVERDAMPED):
                        at[count] = w
                        count += 1
    if not (zeta > 0.0 and full.k[n - 1] > 0.0 and w_max > 0.0):
        return 0, zeta
    at[0], at[1] = 0.0, w_max
    w = min(TURN * full.f[0], w_max) / 32.0
    ratio = exp(log(w_max / w) / (GRID - 2))
    for i in range(2, GRID):
        at[i] = w
        w *= ratio
    sort(at, count)
    return count, zeta


@jit_apart
def receptance_error(f_max, own_poles, receptance, model, scene):
    """Largest abs(dH) up to f_max over the largest abs(H), and a bound on its rounding.

    NaN where H is infinite in the band: with a free end, or with a resonance that nothing damps.
    """
    count, zeta = _sampled(f_max, own_poles, model.p, scene)
    if count == 0:
        return float("nan"), 0.0
    off, size = 0.0, 0.0
    for of_chain in range(2):
        off, size = size, _largest(count, 1 - of_chain, receptance, model, scene)
    return off / size, ROUNDING * scene.full.J.size / zeta
