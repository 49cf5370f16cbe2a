import errno
import io
import os
import random
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import time

import h5py
import numpy as np
import pytest
import slow
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from running import (
    environment,
    fail_on,
    flip,
    interrupted,
    kept,
    place,
    quiet,
    same,
    slow_run,
    stone,
    tall,
    told_by,
    wait_for,
)

import sweep
from kernels.interface import Status
from sweep.cells.solve import Solver
from sweep.results.open import open_result
from sweep.results.verify import verify
from sweep.runs.run import run
from sweep.store import reading
from sweep.store.reading import StoredFile
from sweep.store.store import Store, unfinished_of
from sweep.system import disk
from sweep.system.errors import SweepError


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture(scope="module")
def undisturbed():
    return run(stone(), progress=False)


def test_numbers_are_those_of_the_formula(undisturbed):
    cell = undisturbed.sel(height=2.0, v0=3.0)
    # the larger root of 2 = 3 t + 9.80665 t^2 / 2
    assert cell.fall_time.item() == pytest.approx((-3 + 48.2266**0.5) / 9.80665, rel=1e-14)
    assert undisturbed.status.sel(height=-1.0).values.tolist() == [Status.BAD_INPUT] * 5
    assert np.isnan(undisturbed.fall_time.sel(height=-1.0)).all()


@settings(max_examples=40)
@given(cells=st.integers(1, 40), workers=st.integers(1, 4), stored=st.booleans())
def test_the_same_bits_for_any_block_shape_and_thread_count(tmp_path_factory, undisturbed, cells, workers, stored):
    path = tmp_path_factory.mktemp("run") / "out.h5" if stored else None
    same(quiet(stone(), path, workers=workers, block_cells=cells), undisturbed)


def test_a_zip_of_axes_is_stored_along_cells(output):
    study = stone(design="zip", axes={"height": [1.0, 2.0, 3.0], "method": ["auto", "exact", "rough"]})
    found = quiet(study, output, block_cells=2)
    same(found, quiet(study))
    assert found.fall_time.dims == ("cell",)
    assert found.method.values.tolist() == ["auto", "exact", "rough"]
    assert found.sizes == {"cell": 3, "phase": 3}


def test_what_is_in_memory_and_what_is_in_the_file_is_the_same_dataset(output, undisturbed):
    found = quiet(stone(), output).load()
    times = {"created", "start", "end", "cells_per_second"}
    assert found.attrs.keys() == undisturbed.attrs.keys()
    assert {k: v for k, v in found.attrs.items() if k not in times} == {
        k: v for k, v in undisturbed.attrs.items() if k not in times
    }
    xr.testing.assert_identical(found.drop_attrs(deep=False), undisturbed.drop_attrs(deep=False))


def test_nothing_but_the_output_is_left(output):
    quiet(stone(), output, block_cells=3)
    assert list(output.parent.iterdir()) == [output]


def test_a_complete_output_is_left_alone(output, monkeypatch):
    quiet(stone(), output)
    before = output.stat()
    monkeypatch.setattr(Solver, "solve", None)
    quiet(stone(), output)
    assert output.stat() == before


def test_a_complete_output_is_computed_anew_when_forced(output):
    quiet(stone(), output).close()
    before = output.stat()
    quiet(stone(), output, force=True)
    assert output.stat().st_ino != before.st_ino


def test_what_is_left_over_beside_a_complete_output_is_removed(unfinished, tmp_path, monkeypatch):
    left = unfinished_of(unfinished).read_bytes()
    quiet(tall(23), unfinished).close()
    unfinished_of(unfinished).write_bytes(left)
    monkeypatch.setattr(Solver, "solve", None)
    quiet(tall(23), unfinished)
    assert list(tmp_path.iterdir()) == [unfinished]


def test_the_output_of_another_study_is_kept_unless_forced(output):
    quiet(tall(3), output).close()
    with pytest.raises(SweepError, match=r"another study(.|\n)*axes\.height: was 3 values"):
        quiet(tall(4), output)
    assert open_result(output).sizes["height"] == 3
    assert quiet(tall(4), output, force=True).sizes["height"] == 4


