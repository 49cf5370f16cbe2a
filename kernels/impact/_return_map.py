"""The impact clock's own cycle as the fixed point of its half-cycle map: flight, impact, reflection.

With M/(M + m) = wheel and m/(M + m) = pallet; unlike in `_units` the unit of time is here
sqrt(p M m/(F (M + m))), so the wheel falls with x'' = pallet. The state just after an impact on the upper pallet is
(Y, V, W): y = wheel Y, x' = V, y' = wheel W. The lower pallet is met after the time t, the root of
    x + V t + pallet t^2/2 - 1/2 = U(-wheel (Y + W t)),  x = U(wheel Y),                                 (1)
with the speed of closing C = V + pallet t + u wheel W, where u = U'; and the next state, reflected, is
    Y' = -(Y + W t),  V' = V + pallet (t - J),  W' = u J - W,  J = (1 + e) C/(pallet + wheel u^2).       (2)
Newton starts at t = sqrt(2/(1 - e)), with speeds that an impact would repeat after that time, whatever the way.
Residuals are those of (2), t - J instead of V' - V, which would be blind to V where m is small. They and the derivative
of (2) are pairs of `pairs`: no digits are lost in V near 0 or where two multipliers meet.
The lever is bent about the fixed point of the flat one, which it leaves as it is: only the derivative and the passages
of teeth know it. For e = 0 the map is that of the speed c of escape: fall, stop, and push in contact,
    pallet t^2/2 + 2 c t = slack/2,  R = 2 c + pallet t,  s = wheel R - c,
    c'^2 = s^2 + 2 wheel pallet (2 eta + c t).                                                           (3)
"""

from typing import NamedTuple

from kernels.impact._closed_cycle import MOST_KEPT, ROUNDING, behind, bent, within
from kernels.impact._closed_cycle import verdict as judged
from kernels.impact._units import Cycle, Scene
from kernels.lanes.codes import INACCURATE, NO_CYCLE, NO_METHOD, NOT_CONVERGED, OK
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, sqrt, where
from kernels.maths.cubic import largest_modulus
from kernels.maths.elementary import smaller
from kernels.maths.pairs import add, negative, over, scaled, shifted, times

NEWTON_LIMIT = 40
_CONVERGED = 1e-22
"""A step that was this small leaves 1e-30."""
_PAIR_ERROR = 1e-29
_LEAST = 1e-24
"""A share of mass or of speed below this is lost among 32 digits."""


class State(NamedTuple):
    """Just after an impact: Y, V and W of (1), as pairs."""

    Y: tuple
    V: tuple
    W: tuple


class Column(NamedTuple):
    """How t, Y', J and u change with one of Y, V and W, as pairs."""

    t: tuple
    Y: tuple
    J: tuple
    u: tuple


class FixedPoint(NamedTuple):
    """The state that the map repeats, t and J (pairs), and whether it is `lost`: Newton did not come to rest."""

    state: State
    t: tuple
    J: tuple
    lost: bool


@jit
def _half(x):
    return 0.5 * x[0], 0.5 * x[1]


@jit
def _twice(x):
    return 2.0 * x[0], 2.0 * x[1]


@jit
def _less(x, y):
    """x - y."""
    return add(x, negative(y))


@jit
def _closing(scene, state, t):
    """C, as a pair."""
    return add(add(state.V, times(scene.pallet, t)), times(scene.wheel, state.W))


@jit_call
def flight(scene, state):
    """The time t of (1) for a flat lever, as a pair: by the quadratic formula, and one Newton step in 32 digits."""
    wheel, pallet = scene.wheel, scene.pallet
    way = shifted(scaled(times(wheel, state.Y), -2.0), 0.5)
    closing = add(state.V, times(wheel, state.W))
    b = closing[0]
    t = 2.0 * way[0] / (b + sqrt(fma(b, b, 2.0 * pallet[0] * way[0])))
    covered = scaled(add(closing, scaled(pallet, 0.5 * t)), t)
    gap = _less(covered, way)[0]
    return shifted((t, 0.0 * t), -gap / fma(pallet[0], t, b))


@jit_call
def residuals(scene, state, t):
    """Y' - Y, t - J and W' - W for a flat lever, with J, all as pairs."""
    closing = _closing(scene, state, t)
    J = add(closing, scaled(closing, scene.e))
    return (negative(add(_twice(state.Y), times(state.W, t))), _less(t, J), _less(J, _twice(state.W))), J


