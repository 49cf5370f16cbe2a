"""The written modules of a scene's Runge-Kutta methods, at a fixed step and to a tolerance.

They have what does not fit in one function for all scenes, and lie beside the scene's own module (`module`), whose
functions they take. To a tolerance a cell is followed twice, as by the Taylor method.
"""

import functools
from types import SimpleNamespace

from kernels.codegen import followed_twice
from kernels.codegen.module import Writer, build, loaded
from kernels.codegen.record import record
from kernels.integrate.events import METHODS
from kernels.source_text.driver import signs_of
from kernels.source_text.expression import INPUT
from kernels.source_text.lane import BEGIN, begun_rows, loaded_rows, stored_rows
from kernels.source_text.stiff import linear
from kernels.source_text.template import filled, listed

BLUR = 1e-14
"""Of the surface's value at the start, what rounding may take from it unremarked."""

NAMES = "dopri5", "dop853", "rodas5p"
PAIRS = "DOPRI5", "DOP853", "RODAS5P_PAIR"

FINEST = 1e-13
"""The tightest tolerance that is tried where a wider one fails: below it rounding stops the steps."""

TEXT = '''
"""Fixed-step methods of {name}: written by kernels; do not change it here."""

import math
import sys
from collections import namedtuple

from kernels.integrate.fixed_step import follow
from kernels.integrate.records import Limits, Motion, Scheme, Tally
from kernels.lanes.codes import BAD_INPUT, INACCURATE, REFUSED
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, not_, magnitude, any_lane, where
from kernels.lanes.refill import each_refilled
from kernels.codegen.module import kept

scene = sys.modules["{module}"]
STATES, series_2, rates, begun, hidden = scene.STATES, scene.series_2, scene.rates, scene.begun, scene.hidden


@jit
def events(state, side, signs, parameters):
    """Value and rate of each event: of the switch, then of the kinks."""
    {unpack} = series_2(state, side, signs, parameters, 0.0 * side + 1.0)
    return ({values}), ({slopes})


@jit
def swapped_rates(wide, side, signs, parameters):
    """Rates of the states and of time per unit of an event's value; the last entry says of which event."""
    {states}, time, which = wide
    {rates} = rates(({states},), side, signs, parameters)
    slopes = events(({states},), side, signs, parameters)[1]
    slope = slopes[0]
    {choose_slope}
    return {over}, 1.0 / slope, 0.0 * slope


@jit
def natural_signs_of(wide, side, parameters):
    """As the scene's, of the states among them."""
    {states}, time, which = wide
    return scene_signs(({states},), side, parameters)


scene_signs = scene.natural_signs
Swap = namedtuple("Swap", "rates natural_signs")
Moves = namedtuple(
    "Moves", "rates natural_signs events switched settled underflows hidden bounds hides swap ahead behind"
)
M = Moves(
    rates, scene.natural_signs, events, scene.switched, scene.settled, scene.underflows, hidden, scene.bounds,
    scene.HIDES,
    Swap(swapped_rates, natural_signs_of),
    (1.0,) * ({kinks} + 1), (*(-1.0,) * {kinks}, 1.0),
)


@jit
def advance(memory, i):
    """Every lane on by some steps; whether one has finished."""
    {load}
    parameters = ({parameters})
    {begin}
    scheme = Scheme(int(memory[{method}][0]), int(memory[{location}][0]), int(memory[{substeps}][0]))
    motion = Motion(({states},), side, ({signs}), ({ons}), cut, cuts)
    tally = Tally(
        time, since, interval, count, steps, calls, trials, ({reach}), ({at}), ({before}), wide, slim
    )
    moving = active & (verdict < REFUSED)
    limits = Limits(flips, step, graze)
    motion, tally, verdict, ended = follow(M, scheme, parameters, limits, motion, tally, verdict, moving)
    ({states},), side, ({signs}), ({ons}), cut, cuts = motion
    time, since, interval, count, steps, calls, trials, ({reach}), ({at}), ({before}), wide, slim = tally
    done = active & (ended | (verdict >= REFUSED))
    stage = where(done, 3.0, where(active, 2.0, stage))
    {store}
    return any_lane(done)


@kept
def run(cells, together):
    """Each cell, a row of what ROWS names, until its last switch."""
    each_refilled(advance, cells, together)


ROWS = {rows}
'''


def _is_speed(recorded, scene, place, expression):
    return expression.kind == INPUT and expression.args[0] == scene.states[place + 1]


def methods_of(scene):
    """The names of the methods that can do the scene: pairs (x, v) with x' = v; for Moreau's one, kinks at v = 0."""
    recorded = record(scene)
    n = len(scene.states)
    paired = n % 2 == 0 and all(_is_speed(recorded, scene, j, recorded.rates[j]) for j in range(0, n, 2))
    dry = paired and n == 2 and all(_is_speed(recorded, scene, 0, u) for u in recorded.graph.kinks)
    lacks = {"semi_implicit": paired, "verlet": paired, "moreau": dry}
    return tuple(name for name in METHODS if lacks.get(name, True))


def _prefixed(prefix, names):
    return [f"{prefix}_{name}" for name in names]


