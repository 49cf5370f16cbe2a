"""The general foliot's limit cycle from half swings that are followed (`_half_swing`, whose equations are meant here).

A half swing that starts with v0 = e v1 after the switch ends with the speed -F(v1). The limit cycle is F(v1) = v1,
found by Newton's method. An area shrinks along the flow by exp(-Y), and by J of (3) at the turning point, hence
    dF/dv1 = e^2 v1/F exp(-Y) J,  s = -dlnP/dlnmu = -(dT/dlnmu + e dT/dv0 dv1/dlnmu)/T.              (4)
The multiplier is dF/dv1 on the cycle. (J = 1 for e <= 0, where nothing turns.)

Existence: a swing that starts faster stays faster at every x and loses more, so v1^2 - F^2 = (1 - e^2) v1^2 - 4 + 2 L
rises with v1 and has one root. Where the motion comes to rest on its way in, F is continued by helping it, without
speed, to the next place where the drive wins over dry friction (F = 0 if there is none). That keeps F continuous and
v1^2 - F^2 rising; so the one root is found, and if help was needed on the cycle there is none: the scene STICKS.

Each cell goes through stages on its own. SEARCH: Newton's method within a bracket, at a coarse tolerance. NEAR: at one
of the order of the square of its step. ROUGH and FINE: two half swings with tolerances some times apart, whose
difference tells the error. Where it is too large, they are followed once more at a tighter tolerance. So that no change
of speed hides what the tolerance does, outputs, which may depend on the speed a thousandfold where the torque varies,
are those at the speed by Newton's step: by their tangents, or as they changed since the half swing before.
"""

from collections import namedtuple

import numpy as np

from kernels.foliot._half_swing import problem_of, pull
from kernels.foliot._units import Foliot, Outputs, given, without_dimensions
from kernels.interface import FIRST_REFUSAL, Field, Method, Status
from kernels.lanes.codes import OK, STICKS
from kernels.lanes.columns import in_lanes, to_eight_bits
from kernels.lanes.jit import jit
from kernels.lanes.vectors import fma, magnitude, not_, where
from kernels.lanes.wiring import kernel, method, signed

LIMIT, STUCK, AGAIN = 60, 6, 5
"""Half swings of a cell; of them those that come to rest on their way in, one after the other, where none is helped;
and how often a tighter tolerance is tried."""
SEARCH, NEAR, ROUGH, FINE = 0, 1, 2, 3
"""What a cell's next half swing is for."""
_NOISE, _NOISE_BARE = 100.0, 3000.0
"""Tolerances within which the sign of F - v may be wrong; where no tangents make steps shorter."""
_SAME_WAVE, _ANYTHING = 0.1, 1e300
"""Radians of the torque's wave over which J of (3) is about straight; for what has no bound."""
_SENSITIVITY, _MULTIPLIER = map(Outputs._fields.index, ("sensitivity", "multiplier"))

Cell = namedtuple("Cell", (*Foliot._fields, "depth", "harmonic"))
"""Columns of cells."""
Terms = namedtuple("Terms", "drag outwards inwards gamma degree kappa rough pace stiff")
"""Of a cell: terms of `Problem`, and the stiffness f'(V)/V."""
_State = namedtuple("_State", "rtol index v tolerance spring before used low high stage stuck again share told linear")
Search = namedtuple("Search", (*Cell._fields, *Terms._fields, *_State._fields))
_FOUND = 3 * len(Outputs._fields)
"""Columns of cells that are searched for: the next v1, its tolerance and (5); v1 and tolerance before, the bracket, the
stage; how often no half swing came back, and a tighter tolerance was tried; share and factor of (6) and (7); whether
`bare` may be. And columns behind these: outputs before, at Newton's speed and at that of the half swing, and how they
follow v1."""
Found = namedtuple("Found", "end change slope cancels Y A helped outputs")
"""By a half swing: F, Newton's step from the speed before it, dF/dv1; how many times larger than s the terms are that
it is the sum of; Y, or 0 where exp(-Y) is; the turning point A; whether it was helped; the outputs of the cycle."""
Manner = namedtuple(
    "Manner", "name doc follow begins bare steps coarse orderly least rounding finer shares told tighter"
)
"""A way to follow half swings.

name, doc : of the method
follow : (`Search`, bare) -> rows of `Found` and of outputs; statuses. Those at ROUGH may have parameters some roundings
    off; of those `bare` tangents are not needed
begins : (cells, terms) -> statuses: OK where the method is worth while, else why it is not
bare : whether less is followed where torque varies and neither drag nor what is asked needs tangents
steps : whether it goes by steps of one order. Cells that take about as many go side by side then, and the search is
    left out where friction soon balances the drive: steps are short there in any case
coarse, orderly, least : tolerance of the search; the one below which an error falls as it does; the finest
rounding : of a half swing's speed and time
finer : how many times the fine tolerance the rough one is
shares : of rtol that a half swing may be off by: where friction is smooth at rest, where it is not, and where its
    degree is below 2 or the torque varies, on which time and sensitivity hang steeply
told : what is stated over what rough and fine half swings differ by, in each of these three
tighter : by how much less a share is the next time, where it did not do
"""


