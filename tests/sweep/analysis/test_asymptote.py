"""Corrections to scaling and plateaus."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import sweep
from sweep.analysis import asymptote
from sweep.analysis.asymptote import _outer
from sweep.analysis.fits import Found, fitted
from sweep.analysis.shapes import CORRECTION
from sweep.system.errors import SweepError

X = np.geomspace(0.8, 1e4, 41)


def curve(y, x=X):
    dims = ("set", "x")[-np.ndim(y) :]
    return xr.DataArray(y, {"x": x}, dims, name="y")


@pytest.mark.parametrize(("p", "strength", "fade"), [(-0.5, 0.8, 0.4), (0.3, -0.4, 0.7), (-1 / 3, 2.0, 2 / 3)])
@pytest.mark.parametrize("end", ["high", "low"])
def test_the_exponent_far_out_is_found_at_either_end(p, strength, fade, end):
    """x to 1/x turns one end into the other, and the sign of the exponent."""
    y = X**p * (1 + strength * X**-fade)
    found = sweep.fit_correction(curve(y) if end == "high" else curve(y[::-1], 1 / X[::-1]), "x", end=end)
    sign = 1 if end == "high" else -1
    assert float(found.exponent) == pytest.approx(sign * p, abs=1e-6)
    assert float(found.correction_exponent) == pytest.approx(sign * fade, abs=1e-5)
    assert float(found.exponent_low) <= sign * p + 1e-9
    assert float(found.exponent_high) >= sign * p - 1e-9
    assert float(found.correction) == pytest.approx(strength * X[-1] ** -fade, rel=1e-3)
    assert int(found.fits) == 1


@pytest.mark.parametrize(("p", "strength", "fade"), [(-0.5, 0.8, 0.4), (-1 / 3, 2.0, 2 / 3)])
def test_with_noise_the_profile_holds_the_truth(p, strength, fade):
    rng = np.random.default_rng(1)
    y = X**p * (1 + strength * X**-fade) * np.exp(0.01 * rng.standard_normal((60, X.size)))
    found = sweep.fit_correction(curve(y), "x")
    share = ((found.exponent_low <= p) & (p <= found.exponent_high)).mean()
    assert float(share) >= 0.87
    assert (found.noisy == 1).all()


def test_the_profile_is_that_of_lmfit():
    """lmfit's own walk, on the same sum of squares."""
    import lmfit

    rng = np.random.default_rng(2)
    z = np.log(X**-0.5 * (1 + 0.8 * X**-0.4)) + 0.01 * rng.standard_normal(X.size)
    found = sweep.fit_correction(curve(np.exp(z)), "x", confidence=0.95)
    model = lmfit.Model(lambda x, c, p, b, d: c + p * np.log(x) + np.log(1 + b * x**-d), independent_vars=["x"])
    start = model.make_params(c=0.0, p=-0.5, b=0.8, d=0.4)
    fit = model.fit(z, start, x=X)
    ends = lmfit.conf_interval(fit, fit, p_names=["p"], sigmas=[0.95])["p"]
    assert float(found.exponent_low) == pytest.approx(ends[0][1], abs=2e-3 * abs(ends[2][1] - ends[0][1]) + 2e-4)
    assert float(found.exponent_high) == pytest.approx(ends[2][1], abs=2e-3 * abs(ends[2][1] - ends[0][1]) + 2e-4)


def test_it_makes_no_difference_which_of_the_two_powers_the_fit_calls_the_law():
    """A e^(p s) (1 + B e^(-D (s - 1/2))) is A B e^(D/2) e^((p - D) s) (1 + e^(D (s - 1/2))/B)."""
    t = np.log(X)
    found = fitted(CORRECTION, t, np.log(X**-0.5 * (1 + 0.8 * X**-0.4)))
    strength, fade, level, slope = found.numbers
    other = found._replace(numbers=np.array([1 / strength, -fade, level, slope - fade]))
    np.testing.assert_allclose(_outer(other, t), _outer(found, t), rtol=1e-12)
    np.testing.assert_allclose(_outer(other, t)[:2], [-0.5, 0.4], atol=1e-6)


