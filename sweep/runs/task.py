"""What a run was asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, TextIO

from sweep.runs.isolate import Limits
from sweep.runs.progress import Progress
from sweep.study.model import Study


@dataclass(frozen=True)
class Task:
    """What a run was asked for; see `run`."""

    study: Study
    fingerprint: Mapping[str, str]
    path: Path | None
    workers: int
    stream: TextIO | None = None
    force: bool = False
    block_cells: int | None = None
    extend: bool = False
    until: datetime | None = None
    cluster: Any = None
    repair: bool = False
    isolate: bool = False
    limits: Limits = field(default_factory=Limits)
    retry_failed: bool = False

    @property
    def output(self) -> Path:
        """Where a run to a file writes."""
        assert self.path is not None, "a run in memory has no output"
        return self.path

    @property
    def name(self) -> str:
        """What the run is called in its messages."""
        return self.study.title or "sweep" if self.path is None else self.path.name

    def note(self, text: str) -> None:
        """Says something at once."""
        Progress(1, self.stream, self.name).note(text)
