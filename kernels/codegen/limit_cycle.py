"""Limit cycles of a scene: fixed points of its return map, by Newton's method on columns of cells.

With P(z) the states `flips` switches later and T(z) the time that takes, a cycle is a root of
    rho = P(z) - z - s = 0,  s whole numbers of the states' own turns (a phase that goes on by 2 pi),         (1)
and its multipliers are the eigenvalues of J = dP/dz on the surface. The derivatives are central differences of runs
to a tolerance r, at h, 2 h and 4 h of each state's size and each parameter; the sixth order by Richardson's rule is
given, and what it differs by from the fourth, with the runs' own r/h, is its error. To first order the root is off by
    dz = (I - J)^-1 (rho + r size),  dT = (dT/dz) dz + r T,                                                (2)
and the period changes with a parameter p by dT/dp + (dT/dz) (I - J)^-1 dP/dp.
Newton's method begins where the motion from the start is after some switches. Where it finds nothing, or a cycle that
is not stable, it begins again after more of them. A cycle found at another value of a parameter is followed to the
cell's own along the branch's tangent (I - J)^-1 dP/dp, in steps of its own, so that it hangs on no other cell.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np

from kernels.codegen.columns_algebra import eigenvalues, identity, largest, most, solved, times
from kernels.interface import FIRST_REFUSAL, Status

LOOSE = 1e-7
"""The widest tolerance of runs."""
WIDER = 4.0
"""By how much a cell's runs are looser where they are not right to the tolerance before."""
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
SAFETY = 2.0
SURE = 0.05
"""How far below 1 Newton's own multiplier tells that the cycle is stable."""
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
"""Of the states' sizes, to what an equilibrium is known."""
EARLIEST, TIMES, STILL, LASTS = 1e-6, 22, 1e-12, 3
"""Seconds after the start, then four times as many, so often, at which a motion is looked at that meets no switch any
more: where its states move by less than STILL of their sizes, so many times or to where it cannot be followed, it is at
rest."""


class Columns:
    """Cells of which a cycle is wanted: a row for each of their parameters, their switches a cycle, their rtol."""

    def __init__(self, parameters, flips, rtol):
        self.parameters, self.flips, self.r = np.array(parameters).reshape(len(parameters), len(flips)), flips, rtol

    def __len__(self):
        return len(self.flips)

    def taken(self, cells):
        return Columns(self.parameters[:, cells], self.flips[cells], self.r[cells])


class Cycle(NamedTuple):
    """Columns of cycles: states; their sizes and turns; the residual over the size; rows T and P; slopes of T and P by
    the states that the map depends on (1 + n, n), roughly; the multiplier of largest modulus, as roughly."""

    z: np.ndarray
    scale: np.ndarray
    shift: np.ndarray
    off: np.ndarray
    rows: np.ndarray
    slopes: np.ndarray
    multiplier: np.ndarray


def differences(the_map, cells, z, scale, h, levels, parameters=()):
    """Rows T and P at z; central slopes of T and P (1 + n, moves, levels, cells); whether all of that is right.

    Moves are the states that the map depends on, by h of their scale, then the parameters numbered, by h of
    themselves; derivatives by a parameter are by its logarithm. Without levels there are no slopes.
    """
    moves = [(z, j, h * scale[j]) for j in the_map.directions]
    moves += [(cells.parameters, k, h * cells.parameters[k]) for k in parameters]
    places, settings = [z], [cells.parameters]
    for rows, j, by in moves:
        for level, sign in itertools.product(levels, (1.0, -1.0)):
            moved = rows.copy()
            moved[j] = moved[j] + sign * level * by
            places.append(moved if rows is z else z)
            settings.append(cells.parameters if rows is z else moved)
    many, count = len(places), len(cells)
    found, status = the_map.passed(
        np.concatenate(settings, axis=1), np.concatenate(places, axis=1), np.tile(cells.flips, many),
        np.tile(cells.r, many),
    )  # fmt: skip
    found, fine = found.reshape(-1, many, count), (status == Status.OK).reshape(many, count)
    on = [0, *(1 + j for j in the_map.directions)]
    pairs = found[on, 1:].reshape(len(on), len(moves), len(levels), 2, count)
    over = np.array([[2.0 * level * (by if rows is z else h + 0.0 * by) for level in levels] for rows, _, by in moves])
    with np.errstate(all="ignore"):
        slopes = (pairs[:, :, :, 0] - pairs[:, :, :, 1]) / over.reshape(len(moves), len(levels), count)
    for move, j in enumerate(the_map.directions):
        if j in the_map.modes:  # one that no switch of the cycle sets is no direction, as a parameter is none
            kept = abs(slopes[1 + move, move] - 1.0) <= NEAR
            slopes[1 + move, move] = np.where(kept, 0.0, slopes[1 + move, move])
    return found[:, 0], slopes, fine.all(axis=0)


