"""Laws of the table fitted to points, and what the points tell of each of their numbers.

For given q, the numbers b are a linear least-squares fit (variable projection): a grid over q gives the start, damped
Gauss-Newton steps of q the end. All laws of all lines are fitted at once.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweep.laws.loglog import Array, alike
from sweep.laws.noise import ROUNDING, inliers, regress, shaped
from sweep.laws.shapes import ONE, Law

DAMPINGS = np.array([1e-6, 0.03, 1.0, 30.0])
"""Of Gauss-Newton steps, which are tried at once; the best is taken."""
FURTHER = np.array([2.0, 8.0])
"""Times the step before, which are tried beside them: along a valley, Gauss-Newton steps are short."""
STEPS, ENOUGH = 10, 0.01
"""Steps at most, three times as many of a law that is wanted; and what a step must take away of a deviance for
another one: so much of 0.5 and of what it is above the best, or the cube for a law that is wanted."""
STEP = 1e-6
"""Of q, for derivatives."""
MOST_LINES, MOST_Q, MOST_KEPT = 16, 3, 300
"""Lines that are fitted at once, so that what is held stays below some 50 MB; q of a law at most; and points at most
of which the grid is kept for the next line."""


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
    def criteria(self) -> tuple[float, float]:
        """Akaike's criterion, corrected for few points and inf where they are too few, and Bayes'."""
        numbers, points = self.law.numbers + self.more, self.off.size
        more = 2 * numbers * points / (points - numbers - 1) if points > numbers + 1 else math.inf
        return self.deviance + more, self.deviance + numbers * math.log(points)

    @property
    def aicc(self) -> float:
        return self.criteria[0]

    @property
    def residual(self) -> float:
        """Largest relative distance of a point."""
        return math.expm1(min(float(abs(self.off).max()), 700.0))

    def beside(self, t: Array, noise: str, confidence: float = 0.95) -> tuple[Array, float]:
        """Ends of the intervals of the numbers beside noise of the word (2, k), infinite where the points do not
        determine them; and `aicc` with the noise that suits best, where it is not known."""
        known, aicc = np.flatnonzero(np.isfinite(self.errors)), self.aicc
        ends = np.array([[-np.inf], [np.inf]]) + np.zeros(self.numbers.size)
        if known.size:
            line = regress(t, self.jacobian[:, known], self.off[None], noise, sigma=self.sigma)
            found = line.interval([*range(known.size)], confidence)[:, :, 0]
            found = np.where(np.isnan(found), ends[:, known], found)
            ends[:, known] = self.numbers[known] + np.clip(found, [[-np.inf], [0.0]], [[0.0], [np.inf]])
            if noise != "even" and self.sigma is None:
                aicc = self._replace(deviance=line.deviance[0], more=2).aicc
        return ends, aicc

    def denied(self, t: Array, noise: str) -> bool:
        """Whether the points are not the law and noise; unless that is independent, by polynomials beside the law."""
        if self.sigma is None and noise == "even":
            return bool(shaped(t, self.off))
        more = 0 if self.sigma is not None else 3
        columns = self.jacobian[:, np.isfinite(self.errors)]
        beside = np.polynomial.chebyshev.chebvander(2 * (t - t[0]) / (t[-1] - t[0]) - 1, 1 + more)[:, 2:]
        every = np.concatenate([columns, beside], axis=1)
        return bool(columns.size and regress(t, every, self.off[None], noise, columns.shape[1], self.sigma).denied[0])


def union(
    t: Array,
    own: Found,
    others: Iterable[Found],
    which: list[int],
    noise: str,
    confidence: float,
    as_well: float,
) -> Array:
    """Ends of the intervals of some numbers of a law, and ends that hold those of each of the other laws, too, that the
    points do not rule out beside the best of all: whose AICc is not above it by more than `as_well` (2, 2, k)."""
    every = [one.beside(t, noise, confidence) for one in (own, *others)]
    least = min(aicc for _, aicc in every) + as_well
    first, *rest = (ends[:, which] for k, (ends, aicc) in enumerate(every) if k == 0 or aicc <= least)
    low, high = zip(first, *rest, strict=True)
    return np.array([first, (np.min(low, axis=0), np.max(high, axis=0))])


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(
    laws: Sequence[Law], t: Array, z: Array, errors: Array | None = None, wanted: Law | None = None
) -> list[dict[str, Found]]:
    """For each line of z (m, n) the laws, by name, that are nearest to it, t rising; not those that have not two more
    points than numbers, at more places than numbers. `errors` (m, n) are standard errors, where they are known.

    The law ONE is of the noise that suits it best, where that is not known; points far off count as a number each.
    Laws that are far from the points beside others are not fitted to the last digit, but for that which is `wanted`.
    """
    places = np.unique(t).size
    laws = [law for law in laws if t.size >= law.numbers + 2 and places > law.numbers]
    found: list[dict[str, Found]] = [{} for _ in z]
    most = MOST_LINES if errors is None else 1
    for first in range(0, len(z) if laws else 0, most):
        part = z[first : first + most]
        search = _Search(laws, t, part, None if errors is None else errors[first], wanted)
        moving = np.flatnonzero(search.high[:, 0] > search.low[:, 0])
        for _ in range(STEPS if wanted is None else 3 * STEPS):
            if moving.size:
                moving = search.step(moving)
        search.take_cases()
        for k, one in enumerate(search.found()):
            found[first + k % len(part)][one.law.name] = one
    if ONE in laws and errors is None:
        columns = np.stack([np.ones_like(t), t - t.mean()], axis=1)
        for pattern, rows in alike(inliers(t, columns, z)):
            share = pattern.mean()
            line = regress(t[pattern], columns[pattern], z[rows][:, pattern])
            for row, deviance in zip(rows, line.deviance / share + t.size * math.log(share), strict=True):
                one = found[row][ONE.name]
                other = one._replace(deviance=float(deviance), more=2 + int((~pattern).sum()))
                found[row][ONE.name] = min(one, other, key=lambda fit: fit.aicc)
    return found


class _Search:
    """Rows, laws times lines z (m, n), law by law, each with its q; those that a law does not have are 0 and stay."""

    def __init__(self, laws: Sequence[Law], t: Array, z: Array, errors: Array | None, wanted: Law | None):
        self.laws, self.t, self.errors = laws, t, errors
        self.root = np.ones_like(t) if errors is None else 1 / errors
        self.law, self.z = np.repeat(np.arange(len(laws)), len(z)), np.tile(z, (len(laws), 1))
        limits = np.zeros((2, len(laws), MOST_Q))
        for k, law in enumerate(laws):
            limits[:, k, : len(law.q)] = np.reshape([(one.least, one.most) for one in law.q], (-1, 2)).T
        self.low, self.high = limits[:, self.law]
        self.wanted = np.array([law is wanted for law in laws])[self.law]
        self.rounding = (ROUNDING * (1 + abs(self.z).max(axis=1))) ** 2
        # the nearest of a grid of q
        kept = _grid if t.size <= MOST_KEPT else _grid.__wrapped__
        edges, grid, shift, basis = kept(tuple(laws), t.tobytes(), self.root.tobytes())
        off = z[:, None] * self.root - shift
        square = (off**2).sum(axis=2) - (np.einsum("gnk,mgn->mgk", basis, off) ** 2).sum(axis=2)
        self.q = np.concatenate([grid[a + np.nanargmin(square[:, a:b], axis=1)] for a, b in pairwise(edges)])
        self.before = np.zeros_like(self.q)
        self.square = self._squares(np.arange(len(self.q)), self.q)

    def deviance(self) -> Array:
        """-2 ln likelihood of all rows, but for what they have in common."""
        n = self.t.size
        return self.square if self.errors is not None else n * np.log(self.square / n + self.rounding)

    def _squares(self, rows: NDArray[np.intp], q: Array) -> Array:
        """Weighted sums of squares about the curves of some q; infinite where there is no curve."""
        every, basis, _ = _columns(_curves(self.laws, self.law[rows], q, self.t, self.root))
        off = self.z[rows] * self.root - every[0]
        off = off - (basis @ (off[:, None] @ basis).transpose(0, 2, 1))[..., 0]
        square = (off**2).sum(axis=1)
        return np.where(np.isnan(square), np.inf, square)

    def derivatives(self, rows: NDArray[np.intp]) -> tuple[Array, Array, Array, Array, Array]:
        """Weighted distances (r, n), b (r, k), weighted derivatives by q (r, q, n) at fixed b and columns (k, r, n),
        and an orthonormal basis of these (r, n, k)."""
        q, step = self.q[rows], np.where(self.q[rows] > 0, -STEP, STEP)  # away from the limits
        there = q[:, None] + step[:, None] * np.eye(1 + MOST_Q, MOST_Q, -1)  # q, and each of it changed
        law = np.repeat(self.law[rows], 1 + MOST_Q)
        near = _curves(self.laws, law, there.reshape(-1, MOST_Q), self.t, self.root)
        near = near.reshape(len(near), rows.size, 1 + MOST_Q, self.t.size)
        every, basis, back = _columns(near[:, :, 0].copy())
        off = self.z[rows] * self.root - every[0]
        along = (off[:, None] @ basis).transpose(0, 2, 1)
        b = np.linalg.solve(back, along)[..., 0]
        change = (near[:, :, 1:] - every[:, :, None]) / step[:, :, None]
        by_q = change[0] + np.einsum("krqn,rk->rqn", change[1:], b)
        by_q[~np.isfinite(by_q) | (self.high == self.low)[rows][:, :, None]] = 0.0
        return off - (basis @ along)[..., 0], b, by_q, every[1:], basis

    def step(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Moves the q of rows by a damped Gauss-Newton step; those for which another one is worth it."""
        # derivatives of the distances, which b follows (Kaufman, 1975); q at a limit stay where it holds them
        off, _, by_q, _, basis = self.derivatives(rows)
        by_q -= (by_q @ basis) @ basis.transpose(0, 2, 1)
        right, at = (by_q @ off[..., None])[..., 0], self.q[rows]
        held = ((at <= self.low[rows]) & (right < 0)) | ((at >= self.high[rows]) & (right > 0))
        by_q[held], right[held] = 0.0, 0.0
        normal = by_q @ by_q.transpose(0, 2, 1)
        trace = np.trace(normal, axis1=1, axis2=2)[:, None]
        moves = ((trace > 1e-200) & (trace < np.inf))[:, 0] & (self.square[rows] < np.inf)
        rows, at, right, normal, trace = (part[moves] for part in (rows, at, right, normal, trace))
        if not rows.size:
            return rows
        scale = (np.einsum("rqq->rq", normal) + 1e-12 * trace)[:, None, None] * np.eye(MOST_Q)
        change = np.linalg.solve(normal[:, None] + DAMPINGS[:, None, None] * scale, right[:, None, :, None])[..., 0]
        change = np.concatenate([change, self.before[rows, None] * FURTHER[:, None]], axis=1)
        there = np.clip(at[:, None] + change, self.low[rows, None], self.high[rows, None])
        squares = self._squares(np.repeat(rows, change.shape[1]), there.reshape(-1, MOST_Q)).reshape(rows.size, -1)
        best, before = squares.argmin(axis=1), self.deviance()
        better = squares.min(axis=1) < self.square[rows]
        taken, place = rows[better], (np.flatnonzero(better), best[better])
        self.before[taken] = there[place] - self.q[taken]
        self.q[taken], self.square[taken] = there[place], squares[place]
        after = self.deviance()
        above = after.reshape(len(self.laws), -1) - after.reshape(len(self.laws), -1).min(axis=0)
        enough = np.where(self.wanted, ENOUGH**3, ENOUGH * (0.5 + above.reshape(-1)))
        return np.asarray(rows[(before - after >= enough)[rows]])

    def take_cases(self) -> None:
        """Rows of laws that are further from the points than the law that they have as a case become that."""
        names = [law.name for law in self.laws]
        for name, law in zip(names, self.laws, strict=True):
            if law.case in names:
                own, case = (np.flatnonzero(self.law == names.index(one)) for one in (name, law.case))
                worse = self.square[own] > self.square[case]
                self.q[own[worse]], self.square[own[worse]] = self.q[case[worse]], self.square[case[worse]]

    def found(self) -> list[Found]:
        """Each law of each line."""
        off, b, by_q, columns, _ = self.derivatives(np.arange(len(self.q)))
        jacobian = np.concatenate([by_q.transpose(0, 2, 1), columns.transpose(1, 2, 0)], axis=2)
        numbers, deviance = np.concatenate([self.q, b], axis=1), self.deviance()
        unit = jacobian / (size := np.sqrt((jacobian**2).sum(axis=1, keepdims=True)) + 1e-300)
        inverse = np.linalg.pinv(unit, rcond=1e-8)
        lost = 1 - np.einsum("rkn,rnk->rk", inverse, unit) > 1e-6
        doubt = np.where(lost, np.inf, np.sqrt((inverse**2).sum(axis=2)) / size[:, 0])
        if self.errors is None:
            left = np.array([self.t.size - law.numbers for law in self.laws])[self.law]
            doubt *= np.sqrt(self.square / left)[:, None]
        found = []
        for row, law in enumerate(self.laws[k] for k in self.law.tolist()):
            own = [*range(len(law.q)), *range(MOST_Q, MOST_Q + law.columns)]
            of_points = jacobian[row][:, own] / self.root[:, None], off[row] / self.root, self.errors
            of_law = doubt[row, own], float(deviance[row]), int(self.errors is None)
            found.append(Found(law, numbers[row, own], *of_points, *of_law))
        return found


