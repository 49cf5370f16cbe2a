"""What the study of the torque's fine structure concludes is so, on a coarse grid."""

import math

import numpy as np
import pytest
import torque_ripple as ripple

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="hundreds of cells; the kernels' own tests run as plain Python")

DEPTHS = [0.0, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5]
HARMONICS = [*range(1, 9), *range(16, 33, 2), 33, 35, 40, 41, 50, 51, 64]


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with some of its harmonics and depths."""
    path = tmp_path_factory.mktemp("ripple") / "torque_ripple.h5"
    axes = {"a": [5.0, 0.826752996, 0.1], "harmonic": [float(h) for h in HARMONICS], "depth": DEPTHS}
    study = sweep.study(
        kernel="foliot_ripple", rtol=1e-7, outputs=["period", "sensitivity"], axes=axes, fixed={"mu": 1.0, "phi0": 1.0}
    )
    sweep.run(study, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return ripple.read(str(result))


def verdicts(statements):
    return [s.holds for s in statements]


def test_the_study_file_has_the_grid_the_conclusions_need():
    study = sweep.study(ripple.__file__.replace(".py", ".toml"))
    assert list(study.axes) == ["a", "harmonic", "depth"]
    assert (study.fixed["mu"], study.fixed["phi0"]) == (1.0, 1.0)
    assert study.axes["depth"].values[0] == 0
    assert set(HARMONICS) <= set(study.axes["harmonic"].values)


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert ripple.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "HOW DEEP A RIPPLE MAY BE" in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_weight_of_a_uniform_force_gives_the_foliots_own_sensitivity():
    for alpha in (0.04, 1.463, 100.0, 1e4):
        q = ripple.switch_time(alpha)
        s = (1 - math.tanh(q) / q) / math.tanh(q) ** 2
        assert -ripple.first_order(alpha, [0.0])[0] == pytest.approx(2 * s, rel=1e-9)  # and the mean over angle takes s


def test_a_weakly_driven_foliot_sees_the_mean_of_one_over_torque(ds):
    line = ds.change.isel(a=0).sel(harmonic=2)
    for depth in (0.1, 0.2, 0.5):
        assert float(line.sel(depth=depth)) == pytest.approx(1 / math.sqrt(1 - depth**2) - 1, rel=0.08)  # 2 alpha


def test_the_period_is_linear_in_the_depth_unless_the_drive_is_weak(ds):
    for a, least in ((1, 0.55), (2, 0.17)):
        slope = abs(ds.change / ds.depth).isel(a=a).sel(harmonic=1)
        assert least < float(slope.sel(depth=0.01)) < 1.15 * least
        assert float(slope.sel(depth=0.05)) == pytest.approx(float(slope.sel(depth=0.01)), rel=0.05)


def test_the_finer_the_ripple_the_less_the_period_and_the_more_the_sensitivity_minds(ds):
    strong = ds.isel(a=2)
    coarse, fine = strong.sel(harmonic=slice(1, 8)), strong.sel(harmonic=slice(16, 64))
    assert float(abs(fine.K).max()) < 0.5 * float(abs(coarse.K).max())
    assert float(abs(fine.L).max()) > 2 * float(abs(coarse.L).max())


def test_the_allowed_depth_is_where_the_change_passes_the_limit(ds):
    line = ds.change.isel(a=1).sel(harmonic=1)
    depth = ripple.allowed(line, 0.01)
    assert float(np.interp(depth, line.depth, abs(line))) == pytest.approx(0.01, rel=1e-12)
    assert depth == pytest.approx(0.01 / (0.60268 - 0.386 * depth), rel=0.01)  # first and second order there
    assert math.isnan(ripple.allowed(line, 10.0))
    assert ripple.allowed(line.where(line.depth != 0.02), 0.01) == pytest.approx(depth, rel=0.05)


def test_a_false_period_makes_the_statements_fail(ds):
    wrong = ripple.scaled(ds.assign(period=ds.period * (1 + 0.02 * ds.depth)))
    assert not any(verdicts(ripple.linear(wrong))[0:6:2])
    assert not ripple.weak(wrong)[-1].holds


def test_a_false_sensitivity_makes_the_statements_fail(ds):
    wrong = ripple.scaled(ds.assign(sensitivity=ds.sensitivity * (1 + 0.2 * ds.depth)))
    assert not any(verdicts(ripple.linear(wrong))[1:6:2])


@pytest.mark.parametrize("power", [0.1, -0.1])
def test_another_power_of_the_harmonic_makes_the_statements_fail(ds, power):
    factor = (ds.harmonic / 16) ** power
    assert not any(verdicts(ripple.falls(ds.assign(K=ds.K * factor, L=ds.L * factor))))


def test_a_law_of_another_degree_makes_the_statements_fail(ds):
    wrong = ds.assign(change=ds.change * ds.depth**0.2)
    assert not any(verdicts(ripple.linear(wrong))[6:])
    assert not ripple.weak(wrong)[0].holds