def newton(the_map, cells, z, scale, shift, parameters=()):
    """Where (1) is closed best: z, the residual there over the size, rows T and P, and slopes (1 + n, moves), roughly.

    Differences are taken anew until the residual is small and falls quickly, and then kept.
    """
    at, n, moves = the_map.directions, len(the_map.directions), len(the_map.directions) + len(parameters)
    best, off, slopes = z.copy(), np.full(len(cells), math.inf), np.full((1 + n, moves, len(cells)), np.nan)
    rows, z, left = np.full((1 + len(z), len(cells)), np.nan), z.copy(), np.arange(len(cells))
    before, steady = off.copy(), np.zeros(len(cells), bool)
    for _ in range(ROUNDS):
        some, here, D = cells.taken(left), z[:, left], slopes[:, :, left]
        some.r = np.where(before[left] > FAR, np.maximum(some.r, the_map.rough), some.r)
        found, right = np.empty((1 + len(z), len(left))), np.empty(len(left), bool)
        for those, levels in ((np.flatnonzero(steady[left]), ()), (np.flatnonzero(~steady[left]), (1.0,))):
            if len(those):
                found[:, those], new, right[those] = differences(
                    the_map, some.taken(those), here[:, those], scale[:, left[those]], STEP, levels, parameters
                )
                if levels:
                    D[:, :, those] = new[:, :, 0]
        rho, size = (found[1:] - here - shift[:, left])[at], scale[at][:, left]
        with np.errstate(all="ignore"):
            now = np.where(right, np.maximum(most(abs(rho) / size), CLOSED * some.r), math.inf)
            step = solved(identity(n, len(left)) - D[1:, :n], rho[:, None])[:, 0]
            far = most(abs(step) / size)
            step = step / np.maximum(1.0, far)
        better = now < off[left]
        improved = left[better]
        best[:, improved], off[improved] = z[:, improved], now[better]
        rows[:, improved], slopes[:, :, improved] = found[:, better], D[:, :, better]
        best[np.ix_(the_map.held, improved)] = found[np.ix_([1 + j for j in the_map.held], better)]
        lost = ~(now < math.inf) | ~(far < math.inf)
        cells.r[left[lost]] = np.minimum(WIDER * cells.r[left[lost]], LOOSE)
        z[np.ix_(at, left)] = np.where(lost, 0.5 * (here + best[:, left])[at], here[at] + step)
        settled = (now <= CLOSED * cells.r[left]) | ((now <= 1e-9) & (now > 0.5 * before[left]))
        steady[left] = (now <= FAR) & (now <= QUICK * before[left])
        before[left] = now
        left = left[~settled]
        if not len(left):
            break
    return best, off, rows, slopes


def closed(the_map, cells, cycle, slopes):
    """{name: values and errors} of period and states by (2), with these slopes; (I - J)^-1; sizes of dT/dz by it."""
    at, n = the_map.directions, len(the_map.directions)
    (T, *P), one = cycle.rows, identity(n, len(cells))
    W = solved(one - slopes[1:, :n], one)
    rho = abs((np.array(P) - cycle.z - cycle.shift)[at]) + cells.r * cycle.scale[at]
    spread = np.zeros(cycle.z.shape)
    spread[at] = SAFETY * times(abs(W), rho[:, None])[:, 0]
    late = times(abs(slopes[:1, :n]), abs(W))[0]
    off = SAFETY * (sum(late[i] * rho[i] for i in range(n)) / T + cells.r)
    return {"period": (T, off), "states": (np.array(P), spread / cycle.scale)}, W, late


