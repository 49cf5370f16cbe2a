"""Damped poles: all 2 n roots s of det(s^2 M + s C + K) = 0 at once, each shown to be another.

Ehrlich's and Aberth's iteration takes from Newton's step N = D/D' of a root of D what draws it to the others,
    s -= N/(1 - N sum of 1/(s - s_other)),                                                              (1)
beginning with the roots of every undamped mode with its own damping. Without a spring to ground one root is exactly 0,
without a damper to ground two are; these stay where they are.

A chain's determinant is D of the recurrence, with K_j = k_j + s h_j and common powers of two taken out,
    X_(j+1) = K_j X_j + s^2 U_j,  U_(j+1) = K_j U_j + J_(j+1) X_(j+1),  X_1 = 1, U_1 = J_1,  D = X_(n+1).  (2)
Each of its roots then is followed as a shape from both ends (`_holzer`); with the torque p that is missing at the
joint, where x = 1, Newton's step is
    -p/(x^T (2 s J + h) x),                                                                             (3)
and a root is off by no more than rounding in J, k and h is worth,
    (sum of abs(s^2) J abs(x)^2 + sum of (k + abs(s) h) abs(x_j - x_(j+1))^2)/abs(x^T (2 s J + h) x).   (4)
With light damping the real part is that of (x* J x) s^2 + (x* h x) s + x* k x = 0, which has all its digits; near
critical damping both poles are those of this quadratic.

A modal model (`_modes`) has (ln D)' = trace of (s^2 + s C + w^2)^-1 (2 s + C); a root lies within 2 p of its
Newton steps.

What is told is the damping, -Re s/abs(s), whose digits may be fewer than those of the root by abs(s/Re s), or not: real
errors dM, dC, dK of what the root's shape x feels move it by
    ds = -x^T (s^2 dM + s dC + dK) x/(x^T (2 s M + C) x),                                               (5)
and of light damping, where x is real but for a share of the damping, Re ds is as small as Re s.
Source: Aberth, Math. Comp. 27:339 (1973); Bini & Noferini, Linear Algebra Appl. 439:1130 (2013); (4) by first-order
perturbation of the quadratic eigenvalue problem, derived here.
"""

from typing import NamedTuple

import numpy as np

from kernels.drivetrain import _holzer
from kernels.drivetrain._chain import CHAIN_ROUNDING, NORMAL_LOW, TURN, extremes
from kernels.drivetrain._holzer import FLEXIBILITY, SHAPE, STRAIN
from kernels.lanes.addresses import jit_by_address
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, magnitude, pow2, sqrt
from kernels.maths.small_dense import eliminate, over, size, square, substitute_back

SWEEP_LIMIT = 300
"""Rounds of corrections of all roots; 4 to 10 are usual."""
REFINEMENTS = 3
REACH = 2.0**300
"""Largest h without units."""
_ROUNDING = 2.0**-50
_MODAL_ROUNDING = 2e-16
_SETTLED = 1e-12  # correction over root
_NEAR = 1e-6  # step over root, above which another joint may do better
_TWIN = 2.0**-20  # below which rounding moves a double root
_LIGHT = 0.03
_APART = 1e-3
"""Share of their size by which starts of a search are turned, so that none is real and no two are equal."""
_SAME = 4e-16
"""What rounding leaves of dampings in proportion to the springs: two roundings each."""


@jit_apart
def _of_mode(j, w, half, turn, s):
    """Roots of mode j, s^2 + 2 half s + w^2 = 0, turned by a share of their size; 0: not at all."""
    rest = (w - half) * (w + half)
    far = -half - sqrt(-rest) if rest < 0.0 else -half
    near = w * w / far if rest < 0.0 else -half
    up = sqrt(rest) if rest > 0.0 else 0.0
    s[2 * j] = complex(near - turn * up, up - turn * near)
    s[2 * j + 1] = complex(far - 0.7 * turn * up, 0.7 * turn * far - up)


