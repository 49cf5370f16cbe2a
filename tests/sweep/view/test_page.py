"""What the controls of the page do, without a browser."""

import re
from importlib.util import find_spec

import numpy as np
import pytest

import sweep

pytestmark = pytest.mark.skipif(not find_spec("panel"), reason="the extra view is not installed")


def made(dataset, name, *location):
    """The page; panel is imported here, since every worker reads this file and one of them needs it."""
    from sweep.view.page import Page

    return Page(dataset, name, *location)


def touch(page, x=None, y=None, zoom=False):
    """A click, or the wheel that makes these the ends of the axes, as they come from a browser."""
    from bokeh.events import RangesUpdate, Tap

    figure = page.picture.figure
    if zoom:
        figure.x_range.update(start=x[0], end=x[1])
        figure.y_range.update(start=y[0], end=y[1])
    figure._trigger_event(RangesUpdate(figure) if zoom else Tap(figure, x=x, y=y))


@pytest.fixture
def page(dataset):
    return made(dataset, "map.h5")


def test_a_page_begins_with_the_first_output_over_its_longest_axes(page, dataset):
    assert (page.choice.output, page.choice.x, page.choice.across) == ("period", "mu", "R")
    assert list(page.sliders) == ["a"]
    image = page.picture.cells.data["image"][0]
    expected = dataset.period.isel(a=1).values
    assert image[0, 0] == expected[0, 0]
    assert image[-1, -1] == expected[-1, -1]


def test_a_zoom_reads_the_region_and_a_slider_keeps_it(page):
    touch(page, (1.0, 2.0), (0.5, 0.6), zoom=True)
    assert page.found.values("mu").min() > 0.4
    assert page.found.y.sizes["R"] < 8  # and yet a map
    page.sliders["a"].value = 2
    assert page.picture.figure.x_range.start == 1.0
    assert page.found.values("mu").min() > 0.4


def test_an_address_restores_the_view_and_follows_the_controls(dataset):
    """What it says that there is not, is left aside."""
    from panel.io.location import Location

    location = Location(search="?x=R&at_a=2&output=nothing")
    page = made(dataset, "map.h5", location)
    assert (page.choice.output, page.choice.x, page.choice.across, page.choice.held) == ("period", "R", "mu", {"a": 2})
    page.sliders["a"].value = 0
    page.output.value = "amplitude"
    assert (location.query_params["at_a"], location.query_params["output"]) == (0, "amplitude")


def test_the_exponent_replaces_the_value(page, dataset):
    page.up.value = "(one line)"
    page.sliders["R"].value = 0
    page.shows.value = "local exponent"
    expected = sweep.local_exponent(dataset.period.isel(R=0, a=1).load(), "mu").values
    assert np.array_equal(page.picture.lines.data["ys"][0], expected)


def test_statuses_lie_over_the_picture_and_are_told(page, dataset):
    flags = page.picture.flags.data["image"][0]
    assert np.isnan(flags[0, -1])
    assert np.isfinite(flags[-1, 0])
    count = int((dataset.status.isel(a=1) != 0).sum())
    assert f"NEVER_STARTS, {count} shown" in page.legend.object
    page.statuses.value = False
    assert page.legend.object == ""
    assert page.picture.flags.data["image"] == []


def test_a_click_shows_the_row_of_the_cell(page, dataset):
    touch(page, float(dataset.mu[30]) * 1.05, float(dataset.R[3]) + 0.02)
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page.table.object)
    assert cells[:2] == ["period", f"{float(dataset.period[30, 3, 1]):.6g}"]  # outputs stand first
    assert cells[cells.index("phi0") :][:3] == ["phi0", "1", "rad"]
    chosen = {"x": [float(dataset.mu[30])], "y": [float(dataset.R[3])]}
    assert page.picture.chosen.data == chosen
    touch(page, None, 1.0)
    touch(page, 1e9, 1.0)
    assert page.picture.chosen.data == chosen


def test_a_result_without_an_axis_of_numbers_is_refused(dataset):
    with pytest.raises(sweep.SweepError, match="nothing to show"):
        made(dataset.isel(mu=0, R=0, a=0).load(), "point.h5")


@pytest.fixture(scope="module")
def refined():
    axes = {n: {"spacing": "log", "start": 0.1, "stop": 10.0, "num": 4} for n in ("mu", "a", "phi0")}
    ds = sweep.run(sweep.study(kernel="foliot", axes=axes, outputs=["period", "multiplier"]))
    return sweep.refine(ds, "period", 5e-2).dataset


def test_cells_of_a_refinement_are_shown_as_a_map_between_them(refined):
    """P = f(mu / (a^2 phi0)) / a, and what is shown of it is as right as was asked."""
    page = made(refined, "fine.h5")
    assert (page.choice.x, page.choice.across, list(page.sliders)) == ("mu", "a", ["phi0"])
    assert page.shows.options == ["value"]  # no local exponent of straight lines between cells
    assert page.picture.mapped
    assert page.dataset.period.size < 201**2
    assert f"refined: straight lines between its {refined.sizes['cell']} cells" in page.dataset.title
    page.sliders["phi0"].value = 5
    at = {name: page.dataset[name].values for name in ("mu", "a")}
    phi0 = float(page.dataset.phi0[5])
    truth = sweep.run(sweep.study(kernel="foliot", axes=at, fixed={"phi0": phi0}, outputs=["period"])).period
    np.testing.assert_allclose(page.found.y.values, truth.transpose("a", "mu").values, rtol=5e-2)


def test_a_refined_cell_is_clicked_and_its_part_is_kept(refined):
    page = made(refined, "fine.h5")
    x, y = page.found.values("mu")[3], page.found.values("a")[4]
    touch(page, float(x), float(y))
    assert f"{x:.6g}" in page.table.object
    png, csv = (page.saves[suffix].callback() for suffix in ("png", "csv"))
    assert png.read(4)[1:] == b"PNG"
    assert len(csv.read().splitlines()) > 100
    assert page.saves["toml"].disabled  # cells that lie anywhere are no grid
