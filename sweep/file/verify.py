"""Whether a result, finished or not, is what was written: every byte is read, and compared with its digest."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sweep.cells.partition import Partition
from sweep.errors import SweepError
from sweep.file.foreign import changed_attrs
from sweep.file.layout import DAMAGE
from sweep.file.open import OF_DAMAGE, unreadable
from sweep.file.reading import Changed, StoredFile
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
        Finished, and every byte is as it was written.
    findings : tuple of str
        What is wrong or missing, a line each; none where it is whole.
    blocks : tuple of int or None
        Damaged blocks of a finished result that can be computed again; None where that would not mend it.
    """

    path: Path
    whole: bool
    checked: str
    findings: tuple[str, ...]
    blocks: tuple[int, ...] | None = None

    def __str__(self) -> str:
        if self.whole:
            return f"{self.path}: whole; {self.checked}"
        return "\n".join([f"{self.path}: not whole; {self.checked}", *(f"  {text}" for text in self.findings)])


def verify(path: str | os.PathLike[str]) -> Verdict:
    """Reads a result, finished or not, and compares all digests.

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
    place = output if output.exists() else unfinished_of(output)
    if not place.exists():
        raise SweepError(f"{output}: no such file, and no sweep that writes it")
    structure = "its structure is damaged, or it is not the result of a sweep"
    try:
        if not place.is_file():
            raise unreadable(place, ValueError("it is no regular file"))
        with StoredFile(place) as file:
            return _verdict(output, file, place == output)
    except Changed:
        try:
            changed_attrs(place)
        except DAMAGE:
            return Verdict(output, False, "", (structure,))
        return Verdict(output, False, "", ("was changed by another program, which left its digests out",))
    except DAMAGE as fault:
        if isinstance(fault, OSError) and fault.errno and fault.errno not in OF_DAMAGE:
            raise unreadable(place, fault) from None
        text = (str(fault).splitlines() or [type(fault).__name__])[0]
        return Verdict(output, False, "", (f"{structure} ({text})",))


def _verdict(output: Path, file: StoredFile, ended: bool) -> Verdict:
    """Compares all digests; `ended`: the file has the name of a finished result. Raises one of DAMAGE."""
    size, table = file.path.stat().st_size, file.tables[file.work]
    beside = "damaged beside the outputs' numbers: in attributes, coordinates or its structure"
    if ended and not file.ending:
        return Verdict(output, False, f"{size:,} bytes checked", (beside,))
    findings: list[str] = []
    blocks: tuple[int, ...] = ()
    # the columns of a summary are made at its end
    for name in file.tables if file.ending else (file.work,):
        wanted = range(len(file.done[name])) if file.ending else np.flatnonzero(file.done[name]).tolist()
        bad = list(file.damaged(name, wanted))
        for number, place in enumerate(file.tables[name].places):
            runs = _runs(file.tables[name].blocks, [block for block, column in bad if column == number])
            told = [f"{place.name}: damaged between its cells {start:,} and {stop:,}" for start, stop in runs]
            findings += _shortened(told, f"{place.name}: damaged in {{}} more places")
        if name == file.work:
            blocks = tuple(sorted({block for block, _ in bad}))
    if file.ending:
        checked = f"{size:,} bytes checked"
        return Verdict(output, not findings, checked, tuple(findings), blocks if findings else None)
    done = file.done[file.work]
    missing = [table.blocks.bounds(block) for block in np.flatnonzero(~done).tolist()]
    told = [f"missing: {file.work} {start:,} to {stop:,}" for start, stop in missing]
    findings += _shortened(told, "missing: {} more")
    findings = findings or ["all blocks are there, but it has not ended; run the sweep again to finish"]
    checked = f"unfinished, {int(done.sum()):,} of {done.size:,} blocks there and checked"
    return Verdict(output, False, checked, tuple(findings))


def _runs(blocks: Partition, bad: list[int]) -> Iterator[tuple[int, int]]:
    """The first and the last cell but one of damaged blocks, neighbouring ones together."""
    for some in np.split(np.array(bad, np.int64), np.flatnonzero(np.diff(bad) > 1) + 1) if bad else ():
        yield blocks.bounds(int(some[0]))[0], blocks.bounds(int(some[-1]))[1]


def _shortened(lines: list[str], more: str) -> list[str]:
    """The first lines, and how many more there are."""
    left = len(lines) - MOST_TOLD
    return lines if left <= 0 else [*lines[:MOST_TOLD], more.format(f"{left:,}")]


def check_whole(output: Path) -> None:
    """Raises SweepError where a finished result is damaged."""
    verdict = verify(output)
    if not verdict.whole:
        cure = "" if verdict.blocks is None else "\n  sweep run --repair computes damaged cells again, and nothing else"
        raise SweepError(f"{verdict}{cure}")
