"""Curves that data may follow, against integrals of their slopes, and their fits, against those of scipy and numpy."""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import curve_fit
from scipy.special import expit

from sweep.analysis import shapes

S = np.linspace(0.0, 1.0, 23)
U = np.array([-2.5, -0.7, -0.11, 0.0, 0.04, 0.31, 1.9])


def integral(slope, u, width):
    """Of a slope of v = u/width that rises from 0 to 1, moved so that it tends to u."""
    above = quad(lambda v: 1 - slope(v), 0, np.inf, epsabs=1e-12)[0] - quad(slope, -np.inf, 0, epsabs=1e-12)[0]
    return width * (quad(slope, -np.inf, 0, epsabs=1e-12)[0] + quad(slope, 0, u / width + above, epsabs=1e-12)[0])


def bend_of(law, u, *q):
    """The bend alone; the other column is what is left of u."""
    shift, columns = law.parts(np.array([0.3, *q]), 0.3 + np.asarray(u))
    assert shift == 0.0
    np.testing.assert_array_equal(columns[:, 0], 1.0)
    np.testing.assert_allclose(columns[:, 1] + columns[:, 2], u, atol=1e-12)
    return columns[:, 2]


@pytest.mark.parametrize("width", [0.05, 0.4])
def test_bends_with_a_closed_form_are_the_integrals_of_their_slopes(width):
    found = bend_of(shapes.TWO, U, math.log(width))
    np.testing.assert_allclose(found, [quad(lambda v: expit(v / width), -60 * width, u)[0] for u in U], atol=1e-7)
    hyperbola = bend_of(shapes.HYPERBOLA, U, math.log(width))
    np.testing.assert_allclose(np.gradient(bend_of(shapes.HYPERBOLA, S - 0.5, math.log(width)), S)[11], 0.5, rtol=1e-9)
    np.testing.assert_allclose(hyperbola * (hyperbola - U), width**2 / 4, rtol=1e-6)  # its asymptotes are 0 and u


@pytest.mark.parametrize("power", [-2.0, -0.6, 0.0, 0.9])
def test_an_asymmetric_bend_is_the_integral_of_a_power_of_the_logistic_slope(power):
    width = 0.13
    expected = [integral(lambda v: expit(v) ** math.exp(power), u, width) for u in U]
    np.testing.assert_allclose(bend_of(shapes.ASYMMETRIC, U, math.log(width), power), expected, atol=2e-3 * width)


@pytest.mark.parametrize("power", [-0.9, -0.4, 0.0, 0.5])
def test_a_stretched_bend_is_the_integral_of_a_slope_that_fades_as_a_stretched_exponential(power):
    width, exponent = 0.13, math.exp(power)
    expected = [integral(lambda v: expit(np.sign(v) * abs(v) ** exponent), u, width) for u in U]
    found = bend_of(shapes.STRETCHED, U, math.log(width), power)
    np.testing.assert_allclose(found, expected, atol=2.5e-3 * width)


