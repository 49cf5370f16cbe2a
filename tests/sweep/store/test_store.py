import contextlib
import errno
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import fail_on

from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store.hdf5_bytes import PartBytes
from sweep.store.manifest import MANIFEST, Manifest, read_manifest
from sweep.store.parts import digest, read_part
from sweep.store.store import LOCK, folder_of, opened
from sweep.system import disk
from sweep.system.errors import SweepError

COLUMNS = (
    Column("period", "f8", (), (), {"units": "s", "long_name": "time of a swing"}),
    Column("angle", "f8", ("phase",), (3,), {"units": "rad"}),
    Column("status", "i1", (), (), {}),
    Column("method_used", "i1", (), (), {}),
)
MARK = {"study": "abc"}
PART_BYTES = PartBytes(COLUMNS, Manifest("{}", MARK, Partition(25, 10), "").mark)


def numbers(start, stop):
    cells = np.arange(start, stop, dtype="f8")
    return {
        "period": cells * 0.1,
        "angle": np.add.outer(cells, [0.25, 0.5, 0.75]),
        "status": (cells % 2).astype("i1"),
        "method_used": (cells % 3).astype("i1"),
    }


def begun(store, size=25, cells=10):
    store.begin("{}", MARK, Partition(size, cells))
    return store


def fill(store):
    for index in store.missing():
        store.put(index, numbers(*store.blocks.bounds(index)))


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture
def filled(output):
    """The folder of a store with three finished blocks."""
    with opened(output, COLUMNS) as store:
        fill(begun(store))
    return folder_of(output)


def resumed(store):
    store.resume(read_manifest(store.folder))
    return store


def part_files(folder):
    return sorted(folder.glob("*.h5"))


def test_a_part_opens_with_plain_h5py_and_describes_itself(filled):
    with h5py.File(part_files(filled)[1]) as file:
        assert (file.attrs["start"], file.attrs["stop"]) == (10, 20)
        assert set(file) == {"period", "angle", "status", "method_used"}
        assert file["period"].attrs["units"] == "s"
        for name, values in numbers(10, 20).items():
            assert file[name].dtype == values.dtype
            np.testing.assert_array_equal(file[name], values)


def test_the_last_block_is_shorter(filled):
    with h5py.File(part_files(filled)[2]) as file:
        assert (file.attrs["start"], file.attrs["stop"], file["period"].shape) == (20, 25, (5,))


@given(cells=st.integers(1, 300), start=st.integers(0, 10**15), tail=st.integers(1, 5))
def test_any_block_is_a_valid_file_with_its_own_range(tmp_path_factory, cells, start, tail):
    columns = (Column("x", "f8", ("k",), (tail,), {}), Column("status", "i1", (), (), {}))
    arrays = {"x": np.random.default_rng(cells).random((cells, tail)), "status": np.full(cells, 7, "i1")}
    path = tmp_path_factory.mktemp("image") / "part.h5"
    path.write_bytes(b"".join(map(bytes, PartBytes(columns).pieces(start, start + cells, arrays))))
    with h5py.File(path) as file:
        assert (file.attrs["start"], file.attrs["stop"]) == (start, start + cells)
        np.testing.assert_array_equal(file["x"], arrays["x"])
        np.testing.assert_array_equal(file["status"], arrays["status"])


def test_a_block_computed_twice_has_the_same_name(output):
    with opened(output, COLUMNS) as store:
        begun(store).put(0, numbers(0, 10))
        name = store.names[0]
        store.put(0, numbers(0, 10))
        assert store.names[0] == name
        assert len(part_files(store.folder)) == 1


@pytest.mark.parametrize("name", ["period", "angle", "status", "method_used"])
def test_the_digest_sees_every_column(name):
    changed = numbers(0, 10)
    before = digest(COLUMNS, changed)
    changed[name][7] += 1
    assert digest(COLUMNS, changed) != before


def test_a_store_is_taken_up_where_it_was_left(output, filled):
    lost = part_files(filled)[1]
    lost.unlink()
    with opened(output, COLUMNS) as store:
        assert resumed(store).missing() == [1]
        np.testing.assert_array_equal(store.get(2)["angle"], numbers(20, 25)["angle"])
        fill(store)
        assert lost.exists()


