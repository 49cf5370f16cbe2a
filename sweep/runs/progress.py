"""Progress of a run: a bar on a terminal or in a notebook, lines elsewhere, and the log beside its output, OUT.h5.log.

The log is written by Python's logging, as text or JSON, one record per line. All records go to the logger "sweep", so
that a program can redirect them.
"""

from __future__ import annotations

import contextlib
import json
import logging
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from sweep.errors import SweepError
from sweep.words import SHORTEST, duration, one_digit, paragraph, printable, speed

LOG = logging.getLogger("sweep")
LOG.addHandler(logging.NullHandler())
QUIET_SECONDS = 1.0
"""A shorter run prints nothing."""
LINE_SECONDS = 30.0
"""Interval of lines in the log, and on the screen without a bar; the first ones come sooner if cells are done."""


def log_path(output: Path) -> Path:
    """The log of a run with this output."""
    return output.with_name(output.name + ".log")


def log(text: str, event: str = "note", **fields: Any) -> None:
    """Writes a line; the event is "begin", "progress", "failed", "note" or "end". JSON has it and the fields, too."""
    LOG.info("%s", text, extra={"fields": {"event": event, **fields}})


class _Handler(logging.FileHandler):
    """Writes to the end of a file; a disk that is full does not end the run, neither now nor when it is closed."""

    as_json = False

    def format(self, record: logging.LogRecord) -> str:
        text, at = record.getMessage(), time.localtime(record.created)
        if self.as_json:
            fields = getattr(record, "fields", {})
            return json.dumps({"time": time.strftime("%Y-%m-%dT%H:%M:%S%z", at), "text": text, **fields})
        return f"{time.strftime('%Y-%m-%d %H:%M:%S', at)}  {printable(' '.join(text.splitlines()))}"

    def handleError(self, record: logging.LogRecord) -> None:
        pass

    def close(self) -> None:
        with contextlib.suppress(OSError):
            super().close()


@contextlib.contextmanager
def logging_to(path: Path | None, as_json: bool = False) -> Iterator[None]:
    """All that is logged within goes to the end of a file, too; None: to none. Raises OSError, SweepError."""
    if path is None:
        yield
        return
    if path.is_fifo():  # to open it would wait for a reader
        raise SweepError(f"{path} is a pipe, where the log of the run is to be written; remove it")
    handler, level = _Handler(path, encoding="utf-8"), LOG.level
    handler.as_json = as_json
    LOG.setLevel(logging.INFO)
    LOG.addHandler(handler)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(level)
        handler.close()


def read_lines(text: str) -> Iterator[Mapping[str, Any]]:
    """What the lines of a log say, of either kind: "time", "text", and of JSON its fields."""
    for line in text.splitlines():
        if not line.startswith("{"):
            yield {"time": line[:19], "text": line[21:]}
            continue
        with contextlib.suppress(ValueError):
            yield json.loads(line)


