import os
import signal
import threading
import time

import pytest

from sweep.runs.pool import CtrlC, Terminated, each


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
