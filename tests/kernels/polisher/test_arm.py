"""The polisher's arm against 50 digits, next to dead points, in tiny and lopsided machines, and beyond the domain."""

import numpy as np
import polisher_oracles as oracles
import pytest
from columns import relative_error, solve
from mpmath import mp, mpf, pi

from kernels.interface import Status
from kernels.lanes.jit import COMPILED
from kernels.polisher.arm import POLISHER

SOME = 60 if COMPILED else 12
FIGURE = (62.01, 38.0, 40.5)
"""b, d, f of the paper's figures."""
RATES = ("thd", "rate_max", "rate_min")
CLOSED = tuple(oracles.closed(*FIGURE, 10.0))


def swings(b, d, f, e):
    return e < min(b, d, f) and min(d + f - b - e, b + f - d - e, b + d - f - e) > 0


def machine(kind, random):
    """A random crank-rocker."""
    while True:
        b, d, f = 10 ** random.uniform(-4 if kind == "lopsided" else -1, 0, 3)
        e = min(b, d, f) * 10 ** random.uniform({"small crank": -12, "lopsided": -3}.get(kind, -1), 0)
        if kind == "near dead":
            gap = 10 ** random.uniform(-13, -3)
            e = (d + f - b, b + f - d, b + d - f)[random.integers(3)] * (1 - gap)
        if kind == "right angles":  # d^2 + f^2 - b^2 - e^2, or the same with b and d exchanged, is 0 but for rounding
            f = np.sqrt(abs(b * b - d * d) + e * e)
        if e > 0 and swings(b, d, f, e):
            return b, d, f, e


RIGHT = [
    (0.7646033079641995, 0.24600515147746116, 0.7241413559202836, 0.016763631996645822),
    (0.22432158267627217, 0.4357277682414095, 0.37378230652899247, 0.013217303502674473),
]
"""Machines of which a sum of squares is 0 but for 1e-19, far less than rounding leaves."""


def machines(kind, n=SOME, seed=1):
    random = np.random.default_rng(seed)
    found = [machine(kind, random) for _ in range(n)]
    return np.array([*found, *(RIGHT if kind == "right angles" else [])]).T


KINDS = ("usual", "small crank", "near dead", "lopsided", "right angles")


def largest_errors(outputs, columns, sign=1):
    """The largest relative error of each output; angles of the arm are compared with `sign` times type A's."""
    truths = [oracles.closed(*cell) for cell in np.transpose(columns)]
    found = {}
    for name in CLOSED:
        turned = 1 if name == "transmission_angle" or name.startswith("A1") else sign
        found[name] = relative_error(outputs[name], [turned * t[name] for t in truths]).max()
    return found


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kind_of_arm", [0, 1])
def test_every_closed_output_has_its_digits(kind, kind_of_arm):
    columns = machines(kind)
    outputs, status = solve(POLISHER, "stable", *columns, type=kind_of_arm, rtol=1e-14)
    assert (status == Status.OK).all()
    for name, error in largest_errors(outputs, columns, sign=-1 if kind_of_arm else 1).items():
        assert error < 2e-15, name
    assert np.isnan([outputs[name] for name in (*RATES, "theta_lock", "theta_lock_outer")]).all()


def test_derivatives_are_those_of_the_angles():
    """Of the oracle, which the kernel is compared with: its differences over 1e-20."""
    with mp.workdps(50):
        cell = [mpf(v) for v in (0.62, 0.38, 0.405, 0.1)]
        exact, step = oracles.closed(*cell), mpf(10) ** -20
        for k, length in enumerate("bdfe"):
            beside = oracles.closed(*(x + step * (j == k) for j, x in enumerate(cell)))
            for name in ("A0", "A1"):
                assert abs((beside[name] - exact[name]) / step - exact[f"{name}_{length}"]) < mpf(10) ** -18


@pytest.mark.parametrize("kind", KINDS)
def test_distortion_and_fastest_rates_are_right_to_1e_14(kind):
    cell = machines(kind, 1, seed=2)[:, 0]
    outputs, status = solve(POLISHER, "waveform", *cell, [KINDS.index(kind) % 2.0], rtol=1e-12)
    assert status[0] == Status.OK
    truths = oracles.distortion(*cell), oracles.fastest(*cell, 1), -oracles.fastest(*cell, -1)
    assert relative_error([outputs[name][0] for name in RATES], truths).max() < 1e-14


def test_a_finer_tolerance_than_its_rounding_is_inaccurate():
    assert solve(POLISHER, "waveform", *FIGURE, [15.0], rtol=1e-16)[1][0] == Status.INACCURATE


def exact_lengths(seed, n):
    """Lengths in whole 2^-40, and often such that a sum that decides is 0 or a few units."""
    random = np.random.default_rng(seed)
    for _ in range(n):
        b, d, f = (int(x) for x in random.integers(2**36, 2**40, 3))
        e = (d + f - b, b + f - d, b + d - f, b + d + f, b - d - f, d - b - f, f - b - d)[random.integers(7)]
        e += int(random.integers(-3, 4)) * int(10 ** random.uniform(0, 11))
        if e > 0:
            yield [x * 2.0**-40 for x in (b, d, f, e)]


