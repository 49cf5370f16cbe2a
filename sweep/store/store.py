"""Finished blocks on the disk while a sweep runs: OUT.h5.parts/.

    spec.json                      the study, its fingerprint, and how the grid is cut into blocks
    lock                           held while a sweep runs; the system frees it when the process ends
    <start>-<stop>.<digest>.h5     one block: a small HDF5 file that is written once, or not at all
    workers.<run>.tmp/             files that workers of a cluster are writing; without it they cannot

A block counts as done when its file bears this name. The digest (xxh3, 128 bits) is of the fingerprint and of its
numbers, in the order of the columns: a block computed twice has the same name, and a damaged file, or one of another
study, is known from its name.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store.hdf5_bytes import PartBytes
from sweep.store.manifest import MANIFEST, Manifest, new_manifest
from sweep.store.parts import PART_NAME, digest, part_name, read_part
from sweep.system import disk
from sweep.system.errors import SweepError

LOCK = "lock"
SHARED, CLOSED = "workers", "closed"


def folder_of(output: Path) -> Path:
    """Where the parts of a result are kept while its sweep runs."""
    return output.with_name(output.name + ".parts")


class Store:
    """The parts of one sweep, locked for this process. Made by `opened`.

    Attributes
    ----------
    folder : Path
    columns : tuple of Column
    manifest : Manifest or None
        None until `begin`, where the sweep is new.
    names : dict of int to str
        File of every finished block.
    """

    def __init__(self, folder: Path, columns: Sequence[Column]) -> None:
        self.folder = folder
        self.columns = tuple(columns)
        self.manifest: Manifest | None = None
        self.names: dict[int, str] = {}
        self.run = secrets.token_hex(4)
        self._part_bytes = PartBytes(columns)
        self._scratch = folder

    def _of(self, manifest: Manifest) -> None:
        """The parts are those of this sweep from now on."""
        self.manifest, self._part_bytes = manifest, PartBytes(self.columns, manifest.mark)

    @classmethod
    def sharing(
        cls, shared: Path, columns: Sequence[Column], fingerprint: Mapping[str, str], blocks: Partition
    ) -> Store:
        """The store of a process that writes parts for the one that has made the shared folder, and has the lock."""
        store = cls(shared.parent, columns)
        store._scratch = shared
        store._of(Manifest("", fingerprint, blocks, ""))
        return store

    @property
    def blocks(self) -> Partition:
        """How the grid is cut."""
        assert self.manifest is not None, "the sweep has not begun"
        return self.manifest.blocks

    def missing(self) -> list[int]:
        """Numbers of the blocks that are not done, ascending."""
        return [i for i in range(self.blocks.count) if i not in self.names]

    def begin(self, study: str, fingerprint: Mapping[str, str], blocks: Partition) -> None:
        """Fixes study and partition for good. Raises SweepError."""
        self.write(new_manifest(study, fingerprint, blocks))

    def write(self, manifest: Manifest) -> None:
        """Puts a manifest in place; the parts that are there are not taken up. Raises SweepError."""
        path = self.folder / MANIFEST
        try:
            disk.publish([manifest.to_json().encode()], self.temporary(MANIFEST), path)
        except OSError as fault:
            raise disk.refusal(fault, path) from fault
        self._of(manifest)

    def resume(self, manifest: Manifest) -> None:
        """Takes up the parts that are there. Raises SweepError."""
        self._of(manifest)
        try:
            self._sort_out()
        except OSError as fault:
            raise disk.refusal(fault, self.folder) from fault

    def put(self, index: int, arrays: Mapping[str, Any]) -> None:
        """Stores a block: on return it is on the disk. Raises SweepError."""
        start, stop = self.blocks.bounds(index)
        name = part_name(start, stop, digest(self.columns, arrays, self._part_bytes.mark))
        pieces = self._part_bytes.pieces(start, stop, arrays)
        try:
            disk.publish(pieces, self.temporary(f"{start:012d}"), self.folder / name)
        except OSError as fault:
            raise disk.refusal(fault, self.folder / name) from fault
        self.names[index] = name

    def get(self, index: int, buffers: Mapping[str, Any] | None = None) -> dict[str, Any] | None:
        """The numbers of a finished block, or None where its file is damaged. Raises FileNotFoundError."""
        return read_part(self.folder / self.names[index], self._part_bytes, buffers)

    def set_aside(self, index: int) -> Path:
        """Takes a damaged block out of the finished ones, keeping its file for a look. Raises OSError."""
        path = self.folder / self.names.pop(index)
        return _set_aside(path)

    def temporary(self, name: str) -> Path:
        """A name for a file that is not whole yet."""
        return self._scratch / f"{name}.{self.run}.tmp"

    def open_shared(self) -> Path:
        """A folder in which processes elsewhere make files that become parts. Raises SweepError."""
        shared = self.folder / f"{SHARED}.{self.run}.tmp"
        self.close_shared()
        try:
            disk.make_folder(shared)
        except OSError as fault:
            raise disk.refusal(fault, shared) from fault
        return shared

    def close_shared(self) -> None:
        """From now on nobody else brings a part, however late: what was begun has lost its place. Raises SweepError."""
        for name in [entry.name for entry in os.scandir(self.folder) if entry.name.endswith(".tmp")]:
            path = self.folder / name
            if name.startswith(f"{SHARED}."):
                # renamed, it is gone for everybody in one step; what is in it goes then
                path = path.with_name(f"{CLOSED}.{secrets.token_hex(4)}.tmp")
                try:
                    disk.rename(self.folder / name, path)
                except OSError as fault:
                    raise disk.refusal(fault, self.folder / name) from fault
            if path.name.startswith(f"{CLOSED}."):
                shutil.rmtree(path, ignore_errors=True)

    def take(self, index: int, name: str) -> None:
        """Counts a block as done whose part another process has written. Raises SweepError."""
        match = PART_NAME.fullmatch(name)
        if match is None or (int(match[1]), int(match[2])) != self.blocks.bounds(index):
            raise SweepError(f"{self.folder}: a worker has written something else than it was asked for")
        self.names[index] = name

    def clear(self) -> None:
        """Removes what a sweep writes, the manifest last: a removal cut short leaves a store. Raises SweepError."""
        try:
            self.close_shared()
            for path in list(self.folder.iterdir()):
                if PART_NAME.fullmatch(path.name) or path.suffix in (".tmp", ".damaged"):
                    _remove(path)
            disk.remove(self.folder / MANIFEST)
        except OSError as fault:
            raise disk.refusal(fault, self.folder) from fault
        self.manifest, self.names = None, {}

    def orphans(self) -> int:
        """Parts that are there although no manifest says of what."""
        return 0 if self.manifest else sum(bool(PART_NAME.fullmatch(path.name)) for path in self.folder.iterdir())

    def _sort_out(self) -> None:
        self.close_shared()
        row_bytes = sum(column.cell_bytes for column in self.columns)
        for entry in list(os.scandir(self.folder)):
            if entry.name.endswith(".tmp"):
                _remove(Path(entry.path))
            elif match := PART_NAME.fullmatch(entry.name):
                self._take_up(entry, int(match[1]), int(match[2]), row_bytes)

    def _take_up(self, entry: os.DirEntry[str], start: int, stop: int, row_bytes: int) -> None:
        index = start // self.blocks.cells
        if not self.blocks.holds(start, stop) or entry.stat().st_size < (stop - start) * row_bytes:
            _set_aside(Path(entry.path))
        elif index in self.names:
            self._compare(index, entry.name)
        else:
            self.names[index] = entry.name

    def _compare(self, index: int, other: str) -> None:
        """Of two files of one block, one must be damaged."""
        start, stop = self.blocks.bounds(index)
        both = (self.names[index], other)
        sound = [name for name in both if read_part(self.folder / name, self._part_bytes) is not None]
        if len(sound) == 2:
            raise SweepError(
                f"{self.folder}: cells {start} to {stop} came out differently twice; the kernel is not deterministic"
            )
        del self.names[index]
        for name in set(both) - set(sound):
            _set_aside(self.folder / name)
        if sound:
            self.names[index] = sound[0]


@contextlib.contextmanager
def opened(output: Path, columns: Sequence[Column]) -> Iterator[Store]:
    """The store beside an output, made where there is none and held by this process alone.

    It is removed at the end where nothing is left in it. Raises SweepError.
    """
    folder = folder_of(output)
    try:
        fd = _lock(folder)
    except OSError as fault:
        raise disk.refusal(fault, folder) from fault
    store = Store(folder, columns)
    try:
        if folder.stat().st_dev != output.parent.stat().st_dev:
            raise SweepError(
                f"{folder} is on another file system than its result, which would not get its place at the end; "
                "remove it, or choose another output with -o"
            )
        yield store
    finally:
        if store.manifest is None:
            _remove_folder(folder)
        os.close(fd)


def _lock(folder: Path) -> int:
    while True:
        disk.make_folder(folder)
        disk.sync_folder(folder.parent)
        try:
            fd = disk.open_file(folder / LOCK, os.O_CREAT | os.O_RDWR)
        except FileNotFoundError:
            continue
        if not disk.try_lock(fd):
            os.close(fd)
            raise SweepError(f"{folder}: another run is at work on this output; wait for it, or choose another with -o")
        # the run that held the lock may have removed the folder meanwhile
        with contextlib.suppress(FileNotFoundError):
            if (folder / LOCK).stat().st_ino == os.fstat(fd).st_ino:
                return fd
        os.close(fd)


def _remove_folder(folder: Path) -> None:
    with contextlib.suppress(OSError):
        disk.remove(folder / LOCK)
        folder.rmdir()


def _remove(path: Path) -> None:
    """Removes a file; a folder, of workers who are gone, as far as that goes."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        disk.remove(path)


def _set_aside(path: Path) -> Path:
    aside = path.with_name(path.name + ".damaged")
    disk.rename(path, aside)
    return aside
