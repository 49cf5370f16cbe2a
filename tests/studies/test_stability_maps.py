"""What the study of integrators concludes is so, on a coarse grid."""

from pathlib import Path

import numpy as np
import pytest
import stability_maps as maps
import xarray as xr

import sweep
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of steps; the kernels' own tests run as plain Python")

METHODS = ["euler", "semi_implicit", "verlet", "rk4", "dopri5", "dop853"]


@pytest.fixture(scope="module")
def ds():
    """The study with a few of its steps and drives."""
    axes = {"method": METHODS, "mu": np.geomspace(1e-2, 1e4, 7).tolist(), "step": [0.05, 0.5, 5.0, 20.0]}
    fixed = {"a": 1.0, "phi0": 1.0, "flips": 6, "location": "root"}
    study = sweep.study(kernel="foliot_steps", rtol=1e-6, axes=axes, fixed=fixed)
    return maps.with_truth(sweep.run(study, progress=False))


def test_the_study_files_have_the_grid_the_conclusions_need():
    study = sweep.study(maps.__file__.replace(".py", ".toml"))
    assert list(study.axes) == ["method", "mu", "step"]
    assert (study.fixed["a"], study.fixed["phi0"], study.fixed["location"]) == (1.0, 1.0, 3.0)
    for name, axis in maps.GRIDS.items():
        study = sweep.study(Path(maps.__file__).with_name(f"{name}.toml"))
        assert list(study.axes) == ["method", axis, "step"]
        assert (study.fixed["phi0"], study.fixed["location"]) == (1.0, 3.0)


@pytest.mark.parametrize(("fixed", "axes"), [({"a": 0.1}, {"R": [0.9, 0.999]}), ({"flips": 2}, {"k": [1.5, 1.999]})])
def test_neither_friction_nor_a_spring_makes_a_value_wrong_in_silence(fixed, axes):
    axes = {"method": METHODS, **axes, "step": [0.1, 1.0, 10.0]}
    fixed = {"mu": 1.0, "phi0": 1.0, "flips": 6, "location": "root", **fixed}
    study = sweep.study(kernel="foliot_steps", rtol=1e-6, axes=axes, fixed=fixed)
    ds = maps.with_truth(sweep.run(study, progress=False))
    assert maps.foliots(ds)[0].holds
    assert np.isfinite(ds.off.where(ds.status < FIRST_REFUSAL, 0.0)).all()


def test_a_value_where_nothing_flips_is_wrong_in_silence(ds):
    assert not maps.foliots(ds.assign(off=np.inf + 0 * ds.off, error=0 * ds.error))[0].holds


def test_no_value_is_wrong_by_more_than_ten_times_what_is_stated(ds):
    assert maps.foliots(ds)[0].holds
    assert not maps.foliots(ds.assign(error=1e-3 * ds.error))[0].holds


def test_the_borders_of_theory_are_the_textbooks():
    zero = np.array([0.0])
    for method, end in (("euler", 2.0), ("rk4", 2.785293563), ("dopri5", 3.306567893), ("verlet", 2.0)):
        assert maps.eigenvalue(method, np.array([end]), zero)[0] == pytest.approx(1.0, abs=1e-8)
        assert maps.eigenvalue(method, np.array([end + 0.01]), zero)[0] > 1
    assert maps.eigenvalue("rk4", zero, np.array([np.sqrt(8)]))[0] == pytest.approx(1.0)
    z = np.array([-0.1, 0.3j])
    for method, order in (("euler", 1), ("rk4", 4), ("dopri5", 5), ("dop853", 8)):
        off = abs(maps.stability_function(z, method) - np.exp(z))
        assert (off < abs(z) ** (order + 1)).all()
    assert maps.eigenvalue("semi_implicit", zero, np.array([2.01]))[0] > 1


def test_a_growing_oscillator_is_told_from_a_decaying_one():
    a, w = [1.0, 3.0], [0.5, 2.0]
    size = np.array([[[0.5, 2.0], [2.0, 2.0]]])
    ds = xr.Dataset(
        {
            "angle": (("method", "a", "w"), size),
            "speed": (("method", "a", "w"), 0 * size),
            "status": (("method", "a", "w"), (0 * size).astype(int)),
        },
        coords={"method": ["euler"], "a": a, "w": w},
    )
    assert maps.oscillators(ds)[0].holds
    assert not maps.oscillators(ds.assign(angle=2.5 - ds.angle))[0].holds


def test_where_the_runs_compared_overflow_the_error_is_not_known():
    """The finer runs grow beyond all numbers; the first, whose angle is 3e83, is all there is."""
    fixed = {"a": 4.359125, "w": 4.2095, "end": 63.5, "flips": 1, "step": 1.0, "location": "none"}
    study = sweep.study(
        kernel="stability_maps:KERNEL", rtol=1e-6, axes={"method": ["semi_implicit"]}, fixed=fixed, allow_import=True
    )
    ds = sweep.run(study, progress=False)
    assert np.isinf(ds.error.item())
    assert ds.status.item() == Status.INACCURATE