@pytest.fixture
def unfinished(output):
    """An output whose cells 10 and on are missing."""
    interrupted(tall(23), output)
    assert not output.exists()
    return output


def test_finished_blocks_survive_a_fault_and_are_not_computed_again(unfinished):
    before = kept(unfinished)
    assert before
    found, put = putting(tall(23), unfinished)
    assert sorted(put) == sorted({0, 1, 2, 3, 4} - set(before))
    same(found, quiet(tall(23)))


def test_a_run_that_is_continued_keeps_its_blocks(unfinished, monkeypatch):
    seen, real = [], Store.finish
    monkeypatch.setattr(Store, "finish", lambda self, *rest: seen.append(self.table.blocks.cells) or real(self, *rest))
    quiet(tall(23), unfinished, block_cells=7, workers=4).close()
    assert seen == [5]


def test_the_unfinished_result_of_another_study_is_kept_unless_forced(unfinished):
    before = unfinished_of(unfinished).read_bytes()
    told = r"unfinished result of another study(.|\n)*axes\.height: was 23 values"
    with pytest.raises(SweepError, match=told):
        quiet(tall(24), unfinished)
    assert unfinished_of(unfinished).read_bytes() == before
    same(quiet(tall(24), unfinished, force=True), quiet(tall(24)))


def test_an_unfinished_result_of_another_study_beside_a_complete_output_is_left_alone(output):
    quiet(tall(3), output).close()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "finish", lambda *rest: pytest.fail("far enough"))
        with pytest.raises(pytest.fail.Exception):
            quiet(tall(4), output, force=True)
    before = kept(output)
    assert before
    same(quiet(tall(3), output), quiet(tall(3)))
    assert kept(output) == before
    same(quiet(tall(4), output, force=True), quiet(tall(4)))


@pytest.mark.parametrize("harm", ["cut", "empty", "words", "attribute"])
def test_a_damaged_structure_is_told_and_given_up_when_forced(unfinished, harm):
    path = unfinished_of(unfinished)
    whole = path.read_bytes()
    if harm == "attribute":
        flip(path, whole.index(b"slow" if b"slow:" in whole else b"toy:KERNEL"))
    else:
        path.write_bytes({"cut": whole[:-1], "empty": b"", "words": b"?"}[harm])
    harmed = path.read_bytes()
    with pytest.raises(SweepError, match="damaged beside its numbers"):
        quiet(tall(23), unfinished)
    assert path.read_bytes() == harmed
    same(quiet(tall(23), unfinished, force=True), quiet(tall(23)))


def test_the_bytes_of_another_study_are_found_and_computed_again(unfinished):
    """The same cells, the same columns, sound digests: but of a stone thrown from elsewhere."""
    other = unfinished.with_name("other.h5")
    interrupted(stone(axes={"height": np.arange(101.0, 124)}, outputs=["fall_time"], along={}), other)
    with StoredFile(unfinished_of(unfinished)) as mine, StoredFile(unfinished_of(other)) as strange:
        table, theirs = mine.layout.work, strange.layout.work
        moves = [(p.at(0), q.at(0), table.stored(p, 0)) for p, q in zip(table.places, theirs.places, strict=True)]
        moves.append((table.digests, theirs.digests, table.row_bytes))
    content = unfinished_of(other).read_bytes()
    for at, source, length in moves:
        patch_file(unfinished_of(unfinished), at, content[source : source + length])
    assert "fall_time: damaged between its cells 0 and 5" in verify(unfinished).findings
    same(quiet(tall(23), unfinished), quiet(tall(23)))


def patch_file(path, at, content):
    with path.open("r+b") as file:
        file.seek(at)
        file.write(content)


