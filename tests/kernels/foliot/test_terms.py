"""The foliot with Coulomb friction, hairspring and restitution against 50 digits, and what cannot run."""

import foliot_oracles
import numpy as np
import pytest
from columns import bounds, checked, estimated, relative_error, solve

from kernels.foliot.cycle import FOLIOT
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
SOME = 16 if COMPILED else 4


def random_cells(terms, seed, n=SOME):
    """alpha over 24 decades (a = 1 or 0), R/mu to 1 - 1e-9 or down to 1e-12, zeta from 1e-4 to 10, often near 1."""
    random = np.random.default_rng(seed)
    reach = 12 if terms in ("a", "aR") else 5
    mu, one = 10.0 ** random.uniform(-reach, reach, n), np.ones(n)
    cells = {"mu": mu, "phi0": one, "a": one if "a" in terms else 0.0 * one}
    if "R" in terms:
        close, small = 1.0 - 10.0 ** random.uniform(-9, -0.1, n), 10.0 ** random.uniform(-12, -0.1, n)
        cells["R"] = mu * np.where(random.random(n) < 0.5, close, small)
    if "k" in terms:
        near = 1.0 + random.choice([-1.0, 0.0, 1.0], n) * 10.0 ** random.uniform(-15, -1, n)
        zeta = np.where(random.random(n) < 0.3, near, 10.0 ** random.uniform(-4, 1, n))
        cells["k"] = 0.25 / zeta**2
        cells["mu"] = np.maximum(mu, 2.0 * cells["k"])  # few that come to rest
    if "e" in terms:
        near = 1.0 - 10.0 ** random.uniform(-6, 0, n)
        cells["e"] = np.where(random.random(n) < 0.3, near, random.uniform(-0.95, 1, n))
    return cells


def truths(cells):
    rows = zip(*cells.values(), strict=True)
    return [foliot_oracles.cycle(**dict(zip(cells, map(float, row), strict=True))) for row in rows]


def worst_cell(error, cells):
    return {name: float(column[error.argmax()]) for name, column in cells.items()}


def assert_right(outputs, status, cells, allowed):
    good = np.isin(status, (Status.OK, Status.NOT_SELF_STARTING))
    kept = {name: column[good] for name, column in cells.items()}
    exact = truths(kept)
    for position, name in enumerate(NAMES):
        exact_or_one = [t[position] if t[position] > 1e-300 else 1 for t in exact]  # a multiplier may be 0 for good
        error = relative_error(np.where(outputs[name][good] > 1e-300, outputs[name][good], 1.0), exact_or_one)
        limit = max(3e-13, allowed) if name == "multiplier" else allowed
        assert error.max() < limit, (name, error.max(), worst_cell(error, kept))
    return good.mean()


@pytest.mark.parametrize(("terms", "seed"), [("a", 1), ("aR", 2), ("aR", 3), ("R", 4)])
def test_viscous_and_coulomb_friction_are_right_to_4e_15(terms, seed):
    cells = random_cells(terms, seed)
    outputs, status = solve(FOLIOT, "coulomb", **cells)
    assert (status == Status.OK).all()
    assert assert_right(outputs, status, cells, 4e-15) == 1.0
    assert (bounds(FOLIOT, "coulomb", **cells, asked=NAMES[:4]) <= 4e-15).all()


@pytest.mark.parametrize("terms", ["a", "aR", "R", "ak", "aRk", "ae", "aRe", "Re", "e", "aRke"])
def test_every_linear_term_in_every_combination_is_right_to_1e_13(terms):
    cells = random_cells(terms, seed=len(terms))
    outputs, status = solve(FOLIOT, "segments", **cells, rtol=1e-13)
    assert (status != Status.NOT_CONVERGED).all()
    share = assert_right(outputs, status, cells, 1e-13)
    assert share > (0.2 if terms in ("R", "aRk") else 0.5) or not COMPILED  # small s are remarked


