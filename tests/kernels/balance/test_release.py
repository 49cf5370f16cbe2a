"""The balance's ring-down against 100 digits, where the last digit decides, and against its own laws."""

import balance_oracles as oracles
import numpy as np
import pytest
from columns import bounds, checked, relative_error, solve
from mpmath import mpf

from kernels.balance.release import BALANCE
from kernels.balance.trace import BALANCE_TRACE
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("half_swings", "stop_angle", "stop_time", "margin", "period")
SOME = 200 if COMPILED else 12
INF, NAN = np.inf, np.nan


def dampings(kind, random, n):
    """zeta of a regime."""
    return {
        "light": lambda: 10 ** random.uniform(-16, -2, n),
        "moderate": lambda: random.uniform(0.01, 0.99, n),
        "nearly critical": lambda: 1 - 10 ** random.uniform(-15.9, -2, n),
        "none": lambda: np.zeros(n),
        "any": lambda: np.minimum(10 ** random.uniform(-120, 0, n), 0.999),
    }[kind]()


def scenes(kind, low=-12.0, high=0.0, n=SOME, seed=1, units=30):
    """Columns of random balances: log10 of r/theta0 between `low` and `high`, lengths over `units` decades and back."""
    random = np.random.default_rng(seed)
    unit = 10 ** random.uniform(-units, units, n)
    r = unit * 10 ** random.uniform(low, high, n)
    r_s = r * np.where(random.random(n) < 0.5, 1.0, 1 + 10 ** random.uniform(-3, 1, n))
    theta0 = unit * random.choice([-1.0, 1.0], n) * random.uniform(1, 2, n)
    return dampings(kind, random, n), 10 ** random.uniform(-30, 30, n), r, r_s, theta0


def truths(columns):
    return [oracles.balance(*cell) for cell in zip(*columns, strict=True)]


def errors(outputs, expected, names=NAMES):
    """Relative errors by name; 0 for an exact 0."""
    found = {}
    for name in names:
        true = [t[NAMES.index(name)] for t in expected]
        found[name] = np.array(
            [float(abs(mpf(float(v)) - t) / (abs(t) or 1)) for v, t in zip(outputs[name], true, strict=True)]
        )
    return found


@pytest.mark.parametrize("kind", ["light", "moderate", "nearly critical", "none", "any"])
def test_closed_form_is_right_to_1e_15_and_the_count_exact_up_to_1e12_half_swings(kind):
    columns = scenes(kind)
    outputs, status = solve(BALANCE, "closed", *columns, rtol=1e-14)
    assert np.isin(status, (Status.OK, Status.GRAZING)).all()
    assert (status == Status.OK).mean() > 0.95
    assert (bounds(BALANCE, "closed", *columns) == 2e-15).all()
    good = status == Status.OK
    kept = {name: column[good] for name, column in outputs.items()}
    for name, error in errors(kept, truths([c[good] for c in columns])).items():
        assert error.max() < (1e-300 if name == "half_swings" else 1e-15), name


def grazing(shift, kind="moderate", seed=5):
    """Balances whose stiction lies a share `shift` of itself off the third turning point."""
    zeta, omega_n, r, _, theta0 = scenes(kind, -2, -1.7, SOME, seed, 0)
    zeta = 0.2 * zeta
    third = [oracles.turning_point(*cell, 3) for cell in zip(zeta, r, theta0, strict=True)]
    r_s = np.array([float(t * (1 + mpf(s))) for t, s in zip(third, np.broadcast_to(shift, (SOME,)), strict=True)])
    reached = r_s > r
    return [c[reached] for c in (zeta, omega_n, r, r_s, theta0)]


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_count_that_hangs_on_the_last_digits_is_grazing_and_exact_all_the_same(sign):
    columns = grazing(sign * 10 ** np.linspace(-16, -9.3, SOME))
    outputs, status = solve(BALANCE, "closed", *columns)
    assert len(status) > SOME // 2
    assert (status == Status.GRAZING).all()
    assert (outputs["margin"] < 1e-9).all()
    assert errors(outputs, truths(columns), ["half_swings"])["half_swings"].max() == 0
    beyond = grazing(sign * 10 ** np.linspace(-8.9, -6, SOME))
    outputs, status = solve(BALANCE, "closed", *beyond, rtol=1e-5)
    assert (status == Status.OK).all()
    assert (outputs["half_swings"] == (3 if sign > 0 else 4)).all()
    assert max(error.max() for error in errors(outputs, truths(beyond)).values()) < 1e-14


