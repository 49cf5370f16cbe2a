"""Where no method meets rtol: the best values there are, and what they are right to."""

from dataclasses import replace

import balance_oracles
import numpy as np
import pytest
from mpmath import mp, mpf, sqrt
from stand_ins import solved, stand_in, toy_study, with_kernel

import sweep
from kernels.interface import Status
from sweep.cells.grid import Cells
from sweep.cells.solve import NONE, Solver
from sweep.explore.refine import refine
from sweep.show.text import outputs_of


def gives(value, verdict=Status.OK):
    def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...], status[...] = value, value, value, verdict

    return solve


def promises(error):
    def bound(height, v0, g, rtol, phase, asked, out):
        out[...] = error

    return bound


def estimates(value, errors, verdict=Status.OK):
    """A method that learns by solving what each output is right to."""

    def solve(height, v0, g, rtol, phase, asked, fall_time, impact_speed, drop, error, status):
        fall_time[...], impact_speed[...], drop[...], status[...] = value, value, value, verdict
        error[...] = max(e for e, wanted in zip(errors, asked, strict=True) if wanted)

    return solve


def kernel_of(rough, exact):
    """The toy with two methods, each a pair of what solves and its bound; what takes `asked` estimates its error."""
    kernel = stand_in(rough=rough, exact=exact)
    names = ("asked" in m.solve.__code__.co_varnames[: m.solve.__code__.co_argcount] for m in kernel.methods)
    return replace(kernel, methods=tuple(replace(m, estimates=e) for m, e in zip(kernel.methods, names, strict=True)))


def told(rough, exact, **keys):
    """Value, status, method and error of the one cell of a study."""
    study = with_kernel(toy_study(**{"axes": {"height": [1.0]}, "rtol": 1e-9, **keys}), kernel_of(rough, exact))
    outputs = {name: np.empty(1) for name in study.outputs}
    status, used, error = np.empty(1, np.int8), np.empty(1, np.int8), np.empty(1, np.float32)
    Solver(study).solve(0, Cells(outputs, status, used, error))
    return outputs["impact_speed"][0], Status(int(status[0])).name, used[0], pytest.approx(error[0], 1e-6, nan_ok=True)


@pytest.mark.parametrize(
    ("rough", "exact", "expected"),
    [
        ((gives(1), promises(1e-3)), (gives(2), promises(1e-5)), (2, "INACCURATE", 1, 1e-5)),
        ((gives(1), promises(1e-5)), (gives(2), promises(1e-3)), (1, "INACCURATE", 0, 1e-5)),
        ((gives(1), promises(1e-5)), (gives(2, Status.STEP_LIMIT), None), (1, "INACCURATE", 0, 1e-5)),
        ((gives(1), promises(1e-5)), (gives(2, Status.INACCURATE), None), (1, "INACCURATE", 0, 1e-5)),
        ((gives(1, Status.INACCURATE), None), (gives(2), promises(1e-5)), (2, "INACCURATE", 1, 1e-5)),
        ((gives(1), promises(1e-3)), (estimates(2, (1e-5,) * 3), None), (2, "INACCURATE", 1, 1e-5)),
        ((gives(1), promises(1e-5)), (estimates(2, (1e-3,) * 3), None), (1, "INACCURATE", 0, 1e-5)),
        ((estimates(1, (1e-5,) * 3), None), (estimates(2, (1e-4,) * 3), None), (1, "INACCURATE", 0, 1e-5)),
        ((estimates(1, (1e-4,) * 3), None), (estimates(2, (1e-5,) * 3), None), (2, "INACCURATE", 1, 1e-5)),
        ((estimates(1, (1e-4,) * 3), promises(1e-3)), (gives(2), promises(5e-4)), (2, "INACCURATE", 1, 5e-4)),
        ((gives(1, Status.NO_CYCLE), promises(1e-5)), (gives(2), promises(1e-3)), (2, "INACCURATE", 1, 1e-3)),
        ((gives(1, Status.STICKS), promises(1e-3)), (gives(2), promises(np.inf)), (np.nan, "STICKS", NONE, np.nan)),
        ((gives(1), promises(np.nan)), (gives(2), promises(np.inf)), (np.nan, "NO_METHOD", NONE, np.nan)),
        ((gives(1), promises(np.nan)), (gives(2, Status.INACCURATE), None), (2, "INACCURATE", 1, np.inf)),
        ((gives(1), promises(1e-3)), (gives(2), promises(1e-9)), (2, "OK", 1, np.nan)),
        ((gives(1), promises(1e-3)), (gives(2, Status.GRAZING), None), (2, "GRAZING", 1, np.nan)),
    ],
)  # fmt: skip
def test_auto_gives_the_values_of_the_smallest_bound_where_nothing_meets_rtol(rough, exact, expected):
    found = told(rough, exact)
    assert found[1:3] == expected[1:3]
    assert found[3] == expected[3]
    assert found[0] == pytest.approx(expected[0], nan_ok=True)


@pytest.mark.parametrize("method", ["auto", "rough"])
def test_an_estimate_of_what_was_not_asked_for_says_nothing(method):
    rough = estimates(1, (1e-3, 1e-10, 1.0)), None
    assert told(rough, (gives(2), None), method=method)[1:3] == ("OK", 0)
    both = told(rough, (gives(2, Status.STEP_LIMIT), None), method=method, outputs=["impact_speed", "fall_time"])
    assert both[1:] == ("INACCURATE", 0, 1e-3)


