"""Random cells of every kernel that has an oracle, and their truth in 50 digits; for auto_honesty.py.

A truth is {output: number}, of traces {output: numbers} with None where nothing comes; `NO_CYCLE` where the oracle
finds that there is none, `UNKNOWN` where it does not say. Oracles are those of the tests and import nothing of ours.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import mp, mpf

sys.path.append(str(Path(__file__).parents[2] / "tests" / "oracles"))
import balance_oracles
import chain_oracles
import foliot_oracles
import honest_paths
import impact_oracles
import oracles
import polisher_oracles
import ripple_oracles
import verge_oracles
import wear_oracles

mp.dps = 50
NO_CYCLE, UNKNOWN = "no cycle", "unknown"
CYCLE = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
PHASES = (0.0, 0.05, 0.2, 0.45, 0.55, 0.7, 0.999)
FLIPS = (1.0, 2.0, 3.0, 7.0)
HALF_SWINGS = (0.0, 1.0, 2.0, 5.0, 30.0, 1000.0)
CRANK_ANGLES = (0.0, 0.3, 1.7, 3.0, 4.0, 6.0)
FREQUENCIES = (0.01, 0.07, 0.16, 0.4, 3.0)
MASSES = 4
IMPACT = (
    "period",
    "swing",
    "wheel_speed",
    "pallet_speed",
    "multiplier",
    "recoil",
    "contact_share",
    "impacts",
    "offset",
)
ANGLES = ("A0", "eta_plus", "eta_minus", "theta_plus", "theta_minus", "A0_b", "A0_d", "A0_f", "A0_e")
"""Of a polisher: those of opposite sign for type B."""


@dataclass(frozen=True)
class Case:
    """A kernel over one region: how its cells are drawn, and what is true of one."""

    kernel: str
    region: str
    cells: Callable[[np.random.Generator, int], dict[str, Any]]
    truth: Callable[..., Any]
    outputs: tuple[str, ...]
    share: float = 1.0
    """Of the cells asked for: dear oracles get fewer."""
    along: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    path: Callable[..., list[Any]] | None = None
    """Truths of columns of cells by a second path, where the oracle is too slow (`honest_paths`)."""
    blur: float = 0.0
    """What an oracle in float64 may be off by."""
    over: Mapping[str, str] = field(default_factory=dict)
    """Of an output the error is over another one at the same place, as its kernel says."""


def decades(random, low, high, n):
    """Numbers from 10^low to 10^high, evenly in their logarithm."""
    return 10.0 ** random.uniform(low, high, n)


def some(random, share, values):
    """The values, or 0 in all but a share of the cells."""
    return np.where(random.random(len(values)) < share, values, 0.0)


def below_one(random, n):
    """Numbers in (0, 1): evenly, next to 0 or next to 1."""
    kinds = random.random(n), decades(random, -9, 0, n), 1 - decades(random, -9, -1, n)
    return np.choose(random.integers(3, size=n), kinds)


# foliot


def viscous(random, n):
    """alpha = mu/(a^2 phi0) over 24 decades."""
    a, phi0 = decades(random, -4, 4, n), decades(random, -3, 3, n)
    return {"mu": decades(random, -12, 12, n) * a * a * phi0, "phi0": phi0, "a": a}


def viscous_truth(mu, phi0, a):
    return dict(zip(CYCLE, oracles.foliot(mu, phi0, a), strict=True))


def viscous_and_coulomb(random, n):
    """alpha over 12 decades, R up to mu (1 - 1e-9)."""
    a, phi0 = decades(random, -3, 3, n), decades(random, -3, 3, n)
    mu = decades(random, -4, 8, n) * a * a * phi0
    return {"mu": mu, "phi0": phi0, "a": a, "R": below_one(random, n) * mu}


def linear(random, n):
    """Viscous and Coulomb friction, spring and restitution, each in some cells."""
    mu, phi0 = decades(random, -3, 3, n), decades(random, -3, 3, n)
    a = some(random, 0.7, decades(random, -4, 1, n) * np.sqrt(mu / phi0))
    e = np.choose(random.integers(3, size=n), (np.ones(n), below_one(random, n), -below_one(random, n)))
    R, k = some(random, 0.5, below_one(random, n) * mu), some(random, 0.7, decades(random, -6, 1, n) * mu / phi0)
    return {"mu": mu, "phi0": phi0, "a": a, "R": R, "k": k, "e": e}


def drag(random, n):
    """Power-law drag, with Coulomb friction in half of the cells."""
    mu, phi0, power = decades(random, -2, 2, n), decades(random, -2, 2, n), random.uniform(0.3, 3, n)
    c = decades(random, -3, 2, n) * mu * (mu * phi0) ** (-power / 2)
    return {"mu": mu, "phi0": phi0, "R": some(random, 0.5, below_one(random, n) * mu), "c": c, "n": power}


def cycle_truth(**cell):
    """Of any foliot; 20 digits, which suffice."""
    try:
        return dict(zip(CYCLE, foliot_oracles.cycle(**cell, digits=20), strict=True))
    except foliot_oracles.NoCycle:
        return NO_CYCLE


def wanted(random, n):
    """Foliots to design: amplitudes from 1 + 1e-5 to 1e5 of the switching angle."""
    phi0 = decades(random, -3, 3, n)
    return {"period": decades(random, -4, 4, n), "amplitude": phi0 * (1 + decades(random, -5, 5, n)), "phi0": phi0}


def design_truth(period, amplitude, phi0):
    return dict(zip(("a", "mu"), oracles.foliot_design(period, amplitude, phi0), strict=True))


def motion_truth(mu, phi0, a):
    points = [oracles.foliot_angle(mu, phi0, a, phase) for phase in PHASES]
    return {name: [p[j] for p in points] for j, name in enumerate(("angle", "speed"))}


def released(random, n):
    """As `linear`, let go at rest below +phi0."""
    cells = linear(random, n)
    return {**cells, "phi_start": cells["phi0"] * random.uniform(-2, 0.99, n)}


def flips_truth(mu, phi0, phi_start, **losses):
    times, speeds = foliot_oracles.flips(mu, phi0, phi_start, int(FLIPS[-1]), **losses)
    pairs = {"flip_time": times, "flip_speed": speeds}
    return {name: [v[int(j) - 1] if j <= len(v) else None for j in FLIPS] for name, v in pairs.items()}


def stepped(random, n):
    """As `linear`, from rest at the centre, by steps of 0.001 to 0.1 of the drive's time."""
    cells = linear(random, n)
    return {**cells, "step": decades(random, -3, -1, n) * np.sqrt(cells["phi0"] / cells["mu"])}


