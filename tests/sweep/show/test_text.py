"""What is told of a result: where on the axes a status occurs, and what is picked from it."""

import numpy as np
import pytest
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.results.statuses import summary_text
from sweep.show import text as report
from sweep.show.laws import laws, laws_text, pick
from sweep.show.text import result_text


@pytest.fixture
def product():
    """31 heights by 4 speeds, of which two are refused."""
    axes = {"height": {"spacing": "log", "start": 1, "stop": 1000, "num": 31}, "v0": [0.0, 1.0, -1.0, np.nan]}
    return sweep.run(build(axes=axes, outputs=["fall_time", "impact_speed"]), progress=False)


@pytest.fixture
def zipped():
    """Six cells: two speeds at three heights."""
    axes = {"height": [1.0, 1.0, 2.0, 2.0, 4.0, 4.0], "v0": [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]}
    return sweep.run(build(axes=axes, design="zip"), progress=False)


@pytest.mark.parametrize("at_once", [1, 4, 12, 1 << 22])
def test_a_status_is_told_with_the_part_of_each_axis_where_it_occurs(product, monkeypatch, at_once):
    monkeypatch.setattr(report, "CELLS_AT_ONCE", at_once)
    product.status[20:23, 1] = int(Status.NOT_CONVERGED)
    heights = product.height.values
    text = " ".join(result_text("x.h5", product).split())
    assert " 3 NOT_CONVERGED " in text
    assert f"height {heights[20]:.6g} to {heights[22]:.6g}, v0 1; e.g. height=100.0 v0=1.0" in text


def test_a_status_everywhere_is_told_so(product):
    product.status[:] = int(Status.NOT_CONVERGED)
    text = " ".join(result_text("x.h5", product).split())
    assert "at every value of every axis" in text


def test_a_status_in_a_zip_is_told_by_the_values_of_its_cells(zipped):
    zipped.status[2:5] = int(Status.NOT_CONVERGED)
    text = " ".join(result_text("x.h5", zipped).split())
    assert "height 2 to 4, v0 0 to 1; e.g. height=2.0 v0=0.0" in text


def test_the_share_that_is_done_is_told_and_never_rounded_up(product):
    product.status[:, 3] = int(Status.PENDING)
    assert "x.h5: unfinished: 93 of 124 cells (75 %)" in result_text("x.h5", product)
    product.status[:] = 0
    product.status[0, 0] = int(Status.PENDING)
    assert "123 of 124 cells (99.1 %)" in result_text("x.h5", product)


def test_a_result_without_trouble_is_summed_up_in_one_line(zipped):
    assert (
        summary_text(zipped)
        == "6 cells: 6 ok, 0 remarked, 0 refused, 0 unsolved, 0 FAILED, 0 pending; solved by rough 3, exact 3"
    )


def test_an_axis_of_words_is_told_by_its_words():
    dataset = sweep.run(build(axes={"height": [1.0, 2.0], "method": ["exact", "auto"]}), progress=False)
    assert "method  " in (text := result_text("x.h5", dataset))
    assert "exact, auto" in text


# picking


def test_a_value_picked_from_a_product_takes_its_dimension_away(product):
    part = pick(product, ["v0=1"])
    assert part.fall_time.dims == ("height",)
    assert float(part.v0) == 1.0


def test_a_value_picked_from_a_zip_keeps_all_its_cells(zipped):
    part = pick(zipped, ["v0=1"])
    assert part.height.values.tolist() == [1.0, 2.0, 4.0]
    assert (part.v0 == 1).all()


def test_a_value_as_it_was_printed_is_found_and_the_nearest_of_several_taken():
    values = [0.333330, 1 / 3, 0.333336]
    dataset = sweep.run(build(axes={"height": values}), progress=False)
    assert float(pick(dataset, ["height=0.333333"]).height) == 1 / 3


def test_a_word_is_picked_as_it_is_written():
    dataset = sweep.run(build(axes={"height": [1.0, 2.0], "method": ["exact", "auto"]}), progress=False)
    assert pick(dataset, ["method=auto"]).method.item() == "auto"
    with pytest.raises(sweep.SweepError, match='method has no such value; nearest is "exact" or "auto"'):
        pick(dataset, ["method=rough"])


def test_a_long_table_of_fits_is_cut_and_says_so():
    axes = {"height": [1.0, 2.0, 4.0, 8.0], "v0": np.linspace(0, 1, 50)}
    text = laws_text(laws(sweep.run(build(axes=axes), progress=False), "fall_time", "height"))
    assert "and 10 more; choose with --at axis=value" in text
