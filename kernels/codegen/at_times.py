"""A scene as it is at given times.

A scene of its own is made, with a clock as its last state: its first surface is that the clock comes to the
time wanted, or to the end of a drive's period, and it alone counts.
"""

import functools
import inspect
from dataclasses import replace

import numpy as np

from kernels.codegen.record import named_functions
from kernels.codegen.to_tolerance import solver
from kernels.expression.graph import math_recorded

CLOCK, UNTIL = "clock_of_motion", "time_wanted"
MOST_SWITCHES = 100_000
"""Before the time wanted: a motion whose switches accumulate does not come to it."""


def named(function, names):
    """A function of keywords that asks for these names."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    function.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])
    return function


def asked(function, values):
    """What a scene's function returns for those of the values that it asks for, as a tuple; a constant for itself."""
    if not callable(function):
        return (function,)
    with math_recorded(function):
        found = function(**{name: values[name] for name in inspect.signature(function).parameters})
    return tuple(found) if isinstance(found, tuple | list | np.ndarray) else (found,)


@functools.cache
def clocked(scene, drive=None):
    """The scene that ends where its clock has gone on by UNTIL; or which counts its drive's periods, and begins anew.

    `drive` : the period, a number or a function of parameters; then the clock is put back at its end
    """
    timed = scene if scene.start_time is not None else replace(scene, states=(*scene.states, CLOCK), start_time=0.0)
    clock, parameters = timed.states[-1], (*scene.parameters, *([UNTIL] if drive is None else []))

    def until(**given):
        (begin,), (long,) = asked(timed.start_time, given), asked(given.get(UNTIL, drive), given)
        return begin + long - given[clock]

    def again(**given):
        return (*(given[name] for name in timed.states[:-1]), *asked(timed.start_time, given))

    own, jumps = named_functions(scene.surface or {}), named_functions(scene.switch)
    everywhere = jumps.pop("", None)
    surfaces = {f"own {name}": function for name, function in own.items()}
    switches = dict.fromkeys(surfaces, everywhere) | {f"own {name}": function for name, function in jumps.items()}
    if drive is not None:
        switches[f".{CLOCK}"] = named(again, (*timed.states, *parameters))
    return replace(
        timed, name=f"{scene.name}_clocked", parameters=parameters, switch=switches, only_first=True,
        surface={f".{CLOCK}": named(until, (*parameters, clock))} | surfaces, most_kinks=MOST_SWITCHES,
    )  # fmt: skip


def at_times(scene, method, columns, times, rtol):
    """The states (n_states, n_cells) at a time after the start each; and the status."""
    rows, status = solver(clocked(scene), method)([*columns, times, np.ones(len(rtol))], rtol)
    return rows[2:], status
