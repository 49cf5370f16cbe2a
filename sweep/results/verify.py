"""Whether a result, or the parts of one that is not finished, is what was written: every digest is taken again."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xxhash

from sweep.cells.output_schema import part_columns
from sweep.cells.partition import Partition, row_blocks
from sweep.results.open import checked_study, unreadable
from sweep.store.digests import (
    BESIDE,
    BYTES,
    DIGESTS,
    GROUP,
    STRUCTURE,
    pieces,
    read_table,
    structure_digest,
    structure_place,
    trailer_bytes,
    unbroken,
)
from sweep.store.hdf5_bytes import PartBytes
from sweep.store.manifest import MANIFEST, Manifest, read_manifest
from sweep.store.parts import DAMAGE, PART_NAME, READERS, is_sound
from sweep.store.probe import check_own, readable
from sweep.store.store import LOCK, folder_of
from sweep.system import disk
from sweep.system.errors import SweepError

OF_DAMAGE = (errno.EINVAL, errno.EOVERFLOW)
"""What the system says where a damaged file sends one to a place that cannot be."""
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
    """

    path: Path
    whole: bool
    checked: str
    findings: tuple[str, ...]

    def __str__(self) -> str:
        if self.whole:
            return f"{self.path}: whole; {self.checked}"
        return "\n".join([f"{self.path}: not whole; {self.checked}", *(f"  {text}" for text in self.findings)])


def verify(path: str | os.PathLike[str]) -> Verdict:
    """Reads a finished result, or the parts of an unfinished one, and compares all digests.

    Raises
    ------
    SweepError
        There is nothing to verify, it cannot be read, or it was written without digests.

    Examples
    --------
    >>> import sweep
    >>> ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [0.5, 1.0, 2.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> sweep.run(sweep.study_of(ds), "verified.h5").close()
    >>> sweep.verify("verified.h5").whole
    True
    """
    output = Path(path)
    if output.exists():
        return _finished(output)
    folder = folder_of(output)
    manifest = read_manifest(folder)
    if manifest is None:
        raise SweepError(f"{output}: no such file, and no sweep that writes it")
    return _parts(output, folder, manifest)


@dataclass(frozen=True)
class _Column:
    """A column whose numbers lie in the file one after the other, from `place` on."""

    name: str
    number: int
    place: int
    cell_bytes: int

    def digest(self, fd: int, start: int, stop: int) -> bytes:
        """Digest of some cells."""
        state = xxhash.xxh3_128()
        for piece in pieces(fd, self.place + start * self.cell_bytes, self.place + stop * self.cell_bytes):
            state.update(piece)
        return state.digest()


def _finished(output: Path) -> Verdict:
    import h5py

    try:
        if not output.is_file():
            raise unreadable(output, ValueError("it is no regular file"))
        size = output.stat().st_size
        if not _may_be_read(output):
            return Verdict(output, False, f"{size:,} bytes checked", (BESIDE,))
        with h5py.File(output, "r") as file:
            check_own(file)
            if GROUP not in file and "study_json" in file.attrs:
                raise SweepError(f"{output}: has no digests; it was written by an earlier version")
            findings = _compare(output, file, *_description(file, size))
    except DAMAGE as fault:
        if output.is_dir() or isinstance(fault, PermissionError):
            raise unreadable(output, fault) from None
        if isinstance(fault, OSError) and fault.errno and fault.errno not in OF_DAMAGE:
            raise SweepError(f"{output}: cannot be read ({os.strerror(fault.errno)})") from None
        text = (str(fault).splitlines() or [type(fault).__name__])[0]
        findings = [f"its structure is damaged, or it is not the result of a sweep ({text})"]
    return Verdict(output, not findings, f"{size:,} bytes checked", tuple(findings))


def _may_be_read(output: Path) -> bool:
    """False where the structure is damaged. Raises OSError."""
    fd = disk.open_file(output, os.O_RDONLY)
    try:
        found = unbroken(fd)
        return readable(output, fd) if found is None else found
    finally:
        os.close(fd)


