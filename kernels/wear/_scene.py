"""What the kernels of wear share: their parameters, the check of them, and the scene without units."""

import math

import numpy as np

from kernels.interface import Field
from kernels.lanes.codes import CHANGE_POINT, DOUBLE_CRANK, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths.elementary import in_unit, mantissa_exponent, scale
from kernels.polisher import extremes, linkage
from kernels.polisher.linkage import EXAMPLE as LINKS
from kernels.polisher.linkage import PARAMETERS as LINK_PARAMETERS
from kernels.wear import _dwell, _tool
from kernels.wear._tool import sincos

ANGLE_LIMIT = 1e6
"""Angles beyond which no digits are left of their sines."""
EXPONENT_LIMITS = 0.5, 100.0
_SPAN = 2.0**-100  # of a length of the work over the longest of them


@jit
def allowed(b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston):
    """Whether the parameters are numbers within their limits; NaN fails."""
    links = b > 0.0 and d > 0.0 and f > 0.0 and e >= 0.0 and max(max(b, d), max(f, e)) < math.inf
    kind = type == 0.0 or type == 1.0
    turns = magnitude(omega) < math.inf and magnitude(Omega) < math.inf and preston > 0.0 and preston < math.inf
    angles = magnitude(b_angle) <= ANGLE_LIMIT and magnitude(beta) <= ANGLE_LIMIT
    work = 0.0 <= L < math.inf and magnitude(w_x) < math.inf and magnitude(w_y) < math.inf
    size = tool_a > 0.0 and tool_a < math.inf and tool_b > 0.0 and tool_b < math.inf
    low, high = EXPONENT_LIMITS
    shape = tool_n >= low and tool_n <= high and tool_m >= low and tool_m <= high
    return links and kind and turns and angles and work and size and shape


@jit_call
def arm_without_units(b, d, f, e):
    """The arm of `_dwell`, its lengths and margins, and the verdict on the linkage: OK, a remark or a refusal."""
    lengths, _, fine = linkage.in_units(linkage.Lengths(b, d, f, e))
    margin = linkage.margins(lengths)
    verdict = extremes.verdict(lengths, margin)
    return _dwell.arm_of(lengths, margin), lengths, margin, verdict if fine else OUT_OF_RANGE


@jit_call
def side_by_side(columns):
    """The parameters of each cell in a row."""
    rows = np.empty((columns[0].size, len(columns)))
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            rows[i, k] = columns[k][i]
    return rows


@jit
def turns_fully(verdict):
    """Whether there is a motion to wear by."""
    return verdict in (OK, CHANGE_POINT, DOUBLE_CRANK)


@jit_call
def signed_in_unit(x, unit):
    """x over 2^unit."""
    value = in_unit(magnitude(x), unit)
    return -value if x < 0.0 else value


@jit_call
def _unit_of(x):
    """Power of two next below x; of 0: of 1."""
    return mantissa_exponent(x if x > 0.0 else 1.0)[1]


@jit_call
def work_without_units(p):
    """The tool, the ride (rates of crank and work, L, w, direction of w), both units, and whether all is in range.

    p: the parameters of a cell. Angles of type B are mirrored at the frame. Lengths are over 2^(first unit), rates over
    2^(second unit).
    """
    omega, b_angle, L, beta = p[5], p[6], p[7], p[8]
    w_x, w_y, Omega, tool_a, tool_b = p[9], p[10], p[11], p[12], p[13]
    unit = _unit_of(max(max(L, max(tool_a, tool_b)), max(magnitude(w_x), magnitude(w_y))))
    x, y, reach = signed_in_unit(w_x, unit), signed_in_unit(w_y, unit), in_unit(L, unit)
    a, b = in_unit(tool_a, unit), in_unit(tool_b, unit)
    w = max(magnitude(x), magnitude(y))
    if w > 0.0 and min(magnitude(x), magnitude(y)) > 0.0:
        w = sqrt(x * x + y * y)
    fine = a >= _SPAN and b >= _SPAN and (w == 0.0 or w >= _SPAN) and (reach == 0.0 or reach >= _SPAN)
    fine = fine and (p[19] == 0.0 or in_unit(p[19], unit) >= _SPAN)
    s_b, c_b = sincos(b_angle)
    s, c = sincos(beta)
    c, s = c * c_b - s * s_b, s * c_b + c * s_b
    cosine, sine = (x * c + y * s) / w if w > 0.0 else 1.0, (y * c - x * s) / w if w > 0.0 else 0.0
    pace = _unit_of(max(magnitude(omega), magnitude(Omega)))
    ride = (
        signed_in_unit(omega, pace), signed_in_unit(Omega, pace), reach, w,
        cosine, -sine if p[4] == 1.0 else sine,
    )  # fmt: skip
    return _tool.tool_of(a, b, p[14], p[15]), ride, unit, pace, fine