@jit_apart
def _approach(newton, model, fixed, s, moved):
    """The rounds (1) over all roots but the `fixed` first, each until it settles; whether all do."""
    for i in range(s.size):
        moved[i] = 0.0 if i < fixed else 1.0
    for _ in range(SWEEP_LIMIT):
        busy = False
        for i in range(fixed, s.size):
            if moved[i] > _SETTLED:
                step, pull = newton(s[i], model), 0.0j
                for other in range(s.size):
                    away = s[i] - s[other]
                    if other != i and size(away) > 0.0:
                        pull += over(1.0 + 0.0j, away)
                step = over(step, 1.0 - step * pull)
                s[i] -= step
                share = size(step) / size(s[i])
                moved[i] = 0.0 if share >= 0.5 * moved[i] and share < 1e-6 else share
                busy = busy or not moved[i] <= _SETTLED
        if not busy:
            return True
    return False


@jit_apart
def _in_pairs(fixed, blur, s, pairs):
    """Real roots, and those with Im > 0 before their conjugates, by rising size; whether these are as many.

    A root is real whose Im is no more than `blur` of it; what is missing is NaN.
    """
    count = fixed
    for i in range(s.size):
        pairs[i] = 0.0j if i < fixed else complex(float("nan"), float("nan"))
    for i in range(fixed, s.size):
        real = magnitude(s[i].imag) <= blur * size(s[i])
        for copy in range(1 if real else 2 if s[i].imag > 0.0 else 0):
            if count < s.size:
                pairs[count] = complex(s[i].real, 0.0 if real else s[i].imag * (1.0 - 2.0 * copy))
            count += 1
    complete = count == s.size
    for i in range(s.size):
        s[i], j = pairs[i], i
        while j > fixed and square(s[j - 1]) > square(s[j]):  # of a pair +Im stays before -Im
            s[j - 1], s[j] = s[j], s[j - 1]
            j -= 1
    return complete


@jit_apart
def _newton_of_chain(s, chain):
    """D/D' of (2), by the same recurrence for the derivatives."""
    n, J, k, h = chain
    s_square = s * s
    x, u, dx, du = 1.0 + 0.0j, J[0] + 0.0j, 0.0j, 0.0j
    for j in range(n):
        spring, inertia = k[j] + s * h[j], J[j + 1] if j < n - 1 else 0.0
        dx = spring * dx + h[j] * x + (s_square * du + 2.0 * s * u)
        x = spring * x + s_square * u
        du = spring * du + h[j] * u + inertia * dx
        u = spring * u + inertia * x
        largest = max(size(x), size(u))
        if not 1e-30 < largest < 1e30 and largest > 0.0:
            unit = pow2(-exponent(largest))
            x, u, dx, du = x * unit, u * unit, dx * unit, du * unit
    return over(x, dx)


@jit_apart
def _follow(n, J, k, h, s, ways, e):
    """The chain at s from both ends; a spring that is nought there is as good as that."""
    for j in range(n):
        spring = k[j] + s * h[j]
        ways[FLEXIBILITY, j] = over(1.0 + 0.0j, spring if size(spring) > 0.0 else complex(2.0**-53 * k[j], 0.0))
    _holzer.follow(n, J, k[n - 1] + s * h[n - 1], s * s, ways, e)


@jit_apart
def _look(n, J, k, h, s, r, ways, e):
    """Newton's step (3) from the joint r, the bound (4) on the relative error; x* J x, x* h x and x* k x."""
    left, right = over(1.0 + 0.0j, ways[0, r]), over(1.0 + 0.0j, ways[1, r])
    solid, viscous, elastic = _holzer.join(n, r, J, k, h, ways, e, left, right)
    slope = 0.0j
    for j in range(n):
        slope += 2.0 * s * (J[j] * (ways[SHAPE, j] * ways[SHAPE, j])) + h[j] * (ways[STRAIN, j] * ways[STRAIN, j])
    missing = ways[2, r] * left + ways[3, r] * right + s * s * J[r]
    modulus = sqrt(square(s))
    worth = (modulus * modulus * solid + elastic + modulus * viscous) / (modulus * sqrt(square(slope)))
    return -over(missing, slope), _ROUNDING * worth, solid, viscous, elastic


@jit
def _of_damping(moved, real, s):
    """Bound on the relative error of the damping of a root that (5) moves by so much, along the real axis by `real`."""
    modulus = sqrt(square(s))
    error = moved / modulus + (real / magnitude(s.real) if s.imag != 0.0 and real > 0.0 else 0.0)
    return error / (1.0 - error) if error < 1.0 else float("inf")


