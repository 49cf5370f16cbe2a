"""Corrections to scaling and plateaus."""

import numpy as np
import pytest
import xarray as xr

import sweep
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
