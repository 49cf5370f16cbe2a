"""The embedded pairs Dormand-Prince 5(4) and DOP853: a step with its estimated error, and dense output.

Generic in one cell or lanes; `m` and `mode` as in `steps`.
"""

from collections import namedtuple
from typing import NamedTuple

from kernels.integrate.steps import ONE, dop853, dopri5, rate
from kernels.integrate.tableaux import (
    DOP853_DENSE,
    DOP853_ERROR_3,
    DOP853_ERROR_5,
    DOP853_MORE,
    DOPRI5_DENSE,
    DOPRI5_ERROR,
)
from kernels.integrate.taylor import TINY
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.symbols import left_a_call, symbolic, written
from kernels.lanes.tuples import after, times
from kernels.lanes.vectors import fma, magnitude, sqrt, where

CHANCE_3, CHANCE_5 = 0.02, 0.01
"""An estimate of high order may be 0 by chance on a step far too long, the first behind a switch for one; a rough one
of low order tells. The square of DOP853's third-order estimate, times 0.02, is of the order of its estimate, and below
it on any step worth taking; so is for Dormand-Prince 5(4) 0.01 of that of what the last two rates differ by."""
VAGUE = 0.6
"""Of the last term of DOP853's dense output, which is off by 0.13 to 0.17 of it: little beside the step's own error
where the tolerance limits the step, up to 130 times as much where friction does. Where this is over the tolerance, a
step that ends nearer to the event is taken."""


ROUNDINGS = 3.0
"""Of a state, that an explicit step makes at most."""


class Trial(NamedTuple):
    """A step that is tried: the state after it, its stages, the last rates, the error over the states' sizes."""

    new: tuple
    stages: tuple
    last: tuple
    error: float


@symbolic
def of_size(state, new, first, h, error):
    """The largest error of a state over its own size on the step; what has faded to next to nothing has none."""
    worst = 0.0 * h
    for i in range(len(state)):
        start, end = magnitude(state[i]), magnitude(new[i])
        size = fma(magnitude(h), magnitude(first[i]), where(start > end, start, end))
        part = magnitude(error[i]) / where(size > TINY, size, 1.0)
        worst = where(part <= worst, worst, part)  # NaN stays
    return worst


@symbolic
def at_least(error, least):
    """The larger one; NaN stays."""
    return where(error < least, least, error)


@jit_call
def dop853_tried(m, state, mode, h):
    """A step with its estimated error."""
    new, stages = dop853(m, state, mode, h)
    nothing = times(0.0, state)
    fifth, third = after(nothing, h, DOP853_ERROR_5, stages), after(nothing, h, DOP853_ERROR_3, stages)
    worst_5, worst_3 = of_size(state, new, stages[0], h, fifth), of_size(state, new, stages[0], h, third)
    total = fma(0.01 * worst_3, worst_3, worst_5 * worst_5)
    error = where(total <= 0.0, 0.0, worst_5 * worst_5 / sqrt(total))
    return Trial(new, stages, rate(m, new, mode), at_least(error, CHANCE_3 * worst_3 * worst_3))


@left_a_call
def dop853_series(m, state, trial, mode, h):
    """What the dense output is made of: seven terms."""
    k0, k5, k6, k7, k8, k9, k10, k11 = trial.stages
    new, last = trial.new, trial.last
    k13 = rate(m, after(state, h, DOP853_MORE[0], (k0, k6, k7, k8, k9, k10, k11, last)), mode)
    k14 = rate(m, after(state, h, DOP853_MORE[1], (k0, k5, k6, k7, k10, k11, last, k13)), mode)
    k15 = rate(m, after(state, h, DOP853_MORE[2], (k0, k5, k6, k7, k8, last, k13, k14)), mode)
    nothing = times(0.0, state)
    change = after(new, -1.0, ONE, (state,))
    all_stages = (*trial.stages, last, k13, k14, k15)
    return (
        change,
        after(times(-1.0, change), h, ONE, (k0,)),
        after(times(2.0, change), -h, (1.0, 1.0), (last, k0)),
        *tuple(after(nothing, h, weights, all_stages) for weights in DOP853_DENSE),
    )


