"""What is looked at before a result is opened, piece by piece, and what each refusal says."""

import errno
import os
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray as xr
from handmade import frame, harm, rows_cut, written
from toy_studies import build

from sweep.cells.output_schema import output_schema
from sweep.cells.partition import Partition
from sweep.results import open as opening
from sweep.results.open import changed, check_structure, in_memory, memory, open_result, open_unfinished, unreadable
from sweep.store.frame import Frame, cuts_of
from sweep.store.store import unfinished_of
from sweep.system.errors import SweepError

STUDY = build(axes={"height": [1.0, 2.0, np.nan], "method": ["rough", "exact"]}, outputs=["fall_time", "drop"],
              along={"phase": [0.0, 1.0]})  # fmt: skip


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


def dataset(study=STUDY):
    """As a result of the study is opened, zeros everywhere."""
    plan = output_schema(study, {})
    arrays = {c.name: np.zeros((plan.grid.size, *c.shape), c.dtype) for c in plan.columns}
    return in_memory(plan, arrays)


def test_a_result_in_memory_has_the_shape_and_attributes_of_its_schema():
    found = dataset()
    assert found.sizes == {"height": 3, "method": 2, "phase": 2}
    assert found["drop"].dims == ("height", "method", "phase")
    assert found.fall_time.attrs["units"] == "s"
    assert found.attrs["kernel"] == "toy:KERNEL"
    assert found.height.attrs["units"] == "m"


def refused(action):
    with pytest.raises(SweepError) as caught:
        action()
    return str(caught.value)


def test_nothing_at_all_and_what_vanishes(output, monkeypatch):
    assert refused(lambda: open_result(output)) == f"{output}: no such file, and no sweep that writes it"
    unfinished_of(output).touch()
    tried = []

    def gone(path, strict):
        tried.append((path, strict))
        raise FileNotFoundError

    monkeypatch.setattr(opening, "open_unfinished", gone)
    assert refused(lambda: open_result(output, True)) == f"{output}: is vanishing while it is read; try again"
    assert tried == [(output, True)] * 3


@pytest.mark.parametrize(
    ("blocks", "text"),
    [
        ((0, 2), "1 of 3 blocks are missing"),
        ((), "3 of 3 blocks are missing"),
        (None, "all is computed but not checked yet"),
    ],
)
def test_an_unfinished_result_is_refused_with_what_it_lacks(output, blocks, text):
    written(unfinished_of(output), blocks=blocks)
    found = refused(lambda: open_unfinished(output, strict=True))
    assert found == f"{output}: unfinished, {text}; run its sweep again to continue"


def test_of_a_summary_rows_are_missing(output):
    written(unfinished_of(output), frame(4, rows=rows_cut()), blocks=(1,), name="rows")
    assert "unfinished, 2 of 3 blocks are missing" in refused(lambda: open_unfinished(output, strict=True))


def test_memory_is_that_of_the_machine_or_eight_gibibytes(monkeypatch):
    numbers = {"SC_PHYS_PAGES": 1000, "SC_PAGE_SIZE": 4096}
    monkeypatch.setattr(os, "sysconf", numbers.__getitem__)
    assert memory() == 4_096_000

    def unknown(name):
        raise ValueError

    monkeypatch.setattr(os, "sysconf", unknown)
    assert memory() == 8_589_934_592
    monkeypatch.delattr(os, "sysconf")
    assert memory() == 8_589_934_592


@pytest.mark.parametrize(("bytes_", "chunked"), [(4003, True), (4004, False)])
def test_what_is_larger_than_a_quarter_of_the_memory_is_opened_in_pieces(output, monkeypatch, bytes_, chunked):
    asked = []
    output.write_bytes(bytes(1001))
    monkeypatch.setattr(opening, "memory", lambda: bytes_)
    monkeypatch.setattr(opening, "check_structure", lambda path: False)
    monkeypatch.setattr(opening, "stored_attrs", lambda path: {})
    monkeypatch.setattr("sweep.results.columns.open_checked", lambda path, chunks: asked.append(chunks) or dataset())
    opening._open(output)
    assert asked == ["auto" if chunked else None]


@pytest.mark.parametrize(("number", "size", "compressed", "found"), [
    (100, 800, None, True), (100, 799, None, False), (137, 1, "gzip", True),
    (138, 1, "gzip", False), (0, 0, None, True),
])  # fmt: skip
def test_a_dataset_larger_than_its_file_cannot_be(number, size, compressed, found):
    """Of a byte gzip makes 1100 at most: 137.5 numbers."""
    file = {"x": SimpleNamespace(nbytes=8 * number, compression=compressed), "group": SimpleNamespace()}
    assert opening._can_be(file, "x", size) is found
    assert opening._can_be(file, "group", 0)


