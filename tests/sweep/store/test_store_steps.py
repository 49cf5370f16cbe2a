"""Each step of a store by itself, on a result made by hand: what is asked of the disk, in which order, and when."""

import errno
import os
import threading
from dataclasses import replace

import numpy as np
import pytest
from handmade import TEXTS, fill, frame, harm, numbers, rows_cut, whole, written

from sweep.store import store as storing
from sweep.store.ending import end
from sweep.store.layout import Place, read_layout
from sweep.store.reading import StoredFile
from sweep.store.store import Shared, Store, lock_of, opened, unfinished_of
from sweep.system import disk
from sweep.system.errors import SweepError


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture
def store(output):
    with opened(output) as found:
        found.begin(frame())
        yield found


def put(store, *blocks):
    for block in blocks:
        store.put(block, numbers(store.table, block))


@pytest.fixture
def left_open(monkeypatch):
    """Descriptors that were not given back."""
    found, opening, closing = set(), disk.open_file, os.close
    monkeypatch.setattr(disk, "open_file", lambda *args: (fd := opening(*args), found.add(fd))[0])
    monkeypatch.setattr(os, "close", lambda fd: (closing(fd), found.discard(fd))[0])
    return found


@pytest.fixture
def events(monkeypatch):
    """The calls that change the disk."""
    seen = []
    for name in ("sync_numbers", "fsync", "rename", "sync_folder", "remove"):
        real = getattr(disk, name)
        monkeypatch.setattr(disk, name, lambda *args, name=name, real=real: (seen.append(name), real(*args))[1])
    real = storing.write_digests
    write = lambda fd, table, digests: (seen.append(sorted(digests)), real(fd, table, digests))[1]  # noqa: E731
    monkeypatch.setattr(storing, "write_digests", write)
    return seen


def test_names_of_what_lies_beside_an_output(output):
    assert unfinished_of(output).name == "out.h5.unfinished"
    assert lock_of(output).name == "out.h5.lock"
    assert Store(output).temporary.name == "out.h5.unfinished.tmp"


def test_nothing_is_computed_before_a_store_has_begun(output):
    made = Store(output)
    with pytest.raises(AssertionError, match="the sweep has not begun"):
        made.table  # noqa: B018
    assert (made.layout, made.count, made.missing(), made.found()) == (None, 0, [], None)


def test_numbers_are_synced_before_their_digests_and_these_with_the_next(store, events, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 1e9)
    put(store, 2, 0)
    assert (events, store.count, store.missing()) == ([], 0, [0, 1, 2])
    store.commit()
    assert events == ["sync_numbers", [0, 2], "sync_numbers"]
    assert (store.count, store.missing()) == (2, [1])
    store.commit()
    # nothing waits
    assert events[3:] == ["sync_numbers"]


@pytest.mark.parametrize(("limit", "done"), [(136, 2), (100, 2), (137, 0), (68, 2)])
def test_blocks_are_acknowledged_after_so_many_bytes(store, monkeypatch, limit, done):
    """A block holds 68 bytes, and what is acknowledged counts no more."""
    monkeypatch.setattr(storing, "SYNC_SECONDS", 1e9)
    monkeypatch.setattr(storing, "SYNC_BYTES", limit)
    put(store, 0, 1)
    assert store.count == done


def test_bytes_that_are_on_the_disk_make_no_more_haste(store, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 1e9)
    monkeypatch.setattr(storing, "SYNC_BYTES", 136)
    counts = []
    for block in (0, 1, 2):
        put(store, block)
        counts.append(store.count)
    assert counts == [0, 2, 2]


@pytest.mark.parametrize(("ago", "done"), [(0.25, 1), (0.5, 1), (0.125, 0)])
def test_blocks_are_acknowledged_after_a_time(store, monkeypatch, ago, done):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 0.25)
    store._synced = 100.0
    monkeypatch.setattr(storing.time, "monotonic", lambda: 100.0 + ago)
    put(store, 1)
    assert store.count == done
    assert store._synced == 100.0 + ago * done
    store.tick()
    assert store.count == done


def test_while_one_thread_acknowledges_another_does_not_wait(store, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 0.0)
    with store._committing:
        put(store, 0)
        assert store.count == 0
    store.tick()
    assert store.count == 1
    assert not store._committing.locked()


def test_a_turn_is_given_back_where_the_disk_refuses(store, monkeypatch):
    def full(fd):
        raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(disk, "sync_numbers", full)
    monkeypatch.setattr(storing, "SYNC_SECONDS", 0.0)
    text = f"{store.path}: the disk is full; free some space, then run the same command again to continue"
    for _ in range(2):
        with pytest.raises(SweepError) as caught:
            put(store, 0)
        assert str(caught.value) == text
        assert not store._committing.locked()
    assert store.count == 0


