"""The receptance of drivetrains against the dense equations in 60 digits, and against its own laws."""

import chain_oracles as oracles
import numpy as np
import pytest
from columns import checked, solve
from mpmath import mp, mpc

from kernels.drivetrain.receptance import DRIVETRAIN_FRF
from kernels.drivetrain.reduced import DRIVETRAIN
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

CELLS = 24 if COMPILED else 4
NAN, INF = np.nan, np.inf


def chains(n, decades, damping, seed=1, cells=CELLS):
    """J, k, h of random chains; h about `damping` times what the smallest of them has as critical."""
    random = np.random.default_rng(seed)
    J, k, share = (10 ** random.uniform(-decades / 2, decades / 2, (cells, n)) for _ in range(3))
    return J, k, damping * share * np.sqrt(J * k)


def receptances(J, k, h, drive, read, frequency, rtol=1e-9):
    outputs, status = solve(DRIVETRAIN_FRF, "continued", J, k, h, drive, read, rtol=rtol, along=[np.array(frequency)])
    return outputs, status


def errors(outputs, i, J, k, h, drive, read, frequency):
    """abs(dH)/abs(H) of cell i at every frequency."""
    found = []
    with mp.workdps(50):
        for j, f in enumerate(frequency):
            true = oracles.receptance(J, k, h, f, int(drive), int(read))
            value = mpc(float(outputs["receptance_re"][i, j]), float(outputs["receptance_im"][i, j]))
            found.append(float(abs(value - true) / abs(true)))
    return np.array(found)


@pytest.mark.parametrize("rtol", [1e-14, 1e-13, 1e-12, 1e-9])
@pytest.mark.parametrize(
    ("n", "decades", "damping", "last"),
    [
        (1, 2, 0.1, None), (4, 2, 1e-3, None), (4, 12, 0.1, None), (9, 2, 1e-12, None), (3, 2, 0.1, 0.0),
        (3, 2, 0.1, 0.3),
    ],
)  # fmt: skip
def test_a_receptance_is_right_to_rtol_or_the_cell_says_that_it_is_not(n, decades, damping, last, rtol):
    """Also without the last spring, with a damper there or none."""
    J, k, h = chains(n, decades, damping)
    if last is not None:
        k[:, -1], h[:, -1] = 0.0, last
    random = np.random.default_rng(3)
    drive, read = random.integers(1, n + 1, CELLS), random.integers(1, n + 1, CELLS)
    frequency = 10 ** random.uniform(-2 - decades / 2, 1 + decades / 2, 5)
    outputs, status = receptances(J, k, h, drive, read, frequency, rtol)
    assert set(status) <= {Status.OK, Status.INACCURATE}
    for i in range(0, CELLS, 3):
        worst = errors(outputs, i, J[i], k[i], h[i], drive[i], read[i], frequency).max()
        assert worst <= rtol if status[i] == Status.OK else worst >= rtol / 1000
    if rtol >= 1e-9:
        assert (status == Status.OK).all()


def test_on_a_resonance_without_damping_the_loss_of_digits_is_told():
    """At a share d of the frequency above it, no more than 1e-16/d of the receptance is known."""
    J, k, h = chains(5, 2, 0.0, cells=1)
    resonance = solve(DRIVETRAIN, "direct", J, k, h, reduction=0.0)[0]["frequency"][0, 2]
    for share in (1e-3, 1e-6, 1e-9, 1e-12):
        frequency = resonance * (1 + share)
        outputs, _ = receptances(J, k, h, 1, 5, [frequency])
        actual = errors(outputs, 0, J[0], k[0], h[0], 1, 5, [frequency])[0]
        assert actual < 1e-14 / share
        for rtol in np.geomspace(1e-16, 1.0, 17):
            status = receptances(J, k, h, 1, 5, [frequency], rtol)[1][0]
            if actual > rtol:
                assert status == Status.INACCURATE
            if rtol > 1e-13 / share:
                assert status == Status.OK


def worth(J, k, h, frequency, drive, read):
    """The sum of what H changes by with each inertia, and each spring with its damper, all relative."""
    whole, total, share = oracles.receptance(J, k, h, frequency, drive, read), 0.0, 2.0**-30
    for changed in 1.0 + share * np.eye(J.size):
        for chain in ((changed * J, k, h), (J, changed * k, changed * h)):
            total += float(abs(oracles.receptance(*chain, frequency, drive, read) - whole) / abs(whole)) / share
    return total


