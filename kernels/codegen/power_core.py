"""The *core* of a power: where abs(u)^n, u a state, is a constant for a Taylor series, for it has none at u = 0.

From a kink u = 0 on, u is r t, and abs(u)^n has the mean (r t)^n/(n + 1). With the mean in its place the rates' impulse
is right for whatever n, and what is left of a state whose rate the power changes by D is, in units of time,
    D t (t + d),  d = (D of u)/r                                                                         (1)
for the speed between differs from the true one by less than D t, and the motion is not quite even: d, at most 1/4.
The core ends where that is the tolerance times the state's own size; outside the series steps towards it or away from
it by parts of the way that is left, as the radius of convergence allows.

Where nothing but the power acts at u = 0, u' = -c u^n with n < 1 comes to rest there after u^(1 - n)/((1 - n) c), while
every state's rate changes by the power as u's does: with (1 - n) u^n in the power's place that time and all impulses
are right, and what hangs on u is off by less than u times that time.
"""

from kernels.integrate.taylor import SLACK
from kernels.lanes.jit import jit
from kernels.lanes.vectors import magnitude, where
from kernels.maths.elementary import power
from kernels.source_text.template import filled, listed

UNEVEN = 0.25
"""d of (1), at most."""
FAR = 1e300
SHORT = 0.9
"""Of the way to rest, that a step may take: at the end of it the series may turn round instead."""

CORE = '''
@jit
def with_power_{i}(state, side, signs, parameters, unit, power_{i}):
    """The rates per unit of time, with a value of power {i}."""
    {unpack}
    {lines}
    return {rates}


@jit_call
def core_{i}(state, side, signs, parameters, unit, tolerance, leaves, t, margin):
    """The mean of power {i} in its core, -1 where the motion is not in it; and the longest step from the kink on.

    {doc}
    `t` is the time since the last event, `margin` what there is of u for next to nothing.
    """
    {unpack}
    {value_of_n}
    base = sign_{kink} * {u}
    value, nothing = power(base, {n}), 0.0 * side
    {full} = with_power_{i}(state, side, signs, parameters, unit, value)
    core, longest, nears = nothing - 1.0, nothing + FAR, sign_{kink} * full_{u} < 0.0
    {no_coarse}
    if any_lane(nears):
        {bare} = with_power_{i}(state, side, signs, parameters, unit, nothing)
        over = 1.0 / magnitude(full_{u})
        t_{u}, d = base * over, magnitude(full_{u} - bare_{u}) * over
        uneven = t_{u} * (t_{u} + d)
        inside = nears & (d <= UNEVEN)
        {inside}
        {coarse}
        core = where(inside, mean_power(value, {n}), -1.0)
        {at_kink} = with_power_{i}(({on_kink}), side, signs, parameters, unit, nothing)
        settles = nears & (kink_{u} <= 0.0) & (kink_{u} >= 0.0) & ({n} < 1.0)
        left = t_{u} / (1.0 - {n})
        rests = settles & no_matter(base, left, t, margin)
        core = where(rests, value * (1.0 - {n}), core)
        longest = where(settles & not_(rests), SHORT * left, longest)
    if any_lane(leaves):
        {bare} = with_power_{i}(state, side, signs, parameters, unit, nothing)
        {most} = with_power_{i}(state, side, signs, parameters, unit, nothing + 1.0)
        capacity = nothing + FAR
        {capacity}
        reach = core_time(capacity, magnitude(bare_{u}), magnitude(most_{u} - bare_{u}), {n}, tolerance)
        mean = mean_power(power(magnitude(bare_{u}) * reach, {n}), {n})
        core, longest = where(leaves, mean, core), where(leaves, reach, longest)
        {coarse_behind}
    return core, longest{also}
'''


@jit
def size_in_unit(u, rate):
    """Of a state, with what it gains in a unit of time."""
    return magnitude(u) + magnitude(rate)


