"""The area of a tool within a disc, right to what it says of itself down to a touch; and many turns counted exactly."""

import math

import numpy as np
import pytest
from mpmath import mp, mpf

from kernels.lanes.jit import COMPILED, jit_entry
from kernels.wear import _contact, _path, _tool
from kernels.wear._contact import Point
from kernels.wear._tool import Circle, Tool

MANY = 4000 if COMPILED else 15
ROUND = Tool(1.0, 1.0, 2.0, 2.0, math.sqrt(0.5), math.sqrt(0.5))


@jit_entry
def contact_area(tool, whole, disc, room):
    """As a kernel calls it."""
    return _contact.contact_area(tool, whole, disc, room)


@jit_entry
def arc_within(tool, disc, one, two, turn):
    """As a kernel calls it."""
    return _contact._arc_within(tool, disc, one, two, turn)


def lens(a, radius, distance):
    """Area that two discs have in common."""
    if distance >= a + radius:
        return mpf(0)
    if distance <= abs(a - radius):
        return mp.pi * min(a, radius) ** 2
    square = distance * distance
    one = a * a * mp.acos((square + a * a - radius * radius) / (2 * distance * a))
    other = radius * radius * mp.acos((square + radius * radius - a * a) / (2 * distance * radius))
    sides = (a + radius - distance) * (distance + a - radius) * (distance - a + radius) * (distance + a + radius)
    return one + other - mp.sqrt(sides) / 2


def round_tools(kind, n, seed=0):
    """Radii of discs, and their centres in the frame of a round tool of radius 1."""
    random = np.random.default_rng(seed)
    radius, near = 10 ** random.uniform(-1, 2, n), 10 ** random.uniform(-16, -1, n)
    distance = {
        "anywhere": random.uniform(abs(1 - radius), 1 + radius),
        "touching from outside": (1 + radius) * (1 - near),
        "touching from inside": abs(1 - radius) * (1 + near),
    }[kind]
    return radius, distance * np.exp(1j * random.uniform(0, 2 * np.pi, n))


@pytest.mark.parametrize("kind", ["anywhere", "touching from outside", "touching from inside"])
def test_an_area_of_contact_is_wrong_by_no_more_than_it_says(kind):
    room, tool = _contact.room(), ROUND
    assert len(room.found) == _tool.ARC_LIMIT
    share = []
    with mp.workdps(40):
        for radius, centre in zip(*round_tools(kind, MANY), strict=True):
            disc = Circle(float(centre.real), float(centre.imag), float(radius))
            area, doubt = contact_area(tool, math.pi, disc, room)
            true = lens(mpf(1), mpf(disc.radius), mp.hypot(mpf(disc.x), mpf(disc.y)))
            share.append(float(abs(area - true)) / max(doubt, 1e-300))
    assert max(share) <= 1.0
    assert np.mean(np.array(share) > 1e-3) > 0.5


def test_no_digit_of_the_turns_is_lost_after_a_hundred_million_of_them():
    random = np.random.default_rng(2)
    with mp.workdps(60):
        for j in np.round(10 ** random.uniform(6, 9.4, 200)):
            ratio = random.uniform(0.01, 0.1)
            low = ratio * random.uniform(-1e-17, 1e-17)
            turns = mpf(j) * (mpf(ratio) + mpf(low))
            angle = _path.phase(int(j), ratio, low)
            off = (angle - 2 * mp.pi * turns) / (2 * mp.pi)
            assert abs(off - mp.nint(off)) < 1e-15, j


@pytest.mark.parametrize("ulps", [-200, -60, 0, 60, 200])
def test_an_arc_along_the_outline_is_in_doubt_as_a_whole(ulps):
    """Rounding decides on which side of the tool's outline it runs."""
    radius = 1.0 + ulps * 2.0**-52
    ends = [Point(angle, radius * math.cos(angle), radius * math.sin(angle)) for angle in (0.3, 1.4)]
    share, doubt = arc_within(ROUND, Circle(0.0, 0.0, radius), *ends, 1.1)
    assert doubt >= 0.5 * 1.1 * (1 - 1e-12)
    assert share == 0.0 or abs(share - 0.5 * 1.1) < 1e-12
