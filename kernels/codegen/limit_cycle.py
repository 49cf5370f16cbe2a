"""Limit cycles of a scene: fixed points of its return map, by Newton's method on columns of cells.

With P(z) the states `flips` switches later and T(z) the time elapsed, a cycle is a root of
    rho = P(z) - z - s = 0,  s whole multiples of the states' turns (a phase that advances by 2 pi),         (1)
and its multipliers are the eigenvalues of J = dP/dz on the surface; rho and J are in units of the states' sizes, and J
is computed by central differences of runs to a tolerance. (Tangents as additional states would not cover slides and
powers of abs(u), and would double the compile time and triple the run time, for the same digits.)
Newton's method begins at the motion's state after some switches. If it finds nothing, or an unstable cycle, it begins
again after more of them. A cycle found at another value of a parameter is continued to the cell's value along the
branch's tangent (I - J)^-1 dP/dp, in steps of its own, so that it does not depend on other cells.
"""

import math
from collections import namedtuple

import numpy as np

from kernels.codegen.columns_algebra import eigenvalues, identity, largest, most, solved
from kernels.codegen.followed import put
from kernels.codegen.return_map import TIGHT, clocked, rating
from kernels.codegen.to_tolerance import solver
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
FADED = 2.0
"""Of the states' sizes in a cycle, those of the motion that it was found from: beyond, it is found to its own ones."""
TWO = 10.0
"""Errors of a cycle by which its halves must differ: where it is one, Newton's steps may still be a third of that."""
ASTRAY = 1e-3
"""Of the way to the root, a residual where runs are not right at the root, as they are not at rest."""
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
EARLIEST, TIMES, STILL = 1e-6, 22, 1e-12
"""Seconds after the start, then four times as many, so often, at which a motion is looked at that meets no switch any
more: where its states move by less than STILL of their sizes to the last of them to which it can be followed, it is at
rest."""


class Cycles(namedtuple("Cycles", "parameters flips r z scale shift off rows slopes multiplier status")):
    """Columns of cells, and what is known of their cycles.

    Parameters
    ----------
    parameters, flips, r : of the scene; switches a cycle; tolerance of the runs
    z, scale, shift : states at the end of the cycle, or of the rest; their sizes in it; what they go on by in turns
    off, rows : the residual over the size; T and P
    slopes, multiplier : roughly, those of T and P by the states that the map depends on, then by the branch's
        parameter; and of them the multiplier of largest modulus
    status : what has been found
    """

    def some(self, cells):
        """A copy of those cells."""
        return Cycles(*(column.take(cells, axis=-1) for column in self))


def jacobian(the_map, cycles, h, levels, swept=()):
    """Central slopes of T and P at z (1 + n, moves, levels, cells), sums of both sides, and where all runs are right.

    Moves are the states that the map depends on, by h of their scale, then the parameters that are swept, by h of
    themselves, at several levels times that; slopes are by these units, and P is in units of scale.
    """
    at, first, count = the_map.directions, len(cycles.parameters), len(cycles.r)
    moves, signs = [*(first + j for j in at), *swept], (1.0, -1.0)
    origin, by = (np.concatenate([cycles.parameters, x]) for x in (cycles.z, cycles.scale))
    places = np.tile(origin[:, None, None, None], (len(moves), len(levels), 2, 1))
    for k, move in enumerate(moves):
        places[move, k] += np.multiply.outer(np.multiply.outer(levels, signs), h * by[move])
    places, many = places.reshape(len(origin), -1), len(moves) * len(levels) * 2
    flips, r = np.tile(cycles.flips, many), np.tile(cycles.r, many)
    found, status, _ = the_map.passed(places[:first], places[first:], flips, r)
    pairs = found[[0, *(1 + j for j in at)]].reshape(1 + len(at), len(moves), len(levels), 2, count)
    pairs[1:] = pairs[1:] / cycles.scale[at][:, None, None, None]
    slopes = (pairs[:, :, :, 0] - pairs[:, :, :, 1]) / (2.0 * h * np.array(levels)[:, None])
    for k, j in enumerate(at):
        if j in the_map.modes:  # one that no switch of the cycle sets is no direction, as a parameter is none
            slopes[1 + k, k] = np.where(abs(slopes[1 + k, k] - 1.0) <= NEAR, 0.0, slopes[1 + k, k])
    return slopes, np.add.reduce(pairs, axis=3), (status == Status.OK).reshape(many, count).all(axis=0)


def settling(slopes, moved):
    """(I - J)^-1 of what has been moved, (n, m, cells): by how much the cycle moves."""
    n = len(slopes) - 1
    return solved(identity(n, slopes.shape[-1]) - slopes[1:, :n], moved)


