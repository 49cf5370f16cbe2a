"""One run: same bits however it is cut, continued, extended and repaired; what stands at its place is never lost."""

import errno
import gc
import io
import os
import shutil
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import bad
import h5py
import numpy as np
import pytest
import slow
import toy_studies
from running import environment, flip, interrupted, kept, place, quiet, same, slow_run, stone, tall, wait_for

import sweep
from kernels.interface import Status
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.store import unfinished_of


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture
def unfinished(output):
    """An output of 23 cells of which a few blocks of five are kept."""
    interrupted(tall(23), output)
    assert kept(output)
    return output


# the numbers


def test_cells_that_are_cheap_beside_a_call_are_solved_by_few_calls():
    """The best of three runs: on a busy machine a call may seem to take longer."""

    def calls():
        slow.calls.clear()
        ds = quiet(stone(kernel="slow:CALLED", axes={"height": np.linspace(1.0, 9.0, 32_000)}), workers=1)
        assert (ds.status == Status.OK).all()
        return [*slow.calls]

    fewest = min((calls() for _ in range(3)), key=len)
    assert len(fewest) < 40
    assert max(fewest) > 1000


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        *(({"workers": number}, "workers") for number in (0, -1, True, 1.5)),
        *(({"block_cells": number}, "block_cells") for number in (0, 10**400)),
        *(({name: "no"}, name) for name in ("force", "extend", "repair", "isolate", "retry_failed")),
        ({"extend": np.array([True, False])}, "extend"),
        *(({"progress": stream}, "progress") for stream in ("yes", 3, [])),
        ({"until": "07:00"}, "path"),
        ({"extend": True, "retry_failed": True}, "retry_failed"),
        ({"workers": 2, "cluster": "tcp://127.0.0.1:1"}, "cluster"),
        ({"worker": 2}, "workers"),
        ({"path": "nowhere/out.h5"}, "nowhere"),
        *(({"path": name}, "export") for name in ("out.csv", "out.png")),
        ({"path": "out.h5.unfinished"}, "unfinished"),
        ({"path": "a" * 300}, "cannot be written"),
        ({"path": "/", "force": True}, "is a folder"),
        ({"path": Path(__file__).parent, "force": True}, "is a folder"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(keys, word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SweepError, match=word) as told:
        sweep.run(**{"study": stone(), "progress": False, **keys})
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


# what stands there


@pytest.mark.parametrize("finished", [True, False])
def test_the_output_of_another_study_is_kept_unless_forced(unfinished, finished):
    if finished:
        quiet(tall(23), unfinished).close()
    path = unfinished if finished else unfinished_of(unfinished)
    before = path.read_bytes()
    with pytest.raises(SweepError, match=r"(another study|unfinished)(.|\n)*axes\.height"):
        quiet(tall(24), unfinished)
    assert path.read_bytes() == before
    same(quiet(tall(24), unfinished, force=True), quiet(tall(24)))


@pytest.mark.parametrize("content", [b"", b"words", b"\x89HDF\r\n\x1a\n" + bytes(100), None])
@pytest.mark.parametrize("force", [False, True])
def test_a_foreign_file_is_never_overwritten(output, content, force):
    if content is None:
        with h5py.File(output, "w") as file:
            file["precious"] = 1.0
    else:
        output.write_bytes(content)
    before = output.read_bytes()
    with pytest.raises(SweepError, match="not the result"):
        quiet(stone(), output, force=force)
    assert output.read_bytes() == before


@pytest.mark.parametrize("change", [None, 3.0, "words"])
@pytest.mark.parametrize("force", [False, True])
def test_a_result_whose_fingerprint_was_changed_is_told_and_kept(output, change, force):
    """None: it was removed. Other programs still read the numbers."""
    quiet(tall(3), output).close()
    with h5py.File(output, "r+") as file:
        del file.attrs["fingerprint"]
        if change is not None:
            file.attrs["fingerprint"] = change
    before = output.read_bytes()
    with pytest.raises(SweepError, match="damaged"):
        quiet(tall(3), output, force=force)
    assert output.read_bytes() == before


@pytest.mark.parametrize("name", ["out.h5", "out.h5.unfinished"])
def test_a_pipe_where_a_result_should_be_is_told_at_once(output, name):
    os.mkfifo(output.with_name(name))
    for action in (lambda path: quiet(tall(3), path), sweep.verify, sweep.open_result):
        with pytest.raises(SweepError, match=r"^[^\n]*$"):
            action(output)


def test_the_output_may_be_a_link_to_another_folder(tmp_path):
    (tmp_path / "far").mkdir()
    link = tmp_path / "out.h5"
    link.symlink_to(tmp_path / "far" / "real.h5")
    quiet(stone(), link)
    assert link.is_symlink()
    assert (tmp_path / "far" / "real.h5").is_file()


# continued


def test_what_is_left_over_beside_a_complete_output_is_removed_if_it_is_of_its_study(unfinished):
    left = unfinished_of(unfinished)
    content = left.read_bytes()
    quiet(tall(23), unfinished).close()
    for name in (left.name, f".{left.name}.tmp", "out.h5.lock"):  # and of runs that were killed as they began
        left.with_name(name).write_bytes(content)
    quiet(tall(23), unfinished).close()
    assert list(left.parent.iterdir()) == [unfinished]
    quiet(tall(4), unfinished, force=True).close()
    left.write_bytes(content)
    quiet(tall(4), unfinished).close()
    assert left.read_bytes() == content


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="what is open is looked up in /proc")
def test_what_is_given_up_is_closed_so_that_its_room_on_the_disk_is_free(unfinished, monkeypatch):
    def room(folder, ask=shutil.disk_usage):
        left = str(unfinished_of(unfinished))
        assert not [fd for fd in Path("/proc/self/fd").iterdir() if os.path.realpath(fd).startswith(left)]
        return ask(folder)

    monkeypatch.setattr(shutil, "disk_usage", room)
    gc.disable()
    try:
        quiet(tall(24), unfinished, force=True).close()
    finally:
        gc.enable()


