"""Default pictures: what is drawn, on which scale, with which words; and files that are the same each time."""

import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import LogNorm

from sweep.analysis.loglog import is_logarithmic, spans_decades
from sweep.show.charts import new_figure, save, style
from sweep.show.plot import plot
from sweep.show.view import label, setting, symbol, unit_text, view
from sweep.system.errors import SweepError

FLAGS = {"flag_values": np.array([0, 1, 64, 127], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT PENDING"}
UNITS = {"mu": "rad/s^2", "a": "1/s", "R": "rad/s^2", "phase": "1"}


def dataset(**axes):
    """period = 4 a/mu + mu^(-1/3) + R over the given axes, every cell OK."""
    coords = {n: (n, v, {"units": UNITS[n]} if n in UNITS else {}) for n, v in axes.items()}
    ds = xr.Dataset(coords=coords, attrs={"title": "Foliot period"})
    shape = tuple(len(v) for v in axes.values())
    a, R = ds.get("a", xr.DataArray(1.0)), ds.get("R", xr.DataArray(0.0))
    period = 4 * a / ds.mu + ds.mu ** (-1 / 3) + R + xr.zeros_like(xr.DataArray(np.zeros(shape), dims=list(axes)))
    ds["period"] = (
        period.transpose(*axes).drop_attrs(deep=False).assign_attrs(units="s", long_name="period of the cycle")
    )
    ds["amplitude"] = (2 + 0 * ds.period).assign_attrs(units="rad", long_name="largest angle")
    ds["status"] = (tuple(axes), np.zeros(shape, np.int8), FLAGS)
    return ds


def log(n=41):
    return np.geomspace(1e-3, 1e3, n)


def drawn(axes):
    """Lines that carry points."""
    return [line for line in axes.lines if len(line.get_xdata())]


def words(figure):
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


def test_one_axis_makes_one_line_on_logarithmic_scales_with_names_and_units():
    ds = dataset(mu=log())
    (axes,) = plot(ds).axes
    (line,) = drawn(axes)
    np.testing.assert_array_equal(line.get_xdata(), ds.mu)
    np.testing.assert_array_equal(line.get_ydata(), ds.period)
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert axes.get_ylabel() == "period of the cycle [s]"
    assert axes.get_xlabel() == r"$\mu$ [rad/s$^{2}$]"
    assert axes.get_title() == "Foliot period"
    assert axes.get_legend() is None


def test_a_linear_axis_and_a_narrow_range_stay_linear():
    (axes,) = plot(dataset(mu=np.linspace(1, 2, 11))).axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "linear")


def test_the_output_and_the_axis_may_be_named():
    (axes,) = plot(dataset(mu=log(5), a=[1.0, 2.0, 4.0]), y="amplitude", x="a").axes
    assert axes.get_ylabel() == "largest angle [rad]"
    assert axes.get_xlabel() == "$a$ [1/s]"


def test_few_values_of_a_second_axis_make_a_family_told_apart_without_colour():
    ds = dataset(mu=log(), a=[1.0, 2.0, 4.0])
    figure = plot(ds)
    lines = drawn(figure.axes[0])
    assert words(figure) == ["$a$ = 1 1/s", "$a$ = 2 1/s", "$a$ = 4 1/s"]
    for i, line in enumerate(lines):
        np.testing.assert_array_equal(line.get_ydata(), ds.period[:, i])
    assert len({line.get_color() for line in lines}) == len({str(line._dash_pattern) for line in lines}) == 3


def test_an_axis_of_words_makes_a_family_however_long():
    names = [f"method{i}" for i in range(12)]
    figure = plot(dataset(mu=log(), method=names))
    assert words(figure) == [f"method = {name}" for name in names]
    assert len(drawn(figure.axes[0])) == 12


def test_two_long_axes_make_a_map_with_a_logarithmic_colour_scale():
    ds = dataset(mu=log(61), a=np.linspace(1, 2, 21))
    figure = plot(ds)
    axes, bar = figure.axes
    (mesh,) = axes.collections
    np.testing.assert_array_equal(mesh.get_array(), ds.period.transpose("a", "mu"))
    assert isinstance(mesh.norm, LogNorm)
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert axes.get_ylabel() == "$a$ [1/s]"
    assert bar.get_ylabel() == "period of the cycle [s]"


def test_the_cells_of_a_map_lie_around_their_grid_points():
    figure = plot(dataset(mu=log(7), a=np.linspace(1, 2, 11)), x="mu")
    corners = figure.axes[0].collections[0].get_coordinates()
    np.testing.assert_allclose(corners[0, :, 0], np.geomspace(10**-3.5, 10**3.5, 8))
    np.testing.assert_allclose(corners[:, 0, 1], np.linspace(0.95, 2.05, 12))


def test_a_falling_or_unordered_axis_is_drawn_in_order():
    ds = dataset(mu=log(31), a=np.linspace(1, 2, 11))
    shuffled = ds.isel(mu=np.random.default_rng(0).permutation(31), a=slice(None, None, -1))
    for one in ({}, {"a": 0}):
        left, right = view(shuffled.isel(one), x="mu"), view(ds.isel(dict.fromkeys(one, -1)), x="mu")
        np.testing.assert_array_equal(left.y.values, right.y.values)
        np.testing.assert_array_equal(left.values("mu"), right.values("mu"))


def test_further_axes_are_held_at_their_middle_and_the_title_says_so():
    ds = dataset(mu=log(), a=np.linspace(1, 2, 11), R=[0.0, 10.0, 20.0])
    figure = plot(ds)
    assert figure.axes[0].get_title() == "Foliot period\n$R$ = 10 rad/s$^{2}$"
    np.testing.assert_array_equal(figure.axes[0].collections[0].get_array(), ds.period.sel(R=10).transpose("a", "mu"))


def test_a_trace_is_drawn_along_its_own_coordinate():
    ds = dataset(mu=log(5)).rename(period="angle")
    ds["angle"] = ds.angle * xr.DataArray(np.sin(np.arange(3.0)), dims="phase", coords={"phase": [0.0, 0.5, 1.0]})
    shown = view(ds)
    assert (shown.x, shown.across) == ("phase", "mu")
    ds["status"][2] = 1
    assert (view(ds).status[2] == 1).all()
    assert view(ds).codes() == [1]


def test_the_cells_of_a_zip_design_are_marks_along_the_coordinate_named():
    ds = dataset(mu=log(20)).rename_dims(mu="cell").reset_index("mu").assign_coords(a=("cell", np.arange(20.0)))
    (axes,) = plot(ds).axes
    (line,) = drawn(axes)
    assert line.get_linestyle() == "None"
    assert axes.get_xlabel().startswith(r"$\mu$")
    (line,) = drawn(plot(ds, x="a").axes[0])
    np.testing.assert_array_equal(line.get_xdata(), np.arange(20.0))


def test_cells_that_are_not_ok_are_marked_on_the_line_or_at_its_foot():
    ds = dataset(mu=log())
    ds["status"][[3, 5]] = 1
    ds["status"][10] = 64
    ds["period"][10] = np.nan
    figure = plot(ds)
    remark, foot = drawn(figure.axes[0])[1:]
    np.testing.assert_array_equal(remark.get_xdata(), ds.mu[[3, 5]])
    np.testing.assert_array_equal(remark.get_ydata(), ds.period[[3, 5]])
    np.testing.assert_array_equal(foot.get_xdata(), ds.mu[[10]])
    assert foot.get_ydata().tolist() == [0]
    assert foot.get_transform() == figure.axes[0].get_xaxis_transform()
    assert words(figure) == ["INACCURATE", "BAD_INPUT"]


def test_a_map_hatches_refused_cells_and_outlines_remarks():
    ds = dataset(mu=log(), a=np.linspace(1, 2, 21))
    ds["status"][:3, :4] = 64
    ds["period"][:3, :4] = np.nan
    ds["status"][20:30, 5:10] = 1
    figure = plot(ds)
    _, outline, paint = figure.axes[0].collections
    assert len(paint.get_paths()) == 4  # a run of three cells in each of four rows
    assert paint.get_hatch()
    corner = paint.get_paths()[0].get_extents()
    assert corner.x0 < ds.mu[0] < ds.mu[2] < corner.x1 < ds.mu[3]
    assert corner.y0 < 1 < corner.y1 < ds.a[1]
    assert outline.get_paths()[0].get_extents().width > 0
    assert words(figure) == ["BAD_INPUT"]
    assert [text.get_text() for text in figure.axes[0].texts] == ["INACCURATE"]


def test_a_wide_region_is_named_where_it_is_widest():
    ds = dataset(mu=log(), a=np.linspace(1, 2, 21))
    wide = np.arange(ds.sizes["mu"]) < ds.sizes["mu"] // 2
    ds["status"][wide] = 64
    ds["period"][wide] = np.nan
    figure = plot(ds)
    text = figure.axes[0].texts[0]
    assert text.get_text() == "BAD_INPUT"
    assert words(figure) == []  # what is named in its place needs no legend
    x, y = text.get_position()
    assert ds.mu[0] < x < ds.mu[ds.sizes["mu"] // 2]
    assert y == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize(
    "axes", [{"mu": log()}, {"mu": log(), "a": [1.0, 2.0]}, {"mu": log(), "a": np.arange(1.0, 12)}]
)
def test_a_result_without_one_value_is_drawn_all_the_same(tmp_path, axes):
    ds = dataset(**axes)
    ds["period"] = ds.period * np.nan
    ds["status"][:] = 64
    figure = plot(ds, tmp_path / "out.png")
    assert "BAD_INPUT" in [*words(figure), *(text.get_text() for text in figure.axes[0].texts)]


def test_more_points_than_a_picture_can_show_are_thinned():
    ds = dataset(mu=log(50_001))
    assert view(ds).y.size == 16_667
    wide = xr.Dataset({"period": (("mu", "a"), np.ones((4001, 9)))}, coords={"mu": log(4001), "a": np.arange(1.0, 10)})
    assert view(wide).y.sizes == {"a": 9, "mu": 1334}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"y": "perod"}, "there is no output 'perod' to draw; did you mean period?"),
        ({"y": "status"}, "there is no output 'status' to draw; there are period, amplitude"),
        ({"x": "mv_"}, "there is no number axis 'mv_' to draw period along; there are mu"),
        ({"x": "method"}, "there is no number axis 'method'"),
    ],
)
def test_an_unknown_output_or_axis_is_refused_with_those_there_are(keys, message):
    with pytest.raises(SweepError, match=message):
        plot(dataset(mu=log(5), method=["map", "closed"]), **keys)


