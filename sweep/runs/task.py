"""What a run was asked for."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sweep.cells.fingerprint import fingerprint
from sweep.cells.sample import require_asked
from sweep.errors import SweepError, missing
from sweep.runs.isolate import limit_of
from sweep.runs.pool import cores, deadline, whole_number
from sweep.runs.progress import Progress, stream_of
from sweep.study.model import Study
from sweep.words import as_path

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster


@dataclass(frozen=True)
class Task:
    """What a run was asked for; see `run`. Made by `asked`."""

    study: Study
    fingerprint: Mapping[str, str]
    path: Path | None
    workers: int
    stream: TextIO | None
    block_cells: int | None
    until: datetime | None
    isolate: bool
    cell_limit: float | None
    force: bool = False
    extend: bool = False
    cluster: Any = None
    repair: bool = False
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


def asked(
    study: Study,
    path: str | os.PathLike[str] | None,
    *,
    workers: int | None = None,
    progress: bool | TextIO | None = None,
    block_cells: int | None = None,
    until: str | datetime | None = None,
    isolate: bool = False,
    cell_timeout: float | str | None = None,
    mark: Mapping[str, str] | None = None,
    **options: Any,
) -> Task:
    """What `run` was asked for; further options are kept as they are. Raises SweepError where it cannot be meant."""
    output = None if path is None else Path(os.path.realpath(as_path(path)))
    if output is not None and not output.parent.is_dir():
        raise SweepError(f"{path}: there is no folder {output.parent}")
    task = Task(
        study,
        dict(mark or fingerprint(study)),
        output,
        cores() if workers is None else whole_number("workers", workers),
        stream_of(progress),
        None if block_cells is None else whole_number("block_cells", block_cells),
        deadline(until),
        isolate or cell_timeout is not None,
        limit_of(cell_timeout),
        **options,
    )
    if task.cluster is not None and workers is not None:
        raise SweepError("workers, cluster: a cluster brings its own workers; give one of the two")
    require_asked(study)
    if path is None and until is not None:
        raise SweepError("until: give a path as well, or what is computed by then would be lost")
    if task.extend and task.retry_failed:
        raise SweepError("extend, retry_failed: give one of the two; each continues another result")
    return task


@contextlib.contextmanager
def joined(task: Task) -> Iterator[Cluster | None]:
    """The cluster of a task; None where none is asked for. Raises SweepError."""
    if task.cluster is None:
        yield None
        return
    try:
        from sweep.runs.cluster import Cluster
    except ImportError:
        raise missing("a cluster needs distributed", "cluster") from None
    with Cluster(task.cluster, task.note) as cluster:
        yield cluster