class Progress:
    """Tells how many of the `total` cells are done, how fast, and how long it will take.

    So many were `done` before. The blocks to come should take so much `work`, in seconds or in any measure; they come
    from all over the grid, so those that are done tell what a measure takes, where a `crew` of them is computed at a
    time. A `stream` of None or True is stderr; False: nothing is said. Every line begins with the `name`.
    """

    def __init__(
        self,
        total: int,
        stream: bool | TextIO | None,
        name: str = "sweep",
        done: int = 0,
        work: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stream: Any = sys.stderr if stream is None or stream is True else stream or None
        self.total, self.done, self.crew = total, done, 1
        self._before, self._name, self._clock = done, printable(name), clock
        shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
        notebook = self._stream is sys.stderr and type(shell).__name__ == "ZMQInteractiveShell"
        self._live = self._stream is not None and (self._stream.isatty() or notebook)
        self._bar: Any = None
        self._begun = self._said = clock()
        self._told, self._shown = done, False
        self._work_left, self._blocks, self._last = work, 0, self._begun
        self._spent = self._first_round = np.zeros(2)  # the work of blocks that are done, and their seconds

    @property
    def rate(self) -> float:
        """Cells per second computed here."""
        return (self.done - self._before) / max(self._clock() - self._begun, 1e-9)

    @property
    def left(self) -> float | None:
        """Seconds that are left; None where nothing is known yet."""
        if not self._blocks or self.done >= self.total:
            return 0.0 if self._blocks else None
        # kernels are loaded in the first round, which does not count when there were three
        work, seconds = self._spent - (self._first_round if self._blocks >= 3 * self.crew else 0.0)
        to_come, waited = seconds / work * self._work_left / self.crew, self._clock() - self._last
        # where none has ended for longer than all should take, it may take as long again
        return float(max(to_come - waited if waited < to_come else waited, SHORTEST))

    def add(self, cells: int, work: float, seconds: float) -> None:
        """Counts the cells of a block as done, which was so much work and took so long."""
        self.done, self._work_left, self._last = self.done + cells, self._work_left - work, self._clock()
        self._blocks, self._spent = self._blocks + 1, self._spent + np.array([max(work, 1e-9), seconds])
        if self._blocks == self.crew:
            self._first_round = self._spent
        self.tick()

    def tick(self) -> None:
        """Says something if it is time to."""
        now = self._clock()
        if (since := now - self._begun) < QUIET_SECONDS:
            return
        due = now - self._said >= (min(LINE_SECONDS, since / 3) if self.done > self._told else LINE_SECONDS)
        if due:
            self._said, self._told = now, self.done
            self._log(self.line())
        if due or self._live:
            self._show(self.line())

    def note(self, text: str, event: str = "note", **fields: Any) -> None:
        """Says something out of turn."""
        log(text, event, **fields)
        self._tell(text)

    def _tell(self, text: str) -> None:
        """Writes a line that is not in the log. A reader who has gone, or a full disk, does not stop the run."""
        if self._bar is not None:
            self._bar.clear()
        if self._stream is not None:
            stamp = "" if self._live else time.strftime("%Y-%m-%d %H:%M:%S  ")
            try:
                self._stream.write(paragraph(f"{stamp}{self._name}: {text}") + "\n")
                self._stream.flush()
            except (OSError, ValueError):
                self._stream = None

    def end(self) -> None:
        """Says how it ended, where anything was said before."""
        took = self._clock() - self._begun
        self._log(text := f"{self._counts()}, {speed(self.rate)}, took {duration(took)}", seconds=round(took, 1))
        if self._shown:
            self._show(text)
        self.stop()

    def stop(self) -> None:
        """Leaves the bar as it is and begins a new line."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def line(self) -> str:
        """What is told now: `12,300/1,000,000 cells (1.2 %), 5,100 cells/s, 3 min left`."""
        left = self.left
        return self._counts() + (f", {speed(self.rate)}, {one_digit(left)} left" if left else "")

    def _counts(self) -> str:
        share = 100 * self.done / self.total if self.total else 100.0
        # 100 % only when all is done
        shown = f"{min(share, 99.9):.1f}" if self.done < self.total else "100"
        return f"{self.done:,}/{self.total:,} cells ({shown} %)"

    def _log(self, text: str, **more: float) -> None:
        left = None if self.left is None else round(self.left, 1)
        fields = {"cells": self.done, "of": self.total, "cells_per_second": round(self.rate, 3), "seconds_left": left}
        log(text, "progress", **fields, **more)

    def _show(self, text: str) -> None:
        self._shown = True
        if not self._live:
            self._tell(text)
            return
        if self._bar is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of a notebook without widgets, which gets a bar of text
                from tqdm.auto import tqdm
            form = "{percentage:3.0f} %|{bar:20}| {desc}"
            self._bar = tqdm(total=self.total, initial=self.done, file=self._stream, bar_format=form)
        self._bar.set_description_str(f"{self._name}: {text}", refresh=False)
        self._bar.update(self.done - self._bar.n)
