"""Outputs of the limit cycles found by a search (`limit_cycle`), each with its error.

Derivatives are central differences of runs to a tolerance r, with steps h, 2 h and 4 h times the size of each state and
parameter. Richardson extrapolation gives sixth order; the difference from fourth order is the truncation error.
The noise of the runs is the residual of the sums of both sides after second and fourth derivatives, and at least ODD
r/h; the noisiest slope sets it for all slopes. With rho, J and T as in `limit_cycle`, the error of the root is, to
first order,
    dz = (I - J)^-1 (rho + r),  dT = (dT/dz) dz + r T,                                                     (1)
and the period changes with a parameter p by dT/dp + (dT/dz) (I - J)^-1 dP/dp. Derivatives at that root have an
additional error, second derivatives times dz, which dominates if a multiplier is close to 1.
"""

import math

import numpy as np

from kernels.codegen.columns_algebra import eigenvalues, identity, largest, most, times
from kernels.codegen.followed import put
from kernels.codegen.limit_cycle import CLOSED, FOUND, jacobian, newton, settling
from kernels.codegen.return_map import TIGHT
from kernels.interface import Status

SAFETY = 2.0
SURE = 0.05
"""How far below 1 Newton's own multiplier tells that the cycle is stable."""
SHORTER, ROUGHER = (1.0, 0.1, 0.01), 20.0
"""Of the steps of differences, those that are tried, the next where errors are more than so many of the runs' over a
step: beside a corner of the map only a step that does not come to it tells its slopes, and its error."""
ROUNDING, ROUNDINGS = 2.3e-16, 1e-15
"""Relative noise of a period that depends on no state; least noise of any other period and of states."""
LINEAR = 0.25
"""Largest error of slopes, as a share of I - J, for which first order holds."""
ODD = 0.1
"""Least noise of slopes, over r/h: of a part of the motion that the cycle has not got, as a swing that has died out,
runs may miss the same share on both sides, which sums do not show (found: 0.05)."""
SHARP, CORNER = 1e-3, 3.0
"""Largest noise of slopes that tell where the root is; and, over r/h, of those that are given: what more is left is no
noise but a corner of the map, as where a motion touches the surface, or what the sixth order leaves out; shorter
differences may do."""
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
    the_map, cycles, unknown = search.map, search.cycles, np.full(len(rtol), math.inf)
    found = {name: (z.copy(), unknown.copy()) for name, z in zip(the_map.states, cycles.z, strict=True)}
    there, unclear, error = np.isin(cycles.status, FOUND), np.zeros(len(rtol), bool), unknown

    def by_differences(h, left):
        """Takes what is no worse than what is known of those cells; h = 0: by Newton's. The largest error of each."""
        cells = np.flatnonzero(left)
        if not len(cells):
            return error
        some = cycles.some(cells)
        if h:
            parts, cycles.status[cells], unclear[cells] = differences(the_map, some, swept, h)
        else:
            parts, *_ = closed(the_map, some)
        for name, part in (parts | moving(search, some, parts, asked)).items():
            value, off = (x[modes] if x.ndim > 1 else x for x in part)
            nothing = np.full((*value.shape[:-1], len(rtol)), math.nan)
            values, errors = found.setdefault(name, (nothing, np.full_like(nothing, math.inf)))
            off = np.where(off >= 0.0, off, math.inf)
            better = off <= errors[..., cells]
            values[..., cells] = np.where(better, value, values[..., cells])
            errors[..., cells] = np.where(better, off, errors[..., cells])
        return most(np.array([most(np.atleast_2d(found.get(name, (None, unknown))[1])) for name in asked]))

    sure = (abs(cycles.multiplier) < 1.0 - SURE) & (cycles.off <= CLOSED * cycles.r)
    error = by_differences(0.0, there & sure)
    for r in (cycles.r, tight):
        left = there & (unclear | ~(error <= rtol)) & ((r is not tight) | (cycles.r > tight))
        cells = np.flatnonzero(left & (cycles.r > r))
        put(cycles, cells, newton(the_map, cycles.some(cells)._replace(r=r[cells]), search.swept))
        for shorter in SHORTER:
            error = by_differences(shorter * the_map.step, left)
            left = left & ~(error <= np.maximum(rtol, ROUGHER / the_map.step * cycles.r))
    return {name: values for name, (values, _) in found.items()}, error


def closed(the_map, cycles):
    """{name: values and errors} of period and states by (1), with the cycle's slopes.

    And in size, by directions and over scales, dz, (I - J)^-1 and dT/dz (I - J)^-1/T.
    """
    n, at = len(the_map.directions), the_map.directions
    (T, *P), W = cycles.rows, abs(settling(cycles.slopes, identity(n, len(cycles.r))))
    rho = abs(((np.array(P) - cycles.z - cycles.shift) / cycles.scale)[at]) + cycles.r
    spread, late = np.zeros(cycles.z.shape), times(abs(cycles.slopes[:1, :n]), W) / T
    spread[at] = SAFETY * times(W, rho[:, None])[:, 0]
    off = SAFETY * (times(late, rho[:, None])[0, 0] + cycles.r)
    states = zip(the_map.states, zip(P, spread, strict=True), strict=True)
    return {"period": (T, off)} | dict(states), spread[at], W, late[0]


