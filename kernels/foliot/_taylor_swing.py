"""The general foliot's limit cycle by Taylor series: half swings followed as a scene of one's own, and Newton's method.

The half swing of `_half_swing`, equation (1) there, is a scene of `_swing_scenes`, with a kink at the turning point.
The series, the proof that no event is passed over, and the core of abs(v)^n are those of `kernels.codegen`. At that
point the tangents' speeds should jump by J of (3). That they do not is made good for at the end: what is wanting is a
multiple of the tangent along the motion itself, (v, v'), with the factor
    beta = (J - 1) v_mu/v'  at the turning point,                                                        (1)
which is what dry friction's change of sign shifts the time by. The cycle then follows by (4) of `_integrated_swing`.

Each cell goes through four stages on its own. SEARCH: Newton's method within a bracket, at a coarse tolerance. NEAR: at
one that follows the square of its step. ROUGH and FINE: two half swings, whose difference tells the error. The rough
one has a tolerance FINER times larger than the fine one, and parameters some roundings off, as in `to_tolerance`. Where
the torque varies, outputs may depend on the speed a thousandfold, and a change of speed can hide the effect of the
tolerance: LAST, which starts at the speed that the fine one gives and has its tolerance, shows how much that is. Where
the error is too large, they are followed once more at a tighter tolerance.
"""

import numpy as np

from kernels.codegen.followed import off_by_roundings
from kernels.codegen.to_tolerance import FINER
from kernels.foliot import _units
from kernels.foliot._half_swing import Half, inwards, problem_of, pull, rates
from kernels.foliot._integrated_swing import cycle_by, first_speed, held, newton
from kernels.foliot._swing_scenes import LINEAR, RIPPLE, RIPPLED, SEARCHED, SMOOTH, TERMS, Swung, half_swings
from kernels.foliot._units import Foliot, Outputs
from kernels.interface import FIRST_REFUSAL, Field, Method, Status
from kernels.lanes.codes import OK, STICKS
from kernels.lanes.jit import jit
from kernels.lanes.vectors import where
from kernels.lanes.wiring import kernel, method, signed
from kernels.maths.elementary import exp

LIMIT = 40
"""Half swings of a cell."""
STUCK = 6
"""Of them, those that come to rest on their way in, one after the other."""
_STIFFEST = 100.0
"""Larger f'(V)/V makes steps that are stable too short."""
_MILDEST = 1.0
"""Degree of drag below which its slope has a pole at rest, which series come close to slowly."""
SEARCH, NEAR, ROUGH, FINE, LAST = 0, 1, 2, 3, 4
"""What a cell's next half swing is for."""
_COARSE, _CLOSE, _CHECKED = 1e-4, 0.05, 0.01
"""Tolerance of the search, the relative step below which it ends, and the one below which a rough swing has a twin."""
_NOISE, _NOISE_BARE = 100.0, 3000.0
"""Tolerances within which the sign of F - v may be wrong; where no tangents make steps shorter."""
_CALM = 1e-6
"""Tolerance at which a half swing is right enough for Newton's method to converge, whatever is wanted."""
_SHARE, _SHARE_ROUGH, _TIGHTER = 0.1, 0.01, 0.01
"""Of rtol that a half swing may be off by; where the drag is of a degree below 2 or the torque varies, on which time
and sensitivity hang steeply; how much less where it did not do."""
AGAIN = 3
"""How often that is tried."""
_LEAST = 1e-17
"""Of tolerances: finer ones change nothing but the time that they take."""
_TOLD, _TOLD_ROUGH, _TOLD_STEEP = 4.0, 32.0, 128.0
"""Error that is stated over what rough and fine half swings differ by, of which the fine one's should be a fifteenth;
where the torque varies, or the drag is of a degree below 2: cores of abs(v)^n have a low order; and of the sensitivity
where the torque varies, on which it depends steeply. Besides, an output is off by what the last one's Newton step would
still change, at the rate at which it changed from the speed before."""
_ROUNDING = 2e-14
"""Of a half swing's speed and time; a cycle's are off by 1/(1 - multiplier) as much."""


@jit
def _problem(p):
    """The cell's terms, friction of any degree as it is down to rest; and its units."""
    scene, units = _units.without_dimensions(p)
    return problem_of(scene, (p.depth, p.harmonic), 0.0 * p.e), units


@jit
def begin(p, rtol):
    """Terms of `_half_swing`, the speed that Newton's method begins with, and the stiffness."""
    problem, _ = _problem(p)
    first, _ = first_speed(problem.pace)
    friction = problem.d, problem.outwards, problem.inwards, problem.gamma, problem.n
    return (*friction, problem.kappa, first, problem.stiffness * problem.pace), OK


@jit
def step(p, rtol):
    """Newton's step from v1, the speed before the half swing, to F, with (1) made good for; and the cycle by it."""
    problem, units = _problem(p)
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
        units, cycle, where(held(problem, half.top), STICKS, OK)
    )
    return (half.end, change, slope, cancels, period, amplitude, speed, s, multiplier), status


