"""What `sweep show` says of a result, line by line, from datasets made by hand."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from kernels.interface import Status
from sweep.show import text
from sweep.show.text import head, result_text, sections

FLAGS = {
    "flag_values": np.array([int(status) for status in Status], np.int8),
    "flag_meanings": " ".join(status.name for status in Status),
}
METHODS = {"flag_values": np.array([-1, 0, 1], np.int8), "flag_meanings": "none map closed"}
ATTRS = {
    "title": "Foliot", "question": "Why?", "kernel": "foliot", "design": "product", "where": "mu > 1", "method": "auto",
    "rtol": 1e-9, "start": "monday", "end": "tuesday", "cells_per_second": 12345.678, "versions": "numba 1",
}  # fmt: skip


def result(mu=(1.0, 2.0, 3.0, 4.0), status=(0, 0, 1, 0), **attrs):
    """A period over the drive torque."""
    columns = {
        "period": ("mu", np.arange(1.0, len(mu) + 1) / 3, {"units": "s", "long_name": "period of the cycle"}),
        "status": ("mu", np.array(status, np.int8), FLAGS),
        "method_used": ("mu", np.array([-1 if s else i % 2 for i, s in enumerate(status)], np.int8), METHODS),
    }
    coords = {"mu": ("mu", list(mu), {"units": "rad/s^2", "long_name": "drive"}), "a": 1 / 3, "phase": [0.0, 0.5, 1.0]}
    return xr.Dataset(columns, coords, attrs={**ATTRS, **attrs})


EXPECTED = f"""x.h5: complete, 4 cells
Foliot
Why?
4 cells: 3 ok, 1 remarked, 0 refused, 0 unsolved, 0 FAILED, 0 pending

  kernel    foliot
  design    product
  where     mu > 1
  method    auto
  rtol      1e-09
  started   monday
  ended     tuesday, 12,346 cells/s
  versions  numba 1

axes
  mu  [rad/s^2]  4 values  1, 2, 3, 4  drive

fixed
  a  0.3333333333

along
  phase  3 values  0, 0.5, 1

outputs
  period  [s]  0.333333 to 1.33333  period of the cycle

status
  3  OK          ok        {Status.OK.doc}
  1  INACCURATE  remarked  {Status.INACCURATE.doc}; mu 3; e.g. mu=3.0

