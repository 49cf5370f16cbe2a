"""Whether a result, finished or not, is what was written: every byte is read, and compared with its digest."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sweep.cells.partition import Partition
from sweep.errors import SweepError
from sweep.file import disk
from sweep.file.layout import DAMAGE
from sweep.file.open import BESIDE, OF_DAMAGE, stored_attrs, unreadable
from sweep.file.probe import check_own
from sweep.file.reading import StoredFile, damaged, padding_is_zero, unbroken
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
    try:
        if not place.is_file():
            raise unreadable(place, ValueError("it is no regular file"))
        return _verdict(output, place)
    except DAMAGE as fault:
        if isinstance(fault, OSError) and fault.errno and fault.errno not in OF_DAMAGE:
            raise unreadable(place, fault) from None
        text = (str(fault).splitlines() or [type(fault).__name__])[0]
        return Verdict(output, False, "", (f"its structure is damaged, or it is not the result of a sweep ({text})",))


def _verdict(output: Path, place: Path) -> Verdict:
    """Raises one of DAMAGE, SweepError."""
    checked = f"{place.stat().st_size:,} bytes checked"
    if (found := _structure(place)) is not None:
        return Verdict(output, False, checked, (found,))
    with StoredFile(place) as file:
        if place == output and not file.finished:
            return Verdict(output, False, checked, (BESIDE,))
        bad = {name: list(damaged(file, name, _wanted(file, name))) for name in _tables(file)}
        findings = [line for name, chunks in bad.items() for line in _told(file, name, chunks)]
        if not padding_is_zero(file):
            return Verdict(output, False, checked, (*findings, BESIDE))
        if not file.finished:
            return _unfinished(output, file, findings)
        work = bad[file.layout.work_name]
        blocks = tuple(sorted({block for block, _ in work})) if findings else None
        return Verdict(output, not findings, checked, tuple(findings), blocks)


def _structure(place: Path) -> str | None:
    """What is wrong with all but the numbers. Raises OSError, SweepError."""
    fd = disk.open_file(place, os.O_RDONLY)
    try:
        sound = unbroken(fd, path=place)
    finally:
        os.close(fd)
    if sound is None:
        try:
            stored_attrs(place)
        except SweepError:
            return "its structure is damaged, or it is not the result of a sweep"
        return "was changed by another program, which left its digests out"
    if not sound:
        return BESIDE
    import h5py

    with h5py.File(place, "r") as file:
        check_own(file)
    return None


def _tables(file: StoredFile) -> Iterable[str]:
    """Those that are there; the columns of a summary are made at its end."""
    return file.layout.tables if file.finished else (file.layout.work_name,)


def _wanted(file: StoredFile, name: str) -> list[int]:
    done = file.done(name)
    return list(range(len(done))) if file.finished else np.flatnonzero(done).tolist()


def _told(file: StoredFile, name: str, chunks: list[tuple[int, int]]) -> Iterator[str]:
    """Damaged cells of every column of a table."""
    table = file.layout.tables[name]
    for number, place in enumerate(table.places):
        yield from _runs(place.name, table.blocks, [block for block, column in chunks if column == number])


def _runs(name: str, blocks: Partition, bad: list[int]) -> Iterator[str]:
    """Damaged cells of a column, neighbouring blocks together."""
    runs: list[list[int]] = []
    for index in bad:
        if runs and runs[-1][1] == index:
            runs[-1][1] += 1
        else:
            runs.append([index, index + 1])
    for first, last in runs[:MOST_TOLD]:
        yield f"{name}: damaged between its cells {blocks.bounds(first)[0]:,} and {blocks.bounds(last - 1)[1]:,}"
    if len(runs) > MOST_TOLD:
        yield f"{name}: damaged in {len(runs) - MOST_TOLD} more places"


def _unfinished(output: Path, file: StoredFile, findings: list[str]) -> Verdict:
    work, blocks = file.layout.work_name, file.layout.work.blocks
    done = file.done(work)
    missing = [blocks.bounds(block) for block in np.flatnonzero(~done).tolist()]
    told = [f"missing: {work} {start:,} to {stop:,}" for start, stop in missing[:MOST_TOLD]]
    if len(missing) > MOST_TOLD:
        told.append(f"missing: {len(missing) - MOST_TOLD:,} more")
    found = [*findings, *told] or ["all blocks are there, but it has not ended; run the sweep again to finish"]
    checked = f"unfinished, {int(done.sum()):,} of {blocks.count:,} blocks there and checked"
    return Verdict(output, False, checked, tuple(found))


def check_whole(output: Path) -> None:
    """Raises SweepError where a finished result is damaged."""
    verdict = verify(output)
    if not verdict.whole:
        cure = "" if verdict.blocks is None else "\n  sweep run --repair computes damaged cells again, and nothing else"
        raise SweepError(f"{verdict}{cure}")
