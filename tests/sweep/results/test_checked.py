"""No number of a damaged result is handed out, whoever reads it; all others still are."""

import pickle
import shutil

import h5py
import numpy as np
import pytest
import toy_studies
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import flip, interrupted, keys, place, quiet

import sweep
from sweep.cli import main
from sweep.results import open
from sweep.results.verify import verify
from sweep.store.reading import StoredFile
from sweep.store.store import unfinished_of

SIZES = {"v0": 3, "height": 11, "phase": 3}
BLOCK = 11
CELLS = 33


def study(**more):
    axes = {"v0": [0.0, 2.0, 3.0], "height": np.arange(1.0, 12)}
    return toy_studies.build(axes=axes, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5, 1.0]}, **more)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "out.h5"
    quiet(study(), path, block_cells=BLOCK).close()
    return path


@pytest.fixture
def copy(whole, tmp_path):
    return shutil.copy(whole, tmp_path / "out.h5")


def harm(path, name, cell, bit=0):
    """Flips a bit of a number of a cell."""
    flip(path, place(path, name, cell) + (3 if name != "status" else 0), bit)


@pytest.mark.parametrize("name", ["fall_time", "drop", "status"])
@pytest.mark.parametrize("cell", [0, 4, 5, 17, 32])
def test_damaged_numbers_are_not_handed_out_and_all_others_are(whole, copy, name, cell):
    harm(copy, name, cell)
    first = cell // BLOCK * BLOCK
    last = min(first + BLOCK, CELLS)
    with sweep.open_result(whole) as sound, sweep.open_result(copy) as found:
        with pytest.raises(sweep.SweepError, match=f"{name} is damaged between its cells {first} and {last};"):
            found[name].load()
        flat, wanted = (ds[name].values.reshape(CELLS, -1) if ds is sound else ds[name] for ds in (sound, found))
        for number in range(CELLS):
            at = dict(zip(("v0", "height"), divmod(number, 11), strict=True))
            if first <= number < last:
                with pytest.raises(sweep.SweepError, match="is damaged"):
                    wanted.isel(at).values.tobytes()
            else:
                assert wanted.isel(at).values.tobytes() == flat[number].tobytes()
        for other in {"fall_time", "drop", "status", "method_used"} - {name}:
            assert found[other].values.tobytes() == sound[other].values.tobytes()


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    key=st.fixed_dictionaries({}, optional={name: keys(size) for name, size in SIZES.items()}),
    cell=st.integers(0, CELLS - 1),
)
def test_any_piece_of_it_is_right_or_refused(whole, tmp_path, key, cell):
    path = shutil.copy(whole, tmp_path / "out.h5")
    harm(path, "fall_time", cell)
    with xr.open_dataset(whole, engine="h5netcdf") as plain, sweep.open_result(path) as found:
        assert found["drop"].isel(key).values.tobytes() == plain["drop"].isel(key).values.tobytes()
        key.pop("phase", None)
        numbers = plain.fall_time.copy(data=np.arange(CELLS).reshape(3, 11)).isel(key).values
        try:
            read = found.fall_time.isel(key).values
        except sweep.SweepError:
            return
        assert cell not in numbers
        assert read.tobytes() == plain.fall_time.isel(key).values.tobytes()


def test_a_damaged_summary_is_not_handed_out(tmp_path):
    path = tmp_path / "out.h5"
    quiet(study(summary={"over": ["height"], "outputs": {"fall_time": ["mean"], "drop": ["max"]}}), path).close()
    with sweep.open_result(path) as found:
        assert found.load().fall_time_mean.shape == (3,)
    flip(path, place(path, "fall_time_mean", 1) + 1)
    with sweep.open_result(path) as found, pytest.raises(sweep.SweepError, match="fall_time_mean is damaged between"):
        found.load()


@pytest.mark.parametrize("what", ["title", "height"])
def test_damage_beside_the_numbers_is_told_at_once(copy, what):
    with h5py.File(copy) as file:
        at = file["height"].id.get_offset() + 12
    flip(copy, at if what == "height" else copy.read_bytes().index(b"toy:KERNEL"))
    with pytest.raises(sweep.SweepError, match="damaged beside the outputs' numbers"):
        sweep.open_result(copy)


def test_what_was_changed_on_purpose_is_opened_and_hdf5_checks_it(copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["comment"] = "mine"
        file["fall_time"][1, 2] = 7.0
    with sweep.open_result(copy) as found:
        assert found.attrs["comment"] == "mine"
        assert found.fall_time[1, 2] == 7.0
    with h5py.File(copy) as file:
        at = file["fall_time"].id.get_chunk_info(0).byte_offset
    flip(copy, at)
    with sweep.open_result(copy) as found, pytest.raises(OSError, match="filter"):
        found.fall_time.load()


def test_pieces_of_a_large_result_are_checked(copy, monkeypatch):
    harm(copy, "drop", 20)
    monkeypatch.setattr(open, "memory", lambda: 100)
    with sweep.open_result(copy) as found:
        assert found["drop"].chunks is not None
        with pytest.raises(sweep.SweepError, match="drop is damaged between its cells 11 and 22"):
            found["drop"].compute()


def test_a_checked_dataset_can_be_sent_to_another_process(copy):
    harm(copy, "fall_time", 0)
    with sweep.open_result(copy) as found:
        sent = pickle.loads(pickle.dumps(found["drop"]))
        assert sent.values.tobytes() == found["drop"].values.tobytes()


def test_a_damaged_result_is_shown_as_damaged(copy, capsys):
    harm(copy, "status", 0)
    assert main(["show", str(copy)]) == 2
    assert "status is damaged between its cells 0 and 11" in capsys.readouterr().err


def test_a_damaged_result_is_computed_anew_when_forced(copy, whole):
    harm(copy, "fall_time", 17)
    with pytest.raises(sweep.SweepError, match="fall_time: damaged between its cells 11 and 22"):
        quiet(study(), copy)
    quiet(study(), copy, force=True).close()
    assert verify(copy).whole


# unfinished


@pytest.fixture
def unfinished(tmp_path):
    path = tmp_path / "out.h5"
    interrupted(study(), path)
    return path


@pytest.mark.parametrize("name", ["status", "method_used", "fall_time"])
@pytest.mark.parametrize("harmed", ["status", "fall_time", "drop"])
def test_a_damaged_block_is_pending_in_all_columns_of_an_unfinished_result(unfinished, name, harmed):
    harm(unfinished_of(unfinished), harmed, 1)
    with sweep.open_result(unfinished) as found:
        missing = {"status": 127, "method_used": -1, "fall_time": np.nan}[name]
        np.testing.assert_array_equal(found[name].values.reshape(-1)[:4], [missing] * 4)


def test_a_block_filled_with_zeros_is_pending(unfinished):
    path = unfinished_of(unfinished)
    with StoredFile(path) as file:
        spans = [(p.at(0), file.layout.work.stored(p, 0)) for p in file.layout.work.places]
    content = bytearray(path.read_bytes())
    for at, length in spans:
        content[at : at + length] = bytes(length)
    path.write_bytes(content)
    with sweep.open_result(unfinished) as found:
        assert found.status.values.reshape(-1)[:4].tolist() == [127] * 4
        assert np.isnan(found.fall_time.values.reshape(-1)[:4]).all()
