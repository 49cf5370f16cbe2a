"""What is concluded of best torques and borders is so, on a thinned grid."""

import dataclasses

import law_map_overnight as study
import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="a million cells; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Every third degree, few restitutions and every ninth friction; and the borders as they stand."""
    folder = tmp_path_factory.mktemp("overnight")
    full = sweep.study(study.__file__.replace(".py", ".toml"))
    cuts = {"n": slice(1, None, 3), "e": [0, 5, 8, 10], "R": slice(0, None, 3), "c": slice(0, None, 10)}
    axes = {
        name: dataclasses.replace(axis, values=axis.values[cuts.get(name, slice(None))], words=None)
        for name, axis in full.axes.items()
    }
    axes["n"] = dataclasses.replace(axes["n"], values=np.array([0.25, 1.5, 3.0]))
    axes["R"] = dataclasses.replace(axes["R"], values=np.append(axes["R"].values[:-1], 1e4))
    paths = [folder / "law_map_overnight.h5", folder / "law_map_borders_fine.h5"]
    sweep.run(dataclasses.replace(full, axes=axes), paths[0], workers=1).close()
    coarse = sweep.run(sweep.study(study.__file__.replace("overnight.py", "borders.toml")), workers=1)
    assert sweep.refine(coarse, "sensitivity", 0.02, path=paths[1], workers=1).complete
    return [str(path) for path in paths]


@pytest.fixture(scope="module")
def ds(results):
    return sweep.open_result(results[0]).load()


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert study.main(results) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "The steadiest has s = 0.0495" in " ".join(text.split())


def test_the_balance_is_that_of_one_clock_by_a_root(ds):
    """The speed of (1) by brentq, the shares by hand, at the torque that the balance calls the best."""
    clock = ds[["sensitivity_min", "sensitivity_argmin_mu"]].sel(n=[3.0], e=[0.99]).isel(R=[-1], c=[0])
    best = study.balanced(clock, ds.mu).squeeze()
    mu, R, c = float(best.mu), clock.R.item(), clock.c.item()

    def parts(v):
        return np.array([R * v**2 / mu, 2 * v**3 / (3 * mu), 2 * c * v**5 / (5 * mu), 0.5 * (1 - 0.99**2) * v**2])

    dry, viscous, drag, struck = parts(brentq(lambda v: parts(v).sum() - 2 * mu, 1e-3, 1e9, xtol=1e-300)) / (2 * mu)
    N = viscous + 3 * drag
    # the speed by 45 halvings of 37 in its logarithm: 1e-12
    assert float(best.s) == pytest.approx((N + struck) / (N + 2) + dry / ((mu / R) ** 2 - 1), rel=1e-10)


def test_the_limit_is_the_least_of_its_sum():
    x = np.linspace(5, 200, 2_000_001)  # torque over R; (sqrt 2/3) x/sqrt(R) is half of the viscous share
    R = 1e9
    s = 1 / x**2 + np.sqrt(2) / 3 * x / np.sqrt(R)
    assert s.min() == pytest.approx(3 * (18 * R) ** (-1 / 3), rel=1e-6)
    assert x[s.argmin()] == pytest.approx((18 * R) ** (1 / 6), rel=1e-4)


def failing(statements):
    return [s.what.strip() for s in statements if s.failed]


def test_false_exponents_torques_or_cells_are_seen(ds, results):
    assert not failing(study.best_torques(ds))
    assert len(failing(study.best_torques(ds.assign(sensitivity_min=ds.sensitivity_min * 1.3)))) >= 2
    moved = ds.assign(sensitivity_argmin_mu=ds.sensitivity_argmin_mu * 1.6)
    assert failing(study.best_torques(moved)) == ["the torque where it is"]
    edge = ds.assign(sensitivity_argmin_mu=xr.full_like(ds.sensitivity_argmin_mu, float(ds.mu[-1])))
    assert any("strong drive" in what for what in failing(study.best_torques(edge)))
    fine = sweep.open_result(results[1]).load()
    assert not failing(study.borders(fine))
    assert failing(study.borders(fine.assign(sensitivity=1.03 * fine.sensitivity)))
