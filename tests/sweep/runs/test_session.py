"""A session piece by piece: how it samples, cuts, counts and tells, and what blocks are computed by."""

import math
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from running import stone, tall

from sweep.cells.block import Computed
from sweep.cells.guard import BadCell
from sweep.cells.partition import Partition
from sweep.cells.timing import UNSAMPLED, Sample
from sweep.runs import session as module
from sweep.runs.extend import Precomputed
from sweep.runs.isolate import Limits
from sweep.runs.run import _task
from sweep.runs.session import Session
from sweep.system.errors import SweepError
from sweep.system.pool import Cores
from sweep.system.progress import TimeUp


@pytest.fixture
def told(monkeypatch):
    """What is told: notes, which are in the log too, and other lines."""
    found = []
    monkeypatch.setattr("sweep.system.progress.Progress.note", lambda self, text: found.append(("note", text)))
    monkeypatch.setattr("sweep.system.progress.Progress.tell", lambda self, text: found.append(("tell", text)))
    return found


def made(study=None, threads=1, **keys):
    """A session that has no sample, unless it is to have one."""
    options = {name: keys.pop(name) for name in ("partition", "sampled", "reused") if name in keys}
    task = replace(
        _task(study or tall(20), None, workers=2, progress=False, block_cells=5),
        **keys,
    )
    return Session(task, threads, **{"sampled": False, **options})


def test_a_session_without_a_sample_weighs_blocks_by_their_cells():
    session = made()
    assert session.sample is UNSAMPLED
    assert (session.blocks.count, session.reused, session.processes, session.bad) == (4, None, None, [])
    assert session._weights().tolist() == [5.0] * 4
    session.tick()


def test_a_session_times_a_sample_of_its_grid():
    sample = made(sampled=True).sample
    assert sample is not UNSAMPLED
    assert (len(sample.status) > 0, sample.cost > 0) == (True, True)


@pytest.mark.parametrize(("cells", "blocks"), [(5, 4), (7, 3), (10, 2), (20, 1), (100, 1)])
def test_blocks_have_the_cells_that_are_asked_for(cells, blocks):
    assert made(block_cells=cells).blocks.count == blocks


@pytest.mark.parametrize(("cells", "rows"), [(8, 3), (9, 3), (10, 4)])
def test_blocks_have_whole_rows(monkeypatch, cells, rows):
    session, asked = made(block_cells=cells), []
    monkeypatch.setattr(module, "row_blocks", lambda study: SimpleNamespace(mean=3.0))
    monkeypatch.setattr(module, "boxes", lambda *words: asked.append(words))
    session._partition(1)
    assert asked == [((20,), rows)]


def test_blocks_are_cut_by_the_sample_for_so_many_threads(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "row_partition", lambda *words: (asked.append(words), Partition(35, 7))[1])
    session = made(stone(), threads=3, block_cells=None)
    assert session.blocks.partition == Partition(35, 7)
    # two numbers, three of drop, an error bound, a status and a method
    assert [(words[0], words[2:]) for words in asked] == [(UNSAMPLED, ((7, 5), 5 * 8 + 4 + 2, 3))]
    assert made(stone(), partition=Partition(35, 6)).blocks.partition == Partition(35, 6)


def test_a_result_says_which_of_its_cells_another_version_has_computed():
    assert "taken_over" not in made().schema.attrs
    assert made(reused=Precomputed({}, {"taken_over": "0.9"})).schema.attrs["taken_over"] == "0.9"


class Half:
    """Every cell below a number is known."""

    attrs = {}  # noqa: RUF012

    def __init__(self, below):
        self.below = below

    def known_before(self, cells):
        return np.minimum(cells, self.below)

    def missing(self, start, stop):
        return np.arange(start, stop) >= self.below

    def fill(self, start, stop, arrays):
        arrays["fall_time"][~self.missing(start, stop)] = -7.0


def test_cells_that_are_known_take_a_twentieth_of_the_others():
    session = made(reused=Half(8))
    assert session._weights() == pytest.approx([5 * 0.05, 5 * (1 - 0.95 * 3 / 5), 5.0, 5.0])


def test_the_run_stands_where_blocks_are_left():
    session = made()
    assert (session.progress.done, session.progress.total) == (20, 20)
    progress = session.begin([1, 3])
    assert progress is session.progress
    assert (progress.done, progress.total, session.forecast.blocks) == (10, 20, 2)
    session.again(0)
    assert (progress.done, session.forecast.blocks) == (5, 3)


