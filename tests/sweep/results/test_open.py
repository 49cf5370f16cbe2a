"""Results as Datasets: finished or not, by plain readers too, in pieces, and what is no result."""

import contextlib
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest
import xarray as xr
from running import interrupted

import sweep
from kernels.interface import Status
from sweep import SweepError, open_result, run
from sweep.cli import main
from sweep.file.store import unfinished_of


def stone():
    axes = {"height": [-1.0, 1.0, 2.0, 5.0], "v0": [0.0, 0.5, 3.0], "method": ["rough", "auto"]}
    keys = {"title": "A stone", "along": {"phase": [0.0, 0.25, 1.0]}, "rtol": 0.01}
    return sweep.study(allow_import=True, kernel="toy:KERNEL", axes=axes, **keys)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("stored") / "out.h5"
    run(stone(), path, block_cells=5, progress=False).close()
    return path


@pytest.fixture
def unfinished(tmp_path):
    """An output of 24 cells: the first twelve are there, the next six are missing, the others may be."""
    interrupted(stone(), tmp_path / "out.h5")
    return tmp_path / "out.h5"


def test_the_file_opens_with_plain_h5py_and_is_stored_as_promised(stored):
    with h5py.File(stored) as file:
        for name in ("fall_time", "drop", "status", "method_used", "error_bound"):
            assert file[name].fletcher32
            assert file[name].compression is None
        assert [scale[0].name for scale in file["drop"].dims] == ["/height", "/v0", "/method", "/phase"]


def test_attributes_follow_cf(stored):
    with open_result(stored) as found:
        assert (found.attrs["Conventions"], found.attrs["title"]) == ("CF-1.11", "A stone")
        assert found.fall_time.attrs["ancillary_variables"] == "status method_used error_bound"
        assert (found.fall_time.units, found.height.units, found.g.units) == ("s", "m", "m/s^2")
        assert found.status.attrs["flag_values"].dtype == np.int8
        flags = dict(zip(found.status.attrs["flag_meanings"].split(), found.status.attrs["flag_values"], strict=True))
        assert flags == {s.name: int(s) for s in Status}


def test_an_unfinished_result_is_not_taken_for_a_finished_one_where_that_is_asked(unfinished, stored):
    with pytest.raises(SweepError, match=r"[12] of 4"):
        open_result(unfinished, strict=True)
    open_result(stored, strict=True).close()


def test_large_results_come_in_pieces_and_are_the_same(unfinished, stored, monkeypatch):
    few, whole = open_result(unfinished).load(), open_result(stored).load()
    monkeypatch.setattr("sweep.file.open.memory", lambda: 100)
    for path, expected in ((unfinished, few), (stored, whole)):
        found = open_result(path)
        assert found["drop"].chunks is not None
        for name in expected.data_vars:
            assert found[name].dtype == expected[name].dtype
            np.testing.assert_array_equal(found[name].compute(), expected[name])


def test_a_sweep_can_be_opened_at_any_moment_of_its_end(tmp_path):
    path, study, states = tmp_path / "out.h5", stone(), set()

    def compute():
        for _ in range(5):
            run(study, path, block_cells=5, progress=False, force=True).close()

    with ThreadPoolExecutor(1) as other:
        running = other.submit(compute)
        while not running.done():
            try:
                with open_result(path) as found:
                    states.add(bool((found.status == Status.PENDING).any()))
            except SweepError as error:
                states.add(str(error).partition("no such file")[1])
    running.result()
    assert states <= {False, True, "no such file"}


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4", "h5py"])
def test_a_foreign_reader_of_an_unfinished_sweep_gets_pending_and_no_number(unfinished, stored, engine):
    path = unfinished_of(unfinished)
    with open_result(stored) as whole, foreign(path, engine) as read:
        status = read("status").ravel()
        assert ((status[:12] == 0).any(), (status[12:18] == Status.PENDING).all()) == (True, True)
        for name in ("fall_time", "drop", "method_used", "error_bound"):
            with pytest.raises((OSError, RuntimeError)):
                read(name)
            np.testing.assert_array_equal(read(name, 1), whole[name][1])


@contextlib.contextmanager
def foreign(path, engine):
    """Reads a variable by name, of all or one of the heights."""
    if engine == "h5py":
        with h5py.File(path) as file:
            yield lambda name, *at: file[name][at or ...]
    else:
        with xr.open_dataset(path, engine=engine, mask_and_scale=False) as file:
            yield lambda name, *at: file[name][at or ...].values


def test_a_result_that_is_open_can_be_opened_and_run_again_and_closing_it_frees_the_file(tmp_path):
    path = tmp_path / "out.h5"
    first = run(stone(), path, progress=False)
    second, third = run(stone(), path, progress=False), open_result(path)
    assert first.status.values.tolist() == second.status.values.tolist() == third.status.values.tolist()
    for dataset in (first, second, third):
        dataset.close()
    with h5py.File(path, "r+") as file:
        assert file["status"].shape == (4, 3, 2)


def test_what_is_closed_says_so(stored):
    found = open_result(stored)
    found.close()
    with pytest.raises(SweepError, match="is closed"):
        found.fall_time.load()


@pytest.mark.parametrize("given", [3, b"a.h5"])
def test_what_is_no_path_is_named(given):
    found = run(stone())
    for write in (lambda path: run(stone(), path), lambda path: sweep.export(found, path)):
        with pytest.raises(SweepError, match="expected a path"):
            write(given)
    for read in (open_result, sweep.verify, sweep.list_results):
        with pytest.raises(SweepError, match="expected a path"):
            read(given)


@pytest.mark.parametrize("letters", [246, 252, 300])
def test_a_name_too_long_for_the_system_is_one_clear_line(tmp_path, letters):
    path = tmp_path / ("a" * letters)
    for action in (open_result, sweep.verify, lambda path: run(stone(), path, progress=False)):
        with pytest.raises(SweepError, match=r"no such|too long") as told:
            action(path)
        assert "\n" not in str(told.value)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("content", [None, "folder", b"", b"words", b"\x89HDF\r\n\x1a\n" + bytes(100)])
@pytest.mark.parametrize("name", ["open_result", "verify"])
def test_what_is_no_result_is_one_clear_line(tmp_path, name, content, capsys):
    path = tmp_path / "foreign.h5"
    if content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    if name == "open_result" or not isinstance(content, bytes):
        with pytest.raises(SweepError, match=r"foreign\.h5: .*(no such|[Dd]irectory|damaged)") as told:
            getattr(sweep, name)(path)
        assert "\n" not in str(told.value)
    assert main(["verify", str(path)]) == 2
    assert capsys.readouterr().err
