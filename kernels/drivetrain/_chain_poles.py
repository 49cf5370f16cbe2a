"""Poles of a damped chain: all 2 n roots s of det(s^2 J + s h + k) = 0, every one shown to be another.

From the roots of `_chain_roots` each pole is followed as a shape from both ends, as in `_chain_shapes` but complex;
with the torque p that is missing at the joint, where x = 1, Newton's step is
    -p/(x^T (2 s J + h) x),                                                                             (1)
and a root is off by no more than rounding in J, k and h is worth,
    (sum of abs(s^2) J abs(x)^2 + sum of (k + abs(s) h) abs(x_j - x_(j+1))^2)/abs(x^T (2 s J + h) x).   (2)
With light damping the real part is that of (x* J x) s^2 + (x* h x) s + x* k x = 0, which has all its digits; near
critical damping both poles are those of this quadratic.
Source: first-order perturbation of the quadratic eigenvalue problem, derived here.
"""

from kernels.drivetrain._chain import Scaled, extremes, same, units
from kernels.drivetrain._chain_roots import approach, start, stiffness
from kernels.lanes.codes import NOT_CONVERGED, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import exponent, fma, magnitude, sqrt
from kernels.maths import complex
from kernels.maths.elementary import is_normal, scale
from kernels.maths.small_dense import sort

REFINEMENTS = 3
ROUNDING = 2.0**-50
REACH = 2.0**300
"""Largest h without units."""
_NEAR = 1e-6  # step over root, above which another joint may do better
_TWIN = 2.0**-20  # below which rounding moves a double root
_LIGHT = 0.03
_TURNS = 0.15915494309189535  # 1/(2 pi)


@jit_apart
def _follow(n, chain, s, step, ways):
    """Rows of x, g before the inertia, the winding of the spring on the right (re, im each) and their exponent."""
    J, k, _, e_J, e_k = chain
    square = complex.product(s, s)
    ground = stiffness(n - 1, chain, s)
    x, g, wound, e = (1.0, 0.0), ground if step < 0 else (0.0, 0.0), (1.0, 0.0), 0.0
    j, offset = (0, 0) if step > 0 else (n - 1, 7 * n)
    for left in range(n, 0, -1):
        turned = complex.plus(g, complex.product(square, complex.times(x, scale(J[j], -e_J))))
        spring_at = j if step > 0 else max(j - 1, 0)
        spring = stiffness(spring_at, chain, s)
        if not complex.size(spring) > 0.0:
            spring = 2.0**-53 * scale(k[spring_at], -e_k), 0.0  # as good as 0
        next_wound = complex.over(turned, spring) if left > 1 else wound
        kept = wound if step < 0 else next_wound
        for row, value in enumerate((x[0], x[1], g[0], g[1], kept[0], kept[1], e)):
            ways[offset + row * n + j] = value
        x, g, wound = complex.plus(x, next_wound), turned, next_wound
        own = -exponent(complex.size(x) + complex.size(g))
        x, g, wound = complex.scaled(x, own), complex.scaled(g, own), complex.scaled(wound, own)
        e, j = e - own, j + step


@jit
def _entry(ways, n, row, j, r):
    """A complex entry of row j over x of row r, both of the way in `ways`."""
    unit = ways[r], ways[n + r]
    value = complex.quotient((ways[row * n + j], ways[(row + 1) * n + j]), unit)
    return complex.scaled(value, ways[6 * n + j] - ways[6 * n + r])


@jit
def _joint(n, chain, ways):
    """The inertia r at which J abs(x(left) x(right)) is largest."""
    best, top, power = 0, 0.0, 0.0
    for j in range(n):
        both = complex.size((ways[j], ways[n + j])) * complex.size((ways[7 * n + j], ways[8 * n + j]))
        size, e = both * scale(chain.J[j], -chain.e_J), ways[6 * n + j] + ways[13 * n + j]
        if size > 0.0 and (not top > 0.0 or size > scale(top, power - e)):
            best, top, power = j, size, e
    return best


