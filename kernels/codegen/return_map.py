"""Maps of a scene's states: from one switch at its first surface to a later one, and from the start to a given time.

A run begins just after the switch. So a separate scene is made, whose start takes the states before the switch as
parameters; if the parameter FRESH is 1, it starts as the scene itself does. Its rates, surfaces and switches are those
of the scene; of several surfaces only the first is counted. The state on which that surface depends is set to lie on
it. For a periodically driven scene, the switch is the end of a period, and all states are free. For given times, a
scene is made with a clock as its last state, whose first surface is reached when the clock shows the requested time.
"""

import functools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kernels.codegen.compiled import running, written_of
from kernels.codegen.record import named_functions, record, returned
from kernels.codegen.to_tolerance import solver
from kernels.expression.graph import ADD, INPUT, NUMBER, SceneError, needed
from kernels.integrate.records import Mode
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.columns import DONE, fresh, to_the_end
from kernels.lanes.jit import jit_call
from kernels.lanes.tuples import flat, read, write
from kernels.lanes.vectors import where

FRESH, CLOCK, UNTIL = "from_start", "clock_of_motion", "time_wanted"
MOST_SWITCHES = 100_000
"""Before the time wanted: a motion whose switches accumulate does not come to it."""
TOLERANCES = {
    "taylor": (3e-14, 4e-10, 2e-3),
    "rodas5p": (1e-10, 1e-7, 1e-2),
    "dop853": (1e-12, 1e-8, 4e-3),
}
"""Of runs by each method the tightest, and that of what is wanted roughly; and the step of differences, a share of what
is changed, where what they leave out and what the tightest runs leave out come to the same."""
OTHERS = 1.0, 10.0, 100.0
"""Tolerances of runs whose steps end at other points, over the one of the first."""
TIGHT = 30.0
"""Of the tightest tolerance, that of the sizes."""
APART = 4.0
"""Differences of runs, within which the largest size is."""


class ReturnMap:
    """The return map by one method, of columns of cells; the scene's functions are called here, and not later.

    Parameters
    ----------
    scene : whose cycles are wanted
    method : "taylor", "rodas5p", "dop853", "dopri5"
    drive : the period with which the scene is driven, a function of its parameters; or None
    """

    def __init__(self, scene, method, drive=None):
        if drive is None and scene.start_time is not None:
            raise SceneError(f"{scene.name}: a cycle that depends on the time `t` needs the period of its `drive`")
        if drive is None and scene.surface is None:
            raise SceneError(f"{scene.name}: a cycle needs a surface, or a drive")
        self.own, self.method, self.driven, self.scene = scene, method, drive is not None, returning(scene, drive)
        self.states = scene.states if scene.start_time is None else scene.states[:-1]
        recorded = record(self.scene)
        parts = needed(*recorded.rates, recorded.surface, *recorded.graph.kinks, *recorded.switched)
        self.sides = any(x.kind == INPUT and x.args[0] == "side" for x in parts)
        """Whether the motion, a surface or a switch hangs on the side."""
        if self.sides and (self.driven or isinstance(scene.surface, Mapping)):
            raise SceneError(f"{scene.name}: `side` cannot occur here; take a state of rate 0 that switches set")
        self.held = [] if self.driven else [watched(scene)[-1]]
        """The state that is put onto the surface."""
        self.directions = [j for j in range(len(self.states)) if j not in self.held]
        """Of the states, those that the map depends on."""
        self.modes = [j for j, rate in enumerate(recorded.rates) if rate.kind == NUMBER and not rate.args[0]]
        """The states whose rate is 0."""
        self.fine, self.rough, self.step = TOLERANCES[method]
        turning = [replace(self.scene, peaks=peaks) for peaks in ("all", "some")]
        self._sized = list(zip((*turning, self.scene), ((1.0,), OTHERS, OTHERS), strict=True))
        for one in (*turning, *([] if self.driven else [clocked(scene)])):
            record(one)

    def passed(self, parameters, before, flips, rtol, scene=None):
        """Rows of time and states, `flips` switches after the one before which the states are given; statuses; and the
        largest sizes of the states on the way, at the ends of steps. Numbers are NaN where the motion ends before.

        Parameters
        ----------
        before : None where the scene's start is meant instead
        scene : the map's own one, or with `peaks`
        """
        n, start = len(self.states), np.full(len(flips), float(before is None))
        begin = np.zeros((n, len(flips))) if before is None else before
        solve = solver(scene or self.scene, self.method, again=False)
        found, status, _ = solve([*parameters, *begin, start, flips], rtol)
        found[:, status >= FIRST_REFUSAL] = np.nan
        sizes = 2 + len(self.scene.states)
        return found[[0, *range(2, 2 + n)]], status, found[sizes : sizes + n]

    def turned(self, parameters, before, flips):
        """The largest sizes on the way, tightly, where states turn round; and by how much they may be off besides.

        Where a turn cannot be told, sizes are those of three runs whose steps end at other points.
        """
        sizes, off = np.full(before.shape, np.nan), np.full(before.shape, np.inf)
        for scene, tolerances in self._sized:
            left = np.flatnonzero(np.isnan(sizes).any(axis=0))
            if len(left):
                some, rtol = (parameters[:, left], before[:, left], flips[left]), np.full(len(left), TIGHT * self.fine)
                runs = [self.passed(*some, many * rtol, scene)[1:] for many in tolerances]
                found = [np.where(status <= Status.INACCURATE, on_the_way, np.nan) for status, on_the_way in runs]
                sizes[:, left] = np.maximum.reduce(found)
                off[:, left] = APART * (sizes[:, left] - np.minimum.reduce(found))
        return sizes, np.where(np.isnan(off), np.inf, off)