def _description(file: Any, size: int) -> tuple[list[_Column], Partition]:
    """What the file says that it holds, in so many bytes. Raises one of DAMAGE where that cannot be."""
    names, blocks = read_table(file, size)
    cells, columns = blocks.size, []
    for number, dataset in enumerate(file[name] for name in names):
        if dataset.size % cells:
            raise ValueError(f"{names[number]} has another shape")
        if not dataset.chunks:
            columns.append(_Column(names[number], number, dataset.id.get_offset(), dataset.nbytes // cells))
    return columns, blocks


def _compare(output: Path, file: Any, columns: list[_Column], blocks: Partition) -> list[str]:
    digests = file[GROUP][DIGESTS][...]
    fd = disk.open_file(output, os.O_RDONLY)
    try:
        findings: list[str] = []
        for column in columns:
            found = (column.digest(fd, *blocks.bounds(index)) for index in range(blocks.count))
            bad = [i for i, one in enumerate(found) if one != bytes(digests[i, column.number])]
            findings += _told(column.name, blocks, bad)
        place = structure_place(file)
        apart = [(c.place, c.place + c.cell_bytes * blocks.size) for c in columns]
        size = os.fstat(fd).st_size
        if structure_digest(fd, [*apart, (place, place + BYTES), (size - trailer_bytes(fd), size)]) != bytes(
            file[GROUP][STRUCTURE][...]
        ):
            findings.append(BESIDE)
        return findings
    finally:
        os.close(fd)


def _told(name: str, blocks: Partition, bad: list[int]) -> Iterator[str]:
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


def _parts(output: Path, folder: Path, manifest: Manifest) -> Verdict:
    study = checked_study(folder, manifest)
    part_bytes = PartBytes(part_columns(study), manifest.mark)
    names, strange = _sorted_out(folder, manifest.blocks)

    every = [name for several in names.values() for name in several]
    with ThreadPoolExecutor(READERS) as pool:
        good = dict(zip(every, pool.map(lambda name: is_sound(folder / name, part_bytes), every), strict=True))
    rows = row_blocks(study)
    missing = (rows.cells(*manifest.blocks.bounds(i)) for i in range(manifest.blocks.count) if i not in names)
    findings = [
        *_lines("damaged", (name for name, fine in good.items() if not fine)),
        *_lines("twice there", (name for several in names.values() if len(several) > 1 for name in several)),
        *_lines("not of this sweep", strange),
        *_lines("missing", (f"cells {start:,} to {stop:,}" for start, stop in missing)),
    ]
    if not findings:
        findings = ["all blocks are there, but not put together yet; run the sweep again to finish"]
    checked = f"unfinished, {len(names):,} of {manifest.blocks.count:,} blocks there and checked"
    return Verdict(output, False, checked, tuple(findings))


def _sorted_out(folder: Path, blocks: Partition) -> tuple[Mapping[int, list[str]], list[str]]:
    """File names of every block, and names of files that have no business here."""
    names: dict[int, list[str]] = {}
    strange = []
    for entry in sorted(os.scandir(folder), key=lambda entry: entry.name):
        match = PART_NAME.fullmatch(entry.name)
        index = int(match[1]) // blocks.cells if match else -1
        if match and blocks.holds(int(match[1]), int(match[2])):
            names.setdefault(index, []).append(entry.name)
        elif entry.name not in (MANIFEST, LOCK) and not entry.name.endswith(".tmp"):
            strange.append(entry.name)
    return names, strange


def _lines(what: str, names: Iterable[str]) -> list[str]:
    found = list(names)
    more = [f"{what}: {len(found) - MOST_TOLD:,} more"] if len(found) > MOST_TOLD else []
    return [f"{what}: {name}" for name in found[:MOST_TOLD]] + more


def check_whole(output: Path) -> None:
    """Raises SweepError where a finished result is damaged."""
    verdict = verify(output)
    if not verdict.whole:
        raise SweepError(str(verdict))