def to_root(cycles):
    """How far cycles may be from what closes exactly, of their sizes: by (I - J)^-1 times their residual."""
    inverse = settling(cycles.slopes, identity(len(cycles.slopes) - 1, len(cycles.r)))
    return cycles.off * most(np.add.reduce(abs(inverse), axis=1))


def newton(the_map, cycles, swept=()):
    """The cycles where (1) is closed best, from their states, with the sizes and turns that they have.

    Differences are taken anew until the residual is small and falls quickly, and then kept. Where runs are not right,
    later ones are looser.
    """
    at, held, count = the_map.directions, the_map.held, len(cycles.r)
    best, left = cycles.some(np.arange(count)), np.arange(count)
    best.off[:], best.rows[:], best.slopes[:] = math.inf, math.nan, math.nan
    steady, astray, before, z = np.zeros(count, bool), np.zeros(count, bool), best.off.copy(), best.z.copy()
    for _ in range(ROUNDS):
        if not len(left):
            break
        some = best.some(left)._replace(z=z[:, left])
        some.scale[:] = np.maximum(some.scale, abs(some.z))  # what is barely damped may grow far beyond its start
        r = np.where(before[left] > FAR, np.maximum(some.r, the_map.rough), some.r)
        some.rows[:], status, _ = the_map.passed(some.parameters, some.z, some.flips, r)
        right, anew = status == Status.OK, np.flatnonzero(~steady[left])
        slopes, _, well = jacobian(the_map, some._replace(r=r).some(anew), STEP, (1.0,), swept)
        some.slopes[:, :, anew], right[anew] = slopes[:, :, 0], right[anew] & well
        rho = ((some.rows[1:] - some.z - some.shift) / some.scale)[at]
        some.off[:] = np.where(right, np.maximum(most(abs(rho)), CLOSED * r), math.inf)
        step = settling(some.slopes, rho[:, None])[:, 0]
        far = most(abs(step))
        put(best, left, some, some.off < best.off[left])
        lost = ~((some.off < math.inf) & (far < math.inf))
        astray[left[lost]], best.r[left[lost]] = True, np.minimum(WIDER * some.r[lost], LOOSE)
        vague = (some.off <= CLOSED * r) & (far > FAR)  # closed as well as runs tell, it may be a cycle at any size
        onward = some.z[at] + some.scale[at] * np.where(vague, 0.0, step) / np.maximum(1.0, far)
        z[np.ix_(at, left)] = np.where(lost, 0.5 * (some.z + best.z[:, left])[at], onward)
        steady[left] = (some.off <= FAR) & (some.off <= QUICK * before[left])
        settled = (some.off <= CLOSED * best.r[left]) | ((some.off <= 1e-9) & (some.off > 0.5 * before[left]))
        before[left], astray[left[settled]], left = some.off, False, left[~settled]
    best.off[astray] = np.fmax(best.off, ASTRAY * to_root(best))[astray]
    best.z[held] = np.where(best.off < math.inf, best.rows[[1 + j for j in held]], best.z[held])
    return best._replace(multiplier=largest(*eigenvalues(best.slopes[1:, : len(at)])[:2]))


