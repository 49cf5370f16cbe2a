"""Records passed between the integrators of a scene; each entry is a number of one cell, or of lanes.

Some entries are tuples: the states, one sign a kink, one mark or value an event (the switch, then the kinks).
"""

from collections import namedtuple
from typing import NamedTuple


class Mode(NamedTuple):
    """The smooth piece of a motion that a state is on: what its rates hang on beside it.

    With `natural` the signs of the kinks are those of each stage, as a method without event location takes them; else
    they are held, and the motion is followed as if the kink were not there, until it is located.
    """

    side: float
    signs: tuple
    parameters: tuple
    natural: bool


Written = namedtuple(
    "Written",
    "rates surface kinks switched started natural_signs underflows jet lost hidden bounds made most_kinks cell "
    "roundings biased speeds onto surfaces hiding passable deciding jumped on_clock states_off shaken judged factored "
    "solved error",
    defaults=(None, None, None),
)
"""What is written of a scene: functions of (state, mode) unless said otherwise, and its numbers.

rates, surface, kinks, switched : rates; the surface's value; what is 0 at each kink; the state behind a switch
started : (parameters, side) -> the state
natural_signs : 1 or -1 for each kink, the side on which the state is, and the way over the surface, 1
underflows : (state, mode, unit) -> whether a product loses its digits
jet : (state, mode, unit) -> of each event its offset, factor and series of order 2
lost : what rounding takes from the surface's value at the start, as far as times hang on it; -1 just behind a switch
hidden, bounds : (state, boxes, mode) -> what a box hides of rates and events; the events' values and rates in it
made : what each event's value is made of, in size, and its rate
most_kinks : between two switches, after which a cell is given up
cell : a `Cell` of zeros
roundings : that an event is missed by at most, by the method
biased : 1 where compared runs miss all events to one side, as the weights of steps round; else 0
speeds : of each kink's u ahead of it and behind it, the other signs as they are; None where no motion slides
onto : the state put back onto the kink that it slides along, or None
surfaces : 1 for each kink that is a further surface, at which the motion switches too, 2 where such switches do
    not count; None where there is none
hiding : 1 for each rate, and for each event, that can hide something; None where none can
passable : 1 for the surface, and for each kink, that does not depend on the side: a motion may pass through it
deciding : 1 for each kink whose side decides what a switch does; None where there is none
jumped : (state, mode, on, blur) -> marks and signs where kinks are met, of what jumps over 0 there; whether that comes
    next to 0; None where nothing does
on_clock : (state, unit, h) -> the step next to h > 0 by which each *clock*, a state whose rate is 1, is not rounded
states_off : (state, by) -> the state, its clocks off by so many parts of themselves, others by fewer
shaken : (state, new) -> the new state, but of held ones (`Graph.held`) those that are whole numbers as they were
judged : of each constant of held states whose sign decides, its value and what that is made of; None where none does
factored, solved : None, or of a scene that may be stiff (`expression.stiff`)
error : `carried.Changes`; None where no error is carried along
"""


class Pieces(NamedTuple):
    """Taylor series at a state, each a tuple of coefficients; time in units.

    states, events : of each state; (offset, factor, series) of each event
    controlled : the series that a step's length hangs on
    of_states, of_events : what each state, and what each event watches, is evaluated from (`taylor.Way`)
    inner, rough : coefficients that the tangents take from the series
    """

    states: tuple
    events: tuple
    controlled: tuple
    of_states: tuple
    of_events: tuple
    inner: tuple
    rough: tuple


class Cell(NamedTuple):
    """All that a lane knows of its cell between two events; the first entry is the lane's stage, inputs follow.

    shake : by how many of its roundings each event is missed, and each state at the start (`driver.missed_by`)
    time, interval, at, size, verdict : results: of the last switch; interval and states there; states' sizes; status
    unit, h : of time, in seconds; the next step, in units
    count, since, kinks_met : switches; time and kinks since the last one
    steps, before : of the last leg, of the one before
    own : what the method carries along: `Errors`, `fixed_step.Fixed`, or ()
    """

    stage: float
    parameters: tuple
    flips: float
    tolerance: float
    shake: float
    time: float
    interval: float
    at: tuple
    size: tuple
    verdict: float
    state: tuple
    side: float
    signs: tuple
    unit: float
    h: float
    on: tuple
    count: float
    since: float
    kinks_met: float
    steps: float
    before: float
    own: tuple


class Errors(NamedTuple):
    """What a lane knows of its error: of each state, then of the time and of the time since the last switch.

    told, error : whether it is heeded; the largest of the last switch, relative
    off, spread : the error, and what is not known of it
    noise : time by which rounding may misplace the last event
    once : the largest so far at a switch, fading
    peak : the largest so far of each state
    """

    told: float
    error: float
    off: tuple
    spread: tuple
    noise: float
    once: tuple
    peak: tuple


class Step(NamedTuple):
    """A step of length h from `state` to `new`, and each event's value and rate at both ends."""

    state: tuple
    new: tuple
    h: float
    start: tuple
    start_rates: tuple
    end: tuple
    end_rates: tuple


class Leg(NamedTuple):
    """A motion at the event that ends it, after the time t.

    on : 1 for the event that fired, and for what fell with it
    stuck, lost, broken : pressed on what it started on; not there within limits; numbers that are none
    grazing, hangs : neither met nor missed for sure; met, but only just
    vague : the rates may have hidden something, or two surfaces are met within what is not known of when they are
    paused : not there yet, when most others have waited for long
    tried : steps
    reach : the largest magnitude of each state on the way
    """

    state: tuple
    t: float
    h: float
    on: tuple
    stuck: bool
    lost: bool
    broken: bool
    grazing: bool
    hangs: bool
    vague: bool
    paused: bool
    tried: float
    reach: tuple
