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

from sweep.laws.loglog import Array
from sweep.laws.noise import ROUNDING, corrected, line_deviance, regress
from sweep.laws.shapes import ONE, Law


class Found(NamedTuple):
    """A law fitted to points; `numbers` are q and then b, `jacobian` the derivatives of the curve by them."""

    law: Law
    numbers: Array
    jacobian: Array
    off: Array
    sigma: Array | None
    """Standard errors of the points, where they are known."""
    deviance: float
    more: int = 0
    """Numbers of the noise that are fitted too."""

    @property
    def aicc(self) -> float:
        """Akaike's criterion, corrected for few points."""
        return float(corrected(self.deviance, self.off.size, self.law.numbers + self.more))

    @property
    def bic(self) -> float:
        """Bayes' criterion."""
        return self.deviance + (self.law.numbers + self.more) * math.log(self.off.size)

    @property
    def square(self) -> float:
        """Sum of squares, of what is known of the noise."""
        return float(((self.off if self.sigma is None else self.off / self.sigma) ** 2).sum())

    @property
    def residual(self) -> float:
        """Largest relative distance of a point."""
        return math.expm1(min(float(abs(self.off).max()), 700.0))

    def errors(self) -> Array:
        """Standard errors of the numbers beside independent noise; inf of what the points do not determine."""
        columns = self.jacobian if self.sigma is None else self.jacobian / self.sigma[:, None]
        size = np.sqrt((columns**2).sum(axis=0)) + 1e-300
        _, moved, directions = np.linalg.svd(columns / size, full_matrices=False)
        seen = moved > 1e-8 * moved.max(initial=0.0)
        change = directions.T / size[:, None] / np.where(seen, moved, np.nan)
        lost = (directions[~seen] ** 2).sum(axis=0) > 1e-6
        noise = 1.0 if self.sigma is not None else math.sqrt(self.square / (self.off.size - self.law.numbers))
        return np.where(lost, np.inf, noise * np.sqrt(np.nansum(np.where(lost[:, None], 0.0, change) ** 2, axis=1)))

    def interval(self, t: Array, which: list[int], noise: str, confidence: float) -> tuple[Array, float]:
        """Ends of the intervals of some numbers (2, k), infinite where they are not determined; `aicc` with the noise
        of the word that suits best, where it is not known."""
        known, best = np.flatnonzero(np.isfinite(self.errors())).tolist(), self
        ends = np.array([[-np.inf] * len(which), [np.inf] * len(which)])
        if known:
            line = regress(t, self.jacobian[:, known], self.off[None], noise, sigma=self.sigma)
            for place, number in enumerate(which):
                if number in known:
                    ends[:, place] = line.interval(known.index(number), confidence)[:, 0]
            if self.sigma is None and noise != "even":
                best = self._replace(deviance=float(line.deviance[0]), more=2)
        return self.numbers[which] + np.clip(ends, [[-np.inf], [0.0]], [[0.0], [np.inf]]), best.aicc

    def denied(self, t: Array, noise: str) -> bool:
        """Whether the points are not the law and noise; unless that is independent, by polynomials beside the law."""
        more = 0 if self.sigma is not None or noise == "even" else 3
        columns = self.jacobian[:, np.isfinite(self.errors())]
        beside = np.polynomial.chebyshev.chebvander(2 * (t - t[0]) / (t[-1] - t[0]) - 1, 1 + more)[:, 2:]
        every = np.concatenate([columns, beside], axis=1)
        return bool(columns.size and regress(t, every, self.off[None], noise, columns.shape[1], self.sigma).denied[0])


