"""What an export refuses, and what it writes of each variable, from Datasets made by hand."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from sweep.results import export as module
from sweep.results.export import export
from sweep.system.errors import SweepError

DROP = {"units": "m", "long_name": 'a\n"b"'}
FLAGS = {"flag_values": np.array([0, 1], "i1"), "flag_meanings": "OK BAD"}


def stones():
    """Two by two cells, with a trace, words and flags."""
    return xr.Dataset(
        {
            "drop": (
                ("phase", "height", "how"),
                np.arange(12.0).reshape(3, 2, 2),
                {"units": "m", "long_name": 'a\n"b"'},
            ),
            "status": (("height", "how"), np.array([[0, 1], [0, 0]], "i1"), FLAGS),
        },
        {"height": ("height", [1.0, 2.5], {"units": "m"}), "how": ["=x", "b"], "phase": [0.0, 0.5, 1.0], "g": 9.5},
        {"title": "Stones", "history": "made by hand"},
    )


def refused(dataset, path, **keys):
    with pytest.raises(SweepError) as caught:
        export(dataset, path, **keys)
    return str(caught.value)


def test_what_cannot_be_written_is_told(tmp_path):
    kinds = "export writes .csv, .parquet, .nc and .zarr, as the suffix says"
    assert refused(stones(), tmp_path / "a.txt") == f'{tmp_path}/a.txt: found ".txt"; {kinds}'
    assert refused(stones(), tmp_path / "a") == f"{tmp_path}/a: found no suffix; {kinds}"
    (tmp_path / "b.csv").mkdir()
    assert refused(stones(), tmp_path / "b.csv") == f"{tmp_path}/b.csv is a folder; name a file in it"
    for keys in ({"compress": True}, {"float32": True}):
        found = refused(stones(), tmp_path / "c.csv", **keys)
        assert found == f"{tmp_path}/c.csv: compress and float32 are for .nc and .zarr"
    read = stones()
    read.encoding["source"] = str(tmp_path / "d.csv")
    assert refused(read, tmp_path / "d.csv", force=True) == f"{tmp_path}/d.csv is what is read; name another file"


def test_what_stops_a_writer_is_told_and_leaves_nothing(tmp_path, monkeypatch):
    def failing(dataset, path):
        raise RuntimeError("of HDF5")

    monkeypatch.setitem(module.WRITERS, ".csv", failing)
    found = refused(stones(), tmp_path / "a.csv")
    assert found == f"{tmp_path}/a.csv cannot be written: of HDF5"
    assert list(tmp_path.iterdir()) == []


def test_a_table_of_text_has_a_row_for_each_cell_and_place_of_a_trace(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "ROWS", 5)
    path = export(stones(), tmp_path / "A.CSV")
    assert path.read_text() == "\n".join(
        [
            "# exported by foliot", "# height [m]", "# how", "# phase", "# g", "# drop [m]: a 'b'", "# status",
            "height,how,phase,g,drop,status",
            *(
                f"{h},{how},{p},9.5,{float(4 * k + 2 * i + j)},{'BAD' if (i, j) == (0, 1) else 'OK'}"
                for i, h in enumerate((1.0, 2.5))
                for j, how in enumerate(("'=x", "b"))
                for k, p in enumerate((0.0, 0.5, 1.0))
            ),
            "",
        ]
    )  # fmt: skip


def test_a_table_with_types_has_units_and_attributes_beside(tmp_path, monkeypatch):
    import pyarrow.parquet as pq

    monkeypatch.setattr(module, "ROWS", 5)
    path = export(stones(), tmp_path / "a.parquet")
    schema = pq.read_schema(path)
    assert [str(schema.field(name).type) for name in ("height", "how", "drop", "status")] == [
        "double", "string", "double", "string",
    ]  # fmt: skip
    assert schema.field("height").metadata == {b"units": b"m"}
    assert not schema.field("status").metadata
    assert schema.metadata[b"title"] == b"Stones"
    table = pd.read_parquet(path)
    assert len(table) == 12
    assert table["how"].tolist()[:6] == ["=x"] * 3 + ["b"] * 3
    assert table["status"].tolist()[3:6] == ["BAD"] * 3


def test_the_history_says_once_that_it_is_exported():
    once = module._marked(stones())
    assert once.attrs["history"] == "made by hand\nexported by foliot"
    assert module._marked(once).attrs["history"] == once.attrs["history"]
    assert module._marked(stones().drop_attrs()).attrs["history"] == "exported by foliot"


def test_a_lone_number_is_a_table_of_one_row(tmp_path):
    path = export(xr.Dataset({"y": 1.5}), tmp_path / "a.csv")
    assert path.read_text() == "# exported by foliot\n# y\ny\n1.5\n"


@pytest.mark.parametrize(("large", "chunked"), [(95, True), (96, False)])
def test_what_is_large_is_written_in_pieces(monkeypatch, large, chunked):
    dataset = xr.Dataset({"y": ("x", np.arange(12.0))})
    monkeypatch.setattr(module, "LARGE", large)
    assert bool(module._in_pieces(dataset).chunks) is chunked
    already = dataset.chunk(x=5)
    assert module._in_pieces(already).chunks["x"] == (5, 5, 2)


def test_only_doubles_are_narrowed_and_keep_what_is_said_of_them():
    found = module._in_float32(stones().assign(n=("height", [1, 2])))
    assert {name: str(v.dtype) for name, v in found.data_vars.items()} == {
        "drop": "float32", "status": "int8", "n": "int64",
    }  # fmt: skip
    assert (found.height.dtype, found["drop"].attrs["units"]) == (np.float64, "m")


@pytest.mark.parametrize("compress", [False, True])
def test_netcdf_has_no_fill_values_and_flags_are_packed(tmp_path, compress):
    import h5py

    path = export(stones(), tmp_path / "a.nc", compress=compress)
    with h5py.File(path) as file:
        assert "_FillValue" not in file["drop"].attrs
        found = {name: (file[name].compression_opts, file[name].shuffle) for name in ("drop", "status", "height")}
    assert found == {
        "drop": (5, True) if compress else (None, False),
        "status": (5, True) if compress else (1, False),
        "height": (None, False),
    }
    with xr.open_dataset(path) as again:
        np.testing.assert_array_equal(again["drop"], stones()["drop"])


@pytest.mark.parametrize("compress", [False, True])
def test_zarr_keeps_words_and_numbers(tmp_path, compress):
    pytest.importorskip("zarr")
    path = export(stones(), tmp_path / "a.zarr", compress=compress)
    with xr.open_zarr(path, consolidated=False) as again:
        np.testing.assert_array_equal(again["drop"], stones()["drop"])
        assert again.how.values.tolist() == ["=x", "b"]
        assert ("blosc" in str(again["drop"].encoding["compressors"]).lower()) is compress
