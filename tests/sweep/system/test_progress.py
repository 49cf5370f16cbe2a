import io
import re

import pytest

from sweep.system.errors import SweepError
from sweep.system.progress import Progress, duration, quantity, seconds_of, speed, stream_of


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock():
    return Clock()


def lines(stream):
    """Lines of a log, without their times."""
    return [re.sub(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d  ", "", line) for line in stream.getvalue().splitlines()]


def test_a_run_of_less_than_a_second_is_silent(clock):
    log = io.StringIO()
    progress = Progress(100, log, clock=clock)
    clock.now += 0.99
    progress.add(100)
    progress.end()
    assert log.getvalue() == ""


def test_a_line_says_how_much_how_fast_and_how_long(clock):
    log = io.StringIO()
    progress = Progress(1_000_000, log, "out.h5", clock=clock)
    clock.now += 10
    progress.add(250_000)
    assert lines(log) == ["out.h5: 250,000/1,000,000 cells (25.0 %), 25,000 cells/s, 30 s left"]


class Left:
    """A forecast that says what it is told to."""

    def __init__(self, left):
        self.left = left


def test_time_left_is_that_of_the_forecast(clock):
    """A tenth of the cells that took half of the work: as long again, not nine times as long."""
    progress = Progress(1000, None, forecast=Left(60.0), clock=clock)
    clock.now += 60
    progress.add(100)
    assert progress.line() == "100/1,000 cells (10.0 %), 1.7 cells/s, 1 min 00 s left"


@pytest.mark.parametrize("forecast", [None, Left(0.0), Left(1e-9)])
def test_while_cells_remain_some_time_is_left(clock, forecast):
    progress = Progress(10**9, None, forecast=forecast, clock=clock)
    clock.now += 60
    progress.add(10**9 - 1)
    assert not re.search(r" 0(\.0)? s left", progress.line())
    assert progress.left > 0


def test_cells_of_an_earlier_run_are_done_but_say_nothing_about_speed(clock):
    progress = Progress(100, None, done=80, clock=clock)
    clock.now += 5
    progress.add(10)
    assert progress.line() == "90/100 cells (90.0 %), 2 cells/s, 5.0 s left"


def test_a_night_makes_a_readable_log(clock):
    """Ten hours in steps of a second: the first line, one every 30 s or 5 %, the last."""
    log = io.StringIO()
    progress = Progress(36_000, log, clock=clock)
    for _ in range(36_000):
        clock.now += 1
        progress.add(1)
    progress.end()
    told = lines(log)
    assert 1200 <= len(told) <= 1203
    assert told[0].startswith("sweep: 1/36,000 cells (0.0 %)")
    assert told[-1] == "sweep: 36,000/36,000 cells (100 %), 1 cells/s, took 10 h 00 min"


def test_a_run_of_a_minute_makes_a_dozen_lines(clock):
    log = io.StringIO()
    progress = Progress(6000, log, clock=clock)
    for _ in range(6000):
        clock.now += 0.01
        progress.add(1)
    progress.end()
    assert 8 <= len(lines(log)) <= 16


def test_every_line_of_a_log_bears_its_time(clock):
    log = io.StringIO()
    Progress(10, log, clock=clock).note("hello")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d  sweep: hello\n", log.getvalue())


def test_a_terminal_has_one_line_that_is_redrawn(clock):
    screen = Terminal()
    progress = Progress(100, screen, clock=clock)
    for _ in range(100):
        clock.now += 0.2
        progress.add(1)
    progress.end()
    text = screen.getvalue()
    assert text.count("\n") == 1
    assert text.endswith("took 20 s" + " " * (len(text) - len(text.rstrip(" \n")) - 1) + "\n")
    assert text.count("\r") > 50


def test_a_shorter_line_leaves_nothing_of_the_longer_one(clock):
    screen = Terminal()
    progress = Progress(10**9, screen, clock=clock)
    clock.now += 2
    progress.add(1)
    before = len(screen.getvalue().split("\r")[-1])
    clock.now += 2
    progress.add(10**9 - 1)
    assert len(screen.getvalue().split("\r")[-1]) >= before


def test_a_note_on_a_terminal_begins_a_new_line(clock):
    screen = Terminal()
    progress = Progress(10, screen, clock=clock)
    clock.now += 2
    progress.add(1)
    progress.note("careful")
    assert "left\nsweep: careful\n" in screen.getvalue()


def test_hundred_percent_is_said_only_when_all_is_done(clock):
    progress = Progress(10**6, None, clock=clock)
    progress.add(10**6 - 1)
    assert "(99.9 %)" in progress.line()


def test_cells_that_come_again_are_taken_back(clock):
    progress = Progress(100, None, clock=clock)
    progress.add(100)
    progress.again(10)
    assert progress.done == 90
    clock.now += 1
    assert progress.line().endswith("left")


def test_nothing_done_yet_says_nothing_about_time(clock):
    progress = Progress(100, None, clock=clock)
    clock.now += 5
    assert progress.line() == "0/100 cells (0.0 %)"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.04, "0.0 s"), (9.94, "9.9 s"), (9.96, "10 s"), (59.4, "59 s"), (59.6, "1 min 00 s"), (185, "3 min 05 s"),
        (3599.4, "59 min 59 s"), (3600, "1 h 00 min"), (26000, "7 h 13 min"),
        (86399, "23 h 59 min"), (90000, "1 d 1 h"),
    ],
)  # fmt: skip
def test_durations_read_as_people_say_them(seconds, text):
    assert duration(seconds) == text