def of_columns(solve, inputs, outputs, loop=in_lanes):
    """A function of columns and rtol, made of one of a cell; its results are rows, and statuses."""
    parameters, results = ([Field(name, "1", "") for name in names] for names in (inputs, outputs))
    methods = (method(solve.__name__, "", solve, loop=loop),)
    made = kernel("foliot_swing", doc="", source="", parameters=parameters, outputs=results, methods=methods)
    (only,) = made.methods

    def call(*columns):
        found, status = np.empty((len(results), len(columns[0]))), np.empty(len(columns[0]), np.int8)
        only.solve(*columns, *found, status)
        return found, status

    return call


@jit
def terms_of(p, rtol):
    """The `Terms` of a cell."""
    scene, _ = without_dimensions(p)
    q = problem_of(scene, (p.depth, p.harmonic), rtol)
    rough, stiff = where(q.rough, 1.0, 0.0), q.stiffness * q.pace
    return Terms(q.d, q.outwards, q.inwards, q.gamma, q.n, q.kappa, rough, q.pace, stiff), OK


@jit
def found_by(units, problem, v, half):
    """What a half swing that followed the speed v comes to, the cycle by (4) after Newton's step, and its status."""
    e, end = problem.e, half.end
    slope = where(end > 0.0, e * e * v / end * half.shrink, 0.0)
    change = (end - v) / (1.0 - slope)
    _, _, x_mu, v_mu, x_start, _, decay = half.state
    time_by_mu, time_by_start = x_mu / end, e * x_start / end
    by_start = time_by_start * (-fma(half.rate, time_by_mu, v_mu) / (1.0 - slope))
    s = -(by_start + time_by_mu) / half.time
    cancels = (magnitude(by_start) + magnitude(time_by_mu)) / magnitude(s * half.time)
    cycle = fma(time_by_start, change, half.time), half.top, v + change, s, e * e * half.shrink
    held = (e >= 0.0) & not_(1.0 + pull(half.top, problem) > problem.rho_s)
    outputs, status = given(units, cycle, where(half.helped | held, STICKS, OK))
    helped, Y = where(half.helped, 1.0, 0.0), where(decay < 750.0, decay, 0.0)
    return Found(end, change, slope, cancels, Y, half.top, helped, outputs), status


_terms = of_columns(terms_of, Cell._fields, Terms._fields)


def begun(manner, cells, rtol):
    """The `Terms` of cells, and the statuses that they begin with: OK where the method is worth while."""
    terms = Terms(*_terms(*cells, rtol)[0])
    with np.errstate(over="ignore"):  # an infinite square compares as the square itself would
        return terms, manner.begins(cells, terms).astype(np.int8)


def _spring(s, v):
    """How many times larger an error of F is than that of a step, where most of the energy is the hairspring's.

    An error of x changes F^2 by kappa times as much, of which friction leaves its share:
        max(1, kappa/v1^2 exp(-2 f'(V)/V)).                                                          (5)
    """
    return np.fmax(1.0, to_eight_bits(s.kappa / v**2 * np.exp(-2.0 * s.stiff)))


