"""Two laws, corrections, collapses and the comparison of laws: what data were made of is found, with its numbers."""

import tracemalloc

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import curve_fit
from scipy.stats import chi2

import sweep

X = np.geomspace(2, 2e4, 61)
T = np.log(X / 200)


def line(z, x=X):
    return xr.DataArray(np.exp(z), {"x": ("x", x, {"units": "m"})}, "x", name="y", attrs={"units": "s"})


def two(t, level, low, high, place, log_width):
    w = np.exp(log_width)
    return level + low * (t - place) + (high - low) * w * np.logaddexp(0, (t - place) / w)


# two laws, corrections, collapses


@pytest.mark.parametrize("decades", [0.05, 0.3, 0.8])
@pytest.mark.parametrize(("low", "high"), [(-1.0, -1 / 3), (0.5, 2.0), (0.0, -0.25)])
def test_the_law_it_is_made_of_is_found_to_rounding(low, high, decades):
    w = decades * np.log(10)
    found = sweep.fit_two_laws(line(two(T, 0.4, low, high, 0.5, np.log(w))), "x")
    np.testing.assert_allclose(found.exponent, [low, high], atol=1e-7)
    expected = (200 * np.exp(0.5), decades, np.exp(0.4))
    assert (float(found.crossover), float(found.width), float(found.level)) == pytest.approx(expected, rel=1e-5)
    assert float(found.residual) < 1e-8
    assert (int(found.regimes), int(found.points)) == (2, 61)
    units = {"crossover": "m", "crossover_low": "m", "level": "s", "exponent": "1", "width": "1"}
    assert {name: found[name].attrs["units"] for name in units} == units


@pytest.mark.parametrize("power", [0.0, -0.5])
def test_where_one_law_holds_to_rounding_nothing_meets_anywhere(power):
    found = sweep.fit_two_laws(line(power * T - 4.0 * power), "x")  # ones, too
    assert int(found.regimes) == 1
    assert all(np.isnan(float(found[name])) for name in ("crossover", "width", "level"))
    assert (float(found.crossover_low), float(found.crossover_high)) == (0.0, np.inf)
    assert ((found.exponent_low <= power + 1e-12) & (found.exponent_high >= power - 1e-12)).all()
    over_two = line(power * T - 4.0 * power).expand_dims(a=[1.0, 2.0])
    assert sweep.exponent_map(over_two, "x", [power]).sizes["point"] == 0


def test_two_laws_with_noise_are_those_of_scipys_least_squares():
    z = two(T, 0.4, -1.0, -1 / 3, 0.5, -0.3) + 0.01 * np.random.default_rng(3).standard_normal(T.size)
    best, _ = curve_fit(two, T, z, (0.4, -1.0, -0.3, 0.5, -0.3), xtol=1e-12, ftol=1e-12)
    found = sweep.fit_two_laws(line(z), "x", noise="even")
    np.testing.assert_allclose(found.exponent, best[1:3], rtol=1e-5)
    assert np.log(float(found.crossover) / 200) == pytest.approx(best[3], rel=1e-4)
    compared = sweep.compare_laws(line(z), "x").sel(law="two laws")
    np.testing.assert_allclose(np.log(compared.fitted), two(T, *best), atol=1e-5)  # a thousandth of the noise
    assert float(compared.scatter) == pytest.approx(np.sqrt(np.mean((z - two(T, *best)) ** 2)))
    y = line(z)
    y[[5, 30]] = np.nan
    assert int(sweep.fit_two_laws(y, "x").points) == 59


@pytest.mark.parametrize(("p", "strength", "fade"), [(-0.5, 0.8, 0.4), (0.3, -0.4, 0.7), (-1 / 3, 2.0, 2 / 3)])
@pytest.mark.parametrize("end", ["high", "low"])
def test_the_exponent_far_out_is_found_at_either_end(p, strength, fade, end):
    """x to 1/x turns one end into the other, and the sign of the exponent."""
    x = np.geomspace(0.8, 1e4, 41)
    z = np.log(x**p * (1 + strength * x**-fade))
    found = sweep.fit_correction(line(z, x) if end == "high" else line(z[::-1], 1 / x[::-1]), "x", end=end)
    sign = 1 if end == "high" else -1
    assert float(found.exponent) == pytest.approx(sign * p, abs=1e-6)
    assert float(found.correction_exponent) == pytest.approx(sign * fade, abs=1e-5)
    assert float(found.exponent_low) - 1e-9 <= sign * p <= float(found.exponent_high) + 1e-9
    assert float(found.correction) == pytest.approx(strength * x[-1] ** -fade, rel=1e-3)
    assert int(found.fits) == 1


