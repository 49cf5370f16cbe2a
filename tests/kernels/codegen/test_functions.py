"""What a scene's functions may ask for: each function along a ramp against its integral, and the time `t`."""

import math
import sys

import numpy as np
import pytest
from columns import fields, solve
from mpmath import mp, mpf

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, SceneError, mod, scene_kernel, tan
from kernels.stepping import stepped_kernel

plain = pytest.mark.skipif(COMPILED, reason="40 CPU s of compilation; run with NUMBA_DISABLE_JIT=1")

NAMES = ("tanh", "arctan", "arcsin", "arccos", "tan", "sinh", "cosh", "hypot", "floor", "mod")


def rates(u, b, c, d):
    """numpy's and math's names beside ours, which are the same; b times each, so that integrals are over u."""
    functions = (
        np.tanh(u), math.atan(u), np.arcsin(u / c), math.acos(u / c), tan(u / c), np.sinh(u), math.cosh(u),
        np.hypot(u, d), np.floor(u), mod(u, d),
    )  # fmt: skip
    return b, *(b * f for f in functions)


FUNCTIONS = scene_kernel(
    name="functions",
    doc="integrals of functions over a ramp",
    states=fields("u", *NAMES),
    parameters=fields(*"abcd"),
    rates=rates,
    surface=lambda u, a, b: a + b - u,
    start=lambda a: (a, *[0.0] * len(NAMES)),
    example={"a": -0.5, "b": 2.0, "c": 3.0, "d": 0.75},
)


SMOOTH = scene_kernel(
    name="steps_in_time",
    doc="a smooth step, a root and a sawtooth of the time, which jumps once between",
    states=fields("x", "y"),
    parameters=fields("w"),
    rates=lambda t, w: (np.tanh((t - 1.0) / w) + math.hypot(t, w), t % 0.7),
    surface={"end": lambda t: 4.0 - t, "half": lambda t: -t},
    switch={"half": lambda x, y: (x, y + 1.0)},
    start=lambda: (0.0, 0.0),
    start_time=-3.0,
    example={"w": 0.1},
)


def antiderivatives(c, d):
    """Of each function of the scene, of u."""

    def of_mod(u):
        n = mp.floor(u / d)
        return d * d * (n + (u / d - n) ** 2) / 2

    return {
        "tanh": lambda u: abs(u) + mp.log1p(mp.exp(-2 * abs(u))),
        "arctan": lambda u: u * mp.atan(u) - mp.log1p(u * u) / 2,
        "arcsin": lambda u: u * mp.asin(u / c) + mp.sqrt(c * c - u * u),
        "arccos": lambda u: u * mp.acos(u / c) - mp.sqrt(c * c - u * u),
        "tan": lambda u: -c * mp.log(mp.cos(u / c)),
        "sinh": mp.cosh,
        "cosh": mp.sinh,
        "hypot": lambda u: (u * mp.sqrt(u * u + d * d) + d * d * mp.asinh(u / d)) / 2,
        "floor": lambda u: mp.floor(u) * (u - (mp.floor(u) + 1) / 2),
        "mod": of_mod,
    }


@plain
@pytest.mark.parametrize(
    ("a", "b", "c", "d"),
    [(-0.5, 2.0, 1.6, 0.75), (1.0, 2.25, 3.3, 7.0), (-3.5, 4.0, 3.5 * (1 + 1e-9), 9.0), (-1e-3, 2e-3, 1.01e-3, 1e-3)],
)
def test_every_function_is_integrated_over_any_range(a, b, c, d):
    """Through steep places, up to the ends of arcsin, from an integer on and over many."""
    outputs, status = solve(FUNCTIONS, "taylor_once", [a], b, c, d, flips=1.0, rtol=1e-12)
    assert status[0] == Status.OK
    with mp.workdps(50):
        start = mpf(a)
        for name, of in antiderivatives(mpf(c), mpf(d)).items():
            way = [of(start + mpf(b) * j / 32) - of(start) for j in range(33)]
            assert abs(mpf(float(outputs[name][0])) - way[-1]) <= mpf(1e-11) * max(map(abs, way)), name


@plain
def test_what_a_function_does_not_take_is_out_of_range():
    _, status = solve(FUNCTIONS, "taylor_once", [0.5], 2.0, 2.0, 1.0, flips=1.0)
    assert status[0] == Status.OUT_OF_RANGE


@plain
def test_a_speed_that_is_no_number_behind_a_jump_is_out_of_range():
    falling = scene_kernel(
        name="falling", doc="ball that loses energy as it lands",
        states=(Field("x", "m", "height"), Field("v", "m/s", "speed")),
        parameters=(Field("loss", "m^2/s^2", "of the speed's square"),), rates=lambda v: (v, -9.81),
        surface=lambda x: x, start=lambda: (1.0, 0.0), switch=lambda x, v, loss: (x, np.sqrt(v * v - loss)),
    )  # fmt: skip
    _, status = solve(falling, "taylor_once", [-1.0, 30.0, 15.0], flips=3.0)
    assert list(status) == [Status.OK, Status.OUT_OF_RANGE, Status.OUT_OF_RANGE]