def test_a_result_that_runs_along_nothing_is_refused():
    with pytest.raises(SweepError, match="there is nothing to draw"):
        plot(dataset(mu=log(5)).isel(mu=0))
    with pytest.raises(SweepError, match="no number axis"):
        plot(dataset(mu=log(5), method=["map", "closed"]).isel(mu=0))


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_the_same_result_gives_the_same_bytes_whatever_the_readers_settings(tmp_path, suffix):
    ds = dataset(mu=log(), a=np.linspace(1, 2, 21))
    plot(ds, tmp_path / f"one.{suffix}")
    with matplotlib.rc_context({"font.size": 20, "axes.grid": True, "savefig.dpi": 50}):
        plot(ds, tmp_path / f"two.{suffix}")
    one, two = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("one", "two"))
    assert one == two
    assert one.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix])


def test_the_readers_settings_are_left_as_they_were():
    before = dict(matplotlib.rcParams)
    plot(dataset(mu=log()))
    assert dict(matplotlib.rcParams) == before


def test_pyplot_and_its_windows_are_never_touched():
    code = "import sys, sweep.show.charts; print('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"


def test_without_matplotlib_the_user_is_told_what_to_install():
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "try: import sweep.show.charts\n"
        "except Exception as error: print(type(error).__name__, error)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.startswith("SweepError pictures need matplotlib")
    assert "-e '.[plot]'" in said


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("out.gif", r'out\.gif: found "\.gif"; a picture is one of \.png, \.svg, \.pdf'),
        ("out", "out: found no suffix"),
        ("nowhere/out.png", r"nowhere/out\.png cannot be written: No such file or directory"),
        (".png", "no suffix"),
    ],
)
def test_a_place_that_cannot_be_written_is_one_clear_line(tmp_path, name, message):
    with pytest.raises(SweepError, match=message):
        plot(dataset(mu=log()), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("title", ["a lone $", "$\\frac$", "{$x_$}", "100 $ and 200 $"])
def test_a_title_is_plain_text(tmp_path, title):
    figure = plot(dataset(mu=log()).assign_attrs(title=title), tmp_path / "out.png")
    assert figure.axes[0].get_title() == title.replace("$", "\\$")


def test_a_fault_half_way_leaves_the_old_picture_and_nothing_else(tmp_path, monkeypatch):
    (tmp_path / "out.png").write_text("old")

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with style():
        figure = new_figure(50, 50)
    with pytest.raises(SweepError, match="No space left on device"):
        save(figure, tmp_path / "out.png")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("out.png", "old")]