SIZES, PLACES = np.array([1.0, 2.0, 4.0, 8.0, 16.0]), np.geomspace(0.01, 100, 25)


def curves(a, b, f=lambda u: 1 / (u + u**0.2)):
    u = PLACES / SIZES[:, None] ** a
    return xr.DataArray(SIZES[:, None] ** b * f(u), {"L": SIZES, "x": PLACES}, ("L", "x"), name="y")


@pytest.mark.parametrize(("a", "b"), [(1.5, 0.7), (-0.6, 1.2), (0.0, 0.5)])
def test_the_exponents_of_a_collapse_are_found_without_a_start_and_points_without_a_partner_are_counted(a, b):
    y = curves(a, b)
    found = sweep.fit_collapse(y, "x", "L")
    assert (float(found.x_exponent), float(found.y_exponent)) == pytest.approx((a, b), abs=1e-4)
    assert int(found.points + found.dropped) == 125
    assert found.scatter.attrs["long_name"].endswith("root mean square")
    y[0, :3], y[1, 4] = np.nan, -1.0
    gappy = sweep.fit_collapse(y, "x", "L")
    assert int(gappy.points + gappy.dropped) == 125
    assert int(gappy.dropped) >= int(found.dropped) + 4
    assert float(gappy.x_exponent) == pytest.approx(a, abs=1e-3)


# which law


def bent(slope):
    """ln y from slope -1 to -1/3 about T = 0, by a share of it that rises from 0 to 1."""
    fine = np.linspace(-60, 60, 240_001)
    share = slope(fine / 0.6)
    return -T + 2 / 3 * np.interp(T, fine, np.r_[0.0, np.cumsum(0.5 * (share[1:] + share[:-1]))] * (fine[1] - fine[0]))


def logistic(v):
    return 0.5 * (1 + np.tanh(0.5 * v))


TRUTHS = {
    "one law": -0.5 * T,
    "logarithm": -0.5 * T + np.log(np.log(X)),
    "offset": np.log(1 / X + 0.01),
    "correction to scaling": np.log(X**-0.3 * (1 + 5 * X**-0.8)),
    "two laws": two(T, 0.0, -1.0, -1 / 3, 0.0, np.log(0.4)),
    "two laws, hyperbola": -T + 1 / 3 * (T + np.hypot(T, 1.4)),
    "two laws, two widths": bent(lambda v: logistic(np.where(v < 0, 2 * v, 0.5 * v))),
    "two laws, three scales": bent(lambda v: (logistic(v / 3) + logistic(v) + logistic(3 * v)) / 3),
    "three laws": -T + 0.6 * np.logaddexp(0, (T + 2) / 0.3) * 0.3 + 0.9 * np.logaddexp(0, (T - 2) / 0.3) * 0.3,
}


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", TRUTHS)
def test_the_law_that_data_were_made_of_is_not_ruled_out_and_no_simpler_one_is_left(name, noise):
    rng = np.random.default_rng(1)
    found = sweep.compare_laws(line(TRUTHS[name] + noise * rng.standard_normal(X.size)), "x")
    if noise:
        assert float(found.worse.sel(law=name)) <= 10
    else:
        assert found.attrs["chosen"] == name
        assert float(found.residual.sel(law=name)) < 1e-5
    alive = found.isel(law=np.flatnonzero(found.worse <= 10))
    assert int(found.numbers.sel(law=found.attrs["chosen"])) == int(alive.numbers.min())
    assert ("not ruled out beside it" in found.attrs["verdict"]) == (alive.sizes["law"] > 1)
    # AICc of least squares, with the size of the noise as one number more; one law may have a better kind of noise
    n, k = X.size, found.numbers + 1
    aicc = n * np.log(found.scatter**2) + 2 * k + 2 * k * (k + 1) / (n - k - 1)
    if noise:
        others = found.law != "one law"
        np.testing.assert_allclose(found.aicc[others], aicc[others])
        np.testing.assert_allclose(found.bic[others], (n * np.log(found.scatter**2) + k * np.log(n))[others])
        one = found.sel(law="one law")
        apart = [k * np.log(n) - 2 * k - 2 * k * (k + 1) / (n - k - 1) for k in (3, 4)]
        assert min(abs(float(one.bic - one.aicc) - apart[0]), abs(float(one.bic - one.aicc) - apart[1])) < 1e-9