def steps_truth(mu, phi0, step, **losses):
    times, speeds = foliot_oracles.flips(mu, phi0, 0.0, 3, **losses)
    if len(times) < 3:
        return NO_CYCLE
    return {"period": 2 * (times[2] - times[1]), "time": times[2], "crossing_speed": speeds[2]}


def verges(random, n):
    """Inertias of a ratio from 1e-2 to 1e2; drop, restitution and dry friction each in some cells."""
    tau, I_v, ratio, phi0 = (decades(random, *ends, n) for ends in ((-3, 3), (-3, 3), (-1.3, 0), (-1, 0)))
    rate = np.sqrt(ratio * tau / (I_v * phi0))
    return {
        "tau": tau, "I_v": I_v, "I_c": decades(random, -2, 2, n) * I_v / ratio**2, "n": ratio, "phi0": phi0,
        "drop": some(random, 0.7, random.uniform(0, 0.5, n) * ratio * phi0),
        "e": some(random, 0.5, random.uniform(0, 0.8, n)), "c_v": decades(random, -1, 1, n) * I_v * rate,
        "R_v": some(random, 0.5, random.uniform(0, 0.9, n) * ratio * tau),
    }  # fmt: skip


def verge_truth(**cell):
    """Of the 30th tooth from rest, if the one before took as long."""
    *values, before, met, share = verge_oracles.cycle(cell, 30)
    settled = abs(before / values[0] - 1) < 1e-11 and met == 1 and abs(share - 0.5) < 1e-11
    return dict(zip(VERGE, map(mpf, values), strict=True)) if settled else UNKNOWN


