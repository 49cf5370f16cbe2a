"""Where everything stands in a result of which nothing is computed: from a page on, and where HDF5 looks for it."""

import os
from dataclasses import replace

import h5py
import numpy as np
import pytest
import toy_studies
import xxhash
from handmade import MARK, SCHEMA, cut, frame, rows_cut, written

from kernels.interface import Status
from sweep.cells.output_schema import output_schema
from sweep.cells.partition import Partition, boxes, row_blocks
from sweep.cells.schema import Column
from sweep.store import frame as framing
from sweep.store.frame import ENDINGS, UNKNOWN, Frame, cuts_of, expected_size
from sweep.store.layout import gaps, mark_of, read_layout
from sweep.store.structure import Cut


def test_columns_stand_behind_each_other_each_from_a_page_on():
    made = frame()
    layout = made.layout
    x, status = layout.work.places
    begin = layout.regions[-1][0]
    assert begin % 4096 == 0
    assert x.runs == ((0, begin, 68),)
    assert status.runs == ((0, begin + 4096, 8),)
    assert layout.end == begin + 4096 + 2 * 8 + 8
    assert layout.regions == ((layout.work.digests, layout.work.digests + 3 * 32), (begin, layout.end))
    assert (layout.work.grid, layout.work.blocks, layout.work.mark) == (
        (3, 4), Partition(12, 4, 12), mark_of(MARK, "cells")
    )  # fmt: skip
    assert (layout.fingerprint, layout.begun) == (MARK, "now")
    assert len(layout.key) == 32
    assert layout.key != frame().layout.key


@pytest.mark.parametrize(("values", "shared", "step"), [
    (509, False, 4076), (511, False, 4092), (512, False, 4100), (512, True, 8192), (511, True, 4092),
    (5119, False, 40956), (5120, False, 45056),
])  # fmt: skip
def test_chunks_worth_it_begin_on_a_page(values, shared, step):
    one = Cut((Column("x", "<f8", ("m",), (values,), {}),), (3,), Partition(3, 1, 3))
    schema = output_schema(toy_studies.build(axes={"height": [1.0, 2.0, 3.0]}), MARK)
    schema = replace(schema, columns=one.columns, coordinates=(), attrs={})
    made = Frame(schema, {"cells": one}, MARK, "now", shared)
    (place,) = made.layout.work.places
    assert place.runs[0][2] == step
    assert place.chunk_bytes == 8 * values
    assert made.layout.end == place.runs[0][1] + 2 * step + 8 * values + 4


def test_the_digest_of_the_end_takes_sixteen_bytes_wherever_it_stands():
    for length in range(0, 64, 8):
        schema = replace(SCHEMA, attrs={"title": "x" * length})
        begin, end = Frame(schema, {"cells": cut()}, MARK, "now").layout.endings[-1]
        assert end == begin + 16


def test_what_is_one_chunk_stands_in_the_structure():
    layout = frame(12).layout
    assert [place.runs[0][2] for place in layout.work.places] == [0, 0]
    begin, end = layout.regions[-1]
    assert begin == end == layout.end
    inside = sorted([(p.runs[0][1], p.runs[0][1] + p.chunk_bytes + 4) for p in layout.work.places]
                    + [(layout.work.digests, layout.work.digests + 32)])  # fmt: skip
    assert list(layout.regions[:-1]) == inside


def test_the_chunks_of_rows_come_before_those_of_cells():
    layout = Frame(SCHEMA, {"rows": rows_cut(), "cells": cut()}, MARK, "now").layout
    places = [*layout.tables["rows"].places, *layout.tables["cells"].places]
    begins = [place.runs[0][1] for place in places]
    assert [place.name for place in places] == ["n", "y", "x", "status"]
    assert np.diff(begins).tolist() == [4096] * 3
    assert layout.tables["rows"].mark == mark_of(MARK, "rows")
    assert layout.work_name == "rows"


