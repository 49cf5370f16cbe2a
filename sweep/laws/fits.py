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


DAMPINGS = np.array([[1e-7, 1e-1, 10.0, 1e3], [1e-7, 1e-2, 1.0, 1e2]])
"""Of Gauss-Newton steps with and without what b takes up; all are tried at once, and the best is taken."""
FURTHER = np.array([1.0, 4.0, 16.0])
"""Times the step before, which are tried beside them: along a valley, Gauss-Newton steps are short."""
STEPS, ENOUGH = 10, 1e-2
"""Steps at most, three times as many of a law that is wanted; and what a step must take away of a deviance for
another one: so much of 1 and of what the deviance is above the best, or the square for a law that is wanted."""
MOST_LINES = 16
"""That are fitted at once, so that what is held stays below some 50 MB."""


@np.errstate(all="ignore")  # what overflows is infinite, and no curve
def fitted(
    laws: Sequence[Law], t: Array, z: Array, errors: Array | None = None, wanted: Law | None = None
) -> list[dict[str, Found]]:
    """For each line of z (m, n) the laws, by name, that are nearest to it, t rising; not those that have not two more
    points than numbers, at more places than numbers. `errors` (m, n) are standard errors, where they are known.

    The law ONE is of the noise that suits it best, where that is not known. Laws that are far from the points beside
    others are not fitted to the last digit, but for that which is `wanted`.
    """
    places = np.unique(t).size
    laws = [law for law in laws if t.size >= law.numbers + 2 and places > law.numbers]
    found: list[dict[str, Found]] = [{} for _ in z]
    most = MOST_LINES if errors is None else 1
    for first in range(0, len(z) if laws else 0, most):
        part = z[first : first + most]
        rows = _Rows(laws, t, part, None if errors is None else errors[first], wanted)
        moving = np.arange(len(rows.q))
        while moving.size:
            for _ in range(STEPS if wanted is None else 3 * STEPS):
                if moving.size:
                    moving = rows.step(moving)
            moving = rows.restarted()
        for k, one in enumerate(rows.found()):
            found[first + k % len(part)][one.law.name] = one
    if ONE in laws and errors is None:
        for line, row in zip(found, z, strict=True):
            one = line[ONE.name]
            line[ONE.name] = min(one, one._replace(deviance=line_deviance(t, row), more=2), key=lambda fit: fit.aicc)
    return found


