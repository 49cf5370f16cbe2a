"""What the study of the balance's ring-down concludes is so, on a coarse grid."""

import balance_ringdown as study
import numpy as np
import pytest

import sweep
from kernels.interface import Status


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with a sixth of its points a decade."""
    path = tmp_path_factory.mktemp("ringdown") / "balance_ringdown.h5"
    axes = {
        "zeta": {"spacing": "log", "start": 1e-4, "stop": 2, "num": 31},
        "r": {"spacing": "log", "start": 1e-4, "stop": 0.9, "num": 37},
    }
    coarse = sweep.study(kernel="balance", rtol=1e-12, axes=axes, fixed={"omega_n": 15.0, "theta0": -1.0})
    sweep.run(coarse, path, workers=1).close()
    return path


def test_every_statement_holds_on_either_side_of_release(result):
    groups = study.statements(study.read(str(result)))
    checked = [s for lines in groups.values() for s in lines if s.holds is not None]
    assert [s.what for s in checked if not s.holds] == []
    assert len(checked) == 13


def test_all_light_damping_falls_on_one_curve(result):
    ds = study.read(str(result))
    light = ds.where((ds.zeta < 1e-3) & (ds.r < 0.1), drop=True)
    np.testing.assert_allclose(light.N, light.law, rtol=0, atol=1.0)
    assert (ds.status.where(ds.zeta >= 1, drop=True) == Status.OVERDAMPED).all()


def test_a_count_that_is_off_by_two_is_seen(result):
    ds = study.read(str(result))
    statements = study.counts(ds.assign(N=ds.N + 2 * (ds.N > 0)))
    assert statements[0].holds is False


def test_the_figure_shows_the_periods_of_the_sweep_on_one_line(result):
    ds = study.read(str(result))
    page = study.figure(ds)
    by_letter = {axes.get_title(loc="left"): axes for axes in page.axes}
    assert {"(a)", "(b)", "(c)", "(d)"} <= set(by_letter)
    marks = by_letter["(d)"].lines[1:]
    assert len(marks) == 3
    for line in marks[1:]:
        np.testing.assert_array_equal(line.get_ydata(), marks[0].get_ydata())


def test_the_study_draws_its_figure_and_prints_its_table(result, capsys):
    assert study.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_a_kernel_that_ends_by_the_rule_of_the_page_is_seen(result):
    ds = study.read(str(result))
    assert [s.holds for s in study.page_rule(ds)] == [True, True]
    assert study.page_rule(ds.assign(N=ds.N - 1))[0].holds is False


def test_the_motion_that_is_drawn_is_that_of_dop853_at_every_turn():
    zeta, r = study.SHOWN
    times, angles = study.turning_points(zeta, r, 1.0, 5)
    np.testing.assert_allclose(study.motion(zeta, r, 1.0, times, 5), angles, atol=1e-9)


def test_friction_that_changed_the_period_would_be_seen(monkeypatch):
    """A torque of friction that pulls towards the zero, in proportion to the angle, is a stiffer spring."""
    monkeypatch.setattr(
        study, "_equation", lambda z, r, s: lambda t, y: (y[1], -2 * z * y[1] - y[0] * (1 + 1e-6) - s * r)
    )
    assert [s.holds for s in study.followed()] == [False, False]
