"""A result as xarray opens it, and as an account reads it, made by hand."""

import dask.array
import h5py
import numpy as np
import pytest
import xarray as xr
from handmade import finished, frame, harm, whole
from toy_studies import build

from sweep.cells.output_schema import output_schema
from sweep.cells.partition import Partition
from sweep.results.columns import open_checked
from sweep.results.stored import Stored
from sweep.store.frame import Frame, cuts_of
from sweep.system.errors import SweepError


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.h5"


@pytest.mark.parametrize("cells", [2, 4, 12])
def test_columns_are_read_when_they_are_used_and_coordinates_at_once(path, cells):
    layout = finished(path, frame(cells))
    found = open_checked(path, None)
    x = whole(layout.work, layout.work.places[0]).reshape(3, 4, 2)
    for key in (np.s_[:], np.s_[1], np.s_[:, ::-1], np.s_[[2, 0], 1:3], np.s_[..., 1]):
        np.testing.assert_array_equal(found.x[key], x[key])
    np.testing.assert_array_equal(
        found.x.isel(u=xr.DataArray([0, 2], dims="k"), v=xr.DataArray([3, 1], dims="k")), x[[0, 2], [3, 1]]
    )
    assert found.status.dtype == np.int8
    assert (found.x.attrs["units"], found.attrs["title"]) == ("s", "by hand")
    found.close()
    assert found.pair.values.tolist() == np.arange(12.0).reshape(3, 4).tolist()
    with pytest.raises(SweepError, match=r"out\.h5: is closed; open it again to read status"):
        found.status.load()


def test_pieces_of_a_result_are_its_blocks(path):
    finished(path, frame(4))
    with open_checked(path, None) as found:
        assert found.x.encoding["preferred_chunks"] == {"u": 1, "v": 4, "m": 2}
        assert found.status.encoding["preferred_chunks"] == {"u": 1, "v": 4}
    with open_checked(path, "auto") as found:
        assert isinstance(found.x.data, dask.array.Array)


def test_damage_is_an_error_where_it_is_read(path):
    layout = finished(path)
    harm(path, layout.work.places[0].at(1))
    with open_checked(path, None) as found:
        assert found.x[0].values.tolist() == whole(layout.work, layout.work.places[0])[:4].tolist()
        with pytest.raises(SweepError, match="x is damaged between its cells 4 and 8"):
            found.x[1].load()


def test_a_file_of_another_program_is_opened_as_it_is(path):
    xr.Dataset({"y": ("x", [1.0, 2.0])}, {"x": [3.0, 4.0]}).to_netcdf(path, engine="h5netcdf")
    with open_checked(path, None) as found:
        assert found.y.values.tolist() == [1.0, 2.0]


def test_what_is_over_no_dimension_of_its_own_is_refused(path):
    with h5py.File(path, "w") as file:
        file["y"] = np.arange(3.0)
    with pytest.raises(ValueError, match="something in it is over no dimension of its own"):
        open_checked(path, None)


def test_a_column_that_a_program_has_taken_out_is_not_there(path):
    layout = finished(path)
    trailer = path.read_bytes()[layout.end :]
    with h5py.File(path, "r+") as file:
        del file["x"]
    path.write_bytes(path.read_bytes()[: layout.end].ljust(layout.end, b"\0") + trailer)
    with open_checked(path, None) as found:
        assert list(found.data_vars) == ["status"]
        assert found.status.values.ravel().tolist() == list(range(1, 13))


STUDY = build(axes={"height": [1.0, 2.0], "v0": [0.0, 1.0, 3.0]}, outputs=["fall_time", "drop"],
              along={"phase": [0.0, 1.0]})  # fmt: skip


def test_what_is_stored_is_known_by_name_without_reading_it(path):
    schema = output_schema(STUDY, {})
    layout = finished(path, Frame(schema, cuts_of(STUDY, schema, Partition(6, 2, 3)), {}, "now"))
    with Stored(path, STUDY) as found:
        assert "drop" in found
        assert "height" in found
        assert "width" not in found
        drop, height = found["drop"], found["height"]
        assert (drop.dims, drop.shape, drop.attrs["units"]) == (("height", "v0", "phase"), (2, 3, 2), "m")
        number = [c.name for c in schema.columns].index("drop")
        oracle = whole(layout.work, layout.work.places[number]).reshape(2, 3, 2)
        np.testing.assert_array_equal(drop.values, oracle)
        np.testing.assert_array_equal(drop[1, 1:], oracle[1, 1:])
        assert (height.dims, height.values.tolist(), height.attrs["units"]) == (("height",), [1.0, 2.0], "m")
        assert set(found.coords) == {"height", "v0", "g", "phase"}
    assert found._file.fd == -1