methods used
  map     1  25.0 %
  closed  2  50.0 %"""


def test_a_result_is_told_in_full():
    assert Status.INACCURATE == 1
    assert result_text(Path("x.h5"), result()) == EXPECTED


@pytest.mark.parametrize(
    ("pending", "total", "share"),
    [(1, 2000, "99.9 %"), (1, 3, "66.6 %"), (1, 8, "87.5 %"), (3, 3, "0 %"), (1, 2, "50 %")],
)
def test_the_share_that_is_done_has_tenths_and_is_rounded_down(pending, total, share):
    status = [int(Status.PENDING)] * pending + [0] * (total - pending)
    (first, *_) = head(Path("x.h5"), result(range(1, total + 1), status))
    assert first == f"x.h5: unfinished: {total - pending:,} of {total:,} cells ({share})"


def test_a_title_that_is_the_question_stands_once():
    assert head(Path("x.h5"), result(question="Foliot"))[1:2] == ["Foliot"]
    assert len(head(Path("x.h5"), result(question="Foliot"))) == 3
    assert len(head(Path("x.h5"), result(title=""))) == 3


@pytest.mark.parametrize(
    ("values", "count", "shown"),
    [
        ([1.23456789], "1 value", "1.23457"),
        (np.arange(6.0), "6 values", "0, 1, 2, 3, 4, 5"),
        (np.arange(7.0), "7 values", "0 to 6"),
        (np.arange(1234), "1,234 values", "0 to 1233"),
        (["b", "a", "b"], "3 values", "b, a"),
        ([f"w{i}" for i in range(21)], "21 values", ", ".join(f"w{i}" for i in range(20))),
        ([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]], "2 values", "(1, 2, 3, ...) to (5, 6, 7, ...)"),
    ],
)
def test_values_of_an_axis_are_listed_up_to_six(values, count, shown):
    dims = ("x", "y")[: np.ndim(values)]
    assert text._coordinate(xr.DataArray(values, dims=dims, name="x")) == ("x", "", count, shown, "")


def test_an_output_is_looked_up_until_it_is_too_large(monkeypatch):
    output = xr.DataArray([2.0, np.nan, -1.5, np.inf], dims="x", name="y")
    assert text._extent(output) == "-1.5 to 2"
    assert text._extent(output * np.nan) == "no values"
    monkeypatch.setattr(text, "LARGEST_SCAN", 32)
    assert text._extent(output) == "-1.5 to 2"
    monkeypatch.setattr(text, "LARGEST_SCAN", 31)
    assert text._extent(output) == ""


def test_an_unfinished_result_that_is_large_is_not_read_for_its_extent(monkeypatch):
    ended, open_ = result(), result()
    del open_.attrs["end"]

    def extents(dataset):
        return sections(dataset)["outputs"][0][2]

    assert extents(open_) == extents(ended) == "0.333333 to 1.33333"
    monkeypatch.setattr(text, "LARGEST_SCAN", 40)
    assert (extents(open_), extents(ended)) == ("", "0.333333 to 1.33333")
    monkeypatch.setattr(text, "LARGEST_SCAN", open_.nbytes)
    assert extents(open_) == "0.333333 to 1.33333"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.array([3.0, 1.0, 2.0]), "1 to 3"),
        (np.array([2.0, 2.0]), "2"),
        (np.array([np.nan, 1.0]), "1 and nan"),
        (np.array([np.nan]), "nan"),
        (np.array([1.0, 1.0000001]), "1"),
        (np.array(["b", "a", "b"]), "b and a"),
    ],
)
def test_where_a_status_occurs_is_told_by_its_ends(values, said):
    assert text._span(values) == said


def test_the_cells_that_failed_are_told_with_their_reasons(tmp_path):
    failed = int(Status.FAILED)
    ds = result(range(1, 26), [0, 0, *[failed] * 23])
    (tmp_path / "x.h5.log").write_text("2026-01-01 00:00:00  cell 3 FAILED (mu=4): no root\n")
    found = result_text(tmp_path / "x.h5", ds).split("\n\nFAILED, and why\n")[1].splitlines()
    assert len(found) == 20
    assert [line.split() for line in found[:3]] == [
        ["cell", "2", "mu=3.0"], ["cell", "3", "mu=4.0", "no", "root"], ["cell", "4", "mu=5.0"],
    ]  # fmt: skip


def summary(bins=True):
    """Of three speeds at two heights, the speeds are reduced."""
    statuses, methods = ["OK", "BAD_INPUT", "strange"], ["none", "map"]
    columns = {
        "cells_by_status": (("height", "status_name"), [[2, 0, 1], [2, 1, 0]]),
        "cells_by_method": (("height", "method_name"), [[1, 2], [1, 2]]),
        "fall_min": ("height", [0.5, 0.25], {"units": "s", "long_name": "smallest fall"}),
        "mean": ((), 1 / 3),
        "many": ((), 12345),
        "best": ((), np.int8(1), METHODS),
    }
    if bins:
        columns["histogram"] = (("height", "bin"), np.zeros((2, 4)))
    coords = {
        "height": [1.0, 2.0], "v": ("v", [0.0, 1.0, 2.0]), "g": 9.80665,
        "status_name": statuses, "method_name": methods, "fall_bin_lower": ("bin", np.arange(4.0)),
    }  # fmt: skip
    return xr.Dataset(columns, coords, attrs={"over": "v", "kernel": "toy"})


def test_a_summary_is_told_by_its_reductions(tmp_path):
    found = sections(summary())
    assert found["axes"] == [("height", "", "2 values", "1, 2", "")]
    assert found["reduced over"] == [("v", "", "3 values", "0, 1, 2", "")]
    assert found["fixed"][0] == ("g", "", "9.80665", "")
    assert found["reductions"] == [
        ("fall_min", "[s]", "0.25 to 0.5", "smallest fall"),
        ("mean", "", "0.3333333333", ""),
        ("many", "", "12,345", ""),
        ("best", "", "closed", ""),
        ("histogram", "", "4 bins", ""),
    ]
    assert found["status"] == [
        ("4", "OK", "ok", Status.OK.doc), ("1", "BAD_INPUT", "refused", Status.BAD_INPUT.doc),
        ("1", "strange", "FAILED", ""),
    ]  # fmt: skip
    assert found["methods used"] == [("map", "4", "66.7 %")]
    assert found[""] == [("kernel", "toy")]
    lines = "".join(f"2026-01-01 00:00:00  cell {k} FAILED (v=1): worn out\n" for k in range(21))
    (tmp_path / "x.h5.log").write_text(lines)
    told = result_text(tmp_path / "x.h5", summary()).split("\n\nFAILED, and why\n")[1].splitlines()
    assert told == [f"  cell {k:<4}  worn out".replace(f"{k:<4}", f"{k:<2}") for k in range(20)]


@pytest.mark.parametrize(("at_once", "sizes"), [(1 << 22, [24]), (12, [12, 12]), (17, [12, 12]), (5, [6] * 4)])
def test_places_of_statuses_are_looked_up_so_many_cells_at_a_time(monkeypatch, at_once, sizes):
    status = np.zeros((4, 3, 2), np.int8)
    status[2, 1, 0] = status[3, 0, 0] = Status.INACCURATE
    seen, real = [], np.unique
    monkeypatch.setattr(text, "CELLS_AT_ONCE", at_once)
    monkeypatch.setattr(text.np, "unique", lambda piece: seen.append(piece.size) or real(piece))
    (hits,) = text._hits(xr.DataArray(status, dims=("a", "b", "c"))).values()
    assert seen == sizes
    found = {name: np.flatnonzero(hit).tolist() for name, hit in hits.items()}
    assert found == {"a": [2, 3], "b": [0, 1], "c": [0]}