@pytest.mark.parametrize("harm", ["flip", "zeros", "text"])
def test_a_damaged_block_is_told_and_computed_again(unfinished, harm, monkeypatch):
    monkeypatch.setattr("sweep.system.progress.QUIET_SECONDS", 0.0)
    path = unfinished_of(unfinished)
    at = place(path, "fall_time", 0)
    flip(path, at + 3) if harm == "flip" else patch_file(path, at, (b"x" if harm == "text" else b"\0") * 40)
    log = io.StringIO()
    same(quiet(tall(23), unfinished, progress=log), quiet(tall(23)))
    assert "cells 0 to 5 were damaged" in log.getvalue()
    assert "23/23 cells (100 %)" in log.getvalue().splitlines()[-1]


def test_a_disk_that_damages_everything_is_given_up(output, monkeypatch):
    interrupted(tall(23), output)
    real = reading.damaged
    monkeypatch.setattr("sweep.store.store.damaged", lambda file, name, blocks: real(file, name, blocks) or [(0, 0)])
    monkeypatch.setattr(Store, "damaged", lambda self: self.undo([0]) or [0])
    with pytest.raises(SweepError, match="disk is failing"):
        quiet(tall(23), output)
    assert not output.exists()


def test_the_output_is_on_the_disk_before_it_has_its_name(output, monkeypatch):
    events = []
    for name in ("write", "fsync", "rename"):
        real = getattr(disk, name)
        monkeypatch.setattr(disk, name, lambda *args, name=name, real=real: (events.append(name), real(*args))[1])
    quiet(tall(23), output, block_cells=5).close()
    last = len(events) - events[::-1].index("write")
    assert events[last:] == ["fsync", "rename", "fsync"]


def test_numbers_are_on_the_disk_before_their_digests_are_written(output, monkeypatch):
    """Whatever other threads write meanwhile."""
    written, synced, wrong, tables = {}, set(), [], []
    real, sync, begin = disk.write, disk.sync_numbers, Store.begin

    def begun(self, frame):
        begin(self, frame)
        tables.append(self.table)

    def write(fd, pieces, at):
        table = tables[0] if tables else None
        if table and table.digests <= at < table.digests + 5 * table.row_bytes:
            first = (at - table.digests) // table.row_bytes
            blocks = range(first, first + len(pieces[0]) // table.row_bytes)
            wrong.extend(place.at(b) for b in blocks for place in table.places if place.at(b) not in synced)
            written["digests"] = written.get("digests", 0) + len(blocks)
        done = real(fd, pieces, at)
        written[at] = True
        return done

    def synced_now(fd):
        before = set(written)
        sync(fd)
        synced.update(before)

    monkeypatch.setattr(disk, "write", write)
    monkeypatch.setattr(disk, "sync_numbers", synced_now)
    monkeypatch.setattr(Store, "begin", begun)
    monkeypatch.setattr("sweep.store.store.SYNC_BYTES", 1)
    quiet(tall(23), output, block_cells=5, workers=2).close()
    assert written["digests"] == 5
    assert wrong == []


@pytest.mark.parametrize("back", range(6))
def test_a_disk_that_fails_at_the_very_end_is_noticed(tmp_path, back):
    with pytest.MonkeyPatch.context() as patch:
        calls = fail_on(patch, "write", -1, errno.ENOSPC)
        quiet(tall(23), tmp_path / "first.h5", block_cells=30).close()
    with pytest.MonkeyPatch.context() as patch:
        fail_on(patch, "write", len(calls) - back, errno.ENOSPC)
        with pytest.raises(SweepError, match="disk is full"):
            quiet(tall(23), tmp_path / "out.h5", block_cells=30)
    assert not (tmp_path / "out.h5").exists()
    same(quiet(tall(23), tmp_path / "out.h5"), quiet(tall(23)))


def test_writes_that_take_only_a_part_are_carried_on(output, monkeypatch):
    real = disk.write
    monkeypatch.setattr(disk, "write", lambda fd, pieces, at: real(fd, [pieces[0][:97]], at))
    same(quiet(tall(50), output, block_cells=20), quiet(tall(50)))
    assert verify(output).whole


@pytest.mark.parametrize("block", [0, 1, 2])
def test_a_file_that_reads_back_wrong_is_refused(output, monkeypatch, block):
    real, first = disk.write, quiet(tall(3003)).fall_time.values[1001 * block].tobytes()

    def misplaced(fd, pieces, at):
        return real(fd, pieces, at + 8 * (len(pieces[0]) == 1001 * 8 and bytes(pieces[0][:8]) == first))

    monkeypatch.setattr(disk, "write", misplaced)
    with pytest.raises(SweepError, match="differs when read back"):
        quiet(tall(3003), output, block_cells=1001, workers=1)
    assert not output.exists()
    monkeypatch.undo()
    # what it was written over may be the structure
    same(quiet(tall(3003), output, force=True), quiet(tall(3003)))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("name", ["open_file", "write", "fsync", "sync_numbers", "reserve", "rename"])
def test_whichever_call_fails_nothing_acknowledged_is_lost(tmp_path, name, number):
    study = tall(23)
    whole = quiet(study)
    turn, failed = 0, True
    while failed:
        turn += 1 if turn < 12 else 7
        output = tmp_path / f"out{turn}.h5"
        with pytest.MonkeyPatch.context() as patch:
            calls = fail_on(patch, name, turn, number)
            told = told_by(lambda output=output: quiet(study, output, block_cells=10, workers=1).close())
            failed = len(calls) >= turn
        if told:
            assert ("disk is full" if number == errno.ENOSPC else "cannot be written") in told or "be read" in told
            assert "\n" not in told
        before = set(kept(output))
        if output.exists():
            same(open_result(output), whole)
        found, put = putting(study, output)
        assert not before & set(put)
        assert [path for path in tmp_path.iterdir() if path.name.startswith(output.name)] == [output]
        same(found, whole)
    assert turn > 1


def putting(study, output):
    """The result of a run, and the blocks that it wrote."""
    put, real = [], Store.put
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "put", lambda self, index, arrays: put.append(index) or real(self, index, arrays))
        return quiet(study, output), put


