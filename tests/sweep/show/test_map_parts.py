"""Parts of a map and of a chart of precision, by what the axes hold: runs of cells, names of regions, marks, floors."""

import matplotlib.colors
import numpy as np
import pytest
import xarray as xr

from sweep.show import charts
from sweep.show.charts import COLOURS, FLAGGED, MARKS, draw_precision, new_figure, precision_marks
from sweep.show.plot import plot


@pytest.fixture
def axes():
    with charts.style():
        yield new_figure(100, 80).subplots()


def test_a_run_of_cells_side_by_side_is_one_rectangle():
    corners = [np.array([0.0, 1.0, 2.0, 4.0]), np.array([10.0, 20.0, 40.0])]
    here = np.array([[True, False, True], [True, True, False]])
    assert list(charts._runs(corners, here)) == [
        [(0, 10), (1, 10), (1, 20), (0, 20)],
        [(2, 10), (4, 10), (4, 20), (2, 20)],
        [(0, 20), (2, 20), (2, 40), (0, 40)],
    ]


def test_a_region_is_named_where_it_is_widest(axes):
    corners = [np.arange(-1.0, 20.0), np.geomspace(1.0, 2.0**20, 21)]
    here = np.zeros((20, 20), bool)
    here[:5, :] = True
    here[:, :9] = True
    assert charts._name(axes, corners, here, "REFUSED")
    (text,) = axes.texts
    x, y = text.get_position()
    assert x == 3.5  # the middle of cell 4
    assert here[round(np.log2(y) - 0.5), 4]
    assert (text.get_text(), text.get_ha(), text.get_va()) == ("REFUSED", "center", "center")
    assert (text.get_fontsize(), text.get_zorder()) == (7, 5)


@pytest.mark.parametrize(("width", "named"), [(3, False), (5, True)])
def test_a_region_is_named_from_a_width_of_a_fifth_of_the_map_on(axes, width, named):
    """In the middle of 3 columns of 20 the edge is 2 cells away, of 5 columns 3 (2.2 are needed)."""
    corners = [np.arange(21.0), np.arange(21.0)]
    here = np.zeros((20, 20), bool)
    here[:, 8 : 8 + width] = True
    assert charts._name(axes, corners, here, "x") is named
    assert len(axes.texts) == named
    if named:
        assert axes.texts[0].get_position()[0] == 10.5


def test_distances_on_a_map_are_those_of_the_picture_not_of_cells(axes):
    """Of 40 columns and 10 rows a column is a quarter as wide as a row is high: 5 columns are 0.75 rows to the edge."""
    corners = [np.arange(41.0), np.arange(11.0)]
    here = np.zeros((10, 40), bool)
    here[:, 10:15] = True
    assert not charts._name(axes, corners, here, "x")
    here[:, 10:19] = True
    assert charts._name(axes, corners, here, "x")


