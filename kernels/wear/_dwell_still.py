"""Angles of the arm at which wear is no smooth function of it: where it turns, and where v is 0 somewhere on the ring.

On the ring of radius r the speeds at psi = 0 and pi (`_speed_integral`) are 0 where
    alpha' (r +- w) = Omega r                                                                        (1)
and near by the integral of v along an arc goes like x^2 log x of the distance x from there. What is not found here
(two roots closer than the samples, where the left side of (1) all but touches the right) costs panels, no digits.
"""

import math

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude
from kernels.wear import _dwell
from kernels.wear._tool import sincos

STOP_LIMIT = 14
"""How many angles are kept."""
_SAMPLES = 32
_ROOT_LIMIT = 40
_NEAR = 1e-10


@jit
def span(arm):
    """Ends of u over all the arm's motion: u of `_dwell.gaps_at`, or the angle where the arm turns fully."""
    return (-math.pi, math.pi) if arm[3] else (-0.5 * math.pi, 0.5 * math.pi)


@jit_call
def rates_at(arm, u):
    """The arm's angle at u, and alpha' of the stroke back and forth over the crank's rate."""
    if arm[3]:
        s, c = sincos(u)
        eta, (top, bottom, _) = u, _dwell.gaps(arm, c, s)
    else:
        eta, top, bottom, _ = _dwell.gaps_at(arm, u)
        s, c = sincos(eta)
    back, _, forth, _ = _dwell.strokes(arm, c, s, max(top, 0.0), max(bottom, 0.0))
    return eta, back, forth


@jit
def _lead(scene, rate, side):
    """Left less right side of (1)."""
    _, _, (speed, spin, _, w, _, _), r, _ = scene
    return speed * rate * (r + side * w) - spin * r


@jit_call
def _root(scene, forth, side, one, two, f_one, f_two):
    """The arm's angle where (1) holds, between one and two, by the Illinois rule."""
    last, eta = math.inf, 0.0
    for _ in range(_ROOT_LIMIT):
        u = (one * f_two - two * f_one) / (f_two - f_one)
        eta, back, rate = rates_at(scene[0], u)
        value = _lead(scene, rate if forth else back, side)
        if magnitude(u - last) <= _NEAR or value == 0.0:
            break
        if (value > 0.0) == (f_two > 0.0):
            f_one *= 0.5
        else:
            one, f_one = two, f_two
        two, f_two, last = u, value, u
    return eta


@jit_call
def stops_of(scene, still):
    """Puts the angles into `still`, from b on; how many. First those where the arm turns, if it does."""
    arm = scene[0]
    first, last = span(arm)
    count = int(0.0)
    if not arm[3]:
        still[0], still[1] = arm[2]
        count += 2
    before, back, forth = first, 0.0, 0.0
    for k in range(_SAMPLES + 1):
        u = first + (last - first) * k / _SAMPLES
        _, now_back, now_forth = rates_at(arm, u)
        for j in range(4 if k > 0 else 0):
            side, ahead = 1.0 if j % 2 else -1.0, j > 1
            old = _lead(scene, forth if ahead else back, side)
            new = _lead(scene, now_forth if ahead else now_back, side)
            if old * new < 0.0 and count < STOP_LIMIT:
                still[count] = _root(scene, ahead, side, before, u, old, new)
                count += 1
        before, back, forth = u, now_back, now_forth
    return count
