"""How a grid is cut, against cutting lists by hand: blocks within rows of a box, lengths of boxes, and row blocks."""

import itertools
import math

import numpy as np
import pytest
from toy_studies import build

from sweep.cells import partition
from sweep.cells.partition import Partition, RowBlocks, RowStrip, box_shape, boxes, row_blocks


def cut(size, cells, row):
    """Every row of the numbers from 0 on, cut into pieces of so many."""
    rows = [range(k, k + row) for k in range(0, size, row)] if row else [range(size)]
    return [(r[a], r[min(a + cells, len(r)) - 1] + 1) for r in rows for a in range(0, len(r), cells)]


@pytest.mark.parametrize(
    ("size", "cells", "row"),
    [(12, 5, 0), (12, 5, 6), (12, 3, 6), (12, 12, 0), (12, 12, 12), (30, 4, 10), (7, 1, 0), (1, 1, 0), (24, 7, 8)],
)
def test_each_row_is_cut_by_itself_and_its_last_block_is_shorter(size, cells, row):
    blocks, oracle = Partition(size, cells, row), cut(size, cells, row)
    assert blocks.count == len(oracle)
    assert [blocks.bounds(k) for k in range(blocks.count)] == oracle
    assert blocks.edges.tolist() == [start for start, _ in oracle] + [size]
    numbers = [k for k, (start, stop) in enumerate(oracle) for _ in range(start, stop)]
    assert [blocks.index(cell) for cell in range(size)] == numbers
    assert blocks.index(np.arange(size)).tolist() == numbers


