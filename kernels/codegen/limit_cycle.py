"""Limit cycles of a scene: fixed points of its return map, by Newton's method on columns of cells.

With P(z) the states `flips` switches later and T(z) the time that takes, a cycle is a root of
    rho = P(z) - z - s = 0,  s whole numbers of the states' own turns (a phase that goes on by 2 pi),         (1)
and its multipliers are the eigenvalues of J = dP/dz on the surface; rho and J are in units of the states' sizes, and J
is made of central differences of runs to a tolerance.
Newton's method begins where the motion from the start is after some switches. Where it finds nothing, or a cycle that
is not stable, it begins again after more of them. A cycle found at another value of a parameter is followed to the
cell's own along the branch's tangent (I - J)^-1 dP/dp, in steps of its own, so that it hangs on no other cell.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np

from kernels.codegen.columns_algebra import eigenvalues, identity, largest, most, solved
from kernels.interface import FIRST_REFUSAL, Status

LOOSE, WIDER = 1e-7, 4.0
"""The widest tolerance of runs, and by how much a cell's are looser where they are not right to the one before."""
STEP = 1e-5
"""Of a state's size, that of Newton's differences."""
ROUNDS = 14
CLOSED = 4.0
"""Tolerances of the runs within which a cycle is closed."""
FAR, QUICK = 1e-4, 0.1
"""Residual over the size, up to which, and over the one before, Newton's method keeps its differences."""
NEAR = 1e-6
"""Of the states' sizes: within this a cycle is one, and what does not move by more over it is no cycle but at rest."""
LATER = 1, 8, 64
"""How many times as many cycles are followed before Newton's method begins again."""
FOUND = Status.OK, Status.UNSTABLE, Status.PERIOD_2
"""Statuses of what has a cycle."""
FIRST_STEP, LEAST_STEP, MOST_STEPS = 1.0 / 64.0, 1e-6, 400
"""Of the way from one value of a parameter to another, the first step that is tried and the last; and their number."""
STRAIGHT, BENT, FLAT = 0.05, 0.5, 1e-5
"""A cycle is of the same branch where it is as near to where the last one's tangent points to, of the states' sizes,
and both tangents lead from one to the other but for BENT of the way between, or for FLAT of the sizes."""
VANISHES = 0.1
"""From 1, a multiplier of the last cycle of a branch that ends because it meets another one."""
RESTS = 1e-11
"""Of the way to an equilibrium, to what it is known."""
EARLIEST, TIMES, STILL, LASTS = 1e-6, 22, 1e-12, 3
"""Seconds after the start, then four times as many, so often, at which a motion is looked at that meets no switch any
more: where its states move by less than STILL of their sizes, so many times or to where it cannot be followed, it is at
rest."""


class Cells(NamedTuple):
    """Columns of cells of which a cycle is wanted: parameters, switches a cycle, tolerance of the runs."""

    parameters: np.ndarray
    flips: np.ndarray
    r: np.ndarray


class Cycle(NamedTuple):
    """Columns of cycles: states; their sizes and turns; the residual over the size; rows T and P; roughly, slopes of T
    and P by the states that the map depends on, then by the branch's parameter, and the multiplier of largest modulus.
    """

    z: np.ndarray
    scale: np.ndarray
    shift: np.ndarray
    off: np.ndarray
    rows: np.ndarray
    slopes: np.ndarray
    multiplier: np.ndarray


def taken(columns, cells):
    """Those cells' part of `Cells` or of a `Cycle`."""
    return type(columns)(*(part[..., cells] for part in columns))


