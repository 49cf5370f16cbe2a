"""csv and netCDF4: what is written reads back, to the last bit, and nothing half-written stays."""

import csv
import os
import signal
import subprocess
import sys
import textwrap
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import toy_studies
import xarray as xr
from running import environment

import sweep
from sweep.show.laws import laws, write_laws
from sweep.system.errors import SweepError

FLAGS = {"flag_values": np.array([0, 1, 64, 127], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT PENDING"}
METHODS = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "asymptotic closed"}


def result():
    """mu by a, with one refused cell, a trace along phase, fixed phi0."""
    mu, a, phase = [0.1, 1 / 3, 3e300], [1.0, 2.0], [0.0, 0.25, 0.5, 0.75]
    rng = np.random.default_rng(1)
    period = rng.random((3, 2)) * np.array([[1e-300], [1.0], [1e300]])
    status, method = np.zeros((3, 2), np.int8), np.ones((3, 2), np.int8)
    period[1, 1], status[1, 1], method[1, 1] = np.nan, 64, -1
    ds = xr.Dataset(
        {
            "period": (("mu", "a"), period, {"units": "s", "long_name": 'the "period", of\nthe cycle'}),
            "angle": (("mu", "a", "phase"), rng.random((3, 2, 4)), {"units": "rad"}),
            "status": (("mu", "a"), status, FLAGS),
            "method_used": (("mu", "a"), method, METHODS),
        },
        coords={
            "mu": ("mu", mu, {"units": "rad/s^2", "long_name": "drive torque per inertia"}),
            "a": ("a", a, {"units": "1/s"}),
            "phase": ("phase", phase, {"units": "1"}),
            "phi0": ((), 0.5, {"units": "rad"}),
        },
        attrs={"title": "Foliot", "rtol": 1e-9, "study": '# Why?\nkernel = "foliot"\n'},
    )
    return ds


def read(path):
    """Heading and rows, comment lines left out."""
    with path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.reader(line for line in file if not line.startswith("#")))
    return lines[0], lines[1:]


def test_csv_has_one_row_per_cell_and_one_column_per_coordinate_and_output(tmp_path):
    ds = result().drop_vars("angle").drop_vars("phase")
    heading, rows = read(sweep.export(ds, tmp_path / "out.csv"))
    assert heading == ["mu", "a", "phi0", "period", "status", "method_used"]
    cells = [(m, a) for m in ds.mu.values for a in ds.a.values]
    assert [(float(r[0]), float(r[1])) for r in rows] == cells
    assert [float(r[2]) for r in rows] == [0.5] * 6
    np.testing.assert_array_equal([float(r[3]) for r in rows], ds.period.values.ravel())
    assert [r[4] for r in rows] == ["OK", "OK", "OK", "BAD_INPUT", "OK", "OK"]
    assert [r[5] for r in rows] == ["closed", "closed", "closed", "none", "closed", "closed"]


def test_csv_of_traces_has_one_row_per_cell_and_phase(tmp_path):
    ds = result()
    heading, rows = read(sweep.export(ds, tmp_path / "out.csv"))
    table = {name: [row[k] for row in rows] for k, name in enumerate(heading)}
    np.testing.assert_array_equal(np.array(table["angle"], float), ds.angle.values.ravel())
    np.testing.assert_array_equal(np.array(table["phase"], float), np.tile(ds.phase.values, 6))
    np.testing.assert_array_equal(np.array(table["period"], float), np.repeat(ds.period.values.ravel(), 4))
    assert table["status"][12:16] == ["BAD_INPUT"] * 4


def test_csv_columns_do_not_depend_on_the_order_of_an_outputs_dimensions(tmp_path):
    turned = result()
    turned["period"] = turned.period.transpose("a", "mu")
    turned["angle"] = turned.angle.transpose("phase", "mu", "a")
    plain, other = sweep.export(result(), tmp_path / "plain.csv"), sweep.export(turned, tmp_path / "other.csv")
    assert plain.read_text() == other.read_text()


def test_csv_says_the_unit_of_each_column_in_lines_that_readers_skip(tmp_path):
    text = sweep.export(result(), tmp_path / "out.csv").read_text()
    assert text.splitlines()[1:3] == ["# mu [rad/s^2]: drive torque per inertia", "# a [1/s]"]
    assert "# period [s]: the 'period', of the cycle" in text
    assert "# status\n" in text