@jit
def _column(scene, bend, point, inverse, unit, gap):
    """What a disturbance of Y, V or W, one of them by 1 as `unit` says, makes of t, Y', J and u (all slopes at u = 1).

    `gap` is the slope of (1) in it, `inverse` is 1/C.
    """
    W, (one_Y, one_V, one_W) = point.state.W, unit
    delay = negative(times(gap, inverse))
    place = negative(shifted(add(scaled(point.t, one_W), times(W, delay)), one_Y))
    u = times(bend, place)
    closing = add(times(scene.pallet, delay), times(scene.wheel, shifted(times(W, u), one_W)))
    closing = shifted(closing, one_V)
    push = _less(add(closing, scaled(closing, scene.e)), _twice(times(point.J, times(scene.wheel, u))))
    return Column(delay, place, push, u)


@jit_call
def derivative(scene, bend, point):
    """The columns for Y, V and W at a fixed point, where u = 1; `bend` is the slope of u in Y."""
    t = point.t
    one = (1.0 + 0.0 * t[0], 0.0 * t[0])
    inverse = over(one, _closing(scene, point.state, t))
    return (
        _column(scene, bend, point, inverse, (1.0, 0.0, 0.0), scaled(scene.wheel, 2.0)),
        _column(scene, bend, point, inverse, (0.0, 1.0, 0.0), t),
        _column(scene, bend, point, inverse, (0.0, 0.0, 1.0), times(scene.wheel, t)),
    )


@jit
def _newton_matrix(columns, J):
    """The slopes of `residuals`, row by row, to float64 digits."""
    in_Y, in_V, in_W = columns
    places = in_Y.Y[0] - 1.0, in_V.Y[0], in_W.Y[0]
    waits = in_Y.t[0] - in_Y.J[0], in_V.t[0] - in_V.J[0], in_W.t[0] - in_W.J[0]
    pushes = fma(in_Y.u[0], J, in_Y.J[0]), fma(in_V.u[0], J, in_V.J[0]), fma(in_W.u[0], J, in_W.J[0]) - 2.0
    return places, waits, pushes


@jit
def _determinant(a, b, c):
    """Of the matrix with the rows a, b, c."""
    first = fma(b[1], c[2], -(b[2] * c[1]))
    second = fma(b[2], c[0], -(b[0] * c[2]))
    third = fma(b[0], c[1], -(b[1] * c[0]))
    return fma(a[0], first, fma(a[1], second, a[2] * third))


@jit
def _solved(rows, right):
    """x with rows x = right, by Cramer's rule."""
    a, b, c = rows
    r, s, t = right
    det = _determinant(a, b, c)
    x = _determinant((r, a[1], a[2]), (s, b[1], b[2]), (t, c[1], c[2])) / det
    y = _determinant((a[0], r, a[2]), (b[0], s, b[2]), (c[0], t, c[2])) / det
    z = _determinant((a[0], a[1], r), (b[0], b[1], s), (c[0], c[1], t)) / det
    return x, y, z


@jit
def _start(scene):
    """The crude state that Newton starts from."""
    e = scene.e
    t = sqrt(2.0 / (1.0 - e))
    zero = 0.0 * t
    rim = t * (1.0 / (1.0 + e) - scene.pallet[0] - 0.5 * scene.wheel[0])
    return State((-0.25 * t * t, zero), (rim, zero), (0.5 * t, zero))


@jit
def _chosen(condition, new, old):
    """`choose`, of the pairs of two states."""
    return State(choose(condition, new.Y, old.Y), choose(condition, new.V, old.V), choose(condition, new.W, old.W))


@jit_call
def fixed_point(scene):
    """The state that the flat lever's map repeats."""
    state = _start(scene)
    none = (0.0 * scene.e, 0.0 * scene.e)
    t = flight(scene, state)
    misses, J = residuals(scene, state, t)
    active = not_(scene.e < 0.0)
    for _ in range(NEWTON_LIMIT):
        if not any_lane(active):
            break
        columns = derivative(scene, none, FixedPoint(state, t, J, active))
        place, wait, push = misses
        y, v, w = _solved(_newton_matrix(columns, J[0]), (place[0], wait[0], push[0]))
        new = State(shifted(state.Y, -y), shifted(state.V, -v), shifted(state.W, -w))
        state = _chosen(active, new, state)
        t = choose(active, flight(scene, state), t)
        misses, pushed = residuals(scene, state, t)
        J = choose(active, pushed, J)
        moved = magnitude(y) + magnitude(v) + magnitude(w)
        active = active & not_(moved <= _CONVERGED * (magnitude(state.Y[0]) + magnitude(state.W[0])))
    return FixedPoint(state, t, J, active)


