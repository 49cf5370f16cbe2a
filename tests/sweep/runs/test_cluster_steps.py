"""What is asked of a dask client, and what is said where it does not answer; no scheduler is there."""

import logging
from datetime import datetime, timedelta
from types import SimpleNamespace

import pytest

pytest.importorskip("distributed")

from sweep.runs import cluster as module
from sweep.runs.cluster import Absence, Cluster, NoWorkers
from sweep.system.errors import SweepError


class Client(module.distributed.Client):
    """Stands for a client; writes down what it is asked."""

    def __init__(self, threads=(), faults=()):
        self.told, self.left, self.faults = [], list(threads), list(faults)

    def __del__(self):
        pass

    @property
    def asynchronous(self):
        return False

    def nthreads(self):
        self.told.append("nthreads")
        found = self.left.pop(0) if self.left else {}
        if isinstance(found, Exception):
            raise found
        return found

    def submit(self, function, pure):
        self.told.append(("submit", function, pure))
        return SimpleNamespace(release=lambda: self.told.append("release"))

    def register_plugin(self, plugin, name):
        self.told.append(("register", plugin.assignment, name))
        if self.faults:
            raise self.faults.pop(0)

    def unregister_worker_plugin(self, name):
        self.told.append(("unregister", name))
        raise ValueError("gone")

    def get_executor(self, pure):
        return ("executor", pure)

    def close(self, timeout):
        self.told.append(("close", timeout))
        raise ValueError("gone")


@pytest.fixture
def clock(monkeypatch):
    """Time that goes by where somebody sleeps."""
    hand = SimpleNamespace(now=100.0)

    def sleep(seconds):
        hand.now += seconds

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: hand.now, sleep=sleep))
    return hand


def test_workers_are_counted_every_two_seconds(clock):
    client = Client([{"a": 2, "b": 3}, {"a": 1}])
    found = Cluster(client)
    assert found.threads == 5
    clock.now += 2.0
    assert (found.threads, len(client.told)) == (5, 1)
    clock.now += 0.1
    assert (found.threads, len(client.told)) == (1, 2)


def test_a_scheduler_that_does_not_answer_is_lost(clock):
    found = Cluster(Client([ValueError("no answer\nat all")]))
    with pytest.raises(SweepError) as fault:
        _ = found.threads
    assert str(fault.value) == (
        "cluster: the scheduler is lost (no answer); what is finished is kept, run the same command again to continue"
    )
    assert found._gone is True
    assert "(ValueError)" in str(found.lost(ValueError()))
    assert "(ValueError)" in str(found.lost(ValueError("\nbehind an empty line")))


def test_where_there_are_workers_nothing_is_waited_for(clock):
    client, notes = Client([{"a": 1}]), []
    Cluster(client).wait(notes.append, None)
    assert (notes, client.told) == ([], ["nthreads"])


def test_the_first_worker_is_waited_for(clock):
    client, notes = Client([{}, {}, {"a": 1}]), []
    Cluster(client).wait(notes.append, None)
    assert notes == ["the cluster has no workers yet; waiting for the first"]
    assert client.told == ["nthreads", ("submit", module.os.getpid, False), "nthreads", "nthreads", "release"]
    assert 104.0 < clock.now < 105.0


@pytest.mark.parametrize("late", [True, False])
def test_workers_are_waited_for_no_longer_than_is_said(clock, late):
    client = Client()
    if late:
        Cluster(client).wait(lambda text: None, datetime.now().astimezone() - timedelta(seconds=1))
        assert clock.now == 100.0
    else:
        with pytest.raises(NoWorkers):
            Cluster(client).wait(lambda text: None, None, 5.1)
        assert clock.now == pytest.approx(105.2)


def test_workers_are_missing_from_when_they_first_were(clock):
    absence = Absence(5.0)
    assert absence.check(False) is False
    assert absence.check(True) is True
    clock.now += 5.0
    assert absence.check(True) is False
    assert absence.check(False) is False
    clock.now += 5.0
    assert absence.check(True) is True
    clock.now += 5.1
    with pytest.raises(NoWorkers):
        absence.check(True)


ASSIGNMENT = SimpleNamespace(run="r")


