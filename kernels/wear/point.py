"""Wear of one material point of a turning workpiece under the tool of a polishing machine (Preston's law).

    h = preston int_0^tau p v [point in contact] dt                                                  (1)
The point is at (r0, theta0), polar, about the workpiece's centre at t = 0, when the crank is along the x axis; model
and names are those of `polisher_wear`; for large tau the points of a ring wear at its rate on average. Time is split at
every entry and exit, none overlooked (`_path`), and between them integrated adaptively.
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (12) and (20), corrected; Preston (1927).

LOCK_UP: the crank does not turn fully, so there is no wear (NaN). STEP_LIMIT: tau is too long.
"""

import math

import numpy as np

from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT, INACCURATE, OK, OUT_OF_RANGE, STEP_LIMIT
from kernels.lanes.columns import entry_of_cells, one_by_one
from kernels.lanes.jit import jit, jit_call, jit_inline
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths import quadrature
from kernels.maths.elementary import in_unit, is_normal, mantissa_exponent, scale
from kernels.polisher import linkage
from kernels.wear import _path, _pressure, _scene
from kernels.wear._path import INSIDE, ONCE, OUTSIDE, STEPS
from kernels.wear._scene import ANGLE_LIMIT, allowed, pressed

_EPS = 2.0**-52
_TURN = 2.0 * math.pi
_DEPTH = _path.HALVINGS + 2


@jit_call
def _speed(kind, s, scene):
    """Speed at a time s of a step, over the area of contact where the load is constant, and its rounding."""
    path, cranked, turned, loaded = scene
    _, _, vx, vy = _path.position(path, cranked, turned, s)
    v = sqrt(vx * vx + vy * vy)
    if loaded[1] == 0:
        return v, 4.0 * _EPS * v
    cosine, sine = _path.facing(path, cranked, s)
    weight, doubt, slope = _pressure.weight(loaded, cosine, sine)
    return weight * v, weight * v * (4.0 * _EPS + doubt + 8.0 * _EPS * slope)


@jit_call
def _polished(scene, low, high, tolerance, pool):
    """The way of polishing between two times within the tool, and its error; to `tolerance` times the way."""
    if not high > low:
        return 0.0, 0.0
    count = int(0.0)
    quadrature.open_panel(pool, count, 0.0, low, high - low)
    return quadrature.adapt(_speed, scene, pool, count + 1, tolerance)


@jit_call
def _step(scene, h, curve, rtol, stack, pool):
    """The way of polishing in one step of time h, and its error."""
    path, cranked, turned, _ = scene
    tool = path[3]
    total, error, low, top = 0.0, 0.0, 0.0, int(1.0)
    one = _path.position(path, cranked, turned, 0.0)
    stack[0] = h
    least = h * 0.5**_path.HALVINGS
    entered, inside = 0.0, False
    while top > 0:
        high = stack[top - 1]
        two = _path.position(path, cranked, turned, high)
        verdict = _path.judged(tool, one, two, high - low, curve)
        before = _path.excess(tool, one[0], one[1]) < 0.0
        after = _path.excess(tool, two[0], two[1]) < 0.0
        tiny = high - low <= least
        if not (verdict in (INSIDE, OUTSIDE, ONCE) or tiny):
            stack[top] = 0.5 * (low + high)
            top += 1
            continue
        now = before if verdict == ONCE else verdict == INSIDE or (tiny and after)
        if tiny:
            error += (high - low) * _speed(0.0, high, scene)[0]
        if now and not inside:
            entered = low
        if inside and not now:
            way, doubt = _polished(scene, entered, low, rtol, pool)
            total, error = total + way, error + doubt
        inside = now
        if verdict == ONCE and before != after:
            s, blur = _path.crossing(path, cranked, turned, low, high)
            error += min(blur, high - low) * _speed(0.0, high, scene)[0]
            if after:
                entered = s
            else:
                way, doubt = _polished(scene, entered, s, rtol, pool)
                total, error = total + way, error + doubt
            inside = after
        low, one = high, two
        top -= 1
    if inside:
        way, doubt = _polished(scene, entered, h, rtol, pool)
        total, error = total + way, error + doubt
    return total, error


@jit
def _clock(speed, spin):
    """Time of a step, and what the crank and the work turn by in it, in turns, the latter as a pair."""
    if speed == 0.0:
        return _TURN / (STEPS * magnitude(spin)), 0.0, 0.0, (1.0 if spin > 0.0 else -1.0) / STEPS, 0.0
    ratio = spin / speed
    steps = STEPS * math.ceil(max(1.0, min(magnitude(ratio), 1e9)))
    low = linkage.fma(-ratio, speed, spin) / speed
    sign = 1.0 if speed > 0.0 else -1.0
    share = sign * ratio / steps
    rest = linkage.fma(-share, steps, sign * ratio) / steps
    turn = sign / steps
    turn_rest = linkage.fma(-turn, steps, sign) / steps
    return _TURN / (steps * magnitude(speed)), turn, turn_rest, share, rest + sign * low / steps