@jit
def _minor(a, b, c, d):
    """a d - b c, of pairs."""
    return _less(times(a, d), times(b, c))


@jit
def _rim(pallet, column):
    """What of V' - V in (2) comes with t and J."""
    return times(pallet, _less(column.t, column.J))


@jit
def _lever(J, column):
    """What of W' + W in (2) comes with u and J."""
    return add(times(column.u, J), column.J)


@jit_call
def polynomial(scene, columns, J):
    """The characteristic polynomial of the derivative of (2): a2, a1 and a0, as pairs."""
    pallet = scene.pallet
    in_Y, in_V, in_W = columns
    p0, p1, p2 = in_Y.Y, in_V.Y, in_W.Y
    v0, v1, v2 = _rim(pallet, in_Y), shifted(_rim(pallet, in_V), 1.0), _rim(pallet, in_W)
    w0, w1, w2 = _lever(J, in_Y), _lever(J, in_V), shifted(_lever(J, in_W), -1.0)
    first, second, third = _minor(v1, v2, w1, w2), _minor(v0, v2, w0, w2), _minor(v0, v1, w0, w1)
    det = add(_less(times(p0, first), times(p1, second)), times(p2, third))
    minors = add(add(first, _minor(p0, p2, w0, w2)), _minor(p0, p1, v0, v1))
    return negative(add(add(p0, v1), w2)), minors, negative(det)


@jit
def _stability(scene, coefficients):
    """The smaller of p(1) > 0 and -p(-1) > 0, each over what it is small with; all moduli are below 1 if both hold."""
    a2, a1, a0 = coefficients
    even, odd = shifted(a1, 1.0), add(a2, a0)
    fades = 0.25 * add(even, odd)[0] / (scene.pallet[0] * (1.0 - scene.e) * (1.0 + scene.e))
    flips = 0.25 * _less(even, odd)[0] / scene.wheel[0]
    return where(flips < fades, flips, fades)


@jit
def _told_apart(scene):
    """Whether both masses and the restitution are large enough for 32 digits."""
    masses = (scene.wheel[0] > _LEAST) & (scene.pallet[0] > _LEAST)
    return masses & ((scene.e > _LEAST) | not_(scene.e > 0.0))


@jit
def passages(scene, bend, point):
    """The least share by which teeth stay clear of the upper pallet from its escape height down and back up again.

    After the impact the tooth falls behind the pallet by u s - G s^2/2, before the next one it is as far ahead of it as
    this with the speed of closing for u, time taken backwards: less than a pitch, and more than 0, while y < eta.
    """
    wheel, pallet = scene.wheel, scene.pallet[0]
    Y, V, W = point.state
    speed = wheel[0] * W[0]
    out = _less(times(wheel, W), V)[0]
    home = fma(pallet, point.t[0], V[0]) + speed
    bent_by = bend[0] * W[0] * speed
    G, size = pallet - bent_by, pallet + magnitude(bent_by)
    high = fma(-wheel[0], Y[0], scene.eta[0]) / speed
    after = smaller(behind(out, G, size, high), within(out, G, size, high, 1.0))
    return smaller(after, smaller(behind(home, G, size, high), within(home, G, size, high, 1.0)))


@jit
def impact_cycle(scene, nu, rtol):
    """The cycle with an impact, and its status."""
    wheel, point = scene.wheel[0], fixed_point(scene)
    t, (Y, V, W) = point.t[0], point.state
    bend = scaled(scene.kappa, nu / (t * t))
    coefficients = polynomial(scene, derivative(scene, bend, point), point.J)
    multiplier, doubt = largest_modulus(*coefficients)
    root = sqrt(scene.pallet[0])
    rim = V[0] / root
    back = where(rim < 0.0, 0.5 * rim * rim, 0.0)
    cycle = Cycle(t * root, -wheel * Y[0], rim, wheel * W[0] / root, multiplier, back)
    status = judged(passages(scene, bend, point), _stability(scene, coefficients), 30.0 * doubt, rtol)
    return cycle, where(point.lost, NOT_CONVERGED, status)


