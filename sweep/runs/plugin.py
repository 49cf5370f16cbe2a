"""What dask sets up on the workers of a run, also on those that come later; imports distributed."""

from __future__ import annotations

from typing import Any

from distributed import WorkerPlugin

from sweep.runs import worker as remote


class Desk(WorkerPlugin):  # type: ignore[misc]
    """Tells a worker process of a run, and lets it forget the run at the end."""

    def __init__(self, assignment: remote.Assignment) -> None:
        self.assignment = assignment

    def setup(self, worker: Any) -> None:
        """Called in the worker."""
        remote.assign(self.assignment)

    def teardown(self, worker: Any) -> None:
        """Called in the worker."""
        remote.dismiss(self.assignment.run)
