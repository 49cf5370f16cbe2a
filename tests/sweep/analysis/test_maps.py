"""Exponents over two parameters and the lines between regimes."""

import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.analysis import maps
from sweep.analysis.maps import contours, exponent_map, fraction
from sweep.system.errors import SweepError

MU, A = np.geomspace(1e-3, 1e3, 121), np.geomspace(0.1, 10, 41)


def period():
    """1/x + x^(-1/3) of x = mu/a: regimes meet along straight lines mu ~ a."""
    x = MU[:, None] / A
    coords = {"mu": ("mu", MU, {"units": "rad/s^2"}), "a": ("a", A, {"units": "1/s"})}
    return xr.DataArray(1 / x + x ** (-1 / 3), coords, ("mu", "a"), name="period")


def test_lines_of_an_exponent_are_where_theory_has_them():
    """The exponent -(1/x + x^(-1/3)/3)/(1/x + x^(-1/3)) is -1/2 where x^(2/3) = 3."""
    found = exponent_map(period(), "mu", (-0.5,))
    assert found.exponent.dims == ("mu", "a")
    ratio = found.mu_on_border / found.a_on_border
    np.testing.assert_allclose(ratio, 3**1.5, rtol=2e-3)
    assert set(found.line.values) == {0}
    assert float(found.a_on_border.min()) == pytest.approx(0.1)
    assert float(found.a_on_border.max()) == pytest.approx(10)
    assert found.mu_on_border.attrs["units"] == "rad/s^2"


def test_several_levels_have_their_lines_and_one_that_is_not_met_has_none():
    found = contours(np.log(period()), (0.0, 1.0, 99.0))
    assert set(found.level.values) == {0.0, 1.0}
    at = found.where(found.level == 1.0, drop=True)
    x = (at.mu / at.a).values
    np.testing.assert_allclose(1 / x + x ** (-1 / 3), np.e, rtol=1e-3)
    assert contours(period(), (1e9,)).sizes["point"] == 0


def test_no_line_crosses_what_has_no_value():
    gap = period().where(abs(np.log(period().a)) > 0.5)
    found = contours(gap, (1.5,))
    assert len(set(found.line.values)) == 2
    assert not ((found.a > 0.7) & (found.a < 1.4)).any()


def test_linear_axes_are_interpolated_linearly():
    x, y = np.linspace(-1, 1, 21), np.linspace(0, 2, 11)
    field = xr.DataArray(x[:, None] + y, {"x": x, "y": y}, ("x", "y"), name="sum")
    found = contours(field, (0.5,))
    np.testing.assert_allclose(found.x + found.y, 0.5, atol=1e-12)


@pytest.mark.parametrize(("level", "text"), [(-1 / 3, "-1/3"), (0.5, "1/2"), (-1.0, "-1"), (0.27318, "0.273")])
def test_levels_are_written_as_people_do(level, text):
    assert fraction(level) == text


def test_what_is_no_map_is_told():
    with pytest.raises(SweepError, match="1 dimensions"):
        contours(period()[:, 0], (1.0,))
    with pytest.raises(SweepError, match="a has no two numbers"):
        contours(period()[:, :1], (1.0,))


def test_a_real_sweep_gives_the_regimes_of_the_foliot_as_a_dataset(tmp_path):
    axes = {"mu": {"spacing": "log", "start": 1e-3, "stop": 1e3, "num": 61}, "a": np.geomspace(0.5, 2.0, 13)}
    ds = sweep.run(sweep.study(kernel="foliot", axes=axes, fixed={"phi0": 1.0}, outputs=["period"]))
    found = sweep.exponent_map(ds.period, "mu", (-0.9, -0.5))
    alpha = found.mu_on_border / found.a_on_border**2
    for level in (-0.9, -0.5):
        here = alpha.values[found.level.values == level]
        assert np.ptp(here) / here.mean() < 0.02
    found.to_netcdf(tmp_path / "map.nc", engine="h5netcdf")


@pytest.mark.parametrize(
    ("level", "text"),
    [(5 / 12, "5/12"), (5 / 13, "0.385"), (0.5 + 0.9e-9, "1/2"), (0.5 + 1.1e-9, "0.5"), (-0.123456, "-0.123")],
)
def test_fractions_have_denominators_up_to_twelve(level, text):
    assert fraction(level) == text


def test_two_values_an_axis_are_enough_and_words_are_none():
    field = xr.DataArray([[0.0, 1.0], [2.0, 3.0]], {"x": [0, 1], "y": [0.0, 3.0]}, ("x", "y"), name="z")
    found = contours(field, (1.5,))
    np.testing.assert_allclose(2 * found.x + found.y / 3, 1.5, atol=1e-12)
    assert found.level.attrs == {"units": "1", "long_name": "z on the line"}
    with pytest.raises(SweepError, match="y has no two numbers"):
        contours(field.assign_coords(y=["a", "b"]), (1.5,))
    with pytest.raises(SweepError, match="x has no two numbers"):
        contours(field.drop_vars("x"), (1.5,))
    with pytest.raises(SweepError, match="3 dimensions"):
        contours(field.expand_dims("t"), (1.5,))


def test_one_axis_may_be_logarithmic_and_the_other_not():
    """ln x - y, straight in both."""
    x, y = np.geomspace(1, 1e4, 9), np.linspace(0, 9, 10)
    field = xr.DataArray(np.log(x)[:, None] - y, {"x": x, "y": y}, ("x", "y"), name="z", attrs={"units": "m"})
    found = contours(field, (0.3, -0.4))
    for at in (0.3, -0.4):
        one = found.where(found.level == at, drop=True)
        np.testing.assert_allclose(np.log(one.x) - one.y, at, atol=1e-12)
    np.testing.assert_array_equal(np.unique(found.line), [0, 1])
    np.testing.assert_array_equal(found.line == 0, found.level == 0.3)
    assert found.level.attrs["units"] == "m"


def test_borders_are_those_of_weak_scaled_and_strong_drive():
    found = exponent_map(period(), "mu")
    np.testing.assert_allclose(np.unique(found.level), [-0.5], rtol=1e-12)  # -1 and -1/3 are only tended to
    assert [fraction(border) for border in maps.BORDERS] == ["-1", "-1/2", "-1/3"]
