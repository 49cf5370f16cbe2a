"""Results of earlier formats, made by hand: what their trailer tells, and where their numbers are."""

import struct

import h5py
import numpy as np
import pytest
import xxhash

from sweep.store import earlier
from sweep.store.earlier import read, read_seal, unbroken

MAGIC = b"foliot seal\n"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "old.h5"


def sealed(content, regions, count=None, digest=None):
    """A file of these bytes with a trailer."""
    places = struct.pack(f"<{2 * len(regions)}q", *np.ravel(regions))
    structure = bytearray(content)
    for begin, stop in sorted(regions, reverse=True):
        del structure[begin:stop]
    whole = xxhash.xxh3_128(places + xxhash.xxh3_128(bytes(structure)).digest()).digest()
    tail = struct.pack("<I", len(regions) if count is None else count) + MAGIC
    return bytes(content) + places + (digest or whole) + tail


def asked(path, content, function, *args):
    path.write_bytes(content)
    with path.open("rb") as file:
        return function(file.fileno(), len(content), *args)


CONTENT = bytes(range(100))


@pytest.mark.parametrize("regions", [[], [(10, 20)], [(10, 20), (50, 100)], [(0, 0)]])
def test_a_trailer_is_read_as_it_was_written(path, regions):
    whole = sealed(CONTENT, regions)
    assert asked(path, whole, read_seal) == (whole[-32:-16], regions, 100)
    assert asked(path, whole, unbroken, 1e9) is True


def test_every_byte_but_those_of_regions_is_looked_at(path):
    whole = sealed(CONTENT, [(10, 20), (50, 100)])
    for at in range(len(whole) - 16):
        other = bytearray(whole)
        other[at] ^= 1
        assert asked(path, other, unbroken, 1e9) is (10 <= at < 20 or 50 <= at < 100), at


def test_no_trailer_is_none(path):
    for content in (b"", b"x", CONTENT, CONTENT[:31], MAGIC, sealed(CONTENT, [(1, 2)])[:-1] + b"x"):
        if len(content) >= 32 or not content.endswith(MAGIC):
            assert asked(path, content, read_seal) is None
            assert asked(path, content, unbroken, 1e9) is None


@pytest.mark.parametrize(("count", "begin"), [(6, 16), (7, 0), (8, None)])
def test_regions_that_begin_before_the_file_are_none(path, count, begin):
    whole = sealed(CONTENT[:96], [(1, 2)], count)
    found = asked(path, whole, read_seal)
    assert found is None if begin is None else (len(found[1]), found[2]) == (count, begin)


def test_more_regions_than_are_ever_made_are_none(path, monkeypatch):
    whole = sealed(CONTENT, [(1, 2), (3, 4)])
    monkeypatch.setattr(earlier, "MOST_REGIONS", 2)
    assert asked(path, whole, read_seal) is not None
    monkeypatch.setattr(earlier, "MOST_REGIONS", 1)
    assert asked(path, whole, read_seal) is None


@pytest.mark.parametrize("region", [(-1, 5), (9, 8), (90, 101)])
def test_regions_outside_of_the_file_are_damage(path, region):
    assert asked(path, sealed(CONTENT, [region], digest=bytes(16)), unbroken, 1e9) is False


def test_no_more_is_read_than_is_allowed(path):
    whole = sealed(CONTENT, [(10, 20), (50, 100)])
    assert asked(path, whole, unbroken, 40) is True
    assert asked(path, whole, unbroken, 39) is None


def test_a_file_that_ends_early_is_damage(path, monkeypatch):
    path.write_bytes(sealed(CONTENT, []))

    def early(*args):
        raise EOFError

    monkeypatch.setattr(earlier, "structure_digest", early)
    with path.open("rb") as file:
        assert unbroken(file.fileno(), 148, 1e9) is False


def made(path, **changed):
    """A result of two by three cells in blocks of four, with a column of two numbers a cell, and one in chunks."""
    given = {"columns": "x status flags", "size": 6, "cells": 4, "digests": np.arange(96).reshape(2, 3, 16)}
    given |= {"dtype": "u1", "x": np.arange(12.0).reshape(2, 3, 2), "status": np.arange(6, dtype="i1").reshape(2, 3)}
    given |= changed
    with h5py.File(path, "w") as file:
        file["x"], file["status"] = given["x"], given["status"]
        file.create_dataset("flags", data=np.zeros((2, 3), "i1"), chunks=(1, 3))
        digests = file.create_dataset("integrity/digests", data=given["digests"].astype(given["dtype"]))
        digests.attrs.update({"columns": given["columns"], "size": [given["size"]], "cells": given["cells"]})
    path.write_bytes(sealed(path.read_bytes(), []))
    with path.open("rb") as file:
        return read(path, file.fileno(), path.stat().st_size)


def test_columns_that_stand_in_the_file_as_they_are_have_their_places(path):
    layout, digests = made(path)
    table = layout.work
    assert (table.grid, table.blocks.bounds(1), table.mark, table.digests) == ((2, 3), (4, 6), b"", 0)
    assert (layout.end, layout.key, layout.begun, layout.regions) == (path.stat().st_size, "", "", ())
    np.testing.assert_array_equal(digests, np.arange(96).reshape(2, 3, 16)[:, :2])
    x, status = table.places
    assert (x.name, x.dtype, x.shape, x.chunk_bytes) == ("x", "<f8", (2,), 0)
    assert (status.name, status.dtype, status.shape) == ("status", "|i1", ())
    content = path.read_bytes()
    for block, (start, stop) in enumerate([(0, 4), (4, 6)]):
        assert np.frombuffer(content, "f8", 2 * (stop - start), x.at(block)).tolist() == [*range(2 * start, 2 * stop)]
        assert np.frombuffer(content, "i1", stop - start, status.at(block)).tolist() == [*range(start, stop)]


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"size": 0}, "its digests cannot be"),
        ({"cells": 0}, "its digests cannot be"),
        ({"dtype": "i1"}, "its digests cannot be"),
        ({"cells": 6}, "its digests do not fit its columns"),
        ({"columns": "x status"}, "its digests do not fit its columns"),
        ({"digests": np.zeros((2, 3, 15))}, "its digests do not fit its columns"),
        ({"x": np.zeros((5, 2))}, "its digests are of another number of cells"),
    ],
)
def test_digests_that_do_not_fit_the_columns_are_refused(path, changed, text):
    with pytest.raises(ValueError, match=text):
        made(path, **changed)


def test_a_result_without_a_trailer_is_none(path):
    path.write_bytes(CONTENT)
    with path.open("rb") as file, pytest.raises(ValueError, match="it is no result, or was changed"):
        read(path, file.fileno(), 100)


@pytest.mark.parametrize(("shape", "cells", "grid"), [
    ((), 1, ()), ((1,), 1, ()), ((6,), 6, (6,)), ((2, 3, 5), 6, (2, 3)), ((2, 3, 5), 30, (2, 3, 5)),
    ((6, 1, 4), 6, (6,)),
])  # fmt: skip
def test_the_grid_is_the_fewest_lengths_that_hold_all_cells(shape, cells, grid):
    assert earlier._grid(shape, cells) == grid
