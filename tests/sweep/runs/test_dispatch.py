"""Blocks on their way to a cluster: which go together, which come back, and what is said of those that do not."""

import math
from concurrent.futures import CancelledError, Future
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("distributed")

from distributed import KilledWorker

from sweep.cells.schema import Column
from sweep.runs import dispatch
from sweep.runs.dispatch import Dispatch
from sweep.runs.worker import digest
from sweep.system.errors import SweepError


def made(seconds=0.0, blocks=100, threads=4, most=1000):
    """A dispatch without a cluster; each block is thought to take so many seconds."""
    found = object.__new__(Dispatch)
    found._forecast = SimpleNamespace(blocks=blocks, seconds=lambda job: seconds)
    found._cluster = SimpleNamespace(threads=threads, lost=lambda fault: SweepError("lost"))
    found._blocks = SimpleNamespace(
        cells=lambda job: (10 * job, 10 * job + 9), bounds=lambda job: (8 * job, 8 * job + 8)
    )
    found._reused, found._answers, found._most = None, 0, most
    found._suspects, found.told, found.received = [], [], []
    found._note, found._receive = found.told.append, found.received.append
    return found


def sizes(found, blocks=100):
    return [len(batch) for batch in found._batches(iter(range(blocks)))]


@pytest.mark.parametrize(
    ("answers", "left", "threads", "most", "longest"),
    [
        (0, 100, 4, 99, 1),
        (5, 100, 4, 99, 6),
        (50, 100, 4, 99, 12),
        (50, 100, 4, 7, 7),
        (5, 7, 4, 99, 1),
        (50, 100, 0, 99, 50),
    ],
)
def test_blocks_that_go_together(answers, left, threads, most, longest):
    found = made(threads=threads, most=most)
    found._answers = answers
    assert found._longest(left) == longest


def test_as_many_blocks_go_together_as_take_half_a_second():
    found = made(seconds=0.2)
    found._answers = 10**6
    assert sizes(found)[:3] == [3, 3, 3]
    assert sizes(found)[-1] == 1
    assert sum(sizes(found)) == 100
    even = made(seconds=0.25)
    even._answers = 10**6
    assert sizes(even)[0] == 2
    assert sizes(made(), 100) == [1] * 100  # no answer has come yet


def test_blocks_of_which_all_is_known_are_not_sent():
    found = made(blocks=10)
    found._is_reused = lambda job: job % 2 == 0
    assert list(found._batches(iter(range(10)))) == [(1,), (3,), (5,), (7,), (9,)]


def test_two_tasks_a_thread_are_under_way_and_two_more():
    assert made(threads=4)._capacity() == 10
    assert made(threads=0)._capacity() == 2


def failed(fault):
    future = Future()
    future.set_exception(fault)
    return future


def test_an_answer_is_taken_block_by_block_and_what_was_bad_once():
    found, future = made(), Future()
    answer = SimpleNamespace(bad=("x",), seconds={3: 1.0, 4: 2.0}, found={3: b"three", 4: b"four"})
    future.set_result(answer)
    found._take((3, 4), future, None)
    assert [tuple(vars(one).values()) for one in found.received] == [
        (3, b"three", 1.0, 3.0, ("x",)),
        (4, b"four", 2.0, 3.0, ()),
    ]
    assert found._answers == 1


def test_what_fails_is_suspected_told_or_raised():
    found, killed = made(), []
    found._take((1, 2), failed(KilledWorker("t", None, 1)), killed.append)
    assert killed == [(1, 2)]
    found._take((1, 2), failed(TypeError("'NoneType' is no Answer")), killed.append)
    assert found._suspects == [1, 2]
    assert found.told == [
        "workers died again and again while they had cells 10 to 19, 20 to 29; these are tried again at the end"
    ]
    with pytest.raises(SweepError, match=r"cluster: a worker failed \(TypeError: other\); what is finished is kept"):
        found._take((1,), failed(TypeError("other")), killed.append)
    with pytest.raises(SweepError, match=r"a worker failed \(ValueError: Answer\)"):
        found._take((1,), failed(ValueError("Answer")), killed.append)
    with pytest.raises(SweepError, match=r"^lost$"):
        found._take((1,), failed(CancelledError()), killed.append)
    with pytest.raises(SweepError, match=r"^mine$"):
        found._take((1,), failed(SweepError("mine")), killed.append)


def test_eight_blocks_are_named_and_others_counted():
    blocks = made()._blocks
    assert dispatch._listed(blocks, [0]) == "cells 0 to 9"
    assert dispatch._listed(blocks, range(8)).endswith("70 to 79")
    assert dispatch._listed(blocks, range(10)).endswith("70 to 79 and 2 more blocks")


