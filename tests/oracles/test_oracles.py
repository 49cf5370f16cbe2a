"""The oracles against closed laws and against each other: each cell is solved in two unlike ways."""

import foliot_oracles
import oracles
import pytest
import ripple_oracles
from foliot_oracles import Flows, Integrals, NoCycle
from mpmath import mp, mpf


def digits(values, truths):
    """The fewest digits in which two tuples agree."""
    with mp.workdps(60):
        worst = max(abs(v / t - 1) if t else abs(v) for v, t in zip(values, truths, strict=True))
        return int(-mp.log10(worst + mpf(10) ** -50))


LINEAR = [
    (1.0, 0.8, 0.3, 0.2, 0, 0, 0, 0.9),
    (1.0, 0.8, 0.3, 0.2, 0, 0, 0, -0.7),
    (1.0, 1.0, 0.01, 1 - 1e-6, 0, 0, 0, 1.0),
    (1.0, 1.0, 5.0, 0.5, 0, 0, 0, 0.3),
    (3.0, 1.0, 0.2, 0.1, 1.0, 1.0, 0, 1.0),
]


@pytest.mark.parametrize("cell", LINEAR)
def test_flows_and_integrals_agree(cell):
    flows, integrals = (foliot_oracles.cycle_by(cell, method, 12) for method in (Flows, Integrals))
    assert digits(flows, integrals) >= 20


def test_the_viscous_law_is_that_of_flows():
    for a in (7.0, 1.0, 1e-6):
        assert digits(foliot_oracles.cycle(1.0, 1.0, a=a), oracles.foliot(1.0, 1.0, a)) >= 40


@pytest.mark.parametrize("cell", [{"R": 0.2, "k": 1.4, "e": -0.7}, {"R": 0.1, "e": 0.6}, {"c": 0.5, "n": 2, "R": 0.3}])
def test_flows_and_integrals_agree_with_a_taylor_series(cell):
    """The series takes its slopes from differences over 1e-8."""
    truth = ripple_oracles.by_taylor(1.0, 0.8, a=0.3, **{name: v for name, v in cell.items() if name != "n"})
    assert digits(foliot_oracles.cycle(1.0, 0.8, a=0.3, **cell, digits=16), truth) >= 14


@pytest.mark.parametrize("zeta", [1.0, 1 - 1e-13, 1 + 1e-13])
def test_nothing_is_lost_where_the_damping_is_critical(zeta):
    a = 2 * zeta * 0.5
    middle = foliot_oracles.cycle(1.0, 1.0, a=a, k=0.25)
    with mp.workdps(60):
        sides = [foliot_oracles.cycle(1.0, 1.0, a=mpf(a) + h, k=0.25) for h in (mpf("1e-20"), -mpf("1e-20"))]
        means = [(high + low) / 2 for high, low in zip(*sides, strict=True)]
    assert digits(middle, means) >= 35


@pytest.mark.parametrize(
    "cell",
    [
        {"R": 1.0}, {"R": 0.5, "c": 0.5}, {}, {"k": 0.5}, {"k": 2.0, "a": 1.0}, {"k": 1.0, "a": 10.0},
        {"k": 2.0, "a": 2.0, "e": -0.5},
    ],
)  # fmt: skip
def test_where_there_is_no_cycle_it_is_said(cell):
    with pytest.raises(NoCycle):
        foliot_oracles.cycle(1.0, 1.0, **cell)


def test_the_first_flips_come_to_the_cycle():
    cell = {"a": 0.4, "R": 0.1, "k": 0.2, "e": 0.8}
    period, _, speed, _, multiplier = foliot_oracles.cycle(1.3, 0.9, **cell)
    times, speeds = foliot_oracles.flips(1.3, 0.9, -0.3, 40, **cell)
    with mp.workdps(50):
        assert abs(speeds[-1] - speed) < speed * multiplier**39
        assert abs(2 * (times[-1] - times[-2]) - period) < 10 * period * multiplier**38
        ratio = (speeds[12] - speed) / (speeds[11] - speed)
        assert abs(ratio / multiplier - 1) < multiplier**11
