"""What travels between the integrators of a scene, by name; each entry is a number of one cell, or of lanes.

Some entries are tuples: the states, one sign a kink, one mark or value an event (the switch, then the kinks).
"""

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


class Start(NamedTuple):
    """Of a motion: `beyond` the surface or not, and what rounding may take (`blur`) from its value, relative to it."""

    state: tuple
    side: float
    signs: tuple
    unit: float
    on: tuple
    beyond: bool
    blur: float


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
    tried: float
    reach: tuple


class Scheme(NamedTuple):
    """A method at a fixed step, how it locates events (both numbers of `events`), and the substeps of a step."""

    method: int
    location: int
    substeps: int


class Limits(NamedTuple):
    """Switches to follow, the step, and the margin of grazing over an event's value at the start of a step."""

    flips: float
    step: float
    graze: float


class Motion(NamedTuple):
    """Where a motion is.

    on : 1 for the event that it starts on
    cut, cuts : length of the step that is tried next (0: a whole one), and how often that has been cut
    """

    state: tuple
    side: float
    signs: tuple
    on: tuple
    cut: float
    cuts: float


class Tally(NamedTuple):
    """What is counted along a motion at a fixed step.

    since, trials, reach, wide : since the last switch: time, trials, largest of each state, of the surface's value
    interval, at, reach_at : between the last two switches; states at the last one, and their reach before it
    count, slim : of switches; least margin behind one
    """

    time: float
    since: float
    interval: float
    count: float
    steps: float
    calls: float
    trials: float
    reach: tuple
    at: tuple
    reach_at: tuple
    wide: float
    slim: float
