"""One step of each method, of any scene; generic in one cell or lanes.

`m` has the written functions of a scene (`stepped_source`), and a `scene` is (side, signs, parameters, natural): with
`natural` the signs of the kinks are those of each stage, as a method without event location takes them; else they are
held, and the motion is followed as if the kink were not there, until it is located.
"""

from kernels.integrate.tableaux import (
    DOP853,
    DOPRI5,
    RK4,
)
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.tuples import after, paired, times
from kernels.lanes.vectors import choose

ONE = (1.0,)


@jit
def rate(m, state, scene):
    """The rates of the state."""
    side, signs, parameters, natural = scene
    if natural:
        signs = m.natural_signs(state, side, parameters)
    return m.rates(state, side, signs, parameters)


@jit_call
def euler(m, state, scene, h):
    """Explicit Euler: u + h f(u)."""
    return after(state, h, ONE, (rate(m, state, scene),))


@jit_call
def semi_implicit(m, state, scene, h):
    """Semi-implicit Euler: v by the old place, x by the new speed. States are pairs (x, v) with x' = v."""
    kicked = after(state, h, ONE, (rate(m, state, scene),))
    drifted = after(state, h, ONE, (rate(m, kicked, scene),))  # of this the places alone, whose rates are speeds
    return paired(drifted, kicked)


@jit_call
def verlet(m, state, scene, h):
    """Velocity Verlet; where the force hangs on the speed, that at the end is first guessed by an Euler step."""
    k0 = rate(m, state, scene)
    half = after(state, 0.5 * h, ONE, (k0,))
    placed = paired(after(state, h, ONE, (rate(m, half, scene),)), after(state, h, ONE, (k0,)))
    return paired(placed, after(state, 0.5 * h, (1.0, 1.0), (k0, rate(m, placed, scene))))


@jit_call
def moreau(m, state, scene, h):
    """Moreau's time-stepping for one pair (x, v) with dry friction at v = 0: half a drift, a kick, half a drift.

    The new speed v solves v - v0 = h f(x, sign v) with the friction anywhere between its limits where v = 0.
    Source: Moreau, Comput. Methods Appl. Mech. Eng. 177:329 (1999).
    """
    side, _, parameters, _ = scene
    middle = paired(after(state, 0.5 * h, ONE, (rate(m, state, scene),)), state)
    forward = after(state, h, ONE, (m.rates(middle, side, m.ahead, parameters),))
    backward = after(state, h, ONE, (m.rates(middle, side, m.behind, parameters),))
    slid = choose(forward[-1] > 0.0, forward, choose(backward[-1] < 0.0, backward, times(0.0, state)))
    kicked = paired(state, slid)
    return paired(after(middle, 0.5 * h, ONE, (rate(m, kicked, scene),)), kicked)


@jit_call
def rk4(m, state, scene, h):
    """The classical Runge-Kutta method."""
    k0 = rate(m, state, scene)
    k1 = rate(m, after(state, h, RK4[0], (k0,)), scene)
    k2 = rate(m, after(state, h, RK4[1], (k1,)), scene)
    k3 = rate(m, after(state, h, RK4[2], (k2,)), scene)
    return after(state, h, RK4[3], (k0, k1, k2, k3))


@jit
def dopri5_stages(m, state, scene, h):
    k0 = rate(m, state, scene)
    k1 = rate(m, after(state, h, DOPRI5[0], (k0,)), scene)
    k2 = rate(m, after(state, h, DOPRI5[1], (k0, k1)), scene)
    k3 = rate(m, after(state, h, DOPRI5[2], (k0, k1, k2)), scene)
    k4 = rate(m, after(state, h, DOPRI5[3], (k0, k1, k2, k3)), scene)
    k5 = rate(m, after(state, h, DOPRI5[4], (k0, k1, k2, k3, k4)), scene)
    return after(state, h, DOPRI5[5], (k0, k2, k3, k4, k5)), (k0, k2, k3, k4, k5)


@jit_call
def dopri5(m, state, scene, h):
    """Dormand-Prince 5(4), the fifth order."""
    return dopri5_stages(m, state, scene, h)[0]


@jit
def dop853_stages(m, state, scene, h):
    k0 = rate(m, state, scene)
    k1 = rate(m, after(state, h, DOP853[0], (k0,)), scene)
    k2 = rate(m, after(state, h, DOP853[1], (k0, k1)), scene)
    k3 = rate(m, after(state, h, DOP853[2], (k0, k2)), scene)
    k4 = rate(m, after(state, h, DOP853[3], (k0, k2, k3)), scene)
    k5 = rate(m, after(state, h, DOP853[4], (k0, k3, k4)), scene)
    k6 = rate(m, after(state, h, DOP853[5], (k0, k3, k4, k5)), scene)
    k7 = rate(m, after(state, h, DOP853[6], (k0, k3, k4, k5, k6)), scene)
    k8 = rate(m, after(state, h, DOP853[7], (k0, k3, k4, k5, k6, k7)), scene)
    k9 = rate(m, after(state, h, DOP853[8], (k0, k3, k4, k5, k6, k7, k8)), scene)
    k10 = rate(m, after(state, h, DOP853[9], (k0, k3, k4, k5, k6, k7, k8, k9)), scene)
    k11 = rate(m, after(state, h, DOP853[10], (k0, k3, k4, k5, k6, k7, k8, k9, k10)), scene)
    stages = k0, k5, k6, k7, k8, k9, k10, k11
    return after(state, h, DOP853[11], stages), stages


@jit_call
def dop853(m, state, scene, h):
    """Order 8 of Dormand and Prince."""
    return dop853_stages(m, state, scene, h)[0]
