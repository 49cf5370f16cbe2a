"""What a run says of itself while it goes on: how often, how far, how long still."""

import io
import itertools
import logging
import re
import sys
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sweep.system.errors import SweepError
from sweep.system.progress import Progress, duration, quantity, seconds_of, speed


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Left:
    """A forecast that says what it is told to."""

    def __init__(self, left):
        self.left = left


@pytest.fixture
def clock():
    return Clock()


def run(stream, clock, times, total=1000, **keys):
    """A run that does cells (after seconds, cells), and after how many seconds a line is told."""
    progress, told = Progress(total, stream, clock=clock, **keys), []
    for now, cells in times:
        clock.now = 100.0 + now
        before = stream.getvalue()
        progress.add(cells)
        told += [now] if stream.getvalue() != before else []
    progress.end()
    return told


def seconds_in(text):
    """A time in words as a number, and how large its last unit is."""
    units = {"d": 86400.0, "h": 3600.0, "min": 60.0, "s": 1.0}
    parts = re.findall(r"([\d.]+) (d|h|min|s)\b", text)
    last = 0.1 if "." in text else units[parts[-1][1]]
    return sum(float(number) * units[unit] for number, unit in parts), last


@given(st.floats(0.0, 1e7))
def test_times_are_told_to_the_last_digit_of_their_words(seconds):
    found, last = seconds_in(duration(seconds))
    assert abs(found - seconds) <= (0.5 if last <= 1 else 1.0) * last + 0.5
    assert not re.search(r"\b60 (s|min)|\b24 h", duration(seconds))


@given(st.floats(1e-3, 1e12))
def test_speeds_and_bytes_have_two_or_three_digits(number):
    assert float(speed(number).split()[0].replace(",", "")) == pytest.approx(number, rel=0.06)
    size = max(number, 1.0)
    count, unit = quantity(size).split()
    factor = 1000.0 ** ["B", "kB", "MB", "GB", "TB", "PB"].index(unit)
    assert float(count) * factor == pytest.approx(size, rel=6e-3)
    assert 0.99 <= float(count) < 1000


def test_times_are_read_as_they_are_told():
    for text, seconds in (("90", 90), (2, 2), (" 60s ", 60), ("5 min", 300), ("1.5 h", 5400), ("1e-3s", 1e-3)):
        assert seconds_of("cell_timeout", text) == seconds
    for text in ("", "0", "-1", "5 d", "1e999", "ten", "--5", None):
        with pytest.raises(SweepError, match="cell_timeout"):
            seconds_of("cell_timeout", text)


def test_a_line_says_how_much_how_fast_and_how_long(clock):
    """By the cells so far; of an earlier run they say nothing of the speed; a forecast knows better."""
    for keys, cells, wanted in (
        ({}, 250, (250, 25.0, 30.0)),
        ({"done": 800}, 50, (850, 5.0, 30.0)),
        ({"forecast": Left(95.0)}, 100, (100, 10.0, 95.0)),
    ):
        log = io.StringIO()
        run(log, clock, [(0, 0), (10, cells)], name="out.h5", **keys)
        line = log.getvalue().splitlines()[0]
        assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d  out.h5: ", line)
        done, total, share, rate = re.search(
            r"([\d,]+)/([\d,]+) cells \(([\d.]+) %\), ([\d.,]+) cells/s", line
        ).groups()
        assert (int(done), total, float(share)) == (wanted[0], "1,000", wanted[0] / 10)
        assert float(rate) == pytest.approx(wanted[1], rel=0.03)
        assert seconds_in(line.split("cells/s, ")[1])[0] == wanted[2]
        clock.now = 100.0


@pytest.mark.parametrize("forecast", [None, Left(0.0), Left(1e-9)])
def test_while_cells_remain_some_time_is_left_and_it_is_not_all_done(clock, forecast):
    progress = Progress(10**9, None, forecast=forecast, clock=clock)
    clock.now += 60
    progress.add(10**9 - 1)
    assert "(99.9 %)" in progress.line()
    assert seconds_in(progress.line().split("cells/s, ")[1])[0] > 0
    progress.add(1)
    assert "(100 %)" in progress.line()
    progress.again(10)
    assert progress.done == 10**9 - 10
    assert "(100 %)" in Progress(0, None, clock=clock).line()
    assert "left" not in Progress(100, None, clock=clock).line()


@pytest.mark.parametrize(
    ("stream", "times", "told"),
    [
        (io.StringIO(), [(0.5, 900), (0.99, 100)], []),
        (io.StringIO(), [(0.9, 1), (1.0, 1), (30.9, 1), (31.0, 1), (35.9, 60), (36.0, 1), (42, 48), (45, 3), (75, 0)],
         [1.0, 31.0, 36.0, 45, 75]),
        (Terminal(), [(1.0, 1), (1.09, 1), (1.11, 1), (1.2, 1), (1.22, 1)], [1.0, 1.11, 1.22]),
    ],
)  # fmt: skip
def test_a_line_comes_every_half_minute_or_twentieth_and_a_terminal_is_redrawn_ten_times_a_second(
    clock, stream, times, told
):
    assert run(stream, clock, times) == told


def test_a_terminal_has_one_line_of_which_nothing_is_left_over_and_notes_have_their_own(clock):
    screen = Terminal()
    progress = Progress(10**9, screen, "\x1b[2Jstones", clock=clock)
    for cells in (1, 10**8, 1, 8 * 10**8):
        clock.now += 2
        progress.add(cells)
    progress.note("careful")
    progress.stop()
    first, *_, last = screen.getvalue().split("\n")
    assert (screen.getvalue().count("\n"), last) == (2, "")
    drawn = first.split("\r")[1:]
    assert all(len(after) >= len(before.rstrip()) for before, after in itertools.pairwise(drawn))
    assert "careful" in screen.getvalue().split("\n")[1]
    assert "\x1b" not in screen.getvalue()


@pytest.mark.parametrize("fault", [BrokenPipeError(), OSError(28, "No space left on device"), ValueError("closed")])
def test_a_log_that_cannot_be_written_any_more_stops_nothing(clock, fault):
    class Gone(io.StringIO):
        def write(self, text):
            raise fault

    run(Gone(), clock, [(60, 500), (90, 500)])


def test_once_a_minute_it_is_in_the_log_of_a_program(clock, caplog):
    caplog.set_level(logging.INFO, logger="sweep")
    run(io.StringIO(), clock, [(59.9, 10), (60.0, 20), (119.9, 10), (120.0, 10)])
    counts = [re.match(r"\d+/1,000 cells", record.getMessage())[0] for record in caplog.records]
    assert counts == ["30/1,000 cells", "50/1,000 cells", "50/1,000 cells"]


# notebooks


class ZMQInteractiveShell:
    """What IPython calls the shell of a notebook."""


def test_a_notebook_shows_a_bar_of_cells(monkeypatch, clock):
    pytest.importorskip("tqdm")
    import tqdm.auto

    notebook = io.StringIO()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=ZMQInteractiveShell, version_info=(9,)))
    monkeypatch.setattr(sys, "stderr", notebook)
    monkeypatch.setattr(tqdm.auto, "tqdm", tqdm.tqdm)  # without widgets
    progress = Progress(100, sys.stderr, clock=clock)
    for _ in range(4):
        clock.now += 2.0
        progress.add(20)
    progress.note("a word")
    progress.end()
    progress.stop()
    assert all(words in notebook.getvalue() for words in ("80 %|", "80/100 cells", "a word"))
    run(lines := io.StringIO(), clock, [(2, 10)])
    assert "%|" not in lines.getvalue()
