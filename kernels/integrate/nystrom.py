"""Runge-Kutta steps for second-order scenes x'' = f(x, x'), generic in one cell or lanes.

A scene carries its motion and two tangents of it, so a state is (x, v, x1, v1, x2, v2), each pair a position and its
rate, and a right-hand side is `accelerations(state, scene) -> (x'', x1'', x2'')`. Because every position is the
integral of a rate, the stages of a position are folded into those of its rate (Nystroem form):
    V_i = v + h sum_j a_ij F_j,  X_i = x + c_i h v + h^2 sum_j (sum_m a_im a_mj) F_j.                     (1)
An integral y along the motion may follow as a seventh entry of the state; its rate y' is then the fourth of the
right-hand side.

Measured on columns of foliot (40 000 cells) and foliot_ripple (20 000) at rtol 1e-9: with first-order stages of the
same table, as `steps` has them, they take 0.98 and 0.85 of the CPU time, with the step control of `taylor` 0.93 and
1.3. Results differ by 1.4e-14 at most. This form is kept for the bits of what has been computed by it.
"""

import numpy as np

from kernels.integrate.tableaux import DOPRI5, DOPRI5_ERROR
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.vectors import any_lane, choose, dot, exponent, fma, magnitude, not_, pow2, where
from kernels.maths.elementary import LN2, exp, smaller

SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0
STEP_LIMIT = 10_000
"""Steps between two events after which a cell is given up."""
ROOT_LIMIT = 60
SETTLED = 1e-9
"""Newton's step, over the whole one, after which the event is where the next trial ends: its error is the square."""

# The last row is the fifth-order result
_A = np.zeros((7, 7))
for _i, _weights in enumerate(DOPRI5[:5]):
    _A[_i + 1, : _i + 1] = _weights
_A[6, [0, 2, 3, 4, 5]] = DOPRI5[5]
_E = np.zeros(7)
_E[[0, 2, 3, 4, 5, 6]] = DOPRI5_ERROR
_AA = _A @ _A


def _row(i):
    """What stage i takes: its node, and the weights of earlier stages in its rate and in its position."""
    return float(_A[i].sum()), tuple(map(float, _A[i, :i])), tuple(map(float, _AA[i, :i]))


_STAGE_1, _STAGE_2, _STAGE_3, _STAGE_4, _STAGE_5, _RESULT = (_row(i) for i in range(1, 7))
_RATE_ERROR, _POSITION_ERROR = tuple(map(float, _E)), tuple(map(float, _E @ _A))


@jit
def _at(state, h, row, f0, f1, f2, f3):
    """The state at a stage, by (1), from the accelerations of earlier stages: of the motion and of each tangent."""
    node, rate, position = row
    x, v, x1, v1, x2, v2 = state[:6]
    pairs = (
        fma(h, fma(h, dot(position, f0), node * v), x),
        fma(h, dot(rate, f0), v),
        fma(h, fma(h, dot(position, f1), node * v1), x1),
        fma(h, dot(rate, f1), v1),
        fma(h, fma(h, dot(position, f2), node * v2), x2),
        fma(h, dot(rate, f2), v2),
    )
    return _with_integral(pairs, state, h, rate, f3)


@jit
def _with_integral(pairs, state, h, weights, rates):
    """The pairs, and behind them the integral, where the state has one (known when compiled)."""
    if len(state) == 6:
        return pairs
    return (*pairs, fma(h, dot(weights, rates), state[6]))


@jit
def _worse(error, scale, other, other_scale):
    """Of two errors with their scales the one that is larger in its scale; the first where it is NaN."""
    smaller = error * other_scale <= other * scale
    return where(smaller, other, error), where(smaller, other_scale, scale)


@jit
def _worst(h, f0, f1, f2, f3, scale):
    """The largest estimated error over its scale; one division in all, for they are dear."""
    square = h * h
    error, over = magnitude(h * dot(_RATE_ERROR, f0)), scale[1]
    error, over = _worse(error, over, magnitude(square * dot(_POSITION_ERROR, f0)), scale[0])
    error, over = _worse(error, over, magnitude(h * dot(_RATE_ERROR, f1)), scale[3])
    error, over = _worse(error, over, magnitude(square * dot(_POSITION_ERROR, f1)), scale[2])
    error, over = _worse(error, over, magnitude(h * dot(_RATE_ERROR, f2)), scale[5])
    error, over = _worse(error, over, magnitude(square * dot(_POSITION_ERROR, f2)), scale[4])
    if len(scale) > 6:
        error, over = _worse(error, over, magnitude(h * dot(_RATE_ERROR, f3)), scale[6])
    return error / over


@jit
def _rates(accelerations, state, scene):
    """The right-hand side, with an entry (repeated where there is none) for the integral."""
    rates = accelerations(state, scene)
    return rates[0], rates[1], rates[2], rates[-1]