@jit
def _fall(scene, c):
    """The time t and the speed R of (3), as pairs, with 1/R."""
    pallet, slack = scene.pallet, scene.slack
    fast = 2.0 * c[0]
    t = slack[0] / (fast + sqrt(fma(fast, fast, pallet[0] * slack[0])))
    gap = _less(scaled(add(_twice(c), scaled(pallet, 0.5 * t)), t), _half(slack))[0]
    t = shifted((t, 0.0 * t), -gap / fma(pallet[0], t, fast))
    R = add(_twice(c), times(pallet, t))
    return t, R, over((1.0 + 0.0 * c[0], 0.0 * c[0]), R)


@jit_call
def push(scene, c):
    """From one escape to the next: t, R and s of (3), as pairs, and the slopes of t, R and s in c."""
    wheel, pallet = scene.wheel, scene.pallet
    t, R, inverse = _fall(scene, c)
    delay = scaled(times(t, inverse), -2.0)
    faster = shifted(times(pallet, delay), 2.0)
    return (t, R, _less(times(wheel, R), c)), (delay, faster, shifted(times(wheel, faster), -1.0))


@jit_call
def escape_speed(scene):
    """The speed c that (3) repeats, and whether Newton did not come to rest.

    The residual is (c'^2 - c^2)/(wheel pallet) = wheel t (R + 2 c) - 4 (c^2 - eta).
    """
    wheel, eta = scene.wheel, scene.eta
    start = sqrt(fma(2.0, eta[0], 0.5 * wheel[0]))
    c = (start, 0.0 * start)
    active = not_(start < 0.0)
    for _ in range(NEWTON_LIMIT):
        if not any_lane(active):
            break
        (t, R, _), (delay, faster, _) = push(scene, c)
        speeds = add(R, _twice(c))
        square = _less(times(c, c), eta)
        residual = _less(times(wheel, times(t, speeds)), (4.0 * square[0], 4.0 * square[1]))[0]
        slope = wheel[0] * fma(delay[0], speeds[0], t[0] * (faster[0] + 2.0)) - 8.0 * c[0]
        step = residual / slope
        c = choose(active, shifted(c, -step), c)
        active = active & not_(magnitude(step) <= _CONVERGED * c[0])
    return c, active


@jit_call
def plastic_cycle(scene, rtol):
    """The cycle with a push in contact, the share of time in contact, and the status."""
    wheel, pallet, eta = scene.wheel, scene.pallet, scene.eta
    c, lost = escape_speed(scene)
    (t, R, s), (delay, _, slower) = push(scene, c)
    way = add(_twice(eta), times(c, t))
    contact = 2.0 * way[0] / (wheel[0] * R[0])
    both = times(wheel, pallet)
    slope = add(times(s, slower), times(both, add(t, times(c, delay))))[0] / c[0]
    root = sqrt(pallet[0])
    back = where(s[0] < 0.0, 0.5 * s[0] * s[0] / both[0], 0.0)
    start = s[0] / root
    travel = fma(c[0], t[0], eta[0]) + back
    cycle = Cycle((t[0] + contact) * root, travel, start, start, magnitude(slope), back)
    fine = (rtol >= ROUNDING) & (rtol * magnitude(slope) >= _PAIR_ERROR)
    return cycle, contact / (contact + t[0]), where(lost, NOT_CONVERGED, where(fine, OK, INACCURATE))


@jit
def half_cycle(scene, rtol):
    """The cycle, the share of time in contact, and the status."""
    wheel, pallet, kappa, eta, slack, e, curvature = scene
    plastic, lossy = not_(e > 0.0), e < MOST_KEPT
    nu, tame = bent(scene)
    cycle, status = impact_cycle(Scene(wheel, pallet, kappa, eta, slack, where(lossy, e, 0.5), nu), nu, rtol)
    pushed, held, verdict = plastic_cycle(scene, rtol)
    status = where(tame & lossy, status, NO_CYCLE)
    straight = not_(magnitude(curvature) > 0.0)
    status = where(plastic, where(straight, verdict, NO_METHOD), status)
    status = where(_told_apart(scene) | not_(lossy), status, NO_METHOD)
    return choose(plastic, pushed, cycle), where(plastic, held, 0.0), status