def test_a_file_too_large_for_hdf5_itself_is_one_clear_line(output):
    """The limit on a file's size stands in for a full disk that HDF5, not this program, runs into."""
    code = f"""
        import resource
        from pathlib import Path
        import numpy as np
        import toy
        from sweep.system.errors import SweepError
        from sweep.runs.run import run
        import sweep
        study = sweep.study(allow_import=True, kernel="toy:KERNEL", axes=dict(height=np.arange(1.0, 20001)),
                            outputs=["fall_time"])
        for limit in (20_000, 60_000, 168_000, 230_000, 330_000, 345_000):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, -1))
            try:
                run(study, {str(output)!r}, block_cells=1000, progress=False)
            except SweepError as fault:
                assert "cannot be written" in str(fault) and "\\n" not in str(fault), str(fault)
                assert not Path({str(output)!r}).exists()
            else:
                raise SystemExit(f"{{limit}} bytes were enough")
        resource.setrlimit(resource.RLIMIT_FSIZE, (-1, -1))
        run(study, {str(output)!r}, progress=False)
    """
    done = python(code)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    same(open_result(output), quiet(stone(axes={"height": np.arange(1.0, 20001)}, outputs=["fall_time"], along={})))


def python(code):
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], env=environment(), capture_output=True, text=True, timeout=120
    )


@pytest.mark.parametrize(("workers", "cells"), [(1, 7), (3, 20)])
def test_a_killed_run_continues_and_ends_with_the_same_bits(output, workers, cells):
    with slow_run(output, workers, cells) as process:
        wait_for(lambda: len(kept(output)) >= 1, process)
        time.sleep(random.random() * 0.1)
        process.kill()
        process.wait()
        process.stderr.close()
    before = kept(output)
    assert before
    log = io.StringIO()
    found = quiet(tall(400, "slow:SLOW"), output, workers=4 - workers, progress=log)
    same(found, quiet(tall(400, "slow:SLOW")))
    assert list(output.parent.iterdir()) == [output]


