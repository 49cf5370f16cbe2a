"""Linear regression with noise of unknown kind, and the size of that noise.

    z = X b + s(t) e,   e_i = phi e_(i-1) + sqrt(1 - phi^2) new_i,   ln s = a u + c |u|,   -1 <= u <= 1     (1)

s is the size of the noise along the window, which may grow towards one end (a) or both (c). phi, a and c are averaged
over, each (phi, a, c) of a grid weighted by its restricted likelihood: estimates from few points are inaccurate, and
intervals that rely on them have a coverage of 60 to 85 % instead of 95. Outliers are left out.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import fdtrc, gammaincc, stdtrit

from sweep.laws.loglog import EPSILON, Array, alike, barycentric

CORRELATIONS = np.array([-0.2, 0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.96])
SHAPES = np.array([*itertools.product(np.linspace(-1.6, 1.6, 5), (0.0, 1.6, 3.2))])
"""phi, and a with c of (1), that are tried; exp(2 * 1.6) is a ratio of 25 between the sizes at both ends."""
ALONE, EVEN = np.zeros(1), np.zeros((1, 2))

NOISES = {
    "noise": (CORRELATIONS, SHAPES),
    "even": (ALONE, EVEN),
    "uneven": (ALONE, SHAPES),
    "correlated": (CORRELATIONS, EVEN),
    "outliers": (ALONE, EVEN),
}
"""Kinds of noise by the user's word; "noise" is any."""
Noise = bool | str | None
"""A user's statement about noise: whether there is any, its kind, or None."""

BEYOND_DOUBT = 10.0
"""Difference of AICc from which on a law is taken instead of a simpler one."""
RARE = 1e-3
"""Probability below which a test denies, where the noise is known or independent,"""
UNLIKELY = 0.01
"""and where it may be of any kind."""
ROUNDING = 16 * EPSILON
"""Relative deviation of a point from a curve that counts as rounding."""
SMOOTH = 0.12
"""Share of noise in the residuals of a line below which they are curvature, not noise."""


class Regression(NamedTuple):
    """Least squares of lines (m,) on k columns under each phi of the grid (p,), over all a and c."""

    weight: Array  # of each phi (p, m), of sum 1
    value: Array  # the numbers (p, k, m)
    error: Array  # and their standard errors (p, k, m)
    size: Array  # of the noise at each point (m, n), up to a factor
    left: int  # degrees of freedom
    deviance: Array  # -2 ln likelihood (m,), of the noise that suits best, less n ln 2 pi e; rounding is no distance
    denied: NDArray[np.bool_]  # whether the points are not the columns and noise (m,)

    def mean(self) -> tuple[Array, Array]:
        """The numbers and their standard errors, (m, k) each."""
        middle = np.einsum("pm,pkm->km", self.weight, self.value)
        square = np.einsum("pm,pkm->km", self.weight, self.error**2 + (self.value - middle) ** 2)
        return middle.T, np.sqrt(square).T

    def interval(self, numbers: list[int], confidence: float) -> Array:
        """Ends of the intervals of some numbers (2, k, m).

        Each holds the values that are denser, in the mixture of Student's t of all phi, than the ends of the intervals
        of each phi alone are on average. Of all intervals that hold as often beside correlated noise, such are the
        narrowest beside independent noise (Pratt, 1961).
        """
        value, error = self.value[:, numbers], self.error[:, numbers] + 1e-300
        reach, sides = float(stdtrit(self.left, (1 + confidence) / 2)), np.array([-1.0, 1.0])[:, None, None]
        if len(value) == 1:
            return value + sides * reach * error
        height, power = self.weight[:, None] / error, -0.5 * (self.left + 1)
        level = height.sum(axis=0) * (1 + reach**2 / self.left) ** power
        best = np.take_along_axis(value, height.argmax(axis=0)[None], axis=0)[0]

        def dense(reached: Array) -> NDArray[np.bool_]:
            """Whether values so far below and above the densest noise's own (2, k, m) are above the level."""
            off = ((best + sides * reached)[:, None] - value) / error
            return np.asarray((height * (1 + off**2 / self.left) ** power).sum(axis=1) > level)

        inside = np.zeros((2, *best.shape))
        outside = inside + np.ptp(value, axis=0) + error.max(axis=0)
        while (further := dense(outside)).any():
            outside = np.where(further, 2 * outside, outside)
        for _ in range(26):
            middle = (inside + outside) / 2
            further = dense(middle)
            inside, outside = np.where(further, middle, inside), np.where(further, outside, middle)
        return np.asarray(best + sides * inside)