@jit_apart
def _look(n, chain, s, r, ways):
    """Newton's step (1) of a pole from the joint r, the bound (2) on its relative error; x* J x, x* h x and x* k x."""
    J, k, h, e_J, e_k = chain
    right = ways[7 * n :]
    rigid, lost, solid, viscous, elastic = (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, 0.0
    for j in range(n):
        x = _entry(ways if j <= r else right, n, 0, j, r)
        wound = _entry(ways if j < r else right, n, 4, j, r)
        inertia, damper = scale(J[j], -e_J), scale(h[j], -0.5 * (e_J + e_k))
        rigid = complex.plus(rigid, complex.times(complex.product(x, x), inertia))
        lost = complex.plus(lost, complex.times(complex.product(wound, wound), damper))
        solid = fma(inertia, complex.square(x), solid)
        viscous = fma(damper, complex.square(wound), viscous)
        elastic = fma(scale(k[j], -e_k), complex.square(wound), elastic)
    missing = complex.plus(_entry(ways, n, 2, r, r), _entry(right, n, 2, r, r))
    square = complex.times(complex.product(s, s), scale(J[r], -e_J))
    slope = complex.plus(complex.times(complex.product(s, rigid), 2.0), lost)
    step = complex.quotient(complex.plus(missing, square), slope)
    size = sqrt(complex.square(s))
    worth = (size * size * solid + elastic + size * viscous) / (size * sqrt(complex.square(slope)))
    return (-step[0], -step[1]), ROUNDING * worth, solid, viscous, elastic


@jit_apart
def _best_joint(n, chain, s, ways):
    """The joint whose step is the shortest: the largest inertia may hardly move with what a damper lets creep."""
    r = _joint(n, chain, ways)
    least = complex.size(_look(n, chain, s, r, ways)[0])
    if least > _NEAR * complex.size(s):
        for other in range(n):
            size = complex.size(_look(n, chain, s, other, ways)[0])
            if size < least:
                r, least = other, size
    return r


@jit_apart
def _refined(n, chain, s, ways):
    """A pole to its last digits, and a bound on its relative error."""
    error, solid, viscous, r = 0.0, 1.0, 0.0, -1
    for attempt in range(2 * REFINEMENTS):
        _follow(n, chain, s, 1, ways)
        _follow(n, chain, s, -1, ways)
        if r < 0:
            r = _best_joint(n, chain, s, ways)
        step, error, solid, viscous, _ = _look(n, chain, s, r, ways)
        s = complex.plus(s, step)
        late = complex.size(step) / complex.size(s)
        error = error if late <= 4.0 * error else error + late
        if attempt >= REFINEMENTS - 1 and (s[1] == 0.0 or magnitude(s[1]) > 4.0 * error * complex.size(s)):
            break
        if attempt == REFINEMENTS - 1:
            s = s[0], 0.0
    if magnitude(s[0]) < _LIGHT * magnitude(s[1]):
        s = -0.5 * viscous / solid, s[1]
    return s, error


@jit
def _twin(i, count, fixed, pole_re, pole_im):
    """A root next to root i that rounding may have parted from it; -1 for none."""
    for j in range(fixed, count):
        away = complex.size((pole_re[i] - pole_re[j], pole_im[i] - pole_im[j]))
        if j != i and away < _TWIN * magnitude(pole_re[i]):
            return j
    return -1


@jit_apart
def _twins(n, chain, i, j, pole_re, pole_im, ways):
    """Puts two roots near critical damping where the quadratic of the shape between them has its own; their error."""
    middle = 0.5 * (pole_re[i] + pole_re[j]), 0.0
    _follow(n, chain, middle, 1, ways)
    _follow(n, chain, middle, -1, ways)
    r = _best_joint(n, chain, middle, ways)
    _, _, solid, viscous, elastic = _look(n, chain, middle, r, ways)
    half, square = 0.5 * viscous / solid, elastic / solid
    rest = fma(half, half, -square)
    root = sqrt(magnitude(rest))
    pole_re[i] = -half - (root if rest > 0.0 else 0.0)
    pole_re[j] = square / pole_re[i] if rest > 0.0 else -half
    pole_im[i], pole_im[j] = (root, -root) if rest < 0.0 else (0.0, 0.0)
    return 2.0 * _TWIN + 2.0 * magnitude(half + middle[0]) / half


@jit
def _farther(poles, i, j):
    re, im = poles
    return re[i] * re[i] + im[i] * im[i] > re[j] * re[j] + im[j] * im[j]


@jit
def _swap(poles, i, j):
    re, im = poles
    re[i], re[j] = re[j], re[i]
    im[i], im[j] = im[j], im[i]


@jit
def _refine(n, fixed, chain, pole_re, pole_im, errors, work):
    """Every root to its last digits; their errors, negative for twins; and the largest."""
    worst = 0.0
    for i in range(2 * n):
        errors[i] = 0.0
    for i in range(fixed, 2 * n):
        j = _twin(i, 2 * n, fixed, pole_re, pole_im) if errors[i] == 0.0 else -1
        if j >= 0 and errors[j] == 0.0:
            error = _twins(n, chain, i, j, pole_re, pole_im, work)
            errors[i] = errors[j] = -error
            worst = max(worst, error)
        elif errors[i] == 0.0:
            (pole_re[i], pole_im[i]), error = _refined(n, chain, (pole_re[i], pole_im[i]), work)
            errors[i] = error
            worst = max(worst, error) if error >= 0.0 else float("inf")
    return worst


@jit
def _apart(n, fixed, pole_re, pole_im, errors):
    """Whether no two roots but twins may be the same."""
    apart = True
    for i in range(fixed, 2 * n):
        for j in range(fixed, i):
            size = complex.size((pole_re[i], pole_im[i]))
            away = complex.size((pole_re[i] - pole_re[j], pole_im[i] - pole_im[j])) / size
            twins = (errors[i] < 0.0) & (errors[i] == errors[j])
            apart = apart and (twins or away > 4.0 * (magnitude(errors[i]) + magnitude(errors[j])))
    return apart


@jit
def _paired(n, fixed, pole_re, pole_im, pairs):
    """Real roots, and those with Im > 0 beside their conjugates, into `pairs`; whether these are 2 n."""
    found = fixed
    for i in range(fixed, 2 * n):
        for copy in range(2 if pole_im[i] > 0.0 else 1 if pole_im[i] == 0.0 else 0):
            if found < 2 * n:
                pairs[found], pairs[2 * n + found] = pole_re[i], pole_im[i] * (1.0 - 2.0 * copy)
            found += 1
    return found == 2 * n


@jit_apart
def damped_poles(n, J, k, h, frequency, pole_re, pole_im, work):
    """(error, status): all 2 n poles [rad/s] ascending in size, a pair as +Im, -Im; a bound on their relative errors.

    frequency [Hz] is that of `natural_frequencies`; work has room for 16 n. Without a spring to ground one pole is
    exactly 0, without a damper to ground two are. At critical damping two poles hang on half of the digits, as the
    bound says; abs(s) and damping of both together do not. NOT_CONVERGED where others cannot be told apart.
    """
    e_J, e_k, sound = units(n, same, J, k)
    chain = Scaled(J, k, h, e_J, e_k)
    sound = sound & (scale(extremes(n, same, h)[1], -0.5 * (e_J + e_k)) < REACH)
    fixed = start(n, chain, frequency, pole_re, pole_im, work)
    settled = approach(n, chain, fixed, pole_re, pole_im, work)
    error = _refine(n, fixed, chain, pole_re, pole_im, work[14 * n :], work)
    told_apart = _apart(n, fixed, pole_re, pole_im, work[14 * n :])
    told_apart = _paired(n, fixed, pole_re, pole_im, work) and told_apart
    for i in range(2 * n):
        pole_re[i], pole_im[i] = (work[i], work[2 * n + i]) if i >= fixed else (0.0, 0.0)
    sort(0, 2 * n, _farther, _swap, (pole_re, pole_im))  # +Im stays before -Im
    for i in range(2 * n):
        pole_re[i] = scale(pole_re[i], 0.5 * (e_k - e_J))
        pole_im[i] = scale(pole_im[i], 0.5 * (e_k - e_J))
        sound = sound & ((i < fixed) | is_normal(complex.size((pole_re[i], pole_im[i]))))
    if not sound:
        return error, OUT_OF_RANGE
    return error, OK if settled and told_apart else NOT_CONVERGED


@jit_apart
def modal_damping(n, pole_re, pole_im, frequency, damping):
    """Per mode abs(s)/2 pi [Hz] and the damping ratio -Re s/abs(s), from poles as `damped_poles` gives them.

    Real poles are taken in pairs in the order of their size: sqrt(s1 s2)/2 pi, and -(s1 + s2)/(2 sqrt(s1 s2)) >= 1;
    with a pole 0 that is 0 Hz, and damping is infinite beside another pole, 0 beside another 0.
    """
    mode, waiting = 0, 0.0
    single = False
    for i in range(2 * n):
        s, im = pole_re[i], pole_im[i]
        if im > 0.0:
            size = complex.modulus(s, im)
            frequency[mode], damping[mode] = _TURNS * size, -s / size
        elif im == 0.0 and single:
            size = sqrt(magnitude(waiting)) * sqrt(magnitude(s))
            frequency[mode] = _TURNS * size
            damping[mode] = 0.5 * (magnitude(waiting) + magnitude(s)) / size if s < 0.0 else 0.0
        if im > 0.0 or (im == 0.0 and single):
            mode += 1
        if im == 0.0:
            waiting, single = s, not single