def _text(scene, module):
    kinks = module.KINKS
    states, parameters = _prefixed("q", scene.states), _prefixed("q", scene.parameters)
    signs, ons = signs_of(kinks), _prefixed("on", range(1 + kinks))
    reach, at, before = (_prefixed(kind, states) for kind in ("reach", "at", "before"))
    scheme = ["method", "location", "substeps"]
    inputs = [*parameters, "flips", "step", "graze", *scheme]
    results = ["time", "interval", *at, *before, "slim", "steps", "calls", "verdict"]
    between = [*states, "side", *signs, *ons, "cut", "cuts", "since", "count", "trials", "wide", *reach]
    rows = ["stage", *inputs, *results, *between]
    zeros = ("time", "interval", "steps", "calls", "cut", "cuts", "since", "count", "trials", "wide", *at, *before)
    values = [("side", "start.side"), ("slim", "math.inf"), *((name, "0.0") for name in zeros)]
    values += [(r, f"magnitude({s})") for r, s in zip(reach, states, strict=True)]
    begin = filled(BEGIN, begin=begun_rows(states, signs, ons, values), blur=repr(BLUR))
    return filled(
        TEXT, name=scene.name, module=module.__name__, kinks=kinks, signs=listed(signs), states=", ".join(states),
        ons=listed(ons), reach=listed(reach), at=listed(at), before=listed(before), parameters=listed(parameters),
        load=loaded_rows(rows, [name for name in rows if name not in scheme]), begin=begin.rstrip(),
        **{name: rows.index(name) for name in scheme}, rows=tuple(rows),
        store=stored_rows(rows, ["stage", *results, *between]), **_events_of(states, kinks),
    )  # fmt: skip


def _events_of(states, kinks):
    """What the texts of `events` and of `swapped_rates` are made of."""
    events = range(1 + kinks)
    series = [f"s_{s}" for s in states] + [f"(offset_{j}, factor_{j}, event_{j})" for j in events]
    choices = [f"slope = where((which > {j}.0 - 0.5) & (which < {j}.0 + 0.5), slopes[{j}], slope)" for j in events[1:]]
    return {
        "unpack": ", ".join(series),
        "values": listed(f"fma(factor_{j}, event_{j}[0], offset_{j})" for j in events),
        "slopes": listed(f"factor_{j} * event_{j}[1]" for j in events),
        "rates": listed(f"d_{s}" for s in states),
        "over": ", ".join(f"d_{s} / slope" for s in states),
        "choose_slope": "\n".join(choices),
    }


LEGS = '''
"""Legs of {name} to a tolerance: written by kernels; do not change it here."""

from {module} import *
from collections import namedtuple

from {steps} import M
from kernels.integrate.adaptive import to_event
from kernels.integrate.pairs import DOP853, DOPRI5, Trial
from kernels.integrate.records import Mode
from kernels.integrate.rosenbrock import RODAS5P_PAIR, followable
{linear}

Stiff = namedtuple("Stiff", (*M._fields, "factored", "solved"))
M_STIFF = Stiff(*M, factored, solved)
{kept}


@jit_call
def to_event_dopri5(state, side, signs, parameters, unit, h, on, tolerance, active):
    """The leg of Dormand-Prince 5(4)."""
    return to_event(M, DOPRI5, state, Mode(side, signs, parameters, False), unit, h, on, tolerance, active)


@jit_call
def to_event_dop853(state, side, signs, parameters, unit, h, on, tolerance, active):
    """The leg of DOP853."""
    return to_event(M, DOP853, state, Mode(side, signs, parameters, False), unit, h, on, tolerance, active)


@jit_call
def to_event_rodas5p(state, side, signs, parameters, unit, h, on, tolerance, active):
    """The leg of Rodas5P."""
    mode = Mode(side, signs, parameters, False)
    h = followable(M_STIFF, state, mode, unit, h)
    return to_event(M_STIFF, RODAS5P_PAIR, state, mode, unit, h, on, tolerance, active)
'''


KEPT = '''
free_{pair}, free_dense_{pair} = {pair}.tried, {pair}.dense


@jit_call
def tried_{pair}(m, state, mode, h):
    """A step whose end is put back onto the kink that it slides along."""
    trial = free_{pair}(m, state, mode, h)
    new = onto(trial.new, mode.side, mode.signs, mode.parameters)
    return Trial(new, trial.stages, trial.last, trial.error)


@jit_call
def dense_{pair}(m, state, terms, mode, h, part):
    """The dense output, put back likewise."""
    found = free_dense_{pair}(m, state, terms, mode, h, part)
    return onto(found, mode.side, mode.signs, mode.parameters)


{pair} = {pair}._replace(tried=tried_{pair}, dense=dense_{pair})
'''


def twice_by(method, scene):
    """The function of columns (`followed_twice.twice`) that follows the scene by a method of `NAMES`."""

    def twice(module, columns, rtol, outputs, status):
        run = getattr(adaptive(scene), f"run_{method}")
        runs = SimpleNamespace(STATES=module.STATES, ROWS=module.ROWS, run_12=run, run_18=run)
        followed_twice.twice(runs, columns, rtol, outputs, status, FINEST)

    return twice


@functools.cache
def adaptive(scene):
    """The module of the scene's legs to a tolerance, written once, with a `run_{method}` for each method of `NAMES`."""
    module, steps, writer = build(scene), stepped(scene), Writer(scene, record(scene))
    names = {"name": scene.name, "module": module.__name__, "steps": steps.__name__}
    kept = [KEPT.format(pair=pair) for pair in PAIRS] if scene.slides else []
    text = filled(LEGS, **names, kept="".join(kept), linear=linear(writer)).lstrip()
    for method in NAMES:
        text += writer.advance(method)
    return loaded("legs", scene, text)


@functools.cache
def stepped(scene):
    """The module of the scene's fixed-step methods, written once, with `run` and `STATES`."""
    text = _text(scene, build(scene)).lstrip()
    return loaded("steps", scene, text)
