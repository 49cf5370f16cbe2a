"""Pressure of a constant load on a tool that may hang over the workpiece's rim, by the angle of the arm.

    p(phi) = load/A(phi),  A: area of the tool within the disc of the workpiece                      (1)
A depends on the arm's angle phi from the direction of w alone, and not on its sign, for the tool is alike on both sides
of the arm: the disc's centre is at (w cos phi - L, -w sin phi) in the tool's frame. Hence a table of it for each
machine, once for all radii: polynomials on panels of phi, parted where the rim passes the tool's vertices and halved
until they hold, each with what it may be wrong by. Where A -> 0 the pressure has no bound, nor has wear at the very rim
of a workpiece that the tool leaves: this is said by the error. Derived here.
"""

import math
from typing import NamedTuple

import numpy as np

from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.records import read
from kernels.lanes.vectors import magnitude, sqrt
from kernels.maths.decimals import PI, cosine, multiples, precise
from kernels.maths.elementary import in_unit
from kernels.maths.small_dense import sort
from kernels.wear import _contact, _scene, _tool
from kernels.wear._tool import Circle, arctan2, sincos

PANEL_LIMIT = 1024
LOW, HIGH, DOUBT, SLOPE, FIRST = range(5)
NODES = 16
TABLE = (PANEL_LIMIT, FIRST + NODES)
FAINT = 1e-13
"""Share of the largest area that contact may have, below which its area is not told from none."""

_EPS = 2.0**-52
_STARTS = 16
_NARROW = 2.0**-46
_SLACK = 1e-6
_HOPELESS = 1e100
_TESTS = 2
_SHARE = 0.02  # of rtol, for the areas
_TURN = 2.0 * math.pi
_TRIED = 0.83, -0.41


def _cosines():
    """cos(k x_j) of Chebyshev's nodes x_j = (2 j + 1) pi/2 NODES: a row for each k."""
    with precise():
        columns = [multiples(cosine(PI * (2 * j + 1) / (2 * NODES)), NODES) for j in range(NODES)]
        return np.array(columns, np.float64).T.copy()


_COSINES = _cosines()


class Areas(NamedTuple):
    """Of contact, for a load: the table and its panels, and the least and largest area; no panels for a pressure."""

    table: np.ndarray
    panels: int
    lowest: float
    largest: float


class Memory(NamedTuple):
    """Space for a table, for the rest of its `Areas`, and for building it: for stops, values, and `contact_area`."""

    table: np.ndarray
    rest: np.ndarray
    stops: np.ndarray
    values: np.ndarray
    found: np.ndarray
    points: np.ndarray
    stack: np.ndarray


@jit_apart
def memory():
    """A `Memory`."""
    stops, values, found = np.empty(_tool.ARC_LIMIT), np.empty(NODES + _TESTS), np.empty(_tool.ARC_LIMIT)
    points, stack = np.empty(_contact.POINTS), np.empty(_tool.STACK)
    return Memory(np.empty(TABLE), np.empty(3), stops, values, found, points, stack)


@jit
def _folded(phi):
    """The angle in [0, pi] of the same cosine, of one in [-2 pi, 2 pi]."""
    phi = magnitude(phi)
    return _TURN - phi if phi > math.pi else phi


@jit_apart
def _passes(arm, turn, low, high):
    """Whether the arm comes to an angle phi between low and high, on either side."""
    if arm.whirls:
        return True
    for k in range(-2, 3):
        shift = turn + k * _TURN
        ahead = shift + low - _SLACK <= arm.most and shift + high + _SLACK >= arm.least
        if ahead or (shift - high - _SLACK <= arm.most and shift - low + _SLACK >= arm.least):
            return True
    return False


@jit_apart
def _polynomial(row, t):
    """Value of a panel at t in [-1, 1], by Clenshaw's recurrence."""
    one, two = 0.0, 0.0
    for k in range(NODES - 1, 0, -1):
        one, two = 2.0 * t * one - two + row[FIRST + k], one
    return t * one - two + row[FIRST]


@jit_apart
def _fit(row, low, high, tool, whole, ride, radius, memory):
    """Fills a panel; its least and largest area, and the least noise of its values.

    The error is four times the last three coefficients, and not less than what is seen at two angles more.
    """
    middle, half, values = 0.5 * (low + high), 0.5 * (high - low), memory.values
    least, most, noise, calm = math.inf, 0.0, 0.0, math.inf
    for j in range(NODES + _TESTS):
        t = _COSINES[1, j] if j < NODES else _TRIED[j - NODES]
        s, c = sincos(middle + half * t)
        disc = Circle(ride.w * c - ride.reach, -ride.w * s, radius)
        values[j], doubt = _contact.contact_area(tool, whole, disc, memory)
        least, most = min(least, values[j]), max(most, values[j])
        noise, calm = max(noise, doubt), min(calm, doubt)
    slope, last = 0.0, 0.0
    for k in range(NODES):
        total = 0.0
        for j in range(NODES):
            total += _COSINES[k, j] * values[j]
        total *= (1.0 if k == 0 else 2.0) / NODES
        row[FIRST + k] = total
        slope += k * k * magnitude(total) / half
        last += magnitude(total) if k >= NODES - 3 else 0.0
    for j in range(_TESTS):
        last = max(last, magnitude(_polynomial(row, _TRIED[j]) - values[NODES + j]))
    row[LOW], row[HIGH], row[SLOPE], row[DOUBT] = low, high, slope, 4.0 * last + noise
    return least, most, calm


