"""What a system lacks is made of what it has: the same bits, the same care."""

import errno
import os
import signal

import pytest
from running import kept, quiet, same, tall

from sweep.results.verify import verify
from sweep.store.store import opened, unfinished_of
from sweep.system import disk
from sweep.system.errors import SweepError

CALLS = ["pwritev", "pwrite", "preadv", "posix_fallocate", "fdatasync", "sysconf"]
SIGNALS = ["SIGUSR1", "SIGUSR2", "SIGHUP"]


def take_away(monkeypatch, *names):
    """Calls of the system, signals, and the module that locks."""
    for name in names:
        if name == "fcntl":
            monkeypatch.setattr(disk, "fcntl", None)
        else:
            monkeypatch.delattr(signal if name.startswith("SIG") else os, name)


@pytest.mark.parametrize("names", [[name] for name in (*CALLS, "fcntl")] + [SIGNALS, [*CALLS, *SIGNALS, "fcntl"]])
def test_a_run_needs_no_call_that_only_some_systems_have(tmp_path, monkeypatch, names):
    output, expected = tmp_path / "out.h5", quiet(tall(3003))
    take_away(monkeypatch, *names)
    with quiet(tall(3003), output, block_cells=500) as found:
        same(found, expected)
    assert verify(output).whole
    assert list(tmp_path.iterdir()) == [output]


@pytest.mark.parametrize("names", [[], ["fcntl"]])
def test_a_lock_keeps_others_out_whatever_locks(tmp_path, monkeypatch, names):
    take_away(monkeypatch, *names)
    output = tmp_path / "out.h5"
    with opened(output), pytest.raises(SweepError, match="another run is at work"):
        quiet(tall(3), output)
    quiet(tall(3), output).close()
    assert list(tmp_path.iterdir()) == [output]


def test_a_file_system_that_cannot_reserve_space_gives_it_as_blocks_come(tmp_path, monkeypatch):
    def refuses(fd, start, length):
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))

    monkeypatch.setattr(os, "posix_fallocate", refuses)
    same(quiet(tall(300), tmp_path / "out.h5"), quiet(tall(300)))


def test_a_disk_without_room_is_told_before_a_cell_is_computed(tmp_path, monkeypatch):
    def full(fd, start, length):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(SweepError, match="disk is full"):
        quiet(tall(300), tmp_path / "out.h5")
    assert list(tmp_path.iterdir()) == []


def test_space_for_all_of_it_is_there_from_the_start(tmp_path, monkeypatch):
    monkeypatch.setattr("sweep.store.store.Store.put", lambda *rest: (_ for _ in ()).throw(SweepError("stop here")))
    output = tmp_path / "out.h5"
    with pytest.raises(SweepError, match="stop here"):
        quiet(tall(100_000), output)
    found = unfinished_of(output).stat()
    assert 512 * found.st_blocks >= found.st_size
    assert kept(output) == []


def test_pieces_are_written_and_read_whole_however_little_a_call_takes(tmp_path, monkeypatch):
    fd = os.open(tmp_path / "file", os.O_CREAT | os.O_RDWR)
    write, read = disk.write, disk.read
    monkeypatch.setattr(disk, "write", lambda fd, pieces, at: write(fd, [pieces[0][:3]], at))
    monkeypatch.setattr(disk, "read", lambda fd, pieces, at: read(fd, [pieces[0][:2]], at))
    disk.write_all(fd, (b"", b"abcdefg", bytearray(b"hi"), b""), 5)
    first, second = bytearray(4), bytearray(5)
    disk.read_all(fd, (first, second), 5)
    assert bytes(first + second) == b"abcdefghi"
    with pytest.raises(EOFError):
        disk.read_all(fd, (bytearray(1),), 14)
    os.close(fd)
