"""The foliot's half swing integrated: drag not smooth at rest, and what is refused.

Every term of the losses is in `test_ripple.py`, and beside other methods in `test_contract.py`.
"""

import foliot_oracles
import numpy as np
import pytest
from columns import estimated, named, relative_error, solve
from oracles import foliot

from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
UNIT = {"mu": 1.0, "phi0": 1.0}
NEAR_REST = [
    (1.32e-4, {"mu": 0.334, "phi0": 0.111, "c": 0.000814, "n": 0.162, "R": 0.14}),
    (1.52e-5, {"mu": 2.91, "phi0": 2.5, "c": 0.00295, "n": 0.344, "e": 0.0974}),
    (4.9e-4, {"mu": 6.342, "phi0": 0.2295, "c": 0.008921, "n": 1.099, "R": 0.5546}),
    (5.89e-8, {"mu": 0.38, "phi0": 0.459, "c": 0.00803, "n": 3.28, "R": 0.113, "a": 0.00501}),
]
"""rtol and terms; unless rest is passed without a step, errors are 1 to 1000 rtol."""


def as_columns(cells):
    return named(FOLIOT, [UNIT | {"n": 2.0} | cell for cell in cells])


def test_drag_that_is_not_smooth_at_rest_is_right_to_half_of_rtol():
    """The oracle takes two seconds."""
    rtol, cells = zip(*(NEAR_REST if COMPILED else NEAR_REST[:1]), strict=True)
    truths = [foliot_oracles.cycle(**cell, digits=12) for cell in cells]
    outputs, status = solve(FOLIOT, "dopri5", rtol=rtol, **as_columns(cells))
    assert (status == Status.OK).all()
    for position, name in enumerate(NAMES):
        error = relative_error(outputs[name], [truth[position] for truth in truths])
        assert (error <= 0.5 * np.array(rtol)).all(), name


STICKING = [
    {"a": 3.0, "k": 10.0},  # overdamped: creeps to the spring's rest
    {"a": 0.5, "k": 100.0},  # falls short by energy
    {"a": 0.5, "k": 6.6},  # the first that falls short: with 6.0 there is a cycle
    {"R": 1.0},
    {"R": 0.5, "c": 0.5, "n": 0.0},
    {"a": 0.1, "R": 0.9, "k": 30.0},
]


def test_where_a_swing_from_rest_cannot_reach_the_switch_it_sticks():
    for cell in STICKING:
        with pytest.raises(foliot_oracles.NoCycle):
            foliot_oracles.cycle(**UNIT | cell, digits=15)
    rtol = 1e-6 if COMPILED else 1e-3
    assert (solve(FOLIOT, "dopri5", rtol=rtol, **as_columns(STICKING))[1] == Status.STICKS).all()
    assert solve(FOLIOT, "dopri5", rtol=rtol, **as_columns([{"a": 0.5, "k": 6.0}]))[1][0] == Status.OK


def test_a_switch_that_is_met_in_a_long_step_is_not_taken_for_rest_before_it():
    """They were NOT_CONVERGED: what was left open of the step's end was called rest."""
    cells = [
        {"mu": 1.216, "phi0": 0.6763, "n": 1.787, "c": 0.01287, "k": 0.2964},
        {"mu": 0.6919, "phi0": 0.2493, "n": 1.442, "c": 0.02403, "k": 3.348, "e": -0.5092},
        {"mu": 9.654, "phi0": 4.853, "n": 1.088, "c": 0.7434, "a": 0.0006409},
    ]
    for cell, rtol in zip(cells, (2e-3, 8e-3, 5e-4), strict=True):
        found, status = solve(FOLIOT, "dopri5", rtol=rtol, **as_columns([cell]))
        true, _ = solve(FOLIOT, "taylor", rtol=1e-10, **as_columns([cell]))
        assert status[0] == Status.OK
        assert all(abs(found[name] / true[name] - 1.0) <= rtol for name in NAMES)


