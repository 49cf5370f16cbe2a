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
from running import flip, interrupted, keys, quiet

import sweep
from sweep.cli import main
from sweep.results import open
from sweep.results.verify import verify
from sweep.store import parts
from sweep.store.store import folder_of

SIZES = {"v0": 3, "height": 11, "phase": 3}
BLOCK = 5
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
    with h5py.File(path) as file:
        place, cell_bytes = file[name].id.get_offset(), file[name].nbytes // CELLS
    flip(path, place + cell * cell_bytes + 3, bit)


@pytest.mark.parametrize("name", ["fall_time", "drop"])
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
    with h5py.File(path) as file:
        place = file["fall_time_mean"].id.get_offset()
    flip(path, place + 9)
    with sweep.open_result(path) as found, pytest.raises(sweep.SweepError, match="fall_time_mean is damaged between"):
        found.load()


def test_a_single_cell_is_checked(tmp_path):
    path = tmp_path / "out.h5"
    quiet(toy_studies.build(axes={"height": [1.0]}, summary={"over": ["height"]}), path).close()
    with h5py.File(path) as file:
        place = file["fall_time_mean"].id.get_offset()
    flip(path, place + 1)
    with sweep.open_result(path) as found, pytest.raises(sweep.SweepError, match="fall_time_mean is damaged"):
        found.load()


@pytest.mark.parametrize("what", ["title", "height", "status"])
def test_damage_beside_the_numbers_is_told_at_once(copy, what):
    with h5py.File(copy) as file:
        if what == "status":
            place = file["status"].id.get_chunk_info(0).byte_offset
        elif what == "height":
            place = file["height"].id.get_offset() + 12
        else:
            place = copy.read_bytes().index(b"toy:KERNEL")
    flip(copy, place)
    with pytest.raises(sweep.SweepError, match="damaged beside the outputs' numbers"):
        sweep.open_result(copy)


def test_what_was_changed_on_purpose_is_opened_but_its_numbers_are_checked(copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["comment"] = "mine"
        file["fall_time"][1, 2] = 7.0
        file["status"][2, 10] = 3
    with sweep.open_result(copy) as found:
        assert found.attrs["comment"] == "mine"
        assert found["drop"].load().shape == (3, 11, 3)
        with pytest.raises(sweep.SweepError, match="fall_time is damaged between its cells 10 and 15"):
            found.fall_time.load()
        with pytest.raises(sweep.SweepError, match="status is damaged between its cells 30 and 33"):
            found.status.load()


def test_a_file_without_digests_is_opened_as_it_is(copy):
    with h5py.File(copy, "r+") as file:
        del file["integrity"]
    with sweep.open_result(copy) as found:
        assert found.load().fall_time.shape == (3, 11)


def test_pieces_of_a_large_result_are_checked(copy, monkeypatch):
    harm(copy, "drop", 20)
    monkeypatch.setattr(open, "memory", lambda: 100)
    with sweep.open_result(copy) as found:
        assert found["drop"].chunks is not None
        with pytest.raises(sweep.SweepError, match="drop is damaged between its cells 20 and 25"):
            found["drop"].compute()


def test_a_column_is_read_once_and_kept(copy):
    with sweep.open_result(copy) as found:
        before = found.fall_time.values
        harm(copy, "fall_time", 0)
        assert found.fall_time.values.tobytes() == before.tobytes()


def test_a_checked_dataset_can_be_sent_to_another_process(copy):
    harm(copy, "fall_time", 0)
    with sweep.open_result(copy) as found:
        sent = pickle.loads(pickle.dumps(found["drop"]))
        assert sent.values.tobytes() == found["drop"].values.tobytes()


@pytest.mark.parametrize(
    "command",
    [
        ("export", "OUT", "-o", "new.csv"),
        ("export", "OUT", "-o", "new.nc"),
        ("fit", "OUT", "--y", "fall_time", "--x", "height"),
        ("plot", "OUT", "-o", "new.png"),
        ("report", "OUT", "-o", "new.html"),
        ("run", "fall.toml", "-o", "OUT", "--allow-import"),
        ("refine", "OUT", "--y", "fall_time", "--tolerance", "1e-3", "-o", "new.h5", "--allow-import"),
    ],
    ids=lambda command: "-".join(command[:4]),
)
def test_every_command_that_reads_a_damaged_column_names_it(read, tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    read("[axes]\nv0 = [0.0, 2.0, 3.0]\nheight = { num = 11, start = 1, stop = 11, spacing = 'linear' }\n")
    assert main(["run", "fall.toml", "-o", "out.h5", "--allow-import"]) == 0
    words = ["out.h5" if word == "OUT" else word for word in command]
    harm(tmp_path / "out.h5", "fall_time", 17)
    capsys.readouterr()
    assert main(words) == 2
    told = capsys.readouterr().err
    assert "fall_time" in told
    assert "damaged between its cells 0 and 33" in told
    assert not [name for name in command if name.startswith("new") and (tmp_path / name).exists()]


def test_a_damaged_result_is_shown_as_damaged(copy, capsys):
    with h5py.File(copy) as file:
        place = file["status"].id.get_chunk_info(0).byte_offset
    flip(copy, place)
    assert main(["show", str(copy)]) == 2
    assert "damaged beside the outputs' numbers" in capsys.readouterr().err


def test_a_damaged_result_is_computed_anew_when_forced(copy, whole):
    harm(copy, "fall_time", 17)
    with pytest.raises(sweep.SweepError, match="fall_time: damaged between its cells 15 and 20"):
        quiet(study(), copy)
    quiet(study(), copy, force=True).close()
    assert verify(copy).whole


# unfinished


@pytest.fixture
def large(tmp_path, monkeypatch):
    """An unfinished sweep, read when it is used."""
    path = tmp_path / "out.h5"
    interrupted(study(), path)
    monkeypatch.setattr(open, "LARGEST_AT_ONCE", 0)
    return path


@pytest.mark.parametrize("name", ["status", "method_used", "fall_time"])
def test_a_part_filled_with_zeros_is_pending_in_a_large_unfinished_result(large, name):
    part = min(folder_of(large).glob("*.h5"))
    with h5py.File(part) as file:
        spans = [(file[n].id.get_offset(), file[n].nbytes) for n in ("fall_time", "drop", "status", "method_used")]
    content = bytearray(part.read_bytes())
    for place, length in spans:
        content[place : place + length] = bytes(length)
    part.write_bytes(content)
    with sweep.open_result(large) as found:
        missing = {"status": 127, "method_used": -1, "fall_time": np.nan}[name]
        np.testing.assert_array_equal(found[name].values.reshape(-1)[:5], [missing] * 5)


def test_a_flipped_status_is_pending_in_a_large_unfinished_result(large):
    part = min(folder_of(large).glob("*.h5"))
    with h5py.File(part) as file:
        place = file["status"].id.get_offset()
    flip(part, place + 2)
    with sweep.open_result(large) as found:
        assert found.status.values.reshape(-1)[:5].tolist() == [127] * 5
        assert np.isnan(found.fall_time.values.reshape(-1)[:5]).all()


def test_the_parts_of_a_large_unfinished_result_are_checked_once(large, monkeypatch):
    real, calls = parts.read_part, []
    monkeypatch.setattr(parts, "read_part", lambda *rest, **keys: (calls.append(rest), real(*rest, **keys))[1])
    with sweep.open_result(large) as found:
        for name in ("status", "method_used", "fall_time"):
            assert found[name].values.size == CELLS
    assert len(calls) == len(list(folder_of(large).glob("*.h5")))
