"""Every call that changes the disk, by itself: what it asks of the system, and what is left where that refuses."""

import errno
import os
from types import SimpleNamespace

import filelock
import numpy as np
import pytest

from sweep.system import disk
from sweep.system.errors import SweepError


@pytest.fixture
def fd(tmp_path):
    fd = os.open(tmp_path / "file", os.O_CREAT | os.O_RDWR)
    yield fd
    os.close(fd)


def refusing(number):
    """A call of the system that is refused."""

    def call(*args, **keys):
        raise OSError(number, os.strerror(number))

    return call


def test_what_names_no_file_is_told():
    assert disk.as_path("a/b").name == "b"
    with pytest.raises(SweepError) as caught:
        disk.as_path(3)
    assert str(caught.value) == 'expected a path, e.g. "out.h5"; found an object of type int'


@pytest.mark.parametrize(("flags", "waits"), [(os.O_RDONLY, False), (os.O_RDWR, True), (os.O_CREAT | os.O_RDWR, True)])
def test_a_pipe_is_not_waited_for(monkeypatch, flags, waits):
    asked = []
    monkeypatch.setattr(os, "open", lambda *args: asked.append(args) or 7)
    assert disk.open_file("x", flags) == 7
    ((path, given, mode),) = asked
    assert (path, mode) == ("x", 0o666)
    assert given == flags | (0 if waits else os.O_NONBLOCK)


def test_children_inherit_no_descriptor(tmp_path):
    fd = disk.open_file(tmp_path / "file", os.O_CREAT | os.O_RDWR)
    assert not os.get_inheritable(fd)
    os.close(fd)


@pytest.mark.parametrize("names", [[], ["pwritev"], ["pwritev", "pwrite"]])
def test_pieces_are_written_at_their_place(fd, monkeypatch, names):
    for name in names:
        monkeypatch.delattr(os, name)
    count = disk.write(fd, [memoryview(b"abc"), memoryview(b"de")], 4)
    assert count == (3 if names else 5)
    disk.write_all(fd, [b"abc", b"de", b""], 4)
    assert os.pread(fd, 100, 0) == b"\0\0\0\0abcde"


@pytest.mark.parametrize("names", [[], ["preadv"]])
def test_pieces_are_read_from_their_place(fd, monkeypatch, names):
    os.pwrite(fd, b"0123456789", 0)
    for name in names:
        monkeypatch.delattr(os, name)
    first, second = bytearray(3), bytearray(2)
    assert disk.read(fd, [memoryview(first), memoryview(second)], 4) == (3 if names else 5)
    assert bytes(first) == b"456"
    short = bytearray(b"xxxx")
    assert disk.read(fd, [memoryview(short)], 8) == 2
    assert short == b"89xx"


def test_arrays_are_filled_in_turn_by_calls_of_so_many_pieces(fd, monkeypatch):
    os.pwrite(fd, bytes(range(30)), 0)
    calls, real = [], disk.read
    monkeypatch.setattr(disk, "read", lambda fd, pieces, at: calls.append((len(pieces), at)) or real(fd, pieces, at))
    monkeypatch.setattr(disk, "MOST_BUFFERS", 2)
    arrays = [np.empty(2, "u1"), np.empty((1, 4), "u1"), bytearray(3), np.empty(0), np.empty(1, "<u2")]
    disk.read_all(fd, arrays, 5)
    assert calls == [(2, 5), (2, 11)]
    assert b"".join(bytes(a) for a in arrays) == bytes(range(5, 16))


@pytest.mark.parametrize("most", [1, 2, 3, 4, 7])
def test_what_a_call_leaves_over_is_asked_for_again(most):
    content, found, ats = b"abcdefghijk", bytearray(), []

    def call(fd, pieces, at):
        whole = b"".join(pieces)[:most]
        found.extend(whole)
        ats.append(at)
        return len(whole)

    disk._through(call, 3, [content[:2], content[2:7], content[7:8], content[8:]], 100)
    assert found == content
    assert ats == list(range(100, 111, most))


def test_a_file_that_ends_early_is_told(fd):
    os.pwrite(fd, b"abc", 0)
    with pytest.raises(EOFError, match=r"^the file ends early$"):
        disk.read_all(fd, [bytearray(4)], 0)


