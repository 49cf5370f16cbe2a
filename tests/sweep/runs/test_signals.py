import os
import signal
import threading
import time

import pytest

from sweep.runs.loop import signals_held


def press():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)


def test_ctrl_c_waits_until_it_may_strike():
    reached = []

    def pressed():
        with signals_held() as check:
            press()
            reached.append("the check")
            check()
            reached.append("behind it")

    with pytest.raises(KeyboardInterrupt):
        pressed()
    assert reached == ["the check"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_is_not_lost_where_nobody_checks():
    with pytest.raises(KeyboardInterrupt), signals_held():
        press()


def test_a_second_ctrl_c_strikes_at_once():
    struck = False

    def twice():
        nonlocal struck
        with signals_held():
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
        with signals_held() as check:
            press()
            check()
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [1]

    def elsewhere():
        with signals_held():
            seen.append(2)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert seen == [1, 2]
