"""A scene as a module of compiled functions, written to a file that can be read, and whose machine code is kept.

Written are expressions alone: rates, series, tangents, events. What is done with them is generic (`kernels.integrate`).
The file lies in the folder of the kernels' own machine code (`cache`), named by the scene and a digest of its text.
"""

import builtins
import contextlib
import functools
import hashlib
import os
import re
import sys
import tempfile
import threading
from pathlib import Path
from types import ModuleType

import numpy as np
from numba.core.errors import NumbaError

from kernels.codegen.record import record
from kernels.integrate.driver import KINK_LIMIT
from kernels.integrate.records import Cell, Errors
from kernels.lanes import cache
from kernels.lanes.jit import COMPILED, cached
from kernels.source_text.expression import DIV, FUNCTIONS, HALF_SQUARE, INPUT, MUL, NUMBER, SCALED, SceneError, needed
from kernels.source_text.hidden import BOUNDS, HIDDEN, bounds, hidden
from kernels.source_text.rounding import LOST, SIZES, lost_by_surface, made
from kernels.source_text.series import Lines
from kernels.source_text.stiff import LINEAR
from kernels.source_text.tangent import SHORT, TANGENT, Tangents, short, tangent
from kernels.source_text.template import filled, listed

ORDERS = (12, 18)
_BUILDING = threading.RLock()
"""No thread may be given a module that another one is still making."""

HEAD = '''
"""{name}: {doc}

Written by kernels.scene from the functions of the scene; do not change it here.
"""

import math

from kernels.maths.intervals import (
    above, added, half_squared, hidden_by_arcsin, hidden_by_arctan, hidden_by_exp, hidden_by_hypot, hidden_by_over,
    hidden_by_power, hidden_by_root, hidden_by_sinh, hidden_by_tanh, largest, most, multiplied, of_arccos, of_arcsin,
    of_cos, of_cosh, of_exp, of_hypot, of_log, of_power, of_sin, of_sqrt, over, smallest, times, widened,
)
from kernels.codegen.module import cell_of, kept
from kernels.integrate.carried import Changes
from kernels.integrate.driver import Slides, advance
from kernels.integrate.powers import Power, core
from kernels.integrate.records import Pieces, Written
from kernels.integrate.taylor import BY_SERIES, BY_SUM
from kernels.integrate.taylor_leg import Series, to_event
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.refill import each_refilled
from kernels.lanes.vectors import dot, fma, horner, not_, magnitude, any_lane, sqrt, where
from kernels.maths.elementary import (
    arccos, arcsin, arctan, cosh, exp_or_nan as exp, floor, floor_between, hypot, log, power, sincos, sinh, tanh,
)
from kernels.maths.pairs import two_sum

STATES = {states}
PARAMETERS = {parameters}
'''

FUNCTION = '''
@jit
def {name}({arguments}):
    """{doc}"""
    {unpack}
    {lines}
    return {result}
'''

SERIES = '''
@jit
def {name}(state, mode, unit, cores):
    """Taylor coefficients of states and events; time in units."""
    {unpack}
    {cores}
    {lines}
    return Pieces(({states}), ({events}), ({controlled}), ({of_states}), ({of_events}), {inner}, {rough})
'''

SCENE = """
M = Written(
    rates, surface, kinks, switched, started, natural_signs, underflows, jet, lost, hidden, bounds, made,
    {numbers}, {alternating}, {most_kinks}, cell_of({cell}), {slides}, {hiding}, {passable}, {deciding}, None, None,
)
"""

POWER = '''
@jit
def with_power_{i}(state, mode, unit, power_{i}):
    """The rates per unit of time, with a value of power {i}."""
    {unpack}
    {lines}
    return {rates}


@jit
def of_base_{i}(xs):
    """The entry of the state whose power it is."""
    return xs[{base}]


@jit
def of_kink_{i}(xs):
    """The entry of its kink, of a tuple of events'."""
    return xs[{kink}]


@jit
def without_{i}(state, mode):
    """The state on its kink."""
    {unpack}
    return ({without})


POWER_{i} = Power(with_power_{i}, base_{i}, exponent_{i}, of_base_{i}, of_kink_{i}, without_{i})
'''

POWERS = '''
@jit
def cores(state, mode, unit, tolerance, on, t, margins):
    """The cores of powers, and the steps that end with them."""
    {found}
    return ({values}), ({limits}), ({coarse}), {full}


@jit
def on_kink(state, fires):
    """The state, 0 where a kink of a power fires."""
    {states} = state
    {lines}
    return ({states})


@jit
def at_kink(xs):
    """The entry of the kink whose u is the rate of the surface."""
    return xs[{nested}]
'''