def differences(the_map, cycles, swept, h):
    """The same by differences at h, and multipliers and sensitivities; and what is `judged` by them."""
    n, at, runs = len(the_map.directions), the_map.directions, (cycles.parameters, cycles.z, cycles.flips, cycles.r)
    (rows, status, _), levels = the_map.passed(*runs), (1.0, 2.0, 4.0)
    slopes, sums, right = jacobian(the_map, cycles, h, levels, swept)
    low, lower = ((4.0 * slopes[:, :, k] - slopes[:, :, k + 1]) / 3.0 for k in (0, 1))
    high, right = (16.0 * low - lower) / 15.0, right & (status == Status.OK)
    found, spread, W, late = closed(the_map, cycles._replace(rows=rows, slopes=high))
    middle = np.concatenate([rows[:1], (rows[1:] / cycles.scale)[at]])[:, None, None]
    even = (sums - 2.0 * middle) / np.concatenate([rows[:1], 0.0 * rows[:n] + 1.0])[:, None, None]
    if n:
        even[:1, n:] = 0.0  # of how the period goes with a parameter these are most of what is left out
    shown = most(most(abs(even[:, :, 0] - 0.3125 * even[:, :, 1] + even[:, :, 2] / 64.0))) / (2.0 * h)
    bent = most(most(abs(even[:, :n, 0]))) / (h * h)
    right = right & (shown <= SHARP)
    smooth = right & (shown <= CORNER * cycles.r / h)
    here = np.maximum(np.maximum(shown, ROUNDINGS / h), ODD * cycles.r / h) + cycles.r
    noise = here + bent * np.add.reduce(spread)
    of_time = np.where((slopes[0, :n] == 0.0).all(axis=(0, 1)), ROUNDING / h, noise)
    J, signs = high[1:, :n], (-1.0) ** np.arange(n)[:, None]
    felt = here * (most(abs(J.swapaxes(0, 1))) > 0.0)[:, None]  # a state that is set to a number has no noise
    real, imaginary, unsure = eigenvalues(J, low[1:, :n], J + felt * signs, J + felt * signs[:, None])
    multiplier, modulus = largest(real, imaginary), np.sqrt(real * real + imaginary * imaginary)
    off = SAFETY * unsure * (noise / here)
    found["multiplier"] = multiplier, most(off[:1]) / np.maximum(1.0, abs(multiplier))
    for name, part in (("multipliers_real", real), ("multipliers_imaginary", imaginary)):
        found[name] = part, off / np.maximum(1.0, modulus)
    for k, name in enumerate(swept.values(), n):
        pull, other = (settling(D, D[1:, k : k + 1]) for D in (high, low))
        value, rough = ((D[0, k] + times(D[:1, :n], z)[0, 0]) / rows[0] for D, z in ((high, pull), (low, other)))
        doubt = (of_time + noise * np.add.reduce(late)) * (1.0 + np.add.reduce(abs(pull[:, 0])))
        found[name] = value, SAFETY * (abs(value - rough) + doubt) / np.maximum(1.0, abs(value))
    # to first order only where the noise leaves 1 - J what it is
    linear = right & (noise * most(np.add.reduce(W, axis=1)) < LINEAR)
    known = {name: linear if name == "period" or name in the_map.states else linear & smooth for name in found}
    found = {name: (value, np.where(known[name], error, math.inf)) for name, (value, error) in found.items()}
    unsure = np.where(smooth, SAFETY * unsure, math.inf)
    return found, *judged(cycles.status, real, imaginary, unsure, *found["multiplier"])


def judged(status, real, imaginary, unsure, multiplier, error):
    """Statuses, and whether they are unclear. A multiplier of 1 is no isolated cycle; one larger than 1 is unstable.

    `unsure` : of each multiplier, where the cycle is as it stands; `error` : of the largest one
    """
    from_one, grows = np.maximum(abs(real - 1.0), imaginary), abs(multiplier) - 1.0
    unclear = ((from_one <= unsure) & (unsure >= ONE)).any(axis=0) | ((abs(grows) <= error) & (error >= ONE))
    stable = np.where(status == Status.PERIOD_2, status, np.where(grows > error, Status.UNSTABLE, Status.OK))
    one = ((from_one <= ONE) & (unsure < ONE)).any(axis=0)
    return np.where(one, Status.NO_CYCLE, np.where(unclear, status, stable)), unclear


def moving(search, cycles, parts, asked):
    """{name: values and errors} of the largest size of each state in the cycle, where it is asked for, and of turns."""
    the_map, found = search.map, {}
    for j, turn in search.turns.items():
        found[f"{the_map.states[j]}_turns"] = np.round(cycles.shift[j] / turn), np.zeros(len(cycles.r))
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
