"""Axes, windows, stated errors and what noise leaves of a curve: both sides of every limit."""

import math

import numpy as np
import pytest
import xarray as xr

from sweep.analysis import curves
from sweep.system.errors import SweepError

EPSILON = 2.0**-52
X = np.array([1.0, 2.0, 4.0, 8.0])


def output(values=X, x=X, **attrs):
    return xr.DataArray(values, {"x": ("x", x, {"units": "m"})}, "x", name="y", attrs=attrs)


def noise(n):
    return np.sin(17.0 * np.arange(n) ** 2 + 0.3)


# axes and windows


@pytest.mark.parametrize("confidence", [0.0, 1.0, -0.5, 95, math.nan])
def test_a_confidence_is_a_share(confidence):
    with pytest.raises(SweepError, match="confidence: expected a number between 0 and 1, found"):
        curves.check_confidence(confidence)
    for right in (1e-9, 0.5, 1 - 1e-9):
        curves.check_confidence(right)


@pytest.mark.parametrize(
    ("window", "expected"),
    [
        (None, (0.0, math.inf)),
        ((None, None), (0.0, math.inf)),
        ((2, None), (2.0, math.inf)),
        ((None, 3), (0.0, 3.0)),
        ((-1.0, 3), (-1.0, 3.0)),
    ],
)
def test_open_ends_reach_as_far_as_positive_numbers_do(window, expected):
    assert curves.ends(window, "x") == expected


def test_a_window_of_no_width_is_empty():
    with pytest.raises(SweepError, match="the window 2 to 2 of x is empty"):
        curves.ends((2, 2), "x")


@pytest.mark.parametrize(("off", "held"), [(-7.0, 1), (-9.0, 0)])
def test_an_end_may_be_off_a_point_by_seven_roundings_and_not_by_nine(off, held):
    x = np.array([1.0 + off * EPSILON, 1.5, 2.0 - off * 2 * EPSILON])
    assert curves.inside_window(x, (1.0, 2.0), "x").tolist() == [held, True, held]


def test_a_window_is_found_along_the_dimension_of_its_coordinate():
    cells = xr.DataArray(X, {"mu": ("cell", X), "a": ("cell", X[::-1])}, "cell", name="y")
    assert {k: v.tolist() for k, v in curves.window_of(cells, "a", (2.0, None)).items()} == {"cell": [0, 1, 2]}
    dimension, t, logs = curves.window_logs(cells, "a", (2.0, None))
    assert dimension == "cell"
    np.testing.assert_allclose(np.exp(t), [8, 4, 2])
    np.testing.assert_allclose(np.exp(logs), [1, 2, 4])


def test_what_is_missing_or_not_positive_has_no_logarithm():
    found = curves.log_of(output(np.array([math.e, np.nan, 0.0, -1.0])))
    np.testing.assert_allclose(found, [1, np.nan, np.nan, np.nan])
    assert found.name == "y"
    np.testing.assert_array_equal(
        curves.missing_is_nan(output(np.array([1, -2, np.inf, -np.inf]))), [1, -2, np.nan, np.nan]
    )


@pytest.mark.parametrize("at", [0, 1, 3])
def test_every_place_of_an_axis_must_be_in_order(at):
    x = X.copy()
    x[at] = x[at - 1] if at else x[1]
    with pytest.raises(SweepError, match="x neither rises nor falls throughout"):
        curves.positive_axis(output(x=x), "x")
    assert curves.positive_axis(output(x=X[::-1]), "x")[1].tolist() == [8, 4, 2, 1]
    assert curves.positive_axis(output(x=X.astype(int)), "x")[1].dtype == np.float64
    assert curves.positive_axis(output()[:3], "x")[1].size == 3


def test_numbers_of_each_line_stand_under_their_names():
    y = xr.DataArray(np.arange(6.0).reshape(2, 3), dims=("x", "set"), coords={"set": [5, 6, 7]})
    found = curves.numbers_along(("sum", "first"), lambda z: np.stack([z.sum(axis=-1), z[..., 0]], axis=-1), y, "x")
    assert found["sum"].dims == ("set",)
    assert (found["sum"].values.tolist(), found["first"].values.tolist()) == ([3, 5, 7], [0, 1, 2])
    doubled = curves.along(lambda z, w: z + w, y, "x", None, y)
    xr.testing.assert_identical(doubled, 2 * y)


# stated errors


