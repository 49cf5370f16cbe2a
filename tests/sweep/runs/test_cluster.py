"""Runs on a real scheduler with worker processes on this machine; some of these are killed."""

import contextlib
import dataclasses
import gc
import io
import os
import signal
import sys
import threading
import time
from concurrent.futures import Future
from datetime import datetime, timedelta

import numpy as np
import pytest
import toy_studies
from clusters import served
from running import kept, quiet, same, tall

import sweep
from sweep.cli import main
from sweep.command.outcome import explained
from sweep.results.statuses import account
from sweep.results.verify import verify
from sweep.runs import cluster as clusters
from sweep.runs import dispatch, worker
from sweep.store import frame
from sweep.store.store import Store, opened, unfinished_of
from sweep.system.errors import INCOMPLETE, SweepError

# a lost connection is what some of these tests are about; dask leaves its sockets to the collector
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(scope="module")
def address():
    """A scheduler with two workers, which gives a task up when two workers have died of it."""
    with served(workers=2, failures=1) as (address, _):
        yield address


@pytest.fixture(scope="module")
def client(address):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(address, set_as_default=False) as client:
        yield client


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


def elsewhere(study, path=None, **keys):
    return sweep.run(study, path, **{"progress": False, **keys})


@pytest.fixture
def pages(monkeypatch):
    """Every chunk has a page for itself, however short."""
    monkeypatch.setattr(frame, "SHARED_WORTH_A_PAGE", 1)


def hide(monkeypatch):
    """Workers do not see the file."""
    real = Store.shared
    monkeypatch.setattr(Store, "shared", lambda self: dataclasses.replace(real(self), path="/nowhere/out.h5"))


