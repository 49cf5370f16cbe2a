"""Laws of the table fitted to points, and what the points tell of each of their numbers.

For given q, the numbers b are a linear least-squares fit (variable projection): a grid over q gives the start, damped
Gauss-Newton steps of q the end.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np

from sweep.laws.loglog import Array
from sweep.laws.noise import ROUNDING, corrected
from sweep.laws.shapes import Law


class Found(NamedTuple):
    """A law fitted to points; `numbers` are q and then b, `jacobian` the derivatives of the curve by them."""

    law: Law
    numbers: Array
    jacobian: Array
    off: Array
    deviance: float
    aicc: float
    bic: float

    @property
    def exponents(self) -> Array:
        """Per window."""
        return self.numbers[self.numbers.size - len(self.law.exponents) :]


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(law: Law, t: Array, z: Array, weights: Array | None = None, known: bool = False) -> Found | None:
    """The law that is nearest to the points, t rising; None where there are not more points than numbers, and two.

    `known` weights are one over the variance of each point; others tell only how these compare.
    """
    if t.size < law.numbers + 2:
        return None
    span = float(t[-1] - t[0])
    s = (t - t[0]) / span
    root = np.ones_like(z) if weights is None else np.sqrt(weights if known else weights / weights.mean())
    q = _start(law, s, z, root, span)
    here = _project(law, q, s, z, root, span)
    damping = 1e-3
    for _ in range(40 * bool(law.starts)):
        b, off, jacobian, basis = here
        by_q = jacobian[:, : q.size] * root[:, None]
        by_q -= basis @ (basis.T @ by_q)
        square, normal = float(off @ off), by_q.T @ by_q
        if not 1e-200 < np.trace(normal) < np.inf:  # nothing moves the points
            break
        scale = np.diag(normal) + 1e-12 * np.trace(normal)
        step = np.linalg.lstsq(normal + np.diag(damping * scale), by_q.T @ off, rcond=1e-15)[0]
        low, high = np.array(law.limits).T
        further = np.clip(q + step, low, high)
        there = _project(law, further, s, z, root, span)
        less = square - float(there[1] @ there[1])
        if less > 0:
            q, here, damping = further, there, damping * 0.1
            if less < 1e-7 * square:
                break
        else:
            damping = max(10 * damping, 1e-6)
            if damping > 1e8 or abs(step).max() < 1e-9:
                break
    b, off, jacobian, _ = here
    floor = (ROUNDING * (1 + abs(z).max())) ** 2  # what rounding leaves
    deviance = z.size * math.log(float(off @ off) / z.size + floor) - 2 * float(np.log(root).sum())
    deviance = float(off @ off) if known else deviance
    k = law.numbers + (not known)
    aicc = float(corrected(deviance, z.size, k))
    return Found(law, np.concatenate([q, b]), jacobian, off / root, deviance, aicc, deviance + k * math.log(z.size))


def curve(found: Found, t: Array, first: float, last: float) -> Array:
    """ln y of a fitted law at ln x = t; first and last are those of the points that it was fitted to."""
    q, b = np.split(found.numbers, [len(found.law.starts)])
    parts = found.law.parts(q, (t - first) / (last - first), last - first)
    value: Array = parts.shift + parts.columns @ b
    return value


def errors(found: Found, weights: Array | None = None) -> Array:
    """Standard errors of the numbers by the Jacobian; inf of what the points do not determine.

    `weights` are one over the variance of each point; by default the size of the noise is that of the distances.
    """
    root = np.ones(found.off.size) if weights is None else np.sqrt(weights)
    columns = found.jacobian * root[:, None]
    size = np.sqrt((columns**2).sum(axis=0)) + 1e-300
    _, moved, directions = np.linalg.svd(columns / size, full_matrices=False)
    seen = moved > 1e-8 * moved.max(initial=0.0)
    change = directions.T / size[:, None] / np.where(seen, moved, np.nan)
    lost = (directions[~seen] ** 2).sum(axis=0) > 1e-6
    left = found.off.size - found.law.numbers
    noise = 1.0 if weights is not None else math.sqrt(float(found.off @ found.off) / left)
    return np.where(lost, np.inf, noise * np.sqrt(np.nansum(np.where(lost[:, None], 0.0, change) ** 2, axis=1)))


def _start(law: Law, s: Array, z: Array, root: Array, span: float) -> Array:
    if not law.starts:
        return np.empty(0)
    tries, shifts, bases = _grid(law, s.tobytes(), root.tobytes(), span)
    wanted = (z - shifts) * root
    off = (wanted**2).sum(axis=1) - ((bases.transpose(0, 2, 1) @ wanted[:, :, None])[:, :, 0] ** 2).sum(axis=1)
    best: Array = tries[int(np.nanargmin(off))]
    return best


@functools.lru_cache(maxsize=128)
def _grid(law: Law, places: bytes, roots: bytes, span: float) -> tuple[Array, Array, Array]:
    """All q to start from (g, q), their shifts (g, n), and orthonormal bases (g, n, k); NaN where there is no such
    curve. Lines of one array share them."""
    s, root = np.frombuffer(places), np.frombuffer(roots)
    tries = np.array(list(itertools.product(*law.starts)), dtype=np.float64)
    parts = [law.parts(q, s, span) for q in tries]
    shifts = np.stack([np.broadcast_to(one.shift, s.shape) for one in parts])
    columns = np.stack([one.columns for one in parts])
    exist = np.isfinite(columns).all(axis=(1, 2)) & np.isfinite(shifts).all(axis=1)
    bases = np.linalg.qr(np.where(exist[:, None, None], columns, 0.0) * root[:, None])[0]
    return tries, np.where(exist[:, None], shifts, np.nan), bases


def _project(law: Law, q: Array, s: Array, z: Array, root: Array, span: float) -> tuple[Array, Array, Array, Array]:
    """Linear numbers for given q, weighted distances (infinite where there is no curve), Jacobian, and the basis of
    the columns."""
    parts = law.parts(q, s, span)
    columns = parts.columns * root[:, None]
    if not (np.isfinite(columns).all() and np.isfinite(parts.shift).all()):
        return np.zeros(columns.shape[1]), np.full(s.size, np.inf), parts.columns, columns
    wanted = (z - parts.shift) * root
    basis, back = np.linalg.qr(columns)
    b = np.linalg.lstsq(back, basis.T @ wanted, rcond=1e-13)[0]
    jacobian = np.concatenate([parts.shift_by_q + parts.columns_by_q @ b, parts.columns], axis=1)
    return b, wanted - columns @ b, jacobian, basis