def _columns(function, parameters, outputs):
    """The function as one of columns: (*parameters, rtol, *outputs, status)."""
    names = [tuple(Field(name, "1", "") for name in some) for some in (parameters, outputs)]
    made = kernel(
        f"foliot_swing_{function.__name__}", doc="", source="", parameters=names[0], outputs=names[1],
        methods=(method(function.__name__, "", function),),
    )  # fmt: skip
    return made.methods[0].solve


_CELL = (*Foliot._fields, "depth", "harmonic")
_E, _SENSITIVITY = Foliot._fields.index("e"), Outputs._fields.index("sensitivity")
_DECAY, _TOP = Swung._fields.index("decay"), Swung._fields.index("top")
"""Positions of columns."""
_BEGUN = (*TERMS, "v1", "stiff")
_begin = _columns(begin, _CELL, _BEGUN)
_step = _columns(step, (*_CELL, "v1", *Swung._fields), ("end", "change", "slope", "cancels", *Outputs._fields))


def by_taylor(parameters, rippled):
    """The method of a kernel with these parameters, the last two of which, if `rippled`, are depth and harmonic."""
    n = len(parameters)

    def solve(*columns):
        rtol, asked = columns[n], columns[n + 1]
        if len(rtol):
            outputs, errors, status = cycles(cells_of(columns), rtol, rippled, asked > 0)
            for column, found in zip(columns[n + 2 :], (*outputs, errors[asked > 0].max(axis=0), status), strict=True):
                column[...] = found

    def bound(*columns):
        if len(columns[n]):
            columns[-1][...] = np.where(begun(cells_of(columns), columns[n])[2], 0.0, np.inf)

    def cells_of(columns):
        return columns[:n] if rippled else (*columns[:n], np.zeros(len(columns[n])), np.ones(len(columns[n])))

    names = [*parameters, "rtol", "asked"]
    return Method(
        "taylor",
        "Taylor series over half swings, each followed twice, and Newton on their map",
        signed(solve, [*names, *Outputs._fields, "error", "status"]),
        signed(bound, [*names, "out"]),
        estimates=True,
    )


def begun(cells, rtol):
    """Terms and first speeds of cells, and where the method is worth while.

    Not where steps are short for stability, nor where the drag is steep at rest; nor where a hairspring holds what
    creeps inwards, overdamped, before it comes to the switch.
    """
    found = np.empty((len(_BEGUN), len(rtol)))
    _begin(*cells, rtol, *found, np.empty(len(rtol), np.int8))
    terms, (drag, _, inwards, gamma, degree, kappa, v, stiff) = dict(zip(TERMS, found, strict=False)), found
    with np.errstate(over="ignore"):  # an infinite square compares as the square itself would
        creeps = (kappa > inwards) & (drag * drag >= 4.0 * kappa) & (cells[_E] >= 0.0)
    return terms, v, (stiff < _STIFFEST) & ((degree >= _MILDEST) | ~(gamma > 0.0)) & ~creeps


