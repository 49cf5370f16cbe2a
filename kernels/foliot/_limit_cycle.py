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
that follows the square of its step. ROUGH and FINE: two half swings with tolerances some times apart, whose difference
tells the error. Where the torque varies, outputs may depend on the speed a thousandfold, and a change of speed can hide
the effect of the tolerance: LAST, which starts at the speed that the fine one gives and has its tolerance, shows how
much that is. Where the error is too large, they are followed once more at a tighter tolerance.
"""

from collections import namedtuple

import numpy as np

from kernels.foliot._half_swing import problem_of, pull
from kernels.foliot._units import Foliot, Outputs, given, without_dimensions
from kernels.interface import FIRST_REFUSAL, Field, Method, Status
from kernels.lanes.codes import OK, STICKS
from kernels.lanes.columns import in_lanes
from kernels.lanes.jit import jit
from kernels.lanes.vectors import fma, magnitude, not_, where
from kernels.lanes.wiring import kernel, method, signed

LIMIT, STUCK, AGAIN = 60, 6, 5
"""Half swings of a cell; of them those that come to rest on their way in, one after the other, where none is helped;
and how often a tighter tolerance is tried."""
SEARCH, NEAR, ROUGH, FINE, LAST = 0, 1, 2, 3, 4
"""What a cell's next half swing is for."""
_CLOSE, _CHECKED = 0.05, 0.01
"""The relative step below which the search ends, and the one below which a rough swing has a twin."""
_NOISE, _NOISE_BARE = 100.0, 3000.0
"""Tolerances within which the sign of F - v may be wrong; where no tangents make steps shorter."""
_CALM = 1e-6
"""Tolerance at which a half swing is right enough for Newton's method to converge, whatever is wanted."""
_ROUNDING = 2e-14
"""Of a half swing's speed and time."""
_SENSITIVITY, _MULTIPLIER = map(Outputs._fields.index, ("sensitivity", "multiplier"))

