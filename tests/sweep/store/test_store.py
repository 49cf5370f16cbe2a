"""Blocks in their places: what is acknowledged is there, whatever is lost of what was not brought to the disk."""

import contextlib
import itertools
import os
import random
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest
import toy_studies

from kernels.interface import Status
from sweep.cells.output_schema import output_schema
from sweep.cells.partition import boxes, row_blocks
from sweep.store import store as storing
from sweep.store.frame import Frame, cuts_of, expected_size
from sweep.store.reading import StoredFile
from sweep.store.store import opened, unfinished_of
from sweep.system import disk
from sweep.system.errors import SweepError

MARK = {"study": "abc"}
TEXTS = {"created": "2026-01-01T00:00:00+00:00", "end": "2026-01-01T00:00:00+00:00", "cells_per_second": "1.000000e+00"}
STUDY = {"axes": {"height": np.arange(1.0, 26)}, "outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5, 1.0]}}


def frame(cells=5, **keys):
    study = toy_studies.build(**{**STUDY, **keys})
    schema = output_schema(study, MARK)
    shape = schema.grid.shape if study.summary is None else (row_blocks(study).count,)
    return Frame(schema, cuts_of(study, schema, boxes(shape, cells)), MARK, "now")


@pytest.mark.parametrize("cells", [10, 1000, 50_000])
def test_the_size_of_a_result_is_known_before_its_structure_is(cells):
    study = toy_studies.build(axes={"height": np.linspace(1.0, 2.0, 200_000)}, outputs=["fall_time"])
    schema = output_schema(study, MARK)
    cuts = cuts_of(study, schema, boxes(schema.grid.shape, cells))
    assert Frame(schema, cuts, MARK, "now").layout.size == pytest.approx(expected_size(schema, cuts), rel=0.02)


@pytest.mark.parametrize(("shared", "worth"), [(False, 40_960), (True, 4096)])
@pytest.mark.parametrize("cells", [100, 600, 6000, 50_000])
def test_chunks_that_are_long_enough_begin_on_a_page_and_waste_a_tenth_at_most(cells, shared, worth):
    study = toy_studies.build(axes={"height": np.linspace(1.0, 2.0, 200_000)}, outputs=["fall_time"])
    schema = output_schema(study, MARK)
    cuts = cuts_of(study, schema, boxes(schema.grid.shape, cells))
    table = Frame(schema, cuts, MARK, "now", shared).layout.work
    for place in table.places:
        stored, at = place.chunk_bytes + 4, place.all_at(table.blocks.count)
        step = int(np.diff(at).max())
        assert step == stored if stored < worth else not (at % 4096).any()
        assert step <= max(1.1 * stored, stored + 4095 * shared)


@pytest.mark.parametrize("cells", [1, 7, 20_000])
def test_where_nothing_is_computed_hdf5_finds_pending_statuses_and_no_numbers(output, cells):
    made = frame(cells=cells, axes={"height": np.linspace(1.0, 2.0, 100_000 if cells > 7 else 500)})
    with opened(output) as store:
        store.begin(made)
    table = made.layout.work
    with h5py.File(unfinished_of(output)) as file:
        assert set(file["status"][...].ravel().tolist()) == {Status.PENDING}
        for block in {0, 1, 2, table.blocks.count // 2, table.blocks.count - 1}:
            start, _ = table.blocks.bounds(block)
            for place in table.places:
                where = file[place.name].id.get_chunk_info_by_coord((start, *(0 for _ in place.shape)))
                assert where.byte_offset == place.at(block)
                if place.name != "status":
                    with pytest.raises(OSError, match="filter"):
                        file[place.name][start]


def numbers(table, block):
    start, stop = table.blocks.bounds(block)
    rng = np.random.default_rng(block)
    return {p.name: rng.integers(1, 100, (stop - start, *p.shape)).astype(p.dtype) for p in table.places}


def fill(store, blocks=None):
    for block in store.missing() if blocks is None else blocks:
        store.put(block, numbers(store.table, block))
    store.commit()


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture
def filled(output):
    """An unfinished result, the last of whose five blocks is missing."""
    with opened(output) as store:
        store.begin(frame())
        fill(store, range(4))
    return unfinished_of(output)


def taken_up(store):
    store.resume(store.found())
    return store


def test_a_result_is_taken_up_where_it_was_left(output, filled):
    with opened(output) as store:
        assert taken_up(store).missing() == [4]
        assert store.damaged() == []
        fill(store)
        assert store.finish(TEXTS, None) == []
    assert list(output.parent.iterdir()) == [output]
    with StoredFile(output) as file:
        assert file.finished
        for block in range(5):
            expected = numbers(file.layout.work, block)
            for name, column in file.columns().items():
                np.testing.assert_array_equal(column.run(*file.layout.work.blocks.bounds(block)), expected[name])


def test_hdf5_reads_what_was_written(output, filled):
    with h5py.File(filled) as file, StoredFile(filled) as ours:
        for name, column in ours.columns().items():
            np.testing.assert_array_equal(file[name][5:20], column.run(5, 20))


def test_a_changed_byte_of_a_chunk_is_an_error_to_hdf5(filled):
    with StoredFile(filled) as file:
        table = file.layout.work
    for place in table.places:
        with harmed(filled, place.at(1) + 2), h5py.File(filled) as file, pytest.raises(OSError, match="filter"):
            file[place.name][5:10]


@contextlib.contextmanager
def harmed(path, at, bit=1):
    content = bytearray(path.read_bytes())
    content[at] ^= bit
    whole = path.read_bytes()
    path.write_bytes(content)
    yield
    path.write_bytes(whole)


def test_every_changed_byte_of_a_block_is_found_when_it_is_taken_up(output, filled):
    with StoredFile(filled) as file:
        table = file.layout.work
    spans = [(place.at(2), table.stored(place, 2)) for place in table.places]
    spans.append((table.digests + 2 * table.row_bytes, table.row_bytes))
    for at in [at + k for at, length in spans for k in range(0, length, 7)]:
        with harmed(filled, at), opened(output) as store:
            assert taken_up(store).damaged() == [2], at
            assert store.missing() == [2, 4]
            fill(store, [2])


def test_a_second_run_on_the_same_output_is_told_so(output):
    with opened(output), pytest.raises(SweepError, match="another run is at work"), opened(output):
        pass


def test_the_lock_of_a_killed_run_does_not_block(output, filled):
    code = f"""
        import time
        from pathlib import Path
        from sweep.store.store import opened
        with opened(Path({str(output)!r})):
            print("locked", flush=True)
            time.sleep(60)
    """
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    words = [sys.executable, "-c", textwrap.dedent(code)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, env=environment) as other, other.stdout:
        assert other.stdout.readline() == b"locked\n"
        with pytest.raises(SweepError, match="another run is at work"), opened(output):
            pass
        other.send_signal(signal.SIGKILL)
        other.wait()
        with opened(output) as store:
            assert taken_up(store).missing() == [4]


def test_a_lock_that_was_removed_meanwhile_is_no_lock(output, monkeypatch):
    """The run before this one ends, and removes its lock, just as this one takes it."""
    import fcntl

    real, turns = fcntl.flock, []

    def flock(fd, how):
        turns.append(fd)
        if len(turns) == 1:
            output.with_name("out.h5.lock").unlink()
        return real(fd, how)

    monkeypatch.setattr(fcntl, "flock", flock)
    with opened(output):
        assert output.with_name("out.h5.lock").exists()
        with pytest.raises(SweepError, match="another run is at work"), opened(output):
            pass


def test_nothing_is_left_of_a_store_that_was_not_begun(output):
    with opened(output):
        assert output.with_name("out.h5.lock").exists()
    assert list(output.parent.iterdir()) == []


def test_the_frame_is_on_the_disk_before_it_has_its_name(output, monkeypatch):
    events = []
    for name in ("reserve", "write", "fsync", "rename"):
        real = getattr(disk, name)
        monkeypatch.setattr(disk, name, lambda *args, name=name, real=real: (events.append(name), real(*args))[1])
    with opened(output) as store:
        store.begin(frame())
        assert [name for name, _ in itertools.groupby(events)] == ["reserve", "write", "fsync", "rename", "fsync"]
        assert unfinished_of(output).stat().st_size == store.layout.size


def test_a_block_is_acknowledged_only_when_it_is_on_the_disk(output, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_SECONDS", 1e9)
    with opened(output) as store:
        store.begin(frame())
        store.put(0, numbers(store.table, 0))
        assert store.count == 0
        store.commit()
        assert store.count == 1
        store.put(1, numbers(store.table, 1))
        monkeypatch.setattr(storing, "SYNC_SECONDS", 0.0)
        store.tick()
        assert store.count == 2


def test_many_threads_write_and_acknowledge(output, monkeypatch):
    monkeypatch.setattr(storing, "SYNC_BYTES", 1)
    with opened(output) as store:
        store.begin(frame(1))
        threads = [threading.Thread(target=lambda k=k: [store.put(b, numbers(store.table, b)) for b in range(k, 25, 5)])
                   for k in range(5)]  # fmt: skip
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        store.commit()
        assert store.missing() == []
        assert store.finish(TEXTS, None) == []


def test_what_is_left_of_many_blocks_is_known_at_once(output):
    with opened(output) as store:
        store.begin(frame(1, axes={"height": np.arange(1.0, 3001)}, outputs=["fall_time"], along={}))
        fill(store, range(0, 3000, 2))
    with opened(output) as store:
        assert taken_up(store).missing() == list(range(1, 3000, 2))
        assert store.damaged() == []


# What a power cut leaves: all that was brought to the disk, and of what came later any part, in pieces of 4096 bytes


class Recorder:
    """What was written to a file and when it was brought to the disk; and what was acknowledged by then."""

    def __init__(self, monkeypatch):
        self.events, self.lock = [], threading.Lock()
        write, sync, digests = disk.write, disk.sync_numbers, storing.write_digests

        def recorded(fd, pieces, at):
            done = write(fd, pieces, at)
            content = b"".join(map(bytes, pieces))[:done]
            with self.lock:
                self.events += [("write", at + k, content[k : k + 4096]) for k in range(0, done, 4096)]
            return done

        def synced(fd):
            with self.lock:
                before = len(self.events)
            sync(fd)
            with self.lock:
                self.events.append(("sync", before, None))

        def acknowledged(fd, table, rows):
            digests(fd, table, rows)
            with self.lock:
                self.events.append(("acknowledged", 0, list(rows)))

        monkeypatch.setattr(disk, "write", recorded)
        monkeypatch.setattr(disk, "sync_numbers", synced)
        monkeypatch.setattr(storing, "write_digests", acknowledged)

    def survives(self, stop, rng):
        """The writes that are on the disk after a power cut, and the blocks that must be."""
        durable = max((e[1] for e in self.events[:stop] if e[0] == "sync"), default=0)
        sure = [e for e in self.events[:durable] if e[0] == "write"]
        lucky = [e for e in self.events[durable:stop] if e[0] == "write" and rng.random() < 0.5]
        rng.shuffle(lucky)
        kept = {block for e in self.events[:durable] if e[0] == "acknowledged" for block in e[2]}
        return [*sure, *lucky], kept


@pytest.mark.parametrize("seed", range(4))
def test_after_a_power_cut_all_that_was_acknowledged_before_the_last_sync_is_there(output, monkeypatch, seed):
    rng = random.Random(seed)
    with opened(output) as store, pytest.MonkeyPatch.context() as patch:
        store.begin(frame(1))
        empty = unfinished_of(output).read_bytes()
        patch.setattr(storing, "SYNC_BYTES", 300)
        recorder = Recorder(patch)
        blocks = rng.sample(range(25), 25)
        threads = [threading.Thread(target=lambda some=some: [store.put(b, numbers(store.table, b)) for b in some])
                   for some in (blocks[:12], blocks[12:])]  # fmt: skip
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        store.commit()
    for stop in range(0, len(recorder.events) + 1, 3):
        writes, kept = recorder.survives(stop, rng)
        content = bytearray(empty)
        for _, at, piece in writes:
            content[at : at + len(piece)] = piece
        unfinished_of(output).write_bytes(content)
        with opened(output) as store:
            # no digest is there before its numbers
            assert taken_up(store).damaged() == []
            there = set(range(25)) - set(store.missing())
            assert kept <= there
            with StoredFile(unfinished_of(output)) as file:
                for block in there:
                    assert file.is_sound("cells", block)
                    expected = numbers(store.table, block)
                    for name, column in file.columns().items():
                        np.testing.assert_array_equal(column.run(block, block + 1), expected[name])


def test_digests_that_reached_the_disk_before_their_numbers_are_found_out(output, filled):
    """A disk that lies: the digests of a block are there, its numbers are not."""
    with opened(output) as store:
        table = taken_up(store).table
        store.damaged()
        content = bytearray(filled.read_bytes())
        for place in table.places:
            content[place.at(3) : place.at(3) + table.stored(place, 3)] = bytes(table.stored(place, 3))
    filled.write_bytes(content)
    with opened(output) as store:
        assert taken_up(store).damaged() == [3]
        assert store.missing() == [3, 4]


def test_a_block_half_of_whose_digests_are_there_is_not_done(output, filled):
    with StoredFile(filled) as file:
        table = file.layout.work
    content = bytearray(filled.read_bytes())
    at = table.digests + table.row_bytes
    content[at : at + 16] = bytes(16)
    filled.write_bytes(content)
    with opened(output) as store:
        assert taken_up(store).missing() == [1, 4]


def test_a_piece_of_an_earlier_block_is_read_after_one_of_a_later_block(filled):
    with StoredFile(filled) as file:
        column, table = file.columns()["fall_time"], file.layout.work
        for block in (3, 0, 2, 1, 0):
            assert column[5 * block + 1 : 5 * block + 3].tolist() == numbers(table, block)["fall_time"][1:3].tolist()