@functools.cache
def clocked(scene, drive=None):
    """The scene that ends where its clock has gone on by UNTIL; or which counts its drive's periods, and begins anew.

    `drive` : the period, a number or a function of parameters; then the clock is put back at its end
    """
    timed = scene if scene.start_time is not None else replace(scene, states=(*scene.states, CLOCK), start_time=0.0)
    clock, ends = timed.states[-1], drive is None

    def until(**given):
        (begin,), (long,) = returned(timed.start_time, given), (given[UNTIL],) if ends else returned(drive, given)
        return begin + long - given[clock]

    def again(**given):
        return (*(given[name] for name in timed.states[:-1]), *returned(timed.start_time, given))

    own, jumps = named_functions(scene.surface or {}), named_functions(scene.switch)
    everywhere = jumps.pop("", None)
    surfaces = {f"own {name}": function for name, function in own.items()}
    switches = dict.fromkeys(surfaces, everywhere) | {f"own {name}": function for name, function in jumps.items()}
    return replace(
        timed, name=f"{scene.name}_clocked", parameters=(*scene.parameters, UNTIL) if ends else scene.parameters,
        surface={f".{CLOCK}": until} | surfaces, switch=switches if ends else switches | {f".{CLOCK}": again},
        only_first=True, until=ends, most_kinks=MOST_SWITCHES,
    )  # fmt: skip


def watched(scene):
    """offset, factor, and the number of the state u: the first surface is offset + factor u.

    Raises SceneError where it watches more than one state.
    """
    offset, factor, u = record(scene).events[0]
    while u.kind == ADD and not all(term.varies for term in u.args):
        constant, term = sorted(u.args, key=lambda term: term.varies)
        by, u = u.graph.parts(term)
        offset, factor = offset + factor * constant, factor * by
    if u.kind != INPUT:
        raise SceneError(f"surface of the scene {scene.name}: for a cycle it must be a state plus a constant")
    return offset, factor, scene.states.index(u.args[0])


@functools.cache
def returning(scene, drive):
    """The scene that begins behind a switch at side -1, or at its start; driven, with a period."""
    own = replace(scene, only_first=True) if drive is None else clocked(scene, drive)
    states = scene.states if scene.start_time is None else scene.states[:-1]
    places = [f"{name}_before" for name in states]
    first, switches = next(iter(named_functions(own.surface))), named_functions(scene.switch)
    jump = switches.get(first, switches.get(""))

    def start(**given):
        before = {name: given[place] for name, place in zip(states, places, strict=True)}
        values = {**given, "side": -1.0, ".way": 1.0}
        if drive is None:
            (offset, factor, number), graph = watched(scene), given[FRESH].graph
            before[states[number]] = -graph.again(offset, values) / graph.again(factor, values)
        behind = before.values() if drive or jump is None else returned(jump, values | before)
        graph, begun = given[FRESH].graph, returned(scene.start, given)
        return tuple(graph.chosen(given[FRESH], graph.of(x), graph.of(y)) for x, y in zip(begun, behind, strict=True))

    name, parameters = f"{scene.name}_return", (*own.parameters, *places, FRESH)
    return replace(own, name=name, parameters=parameters, start=start, begins=FRESH)


@functools.cache
def rating(scene):
    """The function of columns of parameters and states, and of a side, that gives the rates of each state."""
    functions, m = written_of(scene)
    like = 0.0, (0.0,) * len(scene.parameters), 0.0, (0.0,) * len(scene.states)

    @jit_call
    def of_lanes(memory, i):
        stage, parameters, side, state = read(memory, i, like)
        signs = m.natural_signs(state, Mode(side, (), parameters, False))
        rates = m.rates(state, Mode(side, signs, parameters, False))
        write(memory, i, (where(stage > 0.5, DONE, stage), parameters, side, rates))
        return True

    run = running(functions, of_lanes, "rates")

    def rates(parameters, states, side):
        cells = fresh(len(flat(like)), [*parameters, np.full(states.shape[1], side), *states])
        to_the_end(run, cells)
        return cells[:, -len(states) :].T

    return rates