DAMPINGS = 10.0 ** np.array([-7.0, -3.0, -2.0, -1.0, 0.0, 1.0, 3.0])
"""Of a Gauss-Newton step, all of which are tried at once; the best is taken."""
STEP, STEPS = 1e-6, 30
"""Of numerical derivatives by q; Gauss-Newton steps at most."""
MOST_LINES = 16
"""That are fitted at once, so that what is held stays below some 50 MB."""


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(laws: Sequence[Law], t: Array, z: Array, errors: Array | None = None) -> list[dict[str, Found]]:
    """For each line of z (m, n) the laws, by name, that are nearest to it, t rising; not those that have not two more
    points than numbers, at more places than numbers. `errors` (m, n) are standard errors, where they are known.

    The law ONE is of the noise that suits it best, where that is not known.
    """
    places = np.unique(t).size
    laws = [law for law in laws if t.size >= law.numbers + 2 and places > law.numbers]
    found: list[dict[str, Found]] = [{} for _ in z]
    most = MOST_LINES if errors is None else 1
    for first in range(0, len(z) if laws else 0, most):
        part = z[first : first + most]
        for k, one in enumerate(_nearest(laws, t, part, None if errors is None else errors[first])):
            found[first + k % len(part)][one.law.name] = one
    if ONE in laws and errors is None:
        for line, row in zip(found, z, strict=True):
            one = line[ONE.name]
            line[ONE.name] = min(one, one._replace(deviance=line_deviance(t, row), more=2), key=lambda fit: fit.aicc)
    return found


def _start(law: Law, t: Array, z: Array, root: Array) -> Array:
    """The q (m, q) of a grid that are nearest to lines z (m, n)."""
    if not law.q:
        return np.zeros((len(z), 0))
    tries = np.array(list(itertools.product(*(number.starts for number in law.q))), dtype=np.float64)
    parts = _parts([law], [tries], t)
    exist = np.asarray(np.isfinite(parts).all(axis=(0, 2)))
    basis = np.linalg.qr((np.where(exist[:, None], parts[1:], 0.0) * root).transpose(1, 2, 0))[0]
    wanted = (z[:, None] - np.where(exist[:, None], parts[0], np.nan)) * root
    off = (wanted**2).sum(axis=2) - (np.einsum("gnk,mgn->mgk", basis, wanted) ** 2).sum(axis=2)
    found: Array = tries[np.nanargmin(off, axis=1)]
    return found


def _nearest(laws: Sequence[Law], t: Array, z: Array, errors: Array | None) -> list[Found]:
    """Each law fitted to each line z (m, n); law by law."""
    root, lines = np.ones_like(t) if errors is None else 1 / errors, len(z)
    most = max(1, *(len(law.q) for law in laws))
    # rows are laws times lines; q that a law does not have are 0 and stay so
    q, limits = np.zeros((len(laws) * lines, most)), np.zeros((len(laws), most, 2))
    for k, law in enumerate(laws):
        q[k * lines : (k + 1) * lines, : len(law.q)] = _start(law, t, z, root)
        limits[k, : len(law.q)] = np.reshape([(number.least, number.most) for number in law.q], (-1, 2))
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
    by_q, columns, n = derivatives(rows)[0], parts(rows, q[:, None])[1:, :, 0], t.size
    found = []
    for row, law in enumerate(law for law in laws for _ in z):
        numbers = np.concatenate([q[row, : len(law.q)], b[row, : law.columns]])
        jacobian = np.concatenate([by_q[row, : len(law.q)], columns[: law.columns, row]]).T
        floor = (ROUNDING * (1 + abs(z[row % lines]).max())) ** 2  # what rounding leaves
        square = float(off[row] @ off[row])
        deviance = n * math.log(square / n + floor) if errors is None else square
        found.append(Found(law, numbers, np.array(jacobian), off[row] / root, errors, deviance, int(errors is None)))
    return found


def _parts(laws: Sequence[Law], q: Sequence[Array], t: Array) -> Array:
    """Shift and columns (1 + k, g, n) of (1) of shapes: laws behind one another, each with its q; the rest is 0."""
    span, starts = float(t[-1] - t[0]), np.cumsum([0, *map(len, q)])
    found, s = np.zeros((1 + max(law.columns for law in laws), starts[-1], t.size)), (t - t[0]) / span
    for law, own, start in zip(laws, q, starts, strict=False):
        if len(own):
            for k, part in enumerate(law.parts(own[:, : len(law.q)].T[:, :, None], s, span)):
                found[k, start : start + len(own)] = part
    return found