@np.errstate(all="ignore")
def cycles(cells, rtol, rippled, asked):
    """Limit cycles of many cells by Newton's method on v1, each cell at its own stage.

    Parameters
    ----------
    cells : columns of a `Foliot`, depth and harmonic
    rtol : column
    rippled : whether torque varies; without drag then the search follows no tangents, which make steps shorter
    asked : which of the outputs must be right; without the sensitivity no tangents are followed where none are needed

    Returns
    -------
    outputs, errors : (outputs, cells), errors relative
    status : NOT_CONVERGED where half swings come to rest or the bracket closes on nothing
    """
    n = len(rtol)
    terms, v, possible = begun(cells, rtol)
    terms |= dict(zip(RIPPLE, (cells[-2], cells[-1] * (0.5 * np.pi)), strict=True))
    dragged = terms["gamma"] > 0.0
    rough, linear = dragged & (terms["degree"] < 2.0), ~dragged & rippled
    varies = cells[-2] > 0.0
    told = np.tile(np.where(rough | varies, _TOLD_ROUGH, _TOLD), (len(Outputs._fields), 1))
    told[_SENSITIVITY, varies] = _TOLD_STEEP
    share = np.where(rough | varies, _SHARE_ROUGH, _SHARE)
    forms = RIPPLED if rippled else SMOOTH, SEARCHED, LINEAR
    low, high, stuck, again = np.full(n, -1.0), np.full(n, np.inf), np.zeros(n, int), np.zeros(n, int)
    stage, tolerance, before = np.full(n, SEARCH), np.full(n, _COARSE), np.full(n, np.nan)
    final = np.where(varies, LAST, FINE)
    outputs, errors = np.full((len(Outputs._fields), n), np.nan), np.full((len(Outputs._fields), n), np.inf)
    by_tolerance = errors.copy()
    status = np.where(possible, Status.NOT_CONVERGED, Status.NO_METHOD).astype(np.int8)
    i = np.flatnonzero(possible)
    for _ in range(LIMIT):
        if not len(i):
            break

        # the half swings, each in the form that its cell needs; rough ones from parameters some roundings off
        swung = np.empty((len(Swung._fields) + 1, len(i)))
        bare = linear[i] & ((stage[i] < ROUGH) | (not asked[_SENSITIVITY]))
        kind = 2 * np.where(bare, 1, np.where(linear[i], 2, 0)) + (stage[i] == ROUGH)
        for k in np.flatnonzero(np.bincount(kind)):
            of_kind = np.flatnonzero(kind == k)
            form, j = forms[k // 2], i[of_kind]
            columns = [*(terms[name][j] for name in form.terms), cells[_E][j] * v[j], np.ones(len(j))]
            swung[:, of_kind] = half_swings(form, off_by_roundings(columns) if k % 2 else columns, tolerance[j])

        # Newton's step of each, and the cycle by it
        step_of, found, verdict = np.empty((4, len(i))), np.empty((len(outputs), len(i))), np.empty(len(i), np.int8)
        _step(*(column[i] for column in cells), v[i], *swung[:-1], rtol[i], *step_of, *found, verdict)
        end, change, slope, cancels = step_of
        free = (swung[-1] < FIRST_REFUSAL) & np.isfinite(step_of[:3]).all(axis=0) & (end > 0.0)
        relative, gap, decay = np.abs(change / end), 1.0 - slope, np.where(swung[_DECAY] < 750.0, swung[_DECAY], 0.0)
        stuck[i] = np.where(free, 0, stuck[i] + 1)
        lost = (stuck[i] > STUCK) | ((stage[i] == SEARCH) & (high[i] - low[i] <= _COARSE * v[i]))

        # the error by how far fine ones are from rough ones, and by the speed; done where that will do or nothing helps
        moved = np.abs(v[i] / before[i] - 1.0)
        apart = np.abs(found / outputs[:, i] - 1.0)
        rate = np.divide(
            relative, moved, out=np.zeros_like(moved), where=moved > 0.0
        )  # 0 of a speed that has not moved
        by_tolerance[:, i] = np.where(stage[i] == LAST, by_tolerance[:, i] + apart, told[:, i] * apart)
        # without tangents the errors of steps add up over the waves
        waves = np.where(linear[i] & (not asked[_SENSITIVITY]), terms["wave"][i] / np.pi * (1.0 + swung[_TOP]), 0.0)
        floor = np.tile((_ROUNDING + tolerance[i] * (1.0 + waves)) / gap, (len(found), 1))
        floor[3] *= 1.0 + cancels
        floor[4] *= 1.0 + decay
        ended, stated = free & (stage[i] == final[i]), by_tolerance[:, i] + 2.0 * (rate * apart + relative) + floor
        outputs[:, i[free]], errors[:, i] = found[:, free], np.where(ended, stated, np.inf)
        right = errors[:, i][asked].max(axis=0) <= rtol[i]
        last = ended & (right | (again[i] >= AGAIN) | (tolerance[i] <= _LEAST))
        status[i[last]] = verdict[last]
        repeated = i[ended & ~last]
        share[repeated], again[repeated] = _TIGHTER * share[repeated], again[repeated] + 1

        # the next speed: Newton's, or where that leaves the bracket one that narrows it
        now = before[i] = v[i]
        noise = np.where(linear[i], _NOISE_BARE, _NOISE) * tolerance[i] * now
        low[i] = np.where(~free | (end - now > noise), now, low[i])
        high[i] = np.where(free & (now - end > noise), now, high[i])
        new = now + change
        inside = free & (new > low[i]) & (new < high[i]) & (new < 8.0 * now + 8.0)
        between = np.where(high[i] < np.inf, 0.5 * (np.maximum(low[i], 0.0) + high[i]), 2.0 * now + 1.0)
        checked = inside & (stage[i] >= ROUGH) & (stage[i] < final[i]) & (relative < _CHECKED)
        v[i] = np.where(inside, new, between)

        # the next stage and its tolerance: an error of F counts 1/(1 - slope)-fold in v1. Where the search is cheap,
        # it goes on until what Newton's method leaves is below what is wanted
        wanted = np.fmax(share[i] * rtol[i] * gap / (1.0 + decay) / (1.0 + waves), _LEAST)
        near = np.clip(0.01 * np.sqrt(rtol[i] * gap), FINER * wanted, _COARSE)
        converged = relative < np.sqrt(near)
        left = relative * relative
        near = np.where(linear[i], np.clip(0.01 * left, np.minimum(4.0 * wanted, _CALM), _COARSE), near)
        converged = np.where(linear[i], (left < wanted) & (tolerance[i] <= FINER * wanted), converged)
        close = inside & np.where(stage[i] == SEARCH, relative < _CLOSE, converged)
        onward = checked | (close & (stage[i] < ROUGH))
        stage[i] = np.where(onward, stage[i] + 1, np.minimum(stage[i], ROUGH))
        tolerance[i] = np.choose(stage[i], [np.full(len(i), _COARSE), near, FINER * wanted, wanted, wanted])
        i = i[~(last | lost)]
    return outputs, errors, status