def _wanted(manner, s, gap, decay, waves):
    """The tolerance of the last half swings.

    An error of F counts 1/(1 - dF/dv1)-fold in v1, and Y-fold in exp(-Y); without tangents errors of steps add up over
    the waves of the torque. So it is, with (5),
        share rtol (1 - dF/dv1)/((1 + Y) (1 + waves) spring).                                        (6)
    """
    wanted = s.share / s.spring * gap / ((1.0 + decay) * (1.0 + waves))
    return np.fmin(np.fmax(wanted, manner.least), manner.orderly)


def _by_J(s, by, off):
    """Where the torque varies: how ln J of (3) follows ln v1, at most, and how many times Newton's step it may be away.

    dA/dv0 is less than v0/(tau + kappa A). Where v1 may be `off` so far that its turning points lie on other parts of a
    wave, J may be anything, and 1 - dF/dv1 on the way as small as for the largest J, or nothing.
    """
    gap, wave = 1.0 - by.slope, 0.5 * np.pi * s.harmonic
    sine, cosine = (to_eight_bits(of(wave * (1.0 - by.A))) for of in (np.sin, np.cos))
    extra = s.kappa * by.A + s.depth * np.array([cosine, np.ones(len(wave))])
    by_A = s.kappa + s.depth * wave * sine
    inwards, outwards = s.inwards + extra, s.outwards + extra
    least = 1.0 - by.slope * (inwards / outwards)[1] * (outwards / inwards)[0]
    farther = np.where(least > 0.0, gap / least, _ANYTHING)
    apart = ~(4.0 * wave * by.A * off * farther <= _SAME_WAVE)
    steep = np.abs(by_A * (1.0 / inwards[0] - 1.0 / outwards[0])) * (s.e * s.v) ** 2 / outwards[0]
    varies = (s.depth > 0.0) & (s.e > 0.0)
    return np.where(varies, np.where(apart, _ANYTHING, steep), 0.0), np.where(varies & apart, farther, 1.0)


def _stated(rounding, s, by, former, step, hangs, tolerance):
    """Relative errors of what half swings give, a row for each output.

    Where those before gave the outputs `former`, with a relative difference `apart`, they are
        told apart + 2 (1 + abs(hangs)) step + (rounding + tolerance) spring/(1 - dF/dv1),           (7)
    where `step` is the relative one that Newton's method would still go, and `hangs` how an output follows v1. The last
    term is (1 + Y)-fold of exp(-Y); terms of s that cancel add theirs, with a tenth of the tolerance: they err alike.
    Both follow J, of which two half swings that are waves of the torque apart say nothing.
    """
    apart = np.where(by.outputs == former, 0.0, np.abs(by.outputs / former - 1.0))  # a multiplier may be 0 for good
    gap = 1.0 - by.slope
    floor = (rounding + tolerance) * s.spring / gap
    steep, farther = _by_J(s, by, step + floor)
    floor, step = floor * farther, step * farther
    by_J = np.where(steep > 0.0, steep * np.abs(by.slope / gap) * by.cancels, 0.0)
    stated = s.told * apart + 2.0 * step * (1.0 + np.abs(hangs)) + floor
    stated[_SENSITIVITY] += (rounding + 0.1 * tolerance) * s.spring / gap * by.cancels + (floor + 2.0 * step) * by_J
    stated[_MULTIPLIER] += floor * by.Y + (floor + 2.0 * step) * steep
    return stated


def _first_speed(s):
    """About v1, within some 5 % where there is no hairspring.

    Where friction takes little, accelerations are 1, and by v1^2 (1 - e^2) = 4 - 2 L each kind of it alone gives
        (1 - e^2 + 2 rho e^2) v1^2 = 2 d (1 + e^3) v1^3/3 = 2 gamma (1 + e^m) v1^m/m = 4 (1 - rho),  m = n + 2.      (8)
    Where it takes much, it balances the drive, at v1 = 1/pace.
    """
    out, m, work = np.fmax(s.e, 0.0), s.degree + 2.0, 2.0 * s.inwards
    dry = (1.0 - s.e * s.e + (s.outwards - s.inwards) * out * out) / (2.0 * work)
    viscous = s.drag * (1.0 + s.e**3) / (3.0 * work)
    power = s.gamma * (1.0 + np.sign(s.e) * np.abs(s.e) ** m) / (m * work)
    little = dry**1.25 + viscous ** (5.0 / 6.0) + power ** (2.5 / m)
    return to_eight_bits((little**1.4 + s.pace**3.5) ** (-1.0 / 3.5))


