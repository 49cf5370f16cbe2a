"""What the map of all laws concludes is so, on a coarse grid, and the large grid keeps the same numbers."""

import dataclasses

import law_map as study
import numpy as np
import pytest
from scipy.integrate import quad

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of cells; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with all of its torques and fewer clocks."""
    path = tmp_path_factory.mktemp("law") / "law_map.h5"
    full = sweep.study(study.__file__.replace(".py", ".toml"))
    axes = {name: axis.values for name, axis in full.axes.items()}
    axes |= {"e": [1, 0.99, 0.5], "R": [0, 1, 100], "c": [0, 1e-6, 1]}
    made = sweep.study(
        kernel="foliot", rtol=1e-8, axes=axes, fixed={"phi0": 1}, outputs=["amplitude", "crossing_speed", "sensitivity"]
    )
    sweep.run(made, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.prepared(sweep.open_result(result).load())


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "s = (N + lambda_e)/(N + 2)" in text


def test_shares_are_those_of_every_cell(result, ds):
    with sweep.open_result(result) as found:
        assert dict(ds.sizes) == dict(found.sizes)
        np.testing.assert_array_equal(ds.mu, found.mu)


def test_shares_are_those_of_an_adaptive_integral(ds):
    cell = ds.sel(n=3, e=0.99, a=1, R=1, c=1e-6).sel(mu=1e4, method="nearest")
    mu, u = float(cell.mu), float(cell.crossing_speed)

    def f(v):
        return v + 1 + 1e-6 * v**3

    def lost(part):
        there = quad(lambda v: part(v) * v / (mu - f(v)), 0, u, epsabs=0, epsrel=1e-12)[0]
        return there + quad(lambda v: part(v) * v / (mu + f(v)), 0, 0.99 * u, epsabs=0, epsrel=1e-12)[0]

    parts = {"viscous": lambda v: v, "dry": lambda v: 1.0, "drag": lambda v: 1e-6 * v**3}
    for name, part in parts.items():
        assert float(cell[name]) == pytest.approx(lost(part) / (2 * mu), rel=1e-9)


def test_the_law_holds_for_mixtures_and_a_false_degree_is_seen(ds):
    assert not any(s.failed for s in study.laws(ds))
    wrong = ds.assign(light=(ds.N + ds.impacts) / (ds.N + 2.1))
    assert all(s.failed for s in study.laws(wrong)[1:3])
    assert study.laws(ds.assign(heavy=1.1 * ds.heavy))[3].failed
    assert all(s.failed for s in study.widths(ds.assign(sensitivity=ds.sensitivity**1.2)))


def test_the_large_grid_keeps_the_least_exponent_of_each_clock():
    full = sweep.study(study.__file__.replace("law_map.py", "law_map_overnight.toml"))
    assert np.prod([len(axis.values) for axis in full.axes.values()]) > 9.9e7
    axes = {
        name: dataclasses.replace(axis, values=axis.values[::step], words=None)
        for (name, axis), step in zip(full.axes.items(), (4, 5, 23, 29, 1), strict=True)
    }
    small = dataclasses.replace(full, axes=axes)
    kept = sweep.run(small)
    cells = {name: axis.values for name, axis in axes.items()}
    whole = sweep.run(sweep.study(
        kernel="foliot", rtol=1e-6, axes=cells, fixed=dict(full.fixed), outputs=["sensitivity"]
    ))  # fmt: skip
    least = whole.sensitivity.min("mu")
    np.testing.assert_array_equal(kept.sensitivity_min, least)