CHANGES = """
CHANGES_{order} = Changes(
    rate_changes, event_changes, jump_changes, made_of_rates, made_of_events, inner_{order}, rough_{order},
    {fed_back},
)
"""

LEG = '''
SERIES_{order} = Series(
    {m}, {order}, series_{order}, cores, on_kink, ({ways}), ({watched}), {summed}, {unseen}, {error}
)


@jit_call
def leg_{order}(state, mode, unit, h, on, tolerance, active, errors):
    """The motion to its next event, by series of order {order}."""
    return to_event(SERIES_{order}, state, mode, unit, h, on, tolerance, active, errors, {hides}, {at_kink})
'''

SPEEDS = """
@jit
def speeds(state, mode):
    \"\"\"Of each kink's u, ahead and behind.\"\"\"
    x = flat_speeds(state, mode)
    return ({pairs})
"""

DRIVEN = '''
@jit_call
def advance_{leg}(memory, i):
    """Every lane on, until one has finished."""
    return advance({m}, leg_{leg}, memory, i, {tells}, {slides}, {surfaces})


@kept
def run_{leg}(cells, memory, held, together):
    """Each cell, a row of what a lane knows, until its last switch."""
    each_refilled(advance_{leg}, cells, memory, held, together)
'''

_TEXTS = HEAD, FUNCTION, SERIES, SCENE, POWER, POWERS, LEG, DRIVEN, HIDDEN, BOUNDS, LOST, SIZES, TANGENT, LINEAR
_TAKEN = set(re.findall(r"\w+", "".join(_TEXTS))) | {"n", "p", "s"}
_PREFIXES = "s|d|box|most|half|over|and_one|half_over|delta|made"
_NUMBERED = re.compile(rf"\w*_\d+|n\d+|({_PREFIXES})_\w*")


def cell_of(states, parameters, kinks, tells=False):
    """A cell of zeros, as large as a scene's."""
    u = (0.0,) * states
    errors = Errors(0.0, 0.0, 0.0, 0.0, u, 0.0, 0.0, u, 0.0, 0.0, 0.0, u) if tells else ()
    marks = (0.0,) * (kinks + 1)
    wanted, so_far = (0.0, (0.0,) * parameters, 0.0, 0.0, 0.0), (0.0, 0.0, u, u, 0.0)
    return Cell(*wanted, *so_far, u, 0.0, marks, 0.0, 0.0, marks, 0.0, 0.0, 0.0, 0.0, 0.0, errors)


def _apart(name):
    """A name of a scene's as it is written: apart from those of the text itself."""
    return f"{name}_" if name in _TAKEN or _NUMBERED.fullmatch(name) or hasattr(builtins, name) else name


def _in_every_lane(value, expression):
    """The value as text; a plain number is repeated in every lane, or a tuple of both could not be looped over."""
    return value if any(node.kind == INPUT for node in needed(expression)) else f"0.0 * side + {value}"