def _begun_search(manner, cells, terms, rtol, i):
    """The columns of `Search` and those behind them, of the cells i before their first half swing."""
    known = [*(column[i] for column in (*cells, *terms, rtol)), i]
    search = np.zeros((len(Search._fields) + _FOUND, len(i)))
    search[: len(known)] = known
    s = Search(*search[:-_FOUND])
    dragged, varies, slow = s.gamma > 0.0, s.depth > 0.0, s.pace > 3.0
    kind = np.where((dragged & (s.degree < 2.0)) | varies, 2, np.where(s.rough > 0.5, 1, 0))
    s.share[:], s.told[:] = np.array(manner.shares)[kind] * s.rtol, np.array(manner.told)[kind]
    s.linear[:], s.stage[:] = ~dragged & varies & manner.bare, np.where(slow & manner.steps, ROUGH, SEARCH)
    s.high[:], s.v[:] = np.inf, np.where(slow, 1.0 / s.pace, _first_speed(s))
    s.spring[:] = _spring(s, s.v)
    rough = manner.finer * _wanted(manner, s, 1.0, np.where(s.stiff < 375.0, 2.0 * s.stiff, 0.0), 0.0)
    s.tolerance[:] = np.where(s.stage == ROUGH, rough, np.fmax(manner.coarse / s.spring, manner.least))
    return search