def regress(
    t: Array, columns: Array, z: Array, noise: str = "noise", used: int | None = None, sigma: Array | None = None
) -> Regression:
    """Lines z (m, n) on the first `used` of the columns (n, k), under each noise of the word.

    `sigma` (n,) says all of the noise, where it is known. Points are denied by chi-squared of known noise; by columns
    behind those that are used, which tell too much for chance; without such, of independent noise, if it is `shaped`.
    """
    if sigma is not None:
        noise, columns, z = "even", columns / sigma[:, None], z / sigma
    phi, shapes = NOISES[noise]
    (n, k), own = columns.shape, -np.log1p(-(phi[:, None, None] ** 2))
    used = k if used is None else used
    left = n - used
    basis, back = np.linalg.qr(columns)
    start = basis.T @ z.T
    off = z.T - basis[:, :used] @ start[:used]
    scale = abs(off).max(axis=0) + 1e-300
    u = 2 * (t - t[0]) / (t[-1] - t[0]) - 1
    log_size = shapes @ np.stack([u, abs(u)])
    log_size -= log_size.mean(axis=1, keepdims=True)
    factor, solved, squares = _sums(phi, *(np.exp(-log_size)[:, :, None] * part for part in (basis, off / scale)))
    of_shape, (flat, cautious) = 0.5 * (own + (shapes**2).sum(axis=1)[:, None] / 1.6**2), _priors(noise, n)

    def weights(count: int, prior: Array) -> Array:
        """Of each noise, by a prior of phi and the restricted likelihood on so many columns."""
        determinant = np.log(np.einsum("pskk->psk", factor[:, :, :count, :count])).sum(axis=2)[:, :, None]
        log = prior[:, None, None] - of_shape - determinant - 0.5 * (n - count) * np.log(squares[:, :, count - 1])
        likely = np.exp(log - log.max(axis=(0, 1)))
        return np.asarray(likely / likely.sum(axis=(0, 1)))

    if k > used:
        ratio = squares[:, :, used - 1] / squares[:, :, k - 1] - 1
        beyond = fdtrc(k - used, n - k, ratio * (n - k) / (k - used))
        denied = (weights(k, flat) * beyond).sum(axis=(0, 1)) < UNLIKELY
    else:
        denied = shaped(t, off.T) if noise == "even" else np.zeros(len(z), bool)
    # the numbers of each noise, and their mixture over sizes a, c
    square, turn = squares[:, :, used - 1] * scale**2, np.linalg.inv(back[:used, :used])
    inside = turn @ np.linalg.inv(factor[:, :, :used, :used]).transpose(0, 1, 3, 2)
    value = inside @ solved[:, :, :used] * scale + turn @ start[:used]
    of_point = square / max(left, 1) if sigma is None else np.ones_like(square)
    variance = (inside**2).sum(axis=3)[..., None] * of_point[:, :, None]
    weight = weights(used, cautious)
    of_phi = weight.sum(axis=1)
    part = weight / np.maximum(of_phi, 1e-300)[:, None]
    middle = np.einsum("psm,pskm->pkm", part, value)
    error = np.sqrt(np.einsum("psm,pskm->pkm", part, variance + (value - middle[:, None]) ** 2))
    size = 1 / np.einsum("psm,sn->mn", weight, np.exp(-log_size))
    rounding = (ROUNDING * (1 + abs(z).max(axis=1))) ** 2
    deviance = (n * np.log(square / n + rounding) + own).min(axis=(0, 1))
    if sigma is not None:
        deviance = square[0, 0]
        denied |= gammaincc(left / 2, deviance / 2) < RARE
        left = 10**7  # of a normal distribution
    return Regression(of_phi, middle, error, size, left, deviance, denied)


