"""Which method a cell gets, and what is said of it."""

import doctest

import numpy as np
import pytest
from stand_ins import solved, toy_study

import sweep
from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells import solve
from sweep.cells.solve import NONE, STRIP, UNKNOWN, among


def test_strips_join_without_a_seam():
    mu = np.geomspace(1e-3, 1e3, STRIP + 100)
    study = sweep.study(kernel="foliot", axes={"mu": mu}, fixed={"a": 1.0, "phi0": 1.0}, method="closed")
    outputs, status, _ = solved(study)
    seam, _, _ = solved(study, STRIP - 50, STRIP + 50)
    assert (status < FIRST_REFUSAL).all()
    assert np.array_equal(outputs["period"][STRIP - 50 : STRIP + 50], seam["period"])
    assert np.all(np.diff(outputs["period"]) < 0)


def test_traces_are_solved_a_few_cells_at_a_time():
    phase = np.linspace(0, 1, 100_000)
    study = toy_study(
        axes={"height": np.linspace(1, 2, 50)}, outputs=["drop", "fall_time"], along={"phase": phase}, method="exact"
    )
    outputs, _, _ = solved(study, 0, 45)
    assert outputs["drop"][44, -1] == pytest.approx(1 + 44 / 49, rel=1e-15)


def test_auto_does_not_deny_what_an_impact_clock_does_where_following_it_leaves_that_open():
    random = np.random.default_rng(11)
    near = 1 + 10.0 ** random.uniform(-12, -3, 60) * random.choice([-1, 1], 60)
    axes = {"I_c": 1e-5 * np.append(1 + 1e-9, near), "e": [0.6, 0.77]}
    fixed = {"torque": 0.01, "I_v": 1e-5, "r_c": 0.03, "r_v": 0.03, "teeth": 31, "h": 0.001}
    keys = {"kernel": "impact", "axes": axes, "fixed": fixed, "outputs": ["period"]}
    _, status, used = solved(sweep.study(**keys))
    _, followed, _ = solved(sweep.study(**keys, method="events"))
    closed = solved(sweep.study(**keys, method="closed"))[1]
    open_ = among(followed, UNKNOWN)
    assert (closed == Status.NO_CYCLE).all()
    assert open_[1]
    assert open_.sum() > 20
    assert (status == followed).all()
    assert (used == np.where(open_, NONE, 1)).all()


def test_the_worked_example_comes_out_as_it_stands_there():
    found = doctest.testmod(solve)
    assert found.attempted
    assert not found.failed