class _Rows:
    """Laws times lines z (m, n), law by law, each with its q; those that a law does not have are 0 and stay so."""

    def __init__(self, laws: Sequence[Law], t: Array, z: Array, errors: Array | None, wanted: Law | None):
        self.laws, self.t, self.errors = laws, t, errors
        self.root = np.ones_like(t) if errors is None else 1 / errors
        self.law, self.z = np.repeat(np.arange(len(laws)), len(z)), np.tile(z, (len(laws), 1))
        limits = np.zeros((2, len(laws), 3))
        for k, law in enumerate(laws):
            limits[:, k, : len(law.q)] = np.reshape([(one.least, one.most) for one in law.q], (-1, 2)).T
        self.low, self.high = limits[:, self.law]
        self.wanted = np.array([law is wanted for law in laws])[self.law]
        self.rounding = (ROUNDING * (1 + abs(self.z).max(axis=1))) ** 2
        self.q = self._starts(z)
        self.off, self.b, self.basis, self.back = self._project(np.arange(len(self.q)), self.q)
        self.square, self.before = (self.off**2).sum(axis=1), np.zeros_like(self.q)

    def deviance(self, square: Array) -> Array:
        """-2 ln likelihood of all rows, but for what they have in common."""
        n = self.t.size
        return square if self.errors is not None else n * np.log(square / n + self.rounding)

    def _starts(self, z: Array) -> Array:
        """The q of a grid that are nearest to the lines."""
        own = [law for law in self.laws if not law.starts_as]
        tries = [np.array(list(itertools.product(*(number.starts for number in law.q)))) for law in own]
        edges = np.cumsum([0, *map(len, tries)])
        q = np.zeros((edges[-1], 3))
        for start, some in zip(edges, tries, strict=False):
            q[start : start + len(some), : some.shape[1]] = some
        shift, basis, _ = _linear(own, np.repeat(np.arange(len(own)), np.diff(edges)), q, self.t, self.root)
        wanted = (z[:, None] - shift) * self.root
        square = (wanted**2).sum(axis=2) - (np.einsum("gnk,mgn->mgk", basis, wanted) ** 2).sum(axis=2)
        ends = zip(own, edges, edges[1:], strict=False)
        best = {law.name: q[a + np.nanargmin(square[:, a:b], axis=1)] for law, a, b in ends}
        every = [best[law.starts_as or law.name].copy() for law in self.laws]
        for law, start in zip(self.laws, every, strict=True):
            if law.starts_as:
                start[:, len(law.q) - 1] = law.q[-1].starts[0]
        return np.concatenate(every)

    def restarted(self) -> NDArray[np.intp]:
        """Rows of laws that end further from the points than the law that they have as a case: begun there again."""
        names, m = [law.name for law in self.laws], len(self.q) // len(self.laws)
        back = []
        for k, law in enumerate(self.laws):
            if law.starts_as in names:
                case, own = (np.arange(m) + j * m for j in (names.index(law.starts_as), k))
                worse = self.square[own] > self.square[case]
                own, case = own[worse], case[worse]
                for part in (self.q, self.square, self.off, self.b, self.basis, self.back):
                    part[own] = part[case]
                self.before[own] = 0.0
                back.append(own)
        return np.concatenate(back) if back else np.arange(0)

    def _project(self, rows: NDArray[np.intp], q: Array) -> tuple[Array, Array, Array, Array]:
        """Weighted distances (r, n), infinite where there is no curve, b (r, k), and Q, R of the columns."""
        shift, basis, back = _linear(self.laws, self.law[rows], q, self.t, self.root)
        off = (self.z[rows] - shift) * self.root
        along = (off[:, None] @ basis)[:, 0]
        off = off - (basis @ along[..., None])[..., 0]
        b: Array = np.linalg.solve(back, along[..., None])[..., 0].astype(np.float64)
        return np.where(np.isnan(off), np.inf, off), b, basis, back

    def _derivatives(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Of the weighted curves at fixed b (r, q, n) by q, and the columns with theirs (1 + q, k, r, n)."""
        every = _curves(self.laws, self.law[rows], self.q[rows], self.t, self.q.shape[1])
        every = np.nan_to_num(every, posinf=0.0, neginf=0.0) * self.root
        by_q = every[1:, 0] + np.einsum("qkrn,rk->qrn", every[1:, 1:], self.b[rows])
        return by_q.transpose(1, 0, 2), every[:, 1:]

    def step(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Moves the q of rows by a damped Gauss-Newton step; those for which another one is worth it."""
        # derivatives of the distances, which b follows (Golub and Pereyra, 1973), and without this (Kaufman, 1975)
        by_q, columns = self._derivatives(rows)
        back, basis = self.back[rows].transpose(0, 2, 1), self.basis[rows]
        turned = np.linalg.solve(back, np.einsum("qkrn,rn->rkq", columns[1:], self.off[rows]))
        by_q -= (by_q @ basis) @ basis.transpose(0, 2, 1)
        right = (by_q @ self.off[rows, :, None])[..., 0]
        # q at a limit, beyond which the points are nearer, stay there
        at, low, high = self.q[rows], self.low[rows], self.high[rows]
        held = ((at <= low) & (right < 0)) | ((at >= high) & (right > 0))
        by_q, turned = np.where(held[..., None], 0.0, by_q), np.where(held[:, None], 0.0, turned)
        alone = by_q @ by_q.transpose(0, 2, 1)
        normal = np.stack([alone, alone + turned.transpose(0, 2, 1) @ turned], axis=1)
        trace = np.trace(normal, axis1=2, axis2=3)[..., None]
        moves = ((trace > 1e-200) & (trace < np.inf)).all(axis=(1, 2)) & (self.square[rows] < np.inf)
        rows, at, right, normal, trace = (part[moves] for part in (rows, at, np.where(held, 0.0, right), normal, trace))
        if not rows.size:
            return rows
        scale = (np.einsum("rmqq->rmq", normal) + 1e-12 * trace)[:, :, None, None] * np.eye(at.shape[1])
        change = np.linalg.solve(normal[:, :, None] + DAMPINGS[..., None, None] * scale, right[:, None, None, :, None])
        change = change.reshape(rows.size, DAMPINGS.size, -1)
        change = np.concatenate([change, self.before[rows, None] * FURTHER[:, None]], axis=1)
        there = np.clip(at[:, None] + change, self.low[rows, None], self.high[rows, None])
        tries = there.shape[1]
        there = there.reshape(-1, at.shape[1])
        tried = self._project(np.repeat(rows, tries), there)
        squares = (tried[0] ** 2).sum(axis=1)
        best = squares.reshape(rows.size, -1).argmin(axis=1)
        best += np.arange(rows.size) * tries
        least, before = squares[best], self.deviance(self.square)
        better = least < self.square[rows]
        taken, best = rows[better], best[better]
        self.before[taken] = there[best] - self.q[taken]
        self.q[taken], self.square[taken] = there[best], squares[best]
        self.off[taken], self.b[taken], self.basis[taken], self.back[taken] = (part[best] for part in tried)
        after = self.deviance(self.square)
        above = after.reshape(len(self.laws), -1) - after.reshape(len(self.laws), -1).min(axis=0)
        enough = np.where(self.wanted, ENOUGH**2, ENOUGH * (1 + above.reshape(-1)))
        return np.asarray(rows[(before - after >= enough)[rows]])

    def found(self) -> list[Found]:
        """Each law of each line."""
        by_q, columns = self._derivatives(np.arange(len(self.q)))
        jacobian = np.concatenate([by_q.transpose(0, 2, 1), columns[0].transpose(1, 2, 0)], axis=2)
        numbers, doubt = np.concatenate([self.q, self.b], axis=1), _doubts(jacobian)
        deviance = self.deviance(self.square)
        if self.errors is None:
            left = np.array([self.t.size - law.numbers for law in self.laws])[self.law]
            doubt *= np.sqrt(self.square / left)[:, None]
        found = []
        for row, law in enumerate(self.laws[k] for k in self.law.tolist()):
            own = np.r_[: len(law.q), by_q.shape[1] : by_q.shape[1] + law.columns]
            of_points = jacobian[row][:, own] / self.root[:, None], self.off[row] / self.root, self.errors
            of_law = doubt[row, own], float(deviance[row]), int(self.errors is None)
            found.append(Found(law, numbers[row, own], *of_points, *of_law))
        return found


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
    alike = [k for k, one in enumerate(laws) if not k or one.curve is not laws[k - 1].curve]
    for one, a, b in zip(alike, edges[alike], [*edges[alike[1:]], len(q)], strict=True):
        if b > a:
            curve = laws[one].curve(q[a:b].T[:, :, None], s, span)
            for to, parts in zip(found, curve, strict=False):
                for k, part in enumerate(parts):
                    to[k, a:b] = part
    return found
