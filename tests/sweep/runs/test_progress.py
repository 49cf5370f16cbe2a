"""What a run says of itself while it goes on: how far, how fast, how long still."""

import io
import re

import pytest

from sweep.errors import SweepError
from sweep.runs.progress import Progress
from sweep.words import seconds_of


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def run(stream, clock, times, **keys):
    """A run that does blocks (seconds, cells), of half the work that cells have on average where they are `cheap`."""
    share = 0.5 if keys.pop("cheap", False) else 1.0
    progress = Progress(1000, stream, clock=clock, work=1000.0 - keys.get("done", 0), **keys)
    for seconds, cells in times:
        clock.now += seconds
        progress.add(cells, share * cells, seconds)
    progress.end()


def seconds_in(text):
    """A time in words as a number."""
    units = {"d": 86400.0, "h": 3600.0, "min": 60.0, "s": 1.0}
    return sum(float(number) * units[unit] for number, unit in re.findall(r"([\d.]+) (d|h|min|s)\b", text))


def test_times_are_read_as_they_are_told():
    for text, seconds in (("90", 90), (2, 2), (" 60s ", 60), ("5 min", 300), ("1.5 h", 5400), ("1e-3s", 1e-3)):
        assert seconds_of("cell_timeout", text) == seconds
    for text in ("", "0", "-1", "5 y", "1e999", "ten", "--5", None):
        with pytest.raises(SweepError, match="cell_timeout"):
            seconds_of("cell_timeout", text)


def test_a_line_says_how_much_how_fast_and_how_long(clock):
    """By the cells so far, not of an earlier run, and what the sample said of them; rounded up to one digit."""
    for keys, cells, wanted in (
        ({}, 250, (250, 25.0, 30.0)),
        ({"done": 800}, 50, (850, 5.0, 30.0)),
        ({"cheap": True}, 100, (100, 10.0, 240.0)),
    ):
        log = io.StringIO()
        run(log, clock, [(10, cells)], name="out.h5", **keys)
        line = log.getvalue().splitlines()[0]
        assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d  out.h5: ", line)
        done, total, share, rate = re.search(
            r"([\d,]+)/([\d,]+) cells \(([\d.]+) %\), ([\d.,]+) cells/s", line
        ).groups()
        assert (int(done), total, float(share)) == (wanted[0], "1,000", wanted[0] / 10)
        assert float(rate) == pytest.approx(wanted[1], rel=0.03)
        assert seconds_in(line.split("cells/s, ")[1]) == wanted[2]
        clock.now = 100.0


@pytest.mark.parametrize("work", [1e9, 0.0])
def test_while_cells_remain_some_time_is_left_and_it_is_not_all_done(clock, work):
    progress = Progress(10**9, False, work=work, clock=clock)
    progress.add(10**9 - 1, work, 1e-9)
    assert "(99.9 %)" in progress.line()
    assert seconds_in(progress.line().split("cells/s, ")[1]) > 0
    progress.add(1, 0.0, 0.0)
    assert "(100 %)" in progress.line()
    assert "(100 %)" in Progress(0, False, clock=clock).line()
    assert "left" not in Progress(100, False, clock=clock).line()


@pytest.mark.parametrize("fault", [BrokenPipeError(), OSError(28, "No space left on device"), ValueError("closed")])
def test_a_log_that_cannot_be_written_any_more_stops_nothing(clock, fault):
    class Gone(io.StringIO):
        def write(self, text):
            raise fault

    run(Gone(), clock, [(60, 500), (30, 500)])
