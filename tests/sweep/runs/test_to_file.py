"""The steps of a run into a file: what is taken from where, what is told, and how often damage is mended."""

import contextlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from running import interrupted, kept, quiet, stone, tall

from sweep.cells.fingerprint import fingerprint
from sweep.results.open import open_result
from sweep.runs import to_file
from sweep.runs.run import _task
from sweep.runs.session import Session
from sweep.runs.to_file import run_to_file
from sweep.store.store import Store, opened, unfinished_of
from sweep.system.errors import SweepError
from sweep.system.pool import Terminated
from sweep.system.progress import TimeUp


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture
def notes(monkeypatch):
    """What is told."""
    told = []
    monkeypatch.setattr("sweep.system.progress.Progress.tell", lambda self, text: told.append(text))
    return told


def task_of(output, study=None, **keys):
    return _task(study or tall(10), output, **{"workers": 1, "progress": False, "block_cells": 5, **keys})


@pytest.fixture
def sessions(monkeypatch):
    """What sessions are made of."""
    made = []

    class Seen(Session):
        def __init__(self, *words, **keys):
            made.append((words[1], keys.get("sampled", True), words[2:], keys.get("reused")))
            super().__init__(*words, **keys)

    monkeypatch.setattr(to_file, "Session", Seen)
    return made


def test_what_is_complete_is_tidied_and_nothing_else(output, monkeypatch):
    quiet(tall(10), output)
    tidied = []
    monkeypatch.setattr(to_file.resume, "tidy", lambda store, task: tidied.append(store.output))
    monkeypatch.setattr(to_file, "Session", None)
    assert run_to_file(task_of(output)) is True
    assert tidied == [output]


def test_cells_are_sampled_unless_they_are_solved_already(output, sessions):
    assert run_to_file(task_of(output)) is True
    rest = {"status": np.zeros(10, np.int8), "method_used": np.ones(10, np.int8), "error_bound": np.zeros(10)}
    known = to_file.Precomputed({"fall_time": np.arange(10.0), **rest}, {})
    assert run_to_file(task_of(output, force=True), known) is True
    with open_result(output) as found:
        assert found.fall_time.values.tolist() == list(range(10))
    assert [(threads, sampled, cut, reused is known) for threads, sampled, cut, reused in sessions] == [
        (1, True, (None,), False),
        (1, False, (None,), True),
    ]


def test_a_run_that_is_continued_keeps_its_cut(output, sessions):
    interrupted(stone(), output)
    before = kept(output)
    assert 0 < len(before) < 7
    run_to_file(task_of(output, stone(), block_cells=None))
    _, sampled, (blocks,), reused = sessions[-1]
    assert (sampled, blocks.cells, reused) == (True, 5, None)


def test_what_only_lacks_its_end_is_not_sampled(output, sessions, monkeypatch):
    real = Store.finish
    monkeypatch.setattr(Store, "finish", lambda *words: (_ for _ in ()).throw(TimeUp("noon")))
    assert run_to_file(task_of(output)) is False
    monkeypatch.setattr(Store, "finish", real)
    assert run_to_file(task_of(output)) is True
    assert [(threads, sampled) for threads, sampled, *_ in sessions] == [(1, True), (1, False)]
    assert output.exists()


def test_a_time_that_is_up_before_the_first_block_is_told(output, monkeypatch, notes):
    def late(*words, **keys):
        raise TimeUp("it is 07:00")

    monkeypatch.setattr(to_file, "Session", late)
    assert run_to_file(task_of(output)) is False
    assert notes == ["stopped before the first block, for it is 07:00"]


class Result:
    """Stands for the cells of an earlier result."""

    def __init__(self, output, study):
        self.made, self.checked, self.closed = (output, study), 0, 0

    def __enter__(self):
        return self

    def __exit__(self, *fault):
        self.closed += 1

    def check_sample(self):
        self.checked += 1


class Again(Result):
    """The same, of cells that FAILED."""


@pytest.fixture
def earlier(monkeypatch):
    """What is asked of an earlier result."""
    whole = []
    monkeypatch.setattr(to_file, "Reused", Result)
    monkeypatch.setattr(to_file, "Retried", Again)
    monkeypatch.setattr(to_file, "check_whole", whole.append)
    monkeypatch.setattr(to_file, "stored_fingerprint", lambda path: {"axes.height": "old", "numpy": "1"})
    return whole


def asked(output, **keys):
    """Of an earlier result; its stack is closed."""
    task = replace(task_of(output), fingerprint={"axes.height": "new", "numpy": "1"}, **keys)
    with contextlib.ExitStack() as stack:
        found = to_file._reused(task, stack)
        assert found is None or found.closed == 0
    assert found is None or (found.closed, found.made) == (1, (output, task.study))
    return found


def test_an_earlier_result_is_used_where_that_is_asked_for(output, earlier, notes):
    assert asked(output, extend=True) is None  # there is none
    output.write_text("there")
    assert asked(output) is None
    assert asked(output, extend=True, force=True) is None
    assert earlier == []
    assert type(asked(output, retry_failed=True)) is Again
    found = asked(output, extend=True)
    assert (type(found), found.checked) == (Result, 0)
    assert earlier == [output, output]
    assert notes == []


