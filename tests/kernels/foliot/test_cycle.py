"""The viscous foliot against 50 digits, against waiting for the cycle, and against its own laws."""

import numpy as np
import oracles
import pytest
from columns import bounds, checked, relative_error, solve
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mpf

from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
SOME = 400 if COMPILED else 12


def scenes(low, high, n=SOME, seed=1):
    """mu, phi0, a of random foliots with log10(alpha) between `low` and `high`."""
    random = np.random.default_rng(seed)
    alpha = 10 ** random.uniform(low, high, n)
    a, phi0 = 10 ** random.uniform(-3, 3, n), 10 ** random.uniform(-2, 2, n)
    return alpha * a * a * phi0, phi0, a


def errors(outputs, columns, names=NAMES):
    truths = [oracles.foliot(*cell) for cell in zip(*columns, strict=True)]
    return {name: relative_error(outputs[name], [t[NAMES.index(name)] for t in truths]) for name in names}


@pytest.mark.parametrize(("low", "high"), [(-12, -2), (-2, 0.155), (0.15, 0.16), (0.155, 2), (2, 12)])
def test_closed_form_is_right_to_1e_15_over_24_decades(low, high):
    columns = scenes(low, high)
    outputs, status = solve(FOLIOT, "closed", *columns)
    assert (status == Status.OK).all()
    for name, error in errors(outputs, columns, NAMES[:4]).items():
        worst = error.argmax()
        assert error[worst] < 1e-15, (name, [float(c[worst]) for c in columns])


def test_the_closed_form_promises_what_it_keeps():
    columns = scenes(-12, 12)
    outputs, _ = solve(FOLIOT, "closed", *columns)
    for names, promise in ((NAMES[:4], 1e-15), (NAMES, 2e-15)):
        assert (bounds(FOLIOT, "closed", *columns, asked=names) == promise).all()
        found = errors(outputs, columns, names)
        assert all((found[n][outputs["multiplier"] > 1e-300] <= promise).all() for n in names)


def test_multiplier_keeps_its_digits_down_to_the_smallest_float():
    columns = scenes(-2.5, 6)
    outputs, _ = solve(FOLIOT, "closed", *columns)
    assert errors(outputs, columns, ["multiplier"])["multiplier"].max() < 2e-15


