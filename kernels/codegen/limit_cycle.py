"""Limit cycles of a scene: fixed points of its return map, by Newton's method on columns of cells.

With P(z) the states `flips` switches later and T(z) the time that takes, a cycle is a root of
    rho = P(z) - z - s = 0,  s whole numbers of the states' own turns (a phase that goes on by 2 pi),         (1)
and its multipliers are the eigenvalues of J = dP/dz on the surface. The derivatives are central differences of runs
to a tolerance r, at h, 2 h and 4 h of each state's size and each parameter; the sixth order by Richardson's rule is
given, and what it differs by from the fourth, with the runs' own r/h, is its error. To first order the root is off by
    dz = (I - J)^-1 (rho + r size),  dT = (dT/dz) dz + r T,                                                (2)
and the period changes with a parameter p by dT/dp + (dT/dz) (I - J)^-1 dP/dp.
Newton's method begins where the motion from the start is after some switches. Where it finds nothing, or a cycle that
is not stable, it begins again after more of them.
"""

import itertools
import math

import numpy as np

from kernels.codegen.columns_algebra import eigenvalues, identity, solved, times
from kernels.interface import Status

LOOSE = 1e-7
"""The widest tolerance of runs."""
WIDER = 4.0
"""By how much a cell's runs are looser where they are not right to the tolerance before."""
STEP = 1e-5
"""Of a state's size, that of Newton's differences."""
SHORTER = 0.1
"""Of the steps of differences, those that are tried where the first are too rough."""
ROUGHER = 20.0
"""Errors of the runs over a step, within which the first differences are good."""
ROUNDS = 14
CLOSED = 4.0
"""Tolerances of the runs within which a cycle is closed."""
NEAR = 1e-6
"""Of the states' sizes: within this a cycle is one, and what does not move by more over it is no cycle but at rest."""
LATER = 1, 8, 64
"""How many times as many cycles are followed before Newton's method begins again."""
SAFETY = 2.0
FOUND = Status.OK, Status.UNSTABLE, Status.PERIOD_2
"""Statuses of what has a cycle."""


class Columns:
    """Cells of which a cycle is wanted: a row for each of their parameters, their switches a cycle, their rtol."""

    def __init__(self, parameters, flips, rtol):
        self.parameters, self.flips, self.r = np.array(parameters).reshape(len(parameters), len(flips)), flips, rtol

    def __len__(self):
        return len(self.flips)

    def taken(self, cells):
        return Columns(self.parameters[:, cells], self.flips[cells], self.r[cells])


def differences(the_map, cells, z, scale, h, levels, parameters=()):
    """The map at z and its central differences: T, P, whether they are right; dT (moves, levels, cells), dP, right.

    Moves are the states that the map depends on, by h of their scale, then the parameters numbered, by h of
    themselves; derivatives by a parameter are by its logarithm.
    """
    n, count = len(z), len(cells)
    moves = [(z, j, h * scale[j]) for j in the_map.directions]
    moves += [(cells.parameters, k, h * cells.parameters[k]) for k in parameters]
    places, settings = [z], [cells.parameters]
    for rows, j, by in moves:
        for level, sign in itertools.product(levels, (1.0, -1.0)):
            moved = rows.copy()
            moved[j] = moved[j] + sign * level * by
            places.append(moved if rows is z else z)
            settings.append(cells.parameters if rows is z else moved)
    many = len(places)
    T, P, status = the_map.passed(
        list(np.concatenate(settings, axis=1)), np.concatenate(places, axis=1), np.tile(cells.flips, many),
        np.tile(cells.r, many),
    )  # fmt: skip
    T, P, fine = T.reshape(many, count), P.reshape(n, many, count), (status == Status.OK).reshape(many, count)
    shape = len(moves), len(levels), 2
    pairs_T, pairs_P = T[1:].reshape(*shape, count), P[:, 1:].reshape(n, *shape, count)
    over = np.array([[2.0 * level * (by if rows is z else h + 0.0 * by) for level in levels] for rows, _, by in moves])
    with np.errstate(all="ignore"):
        dT = (pairs_T[:, :, 0] - pairs_T[:, :, 1]) / over
        dP = (pairs_P[:, :, :, 0] - pairs_P[:, :, :, 1]) / over
    return T[0], P[:, 0], fine[0], dT, dP, fine[1:].all(axis=0)


