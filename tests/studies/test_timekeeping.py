"""What the study of torque noise and seconds a day concludes is so, in runs of hours for days."""

import math

import numpy as np
import pytest
import timekeeping

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="millions of half swings; the kernel's tests run as plain Python")

SEEDS, HOURS = 32, 8


def study_file(toml):
    return sweep.study(timekeeping.__file__.replace("timekeeping.py", toml))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The clocks of the study with rates averaged over an hour, and correlations a 24th as long."""
    folder, paths = tmp_path_factory.mktemp("timekeeping"), []
    for toml, half_swing in zip(timekeeping.CLOCKS.values(), (2.0, 1.0, 0.25), strict=True):
        whole = study_file(toml)
        fixed = {name: whole.fixed[name] for name in ("mu", "phi0", "a", "k") if name in whole.fixed}
        fixed |= {"averaging_time": 3600.0, "half_swings": float(round((HOURS + 0.5) * 3600 / half_swing))}
        axes = {"sigma": [0.003, 0.01, 0.1], "tau_c": whole.axes["tau_c"].values / 24, "seed": np.arange(SEEDS) + 1.0}
        study = sweep.study(kernel="foliot_noise", rtol=1e-9, axes=axes, fixed=fixed)
        paths.append(folder / toml.replace(".toml", ".h5"))
        sweep.run(study, paths[-1], progress=False).close()
    return [str(path) for path in paths]


@pytest.fixture(scope="module")
def clocks(results):
    kinds = zip(timekeeping.CLOCKS.items(), results, strict=True)
    return {name: timekeeping.read(path, toml) for (name, toml), path in kinds}


def verdicts(name, ds):
    return [s.holds for s in timekeeping.clock_statements(name, ds)]


@pytest.mark.parametrize("name", list(timekeeping.CLOCKS))
def test_the_study_files_have_the_clocks_the_conclusions_need(name, clocks):
    whole, ds = study_file(timekeeping.CLOCKS[name]), clocks[name]
    assert whole.axes["sigma"].values[[1, -1]].tolist() == [0.01, 0.1]
    theta = whole.axes["tau_c"].values * float(ds["T"])
    np.testing.assert_allclose(theta, [0, 60, 3600, 86400], rtol=1e-4)
    days = whole.fixed["half_swings"] * float(ds["T"]) / 86400
    assert days == pytest.approx(round(days), rel=1e-4)
    assert float(ds["T"]) == pytest.approx({"verge": 2, "Bürgi": 1, "spring": 0.25}[name], rel=1e-4)


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert timekeeping.main(results) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "lasting change" in text
    assert "1.15 % of torque for the verge's" in text


def test_white_noise_scatters_the_rate_by_its_root_mean_share(clocks):
    for ds in clocks.values():
        law = 86400 * float(ds.s) * math.sqrt(float(ds["T"]) / 3600)
        assert float(timekeeping.law(ds, 0.0)) == pytest.approx(law, rel=1e-12)
        assert float(ds.scatter.sel(sigma=0.01, tau_c=0)) / 0.01 == pytest.approx(law, rel=0.2)


def test_the_law_of_correlated_noise_is_that_of_a_sum_of_products(clocks):
    ds = clocks["Bürgi"].assign(averaging_time=20.0).assign_coords(T=1.0)
    r = math.exp(-1 / 7.0)
    w = np.repeat([-1.0, 1.0], 20) / 20
    lag = abs(np.subtract.outer(np.arange(40), np.arange(40)))
    expected = 86400 * float(ds.s) * math.sqrt(w @ r**lag @ w / 2)
    assert float(timekeeping.law(ds, 7.0)) == pytest.approx(expected, rel=1e-12)


def test_slow_noise_scatters_more_than_white_noise_by_its_correlation(clocks):
    for ds in clocks.values():
        ratio = float(ds.scatter.isel(tau_c=1).sel(sigma=0.01) / ds.scatter.isel(tau_c=0).sel(sigma=0.01))
        assert ratio == pytest.approx(math.sqrt(2 * float(ds.tau_c[1])), rel=0.2)


def test_noise_makes_every_clock_lose_by_its_square(clocks):
    ds = clocks["verge"]
    loss = -ds.gain.sel(tau_c=0)
    assert float(loss.sel(sigma=0.1)) > 20 * float(ds.gain_error.sel(tau_c=0, sigma=0.1))
    ratio = float(loss.sel(sigma=0.1)) / timekeeping.second_order(ds, 0.0)
    assert ratio == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("name", list(timekeeping.CLOCKS))
def test_a_long_correlation_loses_as_the_period_curves_with_torque(name, clocks):
    ds = clocks[name]
    step, mu, P = 1e-3, float(ds.mu), []
    for torque in (mu * (1 - step), mu, mu * (1 + step)):
        P.append(float(timekeeping.without_noise(ds.assign_coords(mu=torque)).period))
    curved = 86400 * (P[0] - 2 * P[1] + P[2]) / step**2 / P[1] / 2
    assert timekeeping.second_order(ds, 1e7) == pytest.approx(curved, rel=1e-3)  # differences of second order


def test_the_table_gives_the_noise_that_scatters_by_the_goal(clocks):
    rows = ([cell.strip() for cell in line.split("|")] for line in timekeeping.table(clocks))
    (cells,) = (row for row in rows if row[:2] == ["Bürgi", "1 min/day"])
    assert float(cells[-1]) == pytest.approx(100 * 60 / 86400 / float(clocks["Bürgi"].s), rel=5e-3)
    slow = float(cells[4].rstrip(" *")) / 100
    assert slow * float(clocks["Bürgi"].scatter.sel(sigma=0.01)[2]) / 0.01 == pytest.approx(60, rel=5e-3)


@pytest.mark.parametrize("name", list(timekeeping.CLOCKS))
def test_a_false_scatter_or_sensitivity_makes_statements_fail(name, clocks):
    ds = clocks[name]
    assert False not in verdicts(name, ds)
    assert not any(verdicts(name, ds.assign(scatter=1.5 * ds.scatter))[1:5])
    assert not any(verdicts(name, ds.assign_coords(s=2 * ds.s))[:5])


def test_a_false_power_or_loss_makes_statements_fail(clocks):
    ds = clocks["verge"]
    assert not verdicts("verge", ds.assign(scatter=ds.scatter * ds.sigma**0.05))[5]
    assert not any(verdicts("verge", ds.assign(gain=1.3 * ds.gain))[6:])


def test_another_clock_does_not_give_the_series_of_its_drive(clocks):
    assert all(s.holds for s in timekeeping.lasting(clocks))
    swapped = {"verge": clocks["Bürgi"], "Bürgi": clocks["verge"]}
    assert not any(s.holds for s in timekeeping.lasting(swapped))
