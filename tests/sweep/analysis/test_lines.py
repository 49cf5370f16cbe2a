"""Kinds and intervals of a line, and where two lines meet, against numpy's least squares and straight algebra."""

import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.analysis.lines import Given, crossover, judge

EPSILON = 2.0**-52
N = 12
T = np.linspace(-1.0, 1.0, N) + 0.02 * np.sin(5.0 * np.arange(N)) + 3.0
WAVE = np.resize([1.0, -1.0], N)


def curve(z, t=T, **attrs):
    return xr.DataArray(
        np.exp(z), {"x": ("x", np.exp(t), {"units": "m"})}, "x", name="y", attrs={"units": "s", **attrs}
    )


def judged(z, t=T, bound=0.0, noise=None, sigma=None):
    errors = np.full(t.size, np.nan if sigma is None else sigma)
    return judge(t, z, errors, np.broadcast_to(bound, t.shape), Given(0.95, noise, sigma is not None))


def off_line(z, t=T):
    return z - np.polyval(np.polyfit(t, z, 1), t)


def least(z, t=T):
    return EPSILON * (1 + abs(z).max() + abs((z[-1] - z[0]) / (t[-1] - t[0])) * abs(t).max())


# what the distances are


@pytest.mark.parametrize("size", [0.0, 1e-3])
def test_what_errors_can_do_to_a_line_without_scatter(size):
    bound = size * np.linspace(0.5, 1.0, N)
    z = 0.3 - 0.7 * T
    found = judged(z, bound=bound, noise=False)
    u = T - T.mean()
    reach = (abs(u) * (bound + least(z))).sum() / (u**2).sum() + least(z) / np.ptp(T)
    assert found.kind == ("bounded" if size else "exact")
    assert found.high - found.low == pytest.approx(2 * reach, rel=0.1, abs=0)  # the ends are rounded, too
    assert found.high + found.low == pytest.approx(-1.4)
    assert found.ends == pytest.approx((-0.7, -0.7))
    assert found.fits
    np.testing.assert_array_equal(found.weights, np.ones(N))


@pytest.mark.parametrize(("share", "kind"), [(0.999, "bounded"), (1.001, "curved")])
def test_distances_up_to_twice_the_bound_are_of_it(share, kind):
    z = -0.5 * T + 1e-3 * WAVE
    bound = abs(off_line(z)) / (2 * share)
    assert judged(z, bound=bound, noise=False).kind == kind


def test_known_errors_are_taken_before_anything_is_asked():
    found = judged(-0.5 * T + 0.1 * WAVE, noise="outliers", sigma=0.1)
    assert (found.kind, found.fits, np.isnan(found.ends).all()) == ("weighted", True, True)
    assert found.error == pytest.approx(0.1 / np.sqrt(((T - T.mean()) ** 2).sum()))
    assert not judged(-0.5 * T + 0.1 * WAVE, sigma=0.01).fits


# the numbers of a fit


def test_known_errors_make_all_errors_of_a_fit():
    sigma = np.linspace(0.05, 0.2, N)
    z = 0.3 - 0.7 * T + 0.5 * sigma * WAVE
    y = curve(z)
    found = sweep.fit_exponent(y, "x", sigma=sigma * y)
    weights = sigma**-2
    columns = np.column_stack([np.ones(N), T])
    covariance = np.linalg.inv(columns.T @ (columns * weights[:, None]))
    level, slope = covariance @ columns.T @ (weights * z)
    assert float(found.exponent) == pytest.approx(slope)
    assert float(found.exponent_error) == pytest.approx(covariance[1, 1] ** 0.5)
    assert float(found.prefactor_error) == pytest.approx(np.exp(level) * covariance[0, 0] ** 0.5)
    assert float(found.level_error) == pytest.approx(weights.sum() ** -0.5)
    assert float(found.centre) == pytest.approx(np.exp(np.average(T, weights=weights)))
    assert (float(found.start), float(found.stop)) == pytest.approx(tuple(np.exp(z[[0, -1]])))


# where two laws meet