def newton(the_map, cells, z, scale, shift):
    """Where (1) is closed best: z, its largest residual over the size, and J there, roughly."""
    n, at = len(the_map.directions), the_map.directions
    best, off, jacobian = z.copy(), np.full(len(cells), math.inf), np.full((n, n, len(cells)), np.nan)
    z, left, before = z.copy(), np.arange(len(cells)), np.full(len(cells), math.inf)
    for _ in range(ROUNDS):
        some, here = cells.taken(left), z[:, left]
        _, P, right, _, dP, fine = differences(the_map, some, here, scale[:, left], STEP, (1.0,))
        rho = (P - here - shift[:, left])[at]
        with np.errstate(all="ignore"):
            now = np.where(right & fine, np.maximum.reduce(abs(rho) / scale[at][:, left]), math.inf)
            J = np.array([[dP[i, d, 0] for d in range(n)] for i in at])
            step = solved(identity(n, len(left)) - J, rho[:, None])[:, 0]
            most = np.maximum.reduce(abs(step) / scale[at][:, left])
            step = step / np.maximum(1.0, most)
        better = now < off[left]
        improved = left[better]
        best[:, improved], off[improved] = z[:, improved], now[better]
        best[the_map.seen, improved] = P[the_map.seen, better]
        jacobian[:, :, improved] = J[:, :, better]
        lost = ~(now < math.inf) | ~(most < math.inf)
        cells.r[left[lost]] = np.minimum(WIDER * cells.r[left[lost]], LOOSE)
        back = 0.5 * (here + best[:, left])[at]
        z[np.ix_(at, left)] = np.where(lost, back, here[at] + step)
        settled = (now <= CLOSED * cells.r[left]) | ((now <= 1e-9) & (now > 0.5 * before[left]))
        before[left] = now
        left = left[~settled]
        if not len(left):
            break
    return best, off, jacobian


def largest(J):
    """The multiplier of largest modulus: itself where it is real, else its modulus."""
    real, imaginary = eigenvalues(J)
    squares = real * real + imaginary * imaginary
    first = np.argmax(np.where(np.isnan(squares), -1.0, squares), axis=0)[None]
    one, other = (np.take_along_axis(part, first, 0)[0] for part in (real, imaginary))
    modulus = np.sqrt(one * one + other * other)
    return np.where(abs(other) <= 1e-7 * modulus, one, modulus)


def described(the_map, cells, z, scale, shift, parameters):
    """Of a cycle at z: its outputs and their errors, by name."""
    found = _described(the_map, cells, z, scale, shift, parameters, the_map.step)
    with np.errstate(all="ignore"):
        rough = np.flatnonzero(~(np.maximum.reduce(found["errors"][1:]) <= ROUGHER * cells.r / the_map.step))
        if len(rough):
            some, h = cells.taken(rough), SHORTER * the_map.step
            again = _described(the_map, some, z[:, rough], scale[:, rough], shift[:, rough], parameters, h)
            better = ~(again["errors"] >= found["errors"][:, rough])
            for key in ("values", "errors"):
                found[key][:, rough] = np.where(better, again[key], found[key][:, rough])
            for key in ("spread", "states"):
                found[key][:, rough] = again[key]
    return found


def _described(the_map, cells, z, scale, shift, parameters, h):
    """By differences at h: values and errors of period, multiplier, sensitivities; the states and what they are off."""
    at, n = the_map.directions, len(the_map.directions)
    T, P, right, dT, dP, fine = differences(the_map, cells, z, scale, h, (1.0, 2.0, 4.0), parameters)
    with np.errstate(all="ignore"):
        size, noise, one = scale[at], 1.5 * cells.r / h, identity(n, len(cells))
        orders = [_extrapolated(dT, dP, at, n, high) for high in (True, False)]
        (T_z, _, J, P_p), _ = orders
        W = solved(one - J, one)
        rho = abs((P - z - shift)[at]) + cells.r * size
        spread = SAFETY * times(abs(W), rho[:, None])[:, 0]
        late = times(abs(T_z)[None], abs(W))[0] if n else np.zeros((0, len(cells)))
        period_error = SAFETY * (sum(late[i] * rho[i] for i in range(n)) / T + cells.r)
        signs = [np.array([[(-1.0) ** (i * k + j * (1 - k)) for j in range(n)] for i in range(n)]) for k in (0, 1)]
        noisy = [J + noise * s[:, :, None] * size[:, None] / size[None] for s in signs]
        multiplier, *others = [largest(X) for X in (J, orders[1][2], *noisy)]
        unsure = sum(abs(x - multiplier) for x in others)
        values, errors = [T, multiplier], [period_error, SAFETY * unsure / np.maximum(1.0, abs(multiplier))]
        for k in range(len(parameters)):
            high, low = (_sensitivity(o, one, k, T) for o in orders)
            pull = abs(times(W, P_p[:, k][:, None])[:, 0])
            share = 1.0 + sum(late[i] * size[i] for i in range(n)) / T
            doubt = noise * share * (1.0 + sum(pull[i] / size[i] for i in range(n)))
            values.append(high)
            errors.append(SAFETY * (abs(high - low) + doubt) / np.maximum(1.0, abs(high)))
        states = P.copy()
        errors = np.where(right & fine, np.array(errors), math.inf)
    far = np.zeros(z.shape)
    far[at] = spread
    return {"values": np.array(values), "errors": np.where(np.isnan(errors), math.inf, errors),
            "spread": far, "states": states}  # fmt: skip