def test_every_flipped_bit_of_the_numbers_is_found(filled):
    path = part_files(filled)[0]
    whole = path.read_bytes()
    with h5py.File(path) as file:
        places = [file[c.name].id.get_offset() + k for c in COLUMNS for k in range(10 * c.cell_bytes)]
    for place in places:
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        assert read_part(path, PART_BYTES) is None
    path.write_bytes(whole)
    assert read_part(path, PART_BYTES) is not None


def test_no_damaged_file_is_read_as_something_else(filled):
    """Whatever byte of the file changes, the numbers come out right or not at all."""
    path = part_files(filled)[0]
    whole = path.read_bytes()
    for place in range(0, len(whole), 7):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        found = read_part(path, PART_BYTES)
        if found is not None:
            np.testing.assert_array_equal(found["angle"], numbers(0, 10)["angle"])


def test_a_part_cut_off_anywhere_is_found(filled):
    path = part_files(filled)[0]
    whole = path.read_bytes()
    for length in [0, 1, 100, *range(2000, len(whole), 13)]:
        path.write_bytes(whole[:length])
        found = read_part(path, PART_BYTES)
        assert found is None or digest(COLUMNS, found, PART_BYTES.mark) in path.name


def test_a_part_that_another_version_of_hdf5_laid_out_is_read_as_well(filled):
    path = part_files(filled)[0]
    with h5py.File(filled / "other", "w", libver="latest") as file:
        file.attrs.update(start=0, stop=10)
        for name, values in reversed(numbers(0, 10).items()):
            file[name] = values
    (filled / "other").rename(path)
    np.testing.assert_array_equal(read_part(path, PART_BYTES)["angle"], numbers(0, 10)["angle"])


def test_a_part_under_the_name_of_another_range_is_found(filled):
    first, second, _ = part_files(filled)
    path = first.with_name(second.name.split(".")[0] + "." + first.name.split(".")[1] + ".h5")
    first.rename(path)
    assert read_part(path, PART_BYTES) is None


def test_a_short_file_is_set_aside_at_the_start(output, filled):
    path = part_files(filled)[1]
    path.write_bytes(path.read_bytes()[:100])
    with opened(output, COLUMNS) as store:
        assert resumed(store).missing() == [1]
    assert path.with_name(path.name + ".damaged").exists()
    assert not path.exists()


def test_what_dead_runs_left_half_written_is_removed(output, filled):
    rest = filled / "000000000010.0badcafe.tmp"
    rest.write_bytes(b"half")
    with opened(output, COLUMNS) as store:
        resumed(store)
    assert not rest.exists()


def test_of_two_files_of_one_block_the_sound_one_is_taken(output, filled):
    path = part_files(filled)[1]
    for digits in ("0" * 32, "f" * 32):
        (filled / f"{path.name.split('.')[0]}.{digits}.h5").write_bytes(path.read_bytes())
    with opened(output, COLUMNS) as store:
        assert resumed(store).names[1] == path.name
        assert store.missing() == []
    assert len(list(filled.glob("*.damaged"))) == 2


def test_a_block_that_came_out_differently_twice_betrays_the_kernel(output, filled):
    with opened(output, COLUMNS) as store:
        resumed(store).put(1, numbers(110, 120))
    with opened(output, COLUMNS) as store, pytest.raises(SweepError, match="not deterministic"):
        resumed(store)


def test_a_second_run_on_the_same_output_is_told_so(output):
    with opened(output, COLUMNS), pytest.raises(SweepError, match="another run is at work"), opened(output, COLUMNS):
        pass


def test_the_lock_of_a_killed_run_does_not_block(output, filled):
    code = f"""
        import time
        from pathlib import Path
        from sweep.store.store import opened
        with opened(Path({str(output)!r}), ()):
            print("locked", flush=True)
            time.sleep(60)
    """
    other = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, env=environment())
    assert other.stdout is not None
    with other, other.stdout:
        assert other.stdout.readline() == b"locked\n"
        with pytest.raises(SweepError, match="another run is at work"), opened(output, COLUMNS):
            pass
        other.send_signal(signal.SIGKILL)
        other.wait()
        with opened(output, COLUMNS) as store:
            assert resumed(store).missing() == []


def environment():
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}


