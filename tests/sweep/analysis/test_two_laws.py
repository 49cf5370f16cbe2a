"""Two laws and the bend between them, and confidence intervals that hold the truth as often as they say."""

import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.system.errors import SweepError

MU = np.geomspace(1e-3, 1e3, 61)
SETS = 40


def curve(y, x=MU, dims=("mu",)):
    return xr.DataArray(y, {"mu": ("mu", x, {"units": "rad/s^2"})}, dims, "period", {"units": "s"})


def broken(low=-1.0, high=-1 / 3, crossover=1.6, decades=0.3, x=MU):
    """Two laws, by the textbook's product form, which is not how the fit writes them."""
    w = decades * np.log(10)
    return x**low * (1 + (x / crossover) ** (1 / w)) ** ((high - low) * w)


def noisy(y, size, sets=SETS, seed=4):
    return y * np.exp(size * np.random.default_rng(seed).standard_normal((sets, y.size)))


def covered(found, name, truth):
    return float(((found[f"{name}_low"] <= truth) & (truth <= found[f"{name}_high"])).mean())


@pytest.mark.parametrize("decades", [0.05, 0.3, 0.8])
@pytest.mark.parametrize(("low", "high"), [(-1.0, -1 / 3), (0.5, 2.0), (0.0, -0.25)])
def test_the_law_it_is_made_of_is_found_to_rounding(low, high, decades):
    found = sweep.fit_two_laws(curve(broken(low, high, 1.6, decades)), "mu")
    np.testing.assert_allclose(found.exponent, [low, high], atol=1e-7)
    assert float(found.crossover) == pytest.approx(1.6, rel=1e-6)
    assert float(found.width) == pytest.approx(decades, rel=1e-5)
    assert float(found.residual) < 1e-8
    assert int(found.regimes) == 2
    assert found.crossover.attrs["units"] == "rad/s^2"
    assert found.level.attrs["units"] == "s"


@pytest.mark.parametrize(("size", "decades"), [(0.01, 0.3), (0.03, 0.1)])
def test_intervals_hold_the_truth_about_as_often_as_they_say(size, decades):
    """40 sets: a standard error of 3.4 %; benchmarks/honesty/interval_coverage.py does 10000."""
    found = sweep.fit_two_laws(curve(noisy(broken(decades=decades), size), dims=("set", "mu")), "mu")
    shares = [
        covered(found.sel(law="low"), "exponent", -1.0),
        covered(found.sel(law="high"), "exponent", -1 / 3),
        covered(found, "crossover", 1.6),
    ]
    assert all(share > 0.91 for share in shares), shares  # wider, since bends of other shapes are not ruled out
    assert (found.noisy == 1).all()
    assert (found.regimes == 2).all()


def test_intervals_of_another_confidence_hold_it_that_often():
    y = curve(noisy(broken(), 0.01), dims=("set", "mu"))
    half = sweep.fit_two_laws(y, "mu", confidence=0.5)
    whole = sweep.fit_two_laws(y, "mu")
    assert covered(half.sel(law="low"), "exponent", -1.0) > 0.4
    assert (half.exponent_high - half.exponent_low < whole.exponent_high - whole.exponent_low).all()
    straight = curve(noisy(MU**-0.5, 0.01), dims=("set", "mu"))
    assert (
        0.4 < covered(sweep.fit_exponent(straight, "mu", confidence=0.5, noise="independent"), "exponent", -0.5) < 0.6
    )
    assert covered(sweep.fit_exponent(straight, "mu"), "exponent", -0.5) > 0.91


def test_one_law_is_told_from_two():
    straight = sweep.fit_two_laws(curve(noisy(MU**-0.5, 0.02, 60), dims=("set", "mu")), "mu")
    assert float((straight.regimes == 1).mean()) > 0.95
    exact = sweep.fit_two_laws(curve(3 * MU**-0.5), "mu")
    assert int(exact.regimes) == 1
    slight = sweep.fit_two_laws(curve(noisy(broken(-0.5, -0.4), 0.01, 60), dims=("set", "mu")), "mu")
    assert float((slight.regimes == 2).mean()) > 0.95
    assert float(slight.evidence.median()) > 10


def test_without_noise_the_interval_of_a_line_is_the_range_of_the_exponent_in_the_window():
    """y = 1/x + x^(-1/3): the exponent slides from -1 to -1/3."""
    x = np.geomspace(1e-2, 1e2, 161)
    fit = sweep.fit_exponent(curve(1 / x + x ** (-1 / 3), x), "mu", (0.1, 10))
    ends = [-(1 / a + a ** (-1 / 3) / 3) / (1 / a + a ** (-1 / 3)) for a in (0.1, 10)]
    assert float(fit.exponent_low) == pytest.approx(ends[0], abs=1e-5)
    assert float(fit.exponent_high) == pytest.approx(ends[1], abs=1e-5)
    assert float(fit.noisy) == 0
    forced = sweep.fit_exponent(curve(1 / x + x ** (-1 / 3), x), "mu", (0.1, 10), noise="independent")
    assert float(forced.exponent_high) - float(forced.exponent_low) < 0.05  # an error bar that knows no better


