"""What the study of the balance spring concludes is so, on a coarse grid."""

import math

import hairspring
import numpy as np
import pytest

import sweep
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of cells; the kernels' own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with 8 points a decade instead of 20."""
    path = tmp_path_factory.mktemp("hairspring") / "hairspring.h5"
    axes = {
        "a": {"spacing": "log", "start": 1e-3, "stop": 10, "num": 33},
        "k": {"spacing": "log", "start": 3e-6, "stop": 3e7, "num": 105},
    }
    study = sweep.study(kernel="foliot", rtol=1e-7, axes=axes, fixed={"mu": 1.0, "phi0": 1.0})
    sweep.run(study, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return hairspring.read(str(result))


@pytest.fixture(scope="module")
def springs(ds):
    return hairspring.best_springs(ds)


def verdicts(statements):
    return {s.what.strip(): s.holds for s in statements if s.holds is not None}


def test_the_study_file_has_the_grid_the_conclusions_need():
    study = sweep.study(hairspring.__file__.replace(".py", ".toml"))
    assert list(study.axes) == ["a", "k"]
    assert (study.fixed["mu"], study.fixed["phi0"]) == (1.0, 1.0)
    assert (
        study.axes["k"].values[0] < 1e-5 < 16 / math.pi**2 / study.axes["a"].values[0] ** 2 < study.axes["k"].values[-1]
    )


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert hairspring.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "out of reach" in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_sensitivity_falls_as_the_power_minus_three_quarters_of_the_spring(ds):
    line = hairspring.lines(ds, 1e6)
    window = (line.kappa > 30) & (line.kappa < 3000)
    x, y = np.log(line.kappa[window]), np.log(line.s[window])
    assert np.polyfit(x, y, 1)[0] == pytest.approx(-0.75, abs=0.01)


def test_the_first_order_theory_is_met_where_the_swing_is_nearly_harmonic(ds):
    strong = ds.where((ds.alpha > 1e4) & (ds.kappa > 100) & (ds.kappa < ds.alpha))
    off = strong.s / hairspring.first_order(ds.alpha, ds.kappa).transpose(*strong.s.dims) - 1
    assert int(off.notnull().sum()) > 150
    assert float(abs(off).max()) < 2e-3  # the next order is 1/kappa^(3/2) and 1/alpha^(1/2)


def test_the_spring_of_least_sensitivity_takes_nine_over_pi_squared_of_the_drive(springs):
    strong = springs.where(springs.alpha > 1e4, drop=True)
    assert float(strong.blur.max()) < 0.03
    np.testing.assert_allclose(strong.kappa / strong.alpha, 9 / math.pi**2, rtol=6e-3)  # 8 springs a decade
    np.testing.assert_allclose(strong.s * strong.alpha, math.pi / math.sqrt(27), rtol=1e-3)
    np.testing.assert_allclose(strong.A**2, 4 / 3, rtol=6e-3)
    assert (strong.status == Status.NOT_SELF_STARTING).all()


def test_no_spring_of_the_grid_is_better_than_the_best_one(ds, springs):
    least = ds.s.min("k").where(ds.alpha > 9.99, drop=True)
    assert (springs.s.values <= least.values * (1 + 1e-6)).all()


def test_a_spring_hardly_helps_a_weakly_driven_foliot(ds):
    weak = ds.where(ds.alpha < 1.01, drop=True)
    assert float((weak.s.isel(k=0) / weak.s.min("k")).max()) == pytest.approx(1.26, abs=0.01)


def test_a_self_starting_foliot_has_a_spring_weaker_than_twice_the_drive(ds):
    starts = ds.kappa.where(ds.status == Status.OK)
    assert 1.4 < float(starts.max()) < 2


def test_the_clockmakers_springs_do_what_they_are_said_to(ds, springs):
    line, least = hairspring.lines(ds, 1e4), hairspring.lines(springs, 1e4)
    bare = hairspring.at(1e4, 0.0).s.item()
    kappa = float(hairspring.wanted(line, least, bare / 900).split(",")[0])
    cell = hairspring.at(1e4, kappa).isel(a=0, k=0)
    assert float(bare / cell.s) == pytest.approx(900, rel=3e-3)  # three digits are printed
    assert hairspring.wanted(line, least, float(least.s) / 2) == "out of reach"


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_false_value_makes_a_statement_fail(ds, springs, factor):
    held = verdicts(hairspring.laws(ds.assign(s=factor * ds.s)))
    assert not held["s at kappa = 94.87"]
    of_springs = verdicts(hairspring.optimum(ds, springs.assign(s=factor * springs.s, A=factor * springs.A)))
    assert not of_springs["s alpha there"]
    assert not of_springs["A/phi0 there"]


def test_differences_of_the_period_see_a_false_sensitivity(ds):
    assert hairspring.agreement(ds).holds
    assert not hairspring.agreement(ds.assign(s=1.01 * ds.s)).holds


def test_a_steeper_law_makes_the_exponent_fail(ds):
    held = verdicts(hairspring.laws(ds.assign(s=ds.s * ds.kappa**-0.2)))
    assert not held["exponent of s in kappa, 10 to 1000, alpha = 1e+06"]


def test_a_false_remark_is_seen(ds):
    wrong = ds.assign(status=ds.status.where(ds.kappa < 1e4, Status.OK))
    assert not hairspring.from_rest(wrong).holds
