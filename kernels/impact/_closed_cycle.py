"""The impact clock's own cycle in closed form: one impact a half period, or for e = 0 one push in contact.

Units as in `_units`; wheel = M/(M + m), pallet = m/(M + m), so kappa = wheel/pallet.

Impact, 0 < e < 1. After an impact at y = -Y the pallet flies to +Y, and the wheel half a pitch:
    T^2 = (1 + e) pallet/(1 - e),  w = kappa T/2,  Y = kappa T^2/4,                                      (1)
    V = (wheel (1 - e) - 2 e pallet)/(2 sqrt((1 - e^2) pallet)),  thrown back by V^2/2 where V < 0.      (2)
The tooth falls behind its pallet by u t - G t^2/2 and comes to the next impact, seen backwards, in the same way, with
u = e and 1 in place of the speeds after and before the impact, q = (1 + e)(pallet - nu kappa wheel/4) for G, time in T
and (1 - e) for the pitch. The pallet is in the way of teeth for the share a = (1 + eta/Y)/2 of T on both sides. So the
cycle exists exactly if
    q a < 2 e,  t - q t^2/2 < 1 - e for all t <= a;                                                      (3)
the tooth ahead after the impact and the tooth itself before it are then clear as well. (3) implies a < 1, which is
eta < Y, and, since a >= 1/2, e < 7/8.
The half map (y, V, w), reflected, has multipliers with the product e^2; their polynomial p is given by
    p(1) = (1 - e^2) (4 pallet - nu wheel d),  d = wheel - pallet,                                       (4)
    p(-1) = -(wheel d/2) (4 (1 + e)^2 + nu (kappa (1 - e)^2 + 2 (1 + e^2))),                             (5)
and all are below 1 exactly if p(1) > 0 and p(-1) < 0: Jury's third condition, 4 (1 + e)^2 d + nu kappa d (1 - e)^2 <
8 (1 + e^2), follows from d < 1 and nu kappa d < 4, which is p(1) > 0. With nu = 0: stable for kappa > 1.

Plastic, e = 0 and nu = 0. Tooth and pallet stay together until y = eta, where both have the speed c; then the wheel
falls until the other pallet stops it with the speed R:
    c^2 = (kappa + 4 eta)/4,  T = 2 c/kappa,  R^2 = 1 + kappa,  t_fall = slack/(R + 2 c),                (6)
and both start with V = w = wheel R - c, thrown back by V^2/(2 wheel) where V < 0. It exists for every eta <= 1/4; the
map of c^2 is linear with the factor d^2. Derived here.
"""

from kernels.impact._units import Cycle
from kernels.lanes.codes import GRAZING, INACCURATE, NO_CYCLE, NO_METHOD, OK, UNSTABLE
from kernels.lanes.jit import jit
from kernels.lanes.vectors import choose, fma, magnitude, not_, sqrt, where
from kernels.maths import pairs
from kernels.maths.cubic import largest_modulus
from kernels.maths.elementary import smaller

ROUNDING = 2e-15
"""What the closed forms are right to."""
GRAZE = 4e-15
"""A difference below this share of its terms hangs on the last digits of the input."""
_MOST_BENT = 24.0
"""abs(nu kappa wheel) of (3): beyond it q is below -5 or above 5, and no cycle exists."""


@jit
def existence(scene, nu):
    """The least share by which the conditions (3) hold; negative where the impact cycle does not exist."""
    e, wheel, pallet = scene.e, scene.wheel[0], scene.pallet[0]
    reach = 4.0 * scene.eta[0] * (1.0 - e) / (wheel * (1.0 + e))  # eta/Y
    a = 0.5 * (1.0 + reach)
    n = 0.25 * nu * scene.kappa[0] * wheel
    q, size = (1.0 + e) * (pallet - n), (1.0 + e) * (pallet + magnitude(n))  # of the terms of q
    behind = (2.0 * e - q * a) / fma(size, a, 2.0 * e)
    turns = q * a > 1.0
    peak = where(turns, 0.5 / where(turns, q, 1.0), a * fma(-0.5 * q, a, 1.0))
    return smaller(behind, ((1.0 - e) - peak) / fma(a, fma(0.5 * size, a, 1.0), 1.0 - e))


@jit
def _excess(scene):
    """d = (M - m)/(M + m), as a pair."""
    return pairs.add(scene.wheel, pairs.negative(scene.pallet))


@jit
def stability(scene, nu):
    """The least share by which (4) and (5) have the right signs; negative where disturbances grow."""
    e, wheel = scene.e, scene.wheel[0]
    d = _excess(scene)[0]
    steep, lost = 4.0 * (1.0 + e) * (1.0 + e), scene.kappa[0] * ((1.0 - e) * (1.0 - e))
    curved = nu * wheel  # nu alone may be too large to be multiplied
    flat, bend = 4.0 * scene.pallet[0], curved * d
    first = (flat - bend) / (flat + magnitude(bend))
    flat, bend = steep * wheel, curved * fma(2.0, fma(e, e, 1.0), lost)
    second = (flat + bend) / (flat + magnitude(bend))
    flip = smaller(magnitude(d), magnitude(second)) * where((d > 0.0) & (second > 0.0), 1.0, -1.0)
    flip = where((d < 0.0) & (second < 0.0), -flip, flip)
    return smaller(first, flip)