def test_ctrl_c_ends_within_a_block_keeps_what_is_finished_and_says_how_to_go_on(output):
    with slow_run(output, 2, 10) as process:
        wait_for(lambda: len(kept(output)) >= 2, process)
        process.send_signal(signal.SIGINT)
        begun = time.monotonic()
        _, told = process.communicate(timeout=30)
    assert time.monotonic() - begun < 5
    assert process.returncode == -signal.SIGINT
    assert "run the same command again to continue" in told
    assert "KeyboardInterrupt" in told
    assert len(kept(output)) >= 2
    same(quiet(tall(400, "slow:SLOW"), output), quiet(tall(400, "slow:SLOW")))


def test_a_second_run_on_the_same_output_is_told_so_and_leaves(output):
    with slow_run(output, 2, 10) as process:
        wait_for(lambda: kept(output), process)
        with pytest.raises(SweepError, match="another run is at work"):
            quiet(tall(400, "slow:SLOW"), output)
        assert process.wait(60) == 0
        process.stderr.close()
    same(open_result(output), quiet(tall(400, "slow:SLOW")))


def test_too_little_memory_is_one_line():
    with pytest.raises(SweepError, match="out of memory"):
        quiet(tall(1000, "slow:HUNGRY"), block_cells=1)


@pytest.mark.parametrize("content", [b"", b"words", b"\x89HDF\r\n\x1a\n" + bytes(100)])
@pytest.mark.parametrize("force", [False, True])
def test_a_foreign_file_is_never_overwritten(output, content, force):
    output.write_bytes(content)
    with pytest.raises(SweepError, match="not the result of a sweep"):
        quiet(stone(), output, force=force)
    assert output.read_bytes() == content


def test_an_hdf5_file_of_somebody_else_is_never_overwritten(output):
    with h5py.File(output, "w") as file:
        file["precious"] = 1.0
    with pytest.raises(SweepError, match="not the result of a sweep"):
        quiet(stone(), output, force=True)


@pytest.mark.parametrize("path", ["nowhere/out.h5", "file/out.h5", "."])
def test_an_output_that_cannot_be_is_one_clear_line(tmp_path, path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(Solver, "solve", None)
    with pytest.raises(SweepError) as told:
        quiet(stone(), tmp_path / path)
    assert "\n" not in str(told.value)


def test_a_folder_that_may_not_be_written_is_told_before_anything_is_computed(output, monkeypatch):
    monkeypatch.setattr(Solver, "solve", None)
    fail_on(monkeypatch, "open_file", 1, errno.EACCES)
    with pytest.raises(SweepError, match="Permission denied"):
        quiet(stone(), output)


@pytest.mark.parametrize(
    "keys", [{"workers": 0}, {"workers": -1}, {"workers": True}, {"block_cells": 0}, {"workers": 1.5}]
)
def test_nonsense_is_refused(keys):
    with pytest.raises(SweepError, match="expected a whole number"):
        quiet(stone(), **keys)


def test_no_more_threads_compute_than_there_are_workers(output, monkeypatch):
    inside, most, lock = [], [], threading.Lock()
    real = Solver.solve

    def counted(self, *rest):
        with lock:
            inside.append(self)
            most.append(len(inside))
        time.sleep(0.002)
        real(self, *rest)
        with lock:
            inside.remove(self)

    monkeypatch.setattr(Solver, "solve", counted)
    quiet(tall(60), output, workers=2, block_cells=2)
    assert max(most) == 2


def test_the_output_may_be_a_link_to_another_folder(tmp_path):
    (tmp_path / "far").mkdir()
    link = tmp_path / "out.h5"
    link.symlink_to(tmp_path / "far" / "real.h5")
    quiet(stone(), link)
    assert link.is_symlink()
    assert (tmp_path / "far" / "real.h5").is_file()


def test_a_disk_that_is_too_small_is_refused_at_once(output, monkeypatch):
    import shutil

    usage = shutil.disk_usage(output.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=10))
    with pytest.raises(SweepError, match="are free here"):
        quiet(stone(), output)
    assert list(output.parent.iterdir()) == []