def test_a_figure_is_as_large_as_asked():
    with style():
        assert new_figure(86, 50).get_size_inches().tolist() == pytest.approx([86 / 25.4, 50 / 25.4])


@pytest.mark.parametrize(
    ("grid", "logarithmic"),
    [
        (np.geomspace(1, 2, 5), True),
        (np.geomspace(2, 1, 5), True),
        (np.linspace(1, 2, 5), False),
        (np.linspace(1, 1.0001, 5), False),
        (np.linspace(0, 1e6, 5), False),
        (np.array([1.0, 5.0, 1000.0]), True),
        (np.array([1.0, 2.0]), False),
        (np.array([1.0, 1000.0]), True),
        (np.array([3.0]), False),
        (np.array([]), False),
        (np.array([-1.0, -10.0, -100.0]), False),
    ],
)
def test_an_axis_is_logarithmic_where_its_grid_is(grid, logarithmic):
    assert is_logarithmic(grid) is logarithmic


def test_values_span_decades_from_two_on():
    assert spans_decades([1.0, 100.0, np.nan])
    assert not spans_decades([1.0, 99.0])
    assert not spans_decades([0.0, 100.0])
    assert not spans_decades([np.nan])


@pytest.mark.parametrize(
    ("name", "sign"),
    [
        ("mu", r"$\mu$"),
        ("phi0", r"$\varphi_{\mathrm{0}}$"),
        ("R_s", r"$R_{\mathrm{s}}$"),
        ("a", "$a$"),
        ("omega_n", r"$\omega_{\mathrm{n}}$"),
        ("period", ""),
        ("crossing_speed", ""),
        ("b_angle", r"$b_{\mathrm{angle}}$"),
    ],
)
def test_letters_are_set_as_symbols_and_words_are_not(name, sign):
    assert symbol(name) == sign