def differences(the_map, cells, z, scale, h, levels, parameters):
    """Rows T and P at z; central slopes of T and P (1 + n, moves, levels, cells); whether all of that is right.

    Moves are the states that the map depends on, by h of their scale, then the parameters numbered, by h of
    themselves; slopes are by these units, those of P in units of scale. Without levels there are none.
    """
    at, count, first = the_map.directions, len(cells.r), len(cells.parameters)
    origin, by = (np.concatenate([cells.parameters, x]) for x in (z, scale))
    moves, places = [*(first + j for j in at), *parameters], [origin]
    for move, level, sign in itertools.product(moves, levels, (1.0, -1.0)):
        places.append(origin.copy())
        places[-1][move] += sign * level * (h * by[move])
    whole, many = np.concatenate(places, axis=1), len(places)
    found, status = the_map.passed(whole[:first], whole[first:], np.tile(cells.flips, many), np.tile(cells.r, many))
    found, right = found.reshape(-1, many, count), (status == Status.OK).reshape(many, count).all(axis=0)
    pairs = found[[0, *(1 + j for j in at)], 1:].reshape(1 + len(at), len(moves), len(levels), 2, count)
    slopes = (pairs[:, :, :, 0] - pairs[:, :, :, 1]) / (2.0 * h * np.array(levels)[:, None])
    slopes[1:] = slopes[1:] / scale[at][:, None, None]
    for move, j in enumerate(at):
        if j in the_map.modes:  # one that no switch of the cycle sets is no direction, as a parameter is none
            kept = abs(slopes[1 + move, move] - 1.0) <= NEAR
            slopes[1 + move, move] = np.where(kept, 0.0, slopes[1 + move, move])
    return found[:, 0], slopes, right


def newton(the_map, cells, cycle, parameters=()):
    """The cycle where (1) is closed best, from the states of this one, whose sizes and turns it keeps.

    Differences are taken anew until the residual is small and falls quickly, and then kept. Where runs are not right,
    later ones are looser: `cells.r` is changed.
    """
    at, n, count = the_map.directions, len(the_map.directions), len(cells.r)
    off, steady, left, z = np.full(count, math.inf), np.zeros(count, bool), np.arange(count), cycle.z.copy()
    slopes, rows = np.full((1 + n, n + len(parameters), count), np.nan), np.full((1 + len(z), count), np.nan)
    best, before = z.copy(), off.copy()
    for _ in range(ROUNDS):
        some, scale, D = taken(cells, left), cycle.scale[:, left], slopes[:, :, left]
        some.r[:] = np.where(before[left] > FAR, np.maximum(some.r, the_map.rough), some.r)
        found, right = np.empty((1 + len(z), len(left))), np.empty(len(left), bool)
        for those, levels in ((np.flatnonzero(steady[left]), ()), (np.flatnonzero(~steady[left]), (1.0,))):
            if len(those):
                found[:, those], new, right[those] = differences(
                    the_map, taken(some, those), z[:, left[those]], scale[:, those], STEP, levels, parameters
                )
                if levels:
                    D[:, :, those] = new[:, :, 0]
        rho = ((found[1:] - z[:, left] - cycle.shift[:, left]) / scale)[at]
        now = np.where(right, np.maximum(most(abs(rho)), CLOSED * some.r), math.inf)
        step = settling(D, rho[:, None])[:, 0]
        far = most(abs(step))
        step = scale[at] * step / np.maximum(1.0, far)
        better = now < off[left]
        improved = left[better]
        best[:, improved], off[improved] = z[:, improved], now[better]
        rows[:, improved], slopes[:, :, improved] = found[:, better], D[:, :, better]
        lost = ~(now < math.inf) | ~(far < math.inf)
        cells.r[left[lost]] = np.minimum(WIDER * cells.r[left[lost]], LOOSE)
        z[np.ix_(at, left)] = np.where(lost, 0.5 * (z + best)[np.ix_(at, left)], z[np.ix_(at, left)] + step)
        steady[left] = (now <= FAR) & (now <= QUICK * before[left])
        settled = (now <= CLOSED * cells.r[left]) | ((now <= 1e-9) & (now > 0.5 * before[left]))
        before[left], left = now, left[~settled]
        if not len(left):
            break
    best[the_map.held] = np.where(off < math.inf, rows[[1 + j for j in the_map.held]], best[the_map.held])
    multiplier = largest(*eigenvalues(slopes[1:, :n])[:2])
    return cycle._replace(z=best, off=off, rows=rows, slopes=slopes, multiplier=multiplier)