def test_a_sample_of_what_another_version_has_computed_is_computed_again(output, earlier, notes, monkeypatch):
    output.write_text("there")
    monkeypatch.setattr(to_file, "stored_fingerprint", lambda path: {"axes.height": "old", "numpy": "0"})
    assert asked(output, extend=True).checked == 1
    assert notes == ["another version has computed it; a sample of its cells is computed again"]
    assert asked(output, retry_failed=True).checked == 0


@pytest.mark.parametrize("fault", [KeyboardInterrupt(), Terminated(), TimeUp("it is 07:00")])
def test_how_to_go_on_is_told_where_a_run_is_stopped(output, monkeypatch, notes, fault):
    real, closed = Session.close, []
    monkeypatch.setattr(Session, "close", lambda self: (closed.append(1), real(self))[1])

    def put(self, index, arrays):
        if index == 1:
            raise fault
        real_put(self, index, arrays)

    real_put = Store.put
    monkeypatch.setattr(Store, "put", put)
    monkeypatch.setattr("sweep.system.forecast.Forecast.order", lambda self: iter(range(self.blocks)))
    monkeypatch.setattr(to_file.Session, "compute", one_by_one)
    reason = f", for {fault}" if isinstance(fault, TimeUp) else ""
    if reason:
        assert run_to_file(task_of(output)) is False
    else:
        with pytest.raises(type(fault)):
            run_to_file(task_of(output))
    assert notes == [f"stopped{reason}; 1 of 2 blocks are kept, run the same command again to continue"]
    assert (kept(output), closed) == ([0], [1])


def one_by_one(self, work):
    """`Session.compute` in this thread."""
    solve = self._solver()
    for job in self.forecast.order():
        work(job, lambda *words: (solve(*words), True)[1])


def test_the_disk_is_told_of_all_rows_that_are_left(output, monkeypatch):
    interrupted(stone(), output)
    rows = 35 - 5 * len(kept(output))
    seen = []

    def finish(session, store, cluster):
        seen.append((store.write_back.total, session.forecast.ending, cluster, session.tick))
        raise TimeUp("noon")

    monkeypatch.setattr(to_file, "_finish", finish)
    run_to_file(task_of(output, stone()))
    # fall_time, impact_speed, three numbers of drop, an error bound, a status and a method
    total, ending, cluster, tick = seen[0]
    assert total == rows * (5 * 8 + 4 + 1 + 1)
    assert (ending.__name__, tick.__func__, cluster) == ("seconds", Store.tick, None)


@pytest.mark.parametrize(("less", "fits"), [(0, True), (1, False)])
def test_a_file_is_made_where_it_has_just_room(output, monkeypatch, less, fits):
    study = tall(10)
    quiet(study, output, block_cells=5, workers=1)
    size = output.stat().st_size
    asked = []
    monkeypatch.setattr(to_file.disk, "free", lambda folder: (asked.append(folder), size - less)[1])
    if fits:
        assert run_to_file(task_of(output, force=True)) is True
    else:
        with pytest.raises(SweepError) as fault:
            run_to_file(task_of(output, force=True))
        needed = to_file.quantity(size)
        assert str(fault.value) == (
            f"{output}: needs {needed}, only {to_file.quantity(size - 1)} are free here; free some space, choose "
            "another folder with -o, fewer outputs, or keep a [summary] instead of every cell"
        )
        assert not unfinished_of(output).exists()
    assert asked == [output.parent]


class Damaging:
    """A store whose blocks come back damaged so many times; and the session that computes them."""

    def __init__(self, times):
        self.path, self.times, self.left, self.ended = "out.h5.unfinished", times, [0, 1], 0
        self.notes, self.computed, self.repeated = [], [], []
        self.study = SimpleNamespace(summary=None)
        self.progress = SimpleNamespace(note=self.notes.append, end=self.end)
        self.blocks = SimpleNamespace(label=lambda index: f"cells of {index}")

    def missing(self):
        return self.left

    def endings(self):
        return {"end": "now"}

    def again(self, index):
        self.repeated.append(index)

    def end(self):
        self.ended += 1

    def finish(self, texts, gather):
        assert (texts, gather) == ({"end": "now"}, None)
        self.times -= 1
        self.left = [1] if self.times >= 0 else []
        return self.left


def computing(monkeypatch, both, lost=False):
    """How blocks are computed is written down."""

    def here(session, store):
        both.computed.append(("here", list(store.left)))
        store.left = []

    def elsewhere(session, store, cluster):
        both.computed.append((cluster, list(store.left)))
        store.left = store.left[:1] if lost else []
        return not lost

    monkeypatch.setattr(to_file, "_store_blocks", here)
    monkeypatch.setattr(to_file, "_store_elsewhere", elsewhere)