def test_a_plateau_is_found_where_there_is_one():
    rng = np.random.default_rng(3)
    x = np.geomspace(1e-3, 1e5, 161)
    bent = xr.DataArray((1 / x + x**-0.5 * 1e-6) * np.exp(0.01 * rng.standard_normal(161)), {"x": x}, "x", name="y")
    low = sweep.fit_exponent(bent, "x", towards="low")
    assert low.attrs["plateau"] == 1
    assert low.attrs["exponent_low"] <= -1 <= low.attrs["exponent_high"]
    assert "plateau" in low.attrs["verdict"]
    assert (np.diff(low.high) < 0).all()


def test_a_plateau_is_denied_where_the_exponent_goes_on():
    y = curve(X**-0.5 * np.log(2 * X))
    found = sweep.fit_exponent(y, "x", towards="high")
    assert found.attrs["plateau"] == 0
    assert found.attrs["verdict"].startswith("no plateau: the exponent still goes from")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sweep.fit_correction(curve(X), "x", end="top"), 'end: expected "low" or "high"'),
        (lambda: sweep.fit_correction(curve(X), "x", (1, 2)), "at least 8 points"),
        (lambda: sweep.fit_exponent(curve(np.stack([X, X])), "x", towards="high"), "take one line"),
        (lambda: sweep.fit_exponent(curve(X)[:5], "x", towards="high"), "at least 8 points"),
    ],
)
def test_what_cannot_be_fitted_is_said(call, message):
    with pytest.raises(SweepError, match=message):
        call()


# the pieces, each against its formula written another way

T = np.linspace(1.0, 6.0, 21)


def law(strength, fade, exponent):
    """A fit over T, of numbers per window."""
    numbers = np.array([strength, fade, 0.3, exponent])
    return Found(CORRECTION, numbers, np.full(4, 0.2), np.zeros(T.size), 0.0, 0.0, 0.0)


@pytest.mark.parametrize("fade", [2.0, -2.0])
def test_the_law_far_out_is_the_larger_power_at_the_last_point(fade):
    """Per window of 5: powers are e^(-1.5 s) and B e^(-1.5 s - fade (s - 1/2))."""
    exponent, fading, left = _outer(law(0.8, fade, -1.5), T)
    other = 0.8 * np.exp(-fade / 2)
    expected = (-0.3, 0.4, other) if fade > 0 else (0.1, 0.4, 1 / other)
    np.testing.assert_allclose((exponent, fading, left), expected, rtol=1e-12)


def test_a_correction_without_size_or_end_is_told_as_such():
    assert _outer(law(0.0, -2.0, -1.5), T)[2] == np.inf
    assert _outer(law(1e-200, -700.0, -1.5), T)[2] == pytest.approx(1 / (1e-200 * np.exp(300.0)), rel=1e-9)


@pytest.mark.parametrize(
    ("share", "size", "scatters"),
    [(0.301, 0.1, True), (0.299, 0.1, False), (1.0, 4.1e-12, True), (1.0, 3.9e-12, False)],
)
def test_distances_scatter_by_the_share_of_noise_beyond_rounding(monkeypatch, share, size, scatters):
    off = size * np.where(np.arange(21) % 2, 1.0, -1.0)
    monkeypatch.setattr(asymptote, "noise_size", lambda *_: share * size)
    assert asymptote._scatters(T, np.full(21, -3.0), off) == scatters


def test_without_scatter_the_interval_is_three_times_what_the_outer_half_says(monkeypatch):
    given = []

    def half(which, t, z):
        given.append((which, t, z))
        return law(0.1, 1.0, -1.5)

    monkeypatch.setattr(asymptote, "fitted", half)
    monkeypatch.setattr(asymptote, "slope_bounds", lambda t, bound, points: bound * 1e9 * points)
    low, high = asymptote._by_half(T, -T, -0.5)
    (which, t, z), *_ = given
    assert which is CORRECTION
    np.testing.assert_array_equal(t, T[10:])
    np.testing.assert_array_equal(z, -T[10:])
    reach = 3 * abs(-1.5 / 2.5 + 0.5) + 5 * 1e9 * 1e-15 * 7
    assert (low, high) == (pytest.approx(-0.5 - reach, rel=1e-12), pytest.approx(-0.5 + reach, rel=1e-12))