@functools.lru_cache(4)
def _grid(laws: tuple[Law, ...], t: bytes, root: bytes) -> tuple[Array, Array, Array, Array]:
    """Starts of the q of all laws, law by law: first and past-the-last of each, q, and shift and Q of `_columns`. Lines
    over the same x share them."""
    tries = [np.array(list(product(*(number.starts for number in law.q)))) for law in laws]
    edges = np.cumsum([0, *map(len, tries)])
    grid = np.zeros((edges[-1], MOST_Q))
    for first, some in zip(edges, tries, strict=False):
        grid[first : first + len(some), : some.shape[1]] = some
    places, weights = np.frombuffer(t), np.frombuffer(root)
    every, basis, _ = _columns(_curves(laws, np.repeat(np.arange(len(laws)), np.diff(edges)), grid, places, weights))
    return edges, grid, every[0], basis


def _curves(laws: Sequence[Law], law: NDArray[np.intp], q: Array, t: Array, root: Array) -> Array:
    """Shift and columns of (1), weighted (1 + k, r, n), of rows, which rise, each of a law with its q; what a law does
    not have is 0."""
    span, edges = float(t[-1] - t[0]), np.searchsorted(law, np.arange(len(laws) + 1))
    every, s = np.zeros((1 + max(one.columns for one in laws), len(q), t.size)), (t - t[0]) / span
    for one, a, b in zip(laws, edges, edges[1:], strict=False):
        if b > a:
            for k, part in enumerate(one.curve(q[a:b].T[:, :, None], s, span)):
                every[k, a:b] = part
    every *= root
    return every


def _columns(every: Array) -> tuple[Array, Array, Array]:
    """Curves, and Q (r, n, k) and R of their columns; of those that add nothing to the ones before, and where there is
    no curve and the shift is NaN, 0 and 1."""
    none = ~np.isfinite(every.sum(axis=0)).all(axis=1)
    every[:, none], every[0, none] = 0.0, np.nan
    basis, back = np.linalg.qr(np.moveaxis(every[1:], 0, -1))
    size = abs(np.diagonal(back, axis1=-2, axis2=-1))
    told = size > 1e-13 * size.max(axis=-1, keepdims=True)
    back = np.where(told[..., :, None] & told[..., None, :], back, np.eye(len(every) - 1))
    return every, np.where(told[..., None, :], basis, 0.0), back