def described(the_map, cells, cycle, parameters, h):
    """By differences at h: {name: values and their errors}, of period, states, multipliers and sensitivities."""
    at, n = the_map.directions, len(the_map.directions)
    rows, slopes, right = differences(the_map, cells, cycle.z, cycle.scale, h, (1.0, 2.0, 4.0), parameters)
    with np.errstate(all="ignore"):
        size, noise, T = cycle.scale[at], 1.5 * cells.r / h, rows[0]
        low, lower = ((4.0 * slopes[:, :, k] - slopes[:, :, k + 1]) / 3.0 for k in (0, 1))
        high = (16.0 * low - lower) / 15.0
        found, W, late = closed(the_map, cells, cycle._replace(rows=rows), high)
        J = high[1:, :n]
        signs = [np.array([[(-1.0) ** (i * k + j * (1 - k)) for j in range(n)] for i in range(n)]) for k in (0, 1)]
        felt = np.maximum.reduce(abs(J), axis=1, initial=0.0) > 0.0  # a state that is set to a number has no noise
        noisy = [J + felt[:, None] * noise * s[:, :, None] * size[:, None] / size[None] for s in signs]
        real, imaginary, unsure = eigenvalues(J, low[1:, :n], *noisy)
        multiplier = largest(real, imaginary)
        found["multiplier"] = multiplier, SAFETY * unsure[0] / np.maximum(1.0, abs(multiplier))
        for name, part in (("multipliers_real", real), ("multipliers_imaginary", imaginary)):
            found[name] = part, SAFETY * unsure / np.maximum(1.0, np.sqrt(real * real + imaginary * imaginary))
        for k in range(n, n + len(parameters)):
            best, other = ((D[0, k] + times(D[:1, :n], push(D, k))[0, 0]) / T for D in (high, low))
            pull = abs(times(W, high[1:, k : k + 1])[:, 0])
            share = 1.0 + sum(late[i] * size[i] for i in range(n)) / T
            doubt = noise * share * (1.0 + sum(pull[i] / size[i] for i in range(n)))
            found[parameters[k - n]] = best, SAFETY * (abs(best - other) + doubt) / np.maximum(1.0, abs(best))
    return {name: (value, np.where(right & (error >= 0.0), error, math.inf)) for name, (value, error) in found.items()}


def push(slopes, k):
    """(I - J)^-1 dP/dp, (n, 1, cells), of the parameter whose slopes have the number k."""
    n = len(slopes) - 1
    return solved(identity(n, slopes.shape[-1]) - slopes[1:, :n], slopes[1:, k : k + 1])


def equilibrium(the_map, parameters, z, side):
    """From states z: where the rates are 0, by Newton's method; and whether it is known, and draws motions to it."""
    n = len(z)
    with np.errstate(all="ignore"):
        for _ in range(ROUNDS):
            h, J = STEP * np.maximum(most(abs(z)), 1e-150), np.empty((n, n, z.shape[1]))
            for j in range(n):
                up, down = z.copy(), z.copy()
                up[j], down[j] = z[j] + h, z[j] - h
                J[:, j] = (the_map.rates(parameters, up, side) - the_map.rates(parameters, down, side)) / (2.0 * h)
            step = solved(J, the_map.rates(parameters, z, side)[:, None])[:, 0]
            z = z - step
        known = most(abs(step)) <= RESTS * most(abs(z)) + 1e-140
        return z, known & (eigenvalues(J)[0] < 0.0).all(axis=0)