def test_where_the_outer_half_is_too_short_its_last_local_exponent_counts():
    """A quartic, of which five points know the slope."""
    t = np.linspace(0.0, 1.0, 9)
    low, high = asymptote._by_half(t, t**4, 3.5)
    assert (low, high) == (pytest.approx(3.5 - 1.5, abs=1e-9), pytest.approx(3.5 + 1.5, abs=1e-9))


@pytest.mark.parametrize("angle", [-np.pi / 2, 0.0, 0.7, np.pi / 2])
def test_distances_from_a_correction_are_those_at_its_best_level(angle):
    s = np.linspace(0, 1, 21)
    z = np.cos(3 * s)
    fade = np.exp(np.interp(np.sin(angle), [-1, 1], np.log([0.3, 80.0])))
    law_there = np.log(s**0 + 0.4 * np.exp(fade / 2) / np.exp(fade * s)) - 1.2 * s
    found = asymptote._beside(s, z, np.array([0.4, angle]), -1.2)
    np.testing.assert_allclose(found, law_there - z - (law_there - z).mean(), atol=1e-10)


def test_points_where_a_correction_is_beyond_minus_one_are_far_from_it():
    """1 - 2 e^(-fade (s - 1/2)) is positive from s = 1/2 + ln 2/fade on."""
    s = np.linspace(0, 1, 21)
    fade = np.sqrt(0.3 * 80)
    found = asymptote._beside(s, np.zeros(21), np.array([-2.0, 0.0]), 0.0)
    exists = s > 0.5 + np.log(2) / fade
    np.testing.assert_array_equal(found[~exists], 10.0)
    law_there = np.log(1 - 2 * np.exp(-fade * (s[exists] - 0.5)))
    np.testing.assert_allclose(found[exists], law_there - law_there.mean(), atol=1e-12)
    np.testing.assert_array_equal(asymptote._beside(s, np.zeros(21), np.array([-1e9, 0.0]), 0.0), 10.0)


@pytest.mark.parametrize(("step", "side"), [(0.05, 1), (-0.4, -1)])
def test_an_edge_is_where_the_profile_passes_its_threshold(monkeypatch, step, side):
    monkeypatch.setattr(asymptote, "_least", lambda off, here: here)
    monkeypatch.setattr(asymptote, "_beside", lambda s, z, bent, slope: np.array([slope - 0.2, 0.0]))
    found = asymptote._edge(T, T, np.array([0.0, 0.0, 0.2]), step, 0.49)
    last = abs(step) * 1.4 ** np.ceil(np.log(1 + 0.7 * 0.4 / abs(step)) / np.log(1.4))
    assert 0 <= side * (found - (0.2 + side * 0.7)) <= last / 2**12


def test_a_profile_that_never_passes_its_threshold_has_no_edge(monkeypatch):
    asked = []
    monkeypatch.setattr(asymptote, "_least", lambda off, here: here)
    monkeypatch.setattr(asymptote, "_beside", lambda s, z, bent, slope: asked.append(slope) or np.zeros(2))
    assert asymptote._edge(T, T, np.array([0.0, 0.0, 0.2]), -0.1, 1.0) == -np.inf
    assert len(asked) == 40
    np.testing.assert_allclose(asked[:4], 0.2 - 0.1 * np.array([1, 2.4, 4.36, 7.104]), rtol=1e-12)


