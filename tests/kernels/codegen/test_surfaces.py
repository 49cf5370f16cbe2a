"""Several surfaces, each with its jump: walls, a section beside an impact, and a lid that is not met."""

import math

import pytest
from columns import fields, solve

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import SceneError, cos, mod, scene_kernel, sign, sin, sqrt, where
from kernels.stepping import stepped_kernel

WALLS = {
    "name": "walls", "doc": "a ball between two walls and above a floor, without a force",
    "states": fields("x", "v", "y", "w"), "parameters": fields("e", "x0", "y0", "v0"),
    "rates": lambda v, w: (v, 0.0, w, 0.0),
    "surface": {"left": lambda x: x, "right": lambda x: 1.0 - x, "floor": lambda y: y},
    "switch": {
        "left": lambda x, v, y, w: (x, -v, y, w),
        "right": lambda x, v, y, w, e: (x, -e * v, y, w),
        "floor": lambda x, v, y, w: (x, v, y, -w),
    },
    "start": lambda x0, y0, v0: (x0, v0, y0, -1.0),
}  # fmt: skip
plain = pytest.mark.skipif(COMPILED, reason="compiled in test_functions; run with NUMBA_DISABLE_JIT=1")


def found(kernel, method, *cell, flips, rtol=1e-9, **more):
    outputs, status = solve(kernel, method, [cell[0]], *cell[1:], flips=float(flips), rtol=rtol, **more)
    return {name: values[0] for name, values in outputs.items()}, status[0]


@pytest.fixture(scope="module")
def walls():
    return scene_kernel(**WALLS)


