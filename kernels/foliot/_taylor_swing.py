"""The general foliot's limit cycle by Taylor series: half swings followed as a scene of one's own, and Newton's method.

The half swing of `_half_swing`, equation (1) there, is a scene of `_swing_scenes`, with a kink at the turning point.
The series, the proof that no event is passed over, and the core of abs(v)^n are those of `kernels.codegen`. At that
point the tangents' speeds should jump by J of (3). That they do not is made good for at the end: what is wanting is a
multiple of the tangent along the motion itself, (v, v'), with the factor
    beta = (J - 1) v_mu/v'  at the turning point,                                                        (1)
which is what dry friction's change of sign shifts the time by. The cycle then follows by (4) of `_integrated_swing`.

The error is told by two last half swings, as in `followed_twice`: the finer one has a tolerance FINER times smaller,
and the other's parameters are some roundings off.
"""

import numpy as np

from kernels.codegen.followed_twice import FINER, off_by_roundings
from kernels.foliot import _units
from kernels.foliot._half_swing import Half
from kernels.foliot._integrated_swing import cycle_by, first_of, slope_of
from kernels.foliot._swing_law import Law, Leg, Swing, accelerations, problem_of, pull
from kernels.foliot._swing_scenes import LINEAR, RIPPLE, RIPPLED, SEARCHED, SMOOTH, TERMS, Swung, half_swings
from kernels.foliot._units import Foliot, Outputs
from kernels.interface import FIRST_REFUSAL, Field, Method, Status
from kernels.lanes.codes import OK, STICKS
from kernels.lanes.jit import jit
from kernels.lanes.vectors import not_, where
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
SEARCH, NEAR, ROUGH, FINE = 0, 1, 2, 3
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
_LEAST = 1e-17
"""Of tolerances: finer ones change nothing but the time that they take."""
_TOLD, _TOLD_STEEP, _TOLD_ROUGH = 4.0, 16.0, 32.0
"""Error that is stated over what the two last half swings differ by, of which the finer one's should be a fifteenth;
where the torque varies, on which the sensitivity hangs steeply; and where the drag is of a degree below 2: cores of
abs(v)^n have a low order."""
_ROUNDING = 2e-14
"""Of a half swing's speed and time; a cycle's are off by 1/(1 - multiplier) as much."""


@jit
def _problem(p, depth, harmonic):
    """The cell's terms; friction of any degree as it is, down to rest."""
    scene, units = _units.without_dimensions(p)
    return problem_of(scene, (depth, harmonic), 0.0 * p.e), units


@jit
def _half(problem, swung):
    """The half swing with (1) made good for, as the integration of `_half_swing` has it."""
    terms, e = problem.terms, problem.e
    force = pull(swung.top, terms)
    turns = e > 0.0
    behind = problem.dry.inwards + force
    jump = where(turns, behind / (problem.dry.outwards + force), 1.0)
    leg = Leg(0.0 * e - 1.0, problem.dry.inwards, 0.0 * e, problem.stiffness, 0.0 * e, 0.0 * e)
    shift = (1.0 - jump) / behind
    by_mu, by_start = shift * swung.up_mu, shift * swung.up_start
    bare = Swing(swung.x, swung.v, swung.x_mu, swung.v_mu, swung.x_start, swung.v_start, swung.decay)
    rate = accelerations(bare, Law(leg, terms))[0]
    x_mu, v_mu = swung.x_mu + by_mu * swung.v, swung.v_mu + by_mu * rate
    x_start, v_start = swung.x_start + by_start * swung.v, swung.v_start + by_start * rate
    state = Swing(swung.x, swung.v, x_mu, v_mu, x_start, v_start, swung.decay)
    never = e > 2.0
    return Half(-swung.v, state, leg, swung.top, 0.0 * e, swung.time, jump * exp(-swung.decay), never, never)


