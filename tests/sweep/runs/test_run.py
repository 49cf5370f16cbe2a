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
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from running import (
    environment,
    fail_on,
    interrupted,
    names,
    quiet,
    same,
    slow_run,
    stone,
    tall,
    told_by,
    wait_for,
)

from kernels.interface import Status
from sweep.cells.fingerprint import fingerprint
from sweep.cells.output_schema import output_schema
from sweep.cells.solve import Solver
from sweep.results.open import open_result
from sweep.results.verify import verify
from sweep.runs.run import run
from sweep.store.manifest import MANIFEST
from sweep.store.store import Store, folder_of
from sweep.study.read import build_study
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


def test_parts_left_over_beside_a_complete_output_are_removed(output, monkeypatch):
    with monkeypatch.context() as patch:
        fail_on(patch, "remove", 2, errno.EIO)
        with pytest.raises(SweepError, match="Input/output"):
            quiet(stone(), output)
    assert folder_of(output).exists()
    monkeypatch.setattr(Solver, "solve", None)
    quiet(stone(), output)
    assert list(output.parent.iterdir()) == [output]


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


def test_finished_blocks_survive_a_fault_and_are_not_computed_again(unfinished, monkeypatch):
    before = names(unfinished)
    assert before
    starts = []
    real = Solver.solve
    monkeypatch.setattr(
        Solver, "solve", lambda self, start, stop, *rest: starts.append((start, stop)) or real(self, start, stop, *rest)
    )
    found = quiet(tall(23), unfinished)
    computed = {pair for pair in starts if pair[1] - pair[0] == 5}
    assert not computed & {tuple(int(n) for n in name.split(".")[0].split("-")) for name in before}
    same(found, quiet(tall(23)))


def test_a_run_that_is_continued_keeps_its_blocks(unfinished, monkeypatch):
    seen = []
    monkeypatch.setattr("sweep.runs.run.assemble", lambda store, *rest: seen.append(store.blocks.cells) or [])
    with pytest.raises(SweepError, match="no such file"):
        quiet(tall(23), unfinished, block_cells=7, workers=4)
    assert seen == [5]


def test_the_parts_of_another_study_are_kept_unless_forced(unfinished):
    before = names(unfinished)
    with pytest.raises(SweepError, match=r"unfinished parts of another study(.|\n)*axes\.height: was 23 values"):
        quiet(tall(24), unfinished)
    assert names(unfinished) == before
    same(quiet(tall(24), unfinished, force=True), quiet(tall(24)))


def test_parts_of_another_study_beside_a_complete_output_are_left_alone(output):
    quiet(tall(3), output).close()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sweep.runs.run.assemble", lambda *rest: pytest.fail("far enough"))
        with pytest.raises(pytest.fail.Exception):
            quiet(tall(4), output, force=True)
    before = names(output)
    assert before
    same(quiet(tall(3), output), quiet(tall(3)))
    assert names(output) == before
    same(quiet(tall(4), output, force=True), quiet(tall(4)))


@pytest.mark.parametrize("text", ["?", None])
def test_a_damaged_or_lost_spec_is_written_anew_for_its_own_study_alone(unfinished, text, monkeypatch):
    manifest, before = folder_of(unfinished) / MANIFEST, names(unfinished)
    manifest.unlink() if text is None else manifest.write_text(text)
    with pytest.raises(SweepError, match="damaged" if text else "finished blocks, but no spec"):
        quiet(tall(24), unfinished)
    assert names(unfinished) == before != []
    put, log = [], io.StringIO()
    real = Store.put
    monkeypatch.setattr(Store, "put", lambda self, index, arrays: put.append(index) or real(self, index, arrays))
    same(quiet(tall(23), unfinished, progress=log), quiet(tall(23)))
    assert len(put) == 5 - len(before)
    assert "spec.json was lost or damaged; it is written anew" in log.getvalue()


def test_a_damaged_spec_without_parts_of_this_study_is_given_up_when_forced(unfinished):
    (folder_of(unfinished) / MANIFEST).write_text("?")
    same(quiet(tall(24), unfinished, force=True), quiet(tall(24)))


@pytest.mark.parametrize("own", [True, False])
def test_a_part_of_another_study_is_found_and_computed_again(unfinished, own):
    """The same cells, the same columns, a sound digest: but of a stone thrown from elsewhere."""
    other = unfinished.with_name("other.h5")
    interrupted(stone(axes={"height": np.arange(101.0, 124)}, outputs=["fall_time"], along={}), other)
    first, strange = names(unfinished)[0], folder_of(other) / names(other)[0]
    shutil.copy(strange, folder_of(unfinished))
    if not own:
        (folder_of(unfinished) / first).unlink()
    assert f"damaged: {strange.name}" in verify(unfinished).findings
    same(quiet(tall(23), unfinished), quiet(tall(23)))