def test_without_noise_more_points_do_not_shrink_the_interval():
    widths = []
    for points in (41, 641):
        x = np.geomspace(0.1, 10, points)
        fit = sweep.fit_exponent(curve(1 / x + x ** (-1 / 3), x), "mu")
        widths.append(float(fit.exponent_high - fit.exponent_low))
    assert widths[1] == pytest.approx(widths[0], rel=1e-3)


def test_a_pure_law_without_noise_is_known_to_rounding():
    fit = sweep.fit_exponent(curve(2.5 * MU ** (-1 / 3)), "mu")
    assert float(fit.exponent_low) <= -1 / 3 <= float(fit.exponent_high)
    assert float(fit.exponent_high - fit.exponent_low) < 1e-11


def test_the_laws_of_a_foliot_lie_in_the_intervals_of_its_noise_free_periods():
    study = sweep.study(
        kernel="foliot",
        axes={"mu": {"spacing": "log", "start": 1e-3, "stop": 1e5, "num": 161}},
        fixed={"a": 1.0, "phi0": 1.0},
    )
    found = sweep.fit_two_laws(sweep.run(study).period, "mu")
    assert float(found.noisy) == 0
    for law, truth in (("low", -1.0), ("high", -1 / 3)):
        one = found.sel(law=law)
        assert float(one.exponent_low) <= truth <= float(one.exponent_high)
        assert float(one.exponent_high - one.exponent_low) < 0.02
    # the asymptotes aP = 4/alpha and 4 (3/alpha)^(1/3) meet at alpha = 3^(-1/2)
    assert float(found.crossover_low) <= 3**-0.5 <= float(found.crossover_high)


@pytest.mark.parametrize("gaps", [slice(None, None, 2), slice(2, None, 3), slice(20, 40)])
def test_gaps_do_not_shrink_the_interval_of_a_line_without_noise(gaps):
    x = np.geomspace(1e-2, 1e2, 81)
    y = 1 / x + x ** (-1 / 3)
    whole = sweep.fit_exponent(curve(y, x), "mu")
    y[gaps] = np.nan
    gappy = sweep.fit_exponent(curve(y, x), "mu")
    for end in ("exponent_low", "exponent_high"):
        assert float(gappy[end]) == pytest.approx(float(whole[end]), abs=0.02)


@pytest.mark.parametrize("noise", [None, True, False])
@pytest.mark.parametrize(("power", "prefactor"), [(0.0, 7.3), (-0.5, 3.0), (2.0, 1.0)])
def test_the_interval_of_an_exact_law_holds_it_whatever_is_said_of_noise(power, prefactor, noise):
    fit = sweep.fit_exponent(curve(prefactor * MU**power), "mu", noise=noise)
    assert float(fit.exponent_low) <= power <= float(fit.exponent_high)
    assert float(fit.exponent_high - fit.exponent_low) < 1e-11


@pytest.mark.parametrize("power", [0.0, -0.5])
def test_where_one_law_holds_to_rounding_nothing_meets_anywhere(power):
    found = sweep.fit_two_laws(curve(7.3 * MU**power), "mu")
    assert int(found.regimes) == 1
    assert all(np.isnan(float(found[name])) for name in ("crossover", "width", "level"))
    assert (float(found.crossover_low), float(found.crossover_high)) == (0.0, np.inf)
    assert (found.exponent_low <= power + 1e-12).all()
    assert (found.exponent_high >= power - 1e-12).all()


@pytest.mark.parametrize("size", [2e-3, 1e-4, 1e-6])
def test_where_the_bend_is_plainly_of_another_shape_its_doubt_and_the_noise_are_both_in_the_intervals(size):
    """Slope by a hyperbola, which reaches its limits by powers of ln mu and not of mu."""
    u, w = np.log(MU / 1.6), 0.3 * np.log(10)
    y = np.exp(-2 / 3 * u + 1 / 3 * np.sqrt(u * u + w * w))
    found = sweep.fit_two_laws(curve(noisy(y, size, 100), dims=("set", "mu")), "mu")
    assert (
        found.noisy == (size > 5e-4)
    ).all()  # noise that is less than the points are off (1) is told from 0.6 e-3 on
    for law, truth in (("low", -1.0), ("high", -1 / 3)):
        assert covered(found.sel(law=law), "exponent", truth) > 0.9
    assert covered(found, "crossover", 1.6) > 0.9
    assert float((found.exponent_high - found.exponent_low).median()) < 0.05


