"""Which method a cell gets, what is said of it, and which cells are left out."""

import doctest

import balance_oracles
import numpy as np
import pytest
from mpmath import mp, mpf, sqrt
from toy_studies import build

import sweep
from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells import solve
from sweep.cells.sample import sampled
from sweep.explore.refine import refine


def test_auto_does_not_deny_what_an_impact_clock_does_where_following_it_leaves_that_open():
    random = np.random.default_rng(11)
    near = 1 + 10.0 ** random.uniform(-12, -3, 60) * random.choice([-1, 1], 60)
    axes = {"I_c": 1e-5 * np.append(1 + 1e-9, near), "e": [0.6, 0.77]}
    fixed = {"torque": 0.01, "I_v": 1e-5, "r_c": 0.03, "r_v": 0.03, "teeth": 31, "h": 0.001}
    keys = {"kernel": "impact", "axes": axes, "fixed": fixed, "outputs": ["period"]}
    found, followed, closed = (sweep.run(**keys, method=method) for method in ("auto", "events", "closed"))
    open_ = followed.status.isin([status for status in Status if status.kind == "unsolved"])
    assert (closed.status == Status.NO_CYCLE).all()
    assert open_[0, 1]
    assert open_.sum() > 20
    assert (found.status == followed.status).all()
    assert (found.method_used == np.where(open_, -1, 1)).all()


def test_the_worked_example_comes_out_as_it_stands_there():
    found = doctest.testmod(solve)
    assert found.attempted
    assert not found.failed


def run(**keys):
    return sweep.run(sweep.study(**keys), progress=False).isel(dict.fromkeys(keys["axes"], 0))


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


def test_a_refined_grid_keeps_the_bounds():
    keys = {"kernel": "foliot", "axes": {"mu": np.geomspace(0.1, 10, 5)}, "fixed": {"phi0": 1.0, "a": 1.0}}
    study = sweep.study(**keys, rtol=1e-12, method="asymptotic")
    found = refine(sweep.run(study, progress=False), ["period"], 1e-2).dataset
    assert ((found.status < FIRST_REFUSAL) == found.error_bound.notnull()).all()
    assert ((found.status == Status.INACCURATE) == (found.error_bound > 1e-12)).all()


AXES = {"height": [-1.0, 1.0, 2.0, 4.0], "v0": [0.0, 1.0, 3.0]}


def test_a_condition_that_holds_nowhere_is_told_before_anything_is_run(tmp_path):
    study = build(axes=AXES, where="height > 4")
    for function, *path in ((sweep.run,), (sweep.run, tmp_path / "a.h5"), (sweep.plan,)):
        with pytest.raises(sweep.SweepError, match='where = "height > 4": holds for none of the 12 cells'):
            function(study, *path)
    assert not list(tmp_path.iterdir())


def test_a_sample_is_of_cells_that_are_asked_for_where_there_are_any():
    axes = {"height": [float(h) for h in range(1, 1001)], "v0": [0.0, 1.0]}
    found = sampled(build(axes=axes, where="height > 990 and v0 > 0.5"), 7).axes
    assert (found["height"].values > 990).all()
    assert found["v0"].values.tolist() == [1.0] * 7
    assert len(sampled(build(axes=axes, where="height < 0"), 7).axes["height"]) == 7