@jit_call
def way(path, loaded, theta0, tau, rtol, work):
    """The way of polishing over the time tau, its error, and whether there were few enough steps."""
    pool, stack = work
    speed, spin = path[1][0], path[1][1]
    if speed == 0.0 and spin == 0.0:
        return 0.0, 0.0, True
    h, cranked, cranked_low, turned, turned_low = _clock(speed, spin)
    steps = tau / h
    if not steps < _path.STEP_LIMIT:
        return 0.0, 0.0, False
    curve = _path.bend(path)
    total, error = 0.0, 0.0
    for j in range(int(steps) + 1):
        rest = h * (steps - j)
        scene = (
            path, _path.phase(j, cranked, cranked_low), theta0 + _path.phase(j, turned, turned_low), loaded,
        )  # fmt: skip
        if rest > 0.0:
            more, doubt = _step(scene, min(h, rest), curve, rtol, stack, pool)
            total, error = total + more, error + doubt
    return total, error + 4.0 * _EPS * (total + tau * 0.0), True


@jit_inline
def _cell(p, rtol, loaded, work):
    """Wear, its error and the status of one cell; p: its parameters, loaded: its areas of contact."""
    _, lengths, margin, verdict = _scene.arm_without_units(p[0], p[1], p[2], p[3])
    tool, ride, unit, pace, fine = _scene.work_without_units(p)
    verdict = verdict if fine or verdict >= FIRST_REFUSAL else OUT_OF_RANGE
    if not _scene.turns_fully(verdict):
        return math.nan, math.nan, verdict
    x, y = _scene.signed_in_unit(p[9], unit), _scene.signed_in_unit(p[10], unit)
    r = in_unit(p[20], unit)
    motion = (ride[0], ride[1], ride[2], x, y, p[8])
    path = (lengths, margin, linkage.side_of(p[4]), p[6]), motion, r, tool
    m, e = mantissa_exponent(p[22] if p[22] > 0.0 else 1.0)
    tau = scale(m, e + pace) if p[22] > 0.0 else 0.0
    if p[20] > p[19] > 0.0 or r > 4.0 * (ride[2] + ride[3] + tool[0] + tool[1]):
        return 0.0, 0.0, verdict
    value, error, short = way(path, loaded, p[21], tau, 0.25 * rtol, work)
    if not short:
        return math.nan, math.nan, STEP_LIMIT
    hard, units = (p[17], unit) if loaded[1] == 0 else (p[18], -unit)
    wear = _scene.with_units(value, p[16], hard, units)
    doubt = _scene.with_units(error, p[16], hard, units)
    if value > 0.0 and not is_normal(wear):
        return wear, doubt, OUT_OF_RANGE
    return wear, doubt, verdict if error <= rtol * value else INACCURATE


@entry_of_cells
def path(
    b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
    load, workpiece_radius, r0, theta0, tau, rtol, wear, wear_error, status,
):  # fmt: skip
    """(1), split at every entry and exit; one cell at a time, for no two split alike."""
    cells = _scene.side_by_side((
        b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
        load, workpiece_radius, r0, theta0, tau,
    ))  # fmt: skip
    work = np.empty(quadrature.POOL), np.empty(_DEPTH)
    memory = _pressure.room()
    loaded = _pressure.unloaded(memory[0])
    for i in range(status.size):
        if i == 0 or not _pressure.shared(cells[i], rtol[i], cells[i - 1], rtol[i - 1]):
            loaded = _pressure.areas(cells[i], rtol[i], memory)
        wear[i], wear_error[i], status[i] = _cell(cells[i], rtol[i], loaded, work)


@jit
def _check(
    i, b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
    load, workpiece_radius, r0, theta0, tau, status,
):  # fmt: skip
    fine = allowed(
        b[i], d[i], f[i], e[i], type[i], omega[i], b_angle[i], L[i], beta[i], w_x[i], w_y[i], Omega[i],
        tool_a[i], tool_b[i], tool_n[i], tool_m[i], preston[i],
    )  # fmt: skip
    push = pressed(pressure[i], load[i], workpiece_radius[i])
    point = 0.0 <= r0[i] < math.inf and magnitude(theta0[i]) <= ANGLE_LIMIT and 0.0 <= tau[i] < math.inf
    status[i] = OK if fine and push and point else BAD_INPUT


@entry_of_cells
def check(
    b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
    load, workpiece_radius, r0, theta0, tau, status,
):  # fmt: skip
    """BAD_INPUT: NaN, infinite or outside its limits."""
    one_by_one(
        _check,
        (
            b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston,
            pressure, load, workpiece_radius, r0, theta0, tau, status,
        ),
    )  # fmt: skip


POLISHER_WEAR_POINT = Kernel(
    name="polisher_wear_point",
    doc="Preston wear of one point of a turning workpiece under the tool of a polishing machine",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), corrected and completed",
    parameters=(
        *_scene.PARAMETERS,
        *_scene.PRESS,
        Field("r0", "m", "distance of the point from the workpiece's centre", lower=0.0),
        Field("theta0", "rad", "its direction at the start, from the x axis", default=0.0,
              lower=-ANGLE_LIMIT, upper=ANGLE_LIMIT),
        Field("tau", "s", "time of polishing", lower=0.0),
    ),
    outputs=(
        Field("wear", "m", "depth worn away"),
        Field("wear_error", "m", "what it may be wrong by"),
    ),
    check=check,
    methods=(Method("path", "time split at every entry and exit, adaptive to rtol between them", path),),
    example=_scene.EXAMPLE | {"r0": 0.05, "theta0": 0.0, "tau": 100.0},
)  # fmt: skip
