"""Kinds and intervals of a line, and where two lines meet, against numpy's least squares and straight algebra."""

import numpy as np
import pytest
import xarray as xr
from neighbours import derivative

import sweep
from sweep.analysis import lines
from sweep.analysis.lines import KIND_WORDS, Given, crossover, judge
from sweep.analysis.loglog import line, tends
from sweep.analysis.scatter import Scatter

EPSILON = 2.0**-52
N = 12
T = np.linspace(-1.0, 1.0, N) + 0.02 * np.sin(5.0 * np.arange(N)) + 3.0
WAVE = np.resize([1.0, -1.0], N)
BLIND = Given(0.95, None, False)


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


@pytest.mark.parametrize(("share", "kind"), [(0.99, "exact"), (1.01, "curved")])
def test_distances_up_to_eight_roundings_are_none(share, kind, monkeypatch):
    monkeypatch.setattr(lines, "rounding", lambda t, z: abs(off_line(z)).max() / (8 * share))
    assert judged(-0.5 * T + 1e-3 * WAVE, noise=False).kind == kind


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_interval_of_a_curve_is_the_range_of_its_slope(sign, monkeypatch):
    z = sign * np.exp(0.7 * (T - 3))
    bound = np.linspace(1e-4, 2e-4, N)
    found = judged(z, bound=bound)
    five, seven = derivative(T, 5), derivative(T, 7)
    moved = abs(five) @ (bound + least(z))
    doubt = (abs((five - seven) @ z) + moved).max()
    assert (found.kind, found.fits) == ("curved", False)
    assert found.low == pytest.approx((five @ z).min() - doubt, rel=1e-9)
    assert found.high == pytest.approx((five @ z).max() + doubt, rel=1e-9)
    expected = tends(T, five @ z, moved[0])[1], tends(-T[::-1], (five @ z)[::-1], moved[-1])[1]
    assert found.ends == pytest.approx(expected, rel=1e-9)
    monkeypatch.setattr(lines, "tends", lambda t, local, doubt: (0.0, doubt))
    assert judged(z, bound=bound).ends == pytest.approx((moved[0], moved[-1]), rel=1e-9)
    slope = np.polyfit(T, z, 1)[0]
    size = np.sqrt((off_line(z) ** 2).sum() / (N - 2) / ((T - T.mean()) ** 2).sum())
    assert found.error == pytest.approx(size, rel=1e-9)
    assert found.low < slope < found.high


def test_the_slope_of_the_line_is_in_the_range_of_a_curve(monkeypatch):
    z = np.exp(0.7 * (T - 3))
    slope = np.polyfit(T, z, 1)[0]
    for far, bounds in ((9.0, (slope, 9.0)), (-9.0, (-9.0, slope))):
        monkeypatch.setattr(lines, "slopes", lambda t, z, points, far=far: np.full(t.size, far))
        found = judged(z)
        assert (found.low, found.high) == pytest.approx(bounds, abs=1e-10)


def test_three_points_or_distances_of_rounding_show_no_kind_of_noise(monkeypatch):
    monkeypatch.setattr(lines, "scattered", None)  # is not asked
    three = judged(np.array([0.0, 1.3, 1.9]), np.arange(3.0), noise=True)
    assert (three.kind, three.fits) == ("any", False)
    exact = judged(0.3 - 0.7 * T, noise=True)
    assert (exact.kind, exact.fits) == ("any", True)
    assert judged(0.3 - 0.7 * T, noise="uneven").kind == "any"


def test_known_errors_are_taken_before_anything_is_asked():
    found = judged(-0.5 * T + 0.1 * WAVE, noise="outliers", sigma=0.1)
    assert (found.kind, found.fits, np.isnan(found.ends).all()) == ("weighted", True, True)
    assert found.error == pytest.approx(0.1 / np.sqrt(((T - T.mean()) ** 2).sum()))
    assert not judged(-0.5 * T + 0.1 * WAVE, sigma=0.01).fits


