"""A log that is followed: which lines are told, how long it is waited for, and why cells FAILED."""

import pytest

from sweep.show.follow import LOOK_SECONDS, SILENT_SECONDS, follow, reasons
from sweep.system.errors import SweepError


def line(k, text=None):
    return f"2026-01-01 00:00:{k:02}  {text or f'line {k}'}\n"


@pytest.fixture
def log(tmp_path):
    return tmp_path / "x.h5.log"


def told(log, *later):
    """What is told, where each pause adds the next of `later` to the log; and the pauses."""
    pauses, waiting = [], list(later)

    def sleep(seconds):
        pauses.append(seconds)
        if waiting:
            log.write_text(log.read_text() + waiting.pop(0))

    return list(follow(log.with_suffix(""), sleep)), pauses


def test_the_last_ten_lines_are_told_and_an_ended_run_is_not_waited_for(log):
    log.write_text("".join(line(k) for k in range(12)) + line(12, "ended with 3 cells"))
    said, pauses = told(log)
    assert said == [line(k).strip() for k in range(3, 12)] + [line(12, "ended with 3 cells").strip()]
    assert pauses == []


def test_each_new_line_is_told_once(log):
    log.write_text(line(0))
    said, pauses = told(log, line(1), "", line(2) + line(3), line(4, "ended with 1 cells"))
    assert said == [*(line(k).strip() for k in range(4)), line(4, "ended with 1 cells").strip()]
    assert pauses == [LOOK_SECONDS] * 4


def test_all_new_lines_are_told_however_many(log):
    log.write_text(line(0))
    said, _ = told(log, "".join(line(k) for k in range(1, 30)), line(30, "ended with 1 cells"))
    assert len(said) == 31


def test_a_log_that_is_silent_for_ten_minutes_is_given_up(log):
    log.write_text(line(0))
    pauses = []
    with pytest.raises(SweepError, match=r"x\.h5\.log: nothing new for 600 s; its run was killed"):
        list(follow(log.with_suffix(""), pauses.append))
    assert sum(pauses) == SILENT_SECONDS == 600


def test_a_line_begins_the_wait_anew(log):
    """Even one of the last half second."""
    log.write_text(line(0))
    said, pauses = told(log, *[""] * 1199, line(1), *[""] * 1199, line(2, "ended with 1 cells"))
    assert (len(said), len(pauses)) == (3, 2400)


def test_without_a_log_there_is_nothing_to_follow(log):
    with pytest.raises(SweepError, match="there is no log to follow"):
        list(follow(log.with_suffix("")))


def test_reasons_are_those_of_cells_that_failed(log):
    assert reasons(log.with_suffix("")) == {}
    texts = ["cell 3 FAILED (mu=1): no root: twice", "cell x FAILED (mu=1): no", "cell 7 solved", "cell 12 FAILED ("]
    log.write_text("".join(line(k, text) for k, text in enumerate(texts)))
    assert reasons(log.with_suffix("")) == {3: "no root: twice", 12: ""}