def test_a_lock_in_a_folder_that_was_removed_meanwhile_is_no_lock(output, monkeypatch):
    """The run before this one ends, and removes its folder, just as this one takes the lock."""
    real, turns = disk.try_lock, []

    def lock(fd):
        turns.append(fd)
        if len(turns) == 1:
            (folder_of(output) / LOCK).unlink()
            folder_of(output).rmdir()
        return real(fd)

    monkeypatch.setattr(disk, "try_lock", lock)
    with opened(output, COLUMNS) as store:
        assert (store.folder / LOCK).exists()
        with pytest.raises(SweepError, match="another run is at work"), opened(output, COLUMNS):
            pass


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="no second file system is at hand")
def test_parts_on_another_file_system_are_refused_before_anything_is_computed(output):
    with tempfile.TemporaryDirectory(dir="/dev/shm") as elsewhere:
        if Path(elsewhere).stat().st_dev == output.parent.stat().st_dev:
            pytest.skip("the same file system")
        folder_of(output).symlink_to(elsewhere)
        with pytest.raises(SweepError, match="on another file system"), opened(output, COLUMNS):
            pytest.fail("opened")
        assert list(Path(elsewhere).iterdir()) == []


def test_nothing_is_left_of_a_store_that_was_not_begun(output):
    with opened(output, COLUMNS) as store:
        assert (store.folder / LOCK).exists()
    assert list(output.parent.iterdir()) == []


def test_nothing_is_left_of_a_store_that_was_cleared(output, filled):
    (filled / "result.h5.0badcafe.tmp").write_bytes(b"half")
    with opened(output, COLUMNS) as store:
        resumed(store).clear()
    assert list(output.parent.iterdir()) == []


def test_the_spec_is_removed_after_the_parts_and_the_lock_last(output, filled, monkeypatch):
    removed, real = [], disk.remove
    monkeypatch.setattr(disk, "remove", lambda path: (removed.append(path.name), real(path)))
    with opened(output, COLUMNS) as store:
        resumed(store).clear()
    assert removed[-2:] == [MANIFEST, LOCK]
    assert len(removed) == 5


def test_a_removal_cut_short_leaves_a_store_that_can_be_taken_up(output, filled, monkeypatch):
    fail_on(monkeypatch, "remove", 3, errno.EIO)
    with pytest.raises(SweepError, match="Input/output"), opened(output, COLUMNS) as store:
        resumed(store).clear()
    monkeypatch.undo()
    with opened(output, COLUMNS) as store:
        assert len(resumed(store).missing()) == 2


@pytest.mark.parametrize("name", ["open_file", "write", "fsync", "rename"])
@pytest.mark.parametrize(("number", "words"), [(errno.ENOSPC, "disk is full"), (errno.EIO, "cannot be written")])
def test_a_block_that_cannot_be_written_leaves_no_trace(output, monkeypatch, name, number, words):
    with opened(output, COLUMNS) as store:
        begun(store).put(0, numbers(0, 10))
        before = sorted(store.folder.iterdir())
        with monkeypatch.context() as patch:
            fail_on(patch, name, 1, number)
            with pytest.raises(SweepError, match=words):
                store.put(1, numbers(10, 20))
        assert sorted(store.folder.iterdir()) == before
        assert store.missing() == [1, 2]


def test_writes_that_take_only_a_part_are_carried_on(output, monkeypatch):
    real = os.write
    monkeypatch.setattr(disk, "write", lambda fd, piece: real(fd, piece[:37]))
    with opened(output, COLUMNS) as store:
        fill(begun(store))
        np.testing.assert_array_equal(store.get(1)["angle"], numbers(10, 20)["angle"])


def test_a_block_is_on_the_disk_before_it_has_its_name(output, monkeypatch):
    order = []
    for name in ("fsync", "rename"):
        real = getattr(disk, name)
        monkeypatch.setattr(disk, name, lambda *args, name=name, real=real: (order.append(name), real(*args)))
    with opened(output, COLUMNS) as store:
        begun(store)
        order.clear()
        store.put(0, numbers(0, 10))
    assert order == ["fsync", "rename", "fsync"]


