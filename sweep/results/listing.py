"""The results in a folder, a line each: question, cells, how much is done, statuses, when, by which version."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

from sweep.errors import SweepError
from sweep.file.open import stored
from sweep.results.statuses import account
from sweep.words import Table, as_path

UNFINISHED = re.compile(r"(.+\.(?:h5|nc))\.unfinished")
"""What a sweep that still runs has beside its output."""
HEADINGS = ("result", "cells", "done", "statuses", "when", "version", "question")
LATER = ("when", "version")
"""Of these, what is printed by `sweep list --all` only."""


@dataclass(frozen=True)
class Listed:
    """One result.

    Attributes
    ----------
    path : Path
    question : str
        Or the title, where there is none.
    cells : int
    done : float
        Share of the cells that are computed.
    statuses, account : dict of str to int
        Cells of each status, and under each of the words of `kernels.interface.KINDS`.
    when, version : str
        When it ended, or began where it has not; by which version of foliot.
    fault : str
        Why it cannot be read; all else is empty then.
    """

    path: Path
    question: str = ""
    cells: int = 0
    done: float = 0.0
    statuses: dict[str, int] = field(default_factory=dict)
    account: dict[str, int] = field(default_factory=dict)
    when: str = ""
    version: str = ""
    fault: str = ""

    @property
    def row(self) -> tuple[str, ...]:
        """Texts below `HEADINGS`."""
        if self.fault:
            return self.path.name, "", "", "", "", "", self.fault
        cells = ", ".join(f"{n:,} {kind}" for kind, n in self.account.items() if n)
        done = f"{int(1000 * self.done) / 10:g} %"
        return self.path.name, f"{self.cells:,}", done, cells, self.when[:16], self.version, self.question


class Listing(tuple[Listed, ...]):
    """Results; printed they are a table, without the columns `LATER`."""

    def table(self, complete: bool = False) -> str:
        """The table, by wish with all columns."""
        if not self:
            return "no results here"
        shown = [i for i, name in enumerate(HEADINGS) if complete or name not in LATER]
        rows = [[found.row[i] for i in shown] for found in self]
        return Table(rows, [HEADINGS[i] for i in shown]).text("", complete)

    __str__ = __repr__ = table


def list_results(folder: str | os.PathLike[str] = ".") -> Listing:
    """The results in a folder, finished or not, by name; of other HDF5 files, why they are not results.

    Raises
    ------
    SweepError
        There is no such folder.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.5, 2.0]}, fixed={"phi0": 1.0, "a": 1.0}, question="Why?")
    >>> sweep.run(study, "listed.h5").close()
    >>> found, = (one for one in sweep.list_results() if one.path.name == "listed.h5")
    >>> found.question, found.cells, found.done, found.statuses
    ('Why?', 2, 1.0, {'OK': 2})
    """
    place = as_path(folder)
    if not place.is_dir():
        raise SweepError(f"{place}: there is no such folder")
    names = {entry.name for entry in place.iterdir()}
    found = {name for name in names if name.endswith((".h5", ".nc"))}
    found |= {match[1] for name in names if (match := UNFINISHED.fullmatch(name))}
    return Listing(_listed(place / name) for name in sorted(found))


def _listed(path: Path) -> Listed:
    try:
        with stored(path) as file:
            attrs, found = file.attrs, account(file)
            return Listed(
                path=path,
                question=str(attrs.get("question") or attrs.get("title", "")),
                cells=found.total,
                done=(found.total - found.by_kind["pending"]) / found.total,
                statuses=found.statuses,
                account=found.by_kind,
                when=str(attrs.get("end", attrs.get("start", ""))),
                version=str(attrs.get("versions", "")).partition(",")[0].removeprefix("foliot "),
            )
    except (SweepError, OSError) as fault:
        return Listed(path, fault=str(fault).removeprefix(f"{path}: "))