@pytest.mark.parametrize(
    ("where", "attrs", "fault"),
    [
        ("fall_time", {"units": 3}, "an attribute is no text"),
        (None, {"title": 3.5}, "an attribute is no text"),
        ("height", {"long_name": np.array([1])}, "an attribute is no text"),
        (None, {"mine": "\ud800"}, "surrogates"),
        (None, {"rtol": "much"}, "could not convert"),
        ("fall_time", {"rtol": "much"}, "could not convert"),
        (None, {"cells_per_second": "fast"}, "could not convert"),
    ],
)
def test_attributes_that_are_something_else_are_refused(where, attrs, fault):
    found = dataset()
    opening._check_kinds(found)
    (found.attrs if where is None else found[where].attrs).update(attrs)
    with pytest.raises((TypeError, ValueError, UnicodeError), match=fault):
        opening._check_kinds(found)


def test_outputs_that_are_no_numbers_are_refused():
    for values in (np.zeros(2, complex), np.array(["a", "b"]), np.zeros(2, bool)):
        with pytest.raises(TypeError, match="an output is no number"):
            opening._check_kinds(xr.Dataset({"x": ("y", values)}))
    opening._check_kinds(xr.Dataset({name: ("y", np.zeros(2, name)) for name in ("f4", "i8", "u1")}))


def test_a_result_is_as_its_study_declares_it():
    opening._check_as_declared(dataset(), STUDY)
    opening._check_as_declared(dataset().drop_vars("error_bound"), STUDY)
    words = dataset().assign_coords(method=("method", np.array(["rough", "exact"], object)))
    opening._check_as_declared(words, STUDY)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda d: d.assign_coords(height=[1.0, 2.5, np.nan]), "height has other values than the study"),
        (lambda d: d.assign_coords(method=["exact", "rough"]), "method has other values than the study"),
        (lambda d: d.assign(more=d.fall_time), "more is there than the study asks for"),
        (lambda d: d.drop_vars("fall_time"), "fall_time"),
        (lambda d: d.assign(status=d.status.astype(float)), "status is not as the study says"),
        (lambda d: d.assign(fall_time=d["drop"]), "fall_time is not as the study says"),
        (lambda d: d.assign(fall_time=d.fall_time.transpose()), "fall_time is not as the study says"),
        (lambda d: d.assign(g=("height", np.full(3, 9.80665))), "g"),
    ],
)
def test_a_result_that_is_not_as_its_study_declares_it_is_refused(change, text):
    with pytest.raises((ValueError, KeyError), match=text):
        opening._check_as_declared(change(dataset()), STUDY)


def test_numbers_and_words_are_equal_nan_included():
    assert opening._equal(np.array([1.0, np.nan]), np.array([1.0, np.nan]))
    assert not opening._equal(np.array([1.0, 2.0]), np.array([1.0, np.nan]))
    assert opening._equal(np.array(["a", "b"], object), np.array(["a", "b"]))
    assert not opening._equal(np.array(["a", "c"], object), np.array(["a", "b"]))


def test_words_become_text_of_a_width_and_numbers_stay():
    closed = []
    found = dataset().assign_coords(method=("method", np.array(["rough", "exact"], object), {"long_name": "asked"}))
    found.set_close(lambda: closed.append(True))
    plain = opening._with_plain_text(found)
    assert plain.method.dtype == np.dtype("<U5")
    assert plain.method.attrs == {"long_name": "asked"}
    assert (plain.height.dtype, plain.g.dtype) == (np.float64, np.float64)
    plain.close()
    assert closed


@pytest.mark.parametrize("times", [("unfinished", False), ("2026-01-01", True)])
def test_what_is_known_at_the_end_is_left_out_of_an_unfinished_result(output, monkeypatch, times):
    end, kept = times
    output.touch()
    found = dataset()
    found.attrs |= {"created": "c", "end": end.ljust(25), "cells_per_second": "nan", "start": "s"}
    monkeypatch.setattr(opening, "check_structure", lambda path: False)
    monkeypatch.setattr(opening, "stored_attrs", lambda path: {})
    monkeypatch.setattr("sweep.results.columns.open_checked", lambda path, chunks: found)
    names = {"created", "end", "cells_per_second"} & set(opening._open(output).attrs)
    assert names == ({"created", "end", "cells_per_second"} if kept else set())
    assert opening._open(output).attrs["start"] == "s"


def test_a_damaged_structure_is_told_and_what_has_no_trailer_is_not_known(output):
    assert not check_structure(output)
    layout = written(output)
    assert check_structure(output)
    harm(output, 200)
    assert refused(lambda: check_structure(output)) == (
        f"{output}: damaged beside the outputs' numbers: in attributes, coordinates or its structure; sweep verify "
        "tells of all damage"
    )
    output.write_bytes(output.read_bytes()[: layout.end])
    assert check_structure(output) is False


