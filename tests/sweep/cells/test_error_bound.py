"""Where no method meets rtol: the best values there are, and what they are right to."""

import balance_oracles
import numpy as np
import pytest
from mpmath import mp, mpf, sqrt

import sweep
from kernels.interface import FIRST_REFUSAL, Status
from sweep.explore.refine import refine


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