@jit
def dop853_dense(m, state, terms, mode, h, part):
    """The state at that part of the step."""
    f0, f1, f2, f3, f4, f5, f6 = terms
    rest = 1.0 - part
    y = after(f5, part, ONE, (f6,))
    y = after(f4, rest, ONE, (y,))
    y = after(f3, part, ONE, (y,))
    y = after(f2, rest, ONE, (y,))
    y = after(f1, part, ONE, (y,))
    y = after(f0, rest, ONE, (y,))
    return after(state, part, ONE, (y,))


@jit
def dop853_vague(m, state, terms, mode, h, part):
    """How far the dense output may be off at that part of the step, four times over."""
    rest = 1.0 - part
    square = part * part
    return times(VAGUE * square * square * rest * rest * rest, terms[6])


@jit_call
def dopri5_tried(m, state, mode, h):
    """A step with its estimated error."""
    new, stages = dopri5(m, state, mode, h)
    last = rate(m, new, mode)
    error = after(times(0.0, state), h, DOPRI5_ERROR, (*stages, last))
    bend = of_size(state, new, stages[0], h, times(h, after(last, -1.0, ONE, (stages[4],))))
    worst = of_size(state, new, stages[0], h, error)
    return Trial(new, stages, last, at_least(worst, CHANCE_5 * bend * bend / (1.0 + bend)))


@jit
def dopri5_series(m, state, trial, mode, h):
    """What the dense output is made of."""
    return (*trial.stages, trial.last)


@jit
def dopri5_vague(m, state, terms, mode, h, part):
    """The dense output is off by no more than 1.3 times what the step is."""
    return times(0.0 * part, terms[0])


@written
def dopri5_dense(m, state, terms, mode, h, part):
    """The state at that part of the step."""
    weights = tuple(part * fma(part, fma(part, fma(part, d, c), b), a) for a, b, c, d in DOPRI5_DENSE)
    return after(state, h, weights, terms)


Pair = namedtuple("Pair", "tried series dense vague first order roundings scene", defaults=(None,))
"""An embedded pair of methods, as functions: a step with its error, its dense output, how far that may be off.

`first` is the first step of a leg, in units; a step makes as many `roundings` of its own length at most. `scene` is
the `Written` of the scene that it follows.
"""


@jit
def as_it_is(m, state, mode, unit, h):
    """The first step as it was guessed."""
    return h


DOPRI5 = Pair(dopri5_tried, dopri5_series, dopri5_dense, dopri5_vague, as_it_is, 5.0, ROUNDINGS)
DOP853 = Pair(dop853_tried, dop853_series, dop853_dense, dop853_vague, as_it_is, 8.0, ROUNDINGS)


def kept_on_kink(pair):
    """The pair whose steps and dense output are put back onto the kink that the motion slides along.

    By how much further it is off the kink than at its start, where rounding may leave it, a step has an error too, that
    the embedded method does not tell of where a state follows another one a million times enlarged. What the weights of
    a method make of rounding is put back too, so that an event is missed by as little as by an explicit one.
    """
    free_tried, free_dense = pair.tried, pair.dense

    @jit_call
    def tried(m, state, mode, h):
        trial = free_tried(m, state, mode, h)
        new = m.onto(trial.new, mode)
        off = after(new, -1.0, (1.0, 1.0, -1.0), (trial.new, m.onto(state, mode), state))
        error = of_size(state, new, trial.stages[0], h, off)
        return Trial(new, trial.stages, trial.last, at_least(trial.error, error))

    @jit_call
    def dense(m, state, terms, mode, h, part):
        return m.onto(free_dense(m, state, terms, mode, h, part), mode)

    return pair._replace(tried=tried, dense=dense, roundings=ROUNDINGS)