@pytest.mark.parametrize("size", [1e-5, 1e-4, 3e-4])
def test_noise_far_below_what_the_points_are_off_the_curve_is_in_the_intervals(size):
    """A hyperbola of 41 points; the limits of local exponents alone hold 43 to 87 %."""
    x, width = np.geomspace(1e-3, 1e3, 41), 0.6 * np.log(10)
    u = np.log(x / 1.6)
    y = np.exp(-2 / 3 * u + 1 / 3 * np.hypot(u, width) + size * np.random.default_rng(9).standard_normal((SETS, 41)))
    found = sweep.fit_two_laws(curve(y, x, ("set", "mu")), "mu")
    assert (found.noisy == 0).all()
    for law, truth in (("low", -1.0), ("high", -1 / 3)):
        assert covered(found.sel(law=law), "exponent", truth) > 0.9
    assert float((found.exponent_high - found.exponent_low).median()) < 0.05


def remembering(phi, shape, rng):
    noise = rng.standard_normal(shape)
    for i in range(1, shape[1]):
        noise[:, i] = phi * noise[:, i - 1] + (1 - phi**2) ** 0.5 * noise[:, i]
    return noise


@pytest.mark.parametrize("phi", [0.6, 0.9])
@pytest.mark.parametrize("points", [25, 61])
def test_noise_that_remembers_is_in_the_intervals_unless_it_is_said_to_be_independent(phi, points):
    """By least squares alone, intervals hold 54 to 94 %."""
    x = np.geomspace(1e-3, 1e3, points)
    noise = remembering(phi, (SETS, points), np.random.default_rng(8))
    y = curve(broken(x=x) * np.exp(0.01 * noise), x, ("set", "mu"))
    found, independent = sweep.fit_two_laws(y, "mu"), sweep.fit_two_laws(y, "mu", noise="independent")
    for law, truth in (("low", -1.0), ("high", -1 / 3)):
        assert covered(found.sel(law=law), "exponent", truth) > 0.93
    assert covered(found, "crossover", 1.6) > 0.93
    assert float((found.exponent_high - found.exponent_low).median()) < 0.1
    if phi == 0.9:
        assert covered(independent.sel(law="low"), "exponent", -1.0) < 0.85


def test_a_word_that_is_no_kind_of_noise_is_refused():
    with pytest.raises(SweepError, match="noise: expected True, False or one of independent"):
        sweep.fit_two_laws(curve(broken()), "mu", noise="white")


@pytest.fixture(scope="module")
def periods():
    axis = {"spacing": "log", "start": 1e-4, "stop": 1e4, "num": 81}
    return sweep.run(sweep.study(kernel="foliot", axes={"mu": axis}, fixed={"a": 1.0, "phi0": 1.0})).period


@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("window", [(1e-4, 0.3), (1e-3, 0.58), (1e-3, 1), (0.01, 100), (0.3, 1e3), (0.5, 1e4)])
def test_a_bend_at_the_edge_of_a_window_or_beyond_it_is_in_the_intervals(periods, window, step):
    """8 to 44 points on one side of the bend at 3^(-1/2), or a little across; no noise."""
    found = sweep.fit_two_laws(periods[::step], "mu", window)
    for law, truth in (("low", -1.0), ("high", -1 / 3)):
        one = found.sel(law=law)
        assert float(one.exponent_low) <= truth <= float(one.exponent_high)
    assert float(found.crossover_low) <= 3**-0.5 <= float(found.crossover_high)


def test_few_points_tell_nothing_of_noise_unless_it_is_said():
    x = np.geomspace(1e-2, 1e2, 12)
    y = curve(noisy(broken(x=x), 0.02, 200), x, dims=("set", "mu"))
    silent, told = sweep.fit_two_laws(y, "mu"), sweep.fit_two_laws(y, "mu", noise=True)
    assert (silent.noisy == 0).all()
    assert covered(silent.sel(law="low"), "exponent", -1.0) > 0.98
    assert covered(told.sel(law="low"), "exponent", -1.0) > 0.9


def test_missing_points_and_falling_axes_change_nothing():
    y = curve(noisy(broken(), 0.01, 1)[0])
    whole = sweep.fit_two_laws(y, "mu")
    xr.testing.assert_allclose(sweep.fit_two_laws(y[::-1], "mu"), whole, rtol=1e-9)
    gappy = y.copy()
    gappy[[5, 30]] = np.nan
    assert int(sweep.fit_two_laws(gappy, "mu").points) == 59


@pytest.mark.parametrize(
    ("y", "keys", "message"),
    [
        (curve(broken()), {"dim": "nu"}, "no axis 'nu'"),
        (curve(broken()), {"window": (1.0, 2.0)}, "at least 8 points"),
        (curve(-broken()), {}, "positive values"),
        (curve(broken()), {"confidence": 95}, "between 0 and 1"),
    ],
)
def test_what_cannot_be_fitted_is_said(y, keys, message):
    with pytest.raises(SweepError, match=message):
        sweep.fit_two_laws(y, **{"dim": "mu"} | keys)


# the pieces, each against its formula written another way
