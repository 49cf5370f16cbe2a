"""Each finding of a verdict, on results made by hand."""

import errno
import os

import h5py
import pytest
from handmade import fill, finished, frame, harm, rows_cut, written

from sweep.results import verify as module
from sweep.results.open import BESIDE
from sweep.results.verify import verify
from sweep.store.layout import write_digests
from sweep.store.store import unfinished_of
from sweep.system.errors import SweepError


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


def judged(output):
    found = verify(output)
    return found.whole, found.findings, found.blocks


def test_a_whole_result(output):
    layout = finished(output)
    assert judged(output) == (True, (), None)
    assert verify(output).checked == f"{layout.size:,} bytes checked"


def test_damaged_chunks_are_told_by_column_and_can_be_computed_again(output):
    layout = finished(output)
    x, status = layout.work.places
    for at in (status.at(2), x.at(0), x.at(1)):
        harm(output, at)
    told = ("x: damaged between its cells 0 and 8", "status: damaged between its cells 8 and 12")
    assert judged(output) == (False, told, (0, 1, 2))


def test_a_byte_between_chunks_is_damage_beside_them(output):
    layout = finished(output)
    x = layout.work.places[0]
    harm(output, x.at(2) + x.chunk_bytes + 4)
    assert judged(output) == (False, (BESIDE,), None)
    harm(output, x.at(1))
    assert judged(output) == (False, ("x: damaged between its cells 4 and 8", BESIDE), None)


def test_a_structure_that_is_damaged_is_told_first(output):
    layout = finished(output)
    harm(output, 300)
    harm(output, layout.work.places[0].at(1))
    assert judged(output) == (False, (BESIDE,), None)


def test_a_result_in_its_place_that_has_not_ended_is_damaged(output):
    finished(output, ended=False)
    assert judged(output) == (False, (BESIDE,), None)


def test_of_an_unfinished_result_what_is_there_is_checked(output):
    layout = written(unfinished_of(output), blocks=(0, 2))
    assert judged(output) == (False, ("missing: cells 4 to 8",), None)
    harm(unfinished_of(output), layout.work.places[1].at(2))
    found = verify(output)
    assert found.findings == ("status: damaged between its cells 8 and 12", "missing: cells 4 to 8")
    assert found.checked == "unfinished, 2 of 3 blocks there and checked"


def test_rows_of_a_summary_are_checked_and_its_cells_once_they_are_there(output):
    made = frame(4, rows=rows_cut())
    layout = written(unfinished_of(output), made, blocks=(0,), name="rows")
    assert verify(output).findings == ("missing: rows 2 to 4", "missing: rows 4 to 5")
    finished(output, frame(4, rows=rows_cut()))
    # its cells are written, but no rows
    found = verify(output)
    assert found.findings == ("n: damaged between its cells 0 and 5", "y: damaged between its cells 0 and 5")
    assert found.blocks == (0, 1, 2)
    assert layout.work_name == "rows"


def test_damaged_cells_of_a_summary_are_made_of_its_rows_again(output):
    layout = finished(output, frame(4, rows=rows_cut()))
    with output.open("r+b") as file:
        fill(file.fileno(), layout.tables["rows"])
    assert judged(output) == (True, (), None)
    harm(output, layout.tables["cells"].places[0].at(1))
    assert judged(output) == (False, ("x: damaged between its cells 4 and 8",), ())


def test_a_digest_that_is_lost_is_damage(output):
    layout = finished(output)
    with output.open("r+b") as file:
        write_digests(file.fileno(), layout.work, {1: bytes(32)})
    told = tuple(f"{name}: damaged between its cells 4 and 8" for name in ("x", "status"))
    assert judged(output) == (False, told, (1,))


def test_what_another_program_left_without_its_digests_is_told(output, monkeypatch):
    layout = finished(output)
    output.write_bytes(output.read_bytes()[: layout.end])
    monkeypatch.setattr(module, "stored_attrs", lambda path: {})
    assert judged(output) == (False, ("was changed by another program, which left its digests out",), None)

    def none(path):
        raise SweepError("no")

    monkeypatch.setattr(module, "stored_attrs", none)
    assert judged(output) == (False, ("its structure is damaged, or it is not the result of a sweep",), None)


def test_links_in_a_result_are_damage(output, monkeypatch):
    finished(output)
    real = h5py.File

    def linked(path, mode):
        file = real("memory", "w", driver="core", backing_store=False)
        file["link"] = h5py.SoftLink("/x")
        return file

    monkeypatch.setattr(h5py, "File", linked)
    told = "its structure is damaged, or it is not the result of a sweep (link is a link)"
    assert judged(output) == (False, (told,), None)


def test_nothing_and_what_cannot_be_read_is_told(output, tmp_path, monkeypatch):
    def refused():
        with pytest.raises(SweepError) as caught:
            verify(output)
        return str(caught.value)

    assert refused() == f"{output}: no such file, and no sweep that writes it"
    output.mkdir()
    assert refused() == f"{output}: is a folder, not the result of a sweep"
    output.rmdir()
    finished(output)
    for number, text in ((errno.EIO, "Input/output error"), (errno.EACCES, "Permission denied")):
        monkeypatch.setattr(module, "_verdict", raising(OSError(number, os.strerror(number))))
        assert refused() == f"{output}: cannot be read ({text})"
    for fault, text in (
        (OSError(errno.EINVAL, "odd"), "[Errno 22] odd"),
        (ValueError("one\ntwo"), "one"),
        (KeyError(), "KeyError"),
        (EOFError(), "EOFError"),
    ):
        monkeypatch.setattr(module, "_verdict", raising(fault))
        told = f"its structure is damaged, or it is not the result of a sweep ({text})"
        assert judged(output) == (False, (told,), None)
        assert verify(output).checked == ""


def raising(fault):
    def call(*args):
        raise fault

    return call