def test_no_text_of_a_csv_is_a_formula(tmp_path):
    words = ["=cmd|'/C calc'!A0", "+1+1", "-x", "@SUM(A1)", "-1.5", "plain"]
    ds = xr.Dataset({"=y": ("word", -np.arange(6.0))}, {"word": words})
    ds["=y"].attrs = {"units": "m\n=1", "long_name": "a\n=2"}
    lines = sweep.export(ds, tmp_path / "out.csv").read_text().splitlines()
    assert lines[1:4] == ["# word", "# =y [m =1]: a =2", "word,'=y"]
    assert lines[4:] == [
        "'=cmd|'/C calc'!A0,-0.0",
        "'+1+1,-1.0",
        "'-x,-2.0",
        "'@SUM(A1),-3.0",
        "-1.5,-4.0",
        "plain,-5.0",
    ]


def test_no_text_of_a_table_of_laws_is_a_formula(tmp_path):
    x = np.geomspace(1, 10, 5)
    ds = xr.Dataset({"y": (("word", "x"), [x, x])}, {"x": x, "word": ["=1+1", "plain"]})
    write_laws(laws(ds, "y", "x"), tmp_path / "laws.csv")
    assert ",'=1+1," in (tmp_path / "laws.csv").read_text()


def test_csv_reads_back_with_pandas(tmp_path):
    import pandas

    ds = result()
    frame = pandas.read_csv(sweep.export(ds, tmp_path / "out.csv"), comment="#")
    back = frame.set_index(["mu", "a", "phase"]).to_xarray()
    # its parser of numbers is not exact in all versions
    np.testing.assert_allclose(back.angle, ds.angle, rtol=1e-15)
    np.testing.assert_allclose(back.period[:, :, 0], ds.period, rtol=1e-15)


def test_csv_is_a_file_axis_of_a_study(tmp_path):
    path = sweep.export(result().drop_vars("angle").drop_vars("phase").isel(a=0), tmp_path / "points.csv")
    study = sweep.study(
        kernel="foliot", design="zip", fixed={"phi0": 1.0},
        axes={"mu": {"file": path, "unit": "rad/s^2"}, "a": {"file": path, "unit": "1/s"}},
    )  # fmt: skip
    np.testing.assert_array_equal(study.axes["mu"].values, result().mu)
    np.testing.assert_array_equal(study.axes["a"].values, [1.0, 1.0, 1.0])


def test_csv_of_a_zip_design_has_its_axes_as_columns(tmp_path):
    ds = xr.Dataset(
        {"period": ("cell", [1.0, 2.0]), "status": ("cell", np.array([0, 127], np.int8), FLAGS)},
        coords={"mu": ("cell", [3.0, 4.0]), "method": ("cell", ["map", "a, b"])},
    )
    heading, rows = read(sweep.export(ds, tmp_path / "out.csv"))
    assert heading == ["mu", "method", "period", "status"]
    assert rows == [["3.0", "map", "1.0", "OK"], ["4.0", "a, b", "2.0", "PENDING"]]


def test_a_status_without_a_name_is_written_as_its_number(tmp_path):
    ds = result()
    ds.status[0, 0] = 33
    heading, rows = read(sweep.export(ds, tmp_path / "out.csv"))
    assert rows[0][heading.index("status")] == "33"


def test_csv_of_one_cell_and_of_none(tmp_path):
    one = result().isel(mu=0, a=0, phase=0)
    heading, rows = read(sweep.export(one, tmp_path / "one.csv"))
    assert len(rows) == 1
    assert float(rows[0][heading.index("period")]) == float(one.period)
    heading, rows = read(sweep.export(result().isel(mu=slice(0)), tmp_path / "none.csv"))
    assert rows == []


@pytest.mark.parametrize("rows", [1, 3, 5, 8, 9, 100])
def test_csv_is_the_same_whatever_the_size_of_its_blocks(tmp_path, monkeypatch, rows):
    whole = sweep.export(result(), tmp_path / "whole.csv").read_text()
    monkeypatch.setattr(sys.modules["sweep.results.export"], "ROWS", rows)
    assert sweep.export(result(), tmp_path / "blocks.csv").read_text() == whole


def test_csv_needs_no_more_memory_for_more_cells(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules["sweep.results.export"], "ROWS", 1000)
    peaks = []
    for cells in (20_000, 100_000):
        path = tmp_path / f"{cells}.nc"
        values = np.zeros(cells)
        mu = np.arange(cells, dtype=float)
        xr.Dataset({"period": ("mu", values)}, coords={"mu": mu}).to_netcdf(path, engine="h5netcdf")
        with xr.open_dataset(path, engine="h5netcdf") as ds:
            lazy = ds.drop_indexes("mu").reset_coords("mu").rename(mu="torque")
            tracemalloc.start()
            sweep.export(lazy, tmp_path / "out.csv")
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0]


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_netcdf_reads_back_bit_for_bit_with_units_and_flags(tmp_path, engine):
    ds = result()
    with xr.open_dataset(sweep.export(ds, tmp_path / "out.nc"), engine=engine) as back:
        xr.testing.assert_identical(back.load(), ds.assign_attrs(history="exported by foliot"))
        assert back.status.dtype == np.int8
        assert back.status.attrs["flag_values"].tolist() == [0, 1, 64, 127]
        assert "_FillValue" not in back.status.encoding
        assert "_FillValue" not in back.mu.encoding


