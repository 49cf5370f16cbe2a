"""Scenes and formulas that only studies have, against integrations of their own, series of 25 to 50 digits, sums."""

import math

import chatter_lobes
import fula_milling_machine as fula
import mpmath
import numpy as np
import polisher_zone
import pytest
import stability_maps
import stick_slip
import stiff_lag
import timekeeping
import verge_oracles
import xarray as xr
from _common import solved
from _losses import shares
from chain_oracles import receptance
from mpmath import mp, mpf
from scipy.integrate import quad, solve_ivp

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of swings; the integrator's tests run as plain Python")
FINE = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}


def cross_beats(tau, I_l, I_r, c, R, k, d, phi0, sway, nu, count):
    """Times between switches of two masses on a spring, torque and friction turned round by hand."""
    y, t, last = np.array([-phi0, 0.0, -phi0, 0.0]), 0.0, 0.0
    side, rising, found = 1, 1.0, []

    def rates(t, y):
        torque, shaken = k * (y[0] - y[2]) + d * (y[1] - y[3]), sway * np.cos(nu * t)
        left = (tau * (side > 0) - c * y[1] - R * rising - torque) / I_l - shaken
        right = (-tau * (side < 0) - c * y[3] - R * rising + torque) / I_r + shaken
        return y[1], left, y[3], right

    def leaves(t, y):
        return phi0 - y[0] if side > 0 else y[2] + phi0

    def rest(t, y):
        return y[1]

    leaves.terminal = rest.terminal = True
    leaves.direction = -1
    while len(found) < count:
        rest.direction = -rising
        # scipy finds events on its dense output, which is off by 1e-7 on the long steps that it takes by itself
        leg = solve_ivp(rates, (t, t + 100), y, events=(leaves, rest), max_step=1e-2, **FINE)
        t, y = leg.t[-1], leg.y[:, -1]
        if len(leg.t_events[0]):
            found.append(t - last)
            last, side = t, -side
        else:
            rising = -rising
    return found


@pytest.mark.parametrize(("share", "R", "sway"), [(0.5, 5e-5, 0.0), (0.6, 2e-5, 0.2)])
def test_swings_of_a_cross_beat_are_those_of_two_masses_on_a_spring(share, R, sway):
    tau, I_l, I_r, c, phi0, k, d, nu = 9.56541e-4, 1e-4 * share, 1e-4 * (1 - share), 4.778675e-5, 0.35, 0.3, 2e-3, 1.3
    known = {"I_l": I_l, "I_r": I_r, "c_l": c, "c_r": c, "R_l": R, "R_r": R, "tau": tau, "phi0": phi0}
    known |= {"stiffness": k, "damper": d, "sway": sway, "nu": nu}
    here = solved("cross_beat_scene:KERNEL", flips=[1, 2, 5, 6], rtol=1e-9, **known)
    found = cross_beats(tau, I_l, I_r, c, R, k, d, phi0, sway, nu, 6)
    np.testing.assert_allclose(here.interval, np.array(found)[[0, 1, 4, 5]], rtol=1e-8)


def test_the_cycle_of_a_verge_is_that_of_an_event_simulation():
    p = {"tau": 0.02, "I_v": 1e-4, "I_c": 2.5e-4, "n": 0.2, "phi0": 0.35, "drop": 0.01, "c_v": 1e-4, "R_v": 3.5e-4}
    cell = solved("verge_scene:KERNEL", rtol=4e-10, **p | {"tau": [0.02], "flips": 120}).isel(tau=0)
    period, *_, impacts, dry, _, _, _ = verge_oracles.cycle(p | {"e": 0.0}, 60)
    viscous = (1.0 - impacts - dry) * p["tau"] * (2 * p["n"] * p["phi0"] + p["drop"])
    assert (float(cell.clock), float(cell["drag"])) == pytest.approx((period / 2, viscous), rel=1e-8)


@pytest.mark.parametrize("at", [-0.1, -0.025, 0.05])
def test_the_period_of_a_balance_with_impulses_is_that_of_50_digits(at):
    """From an impulse to the peak and on to the next, closed by a root."""
    zeta, r, w = mpf(1) / 600, mpf("0.025"), mpf("0.05")
    with mp.workdps(50):
        root = mp.sqrt(1 - zeta**2)

        def leg(u, v, t):
            by = (v + zeta * u) / root
            x = mp.exp(-zeta * t) * (u * mp.cos(root * t) + by * mp.sin(root * t))
            return x, mp.exp(-zeta * t) * (v * mp.cos(root * t) - (u + zeta * v) / root * mp.sin(root * t))

        def half(v):
            up = mp.findroot(lambda t: leg(at + r, v, t)[1], mp.pi / 2)
            peak = leg(at + r, v, up)[0] - 2 * r
            back = mp.findroot(lambda t: leg(-peak, mpf(0), t)[0] - (at + r), mp.pi / 2)
            return up + back, mp.sqrt(leg(-peak, mpf(0), back)[1] ** 2 + 2 * w)

        first = (mp.sqrt(r**2 + mp.pi * zeta * w) - r) / (mp.pi * zeta)
        v = mp.findroot(lambda v: half(v)[1] - v, (first, first * mpf("1.01")), solver="secant")
        true = 2 * half(v)[0]
    ds = solved("balance_scene:KERNEL", at=[at], zeta=zeta, omega_n=1.0, r=r, w=w, flips=2001, rtol=1e-12)
    assert float(ds.clock[0]) == pytest.approx(float(true), rel=1e-11)
    assert abs(float(ds.speed[0])) == pytest.approx(float(mp.sqrt(v**2 - 2 * w)), rel=1e-7)