@pytest.mark.parametrize("cells", [2, 4, 12])
def test_what_is_written_is_what_the_layout_tells_of(tmp_path, cells):
    made = frame(cells)
    path = tmp_path / "file"
    layout = written(path, made, blocks=())
    content = path.read_bytes()
    assert len(content) == layout.size
    with path.open("rb") as file:
        assert read_layout(file.fileno(), len(content)) == layout
    structure = b"".join(content[a:b] for a, b in gaps([*layout.regions, *layout.endings], layout.regions[-1][0]))
    assert xxhash.xxh3_128(structure).digest() == layout.structure
    assert [content[a:b] for a, b in layout.endings] == [*UNKNOWN.values(), bytes(16)]
    assert UNKNOWN == {"created": b"unfinished" + b" " * 15, "end": b"unfinished" + b" " * 15,
                       "cells_per_second": b"nan         "}  # fmt: skip
    assert not np.frombuffer(content[layout.work.digests :][: layout.work.row_bytes], "u1").any()


@pytest.mark.parametrize("cells", [2, 4, 12])
def test_hdf5_finds_every_chunk_pending_statuses_and_no_numbers(tmp_path, cells):
    layout = written(tmp_path / "file", frame(cells), blocks=())
    with h5py.File(tmp_path / "file") as file:
        assert (file.attrs["title"], file.attrs["start"]) == ("by hand", "now")
        assert {name: len(file.attrs[name]) for name in ENDINGS} == ENDINGS
        assert (file["status"][...] == Status.PENDING).all()
        for place in layout.work.places:
            found = []
            file[place.name].id.chunk_iter(lambda c, found=found: found.append((c.byte_offset, c.size)))
            sizes = place.chunk_bytes + 4
            assert sorted(found) == [(place.at(k), sizes) for k in range(layout.work.blocks.count)]
        for at in ((0, 0), (1, 2), (2, 3)):
            with pytest.raises(OSError, match="filter"):
                file["x"][at]


def test_room_on_the_disk_is_reserved_for_all_of_it_at_first(tmp_path, monkeypatch):
    asked, made = [], frame()
    monkeypatch.setattr(framing.disk, "reserve", lambda fd, size: asked.append((os.fstat(fd).st_size, size)))
    written(tmp_path / "file", made, blocks=())
    assert asked == [(0, made.layout.size)]


def test_the_tables_of_a_study_are_its_cells():
    study = toy_studies.build(axes={"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0]})
    schema = output_schema(study, MARK)
    blocks = boxes((3, 2), 2)
    assert cuts_of(study, schema, blocks) == {"cells": Cut(schema.columns, (3, 2), blocks)}


def test_the_tables_of_a_summary_are_its_rows_and_groups_of_so_many_bytes(monkeypatch):
    study = toy_studies.build(
        axes={"v0": np.linspace(0.0, 1.0, 12), "height": np.linspace(1.0, 2.0, 6)},
        summary={"over": ["height"], "outputs": {"fall_time": ["min"]}},
    )
    schema, rows = output_schema(study, MARK), row_blocks(study)
    columns = cuts_of(study, schema, Partition(12, 5))["rows"].columns
    group = rows.per_group * sum(column.cell_bytes for column in columns)
    assert rows.count == 72
    for groups, bytes_at_once in ((12, 8 << 20), (4, 4 * group), (3, 4 * group - 1), (1, 1)):
        monkeypatch.setattr(framing, "GATHERED_BYTES", bytes_at_once)
        found = cuts_of(study, schema, Partition(12, 5))
        assert list(found) == ["rows", "cells"]
        assert (found["rows"].grid, found["rows"].blocks) == ((72,), Partition(12, 5))
        assert (found["cells"].grid, found["cells"].blocks.cells) == ((12,), groups)


def test_the_expected_size_is_of_chunks_their_entries_and_digests_texts_and_coordinates():
    # three blocks of a chunk of 64 bytes and one of 4; each with a checksum, an entry of the table and a digest
    coordinates = 3 * 8 + 4 * 3 * 4 + 12 * 8 + 2 * 8 + 2 * 8 + 3 * 8 + 8
    found = expected_size(SCHEMA, {"cells": cut(4)})
    assert found == 32768 + len("by hand") + coordinates + 3 * (64 + 4 + 16 + 16) + 3 * (4 + 4 + 16 + 16)
    more = expected_size(SCHEMA, {"cells": cut(4), "rows": rows_cut(3, 1)})
    assert more - found == 3 * (24 + 4 + 32) + 3 * (8 + 4 + 32)
    paged = Cut((Column("x", "<f8", ("m",), (5120,), {}),), (3,), Partition(3, 1, 3))
    assert expected_size(SCHEMA, {"cells": paged}) - found == 3 * (45056 + 32) - 3 * (100 + 40)