WIDE_SWINGS = (
    {"mu": 0.8325162231299857, "phi0": 3.4541739652892662, "R": 1.9419516558116308e-09, "k": 0.24326608631850752},
    {"mu": 23.45755854915434, "phi0": 39.6822014183762, "R": 1.4281577786622918e-06, "k": 3.5446926172047624},
    {"mu": 0.5509590625740179, "phi0": 3.82539277366175, "R": 6.98390917575075e-05, "k": 1.3309086167759927},
    {"mu": 31.030687325891886, "phi0": 1.1298248019711736, "R": 0.0012675897912571012, "k": 0.0},
    {"mu": 0.17484109976698284, "phi0": 0.0010605806583133613, "R": 4.989492920121259e-05, "k": 0.0},
)
"""With next to no loss: the sensitivity, down to 8e-27, is a difference of terms near 1."""


@pytest.mark.skipif(not COMPILED, reason="swings of thousands of steps")
@pytest.mark.parametrize("method", ["segments", "dopri5"])
@pytest.mark.parametrize("rtol", [5e-5, 1e-6, 1e-9])
def test_a_sensitivity_that_all_but_cancels_is_right_or_said_not_to_be(method, rtol):
    cells = {name: np.array([cell[name] for cell in WIDE_SWINGS]) for name in WIDE_SWINGS[0]}
    outputs, status = solve(FOLIOT, method, **cells, rtol=rtol)
    assert (status < FIRST_REFUSAL).any()
    for i, truth in enumerate(truths(cells)):
        if status[i] in (Status.OK, Status.NOT_SELF_STARTING):
            assert abs(outputs["sensitivity"][i] / float(truth[3]) - 1) <= rtol, (i, status[i])


DEEP = {"mu": 2.0 / np.linspace(600.0, 707.0, 40 if COMPILED else 4), "phi0": 1.0, "a": 1.0}
"""Multipliers near exp(-700): the rounding of the exponent is 3e-14 to 1.4e-13 of them."""


def multiplier_errors(method, cells, **keys):
    """Errors of the multiplier, its truths above the least normal number; what the method says of them; statuses."""
    cells = {name: np.broadcast_to(column, np.shape(cells["mu"])) for name, column in cells.items()}
    outputs, status, told = estimated(FOLIOT, method, **cells, **keys)
    exact = [t[4] for t in truths(cells)]
    small = np.array([t < 1e-307 for t in exact])
    error = relative_error(
        np.where(small, 1.0, outputs["multiplier"]), [1 if s else t for s, t in zip(small, exact, strict=True)]
    )
    return error, told, status


def test_a_multiplier_that_is_next_to_nothing_is_right_or_said_not_to_be():
    for rtol in (1e-13, 5e-14):
        error, told, status = multiplier_errors("segments", DEEP, rtol=rtol)
        assert (error <= told).all()
        assert (error[status == Status.OK] <= rtol).all()
    assert (error > 1e-14).any()


@pytest.mark.parametrize(("a", "k"), [(4.0, 2.0), (8.3, 2.0), (13.3, 2.0), (30.0, 2.0)])
def test_the_multiplier_of_a_foliot_that_creeps_over_its_spring_is_as_right_as_is_said(a, k):
    away = 10.0 ** np.linspace(-9, -1, 9 if COMPILED else 3)
    error, told, _ = multiplier_errors("segments", {"mu": k * (1.0 + away), "phi0": 1.0, "a": a, "k": k})
    assert (error <= told).all(), (error / told).max()


