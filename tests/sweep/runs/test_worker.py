"""A worker without a cluster: what it is told, what it computes, writes and sends, and what it refuses."""

import math
import os
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xxhash
from running import tall

pytest.importorskip("distributed")

from sweep.cells.block import Blocks
from sweep.cells.fingerprint import fingerprint
from sweep.cells.guard import BadCell
from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.runs import worker
from sweep.runs.isolate import Limits
from sweep.runs.run import _task
from sweep.runs.session import Session
from sweep.runs.to_file import _begin
from sweep.runs.worker import Assignment, Plugin, Sent, digest
from sweep.store import frame
from sweep.store.reading import StoredFile
from sweep.store.store import opened
from sweep.system.errors import SweepError

STUDY = tall(10)
G = 9.80665


def fall(*heights):
    return pytest.approx([math.sqrt(2 * h / G) for h in heights], rel=1e-12)


def assignment(**changed):
    keys = {"run": "r", "study": STUDY.to_json(), "fingerprint": fingerprint(STUDY), "partition": Partition(10, 4)}
    return Assignment(**{**keys, "shared": None, "paths": (), **changed})


@pytest.fixture
def told():
    """Tells this process of a run, which it forgets at the end."""
    plugins = []

    def tell(**changed):
        plugins.append(Plugin(assignment(**changed)))
        plugins[-1].setup(None)

    yield tell
    for plugin in plugins:
        plugin.teardown(None)


def test_numbers_of_blocks_are_sent_with_their_digest(told):
    told()
    answer = worker.compute("r", [2, 0], {})
    assert list(answer.found) == [2, 0]
    last, first = (answer.found[job] for job in (2, 0))
    assert (last.arrays["fall_time"], first.arrays["fall_time"]) == (fall(9, 10), fall(1, 2, 3, 4))
    assert last.digest == digest(Blocks(STUDY, Partition(10, 4)).columns, last.arrays) != first.digest
    assert answer.bad == []


def test_of_a_block_with_a_mask_only_wanted_cells_are_computed(told):
    told()
    wanted = np.array([False, True, True, False])
    sent = worker.compute("r", [1, 2], {1: np.packbits(wanted).tobytes()}).found
    times = sent[1].arrays["fall_time"]
    assert times[wanted] == fall(6, 7)
    assert not np.isclose(times[~wanted], [math.sqrt(2 * h / G) for h in (5, 8)]).any()
    assert sent[2].arrays["fall_time"] == fall(9, 10)


