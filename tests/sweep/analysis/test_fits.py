"""Fits of laws to points, against those of scipy and numpy, and their errors, against the exact normal matrix."""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import curve_fit

from sweep.analysis import fits, shapes

S = np.linspace(0.0, 1.0, 23)


def noisy(seed=1, points=30):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(2.0, 7.0, points))
    return t, 1.3 - 0.4 * t + 0.05 * rng.standard_normal(points), rng.uniform(0.3, 3.0, points)


@pytest.mark.parametrize("known", [False, True])
def test_a_line_and_what_it_costs_are_those_of_textbooks(known):
    t, z, weights = noisy()
    weights = weights / 0.05**2
    found = fits.fitted(shapes.ONE, t, z, weights, known)
    span, n = np.ptp(t), t.size
    (slope, level), covariance = np.polyfit(t, z, 1, w=np.sqrt(weights), cov="unscaled")
    off = z - level - slope * t
    square = float((weights * off**2).sum())
    error = np.sqrt(np.diag(covariance)[0] * (1 if known else square / (n - 2)))
    np.testing.assert_allclose(found.numbers, [level + slope * t[0], slope * span], rtol=1e-10)
    np.testing.assert_allclose(found.errors[1], error * span, rtol=1e-6)
    np.testing.assert_allclose(found.off, off, atol=1e-12)
    # -2 ln L but for n (1 + ln 2 pi), with the size of the noise at its best where it is not known
    relative = weights / weights.mean()
    unknown = n * math.log((relative * off**2).sum() / n) - np.log(relative).sum()
    deviance, k = (square, 2) if known else (unknown, 3)
    assert found.deviance == pytest.approx(deviance, rel=1e-9)
    assert found.bic == pytest.approx(deviance + k * math.log(n), rel=1e-9)
    assert found.aicc == pytest.approx(deviance + 2 * k + 2 * k * (k + 1) / (n - k - 1), rel=1e-9)


def test_without_weights_all_points_weigh_alike():
    t, z, _ = noisy()
    plain, even = fits.fitted(shapes.ONE, t, z), fits.fitted(shapes.ONE, t, z, np.full(t.size, 7.0))
    np.testing.assert_allclose(plain.numbers, even.numbers, rtol=1e-12)
    assert plain.deviance == pytest.approx(even.deviance, rel=1e-12)


@pytest.mark.parametrize("law", [shapes.ONE, shapes.CORRECTION, shapes.TWO], ids=str)
def test_a_law_needs_two_points_more_than_numbers(law):
    t, z, _ = noisy(points=law.numbers + 2)
    assert fits.fitted(law, t, z) is not None
    assert fits.fitted(law, t[1:], z[1:]) is None


def test_what_rounding_leaves_of_an_exact_line_is_in_its_deviance():
    t = np.linspace(0.0, 4.0, 9)
    found = fits.fitted(shapes.ONE, t, np.full(9, 3.0))
    assert found.deviance == pytest.approx(2 * 9 * math.log(4 * 2.0**-52 * 4), abs=1.0)


def test_two_laws_and_their_errors_are_those_of_scipy():
    t = np.linspace(-3.0, 5.0, 41)

    def curve(t, place, log_width, level, low, high):
        w = math.exp(log_width)
        return level + low * (t - place) + (high - low) * w * np.logaddexp(0, (t - place) / w)

    truth = (0.8, -0.2, 1.5, -1.0, -0.3)
    z = curve(t, *truth) + 0.01 * np.random.default_rng(3).standard_normal(t.size)
    found = fits.fitted(shapes.TWO, t, z)
    best, covariance = curve_fit(curve, t, z, truth, xtol=1e-12, ftol=1e-12)
    scale = np.array([1 / 8, 1, 1, 8, 8])
    start = np.array([-t[0] / 8, -math.log(8), 0, 0, 0])
    np.testing.assert_allclose(found.numbers, best * scale + start, rtol=1e-4)
    np.testing.assert_allclose(found.errors, np.sqrt(np.diag(covariance)) * scale, rtol=1e-2)
    at = np.array([-4.0, 0.3, 9.0])
    np.testing.assert_allclose(fits.curve(found, at, t[0], t[-1]), curve(at, *best), rtol=1e-5)


def softplus(u, width):
    return width * mp.log1p(mp.exp(u / width))


CURVES = {
    shapes.LOGARITHM: lambda t, b, c, p: c + p * t + mp.log1p(b * (t - 0.5)),
    shapes.OFFSET: lambda t, p, a, c: c + mp.log(mp.exp(p * (t - 0.5)) + mp.tan(a)),
    shapes.CORRECTION: lambda t, b, d, c, p: c + p * t + mp.log1p(b * mp.exp(-d * (t - 0.5))),
    shapes.TWO: lambda t, q, w, c, p, r: c + p * (t - q) + (r - p) * softplus(t - q, mp.exp(w)),
    shapes.HYPERBOLA: lambda t, q, w, c, p, r: (
        c + p * (t - q) + (r - p) * (t - q + mp.sqrt((t - q) ** 2 + mp.exp(2 * w))) / 2
    ),
}


