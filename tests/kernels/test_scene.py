"""A scene of one's own: what it may be made of, what it becomes, and that a study runs it."""

import inspect
import subprocess
import sys
from pathlib import Path

import mpmath
import numpy as np
import own_scene
import pytest
import rich_scene
import sliding_scene
from columns import bounds, checked, counted, solve
from mpmath import mp, mpf
from rich_scene import RICH
from sliding_scene import SLIDING

from kernels.codegen.module import Writer, build
from kernels.codegen.record import record
from kernels.interface import Kernel, Status
from kernels.lanes.jit import COMPILED
from kernels.scene import Field, Scene, exp, scene_kernel
from kernels.source_text.expression import SceneError

ROOT = Path(__file__).parents[2]
NAN, INF = np.nan, np.inf


def rates(angle, speed, side, mu):
    return speed, side * mu - speed


def surface(angle, side):
    return 1.0 - side * angle


def start():
    return 0.0, 0.0


def scene(**changed):
    parts = {
        "name": "plain", "doc": "a foliot", "states": ("angle", "speed"), "parameters": ("mu",),
        "rates": rates, "surface": surface, "start": start,
    } | changed  # fmt: skip
    return Scene(**parts)


def test_it_is_a_kernel_as_any_other():
    assert isinstance(RICH, Kernel)
    parameters = [p.name for p in RICH.parameters]
    outputs = [o.name for o in RICH.outputs]
    assert parameters[-1] == "flips"
    assert outputs == ["time", "interval", "angle", "speed"]
    assert list(inspect.signature(RICH.check).parameters) == [*parameters, "status"]
    for method in RICH.methods:
        assert list(inspect.signature(method.solve).parameters) == [*parameters, "rtol", *outputs, "status"]
    assert np.isinf(bounds(RICH, "taylor_once", [1.0], [1.0])).all()
    assert RICH.method("taylor").bound is None


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ({}, Status.OK), ({"mu": NAN}, Status.BAD_INPUT), ({"c": -1.0}, Status.BAD_INPUT),
        ({"R": INF}, Status.BAD_INPUT), ({"flips": 0.0}, Status.BAD_INPUT), ({"flips": 1.5}, Status.BAD_INPUT),
        ({"flips": 2e6}, Status.BAD_INPUT), ({"speed0": -INF}, Status.BAD_INPUT),
    ],
)  # fmt: skip
def test_what_lies_outside_the_limits_is_bad_input(cell, status):
    given = {"mu": 1.0, "phi0": 1.0, "a": 0.1, "flips": 3.0} | cell
    assert checked(RICH, **{name: [value] for name, value in given.items()})[0] == status


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"rates": lambda angle, speed, nu: (speed, nu)}, "asks for 'nu'"),
        ({"rates": lambda speed: speed}, "returns 1 values instead of 2"),
        ({"rates": lambda angle, speed: (speed, -1.0 if angle > 0 else 1.0)}, "compare"),
        ({"surface": lambda mu: mu}, "does not depend on a state"),
        ({"start": lambda angle: (angle, 0.0)}, "asks for 'angle'"),
        ({"states": ("side", "speed")}, "cannot be a name"),
        ({"states": ("time", "speed")}, "cannot be a name"),
        ({"parameters": ("speed",)}, "names of their own"),
        ({"parameters": ("lambda",)}, "cannot be a name"),
        ({"states": ()}, "needs a state"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_with_a_reason(changed, says):
    with pytest.raises(SceneError, match=says):
        record(scene(**changed))


def test_the_written_module_can_be_read_and_is_the_same_for_the_same_scene():
    module = build(scene())
    assert build(scene()) is module
    text = Path(module.__file__).read_text()
    assert text == Writer(scene(), record(scene())).text()
    assert "def rates(state, side, signs, parameters):" in text
    assert max(map(len, text.splitlines())) < 4000


def own_rates(known, rates, surface, start, switch=None):
    """The scene of another kernel once more, with rates of its own."""
    return scene_kernel(
        name=known.name, doc=known.doc, states=known.outputs[2:], parameters=known.parameters[:-1],
        rates=rates, surface=surface, start=start, switch=switch,
    )  # fmt: skip


@pytest.mark.parametrize("known", [RICH, SLIDING])
def test_a_scenes_functions_are_not_asked_again_at_every_call(known):
    if known is RICH:
        rates = counted(rich_scene.rates)
        kernel = own_rates(RICH, rates, rich_scene.surface, rich_scene.start, rich_scene.switch)
    else:
        rates = counted(sliding_scene.rates)
        kernel = own_rates(SLIDING, rates, sliding_scene.surface, sliding_scene.start)
    for method in kernel.methods:
        asked = []
        for _ in range(2):
            solve(kernel, method.name, flips=[2.0], **known.example)
            asked.append(rates.calls)
        assert asked[1] == asked[0], method.name


def test_names_do_not_clash_with_those_of_the_written_text():
    names = ("h", "exp", "e_0", "verdict", "n12", "abs", "t", "unit")
    odd = scene(
        states=("series", "end_speed"), parameters=names, rates=lambda series, end_speed, t: (end_speed, t - end_speed),
        surface=lambda series, h: h - series,
    )  # fmt: skip
    writer = Writer(odd, record(odd))
    assert len(set(writer.names.values())) == len(writer.names)
    assert set(writer.states) == {"series_", "end_speed_"}
    assert set(writer.parameters) == {f"{name}_" for name in names}
    compile(writer.text(), "scene", "exec")


def test_a_decay_of_one_state_by_its_exponential():
    kernel = scene_kernel(
        name="decay", doc="u' = -r exp(u)", states=(Field("u", "1", "what decays"),),
        parameters=(Field("r", "1/s", "rate"), Field("level", "1", "where it is timed")),
        rates=lambda u, r: -r * exp(u), surface=lambda u, level: u - level, start=lambda: 1.0,
    )  # fmt: skip
    if COMPILED:
        pytest.skip("one more compilation; run with NUMBA_DISABLE_JIT=1")
    outputs, status = solve(kernel, "taylor", [2.0], [-1.0], flips=[1.0], rtol=1e-12)
    true = (mp.exp(1) - mp.exp(-1)) / 2
    assert status[0] == Status.OK
    assert abs(mpf(float(outputs["time"][0])) / true - 1) < 5e-13


def test_the_studys_own_scene_runs_and_is_right(tmp_path):
    if not COMPILED:
        pytest.skip("as a user runs it")
    command = [Path(sys.executable).parent / "sweep", "run", ROOT / "studies" / "own_scene.toml"]
    refused = subprocess.run([*command, "-o", tmp_path / "no.h5"], capture_output=True, text=True)
    assert refused.returncode != 0
    assert "--allow-import" in refused.stdout + refused.stderr
    done = subprocess.run([*command, "--allow-import", "-o", tmp_path / "own.h5"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    import sweep

    with sweep.open_result(tmp_path / "own.h5") as ds:
        assert float((ds.status == Status.OK).mean()) > 0.9
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