@pytest.mark.parametrize("fade", [3.0, -3.0])
@pytest.mark.parametrize(("error", "scatter"), [(0.2, 0.01), (0.01, 0.05), (np.inf, 0.01)])
def test_a_profile_starts_at_the_fit_and_ends_where_students_t_says(monkeypatch, fade, error, scatter):
    """The same curve, whichever of its two powers is called the law."""
    s = np.linspace(0, 1, 21)
    found = law(0.8, fade, -1.5)
    found.errors[-1] = error
    z = np.log(1 + 0.8 * np.exp(-fade * (s - 0.5))) - 1.5 * s + scatter * np.cos(np.pi * np.arange(21))
    starts, edges = [], []
    monkeypatch.setattr(asymptote, "_least", lambda off, start: starts.append((start, off(start))) or start)
    monkeypatch.setattr(asymptote, "_edge", lambda *given: edges.append(given) or given[3])
    ends = asymptote._profile(T, z, found, 0.9)
    ((start, off),) = starts
    expected = -scatter * np.cos(np.pi * np.arange(21))
    np.testing.assert_allclose(off, expected - expected.mean(), atol=2e-3)  # the angle is 0.999 of its sine
    assert start[2] == pytest.approx(-1.5 - min(fade, 0), rel=1e-12)
    assert start[0] == pytest.approx(0.8 ** np.sign(fade), rel=1e-12)
    least = float(off @ off)
    first = min(2.0, max(error, 0.3 * np.sqrt(least / 17)))
    assert [given[3] for given in edges] == [pytest.approx(-first, rel=1e-12), pytest.approx(first, rel=1e-12)]
    wanted = least * (1 + stats.t.ppf(0.95, 17) ** 2 / 17)
    assert [given[4] for given in edges] == pytest.approx([wanted, wanted], rel=1e-9)
    np.testing.assert_allclose(ends, [-first / 5, first / 5], rtol=1e-12)


@pytest.mark.parametrize(("strength", "fits"), [(0.99, 1), (1.01, 0)])
def test_a_correction_fits_where_it_is_less_than_one_far_out(monkeypatch, strength, fits):
    found = law(strength * np.exp(1.0), 2.0, -1.5)._replace(off=np.linspace(-0.2, 0.1, 21))
    monkeypatch.setattr(asymptote, "fitted", lambda *_: found)
    monkeypatch.setattr(asymptote, "_profile", lambda *_: (-0.4, -0.1))
    monkeypatch.setattr(asymptote, "_scatters", lambda *_: True)
    numbers = asymptote._one(-T, T, -1.0, 0.95)
    np.testing.assert_allclose(numbers, [0.3, 0.1, 0.4, -0.4, strength, np.exp(0.2) - 1, 1, fits], rtol=1e-12)


def test_seven_points_are_too_few_for_a_correction_and_eight_are_not():
    z = -0.5 * T + np.log(1 + 0.5 * np.exp(-T))
    assert np.isfinite(asymptote._one(T[:8], z[:8], 1.0, 0.95)).all()
    assert np.isnan(asymptote._one(T[:7], z[:7], 1.0, 0.95)).all()


@pytest.mark.parametrize("end", ["low", "high"])
def test_windows_shrink_by_half_as_much_again_to_one_end(end):
    """Of 41 points over four decades, eight are in 10^(0.7) and more."""
    x = np.geomspace(1, 1e4, 41)
    found = sweep.fit_exponent(curve(x**-0.5, x), "x", towards=end)
    shares = 4 * 1.5 ** -np.arange(8.0)
    shares = shares[np.floor(10 * shares + 1e-9) + 1 >= 8]
    assert found.sizes["window"] == shares.size == 5
    steps = np.floor(10 * shares + 1e-9) / 10
    lows, highs = (10 ** (4 - steps), np.full(5, 1e4)) if end == "high" else (np.ones(5), 10**steps)
    np.testing.assert_allclose(found.points, 10 * steps + 1)
    assert (found.low <= lows * (1 + 1e-9)).all()
    assert (found.high >= highs * (1 - 1e-9)).all()
    assert sweep.fit_exponent(curve(x[:8] ** -0.5, x[:8]), "x", towards=end).sizes["window"] == 1
