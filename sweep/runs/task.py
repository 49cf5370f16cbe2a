"""What a run was asked for."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, TextIO

from sweep.cells.fingerprint import fingerprint
from sweep.cells.reduce import output_schema
from sweep.cells.sample import require_asked
from sweep.cells.schema import Schema
from sweep.errors import SweepError
from sweep.runs.pool import cores, deadline, whole_number
from sweep.runs.progress import Progress
from sweep.study.model import Study
from sweep.words import as_path, seconds_of


@dataclass
class Task:
    """What a run was asked for, as `run` was, and what is meant by it. Raises SweepError where it cannot be meant.

    Attributes
    ----------
    output : Path
        Where a run to a file writes, all links followed.
    cores, end, limit
        What `workers`, `until` and `cell_timeout` mean.
    fingerprint : mapping of str to str
        Of the study and of this program, or what is given instead.
    """

    study: Study
    path: str | os.PathLike[str] | None = None
    workers: int | None = None
    force: bool = False
    progress: bool | TextIO | None = None
    block_cells: int | None = None
    extend: bool = False
    until: str | datetime | None = None
    cluster: Any = None
    repair: bool = False
    isolate: bool = False
    cell_timeout: float | str | None = None
    retry_failed: bool = False
    fingerprint: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.fingerprint = dict(self.fingerprint or fingerprint(self.study))
        self.output = Path(os.path.realpath(as_path("." if self.path is None else self.path)))
        if not self.output.parent.is_dir():
            raise SweepError(f"{self.path}: there is no folder {self.output.parent}")
        self.cores = cores() if self.workers is None else whole_number("workers", self.workers)
        if self.block_cells is not None:
            whole_number("block_cells", self.block_cells)
        self.end = deadline(self.until)
        self.limit = None if self.cell_timeout is None else seconds_of("cell_timeout", self.cell_timeout)
        self.isolate = self.isolate or self.limit is not None
        if self.cluster is not None and self.workers is not None:
            raise SweepError("workers, cluster: a cluster brings its own workers; give one of the two")
        require_asked(self.study)
        if self.path is None and self.until is not None:
            raise SweepError("until: give a path as well, or what is computed by then would be lost")
        if self.extend and self.retry_failed:
            raise SweepError("extend, retry_failed: give one of the two; each continues another result")

    @property
    def name(self) -> str:
        """What the run is called in its messages."""
        return self.study.title or "sweep" if self.path is None else self.output.name

    def note(self, text: str) -> None:
        """Says something at once."""
        Progress(1, self.progress, self.name).note(text)

    @cached_property
    def schema(self) -> Schema:
        """What its result holds."""
        return output_schema(self.study, self.fingerprint)

    def said(self, attrs: Mapping[str, str]) -> Schema:
        """What its result holds, with further attributes."""
        return replace(self.schema, attrs={**self.schema.attrs, **attrs})


def now() -> str:
    """The time as ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")