def free(monkeypatch, output, count):
    """Lets so many bytes be free."""
    usage = shutil.disk_usage(output.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=count))


def test_a_run_that_is_continued_needs_no_more_space(unfinished, monkeypatch):
    free(monkeypatch, unfinished, 0)
    quiet(tall(23), unfinished).close()


def test_room_for_the_result_once_is_enough(output, monkeypatch):
    quiet(tall(2000), output).close()
    size = output.stat().st_size
    free(monkeypatch, output, size - 1)
    with pytest.raises(SweepError, match="are free here"):
        quiet(tall(2000), output.with_name("other.h5"))
    free(monkeypatch, output, size)
    quiet(tall(2000), output.with_name("other.h5")).close()


def test_the_output_and_its_name_are_brought_to_the_disk(output, monkeypatch):
    events, fsync, rename = [], os.fsync, disk.rename

    def record_rename(old, new):
        events.append(("rename", old.stat().st_ino))
        rename(old, new)

    monkeypatch.setattr(os, "fsync", lambda fd: (events.append(("fsync", os.fstat(fd).st_ino)), fsync(fd))[1])
    monkeypatch.setattr(disk, "rename", record_rename)
    quiet(tall(23), output, block_cells=5).close()
    result, folder = output.stat().st_ino, output.parent.stat().st_ino
    assert events[-3:] == [("fsync", result), ("rename", result), ("fsync", folder)]


def test_a_study_may_be_a_mapping_of_its_keys():
    keys = {"kernel": "foliot", "outputs": ["period"], "axes": {"mu": [1.0, 2.0]}, "fixed": {"a": 1.0, "phi0": 1.0}}
    same(quiet(keys), quiet(sweep.study(**keys)))
    with pytest.raises(SweepError, match="1 mistake\n  allow_import  no such key"):
        quiet(keys | {"allow_import": True})
    with pytest.raises(SweepError, match="runs code of your own"):
        quiet(keys | {"kernel": "toy:KERNEL"})
    with pytest.raises(SweepError, match="no such file"):
        quiet("s.toml")


@pytest.mark.parametrize("name", ["out.h5", "out.h5.unfinished"])
def test_a_pipe_where_a_result_should_be_is_told_at_once(output, name):
    os.mkfifo(output.with_name(name))
    for action in (lambda path: quiet(tall(3), path), verify, open_result):
        with pytest.raises(SweepError, match=r"^[^\n]*$"):
            action(output)


def test_parts_of_an_earlier_version_are_told_of_and_the_run_starts_anew(output):
    folder = output.with_name("out.h5.parts")
    folder.mkdir()
    log = io.StringIO()
    same(quiet(tall(23), output, progress=log), quiet(tall(23)))
    assert "this one cannot continue them and starts anew" in log.getvalue()
    assert folder.is_dir()


def test_nothing_is_solved_where_all_is_there_but_the_end(tmp_path, monkeypatch):
    study, output = stone(axes={"height": [1.0, 2.0, 3.0]}), tmp_path / "out.h5"
    with monkeypatch.context() as patch:
        patch.setattr(Store, "finish", lambda *a, **k: (_ for _ in ()).throw(SweepError("stopped here")))
        with pytest.raises(SweepError, match="stopped here"):
            quiet(study, output, block_cells=1)
    monkeypatch.setattr("sweep.cells.solve.Solver.solve", None)
    assert quiet(study, output).fall_time.shape == (3,)


@pytest.mark.parametrize("name", [None, "fall.h5"])
def test_cells_that_are_cheap_beside_a_call_are_solved_by_few_calls(tmp_path, name):
    slow.calls.clear()
    study = stone(kernel="slow:CALLED", axes={"height": np.linspace(1.0, 9.0, 32_000)})
    with quiet(study, name and tmp_path / name, workers=1) as ds:
        assert (ds.status == Status.OK).all()
    assert len(slow.calls) < 40
    assert max(slow.calls) > 1000
