"""Default pictures by what is in them: lines, marks, scales, words; and files that are the same each time."""

import matplotlib
import matplotlib.colors
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import LogNorm

import sweep
from kernels.interface import Status
from sweep.errors import SweepError
from sweep.show.figures import plot
from sweep.show.view import SIDE, View, evened, label

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


def test_an_axis_of_whole_numbers_has_whole_ticks():
    (axes,) = plot(dataset(mu=[1.0, 2.0, 3.0])).axes
    assert not (axes.get_xticks() % 1).any()


def test_two_long_axes_make_a_map_with_a_logarithmic_colour_scale():
    ds = dataset(mu=log(61), a=np.linspace(1, 2, 21))
    figure = plot(ds)
    axes, bar = figure.axes
    (mesh,) = axes.collections
    np.testing.assert_array_equal(mesh.get_array(), ds.period.transpose("a", "mu"))
    assert isinstance(mesh.norm, LogNorm)
    assert bar.get_ylabel() == "period of the cycle [s]"


def test_a_section_is_points_over_a_parameter_by_their_status():
    ds = dataset(mu=log(11)).expand_dims(passage=np.arange(101.0, 133.0))
    ds = ds.assign(status=ds.status.isel(passage=0).copy(data=[0] * 7 + [1] * 4))
    kept = {"time": ds.period.passage * ds.period, "angle": 0.0 * ds.period + 1e-17}
    (axes,) = plot(ds[["status"]].assign(kept | {"period": ds.period})).axes  # a state, not what the surface says of it
    fine, unsure = drawn(axes)
    np.testing.assert_array_equal(np.unique(fine.get_xdata()), ds.mu[:7])
    assert len(fine.get_ydata()) == 7 * 32
    assert len(unsure.get_ydata()) == 4 * 32
    assert axes.get_ylabel() == "period of the cycle [s]"
    speed = (1e-13 * kept["time"]).drop_attrs()
    small = {"angle": 1e-25 * speed, "place": 5e-3 * speed, "speed": speed}  # rounding, and two states
    (axes,) = plot(ds[["status"]].assign(kept | small)).axes
    assert axes.get_ylabel().startswith("place")


def test_further_axes_are_held_at_their_middle_and_the_title_says_so():
    ds = dataset(mu=log(), a=np.linspace(1, 2, 11), R=[0.0, 10.0, 20.0])
    figure = plot(ds)
    assert figure.axes[0].get_title() == "Foliot period\n$R$ = 10 rad/s$^{2}$"
    np.testing.assert_array_equal(figure.axes[0].collections[0].get_array(), ds.period.sel(R=10).transpose("a", "mu"))


def test_the_title_says_what_is_fixed_and_a_histogram_runs_along_its_bins():
    keys = {"kernel": "foliot", "outputs": ["period"], "fixed": {"a": 0.5, "phi0": 1.0, "e": 1.0}}
    ds = sweep.run(axes={"mu": [1.0, 2.0], "R": [0.0, 0.1]}, **keys)
    title = "foliot over mu and R\n$\\varphi_{\\mathrm{0}}$ = 1 rad, $a$ = 0.5 s$^{-1}$"
    assert plot(ds).axes[0].get_title() == title
    assert plot(ds.isel(R=1)).axes[0].get_title() == title + ", $R$ = 0.1 rad/s$^{2}$"
    assert plot(sweep.refine(ds, "period", 0.1).dataset).axes[0].get_title() == title.replace("R\n", "R, refined\n")
    summary = {"over": ["mu"], "outputs": {"period": ["histogram"]}, "edges": {"period": np.geomspace(1, 100, 13)}}
    bins = sweep.run(axes={"mu": log(), "R": [0.0, 0.1, 0.2]}, summary=summary, **keys)
    axes = plot(bins, y="period_histogram").axes[0]
    assert axes.get_ylabel() == "period of the limit cycle [s]"
    np.testing.assert_allclose(axes.get_ylim(), (1.0, 100.0))
    ratio = xr.DataArray(1.0, name="z", attrs={"long_name": "ratio c/(2 sqrt(k I)) (0 in vacuum)"})
    assert label(ratio) == "ratio c/(2 sqrt(k I)), $z$"


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
    colours = {text: mark.get_color() for text, mark in zip(words(figure), (remark, foot), strict=True)}
    only = plot(ds.assign(status=ds.status.where(ds.status != 1, 0).assign_attrs(FLAGS)))
    assert drawn(only.axes[0])[1].get_color() == colours["BAD_INPUT"] != colours["INACCURATE"]
    flags = {"flag_values": [*map(int, Status)], "flag_meanings": " ".join(Status.__members__)}
    shown = View(ds.assign(status=ds.status.assign_attrs(flags)))
    cycles = Status.GRAZING, Status.UNSTABLE, Status.PERIOD_2, Status.NOT_PERIODIC
    assert len({shown.colour(code) for code in cycles}) == 4
    ds = dataset(mu=log(), a=np.arange(1.0, 12))
    ds["status"][3:5] = 1
    ds["period"][3] = np.nan
    assert words(plot(ds)) == ["INACCURATE", "INACCURATE, no value"]


