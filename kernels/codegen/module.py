"""A scene as a module of compiled functions, written to a file that can be read, and whose machine code is kept.

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

from kernels.codegen.power_core import CORE, core
from kernels.codegen.record import record
from kernels.lanes import cache
from kernels.lanes.jit import COMPILED, cached
from kernels.source_text.driver import BEGUN, EVENT, SETTLED, advance, shared
from kernels.source_text.error import END, LEFT, SPREAD_AT_END, STEP
from kernels.source_text.expression import DIV, FUNCTIONS, HALF_SQUARE, INPUT, MUL, NUMBER, SCALED, SceneError, needed
from kernels.source_text.hidden import BOUNDS, HIDDEN, bounds, hidden
from kernels.source_text.lane import BEGIN
from kernels.source_text.leg import BY_KINK, FACTS, LEG, LOOK, ROOT, START, leg
from kernels.source_text.rounding import BLURRED, LOST, PLACE, SIZES, blurred, lost_by_surface
from kernels.source_text.series import Lines
from kernels.source_text.sliding import ENDLESS, JUDGE, LEAVE, PRESS, PRESSED, of_sliding
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
    above, added, half_squared, hidden_by_exp, hidden_by_over, hidden_by_power, hidden_by_root, largest, most,
    multiplied, of_cos, of_exp, of_log, of_power, of_sin, of_sqrt, over, smallest, times, widened,
)
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import dot, fma, horner, not_, magnitude, any_lane, sqrt, where
from kernels.maths.pairs import two_sum
from kernels.lanes.refill import each_refilled
from kernels.codegen.module import kept
from kernels.integrate.taylor import (
    COME_UP, HALVINGS, LONGEST, ROUNDING, SAME, SLACK, STEP_LIMIT, box, clear, crossing, falls, keeps, last_term, mean,
    natural_power, next_step, of_series, of_sum, rises, size, stays_apart, tail, tail_of_sum, worse,
)
from kernels.codegen.power_core import FAR, SHORT, UNEVEN, core_time, mean_power, no_matter, size_in_unit
from kernels.source_text.driver import BLUR, EVENTS, KINK_LIMIT, time_unit
from kernels.maths.elementary import exp, log, power, sincos
from kernels.integrate.records import Leg, Start
from kernels.lanes.codes import BAD_INPUT, GRAZING, INACCURATE, OUT_OF_RANGE, REFUSED, STICKS
from kernels.lanes.codes import STEP_LIMIT as STEP_LIMIT_MET

STATES = {states}
PARAMETERS = {parameters}
KINKS = {kinks}
HIDES = {hides}
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
def series_{order}(state, side, signs, parameters, unit{also}):
    """Taylor coefficients of each state, and (offset, factor, series) of each event; time in units."""
    {unpack}
    {cores}
    {lines}
    return {result}
'''


_OF_LEG = LEG, LOOK, FACTS, START, BY_KINK, ROOT
_OF_ERROR = TANGENT, SIZES, LEFT, STEP, END, SPREAD_AT_END
_OF_SLIDING = PRESSED, JUDGE, ENDLESS, LEAVE, PRESS
_TEXTS = HEAD, FUNCTION, SERIES, HIDDEN, BOUNDS, LOST, BLURRED, PLACE, CORE, BEGIN, EVENT, BEGUN, SETTLED
_TEXTS += (*_OF_LEG, *_OF_ERROR, *_OF_SLIDING)
_TAKEN = set(re.findall(r"\w+", "".join(_TEXTS))) | {"n", "p", "s"}
_PREFIXES = (
    "at|s|end|box|size|bare|full|kink|most|half|over|and_one|half_over|"
    "off|due|reach|delta|noise|rate|made|coarse|left|more|bent|spread|sway"
)
_NUMBERED = re.compile(rf"\w*_\d+|n\d+|({_PREFIXES})_\w*")


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
        self.all_unpacked = self.unpacked("state", "signs", "parameters")

    @functools.cached_property
    def tangents(self):
        """Derivatives along changes of the states."""
        return Tangents(self.recorded.graph, self.scene.states)

    def unpacked(self, *which):
        """Statements that give what the tuples hold its names."""
        held = {
            "state": self.states,
            "signs": [*(f"sign_{j}" for j in range(self.kinks)), "way"],
            "parameters": self.parameters,
            "changes": [f"delta_{s}" for s in self.states],
        }
        return "\n".join(f"{listed(held[name])} = {name}" for name in which if held[name])

    def function(self, name, doc, expressions, arguments, single=False):
        """A function of the values of expressions."""
        lines = Lines(self.names)
        values = [_in_every_lane(lines.value(x), x) for x in expressions]
        return filled(
            FUNCTION, name=name, doc=doc, arguments=", ".join(arguments),
            unpack=self.unpacked(*(a for a in arguments if a in ("state", "signs", "parameters", "changes"))),
            lines="\n".join(lines.text), result=values[0] if single else f"({listed(values)})",
        )  # fmt: skip

    def natural_signs(self):
        """The side of each kink on which a state lies, one after the other."""
        lines = Lines(self.names)
        for j, u in enumerate(self.recorded.graph.kinks):
            lines.text.append(f"sign_{j} = where({lines.value(u)} < 0.0, -1.0, 1.0)")
        return filled(
            FUNCTION, name="natural_signs", doc="1 or -1 for each kink: the side on which the state is; 1 on it. 1.",
            arguments="state, side, parameters", unpack=self.unpacked("state", "parameters"),
            lines="\n".join(lines.text),
            result=f"({listed([*(f'sign_{j}' for j in range(self.kinks)), '0.0 * side + 1.0'])})",
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
            arguments="state, side, signs, parameters, unit", unpack=self.all_unpacked, lines="\n".join(lines.text),
            result=" | ".join(f"({text})" for text in lost) or "unit < 0.0",
        )  # fmt: skip

    def offset(self):
        """The surface's offset, as text of parameters; 0 where that would be long."""
        offset = self.recorded.offset
        return self.names[offset.args[0]] if offset.kind == INPUT else "0.0"

    def advance(self, order, tells=False):
        """The text of `advance_{order}` and `run_{order}`."""
        most = "KINK_LIMIT" if self.scene.most_kinks is None else repr(float(self.scene.most_kinks))
        also = (tells, self.scene.slides, self.feeds_back())
        return advance(self.states, self.parameters, self.kinks, order, self.offset(), most, *also)

    def summed(self):
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

    def seen(self):
        """For each event the state that it watches; None where it is more than one."""
        return [self.names[u.args[0]] if u.kind == INPUT else None for _, _, u in self.recorded.events]

    def lines_with(self, precomputed):
        """Lines of values, of which some have names already."""
        return Lines(self.names, precomputed=precomputed)

    def kinks_of_powers(self):
        """For each power its kink."""
        return [self.recorded.graph.kinks[x.args[0].args[1]] for x in self.recorded.graph.powers]

    def series(self, order, powers=0, tells=False):
        """The text of `series_{order}`, with a core for each of so many powers; if it tells, of its tangent too."""
        recorded = self.recorded
        rates = dict(zip(self.scene.states, recorded.timed, strict=True))
        rates |= {f".delta_{s}": self.tangents.of(x) for s, x in rates.items()} if tells else {}
        lines = Lines(self.names, rates, cores=powers > 0)
        states = [lines.coefficients(recorded.graph.series(s), order) for s in self.scene.states]
        events = [
            f"({lines.value(offset)}, {lines.value(factor)}, {lines.coefficients(u, order)})"
            for offset, factor, u in recorded.events
        ]
        texts = self._tangents(lines, order, powers) if tells else []
        return filled(
            SERIES, order=order, unpack=self.all_unpacked, lines="\n".join(lines.text),
            result=f"({listed([*states, *events, *(inner for _, inner in texts)])})", also=", cores" if powers else "",
            cores=listed(f"core_{i}" for i in range(powers)) + " = cores" if powers else "",
        ) + "".join(text for text, _ in texts)  # fmt: skip

    def _tangents(self, lines, order, powers):
        """Of changes, and of the spread where there is one, that is wanted roughly (`tangent.tangent`)."""
        lengths = {"tangent": short(self, order)} | ({"rough_tangent": SHORT[order]} if self.feeds_back() else {})
        return [tangent(self, lines, order, powers, name, length) for name, length in lengths.items()]

    def text(self):
        """The whole module; of a scene that slides without the Taylor method, which does not follow that."""
        scene, recorded = self.scene, self.recorded
        moving = ("state", "side", "signs", "parameters")
        of_hidden, *hides = hidden(self)
        parts = [
            filled(HEAD, name=scene.name, doc=scene.doc, states=tuple(scene.states), parameters=tuple(scene.parameters),
                   kinks=self.kinks, hides=any(map(any, hides))).lstrip(),
            self.function("rates", "Time derivative of each state.", recorded.rates, moving),
            self.function("surface", "Falls through 0 at the switch.", (recorded.surface,), moving, True),
            self.natural_signs(),
            self.function("kink_values", "What is 0 at each kink.", recorded.graph.kinks, moving),
            self.function("switched", "The state behind the switch; the side then turns.", recorded.switched, moving),
            self.function("started", "The state at the start.", recorded.started, ("side", "parameters")),
            self.underflows(),
            self.series(2),
            lost_by_surface(self),
            shared(self.states, self.parameters, self.kinks),
            of_hidden,
            bounds(self),
            blurred(self),
        ]  # fmt: skip
        if scene.slides:
            return "\n".join([*parts, of_sliding(self)])
        parts += [core(self, i) for i in range(len(recorded.graph.powers))]
        for order in ORDERS:
            parts.append(self.series(order, len(recorded.graph.powers)))
            parts.append(leg(self, order, hides))
            parts.append(self.advance(order))
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
