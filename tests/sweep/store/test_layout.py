"""Where everything stands in a file, by hand: chunks, digests, gaps between them, and the trailer."""

import json
import os
import struct
from dataclasses import replace

import numpy as np
import pytest
import xxhash

from sweep.cells.partition import Partition
from sweep.cells.schema import Column
from sweep.store import frame, layout
from sweep.store.fletcher import checksum
from sweep.store.layout import Layout, Place, Table, gaps, mark_of, read_layout, structure_digest, write_digests

FAR = Place("x", "<f8", (2,), 48, ((0, 100, 60), (2, 1000, 70)))
NEAR = Place("s", "i1", (), 0, ((0, 400, 3),))


def table(mark=b"mark"):
    """Eight cells in blocks of three."""
    return Table((8,), Partition(8, 3), (FAR, NEAR), 2000, mark)


@pytest.fixture
def fd(tmp_path):
    fd = os.open(tmp_path / "file", os.O_CREAT | os.O_RDWR)
    yield fd
    os.close(fd)


def test_chunks_stand_in_runs_of_equal_steps():
    assert [FAR.at(k) for k in range(5)] == FAR.all_at(5).tolist() == [100, 160, 1000, 1070, 1140]
    assert (FAR.cell_bytes, NEAR.cell_bytes) == (16, 1)
    assert (FAR.empty(3).shape, FAR.empty(3).dtype, NEAR.empty(3).shape) == ((3, 2), np.float64, (3,))


def test_a_chunk_takes_its_checksum_in_addition_and_what_has_none_its_cells():
    assert [table().stored(FAR, block) for block in range(3)] == [52, 52, 52]
    assert [table().stored(NEAR, block) for block in range(3)] == [3, 3, 2]
    assert table().row_bytes == 32
    assert table().spans().tolist() == [
        [100, 152], [160, 212], [400, 403], [403, 406], [406, 408], [1000, 1052], [2000, 2096],
    ]  # fmt: skip


def test_a_digest_is_of_the_study_the_block_the_column_and_all_bytes():
    oracle = xxhash.xxh3_128(b"mark" + struct.pack("<qi", 5, 1) + b"abcd").digest()
    assert table().digest(1, 5, b"ab", b"cd") == oracle
    assert table(b"").digest(1, 5, b"ab", b"cd") == xxhash.xxh3_128(b"abcd").digest()


def test_what_is_written_of_the_last_block_is_filled_with_zeros(fd):
    numbers, words = np.arange(4.0).reshape(2, 2), np.array([7, 8])
    digests = table().write(fd, 2, {"x": numbers, "s": words})
    chunk = numbers.tobytes() + bytes(16) + checksum(numbers, 48)
    assert os.pread(fd, 100, 1000) == chunk
    assert os.pread(fd, 5, 406)[:2] == b"\7\10"
    assert digests == table().digest(0, 2, chunk) + table().digest(1, 2, b"\7\10")
    out = np.empty((2, 2))
    assert table().read(fd, 0, 2, digests[:16], out) is out
    np.testing.assert_array_equal(out, numbers)
    assert table().read(fd, 1, 2, digests[16:]).tolist() == [7, 8]
    assert table().read(fd, 0, 2, digests[16:]) is None
    os.pwrite(fd, b"\1", 1040)  # among the zeros
    assert table().read(fd, 0, 2, digests[:16]) is None
    os.ftruncate(fd, 1040)
    assert table().read(fd, 0, 2, digests[:16]) is None


def test_a_last_block_of_one_cell_is_filled_up_and_read_again(fd):
    some = Table((10,), Partition(10, 3), (FAR, NEAR), 2000, b"mark")
    assert some.spans().tolist()[-3:] == [[1000, 1052], [1070, 1122], [2000, 2128]]
    assert some.spans().tolist()[2:6] == [[400, 403], [403, 406], [406, 409], [409, 410]]
    digests = some.write(fd, 3, {"x": np.array([[3.0, 4.0]]), "s": np.array([5])})
    assert os.pread(fd, 48, 1070) == np.array([3.0, 4.0]).tobytes() + bytes(32)
    assert some.read(fd, 0, 3, digests[:16]).tolist() == [[3.0, 4.0]]
    assert some.read(fd, 1, 3, digests[16:]).tolist() == [5]