def test_a_method_that_was_asked_for_gives_its_values_and_their_bound():
    assert told((gives(1), promises(1e-3)), (gives(2), None), method="rough") == (1, "INACCURATE", 0, 1e-3)
    assert told((gives(1), promises(1e-9)), (gives(2), None), method="rough")[1] == "OK"
    assert told((estimates(1, (np.nan,) * 3), None), (gives(2), None), method="rough")[1:] == (
        "INACCURATE", 0, np.inf,
    )  # fmt: skip


@pytest.mark.parametrize("refusal", [Status.BAD_INPUT, Status.NEVER_STARTS])
def test_a_cell_that_a_method_refuses_is_refused_whatever_its_estimate(refusal):
    assert told((estimates(1, (1e-3,) * 3, refusal), None), (gives(2), None), method="rough")[1] == refusal.name


@pytest.mark.parametrize(
    ("first", "then", "expected"),
    [("STEP_LIMIT", "NO_CYCLE", "STEP_LIMIT"), ("NO_CYCLE", "STEP_LIMIT", "STEP_LIMIT"),
     ("NOT_CONVERGED", "NO_METHOD", "NOT_CONVERGED"), ("NO_METHOD", "NO_CYCLE", "NO_METHOD")],
)  # fmt: skip
def test_how_a_method_gave_up_is_not_forgotten_for_less(first, then, expected):
    assert told((gives(1, Status[first]), None), (gives(2, Status[then]), None))[1] == expected


def test_each_cell_gets_its_own_best():
    def slanted(height, v0, g, rtol, phase, asked, out):
        out[...] = 1e-3 * height

    kernel = kernel_of((gives(1), slanted), (gives(2), promises(2e-3)))
    outputs, status, used = solved(with_kernel(toy_study(axes={"height": [5.0, 1.0, 3.0, 1e-9, 2.5]}), kernel))
    assert used.tolist() == [1, 0, 1, 0, 1]
    assert outputs["impact_speed"].tolist() == [2, 1, 2, 1, 2]
    assert status.tolist() == [Status.INACCURATE] * 3 + [Status.OK] + [Status.INACCURATE]


def run(**keys):
    return sweep.run(sweep.build_study(**keys), progress=False).isel(dict.fromkeys(keys["axes"], 0))


def test_foliots_at_too_tight_an_rtol_get_their_closed_form():
    for R, rtol in ((1e-6, 3e-15), (2e-14, 1e-15)):
        found = run(kernel="foliot", axes={"mu": [1.0]}, fixed={"phi0": 1.0, "R": R}, rtol=rtol)
        with mp.workdps(50):
            rho = mpf(R)
            truth = {"period": 4 * sqrt(2 / (rho * (1 - rho**2))), "sensitivity": rho**2 / (1 - rho**2)}
            for name, true in truth.items():
                assert abs(mpf(found[name].item()) / true - 1) <= found.error_bound.item(), name
        assert found.status == Status.INACCURATE
        assert rtol < found.error_bound <= 4.001e-15


def test_a_balance_at_too_tight_an_rtol_gets_its_count():
    found = run(kernel="balance", axes={"zeta": [1e-9]}, fixed={"omega_n": 1.0, "r": 1e-6, "theta0": 1.0}, rtol=1e-15)
    assert found.half_swings == balance_oracles.half_swings(1e-9, 1e-6, 1e-6, 1.0)
    assert (found.status, found.error_bound) == (Status.INACCURATE, pytest.approx(2e-15, rel=1e-6))


def test_multipliers_without_the_sensitivity_are_right_to_1e_13_in_all_of_601_cells():
    keys = {"axes": {"mu": np.geomspace(0.02, 1e4, 601)}, "fixed": {"phi0": 1.0, "a": 1e-3, "R": 1e-9}}
    found = sweep.run(sweep.build_study(kernel="foliot", outputs=["multiplier"], rtol=1e-13, **keys), progress=False)
    assert (found.status == Status.OK).all()


def test_a_file_holds_the_bounds_and_says_so(tmp_path):
    study = sweep.build_study(
        kernel="foliot", axes={"mu": [1.0, 2.0, -1.0]}, fixed={"phi0": 1.0, "a": 1.0}, rtol=1e-9, method="asymptotic"
    )
    path = tmp_path / "out.h5"
    with sweep.run(study, path, progress=False) as found, sweep.run(study, progress=False) as whole:
        assert np.array_equal(found.error_bound, whole.error_bound, equal_nan=True)
        assert np.isnan(found.error_bound.values).tolist() == [False, False, True]
        assert found.error_bound.dtype == np.float32
        assert "error_bound" in found.period.attrs["ancillary_variables"]
        assert outputs_of(found) == list(study.outputs)


def test_a_refined_grid_keeps_the_bounds():
    keys = {"kernel": "foliot", "axes": {"mu": np.geomspace(0.1, 10, 5)}, "fixed": {"phi0": 1.0, "a": 1.0}}
    study = sweep.build_study(**keys, rtol=1e-12, method="asymptotic")
    found = refine(sweep.run(study, progress=False), ["period"], 1e-2).dataset
    assert ((found.status == Status.INACCURATE) == found.error_bound.notnull()).all()
