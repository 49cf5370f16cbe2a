"""What is entered in HDF5's tables is what HDF5 finds in them."""

import io

import h5py
import numpy as np
import pytest
from h5py import h5d, h5p

from sweep.file.chunk_index import SIGNATURE, checksums, chunk_indexes, seal, set_end


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