def test_digests_of_another_process_are_taken_if_they_are_of_all_columns(store, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 1e9)
    for length in (0, 31, 33):
        with pytest.raises(SweepError) as caught:
            store.take(1, bytes(length))
        assert str(caught.value) == f"{store.path}: a worker has written something else than it was asked for"
    store.take(1, b"x" * 32)
    assert store.count == 0
    monkeypatch.setattr(storing, "SYNC_SECONDS", 0.0)
    store.take(2, b"y" * 32)
    assert store.missing() == [0]


def test_a_structure_that_cannot_be_written_leaves_nothing(output, monkeypatch):
    def refused(*args):
        raise OSError(errno.EIO, "no")

    for name in ("fsync", "rename", "sync_folder"):
        with monkeypatch.context() as patch, opened(output) as store:
            patch.setattr(disk, name, refused)
            with pytest.raises(SweepError, match=r"out\.h5\.unfinished: cannot be written \(Input/output error\)"):
                store.begin(frame())
            assert not store.temporary.exists()
            assert store.layout is None


def test_what_is_left_of_a_structure_is_removed_at_the_start(output):
    left = Store(output).temporary
    left.write_bytes(b"half of it")
    with opened(output):
        assert not left.exists()


@pytest.mark.parametrize("at", [100, -1])
def test_a_structure_that_is_damaged_is_refused_and_a_whole_one_taken_up(output, at):
    layout = written(unfinished_of(output))
    assert Store(output).found() == layout
    content = bytearray(unfinished_of(output).read_bytes())
    content[at] ^= 1
    unfinished_of(output).write_bytes(content)
    with pytest.raises(SweepError) as caught:
        Store(output).found()
    assert str(caught.value) == (
        f"{unfinished_of(output)}: damaged beside its numbers, or not of this version; remove it, or give it up "
        "with --force"
    )


@pytest.mark.parametrize("fault", [OSError(errno.EIO, "no"), EOFError()])
def test_a_structure_that_cannot_be_read_is_refused(output, monkeypatch, fault):
    written(unfinished_of(output))

    def refused(fd):
        raise fault

    monkeypatch.setattr(storing, "unbroken", refused)
    with pytest.raises(SweepError, match="damaged beside its numbers, or not of this version"):
        Store(output).found()


def test_descriptors_are_given_back(output, left_open):
    written(unfinished_of(output))
    with opened(output) as store:
        store.resume(store.found())
        store.damaged()
    Store(output).found()
    assert not left_open
    store.close()


def test_what_was_acknowledged_is_taken_up_and_what_is_damaged_undone(output):
    layout = written(unfinished_of(output), blocks=(0, 2))
    harm(unfinished_of(output), layout.work.places[1].at(2))
    with opened(output) as store:
        store.resume(store.found())
        assert (store.count, store.missing()) == (2, [1])
        assert store.damaged() == [2]
        assert (store.count, store.missing()) == (1, [1, 2])
        assert store.damaged() == []
    with StoredFile(unfinished_of(output)) as file:
        assert file.done("cells").tolist() == [True, False, False]


@pytest.mark.parametrize("number", [0, 1])
def test_a_block_that_lacks_a_digest_of_a_column_is_not_done(output, number):
    layout = written(unfinished_of(output))
    with unfinished_of(output).open("r+b") as file:
        os.pwrite(file.fileno(), bytes(16), layout.work.digests + 32 + 16 * number)
    with opened(output) as store:
        store.resume(store.found())
        assert store.missing() == [1]


def test_all_blocks_are_damaged_where_the_file_cannot_be_read(output, monkeypatch):
    written(unfinished_of(output), blocks=(0, 2))
    with opened(output) as store:
        layout = store.found()

        def refused(path):
            raise OSError

        monkeypatch.setattr(storing, "StoredFile", refused)
        store.resume(layout)
        assert store.damaged() == [0, 2]


def test_digests_that_cannot_be_read_are_told(output, monkeypatch):
    layout = written(unfinished_of(output))

    def refused(*args):
        raise EOFError("the file ends early")

    with opened(output) as store:
        monkeypatch.setattr(storing.Table, "read_digests", refused)
        with pytest.raises(SweepError) as caught:
            store.resume(layout)
        assert str(caught.value) == f"{store.path}: cannot be read (the file ends early)"


def test_a_store_that_is_closed_looks_at_no_more_blocks(output, monkeypatch):
    written(unfinished_of(output))
    asked, go = [], threading.Event()
    with opened(output) as store:

        def looked_at(file, name, blocks):
            for block in blocks:
                asked.append((name, block))
                go.set()
                store._closing.wait(10)
            return iter(())

        monkeypatch.setattr(storing, "damaged", looked_at)
        store.resume(store.found())
        go.wait(10)
    assert asked == [("cells", 0)]


