"""The log of a run beside its output: `OUT.h5.log`, by Python's logging, a line for people or a line of JSON each.

All that is logged goes to the logger "sweep", so a program of one's own may send it elsewhere.
"""

from __future__ import annotations

import contextlib
import json
import logging
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sweep.errors import SweepError
from sweep.words import printable

LOG = logging.getLogger("sweep")
LOG.addHandler(logging.NullHandler())


def log_path(output: Path) -> Path:
    """The log of a run with this output."""
    return output.with_name(output.name + ".log")


def log(text: str, event: str = "note", **fields: Any) -> None:
    """Writes a line.

    Parameters
    ----------
    event : what kind of line it is: "begin", "progress", "failed", "note", "end"
    fields : what a line of JSON tells apart, numbers and texts
    """
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
