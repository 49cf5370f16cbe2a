"""Which method a cell gets, and what is said of it."""

import doctest

import numpy as np

import sweep
from kernels.interface import Status
from sweep.cells import solve


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
