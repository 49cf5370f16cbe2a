"""In what two results differ, checked on results that were made to differ in known cells."""

import numpy as np
import pytest
import xarray as xr
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.results.statuses import account

AXES = {"height": [1.0, 2.0, 4.0], "v0": [0.0, 1.0]}


@pytest.fixture
def result():
    return sweep.run(build(axes=AXES, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5, 1.0]}))


def test_a_result_is_the_same_as_itself(result):
    found = sweep.diff(result, result.copy(deep=True))
    assert found.same
    assert "bit for bit" in repr(found)
    assert all((distance.cells, distance.largest) == (0, 0.0) for distance in found.outputs.values())
    assert sweep.diff(result, result.transpose("v0", "phase", "height")).same
    assert sweep.diff(result.drop_indexes("height").isel(height=[2, 0, 1]), result).same
    assert sweep.diff(*[result.fall_time.to_dataset().assign(status=result.status).isel(height=1, v0=1)] * 2).same


def test_the_cell_and_the_distance_are_told(result):
    other = result.copy(deep=True)
    other.fall_time[1, 0] *= 1 + 1e-6
    other.fall_time[2, 1] *= 1 - 1e-3
    other["drop"][0, 1, 2] *= 1 + 1e-9
    found = sweep.diff(result, other)
    assert found.outputs["fall_time"].cells == 2
    assert found.outputs["fall_time"].largest == pytest.approx(1e-3, rel=1e-9)
    assert found.outputs["fall_time"].example == "e.g. height=4 v0=1"
    assert (found.outputs["drop"].cells, found.outputs["drop"].example) == (1, "e.g. height=1 v0=1")
    assert not found.same
    assert sweep.diff(result, other, rtol=1e-5).outputs["fall_time"].cells == 1
    other = result.copy(deep=True)
    other.fall_time[0, 0] *= 2
    assert [sweep.diff(result, other, rtol=rtol).same for rtol in (0.499, 0.5)] == [False, True]


def test_a_value_against_none_is_infinitely_far(result):
    other = result.copy(deep=True)
    other.fall_time[0, 0] = np.nan
    found = sweep.diff(result, other, rtol=0.5)
    assert found.outputs["fall_time"].largest == np.inf
    both = result.copy(deep=True)
    both.fall_time[0, 0] = np.nan
    assert sweep.diff(both, other).same


def test_statuses_are_compared(result):
    other = result.copy(deep=True)
    other.status[1, 1] = Status.INACCURATE
    other.status[2, :] = Status.BAD_INPUT
    found = sweep.diff(result, other, rtol=1.0)
    assert found.statuses == {("OK", "INACCURATE"): 1, ("OK", "BAD_INPUT"): 2}
    assert found.examples["OK", "BAD_INPUT"] == "e.g. height=4 v0=0"
    assert not found.same


def test_another_fixed_parameter_is_a_difference_though_no_cell_differs(result):
    other = result.assign_coords(g=result.g + 1.0)
    found = sweep.diff(result, other)
    assert list(found.fixed) == ["g"]
    assert not found.same
    assert f"fixed: g is {result.g.item()} in the first and {other.g.item()} in the second" in str(found)


def test_cells_of_equal_parameters_are_compared(result):
    more = sweep.run(build(axes={"height": [0.5, 1.0, 2.0, 4.0], "v0": [1.0, 3.0]}))
    found = sweep.diff(result.drop_vars("drop"), more)
    assert (found.cells, found.only_a, found.only_b) == (3, 3, 5)
    assert not found.same
    assert not found.outputs["fall_time"].cells
    assert sweep.diff(result, more).missing == ("drop",)


def test_points_are_compared_by_number():
    points = {"design": "zip", "axes": {"height": [1.0, 2.0], "v0": [0.0, 1.0]}}
    a = sweep.run(build(**points))
    assert sweep.diff(a, a.copy()).same
    b = sweep.run(build(design="zip", axes={"height": [1.0, 3.0], "v0": [0.0, 1.0]}))
    for pair in ((a, b), (a, a.drop_vars("v0")), (a.drop_vars("v0"), a)):
        with pytest.raises(sweep.SweepError, match="points along cell"):
            sweep.diff(*pair)


def test_what_cannot_be_compared_is_refused(result):
    with pytest.raises(sweep.SweepError, match="keeps no cells"):
        sweep.diff(result, sweep.run(build(axes=AXES, summary={})))
    for name, unit in (("fall_time", "ms"), ("height", "mm"), ("g", "mm/s^2")):
        with pytest.raises(sweep.SweepError, match=f"{name} is in .* and in "):
            sweep.diff(result, sweep.in_units(result, {name: unit}))
    with pytest.raises(sweep.SweepError, match="different kernels"):
        sweep.diff(result, result.assign_attrs(kernel="foliot"))
    with pytest.raises(sweep.SweepError, match="height and v0"):
        sweep.diff(result, sweep.run(build(axes={"height": [1.0]})))
    with pytest.raises(sweep.SweepError, match="height has a value twice"):
        sweep.diff(result, xr.concat([result, result], "height"))


def test_cells_of_large_results_are_found_wherever_they_are():
    """More than are looked at together."""
    status = np.zeros((3, 2_000_000), np.int8)
    ds = xr.Dataset({"status": (("x", "y"), status)}, {"x": [1.0, 2.0, 3.0], "y": np.arange(2e6)}, {"kernel": "toy"})
    ds["time"] = ("x", "y"), np.ones(status.shape)
    other = ds.copy(deep=True)
    other.status[2, 7] = Status.BAD_INPUT
    other.time[0, 5], other.time[2, 9] = 2.0, 1.5
    found = sweep.diff(ds, other)
    assert found.examples["0", str(int(Status.BAD_INPUT))] == "e.g. x=3 y=7"
    assert (found.outputs["time"].cells, found.outputs["time"].largest) == (2, 0.5)
    assert found.outputs["time"].example == "e.g. x=1 y=5"
    assert account(other).statuses == {"OK": 5_999_999, "BAD_INPUT": 1}
    assert account(other).examples == {"BAD_INPUT": {"x": "3", "y": "7"}}


@pytest.mark.parametrize("rtol", [-1.0, np.nan, "a", xr.DataArray([1.0, 2.0])])
def test_a_tolerance_that_is_none_is_refused(result, rtol):
    """By NaN any two results would be the same, by -1 a result would differ from itself."""
    with pytest.raises(sweep.SweepError, match="rtol"):
        sweep.diff(result, 2.0 * result, rtol=rtol)


def test_a_tolerance_may_be_an_array_of_one_number(result):
    assert sweep.diff(result, result, rtol=result.fall_time[0, 0]).same
