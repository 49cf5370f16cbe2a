"""Whether a result, finished or not, is what was written: every byte is read, and compared with its digest."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sweep.errors import SweepError
from sweep.file.foreign import changed_result
from sweep.file.layout import DAMAGE, Table
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
    place = output if output.exists() else unfinished_of(output)
    if not place.exists():
        raise SweepError(f"{output}: no such file, and no sweep that writes it")
    if not place.is_file():
        raise unreadable(place, ValueError("it is no regular file"))
    try:
        try:
            with StoredFile(place) as file:
                return _verdict(output, file)
        except Changed:
            changed_result(place).close()
            return Verdict(output, False, "", ("was changed by another program, which left its digests out",))
    except DAMAGE as fault:
        if isinstance(fault, OSError) and fault.errno and fault.errno not in OF_DAMAGE:
            raise unreadable(place, fault) from None
        text = (str(fault).splitlines() or [type(fault).__name__])[0]
        structure = "its structure is damaged, or it is not the result of a sweep"
        return Verdict(output, False, "", (f"{structure} ({text})",))


def _verdict(output: Path, file: StoredFile) -> Verdict:
    """Compares all digests. Raises one of DAMAGE."""
    checked = f"{file.path.stat().st_size:,} bytes checked"
    if file.path == output and not file.ending:
        return Verdict(output, False, checked, ("what was written at its end is damaged",))
    findings: list[str] = []
    damaged: dict[str, list[int]] = {}
    # the columns of a summary are made at its end
    for name in file.tables if file.ending else (file.work,):
        table, done = file.tables[name], file.done[name]
        bad = list(file.damaged(name, range(len(done)) if file.ending else np.flatnonzero(done).tolist()))
        damaged[name] = sorted({block for block, _ in bad})
        for number, place in enumerate(table.places):
            told = (
                f"{place.name}: damaged between its cells {{:,}} and {{:,}}",
                f"{place.name}: damaged in {{}} more places",
            )
            findings += _told(*told, table, [block for block, column in bad if column == number])
    if file.ending:
        blocks = tuple(damaged[file.work]) if findings else None
        return Verdict(output, not findings, checked, tuple(findings), blocks)
    done = file.done[file.work]
    missing = np.flatnonzero(~done).tolist()
    findings += _told(f"missing: {file.work} {{:,}} to {{:,}}", "missing: {} more", file.tables[file.work], missing)
    findings = findings or ["all blocks are there, but it has not ended; run the sweep again to finish"]
    checked = f"unfinished, {int(done.sum()):,} of {done.size:,} blocks there and checked"
    return Verdict(output, False, checked, tuple(findings))


def _told(text: str, more: str, table: Table, blocks: list[int]) -> Iterator[str]:
    """A line for each run of blocks, with its first cell and the last but one; of many, how many there are more."""
    runs = np.split(np.array(blocks, np.int64), np.flatnonzero(np.diff(blocks) > 1) + 1) if blocks else []
    for run in runs[:MOST_TOLD]:
        yield text.format(table.blocks.bounds(int(run[0]))[0], table.blocks.bounds(int(run[-1]))[1])
    if len(runs) > MOST_TOLD:
        yield more.format(f"{len(runs) - MOST_TOLD:,}")


def check_whole(output: Path) -> None:
    """Raises SweepError where a finished result is damaged."""
    verdict = verify(output)
    if not verdict.whole:
        cure = "" if verdict.blocks is None else "\n  sweep run --repair computes damaged cells again, and nothing else"
        raise SweepError(f"{verdict}{cure}")
