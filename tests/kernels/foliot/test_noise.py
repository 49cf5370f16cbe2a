"""Noise of the torque: the generator against published numbers, the run against 40 digits and against theory."""

import math
from itertools import pairwise

import foliot_oracles
import numpy as np
import pytest
from columns import solve
from mpmath import mp, mpf

from kernels.foliot.noise import FOLIOT_NOISE, HEADROOM
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED
from kernels.maths import philox

DAY = 86400.0


def philox_by_its_paper(counter, key):
    """Philox-4x32-10 with integers as wide as they get."""
    word = 2**32
    for _ in range(10):
        high_0, low_0 = divmod(0xD2511F53 * counter[0], word)
        high_1, low_1 = divmod(0xCD9E8D57 * counter[2], word)
        counter = (high_1 ^ counter[1] ^ key[0], low_1, high_0 ^ counter[3] ^ key[1], low_0)
        key = ((key[0] + 0x9E3779B9) % word, (key[1] + 0xBB67AE85) % word)
    return counter


ONES = 0xFFFFFFFF
PUBLISHED = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((ONES,) * 4, (ONES,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344), (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]  # fmt: skip
"""Known answers that come with the generator (Random123, kat_vectors, philox4x32 10)."""


@pytest.mark.parametrize(("counter", "key", "answer"), PUBLISHED)
def test_the_generator_gives_the_published_numbers(counter, key, answer):
    assert tuple(int(w) for w in philox.philox(counter, key)) == answer == philox_by_its_paper(counter, key)


def noise(seed, n, place=0, stream=0):
    """The normal numbers of half swings, by Box & Muller from the generator's words, independent of the kernel."""
    numbers = []
    for j in range(place, place + (n + 1) // 2):
        w = philox_by_its_paper((j % 2**32, j >> 32, stream, 0), (seed % 2**32, seed >> 32))
        u, turn = (((high << 21) + (low >> 11) + 0.5) / 2**53 for high, low in (w[:2], w[2:]))
        r = math.sqrt(-2 * math.log(u))
        numbers += [r * math.cos(2 * math.pi * turn), r * math.sin(2 * math.pi * turn)]
    return np.array(numbers[:n])


def correlated(z, tau_c):
    """x of the kernel's (1)."""
    r = math.exp(-1 / tau_c) if tau_c else 0.0
    x = [z[0]]
    for value in z[1:]:
        x.append(r * x[-1] + math.sqrt(1 - r * r) * value)
    return np.array(x)


def run(*, method="segments", **named):
    """Outputs by name and status; scenes of mu = phi0 = 1 unless told otherwise."""
    named = {"mu": 1.0, "phi0": 1.0, "half_swings": 200.0 if COMPILED else 60.0, "sigma": 0.0} | named
    return solve(FOLIOT_NOISE, method, **{n: np.atleast_1d(np.asarray(v, float)) for n, v in named.items()})


LINEAR = {"a": 0.3, "R": 0.1, "k": 0.2, "e": 0.8}


def followed(torques, a=0.0, R=0.0, k=0.0, e=1.0, frictions=None):
    """T - T_i of every half swing, T and the torque-free start from the oracle's cycle; mu = phi0 = 1, in 40 digits.

    A half swing of torque m is one of torque 1 with all other forces divided by m and times by sqrt(m).
    """
    with mp.workdps(40):
        period, _, v, _, _ = foliot_oracles.cycle(1.0, 1.0, a=a, R=R, k=k, e=e)
        late = []
        for m, share in zip(torques, np.ones(len(torques)) if frictions is None else frictions, strict=True):
            m = mpf(m)
            law = foliot_oracles.law_of(m, 1, a * mpf(float(share)), R, 0, 0, k, e)
            swing = foliot_oracles.Flows.half_swing(law, v / mp.sqrt(m))
            v = swing.speed * mp.sqrt(m)
            late.append(period / 2 - swing.time / mp.sqrt(m))
        return period / 2, late


def scatter_of(nominal, late, tau):
    """Rate error and Allan deviation, in seconds a day, straight from their definitions."""
    with mp.workdps(40):
        gains, times = [mpf(0)], [mpf(0)]
        for d in late:
            gains.append(gains[-1] + d)
            times.append(times[-1] + nominal - d)
        readings, j = [], 0
        while j * tau <= times[-1]:
            i = max(i for i in range(len(late)) if times[i] <= j * tau)
            readings.append(gains[i] + late[i] * (j * tau - times[i]) / (times[i + 1] - times[i]))
            j += 1
        y = [(after - before) / tau for before, after in pairwise(readings)]
        steps = [(after - before) ** 2 for before, after in pairwise(y)]
        return float(DAY * gains[-1] / times[-1]), float(DAY * mp.sqrt(sum(steps) / (2 * len(steps))))


CASES = [
    (3, {"a": 1.0}, 0.05, 0.0, 30.0),
    (0, {"a": 0.05}, 0.3, 3.0, 17.0),
    (1, {"a": 4.0}, 0.5, 0.0, 50.0),  # torque is cut in 2 % of the half swings
    (3, {"a": 0.3, "R": 1 - 1e-8}, 5e-9, 0.0, 1e6),  # friction leaves 1e-8 of it
    (2**32 - 1, LINEAR, 0.1, 10.0, 2.0),  # shorter than a half swing
    (2**32, LINEAR, 0.6, 0.0, 20.0),  # cut, with a spring
    (2**50, {"k": 0.4, "e": -0.5, "a": 0.1}, 0.1, 0.0, 11.0),
    (2, {"e": -0.6}, 0.0, 0.0, 10.0),
    (2, {"a": 30.0}, 0.0, 0.0, 10.0),
]  # fmt: skip
SHORT = 120 if COMPILED else 40


@pytest.mark.parametrize(("seed", "terms", "sigma", "tau_c", "tau"), CASES if COMPILED else CASES[1::3])
def test_a_run_is_that_of_40_digits(seed, terms, sigma, tau_c, tau):
    with mp.workdps(40):
        floor = floor_of(**terms)
        wanted = np.array([1 + mpf(sigma) * mpf(x) for x in correlated(noise(seed, SHORT), tau_c)])
        rate, scatter = scatter_of(*followed([max(torque, floor) for torque in wanted], **terms), tau)
    keys = {"sigma": sigma, "tau_c": tau_c, "seed": seed, "half_swings": SHORT, "averaging_time": tau}
    rtol = 1e-12 if (wanted <= floor).any() else 1e-13  # the force that the floor leaves has two digits fewer
    found, status = run(rtol=rtol, **keys, **terms)
    assert found["rate_error_s_per_day"][0] == pytest.approx(rate, rel=1e-10, abs=1e-9)
    assert found["rate_scatter_s_per_day"][0] == pytest.approx(scatter, rel=1e-10, abs=1e-9)
    assert found["truncated"][0] == (wanted <= floor).mean()
    assert status[0] == Status.OK


@pytest.mark.parametrize("shared", [1.0, 0.3, 0.0, -1.0] if COMPILED else [0.3])
def test_friction_has_as_much_noise_of_its_own_as_it_does_not_share(shared):
    sigma, sigma_a, tau_c, seed, n = 0.05, 0.2, 3.0, 11, 60 if COMPILED else 20
    x, apart = (correlated(noise(seed, n, stream=stream), tau_c) for stream in (0, 1))
    w = shared * x + math.sqrt(1 - shared**2) * apart
    rate, _ = scatter_of(*followed(1 + sigma * x, **LINEAR, frictions=1 + sigma_a * w), 17.0)
    keys = {"sigma": sigma, "sigma_a": sigma_a, "tau_c": tau_c, "seed": seed, "half_swings": n, "averaging_time": 17.0}
    found, status = run(shared=[shared, 0.7], rtol=1e-13, **keys, **LINEAR)  # beside a cell that shares otherwise
    assert found["rate_error_s_per_day"][0] == pytest.approx(rate, rel=1e-10)
    assert status[0] == Status.OK


def floor_of(a=0.0, R=0.0, k=0.0, e=1.0):
    """h + (1 - h)/100 for mu = phi0 = 1, h from a bisection for the least torque that still comes from rest."""
    low, high = mpf(0), mpf(1)
    for _ in range(120):
        middle = (low + high) / 2
        law = foliot_oracles.law_of(middle, 1, a, R, 0, 0, k, e)
        try:
            foliot_oracles.Flows.half_swing(law, mpf(0))
            high = middle
        except foliot_oracles.NoCycle:
            low = middle
    return high + HEADROOM * (1 - high)


SEEDS = 32


@pytest.mark.skipif(not COMPILED, reason="thousands of half swings in plain Python")
@pytest.mark.parametrize(
    ("terms", "sigma"),
    [
        ({"a": 1.0}, 2.0), ({"a": 0.1, "R": 0.5}, 1.0), ({"a": 0.1, "R": 0.5, "R_s": 0.9}, 0.5),
        ({"a": 0.5, "k": 0.3}, 1.0), ({"a": 0.1, "k": 0.3, "R": 0.2, "R_s": 1.2}, 1.0),
        ({"e": -0.9, "k": 0.5}, 3.0), ({"e": 0.0, "k": 0.2}, 1.0),
        ({"e": 0.0, "k": 0.2, "R": 0.3, "R_s": 1.1}, 1.0),
    ],
)  # fmt: skip
def test_noise_never_stops_the_clock(terms, sigma):
    found, status = run(sigma=sigma, seed=np.arange(SEEDS), half_swings=2000, **terms)
    assert np.isin(status, (Status.OK, Status.TOO_SHORT, Status.NOT_SELF_STARTING)).all()
    assert (found["truncated"] > 0.02).all()
    assert np.isfinite(found["rate_error_s_per_day"]).all()


@pytest.mark.skipif(not COMPILED, reason="thousands of half swings in plain Python")
@pytest.mark.parametrize(
    ("named", "statuses"),
    [
        # of less than two averaging times; of what has no cycle; at a tolerance below rounding
        (
            {"a": 1.0, "sigma": 0.01, "half_swings": 50, "averaging_time": [80.0, 120.0, 500.0]},
            "OK TOO_SHORT TOO_SHORT",
        ),
        ({"a": [1.0, 0.1, 0.0], "k": [2.0, 0.1, 0.3], "R": [0, 0, 0.1], "R_s": [0, 0, 1.5]}, "STICKS TOO_SHORT STICKS"),
        ({"a": [1.0] * 2, "sigma": 0.1, "averaging_time": 10.0, "rtol": [1e-16, 1e-12]}, "INACCURATE OK"),
        # where the ends of averaging times are lost in rounding
        ({"a": [1.0] * 2, "sigma": 0.1, "averaging_time": 1e-8, "rtol": [1e-12, 1e-6]}, "INACCURATE OK"),
        # of noise so large that speeds are beyond all measure
        ({"a": [1.0] * 2, "sigma": [1e30, 1e300], "averaging_time": 1e17}, "OK OUT_OF_RANGE"),
    ],
)
def test_what_a_run_comes_to_is_named_and_has_the_numbers_that_there_are(named, statuses):
    found, status = run(**named)
    assert [Status(s).name for s in status] == statuses.split()
    assert np.isfinite(found["rate_error_s_per_day"]).tolist() == (status < FIRST_REFUSAL).tolist()
    assert np.isfinite(found["rate_scatter_s_per_day"]).tolist() == (status < Status.TOO_SHORT).tolist()