@pytest.mark.parametrize("fault", [FileNotFoundError(errno.ENOENT, "gone"), PermissionError(errno.EACCES, "no")])
def test_a_file_that_may_not_be_read_is_told_and_one_that_is_gone_goes_on(output, monkeypatch, fault):
    def refuse(path, flags):
        raise fault

    output.touch()
    monkeypatch.setattr(opening.disk, "open_file", refuse)
    if isinstance(fault, FileNotFoundError):
        with pytest.raises(FileNotFoundError):
            check_structure(output)
    else:
        assert refused(lambda: check_structure(output)) == f"{output}: cannot be read (Permission denied)"


def test_what_is_unreadable_is_told_by_its_kind(output, tmp_path):
    no = f"{output}: not the result of a sweep, or damaged; move it away or choose another name"
    assert str(unreadable(tmp_path, ValueError())) == f"{tmp_path}: is a folder, not the result of a sweep"
    assert str(unreadable(output, ValueError("x"))) == no
    assert str(unreadable(output, OSError("no number"))) == no
    assert str(unreadable(output, OSError(errno.EINVAL, "x"))) == no
    assert str(unreadable(output, OSError(errno.EOVERFLOW, "x"))) == no
    assert str(unreadable(output, OSError(errno.EIO, "x"))) == f"{output}: cannot be read (Input/output error)"


@pytest.mark.parametrize("fault", [ValueError("odd\nmore"), ZeroDivisionError("odd\nmore"), KeyError("odd")])
def test_what_goes_wrong_with_a_changed_result_is_told(output, fault):
    written(output)
    harm(output, 200)

    def failing():
        with changed(output):
            raise fault

    text = "KeyError: 'odd'" if isinstance(fault, KeyError) else f"{type(fault).__name__}: odd"
    told = f"{output}: was changed by another program, and is no result any more ({text})"
    assert refused(failing) == told
    output.rename(unfinished_of(output))
    assert refused(failing) == told
    harm(unfinished_of(output), 200)
    with pytest.raises(type(fault)):
        failing()


def test_a_refusal_of_the_system_is_no_change(output):
    written(output)
    harm(output, 200)
    for fault in (OSError(errno.EIO, "no"), NameError("ours")):
        with pytest.raises(type(fault)), changed(output):
            raise fault


@pytest.mark.parametrize(
    ("change", "whole"),
    [
        (lambda file: None, True),
        (lambda file: file.attrs.__delitem__("study_json"), False),
        (lambda file: file.attrs.update(fingerprint="[]"), True),
        (lambda file: file.attrs.update(fingerprint="{"), False),
        (lambda file: file.__delitem__("status"), False),
        (lambda file: file.move("status", "cells_by_status"), True),
        (lambda file: file.create_dataset("huge", (1 << 20,), "f8", chunks=(1 << 10,)), False),
    ],
)
def test_attributes_are_read_of_what_is_a_result(output, monkeypatch, change, whole):
    monkeypatch.setattr(opening, "readable", lambda path, fd: True)
    with h5py.File(output, "w") as file:
        file.attrs.update(study_json="{}", fingerprint='{"study": "abc"}')
        file["status"] = np.zeros(3, "i1")
        change(file)
    if whole:
        found = opening.stored_attrs(output)
        assert found["fingerprint"] == ({"study": "abc"} if found["fingerprint"] else {})
        assert opening.stored_fingerprint(output) == found["fingerprint"]
    else:
        assert "not the result of a sweep, or damaged" in refused(lambda: opening.stored_attrs(output))


def test_attributes_are_not_asked_for_where_hdf5_cannot_read(output, monkeypatch):
    written(output)
    monkeypatch.setattr(opening, "readable", lambda path, fd: False)
    assert "not the result of a sweep, or damaged" in refused(lambda: opening.stored_attrs(output))


def test_of_rows_that_are_there_an_unfinished_summary_is_made(output):
    study = build(axes={"height": [1.0, 2.0], "v0": [0.0, 1.0, 3.0]},
                  summary={"over": ["v0"], "outputs": {"fall_time": ["min"]}})  # fmt: skip
    schema = output_schema(study, {"study": "x"})
    made = Frame(schema, cuts_of(study, schema, Partition(2, 1)), {"study": "x"}, "now")
    written(unfinished_of(output), made, blocks=(1,), name="rows")
    attrs = {"over": "v0", "study_json": study.to_json(), "fingerprint": {"study": "x"}}
    found = xr.Dataset(attrs={"title": "t", "end": "unfinished", "created": "c"})
    summary = opening._of_unfinished(unfinished_of(output), found, attrs)
    assert summary.attrs == {"title": "t"}
    np.testing.assert_array_equal(summary.fall_time_min, [np.nan, 2.0])
    pending = summary.cells_by_status.sel({"status_name": "PENDING"}).values
    assert pending[0] == 3
    assert pending[1] != 3