@jit
def begin(p, rtol):
    """Terms of `_half_swing`, the speed that Newton's method begins with, and the stiffness."""
    problem, _ = _problem(_units.terms(p), p.depth, p.harmonic)
    dry, terms = problem.dry, problem.terms
    friction = terms.drag, dry.outwards, dry.inwards, terms.power.gamma, terms.power.n
    return (*friction, terms.kappa, first_of(problem)[0].v, problem.stiffness * problem.pace), OK


@jit
def step(p, rtol):
    """Newton's step from v1, the speed before the half swing, to F; and the cycle by it."""
    problem, units = _problem(_units.terms(p), p.depth, p.harmonic)
    swung = Swung(p.time, p.x, p.v, p.x_mu, p.v_mu, p.x_start, p.v_start, p.decay, p.top, p.up_mu, p.up_start)
    half = _half(problem, swung)
    slope = slope_of(problem.e, p.v1, half)
    change = (half.end - p.v1) / (1.0 - slope)
    cycle, cancels = cycle_by(problem, half, p.v1 + change, change, slope)
    held = (problem.e >= 0.0) & not_(1.0 + pull(half.top, problem.terms) > problem.rho_s)
    (period, amplitude, speed, s, multiplier), status = _units.given(units, cycle, where(held, STICKS, OK))
    return (half.end, change, slope, cancels, period, amplitude, speed, s, multiplier), status


def _columns(function, parameters, outputs):
    """The function as one of columns: (*parameters, rtol, *outputs, status)."""
    names = [tuple(Field(name, "1", "") for name in some) for some in (parameters, outputs)]
    made = kernel(
        f"foliot_swing_{function.__name__}", doc="", source="", parameters=names[0], outputs=names[1], check=_anything,
        methods=(method(function.__name__, "", function),),
    )  # fmt: skip
    return made.methods[0].solve


@jit
def _anything(p):
    return OK + 0.0 * p.mu


_CELL = (*Foliot._fields, "depth", "harmonic")
_E, _DECAY, _SENSITIVITY = Foliot._fields.index("e"), Swung._fields.index("decay"), Outputs._fields.index("sensitivity")
"""Positions of columns."""
_BEGUN = (*TERMS, "v1", "stiff")
_begin = _columns(begin, _CELL, _BEGUN)
_step = _columns(step, (*_CELL, "v1", *Swung._fields), ("end", "change", "slope", "cancels", *Outputs._fields))


def by_taylor(parameters, rippled):
    """The method of a kernel with these parameters, the last two of which, if `rippled`, are depth and harmonic."""
    n = len(parameters)

    def solve(*columns):
        cells, rtol, asked = whole(columns), columns[n], columns[n + 1]
        if len(rtol):
            outputs, errors, status = Search(cells, rtol, rippled, asked > 0).cycles()
            for column, found in zip(columns[n + 2 :], (*outputs, errors[asked > 0].max(axis=0), status), strict=True):
                column[...] = found

    def bound(*columns):
        if len(columns[n]):
            terms, _, stiff = begun(whole(columns), columns[n])
            columns[-1][...] = np.where(able(terms, stiff, columns[_E]), 0.0, np.inf)

    def whole(columns):
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
    """Terms, first speeds and stiffness of cells."""
    found = np.empty((len(_BEGUN), len(rtol)))
    _begin(*cells, rtol, *found, np.empty(len(rtol), np.int8))
    return list(found[:-2]), found[-2], found[-1]


def able(terms, stiff, e):
    """Where the method is worth while.

    Not where steps are short for stability, nor where the drag is steep at rest; nor where a hairspring holds what
    creeps inwards, overdamped, before it comes to the switch.
    """
    drag, _, inwards, gamma, degree, kappa = terms[:6]
    with np.errstate(over="ignore"):  # an infinite square compares as the square itself would
        held = (kappa > inwards) & (drag * drag >= 4.0 * kappa) & (e >= 0.0)
    return (stiff < _STIFFEST) & ((degree >= _MILDEST) | ~(gamma > 0.0)) & ~held