def test_what_a_spring_keeps_from_the_switch_is_not_followed_to_its_rest():
    """Drag of a degree next to 1 has it creep there for more steps than there may be."""
    cells = [
        {"mu": 3.19, "phi0": 0.1008, "n": 1.309, "c": 121.7, "R": 2.835, "a": 41.29, "k": 5.979, "e": 0.8766},
        {"mu": 1.3, "phi0": 5.033, "n": 1.205, "c": 402.0, "R": 1.025, "k": 0.2704},
        {"mu": 5.582, "phi0": 0.3175, "n": 1.105, "c": 2972.0, "R": 0.4907, "a": 0.2102, "k": 84.28, "e": -0.5012},
        {"mu": 0.5726, "phi0": 0.262, "n": 1.261, "c": 0.001389, "a": 9.228, "k": 3.972},
    ]
    rtol = 3e-9 if COMPILED else 1e-3
    assert (solve(FOLIOT, "sdirk4", rtol=rtol, **as_columns(cells))[1] == Status.STICKS).all()


@pytest.mark.skipif(not COMPILED, reason="the finest tolerances in plain Python")
@pytest.mark.parametrize(
    ("cell", "rtol", "statuses"),
    [
        ({"mu": 1e-8, "a": 1.0}, 1e-3, {Status.STEP_LIMIT}),  # too stiff
        ({"a": 101.0, "k": 1e-3}, 1e-3, {Status.STEP_LIMIT}),
        ({"R": 0.1492, "k": 77.15}, 1e-9, {Status.INACCURATE}),  # rounding spoils it
        ({"mu": 1e11, "a": 1.0}, 1e-12, {Status.INACCURATE, Status.NOT_CONVERGED}),
        ({"mu": 1e6, "a": 1.0}, 1e-15, {Status.INACCURATE, Status.NOT_CONVERGED}),
        ({"a": 1.0}, np.nan, set(Status) - {Status.OK}),
        ({"a": 1.0}, -1.0, set(Status) - {Status.OK}),
    ],
)
def test_what_cannot_be_right_to_rtol_says_so(cell, rtol, statuses):
    assert solve(FOLIOT, "dopri5", rtol=rtol, **as_columns([cell]))[1][0] in statuses


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize(
    ("exact", "cells"),
    [
        ("segments", {"a": np.geomspace(1.0, 1e5, 21), "R": 0.1, "k": 0.3, "e": 0.9}),
        ("quadrature", {"c": np.geomspace(0.1, 1e4, 16), "n": np.linspace(1.0, 4.0, 16), "R": 0.2, "e": -0.4}),
    ],
    ids=["spring", "drag"],
)
def test_however_stiff_the_implicit_method_is_right_to_half_of_rtol(exact, cells, rtol):
    true, _ = solve(FOLIOT, exact, **UNIT, rtol=1e-12, **cells)
    found, status = solve(FOLIOT, "sdirk4", **UNIT, rtol=rtol, **cells)
    assert (status == Status.OK).all()
    for name in NAMES:
        there = true[name] > 1e-300
        assert np.abs(found[name][there] / true[name][there] - 1.0).max() <= 0.5 * rtol + 1e-12


def test_the_error_that_is_stated_at_strong_drive_covers_the_rounding_of_many_steps():
    """Friction takes little there, and errors of a half swing are some hundred times as large in the cycle."""
    mu = np.geomspace(1e3, 1e8, 200 if COMPILED else 2)
    truths = np.array([[float(value) for value in foliot(x, 1.0, 1.0)[:2]] for x in mu]).T
    for method in ("dopri5", "sdirk4"):
        outputs, status, error = estimated(FOLIOT, method, mu=mu, phi0=1.0, a=1.0, rtol=1e-13, asked=NAMES[:2])
        assert (status <= Status.INACCURATE).all()
        for name, truth in zip(NAMES, truths, strict=False):
            assert (relative_error(outputs[name], truth) <= error).all(), (method, name)
