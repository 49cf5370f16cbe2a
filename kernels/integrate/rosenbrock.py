"""The embedded Rosenbrock method Rodas5P, of orders 5 and 4, L-stable: for stiff scenes; generic in one cell or lanes.

With the exact Jacobian J of the rates f at the start u of a step h, every increment solves one linear system,
    (I - gamma h J) w_i = gamma h f(u + sum_j a_ij w_j) + gamma sum_j c_ij w_j,  j < i                     (1)
and the result is the last stage's place and its increment, which tells the error. What relaxes within much less than h
is damped away. `m` and `mode` as in `steps`; m.factored and m.solved (`expression.stiff`) solve (1).
Source: Steinebach, BIT Numer. Math. 63:27 (2023); Hairer & Wanner, Solving ODEs II, section IV.7.
"""

from kernels.integrate.pairs import CHANCE_5, Pair, Trial, at_least, of_size
from kernels.integrate.steps import ONE, rate
from kernels.integrate.tableaux import RODAS5P, RODAS5P_COUPLED, RODAS5P_GAMMA
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import left_a_call
from kernels.lanes.tuples import after, times
from kernels.lanes.vectors import where

FIRST = 2.0
"""Sizes of a state by which its rates may change it on the first step of a leg."""
ROUNDINGS = 60.0
"""Of its length, that a step makes where rates are constant: 17 on average, 56 at most. Weights of (1) cancel."""


@jit
def factored(m, state, mode, h):
    """The factors of I - gamma h J."""
    return m.factored(state, mode, RODAS5P_GAMMA * h)


@left_a_call
def stepped(m, state, mode, factors, h):
    """The state after the step; the first increment, and the last two."""
    place, increments = state, [m.solved(factors, times(RODAS5P_GAMMA * h, rate(m, state, mode)))]
    for k, coupled in enumerate(RODAS5P_COUPLED):
        done = tuple(increments)
        place = after(state, 1.0, RODAS5P[k], done) if k < len(RODAS5P) else after(place, 1.0, ONE, done[-1:])
        free = times(RODAS5P_GAMMA * h, rate(m, place, mode))
        increments.append(m.solved(factors, after(free, RODAS5P_GAMMA, coupled, done)))
    return after(place, 1.0, ONE, tuple(increments[-1:])), increments[0], increments[-2], increments[-1]


@jit_call
def tried(m, state, mode, h):
    """A step with its estimated error.

    The rates at both ends are those that (1) damps: the true ones of what relaxes at once say nothing of a step.
    """
    factors, over = factored(m, state, mode, h), 1.0 / (RODAS5P_GAMMA * h)
    new, w0, w6, w7 = stepped(m, state, mode, factors, h)
    first, last = times(over, w0), m.solved(factors, rate(m, new, mode))
    before, error = of_size(state, new, first, h, w6), of_size(state, new, first, h, w7)
    return Trial(new, (first,), last, at_least(error, CHANCE_5 * before * before / (1.0 + before)))


@jit
def followable(m, state, mode, unit, h):
    """The first step of a leg, in units: at most so long that its rates change no state by much more than its size.

    Behind a switch a state may be far from where it relaxes to. A step a billion times as long as that takes would be
    right at its end, and pass over all that is met on the way.
    """
    length = h * unit
    rates = rate(m, state, mode)
    damped = m.solved(factored(m, state, mode, length), rates)
    change = of_size(state, state, damped, length, times(length, rates))
    return where(change > FIRST, h * FIRST / change, h)


@jit
def series(m, state, trial, mode, h):
    """The dense output needs nothing but the state."""
    return (times(0.0, state),)


@jit_call
def dense(m, state, terms, mode, h, part):
    """The state at that part of the step: by a step that long."""
    return stepped(m, state, mode, factored(m, state, mode, part * h), part * h)[0]


@jit_call
def vague(m, state, terms, mode, h, part):
    """What the dense output is off by: of what relaxes at once it may be much more than at the step's end."""
    return stepped(m, state, mode, factored(m, state, mode, part * h), part * h)[3]


RODAS5P_PAIR = Pair(tried, series, dense, vague, followable, 5.0, ROUNDINGS)
