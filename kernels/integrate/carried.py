"""Arithmetic of an error that is carried along with a motion; generic in one cell or lanes."""

from kernels.lanes.jit import jit
from kernels.lanes.vectors import where

ULP = 2.0**-50
"""What rounding may take, four times over: as errors are carried, roundings of two states may cancel by chance."""
DOUBT = 4.0
"""By how much an event's margin grows per unit of its error at the start of a leg."""
ORDERLY = 8.0
"""How late, of the time since the event before, one may come: else which comes first is not sure."""
PART = 0.05
"""Of what a state's last rate comes to since the last switch: its size where it is small at the switch."""
FADES = 0.8
"""Of an error at a switch, what counts at the next one at least: where it changes its sign it is small by chance."""
VAGUE = 0.05
"""Of what a step leaves out, what is not known of it."""
STRAIGHT = 20.0
"""Of the rate of an event, what it may change by within the time by which it is late: else it is no straight line."""


@jit
def further(x, by):
    """x, further from 0 by something that is not below 0."""
    return where(x < 0.0, x - by, x + by)