def test_a_half_period_under_friction_over_the_swing_is_that_of_a_series():
    """From the speed at the switch, which the scene gives, to the next."""
    given = {"mu": [1.46], "a": 1.0, "phi0": 1.0, "harmonic": 1, "depth": 0.5, "flips": 60}
    cell = solved("foliot_scene:KERNEL", **given, rtol=4e-10).isel(mu=0)
    v = abs(float(cell.speed))
    with mp.workdps(20):
        f = mp.odefun(lambda t, y: [y[1], mpf(1.46) - (1 + mp.cos(mp.pi * y[0]) / 2) * y[1]], 0, [-1, -v])
        t = mp.findroot(lambda t: f(t)[0] - 1, float(cell.interval))
        assert (float(t), float(f(t)[1])) == pytest.approx((float(cell.interval), v), rel=1e-7)


@pytest.mark.parametrize(("mu", "belt", "fall"), [(1.0, 0.3, 0.4), (2.0, 0.01, 0.02)])
def test_stick_and_slip_in_closed_form_are_the_motion(mu, belt, fall):
    with mp.workdps(25):
        slips = mpmath.odefun(lambda t, u: [u[1], fall * u[1] - u[0] + mu], 0, [mu + mpf(fall) * belt, mpf(belt)])
        caught = mpmath.findroot(lambda t: slips(t)[1] - belt, (4.0, 6.5), solver="anderson")
        true = mpf(mu) / belt + 20 * (caught + (mu + mpf(fall) * belt - slips(caught)[0]) / belt)
        assert abs(mpf(float(stick_slip.last_count(41.0, mu, belt, fall))) / true - 1) < 1e-14


@pytest.mark.parametrize(("mu", "eps"), [(0.3, 0.1), (20.0, 0.01)])
def test_a_stiff_lag_in_closed_form_is_the_motion(mu, eps):
    a, guess = mpf(stiff_lag.FRICTION), stiff_lag.first_switch(mu, eps)
    with mp.workdps(25):
        motion = mpmath.odefun(lambda t, u: [u[1], u[2] - a * u[1], (mu - a * u[1] - u[2]) / mpf(eps)], 0, [0, 0, 0])
        assert abs(mpf(float(guess)) / mpmath.findroot(lambda t: motion(t)[0] - 1, guess) - 1) < 1e-13


@pytest.mark.parametrize("z", [2.0, 15.0, 90.0])
def test_shares_hold_where_the_foliot_goes_at_its_final_speed(z):
    """The speed at the switch is V (1 - exp(-z)), V the final one: 90 is beyond what a float64 can tell from it."""
    clock = {"mu": 1.0, "R": 0.3, "a": 0.8, "c": 0.2, "n": 3.0, "e": 0.5}
    with mp.workdps(60):
        mu, R, a, c, n, e = map(mpf, clock.values())
        parts = {"dry": lambda v: R, "viscous": lambda v: a * v, "drag": lambda v: c * v**n}
        V = mpmath.findroot(lambda v: sum(f(v) for f in parts.values()) - mu, 0.6)
        top, ends = V * (1 - mp.exp(-z)), [y for y in (0, 1, 4, 12, 30) if y < z] + [z]

        def half(part):
            """On the leg that is driven, over y with v = V (1 - exp(-y)), and on the one that is braked."""

            def driven(y):
                v = V * (1 - mp.exp(-y))
                return part(v) * v * V * mp.exp(-y) / (mu - sum(f(v) for f in parts.values()))

            braked = mp.quad(lambda v: part(v) * v / (mu + sum(f(v) for f in parts.values())), [0, e * top])
            return mp.quad(driven, ends), braked

        way, back = half(lambda v: mpf(1))
        phi0 = (way - back) / 2
        true = {name: float(sum(half(f)) / (2 * mu * phi0)) for name, f in parts.items()}
        true["impacts"] = float((1 - e**2) * top**2 / (4 * mu * phi0))
    asked = ["amplitude", "crossing_speed", "sensitivity"]
    zipped = {name: [x] for name, x in {**clock, "phi0": float(phi0)}.items()}
    found = shares(sweep.run(kernel="foliot", design="zip", axes=zipped, rtol=1e-10, outputs=asked))
    assert abs(sum(true.values()) - 1) < 1e-12
    assert {name: float(found[name][0]) for name in true} == pytest.approx(true, abs=1e-9)