@pytest.mark.parametrize("wanted", [["period"], ["amplitude", "crossing_speed"], ["multiplier"]] if COMPILED else [])
def test_a_sensitivity_without_digits_does_not_matter_where_it_is_not_asked_for(wanted):
    cells = {name: np.array([cell[name] for cell in WIDE_SWINGS]) for name in WIDE_SWINGS[0]}
    outputs, status = solve(FOLIOT, "segments", **cells, rtol=1e-12, asked=wanted)
    assert np.isin(status, (Status.OK, Status.NOT_SELF_STARTING)).all()
    for i, truth in enumerate(truths(cells)):
        for name in wanted:
            assert abs(float(outputs[name][i] / truth[NAMES.index(name)] - 1)) <= 1e-12
    assert (solve(FOLIOT, "segments", **cells, rtol=1e-12)[1] == Status.INACCURATE).all()


@pytest.mark.skipif(not COMPILED, reason="many cells and the oracle for each")
def test_errors_told_of_each_output_hold_next_to_the_threshold_of_a_spring():
    random = np.random.default_rng(5)
    n = 24
    k, a = 10.0 ** random.uniform(-2, 2, n), 10.0 ** random.uniform(-2, 1.5, n)
    R, e = k * 10.0 ** random.uniform(-4, 0, n), np.where(random.random(n) < 0.5, random.uniform(-0.9, 0.9, n), 1.0)
    cells = {"mu": (k + R) * (1.0 + 10.0 ** random.uniform(-12, -1, n)), "phi0": np.ones(n), "a": a, "k": k}
    cells |= {"R": R, "e": e}
    exact = truths(cells)
    for position, name in enumerate(NAMES):
        outputs, status, told = estimated(FOLIOT, "segments", **cells, asked=[name])
        truth = [t[position] for t in exact]  # a multiplier may be 0 for good
        found = (status < FIRST_REFUSAL) & np.array([abs(t) > 1e-300 for t in truth])
        error = relative_error(outputs[name][found], [t for t, f in zip(truth, found, strict=True) if f])
        assert (error <= told[found]).all(), name


@pytest.mark.parametrize("R", [0.0, 0.3])
def test_the_sensitivity_to_the_torque_beside_a_strong_hairspring_is_as_right_as_is_said(R):
    k = np.geomspace(1e2, 1e5, 24 if COMPILED else 4)
    cells = {"mu": np.ones(k.size), "phi0": np.ones(k.size), "R": np.full(k.size, R), "k": k, "e": np.full(k.size, 0.7)}
    outputs, _, told = estimated(FOLIOT, "segments", **cells)
    assert (relative_error(outputs["sensitivity"], [t[3] for t in truths(cells)]) <= told).all()


def test_the_multiplier_of_viscous_and_coulomb_friction_is_as_right_as_is_promised():
    n = 64 if COMPILED else 10
    random = np.random.default_rng(3)
    mu = 10.0 ** random.uniform(-2.6, 3.0, n)
    close, small = 1.0 - 10.0 ** random.uniform(-6, -0.1, n), 10.0 ** random.uniform(-12, -0.1, n)
    cells = {"mu": mu, "phi0": 1.0, "a": 1.0, "R": mu * np.where(random.random(n) < 0.5, close, small)}
    error, _, _ = multiplier_errors("coulomb", cells)
    promised = bounds(FOLIOT, "coulomb", **cells, asked=["multiplier"])
    assert (error <= promised).all()
    assert promised.max() < 4.8e-13
    assert promised.min() < 3e-15


REFUSED = [
    ({"a": 1.0, "R": 1.0}, Status.NEVER_STARTS),
    ({"a": 1.0, "R": 0.5, "R_s": 1.0}, Status.NEVER_STARTS),
    ({"c": 1.0, "n": 0.0}, Status.NEVER_STARTS),
    ({"R": 0.5, "R_s": 0.9}, Status.OK),
    ({"R": 0.5, "R_s": 0.4}, Status.BAD_INPUT),
    ({"a": 1.0, "k": 1.0, "R": 0.5, "R_s": 1.2}, Status.OK),  # the spring may help
    ({}, Status.NO_LIMIT_CYCLE),
    ({"k": 2.0}, Status.NO_LIMIT_CYCLE),
    ({"e": 0.5}, Status.OK),
]


