"""Functions made of a recorded scene: plain Python over its expressions, run at compile time (`lanes.symbols`).

They are the part that is specific to a scene: rates, series, tangents, events; the integrators are generic
(`kernels.integrate`). In plain Python they are ordinary functions.
"""

import functools
import hashlib
import inspect
import itertools

from kernels.expression import stiff
from kernels.expression.graph import ADD, CHOSEN, DIV, HALF_SQUARE, INPUT, MUL, NUMBER, SCALED, Expression, needed
from kernels.expression.hidden import Enclosures
from kernels.expression.rounding import Losses, Sizes
from kernels.expression.series import V, Values
from kernels.expression.tangent import ROUGH, Tangents, along, short
from kernels.integrate.carried import Changes
from kernels.integrate.driver import KINK_LIMIT, STILL
from kernels.integrate.pairs import ROUNDINGS
from kernels.integrate.powers import Power, core
from kernels.integrate.records import Cell, Errors, Mode, Pieces, Written
from kernels.integrate.taylor import BY_SERIES, BY_SUM
from kernels.integrate.taylor_leg import Series
from kernels.lanes.symbols import ANY, left_a_call, written

NEXT_TO = 1.0 / 16.0
"""Of a step, what it may be changed by so that a clock is not rounded; a shorter one is taken as it is."""
STATE_OFF = 0.5
"""Of the roundings that a clock is off by at events of a shaken run, those that another state is off by: each second
one to the other side, so that what hangs on the difference of two shows it."""


def cell_of(states, parameters, kinks, tells=False):
    """A cell of zeros, as large as a scene's."""
    u, with_times = (0.0,) * states, (0.0,) * (states + 2)
    errors = Errors(0.0, 0.0, with_times, with_times, 0.0, with_times, u) if tells else ()
    marks = (0.0,) * (kinks + 1)
    wanted, so_far = (0.0, (0.0,) * parameters, 0.0, 0.0, 0.0), (0.0, 0.0, u, u, 0.0)
    return Cell(*wanted, *so_far, u, 0.0, marks, 0.0, 0.0, marks, 0.0, 0.0, 0.0, 0.0, 0.0, errors)


def _digest(scene, recorded):
    """Of all that the machine code of a scene hangs on."""

    def plain(x):
        return x.index if isinstance(x, Expression) else list(map(plain, x)) if isinstance(x, tuple) else x

    graph, *parts = vars(recorded).values()
    nodes = [(x.kind, x.varies, plain(x.args)) for x in graph.nodes]
    names, switches = (scene.name, scene.states, scene.parameters), (scene.begins, scene.only_first)
    flags = *names, scene.most_kinks, scene.slides, *switches
    text = repr((nodes, plain((*graph.kinks, *graph.powers)), plain(tuple(parts)), flags))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def entry(j):
    """A function of tuples: their entry j."""
    return written(lambda xs: xs[j])


def linear(x):
    """Whether it is a sum of states and a constant, with constant factors."""
    if x.kind in (ADD, SCALED, CHOSEN):
        return all(map(linear, x.args[x.kind == CHOSEN :]))
    return x.kind == INPUT or not x.varies