@pytest.mark.parametrize("harm", ["cut", "empty", "words", "attribute"])
def test_a_damaged_structure_is_told_and_given_up_when_forced(unfinished, harm):
    path = unfinished_of(unfinished)
    whole = path.read_bytes()
    if harm == "attribute":
        flip(path, whole.index(b"toy:KERNEL"))
    else:
        path.write_bytes({"cut": whole[:-1], "empty": b"", "words": b"?"}[harm])
    harmed = path.read_bytes()
    with pytest.raises(SweepError, match=r"damaged.*--force"):
        quiet(tall(23), unfinished)
    assert path.read_bytes() == harmed
    same(quiet(tall(23), unfinished, force=True), quiet(tall(23)))


def test_a_damaged_block_is_told_and_computed_again(unfinished):
    flip(unfinished_of(unfinished), place(unfinished_of(unfinished), "fall_time", 0, "cells") + 3)
    log = io.StringIO()
    same(quiet(tall(23), unfinished, progress=log), quiet(tall(23)))
    assert "cells 0 to 5 were damaged" in log.getvalue()


def test_a_killed_run_continues_and_ends_with_the_same_bits(output, monkeypatch):
    with slow_run(output, 2, 7) as process:
        wait_for(lambda: len(kept(output)) >= 2, process)
        process.kill()
        process.communicate()
    assert len(kept(output)) >= 2
    monkeypatch.setattr(slow, "CELL_SECONDS", 0.0)
    same(quiet(tall(400, "slow:SLOW"), output, workers=1), quiet(tall(400, "slow:SLOW")))
    assert list(output.parent.iterdir()) == [output]


def test_a_second_run_on_the_same_output_is_told_so_and_leaves(output):
    with slow_run(output, 2, 10) as process:
        wait_for(lambda: kept(output), process)
        with pytest.raises(SweepError, match="another run"):
            quiet(tall(400, "slow:SLOW"), output)
        process.communicate(timeout=60)
        assert process.returncode == 0


# extended


def test_an_extension_computes_new_cells_alone(output, monkeypatch):
    """From the second run on the kernel raises at the old ones, and no cell FAILED."""
    heights = np.arange(101.0, 131.0)

    def study(some):
        return toy_studies.build(kernel="bad:RAISING", axes={"height": heights[some], "v0": np.arange(5.0)})

    few, more, log = study(slice(0, None, 2)), study(slice(None)), io.StringIO()
    whole = quiet(more)
    quiet(few, output).close()

    def at_old_cells(height, kinds):
        if np.isin(height, heights[::2]).any():
            raise ZeroDivisionError

    monkeypatch.setattr(bad, "misbehave", at_old_cells)
    with quiet(more, output, extend=True, block_cells=7, workers=1, progress=log) as found:
        same(found, whole)
    assert "FAILED" not in log.getvalue()


HEIGHTS, SPEEDS = np.round(np.linspace(-1.0, 9.0, 21), 3), np.array([0.0, 0.5, 3.0, np.nan, 1e4])


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ({"height": HEIGHTS[1:]}, r"axes\.height"),
        ({"height": np.append(HEIGHTS[::-1], 20.0)}, "order"),
        ({"height": np.append(HEIGHTS[:-1], np.nextafter(9.0, 10))}, "digit"),
        ({"v0": np.append(np.where(SPEEDS == 0, -0.0, SPEEDS), 2e4)}, r"axes\.v0"),
        ({"fixed": {"g": 1.6}}, "fixed"),
        ({"outputs": ["impact_speed"]}, "cannot be extended"),
        ({"summary": {}}, "summary"),
    ],
)
def test_what_cannot_be_extended_is_told_and_kept(output, keys, word):
    axes = {"height": HEIGHTS, "v0": SPEEDS}
    quiet(toy_studies.build(axes=axes), output).close()
    before = output.read_bytes()
    other = {name: keys[name] for name in keys if name not in axes}
    more = {"height": np.append(HEIGHTS, 20.0), "v0": SPEEDS} if other else {**axes, **keys}
    with pytest.raises(SweepError, match=word):
        quiet(toy_studies.build(axes=more, **other), output, extend=True)
    assert output.read_bytes() == before
    assert list(output.parent.iterdir()) == [output]


