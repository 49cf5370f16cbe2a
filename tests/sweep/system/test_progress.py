import io
import re

import pytest

from sweep.system.progress import Progress, duration, stream_of


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

    def __init__(self, left, off=0.0):
        self.left, self.interval = left, (left * (1 - off), left * (1 + off))


def test_time_left_is_that_of_the_forecast(clock):
    """A tenth of the cells that took half of the work: as long again, not nine times as long; and the line says why."""
    progress = Progress(1000, None, forecast=Left(60.0), clock=clock)
    clock.now += 60
    progress.add(100)
    assert progress.line() == "100/1,000 cells (10.0 %), 1.7 cells/s so far, 15 to come, 1 min 00 s left"


@pytest.mark.parametrize(
    ("left", "speeds"),
    [
        (12.5, "8 cells/s so far, 16 to come, "),
        (17.5, "8 cells/s, "),
        (35.0, "8 cells/s, "),
        (50.0, "8 cells/s so far, 4 to come, "),
    ],
)
def test_two_speeds_are_told_where_one_is_half_as_fast_again_as_the_other(clock, left, speeds):
    progress = Progress(280, None, forecast=Left(left), clock=clock)
    clock.now += 10
    progress.add(80)
    assert speeds in progress.line()


@pytest.mark.parametrize(
    ("left", "off", "text"),
    [
        (960.0, 0.25, "16 min 00 s left"),
        (960.0, 0.4, "10 to 22 min left"),
        (8.0, 0.9, "1 to 15 s left"),
        (80.0, 0.9, "0 to 3 min left"),
        (18_000.0, 0.6, "2 to 8 h left"),
        (400_000.0, 0.5, "2 to 7 d left"),
        (0.2, 1.0, "0 to 1 s left"),
    ],
)
def test_where_little_is_known_an_interval_is_told(clock, left, off, text):
    progress = Progress(1000, None, forecast=Left(left, off), clock=clock)
    clock.now += 60
    progress.add(100)
    assert progress.line().endswith(text)


@pytest.mark.parametrize("left", [0.1, 1.0, 30.0, 90.0, 91.0, 1000.0, 1e5])
def test_speed_and_time_left_never_contradict_each_other(clock, left):
    progress = Progress(1_000_000, None, forecast=Left(left), clock=clock)
    clock.now += 10
    progress.add(100_000)
    told = progress.line()
    speed = float(re.search(r"([\d,.e+]+)( cells/s,| to come)", told)[1].replace(",", ""))
    assert 1 / 1.5 < speed * left / 900_000 < 1.5


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
