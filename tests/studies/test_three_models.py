"""What the study of the three models concludes is so."""

import dataclasses

import numpy as np
import pytest
import three_models
import xarray as xr

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="three kernels; their own tests run as plain Python")

NAMES = ("three_models", "three_models_denny", "three_models_viscous")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    for name in NAMES:
        study = sweep.study(three_models.__file__.replace("three_models.py", f"{name}.toml"))
        (axis,) = study.axes.values()
        short = dataclasses.replace(axis, values=axis.values[::4])
        sweep.run(dataclasses.replace(study, axes={axis.name: short}), folder / f"{name}.h5", workers=1).close()
    return [folder / f"{name}.h5" for name in NAMES]


@pytest.fixture(scope="module")
def parts(results):
    return [sweep.open_result(path).load() for path in results]


def failing(statements):
    return [s.what for s in statements if s.holds is False]


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert three_models.main([str(path) for path in results]) == 0
    assert " NO" not in capsys.readouterr().out
    assert results[0].with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_three_are_one_dataset_over_one_torque(results):
    three_models.main([str(path) for path in results])
    with xr.open_dataset(results[0].with_name("three_models_all.nc"), engine="netcdf4") as ds:
        assert ds.period.dims == ("model", "torque")
        assert ds.model.values.tolist() == list(three_models.MODELS)
        assert ds.period.attrs["units"] == "s"
        assert ds.torque.attrs["units"] == "N m"
        assert np.isfinite(ds.period).all()


@pytest.fixture(scope="module")
def followed(parts):
    return three_models.in_si(*parts[:2])


def test_other_results_make_the_statements_fail(parts, followed):
    ds = three_models.together(*parts)
    assert not failing(three_models.laws(ds, followed))
    for name in three_models.MODELS[:2]:
        one = followed[name]
        steep = followed | {name: one.assign(period=one.period * one.torque**1e-6, speed=one.speed * one.torque**1e-6)}
        assert len(failing(three_models.laws(ds, steep))) == 2
        assert len(failing(three_models.swings(ds, steep))) == 1
    viscous = parts[2].assign(period=parts[2].period * parts[2].mu ** 0.05, amplitude=parts[2].amplitude * 1.1**0.5)
    other = three_models.together(*parts[:2], viscous.assign(amplitude=viscous.amplitude * viscous.mu**0.01))
    assert len(failing(three_models.laws(other, followed))) == 3
    assert failing(three_models.swings(other, followed)) == ["growth of the swing, viscous"]
    longer = three_models.together(parts[0].assign(period=1.02 * parts[0].period), *parts[1:])
    assert failing(three_models.identity(longer, parts[0]))
    assert len(failing(three_models.laws(longer, followed))) == 1
    assert not failing(three_models.identity(ds, parts[0]))


def test_a_swing_that_grows_does_not_show_friction():
    """Energy: 2.457, 3.944 and 4.475 phi0, as DOP853 has it."""
    (line,) = three_models.with_spring()
    assert line.holds
    assert line.here == "2.457 to 4.476 phi0"


def test_grids_of_other_torques_are_refused(parts):
    impact, denny, viscous = parts
    with pytest.raises(sweep.SweepError, match="same torques"):
        three_models.together(impact, denny.assign_coords(mu=denny.mu * 1.1), viscous)