def settling(slopes, moved):
    """(I - J)^-1 of what has been moved, (n, m, cells): by how much the cycle moves."""
    n = len(slopes) - 1
    return solved(identity(n, slopes.shape[-1]) - slopes[1:, :n], moved)


def equilibrium(the_map, parameters, z, side, size):
    """From states z: where the rates are 0, by Newton's method; and how far off, infinite where motions go from it.

    `size` : of the motion, not of what is left of it, to which the differences are in proportion
    """
    n, h = len(z), STEP * np.maximum(size, 1e-150)
    for _ in range(ROUNDS):
        J = np.empty((n, n, z.shape[1]))
        for j in range(n):
            up, down = z.copy(), z.copy()
            up[j], down[j] = z[j] + h, z[j] - h
            J[:, j] = (the_map.rates(parameters, up, side) - the_map.rates(parameters, down, side)) / (2.0 * h)
        step = solved(J, the_map.rates(parameters, z, side)[:, None])[:, 0]
        z = z - step
    return z, np.where((eigenvalues(J)[0] < 0.0).all(axis=0), most(abs(step)), math.inf)


class Search:
    """The search for the cycles of cells, and what it finds; a cell's numbers depend on that cell alone.

    Parameters
    ----------
    the_map : `ReturnMap`
    turns : dict from the number of a state to what it goes on by in a turn
    cells : Cells
    settle : cycles followed first, a column; 0: only to the first switch that ends one, and never again
    branch : None, or the number of a parameter and a column of its values, at which the search is to begin
    """

    def __init__(self, the_map, turns, cells, settle, branch=None):
        self.map, self.turns, self.cells, self.swept = the_map, turns, cells, [branch[0]] if branch else []
        n, states, count = len(the_map.directions), len(the_map.directions) + len(the_map.held), len(settle)
        shapes = (states,), (states,), (states,), (), (1 + states,), (1 + n, n + len(self.swept)), ()
        self.cycle, self.last = Cycle(*(np.full((*s, count), np.nan) for s in shapes)), np.full((states, count), np.nan)
        self.status = np.full(count, Status.NOT_CONVERGED, np.int8)
        if branch:
            ends, cells.parameters[branch[0]] = cells.parameters[branch[0]].copy(), branch[1]
        left = np.arange(count)
        for later in LATER:
            z, status = self._from_start(left, np.maximum(settle[left] * later, 1.0))
            ended = status > Status.INACCURATE
            over = ended & ~np.isin(self.status[left], FOUND)
            self.status[left[over]] = status[over]
            left = left[~ended]
            self.last[:, left] = z[:, ~ended]
            self._settled(left)
            left = left[(settle[left] > 0) & ~np.isin(self.status[left], (Status.OK, Status.COMES_TO_REST))]
            if not len(left):
                break
        self._doubled(np.flatnonzero((self.status == Status.UNSTABLE) & (self.cycle.multiplier < -1.0) & (settle > 0)))
        if not self.map.driven:
            self._at_equilibrium(np.flatnonzero(~np.isin(self.status, (*FOUND, Status.COMES_TO_REST))))
            self._at_rest(np.flatnonzero((self.status >= FIRST_REFUSAL) & (self.status != Status.NOT_CONVERGED)))
        if branch:
            self._continued(branch[1], ends)

    def refined(self, left, r):
        """The cycles of these cells again, by runs of the tolerance r."""
        if len(left):
            some = taken(self.cells, left)._replace(r=r)
            self._keep(left, some, newton(self.map, some, taken(self.cycle, left), self.swept), self.status[left])

    def _keep(self, left, some, cycle, status, keep=slice(None)):
        """Keeps what has been found for some of the cells."""
        those = left[keep]
        for whole, part in zip((*self.cycle, *self.cells, self.status), (*cycle, *some, status), strict=True):
            whole[..., those] = part[..., keep]

    def _from_start(self, left, cycles):
        """States so many cycles after the start, and statuses."""
        some, nothing = taken(self.cells, left), np.zeros((len(self.last), len(left)))
        rough = np.full(len(left), self.map.rough)
        rows, status = self.map.passed(some.parameters, nothing, some.flips * cycles, rough, 1.0)
        return rows[1:], status

    def _newton(self, some, z):
        """From z: a cycle; how far it is from rest, of its size, NaN where there is none; and how far from its half."""
        (T, *P), sizes = self.map.once(some.parameters, z, some.flips)
        scale = np.where(sizes > 0.0, sizes, np.where(abs(np.array(P)) > 0.0, abs(np.array(P)), 1.0))
        shift, none = np.zeros(z.shape), np.full(len(T), math.nan)
        for j, turn in self.turns.items():
            shift[j] = turn * np.where(P[j] - z[j] < math.inf, np.round((P[j] - z[j]) / turn), 0.0)
            scale[j] = np.minimum(scale[j], turn)
        cycle = newton(self.map, some, Cycle(z, scale, shift, none, none, none, none), self.swept)
        half = np.maximum(np.floor(0.5 * some.flips), 1.0)
        (time, *middle), _ = self.map.once(some.parameters, cycle.z, half)
        apart, by_half = (most(abs(np.array(middle) - cycle.z - share * shift) / scale) for share in (0.0, 0.5))
        alike = (half == some.flips) | self.map.driven | (not self.map.directions)
        moved = np.where(alike, np.where(time > NEAR * T, 1.0, 0.0), np.minimum(apart, 1.0))
        return cycle, np.where(abs(cycle.multiplier) < math.inf, moved, np.nan), by_half

    def _settled(self, left, doubled=False):
        """Takes what Newton's method makes of where motions are, if that is a cycle, or an equilibrium they come to."""
        if not len(left):
            return
        some = taken(self.cells, left)
        cycle, moved, by_half = self._newton(some, self.last[:, left])
        off, size = cycle.off, abs(cycle.multiplier)
        good, stable = (moved > NEAR) & (off <= NEAR * moved), size <= 1.0
        keep, status = (
            good & (stable | ~np.isin(self.status[left], FOUND)),
            np.where(stable, Status.OK, Status.UNSTABLE),
        )
        if doubled:  # not where half of so many switches close the cycle
            keep, status = good & stable & (by_half > NEAR), np.full(len(left), Status.PERIOD_2)
        self._keep(left, some, cycle, status, keep)
        still = np.flatnonzero((moved <= NEAR) & (off <= NEAR) & (size < 1.0))
        if len(still) and not (doubled or self.map.driven):
            some = taken(some, still)._replace(r=np.full(len(still), self.map.fine))
            cycle = newton(self.map, some, taken(cycle, still), self.swept)
            self._rests(left[still], cycle.z, most(cycle.off * cycle.scale / (1.0 - size[still])))

    def _doubled(self, left):
        """Where iterates alternate about a cycle, that of twice as many switches."""
        self.cells.flips[left] *= 2.0
        self._settled(left, doubled=True)
        self.cells.flips[left[self.status[left] != Status.PERIOD_2]] *= 0.5

    def _at_equilibrium(self, left):
        """Where a motion ended close to a stable equilibrium."""
        if not len(left):
            return
        parameters, last = self.cells.parameters[:, left], self.last[:, left]
        size = most(np.fmax(abs(self._from_start(left, np.ones(len(left)))[0]), abs(last)))
        for side in (1.0, -1.0):
            self._rests(left, *equilibrium(self.map, parameters, last, side, size))

    def _rests(self, left, z, off):
        """COMES_TO_REST at z, where that is known and the motion ended closer to it than a cycle after its start."""
        first, _ = self._from_start(left, np.ones(len(left)))
        far, near = (most(abs(x - z)) for x in (first, self.last[:, left]))
        rests = (near <= 0.5 * far) & (off <= RESTS * (far + most(abs(z))))
        self.cycle.z[:, left[rests]], self.status[left[rests]] = z[:, rests], Status.COMES_TO_REST

    def _at_rest(self, left):
        """Where a motion stays that meets no switch any more: its states have moved, and at ever later times do not.

        What sticks need not have moved. A creeping motion is still at first too, but has not moved before that.
        """
        before, size, seconds = np.full((len(self.last), len(left)), np.nan), 0.0, EARLIEST
        moved, lasted = self.status[left] == Status.STICKS, np.zeros(len(left))
        for _ in range(TIMES):
            if not len(left):
                break
            z, status = self.map.at(self.cells.parameters[:, left], np.full(len(left), seconds))
            ended, size = status > Status.INACCURATE, np.fmax(size, abs(z))
            still = (abs(z - before) <= STILL * size).all(axis=0)
            moved = moved | ~(still | ended | np.isnan(before).any(axis=0))
            lasted, z = np.where(ended, lasted, np.where(still, lasted + 1.0, 0.0)), np.where(ended, before, z)
            rests = moved & ((lasted >= LASTS) | (ended & (lasted > 0.0)))
            self.cycle.z[:, left[rests]], self.status[left[rests]] = z[:, rests], Status.COMES_TO_REST
            on = ~rests & ~ended
            left, before, size, moved, lasted = left[on], z[:, on], size[:, on], moved[on], lasted[on]
            seconds = 4.0 * seconds

    def _tangent(self, some, cycle, way):
        """By how much states change over the whole way of the parameter; NaN where that is 0."""
        moved = settling(cycle.slopes, cycle.slopes[1:, -1:])[:, 0]
        return cycle.scale[self.map.directions] * moved * way / some.parameters[self.swept[0]]

    def _continued(self, begin, ends):
        """Follows cycles at the values `begin` of the branch's parameter to those at the values `ends`."""
        at, way, reached, step = self.map.directions, ends - begin, np.zeros(len(ends)), np.full(len(ends), FIRST_STEP)
        going = np.isin(self.status, FOUND) & (begin != ends)
        self.status[(begin != ends) & (self.status == Status.COMES_TO_REST)] = Status.NO_CYCLE
        stable = np.where(self.status == Status.PERIOD_2, self.status, Status.OK)
        for _ in range(MOST_STEPS):
            left = np.flatnonzero(going)
            if not len(left):
                return
            by, old, some = (
                np.minimum(step[left], 1.0 - reached[left]),
                taken(self.cycle, left),
                taken(self.cells, left),
            )
            tangent, last = self._tangent(some, old, way[left]), reached[left] + by >= 1.0
            some.parameters[self.swept[0]] = np.where(last, ends[left], begin[left] + (reached[left] + by) * way[left])
            guess = old.z.copy()
            guess[at] += by * np.where(np.isnan(tangent), 0.0, tangent)
            cycle, moved, _ = self._newton(some, guess)
            chord, off = ((cycle.z - z) / cycle.scale for z in (old.z, guess))
            tangents = tangent, self._tangent(some, cycle, way[left])
            bent = np.fmax(*(most(np.nan_to_num(abs(chord[at] - by * t / cycle.scale[at]))) for t in tangents))
            near = (most(abs(off)) <= STRAIGHT) & (bent <= np.maximum(BENT * most(abs(chord[at])), FLAT))
            near &= (moved > NEAR) & (cycle.off <= NEAR * moved)
            status = np.where(abs(cycle.multiplier) <= 1.0, stable[left], Status.UNSTABLE)
            self._keep(left, some, cycle, status, near)
            reached[left[near]] += by[near]
            step[left] = np.where(near, 2.0 * step[left], 0.25 * by)
            lost = left[~near & (by <= LEAST_STEP)]
            met = abs(self.cycle.multiplier[lost] - 1.0) <= VANISHES
            self.status[lost] = np.where(met, Status.NO_CYCLE, Status.NOT_CONVERGED)
            going[left[near & last]] = going[lost] = False
        self.status[going] = Status.NOT_CONVERGED
