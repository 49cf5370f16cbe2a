"""Lines of a log, for people and as JSON, and what becomes of them where the disk refuses."""

import json
import logging
import time

import pytest

from sweep.system.log import LOG, log, logging_to, read_lines


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.h5.log"


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """A moment of a zone two hours ahead."""
    monkeypatch.setenv("TZ", "XYZ-2")
    time.tzset()
    monkeypatch.setattr(logging.time, "time", lambda: 1_000_000_000.25)
    if hasattr(logging.time, "time_ns"):
        monkeypatch.setattr(logging.time, "time_ns", lambda: 1_000_000_000_250_000_000)
    yield
    monkeypatch.undo()
    time.tzset()


def test_lines_for_people_are_one_line_each_and_shown_not_obeyed(path):
    with logging_to(path):
        log("begun")
        log("two\nlines \x1b[31m 100 %s", cells=3)
    assert path.read_text() == (
        "2001-09-09 03:46:40  begun\n2001-09-09 03:46:40  two lines \\x1b[31m 100 %s\n"
    )  # fmt: skip


def test_lines_of_json_tell_fields_apart(path):
    with logging_to(path, as_json=True):
        log("begun", "begin", cells=3)
        log("more")
        LOG.info("of another program")
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    moment = {"time": "2001-09-09T03:46:40+0200"}
    assert lines == [
        {**moment, "text": "begun", "event": "begin", "cells": 3},
        {**moment, "text": "more", "event": "note"},
        {**moment, "text": "of another program"},
    ]


def test_a_log_goes_on_where_an_earlier_one_ended_and_holds_no_more_than_its_run(path):
    for text in ("one", "two"):
        with logging_to(path):
            log(text)
        log("between")
    assert [line["text"] for line in read_lines(path.read_text())] == ["one", "two"]


def test_the_logger_is_left_as_it_was(path):
    handlers, level = list(LOG.handlers), LOG.level
    LOG.setLevel(logging.ERROR)
    with logging_to(path):
        assert (LOG.level, len(LOG.handlers)) == (logging.INFO, len(handlers) + 1)
    assert (LOG.level, LOG.handlers) == (logging.ERROR, handlers)
    LOG.setLevel(level)
    with logging_to(None):
        assert (LOG.level, LOG.handlers) == (level, handlers)


def test_both_kinds_of_lines_are_read_and_broken_ones_left_out():
    text = '2001-09-09 03:46:40  begun {\n{"time": "t", "text": "x", "cells": 3}\n{"time": \n{}\n'
    assert list(read_lines(text)) == [
        {"time": "2001-09-09 03:46:40", "text": "begun {"}, {"time": "t", "text": "x", "cells": 3}, {}
    ]  # fmt: skip


def test_a_log_that_cannot_be_written_at_all_is_told(tmp_path):
    with pytest.raises(OSError, match="No such file"), logging_to(tmp_path / "none" / "log"):
        pass