def exact_errors(law, numbers, s, off, root):
    """Standard errors by the inverse of the normal matrix, with 60 digits."""
    with mp.workdps(60):
        at, step = [mp.mpf(float(number)) for number in numbers], mp.mpf(10) ** -20
        jacobian = mp.matrix(s.size, len(at))
        for i, j in itertools.product(range(s.size), range(len(at))):
            ends = [CURVES[law](mp.mpf(float(s[i])), *at[:j], at[j] + h, *at[j + 1 :]) for h in (step, -step)]
            jacobian[i, j] = (ends[0] - ends[1]) / (2 * step) * mp.mpf(float(root[i]))
        covariance = (jacobian.T * jacobian) ** -1
        variance = mp.mpf(float(off @ off)) / (s.size - len(at))
        return [float(mp.sqrt(covariance[k, k] * variance)) for k in range(len(at))]


def designs(sets=6):
    rng = np.random.default_rng(12)
    for _ in range(sets):
        little, p = 10 ** rng.uniform(-14, 0) * rng.choice([-1, 1]), rng.choice([0.0, -1.0, 0.3])
        for law in (shapes.TWO, shapes.HYPERBOLA):
            yield law, [rng.uniform(-0.3, 1.3), rng.uniform(-3, -1), 0.2, p, p + little]
        yield shapes.CORRECTION, [abs(little), rng.uniform(2, 8), 0.2, p]
        yield shapes.LOGARITHM, [little if abs(little) > 1e-5 else 1.3, 0.2, p]
        yield shapes.OFFSET, [rng.uniform(-5, -0.1), abs(little), 0.2]


def test_errors_are_those_of_the_exact_normal_matrix_however_little_a_number_is_determined():
    rng = np.random.default_rng(13)
    for law, numbers in designs():
        s = np.concatenate([[0.0], np.sort(rng.uniform(0, 1, rng.integers(10, 30))), [1.0]])
        off, root = rng.standard_normal(s.size), rng.uniform(0.3, 3, s.size)
        found = fits._errors(law, np.array(numbers), s, off, root)
        expected = exact_errors(law, numbers, s, off, root)
        np.testing.assert_allclose(found, expected, rtol=1e-3, err_msg=f"{law} {numbers}")


def test_numbers_that_move_no_point_have_no_end_of_error():
    """Of two laws of one exponent neither place nor width means anything, nor the level there unless that is 0."""
    off, columns = np.full(S.size, 0.1), shapes.TWO.parts(np.array([0.4, -2.0]), S)[1]
    expected = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * (off @ off) / (S.size - 5))
    for exponent, without_end in ((0.0, 2), (-0.7, 3)):
        numbers = np.array([0.4, -2.0, 0.0, exponent, exponent])
        found = fits._errors(shapes.TWO, numbers, S, off, np.ones(S.size))
        assert np.isinf(found[:without_end]).all()
        np.testing.assert_allclose(found[without_end:], expected[without_end - 2 :], rtol=1e-6)


@pytest.mark.parametrize(("place", "law"), [(3.0, 0), (-2.0, 1)])
def test_a_bend_far_outside_leaves_the_law_inside_determined_and_no_other(place, law):
    off = np.full(S.size, 0.1)
    for log_width in (-2.5, -2.0):
        numbers = np.array([place, log_width, 0.2, -1.0, -0.3])
        found = fits._errors(shapes.TWO, numbers, S, off, np.ones(S.size))
        assert np.isinf(np.delete(found, 3 + law)).all()
        alone = math.sqrt(np.polyfit(S, S, 1, cov="unscaled")[1][0, 0] * (off @ off) / (S.size - 5))
        assert alone * (1 - 1e-9) <= found[3 + law] < 10 * alone


def test_where_there_is_no_curve_points_are_far_and_errors_without_end():
    q = np.array([1.0, -1.5])  # an offset of -14 beneath powers of about one
    b, off = fits._project(shapes.OFFSET, q, S, S, np.ones(S.size))
    np.testing.assert_array_equal(b, np.zeros(1))
    np.testing.assert_array_equal(off, np.full(S.size, 1e6))
    assert np.isinf(fits._errors(shapes.OFFSET, np.array([1.0, -1.5, 0.0]), S, off, np.ones(S.size))).all()


@pytest.mark.parametrize("law", [shapes.LOGARITHM, shapes.OFFSET, shapes.TWO, shapes.THREE], ids=str)
def test_a_fit_starts_at_the_best_of_its_grid(law):
    rng = np.random.default_rng(5)
    z, root = -0.4 * S + 0.3 * np.tanh(5 * (S - 0.6)) + 0.01 * rng.standard_normal(S.size), rng.uniform(0.5, 2, S.size)

    def square(q):
        shift, columns = law.parts(np.array(q), S)
        if not (np.isfinite(shift).all() and np.isfinite(columns).all()):
            return np.inf
        w = root**2
        b = np.linalg.pinv(columns * root[:, None]) @ ((z - shift) * root)
        return (w * (z - shift - columns @ b) ** 2).sum()

    best = min(itertools.product(*law.grids), key=square)
    np.testing.assert_array_equal(fits._start(law, S, z, root), best)
