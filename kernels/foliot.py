"""Verge and foliot: the limit cycle.

    phi'' + a phi' = +-mu                                                                          (1)

The torque changes sign as phi passes +-phi0 on its way out. Leaves out: recoil of the crown wheel, the geometry of
the pallets, the fine structure of the torque. Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681.
"""

import math

from kernels import _viscous
from kernels._jit import entry, jit
from kernels._lanes import each_cell, where
from kernels.interface import Status

_OK, _OUT_OF_RANGE = float(Status.OK), float(Status.OUT_OF_RANGE)


@jit
def _write(i, scene, cycle, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    period[i], amplitude[i], crossing_speed[i], normal = _viscous.dimensional(scene, cycle)
    sensitivity[i], multiplier[i] = cycle[3], cycle[4]
    status[i] = where(normal, _OK, _OUT_OF_RANGE)


@jit
def _closed(i, mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    k, rest, scene = _viscous.without_dimensions(mu[i], phi0[i], a[i])
    cycle = _viscous.closed(k, rest)
    _write(i, scene, cycle, period, amplitude, crossing_speed, sensitivity, multiplier, status)


@entry
def closed(mu, phi0, a, rtol, period, amplitude, crossing_speed, sensitivity, multiplier, status):
    """The root q of q - tanh q = 1/alpha from fitted polynomials: 1e-15 at every drive, no iteration."""
    each_cell(_closed, (mu, phi0, a, period, amplitude, crossing_speed, sensitivity, multiplier, status))
