"""The first flips of the foliot: against 40 digits, and against what must be so."""

import foliot_oracles
import numpy as np
import pytest
from columns import relative_error, solve

from kernels.foliot.start import FLIP_LIMIT, FOLIOT_START
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

SOME = 150 if COMPILED else 12
LOSSES = ("a", "R", "k", "e")
INF, NAN = np.inf, np.nan


def start(*parameters, flips=4, **named):
    """Times and speeds of the first flips (a count, or their numbers), and the status."""
    along = [np.arange(1.0, flips + 1) if np.isscalar(flips) else np.asarray(flips, float)]
    outputs, status = solve(FOLIOT_START, "segments", *parameters, along=along, **named)
    return outputs["flip_time"], outputs["flip_speed"], status


def scenes(n, seed):
    """Foliots over 24 decades of alpha, every damping ratio up to 10, Coulomb friction up to mu (1 - 1e-9)."""
    random = np.random.default_rng(seed)

    def some(share):
        return random.random(n) < share

    a = np.where(some(0.1), 0.0, 10 ** random.uniform(-2, 2, n))
    phi0 = 10 ** random.uniform(-2, 2, n)
    mu = np.where(a > 0, 10 ** random.uniform(-12, 12, n) * a * a * phi0, 1.0)
    rho = np.select([some(0.3), some(0.5)], [0.0, random.random(n)], 1 - 10 ** random.uniform(-9, -1, n))
    by_damping, by_drive = (a / 2 / 10 ** random.uniform(-6, 1, n)) ** 2, mu / phi0 * 10 ** random.uniform(-6, 0, n)
    k = np.select([some(0.3), (a > 0) & (by_damping * phi0 < 3 * mu)], [0.0, by_damping], by_drive)
    e = np.select([some(0.5), some(0.7)], [1.0, random.random(n)], random.uniform(-0.95, 0, n))
    phi_start = phi0 * np.select(
        [some(0.3), some(0.5)], [0.0, random.uniform(-1, 1, n)], -(10 ** random.uniform(0, 2, n))
    )
    return {"mu": mu, "phi0": phi0, "a": a, "R": rho * mu, "k": k, "e": e, "phi_start": phi_start}


def truths(cell, count):
    """The oracle's times and speeds, for a release below +phi0."""
    cell = {name: float(v) for name, v in cell.items()}
    return foliot_oracles.flips(cell["mu"], cell["phi0"], cell["phi_start"], count, **{n: cell[n] for n in LOSSES})


def compare(columns, times, speeds):
    """The worst relative error of every cell; the flips that come must be those of the oracle."""
    worst = np.zeros(len(times))
    for i in range(len(times)):
        cell = {name: column[i] for name, column in columns.items()}
        true_times, true_speeds = truths(cell, times.shape[1])
        come = np.isfinite(times[i])
        assert np.array_equal(come, np.arange(len(come)) < len(true_times)), cell
        assert np.array_equal(come, np.isfinite(speeds[i])), cell
        found = (*relative_error(times[i][come], true_times), *relative_error(speeds[i][come], true_speeds))
        worst[i] = max(found, default=0.0)
    return worst


def test_flips_are_right_to_1e_13_or_say_that_they_are_not():
    columns = scenes(SOME, seed=1)
    times, speeds, status = start(**columns, flips=6, rtol=1e-13)
    worst = compare(columns, times, speeds)
    right = np.isin(status, (Status.OK, Status.COMES_TO_REST))
    assert set(status) <= {Status.OK, Status.INACCURATE, Status.COMES_TO_REST, Status.NEVER_STARTS, Status.STICKS}
    assert right.mean() > 0.8
    assert (status == Status.INACCURATE).mean() < 0.1
    assert worst[right].max() < 2e-14


@pytest.mark.skipif(not COMPILED, reason="fifty bisections of many cells")
@pytest.mark.parametrize("rtol", [1e-14, 1e-9])
def test_a_promise_is_kept_where_the_swing_just_comes_or_just_fails_to_come(rtol):
    """Releases at which one more flip just comes, found by bisection, and others near them."""
    n = SOME // 3
    random = np.random.default_rng(5)
    columns = {
        "mu": np.ones(n), "phi0": np.ones(n),
        "a": np.where(random.random(n) < 0.2, 0.0, 10 ** random.uniform(-2, 0.5, n)),
        "R": np.where(random.random(n) < 0.5, 0.0, 3 * random.random(n)), "k": 10 ** random.uniform(-0.5, 1.5, n),
        "e": np.where(random.random(n) < 0.5, 1.0, random.uniform(-0.99, 1, n)),
    }  # fmt: skip
    low, high = np.where(random.random(n) < 0.5, 0.9, -1.0), -(10 ** random.uniform(0.1, 2, n))

    def count(release):
        return np.isfinite(start(**columns, phi_start=release, flips=5)[0]).sum(axis=1)

    few, many = count(low), count(high)
    for _ in range(55):
        middle = 0.5 * (low + high)
        same = count(middle) == few
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    columns["phi_start"] = high * (1 + np.where(random.random(n) < 0.2, 0.0, 10 ** random.uniform(-16, -3, n)))
    times, speeds, status = start(**columns, flips=5, rtol=rtol)
    assert (few != many).mean() > 0.2
    sure = np.isin(status, (Status.OK, Status.COMES_TO_REST, Status.NEVER_STARTS, Status.STICKS))
    assert sure.mean() > 0.2
    worst = compare({name: c[sure] for name, c in columns.items()}, times[sure], speeds[sure])
    assert worst.max() < rtol
    assert {Status.INACCURATE, Status.GRAZING} <= set(status)


