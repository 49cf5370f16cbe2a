"""The general foliot's limit cycle by Taylor series: half swings followed as a scene of one's own, and Newton's method.

The half swing of `_half_swing`, equation (1) there, is a scene of one's own, from x = 1 with the speed v0 to x = -1,
with a kink at the turning point. The series, the proof that no event is passed over, and the core of abs(v)^n are those
of `kernels.codegen`. The two tangents go along as states; of them `up_mu` and `up_start` keep the speeds that they have
at the turning point, where they should jump by J of (3). That they do not is made good for at the end: what is wanting
is a multiple of the tangent along the motion itself, (v, v'), with the factor
    beta = (J - 1) v_mu/v'  at the turning point,                                                        (1)
which is what dry friction's change of sign shifts the time by. The cycle then follows by (4) of `_integrated_swing`.
A form of the scene follows what its cells need: with drag of any degree; without, where the friction's slope is a
constant; and for a search of the speed, which needs no tangent, for dF/dv1 is known from `decay` and `top`.

Each cell goes through four stages on its own. SEARCH: Newton's method within a bracket, at a coarse tolerance. NEAR: at
one that follows the square of its step. ROUGH and FINE: two half swings, whose difference tells the error. The rough
one has a tolerance FINER times larger than the fine one, and parameters some roundings off, as in `to_tolerance`. Where
the torque varies, outputs may depend on the speed a thousandfold, and a change of speed can hide the effect of the
tolerance: LAST, which starts at the speed that the fine one gives and has its tolerance, shows how much that is. Where
the error is too large, they are followed once more at a tighter tolerance.
"""

import functools
from collections import namedtuple

import numpy as np

from kernels.codegen.compiled import runner
from kernels.codegen.followed import followed, off_by_roundings
from kernels.codegen.to_tolerance import FINER
from kernels.expression.graph import cos, power, sign, sin
from kernels.foliot import _units
from kernels.foliot._half_swing import Half, inwards, problem_of, pull, rates
from kernels.foliot._integrated_swing import cycle_by, first_speed, held, newton
from kernels.foliot._units import Foliot, Outputs
from kernels.interface import FIRST_REFUSAL, Field, Method, Status
from kernels.lanes.codes import OK, STICKS
from kernels.lanes.jit import jit
from kernels.lanes.vectors import where
from kernels.lanes.wiring import kernel, method, signed
from kernels.maths.elementary import exp
from kernels.scene import Scene

LIMIT, STUCK = 40, 6
"""Half swings of a cell, and of them those that come to rest on their way in, one after the other."""
_STIFFEST, _MILDEST = 100.0, 1.0
"""f'(V)/V above which steps that are stable are too short; degree of drag below which its slope has a pole at rest,
which series come close to slowly."""
SEARCH, NEAR, ROUGH, FINE, LAST = 0, 1, 2, 3, 4
"""What a cell's next half swing is for."""
_COARSE, _CLOSE, _CHECKED = 1e-4, 0.05, 0.01
"""Tolerance of the search, the relative step below which it ends, and the one below which a rough swing has a twin."""
_NOISE, _NOISE_BARE = 100.0, 3000.0
"""Tolerances within which the sign of F - v may be wrong; where no tangents make steps shorter."""
_CALM, _LEAST = 1e-6, 1e-17
"""Tolerance at which a half swing is right enough for Newton's method to converge, whatever is wanted; and below which
a finer one changes nothing but the time that it takes."""
_SHARE, _SHARE_ROUGH, _TIGHTER, AGAIN = 0.1, 0.01, 0.01, 3
"""Of rtol that a half swing may be off by; where the drag is of a degree below 2 or the torque varies, on which time
and sensitivity hang steeply; how much less where it did not do, and how often that is tried."""
_TOLD, _TOLD_ROUGH, _TOLD_STEEP = 4.0, 32.0, 128.0
"""Error that is stated over what rough and fine half swings differ by, of which the fine one's should be a fifteenth;
where the torque varies, or the drag is of a degree below 2: cores of abs(v)^n have a low order; and of the sensitivity
where the torque varies, on which it depends steeply."""
_ROUNDING = 2e-14
"""Of a half swing's speed and time."""