def test_of_a_block_known_in_part_a_bit_tells_each_cell_that_is_not():
    found = made()
    assert found._mask(2) is None
    found._reused = SimpleNamespace(missing=lambda start, stop: np.arange(start, stop) == 17)
    assert found._mask(2) == b"\x40"
    assert found._mask(1) == b"\x00"


def test_a_change_of_threads_is_in_the_log_and_their_absence_is_told(monkeypatch):
    found, logged = made(), []
    monkeypatch.setattr(dispatch, "log", lambda *given, **keys: logged.append(given[0]))
    found._threads, found._absence = None, SimpleNamespace(check=lambda absent: absent)
    for threads in (4, 4, 2, 0):
        found._cluster.threads = threads
        found._look_for_workers()
    assert logged == ["the cluster has 2 threads, 4 before", "the cluster has 0 threads, 2 before"]
    assert found.told == ["the cluster has no workers left; waiting for new ones"]


COLUMNS = (Column("x", "<f8", ("k",), (2,), {}), Column("status", "i1", (), (), {}))


def sent(**changed):
    arrays = {"x": np.arange(16.0).reshape(8, 2), "status": np.zeros(8, np.int8), **changed}
    return SimpleNamespace(arrays=arrays, digest=digest(COLUMNS, arrays))


def of_columns():
    found = made()
    found._blocks.columns, found._blocks.label = COLUMNS, lambda job: f"block {job}"
    found._blocks.empty = lambda cells: {c.name: c.empty(cells) for c in COLUMNS}
    return found


def test_numbers_come_as_they_were_sent_or_are_refused():
    good = sent()
    assert of_columns()._checked(2, good)["x"] is good.arrays["x"]
    changed = sent()
    changed.arrays["x"] = changed.arrays["x"] + 1
    wrong = [
        sent(x=np.arange(14.0).reshape(7, 2)),
        sent(x=np.zeros((8, 3))),
        sent(x=np.zeros((8, 2), np.float32)),
        sent(status=np.zeros(8, bool)),
        changed,
    ]
    for one in wrong:
        with pytest.raises(SweepError, match="block 2: damaged on their way from the worker"):
            of_columns()._checked(2, one)


class Known:
    """Cells below a number are known, and are 7."""

    def __init__(self, below):
        self.below = below

    def missing(self, start, stop):
        return np.arange(start, stop) >= self.below

    def fill(self, start, stop, arrays):
        for column in arrays.values():
            column[: max(self.below - start, 0)] = 7


def test_known_cells_are_filled_in_where_numbers_cannot_be_written_too():
    found, answer = of_columns(), sent()
    found._reused = Known(18)
    answer.arrays["x"].flags.writeable = False
    arrays = found._checked(2, answer)
    assert arrays["x"].tolist() == [[7, 7], [7, 7], *([2.0 * k, 2.0 * k + 1] for k in range(2, 8))]
    assert arrays["status"].tolist() == [7, 7, 0, 0, 0, 0, 0, 0]
    assert answer.arrays["x"][0, 0] == 0


@pytest.mark.parametrize(("below", "known"), [(24, True), (23, False)])
def test_a_block_is_received_at_once_where_all_of_it_is_known(below, known):
    found = of_columns()
    assert found._is_reused(2) is False
    found._reused = Known(below)
    assert found._is_reused(2) is known
    assert len(found.received) == known
    if known:
        one = found.received[0]
        assert (one.block, one.seconds, one.ago, one.bad) == (2, 0.0, 0.0, ())
        assert one.found["x"].tolist() == [[7, 7]] * 8


@pytest.mark.parametrize(
    ("without", "cells", "reused", "lost", "most"),
    [
        ("wait", 1 << 20, None, math.inf, 4),
        ("here", (32 << 20) // 8 + 1, 5, dispatch.LOST_SECONDS, 1),
        ("end", 0, None, dispatch.LOST_SECONDS, 32 << 20),
    ],
)
def test_what_workers_are_told(monkeypatch, without, cells, reused, lost, most):
    monkeypatch.setattr(dispatch, "Assignment", lambda *words: words)
    monkeypatch.setattr(dispatch, "Absence", lambda seconds: seconds)
    study = SimpleNamespace(to_json=lambda: "json", kernel_name="foliot")
    task = SimpleNamespace(note=print, study=study, fingerprint={"a": "1"}, without_workers=without)
    blocks = SimpleNamespace(partition=SimpleNamespace(cells=cells), row_bytes=8 if cells else 0)
    found = Dispatch(None, task, blocks, None, reused, "shared", "limits")
    name, *words = found._assignment
    assert len(name) == len("foliot-") + 8
    assert words == ["json", {"a": "1"}, blocks.partition, None if reused else "shared", (), "limits"]
    assert (found._absence, found._most) == (lost, most)
