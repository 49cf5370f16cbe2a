"""What the kernels of wear share: their parameters, the check of them, and the machine without units."""

from collections import namedtuple
from typing import NamedTuple

from kernels.interface import FIRST_REFUSAL, Field
from kernels.lanes.codes import BAD_INPUT, CHANGE_POINT, DOUBLE_CRANK, OK, OUT_OF_RANGE
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.vectors import magnitude, not_, sqrt, where
from kernels.maths.elementary import in_unit, mantissa_exponent
from kernels.maths.wide import number, times, wide
from kernels.polisher import extremes, linkage
from kernels.wear import _dwell
from kernels.wear._dwell import Arm
from kernels.wear._tool import Tool, power, sincos

ANGLE_LIMIT = 1e6
"""Angles beyond which no digits are left of their sines."""
EXPONENT_LIMITS = 0.5, 100.0
_SPAN = 2.0**-100  # of a length of the work over the longest of them


Ride = namedtuple("Ride", "speed spin reach w turn_c turn_s")
"""Rates of the crank and of the work, L, w, cosine and sine of the direction of w from b + beta."""


class Setup(NamedTuple):
    """A machine without units: lengths of the work are over 2^unit, rates over 2^pace; and the verdict on it."""

    arm: Arm
    tool: Tool
    ride: Ride
    unit: float
    pace: float
    verdict: float


@jit
def check(p):
    """BAD_INPUT unless just one of pressure and load is given, and with a load the workpiece's radius."""
    hard, loaded = p.pressure > 0.0, p.load > 0.0
    one = (hard & not_(loaded)) | (loaded & not_(hard))
    return where(one & (not_(loaded) | (p.workpiece_radius > 0.0)), OK, BAD_INPUT)


@jit
def turns_fully(verdict):
    """Whether there is a motion to wear by."""
    return verdict in (OK, CHANGE_POINT, DOUBLE_CRANK)


@jit_apart
def signed_in_unit(x, unit):
    """x over 2^unit."""
    value = in_unit(magnitude(x), unit)
    return -value if x < 0.0 else value


@jit_apart
def _unit_of(x):
    """Power of two next below x; of 0: of 1."""
    return mantissa_exponent(x if x > 0.0 else 1.0)[1]


@jit_apart
def without_units(p):
    """The `Setup` of a machine. Angles of type B are mirrored at the frame."""
    lengths, _, normal = linkage.in_units(p)
    margin = linkage.margins(lengths)
    verdict = extremes.verdict(lengths, margin) if normal else OUT_OF_RANGE
    unit = _unit_of(max(max(p.L, max(p.tool_a, p.tool_b)), max(magnitude(p.w_x), magnitude(p.w_y))))
    pace = _unit_of(max(magnitude(p.omega), magnitude(p.Omega)))
    a, b, reach = in_unit(p.tool_a, unit), in_unit(p.tool_b, unit), in_unit(p.L, unit)
    x, y = signed_in_unit(p.w_x, unit), signed_in_unit(p.w_y, unit)
    w = max(magnitude(x), magnitude(y))
    if w > 0.0 and min(magnitude(x), magnitude(y)) > 0.0:
        w = sqrt(x * x + y * y)
    s_b, c_b = sincos(p.b_angle)
    s, c = sincos(p.beta)
    c, s = c * c_b - s * s_b, s * c_b + c * s_b
    cosine, sine = (x * c + y * s) / w if w > 0.0 else 1.0, (y * c - x * s) / w if w > 0.0 else 0.0
    speed, spin = signed_in_unit(p.omega, pace), signed_in_unit(p.Omega, pace)
    ride = Ride(speed, spin, reach, w, cosine, -sine if p.type == 1.0 else sine)
    fine = a >= _SPAN and b >= _SPAN and (w == 0.0 or w >= _SPAN) and (reach == 0.0 or reach >= _SPAN)
    fine = fine and (p.workpiece_radius == 0.0 or in_unit(p.workpiece_radius, unit) >= _SPAN)
    verdict = verdict if fine or verdict >= FIRST_REFUSAL else OUT_OF_RANGE
    n, m = p.tool_n, p.tool_m
    tool = Tool(a, b, n, m, power(0.5, 1.0 / n), power(0.5, 1.0 / m))
    return Setup(_dwell.arm_of(lengths, margin), tool, ride, unit, pace, verdict)


@jit_apart
def with_units(value, preston, pressure, units):
    """`value` times preston, pressure and 2^units, without overflow on the way."""
    preston, pressure, (m, e) = wide((preston, pressure, value))
    return number(times(times(preston, pressure), (m, e + units))) if value > 0.0 else value


ANGLE = {"default": 0.0, "lower": -ANGLE_LIMIT, "upper": ANGLE_LIMIT}
_EXPONENT = {"lower": EXPONENT_LIMITS[0], "upper": EXPONENT_LIMITS[1]}

PARAMETERS = (
    *linkage.PARAMETERS,
    Field("omega", "rad/s", "angular rate of the crank"),
    Field("b_angle", "rad", "direction of b, from the arm's pivot to the motor's shaft", **ANGLE),
    Field("L", "m", "distance of the tool's centre from the arm's pivot", lower=0.0),
    Field("beta", "rad", "angle of the tool's centre ahead of the arm, seen from the pivot", **ANGLE),
    Field("w_x", "m", "x of the workpiece's centre, from the arm's pivot"),
    Field("w_y", "m", "y of the workpiece's centre, from the arm's pivot", default=0.0),
    Field("Omega", "rad/s", "angular rate of the work"),
    Field("tool_a", "m", "half width of the tool along the arm", lower=0.0, open_lower=True),
    Field("tool_b", "m", "half width of the tool across the arm", default="tool_a", lower=0.0, open_lower=True),
    Field("tool_n", "1", "exponent of abs(X/a), along the arm; 2: ellipse, 1: rhombus, 100: square", 2.0, **_EXPONENT),
    Field("tool_m", "1", "exponent of abs(Y/b), across the arm", "tool_n", **_EXPONENT),
    Field("preston", "1/Pa", "Preston's coefficient: depth per distance and pressure", lower=0.0, open_lower=True),
    Field("pressure", "Pa", "pressure under the tool, if constant; or else load and workpiece_radius",
          default=0.0, lower=0.0, open_lower=True),
    Field("load", "N", "force on the tool, if constant: pressure is load over the area of contact",
          default=0.0, lower=0.0),
    Field("workpiece_radius", "m", "radius of the workpiece, beyond which nothing wears; needed with load; 0: no rim",
          default=0.0, lower=0.0),
)  # fmt: skip

Machine = namedtuple("Machine", [field.name for field in PARAMETERS])

EXAMPLE = linkage.EXAMPLE | {
    "omega": 2.0, "b_angle": -0.66, "L": 0.5, "beta": 0.0, "w_x": 0.5, "w_y": 0.0, "Omega": 0.8, "tool_a": 0.06,
    "tool_b": 0.06, "tool_n": 2.0, "tool_m": 2.0, "preston": 1e-13, "pressure": 7000.0, "load": 0.0,
    "workpiece_radius": 0.0,
}  # fmt: skip
