"""What a scene's functions may be made of: plain numbers, comparisons, numpy's; and what is said of the rest."""

import math

import numpy as np
import pytest
from columns import fields, relative_error, solve
from mpmath import mp, mpf

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import SceneError, maximum, minimum, mod, scene_kernel, sign, where
from kernels.stepping import stepped_kernel

METHODS = ["taylor", "taylor_once", "dop853", "dopri5"]


PULSE = {
    "name": "pulse", "doc": "a force of a short time, and rates that no state and no parameter is in",
    "states": fields("x", "t", "still"), "parameters": fields("H", "w", "unused"),
    "rates": lambda t, w, H: (H * (sign(t - 20) - sign(t - 20 - w)) / 2, np.int64(1), 0),
    "surface": lambda t: 30 - t, "start": lambda: (0, 0.0, 7), "switch": lambda: (0, 0, 7),
}  # fmt: skip


@pytest.fixture(scope="module")
def pulse():
    return scene_kernel(**PULSE)


@pytest.mark.parametrize("method", ["taylor"] if COMPILED else ["taylor", "dop853", "dopri5"])
@pytest.mark.parametrize("flips", [1.0, 2.0])
def test_a_pulse_between_two_signs_and_rates_that_are_plain_numbers_are_followed_by_series_and_steps(
    pulse, method, flips
):
    H, w = np.array([2.0, 3.0, 1e4]), np.array([1.0, 1e-3, 3.0])
    outputs, status = solve(pulse, method, H, w, np.full(3, 5.0), np.full(3, flips))
    assert (status == Status.OK).all()
    np.testing.assert_allclose(outputs["time"], 30.0 * flips, rtol=1e-9)
    np.testing.assert_allclose(outputs["x"], H * w, rtol=1e-9)
    np.testing.assert_array_equal(outputs["still"], 7.0)


def test_a_scene_without_parameters_and_of_one_state_is_followed_by_every_method():
    clock = {
        "name": "bare_clock", "doc": "t' = 1", "states": fields("t"), "parameters": (),
        "rates": lambda: 1, "surface": lambda t: 1 - t, "start": lambda: 0, "switch": lambda: 0,
    }  # fmt: skip
    kernel, stepped = scene_kernel(**clock), stepped_kernel(**clock)
    runs = [(kernel, method, {}) for method in METHODS]
    runs += [(stepped, method, {"step": np.array([0.25])}) for method in ("euler", "dop853")]
    for scene, method, step in runs[:1] if COMPILED else runs:
        outputs, status = solve(scene, method, np.array([3.0]), **step)
        assert status[0] == Status.OK
        assert outputs["time"][0] == pytest.approx(3.0, rel=1e-12)


def test_maximum_minimum_and_where_are_exact_and_bend_where_they_should():
    """x' = max(1/2, min(x, c)), y' = 3 or -1: growth at 1/2, then x, then c, to 4."""
    kernel = scene_kernel(
        name="bends", doc="growth between limits", states=fields("x", "y"), parameters=fields("c"),
        rates=lambda x, c: (maximum(np.float64(0.5), minimum(x, c)), where(x >= 1, 3, -1.0)),
        surface=lambda x: 4.0 - x, start=lambda: (0.0, 0.0),
    )  # fmt: skip
    outputs, status = solve(kernel, "taylor", np.array([2.0]), np.array([1.0]), rtol=1e-12)
    true = 1 + mp.log(2) + mp.log(2) + mpf(2) / 2
    at_1 = 1 + mp.log(2)
    assert status[0] == Status.OK
    assert relative_error(outputs["time"], [true])[0] < 1e-13
    assert relative_error(outputs["y"], [3 * (true - at_1) - at_1])[0] < 1e-12


@pytest.mark.skipif(COMPILED, reason="many small compilations; run with NUMBA_DISABLE_JIT=1")
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_what_rests_on_a_kink_is_followed_to_the_side_that_it_bends_to_and_where_it_comes_back(method):
    """x = k t^2 (t - r) (t - s) and y' = sign(x), up to t = 1; some come back within their first step."""
    kernel = scene_kernel(
        name="bent", doc="rest on a kink", states=fields("x", "v", "t", "y"), parameters=fields("k", "r", "s"),
        rates=lambda x, v, t, k, r, s: (v, k * (2.0 * r * s - 6.0 * (r + s) * t + 12.0 * t * t), 1.0, sign(x)),
        surface=lambda t: 1.0 - t, start=lambda: (0.0,) * 4,
    )  # fmt: skip
    k, r, s = np.array([[1.0, 2.0, 3.0], [1.0, 0.5, 2.0], [1.0, 1e-3, 2.0], [1.0, 0.1, 0.2], [100.0, 0.01, 0.02]]).T
    for side in (1.0, -1.0):
        outputs, status = solve(kernel, method, side * k, r, s, flips=1.0, rtol=1e-6)
        assert (status == Status.OK).all()
        wanted = side * (2.0 * np.minimum(r, 1.0) - 1.0 + 2.0 * (1.0 - np.minimum(s, 1.0)))
        np.testing.assert_allclose(outputs["y"], wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("condition", "chosen"),
    [
        (lambda c: c > 2.0, "yyx"), (lambda c: c >= 2.0, "yxx"),
        (lambda c: c < 2.0, "xyy"), (lambda c: c <= 2.0, "xxy"),
        (lambda c: np.float64(2.0) < c, "yyx"), (lambda c: np.float64(2.0) >= c, "xxy"),
    ],
)  # fmt: skip
def test_where_of_a_parameter_takes_the_side_that_it_lies_on_and_at_the_edge_what_is_said(condition, chosen):
    kernel = scene_kernel(
        name="chosen", doc="", states=fields("t"), parameters=fields("c"), rates=lambda: 1.0,
        surface=lambda t: 1.0 - t, start=lambda c: where(condition(c), 0.75, 0.5),
    )  # fmt: skip
    if COMPILED:
        pytest.skip("many small compilations; run with NUMBA_DISABLE_JIT=1")
    outputs, _ = solve(kernel, "taylor_once", np.array([1.0, 2.0, 3.0]), np.ones(3))
    assert "".join("x" if time == 0.25 else "y" for time in outputs["time"]) == chosen


