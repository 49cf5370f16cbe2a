"""Runs on a real scheduler with worker processes on this machine; some of these are killed."""

import asyncio
import contextlib
import io
import os
import signal
import threading
import time
from datetime import datetime, timedelta
from types import SimpleNamespace

import pytest
from clusters import served
from running import kept, quiet, same, tall

import sweep
from kernels.interface import Status
from sweep.cli import main
from sweep.command.reading import explained
from sweep.errors import INCOMPLETE, SweepError
from sweep.file.store import Store
from sweep.results.statuses import account

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


@contextlib.contextmanager
def after_blocks(output, count, deed):
    """Does something as soon as so many blocks are kept."""

    def wait():
        while len(kept(output)) < count:
            time.sleep(0.01)
        deed()

    thread = threading.Thread(target=wait)
    thread.start()
    yield
    thread.join()


def continues(study, output):
    """Here, to the same bits as if it had never been anywhere else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(study, output), quiet(study))
    assert list(output.parent.iterdir()) == [output]


def test_the_command_line_takes_an_address(address, output, read, capsys):
    read("axes.height = [1.0, 2.0, 3.0]\n")
    study = str(output.parent / "fall.toml")
    arguments = ["run", study, "-o", str(output), "--allow-import", "--cluster", address]
    assert main(arguments) == 0
    assert "3 cells: 3 ok" in capsys.readouterr().out
    assert main([word for word in arguments if word != "--allow-import"]) == 2
    assert "allow it with --allow-import" in capsys.readouterr().err


def test_a_run_of_which_only_the_end_or_nothing_is_missing_needs_no_cluster(output, monkeypatch):
    def killed(self, rate):
        self.commit()
        raise SweepError("stop here")

    with monkeypatch.context() as patch:
        patch.setattr(Store, "finish", killed)
        with pytest.raises(SweepError, match="stop here"):
            quiet(tall(3), output)
    assert kept(output)
    for _ in range(2):
        with elsewhere(tall(3), output, cluster="tcp://127.0.0.1:1") as found:
            assert account(found).by_kind["ok"] == 3
    assert list(output.parent.iterdir()) == [output]


def test_a_lost_scheduler_is_one_line_and_the_run_continues(output):
    study = tall(1000, "slow:SLOW")
    with served(workers=1) as (address, process):
        lost = pytest.raises(SweepError, match=r"scheduler is lost.*same.command")
        with after_blocks(output, 5, lambda: os.killpg(process.pid, signal.SIGKILL)), lost as told:
            elsewhere(study, output, cluster=address, block_cells=4)
    assert "\n" not in str(told.value)
    assert explained(told.value).code == INCOMPLETE
    before = kept(output)
    assert len(before) >= 5
    continues(study, output)


def test_ctrl_c_or_its_time_end_a_run_on_a_cluster(client, output, monkeypatch):
    """The time is up as soon as blocks are kept: the clock is put forward then."""
    study, late = tall(1000, "slow:SLOW"), datetime.now() + timedelta(hours=2)
    keys = {"cluster": client, "block_cells": 4, "until": late - timedelta(hours=1)}
    with after_blocks(output, 3, lambda: os.kill(os.getpid(), signal.SIGINT)), pytest.raises(KeyboardInterrupt):
        elsewhere(study, output, **keys)
    before = len(kept(output))
    assert before >= 3
    clock = SimpleNamespace(now=lambda: late)
    with after_blocks(output, before + 3, lambda: monkeypatch.setattr("sweep.runs.loop.datetime", clock)):
        found = elsewhere(study, output, **keys)
    told = account(found).by_kind
    assert 4 * before < told["ok"] == 1000 - told["pending"] < 1000
    found.close()
    monkeypatch.undo()
    continues(study, output)


@pytest.mark.parametrize("where", ["tcp://127.0.0.1:1", "nonsense", "missing.json"])
def test_an_address_where_nobody_answers_is_one_clear_line(output, where, monkeypatch):
    monkeypatch.setattr("sweep.runs.cluster.CONNECT_SECONDS", 1)
    with pytest.raises(SweepError, match=r"^cluster: [^\n]*$"):
        elsewhere(tall(3), output, cluster=where)
    assert list(output.parent.iterdir()) == []


def test_a_worker_with_another_version_refuses(client, output, monkeypatch):
    real = sweep.runs.loop.fingerprint
    monkeypatch.setattr("sweep.runs.loop.fingerprint", lambda study: {**real(study), "source toy": "other"})
    with pytest.raises(SweepError, match=r"worker.*versions(.|\n)*source toy"):
        elsewhere(tall(3), output, cluster=client)


@pytest.mark.parametrize(
    ("kernel", "options", "bad"), [("bad:RAISING", {}, 1), ("bad:WORST", {"cell_timeout": 5.0}, 6)]
)
def test_a_kernel_that_fails_on_a_cluster_costs_its_cells_alone(client, output, kernel, options, bad):
    with elsewhere(tall(100, kernel), output, cluster=client, block_cells=10, **options) as found:
        assert found.height.values[found.status.values == Status.FAILED].tolist() == [
            11.0 * k for k in range(1, bad + 1)
        ]
        assert account(found).by_kind["ok"] == 100 - bad


def test_workers_killed_in_the_middle_cost_nothing_but_time(client, output, monkeypatch):
    study, until = tall(400, "slow:SLOW"), datetime.now() + timedelta(seconds=100)

    def kill():
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

    with after_blocks(output, 3, kill):
        found = elsewhere(study, output, cluster=client, block_cells=4, until=until)
    with found:
        monkeypatch.setattr("slow.CELL_SECONDS", 0.0)
        same(found, quiet(study))
    assert sweep.verify(output).whole


def test_a_block_of_which_every_worker_dies_ends_the_run_and_is_named(output):
    """On a cluster of its own, for dask may begin no worker anew in place of one that dies while it begins."""
    study, until = tall(60, "slow:LETHAL"), datetime.now() + timedelta(seconds=300)
    refused = pytest.raises(SweepError, match=r"12 to 13.*KilledWorker.*isolated")
    with served(workers=2, failures=0) as (address, _), refused:
        elsewhere(study, output, cluster=address, block_cells=1, until=until)
    same(quiet(study, output), quiet(study))  # nobody dies of it here


def test_what_is_given_up_does_not_end_what_dask_fetches_together_with_it():
    pytest.importorskip("distributed")
    from sweep.runs.cluster import answer

    class Asked:
        """One of dask's futures, whose result comes together with those of others."""

        def __init__(self, together):
            self.together, self.released = together, False

        def __await__(self):
            return self.together.__await__()

        def release(self):
            self.released = True

    async def fetched():
        together = asyncio.get_running_loop().create_future()
        asked = Asked(together), Asked(together)
        given_up, wanted = (asyncio.create_task(answer(one)) for one in asked)
        await asyncio.sleep(0.01)
        given_up.cancel()
        await asyncio.wait([given_up])
        together.set_result(1)
        return await wanted, given_up.cancelled(), [one.released for one in asked]

    assert asyncio.run(fetched()) == (1, True, [True, False])


def test_a_cluster_without_workers_is_waited_for_and_says_so(output):
    log, until = io.StringIO(), datetime.now() + timedelta(seconds=2)
    keys = {"until": until, "progress": log}
    with served(workers=0) as (address, _), elsewhere(tall(30), output, cluster=address, **keys) as found:
        assert account(found).by_kind["pending"] == 30
    assert "the cluster has no workers" in log.getvalue()


def test_workers_that_see_the_file_write_large_blocks_themselves(client, output, monkeypatch):
    """What the run is sent of them is digests alone."""
    real, sent = Store.put, []
    monkeypatch.setattr(Store, "put", lambda self, job, found: (sent.append(type(found)), real(self, job, found))[1])
    study = tall(20_000)
    with elsewhere(study, output, cluster=client, block_cells=5000) as found:
        same(found, quiet(study))
    assert sent == [bytes] * 4
    assert sweep.verify(output).whole
