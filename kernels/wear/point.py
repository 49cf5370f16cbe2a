"""Wear of one material point of a turning workpiece under the tool of a polishing machine (Preston's law).

    h = preston int_0^tau p v [point in contact] dt                                                  (1)
The point is at the polar coordinates (r0, theta0) about the workpiece's centre at t = 0, when the crank is along the x
axis; model and names are those of `polisher_wear`, and for large tau points of a ring wear at its mean rate. Time is
split at every entry and exit, with none overlooked (`_path`), and integrated adaptively between them.
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (12) and (20), corrected; Preston (1927).

LOCK_UP: the crank does not turn fully, so there is no wear (NaN). STEP_LIMIT: tau is too long.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.interface import Field
from kernels.lanes.codes import INACCURATE, OUT_OF_RANGE, STEP_LIMIT
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.records import read
from kernels.lanes.vectors import magnitude, sqrt
from kernels.lanes.wiring import kernel, tracing
from kernels.maths import quadrature
from kernels.maths.elementary import in_unit, is_normal
from kernels.polisher import linkage
from kernels.wear import _path, _pressure, _scene
from kernels.wear._path import INSIDE, ONCE, OUTSIDE, STEPS, Course, Step, position
from kernels.wear._scene import Machine, signed_in_unit
from kernels.wear._tool import excess

_EPS = 2.0**-52
_TURN = 2.0 * math.pi
_DEPTH = _path.HALVINGS + 2


class Room(NamedTuple):
    """Space for panels of integrals and their nodes, and for the stack of times."""

    pool: np.ndarray
    nodes: quadrature.Nodes
    stack: np.ndarray


@jit_apart
def _speed(s, step):
    """Speed at a time s of a step, over the area of contact where the load is constant, and its rounding."""
    there = position(step, s)
    v = sqrt(there.vx * there.vx + there.vy * there.vy)
    blur = 4.0 * _EPS * (v + 2.0 * magnitude(step.course.ride.spin) * step.course.r)  # of two that may cancel
    if step.areas.panels == 0:
        return v, blur
    x, y = step.course.x, step.course.y
    w, cosine, sine = sqrt(x * x + y * y), 1.0, 0.0  # of the arm's angle from the direction of w
    if w > 0.0:
        cosine, sine = (x * there.c + y * there.s) / w, (x * there.s - y * there.c) / w
    weight, doubt, slope = _pressure.weight(step.areas, cosine, sine)
    return weight * v, weight * (blur + v * (doubt + 8.0 * _EPS * slope))


@jit_apart
def _speeds(kind, nodes, count, step):
    """The integrand: `_speed` at the times of all nodes."""
    for j in range(count):
        nodes.value[j], nodes.doubt[j] = _speed(nodes.x[j], step)


@jit_apart
def _polished(step, low, high, tolerance, room):
    """The way of polishing between two times within the tool, and its error; to `tolerance` times the way."""
    if not high > low:
        return 0.0, 0.0
    count = np.int64(0)
    quadrature.open_panel(room.pool, count, 0.0, low, high - low)
    return quadrature.adapt(_speeds, step, room.pool, room.nodes, count + 1, tolerance)


@jit_apart
def _way_in_step(step, h, curve, rtol, room):
    """The way of polishing in one step of time h, and its error."""
    stack, tool = room.stack, step.course.tool
    total, error, low, top = 0.0, 0.0, 0.0, np.int64(1)
    one = position(step, 0.0)
    stack[0] = h
    least = h * 0.5**_path.HALVINGS
    entered, inside = 0.0, False
    while top > 0:
        high = stack[top - 1]
        two = position(step, high)
        verdict = _path.judged(tool, one, two, high - low, curve)
        before, after = excess(tool, one.x, one.y) < 0.0, excess(tool, two.x, two.y) < 0.0
        tiny = high - low <= least
        if not (verdict in (INSIDE, OUTSIDE, ONCE) or tiny):
            stack[top] = 0.5 * (low + high)
            top += 1
            continue
        now = before if verdict == ONCE else verdict == INSIDE or (tiny and after)
        if tiny:
            error += (high - low) * _speed(high, step)[0]
        crossed, then = low, now
        if verdict == ONCE and before != after:
            crossed, blur = _path.crossing(step, low, high)
            then = after
            error += min(blur, high - low) * _speed(high, step)[0]
        for s, here in ((low, now), (crossed, then)):
            if here and not inside:
                entered = s
            if inside and not here:
                way, doubt = _polished(step, entered, s, rtol, room)
                total, error = total + way, error + doubt
            inside = here
        low, one = high, two
        top -= 1
    if inside:
        way, doubt = _polished(step, entered, h, rtol, room)
        total, error = total + way, error + doubt
    return total, error


@jit_apart
def way(course, areas, theta0, tau, rtol, room):
    """The way of polishing over the time tau, its error, and whether there were few enough steps.

    A step is a share of a turn of the crank or the work, whichever is faster; what both turn by in it is kept as pairs.
    """
    speed, spin = course.ride.speed, course.ride.spin
    if speed == 0.0 and spin == 0.0:
        return 0.0, 0.0, True
    if speed == 0.0:
        h, crank, crank_low = _TURN / (STEPS * magnitude(spin)), 0.0, 0.0
        work, work_low = (1.0 if spin > 0.0 else -1.0) / STEPS, 0.0
    else:
        ratio, sign = spin / speed, 1.0 if speed > 0.0 else -1.0
        count = STEPS * math.ceil(max(1.0, min(magnitude(ratio), 1e9)))
        h, crank, work = _TURN / (count * magnitude(speed)), sign / count, sign * ratio / count
        crank_low = linkage.fma(-crank, count, sign) / count
        low = linkage.fma(-ratio, speed, spin) / speed
        work_low = linkage.fma(-work, count, sign * ratio) / count + sign * low / count
    steps = tau / h
    if not steps < _path.STEP_LIMIT:
        return 0.0, 0.0, False
    curve = _path.bend(course)
    total, error = 0.0, 0.0
    for j in range(int(steps) + 1):
        rest = h * (steps - j)
        if rest > 0.0:
            turned = theta0 + _path.phase(j, work, work_low)
            step = Step(course, _path.phase(j, crank, crank_low), turned, areas)
            more, doubt = _way_in_step(step, min(h, rest), curve, rtol, room)
            total, error = total + more, error + doubt
    return total, error + 4.0 * _EPS * total, True


@jit
def _follow(i, columns, room, memory):
    """(1), split at every entry and exit; one cell at a time, for no two split alike."""
    p, rtol, r0 = read(Machine, columns, i), columns.rtol[i], columns.r0[i]
    areas = _pressure.areas_of(i, p, columns, memory)
    setup = _scene.without_units(p)
    ride, unit, tool = setup.ride, setup.unit, setup.tool
    x, y, r = signed_in_unit(p.w_x, unit), signed_in_unit(p.w_y, unit), in_unit(r0, unit)
    course = Course(setup.arm, linkage.side_of(p.type), p.b_angle, ride, x, y, p.beta, r, tool)
    time = in_unit(columns.tau[i], -setup.pace)
    wear, doubt, status = math.nan, math.nan, setup.verdict
    if _scene.turns_fully(status):
        if r0 > p.workpiece_radius > 0.0 or r > 4.0 * (ride.reach + ride.w + tool.a + tool.b):
            wear, doubt = 0.0, 0.0
        else:
            value, error, short = way(course, areas, columns.theta0[i], time, 0.25 * rtol, room)
            hard, units = (p.pressure, unit) if areas.panels == 0 else (p.load, -unit)
            if short:
                wear = _scene.with_units(value, p.preston, hard, units)
                doubt = _scene.with_units(error, p.preston, hard, units)
                status = status if error <= rtol * value else INACCURATE
                status = OUT_OF_RANGE if value > 0.0 and not is_normal(wear) else status
            else:
                status = STEP_LIMIT
    columns.wear[i], columns.wear_error[i], columns.status[i] = wear, doubt, status


@jit
def _buffers():
    return Room(np.empty(quadrature.POOL), quadrature.nodes(), np.empty(_DEPTH)), _pressure.memory()


POLISHER_WEAR_POINT = kernel(
    "polisher_wear_point",
    doc="Preston wear of one point of a turning workpiece under the tool of a polishing machine",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), corrected and completed",
    parameters=(
        *_scene.PARAMETERS,
        Field("r0", "m", "distance of the point from the workpiece's centre", lower=0.0),
        Field("theta0", "rad", "its direction at the start, from the x axis", **_scene.ANGLE),
        Field("tau", "s", "time of polishing", lower=0.0),
    ),
    outputs=(
        Field("wear", "m", "depth worn away"),
        Field("wear_error", "m", "error bound of the wear", of_method=True),
    ),
    check=_scene.check,
    methods=(
        tracing("path", "time split at every entry and exit, adaptive to rtol between them",
                _follow, buffers=_buffers, loop=cell_by_cell),
    ),
    example=_scene.EXAMPLE | {"r0": 0.05, "theta0": 0.0, "tau": 100.0},
)  # fmt: skip
