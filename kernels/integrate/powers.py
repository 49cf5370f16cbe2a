"""The *core* of a power: around u = 0, u a state, abs(u)^n has no Taylor series, and is replaced by a constant.

Just after a kink u = 0, u is r t, and abs(u)^n has the mean (r t)^n/(n + 1). Replacing it by this mean keeps the
impulse of the rates exact for any n. The remaining error of a state whose rate the power changes by D is, in units of
time,
    D t (t + d)                                                                                          (1)
since the rate in between differs from the true one by less than D t, and r is not constant: d, at most 1/4, is the
relative change of r in the core, by the power and everything else, as where u turns round next to 0. Further errors are
D times the difference of a step's length from t, and t times the change of D in the core (for abs(u)^n u, D is 0 at
the kink). For n < 0, D is that of the mean.
The core ends where (1) equals the tolerance times the state's own size; outside, the steps of the series are fractions
of the distance to the core, as the radius of convergence allows.

If only the power acts at u = 0, u' = -c u^n with n < 1 comes to rest there after u^(1 - n)/((1 - n) c), while the rates
of all states change by the power as that of u does. Replacing the power by (1 - n) u^n keeps that time and all impulses
exact; the error of states that depend on u is below u times that time. Generic in one cell or lanes.
"""

from collections import namedtuple

from kernels.integrate.steps import ONE
from kernels.lanes.jit import jit_call
from kernels.lanes.symbols import left_a_call, symbolic
from kernels.lanes.tuples import after, all_of, joined, times
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, not_, where
from kernels.maths.elementary import power

UNEVEN = 0.25
"""d of (1), at most."""
FAR = 1e300
REST = 0.1
"""Of the margin of u, that below which it does not matter where u is on its way to rest: the motion may end before."""
ROUNDS, LEAST = 3, 1e-9
"""How often a core behind a kink is made shorter, of which the rates may change within it; and what of it is left."""
SHORT = 0.9
"""Of the way to rest, that a step may take: at the end of it the series may turn round instead."""


Power = namedtuple("Power", "rates base exponent of_base of_kink without")
"""What is written of a scene for one of its powers.

rates : (state, mode, unit, value) -> the rates per unit of time, with that value of the power
base, exponent : (state, mode) -> abs(u); n
of_base, of_kink : the entry of u in a tuple of states, of its kink in one of events
without : (state, mode) -> the state at u = 0
"""


@jit_call
def core(p, state, mode, unit, tolerance, on, t, margins, furthest):
    """The mean of a power in its core, and how far from there a step may go.

    Parameters
    ----------
    p : Power
    t : time since the last event
    margins : of each event, what there is of it for next to nothing
    furthest : the longest step that may be taken

    Returns
    -------
    core : the mean, -1 where the motion is not in the core
    longest : step from the kink on
    coarse : of (1) t, D of each state, and what is left of it
    full : the rates with the power as it is
    """
    n, base, nothing = p.exponent(state, mode), p.base(state, mode), 0.0 * mode.side
    value, margin, leaves = power(base, n), p.of_kink(margins), (p.of_kink(on) > 0.5) & (t <= 0.0)
    full = p.rates(state, mode, unit, value)
    core, longest, coarse = nothing - 1.0, nothing + FAR, (nothing, times(nothing, state), times(nothing, state))
    nears = p.of_kink(joined((0.0,), mode.signs)) * p.of_base(full) < 0.0
    if any_lane(nears):
        core, longest, coarse = towards(p, state, mode, unit, tolerance, n, base, value, full, margin, nears, furthest)
    if any_lane(leaves):
        behind = away(p, state, mode, unit, tolerance, n, furthest)
        core, longest, coarse = choose(leaves, behind, (core, longest, coarse))
    return core, longest, coarse, full


