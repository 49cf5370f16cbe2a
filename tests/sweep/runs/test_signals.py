import os
import signal
import threading
import time

import pytest

from sweep.errors import signals_held


def press():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)


@pytest.mark.parametrize("doings", ["press check", "press", "press press"])
def test_ctrl_c_waits_until_it_may_strike_or_the_end_and_a_second_one_strikes_at_once(doings):
    reached = []

    def run():
        with signals_held() as check:
            for doing in doings.split():
                reached.append(doing)
                press() if doing == "press" else check()
            reached.append("behind it")

    with pytest.raises(KeyboardInterrupt):
        run()
    assert reached == [*doings.split(), *["behind it"] * (doings == "press")]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


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
