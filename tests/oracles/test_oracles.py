"""The oracles against closed laws and against each other: each cell is solved in two unlike ways."""

import foliot_oracles
import oracles
import pytest
from foliot_oracles import Flows, Integrals, NoCycle, Series
from mpmath import asin, atan, atanh, exp, expm1, log1p, mp, mpf, pi, sqrt


def digits(values, truths):
    """The fewest digits in which two tuples agree."""
    with mp.workdps(60):
        worst = max(abs(v / t - 1) if t else abs(v) for v, t in zip(values, truths, strict=True))
        return int(-mp.log10(worst + mpf(10) ** -50))


@pytest.mark.parametrize("alpha", [0.02, 1.0, 1e12])
def test_viscous_friction_alone_gives_the_closed_form(alpha):
    assert digits(foliot_oracles.cycle(alpha, 0.7, a=1.0), oracles.foliot(alpha, 0.7, 1.0)) >= 40


def test_at_the_weakest_drive_only_the_multiplier_is_below_any_float():
    solved, truth = foliot_oracles.cycle(1e-12, 1.0, a=1.0), oracles.foliot(1e-12, 1.0, 1.0)
    assert digits(solved[:4], truth[:4]) >= 40
    assert solved[4] == 0 < truth[4] < mpf(10) ** -400


@pytest.mark.parametrize("rho", [1e-9, 0.3, 1 - 1e-9])
def test_coulomb_friction_alone_gives_its_law(rho):
    with mp.workdps(70):
        r, phi0 = mpf(rho), mpf("0.75")
        law = (4 * sqrt(2 * phi0 / r) / sqrt(1 - r**2), phi0 / r, sqrt(2 * phi0 * (1 - r**2) / r))
        law = (*law, r**2 / (1 - r**2), (1 - r) / (1 + r))
    assert digits(foliot_oracles.cycle(1.0, 0.75, R=rho), law) >= 40


@pytest.mark.parametrize("e", [0.6, 1 - 1e-9, 0.0, -0.7])
def test_restitution_alone_gives_its_law(e):
    with mp.workdps(50):
        r = mpf(e)
        amplitude = (1 + r**2) / (1 - r**2) if e > 0 else mpf(1)
        law = (4 * sqrt((1 + r) / (1 - r)), amplitude, 2 / sqrt(1 - r**2), mpf("0.5"), r**2)
    assert digits(foliot_oracles.cycle(1.0, 1.0, e=e), law) >= 40


@pytest.mark.parametrize("c", [1e-6, 0.5, 40.0])
def test_quadratic_drag_alone_gives_its_law(c):
    with mp.workdps(120):
        g = mpf(c)
        lam = sqrt(sqrt(-expm1(-4 * g)))
        law = (2 * (atanh(lam) + atan(lam)) / sqrt(g), 1 + log1p(lam**2) / (2 * g), lam / sqrt(g))
        law = (*law, mpf("0.5"), exp(-4 * g) / (1 + lam**2) ** 2)
    assert digits(foliot_oracles.cycle(1.0, 1.0, c=c, n=2, digits=20), law) >= 20


def test_a_spring_without_friction_swings_in_arcs_of_a_circle():
    e, kappa = mpf("0.5"), mpf("0.25")
    with mp.workdps(50):  # about -+1/kappa; the switch takes 1 - e^2 of v1^2, the drive gives 4
        v1, w = 2 / sqrt(1 - e**2), sqrt(kappa)
        out, back = 1 + 1 / kappa, 1 / kappa - 1
        radius = sqrt(out**2 + (e * v1 / w) ** 2)
        period = 2 * (pi - asin(out / radius) - asin(back / radius)) / w
        law = (period, radius - 1 / kappa, v1, e**2)
    solved = foliot_oracles.cycle(1.0, 1.0, k=0.25, e=0.5)
    assert digits((*solved[:3], solved[4]), law) >= 40


LINEAR = [
    (1.0, 0.8, 0.3, 0.2, 0, 0, 0, 0.9),
    (1.0, 0.8, 0.3, 0.2, 0, 0, 0, -0.7),
    (1.0, 1.0, 0.01, 1 - 1e-6, 0, 0, 0, 1.0),
    (1.0, 1.0, 5.0, 0.5, 0, 0, 0, 0.3),
    (3.0, 1.0, 0.2, 0.1, 1.0, 1.0, 0, 1.0),
]


@pytest.mark.parametrize("cell", LINEAR)
def test_flows_and_integrals_agree(cell):
    flows, integrals = (foliot_oracles._cycle(cell, method, 12) for method in (Flows, Integrals))
    assert digits(flows, integrals) >= 20


def test_flows_and_series_agree():
    cell = (1.0, 0.8, 0.3, 0.2, 0, 0, 1.4, -0.7)
    assert digits(foliot_oracles._cycle(cell, Flows, 20), foliot_oracles._cycle(cell, Series, 16)) >= 25


def test_integrals_and_series_agree():
    cell = (1.0, 0.8, 0.3, 0.2, 0.4, 2.3, 0, -0.7)
    assert digits(foliot_oracles._cycle(cell, Integrals, 10), foliot_oracles._cycle(cell, Series, 10)) >= 16


def test_series_turn_where_flows_turn():
    with mp.workdps(30):
        law = foliot_oracles.law_of(1.0, 0.8, 0.3, 0.2, 0, 0, 0.5, 0.9)
        series, flow = (method.half_swing(law, mpf("1.5")) for method in (Series, Flows))
        assert digits(vars(series).values(), vars(flow).values()) >= 25


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
        {"k": 2.0, "a": 2.0, "e": -0.5}, {"k": 2.0, "c": 1.0, "n": 1.5},
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


def test_flips_end_where_the_motion_does():
    assert foliot_oracles.flips(1.0, 1.0, 0.0, 5, R=1.0) == ([], [])
    times, speeds = foliot_oracles.flips(1.0, 1.0, -4.0, 5, a=1.0, k=2.0)
    assert 0 < len(times) == len(speeds) < 5