@symbolic
def towards(p, state, mode, unit, tolerance, n, base, value, full, margin, nears, furthest):
    """`core`, how far a step may go, and what is left out, where u comes to 0."""
    nothing = 0.0 * mode.side
    bare = p.rates(state, mode, unit, nothing)
    over = 1.0 / magnitude(p.of_base(full))
    t_base = base * over
    kink = p.without(after(state, t_base, ONE, (full,)), mode)
    bare_there = p.rates(kink, mode, unit, nothing)
    at_kink = p.of_base(bare_there)
    d = magnitude(p.of_base(full) - at_kink) * over
    here, there = apart(full, bare), apart(p.rates(kink, mode, unit, value), bare_there)
    most_of, early = times(steep(n), tuple(where(x < y, y, x) for x, y in zip(here, there, strict=True))), t_base + d
    parts = zip(most_of, here, there, strict=True)
    left = times(t_base, tuple(fma(z, early, steep(n) * magnitude(x - y)) for z, x, y in parts))
    small = tuple(x <= tolerance * size_in_unit(u, rate) for x, u, rate in zip(left, state, full, strict=True))
    inside = nears & (d <= UNEVEN) & ((1.0 + UNEVEN) * t_base <= furthest) & all_of(small)
    settles = nears & (at_kink <= 0.0) & (at_kink >= 0.0) & (n < 1.0)
    way = t_base / (1.0 - n)
    rests = settles & (base <= REST * margin)
    core = where(rests, value * (1.0 - n), where(inside, mean_power(value, n), -1.0))
    longest = where(settles & not_(rests), SHORT * way, FAR)
    none = times(nothing, state)
    return core, longest, choose(inside, (t_base, most_of, left), (nothing, none, none))


@symbolic
def away(p, state, mode, unit, tolerance, n, furthest):
    """The same where u = rate t leaves 0: as long as it may be taken for small by (1), at most 1 unit."""
    nothing = 0.0 * mode.side
    bare, whole = p.rates(state, mode, unit, nothing), p.rates(state, mode, unit, nothing + 1.0)
    by_power, reach = apart(whole, bare), _no_more_than_one(furthest)
    for _ in range(ROUNDS):
        reach, mean, most_of, left = shorter(p, state, mode, unit, tolerance, n, bare, by_power, reach)
    return mean, reach, (reach, most_of, left)


@left_a_call
def shorter(p, state, mode, unit, tolerance, n, bare, by_power, reach):
    """How long by (1) a core may be, by what rates change on the way of this one; its mean, D, and what is left out."""
    moved, nothing = after(state, reach, ONE, (bare,)), 0.0 * reach
    ahead, more = p.rates(moved, mode, unit, nothing), p.rates(moved, mode, unit, nothing + 1.0)
    rate, there, capacity = magnitude(p.of_base(bare)), apart(more, ahead), nothing + FAR
    turn = magnitude(p.of_base(ahead) - p.of_base(bare)) / (rate * reach)
    slopes = tuple(magnitude(x - z) / reach for x, z in zip(there, by_power, strict=True))
    by = tuple(z + slope for z, slope in zip(by_power, slopes, strict=True))
    for u, y, z in zip(state, bare, by, strict=True):
        share = size_in_unit(u, y) / z
        capacity = where(share < capacity, share, capacity)
    drag, of_base = power(rate, n), p.of_base(by)
    room = 0.5 * tolerance * capacity / drag  # D t^2 <= half the tolerance times the size
    over = rate / (of_base * drag)
    slow = power(_no_more_than_one(room / (1.0 + turn)), 1.0 / (n + 2.0))
    even = power(_no_more_than_one(room * over), 1.0 / (2.0 * n + 1.0))
    mild = where(n > 0.0, power(_no_more_than_one(UNEVEN * over), 1.0 / where(n > 0.0, n, 1.0)), 1.0)
    mild = where(mild * turn > UNEVEN, UNEVEN / turn, mild)
    wanted = where(slow < even, slow, even)
    wanted = where(wanted < mild, wanted, mild)
    wanted = where(wanted < reach, wanted, reach)
    reach = where(wanted > LEAST * reach, wanted, LEAST * reach)
    last = power(rate * reach, n)
    early = fma(of_base, last / rate, reach * (1.0 + turn))
    most_of = tuple(steep(n) * last * fma(slope, reach, z) for z, slope in zip(by_power, slopes, strict=True))
    return reach, mean_power(last, n), most_of, times(steep(n) * last * reach * early, by)


@symbolic
def apart(xs, ys):
    """By how much each of a tuple is another."""
    return tuple(magnitude(x - y) for x, y in zip(xs, ys, strict=True))


@symbolic
def steep(n):
    """The mean of what falls as t^n over its last value, or 1 of what rises."""
    return where(n < 0.0, 1.0 / (n + 1.0), 1.0)


@symbolic
def outside(cores, lanes):
    """Of the lanes those in no core of a power, which the series leaves out."""
    for core in cores:
        lanes = lanes & (core < 0.0)
    return lanes


@symbolic
def size_in_unit(u, rate):
    """Of a state, with what it gains in a unit of time."""
    return magnitude(u) + magnitude(rate)


@symbolic
def mean_power(last, n):
    """The mean of what grows as t^n up to `last`."""
    return last / (n + 1.0)


@symbolic
def _no_more_than_one(x):
    return where(x < 1.0, x, 1.0)
