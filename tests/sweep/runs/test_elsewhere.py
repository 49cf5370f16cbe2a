"""Going to a cluster, and on without it."""

import math
from types import SimpleNamespace

import pytest

pytest.importorskip("distributed")

from sweep.runs import cluster
from sweep.runs.elsewhere import compute_elsewhere, joined, threads
from sweep.system.progress import TimeUp


def task_of(**changed):
    notes = []
    keys = {"cluster": "tcp://x", "without_workers": "wait", "until": "then", "workers": 3, "note": notes.append}
    return SimpleNamespace(**{**keys, **changed}), notes


@pytest.fixture
def workers(monkeypatch):
    """Stands for a cluster; it has workers, or none in time."""

    def stand(none=False):
        asked = []

        class Stand:
            def __init__(self, address):
                asked.append(address)

            def __enter__(self):
                return self

            def __exit__(self, *fault):
                asked.append("left")

            def wait(self, note, until, seconds):
                asked.append((until, seconds))
                if none:
                    raise cluster.NoWorkers

        monkeypatch.setattr(cluster, "Cluster", Stand)
        return asked

    return stand


def test_no_cluster_is_joined_where_none_is_asked_for(workers):
    asked = workers()
    with joined(task_of(cluster=None)[0]) as found:
        assert found is None
    assert asked == []


@pytest.mark.parametrize(
    ("word", "seconds"), [("wait", math.inf), ("here", cluster.LOST_SECONDS), ("end", cluster.LOST_SECONDS)]
)
def test_workers_are_waited_for_as_long_as_is_said(workers, word, seconds):
    asked = workers()
    with joined(task_of(without_workers=word)[0]) as found:
        assert found is not None
        assert asked == ["tcp://x", ("then", seconds)]
    assert asked[2:] == ["left"]


def test_where_there_are_none_it_goes_on_here_or_ends(workers):
    workers(none=True)
    task, notes = task_of(without_workers="-here".removeprefix("-"))
    with joined(task) as found:
        assert found is None
    assert notes == ["the cluster has no workers; going on here"]
    with pytest.raises(TimeUp, match=r"^the cluster has no workers$"), joined(task_of(without_workers="end")[0]):
        pass


@pytest.mark.parametrize("isolated", [True, False])
@pytest.mark.parametrize("lost", [True, False])
def test_what_is_left_is_dispatched_and_for_here_where_the_workers_are_lost(monkeypatch, isolated, lost):
    made = []
    monkeypatch.setattr("sweep.runs.dispatch.Dispatch", lambda *words: (made.append(words), "executor")[1])
    task, notes = task_of(without_workers="here")

    def compute(executor, receive):
        made.append((executor, receive))
        if lost:
            raise cluster.NoWorkers

    processes = SimpleNamespace(limits="limits") if isolated else None
    keys = {"task": task, "blocks": "blocks", "forecast": "forecast", "reused": "reused", "processes": processes}
    session = SimpleNamespace(**keys, compute_elsewhere=compute)
    assert compute_elsewhere(session, "cluster", "shared", "receive") is not lost
    limits = "limits" if isolated else None
    assert made == [
        ("cluster", task, "blocks", "forecast", "reused", "shared", limits),
        ("executor", "receive"),
    ]
    assert notes == ["the cluster has no workers; going on here"] * lost


def test_threads_are_those_of_the_cluster_or_cores_here():
    task, _ = task_of()
    assert threads(task, None) == 3
    assert threads(task, SimpleNamespace(threads=8)) == 8
    assert threads(task, SimpleNamespace(threads=0)) == 3