def test_times_of_the_run_are_those_of_utc_to_the_second():
    session = made()
    found = session.dated("then").attrs
    assert found["start"] == "then"
    assert found["end"] == found["created"]
    end = datetime.fromisoformat(found["end"])
    assert end.tzinfo == UTC
    assert end.microsecond == 0
    assert timedelta() <= datetime.now(UTC) - end < timedelta(seconds=60)
    assert found["cells_per_second"] == "0.000000e+00"
    assert {name: found[name] for name in session.schema.attrs} == dict(session.schema.attrs)


def columns(session, cells):
    return session.blocks.empty(cells)


def test_a_solver_computes_what_is_missing_and_fills_in_the_rest():
    session = made(reused=Half(7))
    begun = []
    session.forecast.begin = begun.append
    arrays = columns(session, 5)
    session._solver()(5, 10, arrays)
    g = 9.80665
    expected = [-7.0, -7.0, *(math.sqrt(2 * h / g) for h in (8, 9, 10))]
    assert arrays["fall_time"] == pytest.approx(expected, rel=1e-12)
    assert begun == [1]
    session.reused = None
    plain = columns(session, 5)
    session._solver()(0, 5, plain)
    assert plain["fall_time"] == pytest.approx([math.sqrt(2 * h / g) for h in range(1, 6)], rel=1e-12)


def test_blocks_are_computed_and_their_ends_are_told_of():
    session = made()
    session.begin([0, 2, 3])
    done, ticks = [], []
    session.tick = lambda: ticks.append(1)

    def work(job, solve):
        arrays = columns(session, 5)
        done.append((job, solve(5 * job, 5 * job + 5, arrays), arrays["fall_time"][0]))

    session.compute(work)
    assert [(job, wanted) for job, wanted, _ in sorted(done)] == [(0, True), (2, True), (3, True)]
    assert [first for *_, first in sorted(done)] == pytest.approx(
        [math.sqrt(2 * h / 9.80665) for h in (1, 11, 16)], rel=1e-12
    )
    assert (session.forecast.blocks, session.progress.done, session.progress.computed) == (0, 20, 15)
    assert ticks


def test_threads_are_twice_the_cores_and_jobs_twice_those_that_compute(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "cores", lambda: 3)
    monkeypatch.setattr(module, "each", lambda jobs, work, threads, *rest: asked.append((threads, rest[-1])))
    session = made()
    session.compute(None)
    session.task.cores.count = 5
    session.compute(None)
    (few, _), (many, capacity) = asked
    assert (few, many, capacity()) == (6, 10, 10)
    session.task.cores.count = 1
    assert capacity() == 2


def test_a_fault_is_told_with_the_cells_of_its_block():
    session = made()
    session.begin([2])

    def work(job, solve):
        raise ValueError("odd")

    with pytest.raises(SweepError, match="^" + re.escape("cells 10 to 15: the kernel failed (ValueError: odd)")):
        session.compute(work)


def test_blocks_from_elsewhere_are_received_and_counted():
    session, received, bad = made(), [], BadCell(3, {"height": "4"}, "odd")
    session.begin([0, 1])
    ended, ticks = [], []
    session.forecast.end = lambda *words: ended.append(words)
    session.tick = lambda: ticks.append(1)

    class Executor:
        def compute(self, blocks, receive):
            receive(None)
            assert (session.progress.computed, ticks) == (0, [1])
            receive(Computed(1, b"digests", 2.0, 3.0, [bad]))

    session.compute_elsewhere(Executor(), lambda block, found: received.append((block, found)))
    assert received == [(1, b"digests")]
    assert ended == [(1, 2.0, 3.0)]
    assert session.bad == [bad]
    assert (session.progress.computed, ticks) == (5, [1])


def test_a_change_of_cores_is_told_once(told):
    session = made()
    session._count(None)
    session.task.cores.count = 3
    session._count(None)
    session._count(None)
    session.task.cores.count = 1
    session._count(None)
    assert told == [("note", "on 3 cores from now on"), ("note", "on 1 core from now on")]


@pytest.fixture
def logged(monkeypatch):
    """What is logged."""
    found = []
    monkeypatch.setattr(module, "log", lambda *words, **keys: found.append((words, keys)))
    return found


def test_a_cell_that_failed_is_told_and_logged_once(told, logged):
    session = made()
    session.bad.append(BadCell(3, {"height": "4"}, "odd"))
    session._count(None)
    session._count(None)
    said = "cell 3 FAILED (height=4): odd"
    assert told == [("tell", said)]
    assert logged == [((said, "failed"), {"cell": 3, "values": {"height": "4"}, "reason": "odd"})]


