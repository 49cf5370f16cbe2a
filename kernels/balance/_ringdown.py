"""The ring-down of a balance with viscous and solid friction: its turning points and their number.

    th'' + 2 zeta w th' + w^2 (th +- r) = 0,  + for th' > 0,  r = R/k                                (1)
From rest at a_k (k even: on the side of release) the half swing is free, damped, about +r or -r, and ends at
    a_{k+1} = E a_k - r (1 + E),  E = e^-delta,  delta = pi zeta/sqrt(1 - zeta^2)                    (2)
    a_k = a_0 E^k - r (1 + E) (1 - E^k)/(1 - E),  for zeta = 0: a_0 - 2 k r                          (3)
after pi/(w sqrt(1 - zeta^2)), whatever the friction. The balance rests at the first a_N <= r_s, that is
    N = ceil(ln(1 + (a_0 - r_s)/(r_s + r coth(delta/2)))/delta).                                     (4)
Source: "Theory of Horology", 2-3, (3) and (10), restarted at every turning point; it rests where abs(th) <= r and
not where abs(th +- r) < r, as is printed there.

After N half swings (3) is a difference of terms N times as large, so it is taken in pairs of float64: the count is that
of the inputs as they are given, and (4) only where to begin. Angles are in units of a power of two near r.
A *scene* is the tuple (zeta, r, r_s, a_0), with 0 <= zeta < 1.
"""

import math

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import choose, fma, isnt, magnitude, nearest, some, where
from kernels.maths import pairs
from kernels.maths.elementary import exp, in_unit, log1p, mantissa_exponent, scale

COUNT_LIMIT = 2.0**50
"""Half swings from which on they are only known to 1e-15: 32 digits do not tell two turning points apart."""
RECURSION_LIMIT = 100_000
"""Half swings after which `recursion` gives up."""
GRAZING = 1e-9
"""Margin below which one more swing hangs on the last digits of the input, whatever the count."""
FAINT = 1e-100
"""Damping zeta that changes no turning point before COUNT_LIMIT."""

_CONFIRM_LIMIT = 24
_PAIR_ERROR = 1e-30
_LOST = 1e-300  # what a share E below normal numbers may lose
_TWO_ULP = 2.0**-51
_UNIT_LIMIT = 2.0**900
"""theta0/r beyond which products would leave float64."""


@jit
def in_units(r, r_s, theta0):
    """r, r_s and abs(theta0) in units of 2^e, e, and whether they are not too large there; powers of two are exact."""
    angle = magnitude(theta0)
    _, e = mantissa_exponent(where(r > 0.0, r, where(r_s > 0.0, r_s, where(angle > 0.0, angle, 1.0))))
    release = in_unit(angle, e)
    held = in_unit(r_s, e)
    return in_unit(r, e), held, release, e, (release < _UNIT_LIMIT) & (held < _UNIT_LIMIT)


@jit
def decrement(zeta):
    """delta of (2) and sqrt(1 - zeta^2), as pairs, for 0 <= zeta < 1."""
    high, low = pairs.two_product(zeta, zeta)
    one = 0.0 * zeta + 1.0
    root = pairs.root(pairs.add(pairs.two_sum(one, -high), (-low, 0.0 * low)))
    return pairs.over(pairs.scaled(pairs.PI, zeta), root), root


@jit
def tame(zeta, delta):
    """zeta and delta, 0 where they count for nothing: products of their parts would be no normal numbers."""
    felt = zeta > FAINT
    return where(felt, zeta, 0.0), (where(felt, delta[0], 0.0), where(felt, delta[1], 0.0))


@jit_call
def turning_point(zeta, delta, share, r, start, k):
    """a_k of (3), as a pair, and its first term a_0 E^k; `zeta` and `delta` are tame, `share` is of `share_kept`."""
    _, lost = share
    q, n = pairs.exponential(pairs.negative(pairs.scaled(delta, k)))
    kept = pairs.scaled(pairs.shifted(q, 1.0), start)
    kept = scale(kept[0], n), scale(kept[1], n)
    smooth = isnt(zeta > FAINT)
    ratio = pairs.over(pairs.missing(q, n), choose(smooth, (1.0, 0.0), lost))
    ratio = choose(smooth, (k, 0.0 * k), ratio)
    friction = pairs.scaled(pairs.times(_both(share), ratio), r)
    return pairs.add(kept, pairs.negative(friction)), kept[0]


@jit
def share_kept(delta):
    """E and 1 - E, each a pair with its own digits."""
    q, n = pairs.exponential(pairs.negative(delta))
    return pairs.whole(q, n), pairs.missing(q, n)


@jit
def _both(share):
    """1 + E."""
    return pairs.shifted(share[0], 1.0)


@jit
def next_turning_point(share, r, a):
    """a_{k+1} of (2), as a pair."""
    return pairs.add(pairs.times(share[0], a), pairs.negative(pairs.scaled(_both(share), r)))


@jit
def count_by_formula(scene, delta, lost):
    """(4) without its ceil, within 4e-15; a number above 0 where a_0 > r_s."""
    _, r, r_s, start = scene
    coth = where(delta > FAINT, delta * (2.0 - lost) / where(delta > FAINT, lost, 1.0), 2.0)  # delta coth(delta/2)
    below = fma(r, coth, delta * r_s)
    high = where(delta > 1.0, delta, 1.0)
    x = (delta / high) * (start - r_s) / (below / high)
    small = x < 1e-17
    return where(small, (start - r_s) / below, log1p(x) / where(small, 1.0, delta))


