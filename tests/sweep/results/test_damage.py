"""Damage of every kind is found, told with its cells, and mended; no damaged number is handed out, all others are."""

import os
import pickle
import random
import shutil

import h5py
import numpy as np
import pytest
import toy_studies
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import flip, interrupted, kept, keys, place, quiet, tall

import sweep
from kernels.interface import Status
from sweep.cli import main
from sweep.file.reading import StoredFile
from sweep.file.store import Store, unfinished_of

BLOCK, CELLS = 11, 33
PIECES = st.fixed_dictionaries({}, optional={"v0": keys(3), "height": keys(11), "phase": keys(3)})
SUMMARY = {"over": ["height"], "outputs": {"fall_time": ["min", "mean", "argmin"]}}


def study(**more):
    axes = {"v0": [0.0, 2.0, 3.0], "height": np.arange(1.0, 12)}
    return toy_studies.build(axes=axes, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5, 1.0]}, **more)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "out.h5"
    quiet(study(), path, block_cells=BLOCK).close()
    return path


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    path = tmp_path_factory.mktemp("summary") / "out.h5"
    quiet(study(summary=SUMMARY), path).close()
    return path


@pytest.fixture
def copy(whole, tmp_path):
    return shutil.copy(whole, tmp_path / "out.h5")


@pytest.fixture(params=["cells", "summary", "unfinished"])
def any_result(request, whole, summary, tmp_path):
    """A result and the file that holds it."""
    path = tmp_path / "out.h5"
    if request.param == "unfinished":
        interrupted(study(), path)
        return path, unfinished_of(path)
    shutil.copy({"cells": whole, "summary": summary}[request.param], path)
    return path, path


def harm(path, name, cell, bit=0):
    """Flips a bit of a number of a cell."""
    flip(path, place(path, name, cell) + (3 if name != "status" else 0), bit)


# what verify finds


def test_a_flipped_bit_is_found_wherever_anything_stands_and_a_whole_result_is_whole(any_result):
    """Between chunks and pages of HDF5's tables nothing stands, and a bit there changes nothing for any reader."""
    path, file = any_result
    before = sweep.verify(path)
    assert before.whole is (path == file)
    content = file.read_bytes()
    with StoredFile(file) as found:
        table, end = found.work, found.key_at
        special = [table.digests_at + 3, found.key_at + 1, content.index(b"GCOL") + 40]
        tables = [table for table in found.tables.values() if found.finished or table.done.any()]
        columns = [column for table in tables for column in table.columns.values()]
        chunks = [int(at) + k for c in columns for at, done in zip(c.at, c.table.done, strict=True) if done
                  for k in (0, c.size, c.size + c.check - 1)]  # fmt: skip
    rng = random.Random(3)
    for at in special + rng.sample(range(end), 60) + rng.sample(chunks, 40):
        flip(file, at, at % 8)
        assert not sweep.verify(path).whole, at
        assert path != file or sweep.verify(path) != before, at
        file.write_bytes(content)
    assert sweep.verify(path) == before
    file.write_bytes(content + b"more")
    assert not sweep.verify(path).whole


def test_a_damaged_fixed_parameter_is_refused_by_hdf5_too(copy):
    with h5py.File(copy) as file:
        number = file["g"][()]
    flip(copy, copy.read_bytes().index(number.tobytes()))
    with h5py.File(copy) as file, pytest.raises((OSError, KeyError)):
        file["g"][()]


@pytest.mark.parametrize("name", ["fall_time", "drop", "status"])
def test_damaged_cells_are_named(copy, name):
    harm(copy, name, 17)
    found = sweep.verify(copy)
    assert found.findings == (f"{name}: damaged between its cells 11 and 22",)
    assert found.blocks == (1,)


@pytest.mark.parametrize("what", ["comment", "coordinate", "status"])
def test_what_another_program_changed_is_told_and_what_is_left_can_be_read(copy, what):
    with h5py.File(copy, "r+") as file:
        if what == "comment":
            file.attrs["comment"] = "mine"
        else:
            file["height" if what == "coordinate" else "status"][0] = 0.5 if what == "coordinate" else 64
    found = sweep.verify(copy)
    assert "status: damaged between" in str(found) if what == "status" else "another program" in str(found)
    with sweep.open_result(copy) as changed:
        assert changed["drop"].load().attrs["units"] == "m"
        assert changed.attrs.get("comment") == ("mine" if what == "comment" else None)
        if what == "status":
            with pytest.raises(sweep.SweepError, match="another program"):
                changed.status.load()