def test_what_waits_is_acknowledged_when_a_store_is_closed(output, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 1e9)
    with opened(output) as store:
        store.begin(frame())
        put(store, 1)
    assert store._fd == -1
    with StoredFile(unfinished_of(output)) as file:
        assert file.done("cells").tolist() == [False, True, False]


def test_a_result_ends_with_a_sync_before_it_has_its_name(store, output, events):
    put(store, 0, 1, 2)
    store.commit()
    events.clear()
    assert store.finish(TEXTS, None) == []
    assert events == ["sync_numbers", [], "fsync", "rename", "sync_folder", "fsync"]
    assert output.exists()
    assert not store.path.exists()
    with StoredFile(output) as file:
        assert file.finished


def test_a_result_that_does_not_read_back_is_not_put_in_its_place(store, output):
    put(store, 0, 1, 2)
    store.commit()
    harm(store.path, store.table.places[0].at(1))
    with pytest.raises(SweepError) as caught:
        store.finish(TEXTS, None)
    assert str(caught.value) == (
        f"{output}: differs when read back from what was written; the disk may be failing"
    )  # fmt: skip
    assert not output.exists()


def test_a_result_with_damaged_blocks_is_not_ended(output):
    layout = written(unfinished_of(output))
    harm(unfinished_of(output), layout.work.places[0].at(1))
    with opened(output) as store:
        store.resume(store.found())
        assert store.finish(TEXTS, None) == [1]
        assert store.missing() == [1]
        assert not output.exists()
        put(store, 1)
        assert store.finish(TEXTS, None) == []
    assert output.exists()


def test_damaged_rows_of_a_summary_are_undone_and_it_ends_when_they_are_there(output):
    def gather(file, block):
        return numbers(file.layout.tables["cells"], block)

    with opened(output) as store:
        store.begin(frame(4, rows=rows_cut()))
        put(store, 0, 1, 2)
        store.commit()
        harm(store.path, store.table.places[0].at(1))
        assert store.finish(TEXTS, gather) == [1]
        assert store.missing() == [1]
        put(store, 1)
        assert store.finish(TEXTS, gather) == []
    with StoredFile(output) as file:
        place = file.layout.tables["cells"].places[0]
        np.testing.assert_array_equal(file.columns()["x"].run(0, 12), whole(file.layout.tables["cells"], place))


def test_a_finished_result_is_taken_up_without_its_damaged_blocks(output, events):
    layout = written(output)
    with output.open("r+b") as file:
        end(file.fileno(), layout, TEXTS)
    with opened(output) as store:
        events.clear()
        store.reopen([1])
        assert events[:3] == ["rename", "sync_folder", "fsync"]
        assert (store.missing(), store.damaged()) == ([1], [])
        with StoredFile(store.path) as file:
            assert not file.finished
        put(store, 1)
        assert store.finish(TEXTS, None) == []
    with StoredFile(output) as file:
        assert file.finished


@pytest.mark.parametrize(("steps", "shared"), [((4096, 8192), True), ((4096, 8194), False), ((2, 8192), False)])
def test_only_blocks_that_begin_on_pages_are_written_by_others(store, steps, shared):
    places = tuple(Place(name, "i1", (), 4, ((0, 4096, step),)) for name, step in zip("xy", steps, strict=True))
    table = replace(store.table, places=places)
    store.layout = replace(store.layout, tables={"cells": table})
    assert store.shared() == (Shared(str(store.path), store.layout.key, table) if shared else None)


def test_another_process_finds_the_same_file_by_its_key(store, tmp_path, left_open):
    shared = Shared(str(store.path), store.layout.key, store.table)
    fd = shared.opened()
    assert read_layout(fd, os.fstat(fd).st_size) == store.layout
    fill(fd, store.table, [1])
    os.close(fd)
    assert Shared(str(store.path), "0" * 32, store.table).opened() is None
    assert Shared(str(tmp_path / "none"), store.layout.key, store.table).opened() is None
    (tmp_path / "short").write_bytes(b"x")
    assert Shared(str(tmp_path / "short"), store.layout.key, store.table).opened() is None
    assert not left_open


def test_a_file_that_cannot_be_read_is_not_the_same(store, monkeypatch):
    def early(*args):
        raise EOFError

    monkeypatch.setattr(storing, "read_layout", early)
    assert Shared(str(store.path), store.layout.key, store.table).opened() is None


def test_a_store_that_is_discarded_is_gone(store):
    store.discard()
    assert not store.path.exists()
    assert store.found() is None


def test_a_second_run_is_told_what_it_can_do(output):
    with opened(output), pytest.raises(SweepError) as caught, opened(output):
        pass
    assert str(caught.value) == (
        f"{output}: another run is at work on this output; wait for it, or choose another with -o"
    )  # fmt: skip