@jit_call
def dopri5_step(accelerations, state, scene, h, scale):
    """One step of Dormand-Prince 5(4).

    Returns
    -------
    state : tuple
        After the step, fifth order.
    error : float64 or Lanes
        The largest estimated error of a component over its entry in `scale`.
    acceleration : float64 or Lanes
        Of the motion, after the step.
    """
    a0, a1, a2, a3 = _rates(accelerations, state, scene)
    f0, f1, f2, f3 = (a0,), (a1,), (a2,), (a3,)
    b0, b1, b2, b3 = _rates(accelerations, _at(state, h, _STAGE_1, f0, f1, f2, f3), scene)
    f0, f1, f2, f3 = (a0, b0), (a1, b1), (a2, b2), (a3, b3)
    c0, c1, c2, c3 = _rates(accelerations, _at(state, h, _STAGE_2, f0, f1, f2, f3), scene)
    f0, f1, f2, f3 = (*f0, c0), (*f1, c1), (*f2, c2), (*f3, c3)
    d0, d1, d2, d3 = _rates(accelerations, _at(state, h, _STAGE_3, f0, f1, f2, f3), scene)
    f0, f1, f2, f3 = (*f0, d0), (*f1, d1), (*f2, d2), (*f3, d3)
    e0, e1, e2, e3 = _rates(accelerations, _at(state, h, _STAGE_4, f0, f1, f2, f3), scene)
    f0, f1, f2, f3 = (*f0, e0), (*f1, e1), (*f2, e2), (*f3, e3)
    g0, g1, g2, g3 = _rates(accelerations, _at(state, h, _STAGE_5, f0, f1, f2, f3), scene)
    f0, f1, f2, f3 = (*f0, g0), (*f1, g1), (*f2, g2), (*f3, g3)
    new = _at(state, h, _RESULT, f0, f1, f2, f3)
    z0, z1, z2, z3 = _rates(accelerations, new, scene)
    return new, _worst(h, (*f0, z0), (*f1, z1), (*f2, z2), (*f3, z3), scale), z0


@jit
def _step_factor(ratio):
    """0.9 ratio^(-1/5), from 0.2 to 5, for a step whose error was `ratio` of what is allowed."""
    ratio = where(ratio < 1e6, ratio, 1e6)  # NaN too: the step overflowed
    ratio = where(ratio > 1e-6, ratio, 1e-6)
    e = exponent(ratio)
    m = ratio * pow2(-e) - 1.0
    log2_ratio = e + m * (4.0 / 3.0 - m * (1.0 / 3.0))  # within 0.01
    factor = SAFETY * exp(-0.2 * LN2 * log2_ratio)
    factor = where(factor > SHRINK, factor, SHRINK)
    return where(factor < GROW, factor, GROW)


@jit_inline
def integrate_until(event, accelerations, scales, longest, state, scene, h, tolerance, active):
    """Follow the motion of the active cells until `event` falls through 0, and stop there.

    Parameters
    ----------
    event(state, acceleration, scene) -> (value, rate) : positive at the start, falling monotonically through 0
    accelerations(state, scene) : tuple of the three second derivatives
    scales(state, scene) : tuple of six, what `tolerance` is relative to
    longest(state, acceleration, scene) : what a step may be long at most
    h : first step

    Returns
    -------
    state : at the event
    t : time taken
    h : last whole step, a first step for what follows
    moving : cells that have not met the event after STEP_LIMIT steps
    """
    moving = active
    t = 0.0 * h
    h = smaller(h, longest(state, accelerations(state, scene)[0], scene))
    for _ in range(STEP_LIMIT):
        if not any_lane(moving):
            break
        new, error, acceleration = dopri5_step(accelerations, state, scene, h, scales(state, scene))
        ratio = error / tolerance
        accepted = moving & (ratio <= 1.0)
        passed = accepted & (event(new, 0.0, scene)[0] <= 0.0)
        moving = moving & not_(passed)
        accepted = accepted & moving
        state = choose(accepted, new, state)
        t = where(accepted, t + h, t)
        most = where(accepted, longest(new, acceleration, scene), h)
        h = where(moving, smaller(h * _step_factor(ratio), most), h)
    state, last = _locate(event, accelerations, scales, state, scene, h, active)
    return state, t + last, h, moving


@jit_inline
def _locate(event, accelerations, scales, state, scene, h, active):
    """Shorten the step `h` until it ends at the event: Newton, bisection where that leaves the bracket.

    Each trial is a whole Runge-Kutta step from the same state, so the root has the order of the method.
    """
    scale = scales(state, scene)
    low, high = 0.0 * h, h
    shorter = 0.5 * h
    new, _, _ = dopri5_step(accelerations, state, scene, shorter, scale)
    searching = active
    for _ in range(ROOT_LIMIT):
        if not any_lane(searching):
            break
        value, rate = event(new, accelerations(new, scene)[0], scene)
        low, high = where(value > 0.0, shorter, low), where(value > 0.0, high, shorter)
        guess = shorter - value / rate
        settled = magnitude(guess - shorter) <= SETTLED * h
        guess = where(settled | ((guess > low) & (guess < high)), guess, 0.5 * (low + high))
        shorter = where(searching, guess, shorter)
        trial, _, _ = dopri5_step(accelerations, state, scene, shorter, scale)
        new = choose(searching, trial, new)
        searching = searching & not_(settled)
    return choose(active, new, state), where(active, shorter, 0.0)
