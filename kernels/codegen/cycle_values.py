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
from kernels.codegen.limit_cycle import CLOSED, FOUND, jacobian, newton, settling
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


def described(search, swept, modes, asked, rtol, tight):
    """What is said of the cycles of a search, as far as it is asked for: {output: values}; the largest error, a column.

    By Newton's last run alone where that tells enough, else by differences, and by shorter ones where these are rough.
    What is not right to rtol then, or not clear of a modulus of 1, is solved again by tight runs.

    Parameters
    ----------
    search : `limit_cycle.Search`, whose statuses are judged here
    swept : {number of a parameter: name of the sensitivity to it}, of those that are asked for
    modes : numbers of the multipliers that are wanted
    asked : names of outputs
    rtol, tight : columns, of what is wanted and of tight runs
    """
    the_map, cycles, found = search.map, search.cycles, {}

    def keep(cells, parts):
        """Takes what is no worse than what is known of these cells."""
        for name, (value, off) in parts.items():
            value, off = (x[modes] if x.ndim > 1 else x for x in (value, np.where(off >= 0.0, off, math.inf)))
            shape = *value.shape[:-1], len(rtol)
            values, errors = found.setdefault(name, (np.full(shape, math.nan), np.full(shape, math.inf)))
            better = off <= errors[..., cells]
            values[..., cells] = np.where(better, value, values[..., cells])
            errors[..., cells] = np.where(better, off, errors[..., cells])

    def error():
        unknown = math.nan, np.full(len(rtol), math.inf)
        return most(np.array([most(np.atleast_2d(found.get(name, unknown)[1])) for name in asked]))

    def by_differences(left):
        for h in (the_map.step, SHORTER * the_map.step):
            if not left.any():
                return
            cells = np.flatnonzero(left)
            parts = differences(the_map, cycles.some(cells), swept, h)
            cycles.status[cells], unclear[cells] = judged(cycles.status[cells], parts)
            keep(cells, parts | moving(search, cells, parts, asked))
            left = left & ~(error() <= np.maximum(rtol, ROUGHER / the_map.step * cycles.r))

    unclear, there = np.zeros(len(rtol), bool), np.isin(cycles.status, FOUND)
    keep(slice(None), {name: (z, z + math.nan) for name, z in zip(the_map.states, cycles.z, strict=True)})
    sure = (abs(cycles.multiplier) < 1.0 - SURE) & (cycles.off <= CLOSED * cycles.r)
    cells = np.flatnonzero(there & sure)
    parts, _ = closed(the_map, cycles.some(cells))
    keep(cells, parts | moving(search, cells, parts, asked))
    by_differences(there & ~(error() <= rtol))
    left = there & (unclear | ~(error() <= rtol)) & (cycles.r > tight)
    cells = np.flatnonzero(left)
    cycles.put(cells, newton(the_map, cycles.some(cells)._replace(r=tight[cells]), search.swept))
    by_differences(left)
    return {name: values for name, (values, _) in found.items()}, error()


def closed(the_map, cycles):
    """{name: values and errors} of period and states by (1), with the cycle's slopes; sizes of dT/dz (I - J)^-1/T."""
    at, n = the_map.directions, len(the_map.directions)
    (T, *P), W = cycles.rows, abs(settling(cycles.slopes, identity(n, len(cycles.r))))
    rho = abs(((np.array(P) - cycles.z - cycles.shift) / cycles.scale)[at]) + cycles.r
    spread, late = np.zeros(cycles.z.shape), times(abs(cycles.slopes[:1, :n]), W) / T
    spread[at] = SAFETY * times(W, rho[:, None])[:, 0]
    off = SAFETY * (times(late, rho[:, None])[0, 0] + cycles.r)
    return {"period": (T, off)} | dict(zip(the_map.states, zip(P, spread, strict=True), strict=True)), late[0]


