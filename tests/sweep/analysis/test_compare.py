"""Which law: the one that data were made of is chosen, and what cannot be told apart is not."""

import numpy as np
import pytest
import xarray as xr
from scipy.stats import chi2

import sweep
from sweep.analysis import compare
from sweep.analysis.correlated import criterion, deviance
from sweep.analysis.fits import curve, fitted
from sweep.analysis.shapes import BENDS, LAWS
from sweep.system.errors import SweepError

X = np.geomspace(2, 2e4, 61)
T = np.log(X / 200)


def line(z, x=X):
    return xr.DataArray(np.exp(z), {"x": ("x", x, {"units": "m"})}, "x", name="y", attrs={"units": "s"})


TRUTHS = {
    "one law": -0.5 * T,
    "logarithm": -0.5 * T + np.log(np.log(X)),
    "offset": np.log(1 / X + 0.01),
    "correction to scaling": np.log(X**-0.3 * (1 + 5 * X**-0.8)),
    "two laws": -T + 2 / 3 * 0.4 * np.logaddexp(0, T / 0.4),
    "two laws, hyperbola": -T + 1 / 3 * (T + np.hypot(T, 1.4)),
    "two laws, two widths": -T + 2 / 3 * np.where(T < 0, 0.3 * np.logaddexp(0, T / 0.3), 0),
    "three laws": -T + 0.6 * np.logaddexp(0, (T + 2) / 0.3) * 0.3 + 0.9 * np.logaddexp(0, (T - 2) / 0.3) * 0.3,
}
TRUTHS["two laws, two widths"] += 2 / 3 * np.where(T >= 0, 1.2 * np.logaddexp(0, T / 1.2) + (0.3 - 1.2) * np.log(2), 0)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", TRUTHS)
def test_the_law_that_data_were_made_of_is_not_ruled_out_and_no_simpler_one_is_left(name, noise):
    rng = np.random.default_rng(1)
    found = sweep.compare_laws(line(TRUTHS[name] + noise * rng.standard_normal(X.size)), "x")
    assert float(found.worse.sel(law=name)) <= 10 or noise == 0
    alive = found.law.values[(found.worse <= 10).values]
    numbers = {str(law): int(found.numbers.sel(law=law)) for law in found.law.values}
    assert numbers[found.attrs["chosen"]] == min(numbers[str(law)] for law in alive)
    if noise == 0:
        assert found.attrs["chosen"] == name
        assert float(found.residual.sel(law=name)) < 1e-5


def test_pure_noise_about_one_law_leaves_one_law():
    rng = np.random.default_rng(2)
    chosen = [
        sweep.compare_laws(line(-0.5 * T + 0.02 * rng.standard_normal(X.size)), "x").attrs["chosen"] for _ in range(20)
    ]
    assert chosen == ["one law"] * 20


def test_the_verdict_says_what_is_not_ruled_out_and_where_no_law_is_right():
    rng = np.random.default_rng(3)
    told = sweep.compare_laws(line(TRUTHS["two laws"] + 0.05 * rng.standard_normal(X.size)), "x").attrs["verdict"]
    assert "not ruled out beside it" in told
    wavy = sweep.compare_laws(line(-0.5 * T + 0.1 * np.sin(2 * T)), "x")
    assert "none of them is the law" in wavy.attrs["verdict"]


def test_known_errors_give_chi_squared_its_chance():
    rng = np.random.default_rng(4)
    y = line(TRUTHS["two laws"] + 0.02 * rng.standard_normal(X.size))
    right, small = (sweep.compare_laws(y, "x", sigma=size * y) for size in (0.02, 0.005))
    assert float(right.chi_squared.sel(law="two laws")) > 1e-3
    assert float(right.chi_squared.sel(law="one law")) < 1e-6
    assert float(small.chi_squared.sel(law="two laws")) < 1e-6
    assert "none of them" in small.attrs["verdict"]
    law = line(-0.5 * T + 0.02 * rng.standard_normal(X.size))
    one = sweep.compare_laws(law, "x", sigma=0.02 * law).sel(law="one law")
    slope = np.polynomial.Polynomial.fit(T, np.log(law), 1)
    square = float((((np.log(law) - slope(T)) / 0.02) ** 2).sum())
    assert float(one.chi_squared) == pytest.approx(chi2.sf(square, X.size - 2), rel=1e-6)


def test_the_criterion_of_noise_that_remembers_counts_its_size_and_its_correlation():
    z = -0.5 * T + 0.02 * np.random.default_rng(6).standard_normal(X.size)
    columns, even = np.column_stack([np.ones(X.size), T]), np.ones(X.size)
    k, n = 4, X.size  # level, slope, size of the noise, correlation
    wanted = deviance(columns, z, even) + 2 * k + 2 * k * (k + 1) / (n - k - 1)
    assert criterion(columns, z, even) == pytest.approx(wanted)


def test_the_criterion_is_that_of_statsmodels():
    import statsmodels.api as sm

    rng = np.random.default_rng(5)
    z = -0.5 * T + 0.02 * rng.standard_normal(X.size)
    parabola = sm.OLS(z, sm.add_constant(T)).fit()
    one = next(law for law in LAWS if law.name == "one law")
    found = fitted(one, T, z)
    n, k = X.size, 3  # slope, level, size of the noise
    assert found.deviance == pytest.approx(-2 * parabola.llf - n * (1 + np.log(2 * np.pi)), abs=1e-8)
    assert found.bic == pytest.approx(found.deviance + k * np.log(n))
    assert found.aicc == pytest.approx(found.deviance + 2 * k + 2 * k * (k + 1) / (n - k - 1))


