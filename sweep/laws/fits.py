"""Laws of the table fitted to points, and what the points tell of each of their numbers.

For given q, the numbers b are a linear least-squares fit (variable projection): a grid over q gives the start, damped
Gauss-Newton steps of q the end. All laws of all lines are fitted at once.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc, ndtri

from sweep.laws.loglog import Array
from sweep.laws.noise import RARE, ROUNDING, UNLIKELY, Regression, corrected, line_deviance, regress, runs_chance
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

    def interval(self, t: Array, which: list[int], noise: str, confidence: float) -> tuple[Array, Array, float]:
        """Ends of the intervals of some numbers, about them, and `aicc_under`."""
        errors = self.errors()
        doubt, known = errors[which], np.isfinite(errors)
        if self.weights is not None or not known[which].all():
            reach = (3 if self.weights is None else ndtri((1 + confidence) / 2)) * doubt
            return -reach, reach, self.aicc_under(t, noise)
        line = regress(t, self.jacobian[:, known], self.off[None], noise)
        low, high = np.array([line.interval(int(known[:k].sum()), confidence) for k in which])[:, :, 0].T
        return np.fmin(low, 0), np.fmax(high, 0), self.aicc_under(t, noise, line)

    def aicc_under(self, t: Array, noise: str, line: Regression | None = None) -> float:
        """`aicc` with the noise of a word that suits best, where it is not known."""
        columns = self.jacobian[:, np.isfinite(self.errors())]
        if self.weights is not None or noise == "even" or not columns.size:
            return self.aicc
        line = line or regress(t, columns, self.off[None], noise)
        return float(corrected(float(line.deviance[0]), t.size, self.law.numbers + 2))

    def chi_squared(self) -> float:
        """Chance of so large a chi-squared; NaN where the noise is not known."""
        if self.weights is None:
            return math.nan
        return float(gammaincc((self.off.size - self.law.numbers) / 2, float((self.off**2 * self.weights).sum()) / 2))

    def denied(self, t: Array, noise: str, more: int = 3) -> bool:
        """Whether the points are not the law and noise: by chi-squared where it is known, by the signs of neighbours
        where it is known or even, else by so many polynomials beside the law that tell far more."""
        if self.weights is not None or noise == "even":
            return bool(self.chi_squared() < RARE or runs_chance(self.off) < RARE)
        columns = self.jacobian[:, np.isfinite(self.errors())]
        beside = np.polynomial.chebyshev.chebvander(2 * (t - t[0]) / (t[-1] - t[0]) - 1, 1 + more)[:, 2:]
        every = np.concatenate([columns, beside], axis=1)
        return bool(regress(t, every, self.off[None], noise, columns.shape[1]).chance[0] < UNLIKELY)


DAMPINGS = 10.0 ** np.array([-7.0, -4.0, -3.0, -2.0, -1.5, -1.0, -0.5, 0.0, 1.0, 3.0])
"""Of a Gauss-Newton step, all of which are tried at once; the best is taken."""
STEP, STEPS = 1e-6, 30
"""Of numerical derivatives by q; Gauss-Newton steps at most."""
MOST_LINES = 16
"""That are fitted at once, so that what is held stays below some 50 MB."""


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(laws: Sequence[Law], t: Array, z: Array, errors: Array | None = None) -> list[dict[str, Found]]:
    """For each line of z (m, n) the laws, by name, that are nearest to it, t rising; not those that have not two more
    points than numbers. `errors` (m, n) are standard errors, where they are known.

    The law ONE is of the noise that suits it best, where that is not known; bends with a shape start from TWO.
    """
    most = MOST_LINES if errors is None else 1
    if len(z) > most:
        parts = [slice(i, i + most) for i in range(0, len(z), most)]
        return [line for i in parts for line in fitted(laws, t, z[i], None if errors is None else errors[i])]
    weights = None if errors is None else errors[0] ** -2.0
    laws = [law for law in laws if t.size >= law.numbers + 2]
    shaped = [law for law in laws if TWO in laws and law.exponents == TWO.exponents and law is not TWO]
    plain = [law for law in laws if law not in shaped]
    starts = [_start(law, t, z, weights) for law in plain]
    found: list[dict[str, Found]] = [{} for _ in z]
    for round_ in (plain, shaped):
        if round_ is shaped and shaped:
            near = np.array([line[TWO.name].numbers[:2] for line in found])
            starts = [np.pad(near, [(0, 0), (0, len(law.starts) - 2)]) for law in shaped]
        for k, one in enumerate(_nearest(round_, starts, t, z, weights) if round_ else ()):
            found[k % len(z)][one.law.name] = one
    if ONE in laws and weights is None:
        k = ONE.numbers + 2
        for line, row in zip(found, z, strict=True):
            deviance = line_deviance(t, row)
            aicc, bic = float(corrected(deviance, t.size, k)), deviance + k * math.log(t.size)
            if aicc < line[ONE.name].aicc:
                line[ONE.name] = line[ONE.name]._replace(deviance=deviance, aicc=aicc, bic=bic)
    return found


def _start(law: Law, t: Array, z: Array, weights: Array | None) -> Array:
    """The q (m, q) of a grid that are nearest to lines z (m, n)."""
    tries = np.array(list(itertools.product(*law.starts)), dtype=np.float64)
    if not law.starts:
        return np.zeros((len(z), 0))
    root = np.ones_like(t) if weights is None else np.sqrt(weights)
    parts = _parts([law], [tries], t)
    exist = np.asarray(np.isfinite(parts).all(axis=(0, 2)))
    basis = np.linalg.qr((np.where(exist[:, None], parts[1:], 0.0) * root).transpose(1, 2, 0))[0]
    wanted = (z[:, None] - np.where(exist[:, None], parts[0], np.nan)) * root
    off = (wanted**2).sum(axis=2) - (np.einsum("gnk,mgn->mgk", basis, wanted) ** 2).sum(axis=2)
    found: Array = tries[np.nanargmin(off, axis=1)]
    return found


def _nearest(laws: Sequence[Law], starts: list[Array], t: Array, z: Array, weights: Array | None) -> list[Found]:
    """Each law fitted to each line z (m, n), from its start (m, q); law by law."""
    root = np.ones_like(t) if weights is None else np.sqrt(weights)
    most, lines = max(1, *(len(law.starts) for law in laws)), len(z)
    # rows are laws times lines; q that a law does not have are 0 and stay so
    q = np.concatenate([np.pad(start, [(0, 0), (0, most - start.shape[1])]) for start in starts])
    limits = np.zeros((len(laws), most, 2))
    for k, law in enumerate(laws):
        limits[k, : len(law.starts)] = np.reshape(law.limits, (-1, 2))
    low, high = np.repeat(limits, lines, axis=0)[:, None].transpose(3, 0, 1, 2)
    steps = STEP * np.concatenate([np.eye(most), -np.eye(most)])

    def parts(rows: NDArray[np.intp], at: Array) -> Array:
        """Shifts and columns (1 + k, r, g, n) of rows at some q (r, g, most)."""
        which = np.searchsorted(rows, lines * np.arange(len(laws) + 1))
        found = _parts(laws, [at[a:b].reshape(-1, most) for a, b in itertools.pairwise(which)], t)
        return found.reshape(len(found), *at.shape[:2], t.size)

    def project(rows: NDArray[np.intp], at: Array) -> tuple[Array, Array, Array, Array]:
        """Weighted distances (r, g, n), infinite where there is no curve, b (r, g, k), and Q, R of the columns."""
        every = parts(rows, at)
        exist = np.asarray(np.isfinite(every).all(axis=(0, 3)))[..., None]
        columns, wanted = (np.where(exist, one, 0.0) * root for one in (every[1:], z[rows % lines, None] - every[0]))
        basis, back = np.linalg.qr(np.moveaxis(columns, 0, -1))
        size = abs(np.diagonal(back, axis1=-2, axis2=-1))
        told = size > 1e-13 * size.max(axis=-1, keepdims=True)  # others add nothing
        basis = np.where(told[..., None, :], basis, 0.0)
        along = (wanted[..., None, :] @ basis)[..., 0, :]
        back = np.where(told[..., :, None] & told[..., None, :], back, np.eye(len(columns)))
        off = np.where(exist, wanted - (basis @ along[..., None])[..., 0], np.inf)
        return off, np.linalg.solve(back, along[..., None])[..., 0], basis, back

    def derivatives(rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Of the curves at fixed b (r, most, n), and of the columns (k, r, most, n), by q."""
        beside = np.clip(q[rows, None] + steps, low[rows], high[rows])
        every, apart = parts(rows, beside), np.einsum("rqq->rq", beside[:, :most] - beside[:, most:])[..., None]
        by_q = np.nan_to_num((every[:, :, :most] - every[:, :, most:]) / apart, posinf=0.0, neginf=0.0)
        return by_q[0] + np.einsum("krqn,rk->rqn", by_q[1:], b[rows]), by_q[1:]

    rows = np.arange(len(q))
    off, b, basis, back = (part[:, 0] for part in project(rows, q[:, None]))
    for _ in range(STEPS):
        # of the distances (Golub and Pereyra, 1973)
        by_q, columns = (part * root for part in derivatives(rows))
        turned = np.linalg.solve(back[rows].transpose(0, 2, 1), np.einsum("krqn,rn->rkq", columns, off[rows]))
        by_q += (turned.transpose(0, 2, 1) - by_q @ basis[rows]) @ basis[rows].transpose(0, 2, 1)
        normal, square = by_q @ by_q.transpose(0, 2, 1), (off[rows] ** 2).sum(axis=1)
        trace = np.trace(normal, axis1=1, axis2=2)
        moves = (trace > 1e-200) & (trace < np.inf) & (square < np.inf)  # else nothing moves the points
        rows, square, by_q, normal, trace = (part[moves] for part in (rows, square, by_q, normal, trace))
        if not rows.size:
            break
        scale = (np.einsum("rqq->rq", normal) + 1e-12 * trace[:, None])[:, None, None] * np.eye(most)
        right = (by_q @ off[rows, :, None])[:, None]
        change = np.linalg.solve(normal[:, None] + DAMPINGS[:, None, None] * scale, right)[..., 0]
        there = np.clip(q[rows, None] + change, low[rows], high[rows])
        tried = project(rows, there)
        squares = (tried[0] ** 2).sum(axis=2)
        best = np.argmin(squares, axis=1)
        least = np.take_along_axis(squares, best[:, None], axis=1)[:, 0]
        better = np.flatnonzero(least < square)
        taken, best = rows[better], best[better]
        q[taken] = there[better, best]
        off[taken], b[taken], basis[taken], back[taken] = (part[better, best] for part in tried)
        rows = taken[(square - least >= 1e-6 * square)[better]]
    rows = np.arange(len(q))
    by_q, columns = derivatives(rows)[0], parts(rows, q[:, None])[1:, :, 0]
    found = []
    for row in range(len(q)):
        law = laws[row // lines]
        part, numbers = off[row], np.concatenate([q[row, : len(law.starts)], b[row, : law.columns]])
        jacobian = np.concatenate([by_q[row, : len(law.starts)], columns[: law.columns, row]]).T
        floor = (ROUNDING * (1 + abs(z[row % lines]).max())) ** 2  # what rounding leaves
        square = float(part @ part)
        deviance = t.size * math.log(square / t.size + floor) if weights is None else square
        k = law.numbers + (weights is None)
        aicc, bic = float(corrected(deviance, t.size, k)), deviance + k * math.log(t.size)
        found.append(Found(law, numbers, np.array(jacobian), part / root, weights, deviance, aicc, bic))
    return found


def _parts(laws: Sequence[Law], q: Sequence[Array], t: Array) -> Array:
    """Shift and columns (1 + k, g, n) of (1) of shapes: laws behind one another, each with its q; the rest is 0."""
    span, starts = float(t[-1] - t[0]), np.cumsum([0, *map(len, q)])
    found, s = np.zeros((1 + max(law.columns for law in laws), starts[-1], t.size)), (t - t[0]) / span
    for law, own, start in zip(laws, q, starts, strict=False):
        if len(own):
            for k, part in enumerate(law.parts(own[:, : len(law.starts)].T[:, :, None], s, span)):
                found[k, start : start + len(own)] = part
    return found