@jit
def pressed(pressure, load, workpiece_radius):
    """Whether just one of pressure and load is given, and with a load the workpiece's radius; NaN fails."""
    numbers = 0.0 <= pressure < math.inf and 0.0 <= load < math.inf and 0.0 <= workpiece_radius < math.inf
    return numbers and (pressure > 0.0) != (load > 0.0) and (load == 0.0 or workpiece_radius > 0.0)


@jit_call
def with_units(value, preston, pressure, units):
    """`value` times preston, pressure and 2^units, without overflow on the way."""
    m, e = mantissa_exponent(preston)
    m_p, e_p = mantissa_exponent(pressure)
    m_v, e_v = mantissa_exponent(value if value > 0.0 else 1.0)
    return scale(m * m_p * m_v, e + e_p + e_v + units) if value > 0.0 else value


PARAMETERS = (
    *LINK_PARAMETERS,
    Field("omega", "rad/s", "angular rate of the crank"),
    Field("b_angle", "rad", "direction of b, from the arm's pivot to the motor's shaft", default=0.0,
          lower=-ANGLE_LIMIT, upper=ANGLE_LIMIT),
    Field("L", "m", "distance of the tool's centre from the arm's pivot", lower=0.0),
    Field("beta", "rad", "direction of the tool's centre, seen from the pivot, from d on", default=0.0,
          lower=-ANGLE_LIMIT, upper=ANGLE_LIMIT),
    Field("w_x", "m", "centre of the work, from the arm's pivot"),
    Field("w_y", "m", "centre of the work, from the arm's pivot", default=0.0),
    Field("Omega", "rad/s", "angular rate of the work"),
    Field("tool_a", "m", "half width of the tool along the arm", lower=0.0, open_lower=True),
    Field("tool_b", "m", "half width of the tool across the arm", default="tool_a", lower=0.0, open_lower=True),
    Field("tool_n", "1", "exponent of abs(X/a), along the arm; 2: ellipse, 1: rhombus, 100: square", default=2.0,
          lower=EXPONENT_LIMITS[0], upper=EXPONENT_LIMITS[1]),
    Field("tool_m", "1", "exponent of abs(Y/b), across the arm", default="tool_n",
          lower=EXPONENT_LIMITS[0], upper=EXPONENT_LIMITS[1]),
    Field("preston", "1/Pa", "wear per way and pressure", lower=0.0, open_lower=True),
)  # fmt: skip

PRESS = (
    Field("pressure", "Pa", "pressure under the tool, if constant; or else load and workpiece_radius", default=0.0,
          lower=0.0, open_lower=True),
    Field("load", "N", "force on the tool, if constant: pressure is load over the area of contact", default=0.0,
          lower=0.0),
    Field("workpiece_radius", "m", "radius of the workpiece, beyond which nothing wears; needed with load; 0: no rim",
          default=0.0, lower=0.0),
)  # fmt: skip

EXAMPLE = LINKS | {
    "omega": 2.0, "b_angle": -0.66, "L": 0.5, "beta": 0.0, "w_x": 0.5, "w_y": 0.0, "Omega": 0.8,
    "tool_a": 0.06, "tool_b": 0.06, "tool_n": 2.0, "tool_m": 2.0,
    "preston": 1e-13, "pressure": 7000.0, "load": 0.0, "workpiece_radius": 0.0,
}  # fmt: skip
