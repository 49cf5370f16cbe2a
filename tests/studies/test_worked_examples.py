"""Worked examples with libraries of the field: an inverse design by scipy, fits by xarray and lmfit."""

import importlib
import math

import numpy as np
import pytest


@pytest.fixture(scope="module")
def inverse_design():
    """The study's module, which compiles a kernel where it is read: every worker reads this file, one runs it."""
    return importlib.import_module("inverse_design")


def swing(b, d, f, e):
    """Half of what the arm swings, by the triangle of coupler, arm and motor at both dead points, in textbook form."""
    angles = [math.acos((b**2 + d**2 - side**2) / (2 * b * d)) for side in (f + e, f - e)]
    return (angles[0] - angles[1]) / 2


def test_the_machine_found_swings_as_wanted(inverse_design):
    found = inverse_design.best()
    half = swing(inverse_design.MOTOR, inverse_design.ARM, found.f, found.e)
    assert half == pytest.approx(math.radians(15), rel=1e-10)


def test_no_machine_of_that_amplitude_nearby_is_less_distorted(inverse_design):
    found = inverse_design.best()
    grid = [inverse_design.distortion(f) for f in np.linspace(0.30, 0.70, 41)]
    assert found.thd <= min(grid) * (1 + 1e-9)


def test_no_crank_swings_the_arm_that_far(inverse_design):
    assert math.isnan(inverse_design.crank(0.30, math.radians(80)))
    assert inverse_design.distortion(0.30, math.radians(80)) == math.inf


def test_a_clock_is_known_from_its_periods():
    pytest.importorskip("lmfit")
    import fit_a_model

    found = fit_a_model.fitted(fit_a_model.measured())
    for name, value in fit_a_model.TRUE.items():
        parameter = found.params[name]
        assert abs(parameter.value - value) < 4 * parameter.stderr < 0.01 * value
    assert found.redchi == pytest.approx(fit_a_model.NOISE**2, rel=0.8)


def test_a_power_law_by_xarray_has_the_exponent_of_our_own_fit():
    pytest.importorskip("lmfit")
    import fit_a_model

    import sweep

    period = sweep.run(**fit_a_model.KEYS, axes={"mu": np.geomspace(1e4, 1e6, 21)}, fixed=fit_a_model.TRUE).period
    law = fit_a_model.power_law(period, 1e3).curvefit_coefficients.sel(param="p")
    assert float(law) == pytest.approx(float(sweep.fit_exponent(period, "mu").exponent), abs=2e-4)
    assert float(law) == pytest.approx(-1 / 3, abs=2e-3)
