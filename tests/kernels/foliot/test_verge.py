"""Two bodies with friction and restitution, against an event simulation and the kernels that they turn into."""

from fractions import Fraction

import numpy as np
from columns import solve
from verge_oracles import cycle, followed

from kernels.foliot.cycle import FOLIOT
from kernels.foliot.verge import VERGE
from kernels.impact.clock import IMPACT
from kernels.interface import Status

PHI0 = np.deg2rad(20.0)
NAMES = [field.name for field in VERGE.parameters]


def clock(alpha, kappa, e, dry=0.0, drop=0.01):
    """A clock by its drive over viscous friction, inertias, restitution, and R_v/(n tau); `drop` over n phi0."""
    I_v, n, c_v = 1e-4, 0.2, 1e-4
    tau = alpha * c_v**2 * PHI0 / (I_v * n)
    values = tau, I_v, kappa * I_v / n**2, n, PHI0, drop * n * PHI0, e, c_v, dry * n * tau
    return dict(zip(NAMES, values, strict=True))


def found(clocks, rtol=1e-10):
    columns = [[c[name] for c in clocks] for name in NAMES]
    return solve(VERGE, "return_map", *columns, rtol=rtol)


CLOCKS = [clock(2.0, 0.2, 0.4, 0.1), clock(8.0, 0.3, 0.0, drop=0.2), clock(0.5, 2.0, 0.2, 0.7), clock(10.0, 0.3, 0.3)]


def test_the_cycle_is_that_of_an_event_simulation_in_si():
    outputs, status = found(CLOCKS)
    truth = np.array([cycle(c, 22) for c in CLOCKS]).T
    assert (status == Status.OK).all()
    for values, true in zip(outputs.values(), truth, strict=False):
        assert np.allclose(values, true, rtol=1e-10, atol=1e-12)


def test_beyond_half_a_pitch_the_clock_unmeshes_on_its_way_from_rest():
    """Just inside the cycle is there, and no recoil on the way is of half a pitch; just beyond, there is one."""
    clocks = [clock(alpha, 0.1, 0.3) for alpha in np.geomspace(5.0, 300.0, 41)]
    outputs, status = found(clocks)
    pitch = 2 * (2 * 0.2 * PHI0 + clocks[0]["drop"])
    inside = status == Status.OK
    last = np.flatnonzero(inside)[-1]
    assert (status[last + 1 :] == Status.UNMESHES).all()
    assert inside[: last + 1].all()
    assert 0.45 < outputs["recoil"][last] / pitch < 0.5
    for one, unmeshes in ((clocks[last], False), (clocks[last + 1], True)):
        assert (followed(one, 60)[0][5].max() > pitch / 2) == unmeshes


def test_without_friction_it_is_the_plastic_impact_clock():
    teeth, I_v, n, kappa = 31.0, 1e-4, 0.2, np.array([0.02, 0.3, 1.0, 4.0])
    drop = 0.05 * np.pi / teeth
    phi0 = 0.5 * (np.pi / teeth - drop) / n
    two, status = solve(VERGE, "return_map", 1e-3, I_v, kappa * I_v / n**2, n, phi0, drop)
    one, other = solve(IMPACT, "closed", 1e-3, kappa * I_v / n**2, I_v, 0.05, 0.01, teeth, 0.01 * phi0, 0.0)
    there = status == Status.OK
    assert there[1:].all()
    assert status[0] == Status.UNMESHES
    assert one["recoil"][0] > np.pi / teeth
    assert (other == Status.OK).all()
    assert np.allclose(two["period"][there], one["period"][there], rtol=1e-11)
    assert np.allclose(two["amplitude"][there], one["swing"][there] / 0.01, rtol=1e-11)
    assert np.allclose(two["recoil"][there], one["recoil"][there], rtol=1e-9, atol=1e-14)
    assert np.allclose(two["impact_share"][there], 1.0, rtol=1e-11)


def test_without_inertia_of_the_wheel_it_is_the_foliot():
    """To the wheel's inertia and its drop, both a millionth."""
    clocks = [clock(alpha, 1e-9, e, dry, 1e-9) for alpha in (0.3, 1.5, 4.0) for e in (0.0, 0.6) for dry in (0.0, 0.2)]
    outputs, status = found(clocks, 1e-8)
    mu = np.array([c["n"] * c["tau"] / c["I_v"] for c in clocks])
    R = np.array([c["R_v"] / c["I_v"] for c in clocks])
    foliot, _ = solve(FOLIOT, "segments", mu=mu, phi0=PHI0, a=1.0, R=R)
    assert (status == Status.OK).all()
    for name in ("period", "amplitude"):
        assert np.allclose(outputs[name], foliot[name], rtol=1e-7)