@pytest.mark.parametrize("digests_too", [False, True])
def test_chunks_that_changed_places_are_found(copy, digests_too):
    """HDF5's own checksum sees nothing of it; neither would digests that do not say of which chunk they are."""
    with StoredFile(copy) as file:
        table, column = file.tables["cells"], file.tables["cells"].columns["fall_time"]
        spans = [(int(at), column.size + column.check) for at in column.at[:2]]
    digests = [(table.digests_at + block * table.row_bytes, 16) for block in (0, 1)]
    content = bytearray(copy.read_bytes())
    for (a, n), (b, m) in (spans, digests) if digests_too else (spans,):
        content[a : a + n], content[b : b + m] = content[b : b + m], content[a : a + n]
    copy.write_bytes(content)
    assert sweep.verify(copy).blocks == (0, 1)


def test_a_result_whose_last_bytes_never_came_is_refused_whoever_reads_it(whole, tmp_path, monkeypatch, capsys):
    """As of a copy that was interrupted; its length may be right."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(whole, "whole.h5")
    path, content = tmp_path / "out.h5", whole.read_bytes()
    for lost in sorted({1, 2, 11, 12, 13, 28, 29, *np.geomspace(40, len(content) - 100, 9).astype(int).tolist()}):
        for fill in (b"\0", b"\xff", b""):
            path.write_bytes(content[:-lost] + fill * lost)
            if path.read_bytes() == content:
                continue
            with pytest.raises(sweep.SweepError, match="damaged"):
                sweep.open_result(path).load()
            assert not sweep.verify(path).whole
    for command in (["show"], ["verify"], ["export", "-o", "out.csv"], ["diff", "whole.h5"]):
        assert main([*command, str(path)]) == 2
        printed = capsys.readouterr()
        assert "damaged" in printed.err + printed.out


# what readers get


@pytest.fixture(scope="module", params=[1, 4, 11, 33])
def cut(request, tmp_path_factory):
    """A result in blocks of so many cells."""
    path = tmp_path_factory.mktemp("cut") / "out.h5"
    quiet(study(), path, block_cells=request.param).close()
    return path


@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(key=PIECES, cell=st.integers(0, CELLS - 1))
def test_any_piece_is_right_or_refused(cut, tmp_path, key, cell):
    """A cell that is damaged takes its block along, and nothing else, however blocks are cut."""
    path = shutil.copy(cut, tmp_path / "out.h5")
    harm(path, "fall_time", cell)
    with StoredFile(cut) as file:
        bounds = map(file.work.blocks.bounds, range(file.work.blocks.count))
        first, end = next((first, end) for first, end in bounds if cell < end)
    with xr.open_dataset(cut, engine="h5netcdf") as plain, sweep.open_result(path) as found:
        assert found["drop"].isel(key).values.tobytes() == plain["drop"].isel(key).values.tobytes()
        key.pop("phase", None)
        numbers = plain.fall_time.copy(data=np.arange(CELLS).reshape(3, 11)).isel(key).values
        if ((first <= numbers) & (numbers < end)).any():
            with pytest.raises(sweep.SweepError, match="fall_time is damaged"):
                found.fall_time.isel(key).load()
        else:
            assert found.fall_time.isel(key).values.tobytes() == plain.fall_time.isel(key).values.tobytes()


def test_a_damaged_summary_is_not_handed_out(summary, tmp_path):
    path = shutil.copy(summary, tmp_path / "out.h5")
    flip(path, place(path, "fall_time_mean", 1) + 1)
    with sweep.open_result(path) as found, pytest.raises(sweep.SweepError, match="fall_time_mean is damaged"):
        found.load()


@pytest.mark.parametrize("what", ["title", "height", "end"])
def test_damage_beside_the_numbers_is_told_at_once_and_cannot_be_repaired(copy, what):
    with h5py.File(copy) as file:
        places = {"height": file["height"].id.get_chunk_info(0).byte_offset + 12}
        places["end"] = file["ending/ending"].id.get_chunk_info(0).byte_offset + 16
    places["title"] = copy.read_bytes().index(b"toy:KERNEL")
    flip(copy, places[what])
    for action in (sweep.open_result, lambda path: quiet(study(), path, repair=True)):
        with pytest.raises(sweep.SweepError, match="damaged"):
            action(copy)
    assert copy.exists()


def test_a_dataset_that_was_sent_to_another_process_is_checked_there(copy):
    harm(copy, "fall_time", 0)
    with sweep.open_result(copy) as found:
        fall_time = pickle.loads(pickle.dumps(found.fall_time))
        with pytest.raises(sweep.SweepError, match="damaged"):
            fall_time.load()


def test_a_result_from_a_pickle_has_a_file_of_its_own_and_refuses_another_result(copy):
    with sweep.open_result(copy) as found:
        sent = pickle.dumps(found)
        pickle.loads(sent).close()
        assert found.equals(pickle.loads(sent))
    quiet(tall(7), copy, force=True).close()
    with pytest.raises(sweep.SweepError, match="replaced"):
        pickle.loads(sent)


def test_an_unfinished_result_by_either_name_is_not_called_damaged_and_what_is_missing_is_told(tmp_path):
    interrupted(tall(23), tmp_path / "out.h5")
    for name in ("out.h5", "out.h5.unfinished"):
        found = sweep.verify(tmp_path / name)
        assert not found.whole
        assert "damaged" not in str(found)
        assert "missing: cells 10 to" in str(found)
        assert f"{len(kept(tmp_path / 'out.h5'))} of 5 blocks" in found.checked


def test_damaged_blocks_of_an_unfinished_result_are_named(tmp_path):
    output = tmp_path / "out.h5"
    interrupted(study(), output)
    harm(unfinished_of(output), "fall_time", 6)
    found = sweep.verify(output)
    assert found.findings[0] == "fall_time: damaged between its cells 4 and 8"
    assert found.blocks == (1,)


def test_an_unfinished_result_that_is_damaged_beside_its_numbers_is_not_continued(tmp_path):
    output = tmp_path / "out.h5"
    interrupted(study(), output)
    with StoredFile(unfinished_of(output)) as file:
        flip(file.path, file.key_at)
    with pytest.raises(sweep.SweepError, match="--force"):
        quiet(study(), output)
    quiet(study(), output, force=True).close()
    assert sweep.verify(output).whole


# what mends it


def test_a_damaged_result_is_read_once_before_it_is_repaired(tmp_path, monkeypatch):
    path, real, places = tmp_path / "out.h5", os.preadv, []
    quiet(study(), path, block_cells=3).close()
    healthy = place(path, "fall_time", 6)
    harm(path, "fall_time", 20)
    monkeypatch.setattr(os, "preadv", lambda fd, buffers, at: (places.append(at), real(fd, buffers, at))[1])
    quiet(study(), path, repair=True).close()
    assert places.count(healthy) == 1
    monkeypatch.undo()
    assert sweep.verify(path).whole


def test_a_repair_that_is_interrupted_is_unfinished_and_continues(copy, monkeypatch):
    harm(copy, "fall_time", 17)
    with monkeypatch.context() as patch:
        patch.setattr(Store, "put", lambda *words: 1 / 0)
        with pytest.raises(sweep.SweepError, match="ZeroDivisionError"):
            quiet(study(), copy, repair=True)
    with sweep.open_result(copy) as found:
        assert "end" not in found.attrs
        pending = np.flatnonzero(found.status.values.ravel() == Status.PENDING)
        assert pending.tolist() == list(range(BLOCK, 2 * BLOCK))
    quiet(study(), copy).close()
    assert sweep.verify(copy).whole


@pytest.mark.parametrize("kind", ["cells", "summary"])
@pytest.mark.parametrize("what", [[1], [0, 3], range(99), "digests", []])
def test_a_damaged_result_is_repaired_to_the_same_bytes(tmp_path, kind, what):
    made, path = study(**({"summary": SUMMARY} if kind == "summary" else {})), tmp_path / "out.h5"
    quiet(made, path, block_cells=10).close()
    before = path.read_bytes()
    with StoredFile(path) as file:
        table = file.work
        count, places = table.blocks.count, next(iter(table.columns.values())).at
    for block in [2 % count] if what == "digests" else [block for block in what if block < max(count, 2)]:
        at = table.digests_at + block % count * table.row_bytes if what == "digests" else int(places[block % count])
        flip(path, at + 1)
    if what:
        with pytest.raises(sweep.SweepError, match="--repair"):
            quiet(made, path)
    quiet(made, path, repair=True).close()
    assert sweep.verify(path).whole
    assert list(tmp_path.iterdir()) == [path]
    after = path.read_bytes()
    assert sum(a != b for a, b in zip(before, after, strict=True)) <= (128 + 16) * bool(what)  # ending, digest
