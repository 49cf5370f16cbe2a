"""Damped poles of a modal model: the 2 p roots s of det(s^2 + s C + diag(w^2)), all at once.

Ehrlich & Aberth's iteration: Newton's step N = 1/(ln det)', with (ln det)' = trace of (s^2 + s C + w^2)^-1 (2 s + C),
and the roots found already kept away,  s -= N/(1 - N sum_j 1/(s - s_j)).
Starts from the undamped frequencies. Source: Bini & Noferini, Linear Algebra Appl. 439:1130 (2013).
"""

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import fma, magnitude, sqrt
from kernels.maths.small_dense import eliminate, over, size, sort, substitute_back

ITERATION_LIMIT = 100
POLISH = 2
"""Rounds after the last change was below 1e-6; each cubes the error."""
_SETTLED = 1e-6
_ROUNDING = 2e-16


@jit
def _fill(A, B, s, w, C, p):
    """A = s^2 + s C + w^2 and B = dA/ds."""
    for i in range(p):
        for j in range(p):
            A[i, j], B[i, j] = s * C[i, j], complex(C[i, j], 0.0)
        A[i, i] += s * s + w[i] * w[i]
        B[i, i] += 2.0 * s


@jit_apart
def _logarithmic_slope(A, B, p):
    """Trace of A^-1 B, by elimination; NaN where A is singular. Uses up A and B."""
    eliminate(A, B, p, p)
    total = 0.0j
    for column in range(p):
        substitute_back(A, B, column, column, p)
        total += B[column, column]
    return total


@jit
def _start(s, w, C, p, known):
    """Two roots a mode: those it would have alone, moved off the axes and off each other; the known ones are 0."""
    for i in range(p):
        half = 0.5 * C[i, i]
        inside = w[i] * w[i] - half * half
        if inside > 0.0:
            s[2 * i], s[2 * i + 1] = complex(-half, sqrt(inside)), complex(-half, -sqrt(inside))
        else:
            fast = half + sqrt(-inside)
            slow = w[i] * w[i] / fast if fast > 0.0 else 0.0
            s[2 * i], s[2 * i + 1] = complex(-slow, -1e-3 * slow), complex(-fast, 1e-3 * fast)
    for k in range(known):
        s[k] = 0.0j


@jit
def _repulsion(s, k, count):
    """Sum of 1/(s_k - s_j) over the other roots."""
    total = 0.0j
    for j in range(count):
        if j != k:
            away = s[k] - s[j]
            total += over(1.0 + 0.0j, away if size(away) > 0.0 else complex(1e-3 * size(s[k]), 0.0))
    return total


@jit
def _improve(s, k, w, C, p, A, B):
    """One step of root k; its relative size, and that of Newton's step alone. Exactly on a root there is none."""
    _fill(A, B, s[k], w, C, p)
    slope = _logarithmic_slope(A, B, p)
    if not size(slope) < float("inf"):
        return 0.0, 0.0
    newton = over(1.0 + 0.0j, slope)
    change = over(newton, 1.0 - newton * _repulsion(s, k, 2 * p))
    before = size(s[k])
    s[k] -= change
    return size(change) / before, size(newton) / before


@jit
def _modulus(z):
    return sqrt(fma(z.real, z.real, z.imag * z.imag))


@jit
def _farther(s, i, j):
    return _modulus(s[i]) > _modulus(s[j])


@jit
def _swap(s, i, j):
    s[i], s[j] = s[j], s[i]


@jit
def _write(s, known, p, blur, pole_re, pole_im):
    """Pairs and real poles by rising modulus, from the upper half plane, NaN after the last; whether they are 2 p."""
    filled = known
    for k in range(known):
        pole_re[k], pole_im[k] = 0.0, 0.0
    for k in range(known, 2 * p):
        real = magnitude(s[k].imag) <= blur * size(s[k])
        needed = 1 if real else 2
        if (real or s[k].imag > 0.0) and filled + needed <= 2 * p:
            pole_re[filled], pole_im[filled] = s[k].real, 0.0 if real else s[k].imag
            if not real:
                pole_re[filled + 1], pole_im[filled + 1] = s[k].real, -s[k].imag
            filled += needed
    for k in range(filled, 2 * p):
        pole_re[k], pole_im[k] = float("nan"), float("nan")
    return filled == 2 * p


@jit_apart
def modal_poles(w, C, p, free, pole_re, pole_im, s, A, B):
    """All 2 p poles [rad/s], conjugates together; a bound on their relative error, inf where they did not come.

    `free` : whether mode 0 is a free motion, w = 0: one pole is 0, and a second one if nothing damps it
    `s`, `A`, `B` : complex buffers
    """
    known = 0
    if free:
        known = 1 if C[0, 0] > 0.0 else 2
    _start(s, w, C, p, known)
    error, left = 0.0, POLISH
    for _ in range(ITERATION_LIMIT):
        worst, error = 0.0, 0.0
        for k in range(known, 2 * p):
            change, newton = _improve(s, k, w, C, p, A, B)
            worst, error = max(worst, change), max(error, newton)
        if worst <= _SETTLED:
            left -= 1
        if left == 0:
            break
    blur = 2.0 * p * max(error, _ROUNDING)  # a root lies within 2 p Newton steps
    sort(known, 2 * p, _farther, _swap, s)  # of a conjugate pair the upper one stays first
    whole = _write(s, known, p, blur, pole_re, pole_im)
    return blur if whole and left == 0 else float("inf")
