"""What the study of friction laws concludes is so, on coarse grids."""

import re

import friction_laws as study
import numpy as np
import pytest

import sweep
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of cells; the kernels' own tests run as plain Python")


def coarse(name, axes):
    """The study in a file on other axes."""
    full = sweep.study(study.__file__.replace("friction_laws.py", f"{name}.toml"))
    fixed = {p: full.fixed[p] for p in full.fixed if p in ("a", "c", "phi0")}
    return sweep.study(kernel="foliot", rtol=full.rtol, axes=axes, fixed=fixed)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Both studies with 8 and 10 torques a decade instead of 20 and 40, and a tenth of the Coulomb frictions."""
    folder = tmp_path_factory.mktemp("friction")
    n = sweep.study(study.__file__.replace(".py", ".toml")).axes["n"].values
    mu = {"spacing": "log", "start": 1e-24, "stop": 1e24, "num": 48 * 8 + 1}
    laws = coarse("friction_laws", {"n": n, "mu": mu})
    mu = {"spacing": "log", "start": 1e-3, "stop": 1e11, "num": 141}
    grid = coarse("friction_laws_map", {"R": {"spacing": "log", "start": 1e-3, "stop": 1e9, "num": 61}, "mu": mu})
    paths = folder / "friction_laws.h5", folder / "friction_laws_map.h5"
    for coarse_study, path in zip((laws, grid), paths, strict=True):
        sweep.run(coarse_study, path, workers=1).close()
    return paths


@pytest.fixture(scope="module")
def laws(results):
    return study.read(*map(str, results))[0]


@pytest.fixture(scope="module")
def grid(results):
    return study.read(*map(str, results))[1]


@pytest.fixture(scope="module")
def line(grid):
    return study.valley(grid)


def held(statements):
    return {s.what.strip(): s.holds for s in statements}


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert study.main([str(path) for path in results]) == 0
    assert not re.search(r"\| NO$", capsys.readouterr().out, re.MULTILINE)
    assert results[0].with_suffix(".png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("n", [0.5, 1.0, 1.5, 2.5, 3.0, 4.0])
def test_the_exponents_of_small_and_large_torque_change_places_at_degree_two(laws, n):
    slow, free = -1 / n, -n / (n + 2)
    law = np.log(laws.period.sel(n=n).values), np.log(laws.mu.values)
    found = [(law[0][i + 1] - law[0][i]) / (law[1][i + 1] - law[1][i]) for i in (0, -2)]
    assert found == pytest.approx([slow, free] if n < 2 else [free, slow], abs=1e-5)


def test_no_torque_moves_the_exponent_of_quadratic_drag(laws):
    slopes = np.diff(np.log(laws.period.sel(n=2))) / np.diff(np.log(laws.mu))
    np.testing.assert_allclose(slopes, -0.5, rtol=1e-12)


def test_coulomb_friction_alone_has_a_least_torque_and_a_period_that_forgets_the_drive(laws):
    dry = laws.sel(n=0)
    assert (dry.status == np.where(dry.mu > 1, Status.OK, Status.NEVER_STARTS)).all()
    mu = dry.mu.values[dry.mu > 1]
    expected = 4 * np.sqrt(2 / (1 - mu**-2.0))
    np.testing.assert_allclose(dry.period[dry.mu.values > 1], expected, rtol=1e-12)
    assert float(dry.period[-1]) == pytest.approx(4 * np.sqrt(2), rel=1e-12)


def test_a_best_torque_is_there_from_four_fifths_of_coulomb_friction_on(grid, line):
    third = 1 / 3 - 1e-9
    has_valley = (grid.sensitivity < third).any("mu")
    assert (has_valley == (grid.R > 0.8)).all()
    assert (line.sensitivity < third).all()
    assert (line.mu / line.R > 4.9).all()
    # its neighbours in torque on either side are worse
    for factor in (0.7, 1.4):
        aside = study.foliot(factor * line.mu.values, line.R.values, "zip")
        assert (aside.sensitivity.values > line.sensitivity.values).all()


def test_the_threshold_of_the_valley_is_four_fifths():
    assert study.threshold() == pytest.approx(0.8, abs=3e-5)


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_a_false_value_makes_a_statement_fail(laws, grid, line, factor):
    wrong = held(study.exact(laws.assign(sensitivity=factor * laws.sensitivity)))
    assert not wrong["n = 0: s at every mu > R"]
    assert not wrong["n = 2: s at every mu"]
    assert not wrong["n = 1: P, amplitude, s against the viscous closed form"]
    wrong = held(study.best(grid, line.assign(sensitivity=factor * line.sensitivity)))
    assert not wrong["s there"]


def test_a_false_power_makes_the_exponents_fail(laws):
    assert not any(held(study.ends(laws.assign(period=laws.period * laws.mu**3e-4))).values())


def test_false_differences_are_seen(laws):
    assert study.differences(laws).holds
    assert not study.differences(laws.assign(sensitivity=laws.sensitivity + 0.01)).holds


def test_a_valley_below_the_threshold_would_be_seen(grid, line):
    sunk = grid.assign(sensitivity=grid.sensitivity - 1e-3)
    wrong = held(study.best(sunk, line))
    assert not wrong["smallest R of the map with s < 1/3"]
    assert [holds for what, holds in wrong.items() if what.startswith("R < 0.79")] == [False]


def test_a_false_law_of_the_valley_is_seen(line):
    assert all(s.holds for s in study.far(line))
    assert not any(s.holds for s in study.far(line.assign_coords(R=line.R**1.05, mu=line.mu**1.05)))