class Search:
    """Newton's method on v1 for many cells, each at its own stage.

    Parameters
    ----------
    cells : columns of a `Foliot`, depth and harmonic
    rtol : column
    asked : which of the outputs must be right; without the sensitivity no tangents are followed where none are needed
    """

    def __init__(self, cells, rtol, rippled, asked):
        n = len(rtol)
        self.cells, self.rtol, self.asked, self.general = cells, rtol, asked, RIPPLED if rippled else SMOOTH
        terms, self.v, stiff = begun(cells, rtol)
        self.terms = dict(zip((*TERMS, *RIPPLE), (*terms, cells[-2], cells[-1] * (0.5 * np.pi)), strict=True))
        self.low, self.high, self.stuck = np.full(n, -1.0), np.full(n, np.inf), np.zeros(n, int)
        self.stage, self.tolerance = np.full(n, SEARCH), np.full(n, _COARSE)
        self.outputs = np.full((len(Outputs._fields), n), np.nan)
        self.errors = np.full_like(self.outputs, np.inf)
        possible = able(terms, stiff, cells[_E])
        self.status = np.where(possible, Status.NOT_CONVERGED, Status.NO_METHOD).astype(np.int8)
        dragged = self.terms["gamma"] > 0.0
        rough = dragged & (self.terms["degree"] < 2.0)
        self.linear, self.tangents = ~dragged & rippled, asked[_SENSITIVITY]
        self.told = np.where(rough, _TOLD_ROUGH, np.where(self.linear, _TOLD_STEEP, _TOLD))
        self.share = np.where(rough | self.linear, _SHARE_ROUGH, _SHARE)
        self.again = np.zeros(n, bool)

    def cycles(self):
        """Outputs, their relative errors, and statuses."""
        active = np.flatnonzero(self.status == Status.NOT_CONVERGED)
        with np.errstate(all="ignore"):
            for _ in range(LIMIT):
                if not len(active):
                    break
                active = active[self._advance(active)]
        return self.outputs, self.errors, self.status

    def _advance(self, i):
        """One half swing of the cells i; which of them go on."""
        swung = self._swung(i)
        newton, found = np.empty((4, len(i))), np.empty((len(Outputs._fields), len(i)))
        status = np.empty(len(i), np.int8)
        cells = [column[i] for column in self.cells]
        _step(*cells, self.v[i], *swung[:-1], self.rtol[i], *newton, *found, status)
        free = (swung[-1] < FIRST_REFUSAL) & np.isfinite(newton[:3]).all(axis=0) & (newton[0] > 0.0)
        self.stuck[i] = np.where(free, 0, self.stuck[i] + 1)
        closed = self.high[i] - self.low[i] <= _COARSE * self.v[i]
        lost = (self.stuck[i] > STUCK) | ((self.stage[i] == SEARCH) & closed)
        done = self._judged(i, free, newton, swung[_DECAY], found, status) | lost
        self._follow(i, free, newton, swung)
        return ~done

    def _swung(self, i):
        """The half swings of the cells i, as rows of `Swung`, and their statuses; rough ones from other roundings."""
        stage, linear = self.stage[i], self.linear[i]
        bare = linear & ((stage < ROUGH) | (not self.tangents))
        kind = 2 * np.where(bare, 1, np.where(linear, 2, 0)) + (stage == ROUGH)
        kinds = np.flatnonzero(np.bincount(kind))
        if len(kinds) == 1:
            return self._followed(*divmod(kinds[0], 2), i)
        found = np.empty((len(Swung._fields) + 1, len(i)))
        for k in kinds:
            those = np.flatnonzero(kind == k)
            found[:, those] = self._followed(*divmod(k, 2), i[those])
        return found

    def _followed(self, number, rough, i):
        """The half swings of the cells i in one of the forms; rough ones with parameters some roundings off."""
        form = (self.general, SEARCHED, LINEAR)[number]
        columns = [*(self.terms[name][i] for name in form.terms), self.cells[_E][i] * self.v[i], np.ones(len(i))]
        return half_swings(form, off_by_roundings(columns) if rough else columns, self.tolerance[i])

    def _judged(self, i, free, newton, decay, found, status):
        """Which cells are done: those whose two last half swings agree, or are as fine as can be."""
        fine = np.flatnonzero(free & (self.stage[i] == FINE))
        cells, last = i[fine], np.zeros(len(i), bool)
        errors = self._told(cells, newton[:, fine], decay[fine], found[:, fine])
        self.outputs[:, i[free]], self.errors[:, i], self.errors[:, cells] = found[:, free], np.inf, errors
        good = errors[self.asked].max(axis=0) <= self.rtol[cells]
        last[fine] = good | self.again[cells] | (self.tolerance[cells] <= _LEAST)
        self.status[i[last]] = status[last]
        again = cells[~last[fine]]
        self.share[again], self.again[again] = _TIGHTER * self.share[again], True
        return last

    def _told(self, i, newton, decay, found):
        """The error of each output of the cells i, by how far the last half swing is from the one before."""
        end, change, slope, cancels = newton
        apart = np.abs(found / self.outputs[:, i] - 1.0)
        floor = np.tile((_ROUNDING + self.tolerance[i]) / (1.0 - slope), (len(found), 1))
        floor[3] *= 1.0 + cancels
        floor[4] *= 1.0 + np.where(decay < 750.0, decay, 0.0)
        return self.told[i] * apart + 2.0 * np.abs(change / end) + floor

    def _follow(self, i, free, newton, swung):
        """Speed, stage and tolerance of the next half swing."""
        v, (end, change, slope, _) = self.v[i], newton
        noise = np.where(self.linear[i], _NOISE_BARE, _NOISE) * self.tolerance[i] * v
        self.low[i] = np.where(~free | (end - v > noise), v, self.low[i])
        self.high[i] = np.where(free & (v - end > noise), v, self.high[i])
        low, high, new = self.low[i], self.high[i], v + change
        inside = free & (new > low) & (new < high) & (new < 8.0 * v + 8.0)
        between = np.where(high < np.inf, 0.5 * (np.maximum(low, 0.0) + high), 2.0 * v + 1.0)
        self.v[i] = np.where(inside, new, between)
        self._set(i, inside, np.abs(change / end), slope, swung[_DECAY])

    def _set(self, i, inside, relative, slope, decay):
        """The stage that follows, and its tolerance: an error of F counts 1/(1 - slope)-fold in v1.

        Where the search is cheap it goes on until what Newton's method leaves is below what is wanted.
        """
        stage, rtol, gap, linear = self.stage[i], self.rtol[i], 1.0 - slope, self.linear[i]
        wanted = np.maximum(self.share[i] * rtol * gap / (1.0 + np.where(decay < 750.0, decay, 0.0)), _LEAST)
        near = np.clip(0.01 * np.sqrt(rtol * gap), FINER * wanted, _COARSE)
        converged = relative < np.sqrt(near)
        if linear.any():
            left = relative * relative
            near = np.where(linear, np.clip(0.01 * left, np.minimum(4.0 * wanted, _CALM), _COARSE), near)
            converged = np.where(linear, (left < wanted) & (self.tolerance[i] <= FINER * wanted), converged)
        close = inside & np.where(stage == SEARCH, relative < _CLOSE, converged)
        checked = inside & (stage == ROUGH) & (relative < _CHECKED)
        onward = np.where(close & (stage < ROUGH), stage + 1, stage)
        self.stage[i] = stage = np.where(stage == FINE, ROUGH, np.where(checked, FINE, onward))
        self.tolerance[i] = np.choose(stage, [np.full(len(i), _COARSE), near, FINER * wanted, wanted])