def test_a_value_between_two_that_are_missing_is_a_point():
    ds = dataset(mu=log())
    assert drawn(plot(ds).axes[0])[0].get_marker() == "None"
    ds["period"][[1, 5, 7]] = np.nan
    line = drawn(plot(ds).axes[0])[0]
    assert (line.get_marker(), line.get_markevery()) == (".", [0, 6])
    assert drawn(plot(ds.isel(mu=[3])).axes[0])[0].get_markevery() == [0]


@pytest.mark.parametrize(
    "axes", [{"mu": log()}, {"mu": log(), "a": [1.0, 2.0]}, {"mu": log(), "a": np.arange(1.0, 12)}]
)
def test_a_result_without_one_value_is_drawn_all_the_same(tmp_path, axes):
    ds = dataset(**axes)
    ds["period"] = ds.period * np.nan
    ds["status"][:] = 64
    figure = plot(ds, tmp_path / "out.png")
    assert "BAD_INPUT" in [*words(figure), *(text.get_text() for text in figure.axes[0].texts)]


@pytest.mark.parametrize(
    ("keys", "word"), [({"y": "perod"}, "did you mean period"), ({"y": "status"}, "period"), ({"x": "method"}, "mu")]
)
def test_an_unknown_output_or_axis_is_refused_with_those_there_are(keys, word):
    with pytest.raises(SweepError, match=word):
        plot(dataset(mu=log(5), method=["map", "closed"]), **keys)
    with pytest.raises(SweepError, match="no values"):
        plot(dataset(mu=[]))
    with pytest.raises(SweepError, match="study_json"):
        plot(dataset(mu=log(5)).assign_attrs(study_json="garbage"))
    with pytest.raises(SweepError, match="expected a path"):
        plot(dataset(mu=log(5)), 3)


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_the_same_result_gives_the_same_bytes_whatever_the_readers_settings(tmp_path, suffix):
    ds = dataset(mu=log(), a=np.linspace(1, 2, 21))
    plot(ds, tmp_path / f"one.{suffix}")
    with matplotlib.rc_context({"font.size": 20, "axes.grid": True, "savefig.dpi": 50}):
        plot(ds, tmp_path / f"two.{suffix}")
    one, two = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("one", "two"))
    assert one == two
    assert one.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix])


# which cells are shown


@pytest.mark.parametrize(("axes", "shape"), [(2, (SIDE, SIDE)), (3, (34, 34, 34))])
def test_cells_that_lie_anywhere_become_an_even_grid(axes, shape):
    """A plane is the same plane between its cells; of three axes and more the grid is coarser."""
    rng = np.random.default_rng(0)
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * axes)).reshape(axes, -1).T
    places = np.concatenate([corners, rng.random((20, axes))]) + 1
    names = ["a", "b", "c"][:axes]
    columns = {"y": ("cell", places @ np.arange(1.0, axes + 1)), "status": ("cell", np.zeros(len(places), np.int8))}
    scattered = xr.Dataset(columns, {name: ("cell", places[:, k]) for k, name in enumerate(names)})
    even = evened(scattered)
    assert tuple(even.sizes[name] for name in names) == shape
    np.testing.assert_allclose((even.a[0], even.a[-1]), (1.0, 2.0))
    expected = sum((k + 1) * even[name] for k, name in enumerate(names))
    np.testing.assert_allclose(even.y, expected.transpose(*even.y.dims), rtol=0.02)


# charts of precision


