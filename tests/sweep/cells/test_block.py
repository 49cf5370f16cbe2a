"""Blocks of a study: their rows, cells and columns, what solves them, and what a fault in them says."""

from dataclasses import replace

import numpy as np
import pytest
import toy
from toy_studies import build

from sweep.cells import block as module
from sweep.cells.block import (
    Blocks,
    Computed,
    block_solver,
    faults_reported,
    row_shape,
    sampled_by,
    sampled_study,
    warm,
)
from sweep.cells.compiling import Compiling
from sweep.cells.partition import Partition
from sweep.cells.timing import Sample
from sweep.system.errors import SweepError

AXES = {"height": np.arange(1.0, 6.0), "v0": [0.0, 1.0]}
SUMMARY = {"over": ["v0"], "outputs": {"fall_time": ["min"]}}


def test_blocks_of_cells():
    blocks = Blocks(build(axes=AXES), Partition(10, 4))
    assert (blocks.count, blocks.row_bytes) == (3, 8 + 4 + 1 + 1)
    assert [blocks.bounds(k) for k in range(3)] == [blocks.cells(k) for k in range(3)] == [(0, 4), (4, 8), (8, 10)]
    assert blocks.label(1) == "cells 4 to 8"
    found = blocks.empty()
    assert {name: (column.dtype, column.shape) for name, column in found.items()} == {
        "fall_time": (np.float64, (4,)), "error_bound": (np.float32, (4,)),
        "status": (np.int8, (4,)), "method_used": (np.int8, (4,)),
    }  # fmt: skip
    assert len(blocks.empty(2)["status"]) == 2
    assert len(blocks.empty(0)["status"]) == 0
    assert len(Blocks(build(axes=AXES), Partition(10, 40)).empty()["status"]) == 10


def test_blocks_of_a_summary_are_of_rows():
    study = build(axes=AXES, summary=SUMMARY)
    blocks = Blocks(study, Partition(5, 2))
    assert [blocks.bounds(k) for k in range(3)] == [(0, 2), (2, 4), (4, 5)]
    assert [blocks.cells(k) for k in range(3)] == [(0, 4), (4, 8), (8, 10)]
    assert blocks.label(2) == "cells 8 to 10"
    assert "fall_time min" in blocks.empty()
    assert row_shape(study) == (5,)
    assert row_shape(build(axes=AXES)) == (5, 2)


def test_what_is_computed_is_begun_at_once_and_good_unless_more_is_said():
    found = Computed(3, b"", 1.5)
    assert (found.ago, found.bad) == (0.0, ())


class Recorded:
    """A solver that fills its cells with one number, or raises where it is told to."""

    def __init__(self, *bad):
        self.calls, self.bad = [], bad

    def solve(self, start, cells, wanted=None):
        self.calls.append((start, cells.number, wanted))
        if start in self.bad:
            raise ValueError("no")
        for column in (*cells.outputs.values(), cells.status, cells.used):
            column[:] = 1 if column.dtype == np.int8 else 2.5


def test_a_block_of_cells_is_solved_with_what_is_wanted():
    study, solver = build(axes=AXES), Recorded()
    arrays, wanted = Blocks(study, Partition(10, 4)).empty(), np.array([True, False, True, True])
    block_solver(study, solver)(4, 8, arrays, wanted)
    assert [call[:2] for call in solver.calls] == [(4, 4)]
    assert solver.calls[0][2] is wanted
    assert arrays["fall_time"].tolist() == [2.5] * 4
    assert arrays["status"].tolist() == [1] * 4


def test_a_block_of_a_summary_reduces_its_cells():
    study, solver = build(axes=AXES, summary=SUMMARY), Recorded()
    arrays = Blocks(study, Partition(5, 2)).empty()
    block_solver(study, solver)(2, 4, arrays, None)
    assert sum(call[1] for call in solver.calls) == 4
    assert arrays["fall_time min"].tolist() == [2.5, 2.5]


def test_a_block_is_solved_by_the_kernel_where_nothing_else_is_said():
    study = build(axes=AXES)
    arrays = Blocks(study, Partition(10, 10)).empty()
    block_solver(study)(0, 10, arrays, None)
    expected = 2 * np.repeat(AXES["height"], 2)
    v0 = np.tile(AXES["v0"], 5)
    oracle = expected / (v0 + np.sqrt(v0**2 + 9.80665 * expected))
    np.testing.assert_allclose(arrays["fall_time"], oracle, rtol=1e-14)


@pytest.mark.parametrize(
    ("keys", "cells"),
    [
        ({"method": "exact"}, [4]),
        ({}, [4, 0, 9]),
        ({"axes": {"height": [1.0, 2.0], "method": ["exact", "rough"]}}, [1, 0, 3]),
        ({"axes": {"height": [1.0]}}, [0]),
        ({"axes": {"height": [1.0, 2.0]}}, [0, 1]),
    ],
)
def test_several_methods_are_tried_in_the_middle_and_in_corners(keys, cells):
    solver = Recorded(4, 9)
    warm(solver, build(**{"axes": AXES, **keys}))
    assert [call[:2] for call in solver.calls] == [(cell, 1) for cell in cells]


@pytest.mark.parametrize("method", ["a", "z"])
def test_one_method_is_tried_in_the_middle_whatever_its_name(method):
    solver = Recorded()
    warm(solver, replace(build(axes=AXES), method=method))
    assert [call[:2] for call in solver.calls] == [(4, 1)]


def test_a_sample_is_of_all_cells_and_that_of_a_summary_costs_its_reduction(monkeypatch):
    asked = []

    def sample(solver, columns, size, clock):
        asked.append(([column.name for column in columns], size, clock()))
        return Sample(np.zeros(1), np.array([1.0, 2.0]), 1, np.zeros(1, "i1"), np.zeros(1, "i1"))

    monkeypatch.setattr(module, "take_sample", sample)
    monkeypatch.setattr(module.Reducer, "seconds", lambda self: 0.5)
    assert sampled_by(Recorded(), build(axes=AXES), lambda: 7.0).costs.tolist() == [1.0, 2.0]
    assert sampled_by(Recorded(), build(axes=AXES, summary=SUMMARY), lambda: 7.0).costs.tolist() == [1.5, 2.5]
    assert asked == 2 * [(["fall_time", "error_bound", "status", "method_used"], 10, 7.0)]


def test_a_kernel_that_always_fails_is_told_with_its_name():
    with pytest.raises(SweepError) as caught:
        sampled_by(Recorded(*range(10)), build(axes=AXES), lambda: 0.0)
    assert str(caught.value) == "toy:KERNEL: the kernel failed (ValueError: no); what is finished is kept"


def test_what_compiling_took_is_remembered_after_the_sample():
    done = []

    class Watched(Compiling):
        def remember(self):
            done.append("remembered")

    def check(*columns):
        done.append("checked")
        toy.check(*columns)

    study = build(axes=AXES)
    watched = Watched(replace(toy.KERNEL, check=check), "toy:KERNEL")
    assert sampled_study(study, watched).cost > 0
    assert set(done) == {"checked", "remembered"}
    assert done[-1] == "remembered"
    assert sampled_study(study).cost > 0


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (SweepError("a line"), "a line"),
        (MemoryError(), "out of memory; fewer workers need less; what is finished is kept"),
        (ValueError("a\nb"), "cell 3 (ValueError: a b); what is finished is kept"),
    ],
)
def test_every_fault_is_a_line(fault, text):
    with pytest.raises(SweepError) as caught, faults_reported("cell 3"):
        raise fault
    assert str(caught.value) == text
    assert (caught.value is fault) is isinstance(fault, SweepError)