@pytest.mark.parametrize("harm", ["flip", "cut", "empty", "text"])
def test_a_damaged_part_is_told_set_aside_and_computed_again(unfinished, harm, monkeypatch):
    monkeypatch.setattr("sweep.system.progress.QUIET_SECONDS", 0.0)
    path = folder_of(unfinished) / names(unfinished)[0]
    whole = path.read_bytes()
    with h5py.File(path) as file:
        place = file["fall_time"].id.get_offset() + 3
    harmed = {"flip": whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :], "cut": whole[:-1], "empty": b""}
    path.write_bytes(harmed.get(harm, b"x" * len(whole)))
    log = io.StringIO()
    same(quiet(tall(23), unfinished, progress=log), quiet(tall(23)))
    assert harm == "empty" or "cells 0 to 5 were damaged" in log.getvalue()
    assert "23/23 cells (100 %)" in log.getvalue().splitlines()[-1]


def test_a_disk_that_damages_everything_is_given_up(output, monkeypatch):
    real = disk.write

    def bad(fd, piece):
        return real(fd, bytes(b ^ 1 for b in piece) if len(piece) == 23 * 8 else piece)

    monkeypatch.setattr(disk, "write", bad)
    with pytest.raises(SweepError, match="disk is failing"):
        quiet(tall(23), output, block_cells=23)
    assert not output.exists()


def test_the_output_is_on_the_disk_before_it_has_its_name(output, monkeypatch):
    events = []
    for name in ("pwrite", "fsync", "rename"):
        real = getattr(disk, name)
        monkeypatch.setattr(disk, name, lambda *args, name=name, real=real: (events.append(name), real(*args))[1])
    quiet(tall(23), output, block_cells=5).close()
    last = len(events) - events[::-1].index("pwrite")
    assert events[last:] == ["fsync", "rename", "fsync"]


@pytest.mark.parametrize("back", [0, 1, 2, 3, 4, 5])
def test_a_disk_that_is_full_at_the_very_end_is_noticed(tmp_path, back):
    with pytest.MonkeyPatch.context() as patch:
        calls = fail_on(patch, "pwrite", -1, errno.ENOSPC)
        quiet(tall(23), tmp_path / "first.h5", block_cells=30).close()
    with pytest.MonkeyPatch.context() as patch:
        fail_on(patch, "pwrite", len(calls) - back, errno.ENOSPC)
        with pytest.raises(SweepError, match="disk is full"):
            quiet(tall(23), tmp_path / "out.h5", block_cells=30)
    assert not (tmp_path / "out.h5").exists()


def test_writes_of_the_output_that_take_only_a_part_are_carried_on(output, monkeypatch):
    real = disk.pwrite
    monkeypatch.setattr(disk, "pwrite", lambda fd, piece, at: real(fd, piece[:97], at))
    same(quiet(tall(50), output, block_cells=20), quiet(tall(50)))


@pytest.mark.parametrize("block", [0, 1, 2])
def test_an_assembled_file_that_reads_back_wrong_is_refused(output, monkeypatch, block):
    real, first = disk.pwrite, quiet(tall(3003)).fall_time.values[1001 * block].tobytes()

    def misplaced(fd, piece, at):
        return real(fd, piece, at + 8 * (len(piece) == 1001 * 8 and bytes(piece[:8]) == first))

    monkeypatch.setattr(disk, "pwrite", misplaced)
    with pytest.raises(SweepError, match="differs when read back"):
        quiet(tall(3003), output, block_cells=1001, workers=1)
    assert not output.exists()
    monkeypatch.undo()
    same(quiet(tall(3003), output), quiet(tall(3003)))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("name", ["open_file", "write", "pwrite", "fsync", "rename", "make_folder"])
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
            assert ("disk is full" if number == errno.ENOSPC else "cannot be written") in told
            assert "\n" not in told
        kept = set(names(output)) if folder_of(output).exists() else set()
        if output.exists():
            same(open_result(output), whole)
        found = quiet(study, output)
        assert not list(folder_of(output).glob("*"))
        same(found, whole)
        assert kept <= {name for name in kept if int(name.split("-")[0]) % 10 == 0}
    assert turn > 1