def family(n, values=lambda k: 1.0 + k, status=()):
    x = np.linspace(1.0, 2.0, 7)
    y = np.array([np.full(7, float(values(k))) for k in range(n)])
    codes = np.zeros((n, 7), np.int8)
    for row, column, code in status:
        codes[row, column] = code
    flags = {"flag_values": np.array([0, 1, 64], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT"}
    columns = {"y": (("k", "x"), y), "status": (("k", "x"), codes, flags)}
    return xr.Dataset(columns, {"x": x, "k": [f"k{i}" for i in range(n)]})


def test_colours_and_dashes_begin_anew_after_the_last():
    lines = plot(family(9)).axes[0].lines
    assert [line.get_color() for line in lines] == [*COLOURS, *COLOURS[:2]]
    styles = [str(line._dash_pattern) for line in lines]
    assert styles[:4] == styles[4:8]
    assert len(set(styles[:4])) == 4


def test_points_of_a_zip_are_marked_and_their_legend_is_outside():
    zipped = family(1, status=[(0, 2, 1)]).isel(k=0, drop=True).rename_dims(x="cell").reset_index("x")
    figure = plot(zipped)
    (axes,) = figure.axes
    first, flagged, *_ = axes.lines
    assert (first.get_linestyle(), first.get_marker(), first.get_markersize()) == ("None", MARKS[0], 2.5)
    assert flagged.get_xdata().tolist() == [zipped.x.values[2]]
    assert axes.get_legend() is None
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["INACCURATE"]


def test_each_status_has_a_mark_and_a_colour_of_its_own():
    marked = plot(family(2, status=[(0, 1, 1), (1, 3, 64), (1, 4, 5)])).axes[0]
    named = {line.get_label(): (line.get_marker(), line.get_color()) for line in marked.lines}
    assert named["INACCURATE"] == ("o", FLAGGED[0])
    assert named["5"] == ("s", FLAGGED[1])
    assert named["BAD_INPUT"] == ("D", FLAGGED[2])


def test_a_value_that_is_not_positive_is_at_the_foot_of_a_logarithm_alone():
    for values, on_the_line in ((lambda k: 10.0 ** (3 * k), True), (lambda k: -1.0 - k, True)):
        axes = plot(family(2, values, [(0, 1, 1)])).axes[0]
        first = next(line for line in axes.lines[2:] if len(line.get_xdata()))
        assert (first.get_transform() == axes.transData) is on_the_line


def test_a_map_of_a_narrow_range_has_linear_colours():
    wide = xr.Dataset({"y": (("a", "b"), np.arange(1.0, 101).reshape(10, 10))}, {n: np.arange(1.0, 11) for n in "ab"})
    assert isinstance(plot(wide).axes[0].collections[0].norm, matplotlib.colors.LogNorm)
    assert not isinstance(plot(wide + 1).axes[0].collections[0].norm, matplotlib.colors.LogNorm)


def test_a_map_along_a_single_value_is_a_column_around_it():
    one = xr.Dataset({"y": (("a", "b"), np.arange(9.0).reshape(1, 9))}, {"a": [3.0], "b": np.arange(9.0)})
    corners = plot(one, x="a").axes[0].collections[0].get_coordinates()
    assert corners[0, :, 0].tolist() == [2.5, 3.5]
    assert corners[:, 0, 1].tolist() == [k - 0.5 for k in range(10)]


# charts of precision


def precision(**changes):
    """Three methods at two tolerances: right, with refused cells, silent; the last solves nothing."""
    columns = {
        "seconds": [[1e-6, 2e-6], [3e-6, 4e-6], [5e-6, 6e-6], [1e-6, 1e-6]],
        "error_median": [[1e-5, 1e-9], [0.0, 1e-3], [1e-2, 50.0], [np.nan, np.nan]],
        "error_worst": [[1e-4, 1e-8], [1e-3, 1e-2], [1e-1, 90.0], [np.nan, np.nan]],
        "error_low": [[1e-6, 0.0], [1e-6, 1e-6], [1e-6, 1e-6], [np.nan, np.nan]],
        "error_high": [[1e-4, 1e-8], [1e-2, 9.0], [1e-1, 80.0], [np.nan, np.nan]],
        "unsolved": [[0, 0], [0.2, 0], [0, 0], [1, 1]],
        "inaccurate": [[0, 0], [0, 0], [0, 0.3], [0, 0]],
        "silent": [[0, 0], [0, 0], [0.1, 0], [0, 0]],
    }
    attrs = {"reference": "exact", "reference_error": 2e-12, "cells": 9, "title": "A $ stone"}
    names = ["right", "shy", "liar", "idle"]
    found = xr.Dataset(
        {n: (("method", "rtol"), np.array(c, float)) for n, c in columns.items()}, {"method": names}, attrs
    )
    return found.assign(**changes)


def test_filled_open_and_crossed_marks_are_where_cells_are_solved_refused_and_wrong(axes):
    draw_precision(axes, precision(), "error_median")
    lines = axes.lines
    assert [line.get_label() for line in lines[::3]] == ["right", "shy", "liar"]
    assert [line.get_markevery().tolist() for line in lines[::3]] == [[True, True], [False, True], [True, False]]
    assert [line.get_xdata().tolist() for line in lines[1::3]] == [[], [3e-6], [6e-6]]
    assert [line.get_ydata().tolist() for line in lines[1::3]] == [[], [1e-17], [3.0]]
    assert [line.get_xdata().tolist() for line in lines[2::3]] == [[], [], [5e-6]]
    assert [line.get_ydata().tolist() for line in lines[2::3]] == [[], [], [1e-2]]
    assert [line.get_color() for line in lines[::3]] == list(COLOURS[:3])
    assert [line.get_marker() for line in lines[::3]] == list(MARKS[:3])
    assert {line.get_markerfacecolor() for line in lines[1::3]} == {"white"}


def test_looks_begin_anew_after_the_last(axes):
    many = precision().isel(method=[0] * 9).assign_coords({"method": [f"m{k}" for k in range(9)]})
    draw_precision(axes, many, "error_worst")
    lines = axes.lines[::3]
    assert [line.get_color() for line in lines] == [*COLOURS, *COLOURS[:2]]
    assert [line.get_marker() for line in lines] == [*MARKS, MARKS[0]]
    assert [str(line._dash_pattern) for line in lines[:4]] == [str(line._dash_pattern) for line in lines[4:8]]
    assert [charts._look(k, False)["marker"] for k in (0, 1, 8, 9)] == [*MARKS[:2]] * 2


def test_bars_reach_over_the_middle_of_the_cells_and_stay_in_the_chart(axes):
    draw_precision(axes, precision(), "error_median")
    ends = [collection.get_segments() for collection in axes.collections]
    assert [[segment[:, 1].tolist() for segment in bars] for bars in ends] == [
        [[1e-6, 1e-4], [1e-17, 1e-8]],
        [[1e-6, 1e-2], [1e-6, 3.0]],
        [[1e-6, 1e-1], [1e-6, 3.0]],
    ]
    assert ends[0][1][:, 0].tolist() == [2e-6, 2e-6]


def test_the_worst_cell_has_no_bars(axes):
    draw_precision(axes, precision(), "error_worst")
    assert not axes.collections
    assert axes.lines[0].get_ydata().tolist() == [1e-4, 1e-8]


@pytest.mark.parametrize(("floor", "top"), [(2e-12, 2e-12), (0.0, 1e-17)])
def test_the_grey_floor_is_what_the_reference_is_right_to(axes, floor, top):
    draw_precision(axes, precision().assign_attrs(reference_error=floor), "error_worst")
    (grey,) = axes.patches
    assert (grey.get_y(), grey.get_y() + grey.get_height()) == pytest.approx((5e-18, top), rel=1e-12)
    assert axes.get_ylim() == (5e-18, 10.0)
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert axes.get_xlabel() == "time per cell on one core [s]"


def test_a_reference_of_unknown_error_has_no_floor(axes):
    found = precision()
    del found.attrs["reference_error"]
    draw_precision(axes, found, "error_worst")
    assert not axes.patches
    assert "below what the reference is right to" not in precision_marks(found)


def test_the_legend_names_the_marks_that_occur():
    solved, some, silent, middle, below = (
        "all cells solved", "some unsolved or inaccurate", "some silently wrong", "middle 80 % of the cells",
        "below what the reference is right to",
    )  # fmt: skip
    found = precision()
    marks = precision_marks(found)
    assert list(marks) == [solved, some, silent, middle, below]
    assert marks[some].get_markerfacecolor() == "white"
    assert marks[solved].get_markerfacecolor() == "0.3"
    assert (marks[silent].get_marker(), marks[middle].get_marker()) == ("x", "|")
    none = found.unsolved * 0
    assert some in precision_marks(found.assign(inaccurate=none))
    assert some in precision_marks(found.assign(unsolved=none))
    bare = found.assign(unsolved=none, inaccurate=none, silent=none).drop_vars("error_high")
    assert list(precision_marks(bare)) == [solved, below]


def test_the_note_says_what_errors_are_against_and_who_is_idle_or_wrong():
    note = " ".join(charts._note(precision().assign_attrs(missing="ida is not installed")))
    basis = r"Errors against exact, itself right to 2e-12, in 9 cells of: A \$ stone"
    assert note == f"{basis}; ida is not installed; idle solves no cell; liar is silently wrong."
    assert all(len(line) <= 145 for line in charts._note(precision().assign_attrs(title="very " * 80 + "long")))


def test_both_panels_share_a_width_of_at_least_thirty_times():
    figure = plot(precision())
    median, worst = figure.axes
    low, high = median.get_xlim()
    assert high / low == pytest.approx(30)
    assert worst.get_xlim() == (low, high)
    assert low * high == pytest.approx(6e-12, rel=1e-6)  # 1 to 6 microseconds are in its middle
    assert (median.get_title(), worst.get_title()) == ("median cell", "worst cell")
    assert (median.get_title("left"), worst.get_title("left")) == ("(a)", "(b)")
    assert (median.get_ylabel(), worst.get_ylabel()) == ("relative error [1]", "")
    long = precision(seconds=precision().seconds * [[1.0], [1.0], [100.0], [1.0]])
    low, high = plot(long).axes[0].get_xlim()
    assert low < 1e-6 < 6e-4 < high < 2e-3
    assert figure.get_size_inches().tolist() == pytest.approx([178 / 25.4, (96 + 3.2) / 25.4])