def test_digests_of_neighbours_are_written_at_once(fd, monkeypatch):
    wrote = []
    write_all = layout.disk.write_all
    monkeypatch.setattr(layout.disk, "write_all", lambda fd, pieces, at: (wrote.append(at), write_all(fd, pieces, at)))
    some = Table((30,), Partition(30, 3), (FAR, NEAR), 2000, b"")
    digests = {block: bytes([block + 1]) * 32 for block in (4, 0, 1, 9, 5)}
    write_digests(fd, some, digests)
    assert wrote == [2000, 2000 + 4 * 32, 2000 + 9 * 32]
    found = some.read_digests(fd)
    assert found.shape == (10, 2, 16)
    assert found[:, 1, 3].tolist() == [1, 2, 0, 0, 5, 6, 0, 0, 0, 10]


@pytest.mark.parametrize(
    ("apart", "size", "found"),
    [
        ([(5, 7), (0, 2), (6, 9)], 12, [(2, 5), (9, 12)]),
        ([(3, 20)], 10, [(0, 3)]),
        ([(0, 10), (2, 3)], 12, [(10, 12)]),
        ([(0, 10)], 10, []),
        ([(2, 2)], 4, [(0, 2), (2, 4)]),
        ([(15, 20)], 10, [(0, 10)]),
        ([], 3, [(0, 3)]),
    ],
)
def test_gaps_are_what_no_region_holds(apart, size, found):
    assert list(gaps(apart, size)) == found


def test_the_digest_of_the_structure_is_of_all_gaps_piece_by_piece(fd, monkeypatch):
    os.write(fd, bytes(range(100)))
    monkeypatch.setattr(layout, "PIECE", 7)
    whole = bytes([*range(10), *range(30, 80)])
    assert structure_digest(fd, [(10, 30)], 80) == xxhash.xxh3_128(whole).digest()


def test_marks_differ_by_study_and_table():
    words = json.dumps([{"a": "1", "b": "2"}, "cells"], sort_keys=True).encode()
    assert mark_of({"b": "2", "a": "1"}, "cells") == xxhash.xxh3_128(words).digest()
    assert mark_of({"b": "2", "a": "1"}, "rows") != mark_of({"b": "2", "a": "1"}, "cells")


def made(**changed):
    keys = {"key": "ab", "fingerprint": {"a": "1"}, "begun": "now", "tables": {"cells": table()}, "end": 3000}
    keys |= {"endings": ((1, 2),), "regions": ((0, 3000),), "structure": b"\1\2"}
    return Layout(**keys | changed)


def stored(fd, found, size=None, trailer=None):
    """What is read of a layout that was written."""
    trailer = trailer or found.trailer()
    os.ftruncate(fd, found.end)
    os.pwrite(fd, trailer, found.end)
    return read_layout(fd, found.end + len(trailer) if size is None else size)


def test_a_layout_is_read_as_it_was_written(fd):
    assert stored(fd, made()) == made()
    assert made().size == os.fstat(fd).st_size
    assert (made().work_name, made().work) == ("cells", table())
    summary = made(tables={"cells": table(), "rows": table(b"other")})
    assert (summary.work_name, summary.work.mark) == ("rows", b"other")
    assert made().ending_digest([b"x", b"y"]) == xxhash.xxh3_128(b"abxy").digest()


@pytest.mark.parametrize(
    "wrong",
    [
        {"regions": ((0, 3001),)},
        {"regions": ((5, 4),)},
        {"endings": ((-1, 2),)},
        {"tables": {"cells": replace(table(), digests=2905)}},  # 96 bytes of them end at 3001
        {"tables": {"cells": replace(table(), digests=-1)}},
        {"tables": {"cells": replace(table(), grid=(9,))}},
        {"tables": {"cells": replace(table(), blocks=Partition(0, 3), grid=(0,))}},
        {"tables": {"cells": replace(table(), blocks=Partition(8, 0))}},
    ],
)
def test_a_layout_that_cannot_be_is_none(fd, wrong):
    assert stored(fd, made(**wrong)) is None