def test_netcdf_of_a_result_larger_than_memory_is_written_piece_by_piece(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules["sweep.results.export"], "LARGE", 0)
    ds = result()
    with xr.open_dataset(sweep.export(ds, tmp_path / "out.nc"), engine="h5netcdf") as back:
        xr.testing.assert_identical(back.load(), ds.assign_attrs(history="exported by foliot"))


def test_netcdf_keeps_full_precision_however_the_source_was_packed(tmp_path):
    ds = result()
    ds.period.encoding = {"dtype": "float32", "scale_factor": 2.0}
    with xr.open_dataset(sweep.export(ds, tmp_path / "out.nc"), engine="h5netcdf") as back:
        np.testing.assert_array_equal(back.period, ds.period)


def test_netcdf_holds_an_axis_of_words(tmp_path):
    ds = xr.Dataset({"period": ("method", [1.0, 2.0])}, coords={"method": ["map", "closed"]})
    with xr.open_dataset(sweep.export(ds, tmp_path / "out.nc"), engine="h5netcdf") as back:
        assert back.method.values.tolist() == ["map", "closed"]


@pytest.mark.parametrize(("name", "found"), [("out.h5", '".h5"'), ("out.xlsx", '".xlsx"'), ("out", "no suffix")])
def test_another_suffix_is_refused_with_those_there_are(tmp_path, name, found):
    with pytest.raises(SweepError, match=f"{name}: found {found}; export writes .csv, .parquet, .nc and .zarr"):
        sweep.export(result(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["OUT.CSV", "Out.Nc"])
def test_capitals_in_a_suffix_do_not_matter(tmp_path, name):
    assert sweep.export(result(), str(tmp_path / name)).stat().st_size > 0


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_a_folder_that_is_not_there_is_one_clear_line(tmp_path, suffix):
    with pytest.raises(SweepError, match=rf"nowhere/out\{suffix} cannot be written: No such file or directory"):
        sweep.export(result(), tmp_path / "nowhere" / f"out{suffix}")


def test_a_folder_in_the_place_of_the_file_is_refused(tmp_path):
    (tmp_path / "out.csv").mkdir()
    with pytest.raises(SweepError, match=r"out\.csv is a folder"):
        sweep.export(result(), tmp_path / "out.csv")


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_a_fault_half_way_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, suffix):
    target = tmp_path / f"out{suffix}"
    target.write_text("old")

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(SweepError, match="cannot be written: No space left on device"):
        sweep.export(result(), target, force=True)
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == [target.name]


def test_a_fault_of_the_netcdf_library_is_one_clear_line(tmp_path, monkeypatch):
    def fault(self, *args, **kwargs):
        raise RuntimeError("Can't flush cache")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fault)
    with pytest.raises(SweepError, match=r"out\.nc cannot be written: Can't flush cache"):
        sweep.export(result(), tmp_path / "out.nc")
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_leaves_no_half_written_file(tmp_path, monkeypatch):
    def stop(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["sweep.results.export"], "_column", stop)
    with pytest.raises(KeyboardInterrupt):
        sweep.export(result(), tmp_path / "out.csv")
    assert list(tmp_path.iterdir()) == []


def test_parquet_reads_back_to_the_last_bit_with_units(tmp_path):
    import pyarrow.parquet as pq

    ds = result()
    path = sweep.export(ds, tmp_path / "out.parquet")
    table, frame = (
        pq.read_table(path),
        ds.drop_vars(["status", "method_used"]).to_dataframe(dim_order=["mu", "a", "phase"]),
    )
    np.testing.assert_array_equal(table["angle"].to_numpy(), frame.angle)
    np.testing.assert_array_equal(table["period"].to_numpy(), frame.period)
    assert table["status"].to_pylist()[12:16] == ["BAD_INPUT"] * 4
    assert table["method_used"].to_pylist()[12:16] == ["none"] * 4
    assert table.schema.field("mu").metadata[b"units"] == b"rad/s^2"
    assert table.schema.metadata[b"study"] == ds.attrs["study"].encode()
    assert table.schema.field("angle").type == "double"


def test_zarr_opens_as_the_same_dataset_and_replaces_an_older_one(tmp_path):
    path = tmp_path / "out.zarr"
    for factor in (1.0, 2.0):
        ds = result()
        ds["period"] = factor * ds.period.assign_attrs()
        sweep.export(ds, path)
        with xr.open_zarr(path, consolidated=False) as read:
            xr.testing.assert_equal(read.load(), ds)
            assert read.status.attrs["flag_meanings"] == FLAGS["flag_meanings"]
    assert [p.name for p in tmp_path.iterdir()] == ["out.zarr"]


