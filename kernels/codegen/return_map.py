"""The return map of a scene: its states just before a switch, from those just before one `flips` earlier.

A run begins behind the switch. So a scene of its own is made, whose start takes the states before it as parameters,
and which begins as the scene itself does where the parameter FRESH is 1. Its rates, surface and switch are the scene's.
The state that the surface watches is put onto the surface, whatever is given for it.
"""

import functools
import inspect
from dataclasses import replace

import numpy as np

from kernels.codegen import followed_twice, stated_error
from kernels.codegen.accumulated import to_rest
from kernels.codegen.functions import Functions
from kernels.codegen.module import build, running
from kernels.codegen.record import record
from kernels.codegen.slid_along import slid_along
from kernels.codegen.stepped import runs, twice_by
from kernels.integrate.records import Mode
from kernels.interface import Status
from kernels.lanes import refill
from kernels.lanes.jit import jit_call
from kernels.lanes.tuples import flat, read, write
from kernels.lanes.vectors import where
from kernels.source_text.expression import INPUT, Expression, SceneError, math_recorded, needed

FRESH = "from_start"
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
    """The return map by one method, of columns of cells.

    Parameters
    ----------
    scene : whose cycles are wanted
    method : "taylor", "rodas5p", "dop853", "dopri5"
    """

    def __init__(self, scene, method):
        self.scene, self.method, self.seen = returning(scene), method, watched(scene)
        self.fine, self.rough, self.step = TOLERANCES[method]
        self._how = to_the_end(self.scene, method)
        self.directions = [j for j in range(len(scene.states)) if j != self.seen]
        """Of the states, those that the map depends on."""

    def passed(self, parameters, before, flips, rtol, fresh=0.0):
        """Time, states and statuses, columns: at the switch `flips` after the one before which the states are given."""
        count, n = len(flips), len(before)
        found, status = np.full((2 + n, count), np.nan), np.empty(count, np.int8)
        columns = [*parameters, *before, np.full(count, fresh), flips]
        self._how(build(self.scene), columns, rtol, list(found), status)
        return found[0], found[2:], status

    def sizes(self, parameters, before, flips):
        """The largest size of each state on the way to some digits; NaN where the motion does not get there."""
        return self._sizes(self.scene, parameters, before, flips, self.rough)

    def turned(self, parameters, before, flips):
        """The same tightly, where states turn round; and by how much it may be off besides.

        Where a turn cannot be told, sizes are those of three runs whose steps end at other points.
        """
        tight = TIGHT * self.fine
        sizes, off = self._sizes(turning(self.scene, True), parameters, before, flips, tight), np.zeros(before.shape)
        for scene, sure in (
            (turning(self.scene, False), paired(self.scene)),
            (self.scene, np.full(len(before), False)),
        ):
            left = np.flatnonzero(np.isnan(sizes).any(axis=0))
            if len(left):
                some, here, steps = [c[left] for c in parameters], before[:, left], flips[left]
                others = [self._sizes(scene, some, here, steps, many * tight) for many in OTHERS]
                sizes[:, left] = np.maximum.reduce(others)
                off[:, left] = np.where(sure[:, None], 0.0, APART * (sizes[:, left] - np.minimum.reduce(others)))
        return sizes, np.where(np.isnan(off), np.inf, off)

    def _sizes(self, scene, parameters, before, flips, rtol):
        """The largest size of each state at the ends of steps."""
        count, n = len(flips), len(before)
        module = build(scene) if self.method == "taylor" else runs(scene, self.method)
        columns = [*parameters, *before, np.zeros(count), flips]
        found = followed_twice.followed(module, columns, np.full(count, rtol))
        return np.where(found[-1] <= Status.INACCURATE, found[2 + n : -1], np.nan)

    def rates(self, parameters, states, side):
        """The rates of each state, columns."""
        run, like = rating(self.scene)
        cells = refill.fresh(len(flat(like)), [*parameters, np.full(states.shape[1], side), *states])
        refill.to_the_end(run, cells)
        return cells[:, -len(states) :].T