@np.errstate(all="ignore")
def cycles(manner, cells, rtol, asked):
    """Limit cycles of many cells by Newton's method on v1, each cell at its own stage.

    `asked` says which of the outputs must be right. The result is outputs and relative errors, a row for each output,
    and statuses: NOT_CONVERGED where half swings come to rest or the bracket closes on nothing.
    """
    n, tangents = len(rtol), asked[_SENSITIVITY] or asked[_MULTIPLIER]
    terms, status = begun(manner, cells, rtol)
    outputs, errors = np.full((len(asked), n), np.nan), np.full((len(asked), n), np.inf)
    follows = np.array([not tangents, True, False, tangents, True])[:, None]  # the others by (4)
    (going,) = np.nonzero(status == Status.OK)
    status[going] = Status.NOT_CONVERGED
    search, going = _begun_search(manner, cells, terms, rtol, going), np.arange(len(going))
    for _ in range(LIMIT):
        if not len(going):
            break
        if manner.steps:  # lanes wait for their slowest
            s = Search(*search[:-_FOUND])
            going = going[np.argsort(((s.tolerance**-0.2 + s.stiff) * (1.0 + np.sqrt(s.kappa)))[going])]
        search = search.take(going, axis=1)
        s, (former, raw, hangs) = Search(*search[:-_FOUND]), search[-_FOUND:].reshape(3, len(asked), -1)
        i, now, used, stage = s.index.astype(int), s.v, s.tolerance, s.stage

        # the half swings; Newton's step of each, and the cycle by it
        rows, verdict = manner.follow(s, (s.linear > 0.0) & ((stage < ROUGH) | (not tangents)))
        by = Found(*rows[: -len(asked)], rows[-len(asked) :])
        many, gap, onward = verdict == Status.STEP_LIMIT, 1.0 - by.slope, by.change / by.end
        free, step = np.isfinite(onward + by.slope) & ~many, np.abs(onward)

        # outputs go along with v1: by (4), or as they did since the half swing before, if its tolerance was less
        moved = now / s.before - 1.0
        secant = (by.outputs / raw - 1.0) / moved
        hangs[:] = np.where(follows & (np.abs(moved) > s.used) & np.isfinite(secant), secant, hangs)
        raw[:] = by.outputs
        by = by._replace(outputs=raw * (1.0 + hangs * onward))

        # the error (7), where the last two are done; the end where that will do or nothing helps
        waves = s.linear * s.harmonic * 0.5 * (1.0 + by.A) if manner.bare and not tangents else 0.0
        ended, done = many, free & (stage == FINE)
        if done.any():
            stated = _stated(manner.rounding, s, by, former, step, hangs, used * (1.0 + waves))
            outputs[:, i[done]], errors[:, i[done]] = by.outputs[:, done], stated[:, done]
            status[i[done]] = verdict[done]
            enough = stated[asked].max(axis=0) <= s.rtol
            ended = many | (done & (enough | (verdict >= FIRST_REFUSAL) | (s.again >= AGAIN) | (used <= manner.least)))
            s.share[done] *= manner.tighter
            s.again[done] += 1.0

        # or where it sticks, as slower swings, that of the cycle too, come to rest before; where the torque varies, a
        # faster one may at its turning point, so that only rest at the switch is for good. Or where steps are too many
        noise = np.where(s.linear > 0.0, _NOISE_BARE, _NOISE) * used * now
        slower = now - by.end > noise
        helped = (by.helped > 0.5) & np.where(s.depth > 0.0, by.end <= 0.0, slower)
        refused = helped | (many & (s.again < 1.0))
        status[i[refused]] = verdict[refused]
        s.stuck[:] = np.where(free, 0.0, s.stuck + 1.0)
        lost = (s.stuck > STUCK) | ((stage == SEARCH) & (s.high - s.low <= manner.coarse * now))

        # the next speed: Newton's, or where that leaves the bracket one that narrows it
        s.low[:] = np.where(~free | (by.end - now > noise), now, s.low)
        s.high[:] = np.where(free & slower, now, s.high)
        new = now + by.change
        inside = free & (new > s.low) & (new < s.high) & (new < 8.0 * now + 8.0)
        between = np.where(s.high < np.inf, 0.5 * (s.low + s.high), 2.0 * now + 1.0)
        former[:], s.before[:], s.used[:] = by.outputs, now, used
        s.v[:] = np.where(inside, new, between)

        # the next stage, where a step is so small that its square does not count there; its tolerance, at last (6)
        s.spring[:] = _spring(s, s.v)
        wanted = _wanted(manner, s, gap, by.Y, waves)
        rough = manner.finer * wanted
        near = np.fmax(rough, np.fmin(0.003 * np.sqrt(s.rtol * gap), manner.coarse))
        coarse = np.fmin(np.fmax(np.where(gap > 0.0, 0.03 * gap, 0.03), rough), manner.coarse)
        close = np.where(stage == SEARCH, 0.08, np.where(stage == NEAR, 2.0 * np.sqrt(near), np.sqrt(0.1 * s.rtol)))
        s.stage[:] = np.where(inside & (stage < FINE) & (step < close), stage + 1.0, np.fmin(stage, ROUGH))
        loose, tight = np.where(s.stage == SEARCH, coarse, near) / s.spring, np.where(s.stage == ROUGH, rough, wanted)
        s.tolerance[:] = np.fmax(np.where(s.stage < ROUGH, loose, tight), manner.least)
        (going,) = np.nonzero(~(ended | lost | helped))
    return outputs, errors, status


def method_by(manner, parameters, sooner=None):
    """The method of a kernel with these parameters, with depth and harmonic among them where the torque varies.

    sooner : (cells, rtol) -> those in which `auto` tries it ahead of the method declared before it
    """
    n = len(parameters)

    def solve(*columns):
        asked = columns[n + 1] > 0
        outputs, errors, status = cycles(manner, cells_of(columns), columns[n], asked)
        for column, found in zip(columns[n + 2 :], (*outputs, errors[asked].max(axis=0), status), strict=True):
            column[...] = found

    def bound(*columns):
        columns[-1][...] = np.where(begun(manner, cells_of(columns), columns[n])[1], np.inf, 0.0)

    def cells_of(columns):
        none = np.zeros(len(columns[n]))
        return Cell(**({"depth": none, "harmonic": none} | dict(zip(parameters, columns, strict=False))))

    names = [*parameters, "rtol", "asked"]
    return Method(
        manner.name,
        manner.doc,
        signed(solve, [*names, *Outputs._fields, "error", "status"]),
        signed(bound, [*names, "out"]),
        estimates=True,
        sooner=sooner and (lambda *columns: sooner(cells_of(columns), columns[n])),
    )