@plain
@pytest.mark.parametrize(
    ("flips", "time", "x", "v", "w"),
    [(1, 0.5, 1.0, 1.0, -1.0), (2, 1.75, 0.375, -0.5, -1.0), (3, 2.5, 0.0, -0.5, 1.0), (4, 4.5, 1.0, 0.5, 1.0)],
)
def test_each_surface_has_its_own_jump(walls, flips, time, x, v, w):
    """From the middle to the right wall, which takes half of the speed; the floor is met on the way back."""
    outputs, status = found(walls, "taylor_once", 0.5, 0.5, 1.75, 1.0, flips=flips)
    assert status == Status.OK
    assert [outputs[name] for name in ("time", "x", "v", "w")] == pytest.approx([time, x, v, w], abs=1e-12)


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_surfaces_that_are_met_at_once_all_jump_and_a_start_that_falls_from_one_jumps_at_once(walls, method):
    """Into the corner at t = 0.5, to the right wall at 1.5; a ball on the right wall that goes on to the right.

    Where the corner is missed by less than the tolerance, the floor is met behind the wall.
    """
    outputs, status = found(walls, method, 0.5, 0.5, 0.5, -1.0, flips=2)
    assert status == Status.OK
    assert [outputs[name] for name in ("time", "x", "v", "y", "w")] == pytest.approx([1.5, 1, 1, 1, 1], abs=1e-12)
    outputs, status = found(walls, method, 0.5, 1.0, 4.0, 1.0, flips=2)
    assert [outputs[name] for name in ("time", "x", "v")] == pytest.approx([2.0, 0.0, -0.5], abs=1e-12)
    outputs, status = found(walls, method, 0.5, 0.5, 0.500001, -1.0, flips=2, rtol=1e-4)
    assert status == Status.OK
    assert outputs["interval"] == pytest.approx(1e-6)


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853"])
@pytest.mark.parametrize("order", [("clock", "floor"), ("floor", "clock")])
def test_a_jump_onto_another_surface_that_it_falls_through_meets_that_at_once(method, order):
    """Each second y is put onto the floor, which throws it up to 3."""
    parts = {"clock": (lambda x: 1.0 - x, lambda: (0.0, 0.0)), "floor": (lambda y: y, lambda x: (x, 3.0))}
    kernel = scene_kernel(
        name="onto", doc="", states=fields("x", "y"), parameters=fields("y0"), rates=lambda: (1.0, -1.0),
        surface={name: parts[name][0] for name in order}, switch={name: parts[name][1] for name in order},
        start=lambda y0: (0.0, y0),
    )  # fmt: skip
    for flips, time, y in ((1, 1, 4), (2, 1, 0), (3, 2, 2), (4, 2, 0)):
        outputs, status = found(kernel, method, 5.0, flips=flips)
        assert [status, outputs["time"], outputs["y"]] == pytest.approx([Status.OK, time, y], abs=1e-8)


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_counter_is_compared_as_a_number_is_where_it_is_equal_too(method):
    """The number n of switches, one a second, from 0: y gains 0, 110, 121, 101, 111 in the seconds."""
    kernel = scene_kernel(
        name="counter", doc="", states=fields("x", "n", "y"), parameters=fields("n0"), surface=lambda x: 1.0 - x,
        rates=lambda n: (1.0, 0.0, where(n >= 2, 1.0, 0.0) + 10.0 * mod(n, 3) + 100.0 * sign(n)),
        switch=lambda n, y: (0.0, n + 1.0, y), start=lambda n0: (0.0, n0, 0.0),
    )  # fmt: skip
    outputs, status = solve(kernel, method, flips=[1.0, 2.0, 3.0, 4.0, 5.0], n0=0.0)
    assert (status == Status.OK).all()
    assert outputs["y"] == pytest.approx([0, 110, 231, 332, 443])
    outputs, status = solve(kernel, method, flips=2.0, n0=[1.0, 1.0 + 1e-15, 0.3])
    assert status.tolist() == [Status.OK, Status.INACCURATE, Status.OK]


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853", "rodas5p"])
def test_a_section_beside_an_impact_is_passed_and_counts_behind_it_too(method):
    """A falling ball: its top, v through 0, before the floor where it is thrown up by e; resting there it sticks."""
    kernel = scene_kernel(
        name="bounce", doc="", states=fields("x", "v"), parameters=fields("e"), rates=lambda v: (v, -1.0),
        surface={"top": lambda v: v, "floor": lambda x: x}, switch={"floor": lambda x, v, e: (x, -e * v)},
        start=lambda: (0.5, 0.0),
    )  # fmt: skip
    for flips, time, x, v in ((1, 0, 0.5, 0), (2, 1, 0, -1), (3, 1.5, 0.125, 0), (4, 2, 0, -0.5), (5, 2.25, 1 / 32, 0)):
        outputs, status = found(kernel, method, 0.5, flips=flips)
        assert status == Status.OK
        assert [outputs[name] for name in ("time", "x", "v")] == pytest.approx([time, x, v], abs=1e-8)
    assert found(kernel, method, 0.0, flips=5)[1] != Status.OK


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853", "rk4"])
def test_what_both_sides_press_onto_a_surface_does_not_pass_through_it(method):
    """An oscillator whose dry friction is written by `side`: it turns twice, and is held where the spring is weaker."""
    scene = {
        "name": "dry", "doc": "", "states": fields("x", "v"), "parameters": fields("c"),
        "rates": lambda x, v, side, c: (v, -x - side * c), "start": lambda: (-1.0, 0.0),
    }  # fmt: skip
    step, turn = {"step": 0.03} if method == "rk4" else {}, lambda v, side: side * v
    kernel = (stepped_kernel if step else scene_kernel)(**scene, surface=turn)
    assert found(kernel, method, 0.3, flips=2, **step)[1] <= Status.GRAZING
    assert found(kernel, method, 0.3, flips=8, **step)[1] == Status.STICKS
    if not step:
        several = scene_kernel(**scene, surface={"turn": turn, "far": lambda x: x + 9.0})
        assert found(several, method, 0.3, flips=8)[1] == Status.STICKS


@plain
def test_what_an_impact_leaves_at_rest_on_a_moving_wall_sticks_and_goes_where_the_wall_recedes():
    """Behind the impact the relative speed is 0 but for rounding."""
    wall = scene_kernel(
        name="wall", doc="", states=fields("x", "v"), parameters=fields("A", "w"), rates=lambda x, v: (v, -x),
        surface=lambda x, t, A, w: x - 0.1 - A * sin(w * t), switch=lambda x, t, A, w: (x, A * w * cos(w * t)),
        start=lambda: (1.0, 0.0),
    )  # fmt: skip
    for A, w in ((0.31, 0.7), (0.1234, 0.7), (0.77, 0.7)):
        assert found(wall, "taylor_once", A, w, flips=2)[1] == Status.STICKS
    assert found(wall, "taylor_once", 0.77, 1.3, flips=2)[1] == Status.OK


