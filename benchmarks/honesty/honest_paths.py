"""Second paths to the truth, in 80-bit numbers, for cells that would take the 50-digit oracles hours; for honest_cells.

They share nothing with the kernels, and auto_honesty.py holds them against the oracles in some cells of every run. Each
takes columns and gives a truth per cell: {output: number}, `None` where there is no cycle, or `NotImplemented` where
the path does not resolve the cell. In units of phi0 and sqrt(phi0/mu), rho = R/mu and sigma = 1 - rho.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.polynomial.legendre import leggauss

CYCLE = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
REAL = np.longdouble
PI = REAL("3.14159265358979323846264338327950288")
PIECES = (1.0, 2.0, 4.0, 8.0, 16.0, 44.0)
"""Limits of integration over z; beyond the last one exp(-z) is below the last digit."""
ROUNDS = 60
CLOSE = 1e-15
"""How well two grids must agree."""
MOST_PANELS = 10_000
"""Of a grid over a swing with a ripple: what friction stops only after more waves is not resolved, which takes 1 GB."""


def gauss(n):
    """Nodes in (0, 1) and weights to 80 bits: numpy's, and two Newton steps on the polynomial."""
    x = leggauss(n)[0].astype(REAL)
    for _ in range(3):
        low, high = np.ones_like(x), x
        for k in range(2, n + 1):
            low, high = high, ((2 * k - 1) * x * high - (k - 1) * low) / k
        slope = n * (low - x * high) / (1 - x * x)
        x = x - high / slope
    return (1 + x) / 2, 1 / ((1 - x * x) * slope * slope)


def double_exponential(step=0.0625, reach=4.6):
    """Nodes in (0, 1) and weights that end singularities do not trouble."""
    t = np.arange(-int(reach / step), int(reach / step) + 1).astype(REAL) * step
    s = 1 / (1 + np.exp(-PI * np.sinh(t)))
    return s, step * PI * np.cosh(t) * s / (1 + np.exp(PI * np.sinh(t)))


GAUSS, ENDS = gauss(48), double_exponential()


def power_drag(mu, phi0, R, c, n):
    """Foliots with friction R + c abs(v)^n: integrals over v = V s, V the speed that is never exceeded.

    With x = s^n the drive's force less friction is sigma (1 - x), friction and drive together 1 + rho + sigma x; the
    way in less the way out is 2/V^2 over the cycle. s = 1 - exp(-z), since s may be next to 1.
    """
    mu, phi0, R, c, n = (np.asarray(column).astype(REAL) for column in (mu, phi0, R, c, n))
    rho, sigma = R / mu, (mu - R) / mu
    gamma = c / mu * np.exp(n / 2 * np.log(phi0 * mu))
    V = np.exp(np.log(sigma / gamma) / n)
    goal, z = 2 / V / V, np.ones_like(V)
    for _ in range(ROUNDS):
        way, _, _, _, _, slope, _ = _integrals(z, n, rho, sigma)
        change = np.clip(np.log(goal / way) * way / (slope * z), -2, 2)
        z = z * np.exp(change)
        if (abs(change) < 1e-18).all():
            break
    way, time, way_rho, time_rho, out, slope, time_slope = _integrals(z, n, rho, sigma)
    by_V = (rho / sigma - n / 2 + 1) / n  # dlnV/dlnmu
    by_z = (rho * way_rho - 2 * goal * by_V) / slope
    s = 0.5 - by_V - (time_slope * by_z - rho * time_rho) / time
    x, rest = _power(z, n)
    unit = np.sqrt(phi0 / mu)
    multiplier = sigma * rest / (1 + rho + sigma * x)
    columns = (2 * V * time * unit, phi0 * (1 + V * V * out), -V * np.expm1(-z) * phi0 / unit, s, multiplier)
    with np.errstate(over="ignore", under="ignore"):
        return [dict(zip(CYCLE, map(float, row), strict=True)) for row in zip(*columns, strict=True)]


def _power(z, n):
    """x = s^n and 1 - x at s = 1 - exp(-z)."""
    with np.errstate(under="ignore"):
        logarithm = n * np.where(z > 1, np.log1p(-np.exp(-np.maximum(z, 1))), np.log(-np.expm1(-np.minimum(z, 1))))
    return np.exp(logarithm), -np.expm1(logarithm)