@jit_apart
def _felt(n, J, k, h, s, ways):
    """Bound on the relative error of a pole's damping: (5) of the shape that `_look` left, J, k and h rounded."""
    slope, moved, real = 0.0j, 0.0, 0.0
    for j in range(n):
        slope += 2.0 * s * (J[j] * (ways[SHAPE, j] * ways[SHAPE, j])) + h[j] * (ways[STRAIN, j] * ways[STRAIN, j])
    for j in range(n):
        x, strain = ways[SHAPE, j], over(ways[STRAIN, j] * ways[STRAIN, j], slope)
        for z in (s * s * (J[j] * over(x * x, slope)), k[j] * strain, s * (h[j] * strain)):
            moved, real = moved + size(z), real + magnitude(z.real)
    return _of_damping(_ROUNDING * moved, _ROUNDING * real, s)


@jit_apart
def _best_joint(n, J, k, h, s, ways, e):
    """The joint whose step is the shortest: the largest inertia may hardly move with what a damper lets creep."""
    r = _holzer.joint(n, J, ways, e)
    least = size(_look(n, J, k, h, s, r, ways, e)[0])
    if least > _NEAR * size(s):
        for other in range(n):
            step = size(_look(n, J, k, h, s, other, ways, e)[0])
            if step < least:
                r, least = other, step
    return r


@jit_apart
def _refined(n, J, k, h, s, ways, e):
    """A pole to its last digits, and bounds on the relative errors of it and of its damping."""
    error, solid, viscous, r, settled = 0.0, 1.0, 0.0, -1, False
    for attempt in range(4 * REFINEMENTS):
        _follow(n, J, k, h, s, ways, e)
        if r < 0:
            r = _best_joint(n, J, k, h, s, ways, e)
        step, error, solid, viscous, _ = _look(n, J, k, h, s, r, ways, e)
        s += step
        late = size(step) / size(s)
        settled = late <= 4.0 * error
        error = error if settled else error + late
        sure = s.imag == 0.0 or magnitude(s.imag) > 4.0 * error * size(s)
        if attempt >= REFINEMENTS - 1 and sure and settled:
            break
        if attempt == REFINEMENTS - 1 and not sure:
            s = complex(s.real, 0.0)
    if magnitude(s.real) < _LIGHT * magnitude(s.imag):
        s = complex(-0.5 * viscous / solid, s.imag)
    return s, error, _felt(n, J, k, h, s, ways) if settled or s.imag == 0.0 else float("inf")


@jit_apart
def _refine_twins(n, J, k, h, s, i, j, ways, e):
    """Puts two roots near critical damping where the quadratic of the shape between them has its own; their error."""
    middle = complex(0.5 * (s[i].real + s[j].real), 0.0)
    _follow(n, J, k, h, middle, ways, e)
    _, _, solid, viscous, elastic = _look(n, J, k, h, middle, _best_joint(n, J, k, h, middle, ways, e), ways, e)
    half, product = 0.5 * viscous / solid, elastic / solid
    rest = half * half - product
    root = sqrt(magnitude(rest))
    if rest > 0.0:
        s[i] = complex(-half - root, 0.0)
        s[j] = complex(product / s[i].real, 0.0)
    else:
        s[i], s[j] = complex(-half, root), complex(-half, -root)
    return 2.0 * _TWIN + 2.0 * magnitude(half + middle.real) / half


@jit_apart
def _refine(n, J, k, h, fixed, s, errors, ways, e):
    """Every root to its last digits; a bound on the error of their damping, inf where two but twins may be the same."""
    worst = 0.0
    for i in range(s.size):
        errors[i] = 0.0
    for i in range(fixed, s.size):
        twin = i
        for j in range(s.size - 1, fixed - 1, -1):
            near = j != i and size(s[i] - s[j]) < _TWIN * magnitude(s[i].real)
            twin = j if near and errors[i] == 0.0 else twin
        if twin != i and errors[twin] == 0.0:
            error = _refine_twins(n, J, k, h, s, i, twin, ways, e)
            errors[i] = errors[twin] = -error
            worst = max(worst, error)
        elif errors[i] == 0.0:
            s[i], errors[i], doubt = _refined(n, J, k, h, s[i], ways, e)
            worst = max(worst, errors[i], doubt) if errors[i] + doubt >= 0.0 else float("inf")
    for i in range(fixed, s.size):
        for j in range(fixed, i):
            twins = errors[i] < 0.0 and errors[i] == errors[j]
            away = size(s[i] - s[j]) / size(s[i])
            if not (twins or away > 4.0 * (magnitude(errors[i]) + magnitude(errors[j]))):
                return float("inf")
    return worst


