"""Laws of `shapes` fitted to points, and what the points tell of each of their numbers.

For given q, the numbers b are a linear least-squares fit (variable projection): a grid over q gives the start, scipy's
Levenberg-Marquardt the end.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from sweep.laws.correlated import corrected
from sweep.laws.loglog import EPSILON, Array
from sweep.laws.shapes import Law, Parts


class Found(NamedTuple):
    """A law fitted to points; `numbers` are q and then b, their standard errors `errors` for noise of the size of
    `off`."""

    law: Law
    numbers: Array
    errors: Array
    off: Array
    deviance: float
    aicc: float
    bic: float


@np.errstate(all="ignore")  # what overflows is infinite, and no curve, or not determined
def fitted(law: Law, t: Array, z: Array, weights: Array | None = None, known: bool = False) -> Found | None:
    """The law that is nearest to the points, t rising; None where there are not more points than numbers, and two.

    `known` weights are one over the variance of each point; others tell only how these compare.
    """
    from scipy.optimize import leastsq

    if t.size < law.numbers + 2:
        return None
    s = (t - t[0]) / (t[-1] - t[0])
    root = np.ones_like(z) if weights is None else np.sqrt(weights if known else weights / weights.mean())
    q = _start(law, s, z, root)
    if law.grids:
        options: dict[str, Any] = {"xtol": 1e-8, "ftol": 1e-10, "maxfev": 200, "full_output": True}
        q = leastsq(lambda p: _project(law, p, s, z, root)[1], q, diag=np.ones(q.size), **options)[0]
    b, off = _project(law, q, s, z, root)
    numbers = np.concatenate([q, b])
    errors = _errors(law, numbers, s, off, root)
    if known:
        errors = errors * math.sqrt((s.size - law.numbers) / max(float(off @ off), 1e-300))
    floor = (4 * EPSILON * (1 + abs(z).max())) ** 2  # what rounding leaves
    deviance = z.size * math.log(float(off @ off) / z.size + floor) - 2 * float(np.log(root).sum())
    deviance = float(off @ off) if known else deviance
    k = law.numbers + (not known)
    return Found(
        law, numbers, errors, off / root, deviance, corrected(deviance, z.size, k), deviance + k * math.log(z.size)
    )


def curve(found: Found, t: Array, first: float, last: float) -> Array:
    """ln y of a fitted law at ln x = t; first and last are those of the points that it was fitted to."""
    s = (t - first) / (last - first)
    q, b = np.split(found.numbers, [len(found.law.grids)])
    shift, columns = found.law.parts(q, s)
    value: Array = shift + columns @ b
    return value


def _start(law: Law, s: Array, z: Array, root: Array) -> Array:
    tries, shifts, bases = _grid(law, s.tobytes(), root.tobytes())
    wanted = (z - shifts) * root
    off = wanted - (bases @ (bases.transpose(0, 2, 1) @ wanted[:, :, None]))[:, :, 0]
    best: Array = tries[int(np.nanargmin((off**2).sum(axis=1)))]
    return best


@functools.lru_cache(maxsize=128)
def _grid(law: Law, places: bytes, roots: bytes) -> tuple[Array, Array, Array]:
    """All q to start from (g, q), their shifts (g, n), and orthonormal bases (g, n, columns); NaN where there is no
    such curve. Lines of one array share them."""
    s, root = np.frombuffer(places), np.frombuffer(roots)
    tries = np.array(list(itertools.product(*law.grids)), dtype=np.float64)
    parts = [law.parts(q, s) for q in tries]
    shifts = np.stack([np.broadcast_to(shift, s.shape) for shift, _ in parts])
    columns = np.stack([columns for _, columns in parts])
    exist = np.isfinite(columns).all(axis=(1, 2)) & np.isfinite(shifts).all(axis=1)
    bases = np.linalg.qr(np.where(exist[:, None, None], columns, 0.0) * root[:, None])[0]
    return tries, np.where(exist[:, None], shifts, np.nan), bases


FAR = 1e6
"""Distance of points from a curve that does not exist there."""


def _project(law: Law, q: Array, s: Array, z: Array, root: Array) -> tuple[Array, Array]:
    """Linear numbers and weighted distances for given q."""
    from scipy.linalg.lapack import dgelsd

    shift, columns = law.parts(q, s)
    if not (np.isfinite(shift).all() and np.isfinite(columns).all()):
        return np.zeros(columns.shape[1]), np.full(s.size, FAR)
    wanted, columns = (z - shift) * root, columns * root[:, None]
    b = dgelsd(columns, wanted, *_workspace(*columns.shape), EPSILON * s.size)[0][: columns.shape[1]]
    return b, wanted - columns @ b


@functools.lru_cache(maxsize=128)
def _workspace(points: int, columns: int) -> tuple[int, int]:
    """What dgelsd is to be given; numpy asks for it in each of its thousands of calls."""
    from scipy.linalg.lapack import dgelsd_lwork

    most, whole, _ = dgelsd_lwork(points, columns, 1)
    return int(most), int(whole)


STEP = 3e-6
"""Of derivatives by q, which are of a size like one."""
DOUBT = 3 * EPSILON / STEP
"""Part of the largest column that no derivative is sure of, by rounding."""
SEEN = 10.0
"""Doubts of the Jacobian from which on points are seen to move."""


def _errors(law: Law, numbers: Array, s: Array, off: Array, root: Array) -> Array:
    """Standard errors by the Jacobian; inf of what the points do not determine.

    Directions of the numbers in which points are not seen to move are lost. Numbers of which they are a part, beyond
    what the doubt of the Jacobian makes so, are not determined; errors of others are as if those were known.
    """
    slopes, doubt, level = _jacobian(law, numbers, s)
    if not (np.isfinite(slopes).all() and np.isfinite(doubt).all()):  # some derivative leaves where the curve exists
        return np.full(numbers.size, np.inf)
    least = np.sqrt(((doubt * root[:, None]) ** 2).sum(axis=0)) + 1e-100  # some may be zeros
    _, moved, directions = np.linalg.svd(slopes * root[:, None] / least, full_matrices=False)
    seen = moved > SEEN
    change = directions.T / least[:, None] / np.where(seen, moved, 1.0)
    change[len(law.grids)] -= level @ change
    known, lost = ((change[:, which] ** 2).sum(axis=1) for which in (seen, ~seen))
    found: Array = np.sqrt(known * float(off @ off) / (s.size - law.numbers))
    return np.where(lost > SEEN * known, np.inf, found)


def _jacobian(law: Law, numbers: Array, s: Array) -> tuple[Array, Array, Array]:
    """Derivatives of the curve, how far they are in doubt by rounding and steps, and the level that each number adds.

    Columns of exponents add up to t less a place. So if all exponents were the first, q would move the level alone;
    that is told apart, since beside it a bend between exponents that are nearly alike would be lost.
    """
    q, b = np.split(numbers, [len(law.grids)])
    columns, first = law.parts(q, s)[1], b[1] if b.size > 1 else 0.0
    rest = np.array([0.0, *(b[1:] - first)])
    slopes = np.concatenate([np.empty((s.size, q.size)), columns], axis=1)
    doubt, level = np.full(slopes.shape, DOUBT * abs(columns).max()), np.zeros(numbers.size)
    for j, step in enumerate(STEP * np.maximum(1.0, abs(q))):
        (shift, by_q), (rough_shift, rough) = (_derivative(law, q, j, times * step, s) for times in (1, 2))
        slopes[:, j] = shift + by_q @ rest
        doubt[:, j] = doubt[:, j] * abs(rest).sum() + 3 * abs(rough_shift + rough @ rest - slopes[:, j])
        level[j] = first * by_q[:, 1:].sum(axis=1).mean()
    return slopes, doubt, level


def _derivative(law: Law, q: Array, j: int, step: float, s: Array) -> Parts:
    """Of shift and columns by one q."""
    by = np.where(np.arange(q.size) == j, step, 0.0)
    (shift, columns), (less, below) = law.parts(q + by, s), law.parts(q - by, s)
    return (shift - less) / (2 * step), (columns - below) / (2 * step)
