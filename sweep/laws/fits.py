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
    errors: Array
    """Standard errors of the numbers beside independent noise; inf of what the points do not determine."""
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

    def interval(self, t: Array, which: list[int], noise: str, confidence: float) -> tuple[Array, float]:
        """Ends of the intervals of some numbers (2, k), infinite where they are not determined; `aicc` with the noise
        of the word that suits best, where it is not known."""
        known, best = np.flatnonzero(np.isfinite(self.errors)).tolist(), self
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
        columns = self.jacobian[:, np.isfinite(self.errors)]
        beside = np.polynomial.chebyshev.chebvander(2 * (t - t[0]) / (t[-1] - t[0]) - 1, 1 + more)[:, 2:]
        every = np.concatenate([columns, beside], axis=1)
        return bool(columns.size and regress(t, every, self.off[None], noise, columns.shape[1], self.sigma).denied[0])


DAMPINGS = 10.0 ** np.array([-7.0, -3.0, -2.0, -1.0, 0.0, 1.0, 3.0])
"""Of a Gauss-Newton step, all of which are tried at once; the best is taken."""
STEPS = 30
"""Gauss-Newton steps at most."""
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


def _nearest(laws: Sequence[Law], t: Array, z: Array, errors: Array | None) -> list[Found]:
    """Each law fitted to each line z (m, n); law by law."""
    root, lines, n = np.ones_like(t) if errors is None else 1 / errors, len(z), t.size
    # rows are laws times lines; q that a law does not have are 0 and stay so
    law, wanted = np.repeat(np.arange(len(laws)), lines), np.tile(z, (len(laws), 1))
    limits = np.zeros((2, len(laws), max(1, *(len(one.q) for one in laws))))
    for k, one in enumerate(laws):
        limits[:, k, : len(one.q)] = np.reshape([(number.least, number.most) for number in one.q], (-1, 2)).T
    low, high = limits[:, law]
    q = _starts(laws, t, z, root, limits.shape[2])

    def project(rows: NDArray[np.intp], at: Array) -> tuple[Array, Array, Array, Array]:
        """Weighted distances (r, n), infinite where there is no curve, b (r, k), and Q, R of the columns."""
        shift, basis, back = _linear(laws, law[rows], at, t, root)
        off = (wanted[rows] - shift) * root
        along = (off[:, None] @ basis)[:, 0]
        off = off - (basis @ along[..., None])[..., 0]
        b: Array = np.linalg.solve(back, along[..., None])[..., 0].astype(np.float64)
        return np.where(np.isnan(off), np.inf, off), b, basis, back

    def derivatives(rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Of the curves at fixed b (r, q, n) by q, and the columns with theirs (1 + q, k, r, n)."""
        every = np.nan_to_num(_curves(laws, law[rows], q[rows], t, limits.shape[2]), posinf=0.0, neginf=0.0)
        by_q = every[1:, 0] + np.einsum("qkrn,rk->qrn", every[1:, 1:], b[rows])
        return by_q.transpose(1, 0, 2) * root, every[:, 1:] * root

    rows = np.arange(len(q))
    off, b, basis, back = project(rows, q)
    square = (off**2).sum(axis=1)
    for _ in range(STEPS):
        # of the distances, which b follows (Golub and Pereyra, 1973)
        by_q, columns = derivatives(rows)
        turned = np.linalg.solve(back[rows].transpose(0, 2, 1), np.einsum("qkrn,rn->rkq", columns[1:], off[rows]))
        by_q += (turned.transpose(0, 2, 1) - by_q @ basis[rows]) @ basis[rows].transpose(0, 2, 1)
        normal = by_q @ by_q.transpose(0, 2, 1)
        trace = np.trace(normal, axis1=1, axis2=2)
        moves = (trace > 1e-200) & (trace < np.inf) & (square[rows] < np.inf)  # else nothing moves the points
        rows, by_q, normal, trace = (part[moves] for part in (rows, by_q, normal, trace))
        if not rows.size:
            break
        scale = (np.einsum("rqq->rq", normal) + 1e-12 * trace[:, None])[:, None, None] * np.eye(q.shape[1])
        right = (by_q @ off[rows, :, None])[:, None]
        change = np.linalg.solve(normal[:, None] + DAMPINGS[:, None, None] * scale, right)[..., 0]
        there = np.clip(q[rows, None] + change, low[rows, None], high[rows, None]).reshape(-1, q.shape[1])
        tried = project(np.repeat(rows, DAMPINGS.size), there)
        squares = (tried[0] ** 2).sum(axis=1)
        best = squares.reshape(rows.size, -1).argmin(axis=1) + np.arange(rows.size) * DAMPINGS.size
        least, before = squares[best], square[rows]
        better = least < before
        taken, best = rows[better], best[better]
        q[taken], square[taken] = there[best], squares[best]
        off[taken], b[taken], basis[taken], back[taken] = (part[best] for part in tried)
        rows = rows[better & (before - least >= 1e-6 * before)]
    by_q, columns = derivatives(np.arange(len(q)))
    jacobian = np.concatenate([by_q.transpose(0, 2, 1), columns[0].transpose(1, 2, 0)], axis=2)
    left = np.array([n - one.numbers for one in laws])[law]
    doubt = np.sqrt(square / left if errors is None else np.ones_like(square))[:, None] * _doubts(jacobian)
    deviance = square
    if errors is None:  # what rounding leaves
        deviance = n * np.log(square / n + (ROUNDING * (1 + abs(wanted).max(axis=1))) ** 2)
    found = []
    for row, one in enumerate(laws[k] for k in law.tolist()):
        own = np.r_[: len(one.q), q.shape[1] : q.shape[1] + one.columns]
        numbers = np.concatenate([q[row], b[row]])[own]
        of_points = jacobian[row][:, own] / root[:, None], off[row] / root, errors, doubt[row, own]
        found.append(Found(one, numbers, *of_points, float(deviance[row]), int(errors is None)))
    return found


def _starts(laws: Sequence[Law], t: Array, z: Array, root: Array, most: int) -> Array:
    """The q (laws times m, most) of a grid that are nearest to lines z (m, n), law by law."""
    own = [one for one in laws if not one.starts_as]
    tries = [np.array(list(itertools.product(*(number.starts for number in one.q)))) for one in own]
    edges = np.cumsum([0, *map(len, tries)])
    q = np.zeros((edges[-1], most))
    for start, some in zip(edges, tries, strict=False):
        q[start : start + len(some), : some.shape[1]] = some
    shift, basis, _ = _linear(own, np.repeat(np.arange(len(own)), np.diff(edges)), q, t, root)
    wanted = (z[:, None] - shift) * root
    square = (wanted**2).sum(axis=2) - (np.einsum("gnk,mgn->mgk", basis, wanted) ** 2).sum(axis=2)
    best = {}
    for one, a, b in zip(own, edges, edges[1:], strict=False):
        best[one.name] = q[a + np.nanargmin(square[:, a:b], axis=1)]
    return np.concatenate([best[one.starts_as or one.name] for one in laws])


def _linear(laws: Sequence[Law], law: NDArray[np.intp], q: Array, t: Array, root: Array) -> tuple[Array, Array, Array]:
    """Of (1) at some q: the shift (r, n), NaN where there is no curve, and Q (r, n, k), R of the weighted columns; of
    those that add nothing to the ones before, 0 and 1."""
    shift, *columns = _curves(laws, law, q, t)[0]
    exist = np.isfinite(shift + sum(columns)).all(axis=1, keepdims=True)
    basis, back = np.linalg.qr(np.moveaxis(np.where(exist, columns, 0.0) * root, 0, -1))
    size = abs(np.diagonal(back, axis1=-2, axis2=-1))
    told = size > 1e-13 * size.max(axis=-1, keepdims=True)
    back = np.where(told[..., :, None] & told[..., None, :], back, np.eye(len(columns)))
    return np.where(exist, shift, np.nan), np.where(told[..., None, :], basis, 0.0), back


def _doubts(columns: Array) -> Array:
    """Standard errors (r, k) of the numbers of columns (r, n, k) beside noise of 1; inf of what is not determined."""
    size = np.sqrt((columns**2).sum(axis=1)) + 1e-300
    _, moved, directions = np.linalg.svd(columns / size[:, None], full_matrices=False)
    seen = (moved > 1e-8 * moved.max(axis=1, keepdims=True))[..., None]
    lost = (np.where(seen, 0.0, directions) ** 2).sum(axis=1) > 1e-6
    change = np.where(seen, directions / np.where(seen, moved[..., None], 1.0), 0.0) / size[:, None]
    return np.where(lost, np.inf, np.sqrt((change**2).sum(axis=1)))


def _curves(laws: Sequence[Law], law: NDArray[np.intp], q: Array, t: Array, derivatives: int = 0) -> Array:
    """Shift and columns (1, 1 + k, r, n) of (1) of shapes: of rows, which rise, each of a law with its q; the rest
    is 0. Behind them as many derivatives by q, likewise."""
    span, edges = float(t[-1] - t[0]), np.searchsorted(law, np.arange(len(laws) + 1))
    found, s = np.zeros((1 + derivatives, 1 + max(one.columns for one in laws), len(q), t.size)), (t - t[0]) / span
    for one, a, b in zip(laws, edges, edges[1:], strict=False):
        if b > a:
            curve = one.curve(q[a:b, : len(one.q)].T[:, :, None], s, span)
            for to, parts in zip(found, curve, strict=False):
                for k, part in enumerate(parts):
                    to[k, a:b] = part
    return found