Swung = namedtuple("Swung", "time x v x_mu v_mu x_start v_start decay top up_mu up_start")
"""What a half swing comes to: its time, and states at the switch."""
TERMS, RIPPLE = ("drag", "outwards", "inwards", "gamma", "degree", "kappa"), ("depth", "wave")
Form = namedtuple("Form", "name states terms")
"""A scene of a half swing, which follows some of its states by some of the terms."""
SMOOTH = Form("foliot_swing", Swung._fields[1:], TERMS)
RIPPLED = Form("foliot_ripple_swing", SMOOTH.states, (*TERMS, *RIPPLE))
_BARE = tuple(name for name in RIPPLED.terms if name not in ("gamma", "degree"))
LINEAR = Form("foliot_ripple_linear", tuple(name for name in SMOOTH.states if name != "decay"), _BARE)
SEARCHED = Form("foliot_ripple_search", ("x", "v", "top"), _BARE)
FORMS = SMOOTH, RIPPLED, LINEAR, SEARCHED
_UNKNOWN = {"x_mu": np.nan, "v_mu": np.nan, "up_mu": np.nan}
_FIRST = {"x": 1.0, "v_start": 1.0, "top": 1.0, "up_start": 1.0}
Cell = namedtuple("Cell", (*Foliot._fields, "depth", "harmonic"))
"""Columns of cells."""
Step = namedtuple("Step", (*TERMS, "first", "stiff", "end", "change", "slope", "cancels", "outputs"))
"""Of a half swing: the cell's terms, the speed that Newton's method begins with and the stiffness; F, Newton's step
from the speed before the half swing, and dF/dv1; the cycle, and how its sensitivity cancels."""


@functools.cache
def _runner(form):
    """The compiled half swing by (1) of `_half_swing`, with its tangents and the states at the turning point."""
    dragged, varies = "gamma" in form.terms, "wave" in form.terms

    def rates_of_named(**p):
        x, v, drag, kappa = p["x"], p["v"], p["drag"], p["kappa"]
        side = sign(v)
        rising, falling = 0.5 * (1.0 + side), 0.5 * (1.0 - side)
        steady, slope = rising * p["outwards"] + falling * p["inwards"], drag
        angle = p["wave"] * (1.0 - x) if varies else None
        extra = p["depth"] * cos(angle) if varies else 0.0
        if dragged:
            gamma, degree, speed = p["gamma"], p["degree"], abs(v)
            slope = drag + degree * gamma * power(speed, degree - 1.0)
            force = steady + ((1.0 + extra) - 1.0) + drag * v + side * gamma * power(speed, degree) + kappa * x
        else:
            force = steady + drag * v + kappa * x + extra
        found = {"x": v, "v": -force, "top": rising * v, "decay": slope}
        if "x_mu" in p:
            stiffness = kappa + p["depth"] * p["wave"] * sin(angle) if varies else kappa
            pushed = -(1.0 + extra) if dragged else -1.0 - extra
            by_mu = pushed - stiffness * p["x_mu"] - slope * p["v_mu"]
            by_start = -stiffness * p["x_start"] - slope * p["v_start"]
            found |= {"x_mu": p["v_mu"], "v_mu": by_mu, "x_start": p["v_start"], "v_start": by_start}
            found |= {"up_mu": rising * by_mu, "up_start": rising * by_start}
        return tuple(found[name] for name in form.states)

    def surface(x):
        return x + 1.0

    def start(v0):
        return tuple(v0 if name == "v" else _FIRST.get(name, 0.0) for name in form.states)

    terms = (*form.terms, "v0")
    functions = signed(rates_of_named, [*form.states, *form.terms]), surface, start
    return runner(Scene(form.name, "half swing of a foliot", form.states, terms, *functions, most_kinks=1), "taylor")


