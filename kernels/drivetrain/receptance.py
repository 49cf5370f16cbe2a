"""Drivetrain: receptance, the angle of one inertia per torque at another, against frequency.

A chain of n inertias, J_1 -k_1- J_2 - ... - J_n -k_n- ground, each spring with a damper h_j beside it. For a torque
exp(i w t) at `drive_mass` the angle at `read_mass` is H exp(i w t), with
    (-w^2 J + i w h + k) H = unit torque,  w = 2 pi frequency,                                          (1)
J diagonal, k and h tridiagonal. The response is linear in the torque. k_n = 0 leaves the end free.
Leaves out: backlash, solid friction, damping that is not viscous. Source: the drivetrain of a milling machine after
Rivin; `_receptance` describes the solution of (1) and the bound that decides on INACCURATE.

rtol limits abs(dH)/abs(H) at every frequency: the phase is accurate to it in radian, the decibel to 8.7 times it.
At an undamped resonance, and at 0 Hz without a spring to ground, H is infinite: it is NaN there, and the cell is
PARTLY_OUT_OF_RANGE, or OUT_OF_RANGE if there is no other frequency.
"""

import math
from collections import namedtuple

import numpy as np

from kernels.drivetrain._chain import TURN, Chain, refusal, take_units
from kernels.drivetrain._frequencies import row_at
from kernels.drivetrain._receptance import receptance
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, INACCURATE, OK, OUT_OF_RANGE, PARTLY_OUT_OF_RANGE
from kernels.lanes.columns import FEW, cell_by_cell
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.records import read
from kernels.lanes.vectors import where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths import complex
from kernels.maths.elementary import arctan2, hypot, is_normal, log, scale

_DB = 20.0 / math.log(10.0)


@jit_apart
def _write(i, j, lanes, sound, values, output, rows):
    """output[i, j ...] = values of the lanes that are frequencies; NaN where they are not `sound`."""
    rows[row_at(0)] = where(sound, values, math.nan)
    for lane in range(lanes):
        output[i, j + lane] = rows[lane]


@jit_apart
def _follow(i, columns, chain, rows):
    """Both ends followed to the inertia that is turned, FEW frequencies at a time: they share their chain."""
    p, count, worst, given = read(Drive, columns, i), columns.frequency.size, 0.0, 0
    e_J, e_k = take_units(p.J, p.k, p.h, chain)
    for j in range(0, count, FEW):
        lanes = min(FEW, count - j)
        for lane in range(FEW):  # the last one again beyond the end
            rows[lane] = columns.frequency[min(j + lane, count - 1)]
        w = scale(rows[row_at(0)] * TURN, -0.5 * (e_k - e_J))
        re, im, e, error = receptance(chain, w, int(p.drive_mass), int(p.read_mass), row_at, rows)
        re, im = complex.scaled((re, im), e - e_k)
        amplitude = hypot(re, im)
        sound = is_normal(amplitude) & (error < math.inf)
        _write(i, j, lanes, sound, re, columns.receptance_re, rows)
        _write(i, j, lanes, sound, im, columns.receptance_im, rows)
        _write(i, j, lanes, sound, amplitude, columns.amplitude, rows)
        _write(i, j, lanes, sound, 0.0 - arctan2(-im, re), columns.phase, rows)  # [-pi, pi)
        _write(i, j, lanes, sound, _DB * log(where(sound, amplitude, 1.0)), columns.amplitude_dB, rows)
        rows[row_at(0)] = where(sound, error, -1.0)
        for lane in range(lanes):
            worst = max(worst, rows[lane])
            given += rows[lane] >= 0.0
    verdict = OK if given == count else PARTLY_OUT_OF_RANGE
    columns.status[i] = where(worst <= columns.rtol[i], verdict, INACCURATE) if given > 0 else OUT_OF_RANGE


@jit
def _buffers(columns):
    n = columns.J.shape[1]
    rows, none = np.empty((4, n)), np.empty(0, np.complex128)
    return Chain(rows[0], rows[1], rows[2], rows[3], none), np.empty(3 * n * FEW)


@jit
def check(p):
    """BAD_INPUT where a spring but the last is 0, or there is no such mass.

    OUT_OF_RANGE where inertias, or springs, are more than 2^300 apart.
    """
    n = p.J.size
    return where((p.drive_mass <= n) & (p.read_mass <= n), refusal(n, p.J, p.k), BAD_INPUT)


PARAMETERS = (
    Field("J", "kg m^2", "moments of inertia, beginning at the free end", lower=0.0, open_lower=True, dims=("mass",)),
    Field("k", "N m/rad", "stiffness of the spring after each; last one 0: no ground", lower=0.0, dims=("mass",)),
    Field("h", "N m s/rad", "damping parallel to each spring", lower=0.0, dims=("mass",)),
    Field("drive_mass", "1", "number of the inertia with the torque", 1.0, lower=1.0, upper=64.0, integer=True),
    Field("read_mass", "1", "number of the inertia whose angle is given", "drive_mass", 1.0, 64.0, integer=True),
)  # fmt: skip
"""The chain, and the numbers of the inertias with the torque and with the angle."""

Drive = namedtuple("Drive", [field.name for field in PARAMETERS])

MILLING_MACHINE = {
    "J": (0.2520, 0.01226, 0.002785, 0.007541, 0.01422, 0.06374, 0.9414, 0.9752),
    "k": (73844.0, 37167.0, 8228.0, 13455.0, 39325.0, 27459.0, 51485.0, 11690.0),
    "h": (1.765, 0.4119, 0.1863, 0.3628, 0.9561, 1.834, 7.061, 127.5),
}
"""Drive of a milling machine, spindle first (Baran & Marchelek, Mech. Teor. Stos. 9:201 (1971), table 1, in SI)."""

DRIVETRAIN_FRF = kernel(
    "drivetrain_frf",
    doc="angle of one inertia of a drivetrain per torque at another, against frequency",
    source="drivetrain of a milling machine after Rivin; solution and error bound derived in `_receptance`",
    parameters=PARAMETERS,
    outputs=(
        Field("receptance_re", "rad/(N m)", "receptance, real part", dims=("frequency",)),
        Field("receptance_im", "rad/(N m)", "receptance, imaginary part", dims=("frequency",)),
        Field("amplitude", "rad/(N m)", "modulus of the receptance", dims=("frequency",)),
        Field("phase", "rad", "angle of the receptance, in [-pi, pi): negative where it lags", dims=("frequency",)),
        Field("amplitude_dB", "1", "amplitude over 1 rad/(N m), in decibel", dims=("frequency",)),
    ),
    record=Drive,
    check=check,
    loop=cell_by_cell,
    methods=(
        tracing(
            "continued", "recursion from both ends of the chain at each frequency", _follow,
            buffers=_buffers, loop=cell_by_cell,
        ),
    ),
    along=(Field("frequency", "Hz", "frequency of the torque", lower=0.0),),
    example=MILLING_MACHINE,
)  # fmt: skip
