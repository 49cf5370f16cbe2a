"""A scene along its way: at its switches and at given times, against closed forms."""

import bounce_scene
import numpy as np
import pytest
from columns import estimated, solve
from kicked_scene import SECTION

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, cos
from kernels.trajectory import motion_kernel, section_kernel

pytestmark = pytest.mark.skipif(not COMPILED, reason="an order of 18 takes long as plain Python")


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_section_is_the_map_of_kicks(method):
    gain, passages = np.array([2.8, 3.2, 3.5]), np.array([1.0, 2.0, 7.0, 40.0])
    found, status, error = estimated(SECTION, method, gain=gain, bend=1.0, along=[passages])
    assert (status == Status.OK).all()
    speed, true = np.full(3, 0.3), []
    for passage in range(1, 41):
        if passage in passages:
            true.append(-((-1.0) ** (passage - 1)) * speed)
        speed = gain * speed * (1.0 - speed)
    assert abs(found["v"] - np.transpose(true)).max() <= 1e-9 * 0.9
    assert abs(found["time"] / (np.pi * passages) - 1.0).max() < 1e-9
    assert (error <= 1e-9).all()


def test_chaos_is_given_and_not_called_right():
    found, status = solve(SECTION, "taylor", gain=[3.9], bend=1.0, along=[np.arange(1.0, 121.0)])
    assert status[0] == Status.INACCURATE
    assert (abs(found["v"][0]) < 1.0).all()
    assert solve(SECTION, "taylor", gain=[3.9], along=[np.array([2.0, 1.0])])[1][0] == Status.BAD_INPUT


def test_a_motion_is_known_at_any_time_until_its_bounces_accumulate():
    """The flight behind bounce k takes 2 e^k times the fall. Times may be as close as numbers are, and of any size."""
    at, e = np.array([1e-18, 0.4, 0.4 + 1e-16, 0.8, 3.0]), np.array([0.5, 0.9])
    found, status = solve(motion_kernel(**bounce_scene.SCENE), "taylor", e=e, along=[at], rtol=1e-10)
    assert list(status) == [Status.TOO_SHORT, Status.OK]
    assert np.isnan(found["height"][0, 4])
    for cell, times in ((0, at[:4]), (1, at)):
        half = np.sqrt(2.0 / 9.81) * e[cell] ** np.arange(20.0)
        lands = np.cumsum(2.0 * half) - half[0]
        k = np.searchsorted(lands, times)
        true = 9.81 / 2.0 * (half[k] ** 2 - (times - lands[k] + half[k]) ** 2)
        assert abs(found["height"][cell, : len(times)] - true).max() < 1e-9


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_motion_is_known_at_times_that_are_next_to_nothing_beside_that_of_its_start(method):
    """x'' = cos(t) from (2, 0.5) at t0; x is where it goes at its speed, and cos(t0) - cos(t) ahead of that."""
    late = motion_kernel(
        name="late", doc="mass under a force", states=(Field("x", "m", "place"), Field("v", "m/s", "speed")),
        parameters=(Field("t0", "s", "start"),), rates=lambda v, t: (v, cos(t)), surface=lambda x: x + 1e9,
        start=lambda: (2.0, 0.5), start_time=lambda t0: t0,
    )  # fmt: skip
    at, t0 = np.array([1e-300, 1e-17, 1e-9, 1e-3, 1.0]), np.array([0.0, 1.0, -100.0, 1e6])
    found, status = solve(late, method, t0, rtol=1e-7, along=[at])
    assert (status == Status.OK).all()
    # cos and sin of t0 + at - t0 in differences that lose nothing
    middle, half = t0[:, None] + 0.5 * at, np.sin(0.5 * at)
    assert abs(found["v"] - (0.5 + 2.0 * np.cos(middle) * half)).max() < 5e-8
    moved = (0.5 - np.sin(t0)[:, None]) * at + 2.0 * np.sin(middle) * half
    assert abs(found["x"] - (2.0 + moved)).max() < 2e-7


@pytest.mark.parametrize(("kernel", "points"), [(motion_kernel, [1e-6, 5.0]), (section_kernel, [1.0, 2.0])])
def test_the_end_of_a_stiff_motion_is_left_to_the_method_for_it(kernel, points):
    """At two times, or as its surface falls through 0."""
    lagging = kernel(
        name="lagging", doc="what follows a cosine at once", states=(Field("x", "1", "place"),),
        parameters=(Field("k", "1/s", "how fast"),), rates=lambda x, t, k: -k * (x - cos(t)),
        surface=lambda t: (2e-6 - t) * (t - 3.0) * (t - 4.0), start=lambda: 1.0,
    )  # fmt: skip
    found, status = solve(lagging, "taylor", [1e6], along=[np.array(points)], rtol=1e-10)
    assert status[0] == Status.INACCURATE  # so that auto goes on to the next method
    assert np.isfinite(found["x"][0, 0])
    assert np.isnan(found["x"][0, 1])
    found, status = solve(lagging, "rodas5p", [1e6], along=[np.array(points)], rtol=1e-6)
    assert status[0] == Status.OK
    end = points[1] if kernel is motion_kernel else 4.0
    assert abs(found["x"][0, 1] - (np.cos(end) + 1e-6 * np.sin(end))) < 1e-6


def test_a_surface_that_is_only_touched_is_not_said_to_be_passed():
    """x'' = -x from 1, at -1 - d: met at arccos(-1 - d), nearly missed, nearly met, and never."""
    touched = section_kernel(
        name="touched", doc="oscillator that just meets a level", states=(Field("x", "1", ""), Field("v", "1", "")),
        parameters=(Field("d", "1", "depth"),), rates=lambda x, v: (v, -x), surface=lambda x, d: x + 1.0 + d,
        start=lambda: (1.0, 0.0),
    )  # fmt: skip
    d, passages = np.array([-0.1, -1e-3, -9.043732666554432e-14, 1.09856441320834e-15, 1e-6]), np.array([1.0, 2.0, 5.0])
    found, status = solve(touched, "taylor", d, rtol=[1e-9, 1e-9, 2.1176513191615395e-07, 7e-4, 1e-9], along=[passages])
    assert list(status[[0, 1, 4]]) == [Status.OK, Status.OK, Status.STEP_LIMIT]
    assert status[3] in (Status.GRAZING, Status.INACCURATE)
    true = np.arccos(-1.0 - d[:3, None]) + 2.0 * np.pi * (passages - 1.0)
    off = abs(found["time"][:3] / true - 1.0).max(axis=1)
    assert (off < [1e-9, 1e-9, 2e-7 if status[2] == Status.OK else 1.0]).all()