def arm_angle(t, e, b=0.6201, d=0.38, f=0.405):
    """Angle of the polisher's arm, type A: where the circles of arm and coupler meet."""
    pin = b * np.exp(-1j * np.radians(38.4)) + e * np.exp(1j * t)
    return np.angle(pin) + np.arccos((abs(pin) ** 2 + d**2 - f**2) / (2 * d * abs(pin)))


@pytest.mark.parametrize(("X", "Y", "beta"), [(-0.04, 0.0, 0.1), (0.01, -0.03, -0.2)])
def test_a_point_of_the_tool_wears_by_its_mean_speed(X, Y, beta):
    """By quadrature; the arm's rate by differences."""
    known = dict(sweep.study(polisher_zone.__file__.replace(".py", ".toml")).fixed) | {"type": "A"}
    axes = {"e": [0.1], "beta": [0.0]}
    ds = sweep.run(kernel="polisher_wear", axes=axes, fixed=known, along={"radius": [0.0]})
    omega, Omega, L = 20 * np.pi / 30, 7.3 * np.pi / 30, 0.5

    def speed(t):
        rate = omega * (arm_angle(t + 1e-5, 0.1) - arm_angle(t - 1e-5, 0.1)) / 2e-5
        place = np.exp(1j * (arm_angle(t, 0.1) + beta)) * (L + X + 1j * Y)
        return abs(rate * place - Omega * (place - 0.5))

    true = 1e-13 * 7000 * quad(speed, 0, 2 * np.pi, limit=400, epsrel=1e-8)[0] / (2 * np.pi)
    here = polisher_zone.tool_wear(ds, polisher_zone.swings(ds, ds.e.values), np.array(X), np.array(Y), beta)[0]
    assert float(here) == pytest.approx(true, rel=1e-5)  # 720 crank angles of a speed that bends: 1e-6


@pytest.fixture(scope="module")
def lobes():
    """The chains of the study of chatter."""
    return chatter_lobes.prepared(sweep.run(sweep.study(chatter_lobes.__file__.replace(".py", ".toml"))))


@pytest.mark.parametrize(("n", "i"), [(8, 1200), (5, 9000)])
def test_lobes_fulfil_the_equation_of_the_delay_in_50_digits(lobes, n, i):
    chain, f = fula.chain(lobes, n), chatter_lobes.FREQUENCIES[i]
    with mpmath.workdps(50):
        H = receptance(chain["J"], chain["k"], chain["h"], f, 1, 1)
        for k in (0, 3):
            tooth, K = (float(v[i]) for v in chatter_lobes.lobe(lobes.H.sel(n_keep=n).values, k))
            assert abs(1 + K * (1 - mpmath.exp(mpmath.mpc(0, -2) * mpmath.pi * f / tooth)) * H) < 1e-10


def test_responses_of_the_milling_machine_are_those_of_the_damped_chain():
    chain = fula.chain(sweep.run(sweep.study(fula.__file__.replace(".py", ".toml"))), 8)
    true = receptance(chain["J"], chain["k"], chain["h"], 230.0, 1, 1)
    assert fula.response(chain, np.array([230.0]))[0] == pytest.approx(complex(true), rel=1e-12, abs=0.0)


def test_the_law_of_correlated_noise_is_that_of_a_sum_of_products():
    coords = {"s": 0.4, "T": 1.0, "averaging_time": 20.0}
    lag, w = abs(np.subtract.outer(np.arange(40), np.arange(40))), np.repeat([-1.0, 1.0], 20) / 20
    expected = 86400 * 0.4 * math.sqrt(w @ math.exp(-1 / 7.0) ** lag @ w / 2)
    assert float(timekeeping.law(xr.Dataset(coords=coords), 7.0)) == pytest.approx(expected, rel=1e-12, abs=0.0)


def test_the_borders_of_stability_are_the_textbooks():
    zero = np.array([0.0])
    for method, end in (("euler", 2.0), ("rk4", 2.785293563), ("dopri5", 3.306567893), ("verlet", 2.0)):
        assert stability_maps.eigenvalue(method, np.array([end]), zero)[0] == pytest.approx(1.0, abs=1e-8)
        assert stability_maps.eigenvalue(method, np.array([end + 0.01]), zero)[0] > 1
    z = np.array([-0.1, 0.3j])
    for method, order in (("euler", 1), ("rk4", 4), ("dopri5", 5), ("dop853", 8)):
        assert (abs(stability_maps.stability_function(z, method) - np.exp(z)) < abs(z) ** (order + 1)).all()