@pytest.mark.parametrize(("cell", "status"), REFUSED)
def test_what_no_method_can_run_is_refused_by_name(cell, status):
    assert checked(FOLIOT, **{"mu": [1.0], "phi0": 1.0} | cell)[0] == status


def test_a_spring_that_the_drive_cannot_throw_over_makes_the_foliot_stick():
    """(mu - R)/k against phi0 tanh(delta/2), delta = pi zeta/sqrt(1 - zeta^2); against phi0 from zeta = 1 on."""
    zeta = np.array([0.01, 0.1, 0.5, 0.9, 1.0, 3.0])
    root = np.sqrt(np.maximum(1 - zeta**2, 1e-30))
    least = np.tanh(0.5 * np.pi * zeta / root)
    for factor, found in ((1 - 1e-6, Status.STICKS), (1 + 1e-6, Status.OK)):
        _, status = solve(FOLIOT, "segments", 0.3 + least * factor, 1.0, 2 * zeta, R=0.3, k=1.0, rtol=1e-3)
        assert ((status == found) | (status == Status.NOT_SELF_STARTING) & (found == Status.OK)).all()


def test_from_rest_at_the_centre_a_weak_drive_does_not_throw_a_spring_over():
    """It reaches (mu/k)(1 + exp(-delta)) at first, and less ever after."""
    zeta = np.array([0.01, 0.1, 0.5, 0.9])
    reach = 1 / (1 + np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)))
    weak = solve(FOLIOT, "segments", reach * (1 - 1e-9), 1.0, 2 * zeta, k=1.0)[1]
    assert (weak == Status.NOT_SELF_STARTING).all()
    assert (solve(FOLIOT, "segments", reach * (1 + 1e-9), 1.0, 2 * zeta, k=1.0)[1] == Status.OK).all()


@pytest.mark.parametrize("method", ["segments", "dopri5"])
def test_stiction_holds_a_turning_point_that_the_spring_does_not_free_and_none_at_a_switch_that_throws_back(method):
    cells = {
        "a": [0.5, 0.5, 0.0, 0.0, 0.0, 0.1, 0.1], "R": [0.1, 0.1, 0.5, 0.5, 0.5, 0.1, 0.1],
        "R_s": [1.5, 1.05, 0.9, 1.5, 1.5, 3.0, 3.0], "k": [0.1, 0.1, 0.0, 0.0, 10.0, 1.0, 1.0],
        "e": [1.0, 1.0, 1.0, 1.0, 1.0, 0.5, -0.5],
    }  # fmt: skip
    _, status = solve(FOLIOT, method, mu=1.0, phi0=1.0, **cells, rtol=1e-6)
    held = [s == Status.STICKS for s in status]
    assert held == [True, False, False, True, False, True, False]
    assert set(status) <= {Status.OK, Status.STICKS, Status.NOT_SELF_STARTING}


def test_beyond_their_range_segments_leave_the_cell_to_others():
    assert solve(FOLIOT, "segments", [1.0, 1.0], 1.0, [1e80, 1e50], e=0.5)[1].tolist() == [Status.NO_METHOD, Status.OK]


@pytest.mark.parametrize("losses", [{"R": 0.0}, {"R": 0.5}, {"e": 0.5}, {"e": -0.5}])
def test_what_friction_makes_creep_takes_the_way_over_its_terminal_speed(losses):
    """(mu - R)/a, up to where segments end: no time is lost in the start, as the way of that is (mu - R)/a^2."""
    a = np.geomspace(1e8, 1e59, 150)
    outputs, status = solve(FOLIOT, "segments", 1.0, 1.0, a, **losses, rtol=1e-13)
    assert (status == Status.OK).all()
    assert relative_error(outputs["period"], 4.0 * a / (1.0 - losses.get("R", 0.0))).max() < 1e-13
