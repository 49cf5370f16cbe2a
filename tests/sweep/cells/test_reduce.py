"""Summaries against numpy on the cells that a study without one keeps."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from running import quiet, same
from toy_studies import build

from sweep.cells.partition import Partition, row_blocks
from sweep.cells.reduce import tree_sum

EVERYTHING = ["min", "max", "mean", "argmin", "argmax", "histogram"]
OVER = st.sampled_from([("height", "v0"), ("height",), ("v0",)])


def long_study(over):
    """12,000 cells, so that row blocks are shorter than groups; a tenth of them are refused."""
    rng = np.random.default_rng(5)
    heights = rng.lognormal(size=2000)
    heights[rng.random(2000) < 0.1] *= -1
    outputs, edges = {"fall_time": EVERYTHING}, {"fall_time": [1e-3, 0.1, 1.0, 2.0]}
    axes = {"height": heights, "v0": [0.0, 0.5, 3.0, 1e-9, 1e4, 2.0]}
    return build(axes=axes, summary={"over": list(over), "outputs": outputs, "edges": edges})


@pytest.fixture(scope="module")
def long():
    return {over: quiet(long_study(over)) for over in (("height", "v0"), ("height",), ("v0",))}


@settings(max_examples=9, deadline=None)
@given(over=OVER, cells=st.integers(400, 12_000), workers=st.integers(1, 4))
def test_the_same_bits_for_any_block_shape_and_thread_count(tmp_path_factory, long, over, cells, workers):
    path = tmp_path_factory.mktemp("run") / "out.h5"
    with quiet(long_study(over), path, workers=workers, block_cells=cells) as found:
        same(found, long[over])


def test_edges_of_bins_may_be_spaced_as_axes_are_and_in_another_unit():
    edges = {"fall_time": {"spacing": "log", "start": 100, "stop": 1e4, "num": 3, "unit": "ms"}}
    summary = {"outputs": {"fall_time": ["histogram"]}, "edges": edges}
    found = quiet(build(axes={"height": [1.0, 2.0, -1.0]}, summary=summary))
    np.testing.assert_array_equal(found.fall_time_bin_lower, [0.1, 1.0])
    np.testing.assert_array_equal(found.fall_time_bin_upper, [1.0, 10.0])
    assert found.fall_time_histogram.values.tolist() == [2, 0]


@given(st.lists(st.floats(allow_nan=False, width=64, min_value=-1e300, max_value=1e300), min_size=1, max_size=70))
def test_the_tree_sum_is_right_to_twice_the_digits(numbers):
    total, rest = tree_sum(np.array([numbers]))
    exact = sum(map(Fraction, numbers))
    size = sum(abs(Fraction(n)) for n in numbers)
    assert abs(Fraction(total[0]) + Fraction(rest[0]) - exact) <= size * Fraction(2) ** -98
    assert total[0] + rest[0] == pytest.approx(float(exact), abs=float(size) * 1e-29, rel=2.3e-16)


@given(
    groups=st.integers(1, 9),
    group=st.integers(1, 60),
    length=st.integers(1, 70),
    room=st.integers(1, 80),
    data=st.data(),
)
def test_strips_cover_the_rows_and_are_cut_at_the_same_places(groups, group, length, room, data):
    blocks = Partition(groups * group, min(length, group), group)
    edges = [blocks.first(row) for row in range(blocks.count + 1)]
    assert edges[-1] == blocks.size
    assert all(b > a for a, b in itertools.pairwise(edges))
    assert set(range(0, blocks.size + 1, group)) <= set(edges)
    start = data.draw(st.integers(0, blocks.count - 1))
    stop = data.draw(st.integers(start + 1, blocks.count))
    at = edges[start]
    for row, rows, cell, cells in blocks.strips(start, stop, room):
        assert cell == at
        assert rows * cells <= room
        if rows > 1:
            assert edges[row : row + rows + 1] == list(range(cell, cell + rows * cells + 1, cells))
        assert edges[row] <= cell < edges[row + 1]
        assert (cell - edges[row]) % room == 0
        at += rows * cells
    assert at == edges[stop]


def test_of_equal_extremes_the_first_cell_is_told():
    """`rough` does not heed the speed: all cells of a height are equal, over many row blocks."""
    speeds = np.arange(3000.0, 0.0, -1.0)
    study = build(axes={"height": [2.0], "v0": speeds}, method="rough", rtol=0.9, summary={})
    found = quiet(study)
    assert row_blocks(study).per_row > 1
    assert (found.fall_time_argmin_v0, found.fall_time_argmax_v0) == (3000.0, 3000.0)
