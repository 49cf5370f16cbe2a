"""The structure of a result that no study made, as HDF5, netCDF4 and xarray find it."""

import io

import h5py
import numpy as np
import pytest
import xarray as xr
from h5py import h5d
from handmade import SCHEMA, cut, rows_cut

from sweep.cells.grid import Box
from sweep.cells.partition import Partition
from sweep.cells.schema import Column, Schema
from sweep.store.structure import ENDING, Cut, column_of, digests_of, laid_out


def opened(image):
    return h5py.File(io.BytesIO(image), "r")


@pytest.mark.parametrize(("cells", "chunk"), [(2, (1, 2)), (4, (1, 4)), (8, (2, 4)), (12, (3, 4))])
def test_chunks_are_boxes_of_the_cells_of_a_block(cells, chunk):
    made = cut(cells)
    assert made.chunk == chunk
    assert [made.chunk_bytes(column) for column in made.columns] == [16 * cells, cells]
    with opened(laid_out(SCHEMA, {"cells": made})[0]) as file:
        assert (file["x"].chunks, file["status"].chunks) == ((*chunk, 2), chunk)
        assert (file["x"].shape, file["status"].shape) == ((3, 4, 2), (3, 4))
        assert (file["x"].dtype, file["status"].dtype) == (np.dtype("<f8"), np.dtype("i1"))
        assert file["x"].fletcher32


def test_of_several_chunks_hdf5_knows_one_byte_and_of_one_chunk_all():
    image, places = laid_out(SCHEMA, {"cells": cut(4)})
    with opened(image) as file:
        for name in ("x", "status"):
            info = file[name].id.get_chunk_info(0)
            assert (info.byte_offset, info.size) == (places[name], 1)
    image, places = laid_out(SCHEMA, {"cells": cut(12)})
    with opened(image) as file:
        for name, size in (("x", 12 * 16 + 4), ("status", 12 + 4)):
            info = file[name].id.get_chunk_info(0)
            assert (info.byte_offset, info.size) == (places[name], size)


def test_digests_have_their_place_at_once_and_are_not_filled():
    image, places = laid_out(SCHEMA, {"rows": rows_cut(), "cells": cut()})
    names = ["integrity/ending", "integrity/rows_digests", "integrity/cells_digests"]
    assert [ENDING, digests_of("rows"), digests_of("cells")] == names
    assert set(places) == {*names, "rows/n", "rows/y", "x", "status"}
    with opened(image) as file:
        assert [file[name].shape for name in names] == [(16,), (3, 2, 16), (3, 2, 16)]
        for name in names:
            assert file[name].id.get_offset() == places[name] > 0
            properties = file[name].id.get_create_plist()
            assert properties.get_alloc_time() == h5d.ALLOC_TIME_EARLY
            assert properties.get_fill_time() == h5d.FILL_TIME_NEVER
            assert file[name].dtype == np.uint8
        for name in ("x", "rows/n"):
            assert file[name].id.get_create_plist().get_fill_time() == h5d.FILL_TIME_NEVER
        texts = [file[name].attrs["long_name"] for name in names]
    computed = "xxh3_128 of each chunk of each column, zeros where it is not computed yet"
    assert texts == ["xxh3_128 of the times of the run, zeros until it has ended", computed, computed]


def test_what_a_summary_is_made_of_stands_in_a_group():
    assert column_of("rows", Column("y", "<f8", (), (), {})) == "rows/y"
    assert column_of("cells", Column("y", "<f8", (), (), {})) == "y"
    image, _ = laid_out(SCHEMA, {"rows": rows_cut(5, 2), "cells": cut()})
    with opened(image) as file:
        assert (file["rows/n"].shape, file["rows/n"].chunks) == ((5, 3), (2, 3))
        assert (file["rows/y"].shape, file["rows/y"].chunks) == ((5,), (2,))
        names = [[scale[0].name for scale in file[f"rows/{name}"].dims] for name in "ny"]
        assert names == [["/rows/row", "/rows/n 0"], ["/rows/row"]]
    with opened(laid_out(SCHEMA, {"cells": cut()})[0]) as file:
        assert "rows" not in file


def test_the_file_is_as_long_as_its_superblock_says():
    for made in ({"cells": cut()}, {"rows": rows_cut(), "cells": cut(12)}):
        image, _ = laid_out(SCHEMA, made)
        assert int.from_bytes(image[28:36], "little") == len(image)


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_xarray_finds_coordinates_attributes_and_dimensions(tmp_path, engine):
    path = tmp_path / "out.h5"
    path.write_bytes(laid_out(SCHEMA, {"cells": cut()})[0])
    with xr.open_dataset(path, engine=engine) as found:
        assert found.sizes == {"u": 3, "v": 4, "m": 2, "w": 3}
        assert set(found.coords) == {"u", "v", "pair", "m", "mass", "edge", "g"}
        assert set(found.data_vars) == {"x", "status"}
        assert set(found.x.coords) == {"u", "v", "pair", "m", "mass", "g"}
        assert set(found.status.coords) == {"u", "v", "pair", "g"}
        assert found.v.values.tolist() == ["a", "bb", "ccc", "d"]
        assert found.pair.values.tolist() == np.arange(12.0).reshape(3, 4).tolist()
        assert found.m.dtype == np.int64
        assert (float(found.g), found.g.attrs) == (9.5, {"units": "m/s^2"})
        assert found.attrs["title"] == "by hand"
        assert (found.x.attrs["units"], found.mass.attrs["units"]) == ("s", "kg")


def test_variables_name_their_coordinates_but_not_their_dimensions():
    with opened(laid_out(SCHEMA, {"cells": cut()})[0]) as file:
        assert file["x"].attrs["coordinates"] == "pair mass g"
        assert file["status"].attrs["coordinates"] == "pair g"
        # and what has none of the dimensions of the grid is one of the file
        assert file.attrs["coordinates"] == "mass edge"


def test_where_there_is_a_single_cell_its_numbers_are_no_array():
    columns = (Column("x", "<f8", ("m",), (2,), {}), Column("status", "i1", (), (), {}))
    single = Cut(columns, (), Partition(1, 1))
    assert [single.chunk_bytes(column) for column in columns] == [16, 0]
    image, places = laid_out(Schema(Box((), ()), columns, (), {}), {"cells": single})
    with opened(image) as file:
        assert (file["status"].shape, file["x"].shape, file["x"].chunks) == ((), (2,), (2,))
        assert file["status"].id.get_offset() == places["status"]
        assert file["status"][()] == 0
        assert "coordinates" not in file.attrs
        assert "coordinates" not in file["x"].attrs