def precision(**changes):
    """Three methods at two tolerances: right, with refused cells, silent; the last solves nothing."""
    columns = {
        "seconds": [[1e-6, 2e-6], [3e-6, 4e-6], [5e-6, 6e-6], [1e-6, 1e-6]],
        "error_median": [[1e-5, 1e-9], [0.0, 1e-3], [1e-2, 50.0], [np.nan, np.nan]],
        "error_worst": [[1e-4, 1e-8], [1e-3, 1e-2], [1e-1, 90.0], [np.nan, np.nan]],
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


def test_a_chart_of_precision_has_every_method_where_it_is_and_says_where_cells_are_wrong():
    """Errors that mean nothing lie on the rims; open marks are cells refused, crosses silently wrong ones."""
    figure = plot(precision())
    median, worst = figure.axes
    for axes, errors in (
        (median, [[1e-5, 1e-9], [2e-12 / 3, 1e-3], [1e-2, 3.0]]),
        (worst, [[1e-4, 1e-8], [1e-3, 1e-2], [1e-1, 3.0]]),
    ):
        whole, refused, silent = (axes.lines[k::3] for k in range(3))
        assert [line.get_label() for line in whole] == ["right", "shy", "liar"]
        assert [line.get_ydata().tolist() for line in whole] == errors
        assert [line.get_xdata().tolist() for line in whole] == [[1e-6, 2e-6], [3e-6, 4e-6], [5e-6, 6e-6]]
        assert [line.get_xdata().tolist() for line in refused] == [[], [3e-6], [6e-6]]
        assert [line.get_ydata().tolist() for line in silent] == [[], [], [errors[2][0]]]
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert "exact" in median.get_ylabel()
    assert [axes.get_title() for axes in (median, worst)] == ["median of 9 cells", "worst of 9 cells"]
    assert figure.get_suptitle() == r"A \$ stone"
    assert {"idle (solves no cell)", "liar (silently wrong)", "right", "shy"} < set(words(figure))
    assert any("2e-12" in word for word in words(figure))


def test_a_chart_has_no_empty_decades_above_its_errors():
    figure = plot(precision(error_worst=precision().error_worst * 1e-4))
    assert all(9e-3 < axes.get_ylim()[1] < 9e-2 for axes in figure.axes)


def test_a_method_has_one_colour_in_every_chart_whatever_stands_beside_it():
    """Methods of the project by their names; others by their place."""
    one, two = precision(), precision()
    one, two = (
        one.assign_coords(method=["auto", "taylor", "mine", "idle"]),
        two.assign_coords(method=["taylor", "dopri5", "auto", "idle"]),
    )
    looks = [{line.get_label(): line.get_color() for line in plot(ds).axes[0].lines[::3]} for ds in (one, two)]
    assert looks[0]["taylor"] == looks[1]["taylor"]
    assert looks[0]["auto"] == looks[1]["auto"]
    assert len({looks[1][name] for name in ("taylor", "dopri5", "auto")}) == 3


# laws beside each other

X = np.array([1.0, 10.0, 100.0])
Y = np.array([2.0, 3.0, 5.0])


def test_points_and_laws_are_drawn_the_chosen_first():
    """Law k lies (k + 1) % above the points, and is worse by k."""
    fitted = np.array([Y * (1 + 0.01 * (k + 1)) for k in range(3)])
    columns = {
        "fitted": (("law", "point"), fitted),
        "worse": ("law", np.arange(3) * 1.2345),
        "scatter": ("law", np.full(3, 0.25)),
        "residual": ("law", [9.0, 0.125, 9.0]),
        "x": ("point", X, {"units": "rad/s^2"}),
        "y": ("point", Y, {"units": "s"}),
    }
    attrs = {"y": "period", "x": "mu", "chosen": "law1", "verdict": "one law by 10"}
    above, below = plot(xr.Dataset(columns, {"law": ["law0", "law1", "law2"]}, attrs)).axes
    points, *laws = above.lines
    np.testing.assert_array_equal(points.get_xydata(), np.column_stack([X, Y]))
    assert [line.get_label() for line in laws] == ["law1, AICc +1.23, chosen", "law0, AICc best", "law2, AICc +2.47"]
    for line, off in zip(laws, (1.02, 1.01, 1.03), strict=True):
        np.testing.assert_allclose(line.get_xydata(), np.column_stack([X, Y * off]), rtol=1e-15)
    assert "twice the scatter about law1" in words(above.figure)
    assert (above.get_title(), len(below.lines)) == ("one law by 10", 4)  # and the zero
    assert 0.125 < below.get_ylim()[1] < 1.0  # how far the chosen law is off is seen
