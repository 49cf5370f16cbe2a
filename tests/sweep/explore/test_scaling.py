"""Dimensionless groups found from units and tried on cells; superfluous axes; collapse."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from toy import KERNEL as TOY

import sweep
from kernels.interface import Field
from sweep.explore.scaling import scaling

DECADES = {"spacing": "log", "start": 0.1, "stop": 10, "num": 5}


def foliot(*axes, **fixed):
    return sweep.study(kernel="foliot", axes=dict.fromkeys(axes, DECADES), fixed=fixed)


def toy(*axes, kernel=TOY, **fixed):
    keys = {"axes": dict.fromkeys(axes, DECADES), "fixed": fixed, "along": {"phase": {"num": 3}}}
    return replace(sweep.study(kernel="toy:KERNEL", allow_import=True, **keys), kernel=kernel)


def groups(study):
    return [str(group) for group in scaling(study).groups]


def test_a_viscous_foliot_over_three_axes_is_one_dimensional():
    found = scaling(foliot("mu", "a", "phi0"))
    assert [str(group) for group in found.groups] == ["mu/(phi0 a^2)"]
    assert "mu/(phi0 a^2)" in repr(found)
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
        (("mu", "a"), {"phi0": 1.0, "c": 0.2, "n": 2.0}, ["mu/(phi0 a^2)", "phi0 c"], 1),  # c is in 1/rad
    ],
)
def test_further_terms_add_their_groups(axes, fixed, expected, free):
    study = foliot(*axes, **fixed)
    assert groups(study) == expected
    assert scaling(study).free == free


@pytest.mark.parametrize("rtol", [1e-2, 1e-9])
@pytest.mark.parametrize(("n", "expected"), [(1.0, "phi0 c^2/mu"), (1.5, "phi0^3 c^4/mu"), (2.0, "phi0 c")])
def test_a_parameter_whose_unit_depends_on_another_one_is_in_the_group(n, expected, rtol):
    """Of drag c v^n alone, with c in rad^(1-n) s^(n-2)."""
    found = scaling(replace(foliot("mu", "c", "phi0", n=n), rtol=rtol))
    assert ([str(g) for g in found.groups], found.free) == ([expected], 2)
    assert "a single cell" not in found.advice


def test_a_law_that_holds_nearly_is_not_taken_for_a_scaling():
    """At strong drive P ~ mu^(-1/3), to 1e-3."""
    strong = {"spacing": "log", "start": 1e4, "stop": 1e6, "num": 5}
    study = sweep.study(kernel="foliot", axes={"mu": strong, "a": DECADES, "phi0": DECADES}, rtol=1e-2)
    assert scaling(study).free == 2


def test_a_unit_that_changes_more_than_numbers_does_not_count():
    """The toy with a hidden length: its fall is stopped at 3 m, whatever the height."""

    def stopped(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        TOY.methods[1].solve(np.minimum(height, 3.0), v0, g, rtol, phase, fall_time, impact_speed, drop, status)

    assert groups(toy("height", "g")) == []
    assert scaling(toy("height", "g", v0=1.0)).free == 1
    hidden = replace(TOY, methods=(replace(TOY.methods[1], solve=stopped),))
    assert scaling(toy("height", "g", kernel=hidden, v0=1.0)).free == 0


def test_coordinates_hold_units_fast_where_the_kernel_takes_them_for_what_they_are():
    def at_times(height, v0, g, rtol, time, fall_time, impact_speed, drop, status):
        TOY.methods[1].solve(height, v0, g, rtol, time, fall_time, impact_speed, drop, status)
        drop[...] = v0[:, None] * time + g[:, None] * time**2 / 2

    along = (Field("phase", "s", "time", lower=0, upper=1),)
    timed = replace(TOY, along=along, methods=(replace(TOY.methods[1], solve=at_times),))
    assert scaling(toy("height", "g", kernel=timed, v0=1.0)).free == 0
    assert scaling(toy("height", "g", kernel=replace(timed, methods=TOY.methods), v0=1.0)).free == 1
    beads = sweep.study(kernel="beads:KERNEL", allow_import=True, axes={"g": DECADES}, fixed={"mass": [1.0, 2.0]})
    found = scaling(beads)
    assert found.groups == ()
    assert found.advice.startswith("every output is a power of g")


def test_outputs_rescaled_fall_on_one_curve_and_say_what_they_are():
    study = foliot("mu", "a", "phi0")
    ds = sweep.run(study)
    free = sweep.scaling(ds).rescaled(ds)
    assert free.period.attrs["long_name"] == "period a"
    assert all(free[name].attrs["units"] == "1" for name in study.outputs)
    assert free.group_1.attrs["long_name"] == "mu/(phi0 a^2)"
    np.testing.assert_allclose(free.period, ds.period * ds.a, rtol=1e-15)
    np.testing.assert_allclose(free.group_1, ds.mu / ds.phi0 / ds.a**2, rtol=1e-14)
    alpha, period = (v.values.ravel() for v in xr.broadcast(free.group_1, free.period))
    order = np.argsort(alpha)
    same = np.diff(np.log(alpha[order])) < 1e-12
    assert same.sum() > 3
    assert (abs(np.diff(np.log(period[order])))[same] < 1e-12).all()
    with pytest.raises(sweep.SweepError, match="another unit"):
        sweep.scaling(study).rescaled(sweep.in_units(ds, {"a": "1/minute"}))
    chain = sweep.run(kernel="drivetrain", axes={"f_max": [1.0, 2.0]}, fixed={"J": [1.0, 2.0], "k": [1.0, 0.0]})
    before = chain.copy(deep=True)  # of arrays there are outputs to free, and no groups
    assert not sweep.scaling(chain).rescaled(chain).identical(before)
    xr.testing.assert_identical(chain, before)
    reread = sweep.scaling(study).rescaled(ds)
    xr.testing.assert_identical(reread, free)