def test_a_bend_with_a_number_more_is_never_further_from_the_points_than_without():
    rng = np.random.default_rng(3)
    for seed in range(20):
        z = rng.choice(list(TRUTHS.values())) + rng.choice([1e-3, 0.03, 0.3]) * rng.standard_normal(X.size)
        found = sweep.compare_laws(line(z), "x").scatter
        for law in ("two laws, two widths", "two laws, three scales"):
            assert float(found.sel(law=law)) <= float(found.sel(law="two laws")) * (1 + 1e-12), seed


LINEAR = np.linspace(1.0, 100.0, 40)
NO_POWER_LAWS = {
    "exponential": -LINEAR / 20,
    "stretched exponential": -((LINEAR / 20) ** 0.6),
    "cut-off": -0.5 * np.log(LINEAR) - LINEAR / 20,
    "cut-off at both ends": -0.5 * np.log(LINEAR) - (LINEAR / 20) ** 0.8 - (5 / LINEAR) ** 0.8,
    "lognormal": -0.5 * np.log(LINEAR / 10) ** 2,
    "two exponentials": np.log(np.exp(-LINEAR / 5) + 0.1 * np.exp(-LINEAR / 40)),
}


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", NO_POWER_LAWS)
def test_other_functions_are_called_no_power_law_and_have_no_exponents(name, noise):
    z = NO_POWER_LAWS[name] + noise * np.random.default_rng(6).standard_normal(40)
    found = sweep.fit_two_laws(line(z, LINEAR), "x")
    assert (str(found.verdict.values), int(found.regimes)) == ("no power law", 0)
    assert all(np.isnan(found[key]).all() for key in ("exponent", "exponent_low", "crossover", "crossover_high"))
    assert str(sweep.fit_exponent(line(z, LINEAR), "x").verdict.values) == "no power law"
    assert noise or sweep.fit_correction(line(z, LINEAR), "x").verdict.item() == "no law at this end"
    compared = sweep.compare_laws(line(z, LINEAR), "x")
    assert float(compared.worse.sel(law=name)) < 10
    assert noise or (compared.chosen == name and "no power law" in compared.verdict)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_hyperbolic_secant_is_no_power_law_and_two_laws_are_no_exponentials(noise):
    scatter = noise * np.random.default_rng(2).standard_normal(40)
    for x in (LINEAR, np.geomspace(0.1, 30.0, 40)):
        found = sweep.fit_two_laws(line(-np.log(np.cosh(x / 10)) + scatter, x), "x")
        assert str(found.verdict.values) == "no power law"
    assert int(sweep.fit_two_laws(line(two(T, 0.0, -1.0, -2.0, 0.0, 0.0)[20:40], X[20:40]), "x").regimes) == 2


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(
    "factor", [1 + 0.5 * np.exp(-(T**2) / 8), 1 + 0.5 / (1 + T**2 / 2), 1 - 0.4 * np.exp(-(T**2) / 8)]
)
def test_a_broad_peak_on_one_law_is_not_called_two(factor, noise):
    z = -0.5 * T + np.log(factor) + noise * np.random.default_rng(4).standard_normal(X.size)
    assert int(sweep.fit_two_laws(line(z), "x").regimes) == 0
    assert sweep.compare_laws(line(z), "x").attrs["chosen"] == "peak"


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(
    ("law", "z"),
    [
        ("step", 0.3 * np.tanh(T)),
        ("step", 0.3 * np.tanh(4 * T)),
        ("lopsided peak", np.log1p(0.5 * np.exp(-(T**2) / np.where(T < 0, 3, 14)))),
    ],
)
def test_a_step_and_a_lopsided_peak_are_not_called_three_laws(law, z, noise):
    """Nor is what they are called another in the direction of 1/x."""
    z = z - 0.5 * T + noise * np.random.default_rng(4).standard_normal(X.size)
    for y in (line(z), line(z[::-1])):
        assert str(sweep.fit_two_laws(y, "x").verdict.values) == "no power law"
        assert sweep.compare_laws(y, "x").attrs["chosen"] == law