def _extrapolated(dT, dP, at, n, high):
    """dT/dz, dT/dp, J, dP/dp from differences at h, 2 h and 4 h: of order 6, or of order 4."""

    def rule(d):
        first = (4.0 * d[0] - d[1]) / 3.0
        return (16.0 * first - (4.0 * d[1] - d[2]) / 3.0) / 15.0 if high else first

    of_T = [rule(d) for d in dT]
    of_P = [[rule(dP[i, d]) for d in range(len(dT))] for i in at]
    count = dT.shape[-1]
    of_T, of_P = np.array(of_T).reshape(-1, count), np.array(of_P).reshape(n, -1, count)
    return of_T[:n], of_T[n:], of_P[:, :n], of_P[:, n:]


def _sensitivity(order, one, k, T):
    """d ln T/d ln p of parameter k."""
    T_z, T_p, J, P_p = order
    dz = solved(one - J, P_p[:, k][:, None])[:, 0]
    return (T_p[k] + sum(T_z[i] * dz[i] for i in range(len(T_z)))) / T


class Search:
    """The search for the cycles of cells, and what it finds; a cell's numbers depend on that cell alone.

    Parameters
    ----------
    the_map : `ReturnMap`
    turns : dict from the number of a state to what it goes on by in a turn
    cells : Columns
    settle : cycles followed first, a column; 0: only to the first switch that ends one, and never again
    """

    def __init__(self, the_map, turns, cells, settle):
        self.map, self.turns, self.cells, self.settle = the_map, turns, cells, settle
        shape = len(the_map.scene.states), len(cells)
        self.z, self.scale, self.shift = np.full(shape, np.nan), np.ones(shape), np.zeros(shape)
        self.last, self.before = np.full(shape, np.nan), np.full(shape, np.nan)
        self.status = np.full(len(cells), Status.NOT_CONVERGED, np.int8)
        self.multiplier = np.full(len(cells), np.nan)
        left = np.arange(len(cells))
        for later in LATER:
            left = self._tried(left, later)
            left = left[self.settle[left] > 0]
        self._doubled(np.flatnonzero((self.status == Status.UNSTABLE) & (self.multiplier < -1.0) & (settle > 0)))
        self._at_rest(np.flatnonzero(~np.isin(self.status, FOUND)))

    def _tried(self, left, later):
        """Newton's method for these cells; which have no stable cycle yet, though there may be one."""
        if not len(left):
            return left
        some = self.cells.taken(left)
        cycles = np.maximum(self.settle[left] * later, 1.0)
        nothing = np.zeros((len(self.z), len(left)))
        _, z, status = self.map.passed(
            list(some.parameters), nothing, some.flips * cycles, np.full(len(left), self.map.rough), 1.0
        )
        goes_on = status <= Status.INACCURATE
        over = left[~goes_on & ~np.isin(self.status[left], FOUND)]
        self.status[over] = status[~goes_on & ~np.isin(self.status[left], FOUND)]
        left, z = left[goes_on], z[:, goes_on]
        self.before[:, left], self.last[:, left] = self.last[:, left], z
        self._settled(left, z)
        return left[~np.isin(self.status[left], (Status.OK,))]

    def _settled(self, left, z, doubled=False):
        """Takes what Newton's method makes of z, where that is a cycle."""
        some = self.cells.taken(left)
        _, P, _ = self.map.passed(list(some.parameters), z, some.flips, np.full(len(left), self.map.rough))
        sizes = self.map.sizes(list(some.parameters), z, some.flips)
        scale = np.where(sizes > 0.0, sizes, np.where(abs(P) > 0.0, abs(P), 1.0))
        shift = np.zeros(z.shape)
        for j, turn in self.turns.items():
            shift[j] = turn * np.where(P[j] - z[j] < math.inf, np.round((P[j] - z[j]) / turn), 0.0)
            scale[j] = np.minimum(scale[j], turn)
        z, off, J = newton(self.map, some, z, scale, shift)
        multiplier = largest(J)
        moved = self._moved(some, z, scale)
        good = (moved > NEAR) & (off <= NEAR * moved) & (abs(multiplier) < math.inf)
        stable = abs(multiplier) <= 1.0
        keep = good & (stable | ~np.isin(self.status[left], FOUND))
        if doubled:
            keep = good & stable & self._two(some, z, scale, shift)
        those = left[keep]
        self.z[:, those], self.scale[:, those], self.shift[:, those] = z[:, keep], scale[:, keep], shift[:, keep]
        self.cells.r[those], self.multiplier[those] = some.r[keep], multiplier[keep]
        self.status[those] = np.where(stable[keep], Status.OK, Status.UNSTABLE)
        return those

    def _moved(self, some, z, scale):
        """How far apart states of a cycle are, over their sizes; 1 at most, and 0 of a point that the surface holds."""
        half = np.maximum(np.floor(0.5 * some.flips), 1.0)
        T, middle, _ = self.map.passed(list(some.parameters), z, half, np.full(len(half), self.map.rough))
        apart = np.minimum(np.maximum.reduce(abs(middle - z) / scale), 1.0)
        return np.where(half == some.flips, T > 0.0, apart)

    def _two(self, some, z, scale, shift):
        """Whether half of so many switches do not close the cycle."""
        half = 0.5 * some.flips
        _, middle, _ = self.map.passed(list(some.parameters), z, half, np.full(len(half), self.map.rough))
        return np.maximum.reduce(abs(middle - z - 0.5 * shift) / scale) > NEAR

    def _doubled(self, left):
        """Where iterates alternate about a cycle, that of twice as many switches."""
        if len(left):
            self.cells.flips[left] *= 2.0
            twice = self._settled(left, self.last[:, left], doubled=True)
            self.status[twice] = Status.PERIOD_2
            self.cells.flips[np.setdiff1d(left, twice)] *= 0.5

    def _at_rest(self, left):
        """Where a motion comes to rest: at an equilibrium to which it has come closer from its first cycle on."""
        some = self.cells.taken(left)
        _, first, _ = self.map.passed(
            list(some.parameters),
            np.zeros((len(self.z), len(left))),
            some.flips,
            np.full(len(left), self.map.rough),
            1.0,
        )
        for side in (1.0, -1.0) if len(left) else ():
            z = self._equilibrium(some, self.last[:, left], side)
            far, near = (np.maximum.reduce(abs(x - z)) for x in (first, self.last[:, left]))
            rests = (near <= 0.5 * far) & (self.status[left] != Status.COMES_TO_REST)
            self.z[:, left[rests]], self.status[left[rests]] = z[:, rests], Status.COMES_TO_REST

    def _equilibrium(self, some, z, side):
        """Where the rates are 0, by Newton's method; NaN where it is not found."""
        n, given = len(z), np.concatenate([some.parameters, np.zeros((len(z) + 1, len(some)))])
        with np.errstate(all="ignore"):
            for _ in range(ROUNDS):
                h = STEP * np.maximum(np.maximum.reduce(abs(z)), 1e-150)
                found = self.map.rates(given, z, side)
                J = np.empty((n, n, len(some)))
                for j in range(n):
                    up, down = z.copy(), z.copy()
                    up[j], down[j] = z[j] + h, z[j] - h
                    J[:, j] = (self.map.rates(given, up, side) - self.map.rates(given, down, side)) / (2.0 * h)
                step = solved(J, found[:, None])[:, 0]
                before, z = z, z - step
            still = np.maximum.reduce(abs(z - before)) <= NEAR * np.maximum.reduce(abs(z)) + 1e-140
        return np.where(still, z, np.nan)