def test_wheels_thrown_back_to_the_tooth_before_are_those_of_impact_contact_by_contact():
    """Without friction; each of these clocks meets in each half period a tooth that had escaped before."""
    e, kappa = np.array([(0.2, 0.8), (0.4, 0.7), (0.5, 0.55), (0.5, 0.85), (0.6, 0.35), (0.7, 0.55), (0.3, 9.0)]).T
    teeth, I_v, n = 15.0, 1e-4, 0.2
    h = 2 * np.pi / teeth / 4.1
    two, status = solve(VERGE, "return_map", 1.0, I_v, kappa * I_v / n**2, n, h / n, 0.05 * h, e)
    one, other = solve(IMPACT, "events", 1.0, kappa * I_v / n**2, I_v, 1.0, n, teeth, h, e)
    there = (status == Status.OK) & (other == Status.OK)
    assert there.sum() >= 5
    assert set(status[~there]) <= {Status.NOT_CONVERGED, Status.UNMESHES}
    assert np.allclose(two["period"][there], one["period"][there], rtol=1e-9)
    assert np.allclose(two["amplitude"][there], one["swing"][there] / n, rtol=1e-9)


def test_wheels_thrown_back_to_the_tooth_before_with_friction_are_those_of_an_event_simulation():
    """As often as four times in half a period; the last three clocks limp. Their simulation takes five seconds."""
    again = [
        clock(2.2, 0.513, 0.721, 0.4, 0.05), clock(52.0, 0.983, 0.771, 0.05), clock(2500.0, 0.655, 0.512, 0.05),
        clock(7200.0, 0.861, 0.594, 0.2, 0.2), clock(1200.0, 0.918, 0.565, 0.05, 0.05),
        clock(3.2, 0.567, 0.52, 0.05, 0.2), clock(180.0, 0.66, 0.598, 0.4),
    ]  # fmt: skip
    limping = [clock(300.0, 3.0, 0.6, 0.05), clock(20.0, 6.0, 0.4), clock(56.0, 10.0, 0.6)]
    outputs, status = found(again + limping)
    period, amplitude, _, _, impacts, _, before, met, half = np.array([cycle(c, 60) for c in again + limping]).T
    assert (status == Status.OK).all()
    assert (met[:7] >= 2).all()
    assert met.max() >= 4
    assert (abs(half[:7] - 0.5) < 1e-9).all()
    assert (abs(half[7:] - 0.5) > 0.01).all()
    for name, values in (("period", period), ("amplitude", amplitude), ("impact_share", impacts)):
        assert np.allclose(outputs[name], values, rtol=1e-9, atol=1e-9), name
    assert np.allclose(period, before, rtol=1e-9)


def test_a_clock_whose_bounces_die_out_may_limp():
    """Just above the dry friction that stops it; the speed that repeats at each escape is left again."""
    limping = dict(
        zip(NAMES, (0.4045, 0.0463, 100.0, 0.015, 0.235, 6e-4, 0.685, 0.0, 0.015 * 0.4045 * 0.99995), strict=True)
    )
    outputs, status = found([limping], 1e-12)
    period, amplitude, *_, half = cycle(limping, 100)
    assert status == Status.OK
    assert abs(half - 0.5) > 1e-4
    assert np.allclose((outputs["period"], outputs["amplitude"]), ([period], [amplitude]), rtol=1e-9)


def test_next_to_the_dry_friction_that_stops_it_the_drive_is_known_exactly():
    """Without drop, bounces and viscous friction, with kappa = 3, P = 8 sqrt(I_v phi0/(3 (n tau - R_v)))."""
    n, tau, I_v = 1.1, 0.7, 1e-4
    R_v = np.float64(n * tau) * (1 - np.geomspace(1e-15, 1e-3, 13))
    push = np.array([float(Fraction(n) * Fraction(tau) - Fraction(R)) for R in R_v])
    two, status = solve(VERGE, "return_map", tau, I_v, 3 * I_v / n**2, n, PHI0, 0.0, 0.0, 0.0, R_v, rtol=1e-12)
    assert (status == Status.OK).all()
    assert np.allclose(two["period"], 8 * np.sqrt(I_v * PHI0 / (3 * push)), rtol=1e-14)


def test_without_drop_a_clock_whose_wheel_bounces_may_come_to_rest_between_two_teeth():
    """With less and less drop it returns to the tooth before ever more often, and its period grows."""
    outputs, status = found([clock(1e4, 64.0, 0.104, drop=d) for d in (1e-4, 1e-6, 0.0)])
    assert (status == (Status.OK, Status.OK, Status.STEP_LIMIT)).all()
    assert outputs["period"][1] > outputs["period"][0]


def test_where_it_says_so_a_clock_comes_to_no_cycle_of_one_tooth():
    never = [clock(50.0, 0.133, 0.9), clock(100.0, 7.5, 0.9), clock(20.0, 2.4, 0.9)]
    _, status = found(never)
    assert (status == Status.NOT_CONVERGED).all()
    assert all(abs(period / before - 1) > 1e-4 for period, *_, before, _, _ in (cycle(c, 40) for c in never))
