import os
import signal
import threading
import time
from concurrent.futures import Future

import numpy as np
import pytest

from sweep.system import pool
from sweep.system.errors import SweepError
from sweep.system.pool import BufferPool, Cores, CtrlC, Stopper, Terminated, each, through, whole_number


def test_every_job_is_done_once_and_told():
    done, told = [], []
    each(range(100), done.append, 4, told.append)
    assert sorted(done) == sorted(j for j in told if j is not None) == list(range(100))


def test_jobs_are_submitted_a_few_at_a_time():
    taken, told = [], []

    def jobs():
        for job in range(1000):
            taken.append(job)
            yield job

    def finished(job):
        if job is not None:
            told.append(job)
        assert len(taken) - len(told) <= 2 * 3

    each(jobs(), lambda job: None, 3, finished)
    assert len(told) == 1000


def test_after_a_fault_no_job_is_begun():
    begun = []

    def work(job):
        begun.append(job)
        if job == 5:
            raise ValueError("five")

    with pytest.raises(ValueError, match="five"):
        each(range(1000), work, 2, lambda job: None)
    assert len(begun) < 30


def test_a_halt_lets_in_no_more_than_its_slots_and_nobody_afterwards():
    stopper = Stopper(2)
    inside, most = [], []

    def enter():
        inside.append(1)
        most.append(len(inside))
        time.sleep(0.005)
        inside.pop()

    threads = [threading.Thread(target=stopper.compute, args=(enter,)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(most) == 8
    assert max(most) == 2
    stopper.set()
    assert not stopper.compute(enter)
    assert len(most) == 8


def press():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)


def test_ctrl_c_waits_until_it_may_strike():
    reached = []

    def pressed():
        with CtrlC() as ctrl_c:
            press()
            reached.append("the check")
            ctrl_c.check()
            reached.append("behind it")

    with pytest.raises(KeyboardInterrupt):
        pressed()
    assert reached == ["the check"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_is_not_lost_where_nobody_checks():
    with pytest.raises(KeyboardInterrupt), CtrlC():
        press()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_strikes_within_is_held_back_to_the_next_check_of_any(number):
    reached = []

    def pressed():
        with CtrlC() as outer:
            with CtrlC():
                pass
            os.kill(os.getpid(), number)
            time.sleep(0.01)
            reached.append(signal.getsignal(number))
            with CtrlC() as inner:
                reached.append("within")
                inner.check()
                reached.append("behind the check")
            outer.check()

    with pytest.raises((KeyboardInterrupt, Terminated)):
        pressed()
    assert reached == [CtrlC.OWN[number], "within"]
    with CtrlC() as ctrl_c:
        ctrl_c.check()


def test_a_second_ctrl_c_strikes_at_once():
    struck = False

    def twice():
        nonlocal struck
        with CtrlC():
            press()
            try:
                press()
            except KeyboardInterrupt:
                struck = True

    with pytest.raises(KeyboardInterrupt):
        twice()
    assert struck


def test_handlers_of_others_and_other_threads_are_left_alone():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(1))
    try:
        with CtrlC() as ctrl_c:
            press()
            ctrl_c.check()
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [1]

    def elsewhere():
        with CtrlC():
            seen.append(2)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert seen == [1, 2]


def test_ctrl_c_ends_a_run_after_the_jobs_at_work():
    ended = []

    def work(job):
        if job == 3:
            os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        ended.append(job)

    with pytest.raises(KeyboardInterrupt):
        each(range(1000), work, 2, lambda job: None)
    assert 4 <= len(ended) < 100


def test_signals_change_how_many_compute_at_once():
    cores, most, inside = Cores(1), [0], []
    before = signal.getsignal(signal.SIGUSR1)

    def work(job):
        def compute():
            inside.append(job)
            most[-1] = max(most[-1], len(inside))
            time.sleep(0.01)
            inside.remove(job)

        stopper.compute(compute)

    def finished(job):
        if job in (20, 60):
            os.kill(os.getpid(), signal.SIGUSR1 if job == 20 else signal.SIGUSR2)
        if job in (40, 100):
            most.append(0)

    stopper = Stopper(cores)
    with cores.told_by_signals():
        each(range(150), work, 6, finished, stopper, lambda: 2 * cores.count)
        assert cores.count == 1
        os.kill(os.getpid(), signal.SIGUSR2)
        assert cores.count == 1
    assert most[0] <= 2
    assert most[1:] == [2, 1]
    assert signal.getsignal(signal.SIGUSR1) is before


def test_a_job_that_does_not_end_is_killed_or_given_up(monkeypatch):
    monkeypatch.setattr(pool, "GRACE_SECONDS", 0.1)
    monkeypatch.setattr(pool, "KILL_SECONDS", 0.1)
    monkeypatch.setattr(pool, "_endless", threading.Event())
    wanted, killed, free = [], [], threading.Event()

    def work(job):
        wanted.append(stopper.compute(lambda: free.wait(20)))

    def finished(job):
        raise KeyboardInterrupt

    stopper = Stopper(1, kill=lambda: (killed.append(1), free.set()))
    with pytest.raises(KeyboardInterrupt):
        each([0], work, 1, finished, stopper)
    assert (killed, wanted, pool.left_behind()) == ([1], [True], False)
    free.clear()
    stopper = Stopper(1)
    with pytest.raises(KeyboardInterrupt):
        each([0], work, 1, finished, stopper)
    assert pool.left_behind()
    free.set()
    time.sleep(0.1)
    assert wanted == [True, False]


def test_what_is_borrowed_comes_back_and_more_is_made_only_where_there_is_too_little():
    made = []

    def make():
        made.append(len(made))
        return made[-1]

    buffers = BufferPool(make, 1)
    assert made == [0]
    with buffers.borrow() as one:
        assert one == 0
        with buffers.borrow() as two:
            assert two == 1
    with pytest.raises(ValueError, match="lost"), buffers.borrow() as one:
        raise ValueError("lost")
    with buffers.borrow() as one, buffers.borrow() as two:
        assert {one, two} == {0, 1}
    assert made == [0, 1]


@pytest.mark.parametrize("capacity", [1, 3])
def test_no_more_are_submitted_at_a_time_than_there_is_room_for(capacity):
    told, ends = [], []

    def submit(job):
        told.append(("submit", job))
        future = Future()
        future.set_result(10 * job)
        return future

    def settled(job, future):
        ends.append(None if job is None else (job, future.result()))
        told.append(("settled", job))

    through(range(4), submit, lambda: capacity, settled, lambda: told.append("stop"), CtrlC())
    assert sorted(e for e in ends if e is not None) == [(k, 10 * k) for k in range(4)]
    assert [one for one in told if one[0] == "submit"] == [("submit", k) for k in range(4)]
    first = told.index(("settled", None))
    assert sum(one[0] == "submit" for one in told[:first]) == capacity
    assert "stop" not in told


def test_a_fault_stops_before_it_goes_on():
    told = []

    def submit(job):
        future = Future()
        future.set_result(job)
        return future

    def settled(job, future):
        told.append(job)
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        through(range(4), submit, lambda: 2, settled, lambda: told.append("stop"), CtrlC())
    assert told[-1] == "stop"
    assert len(told) == 2


def test_a_process_told_to_end_has_the_usual_status():
    assert Terminated().code == 143


@pytest.mark.parametrize("number", [1, 7, np.int64(3)])
def test_a_whole_number_is_taken(number):
    found = whole_number("workers", number)
    assert (found, type(found)) == (number, int)


@pytest.mark.parametrize("number", [0, -1, 1.0, True, "2", None, np.int64(0)])
def test_what_is_no_whole_number_is_told(number):
    with pytest.raises(SweepError, match="workers: expected a whole number from 1 on, found "):
        whole_number("workers", number)


def test_cores_are_those_this_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0: range(3), 1: range(9)}[pid], raising=False)
    assert pool.cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    assert pool.cores() == 5
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert pool.cores() == 1