@jit_apart
def _by_proportion(n, k, h, f, fixed, s):
    """Where h = b k, poles by s^2 + b w^2 s + w^2 = 0 of each mode; a bound on their errors, inf where h is not.

    Of stiff modes a pole each is next to -1/b, too close together to be told apart as roots of the determinant.
    """
    b, worst = h[0] / k[0], 0.0
    for j in range(n):
        if not (magnitude(h[j] - b * k[j]) <= _SAME * h[j] and b > NORMAL_LOW):
            return float("inf")
    for j in range(n):
        w, half = TURN * f[j], 0.5 * b * (TURN * f[j]) * (TURN * f[j])
        _of_mode(j, w, half, 0.0, s)
        if 2 * j >= fixed:
            root = sqrt(magnitude((w - half) * (w + half)))
            worst = max(worst, CHAIN_ROUNDING * (3.0 * half + w) / root if root > 0.0 else float("inf"))
    for i in range(fixed):
        s[i] = 0.0j
    return worst


@jit_apart
def undamped_poles(chain):
    """Poles on the imaginary axis."""
    for i in range(chain.f.size):
        chain.s[2 * i], chain.s[2 * i + 1] = complex(0.0, TURN * chain.f[i]), complex(0.0, -TURN * chain.f[i])


@jit_by_address
def poles_of_chain(chain, n, room):
    """All 2 n poles of a chain's first n masses by rising size, a pair as +Im, -Im; a bound on their relative errors.

    At critical damping two poles hang on half of the digits, as the bound says; abs(s) and damping of both together do
    not. inf where they did not come or cannot be told apart.
    """
    J, k, h, f, s = chain
    s, strongest = s[: 2 * n], extremes(n, h)[1]
    if not strongest > 0.0:
        undamped_poles(chain)
        return 0.0
    fixed = 0 if k[n - 1] > 0.0 else 1 if h[n - 1] > 0.0 else 2
    for j in range(n):
        solid, viscous, _ = _holzer.mode(n, J, k, h, TURN * f[j], room.ways, room.e)
        _of_mode(j, TURN * f[j], 0.5 * viscous / solid, _APART * (1.0 + j / n), s)
    for i in range(fixed):
        s[i] = 0.0j
    settled = _approach(_newton_of_chain, (n, J, k, h), fixed, s, room.work)
    error = _refine(n, J, k, h, fixed, s, room.work, room.waves, room.e)
    if not (settled and error < float("inf")):
        error = _by_proportion(n, k, h, f, fixed, s)
    complete = _in_pairs(fixed, 0.0, s, room.pairs)
    return error if complete and strongest < REACH else float("inf")


class _Modal(NamedTuple):
    """Equations of modes at s: their w and C, the matrix A over `unit` twice, right sides B; `blur` as in `Modes`."""

    p: int
    w: np.ndarray
    C: np.ndarray
    A: np.ndarray
    B: np.ndarray
    unit: np.ndarray
    blur: np.ndarray


@jit_apart
def _equations_of_modes(s, model):
    """s^2 + s C + w^2 in units in which no entry is above 1, so that elimination keeps digits of graded modes."""
    p, w, C, A, _, unit, _ = model
    for i in range(p):
        unit[i] = 1.0 / sqrt(square(s) + w[i] * w[i] + size(s) * C[i, i])
    for i in range(p):
        for j in range(p):
            A[i, j] = s * (C[i, j] * (unit[i] * unit[j]))
        rest = complex((w[i] - s.imag) * (w[i] + s.imag) + s.real * s.real, 2.0 * s.real * s.imag)
        A[i, i] += rest * (unit[i] * unit[i])


@jit_apart
def _newton_of_modes(s, model):
    """1/(ln D)' by elimination; 0 exactly on a root."""
    p, _, C, A, B, unit, _ = model
    _equations_of_modes(s, model)
    for i in range(p):
        for j in range(p):
            B[i, j] = complex(C[i, j] * (unit[i] * unit[j]), 0.0)
        B[i, i] += 2.0 * s * (unit[i] * unit[i])
    eliminate(A, B, p, p)
    slope = 0.0j
    for column in range(p):
        substitute_back(A, B, column, column, p)
        slope += B[column, column]
    return over(1.0 + 0.0j, slope) if size(slope) < float("inf") else 0.0j