def test_a_bend_of_two_widths_has_a_slope_of_each_that_meet_at_a_half():
    below, above = 0.2 * math.exp(0.5), 0.2 * math.exp(-0.5)
    join = (below - above) * math.log(2)  # there u is where the slope is a half
    inner = [quad(lambda u: expit((u - join) / (below if u < join else above)), -40.0, u, points=[join])[0] for u in U]
    np.testing.assert_allclose(bend_of(shapes.UNEVEN, U, math.log(0.2), 0.5), inner, atol=1e-6)
    np.testing.assert_allclose(bend_of(shapes.UNEVEN, [50.0, -50.0], math.log(0.2), 0.5), [50.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("law", "q", "ends"),
    [
        (shapes.TWO, 0, (-7.0, 1.0)),
        (shapes.HYPERBOLA, 0, (-7.0, 1.0)),
        (shapes.ASYMMETRIC, 1, (-2.5, 2.5)),
        (shapes.STRETCHED, 1, (-1.2, 0.8)),
    ],
)
def test_widths_and_powers_are_held_within_ends(law, q, ends):
    numbers, u = np.full(len(law.grids) - 1, -1.0), np.array([-0.001, 0.0, 0.002, 0.5])

    def at(value):
        return bend_of(law, u, *np.where(np.arange(numbers.size) == q, value, numbers))

    for end, side in zip(ends, (-1, 1), strict=True):
        np.testing.assert_array_equal(at(end + side * 0.5), at(end))
        assert (at(end - side * 0.05) != at(end)).any()


def test_an_integrated_bend_is_nothing_far_below_and_u_far_above():
    far = np.array([-1e9, -5e3, 5e3, 1e9])
    for law, power in ((shapes.ASYMMETRIC, 0.5), (shapes.STRETCHED, 0.2)):
        np.testing.assert_allclose(bend_of(law, far, 0.0, power), [0.0, 0.0, 5e3, 1e9], rtol=1e-12, atol=1e-9)


def test_between_points_a_cubic_with_its_slopes_is_exact():
    def cubic(v):
        return 0.3 * v**3 - 0.2 * v**2 + v - 4

    def steep(v):
        return 0.9 * v**2 - 0.4 * v + 1

    v = np.concatenate([np.linspace(-5, 5, 41), shapes.GRID[[0, 7, 180, -1]]])
    found = shapes._on_grid(shapes._hermite(cubic(shapes.GRID), steep(shapes.GRID)), v)
    np.testing.assert_allclose(found, cubic(v), rtol=1e-12, atol=1e-10)


def test_the_grid_of_slopes_is_fine_in_the_middle_and_reaches_far():
    assert shapes.GRID[-1] == -shapes.GRID[0] == math.sinh(9)
    assert shapes.STEPS.min() == pytest.approx(0.05, rel=1e-3)
    assert shapes.GRID.size == shapes.STEPS.size + 1


def test_three_laws_have_two_bends_with_the_middle_law_between_them():
    first, second, width = 0.25, 0.8, 0.05
    shift, columns = shapes.THREE.parts(np.array([second, first, math.log(width)]), S)  # in either order
    a, b = width * np.log1p(np.exp((S - first) / width)), width * np.log1p(np.exp((S - second) / width))
    assert shift == 0.0
    np.testing.assert_allclose(columns, np.column_stack([np.ones_like(S), S - a, a - b, b]), atol=1e-12)


@pytest.mark.parametrize(
    ("first", "second", "width", "exists"),
    [
        (0.3, 0.5, 0.0999, True),
        (0.3, 0.5, 0.1001, False),  # apart by two widths
        (1e-9, 0.5, 0.01, True),
        (0.0, 0.5, 0.01, False),
        (0.5, 1 - 1e-9, 0.01, True),
        (0.5, 1.0, 0.01, False),
        (0.5, 0.5, 0.01, False),
    ],
)
def test_a_middle_law_that_would_be_seen_nowhere_is_none(first, second, width, exists):
    columns = shapes.THREE.parts(np.array([first, second, math.log(width)]), S)[1]
    assert columns.shape == (S.size, 4)
    assert np.isfinite(columns).all() == exists


def test_curves_of_one_law_are_their_formulas():
    """With x = e^t, t from -1/2 to 1/2 over the window."""
    x = np.exp(S - 0.5)
    straight = np.column_stack([np.ones_like(S), S])
    np.testing.assert_array_equal(shapes.ONE.parts(np.empty(0), S)[1], straight)
    assert shapes.ONE.parts(np.empty(0), S)[0] == 0.0
    for law, q, factor in (
        (shapes.LOGARITHM, [1.3], 1 + 1.3 * np.log(x)),
        (shapes.CORRECTION, [0.4, 2.5], 1 + 0.4 * x**-2.5),
        (shapes.OFFSET, [-2.5, 0.3], x**-2.5 + math.tan(0.3)),
    ):
        shift, columns = law.parts(np.array(q), S)
        np.testing.assert_allclose(np.exp(shift), factor, rtol=1e-12)
        np.testing.assert_array_equal(columns, straight if law is not shapes.OFFSET else straight[:, :1])


@pytest.mark.parametrize("law", shapes.LAWS, ids=str)
def test_numbers_of_a_law_are_those_that_it_has(law):
    q = np.array([grid[-1] for grid in law.grids])
    columns = law.parts(q, S)[1]
    assert law.numbers == len(law.grids) + columns.shape[1]
    assert len(law.exponents) <= columns.shape[1]


def test_single_powers_are_those_of_a_stretched_bend_over_its_whole_range():
    assert len(shapes.POWERS) == 17
    assert min(shapes.POWERS) == pytest.approx(-1.2)
    assert max(shapes.POWERS) == pytest.approx(0.8)
    np.testing.assert_allclose(np.diff(sorted(shapes.POWERS)), 0.125, rtol=1e-12)
    for power, law in itertools.islice(shapes.POWERS.items(), 0, None, 8):
        assert law.numbers == 5
        assert law.grids == shapes.STRETCHED.grids[:2]
        alone, whole = (
            law.parts(np.array([0.4, -2.0]), S)[1],
            shapes.STRETCHED.parts(np.array([0.4, -2.0, power]), S)[1],
        )
        np.testing.assert_array_equal(alone, whole)


# fits


def noisy(seed=1, points=30):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(2.0, 7.0, points))
    return t, 1.3 - 0.4 * t + 0.05 * rng.standard_normal(points), rng.uniform(0.3, 3.0, points)