@jit
def mean_power(last, n):
    """The mean of what grows as t^n up to `last`."""
    return last / (n + 1.0)


@jit
def no_matter(u, left, t, margin):
    """Whether so little is left of u that its way to rest, in the time `left`, does not matter."""
    return (SLACK * u * left <= margin * (t + left)) | (u <= SLACK * margin)


@jit
def core_time(capacity, rate, most, n, tolerance):
    """How long u = rate t may be taken for small, by (1); at most 1 unit.

    `capacity` is the least size of a state over what the power, were it 1, would add to its rate; `most` is that of u.
    """
    drag = power(rate, n)
    whole = 0.5 * tolerance * capacity / drag  # D t^2 <= half the tolerance times the size
    slow = power(_no_more_than_one(whole), 1.0 / (n + 2.0))
    even = power(_no_more_than_one(whole * (rate / (most * drag))), 1.0 / (2.0 * n + 1.0))
    mild = where(n > 0.0, power(_no_more_than_one(UNEVEN * (rate / (most * drag))), 1.0 / where(n > 0.0, n, 1.0)), 1.0)
    shorter = where(slow < even, slow, even)
    return where(shorter < mild, shorter, mild)


@jit
def _no_more_than_one(x):
    return where(x < 1.0, x, 1.0)


def core(writer, i, tells=False):
    """The text of `core_{i}` and what it calls; if it tells, that gives also what (1) leaves, and the true rates."""
    node = list(writer.recorded.graph.powers)[i]
    base, exponent = node.args
    kink = writer.kinks_of_powers()[i]
    states, u = writer.states, writer.names[base.args[1].args[0]]
    lines = writer.lines_with({node: f"power_{i}"})
    rates = [lines.value(rate) for rate in writer.recorded.timed]
    of_n = writer.lines_with({})
    n = of_n.value(exponent)
    inside = [
        f"inside = inside & (magnitude(full_{s} - bare_{s}) * uneven <= tolerance * size_in_unit({s}, full_{s}))"
        for s in states
    ]
    capacity = [
        f"""\
share = size_in_unit({s}, bare_{s}) / magnitude(most_{s} - bare_{s})
capacity = where(share < capacity, share, capacity)"""
        for s in states
    ]
    return filled(
        CORE, i=i, kink=kink, u=u, n=n, unpack=writer.all_unpacked, lines="\n".join(lines.text),
        rates=f"({listed(rates)})",
        value_of_n="\n".join(of_n.text), inside="\n".join(inside), capacity="\n".join(capacity),
        bare=listed(f"bare_{s}" for s in states), full=listed(f"full_{s}" for s in states),
        most=listed(f"most_{s}" for s in states), at_kink=listed(f"kink_{s}" for s in states),
        on_kink=listed("0.0 * side" if s == u else s for s in states), **_told(states, u, n, tells),
    )  # fmt: skip


def _told(states, u, n, tells):
    """Statements for what is left of each state by (1)."""
    if not tells:
        return dict.fromkeys(("doc", "no_coarse", "coarse", "coarse_behind", "also"), "")
    behind = f"""\
by_power = ({n} + 1.0) * mean
uneven = reach * fma(magnitude(most_{u} - bare_{u}), by_power / magnitude(bare_{u}), reach)"""
    left = "coarse_{s} = where(leaves, magnitude(most_{s} - bare_{s}) * by_power * uneven, coarse_{s})"
    return {
        "doc": "Also what (1) leaves of each state, and the rates with the power as it is.\n",
        "no_coarse": "\n".join(f"coarse_{s} = nothing" for s in states),
        "coarse": "\n".join(
            f"coarse_{s} = where(inside, magnitude(full_{s} - bare_{s}) * uneven, 0.0)" for s in states
        ),
        "coarse_behind": "\n".join([behind, *(left.format(s=s) for s in states)]),
        "also": f", ({listed(f'coarse_{s}' for s in states)}), ({listed(f'full_{s}' for s in states)})",
    }
