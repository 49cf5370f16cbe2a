"""What is said of the limit cycles that a search has found (`limit_cycle`), each value with its error.

Derivatives are central differences of runs to a tolerance r, at h, 2 h and 4 h of the size of each state and of each
parameter; the sixth order by Richardson's rule is given, and what it differs by from the fourth, with the runs' own
r/h, is its error. With rho, J and T as in `limit_cycle` and to first order, the root is off by
    dz = (I - J)^-1 (rho + r),  dT = (dT/dz) dz + r T,                                                     (1)
and the period changes with a parameter p by dT/dp + (dT/dz) (I - J)^-1 dP/dp.
"""

import math

import numpy as np

from kernels.codegen.columns_algebra import eigenvalues, identity, largest, most, times
from kernels.codegen.limit_cycle import CLOSED, FOUND, differences, settling, taken
from kernels.codegen.return_map import TIGHT
from kernels.interface import Status

SAFETY = 2.0
SURE = 0.05
"""How far below 1 Newton's own multiplier tells that the cycle is stable."""
SHORTER, ROUGHER = 0.1, 20.0
"""Of the steps of differences, those that are tried where errors are more than so many of the runs' over a step."""
ONE = 1e-8
"""To what a multiplier must be known where it cannot be told from 1: what is 1 leaves no cycle by itself; what is 1 in
modulus alone lets disturbances neither grow nor fade."""


def closed(the_map, cells, cycle):
    """{name: values and errors} of period and states by (1), with the cycle's slopes; sizes of dT/dz (I - J)^-1/T."""
    at, n = the_map.directions, len(the_map.directions)
    (T, *P), W = cycle.rows, abs(settling(cycle.slopes, identity(n, len(cells.r))))
    rho = abs(((np.array(P) - cycle.z - cycle.shift) / cycle.scale)[at]) + cells.r
    spread, late = np.zeros(cycle.z.shape), times(abs(cycle.slopes[:1, :n]), W) / T
    spread[at] = SAFETY * times(W, rho[:, None])[:, 0]
    off = SAFETY * (times(late, rho[:, None])[0, 0] + cells.r)
    return {"period": (T, off), "states": (np.array(P), spread)}, late[0]


def described(the_map, cells, cycle, swept, h):
    """By differences at h: {name: values and their errors}, of period, states, multipliers and sensitivities.

    `swept` : {number of a parameter: name of the sensitivity to it}
    """
    n = len(the_map.directions)
    rows, slopes, right = differences(the_map, cells, cycle.z, cycle.scale, h, (1.0, 2.0, 4.0), swept)
    low, lower = ((4.0 * slopes[:, :, k] - slopes[:, :, k + 1]) / 3.0 for k in (0, 1))
    high, noise = (16.0 * low - lower) / 15.0, 1.5 * cells.r / h
    found, late = closed(the_map, cells, cycle._replace(rows=rows, slopes=high))
    J, signs = high[1:, :n], (-1.0) ** np.arange(n)[:, None]
    felt = noise * (most(abs(J.swapaxes(0, 1))) > 0.0)[:, None]  # a state that is set to a number has no noise
    real, imaginary, unsure = eigenvalues(J, low[1:, :n], J + felt * signs, J + felt * signs[:, None])
    multiplier, modulus = largest(real, imaginary), np.sqrt(real * real + imaginary * imaginary)
    found["multiplier"] = multiplier, SAFETY * most(unsure[:1]) / np.maximum(1.0, abs(multiplier))
    found["multipliers_real"] = real, SAFETY * unsure / np.maximum(1.0, modulus)
    found["multipliers_imaginary"] = imaginary, SAFETY * unsure / np.maximum(1.0, modulus)
    for k, name in enumerate(swept.values(), n):
        pull, other = (settling(D, D[1:, k : k + 1]) for D in (high, low))
        value, rough = ((D[0, k] + times(D[:1, :n], z)[0, 0]) / rows[0] for D, z in ((high, pull), (low, other)))
        doubt = noise * (1.0 + np.add.reduce(late)) * (1.0 + np.add.reduce(abs(pull[:, 0])))
        found[name] = value, SAFETY * (abs(value - rough) + doubt) / np.maximum(1.0, abs(value))
    return {name: (value, np.where(right & (error >= 0.0), error, math.inf)) for name, (value, error) in found.items()}


