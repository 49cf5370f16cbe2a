"""What every method of `polisher` shares: lengths without units, the verdict on the linkage, and writing a cell."""

import math

from kernels.lanes.codes import CHANGE_POINT, DOUBLE_CRANK, LOCK_UP, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, pow2, some, where
from kernels.polisher import extremes
from kernels.polisher.linkage import in_units, margins

UNIT_LIMIT = 720.0
"""Power of two of the longest length, beyond which derivatives would leave float64."""


@jit
def said(code, status):
    """Whether the code of a cell is that status."""
    return magnitude(code - status) < 0.5


@jit
def judged(b, d, f, e):
    """Lengths without units, their unit, their margins, and the verdict on the linkage."""
    lengths, unit, fine = in_units(b, d, f, e)
    margin = margins(*lengths)
    code = extremes.verdict(lengths, margin)
    return lengths, unit, margin, where(fine & (magnitude(unit) <= UNIT_LIMIT), code, OUT_OF_RANGE)


@jit
def no_rates(code):
    """In place of thd, rate_max and rate_min, where a method does not give them."""
    none = 0.0 * code + math.nan
    return none, none, none


@jit
def locks(code, lengths, margin):
    """Crank angles at which a linkage locks; computed only where one does."""
    inner, outer = 0.0 * code + math.nan, 0.0 * code + math.nan
    locked = said(code, LOCK_UP)
    if some(locked):
        first, second = extremes.locks(lengths, margin)
        inner, outer = where(locked, first, math.nan), where(locked, second, math.nan)
    return inner, outer


@jit
def write(
    i, kind, cell, angles, crank_angles, stops, pressed, rates, slopes, verdict,
    A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer, transmission_angle,
    thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
):  # fmt: skip
    """One cell, or the lanes': values for type A, of which only what exists is written.

    Parameters
    ----------
    kind : +1 or -1, of `side_of`
    cell : of `judged`
    angles, crank_angles, pressed, slopes : of `extremes`, its transmission and tolerances
    stops : of `locks`
    rates : thd and the largest and least rate of that type
    verdict : status where the linkage is OK, or a double crank
    """
    lengths, unit, _, code = cell
    flat, turns = said(code, CHANGE_POINT), said(code, OK)
    exists = turns | (flat & (lengths[3] <= lengths[0]))
    there = where(exists, kind, math.nan)
    A0[i], A1[i] = there * angles[0], where(exists, angles[1], math.nan)
    eta_plus[i], eta_minus[i] = there * angles[2], there * angles[3]
    theta_plus[i], theta_minus[i] = there * crank_angles[0], there * crank_angles[1]
    theta_lock[i], theta_lock_outer[i] = stops
    locked, whirls = said(code, LOCK_UP), said(code, DOUBLE_CRANK)
    transmission_angle[i] = where(turns | flat | whirls, pressed, where(locked, 0.0, math.nan))
    thd[i] = where(turns, rates[0], math.nan)
    rate_max[i] = where(turns | whirls, rates[1], math.nan)
    rate_min[i] = where(turns | whirls, rates[2], math.nan)
    mean_b, mean_d, swing_b, swing_d, coupler, crank = slopes
    per_metre = where(turns, pow2(-where(magnitude(unit) <= UNIT_LIMIT, unit, 0.0)), math.nan)
    of_mean = kind * per_metre
    A0_b[i], A0_d[i], A0_f[i], A0_e[i] = of_mean * mean_b, of_mean * mean_d, of_mean * crank, of_mean * coupler
    A1_b[i], A1_d[i], A1_f[i], A1_e[i] = (
        per_metre * swing_b,
        per_metre * swing_d,
        per_metre * coupler,
        per_metre * crank,
    )
    status[i] = verdict