def test_bytes_of_arrays():
    assert bytes(disk.as_bytes(np.array([[1, 2]], "<u2"))) == b"\1\0\2\0"
    assert bytes(disk.as_bytes(np.empty((0, 3)))) == b""
    assert bytes(disk.as_bytes(b"ab")) == b"ab"


@pytest.mark.parametrize("number", [errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS, None])
def test_a_file_has_its_length_where_room_cannot_be_reserved(fd, monkeypatch, number):
    asked = []
    call = (lambda *args: asked.append(args)) if number is None else refusing(number)
    monkeypatch.setattr(os, "posix_fallocate", call)
    disk.reserve(fd, 5000)
    assert os.fstat(fd).st_size == 5000
    assert asked == ([(fd, 0, 5000)] if number is None else [])
    monkeypatch.delattr(os, "posix_fallocate")
    disk.reserve(fd, 300)
    assert os.fstat(fd).st_size == 300


def test_no_room_is_a_fault(fd, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", refusing(errno.ENOSPC))
    with pytest.raises(OSError, match="No space"):
        disk.reserve(fd, 5000)
    assert os.fstat(fd).st_size == 0


def test_numbers_are_synced_without_the_times_where_that_can_be(monkeypatch):
    asked = []
    monkeypatch.setattr(os, "fsync", lambda fd: asked.append(("fsync", fd)))
    monkeypatch.setattr(os, "fdatasync", lambda fd: asked.append(("fdatasync", fd)))
    disk.sync_numbers(3)
    disk.fsync(4)
    monkeypatch.delattr(os, "fdatasync")
    disk.sync_numbers(5)
    assert asked == [("fdatasync", 3), ("fsync", 4), ("fsync", 5)]


def test_a_folder_is_synced_with_all_that_is_in_it(tmp_path, monkeypatch):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "b" / "c").touch()
    synced, descriptors, closed = [], {}, []
    opening, closing = disk.open_file, os.close
    monkeypatch.setattr(disk, "open_file", lambda p, f: (fd := opening(p, f), descriptors.update({fd: p.name}))[0])
    monkeypatch.setattr(disk, "fsync", lambda fd: synced.append(descriptors[fd]))
    monkeypatch.setattr(os, "close", lambda fd: (closed.append(descriptors[fd]), closing(fd)))
    disk.sync_tree(tmp_path / "a")
    assert synced == closed == ["c", "b", "a"]


def test_a_file_takes_the_place_of_another_once_it_is_on_the_disk(tmp_path, monkeypatch):
    target, events = tmp_path / "out", []
    target.write_text("old")
    monkeypatch.setattr(disk, "fsync", lambda fd: events.append("fsync"))
    real = disk.rename
    monkeypatch.setattr(disk, "rename", lambda old, new: (events.append("rename"), real(old, new)))
    with disk.replacing(target) as part:
        assert part.parent == tmp_path
        part.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert events == ["fsync", "rename", "fsync"]
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("old", ["file", "folder", None])
@pytest.mark.parametrize("new", ["file", "folder"])
def test_files_and_folders_replace_each_other(tmp_path, old, new):
    target = tmp_path / "out"
    if old == "file":
        target.write_text("old")
    elif old == "folder":
        target.mkdir()
        (target / "in").write_text("old")
    with disk.replacing(target) as part:
        part.unlink()
        if new == "folder":
            part.mkdir()
        ((part / "in") if new == "folder" else part).write_text("new")
    assert ((target / "in") if new == "folder" else target).read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_what_was_there_stays_where_its_place_cannot_be_taken(tmp_path, monkeypatch):
    target, real = tmp_path / "out", disk.rename
    target.mkdir()
    (target / "in").write_text("old")

    def rename(old, new):
        if new == target:
            raise OSError(errno.EACCES, "Permission denied")
        real(old, new)

    monkeypatch.setattr(disk, "rename", rename)
    with pytest.raises(SweepError) as caught, disk.replacing(target) as part:
        part.write_text("new")
    assert str(caught.value) == f"{target} cannot be written: Permission denied"
    assert (target / "in").read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_fault_half_way_leaves_what_was_there(tmp_path):
    target = tmp_path / "out"
    target.write_text("old")

    def failing():
        with disk.replacing(target) as part:
            part.unlink()
            part.mkdir()
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        failing()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]
    with (
        pytest.raises(SweepError, match=r"none/out cannot be written: No such file or directory$"),
        disk.replacing(tmp_path / "none" / "out"),
    ):
        pass