class Search:
    """The search for the cycles of cells, and what it finds; a cell's numbers depend on that cell alone.

    Parameters
    ----------
    the_map : `ReturnMap`
    turns : dict from the number of a state to what it goes on by in a turn
    parameters, flips, r : columns of cells, as in `Cycles`
    settle : cycles followed first, a column; 0: only to the first switch that ends one, and never again
    branch : None, or the number of a parameter and a column of its values, at which the search is to begin
    """

    def __init__(self, the_map, turns, parameters, flips, r, settle, branch=None):
        n, states, count = len(the_map.directions), len(the_map.directions) + len(the_map.held), len(r)
        self.map, self.turns, self.swept = the_map, turns, [branch[0]] if branch else []
        shapes = (states,), (states,), (states,), (), (1 + states,), (1 + n, n + len(self.swept)), ()
        unknown, status = (np.full((*s, count), np.nan) for s in shapes), np.full(count, Status.NOT_CONVERGED, np.int8)
        self.cycles, self.last = Cycles(parameters, flips, r, *unknown, status), np.full((states, count), np.nan)
        self.fades = np.zeros(count, bool)
        if branch:
            ends, parameters[branch[0]] = parameters[branch[0]].copy(), branch[1]
        self._from_later_and_later(settle)
        # where iterates alternate about a cycle, or come to none, that of twice as many switches
        alternate = (status == Status.UNSTABLE) & (self.cycles.multiplier < -1.0)
        twice = np.flatnonzero((alternate | ((status == Status.NOT_CONVERGED) & ~self.fades)) & (settle > 0))
        self.cycles.flips[twice] *= 2.0
        self._settled(twice, doubled=True)
        self.cycles.flips[twice[status[twice] != Status.PERIOD_2]] *= 0.5
        if not the_map.driven:
            self._at_equilibrium(np.flatnonzero(~np.isin(status, (*FOUND, Status.COMES_TO_REST))))
            self._at_rest(np.flatnonzero((status >= FIRST_REFUSAL) & (status != Status.NOT_CONVERGED)))
        if branch:
            self._continued(branch[1], ends)

    def _from_later_and_later(self, settle):
        """Newton's method from where motions are after some cycles, and where that is not enough, after more."""
        status, left = self.cycles.status, np.arange(len(settle))
        for later in LATER:
            z, verdict = self._from_start(left, np.maximum(settle[left] * later, 1.0))
            ended = verdict > Status.INACCURATE
            over = ended & ~np.isin(status[left], FOUND)
            status[left[over]] = verdict[over]
            for j, turn in self.turns.items():  # runs are right to a share of what they come to
                z[j] = z[j] - turn * np.round(z[j] / turn)
            self.last[:, left[~ended]] = z[:, ~ended]
            self._settled(left[~ended])
            over = ended | (settle[left] == 0.0) | (status[left] == Status.OK)
            left = left[~over]
            if not len(left):
                break

    def _from_start(self, left, cycles):
        """States so many cycles after the start, and statuses."""
        some = self.cycles.some(left)
        rough = np.full(len(left), self.map.rough)
        rows, status, _ = self.map.passed(some.parameters, None, some.flips * cycles, rough)
        return rows[1:], status

    def _newton(self, some):
        """From the states of these cells: cycles; how far they are from rest, of their sizes, NaN where there is none;
        and how far from their halves."""
        rough = np.full(len(some.r), self.map.rough)
        (T, *P), _, sizes = self.map.passed(some.parameters, some.z, some.flips, rough)
        P = np.array(P)
        some.scale[:] = np.where(sizes > 0.0, sizes, np.where(abs(P) > 0.0, abs(P), 1.0))
        some.shift[:] = 0.0
        for j, turn in self.turns.items():
            gone = P[j] - some.z[j]
            some.shift[j] = turn * np.where(gone < math.inf, np.round(gone / turn), 0.0)
            some.scale[j] = np.minimum(some.scale[j], turn)
        some = newton(self.map, some, self.swept)
        half = np.maximum(np.floor(0.5 * some.flips), 1.0)
        (time, *middle), _, sizes = self.map.passed(some.parameters, some.z, half, rough)
        apart, by_half = (most(abs(middle - some.z - share * some.shift) / some.scale) for share in (0.0, 0.5))
        alike = (half == some.flips) | self.map.driven | (not self.map.directions)
        moved = np.where(alike, np.where(time > NEAR * T, 1.0, 0.0), np.minimum(apart, 1.0))
        sizes = np.where(sizes > 0.0, sizes, some.scale)
        small = np.flatnonzero((moved > NEAR) & (some.scale > FADED * sizes).any(axis=0))
        own = some.some(small)
        own.scale[:] = np.minimum(own.scale, sizes[:, small])
        put(some, small, newton(self.map, own, self.swept))
        return some, np.where(abs(some.multiplier) < math.inf, moved, np.nan), by_half

    def _settled(self, left, doubled=False):
        """Takes what Newton's method makes of where motions are, if that is a cycle; or how small swings fade."""
        if not len(left):
            return
        before = self.cycles.status[left]
        some, moved, by_half = self._newton(self.cycles.some(left)._replace(z=self.last[:, left]))
        size = abs(some.multiplier)
        good, stable = (moved > NEAR) & (some.off <= NEAR * moved), size <= 1.0
        if doubled:  # not where half of so many switches close the cycle, as well as it is known
            apart = by_half > np.maximum(NEAR, TWO * to_root(some))
            some.status[:], good = Status.PERIOD_2, good & stable & apart
        else:
            some.status[:] = np.where(stable, Status.OK, Status.UNSTABLE)
            good &= stable | ~np.isin(before, FOUND)
        put(self.cycles, left, some, good)
        self.fades[left] = (moved <= NEAR) & (some.off <= NEAR) & (size < 1.0)

    def _at_equilibrium(self, left):
        """COMES_TO_REST where a motion ended closer to an equilibrium, at which it stays, than it was after a cycle.

        There the rates are 0, by Newton's method, with differences in proportion to the motion, not to what is left.
        """
        if not len(left):
            return
        first, last = self._from_start(left, 1.0)[0], self.last[:, left]
        parameters, rates = self.cycles.parameters[:, left], rating(self.map.own)
        h = STEP * np.maximum(most(np.fmax(abs(first), abs(last))), 1e-150)
        n, moves = len(last), np.multiply.outer(np.eye(len(last)), h)
        for side in (1.0, -1.0):
            z = last
            for _ in range(ROUNDS):
                sides = ([rates(parameters, z + s * by, side) for by in moves] for s in (1.0, -1.0))
                J, found = np.subtract(*sides).swapaxes(0, 1) / (2.0 * h), rates(parameters, z, side)
                J[range(n), range(n)] -= (J == 0.0).all(axis=1) & (found == 0.0)  # what no rate changes stays
                step = solved(J, found[:, None])[:, 0]
                z = z - step
            far, near = (most(abs(x - z)) for x in (first, last))
            known = self.fades[left] | (eigenvalues(J)[0] < 0.0).all(axis=0)
            known &= most(abs(step)) <= RESTS * (far + most(abs(z)))
            self._rest(left, z, known & (near <= 0.5 * far))

    def _rest(self, left, z, rests):
        self.cycles.z[:, left[rests]], self.cycles.status[left[rests]] = z[:, rests], Status.COMES_TO_REST

    def _at_rest(self, left):
        """Where a motion stays that meets no switch any more: its states have moved, and at ever later times do not.

        What sticks need not have moved. A creeping motion is still at first too, but has not moved before that.
        """
        if not len(left):
            return
        times, count = EARLIEST * 4.0 ** np.arange(TIMES), len(left)
        columns = *self.cycles.parameters[:, left], np.full(count, times[-1]), np.full(count, float(TIMES))
        followed = solver(clocked(self.map.own), self.map.method, sure=False)
        rows, status, _ = followed(columns, np.full(count, TIGHT * self.map.fine), times)
        ended = status > Status.INACCURATE
        z = np.where(ended, np.nan, rows[2 : 2 + len(self.last)])
        still = (abs(np.diff(z, axis=1)) <= STILL * np.maximum.accumulate(abs(z), axis=1)[:, 1:]).all(axis=0)
        moved = (self.cycles.status[left] == Status.STICKS) | ~(still | ended[1:]).all(axis=0)
        last = np.maximum((~ended).sum(axis=0), 2)[None] - 1
        rests = moved & np.take_along_axis(still, last - 1, axis=0)[0]
        self._rest(left, np.take_along_axis(z, last[None], axis=1)[:, 0], rests)

    def _tangent(self, cycles, way):
        """By how much states change over the whole way of the parameter; NaN where that is 0."""
        moved = settling(cycles.slopes, cycles.slopes[1:, -1:])[:, 0]
        return cycles.scale[self.map.directions] * moved * way / cycles.parameters[self.swept[0]]

    def _continued(self, begin, ends):
        """Follows cycles at the values `begin` of the branch's parameter to those at the values `ends`."""
        at, cycles, status, way = self.map.directions, self.cycles, self.cycles.status, ends - begin
        reached, step, going = np.zeros(len(ends)), np.full(len(ends), FIRST_STEP), np.isin(status, FOUND) & (way != 0)
        status[(way != 0) & (status == Status.COMES_TO_REST)] = Status.NO_CYCLE
        stable = np.where(status == Status.PERIOD_2, status, Status.OK)
        for _ in range(MOST_STEPS):
            left = np.flatnonzero(going)
            if not len(left):
                return
            old, new, by = cycles.some(left), cycles.some(left), np.minimum(step[left], 1.0 - reached[left])
            tangent, last = self._tangent(old, way[left]), reached[left] + by >= 1.0
            new.parameters[self.swept[0]] = np.where(last, ends[left], begin[left] + (reached[left] + by) * way[left])
            new.z[at] += by * np.where(np.isnan(tangent), 0.0, tangent)
            guess = new.z
            new, moved, _ = self._newton(new)
            chord, off = ((new.z - z) / new.scale for z in (old.z, guess))
            tangents = tangent, self._tangent(new, way[left])
            bent = np.fmax(*(most(np.nan_to_num(abs(chord[at] - by * t / new.scale[at]))) for t in tangents))
            near = (most(abs(off)) <= STRAIGHT) & (bent <= np.maximum(BENT * most(abs(chord[at])), FLAT))
            near &= (moved > NEAR) & (new.off <= NEAR * moved)
            new.status[:] = np.where(abs(new.multiplier) <= 1.0, stable[left], Status.UNSTABLE)
            put(cycles, left, new, near)
            reached[left[near]] += by[near]
            step[left] = np.where(near, 2.0 * step[left], 0.25 * by)
            lost = left[~near & (by <= LEAST_STEP)]
            met = abs(cycles.multiplier[lost] - 1.0) <= VANISHES
            status[lost] = np.where(met, Status.NO_CYCLE, Status.NOT_CONVERGED)
            going[left[near & last]] = going[lost] = False
        status[going] = Status.NOT_CONVERGED