def test_a_layout_of_a_single_cell_can_be(fd):
    single = {"cells": replace(table(), grid=(1,), blocks=Partition(1, 1))}
    assert stored(fd, made(tables=single)) == made(tables=single)


def test_places_up_to_the_end_are_in_the_file(fd):
    last = {"cells": replace(table(), digests=2904)}
    assert stored(fd, made(tables=last)) is not None
    assert stored(fd, made(endings=((3000, 3000),))) is not None


def test_a_layout_of_another_version_or_place_is_none(fd, monkeypatch):
    assert stored(fd, made(), size=made().size - 1) is None
    moved = made().trailer()
    assert stored(fd, made(end=3001, regions=()), trailer=moved) is None
    monkeypatch.setattr(layout, "FORMAT", 4)
    newer = made().trailer()
    monkeypatch.undo()
    assert stored(fd, made(), trailer=newer) is None


def test_a_trailer_that_was_changed_anywhere_is_none(fd):
    trailer = made().trailer()
    for at in range(len(trailer)):
        other = bytearray(trailer)
        other[at] ^= 64
        assert stored(fd, made(), trailer=bytes(other)) is None, at
    assert read_layout(fd, layout.TAIL - 1) is None
    assert read_layout(fd, layout.TAIL) is None


@pytest.mark.parametrize(
    ("chunk", "worth", "step"),
    [(4091, 4096, 4095), (4092, 4096, 4096), (4093, 4096, 8192), (4093, 40960, 4097), (0, 1, 4096)],
)
def test_chunks_worth_a_page_begin_on_one(chunk, worth, step):
    assert frame._step(chunk, worth) == step
    assert (frame.WORTH_A_PAGE, frame.SHARED_WORTH_A_PAGE) == (40960, 4096)
    assert [frame._paged(size) for size in (0, 1, 4096, 4097)] == [0, 4096, 4096, 8192]


def test_what_stands_in_a_chunk_that_is_not_computed():
    status, number = Column("status", "i1", (), (), {}), Column("x", "<f8", (), (), {})
    pending = np.full(4, frame.Status.PENDING, "i1")
    chunk = pending.tobytes() + checksum(pending, 4)
    assert frame._pending(status, Place("status", "i1", (), 4, ())) == (0, chunk)
    assert frame._pending(number, Place("x", "<f8", (), 32, ())) == (32, b"\xff\xff\xff\xff")
    assert frame._pending(status, Place("status", "i1", (), 0, ())) == (0, b"\xff")
    assert np.isnan(np.frombuffer(frame._pending(number, Place("x", "<f8", (), 0, ()))[1]))


def test_short_chunks_behind_each_other_are_written_some_at_a_time(monkeypatch):
    status, number = Column("status", "i1", (), (), {}), Column("x", "<f8", (), (), {})
    monkeypatch.setattr(frame, "GATHERED_BYTES", 20)
    found = list(frame._nothing_yet(status, Place("status", "i1", (), 4, ((0, 50, 8),)), 5))
    assert [(at, len(piece)) for at, piece in found] == [(50, 16), (66, 16), (82, 8)]
    apart = list(frame._nothing_yet(number, Place("x", "<f8", (), 32, ((0, 50, 40),)), 3))
    assert apart == [(82, frame.WRONG), (122, frame.WRONG), (162, frame.WRONG)]
    monkeypatch.setattr(frame, "GATHERED_BYTES", 80)
    close = list(frame._nothing_yet(number, Place("x", "<f8", (), 32, ((0, 50, 36),)), 3))
    assert [(at, len(piece)) for at, piece in close] == [(50, 72), (122, 36)]
    assert close[1][1] == bytes(32) + frame.WRONG