def test_closed_form_holds_from_1e_minus_30_to_1e30():
    columns = scenes(-30, 30, n=SOME // 2)
    outputs, status = solve(FOLIOT, "closed", *columns)
    assert (status == Status.OK).all()
    for name, error in errors(outputs, columns, NAMES[:4]).items():
        assert error.max() < 1e-15, name


@pytest.mark.parametrize(
    ("mu", "phi0", "a"),
    [
        (1e-200, 1e100, 1e-150),
        (1e-150, 1e-300, 1e75),
        (3e250, 1e250, 2.0),
        (1e-290, 1e-290, 1.0),
        (1e-310, 1.0, 1e-155),
        (1.0, 1e-120, 1e60),
        (1.7e308, 1.7e308, 1.0),
        (1e300, 1e-300, 1e300),
        (1e70, 1e60, 1e150),
        (4e-308, 1e308, 2e-308),  # only the period is too large
        (1e-300, 1e-300, 1e10),  # only the speed is too small
    ],
)
def test_nothing_overflows_or_loses_digits_on_the_way(mu, phi0, a):
    outputs, status = solve(FOLIOT, "closed", [mu], [phi0], [a])
    truth = oracles.foliot(mu, phi0, a)
    exist = [2.3e-308 < t < 1.7e308 for t in truth[:4]]
    k = mpf(a) ** 2 * mpf(phi0) / mpf(mu)
    if 2.3e-308 < k < 1.7e308:
        assert status[0] == (Status.OK if all(exist) else Status.PARTLY_OUT_OF_RANGE)
        for name, there, t in zip(NAMES[:4], exist, truth, strict=False):
            assert relative_error(outputs[name], [t])[0] < 1e-15 if there else np.isnan(outputs[name][0]), name
    else:
        assert status[0] == Status.OUT_OF_RANGE


@pytest.mark.parametrize("alpha", [0.02, 1.0, 1.46299058758010465706, 30.0])
def test_closed_form_is_what_waiting_for_the_cycle_gives(alpha):
    outputs, _ = solve(FOLIOT, "closed", [alpha * 0.09 * 0.7], [0.7], [0.3])
    waited = oracles.foliot_by_waiting(alpha * 0.09 * 0.7, 0.7, 0.3, half_swings=60)
    for name, truth in zip(NAMES, waited, strict=False):
        assert relative_error(outputs[name], [truth])[0] < 1e-15, name


def test_the_point_of_exponent_one_half():
    outputs, _ = solve(FOLIOT, "closed", [1.46299058758010465706], [1.0], [1.0])
    assert outputs["period"][0] == pytest.approx(6.42446119521106945636, rel=1e-15)
    assert outputs["amplitude"][0] == pytest.approx(1.39341841440363426389, rel=1e-15)
    assert outputs["crossing_speed"][0] == pytest.approx(1.46299058758010465706 * 0.92258390188922026865, rel=1e-15)
    assert outputs["sensitivity"][0] == pytest.approx(0.5, rel=1e-15)
    assert outputs["multiplier"][0] == pytest.approx(0.0402666942, rel=1e-9)


@pytest.mark.parametrize(("low", "high"), [(-12, -1), (-1, 1.5), (1.5, 12)])
def test_asymptotic_errors_stay_below_their_bounds(low, high):
    columns = scenes(low, high)
    outputs, status = solve(FOLIOT, "asymptotic", *columns)
    assert (status == Status.OK).all()
    found = errors(outputs, columns)
    found["multiplier"][outputs["multiplier"] < 1e-300] = 0.0  # 0 for good
    for name in NAMES:
        limit = bounds(FOLIOT, "asymptotic", *columns, asked=[name])
        assert (found[name] <= limit).all(), name
        assert limit.max() < 0.2


def test_the_bounds_of_the_series_are_not_idle():
    columns = (np.array([1e4, 0.5]), np.ones(2), np.ones(2))
    outputs, _ = solve(FOLIOT, "asymptotic", *columns)
    limit = bounds(FOLIOT, "asymptotic", *columns, asked=["sensitivity"])
    found = errors(outputs, columns, ["sensitivity"])["sensitivity"]
    assert (found > limit / 30).all()


@pytest.mark.parametrize("rtol", [1e-4, 1e-9, 1e-12])
def test_the_iterated_map_is_right_to_rtol_or_says_that_it_has_not_settled(rtol):
    columns = scenes(-6, 9 if COMPILED else 2, n=SOME // 2)
    outputs, status = solve(FOLIOT, "map", *columns, rtol=rtol)
    good = (status == Status.OK) & (bounds(FOLIOT, "map", *columns) <= rtol)
    assert set(status) <= {Status.OK, Status.NOT_CONVERGED}
    assert good.mean() > 0.5
    kept = [c[good] for c in columns]
    for name, error in errors({n: v[good] for n, v in outputs.items()}, kept).items():
        error[outputs["multiplier"][good] < 1e-300] *= name != "multiplier"
        assert error.max() <= rtol, name


@pytest.mark.skipif(not COMPILED, reason="ten thousand half swings in plain Python")
def test_the_iterated_map_gives_up_at_strong_drive():
    _, status = solve(FOLIOT, "map", np.array([1e12, 1e9, 1.0]), np.ones(3), np.ones(3), rtol=1e-9)
    assert status.tolist() == [Status.NOT_CONVERGED, Status.OK, Status.OK]


@pytest.mark.skipif(not COMPILED, reason="thousands of half swings in plain Python")
def test_what_rounding_leaves_of_the_iterated_map_stays_below_its_bound():
    columns = scenes(-3, 8, seed=3)
    outputs, status = solve(FOLIOT, "map", *columns, rtol=1e-16)
    settled = status == Status.OK
    assert settled.mean() > 0.5
    kept = [c[settled] for c in columns]
    found = errors({n: v[settled] for n, v in outputs.items()}, kept)
    found["multiplier"][outputs["multiplier"][settled] < 1e-300] = 0.0
    for name, error in found.items():
        ratio = error / bounds(FOLIOT, "map", *kept, asked=[name])
        assert ratio.max() < 1, name
    assert max(error.max() for error in found.values()) > 1e-14


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9] if COMPILED else [1e-3])
def test_dopri5_is_right_to_rtol(rtol):
    columns = scenes(-3, 9, n=SOME // 2 if COMPILED else 4)
    outputs, status = solve(FOLIOT, "dopri5", *columns, rtol=rtol)
    assert (status == Status.OK).all()
    for name, error in errors(outputs, columns).items():
        error[outputs["multiplier"] < 1e-300] *= name != "multiplier"
        assert error.max() <= rtol, name


@pytest.mark.skipif(not COMPILED, reason="sixty Newton steps at the finest tolerance in plain Python")
def test_dopri5_says_where_rounding_keeps_newton_from_settling():
    _, status = solve(FOLIOT, "dopri5", np.array([1e6, 1e12, 1.0]), np.ones(3), np.ones(3), rtol=[1e-15, 1e-12, 1e-12])
    assert set(status[:2]) <= {Status.NOT_CONVERGED, Status.INACCURATE}
    assert status[2] == Status.OK


def test_dopri5_refuses_what_is_too_stiff_and_remarks_what_rounding_spoils():
    _, status = solve(FOLIOT, "dopri5", np.array([1e-8, 1e11, 1.0]), np.ones(3), np.ones(3), rtol=[1e-3, 1e-12, 1e-3])
    assert status[0] == Status.STEP_LIMIT
    assert status[1] in (Status.INACCURATE, Status.NOT_CONVERGED)
    assert status[2] == Status.OK


@given(st.floats(-10, 10), st.floats(1e-4, 1.0))
def test_more_torque_makes_the_clock_faster_and_its_swing_wider(log_alpha, more):
    mu = np.array([1.0, 1.0 + more]) * 10.0**log_alpha
    outputs, _ = solve(FOLIOT, "closed", mu, np.ones(2), np.ones(2))
    assert outputs["period"][1] < outputs["period"][0]
    assert outputs["amplitude"][1] >= outputs["amplitude"][0] >= 1.0
    assert np.all((outputs["sensitivity"] > 1 / 3 - 1e-15) & (outputs["sensitivity"] < 1 + 1e-15))


def test_sensitivity_is_the_slope_of_the_period():
    alpha = np.geomspace(1e-3, 1e5, 33)
    step = 1e-4
    low, _ = solve(FOLIOT, "closed", alpha * np.exp(-step), np.ones(33), np.ones(33))
    high, _ = solve(FOLIOT, "closed", alpha * np.exp(step), np.ones(33), np.ones(33))
    middle, _ = solve(FOLIOT, "closed", alpha, np.ones(33), np.ones(33))
    slope = -np.log(high["period"] / low["period"]) / (2 * step)
    assert np.allclose(slope, middle["sensitivity"], rtol=1e-8)


INF, NAN = np.inf, np.nan


@pytest.mark.parametrize(
    ("mu", "phi0", "a", "status"),
    [
        (1, 1, 1, Status.OK), (0, 1, 1, Status.NEVER_STARTS), (1, 1, 0, Status.NO_LIMIT_CYCLE),
        (-1, 1, 1, Status.BAD_INPUT), (1, 0, 1, Status.BAD_INPUT), (1, -1, 1, Status.BAD_INPUT),
        (1, 1, -1, Status.BAD_INPUT), (NAN, 1, 1, Status.BAD_INPUT), (1, NAN, 1, Status.BAD_INPUT),
        (1, 1, NAN, Status.BAD_INPUT), (INF, 1, 1, Status.BAD_INPUT), (1, INF, 1, Status.BAD_INPUT),
        (1, 1, INF, Status.BAD_INPUT), (-INF, 1, 1, Status.BAD_INPUT), (0, NAN, 1, Status.BAD_INPUT),
        (0, 1, 0, Status.NEVER_STARTS),
    ],
)  # fmt: skip
def test_what_cannot_run_is_refused_by_name(mu, phi0, a, status):
    for n in (1, 40):
        assert (checked(FOLIOT, np.full(n, mu), np.full(n, phi0), np.full(n, a)) == status).all()


@pytest.mark.parametrize("method", ["closed", "asymptotic", "map"] if COMPILED else ["closed"])
def test_over_the_whole_range_of_float64_a_cell_is_right_or_refused(method):
    random = np.random.default_rng(11)
    mu, phi0, a = (10 ** random.uniform(-307, 307, SOME) for _ in range(3))
    edges = np.array([[1.0, 1.0, 1e-155], [1.0, 1.0, 1e-160], [1e10, 1.0, 1e-150], [1e300, 1e-10, 1.0]])
    near = np.array([[1.0, 1.0, 2.0**e] for e in (-241, -240, -239, 239, 240, 241, -511, 511)])
    columns = np.concatenate([np.stack([mu, phi0, a], axis=1), edges, near]).T
    outputs, status = solve(FOLIOT, method, *columns, rtol=1e-9)
    good = status == Status.OK
    kept = [c[good] for c in columns]
    limit = np.maximum(bounds(FOLIOT, method, *kept, asked=NAMES[:4]), 1e-9 if method == "map" else 0.0)
    for name, error in errors({n: v[good] for n, v in outputs.items()}, kept, NAMES[:4]).items():
        assert (error <= limit).all(), (name, [float(c[(error / limit).argmax()]) for c in kept])
    assert np.array([np.isfinite(v[good]) for v in outputs.values()]).all()
    for cell in columns.T[status == Status.OUT_OF_RANGE][-50:]:
        assert not 2.3e-308 < mpf(cell[2]) ** 2 * mpf(cell[1]) / mpf(cell[0]) < mpf("1.79e308"), cell
    for i in np.flatnonzero(status == Status.PARTLY_OUT_OF_RANGE)[-50:]:
        truth = oracles.foliot(*columns[:, i])
        for name, true in zip(NAMES[:3], truth, strict=False):
            missing = not 2.3e-308 < true < mpf("1.79e308")
            assert np.isnan(outputs[name][i]) == missing, (name, columns[:, i])
            assert missing or relative_error(outputs[name][i : i + 1], [true])[0] < 1e-9


def test_an_overflow_is_no_number_whatever_else_is_remarked():
    outputs, status = solve(FOLIOT, "dopri5", [1e308], [1.7e308], [1.0], rtol=1e-15)
    assert status[0] in (Status.INACCURATE, Status.PARTLY_OUT_OF_RANGE)
    assert np.isnan(outputs["amplitude"][0])
    assert np.isfinite(outputs["period"][0])


@pytest.mark.skipif(not COMPILED, reason="ten thousand half swings in plain Python")
@pytest.mark.parametrize("rtol", [np.nan, -1.0])
def test_the_iterated_map_never_settles_to_a_senseless_rtol(rtol):
    _, status = solve(FOLIOT, "map", [0.5], [1.0], [1.0], rtol=rtol)
    assert status[0] == Status.NOT_CONVERGED
