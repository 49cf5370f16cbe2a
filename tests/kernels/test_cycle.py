"""Limit cycles of scenes: against closed forms, the foliot's own kernel, and in the words of their statuses."""

import foliot_scene
import numpy as np
import pytest
from columns import estimated, solve
from junction_scene import KERNEL as JUNCTION
from kicked_scene import KICKED
from mpmath import mp, mpf
from scipy.integrate import solve_ivp
from stribeck_scene import KERNEL as STRIBECK

from kernels.cycle import cycle_kernel
from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="a cycle takes minutes as plain Python")


def kicked(zeta, omega, kick):
    """Period, speed before the kick, sizes, multiplier, sensitivities to zeta and omega: u = q (u + kick)."""
    with mp.workdps(50):
        zeta, omega, kick = mpf(zeta), mpf(omega), mpf(kick)
        turn = mp.sqrt(1 - zeta**2)
        q = mp.exp(-mp.pi * zeta / turn)
        before = q * kick / (1 - q)
        far = (before + kick) / omega * mp.exp(-zeta * mp.acos(zeta) / turn)
        found = (2 * mp.pi / (omega * turn), before, far, before + kick, q**2, (zeta / turn) ** 2, mpf(-1))
        return [float(x) for x in found]


def test_a_kicked_oscillator_has_the_cycle_of_the_closed_form():
    zeta, omega, kick = (
        np.ravel(x) for x in np.meshgrid([1e-3, 0.01, 0.3, 0.9], [1e-3, 1.0, 1e3], [0.2, 30.0], indexing="ij")
    )
    found, status, error = estimated(KICKED, "taylor", zeta=zeta, omega=omega, kick=kick, rtol=1e-9)
    assert (status[zeta > 5e-3] == Status.OK).all()
    assert (solve(KICKED, "taylor", zeta=zeta, omega=omega, kick=kick, asked=("period", "v"))[1] == Status.OK).all()
    true = np.array([kicked(*cell) for cell in zip(zeta, omega, kick, strict=True)]).T
    names = "period", "v", "x_size", "v_size", "multiplier", "period_by_zeta", "period_by_omega"
    for name, value, whole in zip(names, true, (1, 1, 1, 1, 0, 0, 0), strict=True):
        scale = np.abs(value) if whole else np.maximum(1.0, np.abs(value))
        assert (abs(abs(found[name]) - abs(value)) <= np.maximum(error, 1e-14) * scale).all(), name
    assert (np.sign(found["period_by_omega"]) == -1).all()
    assert abs(found["period_by_kick"]).max() < 1e-9
    alone, _, _ = estimated(KICKED, "taylor", zeta=zeta[5:6], omega=omega[5:6], kick=kick[5:6], rtol=1e-9)
    for name, column in alone.items():
        assert column[0] == found[name][5], name


def test_a_cycle_far_larger_than_the_motion_that_it_is_searched_from_is_found():
    """The speed grows to 1/(2 pi zeta) kicks."""
    zeta = np.array([1e-4, 1e-6, 1e-8])
    found, status, error = estimated(KICKED, "taylor", zeta=zeta, kick=1.0, asked=("period", "v"))
    assert (status <= Status.INACCURATE).all()
    true = np.array([kicked(one, 1.0, 1.0)[:2] for one in zeta]).T
    for name, value in zip(("period", "v"), true, strict=True):
        assert (abs(abs(found[name] / value) - 1.0) <= np.maximum(error, 1e-9)).all(), name


def test_a_multiplier_close_to_1_is_as_accurate_as_its_cycle_is_known():
    """u = kick + 2 u (1 - u) has a double root at kick = -1/8, where the multiplier is 1."""
    near = 10.0 ** -np.arange(2.0, 9.0)
    u = 0.25 * (1.0 + np.sqrt(near))
    cells = {"kick": -0.125 * (1.0 - near), "gain": 2.0, "bend": 1.0, "v0": u, "settle": 0.0}
    found, status, error = estimated(KICKED, "taylor", **cells, asked=("multiplier",))
    off = abs(found["multiplier"] - (2.0 - 4.0 * u) ** 2)
    assert (off <= error).all()
    assert (off[status == Status.OK] <= 1e-9).all()


def logistic(gain, flips):
    """Multiplier of the stable orbit of so many kicks of u -> gain u (1 - u), and its speeds."""
    u = 0.3
    for _ in range(20_000):
        u = gain * u * (1.0 - u)
    orbit, slope = [u], 1.0
    for _ in range(flips):
        slope *= gain * (1.0 - 2.0 * u)
        u = gain * u * (1.0 - u)
        orbit.append(u)
    return slope, orbit