KINDS = {
    "cells": {"outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5, 1.0]}},
    "summary": {"summary": {"over": ["height"], "outputs": {"fall_time": ["min", "mean", "argmax"]}}},
}


def stones(kind, count=41):
    return toy_studies.build(axes={"v0": [0.0, 2.0, np.nan], "height": np.arange(-1.0, count)}, **KINDS[kind])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", ["memory", "shared folder", "no shared folder"])
def test_the_same_bits_wherever_the_cells_are_computed(client, output, monkeypatch, pages, kind, place):
    if place == "no shared folder":
        hide(monkeypatch)
    sent = []
    monkeypatch.setattr(
        dispatch.Dispatch,
        "_checked",
        lambda self, job, s, real=dispatch.Dispatch._checked: sent.append(job) or real(self, job, s),
    )
    path = None if place == "memory" else output
    with elsewhere(stones(kind), path, cluster=client, block_cells=10) as found:
        same(found, quiet(stones(kind)))
    assert bool(sent) == (place != "shared folder")
    assert place == "memory" or (list(output.parent.iterdir()) == [output] and verify(output).whole)


@pytest.mark.parametrize("shared", [True, False])
def test_an_extension_sends_only_new_cells_out(client, output, monkeypatch, pages, shared):
    if not shared:
        hide(monkeypatch)
    more = toy_studies.build(axes={"height": np.sort(np.r_[np.arange(1.0, 21), np.arange(10.5, 40)])})
    few = toy_studies.build(axes={"height": np.arange(1.0, 21)})
    quiet(few, output).close()
    bits = []
    real = dispatch.Dispatch._mask
    monkeypatch.setattr(dispatch.Dispatch, "_mask", lambda self, job: bits.append(real(self, job)) or bits[-1])
    with elsewhere(more, output, cluster=client, extend=True, block_cells=4) as found:
        same(found, quiet(more))
    assert sum(np.unpackbits(np.frombuffer(b, np.uint8)).sum() for b in bits) == 30


def test_the_command_line_takes_an_address(address, output, read, capsys):
    read("axes.height = [1.0, 2.0, 3.0]\n")
    study = str(output.parent / "fall.toml")
    arguments = ["run", study, "-o", str(output), "--allow-import", "--cluster", address]
    assert main(arguments) == 0
    assert "3 cells: 3 ok" in capsys.readouterr().out
    assert main([*arguments, "--workers", "2"]) == 2
    assert "a cluster brings its own workers" in capsys.readouterr().err
    assert main([word for word in arguments if word != "--allow-import"]) == 2
    assert "allow it with --allow-import" in capsys.readouterr().err


@pytest.mark.parametrize("where", ["tcp://127.0.0.1:1", "nonsense", "", "tls://127.0.0.1:1", "missing.json"])
def test_an_address_where_nobody_answers_is_one_clear_line(output, monkeypatch, where):
    monkeypatch.setattr(clusters, "CONNECT_SECONDS", 0.5)
    before = clients()
    with pytest.raises(SweepError, match=r"^cluster: ") as told:
        elsewhere(tall(3), output, cluster=where)
    assert "\n" not in str(told.value)
    assert list(output.parent.iterdir()) == []
    assert clients() <= before  # one that is left to be collected later may hang what begins then


def clients():
    """The clients there are; while this set lives, none of them ends."""
    return {found for found in gc.get_objects() if isinstance(found, clusters.distributed.Client)}


def test_a_missing_package_is_told_with_its_cure(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "sweep.runs.cluster")
    with pytest.raises(SweepError, match=r"foliot\[cluster\]"):
        elsewhere(tall(3), cluster="tcp://127.0.0.1:1")


def test_nothing_is_asked_of_a_cluster_where_nothing_is_left_to_compute(output):
    quiet(tall(3), output).close()
    with elsewhere(tall(3), output, cluster="tcp://127.0.0.1:1") as found:
        assert found.sizes["height"] == 3


def test_a_worker_with_another_version_refuses(client, output, monkeypatch):
    real = sweep.runs.run.fingerprint
    monkeypatch.setattr("sweep.runs.run.fingerprint", lambda study: {**real(study), "source toy": "other"})
    with pytest.raises(SweepError, match=r"what computes there is not(.|\n)*source toy: changed"):
        elsewhere(tall(3), output, cluster=client)


def pids(client):
    return list(client.run(os.getpid).values())


def kill_a_worker(client, path):
    """Kills a worker, once some parts are there."""
    while len(kept(path)) < 3:
        time.sleep(0.01)
    os.kill(pids(client)[0], signal.SIGKILL)


def soon():
    """When a test is given up."""
    return datetime.now() + timedelta(seconds=100)


@pytest.mark.parametrize("shared", [True, False])
def test_workers_killed_in_the_middle_cost_nothing_but_time(client, output, monkeypatch, pages, shared):
    if not shared:
        hide(monkeypatch)
    study = tall(400, "slow:SLOW")
    killer = threading.Thread(target=kill_a_worker, args=(client, output))
    killer.start()
    try:
        with (
            elsewhere(study, output, cluster=client, block_cells=4, until=soon()) as found,
            pytest.MonkeyPatch.context() as patch,
        ):
            patch.setattr("slow.CELL_SECONDS", 0.0)
            same(found, quiet(study))
    finally:
        killer.join()
    assert verify(output).whole


def test_a_block_that_kills_its_workers_is_reported_when_all_others_are_done(client, output):
    log = io.StringIO()
    study = tall(60, "slow:LETHAL")
    with pytest.raises(SweepError, match="cells 12 to 13: every worker that took them died"):
        elsewhere(study, output, cluster=client, block_cells=1, progress=log, until=soon())
    assert set(kept(output)) == set(range(60)) - {12}
    assert "tried again at the end" in log.getvalue()
    # nobody dies of it here
    same(quiet(study, output), quiet(study))


def test_a_lost_scheduler_is_one_line_and_the_run_continues(output):
    study = tall(1000, "slow:SLOW")
    with served(workers=2) as (address, process):

        def kill():
            while len(kept(output)) < 5:
                time.sleep(0.01)
            os.killpg(process.pid, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        with pytest.raises(SweepError, match=r"the scheduler is lost.*run the same command again") as told:
            elsewhere(study, output, cluster=address, block_cells=4)
        killer.join()
    assert "\n" not in str(told.value)
    assert explained(told.value).code == INCOMPLETE
    before = kept(output)
    assert len(before) >= 5
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(study, output), quiet(study))
    assert list(output.parent.iterdir()) == [output]


def test_a_worker_that_comes_too_late_writes_to_no_other_file(output, pages):
    """It keeps the file that it was told of, whatever stands in its place by then."""
    with begun(output) as store:
        shared = store.shared()
        fd = shared.opened()
        store.discard()
    unfinished_of(output).write_bytes(b"another")
    shared.table.write(fd, 0, {place.name: place.empty(10) for place in shared.table.places})
    os.close(fd)
    assert unfinished_of(output).read_bytes() == b"another"
    assert shared.opened() is None


def test_a_worker_that_answers_nonsense_is_refused(output, pages):
    with begun(output) as store, pytest.raises(SweepError, match="something else than it was asked for"):
        store.take(1, b"../../etc/passwd")


def test_a_worker_that_finds_another_file_sends_its_numbers(output, pages):
    with begun(output) as store:
        shared = store.shared()
        assert dataclasses.replace(shared, key="0" * 32).opened() is None
        fd = shared.opened()
        assert fd is not None
        os.close(fd)


def test_blocks_that_share_a_page_are_sent(output):
    with begun(output) as store:
        assert store.shared() is None


@contextlib.contextmanager
def begun(output):
    """The store of a run that has just begun."""
    study = tall(30)
    schema = sweep.cells.output_schema.output_schema(study, {})
    cuts = frame.cuts_of(study, schema, sweep.cells.partition.Partition(30, 10))
    with opened(output) as store:
        store.begin(frame.Frame(schema, cuts, {}, "now", shared=True))
        yield store


def test_numbers_that_were_damaged_on_their_way_are_refused(client, output, monkeypatch):
    real = dispatch.Dispatch._checked

    def harmed(self, job, sent):
        arrays = {name: column.copy() for name, column in sent.arrays.items()}
        arrays["fall_time"][0] += 1
        return real(self, job, worker.Sent(sent.digest, arrays))

    monkeypatch.setattr(dispatch.Dispatch, "_checked", harmed)
    with pytest.raises(SweepError, match="damaged on their way"):
        elsewhere(tall(3), cluster=client)


def test_a_run_on_a_cluster_ends_at_its_time_and_continues(client, output):
    study = tall(10_000, "slow:SLOW")  # ten seconds of two workers at the least
    begun = datetime.now()
    with elsewhere(study, output, cluster=client, block_cells=40, until=begun + timedelta(seconds=2)) as found:
        told = account(found)
    assert 0 < told.ok < 10_000
    assert told.ok + told.pending == 10_000
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(study, output), quiet(study))
    assert list(output.parent.iterdir()) == [output]