@pytest.fixture
def synced(monkeypatch):
    """What the system itself is asked to bring to the disk, and to rename, in order: (what, number of the file)."""
    events, fsync, rename = [], os.fsync, disk.rename

    def record_rename(old, new):
        events.append(("rename", old.stat().st_ino))
        rename(old, new)

    monkeypatch.setattr(os, "fsync", lambda fd: (events.append(("fsync", os.fstat(fd).st_ino)), fsync(fd))[1])
    monkeypatch.setattr(disk, "rename", record_rename)
    return events


def test_a_block_its_name_and_its_folder_are_brought_to_the_disk(output, synced):
    with opened(output, COLUMNS) as store:
        # the folder of the parts is a name in the folder of the output
        assert synced == [("fsync", output.parent.stat().st_ino)]
        begun(store)
        synced.clear()
        store.put(0, numbers(0, 10))
    part, folder = part_files(store.folder)[0].stat().st_ino, store.folder.stat().st_ino
    assert synced == [("fsync", part), ("rename", part), ("fsync", folder)]


def test_the_spec_is_brought_to_the_disk_before_the_first_block(output, synced):
    with opened(output, COLUMNS) as store:
        synced.clear()
        begun(store)
        manifest, folder = (store.folder / MANIFEST).stat().st_ino, store.folder.stat().st_ino
        assert synced == [("fsync", manifest), ("rename", manifest), ("fsync", folder)]


def longer(path, **more):
    """Makes a part longer than this program writes it, by bytes at the end, or with further datasets."""
    if more:
        with h5py.File(path, "r+") as file:
            file.update({name: np.zeros(count) for name, count in more.items()})
    else:
        path.write_bytes(path.read_bytes() + bytes(4096))


@pytest.mark.parametrize("more", [{}, {"notes": 5000}])
def test_a_part_longer_than_it_should_be_gives_its_own_numbers(output, filled, more):
    path = part_files(filled)[1]
    longer(path, **more)
    with opened(output, COLUMNS) as store:
        found = resumed(store).get(1)
    for name, values in numbers(10, 20).items():
        np.testing.assert_array_equal(found[name], values)


def test_a_longer_part_with_its_columns_elsewhere_is_read_where_they_are(filled):
    path = part_files(filled)[0]
    path.unlink()
    with h5py.File(path, "w") as file:
        file["notes"] = np.zeros(5000)
        file.attrs.update(start=0, stop=10)
        for name, values in reversed(numbers(0, 10).items()):
            file[name] = values
    assert path.stat().st_size > PART_BYTES.template(10).size
    np.testing.assert_array_equal(read_part(path, PART_BYTES)["angle"], numbers(0, 10)["angle"])


def test_a_longer_part_of_other_numbers_is_damaged(filled):
    path = part_files(filled)[0]
    longer(path)
    with h5py.File(path) as file:
        place = file["angle"].id.get_offset()
    content = bytearray(path.read_bytes())
    content[place + 5] ^= 1
    path.write_bytes(content)
    assert read_part(path, PART_BYTES) is None


def test_the_spec_comes_back_as_it_was(output):
    with opened(output, COLUMNS) as store:
        begun(store, 10**12, 12345)
        found = read_manifest(store.folder)
        assert found == store.manifest
        assert (found.blocks, found.fingerprint, found.study) == (Partition(10**12, 12345), MARK, "{}")


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 2}', "\x00"])
def test_a_damaged_spec_is_one_clear_line(filled, text):
    (filled / MANIFEST).write_text(text)
    with pytest.raises(SweepError, match=r"damaged.*run its study again"):
        read_manifest(filled)


def test_a_flipped_bit_anywhere_in_a_spec_is_found(filled):
    whole, before = (filled / MANIFEST).read_bytes(), read_manifest(filled)
    for place in range(len(whole)):
        (filled / MANIFEST).write_bytes(whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1 :])
        # white space may be flipped
        with contextlib.suppress(SweepError):
            assert read_manifest(filled) == before


def test_a_spec_of_a_later_version_is_named_as_such(filled):
    (filled / MANIFEST).write_text('{"format": 99}')
    with pytest.raises(SweepError, match="format 99"):
        read_manifest(filled)


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SweepError, match="cannot be written"), opened(tmp_path / "file" / "out.h5", COLUMNS):
        pass
    with pytest.raises(SweepError, match="cannot be written"), opened(tmp_path / "nowhere" / "out.h5", COLUMNS):
        pass
