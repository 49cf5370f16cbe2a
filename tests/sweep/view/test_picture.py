"""The parts of a picture on a page: scales, ranges, pixels and rasters, colours and words."""

from importlib.util import find_spec

import numpy as np
import pytest
import xarray as xr

from sweep.show.charts import COLOURS
from sweep.show.view import view

pytestmark = pytest.mark.skipif(not find_spec("panel"), reason="the extra view is not installed")
if find_spec("panel"):
    from sweep.view import picture
    from sweep.view.picture import STATUS_COLOURS, Picture, Scales

FLAGS = {"flag_values": np.array([0, 1, 64], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT"}
AUTO = {"x": "auto", "y": "auto", "values": "auto"}


def seen(values, x, a=None, status=None):
    """A line, or lines or a map over a second axis."""
    dims = ("x",) if a is None else ("a", "x")
    values = np.asarray(values, float)
    status = np.zeros(values.shape) if status is None else np.asarray(status)
    columns = {"y": (dims, values, {"units": "s"}), "status": (dims, status.astype(np.int8), FLAGS)}
    return view(xr.Dataset(columns, {"x": x} | ({} if a is None else {"a": a})), x="x")


def a_map(low=1.0, high=3.0):
    return seen(np.linspace(low, high, 36).reshape(9, 4), [1.0, 10.0, 100.0, 1000.0], np.arange(9.0))


def test_scales_are_those_of_the_grids_and_values():
    assert Scales.of(a_map(), AUTO) == Scales(True, False, False)
    assert Scales.of(a_map(1, 1e3), AUTO) == Scales(True, False, True)
    assert Scales.of(seen([1.0, 1e3], [1.0, 2.0]), AUTO) == Scales(False, True)
    wanted = {"x": "linear", "y": "log", "values": "log"}
    assert Scales.of(a_map(), wanted) == Scales(False, True, True)
    assert Scales.of(seen([-1.0, 0.0], [1.0, 1000.0]), {**AUTO, "values": "log"}) == Scales(True, False)
    assert Scales.of(seen([-1.0, 1.0], [1.0, 1000.0]), {**AUTO, "x": "linear", "values": "log"}) == Scales(False, True)


def test_a_range_is_from_edge_to_edge_as_far_as_a_logarithm_reaches():
    def ends(grid, log):
        found = picture._range(np.array(grid), log)
        return found.start, found.end, found.reset_start, found.reset_end

    assert ends([3.0, 1.0, 2.0], False) == (0.5, 3.5, 0.5, 3.5)
    assert ends([0.0, 1.0, 2.0], True) == (1.0, 2.5, 1.0, 2.5)
    assert ends([0.0, 1.0, 2.0], False)[0] == -0.5
    assert ends([1.0, 10.0, 100.0], True) == pytest.approx((10**-0.5, 10**2.5) * 2)


def test_a_range_is_never_empty():
    assert picture._above(1.0, 2.0) == 2.0
    assert picture._above(2.0, 2.0) == 2.0 + 2e-6
    assert picture._above(-3.0, -4.0) == -3.0 + 3e-6
    assert picture._above(0.0, 0.0) == 1e-6


def test_pixels_are_in_the_middle_of_equal_parts():
    assert picture._pixels((0.0, 8.0), 4, False).tolist() == [1.0, 3.0, 5.0, 7.0]
    np.testing.assert_allclose(picture._pixels((1.0, 1e4), 2, True), [10.0, 1000.0], rtol=1e-14)


def test_a_raster_has_no_value_beside_the_grid():
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    found = picture._raster(values, np.array([-1, 0, 1]), np.array([0, 1, -1]))
    nan = np.nan
    np.testing.assert_array_equal(found, [[nan, nan, nan], [1.0, 2.0, nan], [3.0, 4.0, nan]])


def test_a_status_keeps_its_colour_in_all_slices():
    found = seen([1.0, 2.0], [1.0, 2.0])
    assert [picture.status_colour(found, code) for code in (0, 1, 64)] == list(STATUS_COLOURS[1:4])  # 0 is "none"


def test_words_of_an_axis_are_its_meaning_name_and_unit():
    found = seen([1.0, 2.0], [1.0, 2.0])
    assert picture.plain_label(found, "y") == "y [s]"
    assert picture.plain_label(found, "x") == "x"
    found.y.x.attrs.update(long_name="drive", units="1")
    assert picture.plain_label(found, "x") == "drive, x"
    found.y.x.attrs.update(long_name="x", units="m")
    assert picture.plain_label(found, "x") == "x [m]"


def test_lines_are_drawn_with_their_statuses_at_the_foot_where_they_have_no_value():
    found = seen([[1.0, 2.0, np.nan], [4.0, -5.0, 6.0]], [1.0, 2.0, 3.0], [0.5, 0.7], [[0, 1, 64], [0, 0, 0]])
    drawn = Picture(found, Scales(False, False))
    drawn.show(found, True)
    lines = drawn.lines.data
    np.testing.assert_array_equal(lines["ys"], [[1.0, 2.0, np.nan], [4.0, -5.0, 6.0]])
    assert [xs.tolist() for xs in lines["xs"]] == [[1.0, 2.0, 3.0]] * 2
    assert (lines["colour"], lines["name"]) == (list(COLOURS[:2]), ["a = 0.5", "a = 0.7"])
    assert drawn.marks.data["x"].tolist() == [2.0, 3.0]
    assert drawn.marks.data["y"].tolist() == [2.0, -5.0]
    assert drawn.marks.data["colour"] == list(STATUS_COLOURS[2:4])
    drawn.show(found, False)
    assert len(drawn.marks.data["x"]) == 0
    logarithmic = Picture(found, Scales(False, True))
    logarithmic.show(found, True)
    np.testing.assert_array_equal(logarithmic.lines.data["ys"], [[1.0, 2.0, np.nan], [4.0, np.nan, 6.0]])
    assert logarithmic.marks.data["y"].tolist() == [2.0, 1.0]


def test_a_map_is_drawn_from_edge_to_edge_in_the_colours_of_its_values():
    found = a_map()
    drawn = Picture(found, Scales.of(found, AUTO))
    drawn.show(found, True)
    cells = drawn.cells.data
    assert cells["x"] == pytest.approx([10**-0.5])
    assert cells["dw"] == pytest.approx([10**3.5 - 10**-0.5])
    assert (cells["y"], cells["dh"]) == ([-0.5], [9.0])
    image = cells["image"][0]
    assert image.shape == (picture.HEIGHT, picture.WIDTH)
    assert (image[0, 0], image[-1, -1]) == (1.0, 3.0)
    assert (drawn.mapper.low, drawn.mapper.high) == (1.0, 3.0)
    # a quarter of the width is a cell, a ninth of the height
    assert (np.diff(image[0]) != 0).nonzero()[0].tolist() == [224, 449, 674]
    assert image[560 // 9 - 1, 0] == found.y.values[0, 0]
    assert image[560 // 9 + 1, 0] == found.y.values[1, 0]


def test_logarithmic_colours_leave_out_what_is_not_positive():
    found = a_map(-1.0, 3.0)
    drawn = Picture(found, Scales(True, False, True))
    drawn.show(found, False)
    assert drawn.mapper.low == found.y.values[found.y.values > 0].min()
    assert np.isnan(drawn.cells.data["image"][0][0, 0])
    assert drawn.flags.data["image"] == []


def test_a_cross_marks_a_cell_or_none():
    found = a_map()
    drawn = Picture(found, Scales.of(found, AUTO))
    drawn.mark(1.0, 2.0)
    assert drawn.chosen.data == {"x": [1.0], "y": [2.0]}
    drawn.mark(None, None)
    assert drawn.chosen.data == {"x": [], "y": []}


def test_colours_of_lines_begin_anew_after_the_last():
    found = seen(np.ones((8, 2)), [1.0, 2.0], np.arange(8.0))
    drawn = Picture(found, Scales(False, False))
    drawn.show(found, False)
    assert drawn.lines.data["colour"] == [*COLOURS, COLOURS[0]]
    assert drawn.points.data["colour"].tolist() == [colour for colour in (*COLOURS, COLOURS[0]) for _ in range(2)]
