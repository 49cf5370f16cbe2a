"""Fits laws of the table to points, with the uncertainty of each parameter.

For given q, the parameters b follow from linear least squares (variable projection). A grid over q gives initial
values, which damped Gauss-Newton steps improve. All laws of all lines are fitted together.
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
from sweep.laws.noise import ROUNDING, apart, inliers, regress
from sweep.laws.shapes import ONE, Law

DAMPINGS = np.array([1e-6, 0.03, 1.0, 30.0])
"""Damping factors of Gauss-Newton steps, tried together; the best is taken."""
STEPS, ENOUGH = 30, 0.01
"""Steps at most; and what a step must take away of a deviance for another one: so much of what it is above the best,
and the square."""
MOST_LINES, MOST_Q, MOST_POINTS = 16, 3, 300
"""Lines that are fitted at once, so that what is held stays below some 50 MB; q of a law at most; and from so many
points on the starts are chosen by every second point alone, from twice as many on by every third, and so on."""


class Fit(NamedTuple):
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
    apart: bool
    """Whether the distances are more than rounding."""
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

    @np.errstate(all="ignore")  # what overflows is infinite
    def beside(
        self, t: Array, noise: str, confidence: float = 0.95, more: Array | None = None
    ) -> tuple[Array, float, bool]:
        """Beside noise of the word: ends of the intervals of the numbers (2, k), infinite where the points do not
        determine them; `aicc` with the noise that suits best, where it is not known; and whether the points deny the
        law, as columns `more` (n, j) tell too much, or as `regress` says."""
        determined, ends = np.isfinite(self.errors), np.array([[-np.inf], [np.inf]]) + np.zeros(self.numbers.size)
        if not (k := int(determined.sum())):
            return ends, self.aicc, False
        columns = np.column_stack([part for part in (self.jacobian[:, determined], more) if part is not None])
        line = regress(t, columns, self.off[None], noise, k, self.sigma)
        reach = np.clip(line.interval([*range(k)], confidence)[:, :, 0], [[-np.inf], [0.0]], [[0.0], [np.inf]])
        ends[:, determined] = np.where(np.isnan(reach), ends[:, determined], self.numbers[determined] + reach)
        best = self if noise == "even" or self.sigma is not None else self._replace(deviance=line.deviance[0], more=2)
        return ends, best.aicc, self.apart and bool(line.denied[0])


def union(
    t: Array, own: Fit, others: Iterable[Fit], which: list[int], noise: str, confidence: float, as_well: float
) -> Array:
    """Ends of the intervals of some numbers of a law, and ends that hold those of each of the other laws, too, that the
    points do not rule out beside the best of all: whose AICc is not above it by more than `as_well` (2, 2, k)."""
    ends, aicc, _ = zip(*(one.beside(t, noise, confidence) for one in (own, *others)), strict=True)
    alive = [one[:, which] for one, by in zip(ends, aicc, strict=True) if one is ends[0] or by <= min(aicc) + as_well]
    return np.array([alive[0], (np.min(alive, axis=0)[0], np.max(alive, axis=0)[1])])


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(laws: Sequence[Law], t: Array, z: Array, errors: Array | None = None) -> list[dict[str, Fit]]:
    """For each line of z (m, n) the laws, by name, that are nearest to it, t rising; not those that have not two more
    points than numbers, at more places than numbers. `errors` (m, n) are standard errors, where they are known.

    The law ONE is of the noise that suits it best, where that is not known; points far off count as a number each.
    Laws that are far from the points beside others are not fitted to the last digit.
    """
    places, most = np.unique(t).size, MOST_LINES if errors is None else 1
    laws = [law for law in laws if t.size >= law.numbers + 2 and places > law.numbers]
    fits: list[dict[str, Fit]] = [{} for _ in z]
    for first in range(0, len(z) if laws else 0, most):
        search = _Search(laws, t, z[first : first + most], None if errors is None else errors[first])
        for k, one in enumerate(search.fits()):
            fits[first + k % search.lines][one.law.name] = one
    if ONE in laws and errors is None:
        columns = np.stack([np.ones_like(t), t - t.mean()], axis=1)
        for pattern, rows in alike(inliers(t, columns, z)):
            share, line = pattern.mean(), regress(t[pattern], columns[pattern], z[rows][:, pattern])
            for row, deviance in zip(rows, line.deviance / share + t.size * math.log(share), strict=True):
                one = fits[row][ONE.name]
                other = one._replace(deviance=float(deviance), more=2 + int((~pattern).sum()))
                fits[row][ONE.name] = min(one, other, key=lambda fit: fit.aicc)
    return fits


class _Search:
    """Rows, laws times lines z (m, n), law by law, each with its q; those that a law does not have are 0 and stay."""

    def __init__(self, laws: Sequence[Law], t: Array, z: Array, errors: Array | None):
        self.laws, self.lines, self.t, self.errors = laws, len(z), t, errors
        self.root = np.ones_like(t) if errors is None else 1 / errors
        self.law, self.z = np.repeat(np.arange(len(laws)), len(z)), np.tile(z * self.root, (len(laws), 1))
        limits = np.zeros((2, len(laws), MOST_Q))
        for k, law in enumerate(laws):
            limits[:, k, : len(law.q)] = np.reshape([(one.least, one.most) for one in law.q], (-1, 2)).T
        self.low, self.high = limits[:, self.law]
        self.rounding = np.tile((ROUNDING * (1 + abs(z).max(axis=1))) ** 2, len(laws))
        # the nearest of a grid of q
        some = slice(None, None, 1 + t.size // MOST_POINTS)
        edges, grid, shift, basis = _grid(tuple(laws), t[some].tobytes(), self.root[some].tobytes())
        off = (z * self.root)[:, None, some] - shift
        square = (off**2).sum(axis=2) - (np.einsum("gnk,mgn->mgk", basis, off) ** 2).sum(axis=2)
        self.q = np.concatenate([grid[a + np.nanargmin(square[:, a:b], axis=1)] for a, b in pairwise(edges)])
        self.square = self.squares(np.arange(len(self.q)), self.q)

    def deviance(self) -> Array:
        """-2 ln likelihood of all rows, but for what they have in common."""
        n = self.t.size
        return self.square if self.errors is not None else n * np.log(self.square / n + self.rounding)

    def squares(self, rows: NDArray[np.intp], q: Array) -> Array:
        """Weighted sums of squares about the curves of some q; infinite where there is no curve."""
        every, basis, _ = _columns(_curves(self.laws, self.law[rows], q, self.t, self.root))
        off = self.z[rows] - every[0]
        off -= (basis @ (off[:, None] @ basis).transpose(0, 2, 1))[..., 0]
        square = (off**2).sum(axis=1)
        return np.where(np.isnan(square), np.inf, square)

    def derivatives(self, rows: NDArray[np.intp]) -> tuple[Array, Array, Array, Array, Array]:
        """Weighted distances (r, n), b (r, k), weighted derivatives by q (r, q, n) at fixed b and columns (k, r, n),
        and an orthonormal basis of these (r, n, k)."""
        q, step = self.q[rows], np.where(self.q[rows] > 0, -1e-6, 1e-6)  # away from the limits
        there = q[:, None] + step[:, None] * np.eye(1 + MOST_Q, MOST_Q, -1)  # q, and each of it changed
        law = np.repeat(self.law[rows], 1 + MOST_Q)
        near = _curves(self.laws, law, there.reshape(-1, MOST_Q), self.t, self.root)
        near = near.reshape(len(near), rows.size, 1 + MOST_Q, self.t.size)
        every, basis, back = _columns(near[:, :, 0].copy())
        off = self.z[rows] - every[0]
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
        scale = np.einsum("rqq->rq", normal) + 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None] + 1e-200
        damped = normal[:, None] + DAMPINGS[:, None, None] * scale[:, None, None] * np.eye(MOST_Q)
        change = np.linalg.solve(damped, right[:, None, :, None])[..., 0]
        there = np.clip(at[:, None] + change, self.low[rows, None], self.high[rows, None])
        squares = self.squares(np.repeat(rows, DAMPINGS.size), there.reshape(-1, MOST_Q)).reshape(rows.size, -1)
        best, before = squares.argmin(axis=1), self.deviance()
        better = squares.min(axis=1) < self.square[rows]
        place = np.flatnonzero(better), best[better]
        self.q[rows[better]], self.square[rows[better]] = there[place], squares[place]
        after = self.deviance()
        above = after.reshape(-1, self.lines) - after.reshape(-1, self.lines).min(axis=0)
        return np.asarray(rows[(before - after >= ENOUGH**2 + ENOUGH * above.reshape(-1))[rows]])

    def fits(self) -> list[Fit]:
        """Each law of each line, at the end of all steps."""
        moving = np.flatnonzero(self.high[:, 0] > self.low[:, 0])
        for _ in range(STEPS):
            if moving.size:
                moving = self.step(moving)
        # a law that is further from the points than one that it has as a case becomes that
        names = [law.name for law in self.laws]
        for k, law in enumerate(self.laws):
            if law.case in names:
                own, case = (np.flatnonzero(self.law == one) for one in (k, names.index(law.case)))
                worse = self.square[own] > self.square[case]
                self.q[own[worse]], self.square[own[worse]] = self.q[case[worse]], self.square[case[worse]]
        off, b, by_q, columns, _ = self.derivatives(np.arange(len(self.q)))
        jacobian = np.concatenate([by_q.transpose(0, 2, 1), columns.transpose(1, 2, 0)], axis=2)
        numbers, unit = np.concatenate([self.q, b], axis=1), np.sqrt((jacobian**2).sum(axis=1, keepdims=True)) + 1e-300
        inverse = np.linalg.pinv(jacobian / unit, rcond=1e-8)
        lost = 1 - np.einsum("rkn,rnk->rk", inverse, jacobian / unit) > 1e-6
        doubt = np.where(lost, np.inf, np.sqrt((inverse**2).sum(axis=2)) / unit[:, 0])
        every, deviance = [], self.deviance().tolist()
        clear = apart(self.t, self.z / self.root, off / self.root).tolist()
        for row, law in enumerate(self.laws[k] for k in self.law.tolist()):
            which = [*range(len(law.q)), *range(MOST_Q, MOST_Q + law.columns)]
            size = 1.0 if self.errors is not None else math.sqrt(self.square[row] / (self.t.size - law.numbers))
            curve = jacobian[row][:, which] / self.root[:, None], off[row] / self.root, self.errors
            errors, more = size * doubt[row, which], int(self.errors is None)
            every.append(Fit(law, numbers[row, which], *curve, errors, deviance[row], clear[row], more))
        return every


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
    independent = size > 1e-13 * size.max(axis=-1, keepdims=True)
    back = np.where(independent[..., :, None] & independent[..., None, :], back, np.eye(len(every) - 1))
    return every, np.where(independent[..., None, :], basis, 0.0), back