@pytest.mark.parametrize("law", BENDS, ids=str)
def test_every_bend_is_zero_far_below_and_its_own_line_far_above(law):
    """So that x0 is where the asymptotes meet, whatever the shape."""
    t = np.array([-300.0, 300.0])
    for shape in (-0.4, 0.0, 0.4):
        q = np.array([0.0, np.log(0.3), shape])
        _, columns = law.parts(q, t)
        np.testing.assert_allclose(columns[:, 2], [0, 300], atol=0.1 if law.name.endswith("hyperbola") else 1e-3)
        np.testing.assert_allclose(columns[:, 1], [-300, 0], atol=0.1 if law.name.endswith("hyperbola") else 1e-3)


@pytest.mark.parametrize("law", BENDS, ids=str)
def test_every_bend_rises_from_slope_0_to_1_without_a_step(law):
    t = np.linspace(-3, 3, 2001)
    _, columns = law.parts(np.array([0.0, np.log(0.3), 0.3]), t)
    slope = np.gradient(columns[:, 2], t)
    assert (np.diff(slope) > -1e-3).all()
    assert slope.min() > -1e-3
    assert slope.max() < 1 + 1e-3
    assert abs(np.diff(slope)).max() < 0.02


def test_errors_of_numbers_are_those_of_repeated_noise():
    rng = np.random.default_rng(6)
    law = next(law for law in LAWS if law.name == "two laws")
    tries = [fitted(law, T, TRUTHS["two laws"] + 0.01 * rng.standard_normal(X.size)) for _ in range(60)]
    scatter = np.std([f.numbers for f in tries], axis=0)
    told = np.mean([f.errors for f in tries], axis=0)
    np.testing.assert_allclose(scatter[2:], told[2:], rtol=0.35)


def test_a_curve_between_the_points_is_the_same_law():
    law = next(law for law in LAWS if law.name == "two laws")
    found = fitted(law, T, TRUTHS["two laws"])
    middle = (T[1:] + T[:-1]) / 2
    truth = -middle + 2 / 3 * 0.4 * np.logaddexp(0, middle / 0.4)
    np.testing.assert_allclose(curve(found, middle, T[0], T[-1]), truth, atol=1e-6)


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (line(TRUTHS["offset"])[:7], "at least 8 points"),
        (line(TRUTHS["offset"]).expand_dims(a=[1.0, 2.0]), "y runs along a, x; compare laws of one line"),
        (-line(TRUTHS["offset"]), "positive values"),
    ],
)
def test_what_cannot_be_compared_is_said(y, message):
    with pytest.raises(SweepError, match=message):
        sweep.compare_laws(y, "x")


def test_what_is_one_everywhere_is_one_law():
    """All logarithms are 0, to rounding of which all laws are right."""
    y = xr.DataArray(np.ones(21), {"mu": np.geomspace(1.0, 1e3, 21)}, ("mu",), "period")
    found = sweep.compare_laws(y, "mu")
    assert np.isfinite(found.aicc).all()
    assert found.chosen == "one law"


# the parts of a comparison

WAVE = np.sin(17.0 * np.arange(20) ** 2 + 0.3)


@pytest.mark.parametrize(
    ("runs", "square", "expected"),
    [
        (1.01e-3, 1.01e-3, True),
        (0.99e-3, 0.5, False),
        (0.5, 0.99e-3, False),
        (np.nan, np.nan, True),
        (1e-3, 1e-3, True),
    ],
)
def test_a_law_fits_where_neither_test_denies_it(runs, square, expected):
    found = xr.Dataset({"runs": ("law", [runs]), "chi_squared": ("law", [square])}, {"law": ["one law"]})
    assert compare.fits(found, "one law") is expected


def test_eight_points_are_enough_and_may_fall_or_have_gaps():
    y = line(-0.5 * T[:10] + 0.01 * WAVE[:10], X[:10])
    y[[2, 6]] = np.nan
    found = sweep.compare_laws(y[::-1], "x")
    assert found.sizes["point"] == 8
    np.testing.assert_allclose(found.x, np.delete(X[:10], [2, 6]))
    assert (found.x.attrs["units"], found.y.attrs["units"], found.fitted.attrs["units"]) == ("m", "s", "s")
    y[0] = np.nan
    with pytest.raises(SweepError, match="at least 8 points of y, found 7"):
        sweep.compare_laws(y, "x")


def test_known_errors_weigh_the_points():
    sigma = np.geomspace(0.01, 1.0, X.size)
    wave = np.sin(17.0 * np.arange(X.size) ** 2)
    y = line(-0.5 * T + sigma * wave)
    one = sweep.compare_laws(y, "x", (3.0, None), sigma=sigma * y).sel(law="one law")
    inside = X >= 3.0
    slope, level = np.polyfit(T[inside], np.log(y.values[inside]), 1, w=1 / sigma[inside])
    np.testing.assert_allclose(np.log(one.fitted), level + slope * T[inside], atol=1e-6)
