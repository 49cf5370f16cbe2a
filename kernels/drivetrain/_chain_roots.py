"""Roots of det(s^2 J + s h + k) = 0 for a chain, all at once; `_chain_poles` gives them their last digits.

The determinant is D of the recurrence, with K_j = k_j + s h_j and common powers of two taken out,
    X_(j+1) = K_j X_j + s^2 U_j,  U_(j+1) = K_j U_j + J_(j+1) X_(j+1),  X_1 = 1, U_1 = J_1,  D = X_(n+1).  (1)
Ehrlich's and Aberth's correction takes from Newton's step N = D/D' of a root what draws it to the others,
    N/(1 - N sum of 1/(s - s_other)).                                                                   (2)
It begins with the roots of every undamped mode with its own damping, s^2 + s (x^T h x) + w^2 = 0 for x^T J x = 1.
Without a spring to ground one root is exactly 0, without a damper to ground two are; these stay where they are.
Source: Aberth, Math. Comp. 27:339 (1973).
"""

from kernels.drivetrain._chain_shapes import follow_mode
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, fma, sqrt
from kernels.maths import complex
from kernels.maths.elementary import scale

SWEEP_LIMIT = 300
"""Rounds of corrections of all roots; 4 to 10 are usual."""
_SETTLED = 1e-12  # correction over root
_TURNS = 0.15915494309189535  # 1/(2 pi)


@jit
def stiffness(j, chain, s):
    """K_j, without units."""
    _, k, h, e_J, e_k = chain
    damper = scale(h[j], -0.5 * (e_J + e_k))
    return fma(damper, s[0], scale(k[j], -e_k)), damper * s[1]


@jit_apart
def _newton(n, chain, s):
    """D/D' of (1), by the same recurrence for the derivatives."""
    J, _, h, e_J, e_k = chain
    square, twice = complex.product(s, s), complex.times(s, 2.0)
    x, u, dx, du = (1.0, 0.0), (scale(J[0], -e_J), 0.0), (0.0, 0.0), (0.0, 0.0)
    for j in range(n):
        spring, damper = stiffness(j, chain, s), scale(h[j], -0.5 * (e_J + e_k))
        moved = complex.plus(complex.product(spring, dx), complex.times(x, damper))
        bent = complex.plus(complex.product(square, du), complex.product(twice, u))
        dx_next = complex.plus(moved, bent)
        x_next = complex.plus(complex.product(spring, x), complex.product(square, u))
        inertia = scale(J[j + 1], -e_J) if j < n - 1 else 0.0
        du = complex.plus(complex.product(spring, du), complex.times(u, damper))
        du = complex.plus(du, complex.times(dx_next, inertia))
        u = complex.plus(complex.product(spring, u), complex.times(x_next, inertia))
        x, dx = x_next, dx_next
        own = max(complex.size(x), complex.size(u))
        if own > 0.0:
            own = -exponent(own)
            x, u, dx, du = (
                complex.scaled(x, own), complex.scaled(u, own), complex.scaled(dx, own), complex.scaled(du, own)
            )  # fmt: skip
    return complex.quotient(x, dx)


@jit
def _aberth(m, roots_re, roots_im, i, step):
    """Newton's step for the root i of m, with the others taken out."""
    pull = (0.0, 0.0)
    for other in range(m):
        away = roots_re[i] - roots_re[other], roots_im[i] - roots_im[other]
        if other != i and complex.size(away) > 0.0:
            pull = complex.plus(pull, complex.quotient((1.0, 0.0), away))
    held = complex.product(step, pull)
    return complex.quotient(step, (1.0 - held[0], -held[1]))


@jit
def start(n, chain, frequency, pole_re, pole_im, work):
    """Roots of every mode with its own damping, turned a little so that none is real and no two are equal."""
    J, _, h, e_J, e_k = chain
    for j in range(n):
        total = follow_mode(n, J, chain.k, e_J, e_k, frequency[j], work)
        w = scale(frequency[j] / _TURNS, -0.5 * (e_k - e_J)) if frequency[j] > 0.0 else 0.0
        half = 0.0
        for i in range(n):
            wound = work[i] - work[i + 1] if i < n - 1 else work[i]
            half = fma(scale(h[i], -0.5 * (e_J + e_k)) * wound, wound, half)
        half = 0.5 * half / total
        rest = (w - half) * (w + half)
        far = -half - sqrt(-rest) if rest < 0.0 else -half
        near = w * w / far if rest < 0.0 else -half
        up = sqrt(rest) if rest > 0.0 else 0.0
        turn = 1e-3 * (1.0 + j / n)
        pole_re[2 * j], pole_im[2 * j] = near - turn * up, up - turn * near
        pole_re[2 * j + 1], pole_im[2 * j + 1] = far - 0.7 * turn * up, -up + 0.7 * turn * far
    fixed = 0
    if not chain.k[n - 1] > 0.0:
        pole_re[0] = pole_im[0] = 0.0
        fixed = 1
        if not h[n - 1] > 0.0:
            pole_re[1] = pole_im[1] = 0.0
            fixed = 2
    return fixed


@jit
def approach(n, chain, fixed, pole_re, pole_im, moved):
    """Ehrlich's and Aberth's rounds over all roots but the fixed ones; whether all settle."""
    for i in range(2 * n):
        moved[i] = 0.0 if i < fixed else 1.0
    for _ in range(SWEEP_LIMIT):
        busy = False
        for i in range(fixed, 2 * n):
            if moved[i] > _SETTLED:
                step = _aberth(2 * n, pole_re, pole_im, i, _newton(n, chain, (pole_re[i], pole_im[i])))
                pole_re[i], pole_im[i] = pole_re[i] - step[0], pole_im[i] - step[1]
                size = complex.size(step) / complex.size((pole_re[i], pole_im[i]))
                moved[i] = 0.0 if size >= 0.5 * moved[i] and size < 1e-6 else size
                busy = busy or not moved[i] <= _SETTLED
        if not busy:
            return True
    return False
