"""What is entered in HDF5's tables is what HDF5 finds in them."""

import io

import h5py
import numpy as np
import pytest
from h5py import h5d, h5p

from sweep.store.chunk_index import (
    BLOCK,
    HEADER,
    SIGNATURE,
    ChunkIndex,
    checksums,
    chunk_indexes,
    seal,
    set_end,
)


def test_checksums_are_those_that_their_author_gives():
    """`driver5` of http://burtleburtle.net/bob/c/lookup3.c"""
    row = np.frombuffer(b"Four score and seven years ago", np.uint8)[None]
    assert checksums(np.repeat(row, 3, axis=0)).view("<u4").ravel().tolist() == 3 * [0x17770551]


def laid_out(count):
    """A file with a dataset of so many chunks of five, the last one shorter, of which one byte is there."""
    image = io.BytesIO()
    with h5py.File(image, "w", libver=("v110", "v110")) as file:
        file.attrs["misleading"] = SIGNATURE.decode("latin-1").replace("\0", "") + "\x01" * 60
        file.attrs["more so"] = np.frombuffer(SIGNATURE + bytes(60), np.uint8)
        properties = h5p.create(h5p.DATASET_CREATE)
        properties.set_fill_time(h5d.FILL_TIME_NEVER)
        properties.set_chunk((5,))
        properties.set_fletcher32()
        space = h5py.h5s.create_simple((5 * count - 2,))
        made = h5py.Dataset(h5d.create(file.id, b"x", h5py.h5t.IEEE_F64LE, space, properties))
        made.id.write_direct_chunk((0,), b"\0")
        first = made.id.get_chunk_info(0).byte_offset
    return bytearray(image.getvalue()), first


@pytest.mark.parametrize("count", [2, 9, 1023, 1024, 1025, 2048, 8 * 1024 + 1, 10_000])
def test_hdf5_finds_every_chunk_where_it_was_entered(count):
    image, first = laid_out(count)
    (index,) = chunk_indexes(image)
    assert (index.count, index.first(image)) == (count, first)
    at = 4096 * -(-(len(image) + 16 * count) // 4096)
    end = at + 44 * count
    image += bytes(end - len(image))
    seal(image, [*index.fill(image, at, 44, 44), *set_end(image, end)])
    found = []
    with h5py.File(io.BytesIO(image)) as file:
        file["x"].id.chunk_iter(lambda c: found.append((c.chunk_offset[0], c.byte_offset, c.size, c.filter_mask)))
        assert not file["x"][...].any()
    assert sorted(found) == [(5 * k, at + 44 * k, 44, 0) for k in range(count)]


@pytest.mark.parametrize(
    ("count", "pages", "bitmap"), [(1, 0, 0), (4, 0, 0), (5, 2, 1), (8, 2, 1), (9, 3, 1), (32, 8, 1), (33, 9, 2)]
)
def test_more_entries_than_a_page_holds_stand_behind_a_bit_for_each_page(count, pages, bitmap):
    index = ChunkIndex(100, 16, 4, count)
    assert index.pages == pages
    assert index.entries == 100 + BLOCK.size + (bitmap + 4 if pages else 0)


def entry(at, size, width):
    """What the table says of a chunk; its filters are all applied."""
    return at.to_bytes(8, "little") + size.to_bytes(width - 12, "little") + bytes(4)


def test_entries_that_fit_into_a_page_stand_in_the_block_itself():
    image = bytearray(b"\xaa" * 120)
    assert list(ChunkIndex(7, 15, 4, 3).fill(image, 1000, 300, 260)) == [(7, 7 + 14 + 45)]
    rows = b"".join(entry(at, 260, 15) for at in (1000, 1300, 1600))
    assert image == b"\xaa" * 21 + rows + b"\xaa" * (120 - 21 - 45)


def test_pages_each_have_a_checksum_behind_them():
    image = bytearray(b"\xaa" * 300)
    spans = list(ChunkIndex(7, 14, 4, 9).fill(image, 70_000, 5, 9))
    pages = [(26, 26 + 56), (86, 86 + 56), (146, 146 + 14)]
    assert spans == [(7, 22), *pages]
    assert image[:21] == b"\xaa" * 21
    assert image[21] == 0b11100000
    rows = [entry(70_000 + 5 * k, 9, 14) for k in range(9)]
    assert [image[begin:end] for begin, end in pages] == [b"".join(rows[k : k + 4]) for k in (0, 4, 8)]
    # where their checksums will be, nothing is written
    assert {bytes(image[end : end + 4]) for _, end in spans} == {b"\xaa" * 4}
    assert image[164:] == b"\xaa" * 136


@pytest.mark.parametrize("at", range(17))
def test_tables_are_found_wherever_they_begin_and_those_of_a_wrong_checksum_are_none(at):
    header = HEADER.pack(SIGNATURE, 14, 10, 77, 4000 + at)
    wrong = HEADER.pack(SIGNATURE, 15, 10, 78, 4000)
    image = bytearray(
        bytes(at) + SIGNATURE + header + bytes(4) + wrong + bytes(4) + wrong + b"\xff" * 4 + header + bytes(4)
    )
    seal(image, [(at + 6, at + 30), (at + 90, at + 114)])
    same = ChunkIndex(4000 + at, 14, 1024, 77)
    assert list(chunk_indexes(image)) == [same, same]
    assert list(chunk_indexes(bytearray(at))) == []


def test_spans_of_any_length_are_sealed_where_they_end():
    rows = np.random.default_rng(1).integers(0, 256, 60, "u1")
    image = bytearray(rows.tobytes())
    seal(image, [(3, 15), (20, 32), (36, 47)])
    for begin, end in [(3, 15), (20, 32), (36, 47)]:
        assert image[end : end + 4] == checksums(rows[None, begin:end]).tobytes()
    untouched = [*range(15), *range(19, 32), *range(36, 47), *range(51, 60)]
    assert [image[k] for k in untouched] == rows[untouched].tolist()


def test_the_end_of_the_file_stands_in_the_superblock():
    image = bytearray(b"\xaa" * 60)
    assert list(set_end(image, 0x0123456789)) == [(0, 44)]
    assert image == b"\xaa" * 28 + b"\x89\x67\x45\x23\x01\0\0\0" + b"\xaa" * 24