def rippled(random, n):
    """Coulomb friction, and a spring in half of the cells; a ripple of the torque, in half of them of up to 64 half
    waves and down to 1e-6 of a torque that stops."""
    mu, phi0 = decades(random, -2, 2, n), decades(random, -2, 2, n)
    k = some(random, 0.5, decades(random, -3, -0.5, n) * mu / phi0)
    wild = random.random(n) < 0.5
    depth = np.where(wild, 1 - decades(random, -6, -1, n), random.uniform(0, 0.9, n))
    harmonic = random.integers(1, np.where(wild, 65, 5)).astype(float)
    return {
        "mu": mu, "phi0": phi0, "R": random.uniform(0.01, 0.6, n) * mu * (1 - depth), "k": k, "depth": depth,
        "harmonic": harmonic,
    }  # fmt: skip


def ripple_truth(**cell):
    try:
        return dict(zip(CYCLE, ripple_oracles.by_energy(**cell), strict=True))
    except ripple_oracles.NoCycle:
        return NO_CYCLE


# balance


def swinging(random, n):
    """Damping from 1e-8 to next to 1, solid friction from 1e-8 of the release, stiction up to three times that."""
    theta0 = decades(random, -3, 3, n) * random.choice([-1.0, 1.0], n)
    r = decades(random, -8, 0.3, n) * abs(theta0)
    zeta = np.where(random.random(n) < 0.7, decades(random, -8, -0.01, n), below_one(random, n))
    stiction = np.where(random.random(n) < 0.5, 1.0, random.uniform(1, 3, n))
    return {"zeta": zeta, "omega_n": decades(random, -3, 3, n), "r": r, "r_s": r * stiction, "theta0": theta0}


def balance_truth(zeta, omega_n, r, r_s, theta0):
    names = ("half_swings", "stop_angle", "stop_time", "margin", "period")
    return dict(zip(names, balance_oracles.balance(zeta, omega_n, r, r_s, theta0), strict=True))


def trace_truth(zeta, omega_n, r, r_s, theta0):
    last = balance_oracles.half_swings(zeta, r, r_s, theta0)
    side = 1 if theta0 >= 0 else -1
    turns = [
        side * (-1) ** int(k) * balance_oracles.turning_point(zeta, r, theta0, k) if k <= last else None
        for k in HALF_SWINGS
    ]
    return {"turning_point": turns}


def driven(random, n):
    """Balances driven by an impulse or over a lift angle."""
    unit, lift = decades(random, -6, 6, n), random.random(n) < 0.5
    r = some(random, 0.8, unit * decades(random, -6, 0.2, n))
    zeta = some(random, 0.8, decades(random, -6, -0.05, n))
    return {
        "zeta": np.where(r == 0, decades(random, -6, -0.05, n), zeta), "omega_n": decades(random, -6, 6, n), "r": r,
        "w": np.where(lift, 0.0, unit * unit * random.uniform(0.5, 2.0, n)),
        "m": np.where(lift, unit * decades(random, -2, 1, n), 0.0), "beta": np.where(lift, unit, 0.0),
    }  # fmt: skip


def driven_truth(**cell):
    true = balance_oracles.driven(**cell)
    return NO_CYCLE if true is None else dict(zip(("amplitude", "period", "multiplier"), true, strict=True))


# impact clock


def clocks(random, n):
    """Inertias of a ratio from 1e-3 to 1e3, restitution from 0 to 0.9, escape height up to a quarter pitch."""
    r_c, teeth = decades(random, -3, 0, n), 2.0 * random.integers(1, 30, n) + 1
    r_v, I_c = r_c * decades(random, -1, 1, n), decades(random, -8, 0, n)
    kappa = decades(random, -3, 3, n)
    e = some(random, 0.7, decades(random, -9, -0.05, n))
    h = some(random, 0.5, random.random(n) * 2 * np.pi * r_c / teeth / 4)
    return {
        "torque": decades(random, -6, 2, n), "I_c": I_c, "I_v": I_c * kappa * (r_v / r_c) ** 2, "r_c": r_c, "r_v": r_v,
        "teeth": teeth, "h": h, "e": e,
    }  # fmt: skip


