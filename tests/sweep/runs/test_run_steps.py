"""What a run is asked for, what it gives back, and where its cells come to, without a run."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from running import tall

from sweep.runs import run
from sweep.system.errors import SweepError
from sweep.system.progress import TimeUp


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"workers": 2, "cluster": "x"}, "workers, cluster: a cluster brings its own workers; give one of the two"),
        ({"until": "23:59"}, "until: give a path as well, or what is computed by then would be lost"),
        (
            {"extend": True, "retry_failed": True},
            "extend, retry_failed: give one of the two; each continues another result",
        ),
        ({"without_workers": "no"}, 'without_workers: expected "wait", "here" or "end", found \'no\''),
    ],
)
def test_what_does_not_go_together_is_told(keys, said):
    with pytest.raises(SweepError) as fault:
        run._task(tall(3), None, **keys)
    assert str(fault.value) == said


def test_what_a_run_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "cores", lambda: 7)
    plain = run._task(tall(3), tmp_path / "x.h5")
    assert (plain.cores.count, plain.block_cells, plain.isolate, plain.limits.cell) == (7, None, False, None)
    assert (plain.output, plain.until, plain.without_workers) == (tmp_path / "x.h5", None, "wait")
    found = run._task(tall(3), None, workers=2, block_cells=5, cell_timeout="2s", cluster=None, force=True)
    assert (found.cores.count, found.block_cells, found.isolate, found.limits.cell) == (2, 5, True, 2.0)
    assert found.force is True
    assert run._task(tall(3), None, isolate=True).isolate is True
    with pytest.raises(SweepError) as fault:
        run._task(tall(3), tmp_path / "none" / "x.h5")
    assert str(fault.value) == f"{tmp_path / 'none' / 'x.h5'}: there is no folder {tmp_path / 'none'}"


@pytest.mark.parametrize(
    ("complete", "left", "found"),
    [(True, "", True), (True, "x.h5.unfinished", "ran"), (True, "x.h5.lock", "ran"), (False, "", "ran")],
)
def test_a_result_that_is_complete_and_alone_is_left_alone(tmp_path, monkeypatch, complete, left, found):
    if left:
        (tmp_path / left).write_text("")
    monkeypatch.setattr(run.resume, "is_complete", lambda task: complete)
    monkeypatch.setattr(run, "run_to_file", lambda task, precomputed: "ran")
    assert run._complete(SimpleNamespace(output=tmp_path / "x.h5", force=False)) == found


@pytest.mark.parametrize(("memory", "fits"), [(2000, True), (1999, False)])
def test_a_result_that_is_kept_in_memory_fits_there(monkeypatch, memory, fits):
    monkeypatch.setattr(run, "memory", lambda: memory)
    blocks = SimpleNamespace(rows=SimpleNamespace(count=100), row_bytes=20, empty=lambda rows: rows)
    if fits:
        assert run._arrays(SimpleNamespace(blocks=blocks)) == 100
        return
    blocks.row_bytes = 2e7
    with pytest.raises(SweepError) as fault:
        run._arrays(SimpleNamespace(blocks=blocks))
    said = "the result takes 2.0 GB, more than the memory; give a path to store it"
    assert str(fault.value) == said


@pytest.mark.parametrize("lost", [None, True, False])
def test_rows_come_to_their_places_from_here_and_elsewhere(monkeypatch, lost):
    arrays, computed = {"x": np.zeros(10)}, []
    blocks = SimpleNamespace(bounds=lambda job: (4 * job, min(4 * job + 4, 10)))

    def solve(start, stop, columns):
        columns["x"][...] = range(start, stop)

    def compute(work):
        for job in (0, 1, 2):
            work(job, solve)
            computed.append(job)

    def other(session, cluster, shared, receive):
        assert shared is None
        receive(2, {"x": np.array([-8.0, -9.0])})
        return not lost

    monkeypatch.setattr(run, "compute_elsewhere", other)
    run._fill(SimpleNamespace(blocks=blocks, compute=compute), arrays, None if lost is None else "cluster")
    assert computed == ([] if lost is False else [0, 1, 2])
    assert arrays["x"].tolist() == ([0] * 8 + [-8, -9] if lost is False else list(range(10)))


@pytest.mark.parametrize(
    ("count", "block"), [(1, 1), (run.STORED_AT_ONCE, run.STORED_AT_ONCE), (run.STORED_AT_ONCE + 1, run.STORED_AT_ONCE)]
)
def test_cells_that_are_solved_already_are_stored_some_at_once(tmp_path, monkeypatch, count, block):
    asked = []
    monkeypatch.setattr(run, "row_blocks", lambda study: SimpleNamespace(count=count))
    monkeypatch.setattr(run, "_complete", lambda task, known: asked.append((task, known)))
    monkeypatch.setattr(run, "open_result", lambda path: path)
    arrays = {"fall_time": np.arange(5.0)}
    assert run.store_cells(tall(3), tmp_path / "x.h5", arrays, True, {"a": "1"}, "0.1") == tmp_path / "x.h5"
    task, known = asked[0]
    assert (task.block_cells, task.fingerprint, task.force, known.taken_over) == (block, {"a": "1"}, True, "0.1")
    found = {"fall_time": np.zeros(2)}
    known.fill(3, 5, found)
    assert found["fall_time"].tolist() == [3.0, 4.0]


@pytest.mark.parametrize(
    ("path", "complete", "begun", "found"),
    [("x.h5", True, True, "result"), ("x.h5", False, True, "unfinished"), ("x.h5", False, False, None)],
)
def test_what_a_run_gives_back(tmp_path, monkeypatch, path, complete, begun, found):
    monkeypatch.setattr(run, "_complete", lambda task: complete)
    monkeypatch.setattr(run, "is_begun", lambda output: begun)
    monkeypatch.setattr(run, "open_result", lambda output: "result")
    monkeypatch.setattr(run, "open_unfinished", lambda output: "unfinished")
    if found:
        assert run.run(tall(3), tmp_path / path) == found
        return
    with pytest.raises(SweepError, match=r"^until: the time was up before the first cell could be computed$"):
        run.run(tall(3), tmp_path / path)


def test_a_run_in_memory_that_is_stopped_keeps_nothing(monkeypatch):
    def in_memory(task):
        raise TimeUp("the cluster has no workers")

    monkeypatch.setattr(run, "_run_in_memory", in_memory)
    said = r"^stopped, for the cluster has no workers; give a path to keep what is computed$"
    with pytest.raises(SweepError, match=said):
        run.run(tall(3))


def test_a_session_in_memory_is_closed_whatever_happens(monkeypatch):
    closed = []

    class Session:
        def __init__(self, task, threads):
            self.blocks, self.progress = SimpleNamespace(count=3), SimpleNamespace(end=lambda: closed.append("end"))

        def begin(self, jobs):
            closed.append(jobs)
            return self.progress

        def close(self):
            closed.append("close")

    def fill(*words):
        raise ValueError("odd")

    @contextmanager
    def joined(task):
        yield None

    for name, stand in {"Session": Session, "joined": joined, "_arrays": lambda session: {}, "_fill": fill}.items():
        monkeypatch.setattr(run, name, stand)
    with pytest.raises(ValueError, match="odd"):
        run._run_in_memory(run._task(tall(3), None))
    assert closed == [range(3), "close"]


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("workes", "; did you mean workers?"),
        ("outputz", "; did you mean outputs?"),
        ("cel_timeout", "; did you mean cell_timeout?"),
    ],
)
def test_a_keyword_that_is_none_is_told_with_the_one_that_is_meant(key, hint):
    with pytest.raises(SweepError) as fault:
        run._check_keywords({"rtol": 1, "allow_import": True, key: 2})
    assert str(fault.value) == f"sweep.run: no such keyword {key}{hint}"


def test_a_keyword_that_is_like_no_other_is_told_with_all_of_a_study():
    with pytest.raises(SweepError, match=r"^sweep\.run: no such keyword zzz; a study has title, .* and "):
        run._check_keywords({"zzz": 2})
    run._check_keywords(dict.fromkeys(run.KEYS))


@pytest.mark.parametrize(("summary", "found"), [(None, "rows"), ("summary", "groups of rows")])
def test_rows_of_a_summary_are_gathered_into_groups(monkeypatch, summary, found):
    progress = SimpleNamespace(end=lambda: None)
    session = SimpleNamespace(blocks=SimpleNamespace(count=3), began="then", close=lambda: None)
    session.begin, session.dated = lambda jobs: progress, lambda began: ("schema", began)

    @contextmanager
    def joined(task):
        yield None

    stands = {"Session": lambda *words: session, "joined": joined, "_arrays": lambda session: "rows"}
    stands |= {"_fill": lambda *words: None, "gathered": lambda study, rows: f"groups of {rows}"}
    for name, stand in {**stands, "in_memory": lambda *words: words}.items():
        monkeypatch.setattr(run, name, stand)
    task = SimpleNamespace(study=SimpleNamespace(summary=summary), workers=1)
    assert run._run_in_memory(task) == (("schema", "then"), found)