class Search:
    """The search for the cycles of cells, and what it finds; a cell's numbers depend on that cell alone.

    Parameters
    ----------
    the_map : `ReturnMap`
    turns : dict from the number of a state to what it goes on by in a turn
    cells : Columns
    settle : cycles followed first, a column; 0: only to the first switch that ends one, and never again
    branch : None, or the number of a parameter and a column of its values, at which the search is to begin
    """

    def __init__(self, the_map, turns, cells, settle, branch=None):
        self.map, self.turns, self.cells, self.settle = the_map, turns, cells, settle
        n, states, count = len(the_map.directions), len(the_map.directions) + len(the_map.held), len(cells)
        shapes = (states,), (states,), (states,), (), (1 + states,), (1 + n, n), ()
        self.cycle, self.last = Cycle(*(np.full((*s, count), np.nan) for s in shapes)), np.full((states, count), np.nan)
        self.status = np.full(count, Status.NOT_CONVERGED, np.int8)
        if branch:
            ends, cells.parameters[branch[0]] = cells.parameters[branch[0]].copy(), branch[1]
        left = np.arange(count)
        for later in LATER:
            left = self._tried(left, later)
            left = left[(self.settle[left] > 0) & ~np.isin(self.status[left], (Status.OK, Status.COMES_TO_REST))]
        self._doubled(np.flatnonzero((self.status == Status.UNSTABLE) & (self.cycle.multiplier < -1.0) & (settle > 0)))
        if not self.map.driven:
            self._at_equilibrium(np.flatnonzero(~np.isin(self.status, (*FOUND, Status.COMES_TO_REST))))
            self._at_rest(np.flatnonzero((self.status >= FIRST_REFUSAL) & (self.status != Status.NOT_CONVERGED)))
        if branch:
            self._continued(*branch, ends)

    def taken(self, cells):
        """The cycles of these cells."""
        return Cycle(*(part[..., cells] for part in self.cycle))

    def refined(self, cells, r):
        """The cycles of these cells again, by runs of the tolerance r."""
        some, cycle = self.cells.taken(cells), self.taken(cells)
        some.r = r
        if len(cells):
            z, off, rows, slopes = newton(self.map, some, cycle.z, cycle.scale, cycle.shift)
            self._keep(cells, some, cycle._replace(z=z, off=off, rows=rows, slopes=slopes), self.status[cells])

    def _keep(self, cells, some, cycle, status, keep=slice(None)):
        """Keeps what has been found for some of the cells."""
        those = cells[keep]
        for whole, part in zip(self.cycle, cycle, strict=True):
            whole[..., those] = part[..., keep]
        self.cells.r[those], self.status[those] = some.r[keep], status[keep]

    def _from_start(self, cells, cycles):
        """States so many cycles after the start, and statuses."""
        some = self.cells.taken(cells)
        return self.map.from_start(some.parameters, some.flips * cycles, np.full(len(cells), self.map.rough))

    def _tried(self, left, later):
        """Newton's method for these cells; gives back those whose motion goes on."""
        if not len(left):
            return left
        z, status = self._from_start(left, np.maximum(self.settle[left] * later, 1.0))
        goes_on = status <= Status.INACCURATE
        over = ~goes_on & ~np.isin(self.status[left], FOUND)
        self.status[left[over]] = status[over]
        left, z = left[goes_on], z[:, goes_on]
        self.last[:, left] = z
        self._settled(left, z)
        return left

    def _newton(self, some, z, parameters=()):
        """From z: a cycle; how far it is from rest and from its half; and its slopes by parameters."""
        n, ((T, *P), sizes) = len(self.map.directions), self.map.once(some.parameters, z, some.flips)
        scale = np.where(sizes > 0.0, sizes, np.where(abs(np.array(P)) > 0.0, abs(np.array(P)), 1.0))
        shift = np.zeros(z.shape)
        for j, turn in self.turns.items():
            shift[j] = turn * np.where(P[j] - z[j] < math.inf, np.round((P[j] - z[j]) / turn), 0.0)
            scale[j] = np.minimum(scale[j], turn)
        z, off, rows, slopes = newton(self.map, some, z, scale, shift, parameters)
        multiplier = largest(*eigenvalues(slopes[1:, :n])[:2])
        half = np.maximum(np.floor(0.5 * some.flips), 1.0)
        (time, *middle), _ = self.map.once(some.parameters, z, half)
        apart, by_half = (most(abs(np.array(middle) - z - share * shift) / scale) for share in (0.0, 0.5))
        alike = (half == some.flips) | self.map.driven | (not n)
        moved = np.where(alike, np.where(time > NEAR * T, 1.0, 0.0), np.minimum(apart, 1.0))
        moved = np.where(abs(multiplier) < math.inf, moved, np.nan)
        return Cycle(z, scale, shift, off, rows, slopes[:, :n], multiplier), moved, by_half, slopes

    def _settled(self, left, z, doubled=False):
        """Takes what Newton's method makes of z, where that is a cycle, or an equilibrium that the motion comes to."""
        if not len(left):
            return
        some = self.cells.taken(left)
        cycle, moved, by_half, _ = self._newton(some, z)
        off, size = cycle.off, abs(cycle.multiplier)
        good, stable = (moved > NEAR) & (off <= NEAR * moved), size <= 1.0
        keep = good & (stable | ~np.isin(self.status[left], FOUND))
        status = np.where(stable, Status.OK, Status.UNSTABLE)
        if doubled:  # not where half of so many switches close the cycle
            keep, status = good & stable & (by_half > NEAR), np.full(len(left), Status.PERIOD_2)
        self._keep(left, some, cycle, status, keep)
        still = np.flatnonzero((moved <= NEAR) & (off <= NEAR) & (size < 1.0))
        if len(still) and not (doubled or self.map.driven):
            left, some, scale = left[still], some.taken(still), cycle.scale[:, still]
            some.r = np.full(len(still), self.map.fine)
            z, off, *_ = newton(self.map, some, cycle.z[:, still], scale, cycle.shift[:, still])
            first, _ = self._from_start(left, np.ones(len(still)))
            far, near = (most(abs(x - z)) for x in (first, self.last[:, left]))
            rests = left[(near <= 0.5 * far) & (most(off * scale / (1.0 - size[still])) <= RESTS * far)]
            self.cycle.z[:, rests], self.status[rests] = z[:, np.isin(left, rests)], Status.COMES_TO_REST

    def _doubled(self, left):
        """Where iterates alternate about a cycle, that of twice as many switches."""
        self.cells.flips[left] *= 2.0
        self._settled(left, self.last[:, left], doubled=True)
        self.cells.flips[left[self.status[left] != Status.PERIOD_2]] *= 0.5

    def _at_equilibrium(self, left):
        """Where a motion ended close to a stable equilibrium, closer than a cycle after its start: it comes to rest
        there."""
        if not len(left):
            return
        some, last = self.cells.taken(left), self.last[:, left]
        first, _ = self._from_start(left, np.ones(len(left)))
        for side in (1.0, -1.0):
            z, stable = equilibrium(self.map, some.parameters, last, side)
            far, near = (most(abs(x - z)) for x in (first, last))
            rests = stable & (near <= 0.5 * far)
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

    def _continued(self, k, begin, ends):
        """Follows cycles at the values `begin` of parameter k to those at the values `ends`."""
        at, way, reached, step = self.map.directions, ends - begin, np.zeros(len(ends)), np.full(len(ends), FIRST_STEP)
        tangent, going = np.full((len(at), len(ends)), np.nan), np.isin(self.status, FOUND) & (begin != ends)
        self.status[(begin != ends) & (self.status == Status.COMES_TO_REST)] = Status.NO_CYCLE
        stable = np.where(self.status == Status.PERIOD_2, self.status, Status.OK)
        for _ in range(MOST_STEPS):
            left = np.flatnonzero(going)
            if not len(left):
                return
            by = np.minimum(step[left], 1.0 - reached[left])
            last, some = reached[left] + by >= 1.0, self.cells.taken(left)
            some.parameters[k] = np.where(last, ends[left], begin[left] + (reached[left] + by) * way[left])
            z, old = self.cycle.z[:, left], tangent[:, left]
            guess = z.copy()
            guess[at] += by * np.where(np.isnan(old), 0.0, old)
            cycle, moved, _, slopes = self._newton(some, guess, (k,))
            with np.errstate(all="ignore"):
                new = push(slopes, len(at))[:, 0] * way[left] / some.parameters[k]
                chord, off = ((cycle.z - x) / cycle.scale for x in (z, guess))
                bent = np.fmax(*(most(np.nan_to_num(abs(chord[at] - by * t / cycle.scale[at]))) for t in (old, new)))
            near = (most(abs(off)) <= STRAIGHT) & (bent <= np.maximum(BENT * most(abs(chord[at])), FLAT))
            near &= (moved > NEAR) & (cycle.off <= NEAR * moved)
            status = np.where(abs(cycle.multiplier) <= 1.0, stable[left], Status.UNSTABLE)
            self._keep(left, some, cycle, status, near)
            self.cells.parameters[k, left[near]], tangent[:, left[near]] = some.parameters[k, near], new[:, near]
            reached[left[near]] += by[near]
            step[left] = np.where(near, 2.0 * step[left], 0.25 * by)
            going[left[near & last]] = False
            lost = left[~near & (by <= LEAST_STEP)]
            met = abs(self.cycle.multiplier[lost] - 1.0) <= VANISHES
            self.status[lost] = np.where(met, Status.NO_CYCLE, Status.NOT_CONVERGED)
            going[lost] = False
        self.status[going] = Status.NOT_CONVERGED