class Writer:
    """Writes the functions of a recorded scene."""

    def __init__(self, scene, recorded):
        self.scene, self.recorded = scene, recorded
        self.kinks = len(recorded.graph.kinks)
        self.states, self.parameters = ([_apart(n) for n in names] for names in (scene.states, scene.parameters))
        self.names = dict(zip((*scene.states, *scene.parameters), (*self.states, *self.parameters), strict=True))
        self.names |= {"side": "side", ".unit": "unit", ".way": "way"}
        self.names |= {f".sign_{j}": f"sign_{j}" for j in range(self.kinks)}
        self.names |= {f".delta_{s}": f"delta_{name}" for s, name in zip(scene.states, self.states, strict=True)}
        self.signs = listed([*(f"sign_{j}" for j in range(self.kinks)), "way"])
        self.all_unpacked = self.unpacked("state", "mode")

    @functools.cached_property
    def tangents(self):
        """Derivatives along changes of the states."""
        return Tangents(self.recorded.graph, self.scene.states)

    def unpacked(self, *arguments):
        """Statements that give what these arguments hold its names."""
        parameters = [f"{listed(self.parameters)} = parameters"] if self.parameters else []
        held = {
            "state": [f"{listed(self.states)} = state"],
            "mode": ["side, signs, parameters, _ = mode", f"{self.signs} = signs", *parameters],
            "parameters": parameters,
            "changes": [f"{listed(f'delta_{s}' for s in self.states)} = changes"],
        }
        return "\n".join(line for name in arguments for line in held.get(name, []))

    def function(self, name, doc, expressions, arguments=("state", "mode"), single=False):
        """A function of the values of expressions."""
        lines = Lines(self.names)
        values = [_in_every_lane(lines.value(x), x) for x in expressions]
        return filled(
            FUNCTION, name=name, doc=doc, arguments=", ".join(arguments), unpack=self.unpacked(*arguments),
            lines="\n".join(lines.text), result=values[0] if single else f"({listed(values)})",
        )  # fmt: skip

    def natural_signs(self):
        """The side of each kink on which a state lies, one after the other, and the way over the surface."""
        lines = Lines(self.names)
        for j, u in enumerate(self.recorded.graph.kinks):
            lines.text.append(f"sign_{j} = where({lines.value(u)} < 0.0, -1.0, 1.0)")
        unpack = ["side, _, parameters, _ = mode", self.unpacked("state", "parameters"), "way = 0.0 * side + 1.0"]
        return filled(
            FUNCTION, name="natural_signs", doc="1 or -1 for each kink: the side on which the state is; 1 on it. 1.",
            arguments="state, mode", unpack="\n".join(unpack), lines="\n".join(lines.text), result=f"({self.signs})",
        )  # fmt: skip

    def underflows(self):
        """Whether a product of numbers that are not 0 underflows."""
        lines, lost = Lines(self.names), []

        def watch(product, *factors):
            lost.append(" & ".join([f"(magnitude({product}) < 1e-290)", *(f"(magnitude({a}) > 0.0)" for a in factors)]))

        for node in needed(*self.recorded.timed, self.recorded.surface):
            if node.kind in (MUL, HALF_SQUARE, SCALED, DIV) and all(a.kind != NUMBER for a in node.args):
                watch(lines.value(node), *(lines.value(x) for x in node.args))
        return filled(
            FUNCTION, name="underflows", doc="Whether a product of numbers other than 0 loses its digits.",
            arguments="state, mode, unit", unpack=self.all_unpacked, lines="\n".join(lines.text),
            result=" | ".join(f"({text})" for text in lost) or "unit < 0.0",
        )  # fmt: skip

    def _summed(self):
        """The states whose rate is another state, and which."""
        rates = zip(self.states, self.recorded.rates, strict=True)
        return {s: self.names[r.args[0]] for s, r in rates if r.kind == INPUT and r.varies}

    def feeds_back(self):
        """Whether the rate of a state hangs on another one whose own rate, or that of a further one, hangs on it."""
        rates = dict(zip(self.scene.states, self.recorded.rates, strict=True))
        hangs = {s: {x.args[0] for x in needed(r) if x.kind == INPUT and x.args[0] in rates} for s, r in rates.items()}
        for _ in hangs:
            hangs = {s: on.union(*(hangs[other] for other in on)) for s, on in hangs.items()}
        return any(other != s and s in hangs[other] for s, on in hangs.items() for other in on)

    def _seen(self):
        """For each event the state that it watches; None where it is more than one."""
        return [self.names[u.args[0]] if u.kind == INPUT else None for _, _, u in self.recorded.events]

    def curve(self, s, prefix="s", start="{}"):
        """What a state, or a change of it, is evaluated from, as text (`taylor.Way`)."""
        w = self._summed().get(s)
        return f"({start.format(s)}, unit, {prefix}_{w})" if w else f"({prefix}_{s},)"

    def series(self, order, powers=0, tells=False):
        """The text of `series_{order}`, with a core for each of so many powers; if it tells, of its tangents too."""
        recorded = self.recorded
        rates = dict(zip(self.scene.states, recorded.timed, strict=True))
        rates |= {f".delta_{s}": self.tangents.of(x) for s, x in rates.items()} if tells else {}
        lines = Lines(self.names, rates, cores=powers > 0)
        named = [
            f"s_{name} = {lines.coefficients(recorded.graph.series(s), order)}"
            for name, s in zip(self.states, self.scene.states, strict=True)
        ]
        events = []
        for j, (offset, factor, u) in enumerate(recorded.events):
            named.append(f"event_{j} = {lines.coefficients(u, order)}")
            events.append(f"({lines.value(offset)}, {lines.value(factor)}, event_{j})")
        texts = self._tangents(lines, order, powers) if tells else []
        given = dict.fromkeys(("inner", "rough"), "()") | {part: inner for part, _, inner in texts}
        seen = self._seen()
        controlled = [f"s_{s}" for s in self.states] + [f"event_{j}" for j, s in enumerate(seen) if not s]
        return filled(
            SERIES, name="jet" if order == 2 else f"series_{order}", unpack=self.all_unpacked,
            lines="\n".join([*lines.text, *named]), states=listed(f"s_{s}" for s in self.states), events=listed(events),
            controlled=listed(controlled), of_states=listed(map(self.curve, self.states)),
            of_events=listed(self.curve(s) if s else f"(event_{j},)" for j, s in enumerate(seen)),
            cores=listed(f"core_{i}" for i in range(powers)) + " = cores" if powers else "", **given,
        ) + "".join(text for _, text, _ in texts)  # fmt: skip

    def _tangents(self, lines, order, powers):
        """Of changes, and of the spread, that is wanted roughly (`tangent.tangent`)."""
        lengths = {"inner": short(self, order), "rough": SHORT[order]}
        return [(part, *tangent(self, lines, order, powers, part, length)) for part, length in lengths.items()]

    def _power(self, i):
        """The text of power i."""
        node = list(self.recorded.graph.powers)[i]
        base, exponent = node.args
        kink, u = self.recorded.graph.kinks[base.args[1]], self.names[base.args[1].args[0]]
        lines = Lines(self.names, precomputed={node: f"power_{i}"})
        rates = [lines.value(rate) for rate in self.recorded.timed]
        parts = [
            self.function(f"base_{i}", "The base of a power.", [base], single=True),
            self.function(f"exponent_{i}", "Its exponent.", [exponent], single=True),
            filled(
                POWER, i=i, unpack=self.all_unpacked, lines="\n".join(lines.text), rates=f"({listed(rates)})",
                base=self.states.index(u), kink=1 + kink,
                without=listed("0.0 * side" if s == u else s for s in self.states),
            ),
        ]  # fmt: skip
        return "\n".join(parts)

    def powers(self):
        """The text of the scene's powers; of their kinks, each with its state."""
        powers, kinks = self.recorded.graph.powers, self.recorded.graph.kinks
        bases = {1 + kinks[x.args[0].args[1]]: self.names[x.args[0].args[1].args[0]] for x in powers}
        i = range(len(powers))
        return "\n".join(map(self._power, i)) + filled(
            POWERS,
            found="\n".join(f"found_{j} = core(POWER_{j}, state, mode, unit, tolerance, on, t, margins)" for j in i),
            values=listed(f"found_{j}[0]" for j in i), limits=listed(f"found_{j}[1]" for j in i),
            coarse=listed(f"found_{j}[2]" for j in i), full=f"found_{i[-1]}[3]" if powers else "None",
            states=listed(self.states), nested=self.recorded.nested,
            lines="\n".join(f"{u} = where(fires[{j}], 0.0 * {u}, {u})" for j, u in sorted(bases.items())),
        )  # fmt: skip

    def by_series(self, order, tells=False):
        """The text of the leg of that order, and of what drives it."""
        summed, seen, told = self._summed(), self._seen(), f"CHANGES_{order}" if tells else "None"
        way = {s: "BY_SUM" if s in summed else "BY_SERIES" for s in self.states} | {None: "BY_SERIES"}
        m, ways = "M_TOLD" if tells else "M", listed(way[s] for s in self.states)
        changes = filled(CHANGES, order=order, fed_back=self.feeds_back() or None) if tells else ""
        return self.series(order, len(self.recorded.graph.powers), tells) + changes + filled(
            LEG, m=m, order=order, ways=ways, watched=listed(way[s] for s in seen),
            summed=tuple(float(s in summed) for s in self.states), unseen=tuple(float(s is None) for s in seen),
            error=told, hides=self.hides() or None,
            at_kink="at_kink" if self.recorded.nested else None,
        ) + self.driven(order, m, told)  # fmt: skip

    def driven(self, leg, m="M", tells="None"):
        """The text of `run_{leg}`."""
        further = self.recorded.surfaces
        return filled(
            DRIVEN, leg=leg, m=m, tells=tells, slides="M.slides" if self.scene.slides else "None",
            surfaces=tuple(float(j in further) for j in range(self.kinks)) if further else None,
        )  # fmt: skip

    def _deciding(self):
        """1 for each kink, but for further surfaces and the surface's own u, on whose side a switch's result hangs."""
        signs = {x.args[0] for x in needed(*self.recorded.switched) if x.kind == INPUT}
        of_surface = self.recorded.events[0][2]
        found = tuple(
            float(f".sign_{j}" in signs and j not in self.recorded.surfaces and u is not of_surface)
            for j, u in enumerate(self.recorded.graph.kinks)
        )
        return found if any(found) else None

    def _lost(self):
        if self.scene.exact_start:
            return self.function("lost", "Nothing.", (self.recorded.graph.of(0.0),), single=True)
        return lost_by_surface(self)

    @functools.cached_property
    def _hidden(self):
        return hidden(self)

    def hides(self):
        """Whether a rate or an event can hide anything."""
        return any(map(any, self._hidden[1:]))

    def text(self):
        """The whole module; of a scene that slides without the Taylor method, which does not follow that."""
        scene, recorded = self.scene, self.recorded
        of_hidden, *hides = self._hidden
        parts = [
            filled(HEAD, name=scene.name, doc=scene.doc, states=tuple(scene.states),
                   parameters=tuple(scene.parameters)).lstrip(),
            self.function("rates", "Time derivative of each state.", recorded.rates),
            self.function("surface", "Falls through 0 at the switch.", (recorded.surface,), single=True),
            self.function("kinks", "What is 0 at each kink.", recorded.graph.kinks),
            self.function("switched", "The state behind the switch; the side then turns.", recorded.switched),
            self.function("started", "The state at the start.", recorded.started, ("parameters", "side")),
            self.natural_signs(), self.underflows(), self.series(2), self._lost(), of_hidden, bounds(self),
            made(self),
        ]  # fmt: skip
        if scene.slides:
            pairs = [x for pair in recorded.speeds for x in pair]
            parts.append(self.function("flat_speeds", "Of each kink's u, ahead and behind.", pairs))
            parts.append(self.function("onto", "The state on the kink that it slides along.", recorded.onto))
            parts.append(SPEEDS.format(pairs=listed(f"(x[{2 * j}], x[{2 * j + 1}])" for j in range(self.kinks))))
        parts.append(
            filled(
                SCENE,
                numbers=tuple(map(float, range(1 + self.kinks))),
                hiding=tuple(tuple(map(float, h)) for h in hides),
                passable=tuple(
                    float(not any(x.kind == INPUT and x.args[0] == "side" for x in needed(event)))
                    for event in (recorded.surface, *recorded.graph.kinks)
                ),
                deciding=self._deciding(),
                alternating=tuple((-1.0) ** j for j in range(len(self.states))),
                most_kinks=KINK_LIMIT if scene.most_kinks is None else float(scene.most_kinks),
                cell=f"{len(self.states)}, {len(self.parameters)}, {self.kinks}",
                slides="Slides(speeds, onto)" if scene.slides else None,
            )
        )
        if not scene.slides:
            parts += [self.powers(), *map(self.by_series, ORDERS)]
        return "\n".join(parts)