@pytest.mark.parametrize("alpha", [1.0, 1e4, 1e9])
def test_errors_of_hundreds_of_flips_stay_within_what_is_promised(alpha):
    count = 240 if COMPILED else 20
    times, speeds = foliot_oracles.flips(alpha, 1.0, 0.0, count, a=1.0, digits=30)
    at = [1.0, count // 3, count]
    found, fast, status = start([alpha], [1.0], a=[1.0], flips=at, rtol=1e-11)
    tight = start([alpha], [1.0], a=[1.0], flips=at, rtol=1e-15)[2]
    rows = [int(j) - 1 for j in at]
    error = [*relative_error(found[0], [times[j] for j in rows]), *relative_error(fast[0], [speeds[j] for j in rows])]
    assert max(error) < 1e-13
    assert error[2] < 5e-16 or alpha > 1  # the sum of the durations loses nothing
    assert status[0] == Status.OK
    assert tight[0] == Status.INACCURATE


@pytest.mark.parametrize("phi_start", [1.0, 1.5, 30.0])
def test_above_the_switch_the_torque_has_switched_already(phi_start):
    scene = {"mu": [1.0], "phi0": [1.0], "a": [0.3], "R": [0.1], "k": [0.4], "e": [0.9]}
    above, below = start(**scene, phi_start=[phi_start]), start(**scene, phi_start=[-phi_start])
    for one, other in zip(above, below, strict=True):
        assert np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize(
    ("named", "status", "come"),
    [
        ({"R": 1.0}, Status.NEVER_STARTS, 0),
        ({"R": 0.5, "R_s": 1.0}, Status.NEVER_STARTS, 0),
        ({"R": 0.5, "R_s": 0.999}, Status.OK, 4),
        ({"R": 0.5, "R_s": 1.45, "k": 0.2, "phi_start": -3.0}, Status.COMES_TO_REST, 3),  # held at the turning point
        ({"R": 0.5, "R_s": 1.4, "k": 0.2, "phi_start": -1.9}, Status.NEVER_STARTS, 0),
        ({"R": 0.5, "R_s": 1.4, "k": 0.2, "phi_start": -3.0, "e": -0.9}, Status.OK, 4),  # no turning point
        ({"k": 2.5}, Status.STICKS, 0),
        ({"k": 2.0, "a": 1.0, "phi_start": -4.0}, Status.COMES_TO_REST, 2),
        ({"k": 2.0, "a": 5.0, "phi_start": -4.0}, Status.STICKS, 0),  # creeps to 1/2
        ({"k": 2.0, "phi_start": 0.9}, Status.STICKS, 0),  # pulled back, and swings about 1/2
        ({"R": 3.0, "k": 1.0, "phi_start": -9.0, "e": -0.5}, Status.COMES_TO_REST, 2),
        ({"e": 0.0}, Status.OK, 4),
        ({"e": 0.0, "k": 0.5, "R": 0.2, "R_s": 1.6, "phi_start": -2.0}, Status.COMES_TO_REST, 1),  # held at the switch
    ],
)  # fmt: skip
def test_a_motion_that_ends_says_so(named, status, come):
    times, speeds, verdict = start([1.0], [1.0], **{name: [v] for name, v in named.items()})
    assert (verdict[0], np.isfinite(times[0]).sum()) == (status, come)
    assert np.array_equal(np.isfinite(times), np.isfinite(speeds))


def test_what_the_last_digits_decide_is_grazing():
    """Without losses and about 1/2, a release at -y turns at 1 + y: y = 0 would just reach the switch at 1."""
    _, _, status = start([1.0] * 4, [1.0] * 4, k=[2.0] * 4, phi_start=[0.0, -2e-15, -1e-4, 1e-4], flips=1)
    assert status.tolist() == [Status.GRAZING, Status.GRAZING, Status.OK, Status.STICKS]


def test_the_last_digits_may_decide_a_later_flip():
    """With e = 0 the half swing starts from rest at the switch and works 2 (mu - R) phi0 whatever the spring."""
    gap = np.array([0.0, 1e-16, -1e-15, 1e-6, -1e-6])
    times, _, status = start(np.ones(5), np.ones(5), R=1 - gap, k=0.5, e=0.0, phi_start=-3.0, flips=2, rtol=1e-7)
    assert status.tolist() == [Status.GRAZING] * 3 + [Status.OK, Status.COMES_TO_REST]
    assert np.isfinite(times[:, 0]).all()


def test_flips_may_be_asked_for_in_any_order():
    columns = scenes(40 if COMPILED else 3, seed=3)
    every = start(**columns, flips=9)
    for asked in ([2, 5, 9], [9, 2, 5], [3, 3, 1, 9, 9]):
        times, speeds, _ = start(**columns, flips=asked)
        rows = np.array(asked) - 1
        assert np.array_equal(times, every[0][:, rows], equal_nan=True)
        assert np.array_equal(speeds, every[1][:, rows], equal_nan=True)


@pytest.mark.parametrize("asked", [[0.0], [1.5], [1.0, NAN], [INF], [-1.0], [2 * FLIP_LIMIT]])
def test_a_coordinate_that_does_not_count_is_refused(asked):
    assert (start(np.ones(40), np.ones(40), flips=asked)[2] == Status.BAD_INPUT).all()
