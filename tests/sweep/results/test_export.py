"""What `export` refuses, leaves behind where it ends half-way, and makes of a summary; results in other units."""

import csv
import signal
import subprocess
import sys

import numpy as np
import pytest
import toy_studies
import xarray as xr
from running import environment

import sweep
from sweep.errors import SweepError
from sweep.file import disk


def result():
    """Stones of which some are refused, with a trace."""
    return sweep.run(
        toy_studies.build(
            axes={"height": [-1.0, 1.0, 3.0], "v0": [0.0, 1.0]},
            outputs=["fall_time", "impact_speed", "drop"],
            along={"phase": [0.0, 0.5, 1.0]},
        )
    )


def read(path):
    """Heading and rows, comment lines left out."""
    with path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.reader(line for line in file if not line.startswith("#")))
    return lines[0], lines[1:]


def test_words_of_zarr_are_words_to_all_that_takes_a_result(tmp_path):
    """They have a type of numpy's own."""
    study = toy_studies.build(axes={"height": [-1.0, 1.0], "method": ["exact", "rough"]})
    path = sweep.export(found := sweep.run(study), tmp_path / "out.zarr")
    with xr.open_zarr(path) as back:
        assert str(back.sweep.statuses()) == str(found.sweep.statuses())
        assert back.sweep.where("method == 'rough'").sizes["cell"] == 2
        cell = back.sweep.cell(height=1.0, method="rough", allow_import=True)
        assert cell.method == "rough"


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".nc", ".zarr"])
def test_stacked_cells_are_cells_and_none_at_all_are_a_mistake(tmp_path, suffix):
    ds, path = result()[["fall_time", "status"]], tmp_path / f"out{suffix}"
    for none in (sweep.where(ds, "height > 1e9"), ds.isel(v0=[]), xr.Dataset()):
        with pytest.raises(SweepError, match="nothing to export"):
            sweep.export(none, path)
    sweep.export(ds.stack(stone=("height", "v0")), path)
    if suffix == ".csv":
        grid = sweep.export(ds, tmp_path / "grid.csv")
        one, other = ([dict(zip(names, row, strict=True)) for row in rows] for names, rows in map(read, (path, grid)))
        assert one == other


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("out.h5", r"\.parquet"),
        ("out", "no suffix"),
        ("nowhere/out.csv", "No such file"),
        ("nowhere/out.nc", "No such file"),
        ("folder.csv", "folder"),
        (f"{'a' * 300}.csv", "cannot be written"),
    ],
)
def test_what_cannot_be_written_is_one_clear_line(tmp_path, name, word):
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(SweepError, match=word) as told:
        sweep.export(result(), tmp_path / name)
    assert "\n" not in str(told.value)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.csv"]


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_a_fault_half_way_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, suffix):
    target = tmp_path / f"out{suffix}"
    target.write_text("old")

    def full(old, new):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(disk, "rename", full)
    with pytest.raises(SweepError, match="No space left"):
        sweep.export(result(), target, force=True)
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == [target.name]


KILLED = """
import os, signal, sys
import sweep
from sweep.file import disk
disk.sync_folder = lambda path: os.kill(os.getpid(), signal.SIGKILL)
keys = {"kernel": "toy:KERNEL", "axes": {"height": [1.0]}, "outputs": ["fall_time"], "allow_import": True}
sweep.export(sweep.run(**keys), sys.argv[1])
"""


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_what_an_export_left_that_was_killed_goes_with_the_next_one(tmp_path, suffix):
    target = tmp_path / f"out{suffix}"
    killed = subprocess.run([sys.executable, "-c", KILLED, target], env=environment())
    assert (killed.returncode, target.exists()) == (-signal.SIGKILL, False)
    assert list(tmp_path.iterdir())
    sweep.export(result(), target)
    assert list(tmp_path.iterdir()) == [target]


def test_two_exports_do_not_write_to_the_same_file_at_a_time(tmp_path):
    with disk.replacing(tmp_path / "out.csv"), pytest.raises(SweepError, match="another process"):
        sweep.export(result(), tmp_path / "out.csv")


def test_a_summary_is_a_table_with_a_column_for_each_bin_and_status(tmp_path):
    edges = [0.1, 0.5, 1.0]
    summary = {"over": ["height"], "outputs": {"fall_time": ["min", "histogram"]}, "edges": {"fall_time": edges}}
    keys = {"axes": {"v0": [0.0, 1.0], "height": [0.2, 1.0, 3.0]}}
    ds, cells = sweep.run(toy_studies.build(**keys, summary=summary)), sweep.run(toy_studies.build(**keys)).fall_time
    heading, rows = read(sweep.export(ds, tmp_path / "out.csv"))
    table = {name: np.array([row[k] for row in rows], float) for k, name in enumerate(heading)}
    np.testing.assert_array_equal(table["cells_OK"], [3.0, 3.0])
    np.testing.assert_array_equal(table["fall_time_min"], cells.min("height"))
    counts = np.stack([np.histogram(line, edges)[0] for line in cells.transpose("v0", "height").values])
    np.testing.assert_array_equal(np.stack([table["fall_time_histogram_1"], table["fall_time_histogram_2"]], 1), counts)


# in other units


def test_outputs_axes_and_fixed_parameters_change_their_unit():
    stones = result()
    ds = sweep.in_units(stones, {"fall_time": "ms", "height": "mm", "g": "cm/s^2", "impact_speed": "km/hour"})
    np.testing.assert_allclose(ds.fall_time, 1000 * stones.fall_time, rtol=4e-16)
    np.testing.assert_allclose(ds.impact_speed, 3.6 * stones.impact_speed, rtol=4e-16)
    assert ds.height.values.tolist() == [-1000.0, 1000.0, 3000.0]
    assert float(ds.g) == pytest.approx(980.665, rel=4e-16, abs=0.0)
    assert [ds[name].attrs["units"] for name in ("fall_time", "height", "g")] == ["ms", "mm", "cm/s^2"]
    assert ds.fall_time.attrs["long_name"] == stones.fall_time.attrs["long_name"]
    assert stones.height.attrs["units"] == "m"


def test_all_mistakes_are_told_at_once():
    with pytest.raises(SweepError, match="a mapping of names"):
        sweep.in_units(result(), "period")
    with pytest.raises(sweep.StudyError, match="expected a unit"):
        sweep.in_units(result(), {"height": ["mm"]})
    with pytest.raises(sweep.StudyError) as caught:
        sweep.in_units(result(), {"fall_tim": "s", "height": "kg", "status": "1", "g": "parsec/furlong^"})
    text = str(caught.value)
    assert "4 mistakes" in text
    assert "did you mean fall_time?" in text
    assert '"kg" is a mass; height is a length' in text
    assert "words or counts" in text
