"""Whether a result, finished or not, is what was written: all numbers, and all that stands before its key, are read and
compared with their digests. Tables of places behind it have checksums of HDF5's; where nothing stands is not compared.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.reading import UNFINISHED, Damaged, StoredFile, Table
from sweep.file.store import unfinished_of
from sweep.words import as_path

MOST_TOLD = 8
"""Findings of one kind that are told one by one."""


@dataclass(frozen=True)
class Verdict:
    """What was found; `str` of it is what `sweep verify` prints.

    Attributes
    ----------
    whole : bool
        Finished, and all that it says is as it was written.
    findings : tuple of str
        What is wrong or missing, a line each; none where it is whole.
    blocks : tuple of int or None
        Damaged blocks of a finished result that can be computed again; None where that would not mend it.
    state : str
        What it is called if it is not whole: "damaged", or "not complete" where nothing is wrong with what there is.
    """

    path: Path
    whole: bool
    checked: str
    findings: tuple[str, ...]
    blocks: tuple[int, ...] | None = None
    state: str = "damaged"

    def __str__(self) -> str:
        if self.whole:
            return f"{self.path}: undamaged; {self.checked}"
        return "\n".join([f"{self.path}: {self.state}; {self.checked}", *(f"  {text}" for text in self.findings)])

    def require_whole(self) -> None:
        """Raises SweepError where anything is wrong."""
        if not self.whole:
            cure = (
                "" if self.blocks is None else "\n  sweep run --repair computes damaged cells again, and nothing else"
            )
            raise SweepError(f"{self}{cure}")


def verify(path: str | os.PathLike[str]) -> Verdict:
    """Check all checksums of a result, finished or not.

    Raises
    ------
    SweepError
        There is nothing to verify, or it cannot be read.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.run(sweep.study(ds), "verified.h5").close()
    >>> sweep.verify("verified.h5").whole
    True
    """
    output = as_path(path)
    place = output if disk.mark(output) else unfinished_of(output)
    try:
        with StoredFile(place) as file:
            return _verdict(output, file)
    except (FileNotFoundError, NotADirectoryError):
        raise SweepError(f"{output}: no such file, nor a run that is writing it") from None
    except Damaged as fault:
        return Verdict(output, False, "its structure is damaged, or it is not the result of a sweep", (str(fault),))


def _verdict(output: Path, file: StoredFile) -> Verdict:
    """Compares all digests; HDF5 has checked texts and coordinates when it read them."""
    findings: list[str] = []
    if not file.is_as_made():
        findings.append("its structure is not as it was made: damaged, or changed by another program")
    mendable, damaged = not findings, set[int]()
    work = file.tables[file.work]
    # the columns of a summary are made at its end
    for table in (work, *({file.tables["cells"]} - {work} if file.ending else ())):
        there = range(table.blocks.count) if file.ending else np.flatnonzero(table.done).tolist()
        for name, bad in table.damaged(there).items():
            damaged.update(bad if table is work else ())
            findings += _lines(f"{name}: damaged between its cells {{:,}} and {{:,}}", table, bad)
    if file.path.suffix != UNFINISHED:
        blocks = tuple(sorted(damaged)) if findings and mendable else None
        return Verdict(output, not findings, f"{file.path.stat().st_size:,} bytes checked", tuple(findings), blocks)
    state, missing = "damaged" if findings else "not complete", np.flatnonzero(~work.done).tolist()
    findings += _lines(f"missing: {file.work} {{:,}} to {{:,}}", work, missing)
    findings = findings or ["all blocks are there, but it has not ended; run the sweep again to finish"]
    checked = f"unfinished, {work.blocks.count - len(missing):,} of {work.blocks.count:,} blocks there and checked"
    return Verdict(output, False, checked, tuple(findings), state=state)


def _lines(text: str, table: Table, blocks: list[int]) -> Iterator[str]:
    """A line for each run of blocks, with its first cell and the last but one; of many, how many there are more."""
    runs = np.split(np.array(blocks, np.int64), np.flatnonzero(np.diff(blocks) > 1) + 1) if blocks else []
    for run in runs[:MOST_TOLD]:
        yield text.format(table.blocks.bounds(int(run[0]))[0], table.blocks.bounds(int(run[-1]))[1])
    if len(runs) > MOST_TOLD:
        yield f"{text.partition(':')[0]}: {len(runs) - MOST_TOLD:,} more places"