def test_a_lock_is_removed_at_the_end_by_who_has_it(tmp_path):
    path = tmp_path / "lock"
    with disk.locked(path) as ours:
        assert ours
        assert path.exists()
        with disk.locked(path) as other:
            assert not other
        assert path.exists()
    assert not path.exists()
    with disk.locked(path) as again:
        assert again


def test_a_lock_that_cannot_be_removed_is_given_back(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(disk, "remove", refusing(errno.EACCES))
        with disk.locked(tmp_path / "lock") as ours:
            assert ours
    with disk.locked(tmp_path / "lock") as ours:
        assert ours


def test_descriptors_of_locks_are_closed_whatever_happens(tmp_path, monkeypatch):
    closed, real = [], os.close
    monkeypatch.setattr(os, "close", lambda fd: (closed.append(fd), real(fd)))
    with disk.locked(tmp_path / "lock"):
        assert disk._try_lock(tmp_path / "lock") is None
        assert len(closed) == 1
    assert len(closed) == 2
    monkeypatch.setattr(disk.fcntl, "flock", refusing(errno.EIO))
    with pytest.raises(OSError, match="Input/output"):
        disk._try_lock(tmp_path / "lock")
    assert len(closed) == 3


def test_a_lock_whose_file_is_another_meanwhile_is_taken_anew(tmp_path, monkeypatch):
    path, real, tried = tmp_path / "lock", disk.fcntl.flock, []

    def flock(fd, how):
        assert how == disk.fcntl.LOCK_EX | disk.fcntl.LOCK_NB
        tried.append(fd)
        if len(tried) < 3:
            path.rename(tmp_path / f"kept {len(tried)}")
        if len(tried) == 1:
            path.touch()
        real(fd, how)

    monkeypatch.setattr(disk.fcntl, "flock", flock)
    fd = disk._try_lock(path)
    assert os.fstat(fd).st_ino == path.stat().st_ino
    # each was closed before the next one was opened
    assert tried == [fd] * 3
    os.close(fd)


def test_the_library_locks_where_the_system_cannot(tmp_path, monkeypatch):
    asked, real = [], filelock.FileLock
    monkeypatch.setattr(filelock, "FileLock", lambda path, **keys: asked.append(keys) or real(path, **keys))
    monkeypatch.setattr(disk, "fcntl", None)
    with disk.locked(tmp_path / "lock") as ours, disk.locked(tmp_path / "lock") as other:
        assert (ours, other) == (True, False)
    assert not (tmp_path / "lock").exists()
    # nobody is waited for
    assert asked == [{"timeout": 0}] * 2


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (OSError(errno.ENOSPC, "x"), "the disk is full; free some space, then run the same command again to continue"),
        (OSError(errno.EDQUOT, "x"), "the disk is full; free some space, then run the same command again to continue"),
        (OSError(errno.EIO, "x"), "cannot be written (Input/output error)"),
        (OSError("first\nsecond"), "cannot be written (first)"),
        (RuntimeError("of HDF5\nmore"), "cannot be written (of HDF5)"),
    ],
)
def test_a_refusal_is_one_line(tmp_path, fault, text):
    assert str(disk.refusal(fault, tmp_path)) == f"{tmp_path}: {text}"
    if isinstance(fault, OSError):
        with pytest.raises(SweepError) as caught, disk.refusing(tmp_path):
            raise fault
        assert (str(caught.value), caught.value.__cause__) == (f"{tmp_path}: {text}", fault)


def test_free_space_is_that_of_the_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(disk.shutil, "disk_usage", lambda path: SimpleNamespace(free=5, total=9, used=4))
    assert disk.free(tmp_path) == 5
    disk.remove(tmp_path / "none")