def test_a_cycle_that_doubles_its_period_is_told_by_its_multiplier():
    gain = np.array([2.8, 3.2, 3.5, 3.2])
    cells = {"gain": gain, "bend": 1.0, "settle": [4.0, 4.0, 4.0, 0.0], "v0": [0.3, 0.3, 0.3, 2.2 / 3.2]}
    found, status = solve(KICKED, "taylor", **cells, asked=("period", "v", "multiplier"), rtol=1e-8)
    assert list(status) == [Status.OK, Status.OK, Status.PERIOD_2, Status.UNSTABLE]
    for cell, flips in enumerate((2, 2, 4)):
        slope, orbit = logistic(gain[cell], flips)
        assert found["multiplier"][cell] == pytest.approx(slope, abs=1e-8)
        assert min(abs(found["v"][cell] - u) for u in orbit) < 1e-9
        assert found["period"][cell] == pytest.approx(np.pi * flips, rel=1e-12)
    assert found["multiplier"][3] == pytest.approx(1.2**2, abs=1e-9)


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ({"zeta": 0.1}, Status.COMES_TO_REST), ({"zeta": 0.0}, Status.NO_CYCLE),
        ({"zeta": -0.1, "kick": -1.0, "v0": 3.6}, Status.UNSTABLE), ({"zeta": 0.0, "kick": 1.0}, Status.NOT_CONVERGED),
        ({"zeta": 0.05, "gain": 1.5}, Status.NOT_CONVERGED),  # it grows, about an equilibrium of the rates
    ],
)  # fmt: skip
def test_what_has_no_stable_cycle_says_so(cell, status):
    found, verdict = solve(KICKED, "taylor", **{name: [value] for name, value in cell.items()})
    assert verdict[0] == status
    if status == Status.COMES_TO_REST:
        assert np.isnan(found["period"][0])
        assert abs(found["x"][0]) < 1e-12
        assert abs(found["v"][0]) < 1e-12


def test_what_comes_to_rest_slowly_is_no_cycle_of_tiny_size():
    _, verdict = solve(KICKED, "taylor", gain=[0.999], bend=1.0)
    assert verdict[0] == Status.COMES_TO_REST


def test_the_foliot_as_a_scene_has_the_cycle_of_its_own_kernel():
    """Five decades of drive, four losses."""
    mu = np.tile(10.0 ** np.linspace(-1.0, 4.0, 6), 4)
    losses = {name: np.zeros(24) for name in ("a", "c", "R")} | {"e": np.ones(24)}
    losses["a"][:] = 0.5
    losses["e"][6:12], losses["c"][12:18], losses["R"][18:] = 0.6, 0.3, 0.2 * mu[18:]
    asked = "period", "speed", "multiplier", "period_by_mu"
    scene = cycle_kernel(**foliot_scene.SCENE)
    found, status = solve(scene, "taylor", mu=mu, phi0=1.0, **losses, asked=asked)
    assert (status == Status.OK).all()
    smooth = losses["c"] == 0.0
    for those, method in ((smooth, "segments"), (~smooth, "taylor")):
        own, _ = solve(FOLIOT, method, mu=mu[those], phi0=1.0, n=2.0, rtol=1e-11,
                       **{name: column[those] for name, column in losses.items()})  # fmt: skip
        for name, other in (("period", "period"), ("speed", "crossing_speed")):
            assert abs(abs(found[name][those]) / own[other] - 1.0).max() < 1e-9, name
        assert abs(found["multiplier"][those] - own["multiplier"] ** 2).max() < 1e-9
        assert abs(found["period_by_mu"][those] + own["sensitivity"]).max() < 1e-9


def test_a_phase_that_is_locked_to_its_drive_goes_on_by_whole_turns():
    """phase' = detuning + cos(drive) - sin(phase), drive' = 1: locked, and between two steps."""
    cells = {"detuning": [0.0, 0.3, 1.2, 0.9], "order": 0.0, "ac": 1.0, "w": 1.0, "flips": 1.0, "settle": 16.0}
    found, status = solve(JUNCTION, "taylor", **cells, asked=("period", "phase", "phase_turns"))
    assert list(status) == [Status.OK] * 3 + [Status.NOT_CONVERGED]
    assert list(found["phase_turns"][:3]) == [0.0, 0.0, 1.0]
    end = 24.0 * np.pi
    own = solve_ivp(lambda t, y: [1.2 + np.cos(t) - np.sin(y[0])], (0.0, end), [0.0], rtol=1e-11, atol=1e-12)
    assert np.cos(own.y[0, -1] - found["phase"][2]) == pytest.approx(1.0, abs=1e-15)
    assert np.sin(own.y[0, -1] - found["phase"][2]) == pytest.approx(0.0, abs=1e-8)


def stuck_and_slipping(belt):
    """Period and largest sizes of place and speed of the mass on the belt, by scipy from where it begins to slip."""
    begins = 1.5 - 0.1 * belt

    def slips(t, y):
        return y[1], 1.0 + 0.5 * np.exp((y[1] - belt) / 0.5) - y[0] - 0.1 * y[1]

    def sticks(t, y):
        return y[1] - belt if t > 0.05 else -1.0

    sticks.terminal = True
    events = [sticks, lambda t, y: slips(t, y)[1], lambda t, y: y[1]]
    own = solve_ivp(slips, (0.0, 20.0), [begins, belt], rtol=1e-12, atol=1e-13, events=events)
    turns = [np.abs(own.y_events[k][:, j]).max() for k, j in ((2, 0), (1, 1))]
    return own.t[-1] + (begins - own.y[0, -1]) / belt, max(turns[0], begins), max(turns[1], belt)


def test_a_cycle_in_which_the_mass_sticks_has_a_period_and_amplitudes():
    belt = np.array([0.1, 0.3, 1.2])
    found, status = solve(STRIBECK, "taylor", belt=belt, flips=2.0, rtol=1e-8)
    assert (status == Status.OK).all()
    true = np.transpose([stuck_and_slipping(one) for one in belt])
    for name, value in zip(("period", "place_size", "speed_size"), true, strict=True):
        assert abs(found[name] / value - 1.0).max() < 1e-8, name
    assert abs(found["multiplier"]).max() < 1e-8