def clock_truth(**cell):
    """Of the symmetric cycle; where that does not exist or is unstable, another motion may be the true one."""
    values = tuple(cell[name] for name in ("torque", "I_c", "I_v", "r_c", "r_v", "teeth", "h", "e"))
    if cell["e"] == 0:
        return dict(zip(IMPACT, impact_oracles.plastic_cycle(*values, digits=80), strict=True))
    true, there = impact_oracles.impact_cycle(*values)
    return dict(zip(IMPACT, true, strict=True)) if there and true[4] < 1 else UNKNOWN


# polisher


def machines(random, n):
    """Cranks from 1e-8 of the shortest link to 1e-12 from a dead point, of both types."""
    b, d, f = (decades(random, -1, 1, n) for _ in range(3))
    longest = np.minimum.reduce([d + f - b, b + f - d, b + d - f, b, d, f])
    e = longest * np.where(random.random(n) < 0.6, decades(random, -8, 0, n), 1 - decades(random, -12, -1, n))
    return {
        "b": np.where(longest > 0, b, 1.0), "d": np.where(longest > 0, d, 0.7), "f": np.where(longest > 0, f, 0.8),
        "e": np.where(longest > 0, e, 0.1), "type": random.choice(["A", "B"], n),
    }  # fmt: skip


def extremes_truth(b, d, f, e, type):
    if polisher_oracles.verdict(b, d, f, e) != "OK":
        return UNKNOWN
    sign = 1 if type == "A" else -1
    return {name: v * (sign if name in ANGLES else 1) for name, v in polisher_oracles.closed(b, d, f, e).items()}


def waveform_truth(b, d, f, e, type):
    return {"thd": polisher_oracles.distortion(b, d, f, e)} if polisher_oracles.verdict(b, d, f, e) == "OK" else UNKNOWN


def turning(random, n):
    return {**machines(random, n), "omega": decades(random, -3, 3, n)}


def arm_truth(b, d, f, e, type, omega):
    if polisher_oracles.verdict(b, d, f, e) != "OK":
        return UNKNOWN
    points = [polisher_oracles.motion(b, d, f, e, 1 if type == "A" else -1, theta) for theta in CRANK_ANGLES]
    if None in points:
        return UNKNOWN
    names = ("alpha", "alpha_rate", "alpha_acceleration")
    return {name: [p[j] * mpf(omega) ** j for p in points] for j, name in enumerate(names)}


def worn(random, n):
    """The paper's machine with other tools, rates and centres of the work, at a radius that the tool may reach."""
    exponent = random.choice([1.0, 2.0, 3.3, 100.0], n)
    return {
        "e": random.uniform(1, 16, n), "w_x": random.uniform(40, 60, n), "w_y": random.uniform(-9, 9, n),
        "Omega": decades(random, -1, 1.5, n) * random.choice([-1.0, 1.0], n), "tool_a": random.uniform(2, 9, n),
        "tool_b": random.uniform(2, 9, n), "tool_n": exponent, "tool_m": exponent,
    }  # fmt: skip


def wear_truth(**cell):
    machine = wear_oracles.Machine(**PAPER | {"type": 0.0}, **cell)
    return {"wear": [mpf(wear_oracles.ring_wear(machine, RADII[0]) / (4 * np.pi**2))]}


# drivetrain


def chains(random, n):
    """Four inertias and springs of three decades each way."""
    return {name: decades(random, -3, 3, (n, MASSES)) for name in ("J", "k")}


def modes_truth(J, k):
    return {"frequency": chain_oracles.frequencies(J, k, digits=60)}