@jit_apart
def table_of(arm, tool, ride, radius, tolerance, memory):
    """The `Areas` of a machine whose workpiece has that radius, to a relative tolerance."""
    table, stops, reach, w = memory.table, memory.stops, ride.reach, ride.w
    whole = 4.0 * (_contact.sector(0.0, 1.0, tool)[0] + _contact.sector(1.0, 1.0, tool)[0])
    radius = min(radius, 4.0 * (reach + w + tool.a + tool.b))
    turn = arctan2(ride.turn_s, ride.turn_c)

    # angles between which panels are opened, the first one last: an even grid, and where the rim passes vertices
    todo = np.int64(0)
    for k in range(_STARTS + 1):
        stops[todo] = math.pi * k / _STARTS
        todo += 1
    near, high = tool.a * tool.half_x, tool.b * tool.half_y
    for x, y in ((tool.a, 0.0), (-tool.a, 0.0), (0.0, tool.b), (near, high), (-near, high)):
        x = x + reach
        rho = sqrt(x * x + y * y)
        cosine, unit = w * w + rho * rho - radius * radius, 2.0 * w * rho
        if magnitude(cosine) < unit:
            chi, gamma = arctan2(sqrt((unit - cosine) * (unit + cosine)), cosine), arctan2(y, x)
            stops[todo], stops[todo + 1] = _folded(chi + gamma), _folded(chi - gamma)
            todo += 2
    sort(stops, todo)
    for k in range(todo // 2):
        stops[k], stops[todo - 1 - k] = stops[todo - 1 - k], stops[k]

    largest, lowest = min(whole, math.pi * radius * radius), math.inf
    count, low = np.int64(0), 0.0
    while todo > 0:
        high = stops[todo - 1]
        if high - low > _EPS and _passes(arm, turn, low, high):
            least, most, calm = _fit(table[count], low, high, tool, whole, ride, radius, memory)
            fine = table[count, DOUBT] <= max(tolerance * least, 32.0 * calm) or most <= FAINT * largest
            if not (fine or high - low <= _NARROW) and count + todo + 1 < PANEL_LIMIT and todo < stops.size:
                stops[todo] = 0.5 * (low + high)
                todo += 1
                continue
            lowest = min(lowest, least)
            count += 1
        low = high
        todo -= 1
    return Areas(table, count, lowest, largest)


@jit_apart
def areas_of(i, p, columns, memory):
    """The areas of contact of cell i, p, in its unit of length, none where none are needed.

    Those that `memory` has, unless it is the first or has another geometry, load or tolerance than the cell q before.
    """
    before, rtol = max(i - 1, 0), columns.rtol[i]
    q = read(_scene.Machine, columns, before)
    alike = i > 0 and rtol == columns.rtol[before] and (p.load > 0.0) == (q.load > 0.0)
    alike = alike and p.b == q.b and p.d == q.d and p.f == q.f and p.e == q.e and p.type == q.type and p.L == q.L
    alike = alike and p.b_angle == q.b_angle and p.beta == q.beta and p.w_x == q.w_x and p.w_y == q.w_y
    alike = alike and p.tool_a == q.tool_a and p.tool_b == q.tool_b and p.tool_n == q.tool_n and p.tool_m == q.tool_m
    rest = memory.rest
    if not (alike and p.workpiece_radius == q.workpiece_radius):
        setup = _scene.without_units(p)
        rest[0], rest[1], rest[2] = 0.0, 1.0, 1.0
        if p.load > 0.0 and _scene.turns_fully(setup.verdict):
            radius, tolerance = in_unit(p.workpiece_radius, setup.unit), max(_SHARE * rtol, 4.0 * _EPS)
            areas = table_of(setup.arm, setup.tool, setup.ride, radius, tolerance, memory)
            rest[0], rest[1], rest[2] = areas.panels, areas.lowest, areas.largest
    return Areas(memory.table, np.int64(rest[0]), rest[1], rest[2])


@jit_apart
def weight(areas, c, s):
    """1/A at the angle (cos phi, sin phi) = (c, s), what it may be wrong by, and a bound on its slope, both relative.

    1 where the pressure is given.
    """
    table, faintest = areas.table, FAINT * areas.largest
    if areas.panels == 0:
        return 1.0, 0.0, 0.0
    phi, low, high = arctan2(magnitude(s), c), 0, areas.panels
    while high - low > 1:
        k = (low + high) // 2
        if table[k, LOW] <= phi:
            low = k
        else:
            high = k
    row = table[low]
    start, end = row[LOW], row[HIGH]
    area = _polynomial(row, ((phi - start) - (end - phi)) / (end - start))
    if not (area > 2.0 * row[DOUBT] and area > faintest):
        return 1.0 / faintest, _HOPELESS, 0.0
    return 1.0 / area, row[DOUBT] / area * 2.0, 2.0 * row[SLOPE] / area