def differences(the_map, cycles, swept, h):
    """The same by differences at h, and multipliers and sensitivities."""
    n, runs = len(the_map.directions), (cycles.parameters, cycles.z, cycles.flips, cycles.r)
    (rows, status), (slopes, right) = the_map.passed(*runs), jacobian(the_map, cycles, h, (1.0, 2.0, 4.0), swept)
    low, lower = ((4.0 * slopes[:, :, k] - slopes[:, :, k + 1]) / 3.0 for k in (0, 1))
    high, noise, right = (16.0 * low - lower) / 15.0, 1.5 * cycles.r / h, right & (status == Status.OK)
    found, late = closed(the_map, cycles._replace(rows=rows, slopes=high))
    J, signs = high[1:, :n], (-1.0) ** np.arange(n)[:, None]
    felt = noise * (most(abs(J.swapaxes(0, 1))) > 0.0)[:, None]  # a state that is set to a number has no noise
    real, imaginary, unsure = eigenvalues(J, low[1:, :n], J + felt * signs, J + felt * signs[:, None])
    multiplier, modulus = largest(real, imaginary), np.sqrt(real * real + imaginary * imaginary)
    found["multiplier"] = multiplier, SAFETY * most(unsure[:1]) / np.maximum(1.0, abs(multiplier))
    for name, part in (("multipliers_real", real), ("multipliers_imaginary", imaginary)):
        found[name] = part, SAFETY * unsure / np.maximum(1.0, modulus)
    for k, name in enumerate(swept.values(), n):
        pull, other = (settling(D, D[1:, k : k + 1]) for D in (high, low))
        value, rough = ((D[0, k] + times(D[:1, :n], z)[0, 0]) / rows[0] for D, z in ((high, pull), (low, other)))
        doubt = noise * (1.0 + np.add.reduce(late)) * (1.0 + np.add.reduce(abs(pull[:, 0])))
        found[name] = value, SAFETY * (abs(value - rough) + doubt) / np.maximum(1.0, abs(value))
    return {name: (value, np.where(right, error, math.inf)) for name, (value, error) in found.items()}


def judged(status, parts):
    """Statuses, and whether they are unclear: what no disturbance tells apart is no cycle by itself; one may grow."""
    names = "multipliers_real", "multipliers_imaginary", "multiplier"
    (real, unsure), (imaginary, _), (multiplier, error) = (parts[name] for name in names)
    one, grows = (abs(real - 1.0) <= unsure) & (imaginary <= unsure), abs(multiplier) - 1.0
    unclear = (one & (unsure >= ONE)).any(axis=0) | ((abs(grows) <= error) & (error >= ONE))
    stable = np.where(status == Status.PERIOD_2, status, np.where(grows > error, Status.UNSTABLE, Status.OK))
    clear = np.where(unclear, status, stable)
    return np.where((one & (unsure < ONE)).any(axis=0), Status.NO_CYCLE, clear), unclear


def moving(search, cells, parts, asked):
    """{name: values and errors} of the largest size of each state in the cycle, where it is asked for, and of turns."""
    cycles, the_map, found = search.cycles.some(cells), search.map, {}
    for j, turn in search.turns.items():
        found[f"{the_map.states[j]}_turns"] = np.round(cycles.shift[j] / turn), np.zeros(len(cells))
    names = [f"{name}_size" for name in the_map.states]
    if asked.isdisjoint(names):
        return found
    z, off = (np.array(part) for part in zip(*(parts[name] for name in the_map.states), strict=True))
    sizes, apart = the_map.turned(cycles.parameters, z, cycles.flips)
    apart = apart + TIGHT * the_map.fine * cycles.scale
    for j in the_map.directions:
        by, moved = np.maximum(off[j], 1e-7), z.copy()
        moved[j] = moved[j] + by * cycles.scale[j]
        other, _ = the_map.turned(cycles.parameters, moved, cycles.flips)
        apart = apart + 2.0 * abs(other - sizes) * (off[j] / by)
    return found | {name: (sizes[j], apart[j] / sizes[j]) for j, name in enumerate(names)}
