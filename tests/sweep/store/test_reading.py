"""Numbers out of a result, against plain numpy: whatever is asked for, checked, and missing where it is not there."""

import gc
import os
import pickle

import numpy as np
import pytest
from handmade import SCHEMA, fill, finished, frame, harm, rows_cut, whole, written

from kernels.interface import Status
from sweep.store import reading
from sweep.store.reading import StoredFile, damaged, missing, runs
from sweep.system.errors import SweepError

KEYS = [
    (), (Ellipsis,), (0,), (2,), (-1,), (slice(1, 3),), (slice(0, 3, 2),), (slice(None, None, -1),), (slice(2, 0, -1),),
    (slice(None), 1), (slice(None), slice(1, 3)), (slice(None), slice(3, None, -2)), (1, 2), (1, slice(None)),
    (1, slice(1, 4)), (slice(1, 2), slice(2, 3)), (slice(0, 0),), (slice(None), slice(2, 2)), (1, slice(0, 4, 3)),
    (slice(1, 3), slice(None), 1), (slice(0, 3, 2), 3, slice(None, None, -1)), (Ellipsis, slice(None), slice(1, 2), 0),
]  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.h5"


@pytest.mark.parametrize("cells", [2, 4, 12])
@pytest.mark.parametrize("short", [1, 64])
def test_a_column_is_indexed_as_an_array_is(path, monkeypatch, cells, short):
    monkeypatch.setattr(reading, "SHORT_RUN", short)
    layout = finished(path, frame(cells))
    with StoredFile(path) as file:
        for number, (name, column) in enumerate(file.columns().items()):
            place = layout.work.places[number]
            oracle = whole(layout.work, place).reshape(3, 4, *place.shape)
            assert (name, column.shape, column.dtype) == (place.name, oracle.shape, oracle.dtype)
            for key in KEYS:
                if len(key) <= oracle.ndim or key[0] is Ellipsis:
                    wanted = key[1:] if key[:1] == (Ellipsis,) else key
                    if len(wanted) > oracle.ndim:
                        continue
                    np.testing.assert_array_equal(column[key], oracle[wanted], strict=True, err_msg=str(key))
            np.testing.assert_array_equal(column[1], oracle[1])


@pytest.mark.parametrize(
    ("grid", "key", "starts", "length"),
    [
        ((3, 4), (slice(None), slice(None)), [0], 12),
        ((3, 4), (slice(1, 3), slice(None)), [4], 8),
        ((3, 4), (1, slice(None)), [4], 4),
        ((3, 4), (slice(0, 3, 2), slice(1, 3)), [1, 9], 2),
        ((3, 4), (slice(None), 2), [2, 6, 10], 1),
        ((3, 4), (slice(2, None, -1), slice(3, 4)), [11, 7, 3], 1),
        ((3, 4), (slice(None), slice(0, 4, 2)), [0, 2, 4, 6, 8, 10], 1),
        ((2, 3, 4), (1, slice(1, 3), slice(None)), [16], 8),
        ((2, 3, 4), (slice(None), slice(1, 2), slice(None)), [4, 16], 4),
        ((2, 3, 4), (slice(None), slice(0, 3, 2), slice(None)), [0, 8, 12, 20], 4),
        ((2, 3, 4), (-1, -1, -1), [23], 1),
        ((3, 4), (slice(1, 1), slice(None)), [4], 0),
        ((), (), [0], 1),
    ],
)
def test_a_key_is_runs_of_cells(grid, key, starts, length):
    found, long = runs(key, grid)
    assert (found.tolist(), long) == (starts, length)


def test_cells_are_looked_up_in_any_order(path):
    layout = finished(path)
    numbers = np.array([11, 0, 5, 5, 3, 4, 8, 7])
    with StoredFile(path) as file:
        for place, column in zip(layout.work.places, file.columns().values(), strict=True):
            np.testing.assert_array_equal(column.cells(numbers), whole(layout.work, place)[numbers])
            assert column.cells(numbers[:0]).shape == (0, *place.shape)


