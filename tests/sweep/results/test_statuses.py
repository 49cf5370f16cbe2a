"""Accounts of cells: which status counts as what, sums of summaries, and the words of it all."""

import numpy as np
import pytest
import xarray as xr

from kernels.interface import Status
from sweep.results import statuses as module
from sweep.results.statuses import (
    Account,
    StatusCount,
    account,
    cell_values,
    count_methods,
    count_statuses,
    failed_cells,
    failures,
    flag_words,
    flat_pieces,
    summary_text,
)

FLAGS = {"flag_values": np.array([-1, 0, 1], np.int8), "flag_meanings": "none map closed"}


def cells(status, methods=None):
    """One cell of each status."""
    status = np.array(status, np.int8)
    used = np.zeros(status.shape, np.int8) if methods is None else np.array(methods, np.int8)
    dims = ("a", "b")[: status.ndim]
    coords = {name: np.arange(float(n)) + 0.1 for name, n in zip(dims, status.shape, strict=True)}
    return xr.Dataset({"status": (dims, status), "method_used": (dims, used, FLAGS)}, coords)


def test_each_status_is_of_one_kind():
    found = {status.name: str(account(cells([status]))).partition(": ")[2] for status in Status}
    kinds = {name: text.replace("0 not asked", "") for name, text in found.items()}

    def one(kind):
        return {name for name, text in kinds.items() if f"1 {kind}" in text}

    assert one("ok") == {"OK"}
    assert one("pending") == {"PENDING"}
    assert one("not asked") == {"NOT_ASKED"}
    assert one("failed") == {"NOT_CONVERGED", "STEP_LIMIT", "NO_METHOD", "FAILED"}
    assert one("refused") == {s.name for s in Status if s.refused} - one("failed") - one("pending") - one("not asked")
    assert "BAD_INPUT" in one("refused")
    assert "INACCURATE" in one("remarks")
    assert account(cells([99])).failed == 1  # of a later version


def test_an_account_adds_up_and_tells_of_cells_not_asked_where_there_are():
    found = Account(1000, 20, 3, 4, 5, 6)
    assert found.total == 1038
    assert str(found) == "1,038 cells: 1,000 ok, 20 remarks, 3 refused, 4 failed, 5 pending, 6 not asked"
    assert str(Account(1, 0, 0, 0, 0)) == "1 cells: 1 ok, 0 remarks, 0 refused, 0 failed, 0 pending"


def test_the_first_cell_of_each_status_is_its_example():
    found = cells([[0, 64, 0], [1, 64, 1]])
    counts = count_statuses(found)
    assert [(c.name, c.cells, c.total) for c in counts] == [("OK", 2, 6), ("INACCURATE", 2, 6), ("BAD_INPUT", 2, 6)]
    assert [c.example for c in counts] == [{}, {"a": "1.1", "b": "0.1"}, {"a": "0.1", "b": "1.1"}]
    assert [c.name for c in failures(found)] == ["INACCURATE", "BAD_INPUT"]
    assert str(counts[1]) == "2 of 6 cells: INACCURATE, e.g. a=1.1 b=0.1"
    assert str(StatusCount("OK", 2, 6)) == "2 of 6 cells: OK"
    assert cell_values(found, 5) == {"a": "1.1", "b": "2.1"}


@pytest.mark.parametrize("at_once", [1, 2, 3, 5, 6, 7])
def test_pieces_are_all_cells_in_their_order_and_no_larger_than_said(monkeypatch, at_once):
    monkeypatch.setattr(module, "CELLS_AT_ONCE", at_once)
    column = cells(np.arange(12).reshape(4, 3)).status
    pieces = list(flat_pieces(column))
    assert np.concatenate(pieces).tolist() == list(range(12))
    assert max(map(len, pieces)) == {1: 1, 2: 2, 3: 3, 5: 3, 6: 6, 7: 6}[at_once]
    assert np.concatenate(list(flat_pieces(cells([7])["status"].isel(a=0)))).tolist() == [7]
    failed = cells([[int(Status.FAILED)] * 3, [0, 0, int(Status.FAILED)]])
    assert failed_cells(failed, 9) == [0, 1, 2, 5]
    assert failed_cells(failed, 2) == [0, 1]
    assert failed_cells(failed, 0) == []


def test_methods_are_counted_and_none_is_left_out():
    assert count_methods(cells([0, 0, 0, 64], [1, 0, 1, -1])) == {"map": 1, "closed": 2}
    text = "4 cells: 3 ok, 0 remarks, 1 refused, 0 failed, 0 pending; solved by map 1, closed 2"
    found = summary_text(cells([0, 0, 0, 64], [1, 0, 1, -1]))
    assert found == f"{text}\n1 of 4 cells: BAD_INPUT, e.g. a=3.1"
    assert summary_text(cells([64], [-1])).startswith("1 cells: 0 ok, 0 remarks, 1 refused, 0 failed, 0 pending\n")


def test_words_of_flags():
    assert flag_words(cells([0]).method_used) == {-1: "none", 0: "map", 1: "closed"}
    assert flag_words(cells([0]).status) == {}
    # of a result that another program made -1 is none, too
    flags = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "map closed"}
    assert flag_words(xr.DataArray(0, attrs=flags)) == {-1: "none", 0: "map", 1: "closed"}


def test_pieces_of_no_cells_are_none():
    assert [piece.size for piece in flat_pieces(xr.DataArray(np.zeros((3, 0))))] == [0]


def test_a_summary_is_summed_over_all_it_keeps():
    columns = {
        "cells_by_status": (("a", "status_name"), [[2, 0, 1], [3, 0, 0]]),
        "cells_by_method": (("a", "method_name"), [[1, 2], [0, 3]]),
    }
    found = xr.Dataset(columns, {"status_name": ["OK", "FAILED", "BAD_INPUT"], "method_name": ["none", "map"]})
    assert module.tally(found) == {"OK": 5, "BAD_INPUT": 1}
    assert count_methods(found) == {"map": 5}
    assert (account(found).total, account(found).refused) == (6, 1)
    assert [(c.name, c.cells, c.total) for c in count_statuses(found)] == [("OK", 5, 6), ("BAD_INPUT", 1, 6)]