def to_the_end(scene, method):
    """The function of columns that follows the scene by the method: to where switches accumulate, and along kinks."""
    how = stated_error.by_one(scene) if method == "taylor" else twice_by(method, scene)
    return slid_along(to_rest(how), scene, method)


def named(function, names):
    """A function of keywords that asks for these names."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    function.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])
    return function


def asked(function, values):
    """What a scene's function returns for those of the values that it asks for, as a tuple."""
    with math_recorded(function):
        found = function(**{name: values[name] for name in inspect.signature(function).parameters})
    return tuple(found) if isinstance(found, tuple | list | np.ndarray) else (found,)


def watched(scene):
    """The number of the state that the surface watches. Raises SceneError where that is not one alone."""
    u = record(scene).events[0][2]
    if u.kind != INPUT:
        raise SceneError(f"surface of the scene {scene.name}: of a cycle it has to be a state, but for constants")
    return scene.states.index(u.args[0])


def has_sides(scene):
    """Whether the motion or its surface hangs on the side."""
    recorded = record(scene)
    parts = needed(*recorded.rates, recorded.surface, *recorded.switched)
    return any(x.kind == INPUT and x.args[0] == "side" for x in parts)


@functools.cache
def returning(scene):
    """The scene that begins behind a switch at side -1, or at its start."""
    places = [f"{name}_before" for name in scene.states]
    seen = watched(scene)
    offset, factor, _ = record(scene).events[0]

    def start(**given):
        before = {name: given[place] for name, place in zip(scene.states, places, strict=True)}
        graph = given[FRESH].graph
        values = {**given, "side": -1.0, ".way": 1.0}
        before[scene.states[seen]] = -graph.again(offset, values) / graph.again(factor, values)
        behind = tuple(before.values())
        if scene.switch is not None:
            behind = asked(scene.switch, values | before)
        fresh, begun = given[FRESH], asked(scene.start, given)
        return tuple(fresh * x + (1.0 - fresh) * y for x, y in zip(begun, behind, strict=True))

    parameters = (*scene.parameters, *places, FRESH)
    start = named(start, (*parameters, "side"))
    return replace(scene, name=f"{scene.name}_return", parameters=parameters, start=start, exact_start=True)


def paired(scene):
    """Whether the rate of each state is another state, but for a factor."""
    return np.array([r.varies and r.graph.parts(r)[1].kind == INPUT for r in record(scene).rates])


@functools.cache
def turning(scene, everywhere):
    """The scene with a kink wherever a state turns round, so that steps end where its size is largest.

    If not `everywhere`, of states alone whose rate is another one: a rate may come close to 0 and stay there.
    """
    those = np.full(len(scene.states), True) if everywhere else paired(scene)

    def rates(**given):
        found = asked(scene.rates, given)
        for rate, turns in zip(found, those, strict=True):
            if turns and isinstance(rate, Expression) and rate.varies:
                abs(rate)
        return found

    rates = named(rates, inspect.signature(scene.rates).parameters)
    return replace(scene, name=f"{scene.name}_turning", rates=rates)


@functools.cache
def rating(scene):
    """What runs cells of parameters, a side and states, in whose place it puts the rates; and a cell of zeros."""
    functions, m = Functions(scene, record(scene)), build(scene).M
    like = 0.0, (0.0,) * functions.size[1], 0.0, (0.0,) * functions.size[0]

    @jit_call
    def of_lanes(memory, i):
        stage, parameters, side, state = read(memory, i, like)
        signs = m.natural_signs(state, Mode(side, (), parameters, False))
        rates = m.rates(state, Mode(side, signs, parameters, False))
        write(memory, i, (where(stage > 0.5, refill.DONE, stage), parameters, side, rates))
        return True

    return running(functions, of_lanes, "rates"), like
