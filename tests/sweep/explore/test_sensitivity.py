"""Indices by SALib on designs of ours, against functions whose indices are known."""

import numpy as np
import pytest
import xarray as xr
from toy_studies import build

import sweep

pytest.importorskip("SALib")

AXES = {
    "height": {"spacing": "linear", "start": 1.0, "stop": 2.0},
    "v0": {"spacing": "linear", "start": 0.0, "stop": 1.0},
    "g": {"spacing": "linear", "start": 5.0, "stop": 15.0},
}


def cells(kind, n, **keys):
    return sweep.run(build(design={"kind": kind, "n": n, "seed": 5}, axes=AXES, **keys))


def test_sobol_indices_are_shares_of_the_variance_and_what_acts_together_is_in_the_total_alone():
    ds = cells("saltelli", 1024)
    assert ds.sizes["cell"] == 1024 * 5
    found = sweep.sensitivity(ds, 3 * ds.height + 4 * ds.v0 + 0.0 * ds.g)
    assert np.allclose(found.first_order, [9 / 25, 16 / 25, 0], atol=0.01)
    assert np.allclose(found.total, [9 / 25, 16 / 25, 0], atol=0.01)
    assert list(found.parameter.values) == ["height", "v0", "g"]
    found = sweep.sensitivity(ds, (ds.v0 - 0.5) * (ds.height - 1.5))
    assert np.allclose(found.first_order, 0, atol=0.05)
    assert np.allclose(found.total, [1, 1, 0], atol=0.1)


def test_morris_effects_are_slopes_over_the_range():
    ds = cells("morris", 16)
    assert ds.sizes["cell"] == 16 * 4
    found = sweep.sensitivity(ds, 2 * ds.height - 3 * ds.v0 + ds.g)
    assert np.allclose(found.effect, [2, 3, 10])
    assert np.allclose(found["mean"], [2, -3, 10])
    assert np.allclose(found.spread, 0, atol=1e-12)


@pytest.mark.parametrize("kind", ["saltelli", "morris"])
def test_the_same_cells_have_the_same_errors_in_every_call_whoever_opened_the_result(kind, tmp_path):
    """The study that stands in a file leaves the values of long axes to the coordinates."""
    with sweep.run(build(design={"kind": kind, "n": 256}, axes=AXES), tmp_path / "out.h5", progress=False) as ds:
        np.random.seed(1)  # noqa: NPY002  a state that others change, too
        first = sweep.sensitivity(ds, "fall_time")
    with xr.open_dataset(tmp_path / "out.h5", engine="h5netcdf") as plain:
        xr.testing.assert_identical(first, sweep.sensitivity(plain[["fall_time", "status"]], "fall_time"))


@pytest.mark.parametrize(
    ("make", "y", "message"),
    [
        (lambda: sweep.run(build(axes={"height": [1.0, 2.0]})), "fall_time", 'neither "saltelli" nor "morris"'),
        (lambda: cells("morris", 4), "fal_time", "there is no output 'fal_time'"),
        (lambda: cells("morris", 4, where="v0 > '0.5 m/s'"), "fall_time", "cells have no value"),
        (lambda: cells("morris", 4).sortby("height"), "fall_time", "sorted"),
        (lambda: cells("saltelli", 4).isel(cell=slice(16)), "fall_time", "left out"),
        (lambda: "saltelli.h5", "fall_time", "open the file first"),
    ],
)
def test_what_cannot_be_told_is_refused(make, y, message):
    with pytest.raises(sweep.SweepError, match=message):
        sweep.sensitivity(make(), y)