@pytest.mark.parametrize(("times", "lethal"), [(1, False), (3, False), (99, True)])
def test_an_answer_that_gets_lost_in_the_executor_is_asked_for_again(client, monkeypatch, times, lethal):
    lost, real = [], clusters.Cluster.submit

    def submit(self, executor, run, batch, masks):
        future = real(self, executor, run, batch, masks)
        if 7 in batch and len(lost) < times:
            lost.append(batch)
            future = Future()
            future.set_exception(TypeError("cannot unpack non-iterable Answer object"))
        return future

    monkeypatch.setattr(clusters.Cluster, "submit", submit)
    if lethal:
        with pytest.raises(SweepError, match="cells 7 to 8: every worker"):
            elsewhere(tall(20), cluster=client, block_cells=1)
    else:
        same(elsewhere(tall(20), cluster=client, block_cells=1), quiet(tall(20)))
    assert len(lost) == min(times, 1 + dispatch.MOST_ROUNDS)


def test_ctrl_c_ends_a_run_on_a_cluster(client, output):
    study = tall(1000, "slow:SLOW")

    def press():
        while len(kept(output)) < 3:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        elsewhere(study, output, cluster=client, block_cells=4)
    thread.join()
    assert kept(output)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(study, output), quiet(study))
    assert list(output.parent.iterdir()) == [output]