def test_of_too_many_cells_that_failed_only_their_number_is_told(told, logged):
    session = made()
    session.bad += [BadCell(cell, {}, "odd") for cell in range(1000)]
    session._count(None)
    assert (len(told), len(logged)) == (1000, 1000)
    for cell in (1000, 1001):
        session.bad.append(BadCell(cell, {}, "odd"))
        session._count(None)
    assert told[999:] == [
        ("tell", "cell 999 FAILED (): odd"),
        ("note", "more cells FAILED; from here on they are counted only"),
    ]
    assert len(logged) == 1000


def test_it_is_told_when_the_time_is_up():
    session = made(until=datetime.now().astimezone() + timedelta(hours=1))
    session.check_time()
    session._count(None)
    session.task = replace(session.task, until=datetime.now().astimezone() - timedelta(seconds=1))
    for late in (session.check_time, lambda: session._count(None), lambda: session.compute(None)):
        with pytest.raises(TimeUp, match=r"^it is \d\d:\d\d$"):
            late()
    with pytest.raises(TimeUp):
        session.compute_elsewhere(None, None)


@pytest.mark.parametrize(("seconds", "stops"), [(1.0, False), (1.01, True)])
def test_a_sample_has_a_second_although_the_time_is_up(monkeypatch, seconds, stops):
    now, closed = [5.0], []
    sample = Sample(np.zeros(1), np.ones(1), 1, None, None)
    real = Session.close

    def each(jobs, work, threads, tick, stopper):
        assert (jobs, threads) == ([0], 1)
        now[0] += seconds
        tick(None)
        work(0)

    monkeypatch.setattr(module, "each", each)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(module, "sampled_study", lambda study, compiling: sample)
    monkeypatch.setattr(Session, "close", lambda self: (closed.append(1), real(self))[1])
    late = datetime.now().astimezone() - timedelta(seconds=1)
    if stops:
        with pytest.raises(TimeUp):
            made(sampled=True, until=late)
    else:
        assert made(sampled=True, until=late).sample is sample
    assert closed == [1] * stops


class Apart:
    """Stands for processes of their own."""

    def __init__(self, study, limits, count):
        self.made, self.limits, self.ended, self.clock = (study, limits, count), limits, 0, "clock"

    def solver(self):
        return self

    def end(self):
        self.ended += 1


def test_cells_in_processes_of_their_own_are_sampled_there_and_limited_by_what_the_dearest_takes(monkeypatch):
    sample, asked = Sample(np.zeros(2), np.array([0.25, 0.5]), 1, None, None), []
    monkeypatch.setattr(module, "Processes", Apart)
    monkeypatch.setattr(module, "sampled_by", lambda *words: (asked.append(words), sample)[1])
    study, cores = tall(20), Cores(3)
    session = made(study, sampled=True, isolate=True, limits=Limits(9.0), cores=cores)
    assert session.processes.made == (study, Limits(9.0), 3)
    assert asked == [(session.processes, study, "clock")]
    assert session.processes.limits == Limits(9.0, 0.5)
    session._stopper()._kill()
    session.close()
    assert session.processes.ended == 2
    assert made()._stopper()._kill() is None


def test_the_solver_of_processes_of_their_own_is_one_of_them(monkeypatch):
    monkeypatch.setattr(module, "Processes", Apart)
    session, asked = made(isolate=True), []
    monkeypatch.setattr(module, "Guard", lambda cells, report: asked.append((cells, report)))
    monkeypatch.setattr(module, "block_solver", lambda study, guard: None)
    session._solver()
    assert asked[0][0] is session.processes
    asked[0][1]("bad")
    assert session.bad == ["bad"]


def test_a_session_that_is_closed_ends_its_line():
    session, stopped = made(), []
    session.progress.stop = lambda: stopped.append(1)
    session.close()
    del session.progress
    session.close()
    assert stopped == [1]


def test_the_log_begins_with_what_is_computed_where(monkeypatch, logged):
    machine = SimpleNamespace(node="n", system="s", machine="m")
    monkeypatch.setattr(module, "platform", SimpleNamespace(uname=lambda: machine))
    monkeypatch.setattr(module.os, "getpid", lambda: 77)
    session = made(tall(2000), block_cells=1)
    session.schema = replace(session.schema, attrs={"versions": "v 1"})
    session.begin(range(500))
    session.log_begin()
    (text, kind), keys = logged[0]
    assert text == (
        "begins: A stone, kernel toy:KERNEL, 1,500 of 2,000 cells done before, 2,000 blocks, 2 cores, "
        "process 77 on n (s m), v 1"
    )
    assert kind == "begin"
    expected = {"kernel": "toy:KERNEL", "cells": 1500, "of": 2000, "cores": 2, "process": 77, "machine": "n"}
    assert keys == {**expected, "versions": "v 1"}
