"""Curves that data may follow, against integrals of their slopes."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
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


def test_places_widths_and_fades_to_start_from_span_the_window():
    np.testing.assert_allclose(np.diff(shapes.PLACES), 0.8 / 6, rtol=1e-12)
    assert (shapes.PLACES[0], shapes.PLACES[-1]) == (0.1, 0.9)
    np.testing.assert_allclose(np.exp(shapes.WIDTHS), [0.01, 0.04, 0.12, 0.3], rtol=1e-12)
    assert tuple(-fade for fade in reversed(shapes.FADES)) == shapes.FADES
    assert all(abs(b) < 2 for b in shapes.LOGARITHM.grids[0])  # 1 + B t is positive in the window
