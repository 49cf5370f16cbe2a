"""Dimensionless groups found from units and tried on cells; superfluous axes; collapse."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from beads import KERNEL as BEADS
from toy import KERNEL as TOY

import sweep
from kernels.interface import Field
from sweep.explore.groups import Group, scaling

DECADES = {"spacing": "log", "start": 0.1, "stop": 10, "num": 5}


def foliot(*axes, **fixed):
    return sweep.build_study(kernel="foliot", axes=dict.fromkeys(axes, DECADES), fixed=fixed)


def toy(*axes, kernel=TOY, **fixed):
    keys = {"axes": dict.fromkeys(axes, DECADES), "fixed": fixed, "along": {"phase": {"num": 3}}}
    return replace(sweep.build_study(kernel="toy:KERNEL", allow_import=True, **keys), kernel=kernel)


def groups(study):
    return [str(group) for group in scaling(study).groups]


def test_a_viscous_foliot_over_three_axes_is_one_dimensional():
    found = scaling(foliot("mu", "a", "phi0"))
    assert [str(group) for group in found.groups] == ["mu/(phi0 a^2)"]
    assert {name: str(group) for name, group in found.scales.items()} == {
        "period": "a",
        "amplitude": "1/phi0",
        "crossing_speed": "1/(phi0 a)",
        "sensitivity": "",
        "multiplier": "",
    }
    assert found.free == 2
    assert found.advice.startswith("one-dimensional in mu, a, phi0: only mu/(phi0 a^2) matters; 2 of these axes")


@pytest.mark.parametrize(
    ("axes", "fixed", "expected", "free"),
    [
        (("mu", "a"), {"phi0": 1.0}, ["mu/(phi0 a^2)"], 1),
        (("mu",), {"phi0": 1.0, "a": 1.0}, ["mu/(phi0 a^2)"], 0),
        (("mu", "a"), {"phi0": 1.0, "R": 0.05}, ["mu/(phi0 a^2)", "R/mu"], 0),
        (("mu", "phi0", "a"), {"R": 0.05}, ["mu/(phi0 a^2)", "R/mu"], 1),
        (("mu", "a"), {"phi0": 1.0, "c": 0.2, "n": 2.0}, ["mu/a^2"], 1),  # c v|v| fixes the unit of angles
    ],
)
def test_further_terms_add_their_groups(axes, fixed, expected, free):
    study = foliot(*axes, **fixed)
    assert groups(study) == expected
    assert scaling(study).free == free


def test_a_unit_that_changes_more_than_numbers_does_not_count():
    """The toy with a hidden length: its fall is stopped at 3 m, whatever the height."""

    def stopped(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        TOY.methods[1].solve(np.minimum(height, 3.0), v0, g, rtol, phase, fall_time, impact_speed, drop, status)

    assert groups(toy("height", "g")) == []
    assert scaling(toy("height", "g", v0=1.0)).free == 1
    hidden = replace(TOY, methods=(replace(TOY.methods[1], solve=stopped),))
    assert scaling(toy("height", "g", kernel=hidden, v0=1.0)).free == 0


def test_coordinates_and_arrays_with_a_unit_hold_units_fast():
    timed = replace(TOY, along=(Field("phase", "s", "time", lower=0, upper=1),))
    assert scaling(toy("height", "g", kernel=timed, v0=1.0)).free == 0
    beads = sweep.build_study(kernel="beads:KERNEL", allow_import=True, axes={"g": DECADES}, fixed={"mass": [1.0, 2.0]})
    found = scaling(beads)
    assert found.groups == ()
    assert found.advice.startswith("every output is a power of g")
    held = replace(BEADS.parameters[1], unit="m/s")  # as if places moved
    beads = replace(beads, kernel=replace(BEADS, parameters=(BEADS.parameters[0], held, BEADS.parameters[2])))
    assert scaling(beads).free == 0


def test_outputs_rescaled_fall_on_one_curve_and_say_what_they_are():
    study = foliot("mu", "a", "phi0")
    ds = sweep.run(study)
    free = sweep.rescaled(ds)
    assert free.period.attrs["long_name"] == "period a"
    assert free.amplitude.attrs["long_name"] == "amplitude/phi0"
    assert free.sensitivity.attrs["long_name"] == "sensitivity"
    assert all(free[name].attrs["units"] == "1" for name in study.outputs)
    assert free.group_1.attrs["long_name"] == "mu/(phi0 a^2)"
    np.testing.assert_allclose(free.period, ds.period * ds.a, rtol=1e-15)
    np.testing.assert_allclose(free.group_1, ds.mu / ds.phi0 / ds.a**2, rtol=1e-14)
    assert sweep.collapse_quality(free.group_1, free.period) < 1e-12
    assert sweep.collapse_quality(ds.mu, ds.period) > 0.1
    reread = sweep.rescaled(ds, study)
    xr.testing.assert_identical(reread, free)


def test_a_collapse_measures_what_is_off():
    x = xr.DataArray(np.geomspace(0.1, 10, 401), dims="i")
    assert sweep.collapse_quality(x, 2 * x**-0.5) < 1e-12
    wobble = np.where(np.arange(401) % 2, 0.01, -0.01)
    assert sweep.collapse_quality(x, 2 * x**-0.5 * np.exp(wobble)) == pytest.approx(0.02, rel=1e-3)


def test_plan_says_so_before_it_runs():
    assert "only mu/(phi0 a^2) matters" in str(sweep.plan(foliot("mu", "a", "phi0")))
    assert "scaling" not in str(sweep.plan(foliot("mu", a=1.0, phi0=1.0)))


def test_groups_are_written_as_people_do():
    from fractions import Fraction as F

    assert str(Group((("mu", F(1)), ("a", F(-2)), ("phi0", F(-1))))) == "mu/(a^2 phi0)"
    assert str(Group((("a", F(1, 2)),))) == "a^(1/2)"
    assert str(Group((("a", F(-1)),))) == "1/a"
