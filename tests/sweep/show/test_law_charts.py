"""The picture of laws beside each other, by what its axes hold."""

import matplotlib.colors
import numpy as np
import pytest
import xarray as xr

from sweep.show.charts import COLOURS, DASHES
from sweep.show.plot import plot

X = np.array([1.0, 10.0, 100.0])
Y = np.array([2.0, 3.0, 5.0])
SCATTER = 0.25


def compared(n=3, chosen="law1", residual=0.125, **attrs):
    """Law k lies (k + 1) % above the points, and is worse by k."""
    names = [f"law{k}" for k in range(n)]
    fitted = np.array([Y * (1 + 0.01 * (k + 1)) for k in range(n)])
    columns = {
        "fitted": (("law", "point"), fitted), "worse": ("law", np.arange(float(n)) * 1.2345),
        "scatter": ("law", np.full(n, SCATTER)), "residual": ("law", [residual if k == 1 else 9.0 for k in range(n)]),
        "x": ("point", X, {"units": "rad/s^2"}), "y": ("point", Y, attrs),
    }  # fmt: skip
    names_of = {"y": "period", "x": "mu", "chosen": chosen, "verdict": "one law by 10"}
    return xr.Dataset(columns, {"law": names}, names_of)


@pytest.fixture
def axes():
    return plot(compared(units="s")).axes


def test_points_and_laws_are_drawn_the_chosen_first_and_wide(axes):
    above, below = axes
    points, *laws = above.lines
    assert (points.get_marker(), points.get_linestyle(), points.get_label()) == ("o", "None", "points")
    np.testing.assert_array_equal(points.get_xydata(), np.column_stack([X, Y]))
    assert [line.get_label() for line in laws] == ["law1, AICc +1.23, chosen", "law0, AICc best", "law2, AICc +2.47"]
    assert [line.get_linewidth() for line in laws] == [1.4, 0.8, 0.8]
    for i, (line, off) in enumerate(zip(laws, (1.02, 1.01, 1.03), strict=True)):
        np.testing.assert_allclose(line.get_xydata(), np.column_stack([X, Y * off]), rtol=1e-15)
        assert line.get_color() == COLOURS[i]
    assert laws[0].get_linestyle() == DASHES[0]
    assert laws[1].get_linestyle() == "--"
    assert len(below.lines) == 4  # and the zero


def test_what_laws_leave_is_point_over_law_less_one(axes):
    _, below = axes
    for i, (line, off) in enumerate(zip(below.lines, (1.02, 1.01, 1.03), strict=False)):
        np.testing.assert_allclose(line.get_xydata(), np.column_stack([X, np.full(3, 1 / off - 1)]), rtol=1e-13)
        assert (line.get_color(), line.get_marker()) == (COLOURS[i], ".")
    assert list(below.lines[-1].get_ydata()) == [0.0, 0.0]
    assert below.get_ylim() == (-0.5, 0.5)  # four times the largest distance of the chosen law


def test_the_band_is_two_scatters_to_either_side_of_the_chosen_law(axes):
    above, below = axes
    (band,) = above.collections
    corners = band.get_paths()[0].vertices
    low, high = (sorted(corners[corners[:, 0] == X[0]][:, 1])[k] for k in (0, -1))
    assert (low, high) == pytest.approx((Y[0] * 1.02 * np.exp(-0.5), Y[0] * 1.02 * np.exp(0.5)), rel=1e-14)
    (span,) = below.patches
    assert span.get_y() == pytest.approx(-np.expm1(0.5))
    assert span.get_height() == pytest.approx(2 * np.expm1(0.5))
    assert matplotlib.colors.to_hex(band.get_facecolor()[0]) == COLOURS[0].lower()


def test_scales_labels_and_the_verdict(axes):
    above, below = axes
    assert {above.get_xscale(), above.get_yscale(), below.get_xscale()} == {"log"}
    assert below.get_yscale() == "linear"
    assert (above.get_ylabel(), below.get_xlabel(), below.get_ylabel()) == (
        "period [s]",
        "mu [rad/s^2]",
        "point / law - 1",
    )
    assert above.get_title() == "one law by 10"
    (legend,) = above.figure.legends
    assert [text.get_text() for text in legend.get_texts()][:2] == ["points", "law1, AICc +1.23, chosen"]


@pytest.mark.parametrize("attrs", [{}, {"units": "1"}, {"units": ""}])
def test_a_pure_number_has_no_unit(attrs):
    assert plot(compared(**attrs)).axes[0].get_ylabel() == "period"


def test_six_laws_are_drawn_and_the_chosen_is_among_them():
    labels = [line.get_label() for line in plot(compared(9, "law8")).axes[0].lines[1:]]
    assert [label.partition(",")[0] for label in labels] == ["law8", "law0", "law1", "law2", "law3", "law4"]


def test_a_law_without_any_misfit_has_an_axis_all_the_same():
    assert plot(compared(residual=0.0)).axes[1].get_ylim() == (-4e-15, 4e-15)


def test_the_picture_is_saved_where_it_is_said(tmp_path):
    plot(compared(), tmp_path / "laws.svg")
    assert (tmp_path / "laws.svg").read_text().startswith("<?xml")