def test_a_file_too_large_for_hdf5_itself_is_one_clear_line(output):
    """The limit on a file's size stands in for a full disk that HDF5, not this program, runs into."""
    code = f"""
        import resource
        from pathlib import Path
        import numpy as np
        import toy
        from sweep.system.errors import SweepError
        from sweep.runs.run import run
        from sweep.study.read import build_study
        study = build_study(allow_import=True, kernel="toy:KERNEL", axes=dict(height=np.arange(1.0, 20001)),
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
        wait_for(lambda: len(names(output)) >= 1, process)
        time.sleep(random.random() * 0.1)
        process.kill()
        process.wait()
        process.stderr.close()
    before = names(output)
    assert before
    log = io.StringIO()
    found = quiet(tall(400, "slow:SLOW"), output, workers=4 - workers, progress=log)
    same(found, quiet(tall(400, "slow:SLOW")))
    assert list(output.parent.iterdir()) == [output]


def test_ctrl_c_ends_within_a_block_keeps_what_is_finished_and_says_how_to_go_on(output):
    with slow_run(output, 2, 10) as process:
        wait_for(lambda: len(names(output)) >= 2, process)
        process.send_signal(signal.SIGINT)
        begun = time.monotonic()
        _, told = process.communicate(timeout=30)
    assert time.monotonic() - begun < 5
    assert process.returncode == -signal.SIGINT
    assert "run the same command again to continue" in told
    assert "KeyboardInterrupt" in told
    assert len(names(output)) >= 2
    same(quiet(tall(400, "slow:SLOW"), output), quiet(tall(400, "slow:SLOW")))


def test_a_second_run_on_the_same_output_is_told_so_and_leaves(output):
    with slow_run(output, 2, 10) as process:
        wait_for(lambda: folder_of(output).exists() and names(output), process)
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
    fail_on(monkeypatch, "make_folder", 1, errno.EACCES)
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


def needed(cells, left):
    """Bytes of the output of `tall` and of parts to come.

    Axis, g, v0; fall time, error bound, status and method of every cell; what both say in words.
    """
    study = tall(cells)
    words = output_schema(study, fingerprint(study)).attrs.values()
    return 8 * (cells + 2) + 14 * cells + 14 * left + 2 * sum(len(str(text).encode()) for text in words)


def test_space_for_the_output_without_its_parts_is_too_little(output, monkeypatch):
    free(monkeypatch, output, needed(2000, 2000) - 1)
    with pytest.raises(SweepError, match="are free here"):
        quiet(tall(2000), output)
    assert list(output.parent.iterdir()) == []
    free(monkeypatch, output, needed(2000, 2000))
    quiet(tall(2000), output).close()


def test_parts_that_are_there_need_no_more_space(unfinished, monkeypatch):
    left = 23 - 5 * len(names(unfinished))
    assert 0 < left < 23
    free(monkeypatch, unfinished, needed(23, left) - 1)
    with pytest.raises(SweepError, match="are free here"):
        quiet(tall(23), unfinished)
    free(monkeypatch, unfinished, needed(23, left))
    quiet(tall(23), unfinished).close()


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


def test_room_for_the_text_of_the_study_is_needed_too(output, monkeypatch):
    """In the result and, while it is computed, in spec.json beside it."""
    import dataclasses
    import shutil

    study = dataclasses.replace(stone(), text="# " + "long " * 20_000)
    usage = shutil.disk_usage(output.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=2 * len(study.text)))
    with pytest.raises(SweepError, match="are free here"):
        quiet(study, output)


def test_a_study_may_be_a_mapping_of_its_keys():
    keys = {"kernel": "foliot", "outputs": ["period"], "axes": {"mu": [1.0, 2.0]}, "fixed": {"a": 1.0, "phi0": 1.0}}
    same(quiet(keys), quiet(build_study(**keys)))
    with pytest.raises(SweepError, match="1 mistake\n  allow_import  no such key"):
        quiet(keys | {"allow_import": True})
    with pytest.raises(SweepError, match="runs code of your own"):
        quiet(keys | {"kernel": "toy:KERNEL"})
    with pytest.raises(SweepError, match=r'expected a study, found "s\.toml"; read a file with sweep\.read_study'):
        quiet("s.toml")


@pytest.mark.parametrize("place", ["out.h5", "out.h5.parts"])
def test_a_pipe_where_a_result_or_its_parts_should_be_is_told_at_once(output, place):
    os.mkfifo(output.with_name(place))
    for action in (lambda path: quiet(tall(3), path), verify, open_result):
        with pytest.raises(SweepError, match=r"^[^\n]*$"):
            action(output)


def test_pipes_among_the_parts_are_told_and_set_aside(unfinished):
    first = folder_of(unfinished) / names(unfinished)[0]
    first.unlink()
    os.mkfifo(first)
    assert f"damaged: {first.name}" in verify(unfinished).findings
    with open_result(unfinished) as found:
        assert found.status[0] == Status.PENDING
    same(quiet(tall(23), unfinished), quiet(tall(23)))


def test_a_file_of_somebody_elses_in_the_folder_of_the_parts_is_left_there(tmp_path):
    output = tmp_path / "out.h5"
    folder_of(output).mkdir()
    note = folder_of(output) / "notes.txt"
    note.write_text("mine")
    quiet(stone(axes={"height": [1.0, 2.0]}), output).close()
    assert note.read_text() == "mine"
    assert sorted(p.name for p in folder_of(output).iterdir() if p.name != "lock") == ["notes.txt"]


def test_nothing_is_solved_where_only_the_output_has_to_be_put_together(tmp_path, monkeypatch):
    study, output = stone(axes={"height": [1.0, 2.0, 3.0]}), tmp_path / "out.h5"
    with monkeypatch.context() as patch:
        patch.setattr("sweep.runs.run.assemble", lambda *a, **k: (_ for _ in ()).throw(SweepError("stopped here")))
        with pytest.raises(SweepError, match="stopped here"):
            quiet(study, output, block_cells=1)
    monkeypatch.setattr("sweep.cells.solve.Solver.solve", None)
    assert quiet(study, output).fall_time.shape == (3,)