@pytest.mark.parametrize("gone", [True, False])
def test_workers_know_of_a_run_as_long_as_it_lasts(clock, gone):
    client = Client()
    found = Cluster(client)
    with found.introduced(ASSIGNMENT):
        assert client.told == [("register", ASSIGNMENT, "r")]
        found._gone = gone
    assert client.told[1:] == ([] if gone else [("unregister", "r")])


@pytest.mark.parametrize(("times", "lost"), [(4, False), (5, True)])
def test_workers_that_leave_meanwhile_are_told_again(clock, times, lost):
    client = Client(faults=[OSError("left")] * times)
    if lost:
        with pytest.raises(SweepError, match=r"^cluster: the scheduler is lost \(left\)"):
            Cluster(client)._introduce(ASSIGNMENT)
    else:
        Cluster(client)._introduce(ASSIGNMENT)
    assert [what for what in client.told if what != "nthreads"] == [("register", ASSIGNMENT, "r")] * 5
    assert client.told.count("nthreads") == 4


def test_a_worker_that_cannot_take_part_is_told():
    with pytest.raises(SweepError) as fault:
        Cluster(Client(faults=[ImportError("no foliot")]))._introduce(ASSIGNMENT)
    assert str(fault.value) == (
        "cluster: a worker cannot take part (ImportError: no foliot); every machine of the cluster needs the same "
        "version of foliot"
    )


def test_blocks_are_submitted_and_taken_back():
    found, told = Cluster(Client()), []
    executor = SimpleNamespace(submit=lambda *words: words, shutdown=lambda wait: told.append(wait))
    assert found.executor() == ("executor", False)
    assert found.submit(executor, "r", [1]) == (module.worker.compute, "r", [1])
    found.cancel(executor)
    assert told == [False]
    executor.submit = None
    with pytest.raises(SweepError, match=r"^cluster: the scheduler is lost"):
        found.submit(executor, "r", [1])
    found.cancel(executor)
    assert told == [False]


@pytest.mark.parametrize(("own", "gone", "closed"), [(False, False, []), (True, False, [10]), (True, True, [0.1])])
def test_a_client_of_its_own_is_closed(monkeypatch, own, gone, closed):
    client = Client()
    monkeypatch.setattr(module, "_connected", lambda address: client)
    with Cluster("tcp://x" if own else client) as found:
        found._gone = gone
    assert client.told == [("close", seconds) for seconds in closed]


def test_a_client_that_is_asynchronous_is_refused(monkeypatch):
    monkeypatch.setattr(Client, "asynchronous", True)
    with pytest.raises(SweepError, match=r"^cluster: the client is asynchronous; pass one that is not$"):
        Cluster(Client())


@pytest.fixture
def connects(monkeypatch):
    """What clients are made of; what they fail with."""
    made, faults = [], []

    def client(**keys):
        made.append(keys)
        if faults:
            raise faults[0]
        return "client"

    monkeypatch.setattr(module, "distributed", SimpleNamespace(Client=client))
    level = logging.getLogger("distributed").level
    yield made, faults
    logging.getLogger("distributed").setLevel(level)


def test_a_scheduler_is_found_by_its_address_or_its_file(connects, tmp_path):
    made, _ = connects
    file = tmp_path / "s.json"
    file.write_text("{}")
    for address, keys in (
        ("tcp://x", {"address": "tcp://x"}),
        (file, {"scheduler_file": str(file)}),
        (str(file), {"scheduler_file": str(file)}),
        (None, {"address": None}),
    ):
        logging.getLogger("distributed").setLevel(logging.INFO)
        assert module._connected(address) == "client"
        assert made[-1] == {**keys, "timeout": 10, "set_as_default": False}
        silent = logging.getLogger("distributed").level == logging.CRITICAL
        assert silent is isinstance(address, str)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        (" ", "cluster: expected an address such as tcp://10.0.0.1:8786, found nothing"),
        ("/none/s.json", "cluster: there is no scheduler file /none/s.json"),
        ("tcp://x", "cluster: no dask scheduler answers at tcp://x (OSError)"),
    ],
)
def test_where_nobody_answers_is_told(connects, address, said):
    connects[1].append(OSError("\nmore"))
    with pytest.raises(SweepError) as fault:
        module._connected(address)
    assert str(fault.value) == said