def damped_chains(random, n):
    return {**chains(random, n), "h": decades(random, -4, 1, (n, MASSES))}


def receptance_truth(J, k, h):
    found = [chain_oracles.receptance(J, k, h, frequency, 1, 1) for frequency in FREQUENCIES]
    return {
        "receptance_re": [z.real for z in found], "receptance_im": [z.imag for z in found],
        "amplitude": [abs(z) for z in found],
    }  # fmt: skip


def by_drag_of_degree_1(mu, phi0, a, R):
    return honest_paths.power_drag(mu, phi0, R, a, np.ones_like(a))


CLOSED = tuple(polisher_oracles.closed(62.01, 38.0, 40.5, 10.0))
BALANCE = ("half_swings", "stop_angle", "stop_time", "margin", "period")
VERGE = ("period", "amplitude", "escape_speed", "recoil", "impact_share", "dry_share")
RADII = (6.0,)
PAPER = {
    "b": 62.01, "d": 38.0, "f": 40.5, "type": "A", "omega": 1.0, "b_angle": 0.0, "L": 50.0, "beta": 0.0, "preston": 1.0,
    "pressure": 1.0,
}  # fmt: skip
RECEPTANCE = ("receptance_re", "receptance_im", "amplitude")
CASES = (
    Case("foliot", "viscous", viscous, viscous_truth, CYCLE),
    Case("foliot", "viscous and Coulomb", viscous_and_coulomb, cycle_truth, CYCLE, 0.12, path=by_drag_of_degree_1),
    Case("foliot", "linear", linear, cycle_truth, CYCLE, 0.18),
    Case("foliot", "power-law drag", drag, cycle_truth, CYCLE, 0.12, path=honest_paths.power_drag),
    Case("foliot_design", "", wanted, design_truth, ("a", "mu"), 0.12),
    Case("foliot_motion", "viscous", viscous, motion_truth, ("angle", "speed"), 0.12, along={"phase": PHASES}),
    Case("foliot_start", "linear", released, flips_truth, ("flip_time", "flip_speed"), 0.12, along={"flip": FLIPS}),
    Case(
        "foliot_steps", "linear", stepped, steps_truth, ("period", "time", "crossing_speed"), 0.12, fixed={"flips": 3.0}
    ),
    Case("verge", "", verges, verge_truth, VERGE, 0.01, blur=1e-9),
    Case("foliot_ripple", "Coulomb and spring", rippled, ripple_truth, CYCLE, 0.12, path=honest_paths.rippled),
    Case("balance", "", swinging, balance_truth, BALANCE),
    Case("balance_trace", "", swinging, trace_truth, ("turning_point",), 0.2, along={"half_swing": HALF_SWINGS}),
    Case("balance_driven", "", driven, driven_truth, ("amplitude", "period", "multiplier"), 0.12),
    Case("impact", "", clocks, clock_truth, IMPACT, 0.6),
    Case("polisher", "extremes", machines, extremes_truth, CLOSED),
    Case("polisher", "waveform", machines, waveform_truth, ("thd",), 0.01),
    Case(
        "polisher_motion", "", turning, arm_truth, ("alpha", "alpha_rate", "alpha_acceleration"), 0.2,
        along={"crank_angle": CRANK_ANGLES},
    ),
    Case(
        "polisher_wear", "", worn, wear_truth, ("wear",), 0.002, along={"radius": RADII}, fixed=PAPER, blur=1e-10
    ),
    Case("drivetrain", "frequencies", chains, modes_truth, ("frequency",), 0.12),
    Case(
        "drivetrain_frf", "", damped_chains, receptance_truth, RECEPTANCE, 0.12, along={"frequency": FREQUENCIES},
        over={"receptance_re": "amplitude", "receptance_im": "amplitude"},
    ),
)  # fmt: skip
WITHOUT = {
    "foliot_noise": "statistics of a random torque; its tests compare means and scatter with theory",
    "polisher_wear_point": "its tests compare with integration over time, in float64",
}
"""Kernels without a 50-digit oracle, and what they are compared with."""