def _integrals(z, n, rho, sigma):
    """Up to z: way in less way out, time, both by rho, way out; and the rates of the first two with z."""
    low = -np.expm1(-np.minimum(z, 1))
    nodes, weights = ENDS
    s = low[:, None] * nodes
    logarithm = n[:, None] * np.log(s)
    terms = _terms(s, np.exp(logarithm), -np.expm1(logarithm), rho[:, None], sigma[:, None])
    sums = [low * (term * weights).sum(axis=1) for term in terms]
    for start, end in itertools.pairwise(PIECES):
        width = np.clip(z, start, end) - start
        if (width > 0).any():
            u = start + width[:, None] * GAUSS[0]
            x, rest = _power(u, n[:, None])
            terms = _terms(-np.expm1(-u), x, rest, rho[:, None], sigma[:, None])
            sums = [
                total + width * (term * np.exp(-u) * GAUSS[1]).sum(axis=1)
                for total, term in zip(sums, terms, strict=True)
            ]
    beyond = np.maximum(z - PIECES[-1], 0) / (sigma * n)
    sums = [total + beyond * part for total, part in zip(sums, (1, 1, 1 / sigma, 1 / sigma, 0), strict=True)]
    x, rest = _power(np.minimum(z, 60), n)
    at_end = _terms(-np.expm1(-z), x, rest, rho, sigma)
    return *sums, at_end[0] * np.exp(-np.minimum(z, 60)), at_end[1] * np.exp(-np.minimum(z, 60))


def _terms(s, x, rest, rho, sigma):
    """Of one ds: way in less way out, time, both by rho, and way out; rest = 1 - x."""
    drive, brake = sigma * rest, 1 + rho + sigma * x
    first, second = 1 / (sigma * drive), rest / (brake * brake)
    return (
        s * 2 * (rho + sigma * x) / (drive * brake), 1 / drive + 1 / brake,
        s * (first + second), first - second, s / brake,
    )  # fmt: skip


def rippled(mu, phi0, R, k, depth, harmonic):
    """Foliots with dry friction, spring and a torque tau = 1 + depth cos(harmonic pi (1 - x)/2), by energy.

    The turning point is 1/rho. From there v^2/2 = y g(y) after a way y = L u^2, so that dt = sqrt(2 L/g) du.
    """
    return [_rippled(*map(REAL, cell)) for cell in zip(mu, phi0, R, k, depth, harmonic, strict=True)]


def _rippled(mu, phi0, R, k, depth, harmonic):
    rho, kappa = R / mu, k * phi0 / mu
    top = 1 / rho
    pull = 1 + depth * np.cos(harmonic * PI * (1 - top) / 2) + kappa * top
    if not pull > rho:
        return None
    legs = [(top + 1, -rho), (top - 1, rho)]
    panels = 8 + int(harmonic * (top + 1))
    if panels > MOST_PANELS:
        return NotImplemented
    found = [_ripple_legs(legs, top, kappa, depth, harmonic, panels * more) for more in (1, 2)]
    if None in found:
        return None if found == [None, None] else NotImplemented
    if max(abs(float(a / b - 1)) for a, b in zip(*found, strict=True)) > CLOSE:
        return NotImplemented
    time, change, energy = found[1]
    unit = np.sqrt(phi0 / mu)
    values = (2 * time * unit, top * phi0, np.sqrt(2 * energy) * phi0 / unit, 0.5 - change / time)
    return dict(zip(CYCLE, map(float, (*values, (pull - rho) / (pull + rho))), strict=True))


def _ripple_legs(legs, top, kappa, depth, harmonic, panels):
    """Half the period, its change with ln mu, and the energy at the switch; None where the motion does not arrive."""
    u = ((np.arange(panels).astype(REAL)[:, None] + PANEL[0]) / panels).ravel()
    weights = np.tile(PANEL[1] / panels, panels)
    time, change, wave = REAL(0), REAL(0), harmonic * PI
    for L, dry in legs:
        middle, q = top - L * u * u / 2, wave * L * u * u / 4
        angle, moved = wave * (1 - middle) / 2, top * (1 - u * u / 2)
        sinc, bent = np.sin(q) / q, (q * np.cos(q) - np.sin(q)) / (q * q)
        g = 1 + dry + kappa * middle + depth * np.cos(angle) * sinc
        if not (g > 0).all():
            return None
        by_mu = kappa * (moved - middle) - dry
        by_mu += depth * (np.sin(angle) * wave / 2 * moved * sinc + np.cos(angle) * bent * wave * top * u * u / 4)
        own = np.sqrt(2 * L) * (weights / np.sqrt(g)).sum()
        time += own
        change += own * top / (2 * L) - np.sqrt(L / 2) * (weights * by_mu / (g * np.sqrt(g))).sum()
    L, dry = legs[0]
    q, angle = wave * L / 4, wave * (1 - top + L / 2) / 2
    return time, change, L * (1 + dry + kappa * (top - L / 2) + depth * np.cos(angle) * np.sin(q) / q)


PANEL = gauss(24)