def test_the_error_told_is_what_four_roundings_of_every_inertia_and_spring_are_worth():
    """Without damping: with it, sizes of complex numbers are sums of their parts."""
    J, k, h = chains(4, 2, 0.0, cells=8)
    resonances = solve(DRIVETRAIN, "direct", J, k, h, reduction=0.0)[0]["frequency"]
    for i in range(8 if COMPILED else 3):
        drive, frequency = 1 + i % 3, 1.001 * resonances[i, i % 4]
        error = 2.0**-50 * (1.0 + worth(J[i], k[i], h[i], frequency, drive, 4))
        for share, verdict in ((0.99, Status.INACCURATE), (1.01, Status.OK)):
            _, status = receptances(*(c[i : i + 1] for c in (J, k, h)), drive, 4, [frequency], share * error)
            assert status[0] == verdict, (i, share)


@pytest.mark.parametrize("count", [2, 7, 33])
def test_where_a_receptance_is_infinite_it_alone_is_left_out(count):
    J, k, h = chains(3, 2, 0.1)
    k[:, -1] = h[:, -1] = 0.0
    frequency = np.append(np.geomspace(1e-9, 3.0, count - 1), 0.0)
    outputs, status = receptances(J, k, h, 1, 3, frequency)
    assert (status == Status.PARTLY_OUT_OF_RANGE).all()
    for values in outputs.values():
        assert np.isnan(values[:, -1]).all()
    for i in range(0, CELLS, 6):
        assert errors(outputs, i, J[i], k[i], h[i], 1, 3, frequency[:-1]).max() < 1e-12
    assert (receptances(J, k, h, 1, 3, [0.0])[1] == Status.OUT_OF_RANGE).all()  # nothing is left


def test_a_free_chain_turned_so_slowly_that_its_inertia_loses_digits_is_refused():
    large = np.array([[1e100, 1e100]])
    for last, at_1e_160_hertz in ((0.0, Status.OUT_OF_RANGE), (1e100, Status.OK)):
        k = np.array([[1e100, last]])
        assert receptances(large, k, 0.0 * k, 1, 1, [1e-160])[1] == at_1e_160_hertz


def test_at_rest_the_receptance_is_the_flexibility_to_ground():
    J, k, h = chains(6, 12, 0.1)
    for drive, read in ((1, 1), (2, 5), (6, 3)):
        outputs, _ = receptances(J, k, h, drive, read, [0.0])
        flexibility = (1 / k[:, max(drive, read) - 1 :]).sum(axis=1)
        np.testing.assert_allclose(outputs["amplitude"][:, 0], flexibility, rtol=3e-15)
        assert not outputs["receptance_im"].any()
        assert not outputs["phase"].any()


def test_amplitude_phase_and_decibel_are_those_of_the_receptance_and_the_drive_point_lags():
    """Where damping alone takes energy, a torque does work on its own inertia: its phase is between -pi and 0."""
    J, k, h = chains(5, 4, 0.1)
    for read in (1, 4):
        outputs, _ = receptances(J, k, h, 1, read, np.geomspace(1e-2, 100, 50))
        H = outputs["receptance_re"] + 1j * outputs["receptance_im"]
        np.testing.assert_allclose(outputs["amplitude"], abs(H), rtol=4e-16)
        np.testing.assert_allclose(outputs["phase"], np.angle(H), rtol=0, atol=1e-15)
        np.testing.assert_allclose(outputs["amplitude_dB"], 20 * np.log10(abs(H)), rtol=1e-15, atol=1e-14)
        assert read > 1 or ((outputs["phase"] >= -np.pi) & (outputs["phase"] < 0)).all()


@pytest.mark.parametrize("mass", [0.0, 4.0, 1.5, -1.0, NAN, INF])
def test_a_mass_that_is_not_in_the_chain_is_bad_input(mass):
    ones = np.ones((1, 3))
    assert checked(DRIVETRAIN_FRF, ones, ones, ones, drive_mass=mass, read_mass=1.0)[0] == Status.BAD_INPUT
    assert checked(DRIVETRAIN_FRF, ones, ones, ones, drive_mass=1.0, read_mass=mass)[0] == Status.BAD_INPUT
    assert checked(DRIVETRAIN_FRF, ones, ones, ones, drive_mass=3.0)[0] == Status.OK


def test_without_damping_the_response_is_in_phase_below_a_resonance_and_at_minus_pi_above():
    one = np.ones((1, 1))
    outputs, _ = receptances(one, one, 0.0 * one, 1, 1, [0.1, 0.2])  # the resonance is at 1/2 pi = 0.159 Hz
    assert outputs["phase"].tolist() == [[0.0, -np.pi]]
