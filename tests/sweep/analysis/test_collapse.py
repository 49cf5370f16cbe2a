"""Exponents of a collapse."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import sweep
from sweep.analysis import collapse
from sweep.system.errors import SweepError

X, L = np.geomspace(0.01, 100, 25), np.array([1.0, 2.0, 4.0, 8.0, 16.0])


def curves(a, b, noise=0.0, seed=1, f=lambda u: 1 / (u + u**0.2)):
    u = X / L[:, None] ** a
    y = L[:, None] ** b * f(u) * np.exp(noise * np.random.default_rng(seed).standard_normal(u.shape))
    return xr.DataArray(y, {"L": L, "x": X}, ("L", "x"), name="y")


@pytest.mark.parametrize(("a", "b"), [(1.5, 0.7), (-0.6, 1.2), (0.0, 0.5)])
def test_the_exponents_of_a_collapse_are_found_without_a_start(a, b):
    found = sweep.fit_collapse(curves(a, b), "x", "L", bootstrap=30)
    assert float(found.x_exponent) == pytest.approx(a, abs=1e-4)
    assert float(found.y_exponent) == pytest.approx(b, abs=1e-4)
    assert int(found.points) + int(found.dropped) == 125


def test_bootstrap_intervals_hold_the_truth():
    held = np.zeros(2)
    for seed in range(16):
        found = sweep.fit_collapse(curves(1.5, 0.7, 0.02, seed), "x", "L", bootstrap=40)
        held += [
            float(found.x_exponent_low) <= 1.5 <= float(found.x_exponent_high),
            float(found.y_exponent_low) <= 0.7 <= float(found.y_exponent_high),
        ]
        assert float(found.x_exponent_high - found.x_exponent_low) < 0.1
        assert int(found.fits) == 1
    assert (held >= 12).all()


def test_pieces_of_cubics_and_both_exponents_are_numbers_that_points_pay_for(monkeypatch):
    asked = []
    monkeypatch.setattr(collapse, "student", lambda freedom, _: asked.append(freedom) or 1.0)
    found = sweep.fit_collapse(curves(1.5, 0.7, 0.02)[:, ::3], "x", "L", bootstrap=4)
    pieces = int(found.points) // 8
    assert asked == [int(found.points) - (pieces + 3) - 2]


def test_points_that_are_missing_or_compared_with_nothing_are_counted():
    y = curves(1.5, 0.7)
    y[0, :3] = np.nan
    y[1, 4] = -1.0
    found = sweep.fit_collapse(y, "x", "L", bootstrap=10)
    whole = sweep.fit_collapse(curves(1.5, 0.7), "x", "L", bootstrap=10)
    assert int(found.dropped) >= 4
    assert int(found.points + found.dropped) == 125 == int(whole.points + whole.dropped)
    assert float(found.x_exponent) == pytest.approx(1.5, abs=1e-3)


def test_curves_that_are_not_one_are_said_not_to_be():
    y = curves(1.0, 0.5, 0.01)
    shapes = y * (1 + 0.1 * np.log(y.L) * np.tanh(np.log(y.x)))
    assert int(sweep.fit_collapse(shapes, "x", "L", bootstrap=10).fits) == 0


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (curves(1.5, 0.7, 0.02, f=lambda u: u**-0.5), "f is a power law, so a and b are not determined apart"),
        (curves(1.5, 0.7)[:, 0], "takes one output along x and L"),
        (curves(1.5, 0.7)[:1], "L: a collapse needs at least two values"),
        (curves(1.5, 0.7).where(X < 0.012), "at least 10 positive points"),
    ],
)
def test_what_cannot_collapse_is_said(y, message):
    with pytest.raises(SweepError, match=message):
        sweep.fit_collapse(y, "x", "L", bootstrap=5)


# the pieces of a collapse, each against its formula written another way


def scattered(seed=0, number=40):
    rng = np.random.default_rng(seed)
    t, curve = rng.uniform(-2, 3, number), np.repeat(np.arange(4.0), number // 4)
    size = np.log(2.0) * curve
    return collapse.Points(t, np.tanh(t - 0.7 * size) + 0.4 * size + 0.1 * rng.standard_normal(number), size, curve)


@pytest.mark.parametrize(("number", "pieces"), [(7, 1), (15, 1), (16, 2), (23, 2), (159, 19), (160, 20), (400, 20)])
def test_a_spline_has_a_piece_for_eight_points_and_at_most_twenty(number, pieces):
    assert collapse._knots(np.zeros(number)) == pieces


def test_the_common_curve_is_a_cubic_spline_with_knots_at_quantiles():
    points = scattered()
    b, fitted, numbers = collapse._spline(points, 0.7)
    u = points.t - 0.7 * points.size
    knots = np.quantile(u, [0.2, 0.4, 0.6, 0.8])
    truncated = [np.maximum(u - knot, 0) ** 3 for knot in knots]
    columns = np.column_stack([points.size, *(u**k for k in range(4)), *truncated])
    best = np.linalg.pinv(columns) @ points.z
    assert b == pytest.approx(best[0], abs=1e-6)
    np.testing.assert_allclose(fitted, columns @ best, atol=1e-6)
    assert numbers == columns.shape[1] + 1  # and a itself
    assert collapse._square(points, 0.7) == pytest.approx(((points.z - columns @ best) ** 2).sum(), rel=1e-6)
    np.testing.assert_allclose(collapse._columns(points, 0.7)[:, 1:].sum(axis=1), 1.0, rtol=1e-6)


@pytest.mark.parametrize(("span", "most"), [(1.5, 0.9 * 1.5 / np.log(1.5)), (40.0, 8.0)])
def test_exponents_are_tried_up_to_where_neighbours_have_nothing_in_common(span, most):
    size = np.log([2.0, 3.0, 6.0, 2.0])
    low, high = collapse._range(collapse.Points(np.array([0.0, span, 1.0, 0.5]), size, size, size))
    assert (-low, high) == (pytest.approx(most, rel=1e-12), pytest.approx(most, rel=1e-12))


def test_points_are_shared_where_another_curve_has_points_on_both_sides():
    t, size = np.array([0.0, 2.0, 4.0, 3.0, 5.0, 6.0]), np.array([0.0, 0, 0, 1, 1, 1])
    points = collapse.Points(t, t, size, size)
    np.testing.assert_array_equal(collapse._shared(points, 0.0), [False, False, True, True, False, False])
    # moved by two, 1 3 4: the last ones of both lie on each other
    np.testing.assert_array_equal(collapse._shared(points, 2.0), [False, True, True, True, True, True])
    np.testing.assert_array_equal(collapse._shared(points, 9.0), np.zeros(6))
    assert collapse._overlap(points, 0.0) == pytest.approx(3.0**4)
    assert collapse._overlap(points, 2.0) == pytest.approx(1.2**4)
    assert collapse._overlap(points, 9.0) == pytest.approx(1e12)


@pytest.mark.parametrize("place", [-2.0, -1.97, 0.3, 1.96, 2.0])
def test_the_best_exponent_is_that_of_the_least_square_wherever_it_is(monkeypatch, place):
    """A narrow dip between 81 points, and a wide one beside it."""
    monkeypatch.setattr(
        collapse, "_square", lambda _, a: 1 - np.exp(-(((a - place) / 0.03) ** 2)) + 0.3 * np.tanh((a + 0.5) ** 2)
    )
    monkeypatch.setattr(collapse, "_overlap", lambda *_: 1.0)
    slant = 0.3 * 2 * (place + 0.5) / np.cosh((place + 0.5) ** 2) ** 2 * 0.03**2 / 2
    expected = np.clip(place - slant, -2, 2)
    assert collapse._best(scattered(), (-2.0, 2.0)) == pytest.approx(expected, abs=2e-5)


def test_the_best_exponent_is_not_one_that_pulls_curves_apart(monkeypatch):
    monkeypatch.setattr(collapse, "_square", lambda _, a: 1.0 - 0.5 * (a > 1.5) + 0.1 * (a - 0.5) ** 2)
    monkeypatch.setattr(collapse, "_overlap", lambda _, a: 9.0 if a > 1.5 else 1.0)
    assert collapse._best(scattered(), (-2.0, 2.0)) == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(("times", "determined"), [(1.59, False), (1.61, True)])
@pytest.mark.parametrize("side", [-0.25, 0.25])
def test_exponents_are_determined_where_others_are_worse_by_more_than_noise(monkeypatch, times, determined, side):
    """By 12/20 of the square."""
    points, off = scattered(), np.full(40, 0.1)
    monkeypatch.setattr(
        collapse, "_square", lambda _, a: 0.4 * times if a == pytest.approx(0.7 + side, abs=1e-12) else 9.0
    )
    if determined:
        collapse._require_determined(points, 0.7, off, 20)
    else:
        with pytest.raises(SweepError, match="not determined apart"):
            collapse._require_determined(points, 0.7, off, 20)


def test_what_rounding_leaves_determines_nothing(monkeypatch):
    points = scattered()
    rounding = 1e-20 * np.ptp(points.z) ** 2 * 1.6
    for square, determined in ((1.01 * rounding, True), (0.99 * rounding, False)):
        monkeypatch.setattr(collapse, "_square", lambda *_, square=square: square)
        if determined:
            collapse._require_determined(points, 0.7, np.zeros(40), 20)
        else:
            with pytest.raises(SweepError, match="not determined apart"):
                collapse._require_determined(points, 0.7, np.zeros(40), 20)


def test_sets_close_in_on_their_exponents(monkeypatch):
    """Sets say 1.00 to 1.04: a grid of 41 from 0 to 2 steps by 0.05, the next by 0.006, the third by 0.0016."""
    points, off = scattered(), np.resize([-0.2, 0.1, 0.4], 40)
    said = np.column_stack([np.array([1.0, 1.02, 1.04]), np.zeros(3)])
    grids = []

    def least(_, grid, z, overlap):
        grids.append((grid[0], grid[-1], grid.size, overlap))
        drawn = z - points.t
        assert np.isin(np.round(drawn, 9), off).all()
        assert drawn.shape == (3, 40)
        return said

    monkeypatch.setattr(collapse, "_least_on", least)
    monkeypatch.setattr(collapse, "_overlap", lambda _, a: 5.0 + a)
    np.testing.assert_array_equal(collapse._bootstrap(points, points.t, off, (0.0, 2.0), 3, 1), said)
    np.testing.assert_allclose([one[:3] for one in grids], [(0, 2, 41), (0.9, 1.14, 41), (0.988, 1.052, 41)], rtol=1e-9)
    np.testing.assert_allclose(grids[0][3], 5 + np.linspace(0, 2, 41))
    assert all((one[3] == 1).all() for one in grids[1:])


def test_sets_that_say_the_same_close_in_to_rounding_and_stop(monkeypatch):
    asked = []
    monkeypatch.setattr(collapse, "_least_on", lambda _, grid, *rest: asked.append(grid) or np.full((3, 2), 1.0))
    collapse._bootstrap(scattered(), np.zeros(40), np.zeros(40), (0.0, 2.0), 3, 1)
    np.testing.assert_allclose([grid[1] - grid[0] for grid in asked], 0.05 * 0.1 ** np.arange(len(asked)), rtol=1e-4)
    assert len(asked) == 9  # a step of 5e-10 is less than 1e-9 (1 + 1)


def test_each_set_has_the_exponents_of_its_parabola():
    points, grid = scattered(), np.linspace(0.5, 0.9, 9)
    z = points.z + 0.05 * np.random.default_rng(3).standard_normal((4, 40))
    overlap = 1 + 0.1 * np.arange(9)
    found = collapse._least_on(points, grid, z, overlap)
    for row, one in zip(found, z, strict=True):
        splines = [collapse._spline(points._replace(z=one), a) for a in grid]
        squares = [((one - fitted) ** 2).sum() * w for (_, fitted, _), w in zip(splines, overlap, strict=True)]
        k = int(np.clip(np.argmin(squares), 1, 7))
        bow, slant, _ = np.polyfit(grid[k - 1 : k + 2] - grid[k], squares[k - 1 : k + 2], 2)
        away = np.clip(-slant / (2 * bow) if bow > 0 else 0.0, -0.05, 0.05)
        rise = (splines[k + 1][0] - splines[k - 1][0]) / 0.1
        np.testing.assert_allclose(row, [grid[k] + away, splines[k][0] + rise * away], rtol=1e-5)


@pytest.mark.parametrize(("chance", "one"), [(1.01e-3, True), (0.99e-3, False)])
def test_one_curve_is_denied_by_an_analysis_of_variance(monkeypatch, chance, one):
    """Of cubics along all curves but the first, against nothing."""
    points, asked = scattered(), []
    off = 0.1 * np.random.default_rng(7).standard_normal(40)
    monkeypatch.setattr("scipy.special.fdtrc", lambda *given: asked.append(given) or chance)
    assert collapse._one_curve(points, 0.7, off) == one
    u = points.t - 0.7 * points.size
    rest = sum(
        np.polynomial.Polynomial.fit(u[here], off[here], 3, full=True)[1][0][0]
        for here in (points.curve == number for number in (1, 2, 3))
    )
    rest += (off[points.curve == 0] ** 2).sum()
    ((first, second, ratio),) = asked
    assert (first, second) == (12, 28)
    assert ratio == pytest.approx(((off**2).sum() - rest) / 12 / (rest / 28), rel=1e-8)


@pytest.mark.parametrize(("beside", "one"), [(3, True), (4, False)])
def test_a_cubic_that_leaves_no_point_to_spare_denies_no_curve(monkeypatch, beside, one):
    points = collapse.Points(np.arange(beside + 1.0), *np.zeros((2, beside + 1)), np.array([0.0] + beside * [1.0]))
    monkeypatch.setattr("scipy.special.fdtrc", lambda *_: 0.0)
    assert collapse._one_curve(points, 0.7, np.ones(beside + 1)) == one


def test_distances_of_the_size_of_rounding_deny_no_curve(monkeypatch):
    points = scattered()
    monkeypatch.setattr("scipy.special.fdtrc", lambda *_: 0.0)
    off = np.where(np.arange(40) % 2, 1.0, -1.0)
    assert collapse._one_curve(points, 0.7, 0.99e-12 * off)
    assert not collapse._one_curve(points, 0.7, 1.01e-12 * off)


def test_intervals_are_students_t_times_the_scatter_of_sets(monkeypatch):
    """Residuals are drawn as wide as they are with the numbers that were fitted paid for."""
    drawn = []
    sets = np.array([[1.0, 0.2], [1.4, 0.3], [1.9, 0.1]])
    monkeypatch.setattr(collapse, "_bootstrap", lambda points, fitted, off, *rest: drawn.append((off, *rest)) or sets)
    found = sweep.fit_collapse(curves(1.5, 0.7, 0.02), "x", "L", bootstrap=3, seed=5, confidence=0.9)
    number = int(found.points)
    left = number - (min(20, number // 8) + 3 + 2)
    reach = stats.t.ppf(0.95, left) * sets.std(axis=0, ddof=1)
    for name, wide in zip(("x_exponent", "y_exponent"), reach, strict=True):
        assert float(found[f"{name}_high"] - found[name]) == pytest.approx(wide, rel=1e-9)
        assert float(found[name] - found[f"{name}_low"]) == pytest.approx(wide, rel=1e-9)
    off, near, times, seed = drawn[0]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(float(found.residual) * np.sqrt(number / left), rel=1e-9)
    np.testing.assert_allclose(near, [1.5 - 0.75, 1.5 + 0.75], atol=0.05)
    assert (times, seed) == (3, 5)
