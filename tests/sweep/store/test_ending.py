"""The end of a result: what is written then, what is read back of it, and the groups of a summary."""

import os
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from handmade import MARK, SCHEMA, TEXTS, cut, fill, frame, harm, numbers, rows_cut, whole, written

from sweep.cells.partition import Partition
from sweep.store import ending
from sweep.store.ending import end, gathered, reads_back
from sweep.store.frame import UNKNOWN, Frame
from sweep.store.layout import Table
from sweep.store.reading import StoredFile, has_ended


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.h5"


def ended(path, layout, texts=TEXTS):
    fd = os.open(path, os.O_RDWR)
    end(fd, layout, texts)
    found = has_ended(fd, layout)
    os.close(fd)
    return found


def test_texts_of_the_end_are_filled_up_or_cut_to_their_length_and_can_be_taken_back(path):
    layout = written(path)
    assert ended(path, layout, {"created": "a", "end": "b" * 30, "cells_per_second": "1.5"})
    content = path.read_bytes()
    texts = [b"a".ljust(25), b"b" * 25, b"1.5".ljust(12)]
    assert [content[a:b] for a, b in layout.endings] == [*texts, layout.ending_digest(texts)]
    with h5py.File(path) as file:
        assert file.attrs["end"] == "b" * 25
    assert not ended(path, layout, None)
    content = path.read_bytes()
    assert [content[a:b] for a, b in layout.endings] == [*UNKNOWN.values(), bytes(16)]


def test_a_result_that_has_not_ended_does_not_read_back(path):
    layout = written(path)
    assert not reads_back(path)
    assert ended(path, layout)
    assert reads_back(path)


@pytest.mark.parametrize("block", [0, 1, 2])
@pytest.mark.parametrize("number", [0, 1])
def test_damage_in_a_block_that_is_read_back_is_seen(path, block, number):
    layout = written(path)
    assert ended(path, layout)
    harm(path, layout.work.places[number].at(block))
    assert not reads_back(path)


@pytest.mark.parametrize(("count", "seen"), [(1, [0]), (2, [0, 1]), (3, [0, 1, 2]), (6, [0, 2, 5]), (12, [0, 5, 11])])
def test_the_first_the_last_and_the_middle_block_are_read_back(path, monkeypatch, count, seen):
    layout = written(path, frame(12 // count) if count > 3 else frame({1: 12, 2: 8, 3: 4}[count]))
    assert ended(path, layout)
    found = []
    monkeypatch.setattr(ending, "_is_same", lambda file, block: found.append(block) or True)
    assert reads_back(path)
    assert sorted(found) == seen
    monkeypatch.setattr(ending, "_is_same", lambda file, block: block != seen[-1])
    assert not reads_back(path)


def test_what_is_no_result_does_not_read_back_but_a_refusal_is_told(path):
    path.write_bytes(b"nothing")
    assert not reads_back(path)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        reads_back(path)


@pytest.mark.parametrize("grid", [(6, 4), (24,), (2, 3, 4)])
@pytest.mark.parametrize("change", [-1.0, 1.0])
def test_numbers_that_hdf5_finds_are_compared_over_the_box_of_the_block(path, grid, change):
    x, y = np.arange(24.0), np.arange(24)
    with h5py.File(path, "w") as file:
        file["x"], file["y"] = x.reshape(grid), y.reshape(grid)
    given = {"x": x.copy(), "y": y}
    columns = {name: SimpleNamespace(run=lambda a, b, c=c: c[a:b]) for name, c in given.items()}
    table = Table(grid, Partition(24, 4), (), 0, b"")
    file = SimpleNamespace(path=path, layout=SimpleNamespace(tables={"cells": table}), columns=lambda: columns)
    assert [ending._is_same(file, block) for block in range(6)] == [True] * 6
    for cell in (8, 9, 10, 11):
        given["x"][cell] += change
        assert [ending._is_same(file, block) for block in range(6)] == [True, True, False, True, True, True]
        given["x"][cell] -= change


def summary(path, blocks=None):
    """Five rows in blocks of two, of which the cells in blocks of four are to be made."""
    made = Frame(SCHEMA, {"rows": rows_cut(), "cells": cut()}, MARK, "now")
    return written(path, made, blocks, "rows")


def gather(file, block):
    """Of each group its numbers, and in its status the sum of rows."""
    made = numbers(file.layout.tables["cells"], block)
    made["status"][:] = file.columns("rows")["y"].run(0, 5).sum()
    return made


def test_groups_are_made_of_rows_and_their_digests_written_behind_a_sync(path, monkeypatch):
    layout, events = summary(path), []
    fd = os.open(path, os.O_RDWR)
    for name, module in (("sync_numbers", ending.disk), ("write_digests", ending)):
        real = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, name=name, real=real: (events.append(name), real(*a))[1])
    assert gathered(path, fd, layout, gather) == []
    os.close(fd)
    assert events == ["sync_numbers", "write_digests"]
    with StoredFile(path) as file:
        table = layout.tables["cells"]
        assert file.done("cells").tolist() == [True] * 3
        columns = file.columns()
        np.testing.assert_array_equal(columns["x"].run(0, 12), whole(table, table.places[0]))
        assert columns["status"].run(0, 12).tolist() == [15] * 12


def test_damaged_rows_are_told_once_and_no_group_is_made(path):
    layout = summary(path)
    for number in (0, 1):
        harm(path, layout.work.places[number].at(2))
    harm(path, layout.work.places[1].at(0))
    fd = os.open(path, os.O_RDWR)
    assert gathered(path, fd, layout, gather) == [0, 2]
    with StoredFile(path) as file:
        assert not file.done("cells").any()
    fill(fd, layout.work)
    assert gathered(path, fd, layout, gather) == []
    os.close(fd)