def test_seconds_of_blocks_have_their_share_of_the_sync(told, monkeypatch):
    told()
    now, synced = [10.0], []
    context = worker._context("r")

    def block(job, mask):
        now[0] += job
        return (job, mask)

    def sync():
        synced.append(1)
        now[0] += 3.0

    monkeypatch.setattr(worker.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(context, "block", block)
    monkeypatch.setattr(context, "sync", sync)
    answer = worker.compute("r", [5, 2], {2: b"m"})
    assert dict(answer.seconds) == {5: 6.5, 2: 3.5}
    assert dict(answer.found) == {5: (5, None), 2: (2, b"m")}
    assert synced == [1]


def test_a_run_has_one_context_until_it_is_over(told, monkeypatch):
    plugin = Plugin(assignment())
    plugin.setup(None)
    context = worker._context("r")
    assert worker._context("r") is context
    ended = []
    monkeypatch.setattr(context, "end", lambda: ended.append(1))
    plugin.teardown(None)
    plugin.teardown(None)
    assert ended == [1]
    assert "r" not in worker._contexts
    with pytest.raises(SweepError, match=r"^the run is over$"):
        worker.compute("r", [0], {})


def test_cells_that_failed_are_told_once(told):
    told()
    context = worker._context("r")
    context._thread.bad.append(BadCell(3, {}, "odd"))
    assert context.bad() == [BadCell(3, {}, "odd")]
    assert context.bad() == []


def test_a_thread_has_one_solver(told):
    told()
    context = worker._context("r")
    assert context._solve() is context._solve()


def test_what_a_thread_cannot_solve_is_its_own(told, monkeypatch):
    told()
    context, reports = worker._context("r"), []
    monkeypatch.setattr(worker, "Guard", lambda cells, report: reports.append(report))
    monkeypatch.setattr(worker, "block_solver", lambda study, guard: "solve")
    assert context._solve() == "solve"
    reports[0]("cell")
    assert context.bad() == ["cell"]
    reports[0]("another")
    assert context.bad() == ["another"]


@pytest.fixture
def file(tmp_path, monkeypatch):
    """A result that has begun, for others to write to, in blocks that share no page."""
    monkeypatch.setattr(frame, "SHARED_WORTH_A_PAGE", 1)
    task = _task(STUDY, tmp_path / "out.h5", workers=1, progress=False)
    session = Session(task, 1, Partition(10, 4), sampled=False)
    with opened(task.output) as store:
        _begin(session, store, shared=True)
        yield store
    session.close()


def test_blocks_are_written_to_the_file_that_a_worker_sees(told, file, monkeypatch):
    synced = []
    real = worker.disk.fsync
    monkeypatch.setattr(worker.disk, "fsync", lambda fd: (synced.append(fd), real(fd)))
    told(shared=file.shared())
    answer = worker.compute("r", [1, 2], {})
    assert synced == [worker._context("r")._fd]
    for job in (1, 2):
        file.take(job, answer.found[job])
    file.commit()
    assert file.missing() == [0]
    with StoredFile(file.path) as stored:
        assert stored.columns("cells")["fall_time"].run(4, 10) == fall(5, 6, 7, 8, 9, 10)
    mask = np.packbits(np.ones(4, bool)).tobytes()
    assert isinstance(worker.compute("r", [0], {0: mask}).found[0], Sent)


def test_a_thread_uses_its_buffers_again(told, file, monkeypatch):
    told(shared=file.shared())
    context, made = worker._context("r"), []
    real = context._blocks.empty
    monkeypatch.setattr(context._blocks, "empty", lambda *words: (made.append(words), real(*words))[1])
    worker.compute("r", [0, 1], {})
    assert made == [()]


def test_a_block_that_is_written_is_as_long_as_it_is(told, file):
    told(shared=file.shared())
    context, solved = worker._context("r"), []
    context._thread.solve = lambda start, stop, arrays, wanted: solved.append(
        (start, stop, wanted, *{len(column) for column in arrays.values()})
    )
    worker.compute("r", [1, 2], {})
    assert solved == [(4, 8, None, 4), (8, 10, None, 2)]


def test_a_worker_that_sees_another_file_sends_numbers(told, file):
    told(shared=replace(file.shared(), key="another"))
    assert isinstance(worker.compute("r", [1], {}).found[1], Sent)


def test_the_file_is_closed_when_the_run_is_over(file):
    context = worker._Context(assignment(shared=file.shared()))
    fd = context._fd
    os.fstat(fd)
    del context
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(fd)


def test_a_fault_names_the_cells_of_its_block(told, monkeypatch):
    told()

    def solve(*words):
        raise ValueError("odd")

    worker._context("r")._thread.solve = solve
    with pytest.raises(SweepError, match=r"^cells 4 to 8: the kernel failed \(ValueError: odd\)"):
        worker.compute("r", [1], {})


class Apart:
    """Stands for processes of their own."""

    def __init__(self, *made):
        self.made, self.ended = made, 0

    def solver(self):
        return "solver"

    def end(self):
        self.ended += 1


def test_cells_are_solved_in_processes_of_their_own_where_they_have_limits(monkeypatch):
    warmed = []
    monkeypatch.setattr(worker, "Processes", Apart)
    monkeypatch.setattr(worker, "warm", lambda solver, study: warmed.append(study))
    monkeypatch.setattr(worker.os, "cpu_count", lambda: None)
    monkeypatch.setattr(worker, "Guard", lambda cells, report: cells)
    monkeypatch.setattr(worker, "block_solver", lambda study, guard: guard)
    plain = worker._Context(assignment())
    plain.end()
    assert len(warmed) == 1
    context = worker._Context(assignment(limits=Limits(9.0)))
    assert len(warmed) == 1
    assert context._processes.made[1:] == (Limits(9.0), 1)
    assert context._solve() == "solver"
    context.end()
    assert context._processes.ended == 1
    monkeypatch.setattr(worker.os, "cpu_count", lambda: 6)
    assert worker._Context(assignment(limits=Limits(9.0)))._processes.made[2] == 6


def test_a_kernel_is_looked_for_in_folders_that_are_here_and_once(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    (tmp_path / "own").mkdir()
    before = list(sys.path)
    paths = (str(tmp_path), str(tmp_path / "own"), str(tmp_path / "none"))
    assert worker._study(assignment(paths=paths)).kernel_name == "toy:KERNEL"
    assert sys.path == [*before, str(tmp_path / "own")]


def test_another_version_is_refused_with_what_differs(monkeypatch):
    monkeypatch.setattr(worker.socket, "gethostname", lambda: "host")
    with pytest.raises(SweepError) as fault:
        worker._study(assignment(fingerprint={**fingerprint(STUDY), "numpy": "0.1"}))
    first, second = str(fault.value).split("\n")
    assert first == (
        "worker on host: what computes there is not what was asked for here; install the same versions on every machine"
    )
    assert second.startswith("  numpy")
    study = STUDY.to_json().replace("toy:KERNEL", "nowhere:KERNEL")
    with pytest.raises(SweepError, match=r"^worker on host: (?!worker).*nowhere"):
        worker._study(assignment(study=study))


def test_a_digest_is_that_of_all_columns_in_their_order():
    columns = (Column("x", "<f8", ("k",), (2,), {}), Column("status", "i1", (), (), {}))
    arrays = {"status": np.array([1, 2], np.int8), "x": np.arange(4.0).reshape(2, 2)}
    told = arrays["x"].tobytes() + arrays["status"].tobytes()
    assert digest(columns, arrays) == xxhash.xxh3_128(told).hexdigest()


def test_what_is_written_is_synced_only_where_something_is(monkeypatch):
    synced = []
    monkeypatch.setattr(worker.disk, "fsync", synced.append)
    context = object.__new__(worker._Context)
    for shared, fd in ((None, None), (SimpleNamespace(path="x"), None), (SimpleNamespace(path="x"), 77)):
        context._shared, context._fd = shared, fd
        context.sync()
    context._fd = None
    assert synced == [77]
