"""The checksum is HDF5's, whose own library is the oracle here."""

import io

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sweep.file.reading import checksum


def by_hdf5(content):
    """What HDF5 writes behind a chunk of these bytes."""
    file = io.BytesIO()
    with h5py.File(file, "w") as h5:
        dataset = h5.create_dataset("x", content.shape, "u1", chunks=content.shape, fletcher32=True)
        dataset[...] = content
        h5.flush()
        chunk = dataset.id.get_chunk_info(0)
    return file.getvalue()[chunk.byte_offset + content.size : chunk.byte_offset + chunk.size]


def padded(content, length):
    return np.concatenate([content, np.zeros(length - content.size, "u1")])


@given(content=st.binary(min_size=1, max_size=200), more=st.integers(0, 50))
def test_short_chunks_have_the_checksum_of_hdf5(content, more):
    raw = np.frombuffer(content, "u1")
    assert checksum(raw, raw.size + more) == by_hdf5(padded(raw, raw.size + more))


@pytest.mark.parametrize("size", [8191, 8192, 8193, 16384, 100_001, 262_144])
@pytest.mark.parametrize("fill", ["random", 0, 255, 1])
def test_long_chunks_have_the_checksum_of_hdf5(size, fill):
    raw = np.random.default_rng(size).integers(0, 256, size, "u1") if fill == "random" else np.full(size, fill, "u1")
    for more in (0, 1, 8000):
        assert checksum(raw, size + more) == by_hdf5(padded(raw, size + more))


def test_sums_that_are_a_multiple_of_65535_are_told_from_zero():
    # 0xffff is 0 modulo 65535, but HDF5 keeps it apart from words that are zero
    for words in ([0xFFFF], [0xFFFF, 0xFFFF], [1, 0xFFFE], [0, 0]):
        raw = np.array(words, "<u2").view("u1")
        assert checksum(raw, raw.size) == by_hdf5(raw)


def test_the_largest_words_do_not_overflow():
    raw = np.full(16 << 20, 255, "u1")
    assert checksum(raw, raw.size) == by_hdf5(raw)