def test_a_summary_a_zip_and_a_damaged_result_are_not_extended(tmp_path):
    kinds = {"summary": {"summary": {}}, "design": {"design": "zip"}, "whole": {}}
    for word, keys in kinds.items():
        output = tmp_path / f"{word}.h5"
        few, more = (toy_studies.build(axes={"height": np.arange(1.0, n)}, **keys) for n in (4, 5))
        quiet(few, output).close()
        if word == "whole":
            flip(output, place(output, "fall_time", 1))
        with pytest.raises(SweepError, match=word):
            quiet(more, output, extend=True)
        if word == "summary":
            with pytest.raises(SweepError, match="summary"):
                quiet(few, output, retry_failed=True)


# the disk


def test_numbers_that_do_not_reach_the_disk_are_never_acknowledged(output, monkeypatch):
    """The first sync fails, but only when all other blocks have been computed meanwhile."""
    study, real, calls = tall(20, "bad:SLOW"), disk.sync_numbers, []

    def sync(fd):
        calls.append(fd)
        if len(calls) == 1:
            time.sleep(1.5)
            raise OSError(errno.EIO, "failed")
        real(fd)

    with monkeypatch.context() as patch:
        patch.setattr(disk, "sync_numbers", sync)
        with pytest.raises(SweepError, match="cannot be written"):
            quiet(study, output, block_cells=10, workers=1)
    assert not output.exists()
    same(quiet(study, output), quiet(study))
    assert sweep.verify(output).whole


def test_a_file_that_reads_back_wrong_is_refused(output, monkeypatch):
    real, first = disk.write, quiet(tall(3003)).fall_time.values[1001].tobytes()

    def misplaced(fd, pieces, at):
        return real(fd, pieces, at + 8 * (len(pieces[0]) == 1001 * 8 and bytes(pieces[0][:8]) == first))

    with monkeypatch.context() as patch:
        patch.setattr(disk, "write", misplaced)
        with pytest.raises(SweepError, match="read back"):
            quiet(tall(3003), output, block_cells=1001, workers=1)
    assert not output.exists()
    same(quiet(tall(3003), output, force=True), quiet(tall(3003)))


def test_a_structure_that_cannot_be_read_is_damaged(output, monkeypatch):
    """As where the disk fails below what HDF5 has no need to read; the digest of the structure is over all of it."""
    quiet(tall(3), output).close()
    real = disk.read_all

    def failing(fd, buffers, at):
        if at == 0:
            raise OSError(errno.EIO, "failed")
        real(fd, buffers, at)

    monkeypatch.setattr(disk, "read_all", failing)
    found = sweep.verify(output)
    assert not found.whole
    assert "structure" in found.findings[0]
    with pytest.raises(SweepError, match="structure"):
        quiet(tall(3), output)


def test_ctrl_c_while_the_lock_is_given_back_does_not_keep_it(output, monkeypatch):
    def interrupted_once(path, real=disk.remove):
        if path.suffix == ".lock":
            monkeypatch.setattr(disk, "remove", real)
            raise KeyboardInterrupt
        real(path)

    monkeypatch.setattr(disk, "remove", interrupted_once)
    with pytest.raises(KeyboardInterrupt):
        quiet(tall(3), output)
    same(quiet(tall(4), output, force=True), quiet(tall(4)))


def test_a_file_too_large_for_the_system_is_one_clear_line(output):
    """The limit on a file's size stands in for a full disk that HDF5, not this program, runs into."""
    code = f"""
        import resource
        import numpy as np
        import sweep
        keys = dict(allow_import=True, kernel="toy:KERNEL", axes=dict(height=np.arange(1.0, 20001)),
                    outputs=["fall_time"])
        for limit in (20_000, 60_000, 168_000, 230_000, 330_000):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, -1))
            try:
                sweep.run(path={str(output)!r}, block_cells=1000, progress=False, **keys)
            except sweep.SweepError as fault:
                assert "cannot be written" in str(fault) and "\\n" not in str(fault), str(fault)
            else:
                raise SystemExit(f"{{limit}} bytes were enough")
        resource.setrlimit(resource.RLIMIT_FSIZE, (-1, -1))
        sweep.run(path={str(output)!r}, progress=False, **keys)
    """
    words = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(words, env=environment(), capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert sweep.verify(output).whole


def test_no_more_threads_compute_than_there_are_workers(tmp_path):
    """Cells that sleep for a twentieth of a second take their time, however fast the machine is."""
    begun = time.monotonic()
    quiet(tall(40, "bad:SLOW"), tmp_path / "out.h5", workers=2, block_cells=2).close()
    assert time.monotonic() - begun >= 40 * 0.05 / 2