def test_damaged_blocks_are_computed_again_twice(monkeypatch):
    both = Damaging(2)
    computing(monkeypatch, both)
    to_file._finish(both, both, None)
    assert both.computed == [("here", [0, 1]), ("here", [1]), ("here", [1])]
    assert both.notes == ["cells of 1 were damaged on the disk and are computed again"] * 2
    assert (both.repeated, both.ended) == ([1, 1], 1)


def test_a_disk_that_damages_three_times_is_given_up(monkeypatch):
    both = Damaging(3)
    computing(monkeypatch, both)
    said = "^out.h5.unfinished: what is written there comes back damaged again and again; the disk is failing$"
    with pytest.raises(SweepError, match=said):
        to_file._finish(both, both, None)
    assert (len(both.computed), both.ended) == (3, 0)


def test_nothing_is_computed_where_nothing_is_missing(monkeypatch):
    both = Damaging(0)
    both.left = []
    computing(monkeypatch, both)
    to_file._finish(both, both, "cluster")
    assert (both.computed, both.ended) == ([], 1)


@pytest.mark.parametrize(
    ("lost", "computed"),
    [
        (False, [("cluster", [0, 1]), ("cluster", [1])]),
        (True, [("cluster", [0, 1]), ("here", [0]), ("here", [1])]),
    ],
)
def test_a_cluster_computes_until_it_is_lost(monkeypatch, lost, computed):
    both = Damaging(1)
    computing(monkeypatch, both, lost)
    to_file._finish(both, both, "cluster")
    assert both.computed == computed


def test_groups_are_made_of_their_own_rows(monkeypatch):
    monkeypatch.setattr(to_file, "row_blocks", lambda study: SimpleNamespace(per_group=3))
    monkeypatch.setattr(to_file, "gathered", lambda study, rows: (study, rows))
    groups = SimpleNamespace(blocks=SimpleNamespace(bounds=lambda block: (5 * block, 5 * block + 4)))
    columns = {"x": SimpleNamespace(run=lambda start, stop: range(start, stop))}
    file = SimpleNamespace(layout=SimpleNamespace(tables={"cells": groups}), columns={"rows": columns}.get)
    assert to_file._gather("study")(file, 1) == ("study", {"x": range(15, 27)})


@pytest.mark.parametrize("wanted", [True, False])
def test_a_block_is_kept_as_long_as_it_is_and_only_while_it_is_wanted(wanted):
    stored = {}
    blocks = SimpleNamespace(empty=lambda: {"x": np.zeros(4)}, bounds=lambda job: (4 * job, min(4 * job + 4, 10)))

    def solve(start, stop, arrays):
        arrays["x"][:] = np.arange(start, stop)
        return wanted

    def compute(work):
        for job in range(3):
            work(job, solve)

    store = SimpleNamespace(put=lambda job, arrays: stored.update({job: arrays["x"].tolist()}))
    to_file._store_blocks(SimpleNamespace(blocks=blocks, compute=compute), store)
    assert stored == ({0: [0, 1, 2, 3], 1: [4, 5, 6, 7], 2: [8, 9]} if wanted else {})


def test_what_workers_have_written_is_taken_and_what_they_send_is_put(monkeypatch):
    done = []

    def elsewhere(session, cluster, shared, receive):
        receive(3, b"digests")
        receive(4, {"x": 1})
        return (session, cluster, shared)

    monkeypatch.setattr(to_file, "compute_elsewhere", elsewhere)
    store = SimpleNamespace(
        take=lambda *given: done.append(("take", *given)),
        put=lambda *given: done.append(("put", *given)),
        shared=lambda: "shared",
    )
    assert to_file._store_elsewhere("session", store, "cluster") == ("session", "cluster", "shared")
    assert done == [("take", 3, b"digests"), ("put", 4, {"x": 1})]


@pytest.mark.parametrize("cluster", [None, "cluster"])
def test_only_blocks_that_are_written_here_are_on_their_way_to_the_disk(output, monkeypatch, cluster):
    begun, seen = [], []
    real = to_file._begin
    monkeypatch.setattr(to_file, "_begin", lambda *words, shared: (begun.append(shared), real(*words, shared)))
    monkeypatch.setattr(to_file, "_finish", lambda session, store, cluster: seen.append((store, cluster)))
    session = Session(task_of(output), 1)
    with opened(output) as store:
        assert to_file._run_session(session, store, cluster) is True
        assert seen == [(store, cluster)]
        assert store.write_back.total == (0 if cluster else 10 * 14)
    assert begun == [cluster is not None]


@pytest.mark.parametrize("shared", [True, False])
def test_a_file_is_begun_for_who_writes_it(output, monkeypatch, shared):
    seen = []
    real = to_file.Frame
    monkeypatch.setattr(to_file, "Frame", lambda *words: (seen.append(words), real(*words))[1])
    task = task_of(output)
    session = Session(task, 1)
    with opened(output) as store:
        to_file._begin(session, store, shared)
        assert (store.count, store.table.blocks.count) == (0, 2)
    session.close()
    assert seen[0][2:] == (fingerprint(task.study), session.began, shared)
