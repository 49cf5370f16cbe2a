"""What of a run is done on a cluster: joining it, having it compute, and going on without it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from sweep.cells.block import Found
from sweep.runs.session import Session
from sweep.runs.task import HERE, WAIT, Task
from sweep.store.store import Shared
from sweep.system.errors import missing
from sweep.system.progress import TimeUp

if TYPE_CHECKING:
    from sweep.runs.cluster import Cluster


@contextlib.contextmanager
def joined(task: Task) -> Iterator[Cluster | None]:
    """The cluster, once it has a worker; None where none is asked for, or it has none. Raises SweepError, TimeUp."""
    if task.cluster is None:
        yield None
        return
    try:
        from sweep.runs.cluster import LOST_SECONDS, Cluster, NoWorkers
    except ImportError:
        raise missing("a cluster needs distributed", "cluster") from None
    with Cluster(task.cluster) as cluster:
        found: Cluster | None = cluster
        try:
            cluster.wait(task.note, task.until, math.inf if task.without_workers == WAIT else LOST_SECONDS)
        except NoWorkers:
            _without(task)
            found = None
        yield found


def compute_elsewhere(
    session: Session, cluster: Cluster, shared: Shared | None, receive: Callable[[int, Found], None]
) -> bool:
    """Has what is left of a session computed by a cluster; False where it lost its workers, and the rest is for here.

    Raises SweepError, TimeUp.
    """
    from sweep.runs.cluster import NoWorkers
    from sweep.runs.dispatch import Dispatch

    limits = None if session.processes is None else session.processes.limits
    executor = Dispatch(cluster, session.task, session.blocks, session.forecast, session.reused, shared, limits)
    try:
        session.compute_elsewhere(executor, receive)
    except NoWorkers:
        _without(session.task)
        return False
    return True


def threads(task: Task, cluster: Cluster | None) -> int:
    """How many threads compute, here or elsewhere."""
    return task.workers if cluster is None else cluster.threads or task.workers


def _without(task: Task) -> None:
    """Says what is done without workers. Raises TimeUp where that is to end."""
    if task.without_workers != HERE:
        raise TimeUp("the cluster has no workers")
    task.note("the cluster has no workers; going on here")
