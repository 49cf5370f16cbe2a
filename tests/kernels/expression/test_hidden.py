"""Pulses that neither a series nor a few points tell of, and starts that rounding hides: right, or a word about it."""

import numpy as np
import pytest
from columns import fields, solve
from mpmath import mp, mpf

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.scene import exp, power, scene_kernel, sqrt
from kernels.stepping import stepped_kernel

pytestmark = pytest.mark.skipif(not COMPILED, reason="many steps")
END = 30


def scene(name, rates, states=("x", "t"), parameters=("w", "H", "c", "clock"), make=scene_kernel, **changed):
    parts = {"surface": lambda t: END - t, "start": lambda: (*[1.0] * (len(states) - 1), 0.0)} | changed
    return make(name=name, doc="pulse", states=fields(*states), parameters=fields(*parameters), rates=rates, **parts)


def gaussian(x, t, w, H, c, clock):
    return H * exp(-(((t - c) / w) ** 2)), clock


GAUSSIAN = scene(
    "gaussian", gaussian, parameters=("w", "H", "c", "clock", "t0"), start=lambda t0: (1.0, t0),
    surface=lambda t, t0: t0 + END - t,
)  # fmt: skip
SHAPES = scene(
    "shapes",
    lambda t, w, H, c, clock: (
        H / (1 + ((t - c) / w) ** 2),
        H * power(1 + ((t - c) / w) ** 2, -1.5),
        H * sqrt((t - c) ** 2 + w * w),
        H * exp(-abs(t - c) / w),
        clock,
    ),
    ("rational", "cubed", "corner", "edge", "t"),
)


def area(antiderivative, w, H, c):
    """What a pulse H g(y), y = (t - c)/w, adds to 1."""
    w, H, c = mpf(w), mpf(H), mpf(c)
    return 1 + H * w * (antiderivative((END - c) / w) - antiderivative(-c / w))


def of_gaussian(y):
    return mp.sqrt(mp.pi) / 2 * mp.erf(y)


def cells():
    """w, H, c over decades, with the one that was found."""
    random = np.random.default_rng(3)
    w, H, c = 10.0 ** random.uniform(-3, 0.5, 60), 10.0 ** random.uniform(-3, 4, 60), random.uniform(3, 29, 60)
    return [*zip(w, H, c, strict=True), (1.0, 1e4, 20.0), (1e-3, 1.0, 20.0)][2:]


def solved(kernel, method, rtol, cells, **more):
    w, H, c = np.transpose(cells)
    return solve(kernel, method, w, H, c, np.ones(len(w)), **more, flips=np.ones(len(w)), rtol=rtol)


def wrong(found, status, true, rtol):
    """Cells that say OK and are not right."""
    error = np.array([float(abs(mpf(float(f)) / t - 1)) for f, t in zip(found, true, strict=True)])
    return (status == Status.OK) & ~(error <= rtol)


@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_a_gaussian_pulse_is_seen_wherever_it_is_and_however_narrow(rtol):
    """By steps it is a nightly family of benchmarks/honesty."""
    outputs, status = solved(GAUSSIAN, "taylor", rtol, cells(), t0=0.0)
    assert not wrong(outputs["x"], status, [area(of_gaussian, *cell) for cell in cells()], rtol).any()
    assert (status == Status.OK).mean() > 0.9


def test_pulses_of_all_shapes_are_seen():
    rtol = 1e-10

    def of_corner(y):
        return (y * mp.sqrt(1 + y * y) + mp.asinh(y)) / 2

    def of_edge(y):
        return mp.sign(y) * (1 - mp.exp(-abs(y)))

    outputs, status = solved(SHAPES, "taylor", rtol, cells())
    assert (status == Status.OK).mean() > 0.5
    for name, whole in (("rational", mp.atan), ("cubed", lambda y: y / mp.sqrt(1 + y * y)), ("edge", of_edge)):
        assert not wrong(outputs[name], status, [area(whole, *cell) for cell in cells()], rtol).any()
    corners = [1 + w * (area(of_corner, w, H, c) - 1) for w, H, c in cells()]
    assert not wrong(outputs["corner"], status, corners, rtol).any()


def test_a_pulse_of_the_switch_itself_is_seen():
    kernel = scene(
        "surface", lambda x, t, w, H, c, clock: (H, clock), surface=lambda t, w, c: 0.5 - exp(-(((t - c) / w) ** 2))
    )
    widths = [1e-3, 0.03, 1.0]
    outputs, status = solved(kernel, "taylor", 1e-10, [(w, 1.0, 20.0) for w in widths])
    assert not wrong(outputs["time"], status, [20 - mpf(w) * mp.sqrt(mp.log(2)) for w in widths], 1e-10).any()
    assert (status[:2] == Status.OK).all()  # the last one's unit of time, e/e', is 1e173 s


def test_at_a_fixed_step_a_pulse_between_the_points_is_not_quiet():
    kernel = scene("gaussian_steps", gaussian, make=stepped_kernel)
    w = np.array([1e-3, 0.01, 0.1, 0.3, 1.0])
    for step in (2.9, 0.3):
        outputs, status = solve(kernel, "rk4", w, 1e4, 19.3, 1.0, flips=1.0, step=step, rtol=1e-6)
        true = [float(area(of_gaussian, each, 1e4, 19.3)) for each in w]
        assert ((status == Status.INACCURATE) | (abs(outputs["x"] / true - 1) <= outputs["error"])).all()
        assert status[0] == Status.INACCURATE
    assert status[-1] == Status.OK


def test_a_start_that_rounding_puts_on_the_switch_is_not_quiet():
    t0 = np.array([0.0, 1e17, 1e18, 1e19])
    outputs, status = solved(GAUSSIAN, "taylor", 1e-12, [(1.0, 1.0, 20.0)] * len(t0), t0=t0)
    assert (status[t0 > 1e10] != Status.OK).all()
    assert status[0] == Status.OK
    assert outputs["time"][0] == pytest.approx(END, rel=1e-12)
