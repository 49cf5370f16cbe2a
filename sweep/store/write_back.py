"""How long the disk takes for what is written to a file, as fast as it has been so far."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

ENOUGH_BYTES = 1 << 20
"""What the disk takes for less is the time of a call, not of the bytes."""
READ_BACK_SECONDS = 0.1
"""About what it takes to end a file and to read some of it back."""


class WriteBack:
    """What is on its way to the disk.

    Parameters
    ----------
    total : int
        Bytes that are to come to the disk altogether.
    clock : callable
        Seconds.

    Attributes
    ----------
    put, synced : int
        Bytes that have been written, and of these, those that are on the disk.
    """

    def __init__(self, total: int = 0, clock: Callable[[], float] = time.monotonic) -> None:
        self.total, self.put, self.synced, self._clock = total, 0, 0, clock
        self._bytes, self._seconds = 0, 0.0
        self._begun: float | None = None

    @contextlib.contextmanager
    def syncing(self) -> Iterator[None]:
        """What is written comes to the disk within."""
        put, begun = self.put, self._clock()
        self._begun = begun
        yield
        taken, self._begun = self._clock() - begun, None
        some, self.synced = put - self.synced, put
        if some >= ENOUGH_BYTES:
            self._seconds, self._bytes = self._seconds + taken, self._bytes + some

    def seconds(self) -> tuple[float, float]:
        """What the disk takes for what is written, and for all that is to come.

        Before the first bytes are there, it is as long again as it has been waited for them.
        """
        begun = self._begun  # another thread may end what it has begun
        waited = 0.0 if begun is None else self._clock() - begun
        if not self._bytes:
            return waited + READ_BACK_SECONDS, waited + READ_BACK_SECONDS
        pace = self._seconds / self._bytes
        written, left = (max((to - self.synced) * pace - waited, 0.0) for to in (self.put, self.total))
        return written + READ_BACK_SECONDS, left + READ_BACK_SECONDS
