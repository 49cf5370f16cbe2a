"""Laws of the table fitted to points, and what the points tell of each of their numbers.

For given q, the numbers b are a linear least-squares fit (variable projection): a grid over q gives the start, damped
Gauss-Newton steps of q the end.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc, ndtri

from sweep.laws.loglog import Array
from sweep.laws.noise import RARE, ROUNDING, UNLIKELY, corrected, line_deviance, regress, runs_chance
from sweep.laws.shapes import ONE, TWO, Law


class Found(NamedTuple):
    """A law fitted to points; `numbers` are q and then b, `jacobian` the derivatives of the curve by them."""

    law: Law
    numbers: Array
    jacobian: Array
    off: Array
    weights: Array | None
    """One over the variance of each point, where it is known."""
    deviance: float
    aicc: float
    bic: float

    def errors(self) -> Array:
        """Standard errors of the numbers; inf of what the points do not determine."""
        columns = self.jacobian if self.weights is None else self.jacobian * np.sqrt(self.weights)[:, None]
        size = np.sqrt((columns**2).sum(axis=0)) + 1e-300
        _, moved, directions = np.linalg.svd(columns / size, full_matrices=False)
        seen = moved > 1e-8 * moved.max(initial=0.0)
        change = directions.T / size[:, None] / np.where(seen, moved, np.nan)
        lost = (directions[~seen] ** 2).sum(axis=0) > 1e-6
        left = self.off.size - self.law.numbers
        noise = 1.0 if self.weights is not None else math.sqrt(float(self.off @ self.off) / left)
        return np.where(lost, np.inf, noise * np.sqrt(np.nansum(np.where(lost[:, None], 0.0, change) ** 2, axis=1)))

    def interval(self, t: Array, which: list[int], noise: str, confidence: float) -> tuple[Array, Array]:
        """Ends of the intervals of some numbers, about them."""
        errors = self.errors()
        doubt = errors[which]
        if self.weights is not None:
            reach = ndtri((1 + confidence) / 2) * doubt
            return -reach, reach
        if not np.isfinite(doubt).all():
            reach = np.where(np.isfinite(doubt), 3 * doubt, np.inf)
            return -reach, reach
        known = np.isfinite(errors)
        line = regress(t, self.jacobian[:, known], self.off[None], noise)
        low, high = np.array([line.interval(int(known[:k].sum()), confidence) for k in which])[:, :, 0].T
        return np.fmin(low, 0), np.fmax(high, 0)

    def denied(self, t: Array, noise: str, more: int = 3) -> bool:
        """Whether the points are not the law and noise: by chi-squared where it is known, by the signs of neighbours
        where it is known or even, else by so many polynomials beside the law that tell far more."""
        if self.weights is not None:
            square = float((self.off**2 * self.weights).sum())
            if gammaincc((t.size - self.law.numbers) / 2, square / 2) < RARE:
                return True
        if self.weights is not None or noise == "even":
            return bool(runs_chance(self.off) < RARE)
        columns = self.jacobian[:, np.isfinite(self.errors())]
        beside = np.polynomial.chebyshev.chebvander(2 * (t - t[0]) / (t[-1] - t[0]) - 1, 1 + more)[:, 2:]
        every = np.concatenate([columns, beside], axis=1)
        return bool(regress(t, every, self.off[None], noise, columns.shape[1]).chance[0] < UNLIKELY)


DAMPINGS = 10.0 ** np.array([-7.0, -4.0, -3.0, -2.0, -1.5, -1.0, -0.5, 0.0, 1.0, 3.0])
"""Of a Gauss-Newton step, all of which are tried at once; the best is taken."""
STEP = 1e-6
"""Of numerical derivatives by q."""


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(law: Law, t: Array, z: Array, weights: Array | None = None, near: Array | None = None) -> Found | None:
    """The law that is nearest to the points, t rising; None where there are not more points than numbers, and two.

    `weights` are one over the variance of each point; `near` are q to start from instead of those of the table.
    """
    if t.size < law.numbers + 2:
        return None
    span = float(t[-1] - t[0])
    s = (t - t[0]) / span
    root = np.ones_like(z) if weights is None else np.sqrt(weights)
    q = np.zeros(0) if near is None else near
    if law.starts and near is None:
        tries, shifts, bases = _grid(law, s.tobytes(), root.tobytes(), span)
        wanted = (z - shifts) * root
        off = (wanted**2).sum(axis=1) - ((bases.transpose(0, 2, 1) @ wanted[:, :, None])[:, :, 0] ** 2).sum(axis=1)
        q = tries[int(np.nanargmin(off))]
    steps, (low, high) = STEP * np.eye(q.size), np.reshape(law.limits, (q.size, 2)).T
    for _ in range(30 * bool(law.starts)):
        beside = np.clip([q, *(q - steps), *(q + steps)], low, high)
        off, *sides = _project(law, beside, s, z, root, span)[0]
        below, above = np.split(np.array(sides), 2)
        square, by_q = float(off @ off), (above - below) / (2 * STEP)
        normal = by_q @ by_q.T
        if not 1e-200 < np.trace(normal) < np.inf:  # nothing moves the points
            break
        scale = np.diag(np.diag(normal) + 1e-12 * np.trace(normal))
        change = np.linalg.solve(normal + DAMPINGS[:, None, None] * scale, (by_q @ off)[None, :, None])[:, :, 0]
        there = np.clip(q - change, low, high)
        squares = (_project(law, there, s, z, root, span)[0] ** 2).sum(axis=1)
        best = int(np.argmin(squares))
        if not squares[best] < square:
            break
        q = there[best]
        if square - squares[best] < 1e-6 * square:
            break
    off, b = (part[0] for part in _project(law, q[None], s, z, root, span))
    jacobian = np.zeros((t.size, q.size + b.size))
    jacobian[:, q.size :] = np.broadcast_to(_parts(law, q[None], s, span)[1][0], (t.size, b.size))
    for k in range(q.size):
        one, other = np.clip([q + steps[k], q - steps[k]], low, high)
        moved = _value(law, one, b, s, span) - _value(law, other, b, s, span)
        jacobian[:, k] = np.nan_to_num(moved / (one[k] - other[k]), posinf=0.0, neginf=0.0)
    floor = (ROUNDING * (1 + abs(z).max())) ** 2  # what rounding leaves
    deviance = z.size * math.log(float(off @ off) / z.size + floor) if weights is None else float(off @ off)
    k = law.numbers + (weights is None)
    aicc, bic = float(corrected(deviance, z.size, k)), deviance + k * math.log(z.size)
    return Found(law, np.concatenate([q, b]), jacobian, off / root, weights, deviance, aicc, bic)


def all_fitted(laws: Sequence[Law], t: Array, z: Array, weights: Array | None) -> dict[str, Found]:
    """Laws by their names. That of one power law is of the noise that suits it best, where it is not known; bends with
    a shape start from the one that has none."""
    found: dict[str, Found] = {}
    for law in laws:
        near = found[TWO.name].numbers[:2] if law.exponents == TWO.exponents and TWO.name in found else None
        near = None if near is None else np.append(near, np.zeros(len(law.starts) - 2))
        one = fitted(law, t, z, weights, near)
        if one is not None and law is ONE and weights is None and (deviance := line_deviance(t, z)) < one.deviance:
            k = ONE.numbers + 2
            aicc, bic = float(corrected(deviance, t.size, k)), deviance + k * math.log(t.size)
            one = one._replace(deviance=deviance, aicc=aicc, bic=bic)
        if one is not None:
            found[law.name] = one
    return found


def curve(found: Found, t: Array, first: float, last: float) -> Array:
    """ln y of a fitted law at ln x = t; first and last are those of the points that it was fitted to."""
    q, b = np.split(found.numbers, [len(found.law.starts)])
    return _value(found.law, q, b, (t - first) / (last - first), last - first)


def _value(law: Law, q: Array, b: Array, s: Array, span: float) -> Array:
    shift, columns = _parts(law, q[None], s, span)
    value: Array = shift[0] + columns[0] @ b
    return value


def _parts(law: Law, q: Array, s: Array, span: float) -> tuple[Array, Array]:
    """Shift (g, n) and columns (g, n, k) for each of q (g, ...)."""
    shift, columns = law.parts(q.T[:, :, None], s, span)
    return np.broadcast_to(shift, (len(q), s.size)), np.broadcast_to(columns, (len(q), s.size, columns.shape[-1]))


def _exist(shift: Array, columns: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(shift).all(axis=1) & np.isfinite(columns).all(axis=(1, 2)))


@functools.lru_cache(maxsize=128)
def _grid(law: Law, places: bytes, roots: bytes, span: float) -> tuple[Array, Array, Array]:
    """All q to start from (g, q), their shifts (g, n), and orthonormal bases (g, n, k); NaN where there is no such
    curve. Lines of one array share them."""
    s, root = np.frombuffer(places), np.frombuffer(roots)
    tries = np.array(list(itertools.product(*law.starts)), dtype=np.float64)
    shifts, columns = _parts(law, tries, s, span)
    exist = _exist(shifts, columns)
    bases = np.linalg.qr(np.where(exist[:, None, None], columns, 0.0) * root[:, None])[0]
    return tries, np.where(exist[:, None], shifts, np.nan), bases


def _project(law: Law, q: Array, s: Array, z: Array, root: Array, span: float) -> tuple[Array, Array]:
    """Weighted distances (g, n), infinite where there is no curve, and the linear numbers (g, k), for each of q."""
    shift, columns = _parts(law, q, s, span)
    exist = _exist(shift, columns)
    columns = np.where(exist[:, None, None], columns * root[:, None], 0.0)
    wanted = np.where(exist[:, None], (z - shift) * root, np.inf)
    basis, back = np.linalg.qr(columns)
    size = abs(np.diagonal(back, axis1=1, axis2=2))
    told = size > 1e-13 * size.max(axis=1, keepdims=True, initial=0.0)
    along = np.where(told, (basis * wanted[:, :, None]).sum(axis=1), 0.0)
    back = np.where(told[:, :, None] & told[:, None, :], back, np.eye(size.shape[1]))
    return wanted - (basis @ along[:, :, None])[:, :, 0], np.linalg.solve(back, along[:, :, None])[:, :, 0]