@pytest.mark.parametrize("most", [0, 1 << 30])
@pytest.mark.parametrize("cells", [2, 4])
def test_a_run_of_cells_is_read_by_one_thread_or_several(path, monkeypatch, most, cells):
    monkeypatch.setattr(reading, "LONG_RUN", most)
    layout = finished(path, frame(cells))
    with StoredFile(path) as file:
        for place, column in zip(layout.work.places, file.columns().values(), strict=True):
            oracle = whole(layout.work, place)
            for start, stop in [(0, 12), (1, 11), (3, 4), (2, 4), (5, 5), (7, 3), (0, 1), (11, 12)]:
                np.testing.assert_array_equal(column.run(start, stop), oracle[start:stop])


@pytest.mark.parametrize(("bytes_", "stop", "threads"), [(64, 4, 1), (65, 4, 0), (1, 2, 0), (64, 5, 1), (None, 12, 0)])
def test_threads_are_for_long_runs_of_several_blocks(path, monkeypatch, bytes_, stop, threads):
    finished(path, frame(2))
    pools, real = [], reading.ThreadPoolExecutor
    monkeypatch.setattr(reading, "LONG_RUN", bytes_ or reading.LONG_RUN)
    monkeypatch.setattr(reading, "ThreadPoolExecutor", lambda n: pools.append(n) or real(n))
    with StoredFile(path) as file:
        file.columns()["x"].run(0, stop)
    assert pools == threads * [4]


@pytest.mark.parametrize(
    ("key", "short", "looked_up"),
    [
        ((1,), 64, 0),
        ((slice(None), 1), 64, 1),
        ((slice(0, 3, 2),), 3, 0),
        ((slice(0, 3, 2),), 4, 0),
        ((slice(0, 3, 2),), 5, 1),
    ],
)
def test_only_cells_of_several_short_runs_are_looked_up_one_by_one(path, monkeypatch, key, short, looked_up):
    finished(path)
    asked, real = [], reading.Numbers.cells
    monkeypatch.setattr(reading, "SHORT_RUN", short)
    monkeypatch.setattr(reading.Numbers, "cells", lambda *args: asked.append(1) or real(*args))
    with StoredFile(path) as file:
        assert file.columns()["status"][key].size
    assert len(asked) == looked_up


def test_of_a_block_a_part_of_which_is_read_the_rest_is_kept(path, monkeypatch):
    finished(path)
    with StoredFile(path) as file:
        column, asked, real = file.columns()["x"], [], reading.Table.read
        monkeypatch.setattr(reading.Table, "read", lambda *args: asked.append(args[3]) or real(*args))
        for cell in (1, 2, 3, 5, 6, 1):
            assert column.run(cell, cell + 1).tolist() == [[2 * cell + 1, 2 * cell + 2]]
        assert asked == [0, 1, 0]


@pytest.mark.parametrize("cell", range(12))
def test_a_part_of_any_block_may_be_read_first(path, cell):
    finished(path)
    with StoredFile(path) as file:
        assert file.columns()["status"].run(cell, cell + 1).tolist() == [cell + 1]
        assert file.columns()["status"].cells(np.array([cell])).tolist() == [cell + 1]


def test_what_is_missing_of_an_unfinished_result_is_nan_and_pending(path):
    layout = written(path, blocks=(0, 2))
    harm(path, layout.work.places[0].at(2))
    with StoredFile(path) as file:
        assert not file.finished
        assert file.done("cells").tolist() == [True, False, True]
        # a block is there as a whole or not at all
        assert [file.is_sound("cells", block) for block in range(3)] == [True, False, False]
        assert file.columns()["status"][...].ravel().tolist() == [1, 2, 3, 4, *8 * [Status.PENDING]]
        assert np.isnan(file.columns()["x"][...]).reshape(3, 8).all(axis=1).tolist() == [False, True, True]
    assert (missing("status"), missing("method_used")) == (Status.PENDING, -1)
    assert np.isnan([missing("x"), missing("error_bound")]).all()


