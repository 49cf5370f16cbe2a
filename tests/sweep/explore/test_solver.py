"""A study's kernel as a function: the numbers of the sweep itself, bit for bit, of one cell and of many."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pint
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from running import tall
from toy_studies import build

import sweep
from kernels.interface import Status

FOLIOT = {"kernel": "foliot", "axes": {"mu": [1.0], "phi0": [1.0]}, "rtol": 1e-8, "where": "phi0 < 8"}


@pytest.fixture(scope="module", params=[("auto", 0.1), ("coulomb", 0.1), ("dopri5", 0.1), ("asymptotic", 0.0)])
def keys(request):
    method, R = request.param
    return {**FOLIOT, "method": method, "fixed": {"a": 1.0, "R": R}}


@settings(deadline=None, max_examples=25)
@given(cells=st.lists(st.tuples(st.floats(-1.0, 1e6), st.floats(1e-3, 10.0)), min_size=1, max_size=3))
def test_cells_are_those_of_the_sweep(keys, cells):
    """Also where one is refused, or not asked for, and where the bound of a method is beyond rtol."""
    mu, phi0 = np.array([(1.0, 1.0), *cells]).T
    clock = sweep.solver(keys)
    swept = sweep.run({**keys, "design": "zip", "axes": {"mu": mu, "phi0": phi0}})
    many = clock(mu, phi0)
    for name in clock.fields:
        assert np.array_equal(getattr(many, name), swept[name].values, equal_nan=True)
        for i in range(len(mu)):
            one = getattr(clock(mu[i], phi0=phi0[i]), name)
            assert np.array_equal(one, swept[name].values[i], equal_nan=True)


def test_arrays_are_broadcast_traces_come_behind_and_no_call_changes_what_an_earlier_one_gave():
    fall = sweep.solver(build(axes={"height": [1.0], "v0": [0.0]}, outputs=["drop"], along={"phase": [0.0, 1.0]}))
    found = fall(height=np.array([[1.0], [2.0]]), v0=[0.0, 1.0, 2.0])
    assert repr(fall).endswith("height, v0 -> drop, status>")
    assert found.drop.shape == (2, 3, 2)
    assert found.status.shape == (2, 3)
    assert np.allclose(found.drop[..., 1], [[1.0] * 3, [2.0] * 3])
    assert fall([], []).status.shape == (0,)
    in_mm, in_cm = xr.DataArray(1000.0, attrs={"units": "mm"}), pint.UnitRegistry().Quantity([100.0], "cm")
    assert fall(in_mm, 0.0).drop[1] == fall(in_cm, [0.0]).drop[0, 1] == fall(1.0, 0.0).drop[1]
    of_astropy = np.array(1000.0).view(type("Quantity", (np.ndarray,), {"unit": "mm"}))
    assert fall(of_astropy, 0.0).drop[1] == fall(1.0, 0.0).drop[1]
    masked = np.ma.array([1, 2], mask=[False, True])
    assert fall(masked, 0.0).status.tolist() == [Status.OK, Status.BAD_INPUT]
    one = fall(3.0, 0.0).drop
    fall(5.0, 0.0)
    assert one.tolist() == [0.0, 3.0]


@pytest.mark.parametrize(
    ("values", "named", "word"),
    [
        ((1.0,), {}, "v0"),
        ((1.0, 2.0, 3.0), {}, "too many"),
        ((1.0,), {"hight": 2.0}, "for height and v0"),
        ((1.0,), {"height": 2.0}, "multiple values"),
        *(((value, 1.0), {}, "height is no number") for value in ("1.0", None, np.datetime64("2020-01-01"), 10**400)),
        ((1.0, [2.0, 1j]), {}, "v0 is complex"),
        (([1.0, 2.0], [1.0, 2.0, 3.0]), {}, "numbers"),
        ((xr.DataArray(1.0, attrs={"units": "kg"}), 1.0), {}, "mass"),
    ],
)
def test_a_wrong_call_is_told(values, named, word):
    fall = sweep.solver(build(axes={"height": [1.0], "v0": [0.0]}))
    with pytest.raises(sweep.SweepError, match=word):
        fall(*values, **named)


@pytest.mark.parametrize("keys", [{"method": ["exact"]}, {"rtol": [1e-3]}, {}])
def test_a_study_that_is_no_function_of_numbers_is_refused(keys):
    study = build(axes={"height": [1.0], **keys}, **({} if keys else {"summary": {}}))
    with pytest.raises(sweep.SweepError, match="a solver"):
        sweep.solver(study)


def test_a_solver_and_what_it_gives_can_be_sent_to_another_process():
    study = sweep.study({**FOLIOT, "fixed": {"a": 1.0}})
    clock = pickle.loads(pickle.dumps(sweep.solver(study)))
    found = clock([1.0, 2.0], phi0=1.0)
    again = pickle.loads(pickle.dumps(found))
    assert (again.period == found.period).all()
    assert pickle.loads(pickle.dumps(study)) == study


def test_threads_that_share_a_solver_have_the_values_of_their_own_cells():
    fall = sweep.solver(build(axes={"height": [1.0]}, outputs=["fall_time"], method="exact"))
    heights = [*np.arange(1.0, 9.0)] * 100
    with ThreadPoolExecutor(4) as threads:
        found = [cell.fall_time for cell in threads.map(fall, heights)]
    assert found == [fall(height).fall_time for height in heights]


def test_where_a_kernel_raises_the_cell_fails_and_others_have_values():
    clock = sweep.solver(tall(40, "bad:RAISING"))
    with pytest.warns(RuntimeWarning, match=r"height=11\b(?!\.)"):
        found = clock([10.0, 11.0, 12.0])
    assert found.status.tolist() == [Status.OK, Status.FAILED, Status.OK]
    assert np.isnan(found.fall_time).tolist() == [False, True, False]
    with pytest.warns(RuntimeWarning):
        assert clock(11.0).status == Status.FAILED
