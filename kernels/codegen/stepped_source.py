"""The written module of a scene's fixed-step methods: what does not fit in one function for all scenes.

It lies beside the scene's own module (`module`), whose functions it takes.
"""

from kernels.codegen.driver_source import advance
from kernels.codegen.expression import INPUT
from kernels.codegen.module import Writer, build, loaded
from kernels.codegen.record import record
from kernels.codegen.template import filled, listed
from kernels.integrate.events import METHODS

BLUR = 1e-14
"""Of the surface's value at the start, what rounding may take from it unremarked."""

TEXT = '''
"""Fixed-step methods of {name}: written by kernels; do not change it here."""

import math
import sys
from collections import namedtuple

from kernels.integrate.fixed_step import follow
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, isnt, magnitude, some, where
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
Moves = namedtuple("Moves", "rates natural_signs events switched settled underflows hidden hides swap ahead behind")
M = Moves(
    rates, scene.natural_signs, events, scene.switched, scene.settled, scene.underflows, hidden, scene.HIDES,
    Swap(swapped_rates, natural_signs_of),
    (1.0,) * {kinks}, (-1.0,) * {kinks},
)


@jit
def advance(memory, i):
    """Every lane on by some steps; whether one has finished."""
    {load}
    parameters = ({parameters})
    fresh = (stage > 0.5) & (stage < 1.5)
    active = fresh | ((stage > 1.5) & (stage < 2.5))
    if some(fresh):
        s, p, g, u, o, beyond, blur = begun(flips, parameters)
        {begin}
        endless = isnt((flips >= 1.0) & (flips < math.inf))
        unsure = where(blur <= {blur}, 0.0, {inaccurate})
        verdict = where(fresh, where(beyond | endless, {bad_input}, unsure), verdict)
    how = int(memory[{method}][0]), int(memory[{method} + 1][0]), int(memory[{method} + 2][0])
    motion = ({states},), side, ({signs}), ({ons}), cut, cuts
    tally = time, since, interval, count, steps, calls, trials, ({reach}), ({at}), ({before}), wide, slim, verdict
    moving = active & (verdict < 64.0)
    motion, tally, ended = follow(M, how, parameters, (flips, step, graze), motion, tally, moving)
    ({states},), side, ({signs}), ({ons}), cut, cuts = motion
    time, since, interval, count, steps, calls, trials, ({reach}), ({at}), ({before}), wide, slim, verdict = tally
    done = active & (ended | (verdict >= 64.0))
    stage = where(done, 3.0, where(active, 2.0, stage))
    {store}
    return some(done)


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


def _text(scene, module):
    kinks = module.KINKS
    states, parameters = ([f"q_{name}" for name in names] for names in (scene.states, scene.parameters))
    signs = [f"sign_{j}" for j in range(kinks)]
    ons = [f"on_{j}" for j in range(1 + kinks)]
    reach, at, before = ([f"{kind}_{s}" for s in states] for kind in ("reach", "at", "before"))
    inputs = [*parameters, "flips", "step", "graze", "method", "location", "parts"]
    results = ["time", "interval", *at, *before, "slim", "steps", "calls", "verdict"]
    work = [*states, "side", *signs, *ons, "cut", "cuts", "since", "count", "trials", "wide", *reach]
    rows = ["stage", *inputs, *results, *work]
    begin = [f"{s} = where(fresh, s[{j}], {s})" for j, s in enumerate(states)]
    begin += [f"{s} = where(fresh, g[{j}], {s})" for j, s in enumerate(signs)]
    begin += [f"{o} = where(fresh, o[{j}], {o})" for j, o in enumerate(ons)]
    begin += ["side = where(fresh, p, side)"]
    begin += [f"{r} = where(fresh, magnitude({s}), {r})" for r, s in zip(reach, states, strict=True)]
    zeros = ("time", "interval", "steps", "calls", "cut", "cuts", "since", "count", "trials", "wide", *at, *before)
    begin += [f"{r} = where(fresh, 0.0, {r})" for r in zeros] + ["slim = where(fresh, math.inf, slim)"]
    changed = ["stage", *results, *work]
    events = range(1 + kinks)
    return filled(
        TEXT, name=scene.name, module=module.__name__, kinks=kinks, signs=listed(signs),
        states=", ".join(states),
        ons=listed(ons), reach=listed(reach), at=listed(at), before=listed(before), parameters=listed(parameters),
        unpack=", ".join([f"s_{s}" for s in states] + [f"(offset_{j}, factor_{j}, event_{j})" for j in events]),
        values=listed(f"fma(factor_{j}, event_{j}[0], offset_{j})" for j in events),
        slopes=listed(f"factor_{j} * event_{j}[1]" for j in events),
        rates=listed(f"d_{s}" for s in states), over=", ".join(f"d_{s} / slope" for s in states),
        choose_slope="\n".join(
            f"slope = where((which > {j}.0 - 0.5) & (which < {j}.0 + 0.5), slopes[{j}], slope)" for j in events[1:]
        ),
        load="\n".join(f"{r} = memory[{j}][i]" for j, r in enumerate(rows) if r not in ("method", "location", "parts")),
        begin="\n".join(begin), bad_input=64.0, inaccurate=1.0, blur=BLUR,
        method=rows.index("method"), rows=tuple(rows),
        store="\n".join(f"memory[{rows.index(r)}][i] = {r}" for r in changed),
    )  # fmt: skip


LEGS = '''
"""Legs of {name} to a tolerance: written by kernels; do not change it here."""

from kernels.integrate import adaptive as _adaptive_step
from {module} import *
from {steps} import M


@jit_call
def to_event_dopri5(state, side, signs, parameters, unit, h, on, tolerance, active):
    """The leg of Dormand-Prince 5(4)."""
    return _adaptive_step.to_event(
        M, _adaptive_step.dopri5_tried, _adaptive_step.dopri5_series, _adaptive_step.dopri5_dense,
        _adaptive_step.dopri5_vague, 5.0, state, side, signs, parameters, unit, h, on, tolerance, active,
    )


@jit_call
def to_event_dop853(state, side, signs, parameters, unit, h, on, tolerance, active):
    """The leg of DOP853."""
    return _adaptive_step.to_event(
        M, _adaptive_step.dop853_tried, _adaptive_step.dop853_series, _adaptive_step.dop853_dense,
        _adaptive_step.dop853_vague, 8.0, state, side, signs, parameters, unit, h, on, tolerance, active,
    )
'''


def adaptive(scene):
    """The module of the scene's legs to a tolerance, with `run_dopri5` and `run_dop853`."""
    module, steps = build(scene), stepped(scene)
    text = filled(LEGS, name=scene.name, module=module.__name__, steps=steps.__name__).lstrip()
    writer = Writer(scene, record(scene))
    for method in ("dopri5", "dop853"):
        text += advance(writer.states, writer.parameters, module.KINKS, method, writer.offset())
    return loaded("legs", scene, text)


def stepped(scene):
    """The module of the scene's fixed-step methods, with `run` and `STATES`."""
    text = _text(scene, build(scene)).lstrip()
    return loaded("steps", scene, text)
