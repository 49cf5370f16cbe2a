"""One step of each method, of any scene; generic in one cell or lanes.

`m` has the compiled functions of a scene (`records.Written`), `mode` what its rates depend on beside the state
(`Mode`).
"""

from kernels.integrate.records import Mode
from kernels.integrate.tableaux import DOP853, DOP853_OF, DOPRI5, DOPRI5_OF, RK4, RK4_OF
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import left_a_call, symbolic
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
    found = m.jet(state, mode, 0.0 * mode.side + 1.0)
    values = tuple(fma(factor, u[0], offset) for offset, factor, u in found)
    return values, tuple(factor * u[1] for offset, factor, u in found)


def explicit(tableau, counting):
    """A step of an explicit method, (m, state, mode, h) -> the state after it, and the rates that it is made of.

    Parameters
    ----------
    tableau : for each stage but the first, and for the result, the weights of the rates that count for it
    counting : the numbers of these
    """

    def step(m, state, mode, h):
        rates = [rate(m, state, mode)]
        for weights, those in zip(tableau[:-1], counting[:-1], strict=True):
            rates.append(rate(m, after(state, h, weights, tuple(rates[j] for j in those)), mode))
        stages = tuple(rates[j] for j in counting[-1])
        return after(state, h, tableau[-1], stages), stages

    return symbolic(step)


euler, rk4 = explicit((ONE,), ((0,),)), explicit(RK4, RK4_OF)
dopri5, dop853 = explicit(DOPRI5, DOPRI5_OF), explicit(DOP853, DOP853_OF)


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


@left_a_call
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