def kept(function):
    """A function called from Python, whose machine code is kept: its file is named by all it was made from."""
    return cached(function) if COMPILED else _quiet(function)


@contextlib.contextmanager
def compiling(scene, method):
    """Where numba fails inside, a SceneError of two lines in place of its hundred."""
    try:
        yield
    except NumbaError as error:
        why = next((line.strip() for line in str(error).splitlines() if line.strip() and "Failed in" not in line), "")
        raise SceneError(
            f"the scene {scene} cannot be compiled for the method {method}: {why[:200]}\n"
            f"Take another method, or say the scene in simpler terms: {FUNCTIONS}"
        ) from None


def _quiet(function):
    """Plain Python without numpy's warnings: 1/0 is inf here as in compiled code."""

    @functools.wraps(function)
    def call(*arguments):
        with np.errstate(all="ignore"):
            return function(*arguments)

    return call


@functools.cache
def build(scene):
    """The module of the scene, which is recorded and written once."""
    text = Writer(scene, record(scene)).text()
    return loaded("scene", scene, text)


def loaded(kind, scene, text):
    """The module of a text that is written for a scene."""
    name = f"{kind}_{scene.name}_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    with _BUILDING:
        if name not in sys.modules:
            module = ModuleType(name)
            module.__file__ = str(_written(name, text))
            sys.modules[name] = module
            try:
                # not what the file says, nor Python's compiled copy of it: others may have been there
                exec(compile(text, module.__file__, "exec"), module.__dict__)
            except BaseException:
                del sys.modules[name]
                raise
        return sys.modules[name]


def _written(name, text):
    """The file of that text: among the kernels' machine code, or where that cannot be, a temporary one."""
    folder = cache.FOLDER or Path(tempfile.mkdtemp(prefix="foliot_scene_"))
    path = folder / f"{name}.py"
    if not path.is_file() or path.read_text() != text:
        handle, draft = tempfile.mkstemp(dir=folder, suffix=".draft")
        with os.fdopen(handle, "w") as file:
            file.write(text)
        Path(draft).replace(path)
    return path