def half_swings(form, rough, terms, start, tolerance):
    """The half swings of cells, a `Swung` of columns, and their statuses.

    Tangents that a form does not follow are NaN by mu, so that the sensitivity is none; by v0 they are 0, which
    takes from time and amplitude what Newton's last step would better.

    Parameters
    ----------
    form, rough : the number in FORMS of each cell's, and whether its terms are to be some roundings off
    terms, start : {name: column}, and the speed v0
    """
    swung, verdict = Swung(*np.empty((len(Swung._fields), len(start)))), np.empty(len(start))
    kind = 2 * form + rough
    for k in np.unique(kind):
        own, (cells,) = FORMS[k // 2], np.nonzero(kind == k)
        columns = [*(terms[name][cells] for name in own.terms), start[cells], np.ones(len(cells))]
        columns = off_by_roundings(columns) if k % 2 else columns
        rows = followed(_runner(own), columns, tolerance[cells])
        found = dict(zip(("time", "interval", *own.states), rows, strict=False))
        found = {"decay": columns[own.terms.index("drag")] * found["time"]} | found
        for name, column in zip(Swung._fields, swung, strict=True):
            column[cells] = found.get(name, _UNKNOWN.get(name, 0.0))
        verdict[cells] = rows[-1]
    return swung, verdict


@jit
def step(p, rtol):
    """The `Step` of a half swing that followed the speed v1, with (1) made good for; and the verdict.

    Terms are those of `_half_swing`, with friction of any degree as it is down to rest.
    """
    scene, units = _units.without_dimensions(p)
    problem = problem_of(scene, (p.depth, p.harmonic), 0.0 * p.e)
    first, _ = first_speed(problem.pace)
    friction = problem.d, problem.outwards, problem.inwards, problem.gamma, problem.n
    e, v, force = problem.e, p.v, pull(p.top, problem)
    behind = problem.inwards + force
    jump = where(e > 0.0, behind / (problem.outwards + force), 1.0)
    shift = (1.0 - jump) / behind
    by_mu, by_start = shift * p.up_mu, shift * p.up_start
    rate = rates((p.x, v, p.x_mu, p.v_mu, p.x_start, p.v_start, p.decay), inwards(problem, problem.floor))[1]
    x_mu, v_mu, x_start, v_start = p.x_mu + by_mu * v, p.v_mu + by_mu * rate, p.x_start + by_start * v, p.v_start
    state, never = (p.x, v, x_mu, v_mu, x_start, v_start + by_start * rate, p.decay), e > 2.0
    half = Half(-v, state, rate, p.top, 0.0 * e, p.time, jump * exp(-p.decay), never, never)
    slope, change = newton(e, p.v1, half)
    cycle, cancels = cycle_by(e, half, p.v1 + change, change, slope)
    (period, amplitude, speed, s, multiplier), status = _units.given(
        units, cycle, where(held(problem, force), STICKS, OK)
    )
    begun = (*friction, problem.kappa, first, problem.stiffness * problem.pace)
    return (*begun, half.end, change, slope, cancels, period, amplitude, speed, s, multiplier), status


_step = kernel(
    "foliot_swing",
    doc="",
    source="",
    parameters=[Field(name, "1", "") for name in (*Cell._fields, "v1", *Swung._fields)],
    outputs=[Field(name, "1", "") for name in (*Step._fields[:-1], *Outputs._fields)],
    methods=(method("step", "", step),),
).methods[0].solve  # fmt: skip


def by_taylor(parameters):
    """The method of a kernel with these parameters; depth and harmonic are the last two, where the torque varies."""
    n, rippled = len(parameters), "depth" in parameters

    def solve(*columns):
        asked = columns[n + 1] > 0
        outputs, errors, status = cycles(cells_of(columns), columns[n], rippled, asked)
        for column, found in zip(columns[n + 2 :], (*outputs, errors[asked].max(axis=0), status), strict=True):
            column[...] = found

    def bound(*columns):
        columns[-1][...] = np.where(begun(cells_of(columns), columns[n])[2], 0.0, np.inf)

    def cells_of(columns):
        return Cell(*columns[:n], *([] if rippled else [np.zeros(len(columns[n])), np.ones(len(columns[n]))]))

    names = [*parameters, "rtol", "asked"]
    return Method(
        "taylor",
        "Taylor series over half swings, each followed twice, and Newton on their map",
        signed(solve, [*names, *Outputs._fields, "error", "status"]),
        signed(bound, [*names, "out"]),
        estimates=True,
    )


def stepped(cells, v, swung, rtol):
    """The `Step` of columns, and statuses."""
    alone = len(Step._fields) - 1
    found, status = np.empty((alone + len(Outputs._fields), len(rtol))), np.empty(len(rtol), np.int8)
    _step(*cells, v, *swung, rtol, *found, status)
    return Step(*found[:alone], found[alone:]), status


def begun(cells, rtol):
    """Terms and first speeds of cells, and where the method is worth while.

    Not where steps are short for stability, nor where the drag is steep at rest; nor where a hairspring holds what
    creeps inwards, overdamped, before it comes to the switch.
    """
    some = np.ones(len(rtol))
    found, _ = stepped(cells, some, [-some if name == "v" else some for name in Swung._fields], rtol)
    with np.errstate(over="ignore"):  # an infinite square compares as the square itself would
        creeps = (found.kappa > found.inwards) & (found.drag * found.drag >= 4.0 * found.kappa) & (cells.e >= 0.0)
    smooth = (found.degree >= _MILDEST) | ~(found.gamma > 0.0)
    return dict(zip(TERMS, found, strict=False)), found.first, (found.stiff < _STIFFEST) & smooth & ~creeps


@np.errstate(all="ignore")
def cycles(cells, rtol, rippled, asked):
    """Limit cycles of many cells by Newton's method on v1, each cell at its own stage.

    `rippled` says that torque varies, where without drag the search follows no tangents, which make steps shorter, and
    `asked` which of the outputs must be right: without the sensitivity no tangents are followed where none are needed.
    The result is outputs, relative errors, one row for each output, and statuses: NOT_CONVERGED where half swings come
    to rest or the bracket closes on nothing.

    An error of F counts 1/(1 - dF/dv1)-fold in v1, and Y-fold in exp(-Y); without tangents errors of steps add up over
    the waves of the torque. So the tolerance wanted of the last half swings is
        share rtol (1 - dF/dv1)/((1 + Y) (1 + waves)).                                               (2)
    When they give an output with a relative difference `apart`, its error is stated as
        told apart + 2 (rate apart + step) + (ROUNDING + tolerance (1 + waves))/(1 - dF/dv1),          (3)
    where `step` is the relative one that Newton's method would still go, and `rate` what it is of the way that v1 went
    since the half swing before. Where the torque varies, what the last two half swings differ by is added. The
    last term is more where the sensitivity cancels, and (1 + Y)-fold of exp(-Y).
    """
    n, of_sensitivity = len(rtol), Outputs._fields.index("sensitivity")
    terms, v, possible = begun(cells, rtol)
    terms |= dict(zip(RIPPLE, (cells.depth, cells.harmonic * (0.5 * np.pi)), strict=True))
    dragged, varies, tangents = terms["gamma"] > 0.0, cells.depth > 0.0, asked[of_sensitivity]
    linear, rough = ~dragged & rippled, (dragged & (terms["degree"] < 2.0)) | varies
    told = np.tile(np.where(rough, _TOLD_ROUGH, _TOLD), (len(Outputs._fields), 1))
    told[of_sensitivity, varies] = _TOLD_STEEP
    share, final = np.where(rough, _SHARE_ROUGH, _SHARE), np.where(varies, LAST, FINE)
    form, searched = np.where(linear, FORMS.index(LINEAR), int(rippled)), FORMS.index(SEARCHED)
    low, high, stuck, again = np.full(n, -1.0), np.full(n, np.inf), np.zeros(n, int), np.zeros(n, int)
    stage, tolerance, before = np.full(n, SEARCH), np.full(n, _COARSE), np.full(n, np.nan)
    outputs, errors = np.full((len(Outputs._fields), n), np.nan), np.full((len(Outputs._fields), n), np.inf)
    by_tolerance = errors.copy()
    status = np.where(possible, Status.NOT_CONVERGED, Status.NO_METHOD).astype(np.int8)
    i = np.flatnonzero(possible)
    for _ in range(LIMIT):
        if not len(i):
            break

        # the half swings, each in the form that its cell needs; Newton's step of each, and the cycle by it
        bare, now, used = linear[i] & ((stage[i] < ROUGH) | (not tangents)), v[i], tolerance[i]
        own, of_cells = np.where(bare, searched, form[i]), {name: column[i] for name, column in terms.items()}
        swung, ended = half_swings(own, stage[i] == ROUGH, of_cells, cells.e[i] * now, used)
        by, verdict = stepped([column[i] for column in cells], now, swung, rtol[i])
        free = (ended < FIRST_REFUSAL) & np.isfinite([by.end, by.change, by.slope]).all(axis=0) & (by.end > 0.0)
        relative, gap = np.abs(by.change / by.end), 1.0 - by.slope
        decay = np.where(swung.decay < 750.0, swung.decay, 0.0)
        stuck[i] = np.where(free, 0, stuck[i] + 1)
        lost = (stuck[i] > STUCK) | ((stage[i] == SEARCH) & (high[i] - low[i] <= _COARSE * now))

        # the error (3), where the last two are done; the end where that will do or nothing helps
        moved, apart = np.abs(now / before[i] - 1.0), np.abs(by.outputs / outputs[:, i] - 1.0)
        rate = np.where(moved > 0.0, relative / moved, 0.0)
        by_tolerance[:, i] = np.where(stage[i] == LAST, by_tolerance[:, i] + apart, told[:, i] * apart)
        waves = np.where(linear[i] & (not tangents), terms["wave"][i] / np.pi * (1.0 + swung.top), 0.0)
        floor = np.tile((_ROUNDING + used * (1.0 + waves)) / gap, (len(Outputs._fields), 1))
        floor[of_sensitivity] *= 1.0 + by.cancels
        floor[4] *= 1.0 + decay
        stated, done = by_tolerance[:, i] + 2.0 * (rate * apart + relative) + floor, free & (stage[i] == final[i])
        outputs[:, i[free]], errors[:, i] = by.outputs[:, free], np.where(done, stated, np.inf)
        right = errors[:, i][asked].max(axis=0) <= rtol[i]
        last = done & (right | (again[i] >= AGAIN) | (used <= _LEAST))
        status[i[last]] = verdict[last]
        repeated = i[done & ~last]
        share[repeated], again[repeated] = _TIGHTER * share[repeated], again[repeated] + 1

        # the next speed: Newton's, or where that leaves the bracket one that narrows it
        noise = np.where(linear[i], _NOISE_BARE, _NOISE) * used * now
        low[i] = np.where(~free | (by.end - now > noise), now, low[i])
        high[i] = np.where(free & (now - by.end > noise), now, high[i])
        new = now + by.change
        inside = free & (new > low[i]) & (new < high[i]) & (new < 8.0 * now + 8.0)
        between = np.where(high[i] < np.inf, 0.5 * (np.maximum(low[i], 0.0) + high[i]), 2.0 * now + 1.0)
        checked = inside & (stage[i] >= ROUGH) & (stage[i] < final[i]) & (relative < _CHECKED)
        before[i], v[i] = now, np.where(inside, new, between)

        # the next stage and its tolerance, at last (2). Where the search is cheap, it goes on until what Newton's
        # method leaves is below what is wanted
        wanted = np.fmax(share[i] * rtol[i] * gap / (1.0 + decay) / (1.0 + waves), _LEAST)
        near = np.clip(0.01 * np.sqrt(rtol[i] * gap), FINER * wanted, _COARSE)
        left, converged = relative * relative, relative < np.sqrt(near)
        near = np.where(linear[i], np.clip(0.01 * left, np.minimum(4.0 * wanted, _CALM), _COARSE), near)
        converged = np.where(linear[i], (left < wanted) & (used <= FINER * wanted), converged)
        close = inside & np.where(stage[i] == SEARCH, relative < _CLOSE, converged)
        onward = checked | (close & (stage[i] < ROUGH))
        stage[i] = np.where(onward, stage[i] + 1, np.minimum(stage[i], ROUGH))
        tolerance[i] = np.choose(stage[i], [np.full(len(i), _COARSE), near, FINER * wanted, wanted, wanted])
        i = i[~(last | lost)]
    return outputs, errors, status