def test_a_kind_of_file_whose_library_is_missing_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SweepError, match=r"pyarrow.* -e '\.\[export\]'"):
        sweep.export(result(), tmp_path / "out.parquet")
    assert not list(tmp_path.iterdir())


@pytest.mark.filterwarnings("error")
def test_zarr_keeps_words_without_a_warning(tmp_path):
    ds = result().expand_dims({"word": ["plain", "longer"]})
    sweep.export(ds, tmp_path / "out.zarr")
    with xr.open_zarr(tmp_path / "out.zarr", consolidated=False) as read:
        assert read["word"].values.tolist() == ["plain", "longer"]


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
@pytest.mark.parametrize("large", [False, True])
def test_a_compressed_export_is_smaller_and_keeps_every_bit(tmp_path, monkeypatch, suffix, large):
    if large:
        monkeypatch.setattr("sweep.results.export.LARGE", 0)
    dataset = toy_result(tmp_path)
    sizes = {}
    for compress in (False, True):
        path = sweep.export(dataset, tmp_path / f"{compress}{suffix}", compress=compress)
        files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
        sizes[compress] = sum(p.stat().st_size for p in files)
        with opened(path) as found:
            for name in dataset.data_vars:
                assert found[name].values.tobytes() == dataset[name].values.tobytes()
    assert sizes[True] < sizes[False] or suffix == ".zarr"


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_an_export_in_float32_is_rounded_to_nearest(tmp_path, suffix):
    dataset = toy_result(tmp_path)
    path = sweep.export(dataset, tmp_path / f"out{suffix}", float32=True)
    with opened(path) as found:
        assert found.fall_time.dtype == np.float32
        np.testing.assert_array_equal(found.fall_time, dataset.fall_time.values.astype("f4"))
        assert found.fall_time.attrs["units"] == "s"
        assert found.status.dtype == np.int8
        assert found.height.dtype == np.float64


@pytest.mark.parametrize("value", [1e39, -1e-39, 1e-310])
def test_what_float32_cannot_hold_is_told(tmp_path, value):
    dataset = toy_result(tmp_path)
    dataset["fall_time"][3] = value
    with pytest.raises(sweep.SweepError, match="fall_time: float32 cannot hold"):
        sweep.export(dataset, tmp_path / "out.nc", float32=True)
    assert not (tmp_path / "out.nc").exists()


def test_tables_are_not_compressed(tmp_path):
    with pytest.raises(sweep.SweepError, match=r"compress and float32 are for \.nc and \.zarr"):
        sweep.export(toy_result(tmp_path), tmp_path / "out.csv", compress=True)


def toy_result(tmp_path):
    study = toy_studies.build(axes={"height": np.linspace(1.0, 2.0, 5000)}, outputs=["fall_time"])
    with sweep.run(study, tmp_path / "result.h5", progress=False) as found:
        return found.load()


def opened(path):
    if path.suffix == ".zarr":
        return xr.open_dataset(path, engine="zarr", consolidated=False, mask_and_scale=False)
    return xr.open_dataset(path, engine="h5netcdf", mask_and_scale=False)


@pytest.mark.parametrize("suffix", [".csv", ".nc", ".zarr"])
def test_what_an_export_left_that_was_killed_goes_with_the_next_one(tmp_path, suffix):
    """One that lives, here or on another machine that sees the folder, keeps what is its own."""
    target, made = (
        tmp_path / f"out{suffix}",
        """
        import os, signal, sys
        import numpy as np
        import xarray as xr
        import sweep
        from sweep.system import disk
        disk.sync_tree = lambda path: os.kill(os.getpid(), signal.SIGKILL)
        sweep.export(xr.Dataset({"y": ("x", np.arange(3.0))}, {"x": np.arange(3.0)}), sys.argv[1])
    """,
    )
    killed = subprocess.run([sys.executable, "-c", textwrap.dedent(made), target], env=environment())
    left = list(tmp_path.iterdir())
    assert (killed.returncode, len(left)) == (-signal.SIGKILL, 1)
    name = left[0].name
    lives = name.replace(f".{name.split('.')[-2]}.", f".{os.getppid()}.")
    others = [tmp_path / lives, tmp_path / f".out{suffix}.far.9.tmp"]
    for other in others:
        other.touch()
    sweep.export(xr.Dataset({"y": ("x", np.arange(3.0))}, {"x": np.arange(3.0)}), target)
    assert sorted(tmp_path.iterdir()) == sorted([target, *others])
