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
    left : int
        Bytes that are to come to the disk altogether.
    clock : callable
        Seconds.

    Attributes
    ----------
    written : int
        Bytes that are written, and not known to be on the disk.
    """

    def __init__(self, left: int = 0, clock: Callable[[], float] = time.monotonic) -> None:
        self.left, self.written, self._clock = left, 0, clock
        self._bytes, self._seconds = 0, 0.0
        self._begun: float | None = None

    @contextlib.contextmanager
    def syncing(self) -> Iterator[None]:
        """What is written comes to the disk within."""
        some, self._begun = self.written, self._clock()
        yield
        taken, self._begun = self._clock() - self._begun, None
        self.written, self.left = self.written - some, self.left - some
        if some >= ENOUGH_BYTES:
            self._seconds, self._bytes = self._seconds + taken, self._bytes + some

    def seconds(self) -> tuple[float, float]:
        """What the disk takes for what is written, and for all that is to come.

        Before the first bytes are there, it is as long again as it has been waited for them.
        """
        waited = 0.0 if self._begun is None else self._clock() - self._begun
        if not self._bytes:
            return waited + READ_BACK_SECONDS, waited + READ_BACK_SECONDS
        pace = self._seconds / self._bytes
        written, left = (max(some * pace - waited, 0.0) + READ_BACK_SECONDS for some in (self.written, self.left))
        return written, left
