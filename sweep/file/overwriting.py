"""What may be overwritten: what is there already by force alone, and what a command reads never."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sweep.errors import SweepError
from sweep.file import disk


def check_target(target: Path, *, force: bool = False, read: Sequence[Path] = ()) -> None:
    """Raise SweepError where something is at `target`, unless by `force`, or where it is what is `read`."""
    there = bool(disk.mark(target))
    if there and any(one.exists() and target.samefile(one) for one in read):
        raise SweepError(f"{target} is what is read; name another file")
    if there and not force:
        raise SweepError(
            f"{target} is there already; name another file, or overwrite it with --force (Python: force=True)"
        )