@jit_apart
def _refined_of_modes(s, model, rounding):
    """A root with the damping of its shape, from two steps of inverse iteration, and the bound (5) on that.

    M, w^2 and C are off by `rounding`, the strains of modes over the dampers by their `blur`.
    """
    p, w, C, A, B, unit, blur = model
    for i in range(p):
        B[i, 0] = 1.0 + 0.0j
    for _ in range(2):
        _equations_of_modes(s, model)
        largest = 0.0
        for i in range(p):
            largest = max(largest, size(B[i, 0]))
        for i in range(p):
            B[i, 0] = complex(B[i, 0].real / largest, -B[i, 0].imag / largest)
        eliminate(A, B, p, 1)
        A[p - 1, p - 1] = A[p - 1, p - 1] if size(A[p - 1, p - 1]) > 0.0 else 2.0**-53 + 0.0j
        substitute_back(A, B, 0, 0, p)
    solid, viscous, slope = 0.0, 0.0, 0.0j
    for i in range(p):
        B[i, 0] = 2.0**-50 * unit[i] * B[i, 0]
    for i in range(p):
        damped = 0.0j
        for j in range(p):
            damped += C[i, j] * B[j, 0]
        x = B[i, 0]
        solid, viscous = solid + square(x), viscous + (x.real * damped.real + x.imag * damped.imag)
        slope += x * (2.0 * s * x + damped)
    if s.imag != 0.0:
        s = complex(-0.5 * viscous / solid, s.imag)
    moved, real = 0.0, 0.0
    for i in range(p):
        for j in range(p):
            z, felt, other = over(B[i, 0] * B[j, 0], slope), sqrt(C[i, i]), sqrt(C[j, j])
            dampers = rounding * felt * other + felt * blur[j] + other * blur[i]
            for term in (rounding * s * s * z, rounding * w[i] * w[j] * z, dampers * s * z):
                moved, real = moved + size(term), real + magnitude(term.real)
    return s, _of_damping(moved, real, s)


@jit_apart
def modal_poles(p, modes, free, rounding, s, room):
    """All 2 p poles of a modal model, ordered as `poles_of_chain` has them; a bound on the error of their damping.

    `free` : whether mode 0 is a free motion, w = 0: one pole is 0, and a second one if nothing damps it
    `rounding` : what their frequencies are off by
    """
    fixed = 0 if not free else 1 if modes.C[0, 0] > 0.0 else 2
    for i in range(p):
        _of_mode(i, modes.w[i], 0.5 * modes.C[i, i], _APART * (1.0 + i / p), s)
    for i in range(fixed):
        s[i] = 0.0j
    model = _Modal(p, modes.w, modes.C, modes.A, modes.B, room.e[0], modes.blur)
    settled, error, worst = _approach(_newton_of_modes, model, fixed, s, room.work), _MODAL_ROUNDING, 0.0
    for i in range(fixed, s.size):
        error = max(error, size(_newton_of_modes(s[i], model)) / size(s[i]))
    error *= 2.0 * p
    complete = _in_pairs(fixed, error, s, room.pairs)
    for i in range(fixed, s.size):
        for j in range(fixed, i):
            complete = complete and size(s[i] - s[j]) > 2.0 * error * size(s[i])
        if complete and s[i].imag >= 0.0:
            s[i], doubt = _refined_of_modes(s[i], model, rounding)
            worst = max(worst, doubt) if doubt >= 0.0 else float("inf")
    return worst if settled and complete else float("inf")


@jit_apart
def modal_damping(s, damping):
    """Per mode the damping ratio -Re s/abs(s), from poles as `poles_of_chain` gives them.

    Real poles are taken in pairs in the order of their size: -(s1 + s2)/(2 sqrt(s1 s2)) >= 1; with a pole 0 damping is
    infinite beside another pole, 0 beside another 0.
    """
    mode, waiting, single = 0, 0.0, False
    for i in range(s.size):
        if s[i].imag > 0.0:
            damping[mode] = -s[i].real / sqrt(square(s[i]))
            mode += 1
        elif s[i].imag == 0.0 and single:
            one, two = magnitude(waiting), magnitude(s[i].real)
            damping[mode] = 0.5 * (one + two) / (sqrt(one) * sqrt(two)) if s[i].real < 0.0 else 0.0
            mode += 1
        if s[i].imag == 0.0:
            waiting, single = s[i].real, not single
