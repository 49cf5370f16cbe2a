"""Exponents of a collapse."""

import numpy as np
import pytest
import xarray as xr

import sweep
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
