"""A clock of two bodies without friction that stay together until the escape: a foliot that loses speed at the switch.

Without drop (h = p/4, e = 0) crown wheel and foliot move together from switch to switch under mu = F/(M + m); at each
switch the foliot of mass m meets the wheel of mass M that comes against it with the same speed. So it is the one-body
`foliot` in lengths, with phi0 = h and the restitution (m - M)/(m + M). The identity is derived here.
"""

import numpy as np
import pytest
from columns import solve

from kernels.foliot.cycle import FOLIOT
from kernels.impact.clock import IMPACT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

LIMIT = 1e-13


def clocks(log_kappa, n=40 if COMPILED else 8, seed=4):
    """Plastic clocks without drop, and M, m, F and h of each; log10 of kappa = M/m between two limits."""
    random = np.random.default_rng(seed)
    torque, I_c, r_c, r_v = (10 ** random.uniform(-3, 3, n) for _ in range(4))
    kappa = 10 ** random.uniform(*log_kappa, n)
    teeth = random.choice([3.0, 15.0, 31.0], n)
    h = 2 * np.pi * r_c / teeth / 4
    columns = [torque, I_c, I_c * (r_v / r_c) ** 2 / kappa, r_c, r_v, teeth, h, np.zeros(n), np.zeros(n)]
    return columns, I_c / r_c**2, columns[2] / r_v**2, torque / r_c, h


def both(log_kappa):
    """Outputs of the two bodies and of the one, the restitution, and r_v to turn lengths into angles."""
    columns, M, m, F, h = clocks(log_kappa)
    e = (m - M) / (m + M)
    two, verdict = solve(IMPACT, "closed", *columns)
    one, status = solve(FOLIOT, "pure", F / (M + m), h, e=e)
    assert (verdict == Status.OK).all()
    assert (status == Status.OK).all()
    return two, one, e, columns


@pytest.mark.parametrize("log_kappa", [(-1.5, -0.01), (0.01, 1.5)])
def test_the_clock_of_two_bodies_has_the_period_and_the_multiplier_of_the_foliot_that_loses_speed_at_the_switch(
    log_kappa,
):
    two, one, _, _ = both(log_kappa)
    for name in ("period", "multiplier"):
        np.testing.assert_allclose(two[name], one[name], rtol=LIMIT, err_msg=name)


@pytest.mark.parametrize("log_kappa", [(-1.5, -0.01), (0.01, 1.5)])
def test_after_the_switch_both_bodies_have_the_speed_that_the_restitution_leaves_of_the_speed_before(log_kappa):
    two, one, e, columns = both(log_kappa)
    speed = -e * one["crossing_speed"]  # of the pallet, in the direction of its new tooth
    np.testing.assert_allclose(two["pallet_speed"] * columns[4], speed, rtol=LIMIT)
    np.testing.assert_allclose(two["wheel_speed"] * columns[3], speed, rtol=LIMIT)


def test_a_heavy_foliot_swings_on_and_throws_the_wheel_back_as_far_as_the_one_body_overshoots():
    two, one, e, columns = both((-1.5, -0.01))
    assert (e > 0).all()
    np.testing.assert_allclose(two["swing"], one["amplitude"], rtol=LIMIT)
    np.testing.assert_allclose(two["recoil"] * columns[3], one["amplitude"] - columns[6], rtol=1e-11)
    assert (two["recoil"] > 0).all()


def test_a_light_foliot_turns_at_once_and_never_goes_beyond_the_switch():
    two, one, e, columns = both((0.01, 1.5))
    assert (e < 0).all()
    np.testing.assert_allclose(two["swing"], columns[6], rtol=LIMIT)
    np.testing.assert_allclose(one["amplitude"], columns[6], rtol=LIMIT)
    assert (two["recoil"] == 0).all()


def test_equal_bodies_stop_each_other_dead():
    columns, _, _, F, h = clocks((0, 0))
    for column, value in zip(columns[1:5], (2.0, 2.0, 0.5, 0.5), strict=True):
        column[:] = value
    columns[6][:] = 2 * np.pi * 0.5 / columns[5] / 4
    F, h = columns[0] / 0.5, columns[6]
    two, _ = solve(IMPACT, "closed", *columns)
    one, _ = solve(FOLIOT, "pure", F / 16.0, h, e=0.0)
    np.testing.assert_allclose(two["period"], one["period"], rtol=LIMIT)
    assert abs(two["pallet_speed"] * two["period"]).max() < 1e-14
    assert (two["multiplier"] == 0).all()


def test_with_drop_the_clock_is_another_one():
    """A falling wheel gains speed before it meets the pallet: the period is no longer that of the foliot."""
    columns, M, m, F, h = clocks((-0.5, 0.5))
    columns[6][:] = 0.9 * h
    two, _ = solve(IMPACT, "closed", *columns)
    one, _ = solve(FOLIOT, "pure", F / (M + m), 0.9 * h, e=(m - M) / (m + M))
    assert (abs(two["period"] / one["period"] - 1) > 1e-3).all()
    np.testing.assert_allclose(two["multiplier"], ((m - M) / (m + M)) ** 2, rtol=1e-11, atol=1e-15)
