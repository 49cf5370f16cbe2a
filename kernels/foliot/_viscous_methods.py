"""The foliot with viscous friction alone: its methods, from two series to the iterated map.

They read mu, phi0 and a only; the physics is in `_viscous`, the declaration in `foliot`.
"""

import math

from kernels.foliot import _viscous
from kernels.lanes.codes import NOT_CONVERGED, OK
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged
from kernels.lanes.vectors import where

SENSITIVITY, MULTIPLIER = 3, 4
"""Positions of these outputs."""


@jit
def _write(i, scene, cycle, verdict, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    period[i], amplitude[i], crossing_speed[i], sound, whole = _viscous.dimensional(scene, cycle)
    sensitivity[i], multiplier[i] = cycle[3], cycle[4]
    status[i] = judged(sound, whole, verdict)


@jit
def _closed(i, mu, phi0, a, *outputs):
    k, rest, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle = _viscous.closed(k, rest)
    _write(i, scene, cycle, OK, *outputs)


@entry()
def closed(mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """The root q of q - tanh q = 1/alpha from fitted polynomials: 1e-15 at every drive, no iteration."""
    each_cell(_closed, (mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _asymptotic(i, mu, phi0, a, *outputs):
    k, _, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle = _viscous.asymptotic(k)
    _write(i, scene, cycle, OK, *outputs)


@entry()
def asymptotic(
    mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status
):
    """Weak and strong series: the period within 0.5 %, the sensitivity within 2.2 % at every drive."""
    each_cell(_asymptotic, (mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def _event_map(i, mu, phi0, a, rtol, *outputs):
    k, _, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle, unsettled = _viscous.event_map(k, rtol[i])
    verdict = where(unsettled, NOT_CONVERGED, OK)
    _write(i, scene, cycle, verdict, *outputs)


@entry()
def event_map(
    mu, phi0, a, R, R_s, c, n, k, e, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status
):
    """The exact map from switch to switch, iterated from rest; slow at strong drive, where a swing forgets little."""
    each_cell(_event_map, (mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status))


@jit
def worst(asked, cycle, sensitivity, multiplier):
    """The largest bound of the outputs asked for: period, amplitude and speed share the first."""
    swing = where((asked[0] | asked[1] | asked[2]) > 0, cycle, 0.0)
    found = _larger(swing, where(asked[SENSITIVITY] > 0, sensitivity, 0.0))
    return _larger(found, where(asked[MULTIPLIER] > 0, multiplier, 0.0))


@jit
def _larger(x, y):
    """NaN is infinite."""
    return where(x <= y, y, where(x > y, x, math.inf))


@jit
def _asymptotic_bound(i, mu, phi0, a, out, asked):
    k, _, _ = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    out[i] = worst(asked, *_viscous.asymptotic_bound(k))


@entry("asked")
def asymptotic_bound(mu, phi0, a, R, R_s, c, n, k, e, rtol, asked, out):
    """Bound on the error of `asymptotic`: the first terms left out."""
    each_cell(_asymptotic_bound, (mu, phi0, a, out, asked))


@jit
def _event_map_bound(i, mu, phi0, a, out, asked):
    k, _, _ = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    out[i] = worst(asked, *_viscous.event_map_bound(k))


@entry("asked")
def event_map_bound(mu, phi0, a, R, R_s, c, n, k, e, rtol, asked, out):
    """What rounding leaves of the iterated map; that it settles to rtol, its status says."""
    each_cell(_event_map_bound, (mu, phi0, a, out, asked))


@entry("asked")
def closed_bound(mu, phi0, a, R, R_s, c, n, k, e, rtol, asked, out):
    """`closed` is right to rounding everywhere."""
    out[:] = worst(asked, _viscous.ROUNDING, _viscous.ROUNDING, 2.0 * _viscous.ROUNDING)