def test_a_sound_block_is_looked_at_once(path, monkeypatch):
    written(path, blocks=(0,))
    with StoredFile(path) as file:
        asked, real = [], reading.Table.read
        monkeypatch.setattr(reading.Table, "read", lambda *args: asked.append(args[2:4]) or real(*args))
        assert [file.is_sound("cells", block) for block in (0, 0, 1, 1)] == [True, True, False, False]
        assert asked == [(0, 0), (1, 0)]


def test_a_block_one_of_whose_digests_is_missing_is_not_done(path):
    layout = written(path)
    content = bytearray(path.read_bytes())
    at = layout.work.digests + 32 + 16
    content[at : at + 16] = bytes(16)
    path.write_bytes(content)
    with StoredFile(path) as file:
        assert file.done("cells").tolist() == [True, False, True]
        assert not file.is_sound("cells", 1)


def test_damage_of_a_finished_result_is_told_with_the_cells_it_is_in(path):
    layout = finished(path)
    harm(path, layout.work.places[0].at(1))
    with StoredFile(path) as file:
        assert file.finished
        assert file.columns()["x"].run(0, 4).tolist() == whole(layout.work, layout.work.places[0])[:4].tolist()
        with pytest.raises(SweepError) as caught:
            file.columns()["x"].run(3, 5)
        assert str(caught.value) == (
            f"{path}: x is damaged between its cells 4 and 8; sweep verify tells of all damage, and sweep run "
            "--repair computes the damaged cells again"
        )
        assert list(damaged(file, "cells", range(3))) == [(1, 0)]
        assert list(damaged(file, "cells", (0, 2))) == []
        assert file.columns()["status"][1].tolist() == [5, 6, 7, 8]


def test_a_file_is_given_back_once_and_can_be_sent(path):
    finished(path)
    with StoredFile(path) as file:
        fd = file.fd
        column = pickle.loads(pickle.dumps(file.columns()["x"]))
    assert file.fd == -1
    with pytest.raises(OSError, match="Bad file"):
        os.fstat(fd)
    file.close()
    assert column[0, 1].tolist() == [3.0, 4.0]
    assert column.file.path == path
    column.file.close()


@pytest.mark.parametrize("blocks", [None, (0,)])
def test_of_a_file_that_is_closed_nothing_is_told_to_be_damaged_or_pending(path, blocks):
    if blocks is None:
        finished(path)
    else:
        written(path, blocks=blocks)
    with StoredFile(path) as file:
        column = file.columns()["x"]
    with pytest.raises(SweepError) as caught:
        column[0]
    assert str(caught.value) == f"{path}: is closed; open it again to read x"


def test_what_was_never_open_is_not_closed(tmp_path, monkeypatch):
    closed = []
    gc.collect()  # what other tests have left
    monkeypatch.setattr(os, "close", closed.append)
    with pytest.raises(FileNotFoundError):
        StoredFile(tmp_path / "none")
    gc.collect()
    assert closed == []


def test_what_is_no_result_is_closed_and_refused(path, monkeypatch):
    path.write_bytes(b"nothing" * 100)
    closed, real = [], os.close
    monkeypatch.setattr(os, "close", lambda fd: closed.append(fd) or real(fd))
    with pytest.raises(ValueError, match="it is no result, or was changed"):
        StoredFile(path)
    assert len(closed) == 1


def test_rows_and_cells_of_a_summary_are_apart(path):
    made = frame(4, rows=rows_cut())
    layout = written(path, made, name="rows")
    with StoredFile(path) as file:
        assert (file.done("rows").tolist(), file.done("cells").tolist()) == ([True] * 3, [False] * 3)
        assert list(file.columns("rows")) == ["n", "y"]
        assert file.columns("rows")["n"][1:3].tolist() == [[4, 5, 6], [7, 8, 9]]
        assert len(list(damaged(file, "cells", range(3)))) == 6
        assert list(damaged(file, "rows", range(3))) == []
        assert file.digest("rows", 2, 1) != file.digest("rows", 2, 0)
        assert file.digest("cells", 0, 0) == bytes(16)
    fd = os.open(path, os.O_RDWR)
    fill(fd, layout.tables["cells"])
    os.close(fd)
    with StoredFile(path) as file:
        assert list(file.columns()) == [column.name for column in SCHEMA.columns]
        assert file.done("cells").all()