def test_three_laws_that_two_do_nearly_as_well_as_are_undecided():
    z = np.interp(T, [T[0], T[20], T[40], T[60]], np.cumsum([0.0, *(np.diff(T[[0, 20, 40, 60]]) * [-0.5, -0.4, -0.5])]))
    y = line(z + 0.01 * np.random.default_rng(3).standard_normal(X.size))
    assert str(sweep.fit_two_laws(y, "x").verdict.values) in ("undecided", "three laws")


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_three_laws_are_told_and_a_meeting_outside_the_window_is_none(noise):
    scatter = noise * np.random.default_rng(3).standard_normal(X.size)
    assert str(sweep.fit_two_laws(line(TRUTHS["three laws"] + scatter), "x").verdict.values) == "three laws"
    tail = sweep.fit_two_laws(line(two(T, 0.0, -1.0, -1 / 3, T[0] - 1.5, 0.3)), "x")
    t = np.linspace(400, 700, 30)  # a meeting beyond the largest number
    beyond = sweep.fit_two_laws(line(-0.1 * t + 90 * np.logaddexp(0, (t - 1000) / 100), np.exp(t)), "x")
    for found in (tail, beyond):
        assert (str(found.verdict.values), bool(np.isnan(found.crossover))) == ("no meeting in the window", True)


def test_few_points_leave_open_what_they_do_not_tell():
    x = np.geomspace(0.01, 100.0, 8)
    noise = 0.01 * np.random.default_rng(3).standard_normal(8)
    for z in (np.log(x / (1 + x)), np.log(-np.expm1(-x))):
        found = sweep.fit_two_laws(line(z + noise, x), "x")
        assert (str(found.verdict.values), int(found.regimes)) == ("undecided", 0)
        compared = sweep.compare_laws(line(z + noise, x), "x")
        assert float(compared.worse[compared.law.str.startswith("two laws")].min()) <= 10
        assert "no power law" not in compared.verdict


@pytest.mark.parametrize("power", [0.0, -0.5])
def test_one_law_is_one_law_with_a_correction_of_zero(power):
    for noise in (0.0, 0.02):
        y = line(1.1 + power * T + noise * np.random.default_rng(5).standard_normal(X.size))
        found = sweep.fit_correction(y, "x")
        assert (int(found.fits), float(found.exponent)) == (1, pytest.approx(power, abs=0.1 * noise + 1e-4))
        assert (found.verdict.item() == "one power law") == (found.correction.item() == 0)
        assert float(found.exponent_low) <= power <= float(found.exponent_high)
        compared = sweep.compare_laws(y, "x")
        assert compared.chosen == "one law"
        assert "none of them" not in compared.verdict


def test_a_correction_that_the_points_deny_has_no_interval():
    """Twelve sets, one or two of which may be described by chance."""
    x = np.geomspace(0.8, 1e4, 41)
    z = -0.5 * np.log(x) - 1 / x + 0.01 * np.random.default_rng(3).standard_normal((12, 41))
    y = xr.DataArray(np.exp(z), {"x": x}, ("set", "x"), name="y")
    found, known = sweep.fit_correction(y, "x"), sweep.fit_correction(y[0], "x", sigma=0.003 * y[0])
    assert float(found.fits.mean()) < 0.3
    assert (found.exponent_low.isnull() == (found.verdict == "no power law with a correction")).all()
    assert (int(known.fits), bool(known.exponent_high.isnull())) == (0, True)


@pytest.mark.parametrize("z", [lambda t: -0.5 * t - np.exp(-t), lambda t: -0.5 * t - np.log1p(2 * np.exp(-t))])
def test_without_noise_the_interval_of_a_correction_holds_what_curves_of_no_such_law_tend_to(z):
    t = np.log(np.geomspace(0.8, 1e4, 41))
    found = sweep.fit_correction(line(z(t), np.exp(t)), "x")
    assert (int(found.noisy), bool(found.exponent_low <= -0.5 <= found.exponent_high)) == (0, True)
    assert float(found.exponent_high - found.exponent_low) < 0.5


@pytest.mark.parametrize("fit", [sweep.fit_exponent, sweep.fit_correction, sweep.fit_two_laws])
def test_values_without_noise_that_are_given_twice_tell_what_they_tell_once(fit):
    t = np.log(np.geomspace(0.8, 1e4, 41))
    once, twice = (fit(line(two(at, 0.4, -1.0, -0.5, 4.0, 0.0), np.exp(at)), "x") for at in (t, np.repeat(t, 2)))
    for name in ("exponent_low", "exponent_high"):
        np.testing.assert_allclose(twice[name], once[name], atol=0.02)


