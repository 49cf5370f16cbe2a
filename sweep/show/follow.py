"""A sweep watched from its log, in another terminal or on another machine; and why cells FAILED, which stands there."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

from sweep.errors import SweepError
from sweep.runs.log import log_path, read_lines

LOOK_SECONDS = 0.5
SILENT_SECONDS = 600.0
"""A log that says nothing for so long, though a line is due every minute, is that of a run that was killed."""
LAST = 10
"""Lines so far that are told."""
ENDED = "ended with "
_FAILED, _REASON = " FAILED (", "): "


def follow(output: Path, sleep: Callable[[float], None] = time.sleep) -> Iterator[str]:
    """The last lines of the log of a run, and those to come until it ends. Raises SweepError."""
    path = log_path(output)
    silent, told, size = 0.0, 0, -1
    while True:
        if (now := _size(path)) != size:
            lines = list(read_lines(path.read_text("utf-8")))
            for line in lines[max(told, len(lines) - LAST) if told == 0 else told :]:
                yield f"{line['time']}  {line['text']}"
            silent, told, size = 0.0, len(lines), now
            if lines and lines[-1]["text"].startswith(ENDED):
                return
        if silent >= SILENT_SECONDS:
            break
        sleep(LOOK_SECONDS)
        silent += LOOK_SECONDS
    raise SweepError(f"{path}: nothing new for {SILENT_SECONDS:.0f} s; its run was killed, or the machine is away")


def reasons(output: Path) -> dict[int, str]:
    """Why cells FAILED, by their numbers; as far as the log says."""
    path = log_path(output)
    found = {}
    for line in read_lines(path.read_text("utf-8", errors="replace")) if path.is_file() else ():
        cell, failed, rest = line.get("text", "").partition(_FAILED)
        number = cell.removeprefix("cell ")
        if failed and number.isdecimal():
            found[int(number)] = rest.partition(_REASON)[2]
    return found


def _size(path: Path) -> int:
    if path.is_fifo():
        raise SweepError(f"{path} is a pipe, and no log of a run")
    try:
        return path.stat().st_size
    except OSError:
        raise SweepError(f"{path}: there is no log to follow; sweep run writes one beside its output") from None
