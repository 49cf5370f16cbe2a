"""Clusters whose workers go, come late, or are made for what there is to do; and the recipes of the README."""

import io
import threading
import time
from datetime import datetime, timedelta

import pytest
from running import quiet, same, tall

from sweep.results.statuses import account
from sweep.runs.cluster import LOST_SECONDS, Absence, NoWorkers
from sweep.system.errors import SweepError

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings(
    "ignore::ResourceWarning",
    "ignore::pytest.PytestUnraisableExceptionWarning",
    r"ignore:\s*Port",  # of another cluster on this machine
)


def fast(study):
    """The bits of a study, at once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        return quiet(study)


@pytest.fixture
def cluster():
    """Workers of this machine, none at first."""
    with distributed.LocalCluster(
        n_workers=0, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


@pytest.fixture
def soon_lost(monkeypatch):
    """A cluster without workers is lost after a fifth of the seconds that users wait."""
    assert LOST_SECONDS + 2 <= 10
    monkeypatch.setattr("sweep.runs.dispatch.LOST_SECONDS", LOST_SECONDS / 5)
    return LOST_SECONDS / 5


def soon():
    return datetime.now() + timedelta(seconds=120)


def scaled_down(cluster, log):
    """Takes all workers away once some cells are done; returns the thread that does, and when it did."""
    when = []

    def scale():
        while " cells (" not in log.getvalue() and time.monotonic() < begun + 60:
            time.sleep(0.05)
        time.sleep(0.5)
        when.append(time.monotonic())
        cluster.scale(0)

    begun = time.monotonic()
    thread = threading.Thread(target=scale)
    thread.start()
    return thread, when


class Timed(io.StringIO):
    """A stream that notes when a text was written."""

    def __init__(self, text):
        super().__init__()
        self.text, self.at = text, None

    def write(self, text):
        if self.text in text and self.at is None:
            self.at = time.monotonic()
        return super().write(text)


def test_a_cluster_that_lost_its_workers_says_so_within_ten_seconds_and_goes_on_here(cluster, soon_lost, tmp_path):
    cluster.scale(2)
    log, study = Timed("no workers; going on here"), tall(4000, "slow:SLOW")
    thread, when = scaled_down(cluster, log)
    keys = {"workers": None, "cluster": cluster, "block_cells": 20, "progress": log, "until": soon()}
    with quiet(study, tmp_path / "out.h5", without_workers="here", **keys) as found:
        thread.join()
        assert account(found).ok == 4000
        same(found, fast(study))
    assert log.at - when[0] < soon_lost + 4
    assert list(tmp_path.iterdir()) == [tmp_path / "out.h5"]


def test_or_it_ends_and_the_same_command_continues(cluster, soon_lost, tmp_path):
    cluster.scale(1)
    log, study, output = Timed("stopped, for the cluster has no workers"), tall(6000, "slow:SLOW"), tmp_path / "out.h5"
    thread, when = scaled_down(cluster, log)
    keys = {"workers": None, "cluster": cluster, "block_cells": 20, "progress": log, "until": soon()}
    found = quiet(study, output, without_workers="end", **keys)
    thread.join()
    assert 0 < account(found).ok < 6000
    assert log.at - when[0] < soon_lost + 4
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(study, output), quiet(study))


def test_a_cluster_that_never_had_a_worker_is_not_waited_for_where_that_is_not_wanted(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("sweep.runs.cluster.LOST_SECONDS", 0.5)
    keys = {"workers": None, "cluster": cluster}
    same(quiet(tall(30), without_workers="here", **keys), quiet(tall(30)))
    with pytest.raises(SweepError, match="the cluster has no workers; give a path"):
        quiet(tall(30), without_workers="end", **keys)
    with pytest.raises(SweepError, match='without_workers: expected "wait", "here" or "end"'):
        quiet(tall(30), without_workers="cry", **keys)


def test_a_cluster_that_adapts_makes_workers_for_a_run_that_waits_for_them(cluster, tmp_path):
    cluster.adapt(minimum=0, maximum=2, interval="200 ms")
    study = tall(1500, "slow:SLOW")
    most, over = [0], threading.Event()

    def watch():
        while not over.wait(0.1):
            most[0] = max(most[0], len(cluster.workers))

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        found = quiet(study, tmp_path / "out.h5", workers=None, cluster=cluster, until=soon())
    finally:
        over.set()
        thread.join()
    same(found, fast(study))
    assert most[0] >= 1


def test_absence_is_told_once_and_counts_from_its_beginning(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    absence = Absence(8.0)
    told = []
    for now[0], none in [(0, False), (1, True), (8, True), (9, False), (20, True), (27, True)]:
        told.append(absence.check(none))
    assert told == [False, True, False, False, True, False]
    now[0] = 29
    with pytest.raises(NoWorkers):
        absence.check(True)