def test_a_collapse_of_a_constant_is_refused_and_known_errors_are_taken():
    with pytest.raises(sweep.SweepError, match="not determined"):
        sweep.fit_collapse(xr.ones_like(curves(1.5, 0.7)), "x", "L")
    y = curves(1.5, 0.7) * np.exp(0.02 * np.random.default_rng(1).standard_normal((5, 25)))
    found, small = (sweep.fit_collapse(y, "x", "L", sigma=size * y.astype(np.longdouble)) for size in (0.02, 0.002))
    assert (int(found.fits), int(small.fits)) == (1, 0)
    assert float(found.x_exponent_low) < 1.5 < float(found.x_exponent_high)
    assert np.isnan(small.x_exponent_low)


def test_many_points_take_no_more_memory_than_they_need_and_overflow_nowhere():
    """Starts were once laid out over all 20,000 points: 650 MB; two laws took two squares of their points."""
    x, size = np.geomspace(0.01, 100, 2000), 2.0 ** np.arange(10)
    u = x / size[:, None] ** 0.5
    noise = 0.02 * np.random.default_rng(1).standard_normal(u.shape)
    y = xr.DataArray(size[:, None] ** 0.7 / (u + u**0.2) * np.exp(noise), {"L": size, "x": x}, ("L", "x"), name="y")
    tracemalloc.start()
    found, long = sweep.fit_collapse(y, "x", "L"), np.geomspace(1e-3, 1e3, 100_000)
    sweep.fit_two_laws(xr.DataArray(1 / long + long ** (-1 / 3), {"x": long}, "x", name="y"), "x")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e8
    assert float(found.x_exponent_low) < 0.5 < float(found.x_exponent_high) < 0.502


def test_known_errors_give_chi_squared_its_chance_and_weigh_the_points():
    z = TRUTHS["two laws"] + 0.02 * np.random.default_rng(4).standard_normal(X.size)
    right, small = (sweep.compare_laws(line(z), "x", sigma=size * line(z)) for size in (0.02, 0.005))
    assert float(right.chi_squared.sel(law="two laws")) > 1e-3
    assert float(right.chi_squared.sel(law="one law")) < 1e-6
    assert float(small.chi_squared.sel(law="two laws")) < 1e-6
    assert "none of them" in small.attrs["verdict"]
    assert "none of them" in sweep.compare_laws(line(-0.5 * T + 0.1 * np.sin(2 * T)), "x").attrs["verdict"]
    sigma = np.geomspace(0.01, 1.0, X.size)
    y = line(-0.5 * T + sigma * np.sin(17.0 * np.arange(X.size) ** 2))
    one = sweep.compare_laws(y, "x", (3.0, None), sigma=sigma * y).sel(law="one law")
    t, z, weights = T[X >= 3.0], np.log(y.values)[X >= 3.0], 1 / sigma[X >= 3.0]
    fit = np.polyval(np.polyfit(t, z, 1, w=weights), t)
    np.testing.assert_allclose(np.log(one.fitted), fit, atol=1e-6)
    square = float((((z - fit) * weights) ** 2).sum())
    assert float(one.chi_squared) == pytest.approx(chi2.sf(square, t.size - 2), rel=1e-6)
    assert float(one.bic) == pytest.approx(square + 2 * np.log(t.size))


def test_eight_points_are_enough_and_may_fall_or_have_gaps():
    y = line(-0.5 * T[:10] + 0.01 * np.sin(17.0 * np.arange(10) ** 2), X[:10])
    y[[2, 6]] = np.nan
    found = sweep.compare_laws(y[::-1], "x")
    np.testing.assert_allclose(found.x, np.delete(X[:10], [2, 6]))
    assert (found.x.attrs["units"], found.y.attrs["units"], found.fitted.attrs["units"]) == ("m", "s", "s")
    constant = sweep.compare_laws(line(0.0 * T), "x")  # all logarithms are 0, to rounding of which all laws are right
    assert np.isfinite(constant.aicc).all()
    assert constant.chosen == "one law"