def scene(**changed):
    parts = {
        "name": "wrong", "doc": "", "states": fields("x", "v"), "parameters": fields("c"),
        "rates": lambda x, v: (v, -x), "surface": lambda x, side: 1.0 - side * x, "start": lambda: (0.0, 1.0),
    }  # fmt: skip
    return scene_kernel(**parts | changed)


@pytest.mark.parametrize(
    ("role", "function", "says"),
    [
        ("rates", lambda v, side: (v, 1.0 if side == 1 else -1.0), "where"),
        ("rates", lambda x, v: (v, -1.0 if x > 0 else 1.0), "compare"),
        ("rates", lambda x, v: (v, max(x, 0.0)), "maximum"),
        ("rates", lambda x, v: (v, np.select([x > 0], [1.0])), "select"),
        ("rates", lambda x, v: (v, x or 1.0), "branch"),
        ("rates", lambda x, v: (v, math.erf(x)), "plain numbers"),
        ("rates", lambda x, v: (v, float(x)), "plain numbers"),
        ("rates", lambda x, v: (v, np.arctan2(x, v)), "arctan2"),
        ("rates", lambda x, v: (v, x.mean()), "attribute"),
        ("rates", lambda x, v: (v, x + "1"), "number"),
        ("rates", lambda x, v: (v, 2.0**x), "exponent"),
        ("rates", lambda x, v: (v, math.inf * x), "float64"),
        ("rates", lambda x, v: (v, 10**400 * x), "float64"),
        ("rates", lambda x, v: (v, x / 0), "divides"),
        ("rates", lambda x, v: (v, None), "None"),
        ("rates", lambda x, v: v, "1 values"),
        ("rates", lambda x, v, nu: (v, nu), "'nu'"),
        ("surface", lambda x: [x, x], "2 values"),
        ("surface", lambda c: c, "state"),
        ("start", lambda x: (x, 0.0), "'x'"),
        ("start", lambda c: (c, 1 / 0), "ZeroDivisionError"),
        ("switch", lambda x, w: (x, w), "'w'"),
    ],
)
def test_a_function_that_cannot_be_recorded_is_named_in_a_line_with_what_is_wrong(role, function, says):
    with pytest.raises(SceneError, match=f"^{role}.*wrong.*{says}") as refusal:
        scene(**{role: function})
    assert len(str(refusal.value).splitlines()) == 1


def test_what_a_function_keeps_of_an_earlier_call_is_refused():
    kept = []

    def rates(x, v):
        kept.append(x)
        return v, -kept[0]

    scene(rates=rates)  # called once, so what it keeps is of this call
    with pytest.raises(SceneError, match="another call"):
        scene(rates=rates)


@pytest.mark.parametrize(
    "changed",
    [
        {"states": fields("side", "v")}, {"states": fields("time", "v")}, {"parameters": fields("v")},
        {"parameters": fields("lambda")}, {"states": ()},
    ],
)  # fmt: skip
def test_names_that_are_taken_or_none_are_refused(changed):
    with pytest.raises(SceneError):
        scene(**changed)


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_what_jumps_over_a_threshold_and_comes_back_soon_is_not_missed(method):
    """A pulse at the beginning of each second; and a surface above which a motion is but for that time."""
    width, seconds = np.tile(10.0 ** -np.linspace(0.05, 4.0, 40), 2), np.repeat([4.0, 9.0], 40)
    common = {"doc": "", "states": fields("on"), "start": lambda: 0.0, "start_time": 0.5}
    pulsed = scene_kernel(
        **common, name="pulsed", parameters=fields("width", "end"), surface=lambda t, end: end - t,
        rates=lambda t, width: where(mod(t, 1.0) < width, 1.0, 0.0),
    )  # fmt: skip
    outputs, status = solve(pulsed, method, width, seconds + 0.95, flips=1.0, rtol=1e-9)
    assert (status == Status.OK).all()
    on = seconds * width + np.maximum(width - 0.5, 0.0)
    assert np.allclose(outputs["on"], on, rtol=1e-9, atol=0.0)
    ticks = scene_kernel(
        **common, name="ticks", parameters=fields("width"), surface=lambda t, width: mod(t, 1.0) - width,
        rates=lambda: 1.0,
    )  # fmt: skip
    outputs, status = solve(ticks, method, width, flips=seconds, rtol=1e-9)
    assert (status == Status.OK).all()
    assert np.allclose(outputs["time"], seconds - 0.5, rtol=1e-9, atol=0.0)