def fits(**other):
    """Laws 8/x about 1e-3 and 5 x^(-1/3) about 1e3 without errors, and with what is given of both."""
    found = []
    for k, (slope, factor, places) in enumerate([(-1.0, 8.0, (1e-4, 1e-3, 1e-2)), (-1 / 3, 5.0, (1e2, 1e3, 1e4))]):
        low, centre, high = places
        values = {"low": low, "centre": centre, "high": high, "exponent": slope, "exponent_error": 0.0}
        values |= {"level": factor * centre**slope, "level_error": 0.0}
        values |= {"start": factor * low**slope, "stop": factor * high**slope}
        values |= {"limit_low": np.nan, "limit_high": np.nan} | {name: pair[k] for name, pair in other.items()}
        one = xr.Dataset(values, attrs={"y": "y", "x": "x", "method": "m"})
        one.centre.attrs, one.level.attrs = {"units": "m"}, {"units": "s"}
        found.append(one)
    return found


def meeting(low, high):
    """ln x where lines (slope, x, y) meet."""
    rows = [[1.0, -slope] for slope, _, _ in (low, high)]
    return np.linalg.solve(rows, [np.log(y) - slope * np.log(x) for slope, x, y in (low, high)])[1]


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("limits", [(-1.1, -0.2), (-0.9, -0.4), (np.nan, -0.2), (-1.1, np.nan)])
def test_the_place_moves_as_far_as_lines_through_the_outer_ends_do(limits, swapped):
    low, high = fits(limit_low=(limits[0], 77.0), limit_high=(77.0, limits[1]))
    found = crossover(high, low) if swapped else crossover(low, high)
    inner = (-1.0, 1e-3, 8 / 1e-3), (-1 / 3, 1e3, 5 * 1e3 ** (-1 / 3))
    outer = (limits[0], 1e-4, 8 / 1e-4), (limits[1], 1e4, 5 * 1e4 ** (-1 / 3))
    place = meeting(*inner)
    pairs = [(inner[0], outer[1]), (outer[0], inner[1]), outer]
    moved = max(abs(meeting(*pair) - place) for pair in pairs if np.isfinite([pair[0][0], pair[1][0]]).all())
    assert float(found.abscissa) == pytest.approx(1.6**1.5)
    assert float(found.ordinate) == pytest.approx(8 / 1.6**1.5)
    assert float(found.abscissa_error) == pytest.approx(1.6**1.5 * moved)
    assert found.attrs == {"y": "y", "x": "x", "method": "m"}
    assert [found[name].attrs["units"] for name in ("abscissa", "abscissa_error", "ordinate")] == ["m", "m", "s"]


def test_errors_of_both_kinds_add_in_squares():
    errors = {"exponent_error": (0.01, 0.02), "level_error": (0.03, 0.04)}
    bend = {"limit_low": (-1.1, 77.0), "limit_high": (77.0, -0.2)}
    noise, system, both = (float(crossover(*fits(**keys)).abscissa_error) for keys in (errors, bend, errors | bend))
    assert both == pytest.approx(np.hypot(noise, system))
    place = 1.5 * np.log(1.6)
    away = np.array([place - np.log(1e-3), place - np.log(1e3)])
    variance = 0.03**2 + 0.04**2 + (0.01 * away[0]) ** 2 + (0.02 * away[1]) ** 2
    assert noise == pytest.approx(1.6**1.5 * variance**0.5 / (2 / 3))


@pytest.mark.parametrize(("share", "meet"), [(0.999, True), (1.001, False)])
def test_exponents_differ_by_more_than_both_their_errors(share, meet):
    size = 2 / 3 * share
    pair = fits(exponent_error=(0.6 * size, 0.8 * size))
    if meet:
        assert np.isfinite(crossover(*pair).abscissa)
    else:
        with pytest.raises(sweep.SweepError, match="the same exponent within their errors"):
            crossover(*pair)


@pytest.mark.parametrize(("low", "high", "apart"), [(1e-2, 1e3, True), (1e-3, 1e3, False), (1e-5, 1e-4, True)])
def test_windows_may_share_an_end_and_no_more(low, high, apart):
    first, second = fits(low=(1e-4, low), high=(1e-2, high))
    for pair in ((first, second), (second, first)):
        if apart:
            crossover(*pair)
        else:
            with pytest.raises(sweep.SweepError, match="the windows of the two fits overlap"):
                crossover(*pair)


@pytest.mark.parametrize("name", ["x", "y"])
def test_fits_of_different_curves_do_not_meet(name):
    for low, high in (("a", "b"), ("b", "a")):
        pair = fits()
        pair[0].attrs[name], pair[1].attrs[name] = low, high
        with pytest.raises(sweep.SweepError, match=f"the fits are of different {name}: {low}, {high}"):
            crossover(*pair)