def test_labels_and_units():
    assert unit_text("rad/s^2") == "rad/s$^{2}$"
    assert unit_text("kg m^-1") == "kg m$^{-1}$"
    assert unit_text("1") == ""
    speed = xr.DataArray(1.0, name="crossing_speed", attrs={"units": "rad/s"})
    assert label(speed) == "crossing speed [rad/s]"
    mu = xr.DataArray(0.5, name="mu", attrs={"units": "rad/s^2", "long_name": "drive torque"})
    assert label(mu) == r"drive torque, $\mu$ [rad/s$^{2}$]"
    assert setting(mu) == r"$\mu$ = 0.5 rad/s$^{2}$"
    assert setting(xr.DataArray("map", name="method")) == "method = map"


def test_a_long_name_is_broken_into_lines_that_fit_the_picture():
    text = "s = -dlnP/dlnmu, the share of a torque error that reaches the period"
    lines = label(xr.DataArray(1.0, name="sensitivity", attrs={"units": "1", "long_name": text})).split("\n")
    assert " ".join(lines) == text
    assert len(lines) == 2
    assert max(map(len, lines)) <= 44


def test_a_line_does_not_begin_with_the_unit():
    attrs = {"units": "kg m^2", "long_name": "moment of inertia of the balance with its rim and"}
    lines = label(xr.DataArray(1.0, name="J", attrs=attrs)).split("\n")
    assert lines == ["moment of inertia of the balance with its", r"rim and, $J$ [kg m$^{2}$]"]


def test_a_remark_on_every_cell_is_outlined_at_the_rim():
    ds = dataset(mu=log(), a=np.linspace(1, 2, 21))
    ds["status"][:] = 1
    _, outline = plot(ds).axes[0].collections
    extent = outline.get_paths()[0].get_extents()
    assert extent.y0 < 1 < 2 < extent.y1


def test_a_remark_on_a_value_that_a_logarithm_cannot_show_is_at_the_foot():
    ds = dataset(mu=log())
    ds["period"][:] = np.where(np.arange(ds.sizes["mu"]) == 4, 0.0, 10.0 ** np.arange(ds.sizes["mu"]))
    ds["status"][4] = 1
    figure = plot(ds.assign(period=ds.period.where(ds.period > 0)))
    foot = drawn(figure.axes[0])[-1]
    np.testing.assert_array_equal(foot.get_xdata(), ds.mu[[4]])


def test_a_symbol_takes_the_room_it_has_in_print():
    text = "middle between the arm's extremes, from b; negative for type B"
    lines = label(xr.DataArray(1.0, name="A0", attrs={"units": "rad", "long_name": text})).split("\n")
    assert lines == ["middle between the arm's extremes, from b;", r"negative for type B, $A_{\mathrm{0}}$ [rad]"]
