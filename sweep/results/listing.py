"""Lists the results in a folder, one per line: question, cells, share computed, statuses, date, version."""

from __future__ import annotations

import os
from pathlib import Path

from sweep.errors import SweepError
from sweep.file.open import stored
from sweep.file.reading import UNFINISHED
from sweep.results.statuses import Account, account
from sweep.words import Table, as_path, percent

HEADINGS = ("result", "cells", "done", "statuses", "when", "version", "question")
LATER = ("when", "version")
"""Of these, what is printed by `sweep list --all` only."""


class Listed:
    """One result.

    Attributes
    ----------
    path : Path
    question : str
        Its question, or its title if there is none.
    cells : int
    done : float
        Share of the cells that are computed.
    statuses, account : dict of str to int
        Number of cells with each status, and in each group of `kernels.interface.KINDS`.
    when, version : str
        When it ended, or began if it has not ended; the version of foliot.
    fault : str
        Why it cannot be read; everything else is then empty.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.fault, attrs, found = path, "", dict[str, str](), Account({}, {})
        try:
            with stored(path) as file:
                attrs, found = file.attrs, account(file)
        except (SweepError, OSError) as fault:
            self.fault = str(fault).removeprefix(f"{path}: ")
        self.question = str(attrs.get("question") or attrs.get("title", ""))
        self.cells, self.statuses, self.account = found.total, found.statuses, found.by_kind
        self.done = 0.0 if self.fault else found.done
        self.when = str(attrs.get("end", attrs.get("start", "")))
        self.version = str(attrs.get("versions", "")).partition(",")[0].removeprefix("foliot ")

    def __repr__(self) -> str:
        return Table([self.row], HEADINGS).text("", True)

    @property
    def row(self) -> tuple[str, ...]:
        """Texts below `HEADINGS`."""
        if self.fault:
            return self.path.name, "", "", "", "", "", self.fault
        cells = ", ".join(f"{n:,} {kind}" for kind, n in self.account.items() if n)
        return self.path.name, f"{self.cells:,}", percent(self.done), cells, self.when[:16], self.version, self.question


class Listing(tuple[Listed, ...]):
    """A list of results, printed as a table without the columns `LATER`."""

    def table(self, complete: bool = False) -> str:
        """The table, with all columns if `complete`."""
        if not self:
            return "no results here"
        shown = [i for i, name in enumerate(HEADINGS) if complete or name not in LATER]
        rows = [[found.row[i] for i in shown] for found in self]
        return Table(rows, [HEADINGS[i] for i in shown]).text("", complete)

    __str__ = __repr__ = table


def list_results(folder: str | os.PathLike[str] = ".") -> Listing:
    """List the results in a folder, finished or not, by name; for other HDF5 files, why they are not results.

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
    names = {entry.name.removesuffix(UNFINISHED) for entry in place.iterdir()}
    return Listing(Listed(place / name) for name in sorted(names) if name.endswith((".h5", ".nc")))