@pytest.mark.parametrize("known", [False, True])
def test_a_line_and_what_it_costs_are_those_of_textbooks(known):
    t, z, weights = noisy()
    weights = weights / 0.05**2
    found = shapes.fitted(shapes.ONE, t, z, weights, known)
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
    plain, even = shapes.fitted(shapes.ONE, t, z), shapes.fitted(shapes.ONE, t, z, np.full(t.size, 7.0))
    np.testing.assert_allclose(plain.numbers, even.numbers, rtol=1e-12)
    assert plain.deviance == pytest.approx(even.deviance, rel=1e-12)


@pytest.mark.parametrize("law", [shapes.ONE, shapes.CORRECTION, shapes.TWO], ids=str)
def test_a_law_needs_two_points_more_than_numbers(law):
    t, z, _ = noisy(points=law.numbers + 2)
    assert shapes.fitted(law, t, z) is not None
    assert shapes.fitted(law, t[1:], z[1:]) is None


def test_what_rounding_leaves_of_an_exact_line_is_in_its_deviance():
    t = np.linspace(0.0, 4.0, 9)
    found = shapes.fitted(shapes.ONE, t, np.full(9, 3.0))
    assert found.deviance == pytest.approx(2 * 9 * math.log(4 * 2.0**-52 * 4), abs=1.0)


def test_two_laws_and_their_errors_are_those_of_scipy():
    t = np.linspace(-3.0, 5.0, 41)

    def curve(t, place, log_width, level, low, high):
        w = math.exp(log_width)
        return level + low * (t - place) + (high - low) * w * np.logaddexp(0, (t - place) / w)

    truth = (0.8, -0.2, 1.5, -1.0, -0.3)
    z = curve(t, *truth) + 0.01 * np.random.default_rng(3).standard_normal(t.size)
    found = shapes.fitted(shapes.TWO, t, z)
    best, covariance = curve_fit(curve, t, z, truth, xtol=1e-12, ftol=1e-12)
    scale = np.array([1 / 8, 1, 1, 8, 8])
    start = np.array([-t[0] / 8, -math.log(8), 0, 0, 0])
    np.testing.assert_allclose(found.numbers, best * scale + start, rtol=1e-4)
    np.testing.assert_allclose(found.errors, np.sqrt(np.diag(covariance)) * scale, rtol=1e-2)
    at = np.array([-4.0, 0.3, 9.0])
    np.testing.assert_allclose(shapes.curve(found, at, t[0], t[-1]), curve(at, *best), rtol=1e-5)


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
        found = shapes._errors(law, np.array(numbers), s, off, root)
        expected = exact_errors(law, numbers, s, off, root)
        np.testing.assert_allclose(found, expected, rtol=1e-3, err_msg=f"{law} {numbers}")