@jit
def _polynomial(scene, nu):
    """The coefficients of p, as pairs: p(1) + p(-1) = 2 (a2 + a0), p(1) - p(-1) = 2 (1 + a1), a0 = -e^2."""
    pallet, e = scene.pallet, scene.e
    one = 1.0 + 0.0 * e, 0.0 * e
    more, less, square = pairs.shifted(one, e), pairs.shifted(one, -e), pairs.two_product(e, e)
    excess = pairs.times(scene.wheel, _excess(scene))
    bend = pairs.scaled(excess, nu)
    flat = (4.0 * pallet[0], 4.0 * pallet[1])
    plus = pairs.times(pairs.times(more, less), pairs.add(flat, pairs.negative(bend)))
    lost = pairs.times(scene.kappa, pairs.times(less, less))
    lost = pairs.add(lost, pairs.shifted((2.0 * square[0], 2.0 * square[1]), 2.0))
    steep = pairs.times(more, more)
    flat = pairs.times(excess, (4.0 * steep[0], 4.0 * steep[1]))
    minus = pairs.add(flat, pairs.times(bend, lost))
    minus = (-0.5 * minus[0], -0.5 * minus[1])
    sum_, gap = pairs.add(plus, minus), pairs.add(plus, pairs.negative(minus))
    a2 = pairs.add((0.5 * sum_[0], 0.5 * sum_[1]), square)
    return a2, pairs.shifted((0.5 * gap[0], 0.5 * gap[1]), -1.0), pairs.negative(square)


@jit
def impact_cycle(scene, nu):
    """The cycle (1), (2), its multiplier from (4), (5), and the relative error of that."""
    wheel, pallet, e = scene.wheel, scene.pallet, scene.e
    loss = (1.0 - e) / (1.0 + e)
    half_period = sqrt(pallet[0] / loss)
    rim = pairs.add(wheel, pairs.scaled(pairs.shifted(pallet, 1.0), -e))[0]  # wheel (1 - e) - 2 e pallet
    lossy = ((1.0 - e) * (1.0 + e)) * pallet[0]
    multiplier, doubt = largest_modulus(*_polynomial(scene, nu))
    back = where(rim < 0.0, 0.125 * rim * rim / lossy, 0.0)
    rim = 0.5 * rim / sqrt(lossy)
    speed = 0.5 * scene.kappa[0] * half_period
    return Cycle(half_period, 0.25 * wheel[0] / loss, rim, speed, multiplier, back, 0.0, 1.0, 0.0), doubt


@jit
def plastic_cycle(scene):
    """The cycle (6)."""
    wheel, kappa, eta = scene.wheel, scene.kappa, scene.eta
    twice = sqrt(fma(4.0, eta[0], kappa[0]))  # 2 c
    stop = sqrt(1.0 / scene.pallet[0])
    fall = scene.slack[0] / (stop + twice)
    half_period = twice / kappa[0]
    lead = pairs.add(pairs.times(kappa, pairs.shifted(wheel, -0.25)), pairs.negative(eta))  # (wheel R)^2 - c^2
    start = lead[0] / fma(0.5, twice, wheel[0] * stop)
    back = where(start < 0.0, 0.5 * start * start / wheel[0], 0.0)
    d = _excess(scene)[0]
    travel = fma(0.5 * twice, fall, eta[0]) + back
    return Cycle(half_period, travel, start, start, d * d, back, 1.0 - fall / half_period, 1.0, 0.0)


@jit
def closed(scene, rtol):
    """The symmetric cycle by formula, with its existence and its multipliers, and the status."""
    plastic, straight = not_(scene.e > 0.0), not_(magnitude(scene.nu) > 0.0)
    tame = magnitude(scene.nu) * scene.kappa[0] * scene.wheel[0] <= _MOST_BENT
    nu = where(tame, scene.nu, 0.0)
    cycle, doubt = impact_cycle(scene, nu)
    exists, stable = existence(scene, nu), stability(scene, nu)
    status = where(stable < -GRAZE, UNSTABLE, where((exists <= GRAZE) | (stable <= GRAZE), GRAZING, OK))
    status = where((rtol >= ROUNDING) & (doubt <= 0.2 * rtol), status, INACCURATE)
    status = where(tame & (exists >= -GRAZE), status, NO_CYCLE)
    status = where(plastic, where(straight, OK, NO_METHOD), status)
    return choose(plastic, plastic_cycle(scene), cycle), status