class Functions:
    """The functions of a scene, `written` for the integrators; those of its series, powers and Jacobian."""

    def __init__(self, scene, recorded):
        self.scene, self.recorded, self.graph = scene, recorded, recorded.graph
        self.states, self.kinks, self.digest = scene.states, tuple(recorded.graph.kinks), _digest(scene, recorded)
        self.size = n, m, kinks = len(scene.states), len(scene.parameters), len(self.kinks)
        rates = dict(zip(self.states, recorded.rates, strict=True))
        self.summed = {s: r.args[0] for s, r in rates.items() if r.kind == INPUT and r.varies}
        """The states whose rate is another state, and which."""
        self.seen = [u.args[0] if u.kind == INPUT else None for _, _, u in recorded.events]
        """For each event the state that it watches; None where it is more than one."""
        hangs = {s: {x.args[0] for x in needed(r) if x.kind == INPUT and x.args[0] in rates} for s, r in rates.items()}
        for _ in hangs:
            hangs = {s: on.union(*(hangs[other] for other in on)) for s, on in hangs.items()}
        self.clocks = [r.kind == NUMBER and r.args[0] == 1.0 for r in recorded.rates]
        """Which states are *clocks*, whose rate is 1."""
        self.feeds_back = any(other != s and s in hangs[other] for s, on in hangs.items() for other in on)
        """Whether the rate of a state hangs on another one whose own rate, or that of a further one, hangs on it."""
        mode, boxes = Mode(ANY, (ANY,) * (kinks + 1), (ANY,) * m, False), ((ANY, ANY),) * n
        self.any = {"state": (ANY,) * n, "new": (ANY,) * n, "changes": (ANY,) * n, "mode": mode, "boxes": boxes}
        self.any |= {"parameters": mode.parameters, "cores": (ANY,) * len(self.graph.powers), "on": mode.signs}

    def written(self):
        """The scene's `Written`, for a method that misses events by no more than an explicit one.

        Derivatives come into the graph in the order that stands here.
        """
        recorded, scene, slides = self.recorded, self.scene, self.scene.slides
        excesses = self._excesses(self.any["state"], self.any["boxes"], self.any["mode"])
        hiding = [[x is not None for x in part] for part in excesses]
        # on whose side a switch's result hangs, but for further surfaces and the surface's own u
        signs, further = {x.args[0] for x in needed(*recorded.switched) if x.kind == INPUT}, recorded.surfaces
        deciding = tuple(
            float(f".sign_{j}" in signs and j not in further and u is not recorded.events[0][2])
            for j, u in enumerate(self.kinks)
        )
        mark, sided = 2.0 if scene.only_first else 1.0, (needed(event) for event in (recorded.surface, *self.kinks))
        return Written(
            hiding=tuple(tuple(map(float, part)) for part in hiding) if any(map(any, hiding)) else None,
            hidden=left_a_call(self.rehearsed(self._hidden)),
            rates=self.values(recorded.rates), surface=self.values(recorded.surface), kinks=self.values(self.kinks),
            switched=self.values(recorded.switched), started=self.inlined(self._started),
            natural_signs=self.inlined(self._natural_signs), underflows=self.inlined(self._underflows),
            jet=self._jet(), lost=self.inlined(self._lost), bounds=left_a_call(self.rehearsed(self._bounds)),
            made=self.inlined(self._made),
            speeds=self.values(recorded.speeds) if slides else None,
            onto=self.values(recorded.onto) if slides else None,
            on_clock=self.inlined(self._on_clock), states_off=self.inlined(self._states_off),
            most_kinks=KINK_LIMIT if scene.most_kinks is None else float(scene.most_kinks),
            surfaces=tuple(mark * (j in further) for j in range(len(self.kinks))) if further else None,
            passable=tuple(float(not any(x.kind == INPUT and x.args[0] == "side" for x in parts)) for parts in sided),
            deciding=deciding if any(deciding) else None,
            jumped=left_a_call(self.rehearsed(self._jumped)) if any(self._jumps()) else None,
            judged=self._values_and_sizes(tuple(self.graph.judged)) if self.graph.judged else None,
            shaken=self.inlined(self._shaken), cell=cell_of(*self.size), roundings=ROUNDINGS, biased=0.0,
        )  # fmt: skip

    def inlined(self, function):
        """A function as compiled code takes it."""
        return written(self.rehearsed(function))

    def rehearsed(self, function):
        """A function that has been called: so derivatives come into the graph in the same order always."""
        signature = inspect.signature(function)
        function(*(self.any.get(name, ANY) for name in signature.parameters))

        def call(*arguments):
            return function(*arguments)

        call.__signature__ = signature
        return call

    def inputs(self, state, mode, unit=None, changes=()):
        """{name of an input: its value}."""
        found = dict(zip(self.states, state, strict=False)) | {"side": mode.side, ".unit": unit}
        found |= {f".held_{name}": found.get(name) for name in self.states}
        found |= dict(zip(self.scene.parameters, mode.parameters, strict=True))
        found |= dict(zip((*(f".sign_{j}" for j in range(len(self.kinks))), ".way"), mode.signs, strict=False))
        return found | {f".delta_{s}": delta for s, delta in zip(self.states, changes, strict=False)}

    def values(self, expressions):
        """A function of state and mode: the values of an expression, or of those in a tuple, or in tuples of them."""

        def valued(x, values):
            return tuple(valued(part, values) for part in x) if isinstance(x, tuple) else values.in_every_lane(x)

        return self.inlined(lambda state, mode: valued(expressions, Values(self.inputs(state, mode))))

    def sizes(self, expressions):
        """A function of what expressions are made of, in size: an ulp of it is what rounding takes."""

        def sizes(state, mode):
            found = Sizes(self.inputs(state, mode))
            return tuple(found.of(x) if x.varies else 0.0 * mode.side + found.of(x) for x in expressions)

        return self.inlined(sizes)

    def _values_and_sizes(self, expressions):
        """A function of state and mode: the value of each expression, and what it is made of in size."""
        values, sizes = self.values(expressions), self.sizes(expressions)
        return written(lambda state, mode: tuple(zip(values(state, mode), sizes(state, mode), strict=True)))

    @functools.cached_property
    def tangents(self):
        """Derivatives along changes of the states."""
        return Tangents(self.graph, self.states)

    def changes(self):
        """The first of `Changes`: what changes of the states change, and what rates and events are made of."""
        recorded = self.recorded
        values = [self.graph.multiply(factor, u) for _, factor, u in recorded.events]
        made = self.sizes(recorded.rates), self.sizes(values)
        return (*map(self.changed, (recorded.rates, values, recorded.switched)), *made)

    def changed(self, expressions):
        """A function of what changes of the states change of expressions."""
        derivatives = [self.graph.of(0.0) if x is None else x for x in map(self.tangents.of, expressions)]

        def changed(state, mode, changes):
            return tuple(map(Values(self.inputs(state, mode, None, changes)).in_every_lane, derivatives))

        return self.inlined(changed)

    def _started(self, parameters, side):
        values = Values(self.inputs((), Mode(side, (), parameters, False)))
        return tuple(map(values.in_every_lane, self.recorded.started))

    def _natural_signs(self, state, mode):
        """One kink after the other, for they may hang on signs of those before."""
        values, signs = Values(self.inputs(state, mode)), []
        for j, u in enumerate(self.kinks):
            signs.append(V.where(values.value(u) < 0.0, -1.0, 1.0))
            values.inputs[f".sign_{j}"] = signs[j]
        return (*signs, 0.0 * mode.side + 1.0)

    def _jumps(self):
        """Whether the surface, and each kink's u, may jump at a kink."""
        parts = (needed(u) for u in (self.recorded.surface, *self.kinks))
        return [any(x.kind == INPUT and x.args[0].startswith(".sign_") for x in part) for part in parts]

    def _jumped(self, state, mode, on, blur):
        """Where kinks have just been met: marks and signs of what jumps over 0 there; whether it comes next to 0.

        A surface that jumps below 0 is met; what else jumps over 0 has the other sign, as if it had been met too.
        `blur` : of what a value is made of, that within which it is next to 0
        """
        old, new = Values(self.inputs(state, mode)), Values(self.inputs(state, mode))
        sizes, jumps, never = Sizes(self.inputs(state, mode)), self._jumps(), on[0] < 0.0

        def over(u, sign, met):
            before, after, size = sign * old.value(u), sign * new.value(u), sizes.of(u)
            jump = (met < 0.5) & (V.magnitude(after - before) > STILL * size)
            return jump & (before > 0.0) & (after < 0.0), jump & (V.magnitude(after) <= blur * size)

        marks, signs, faint = [], [], never
        for j, (u, sign, met) in enumerate(zip(self.kinks, mode.signs[:-1], on[1:], strict=True)):
            jumps_over, close = over(u, sign, met) if jumps[1 + j] else (never, never)
            passed = jumps_over & (sign > 0.0) if j in self.recorded.surfaces else never
            marks.append(V.where(passed, 1.0, met))
            signs.append(V.where(jumps_over & V.not_(passed), -sign, sign))
            new.inputs[f".sign_{j}"], faint = V.where(met > 0.5, -sign, signs[j]), faint | close
        way = mode.signs[-1]
        jumps_over, close = over(self.recorded.surface, way, on[0]) if jumps[0] else (never, never)
        first = V.where(jumps_over & (way > 0.0), 1.0, on[0])
        return (first, *marks), (*signs, V.where(jumps_over, 1.0, way)), faint | close

    def _underflows(self, state, mode, unit):
        value, lost = Values(self.inputs(state, mode, unit)).value, unit < 0.0
        for x in needed(*self.recorded.timed, self.recorded.surface):
            if x.kind in (MUL, HALF_SQUARE, SCALED, DIV) and all(a.kind != NUMBER for a in x.args):
                small = V.magnitude(value(x)) < 1e-290
                for factor in x.args:
                    small = small & (V.magnitude(value(factor)) > 0.0)
                lost = lost | small
        return lost

    def _jet(self):
        pieces, _ = self.series(2)
        return written(lambda state, mode, unit: pieces(state, mode, unit, ()).events)

    def _lost(self, state, mode):
        inputs, started = self.inputs(state, mode), dict(zip(self.states, self.recorded.started, strict=True))
        if self.scene.begins is not None:
            return inputs[self.scene.begins] - 1.0
        found = None if self.scene.until else Losses(inputs, started).lost(self.recorded.surface)
        return 0.0 * mode.side if found is None else found

    def _on_clock(self, state, unit, h):
        for u in itertools.compress(state, self.clocks):
            gone_on = (V.fma(h, unit, u) - u) / unit
            h = V.where(V.magnitude(gone_on - h) <= NEXT_TO * h, gone_on, h)
        return h

    def _states_off(self, state, by):
        parts = (1.0 if clock else STATE_OFF * (-1.0) ** j for j, clock in enumerate(self.clocks))
        return self._shaken(state, tuple(V.fma(part * by, u, u) for part, u in zip(parts, state, strict=True)))

    def _shaken(self, state, new):
        parts = zip(self.states, state, new, strict=True)
        held = self.graph.held
        return tuple(V.where(V.magnitude(V.nearest(u) - u) > 0.0, x, u) if s in held else x for s, u, x in parts)

    @functools.cached_property
    def _event_parts(self):
        """Of each event its offset, what is added to that, both, and the rate of both."""
        parts = [(offset, self.graph.multiply(factor, u)) for offset, factor, u in self.recorded.events]
        whole = [self.graph.add(*part) for part in parts]
        gradients = [[Tangents.along(self.graph, s).of(x) for s in self.states] for x in whole]
        rates = [along(self.graph, gradient, self.recorded.rates) for gradient in gradients]
        return [(*part, x, rate) for part, x, rate in zip(parts, whole, rates, strict=True)]

    def _made(self, state, mode):
        found = Sizes(self.inputs(state, mode))
        size, value = found.of, found.values.value
        return tuple((size(x) + V.magnitude(value(offset)), value(rate)) for offset, x, _, rate in self._event_parts)

    def _enclosures(self, state, boxes, mode):
        return Enclosures(self.inputs(state, mode), dict(zip(self.states, boxes, strict=True)))

    def _excesses(self, state, boxes, mode):
        """What rates, and what events hide; None where that is nothing."""
        found = self._enclosures(state, boxes, mode)
        rates = [found.excess(rate) for rate in self.recorded.rates]
        return rates, [found.excess_scaled(factor, u) for _, factor, u in self.recorded.events]

    def _hidden(self, state, boxes, mode):
        nothing, parts = 0.0 * mode.side, self._excesses(state, boxes, mode)
        return tuple(tuple(nothing if x is None else nothing + x for x in part) for part in parts)

    def _bounds(self, state, boxes, mode):
        found, nothing = self._enclosures(state, boxes, mode), 0.0 * mode.side
        _, _, values, rates = zip(*self._event_parts, strict=True)
        parts = (values, 0), (rates, 0), (rates, 1)
        return tuple(tuple(nothing + found.interval(x)[end] for x in part) for part, end in parts)

    def linear(self):
        """`Written.factored` and `Written.solved`: what `stiff` makes of I - h J."""
        jacobian, n, places = {}, len(self.states), []
        for c, state in enumerate(self.states):
            slopes = map(Tangents.along(self.graph, state).of, self.recorded.rates)
            jacobian |= {(r, c): slope for r, slope in enumerate(slopes) if slope is not None}

        def factored(state, mode, h):
            values, nothing = Values(self.inputs(state, mode)), 0.0 * mode.side
            matrix = {(r, r): 1.0 + nothing for r in range(n)}
            for place, slope in jacobian.items():
                matrix[place] = V.fma(-h, values.value(slope), matrix.get(place, nothing))
            parts = stiff.triangular(matrix, n, nothing)
            places[:] = map(tuple, parts)
            return tuple(tuple(part.values()) for part in parts)

        def solved(factors, right):
            return stiff.solution(*(dict(zip(*pair, strict=True)) for pair in zip(places, factors, strict=True)), right)

        return left_a_call(self.rehearsed(factored)), left_a_call(solved)

    def of_series(self, m, order, changes=None):
        """`taylor_leg.Series` of an order; `changes` : of the error that is carried along, the first of `Changes`."""
        ways = {s: BY_SUM if s in self.summed else BY_SERIES for s in self.states} | {None: BY_SERIES}
        pieces, tangents = self.series(order, True, changes is not None)
        rates, events = self.recorded.rates, [u for *_, u in self.recorded.events]
        bent, bent_events = (tuple(float(not linear(x)) for x in xs) for xs in (rates, events))
        nested = self.recorded.nested
        return Series(
            m, order, pieces, *self.powers, tuple(ways[s] for s in self.states), tuple(ways[s] for s in self.seen),
            tuple(float(s in self.summed) for s in self.states), tuple(float(s is None) for s in self.seen),
            bent if any(bent + bent_events) else None, bent_events if any(bent_events) else None,
            entry(nested) if nested else None,
            changes and Changes(*changes, *tangents, self.feeds_back or None, self.scene.until or None),
        )  # fmt: skip

    def series(self, order, powers=False, tells=False):
        """`Series.pieces` of an order; if it tells, with `Changes.tangent` and `Changes.rough`, which go on from them.

        With `powers` these are constants in their cores.
        """
        recorded, graph, summed = self.recorded, self.graph, self.summed
        rates = dict(zip(self.states, recorded.timed, strict=True))
        if tells:
            rates |= {f".delta_{s}": self.tangents.of(x) for s, x in rates.items()}
        lengths = {"inner": short(recorded.rates, order), "rough": ROUGH[order]} if tells else {}
        taken = {"inner": (), "rough": ()}

        def curves(starts, unit, series):
            """What each state, or its change, is evaluated from (`taylor.Way`)."""
            start = dict(zip(self.states, starts, strict=True))
            return {s: (start[s], unit, series[summed[s]]) if s in summed else (u,) for s, u in series.items()}

        def expanded(state, mode, unit, cores):
            values = Values(self.inputs(state, mode, unit), rates, cores)
            series = {s: values.coefficients(graph.series(s), order) for s in self.states}
            events = tuple((*map(values.value, event), values.coefficients(u, order)) for *event, u in recorded.events)
            of_states = curves(state, unit, series)
            watched = [(s, u) for s, (*_, u) in zip(self.seen, events, strict=True)]
            return values, Pieces(
                states=tuple(series.values()),
                events=events,
                controlled=(*series.values(), *(u for s, u in watched if s is None)),
                of_states=tuple(of_states.values()),
                of_events=tuple((u,) if s is None else of_states[s] for s, u in watched),
                inner=(),
                rough=(),
            )

        def pieces(state, mode, unit, cores):
            values, found = expanded(state, mode, unit, cores)
            return found._replace(**{part: tuple(values.known[key] for key in keys) for part, keys in taken.items()})

        def changed(values, length, changes, unit):
            found, nothing = {}, 0.0 * values.inputs["side"]
            for s, delta in self.tangents.deltas.items():
                terms = (values.coefficient(delta, k) for k in range(length + 1))
                found[s] = tuple(nothing if x is None else x for x in terms)
            return tuple(curves(changes, unit, found).values())

        def tangent(part):
            def tangent(state, mode, unit, inner, changes, cores):
                values = Values(self.inputs(state, mode, unit, changes), rates, cores)
                values.known |= dict(zip(taken[part], inner, strict=True))
                return changed(values, lengths[part], changes, unit)

            return written(tangent)

        state, mode, changes = (self.any[name] for name in ("state", "mode", "changes"))
        cores = self.any["cores"] if powers else ()
        whole, _ = expanded(state, mode, ANY, cores)
        for part, length in lengths.items():
            values = Values(self.inputs(state, mode, ANY, changes), rates, cores)
            values.known = dict(whole.known)
            changed(values, length, changes, ANY)
            inputs = {(x.index, 0) for x in graph.nodes if x.kind == INPUT}
            asked = values.asked - inputs
            taken[part] = [key for key, value in whole.known.items() if key in asked and value is ANY]
        return written(pieces), [tangent(part) for part in lengths]

    @functools.cached_property
    def powers(self):
        """`Series.cores`, and `Series.on_kink`."""
        powers, bases = [], {}
        for node in self.graph.powers:
            base = node.args[0]
            kink, place = self.graph.kinks[base.args[1]], self.states.index(base.args[1].args[0])
            bases[place] = 1 + kink
            of_state, entries = map(self.values, node.args), (entry(place), entry(1 + kink))
            powers.append(Power(self._with_power(node), *of_state, *entries, self._without(place)))

        def cores(state, mode, unit, tolerance, on, t, margins, furthest):
            found = [core(p, state, mode, unit, tolerance, on, t, margins, furthest) for p in powers]
            values, limits, coarse = (tuple(each[k] for each in found) for k in range(3))
            return values, limits, coarse, found[-1][3] if found else None

        def on_kink(state, fires):
            return tuple(V.where(fires[bases[i]], 0.0 * u, u) if i in bases else u for i, u in enumerate(state))

        return written(cores), written(on_kink)

    def _with_power(self, node):
        """The rates per unit of time, with a value of a power."""

        def rates(state, mode, unit, power):
            values = Values(self.inputs(state, mode, unit), precomputed={node: power})
            return tuple(map(values.value, self.recorded.timed))

        return self.inlined(rates)

    def _without(self, place):
        """The state with that one 0."""
        return written(lambda state, mode: (*state[:place], 0.0 * mode.side, *state[place + 1 :]))