Cell = namedtuple("Cell", (*Foliot._fields, "depth", "harmonic"))
"""Columns of cells."""
Terms = namedtuple("Terms", "drag outwards inwards gamma degree kappa rough pace stiff")
"""Of a cell: terms of `Problem`, and the stiffness f'(V)/V."""
Found = namedtuple("Found", "end change slope cancels Y A helped outputs")
"""By a half swing: F, Newton's step from the speed before it, dF/dv1; how many times larger than s the terms are that
it is the sum of; Y, the turning point A, and whether it was helped; the outputs of the cycle by it."""
Manner = namedtuple("Manner", "name doc follow begins bare steps coarse orderly least finer shares told steep tighter")
"""A way to follow half swings.

name, doc : of the method
follow : (cells, terms, v1, tolerance, rtol, rough, bare) -> rows of `Found` and of outputs; statuses. `rough`: cells to
    be followed with parameters some roundings off; `bare`: those whose tangents are not needed
begins : (cells, terms) -> statuses: OK where the method is worth while, else why it is not
bare : whether less is followed where torque varies and neither drag nor the sensitivity need tangents
steps : whether it goes by steps of one order. Cells that take about as many go side by side then, and the search is
    left out where friction soon balances the drive: steps are short there in any case
coarse, orderly, least : tolerance of the search; the one below which an error falls as it does; the finest
finer : how many times the fine tolerance the rough one is
shares : of rtol that a half swing may be off by: where friction is smooth at rest, where it is not, and where its
    degree is below 2 or the torque varies, on which time and sensitivity hang steeply
told, steep : what is stated over what rough and fine half swings differ by, in each of these three; and of the
    sensitivity where the torque varies
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
    amplitude = where(e > 0.0, fma(half.top_by_start, e * change, half.top), 1.0)
    cycle = fma(time_by_start, change, half.time), amplitude, v + change, s, e * e * half.shrink
    held = (e >= 0.0) & not_(1.0 + pull(half.top, problem) > problem.rho_s)
    outputs, status = given(units, cycle, where(half.helped | held, STICKS, OK))
    return Found(end, change, slope, cancels, decay, half.top, where(half.helped, 1.0, 0.0), outputs), status


_terms = of_columns(terms_of, Cell._fields, Terms._fields)


def begun(manner, cells, rtol):
    """The `Terms` of cells, and the statuses that they begin with: OK where the method is worth while."""
    terms = Terms(*_terms(*cells, rtol)[0])
    with np.errstate(over="ignore"):  # an infinite square compares as the square itself would
        return terms, manner.begins(cells, terms).astype(np.int8)


def _counted(decay):
    """Y where errors of it count; beyond, the multiplier exp(-Y) is 0 for good."""
    return np.where(decay < 750.0, decay, 0.0)


def _wanted(manner, share, gap, decay, waves):
    """The tolerance of the last half swings; `share` times rtol is given.

    An error of F counts 1/(1 - dF/dv1)-fold in v1, and Y-fold in exp(-Y); without tangents errors of steps add up over
    the waves of the torque. So it is
        share rtol (1 - dF/dv1)/((1 + Y) (1 + waves)).                                               (5)
    """
    wanted = share * gap / (1.0 + _counted(decay)) / (1.0 + waves)
    return np.fmin(np.fmax(wanted, manner.least), manner.orderly)


def _stated(by, former, last, earlier, told, step, moved, tolerance, gap):
    """Relative errors of what half swings give, a row for each output, and their first term.

    Where those before gave outputs with a relative difference `apart`, they are
        told apart + 2 (rate apart + step) + (ROUNDING + tolerance (1 + waves))/(1 - dF/dv1),          (6)
    where `step` is the relative one that Newton's method would still go, and `rate` what it is of the way `moved` that
    v1 went since. The last term is more where the sensitivity cancels, and (1 + Y)-fold of exp(-Y).

    Parameters
    ----------
    by, former : what is found, and the outputs before
    last, earlier : the cells at LAST, whose first term before gets `apart` more
    tolerance, gap : that of the half swings times (1 + waves); 1 - dF/dv1
    """
    ratio = by.outputs / former
    apart = np.where(by.outputs == former, 0.0, np.abs(ratio - 1.0))  # a multiplier may be 0 for good
    first = np.where(last, earlier + apart, told * apart)
    rate = np.where(moved > 0.0, step / moved, 0.0)
    floor = np.tile((_ROUNDING + tolerance) / gap, (len(former), 1))
    floor[_SENSITIVITY] *= 1.0 + by.cancels
    floor[_MULTIPLIER] *= 1.0 + _counted(by.Y)
    return first + 2.0 * (rate * apart + step) + floor, first


def _next(manner, stage, final, checked, inside, step, gap, used, wanted, rtol, linear):
    """The next stage of cells, and its tolerance, at last (5).

    Where the search is cheap (`linear`), it goes on until what Newton's method leaves of its relative `step` is below
    what is wanted. `checked` are those whose rough half swing has a twin; `inside`, whose step stays in the bracket.
    """
    near = np.clip(0.01 * np.sqrt(rtol * gap), manner.finer * wanted, manner.coarse)
    left, converged = step * step, step < np.sqrt(near)
    near = np.where(linear, np.clip(0.01 * left, np.minimum(4.0 * wanted, _CALM), manner.coarse), near)
    converged = np.where(linear, (left < wanted) & (used <= manner.finer * wanted), converged)
    close = inside & np.where(stage == SEARCH, step < _CLOSE, converged)
    onward = checked | (close & (stage < ROUGH))
    stage = np.where(onward, stage + 1, np.minimum(stage, ROUGH))
    rough = manner.finer * wanted
    coarse = np.clip(0.03 * np.where(gap > 0.0, gap, 1.0), np.fmin(rough, manner.coarse), manner.coarse)
    return stage, np.choose(stage, [coarse, near, rough, wanted, wanted])


@np.errstate(all="ignore")
def cycles(manner, cells, rtol, asked):
    """Limit cycles of many cells by Newton's method on v1, each cell at its own stage.

    `asked` says which of the outputs must be right. The result is outputs and relative errors, a row for each output,
    and statuses: NOT_CONVERGED where half swings come to rest or the bracket closes on nothing.
    """
    n = len(rtol)
    terms, status = begun(manner, cells, rtol)
    dragged, varies, tangents = terms.gamma > 0.0, cells.depth > 0.0, asked[_SENSITIVITY]
    linear = ~dragged & varies & manner.bare
    kind = np.where((dragged & (terms.degree < 2.0)) | varies, 2, np.where(terms.rough > 0.5, 1, 0))
    share, told = np.array(manner.shares)[kind], np.tile(np.array(manner.told)[kind], (len(Outputs._fields), 1))
    told[_SENSITIVITY, varies] = manner.steep
    final = np.where(varies, LAST, FINE)
    low, high, stuck, again = np.zeros(n), np.full(n, np.inf), np.zeros(n, int), np.zeros(n, int)
    before, outputs = np.full(n, np.nan), np.full((len(Outputs._fields), n), np.nan)
    errors, by_tolerance = np.full_like(outputs, np.inf), np.full_like(outputs, np.inf)

    i, slow = np.flatnonzero(status == Status.OK), terms.pace > 3.0
    v = np.where(slow, 1.0 / terms.pace, 2.0 / np.sqrt(1.0 + 4.0 * terms.pace * terms.pace))
    slow &= manner.steps
    stage = np.where(slow, ROUGH, SEARCH)
    tolerance = np.where(slow, manner.finer * _wanted(manner, share * rtol, 1.0, 2.0 * terms.stiff, 0.0), manner.coarse)
    status[i] = Status.NOT_CONVERGED
    for _ in range(LIMIT):
        if not len(i):
            break
        if manner.steps:  # lanes wait for their slowest
            i = i[np.argsort((tolerance[i] ** -0.2 + terms.stiff[i]) * (1.0 + np.sqrt(terms.kappa[i])))]

        # the half swings; Newton's step of each, and the cycle by it
        bare, now, used = linear[i] & ((stage[i] < ROUGH) | (not tangents)), v[i], tolerance[i]
        own, of_cells = Cell(*(column[i] for column in cells)), Terms(*(column[i] for column in terms))
        rows, verdict = manner.follow(own, of_cells, now, used, rtol[i], stage[i] == ROUGH, bare)
        by = Found(*rows[: -len(Outputs._fields)], rows[-len(Outputs._fields) :])
        free = np.isfinite([by.end, by.change, by.slope]).all(axis=0) & (verdict != Status.STEP_LIMIT)
        relative, gap = np.abs(by.change / by.end), 1.0 - by.slope
        stuck[i] = np.where(free, 0, stuck[i] + 1)
        lost = (stuck[i] > STUCK) | ((stage[i] == SEARCH) & (high[i] - low[i] <= manner.coarse * now))

        # the error (6), where the last two are done; the end where that will do or nothing helps
        waves = np.where(linear[i] & (not tangents), cells.harmonic[i] * 0.5 * (1.0 + by.A), 0.0)
        loose, moved, twin = used * (1.0 + waves), np.abs(now / before[i] - 1.0), stage[i] == LAST
        stated, by_tolerance[:, i] = _stated(
            by, outputs[:, i], twin, by_tolerance[:, i], told[:, i], relative, moved, loose, gap
        )
        done = free & (stage[i] == final[i])
        outputs[:, i[free]], errors[:, i[done]] = by.outputs[:, free], stated[:, done]
        status[i[done]] = verdict[done]
        over = stated[asked].max(axis=0) / rtol[i]
        last = done & ((over <= 1.0) | (verdict >= FIRST_REFUSAL) | (again[i] >= AGAIN) | (used <= manner.least))
        repeated = done & ~last
        share[i[repeated]] *= manner.tighter
        again[i] += repeated

        # or where it sticks, as slower swings, that of the cycle too, come to rest before; where the torque varies, a
        # faster one may at its turning point, so that only rest at the switch is for good. Or where steps are too many
        noise = np.where(linear[i], _NOISE_BARE, _NOISE) * used * now
        rests = np.where(varies[i], by.end <= 0.0, now - by.end > noise)
        helped, many = (by.helped > 0.5) & rests, verdict == Status.STEP_LIMIT
        first = many & (again[i] == 0)
        status[i[helped | first]] = verdict[helped | first]

        # the next speed: Newton's, or where that leaves the bracket one that narrows it
        low[i] = np.where(~free | (by.end - now > noise), now, low[i])
        high[i] = np.where(free & (now - by.end > noise), now, high[i])
        new = now + by.change
        inside = free & (new > low[i]) & (new < high[i]) & (new < 8.0 * now + 8.0)
        between = np.where(high[i] < np.inf, 0.5 * (low[i] + high[i]), 2.0 * now + 1.0)
        checked = inside & (stage[i] >= ROUGH) & (stage[i] < final[i]) & (relative < _CHECKED)
        before[i], v[i] = now, np.where(inside, new, between)

        wanted = _wanted(manner, share[i] * rtol[i], gap, by.Y, waves)
        stage[i], tolerance[i] = _next(
            manner, stage[i], final[i], checked, inside, relative, gap, used, wanted, rtol[i], linear[i]
        )
        i = i[~(last | lost | helped | many)]
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