SECTION = {
    "name": "section", "doc": "an oscillator, at each passage of its place of rest",
    "states": fields("x", "v"), "parameters": fields("w"), "rates": lambda x, v, w: (v, -w * w * x),
    "surface": lambda x: x, "start": lambda: (1.0, 0.0),
}  # fmt: skip


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853", "rodas5p", "rk4"])
def test_a_surface_without_a_side_and_without_a_jump_is_passed_once_a_period(method):
    step = {"step": 0.03} if method == "rk4" else {}
    kernel = stepped_kernel(**SECTION) if step else scene_kernel(**SECTION)
    outputs, status = solve(kernel, method, [2.0], flips=3.0, **step)
    assert status[0] <= (Status.GRAZING if step else Status.OK)
    assert [outputs[name][0] for name in ("time", "x", "v")] == pytest.approx([2.25 * math.pi, 0, -2], abs=1e-6)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"switch": {"up": lambda x, v, y, w: (x, v, y, w)}}, "'up'"), ({"surface": {}}, "a surface"),
        ({"surface": None, "switch": None}, "a surface"),
        ({"surface": {"left": lambda x: x, "right": lambda e: e}}, "state"),
        ({"switch": {"left": lambda x: x}}, "switch left.*1 values"),
    ],
)  # fmt: skip
def test_surfaces_and_switches_that_do_not_fit_are_refused(changed, says):
    with pytest.raises(SceneError, match=says):
        scene_kernel(**WALLS | changed)


def test_where_there_is_one_surface_more_are_refused():
    with pytest.raises(SceneError, match="one surface"):
        stepped_kernel(**WALLS)


@plain
@pytest.mark.parametrize("method", ["taylor", "dop853", "rodas5p"])
def test_the_jump_of_a_surface_that_is_not_met_need_not_be_defined(method):
    """A ball gets 3 J/kg at the floor, and loses 2.25 at a lid 1 m above: more than it comes down with."""
    kernel = scene_kernel(
        name="lid", doc="", states=fields("x", "v"), parameters=fields("loss"), rates=lambda v: (v, -1.0),
        surface={"lid": lambda x: 1.0 - x, "floor": lambda x: x}, start=lambda: (0.5, 0.0),
        switch={"lid": lambda x, v, loss: (x, -sqrt(v * v - loss)), "floor": lambda x, v: (x, sqrt(v * v + 6.0))},
    )  # fmt: skip
    outputs, status = found(kernel, method, 4.5, flips=5)
    speeds = [(0.0, 1.0), (7.0, 5.0), (0.5, 2.5), (8.5, 6.5), (2.0, 4.0)]  # squares, at both ends of each flight
    time = sum(abs(math.sqrt(begin) - math.sqrt(end)) for begin, end in speeds)
    assert status == Status.OK
    assert [outputs[name] for name in ("time", "x", "v")] == pytest.approx([time, 0.0, -2.0], abs=1e-8)


@pytest.mark.parametrize("factor", [lambda x: where(x < 1.0, 1.0, 2.0), lambda x: where(x > 1.0, 2.0, 1.0)])
def test_a_jump_knows_on_which_side_of_another_surface_it_is_made(factor):
    """From the middle to the left wall and across, as fast, since that wall is not behind the right one."""
    kernel = scene_kernel(**WALLS | {"switch": {"left": lambda x, v, y, w: (x, -v * factor(x), y, w)}})
    outputs, status = found(kernel, "taylor", 0.5, 0.5, 9.0, -1.0, flips=2)
    assert status == Status.OK
    assert outputs["time"] == pytest.approx(1.5)


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_jump_may_ask_for_the_mode_that_another_surfaces_jump_sets(method):
    """A body between walls: the right one makes it f times as fast in mode 1, the left one as slow again in mode -1."""
    modes = scene_kernel(
        name="modes_at_walls", doc="body between walls", states=fields("x", "v", "m"), parameters=fields("f"),
        rates=lambda v: (v, 0.0, 0.0), surface={"right": lambda x: 1.0 - x, "left": lambda x: x},
        switch={
            "right": lambda x, v, m, f: (x, -v * where(m > 0.0, f, 1.0), -1.0),
            "left": lambda x, v, m, f: (x, -v * where(m > 0.0, 1.0, 1.0 / f), 1.0),
        },
        start=lambda: (0.5, 1.0, 1.0),
    )  # fmt: skip
    values, status = found(modes, method, 3.0, flips=4)
    assert status == Status.OK
    assert values["time"] == pytest.approx(1.5 + 2.0 / 3.0, rel=1e-12)
    assert (values["v"], values["m"]) == (pytest.approx(-3.0, rel=1e-12), -1.0)
