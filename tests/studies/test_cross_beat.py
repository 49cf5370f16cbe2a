"""What the study of Bürgi's cross-beat concludes is so: by integration of both foliots, and by false numbers."""

import cross_beat as study
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of swings; the integrator's tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("cross") / "cross_beat.h5"
    read = sweep.study(study.__file__.replace(".py", ".toml"), allow_import=True)
    sweep.run(read, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.prepared(sweep.open_result(result).load())


@pytest.fixture(scope="module")
def halves(ds):
    return study.shaken(ds)


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys, halves, monkeypatch):
    monkeypatch.setattr(study, "shaken", lambda _: halves)
    assert study.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "so for them it is a detail" in text


def switches(tau, I_l, I_r, c, R, k, d, phi0, sway, nu, count):
    """Times between switches of two masses on a spring, by DOP853, torque and friction turned round by hand."""
    y, t, last = np.array([-phi0, 0.0, -phi0, 0.0]), 0.0, 0.0
    side, rising, found = 1, 1.0, []

    def rates(t, y):
        torque, shaken = k * (y[0] - y[2]) + d * (y[1] - y[3]), sway * np.cos(nu * t)
        left = (tau * (side > 0) - c * y[1] - R * rising - torque) / I_l - shaken
        right = (-tau * (side < 0) - c * y[3] - R * rising + torque) / I_r + shaken
        return y[1], left, y[3], right

    def leaves(t, y):
        return phi0 - y[0] if side > 0 else y[2] + phi0

    def rest(t, y):
        return y[1]

    leaves.terminal = rest.terminal = True
    leaves.direction = -1
    while len(found) < count:
        rest.direction = -rising
        leg = solve_ivp(rates, (t, t + 100), y, "DOP853", events=(leaves, rest), rtol=1e-11, atol=1e-13)
        t, y = leg.t[-1], leg.y[:, -1]
        if len(leg.t_events[0]):
            found.append(t - last)
            last, side = t, -side
        else:
            rising = -rising
    return found


@pytest.mark.parametrize(("share", "R", "sway"), [(0.5, 0.0, 0.0), (0.5, 5e-5, 0.0), (0.7, 0.0, 0.3), (0.6, 2e-5, 0.2)])
def test_the_swings_are_those_of_an_own_integration(ds, share, R, sway):
    tau, c, phi0, nu = 9.56541e-4, float(ds.c_l), float(ds.phi0), 1.3
    fixed = {"I_l": 1e-4 * share, "I_r": 1e-4 * (1 - share), "c_l": c, "c_r": c, "R_l": R, "R_r": R, "tau": tau}
    made = sweep.study(
        kernel="cross_beat_scene:KERNEL", axes={"flips": [1, 2, 5, 6]}, rtol=1e-9, allow_import=True,
        outputs=["interval"], fixed=fixed | {"phi0": phi0, "stiffness": 0.3, "damper": 2e-3, "sway": sway, "nu": nu},
    )  # fmt: skip
    found = switches(tau, 1e-4 * share, 1e-4 * (1 - share), c, R, 0.3, 2e-3, phi0, sway, nu, 6)
    here = sweep.run(made).interval.values
    # both at 1e-9 and better; the frictions' signs are turned round at rests found to 1e-12 s
    np.testing.assert_allclose(here, np.array(found)[[0, 1, 4, 5]], rtol=1e-8)


def failing(statements):
    return [s.what.strip() for s in statements if s.failed]


def test_false_periods_or_swings_are_seen(ds, halves, monkeypatch):
    assert not failing(study.as_one(ds)) + failing(study.steadied(halves))
    assert len(failing(study.as_one(ds.assign(off=ds.off * 1.02)))) == 1
    assert len(failing(study.as_one(ds.assign(off=ds.off + 2e-5)))) == 2
    assert len(failing(study.as_one(ds.assign(period=ds.period * 1.3)))) == 1
    assert len(failing(study.steadied(halves + 1e-3 * (halves.swing % 2) * (halves.share < 0.3)))) == 2
    whole = study.single
    monkeypatch.setattr(study, "single", lambda tau, inertia, *x: whole(tau, 0.99 * inertia, *x))
    assert len(failing(study.sums(ds))) >= 3