@pytest.mark.parametrize(
    ("noise", "kind", "bent", "runs", "expected"),
    [
        (None, "any", None, True, ("any", True, (1.0, 2.0))),
        (None, "any", (-3.0, 3.0), False, ("bent", False, (-3.0, 3.0))),
        (True, "uneven", (-3.0, 3.0), False, ("bent", False, (-3.0, 3.0))),
        ("uneven", "uneven", (-3.0, 3.0), True, ("uneven", True, (1.0, 2.0))),
        ("independent", "independent", (-3.0, 3.0), True, ("independent", False, (1.0, 2.0))),
        ("independent", "independent", (-3.0, 3.0), False, ("independent", True, (1.0, 2.0))),
    ],
)
def test_a_bend_is_looked_for_unless_the_kind_of_noise_is_said(monkeypatch, noise, kind, bent, runs, expected):
    weights, asked = np.linspace(1, 2, N), []
    monkeypatch.setattr(lines, "is_scatter", lambda *_: True)
    monkeypatch.setattr(lines, "scattered", lambda *_: Scatter(kind, weights, 0.25, 1.0, 2.0))
    monkeypatch.setattr(lines, "bend", lambda t, z, c, w: asked.append(w) or bent)
    monkeypatch.setattr(lines, "runs_deny", lambda _: runs)
    found = judged(-0.5 * T + 0.1 * WAVE, noise=noise)
    assert (found.kind, found.fits, (found.low, found.high)) == expected
    assert found.error == 0.25
    np.testing.assert_array_equal(found.weights, np.ones(N) if found.kind == "bent" else weights)
    assert len(asked) == (not isinstance(noise, str))
    for given in asked:
        np.testing.assert_array_equal(given, weights if kind == "uneven" else np.ones(N))


def test_where_nothing_is_said_scatter_is_what_a_test_finds(monkeypatch):
    asked = []
    monkeypatch.setattr(lines, "is_scatter", lambda t, off, z, bound: asked.append((off, bound)) or False)
    z = -0.5 * T + 0.1 * WAVE
    assert judged(z, bound=1e-3).kind == "curved"
    np.testing.assert_allclose(asked[0][0], off_line(z), atol=1e-12)
    assert asked[0][1].tolist() == [1e-3] * N
    judged(z, noise=False)
    judged(z, noise="independent")
    assert len(asked) == 1


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


def test_a_fit_says_of_each_kind_whether_it_is_noise():
    kinds = np.arange(-1.0, len(KIND_WORDS))
    kinds[0] = np.nan
    names = [*lines.Line._fields, *lines.JUDGED]
    fit = xr.Dataset({name: ("set", np.ones(kinds.size)) for name in names})
    fit["kind"], fit["error"] = ("set", kinds), ("set", np.full(kinds.size, 3.0))
    fit["exponent_error"] = ("set", np.r_[0.0, np.full(kinds.size - 1, 2.0)])
    found = lines._describe_fit(fit, curve(T), "x")
    noisy = dict(zip(KIND_WORDS, found.noisy.values[1:].tolist(), strict=True))
    assert noisy == {word: float(word not in ("exact", "bounded", "curved")) for word in KIND_WORDS}
    assert np.isnan(found.noisy[0])
    assert found.kind.values.tolist() == list(range(-1, len(KIND_WORDS)))
    assert found.level_error.values.tolist() == [1.0] + [1.5] * len(KIND_WORDS)
    assert found.prefactor_error.values.tolist() == [1.0] + [1.5] * len(KIND_WORDS)
    assert found.exponent_error.values.tolist() == [0.0] + [3.0] * len(KIND_WORDS)
    units = {name: variable.attrs["units"] for name, variable in found.data_vars.items()}
    seconds = {name for name, unit in units.items() if unit == "s"}
    assert seconds == {"prefactor", "prefactor_error", "level", "start", "stop"}
    assert {name for name, unit in units.items() if unit == "m"} == {"low", "high", "centre"}


def test_lines_of_an_array_each_have_their_points_and_their_errors():
    t = T[::-1]
    z = np.stack([0.3 - 0.7 * t, np.exp(0.5 * t), 0.2 + t])
    z[0, [0, 5]], z[2, 2:] = np.nan, np.nan
    bound = np.zeros((3, N))
    bound[0] = 1e-3
    rows = lines._lines(t, z, np.full((3, N), np.nan), bound, BLIND)
    names = [*lines.Line._fields, *lines.JUDGED]
    found = {name: rows[:, k] for k, name in enumerate(names)}
    words = [KIND_WORDS[int(k)] for k in found["kind"][:2]]
    assert words == ["bounded", "curved"]
    assert np.isnan(found["kind"][2])
    assert found["points"].tolist() == [10, N, 2]
    np.testing.assert_allclose(found["start"][:2], np.exp([z[0, -1], z[1, -1]]))
    np.testing.assert_allclose(found["stop"][:2], np.exp([z[0, 1], z[1, 0]]))
    np.testing.assert_allclose(found["exponent"][:2], line(t, z[:2]).exponent)
    np.testing.assert_array_equal(found["fits"][:2], [1, 0])


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


@pytest.mark.parametrize("noise", [None, True, False, *lines.KINDS])
def test_words_for_noise(noise):
    lines.check_noise(noise)
