"""The study to begin with that every kernel writes can be read and run, and has values to look at."""

import numpy as np
import pytest

import sweep
from kernels.catalogue import KERNELS
from kernels.lanes.jit import COMPILED
from sweep.show.kernels import write_starter

pytestmark = pytest.mark.skipif(not COMPILED, reason="every kernel; their own tests run as plain Python")


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_the_study_to_begin_with_runs(name, tmp_path):
    write_starter(name, tmp_path / "study.toml")
    study = sweep.study(tmp_path / "study.toml")
    assert study.question
    ds = sweep.run(study, progress=False, workers=1)
    valued = ds.status < 64
    assert bool((ds.status == 0).any())
    assert all(np.isfinite(ds[output.name].where(valued)).any() for output in study.asked if output.name not in LOCKED)


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_what_the_study_to_begin_with_varies_grows_about_the_example(name, tmp_path):
    write_starter(name, tmp_path / "study.toml")
    study = sweep.study(tmp_path / "study.toml")
    for values in (*study.along.values(), *(axis.values for axis in study.axes.values())):
        assert (np.diff(values) > 0).all()
    for axis, values in ((a, study.axes[a].values) for a in study.axes if a in study.kernel.example):
        assert np.isscalar(study.kernel.example[axis])
        assert values.min() <= study.kernel.example[axis] <= values.max()


LOCKED = {"theta_lock", "theta_lock_outer"}
"""Given only where a linkage locks."""
