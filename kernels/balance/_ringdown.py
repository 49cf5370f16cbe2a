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
"""

import math
from typing import NamedTuple

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, nearest, not_, where
from kernels.maths import pairs
from kernels.maths.elementary import in_unit, log1p, mantissa_exponent, scale

COUNT_LIMIT = 2.0**50
"""Half swings from which on they are only known to 1e-15: 32 digits do not tell two turning points apart."""
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


class Scene(NamedTuple):
    """A balance in units of angle, zeta < 1."""

    zeta: float
    r: float
    r_s: float
    start: float


class Decay(NamedTuple):
    """delta of (2), sqrt(1 - zeta^2), E and 1 - E, each a pair with its own digits."""

    delta: tuple
    root: tuple
    kept: tuple
    lost: tuple


class Rest(NamedTuple):
    """Half swings until rest, a_N, the least abs(a_k - r_s)/r_s, and what is known of them.

    `grazes`: whether the count hangs on the last digits of the inputs; `doubt`: error of a_N; `unsure`: whether the
    count is not confirmed.
    """

    count: float
    last: float
    margin: float
    grazes: bool
    doubt: float
    unsure: bool


@jit
def in_units(p):
    """The scene in units of 2^e, e, and whether it is not too large there; powers of two are exact.

    Its damping is a tame one where it is overdamped and nothing is counted.
    """
    angle = magnitude(p.theta0)
    _, e = mantissa_exponent(where(p.r > 0.0, p.r, where(p.r_s > 0.0, p.r_s, where(angle > 0.0, angle, 1.0))))
    scene = Scene(where(p.zeta < 1.0, p.zeta, 0.5), in_unit(p.r, e), in_unit(p.r_s, e), in_unit(angle, e))
    return scene, e, (scene.start < _UNIT_LIMIT) & (scene.r_s < _UNIT_LIMIT)


@jit
def decrement(zeta):
    """delta of (2) and sqrt(1 - zeta^2), as pairs, for 0 <= zeta < 1."""
    high, low = pairs.two_product(zeta, zeta)
    one = 0.0 * zeta + 1.0
    root = pairs.root(pairs.add(pairs.two_sum(one, -high), (-low, 0.0 * low)))
    return pairs.over(pairs.scaled(pairs.PI, zeta), root), root


@jit
def decay_of(zeta):
    """The decay of a half swing, for 0 <= zeta < 1."""
    delta, root = decrement(zeta)
    q, n = pairs.exponential(pairs.negative(delta))
    return Decay(delta, root, pairs.whole(q, n), pairs.missing(q, n))


@jit_call
def turning_point(scene, decay, k):
    """a_k of (3), as a pair, and its first term a_0 E^k."""
    smooth = not_(scene.zeta > FAINT)  # there products of the parts of delta would be no normal numbers
    delta = choose(smooth, (0.0, 0.0), decay.delta)
    q, n = pairs.exponential(pairs.negative(pairs.scaled(delta, k)))
    kept = pairs.scaled(pairs.shifted(q, 1.0), scene.start)
    kept = scale(kept[0], n), scale(kept[1], n)
    ratio = pairs.over(pairs.missing(q, n), choose(smooth, (1.0, 0.0), decay.lost))
    ratio = choose(smooth, (k, 0.0 * k), ratio)
    friction = pairs.scaled(pairs.times(pairs.shifted(decay.kept, 1.0), ratio), scene.r)
    return pairs.add(kept, pairs.negative(friction)), kept[0]


@jit
def _whole(x):
    """The least integer from x on, for x >= 0; above 2^50 a nearest one."""
    big = x >= COUNT_LIMIT
    n = nearest(where(big, 0.0, x))
    n = where(n < x, n + 1.0, n)
    return where(big, where(x < 2.0**52, (x + 2.0**52) - 2.0**52, x), n)


@jit_call
def closed(scene):
    """Its rest: the count by (4), confirmed by the turning points on both sides of it.

    The turning points k - 1, above r_s, and k, below it, are pairs; `kept` is the part a_0 E^k of the one at which the
    search began.
    """
    r_s, moves, decay = scene.r_s, scene.start > scene.r_s, decay_of(scene.zeta)
    delta, lost, felt = decay.delta[0], decay.lost[0], scene.zeta > FAINT

    # (4) without its ceil, within 4e-15
    coth = where(delta > FAINT, delta * (2.0 - lost) / where(delta > FAINT, lost, 1.0), 2.0)  # delta coth(delta/2)
    under, high = fma(scene.r, coth, delta * r_s), where(delta > 1.0, delta, 1.0)
    x = (delta / high) * (scene.start - r_s) / (under / high)
    small = x < 1e-17
    guess = where(small, (scene.start - r_s) / under, log1p(x) / where(small, 1.0, delta))
    guess = where(moves, guess, 0.0)
    countless = not_(guess < COUNT_LIMIT)
    k = _whole(where(countless, 0.0, guess * (1.0 - 4e-15) - 1e-6)) - 1.0
    k, counted = where(k > 0.0, k, 0.0), moves & not_(countless)

    # from below the count on, by (2), to the first turning point that does not exceed r_s
    above, kept = turning_point(scene, decay, k)
    sure = above[0] - r_s + above[1] > 0.0
    friction = pairs.negative(pairs.scaled(pairs.shifted(decay.kept, 1.0), scene.r))
    below = pairs.add(pairs.times(decay.kept, above), friction)
    active, k = counted & (pairs.shifted(below, -r_s)[0] > 0.0), k + 1.0
    for _ in range(_CONFIRM_LIMIT):
        if not any_lane(active):
            break
        above = choose(active, below, above)
        below = choose(active, pairs.add(pairs.times(decay.kept, above), friction), below)
        k = where(active, k + 1.0, k)
        active = active & (pairs.shifted(below, -r_s)[0] > 0.0)
    unsure = counted & (active | not_(sure))

    # what two units in the last place of a_0, r and zeta are worth in both: da/dln a_0 = a_0 E^k, da/dln r =
    # -r (1 + E)(1 - E^k)/(1 - E), and ln zeta counts through ln delta, `steep` times: k delta-fold in the first, at
    # most `drift`-fold in the second
    steep = 1.0 / (decay.root[0] * decay.root[0])
    drift = 2.0 * decay.kept[0] * where(felt, delta / where(felt, lost, 1.0), 1.0)
    first, second = fma(k * delta, steep, 1.0), fma(drift, steep, 1.0)
    blur_above = _TWO_ULP * (kept * first + magnitude(kept - above[0]) * second)
    blur_above = where(k > 1.0, blur_above, _TWO_ULP * scene.start)
    kept = decay.kept[0] * kept
    blur = _TWO_ULP * (kept * first + magnitude(kept - below[0]) * second)

    # how far both lie from r_s, and whether that is no more than its error or 1e-9
    over = pairs.shifted(above, -r_s)[0]
    under = where(moves, -pairs.shifted(below, -r_s)[0], r_s - scene.start)
    held = _TWO_ULP * r_s
    over_error, under_error = where(moves, blur_above + held, 0.0), where(moves, blur + held, 0.0)
    grazes = not_(under > GRAZING * r_s) | not_(under > under_error)
    grazes = grazes | (moves & (not_(over > GRAZING * r_s) | not_(over > over_error)))
    margin = where(moves & (over < under), over, under) / unit(r_s)

    count = where(moves, where(countless, _whole(guess), k), 0.0)
    last = where(moves, where(countless, math.nan, below[0]), scene.start)
    doubt = where(moves & felt, fma(_PAIR_ERROR / _TWO_ULP, blur, _LOST), 0.0)
    return Rest(count, last, where(countless, 0.0, margin), grazes | countless, doubt, unsure)


@jit
def unit(r_s):
    """What margins are relative to; without solid friction there is nothing to divide by."""
    return where(r_s > 0.0, r_s, 1.0)
