"""A result on the disk: what plain readers of HDF5 find in it, of which format it is, and who may write to it."""

import h5py
import numpy as np
import pytest
import toy_studies
import xarray as xr

import sweep
from sweep.cells.partition import boxes
from sweep.cells.reduce import output_schema
from sweep.file.frame import cuts_of, expected_size

PHASE = {"outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5, 1.0]}}
STUDIES = {
    "one cell": {"axes": {"height": [2.0]}},
    "a line": {"axes": {"height": np.arange(1.0, 26)}, **PHASE},
    "a box": {"axes": {"height": np.arange(1.0, 7), "v0": np.arange(5.0), "method": ["exact", "rough"]}, **PHASE},
    "a zip": {"axes": {"height": np.arange(1.0, 12), "v0": np.arange(11.0)}, "design": "zip"},
    "arrays": {
        "kernel": "beads:KERNEL",
        "outputs": ["moment", "share"],
        "axes": {"g": [1.0, 2.0]},
        "fixed": {"mass": [0.1, 0.2, 0.7]},
    },
    "a summary": {"axes": {"height": np.arange(1.0, 40), "v0": [0.0, 1.0, 2.0]}, "summary": {"over": ["height"]}},
    "more blocks than a page of HDF5's table holds": {"axes": {"height": np.linspace(1.0, 2.0, 1100)}},
}


def run(path, cells=None, **keys):
    study = toy_studies.build(**keys)
    return sweep.run(study, path, progress=False, workers=1, block_cells=cells)


@pytest.mark.parametrize("cells", [1, 4])
@pytest.mark.parametrize("name", STUDIES)
def test_plain_readers_find_the_numbers_and_all_that_is_said_of_them(tmp_path, name, cells):
    path = tmp_path / "out.h5"
    with run(path, cells, **STUDIES[name]) as found, run(None, **STUDIES[name]) as wanted:
        xr.testing.assert_equal(found, wanted)
        for engine in ("h5netcdf", "netcdf4"):
            with xr.open_dataset(path, engine=engine) as plain:
                xr.testing.assert_equal(plain.astype(found.dtypes), wanted)
                assert {n: plain[n].attrs["units"] for n in plain if "units" in plain[n].attrs} == {
                    n: wanted[n].attrs["units"] for n in wanted if "units" in wanted[n].attrs
                }
        with h5py.File(path) as file:
            for column in wanted.data_vars:
                np.testing.assert_array_equal(file[column][()], wanted[column].values)


@pytest.mark.parametrize("cells", [2000, 50_000])
def test_the_size_of_a_result_is_known_before_it_is_computed(tmp_path, cells):
    keys = {"axes": {"height": np.linspace(1.0, 2.0, 50_000)}, "outputs": ["fall_time"], "method": "exact"}
    study = toy_studies.build(**keys)
    schema = output_schema(study, {})
    found = expected_size(schema, cuts_of(study, schema, boxes(schema.shape, cells)))
    with run(tmp_path / "out.h5", cells, **keys) as ds:
        assert sweep.study(ds, allow_import=True) == study
    assert (tmp_path / "out.h5").stat().st_size == pytest.approx(found, rel=0.05)


def test_a_file_of_another_format_is_refused_by_its_number(tmp_path):
    path = tmp_path / "out.h5"
    run(path, axes={"height": [1.0, 2.0]}).close()
    with h5py.File(path, "r+") as file:
        file["integrity"].attrs["format"] = 4
    for function in (sweep.open_result, sweep.verify):
        with pytest.raises(sweep.SweepError, match=r"\(4\).*format 7"):
            function(path)
