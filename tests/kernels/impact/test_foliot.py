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


@pytest.mark.parametrize("log_kappa", [(-1.5, -0.01), (0.01, 1.5), (0.0, 0.0)])
def test_the_clock_of_two_bodies_is_the_foliot_that_loses_speed_at_the_switch(log_kappa):
    """A heavy foliot swings on and throws the wheel back; a light one turns at once; equal bodies stop each other."""
    random, n = np.random.default_rng(4), 40 if COMPILED else 8
    torque, I_c, r_c, r_v = (10 ** random.uniform(-3, 3, n) for _ in range(4))
    kappa = 10 ** random.uniform(*log_kappa, n)
    teeth = random.choice([3.0, 15.0, 31.0], n)
    h = 2 * np.pi * r_c / teeth / 4
    I_v = I_c * (r_v / r_c) ** 2 / kappa
    M, m = I_c / r_c**2, I_v / r_v**2
    e = (m - M) / (m + M)
    two, verdict = solve(IMPACT, "closed", torque, I_c, I_v, r_c, r_v, teeth, h, 0.0)
    one, status = solve(FOLIOT, "pure", torque / r_c / (M + m), h, e=e)
    assert (verdict == Status.OK).all()
    assert (status == Status.OK).all()
    speed = -e * one["crossing_speed"]  # of both bodies after the switch, in the direction of the new tooth
    recoil = np.where(e > 1e-9, one["amplitude"] - h, 0.0)
    for found, true, size in (
        (two["period"], one["period"], one["period"]),
        (two["multiplier"], one["multiplier"], 1.0),
        (two["swing"], one["amplitude"], h),
        (two["pallet_speed"] * r_v, speed, one["crossing_speed"]),
        (two["wheel_speed"] * r_c, speed, one["crossing_speed"]),
        (two["recoil"] * r_c, recoil, one["amplitude"]),
    ):
        assert (abs(found - true) <= LIMIT * size * np.maximum(1.0, one["amplitude"] / h)).all()
    less, _ = solve(IMPACT, "closed", torque, I_c, I_v, r_c, r_v, teeth, 0.9 * h, 0.0)
    dropless, _ = solve(FOLIOT, "pure", torque / r_c / (M + m), 0.9 * h, e=e)
    assert (abs(less["period"] / dropless["period"] - 1) > 1e-3).all()  # with drop it is another clock