def test_numbers_that_move_no_point_have_no_end_of_error():
    """Of two laws of one exponent neither place nor width means anything, nor the level there unless that is 0."""
    off, columns = np.full(S.size, 0.1), shapes.TWO.parts(np.array([0.4, -2.0]), S)[1]
    expected = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * (off @ off) / (S.size - 5))
    for exponent, without_end in ((0.0, 2), (-0.7, 3)):
        numbers = np.array([0.4, -2.0, 0.0, exponent, exponent])
        found = shapes._errors(shapes.TWO, numbers, S, off, np.ones(S.size))
        assert np.isinf(found[:without_end]).all()
        np.testing.assert_allclose(found[without_end:], expected[without_end - 2 :], rtol=1e-6)


@pytest.mark.parametrize(("place", "law"), [(3.0, 0), (-2.0, 1)])
def test_a_bend_far_outside_leaves_the_law_inside_determined_and_no_other(place, law):
    off = np.full(S.size, 0.1)
    found = shapes._errors(shapes.TWO, np.array([place, -2.5, 0.2, -1.0, -0.3]), S, off, np.ones(S.size))
    line = np.polyfit(S, S, 1, cov="unscaled")[1]
    assert found[3 + law] == pytest.approx(math.sqrt(line[0, 0] * (off @ off) / (S.size - 5)), rel=1e-6)
    assert np.isinf(np.delete(found, 3 + law)).all()


def test_where_there_is_no_curve_points_are_far_and_errors_without_end():
    q = np.array([1.0, -1.5])  # an offset of -14 beneath powers of about one
    b, off = shapes._project(shapes.OFFSET, q, S, S, np.ones(S.size))
    np.testing.assert_array_equal(b, np.zeros(1))
    np.testing.assert_array_equal(off, np.full(S.size, 1e6))
    assert np.isinf(shapes._errors(shapes.OFFSET, np.array([1.0, -1.5, 0.0]), S, off, np.ones(S.size))).all()


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
    np.testing.assert_array_equal(shapes._start(law, S, z, root), best)


def test_places_widths_and_fades_to_start_from_span_the_window():
    np.testing.assert_allclose(np.diff(shapes.PLACES), 0.8 / 6, rtol=1e-12)
    assert (shapes.PLACES[0], shapes.PLACES[-1]) == (0.1, 0.9)
    np.testing.assert_allclose(np.exp(shapes.WIDTHS), [0.01, 0.04, 0.12, 0.3], rtol=1e-12)
    assert tuple(-fade for fade in reversed(shapes.FADES)) == shapes.FADES
    assert all(abs(b) < 2 for b in shapes.LOGARITHM.grids[0])  # 1 + B t is positive in the window


def test_windows_read_backwards_start_alike():
    """Where the shape of a bend has a side, both sides are tried; a stretched one has powers to both sides of one."""
    for law in (shapes.ASYMMETRIC, shapes.UNEVEN):
        assert law.grids[2][0] == -law.grids[2][1] < 0
    low, high = np.exp(shapes.STRETCHED.grids[2])
    np.testing.assert_allclose([low, high], [0.61, 1.35], rtol=0.01)
    first, second, _ = shapes.THREE.grids
    np.testing.assert_allclose(sorted(1 - np.array(second)), first, rtol=1e-12)
    np.testing.assert_allclose(np.diff(first), 0.15, rtol=1e-12)