def test_errors_may_be_a_number_or_an_array_and_are_not_negative():
    np.testing.assert_array_equal(curves.like(0.0, output(), "bound"), np.zeros(4))
    given = output(np.array([0.0, 0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(curves.like(given, output(), "bound"), given)
    with pytest.raises(SweepError, match=r"bound: errors are not negative; found -0\.2"):
        curves.like(given - 0.2, output(), "bound")
    for wrong in (given[:3], given.rename(x="z"), given.expand_dims(a=2), "much", [0.1, 0.2]):
        with pytest.raises(SweepError, match="bound: expected a number, or an array along axes of y; found"):
            curves.like(wrong, output(), "bound")


def test_standard_errors_count_by_the_value_and_lie_between_rounding_and_all_sense():
    found = curves.relative_sigma(output(np.array([-1.0, 2.0, 4.0, np.nan])), 0.5)
    np.testing.assert_allclose(found, [0.5, 0.25, 0.125, np.nan])
    assert np.isnan(curves.relative_sigma(output(), None)).all()
    for share, fits in ((EPSILON, True), (0.99 * EPSILON, False), (1e6, True), (1.01e6, False)):
        sigma = output(X * 0.1)
        sigma[2] = share * X[2]
        if fits:
            curves.relative_sigma(output(), sigma)
        else:
            with pytest.raises(SweepError, match=f"times y, found {share:.3g} times".replace("+", r"\+")):
                curves.relative_sigma(output(), sigma)


def test_bounds_are_given_or_of_the_sweep_or_nothing():
    assert curves.stated_bound(output()).values.tolist() == [0.0] * 4
    assert curves.stated_bound(output(rtol=1e-6)).values.tolist() == [1e-6] * 4
    assert curves.stated_bound(output(rtol=1e-6), 0.0).values.tolist() == [0.0] * 4
    unknown = output(np.array([0.1, np.inf, np.nan, 0.0]))
    assert curves.stated_bound(output(), unknown).values.tolist() == [0.1, 1.0, 1.0, 0.0]


def test_a_dataset_states_its_errors_by_cell_or_as_a_whole():
    ds = output().to_dataset()
    assert curves.stated_error(ds, "y").values.tolist() == [0.0] * 4
    ds.attrs["rtol"] = 1e-4
    assert curves.stated_error(ds, "y").values.tolist() == [1e-4] * 4
    each = ds.assign_coords(rtol=("x", [1e-3, 1e-4, 1e-5, 1e-6]))
    assert curves.stated_error(each, "y").values.tolist() == [1e-3, 1e-4, 1e-5, 1e-6]
    each["error_bound"] = ("x", [np.nan, 0.5, np.nan, 0.0])
    assert curves.stated_error(each, "y").values.tolist() == [1e-3, 0.5, 1e-5, 0.0]
    two = xr.DataArray(np.ones((4, 2)), dims=("x", "a"), coords={"x": X}, name="y").to_dataset()
    two["error_bound"] = two.y.transpose("a", "x") * 0.25
    assert curves.stated_error(two, "y").dims == ("x", "a")


# noise


def alternating(n, ratio):
    """Distances whose neighbours differ, in squares, by this ratio of their own: steps beside a wave."""
    wave = np.resize([1.0, -1.0], n)

    def of(level):
        off = wave + level
        return (np.diff(off) ** 2).sum() / (off**2).sum()

    low, high = 0.0, 100.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if of(middle) > ratio else (low, middle)
    return wave + low


@pytest.mark.parametrize(("n", "least"), [(100, 1.4), (64, 1.25), (36, 1.0), (16, 1.0)])
def test_noise_has_von_neumanns_ratio(n, least):
    """2 - 6/sqrt(n), but at least 1."""
    off = np.stack([alternating(n, least * 1.001), alternating(n, least * 0.999)])
    assert curves.scatter_is_noise(off, off).tolist() == [True, False]
    gappy = np.full((2, 2 * n), np.nan)
    gappy[:, ::2] = off
    assert curves.scatter_is_noise(gappy, gappy).tolist() == [True, False]
    assert curves.scatter_is_noise(off[None], off[None]).shape == (1, 2)


def test_what_rounding_leaves_is_no_noise():
    wave, z = np.resize([1.0, -1.0], 40), np.resize([-99.0, 3.0], 40)
    least = 8 * EPSILON * 100
    assert not curves.scatter_is_noise(0.999 * least * wave, z)
    assert curves.scatter_is_noise(1.001 * least * wave, z)
    assert not curves.scatter_is_noise(np.full(40, np.nan), z)


@pytest.mark.parametrize("n", [5, 6, 7, 8, 14, 15, 30])
def test_the_noise_of_a_curve_is_the_least_of_what_differences_leave(n):
    for off in (noise(n), np.exp(np.linspace(0, 3, n)), np.resize([1.0, 0.0, -1.0, 0.0], n)):
        sizes, rest = [np.inf], off
        for order in range(1, min(10, n - 4) + 1):
            rest = rest[1:] - rest[:-1]
            weights = np.polynomial.Polynomial([-1.0, 1.0]) ** order
            if order > 1:
                sizes.append(np.sqrt((rest**2).mean() / (weights.coef**2).sum()))
        assert curves.noise_of(off) == pytest.approx(min(sizes), rel=1e-9)
