"""What a user is told when something cannot be done: one clear line each, never a traceback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class SweepError(Exception):
    """A fault the user can act on; its text is the whole message. The command line prints it and exits with 2."""


@dataclass(frozen=True)
class Mistake:
    """One thing wrong in a study: where it stands, and what was found, what is allowed, what to do."""

    where: str
    message: str


class StudyError(SweepError):
    """All mistakes of one study at once."""

    def __init__(self, source: str, mistakes: Sequence[Mistake]) -> None:
        self.source, self.mistakes = source, tuple(mistakes)
        width = max(len(m.where) for m in mistakes)
        count = "1 mistake" if len(mistakes) == 1 else f"{len(mistakes)} mistakes"
        super().__init__(
            "\n".join([f"{source}: {count}", *(f"  {m.where:{width}}  {m.message}" for m in self.mistakes)])
        )