def run_of(length, inner, most, unit):
    """The longest run up to `most` that wastes a tenth at most and few lanes; else the next longer one."""
    good = [n for n in range(1, length + 1) if math.ceil(length / n) * n <= 1.1 * length]
    shorter = [n for n in good if most // 2 < n <= most]
    if not shorter:
        return min(n for n in good if n > most)
    idle = {n: max(math.ceil(n * inner / unit) * unit / (n * inner), 1.01) for n in shorter}
    return max(n for n in shorter if idle[n] == min(idle.values()))


@pytest.mark.parametrize("unit", [1, 8, 32])
@pytest.mark.parametrize("shape", [(40,), (97,), (6, 40), (100, 3), (5, 1, 30, 2), (7, 7, 7)])
def test_boxes_are_whole_trailing_axes_and_a_run_of_one(shape, unit):
    for wanted in range(1, math.prod(shape) + 2, 3):
        found = boxes(shape, wanted, unit)
        axis = next((k for k in range(len(shape)) if math.prod(shape[k:]) <= wanted), len(shape))
        if axis == 0:
            assert found == Partition(math.prod(shape), math.prod(shape))
            continue
        inner, length = math.prod(shape[axis:]), shape[axis - 1]
        run = run_of(length, inner, max(1, wanted // inner), unit)
        assert found == Partition(math.prod(shape), inner * run, inner * length), wanted
        assert box_shape(shape, found.cells) == (*[1] * (axis - 1), run, *shape[axis:])


def test_a_box_of_no_cell_wanted_is_one_of_one_cell():
    assert boxes((5, 7), 0) == Partition(35, 1, 7)
    assert boxes((), 5) == Partition(1, 1)
    assert box_shape((), 1) == ()
    assert box_shape((5, 7), 35) == (5, 7)
    assert {type(length) for length in box_shape((5, 7), 14)} == {int}


def test_only_so_many_lengths_of_a_box_are_looked_at(monkeypatch):
    """100 cells fill lanes of 20, longer boxes do not."""
    assert boxes((1000,), 105, 20).cells == 100
    monkeypatch.setattr(partition, "MOST_TRIED", 5)
    assert boxes((1000,), 105, 20).cells == 105
    assert boxes((1000,), 104, 20).cells == 100


def test_few_idle_lanes_are_not_worth_a_smaller_box():
    # of 640 to 651 cells as many lanes of 32 are idle as of 21 / 20; 639 leave one idle, which is nothing
    assert boxes((100_000,), 639, 32).cells == 639
    assert boxes((100_000,), 634, 32).cells == 634
    assert boxes((100_000,), 633, 32).cells == 608


ROWS = [RowBlocks(3, 10, 4), RowBlocks(3, 8, 4), RowBlocks(4, 5, 5), RowBlocks(1, 9, 2), RowBlocks(5, 1, 1)]


def rows_of(blocks):
    """The cells of each row."""
    groups = [range(k * blocks.group, (k + 1) * blocks.group) for k in range(blocks.groups)]
    return [g[a : a + blocks.length] for g in groups for a in range(0, blocks.group, blocks.length)]


@pytest.mark.parametrize("blocks", ROWS)
def test_groups_are_cut_into_rows(blocks):
    rows = rows_of(blocks)
    assert (blocks.count, blocks.size) == (len(rows), sum(map(len, rows)))
    assert blocks.per_group == len(rows) // blocks.groups
    assert blocks.mean == pytest.approx(np.mean([len(row) for row in rows]))
    assert [blocks.first(k) for k in range(len(rows))] == [row[0] for row in rows]
    assert blocks.first(np.arange(len(rows) + 1)).tolist() == [*(row[0] for row in rows), blocks.size]
    assert blocks.cells(1, blocks.count) == (rows[1][0], blocks.size)


@pytest.mark.parametrize("blocks", ROWS)
@pytest.mark.parametrize("capacity", [1, 2, 3, 4, 5, 8, 9, 100])
def test_strips_are_rows_of_equal_length_that_fit_or_pieces_of_one(blocks, capacity):
    rows = rows_of(blocks)
    for start, stop in itertools.combinations(range(blocks.count + 1), 2):
        row, oracle = start, []
        while row < stop:
            cell, cells = rows[row][0], len(rows[row])
            if cells > capacity:
                oracle += [RowStrip(row, 1, c, min(capacity, cell + cells - c)) for c in rows[row][::capacity]]
                row += 1
                continue
            # a strip ends with the group where that is several rows
            last = stop if blocks.per_group == 1 else min(stop, (row // blocks.per_group + 1) * blocks.per_group)
            alike = len([*itertools.takewhile(lambda r, cells=cells: len(r) == cells, rows[row:last])])
            oracle.append(RowStrip(row, min(alike, capacity // cells), cell, cells))
            row += oracle[-1].rows
        assert list(blocks.strips(start, stop, capacity)) == oracle


def test_strips_by_hand():
    assert list(RowBlocks(3, 10, 4).strips(0, 6, 8)) == [
        RowStrip(0, 2, 0, 4), RowStrip(2, 1, 8, 2), RowStrip(3, 2, 10, 4), RowStrip(5, 1, 18, 2),
    ]  # fmt: skip
    assert list(RowBlocks(3, 10, 4).strips(1, 3, 3)) == [
        RowStrip(1, 1, 4, 3), RowStrip(1, 1, 7, 1), RowStrip(2, 1, 8, 2)
    ]  # fmt: skip
    # groups that are a row each follow each other
    assert list(RowBlocks(4, 5, 5).strips(1, 4, 12)) == [RowStrip(1, 2, 5, 5), RowStrip(3, 1, 15, 5)]


def study_of(groups, group):
    axes = {"v0": np.linspace(0.0, 1.0, groups), "height": np.linspace(1.0, 2.0, group)}
    return build(axes=axes, summary={"over": ["height"], "outputs": {"fall_time": ["min"]}})


@pytest.mark.parametrize(
    ("groups", "group", "length"),
    [
        (3, 4, 4),
        (3, 5, 1),  # of few cells each is a row, unless a group has four at most
        (1, 2047, 1),
        (1, 2048, 2),  # 1024 rows
        (1, 4095, 2),
        (1, 4096, 4),
        (256, 8, 8),  # 2048 cells in rows of two; a group of four rows stays whole
        (256, 9, 2),
        (512, 16, 16),
        (128, 33, 4),
    ],
)
def test_a_study_is_cut_into_about_a_thousand_rows_and_short_groups_are_not_cut(groups, group, length):
    found = row_blocks(study_of(groups, group))
    assert (found.groups, found.group, found.length) == (groups, group, length)


def test_rows_of_dear_cells_are_not_longer_than_the_longest(monkeypatch):
    monkeypatch.setattr(partition, "LARGEST", 2)
    assert row_blocks(study_of(1, 9 * 1024)).length == 2
    monkeypatch.setattr(partition, "LARGEST", 1 << 22)
    assert row_blocks(study_of(1, 9 * 1024)).length == 8


def test_a_row_of_a_huge_study_has_four_million_cells():
    axes = {"v0": np.linspace(0.0, 1.0, 100_000), "height": np.linspace(1.0, 2.0, 100_000)}
    study = build(axes=axes, summary={"over": ["v0", "height"], "outputs": {"fall_time": ["min"]}})
    assert row_blocks(study).length == 4_194_304


def test_of_a_study_without_a_summary_every_cell_is_a_row():
    assert row_blocks(build(axes={"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0]})) == RowBlocks(6, 1, 1)
