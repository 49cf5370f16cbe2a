"""Balls whose bounces accumulate: when they come to rest, against closed forms to 50 digits."""

import numpy as np
import pytest
from bounce_scene import KERNEL as BALL
from columns import relative_error, solve
from mpmath import mp, mpf
from stiff_scene import RAISED

from kernels.interface import Status
from kernels.lanes.jit import COMPILED

MANY, SOME = 1e5, 20
pytestmark = pytest.mark.skipif(not COMPILED, reason="many bounces")


def rest(g, e, above):
    """A fall, and bounces of which each takes e times as long as the one before."""
    with mp.workdps(50):
        g, e, above = mpf(float(g)), mpf(float(e)), mpf(float(above))
        return mp.sqrt(2 * above / g) * (1 + e) / (1 - e)


@pytest.mark.parametrize(
    ("kernel", "method", "rtol"),
    [(BALL, "taylor", 1e-4), (BALL, "taylor", 1e-9), (RAISED, "taylor", 1e-9), (BALL, "dop853", 1e-8)],
)
def test_a_ball_is_at_rest_when_its_bounces_accumulate(kernel, method, rtol):
    """All methods of steps carry it there by the same code; benchmarks/honesty/families.py tries them."""
    random = np.random.default_rng(3)
    g, e = 10.0 ** random.uniform(-2, 2, SOME), 1.0 - 10.0 ** random.uniform(-1.5, -0.3, SOME)
    above = 10.0 ** random.uniform(-3, 3, SOME) if kernel is BALL else np.ones(SOME)
    outputs, status = solve(kernel, method, g, e, above, flips=MANY, rtol=rtol)
    assert np.isin(status, [Status.COMES_TO_REST, Status.INACCURATE]).all()
    assert (status == Status.COMES_TO_REST).mean() > 0.9
    rests = status == Status.COMES_TO_REST
    truths = [rest(*cell) for cell in zip(g, e, above, strict=True)]
    assert (relative_error(outputs["time"], truths)[rests] < rtol).all()
    assert (outputs["interval"][rests] == 0).all()
    assert (abs(outputs["speed"])[rests] <= rtol * np.sqrt(2 * g * above)[rests]).all()
    assert (abs(outputs["height"] - (kernel is RAISED))[rests] <= rtol * above[rests]).all()


def braked_ball(g, e, above, d):
    """The time of rest with drag by the square of the speed: bounces by closed forms, until they no longer matter."""
    g, e, above, d = (mpf(x) for x in (g, e, above, d))
    top = mp.sqrt(g / d)
    time = mp.acosh(mp.exp(d * above)) / (d * top)
    speed = top * mp.sqrt(-mp.expm1(-2 * d * above))
    while e * speed / g > time * mpf(10) ** -40:
        up = e * speed
        height = mp.log1p((up / top) ** 2) / (2 * d)
        time += mp.atan(up / top) / (d * top) + mp.asinh(up / top) / (d * top)
        speed = top * mp.sqrt(-mp.expm1(-2 * d * height))
    return time


@pytest.mark.parametrize("kernel", [BALL, RAISED])
def test_where_bounces_shrink_by_a_share_that_differs_it_is_right_too(kernel):
    e = np.array([0.4, 0.6, 0.8, 0.9])
    outputs, status = solve(kernel, "taylor", 9.81, e, 1.0, 0.3, flips=MANY, rtol=1e-9)
    with mp.workdps(50):
        truths = [braked_ball(9.81, float(one), 1.0, 0.3) for one in e]
    assert np.isin(status, (Status.COMES_TO_REST, Status.INACCURATE)).all()
    assert (status[e > 0.5] == Status.COMES_TO_REST).all() or kernel is RAISED  # few bounces are told from that floor
    assert (relative_error(outputs["time"], truths)[status == Status.COMES_TO_REST] < 1e-9).all()


def test_what_does_not_slow_down_by_a_factor_is_not_carried_to_rest():
    """A ball that loses nothing bounces for ever; one thrown back faster is never at rest."""
    _, status = solve(BALL, "taylor", [9.81], [1.0, 1.2, 1e4], flips=500.0)
    assert not np.isin(status, [Status.COMES_TO_REST]).any()