@pytest.mark.parametrize(
    ("fit", "message"),
    [
        (lambda y: sweep.compare_laws(y[:7], "x"), "found 7 at 7"),
        (lambda y: sweep.compare_laws(y.expand_dims(a=[1.0, 2.0]), "x"), "one line"),
        (lambda y: sweep.compare_laws(-y, "x"), "positive values"),
        (lambda y: sweep.fit_correction(y.assign_coords(x=np.repeat([1.0, 9.0], 31)[:61]), "x"), "found 61 at 2"),
        (lambda y: sweep.fit_exponent(y, "x", bound=y.rename("other").to_dataset()), "Dataset has no "),
        (lambda y: sweep.fit_two_laws(y, "nu"), "no axis 'nu'"),
        (lambda y: sweep.local_exponent(y.drop_vars("x"), "x"), "no axis"),
        (lambda y: sweep.local_exponent(y.assign_coords(a=1.0), "a"), "one value"),
        (lambda y: sweep.fit_two_laws(y, ["x"]), "expected a name"),
        (lambda y: sweep.fit_collapse(y, "x", ["L"]), "L"),
        (lambda y: sweep.where_exponent(y, "x", "a"), "value: expected a number"),
        (lambda y: sweep.exponent_map(curves(1.5, 0.7, lambda u: u**-0.5), "x", "a"), "levels: expected a number"),
        (lambda y: sweep.fit_two_laws(y, "x", (1.0, 5.0)), "at least 8 points.* window 1 to 5"),
        (lambda y: sweep.fit_exponent(y, "x", (None, 0.5)), "found 0 at 0 in the window open to 0.5"),
        (lambda y: sweep.fit_exponent(y.expand_dims(a=[1.0])[:0], "x"), "found 0 at 0"),
        (lambda y: sweep.where_exponent(y.expand_dims(a=[1.0])[:0], "x", -0.5), "y has no line along x"),
        (lambda y: sweep.fit_exponent(y.expand_dims(level=[1.0]), "x"), "rename"),
        (lambda y: sweep.fit_two_laws(y.expand_dims(law=["a", "b", "c"]), "x"), "rename"),
        (lambda y: sweep.fit_two_laws(-y, "x"), "positive values"),
        (lambda y: sweep.fit_two_laws(y, "x", confidence=95), "between 0 and 1"),
        (lambda y: sweep.fit_two_laws(y, "x", noise="white"), "noise"),
        (lambda y: sweep.fit_two_laws(y, "x", (2, 20), windows=((1, 2), (3, 4))), "windows"),
        (lambda y: sweep.fit_correction(y, "x", end="top"), "end"),
        (lambda y: sweep.fit_correction(y, "x", (1, 2)), "at least 8 points"),
        (lambda y: sweep.fit_collapse(curves(1.5, 0.7, lambda u: u**-0.5), "x", "L"), "to be a power law"),
        (lambda y: sweep.fit_collapse(y, "x", "L"), "L"),
        (lambda y: sweep.fit_collapse(curves(1.5, 0.7)[:1], "x", "L"), "two values"),
        (lambda y: sweep.fit_collapse(curves(1.5, 0.7).assign_coords(L=[2.0] * 5), "x", "L"), "two values"),
        (lambda y: sweep.exponent_map(curves(1.5, 0.7).assign_coords(L=[1, 3, 2, 4, 5]), "x"), "L is not monotone"),
        (lambda y: sweep.where_exponent(y.copy(data=X**-0.5), "x", -0.5), "does not pass"),
        (
            lambda y: sweep.fit_exponent(y.expand_dims(a=2).assign_coords(b=(("a", "x"), np.ones((2, 61)))), "b"),
            "several",
        ),
        (lambda y: sweep.fit_collapse(curves(1.5, 0.7).assign_coords(L=list("abcde")), "x", "L"), "positive numbers"),
        (lambda y: sweep.where_exponent(y.expand_dims(abscissa=[1.0]), "x", -0.5), "rename"),
        (lambda y: sweep.local_exponent(y.expand_dims(exponent=[1.0]), "x", error=True), "rename"),
        (lambda y: sweep.exponent_map(curves(1.5, 0.7).rename(L="point"), "x"), "rename"),
        (lambda y: sweep.fit_collapse(curves(1.5, 0.7).where(PLACES < 0.012), "x", "L"), "at least 10"),
    ],
)
def test_what_cannot_be_fitted_is_said(fit, message):
    with pytest.raises(sweep.SweepError, match=message):
        fit(line(TRUTHS["offset"]))