def test_huge_counts_are_exact_unless_an_ulp_of_the_input_decides():
    """5e11 half swings: an ulp of r is worth 1e-4 of one, so more is grazing than a margin below 1e-9."""
    random = np.random.default_rng(3)
    n = 10 * SOME
    r, theta0 = 1e-12 * random.uniform(1, 2, n), random.uniform(1, 2, n)
    shift = np.concatenate([10 ** random.uniform(-12, 0, n // 2), random.uniform(0, 1, n - n // 2)])
    swings = np.round(theta0 / (2 * r))
    theta0 = 2 * swings * r + r * (1 - 2 * shift)
    columns = np.zeros(n), np.ones(n), r, r, theta0
    outputs, status = solve(BALANCE, "closed", *columns)
    exact = [oracles.half_swings(0.0, *cell) for cell in zip(r, r, theta0, strict=True)]
    assert (outputs["half_swings"] == np.array(exact, float)).all()
    for ulp in (-1, 1):
        beside = [oracles.half_swings(0.0, q, q, a) for q, a in zip(r, np.nextafter(theta0, ulp * INF), strict=True)]
        changed = np.array(exact, float) != np.array(beside, float)
        assert (status[changed] == Status.GRAZING).all()
    assert 0.0 < (status == Status.GRAZING).mean() < 0.9


@pytest.mark.parametrize("zeta", [0.0, 1e-30, 1e-16])
def test_a_count_that_no_digits_can_tell_is_grazing_and_has_no_stop_angle(zeta):
    outputs, status = solve(BALANCE, "closed", [zeta], [2.0], [1e-30], [1e-30], [1.0])
    assert status[0] == Status.GRAZING
    expected = oracles.half_swings(zeta, 1e-30, 1e-30, 1.0)
    assert relative_error(outputs["half_swings"], [mpf(expected)])[0] < 4e-15
    assert np.isnan(outputs["stop_angle"][0])
    assert outputs["margin"][0] == 0


def test_a_turning_point_exactly_at_the_stiction_is_rest():
    outputs, status = solve(BALANCE, "closed", [0.0], [2.0], [0.125], [0.25], [1.0])
    assert status[0] == Status.GRAZING
    assert outputs["half_swings"][0] == 3
    assert outputs["stop_angle"][0] == -0.25
    assert outputs["margin"][0] == 0


@pytest.mark.parametrize("zeta", [1.0, 1 + 1e-12, 10.0])
def test_an_overdamped_balance_never_turns_and_creeps_to_where_friction_holds_the_spring(zeta):
    outputs, status = solve(BALANCE, "closed", [zeta] * 3, [3.0], [0.1] * 3, [0.2] * 3, [2.0, -2.0, 0.1])
    assert (status == Status.OVERDAMPED).all()
    assert outputs["stop_angle"].tolist() == [0.1, -0.1, 0.1]
    assert outputs["half_swings"].tolist() == [0, 0, 0]
    assert np.isnan(outputs["stop_time"][:2]).all()
    assert outputs["stop_time"][2] == 0
    assert np.isnan(outputs["period"]).all()
    np.testing.assert_allclose(outputs["margin"], [9, 9, 0.5], rtol=1e-15)


def test_without_solid_friction_the_swing_fades_and_never_ends():
    outputs, status = solve(BALANCE, "closed", [0.1], [3.0], [0.0], [0.0], [-2.0])
    assert status[0] == Status.NEVER_ENDS
    assert outputs["stop_angle"][0] == 0
    assert np.isnan([outputs[name][0] for name in ("half_swings", "stop_time", "margin")]).all()
    assert outputs["period"][0] == pytest.approx(2 * np.pi / (3 * np.sqrt(0.99)), rel=1e-15, abs=0.0)


def test_released_within_stiction_it_stays_where_it_is():
    theta0 = [0.05, -0.05, 0.0, -0.1, 0.1]
    outputs, status = solve(BALANCE, "closed", [0.3] * 5, [2.0], [0.1], [0.1], theta0)
    assert status.tolist() == [Status.OK, Status.OK, Status.OK, Status.GRAZING, Status.GRAZING]
    assert outputs["stop_angle"].tolist() == theta0
    assert not outputs["half_swings"].any()
    assert not outputs["stop_time"].any()
    np.testing.assert_allclose(outputs["margin"], [0.5, 0.5, 1.0, 0.0, 0.0], rtol=1e-15)


def trace(*columns, half_swing):
    outputs, status = solve(BALANCE_TRACE, "closed", *columns, along=[np.asarray(half_swing, float)])
    return outputs["turning_point"], status


@pytest.mark.parametrize("kind", ["light", "moderate", "nearly critical", "none"])
def test_turning_points_are_right_to_1e_15_of_the_release(kind):
    columns = scenes(kind, -4, 0, SOME // 4)
    counts = [oracles.half_swings(*cell) for cell in zip(*(columns[k] for k in (0, 2, 3, 4)), strict=True)]
    asked = [0, 1, 2, 3, 7, 20, 1000]
    found, status = trace(*columns, half_swing=asked)
    assert (status == Status.OK).all()
    assert np.array_equal(found[:, ::-1], trace(*columns, half_swing=asked[::-1])[0], equal_nan=True)
    for i, (zeta, _, r, _, theta0) in enumerate(zip(*columns, strict=True)):
        for k, value in zip(asked, found[i], strict=True):
            if k > counts[i]:
                assert np.isnan(value)
            else:
                true = np.sign(theta0) * (-1) ** k * oracles.turning_point(zeta, r, theta0, k)
                assert abs(mpf(float(value)) - true) <= 1e-15 * abs(theta0)


def test_a_trace_shows_what_there_is_of_an_overdamped_and_of_an_endless_motion():
    found, status = trace(
        [1.0, 0.0, 0.1], [1.0], [0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [-2.0, 2.0, -2.0], half_swing=[0, 1, 6]
    )
    assert status.tolist() == [Status.OVERDAMPED, Status.OK, Status.OK]
    assert np.array_equal(found[0], [-2.0, NAN, NAN], equal_nan=True)
    assert found[1].tolist() == [2.0, -2.0, 2.0]
    share = np.exp(-np.pi * 0.1 / np.sqrt(0.99))
    np.testing.assert_allclose(found[2], [-2.0, 2.0 * share, -2.0 * share**6], rtol=1e-14)


def test_a_trace_is_grazing_only_if_it_reaches_the_turning_point_in_doubt():
    columns = grazing(1e-12)
    assert (trace(*columns, half_swing=[0, 1, 2])[1] == Status.OK).all()
    assert (trace(*columns, half_swing=[0, 1, 2, 3])[1] == Status.GRAZING).all()


@pytest.mark.parametrize("coordinate", [[0.5], [-1.0], [0.0, NAN], [1e30], [1.0, INF, 2.0]])
def test_a_coordinate_that_does_not_count_half_swings_is_bad_input(coordinate):
    _, status = trace([0.1], [1.0], [0.1], [0.1], [1.0], half_swing=coordinate)
    assert status[0] == Status.BAD_INPUT


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ((0.0, 1, 0.0, 0.0, 1), Status.NO_LIMIT_CYCLE),
        ((0.0, 1, 0.0, 0.5, 1), Status.NO_LIMIT_CYCLE),
        ((0.0, 1, 0.0, 0.5, 0.4), Status.OK),
        ((0.1, 1, 0.1, 0.09, 1), Status.BAD_INPUT),
        ((0.1, 1, 0.1, 0.1, 0), Status.OK),
    ],
)
def test_what_cannot_run_is_refused_by_name_and_a_trace_shows_also_what_never_ends(cell, status):
    columns = [np.array([float(c)]) for c in cell]
    assert checked(BALANCE, *columns)[0] == status
    assert checked(BALANCE_TRACE, *columns)[0] == (Status.OK if status == Status.NO_LIMIT_CYCLE else status)
