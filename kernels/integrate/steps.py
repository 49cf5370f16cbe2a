"""One step of each method, of any scene; generic in one cell or lanes.

`m` is what is written of a scene (`records.Written`), `mode` what its rates hang on beside the state (`records.Mode`).
"""

from kernels.integrate.records import Mode
from kernels.integrate.tableaux import DOP853, DOPRI5, RK4
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import over_tuples, symbolic
from kernels.lanes.tuples import after, joined, paired, times
from kernels.lanes.vectors import choose, fma

ONE = (1.0,)


@jit
def rate(m, state, mode):
    """The rates of the state; with `mode.natural` those of the side of each kink on which it is."""
    signs = mode.signs
    if mode.natural:
        signs = m.natural_signs(state, mode)
    return m.rates(state, Mode(mode.side, signs, mode.parameters, False))


@symbolic
def events(m, state, mode):
    """Value and rate of each event."""
    found = m.jet(state, mode, 0.0 * mode.side + 1.0, ()).events
    values = tuple(fma(factor, u[0], offset) for offset, factor, u in found)
    return values, tuple(factor * u[1] for offset, factor, u in found)


@jit_call
def euler(m, state, mode, h):
    """Explicit Euler: u + h f(u)."""
    return after(state, h, ONE, (rate(m, state, mode),))


@jit_call
def semi_implicit(m, state, mode, h):
    """Semi-implicit Euler: v by the old place, x by the new speed. States are pairs (x, v) with x' = v."""
    kicked = after(state, h, ONE, (rate(m, state, mode),))
    drifted = after(state, h, ONE, (rate(m, kicked, mode),))  # of this the places alone, whose rates are speeds
    return paired(drifted, kicked)


@jit_call
def verlet(m, state, mode, h):
    """Velocity Verlet; where the force hangs on the speed, that at the end is first guessed by an Euler step."""
    k0 = rate(m, state, mode)
    half = after(state, 0.5 * h, ONE, (k0,))
    placed = paired(after(state, h, ONE, (rate(m, half, mode),)), after(state, h, ONE, (k0,)))
    return paired(placed, after(state, 0.5 * h, (1.0, 1.0), (k0, rate(m, placed, mode))))


@jit_call
@over_tuples
def moreau(m, state, mode, h):
    """Moreau's time-stepping for one pair (x, v) with dry friction at v = 0: half a drift, a kick, half a drift.

    The new speed v solves v - v0 = h f(x, sign v) with the friction anywhere between its limits where v = 0.
    Source: Moreau, Comput. Methods Appl. Mech. Eng. 177:329 (1999).
    """
    middle = paired(after(state, 0.5 * h, ONE, (rate(m, state, mode),)), state)
    ahead = tuple(1.0 for sign in mode.signs)
    behind = joined(tuple(-1.0 for sign in mode.signs[:-1]), (1.0,))
    forward = after(state, h, ONE, (m.rates(middle, Mode(mode.side, ahead, mode.parameters, False)),))
    backward = after(state, h, ONE, (m.rates(middle, Mode(mode.side, behind, mode.parameters, False)),))
    slid = choose(forward[-1] > 0.0, forward, choose(backward[-1] < 0.0, backward, times(0.0, state)))
    kicked = paired(state, slid)
    return paired(after(middle, 0.5 * h, ONE, (rate(m, kicked, mode),)), kicked)


@jit_call
def rk4(m, state, mode, h):
    """The classical Runge-Kutta method."""
    k0 = rate(m, state, mode)
    k1 = rate(m, after(state, h, RK4[0], (k0,)), mode)
    k2 = rate(m, after(state, h, RK4[1], (k1,)), mode)
    k3 = rate(m, after(state, h, RK4[2], (k2,)), mode)
    return after(state, h, RK4[3], (k0, k1, k2, k3))


@jit
def dopri5_stages(m, state, mode, h):
    k0 = rate(m, state, mode)
    k1 = rate(m, after(state, h, DOPRI5[0], (k0,)), mode)
    k2 = rate(m, after(state, h, DOPRI5[1], (k0, k1)), mode)
    k3 = rate(m, after(state, h, DOPRI5[2], (k0, k1, k2)), mode)
    k4 = rate(m, after(state, h, DOPRI5[3], (k0, k1, k2, k3)), mode)
    k5 = rate(m, after(state, h, DOPRI5[4], (k0, k1, k2, k3, k4)), mode)
    return after(state, h, DOPRI5[5], (k0, k2, k3, k4, k5)), (k0, k2, k3, k4, k5)


@jit
def dop853_stages(m, state, mode, h):
    k0 = rate(m, state, mode)
    k1 = rate(m, after(state, h, DOP853[0], (k0,)), mode)
    k2 = rate(m, after(state, h, DOP853[1], (k0, k1)), mode)
    k3 = rate(m, after(state, h, DOP853[2], (k0, k2)), mode)
    k4 = rate(m, after(state, h, DOP853[3], (k0, k2, k3)), mode)
    k5 = rate(m, after(state, h, DOP853[4], (k0, k3, k4)), mode)
    k6 = rate(m, after(state, h, DOP853[5], (k0, k3, k4, k5)), mode)
    k7 = rate(m, after(state, h, DOP853[6], (k0, k3, k4, k5, k6)), mode)
    k8 = rate(m, after(state, h, DOP853[7], (k0, k3, k4, k5, k6, k7)), mode)
    k9 = rate(m, after(state, h, DOP853[8], (k0, k3, k4, k5, k6, k7, k8)), mode)
    k10 = rate(m, after(state, h, DOP853[9], (k0, k3, k4, k5, k6, k7, k8, k9)), mode)
    k11 = rate(m, after(state, h, DOP853[10], (k0, k3, k4, k5, k6, k7, k8, k9, k10)), mode)
    stages = k0, k5, k6, k7, k8, k9, k10, k11
    return after(state, h, DOP853[11], stages), stages