def test_narrow_steps_in_time_are_seen_and_a_second_surface_jumps():
    """x' = tanh((t - 1)/w) + hypot(t, w) and y' = mod(t, 0.7), by time from -3 on; y jumps by 1 at a second surface."""
    w = np.array([1e-3, 0.01, 0.1, 1.0] if COMPILED else [0.01])
    outputs, status = solve(SMOOTH, "taylor", w, flips=2.0, rtol=1e-9)
    assert (status == Status.OK).all()
    with mp.workdps(40):
        for i, width in enumerate(w):
            v = mpf(float(width))

            def of_x(t, v=v):
                rise = v * (abs(t - 1) / v + mp.log1p(mp.exp(-2 * abs(t - 1) / v)))
                return rise + (t * mp.sqrt(t * t + v * v) + v * v * mp.asinh(t / v)) / 2

            x = of_x(mpf(4)) - of_x(mpf(-3))
            sizes = [abs(of_x(mpf(-3 + j / 8)) - of_x(mpf(-3))) for j in range(57)]
            assert abs(mpf(float(outputs["x"][i])) - x) <= 1e-9 * max(sizes)
    y = antiderivatives(1, mpf(0.7))["mod"]
    assert abs(mpf(float(outputs["y"][0])) - (y(mpf(4)) - y(mpf(-3)) + 1)) < 1e-9


FORCED = {
    "name": "forced", "doc": "x' = cos(w t) from start_time on", "states": fields("x"),
    "parameters": fields("w", "end", "since"), "rates": lambda t, w: np.cos(w * t),
    "surface": lambda t, since, end: since + end - t, "start": lambda: 0.0, "start_time": lambda since: since,
}  # fmt: skip


@plain
@pytest.mark.parametrize("since", [0.0, -3.0, -1e3, 1e3])
def test_the_time_is_asked_for_without_a_state_and_counts_from_the_start_time(since):
    """The output `time` counts from the start."""
    w, end = 1.3, 7.0
    true = float((mp.sin(mpf(w) * (mpf(since) + 7)) - mp.sin(mpf(w) * since)) / mpf(w))
    kernel, steps = scene_kernel(**FORCED), stepped_kernel(**FORCED)
    assert [o.name for o in kernel.outputs] == ["time", "interval", "x"]
    outputs, status = solve(kernel, "taylor", [w], end, since, flips=1.0, rtol=1e-9)
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(7.0, rel=1e-9)
    assert outputs["x"][0] == pytest.approx(true, abs=1e-9)
    outputs, _ = solve(steps, "rk4", [w], end, since, flips=1.0, step=0.5)
    assert outputs["x"][0] == pytest.approx(true, abs=1e-2)


@plain
def test_a_state_or_a_parameter_called_t_is_that():
    kernel = scene_kernel(**FORCED | {"states": fields("t"), "rates": lambda t: 2.0, "start_time": None})
    outputs, _ = solve(kernel, "taylor_once", [1.0], 7.0, 0.0, flips=1.0)
    assert outputs["time"][0] == pytest.approx(3.5, rel=1e-12)
    for changed in ({"states": fields("t")}, {"rates": lambda w: w, "surface": lambda x, end: end - x}):
        with pytest.raises(SceneError, match="start_time"):
            scene_kernel(**FORCED | changed)


@plain
def test_a_floor_jumps_where_it_should_and_a_motion_pressed_onto_the_jump_slides_along_it():
    """x' = c - floor(x) - t/2, up to t = 1: through x = 1 without a stop, and held there from both sides."""
    kernel = scene_kernel(
        name="stairs", doc="", states=fields("x"), parameters=fields("c", "x0"),
        rates=lambda x, t, c: c - x // 1 - 0.5 * t, surface=lambda t: 1.0 - t, start=lambda x0: x0,
    )  # fmt: skip
    passed = (mpf(1.6) - mp.sqrt(mpf(1.6) ** 2 - mpf(0.8))) * 2
    true = 1 + mpf(0.6) * (1 - passed) - (1 - passed**2) / 4
    for c, x0, x in ((1.6, 0.2, float(true)), (0.9, 0.8, 1.0)):
        outputs, status = solve(kernel, "taylor" if x == 1.0 else "taylor_once", [c], x0, flips=1.0, rtol=1e-10)
        assert status[0] == Status.OK
        assert outputs["x"][0] == pytest.approx(x, rel=1e-9)


def test_names_of_math_are_what_they_were_once_a_scene_is_recorded():
    assert math is sys.modules["math"]


def test_a_value_from_outside_is_taken_as_the_kernel_is_made_and_anew_by_another_of_that_name():
    """Also where machine code of the first, or of both, is kept."""
    outside = {"g": 9.81}
    fall = {
        "name": "fall", "doc": "from rest", "states": fields("x", "v"), "parameters": fields("height"),
        "rates": lambda v: (v, -outside["g"]), "surface": lambda x: x, "start": lambda height: (height, 0.0),
    }  # fmt: skip
    here = scene_kernel(**fall)
    outside["g"] = 1.62
    there = scene_kernel(**fall)
    for kernel, g in ((here, 9.81), (there, 1.62)):
        outputs, status = solve(kernel, "taylor", [1.0], flips=1.0, rtol=1e-6)
        assert status[0] == Status.OK
        assert outputs["time"][0] == pytest.approx(math.sqrt(2 / g), rel=1e-6)