@jit
def _whole(x):
    """The least integer from x on, for x >= 0; above 2^50 a nearest one."""
    big = x >= COUNT_LIMIT
    n = nearest(where(big, 0.0, x))
    n = where(n < x, n + 1.0, n)
    return where(big, where(x < 2.0**52, (x + 2.0**52) - 2.0**52, x), n)


@jit_call
def closed(scene):
    """The count by (4), confirmed by the turning points on both sides of it.

    Returns
    -------
    count, last, margin : half swings, a_N, and the least abs(a_k - r_s)/r_s
    grazes : whether the count hangs on the last digits of the inputs
    doubt : error of a_N
    unsure : whether the count is not confirmed
    """
    zeta, r, r_s, start = scene
    moves = start > r_s
    delta, root = decrement(zeta)
    share = share_kept(delta)
    guess = count_by_formula(scene, delta[0], share[1][0])
    guess = where(moves, guess, 0.0)
    countless = isnt(guess < COUNT_LIMIT)
    k = _whole(where(countless, 0.0, guess * (1.0 - 4e-15) - 1e-6)) - 1.0
    k = where(k > 0.0, k, 0.0)
    above, kept = turning_point(*tame(zeta, delta), share, r, start, k)
    sure = above[0] - r_s + above[1] > 0.0
    below = next_turning_point(share, r, above)
    active = moves & isnt(countless) & _exceeds(below, r_s)
    k = k + 1.0
    for _ in range(_CONFIRM_LIMIT):
        if not some(active):
            break
        above = choose(active, below, above)
        below = choose(active, next_turning_point(share, r, above), below)
        k = where(active, k + 1.0, k)
        active = active & _exceeds(below, r_s)
    last = where(moves, where(countless, math.nan, below[0]), start)
    over, under = pairs.shifted(above, -r_s)[0], where(moves, -pairs.shifted(below, -r_s)[0], r_s - start)
    steep = 1.0 / (root[0] * root[0])
    drift = 2.0 * share[0][0] * where(zeta > FAINT, delta[0] / where(zeta > FAINT, share[1][0], 1.0), 1.0)
    blur = _blur(steep, drift, delta[0], below[0], share[0][0] * kept, k)
    blur_above = _blur(steep, drift, delta[0], above[0], kept, k)
    blur_above = where(k > 1.0, blur_above, _TWO_ULP * start)
    margin, grazes = _margin(
        over,
        under,
        where(moves, blur_above + _TWO_ULP * r_s, 0.0),
        where(moves, blur + _TWO_ULP * r_s, 0.0),
        r_s,
        moves,
    )
    count = where(moves, where(countless, _whole(guess), k), 0.0)
    doubt = where(moves & (zeta > FAINT), fma(_PAIR_ERROR / _TWO_ULP, blur, _LOST), 0.0)
    unsure = moves & isnt(countless) & (active | isnt(sure))
    return count, last, where(countless, 0.0, margin), grazes | countless, doubt, unsure


@jit
def _exceeds(pair, number):
    return pairs.shifted(pair, -number)[0] > 0.0


@jit
def _margin(over, under, over_error, under_error, r_s, moves):
    """The least distance from r_s, over r_s, and whether one of the distances is no more than its error or 1e-9."""
    grazes = isnt(under > GRAZING * r_s) | isnt(under > under_error)
    grazes = grazes | (moves & (isnt(over > GRAZING * r_s) | isnt(over > over_error)))
    return where(moves & (over < under), over, under) / unit(r_s), grazes


@jit
def unit(r_s):
    """What margins are relative to; without solid friction there is nothing to divide by."""
    return where(r_s > 0.0, r_s, 1.0)


@jit
def _blur(steep, drift, delta, a, kept, k):
    """What two units in the last place of a_0, r and zeta are worth in a_k.

    da/dln a_0 = a_0 E^k, da/dln r = -r (1 + E)(1 - E^k)/(1 - E), and ln zeta counts through ln delta, `steep` times:
    k delta-fold in the first, at most `drift`-fold in the second.
    """
    friction = magnitude(kept - a)
    return _TWO_ULP * (kept * fma(k * delta, steep, 1.0) + friction * fma(drift, steep, 1.0))


@jit_call
def recursion(scene):
    """The count by following (2) in float64, with the error that its rounding has come to; returns as `closed`."""
    zeta, r, r_s, start = scene
    delta, _ = decrement(zeta)
    share = exp(-delta[0])
    loss = r * (1.0 + share)
    a, before, count, error, error_before = start, start, 0.0 * start, 0.0 * start, 0.0 * start
    rounding = 2.3e-16 * (1.0 + delta[0])  # of `share`
    active = (a > r_s) & (r_s > 0.0)  # r_s = 0: it never ends
    for _ in range(RECURSION_LIMIT):
        if not some(active):
            break
        new = fma(share, a, -loss)
        more = fma(share, error, fma(rounding, share * a, 4e-16 * loss)) + 1.2e-16 * magnitude(new)
        more = more + _LOST
        before, error_before = where(active, a, before), where(active, error, error_before)
        a, error = where(active, new, a), where(active, more, error)
        count = where(active, count + 1.0, count)
        active = active & (a > r_s)
    moved = count > 0.0
    margin, grazes = _margin(before - r_s, r_s - a, error_before + 2.3e-16 * r_s, error + 2.3e-16 * r_s, r_s, moved)
    return count, a, margin, grazes, where(moved, error, 0.0), active
