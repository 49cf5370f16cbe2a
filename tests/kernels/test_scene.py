"""A scene of one's own: what it may be made of, and that it is right."""

import golden_columns as golden
import mpmath
import numpy as np
import own_scene
import pytest
import rich_scene
import sliding_scene
from columns import counted, fields, solve
from mpmath import mp, mpf
from rich_scene import RICH
from sliding_scene import SLIDING

from kernels.cycle import cycle_kernel
from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, scene_kernel
from kernels.stepping import stepped_kernel
from kernels.trajectory import motion_kernel, section_kernel


@pytest.mark.parametrize(("scene", "known"), [(rich_scene, RICH), (sliding_scene, SLIDING)])
def test_a_scenes_functions_are_not_asked_again_at_every_call(scene, known):
    """The scene of another kernel once more, with rates of its own."""
    rates = counted(scene.rates)
    kernel = scene_kernel(
        name=known.name, doc=known.doc, states=known.outputs[2:], parameters=known.parameters[:-1],
        rates=rates, surface=scene.surface, start=scene.start, switch=getattr(scene, "switch", None),
    )  # fmt: skip
    for method in golden.OF_SCENE.get(known.name, [method.name for method in kernel.methods]):
        asked = []
        for _ in range(2):
            solve(kernel, method, flips=[2.0], **known.example)
            asked.append(rates.calls)
        assert asked[1] == asked[0], method


@pytest.mark.parametrize("make", [scene_kernel, stepped_kernel, cycle_kernel, motion_kernel, section_kernel])
def test_an_argument_that_is_missing_or_misspelt_is_refused(make):
    field = (Field("x", "1", "x"),)
    parts = {"name": "line", "doc": "", "states": field, "parameters": (), "rates": lambda: 1.0, "start": lambda: 0.0}
    with pytest.raises(TypeError, match="surfaces"):
        make(**parts, surface=lambda x: 1.0 - x, surfaces=None)
    with pytest.raises(TypeError, match="parameters"):
        make(**{name: part for name, part in parts.items() if name != "parameters"}, surface=lambda x: 1.0 - x)
    with pytest.raises(TypeError, match="Field"):
        make(**parts | {"states": ["x"]}, surface=lambda x: 1.0 - x)


@pytest.mark.skipif(COMPILED, reason="one more compilation; run with NUMBA_DISABLE_JIT=1")
def test_names_of_a_scene_may_be_those_of_the_text_that_is_written():
    """x' = 1, y' = h + exp + t: from 0 to x = unit."""
    names = ("h", "exp", "e_0", "verdict", "n12", "abs", "t", "unit")
    kernel = scene_kernel(
        name="odd", doc="", states=fields("series", "end_speed"), parameters=fields(*names),
        rates=lambda series, h, exp, t: (1.0, h + exp + t + 0.0 * series), surface=lambda series, unit: unit - series,
        start=lambda: (0.0, 0.0),
    )  # fmt: skip
    outputs, status = solve(kernel, "taylor_once", [1.0], 2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 5.0, flips=1.0)
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(5.0, rel=1e-14, abs=0.0)
    assert outputs["end_speed"][0] == pytest.approx(30.0, rel=1e-14, abs=0.0)


@pytest.mark.skipif(COMPILED, reason="one more compilation; run with NUMBA_DISABLE_JIT=1")
def test_a_state_too_small_for_its_relative_error_is_refused_and_is_right_above():
    kernel = scene_kernel(
        name="growth", doc="x' = x", states=(Field("t", "1", "time"), Field("x", "1", "what grows")),
        parameters=(Field("x0", "1", "start"),), rates=lambda x: (1.0, x), surface=lambda t: 6.0 - t,
        start=lambda x0: (0.0, x0),
    )  # fmt: skip
    x0 = [1e-307, 1e-293, 1e-278, 1.0]
    outputs, status = solve(kernel, "taylor", x0, flips=1.0, rtol=1e-6)
    assert list(status) == [Status.OUT_OF_RANGE, Status.OUT_OF_RANGE, Status.OK, Status.OK]
    assert np.allclose(outputs["x"][2:] / x0[2:], np.exp(6.0), rtol=1e-6)


def test_a_start_at_rest_falls_from_the_surface_at_once_or_never_and_a_pole_does_not_graze():
    kernel = scene_kernel(
        name="at_rest", doc="x'' = c x'^2 - g", states=fields("x", "v"), parameters=fields("x0", "v0", "g", "c"),
        rates=lambda v, g, c: (v, c * v * v - g), surface=lambda x: x, start=lambda x0, v0: (x0, v0),
    )  # fmt: skip
    cells = [0.0, 1.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]
    for method in ["taylor"] if COMPILED else ["taylor", "dop853"]:
        outputs, status = solve(kernel, method, *(column[: 3 if COMPILED else 1] for column in cells), flips=1.0)
        assert status[0] == Status.OK
        assert outputs["time"][0] == 0.0
    assert not COMPILED or list(status[1:]) == [Status.STEP_LIMIT] * 2


def test_the_studys_own_scene_is_right():
    outputs, status = solve(own_scene.KERNEL, "taylor", [0.3, 5.0], [1.2], [0.05], [0.4], [0.7], [1.0], rtol=1e-9)
    for i, mu in enumerate((0.3, 5.0)):
        with mp.workdps(25):
            time, speed = first_switch(mpf(mu), mpf(1.2), mpf(0.05), mpf(0.4), mpf(0.7))
        assert status[i] == Status.OK
        assert abs(mpf(float(outputs["time"][i])) / time - 1) < 1e-9
        assert abs(mpf(float(outputs["speed"][i])) / speed - 1) < 1e-9


def first_switch(mu, phi0, a, b, w):
    """Time and speed at the first switch of the own scene, by mpmath's own Taylor integrator."""
    motion = mpmath.odefun(lambda t, y: [y[1], mu - a * y[1] - b * y[1] * mp.sqrt(y[1] ** 2 + w**2)], 0, [0, 0])
    time = mpmath.findroot(lambda t: motion(t)[0] - phi0, mp.sqrt(2 * phi0 / mu) * 1.05)
    return time, motion(time)[1]