def test_the_verdict_is_that_of_the_exact_lengths():
    cells = list(exact_lengths(4, 40 * SOME))
    _, status = solve(POLISHER, "stable", *np.transpose(cells))
    names = [Status(s).name for s in status]
    assert names == [oracles.verdict(*cell) for cell in cells]
    assert min(names.count(name) for name in ("OK", "LOCK_UP", "CHANGE_POINT", "DOUBLE_CRANK", "NO_ASSEMBLY")) > 2


def test_crank_angles_of_locks_have_their_digits():
    columns = 10 ** np.random.default_rng(5).uniform(-1, 0, (4, 10 * SOME))
    columns[:, 0] = 62, 60, 5, 10  # of which the arccos for the extremes has values
    outputs, status = solve(POLISHER, "stable", *columns)
    locked, seen = np.flatnonzero(status == Status.LOCK_UP), set()
    for j in locked:
        expected = [x for x in oracles.locks(*columns[:, j]) if x is not None]
        found = [outputs[name][j] for name in ("theta_lock", "theta_lock_outer")][: len(expected)]
        assert relative_error(found, expected).max() < 2e-15
        seen.add(len(expected))
    assert locked[0] == 0
    assert seen == {1, 2}
    assert np.isnan(outputs["A0"][locked]).all()
    assert (outputs["transmission_angle"][locked] == 0).all()


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_a_change_point_in_decimals_is_named_and_its_angles_are_sensible(unit):
    outputs, status = solve(POLISHER, "stable", *(unit * x for x in FIGURE), [unit * 16.49], type=[1.0])
    assert status[0] == Status.CHANGE_POINT
    assert np.degrees(outputs["A1"][0]) == pytest.approx(32.1659, abs=1e-4)
    assert np.degrees(outputs["A0"][0]) == pytest.approx(-32.1659, abs=1e-4)
    assert abs(outputs["eta_minus"][0]) < 2e-8
    assert outputs["transmission_angle"][0] < 1e-7
    assert np.isnan([outputs[name][0] for name in ("A0_b", "A1_e", "thd")]).all()


@pytest.mark.parametrize("method", ["stable", "waveform"])
def test_a_motor_without_throw_holds_the_arm_where_the_triangle_does(method):
    outputs, status = solve(POLISHER, method, [3.0], 4.0, 5.0, 0.0)
    assert status[0] == Status.OK
    assert (
        outputs["A0"][0]
        == outputs["eta_plus"][0]
        == outputs["eta_minus"][0]
        == pytest.approx(np.pi / 2, rel=1e-15, abs=0.0)
    )
    assert outputs["A1"][0] == outputs["A1_b"][0] == 0
    assert outputs["A1_e"][0] == pytest.approx(5 / 12, rel=1e-15, abs=0.0)
    if method == "waveform":
        assert [outputs[name][0] for name in RATES] == [0, 0, 0]


def test_an_arm_that_turns_fully_has_rates_but_no_extremes():
    b, d, f, e = 1.0, 3.0, 3.5, 2.0
    outputs, status = solve(POLISHER, "waveform", [b], d, f, e)
    assert status[0] == Status.DOUBLE_CRANK
    grid = [oracles.rate(b, d, f, e, 1, mpf(k) * 2 * pi / 4000) for k in range(4000)]
    assert outputs["rate_max"][0] == pytest.approx(float(max(grid)), rel=1e-6)
    assert outputs["rate_min"][0] == pytest.approx(float(min(grid)), rel=1e-6)
    assert np.isnan([outputs[name][0] for name in ("A0", "A1", "thd", "theta_plus")]).all()
    least = min(oracles.closed(e, d, f, b)["transmission_angle"], np.pi)  # as a linkage with frame and crank swapped
    assert outputs["transmission_angle"][0] == pytest.approx(float(least), rel=1e-14, abs=0.0)


@pytest.mark.parametrize(
    ("cell", "status"),
    [
        ((1e300, 1e300, 1e300, 1e299), Status.OUT_OF_RANGE), ((1e-300, 1e-300, 1e-300, 1e-301), Status.OUT_OF_RANGE),
        ((1e200, 0.6e200, 0.7e200, 0.1e200), Status.OK), ((1e-200, 0.6e-200, 0.7e-200, 0.1e-200), Status.OK),
        ((1.0, 0.6, 0.7, 1e-40), Status.OUT_OF_RANGE), ((1.0, 0.6, 0.7, 1e-35), Status.OK),
        ((1.0, 1e-300, 1.0, 1e-301), Status.OUT_OF_RANGE), ((1.0, 0.3, 0.3, 0.1), Status.NO_ASSEMBLY),
        ((5e-324, 5e-324, 5e-324, 0.0), Status.OUT_OF_RANGE), ((1.0, 1e300, 1.0, 1.0), Status.OUT_OF_RANGE),
    ],
)  # fmt: skip
def test_over_the_range_of_float64_a_machine_is_right_or_refused(cell, status):
    columns = np.array([cell]).T
    outputs, verdict = solve(POLISHER, "stable", *columns)
    assert verdict[0] == status
    if status == Status.OK:
        assert max(largest_errors(outputs, columns).values()) < 2e-15