class Described:
    """What is said of the cycles of a search, as far as it is asked for.

    Parameters
    ----------
    search : `limit_cycle.Search`, whose statuses are judged here
    swept : {number of a parameter: name of the sensitivity to it}, of those that are asked for
    modes : numbers of the multipliers that are wanted
    asked : names of outputs
    """

    def __init__(self, search, swept, modes, asked):
        self.search, self.map, self.swept, self.modes, self.asked = search, search.map, swept, modes, asked
        self.names, unknown = search.map.own.states[: len(search.cycle.z)], np.full(len(search.status), math.inf)
        self.found = {name: (row.copy(), unknown.copy()) for name, row in zip(self.names, search.cycle.z, strict=True)}
        self.unclear = np.zeros(len(search.status), bool)

    def to(self, rtol, tight):
        """{output: values}, and the largest error of what is asked for, a column.

        By Newton's last run alone where that tells enough, else by differences. What is not right to rtol then, or not
        clear of a modulus of 1, is solved again by tight runs.
        """
        search, r = self.search, self.search.cells.r
        there, sure = np.isin(search.status, FOUND), abs(search.cycle.multiplier) < 1.0 - SURE
        some = np.flatnonzero(there & sure & (search.cycle.off <= CLOSED * r))
        self._keep(some, closed(self.map, taken(search.cells, some), taken(search.cycle, some))[0])
        self._by_differences(there & ~(self._error() <= rtol), rtol)
        left = there & (self.unclear | ~(self._error() <= rtol)) & (r > tight)
        search.refined(np.flatnonzero(left), tight[left])
        self._by_differences(left, rtol)
        return {name: values for name, (values, _) in self.found.items()}, self._error()

    def _error(self):
        off = np.zeros(len(self.search.status))
        for name in self.asked:
            off = np.maximum(off, most(np.atleast_2d(self.found[name][1])) if name in self.found else math.inf)
        return off

    def _by_differences(self, left, rtol):
        """Finds what is asked for of the cells that are left, by differences; by shorter ones where these are rough."""
        for h in (self.map.step, SHORTER * self.map.step):
            some = np.flatnonzero(left)
            if len(some):
                cells, cycle = taken(self.search.cells, some), taken(self.search.cycle, some)
                parts = described(self.map, cells, cycle, self.swept, h)
                self._judged(some, parts)
                self._keep(some, parts)
            left = left & ~(self._error() <= np.maximum(rtol, ROUGHER / self.map.step * self.search.cells.r))

    def _judged(self, cells, parts):
        """Says of what no disturbance tells apart, or grows, that it is no cycle by itself, or not stable."""
        (real, unsure), (imaginary, _), (multiplier, error) = (
            parts[name] for name in ("multipliers_real", "multipliers_imaginary", "multiplier")
        )
        one, grows = (abs(real - 1.0) <= unsure) & (imaginary <= unsure), abs(multiplier) - 1.0
        unclear = (one & (unsure >= ONE)).any(axis=0) | ((abs(grows) <= error) & (error >= ONE))
        before = self.search.status[cells]
        status = np.where(before == Status.PERIOD_2, before, np.where(grows > error, Status.UNSTABLE, Status.OK))
        status = np.where((one & (unsure < ONE)).any(axis=0), Status.NO_CYCLE, np.where(unclear, before, status))
        self.search.status[cells], self.unclear[cells] = status, unclear

    def _keep(self, cells, parts):
        """Keeps what is no worse than what is known of these cells."""
        (states, off), scale, keep = parts.pop("states"), self.search.cycle.scale[:, cells], parts
        keep |= {name: (states[j], off[j]) for j, name in enumerate(self.names)}
        if any(f"{name}_size" in self.asked for name in self.names):
            sizes, unsure = self._sizes(taken(self.search.cells, cells), states, off, scale)
            keep |= {f"{name}_size": (sizes[j], unsure[j]) for j, name in enumerate(self.names)}
        for j, turn in self.search.turns.items():
            keep[f"{self.names[j]}_turns"] = np.round(self.search.cycle.shift[j, cells] / turn), np.zeros(len(cells))
        for name, parts in keep.items():
            value, off = (part[self.modes] if part.ndim > 1 else part for part in parts)
            off, shape = np.where(off >= 0.0, off, math.inf), (*value.shape[:-1], len(self.search.status))
            values, errors = self.found.setdefault(name, (np.full(shape, math.nan), np.full(shape, math.inf)))
            better = off <= errors[..., cells]
            values[..., cells] = np.where(better, value, values[..., cells])
            errors[..., cells] = np.where(better, off, errors[..., cells])

    def _sizes(self, cells, z, off, scale):
        """The largest size of each state in the cycle, and its relative error."""
        sizes, apart = self.map.turned(cells.parameters, z, cells.flips)
        apart = apart + TIGHT * self.map.fine * scale
        for j in self.map.directions:
            by = np.maximum(off[j], 1e-7)
            moved = z.copy()
            moved[j] = moved[j] + by * scale[j]
            other, _ = self.map.turned(cells.parameters, moved, cells.flips)
            apart = apart + 2.0 * abs(other - sizes) * (off[j] / by)
        return sizes, apart / sizes