def test_progress_goes_to_stderr_unless_told_otherwise(capsys):
    print("here", file=stream_of(None))
    assert capsys.readouterr().err == "here\n"
    assert stream_of(False) is None
    log = io.StringIO()
    assert stream_of(log) is log


@pytest.mark.parametrize("fault", [BrokenPipeError(), OSError(28, "No space left on device"), ValueError("closed")])
def test_a_log_that_cannot_be_written_any_more_stops_nothing(clock, fault):
    class Gone(io.StringIO):
        def write(self, text):
            raise fault

    progress = Progress(100, Gone(), clock=clock)
    clock.now += 60
    progress.add(50)
    progress.note("something")
    progress.add(50)
    progress.end()
    assert progress.done == 100


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (9.949, "9.9 s"), (9.951, "10 s"), (60.0, "1 min 00 s"), (3599.6, "1 h 00 min"), (3661, "1 h 01 min"),
        (86400, "1 d 0 h"), (90000 + 7200, "1 d 3 h"), (200_000, "2 d 7 h"),
    ],
)  # fmt: skip
def test_durations_at_the_borders_of_their_units(seconds, text):
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("rate", "text"),
    [
        (9.6, "10 cells/s"),
        (9.5, "10 cells/s"),
        (9.4, "9.4 cells/s"),
        (0.254, "0.25 cells/s"),
        (51234.4, "51,234 cells/s"),
    ],
)
def test_speeds_read_as_people_say_them(rate, text):
    assert speed(rate) == text


@pytest.mark.parametrize(
    ("count", "text"),
    [(999.4, "999 B"), (999.5, "1 kB"), (1e15, "1 PB"), (1e18, "1e+03 PB"), (1e6, "1 MB"), (2.5e9, "2.5 GB")],
)
def test_bytes_at_the_borders_of_their_units(count, text):
    assert quantity(count) == text


@pytest.mark.parametrize(
    ("text", "seconds"), [("90", 90), (2, 2), (" 60s ", 60), ("5 min", 300), ("1.5 h", 5400), ("1e-3s", 1e-3)]
)
def test_times_are_read_as_they_are_told(text, seconds):
    assert seconds_of("cell_timeout", text) == seconds


@pytest.mark.parametrize("text", ["", "0", "-1", "5 d", "1e999", "ten", "--5", None])
def test_what_is_no_time_is_told(text):
    with pytest.raises(SweepError, match='cell_timeout: expected a time like "60s", "5 min" or "1 h", found'):
        seconds_of("cell_timeout", text)


def told_at(stream, clock, times, total=1000):
    """After how many seconds a line is told, of a run that does cells (seconds, cells)."""
    progress, found = Progress(total, stream, clock=clock), []
    for now, cells in times:
        clock.now = 100.0 + now
        before = stream.getvalue()
        progress.add(cells)
        found += [now] if stream.getvalue() != before else []
    return found


def test_a_log_has_a_line_every_half_minute_or_after_a_twentieth_and_five_seconds(clock):
    times = [(0.9, 1), (1.0, 1), (30.9, 1), (31.0, 1), (35.9, 60), (36.0, 1), (42, 48), (45, 3), (75, 0)]
    assert told_at(io.StringIO(), clock, times) == [1.0, 31.0, 36.0, 45, 75]


def test_a_terminal_is_redrawn_ten_times_a_second(clock):
    times = [(1.0, 1), (1.09, 1), (1.11, 1), (1.2, 1), (1.22, 1)]
    assert told_at(Terminal(), clock, times) == [1.0, 1.11, 1.22]


def test_once_a_minute_it_is_in_the_log_of_a_program(clock, monkeypatch):
    logged = []
    monkeypatch.setattr("sweep.system.progress.log", lambda *given, **keys: logged.append((*given, keys)))
    progress = Progress(1000, None, clock=clock)
    for now, cells in ((59.9, 10), (60.0, 20), (119.9, 10), (120.0, 10)):
        clock.now = 100.0 + now
        progress.add(cells)
    clock.now += 5
    progress.end()
    fields = {"cells": 30, "of": 1000, "cells_per_second": 0.5, "seconds_left": 1940.0}
    assert logged[0] == ("30/1,000 cells (3.0 %), 0.5 cells/s, 32 min 20 s left", "progress", fields)
    assert [entry[2]["cells"] for entry in logged] == [30, 50, 50]
    assert logged[2][0] == "50/1,000 cells (5.0 %), 0.4 cells/s, took 2 min 05 s"
    assert logged[2][2]["seconds"] == 125.0


def test_a_shorter_line_is_filled_with_spaces_and_the_next_is_not(clock):
    screen = Terminal()
    progress = Progress(100, screen, clock=clock)
    for text in ("longer", "no", "yes"):
        progress._say(text)
    progress.stop()
    progress.stop()
    assert screen.getvalue() == "\rsweep: longer\rsweep: no    \rsweep: yes\n"


def test_a_grid_without_cells_is_done(clock):
    assert Progress(0, None, clock=clock).line() == "0/0 cells (100 %)"