def _sums(phi: Array, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Least squares of y (s, n, m) on x (s, n, k), each s a size of the noise, under each phi: the Cholesky factor
    (p, s, k, k), products with its columns (p, s, k, m), and sums of squares on the first, two ... columns likewise.

    Sums over points are of three kinds alone: over all, over the first and the last, over pairs of neighbours. So phi
    costs no sums, and the columns before any are those of the Cholesky factor before it.
    """

    def products(a: Array, b: Array) -> Array:
        over, both, by_phi = a.transpose(0, 2, 1), [0, -1], phi[:, None, None, None]
        pairs, whole = over[:, :, 1:] @ b[:, :-1] + over[:, :, :-1] @ b[:, 1:], over @ b
        return np.asarray(whole + by_phi**2 * (whole - over[:, :, both] @ b[:, both]) - by_phi * pairs)

    factor = np.linalg.cholesky(products(x, x))
    solved = np.linalg.solve(factor, products(x, y))
    whole, outer, pairs = (y**2).sum(axis=1), y[:, 0] ** 2 + y[:, -1] ** 2, 2 * (y[:, 1:] * y[:, :-1]).sum(axis=1)
    square = whole + phi[:, None, None] ** 2 * (whole - outer) - phi[:, None, None] * pairs
    squares = np.maximum(square[:, :, None] - np.cumsum(solved**2, axis=2), 1e-28)
    return np.asarray(factor), np.asarray(solved), np.asarray(squares)


@functools.lru_cache
def _priors(noise: str, points: int) -> tuple[Array, Array]:
    """Logarithms of weights of phi: flat, and cautious, for intervals. Those give independent noise a part of its own,
    and much weight to correlations near 1, which few points cannot tell from a slope; by trial at 8 to 200 points, so
    that intervals hold 93.5 % beside AR(1) of 0.9 and are at most 1.3 times as wide as the narrowest single rule's."""
    if (phi := NOISES[noise][0]).size == 1:
        return np.zeros(1), np.zeros(1)
    flat, alone = np.gradient(phi), min(0.15, 1.1 / points)
    cautious = flat * (1 - phi) ** -(1.7 + 4.5 / points)
    return np.log(flat), np.log(cautious / cautious.sum() * (1 - alone) + alone * (phi == 0))


def inliers(t: Array, columns: Array, z: Array) -> NDArray[np.bool_]:
    """Points of lines z (m, n) within 3.5 times the size of the noise about what is fitted to the others."""
    inside, todo = np.ones(z.shape, dtype=bool), np.arange(len(z))
    for _ in range(3):
        changed = np.zeros(len(z), dtype=bool)
        for pattern, which in alike(inside[todo]):
            rows = todo[which]
            line = regress(t[pattern], columns[pattern], z[rows][:, pattern])
            off = abs(z[rows] - line.mean()[0] @ columns.T)
            off /= np.stack([np.interp(t, t[pattern], size) for size in line.size])
            size = np.quantile(off[:, pattern], 0.8, axis=1, keepdims=True) / 1.2816  # a fifth may be anything
            near = off <= 3.5 * size
            other = (near != inside[rows]).any(axis=1) & (near.sum(axis=1) >= max(4, 0.7 * t.size))
            inside[rows[other]], changed[rows[other]] = near[other], True
        todo = np.flatnonzero(changed)
    return inside


def roughness(t: Array, z: Array) -> tuple[Array, Array]:
    """Size of the noise on smooth curves (..., n) without gaps, t rising, and its share of them: 1 where neighbours say
    nothing of each other. Of repeated t the noise is that within repetitions.

    How far points are off the polynomials through two, four, six and eight neighbours, and how far they would be if all
    were noise: noise leaves the same in all, a bend ever less.
    """
    places, which, count = np.unique(t, return_inverse=True, return_counts=True)
    if places.size < t.size:
        off = z - ((z @ np.eye(places.size)[which]) / count)[..., which]
        pairs = [(off * math.sqrt(t.size / (t.size - places.size)), z)]
    else:
        pairs = []
        for neighbours in (k for k in (2, 4, 6, 8) if t.size > k + 2):
            weights = barycentric(sliding_window_view(t, neighbours + 1))
            near = sliding_window_view(z, neighbours + 1, axis=-1)
            parts = weights / np.sqrt((weights**2).sum(axis=1, keepdims=True)) * near
            pairs.append((parts.sum(axis=-1), np.sqrt((parts**2).sum(axis=-1))))
    if not pairs:
        return np.full(z.shape[:-1], np.inf), np.full(z.shape[:-1], np.inf)
    size, alone = (np.sqrt([np.mean(part**2, axis=-1) for part in parts]) for parts in zip(*pairs, strict=True))
    return size.min(axis=0), (size / np.maximum(alone, 1e-300)).min(axis=0)


def shaped(t: Array, off: Array) -> NDArray[np.bool_]:
    """Whether distances (..., n), t rising, are no independent noise: neighbours say more of each other than they do in
    all but 0.1 % of it, by trial at 12 to 200 points."""
    return np.asarray(roughness(t, off)[1] < 1 - 3.4 / math.sqrt(t.size))


def scatters(t: Array, z: Array, off: Array, numbers: int, noise: Noise) -> NDArray[np.bool_]:
    """Whether the distances of lines z (m, n) from a law of so many numbers are noise: above rounding; and as is said,
    else as neighbours say less of each other than they do of a smooth curve. About few points of such a curve a law of
    many numbers swings as noise does."""
    scattered = apart(t, z, off)
    if noise is not None:
        return np.asarray(scattered & bool(noise))
    return np.asarray(scattered & (roughness(t, off)[1] > SMOOTH + (5 * (numbers - 2) ** 2 / (3 * t.size)) ** 4))


def apart(t: Array, z: Array, off: Array) -> NDArray[np.bool_]:
    """Whether the distances of lines z (..., n) from a law are more than rounding."""
    return np.asarray(np.sqrt(np.mean(off**2, axis=-1)) > 8 * rounding(t, z))


def rounding(t: Array, z: Array) -> Array:
    """What rounding of both coordinates leaves of lines (..., n)."""
    slope = abs(z[..., -1] - z[..., 0]) / abs(t[-1] - t[0])
    return np.asarray(EPSILON * (1.0 + abs(z).max(axis=-1) + slope * abs(t).max()))
