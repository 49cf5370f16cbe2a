"""What the study of the exponent -1/2 concludes is so, on a coarse grid."""

import re

import numpy as np
import origin_of_half as study
import pytest
import xarray as xr

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of cells; the kernels' own tests run as plain Python")

DEGREE_TWO = {
    "v^2", "impact", "impact + v^2", "Coulomb ~ drive", "v^2 + Coulomb ~ drive", "impact + Coulomb ~ drive",
    "impact + v^2 + Coulomb ~ drive",
}  # fmt: skip


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with 5 torques a decade instead of 10."""
    path = tmp_path_factory.mktemp("origin") / "origin_of_half.h5"
    full = sweep.study(study.__file__.replace(".py", ".toml"))
    axes = {name: full.axes[name].values for name in ("e", "c", "a", "R")}
    axes["mu"] = {"spacing": "log", "start": 1e-6, "stop": 1e6, "num": 61}
    coarse = sweep.study(kernel="foliot", rtol=1e-9, axes=axes, fixed={"n": 2, "phi0": 1})
    sweep.run(coarse, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.read(str(result))


@pytest.fixture(scope="module")
def found():
    return study.followed()


def held(statements):
    return {s.what: s.holds for s in statements}


def test_coulomb_friction_of_the_study_file_is_half_of_torques_on_its_grid():
    axes = sweep.study(study.__file__.replace(".py", ".toml")).axes
    R, mu = axes["R"].values[1:], axes["mu"].values
    nearest = mu[np.abs(np.log(mu / (R[:, None] / study.RHO))).argmin(axis=1)]
    np.testing.assert_allclose(R / nearest, study.RHO, rtol=1e-14)
    assert study.FIXED in R
    assert study.E in axes["e"].values


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    assert not re.search(r"\| NO$", capsys.readouterr().out, re.MULTILINE)
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_every_mixture_of_losses_is_looked_at_once():
    names = [str(m) for m in study.MIXTURES]
    assert len(names) == len(set(names)) == 2**3 * 3 - 1
    assert {str(m) for m in study.MIXTURES if m.of_degree_two} == DEGREE_TWO


def test_the_exponent_is_minus_one_half_at_every_torque_exactly_for_losses_of_degree_two(ds):
    for mixture in study.MIXTURES:
        line = study.part(ds, mixture)
        x, y = np.log(line.mu.values), np.log(line.period.values)
        slopes = np.diff(y) / np.diff(x)
        always = np.abs(slopes + 0.5).max() < 1e-9
        assert always == (str(mixture) in DEGREE_TWO), str(mixture)


def test_impacts_however_combined_end_at_minus_one_half_and_friction_alone_at_minus_one_third(ds):
    at_end = {str(m): float(study.part(ds, m).slope[-1]) for m in study.MIXTURES}
    assert at_end["viscous"] == pytest.approx(-1 / 3, abs=1e-4)
    assert at_end["impact + viscous"] == pytest.approx(-1 / 2, abs=3e-3)
    assert at_end["Coulomb"] == pytest.approx(0, abs=1e-9)
    assert at_end["impact + Coulomb"] == pytest.approx(-1 / 2, abs=3e-3)


def test_coulomb_friction_in_proportion_to_the_drive_is_followed_along_the_diagonal(ds):
    line = study.part(ds, study.Mixture(coulomb="proportional"))
    np.testing.assert_allclose(line.R / line.mu, study.RHO, rtol=1e-12)
    # at fixed R the same cells have s = rho^2/(1 - rho^2) = 1/3, which is not the exponent asked for
    np.testing.assert_allclose(line.sensitivity, 1 / 3, rtol=1e-9)


@pytest.mark.parametrize("power", [-1e-3, 1e-3])
def test_a_period_of_another_power_makes_the_statements_fail(found, power):
    wrong = {m: line.assign(period=line.period * line.mu**power) for m, line in found.items()}
    assert not any(held(study.always_half(wrong)).values())
    assert not held(study.prefactors(wrong))["impact: P (mu/phi0)^(1/2)"]


def test_an_amplitude_that_grows_with_the_torque_makes_the_statements_fail(found):
    wrong = {m: line.assign(speed=line.speed * line.mu**1e-6) for m, line in found.items()}
    assert not any(held(study.always_half(wrong)).values())
    assert len(held(study.always_half(found))) == 7


def test_viscous_friction_would_not_pass_as_minus_one_half():
    """The scene that measures -1/2 is not bound to it: with a = 1/s it falls by 1/3 at strong drive."""
    axes = {"mu": [1e7, 2e7]}
    fixed = {"phi0": 1, "a": 1, "flips": 3000}
    made = sweep.study(kernel="foliot_scene:KERNEL", axes=axes, fixed=fixed, rtol=1e-9, allow_import=True)
    interval = sweep.run(made).interval.values
    assert np.log2(interval[1] / interval[0]) == pytest.approx(-1 / 3, abs=2e-3)


def test_a_false_sensitivity_makes_the_other_statements_fail(ds):
    wrong = held(study.never_half(ds.assign(sensitivity=1.03 * ds.sensitivity)))
    assert not wrong["viscous: smallest mu"]
    assert not wrong["differences of ln P against the exact s"]
    # a clock that is at -1/2 everywhere although its losses are not of degree two
    flat = xr.full_like(ds.sensitivity, 0.5).where(ds.sensitivity.notnull())
    assert next(s.holds for s in study.never_half(ds.assign(sensitivity=flat))) is False


def test_the_impact_that_takes_over_is_slighter_at_stronger_drive():
    statement = study.slight_impacts()
    assert statement.holds
    places = [float(x) for x in re.findall(r"\d\.\d+e\+\d+", statement.what)]
    # a swing's viscous share (3/alpha)^(1/3) against the impact's 1 - e^2: about alike at both
    shares = [(3 / alpha) ** (1 / 3) / (1 - e**2) for alpha, e in zip(places, (0.99, 0.999), strict=True)]
    assert shares == pytest.approx([0.68, 0.68], abs=0.02)
