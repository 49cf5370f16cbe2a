import os
import signal
import threading
import time

import pytest

from sweep.system import pool
from sweep.system.pool import BufferPool, Cores, CtrlC, Stopper, Terminated, each


def test_every_job_is_done_once_and_told():
    done, told = [], []
    each(range(100), done.append, 4, told.append)
    assert sorted(done) == sorted(j for j in told if j is not None) == list(range(100))


def test_after_a_fault_no_job_is_begun():
    begun = []

    def work(job):
        begun.append(job)
        if job == 5:
            raise ValueError("five")

    with pytest.raises(ValueError, match="five"):
        each(range(1000), work, 2, lambda job: None)
    assert len(begun) < 30


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


def test_cores_are_those_this_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0: range(3), 1: range(9)}[pid], raising=False)
    assert pool.cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    assert pool.cores() == 5
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert pool.cores() == 1
