"""Source text of what a lane does from one event to the next: start, switch, turn signs round, count, end."""

from textwrap import indent

from kernels.lanes.jit import jit
from kernels.lanes.vectors import exponent, magnitude, pow2, sqrt, where
from kernels.source_text.lane import BEGIN, begun_rows, chosen, loaded_rows, stored_rows
from kernels.source_text.sliding import endless, press, turned
from kernels.source_text.template import filled, folded, listed

KINK_LIMIT = 1000
"""Kinks between two switches after which a cell is given up."""
EVENTS = 1_000_000
"""Of lanes none of which finishes, before what they keep is put down."""

BLUR = 16.0
"""Tolerances of the surface's value at the start that rounding may take from it: rtol/2 in the finer run."""

SETTLED = '''
@jit_call
def settled(state, side, parameters, unit, near):
    """The sign of each kink's u, and whether the state is on it: there the sign is that of u in the next moment.

    The last sign is 1, the motion's way over the surface.
    `near` is 1 for the kinks that the state is on but for rounding.
    """
    {signs} = natural_signs(state, side, parameters)
    {unpack} = series_2(state, side, ({signs}), parameters, unit)
    {turn}
    return ({signs}), ({on})
'''

BEGUN = '''
@jit
def begun(flips, parameters):
    """The start. Of what rounding takes from the surface's value, nothing of nothing is nothing."""
    side = 0.0 * flips + 1.0
    {states} = started(side, parameters)
    state = ({lasting})
    one = 0.0 * side + 1.0
    signs, on = settled(state, side, parameters, one, ({zeros}))
    {unpack} = series_2(state, side, signs, parameters, one)
    e, d, dd = fma(factor_0, event_0[0], offset_0), factor_0 * event_0[1], factor_0 * event_0[2]
    {signs} = signs
    way = where(e < 0.0, -1.0, way)
    away = (d > 0.0) | ((d >= 0.0) & (dd > 0.0))
    at = where((e <= 0.0) & (e >= 0.0) & away, 1.0, 0.0)
    lost = lost_by_surface(state, side, signs, parameters)
    blur = where(lost > 0.0, lost / magnitude(e), 0.0)
    return Start(state, side, ({signs}), time_unit(e, d, dd), (at, {also_on}), not_(magnitude(e) >= 0.0), blur)
'''

EVENT = '''
@jit_call
def advance_{order}(memory, i):
    """Every lane on from event to event, until one has finished; whether one has."""
    {load}
    parameters = ({parameters})
    {begin}
    {shake_start}
    {press_fresh}
    done = active & not_(active)
    for _ in range(EVENTS):
        moving = active & (verdict < REFUSED)
        leg{off_out} = to_event_{order}(
            ({states}), side, ({signs}), parameters, unit, h, ({ons}), tolerance, moving{off_in}
        )
        {late}
        verdict = where((leg.hangs | leg.grazing) & (verdict < GRAZING), GRAZING, verdict)
        refused = where(leg.stuck, STICKS, where(leg.broken, OUT_OF_RANGE, verdict))
        verdict = where(leg.lost, STEP_LIMIT_MET, refused)
        {endless}
        moving = moving & (verdict < REFUSED) & not_(leg.grazing)
        {land}
        {sizes}
        h = leg.h
        {ons} = leg.on
        place = blurred(({states}), side, ({signs}), ({ons}), parameters)
        rate = rates(({states}), side, ({signs}), parameters)
        {shake_event}
        time = where(moving, fma(leg.t, unit, time), time)
        since = where(moving, fma(leg.t, unit, since), since)
        switches = moving & (on_0 > 0.5) & (way > 0.0)
        kinks_met = where(switches, 0.0, where(moving, kinks_met + 1.0, kinks_met))
        {turn}
        {come_up}
        if any_lane(switches):
            count = where(switches, count + 1.0, count)
            {largest}
            watched = switches & ((count < 1.5) | (count >= flips))
            if any_lane(watched):
                faint = underflows(({states}), side, ({signs}), parameters, unit)
                verdict = where(watched & faint, OUT_OF_RANGE, verdict)
                {keep}
                {tell}
            since = where(switches, 0.0, since)
            left = surface(({states}), side, ({signs}), parameters)
            gaps = kink_values(({states}), side, ({signs}), parameters)
            {through}
            jumped = switched(({states}), side, ({signs}), parameters)
            side = where(switches, -side, side)
            gaps_behind = kink_values(jumped, side, ({signs}), parameters)
            signs, kinks_on = settled(jumped, side, parameters, unit, ({near}))
            {jump}
            after = surface(({states}), side, ({signs}), parameters)
            size = magnitude({offset}) + magnitude(after - {offset})
            still = magnitude(after) <= fma(1e-12, size, 2.0 * magnitude(left))
            on_0 = where(switches, where(still, 1.0, 0.0), on_0)
            way = where(switches & (after < 0.0) & not_(still), -1.0, way)
        {press}
        steps, before = where(active, leg.tried, steps), where(active, steps, before)
        verdict = where(moving & (kinks_met > {most_kinks}), STEP_LIMIT_MET, verdict)
        done = active & (leg.grazing | (verdict >= REFUSED) | (count >= flips))
        if any_lane(leg.grazing):
            {nothing}
        if any_lane(done):
            break
    stage = where(done, 3.0, where(active, 2.0, stage))
    {store}
    return any_lane(done)


@kept
def run_{order}(cells, together):
    """Each cell, a row of what ROWS names, until its last switch."""
    each_refilled(advance_{order}, cells, together)
'''


@jit
def time_unit(e, d, dd):
    """A power of two near the time in which an event comes up: from e, e' and e''/2."""
    e, d, dd = magnitude(e), magnitude(d), magnitude(dd)
    by_rate, by_bend = e / d, sqrt(e / dd)
    shorter = where(by_bend < by_rate, by_bend, by_rate)
    t = where((shorter > 0.0) & (shorter < 1e300), shorter, where(by_rate < 1e300, by_rate, by_bend))
    again = d / dd
    t = where((t > 1e-300) & (t < 1e300), t, again)
    t = where((t > 1e-300) & (t < 1e300), t, 1.0)
    return pow2(exponent(t))


_STARTS = (
    ("side", "start.side"), ("unit", "start.unit"), ("h", "1.0"),
    *((name, "0.0") for name in ("time", "count", "since", "kinks_met", "steps", "before")),
)  # fmt: skip


def results_of(states):
    """Names of what a cell comes to."""
    return ["time", "interval", *(f"at_{s}" for s in states), *(f"size_{s}" for s in states), "verdict"]


def _between_events(states, kinks):
    """Names of what a lane keeps of its cell between two events, beside results."""
    ons = [f"on_{j}" for j in range(1 + kinks)]
    own = [*states, "side", *signs_of(kinks), "unit", "h", *ons]
    return [*own, "count", "since", "kinks_met", "steps", "before"]


def signs_of(kinks):
    """Names of the kinks' signs, and of the way over the surface."""
    return [*(f"sign_{j}" for j in range(kinks)), "way"]


def of_error(states, spreads):
    """Names of what a lane that tells its error keeps: of times, of each state, of its spread; at the last switch."""
    offs = [f"off_{s}" for s in states]
    spread = ["spread_late", "spread_lag", *(f"spread_{s}" for s in states)] if spreads else []
    return ["told", "error", "late", "lag", *offs, *spread, "latest", "lagged", *(f"once_{s}" for s in offs)]


def rows_of(states, parameters, kinks, also=()):
    """Names of all that a lane keeps; `also` are those of its error (`of_error`)."""
    moving = [*results_of(states), *_between_events(states, kinks)]
    return ["stage", *parameters, "flips", "tolerance", "shake", *moving, *also]


def shared(states, parameters, kinks):
    """The text that does not depend on the order."""
    signs, e = signs_of(kinks), range(1, 1 + kinks)
    unpack = ", ".join([f"s_{s}" for s in states] + [f"(offset_{j}, factor_{j}, event_{j})" for j in (0, *e)])
    turn = [
        f"""\
on_{j} = ((event_{j}[0] <= 0.0) & (event_{j}[0] >= 0.0)) | (near[{j - 1}] > 0.5)
back = (factor_{j} * event_{j}[1] < 0.0) | ((factor_{j} * event_{j}[1] <= 0.0) & (factor_{j} * event_{j}[2] < 0.0))
sign_{j - 1} = where(on_{j} & back, -sign_{j - 1}, sign_{j - 1})"""
        for j in e
    ]
    return filled(
        SETTLED, signs=listed(signs), unpack=unpack, turn="\n".join(turn),
        on=listed(f"where(on_{j}, 1.0, 0.0)" for j in e),
    ) + filled(
        BEGUN, signs=listed(signs), states=listed(states), unpack=unpack,
        lasting=listed(f"{s} + 0.0 * side" for s in states),
        also_on=", ".join(f"on[{j - 1}]" for j in e), zeros=listed("0.0 * side" for _ in e),
    ) + f"\n\nROWS = {tuple(rows_of(states, parameters, kinks))}\n"  # fmt: skip


def advance(states, parameters, kinks, order, offset, most_kinks, tells=False, slides=False, spreads=False):
    """The text of `advance_{order}` and `run_{order}`.

    Parameters
    ----------
    offset : of the surface, as text
    most_kinks : between two switches, as text
    tells : whether the error is carried along (`source_text.error`)
    slides : whether the motion may slide along a kink (`source_text.sliding`)
    spreads : whether the error's spread is carried along
    """
    signs, ons = signs_of(kinks), [f"on_{j}" for j in range(1 + kinks)]
    errors = of_error(states, spreads) if tells else []
    rows = rows_of(states, parameters, kinks, errors)
    sizes = [f"size_{s}" for s in states]
    changed = ["stage", "shake", "time", "verdict", *sizes, *_between_events(states, kinks), *errors[1:]]
    results = {name: f"memory[{rows.index(name)}][i]" for name in ["interval", *(f"at_{s}" for s in states)]}
    values = [*_STARTS, *((name, "0.0") for name in errors[1:])]
    values += [(size, "0.0") for size in sizes]
    values += [(f"off_{s}", f"ULP * magnitude({s})") for s in states] if tells else []  # a start is rounded
    begin = filled(BEGIN, begin=begun_rows(states, signs, ons, values), blur="BLUR * tolerance")
    return filled(
        EVENT, order=order, load=loaded_rows(rows, [name for name in rows if name not in results]),
        parameters=listed(parameters), begin=begin.rstrip(), states=listed(states), signs=listed(signs),
        ons=listed(ons), offset=offset, most_kinks=most_kinks, store=stored_rows(rows, changed),
        **(_landing(states, signs, ons) | _sliding(states, signs, ons, slides)),
        **_switching(states, signs, ons, results),
        **(_telling(states, signs, spreads) if tells else dict.fromkeys(_TELLING, "")),
    )  # fmt: skip


_TELLING = "off_out", "off_in", "late", "largest", "tell", "through"


def _telling(states, signs, spreads):
    """Statements that carry the error along, and its spread."""
    offs, spread = [f"off_{s}" for s in states], [f"spread_{s}" for s in states] if spreads else []
    parts = ["latest / time", "lagged / since"]
    parts += [f"once_off_{s} / where(size_{s} > 0.0, size_{s}, 1.0)" for s in states]
    largest = {"latest": ["late"], "lagged": ["lag"], **{f"once_{name}": [name] for name in offs}}
    late, lags, through = (
        ["late, lag = fma(later, unit, late), fma(later, unit, lag)"],
        ["lag"],
        _through(states, signs, offs),
    )
    if spreads:
        for name, its in zip(largest, ["spread_late", "spread_lag", *spread], strict=True):
            largest[name].append(its)
        late.append("spread_late = fma(spread_later, unit, spread_late)")
        late.append("spread_lag = fma(spread_later, unit, spread_lag)")
        lags, through = [*lags, "spread_lag"], through + _through(states, signs, spread)
    sums = {name: " + ".join(f"magnitude({x})" for x in xs) for name, xs in largest.items()}
    return {
        "off_out": f", ({listed(offs)}), later" + f", ({listed(spread)}), spread_later" * spreads,
        "off_in": f", ({listed(offs)})" + f", ({listed(spread)})" * spreads + ", told > 0.5",
        "late": "\n".join(late),
        "largest": "\n".join(
            f"{name} = where(switches, most(FADES * {name}, {x}), {name})" for name, x in sums.items()
        ),
        "tell": f"error = where(watched, {folded('most({}, {})', parts)}, error)",
        "through": "\n".join([*through, *(f"{lag} = where(switches, 0.0, {lag})" for lag in lags)]),
    }


def _through(states, signs, changes):
    """Statements that give changes of the states what a switch leaves of them."""
    text = f"through = jump_changes(({listed(states)}), side, ({listed(signs)}), parameters, ({listed(changes)}))"
    return [text, *chosen("switches", changes, "through")]


def _landing(states, signs, ons):
    """Statements at the end of a leg."""
    return {
        "land": "\n".join(chosen("moving", states, "leg.state")),
        "sizes": "\n".join(
            f"size_{s} = where(leg.reach[{j}] > size_{s}, leg.reach[{j}], size_{s})" for j, s in enumerate(states)
        ),
        "turn": "\n".join(
            f"{s} = where(moving & ({o} > 0.5), -{s}, {s})" for s, o in zip(signs[:-1], ons[1:], strict=True)
        ),
        "come_up": "way = where(moving & (on_0 > 0.5), 1.0, way)",
    }


def _sliding(states, signs, ons, slides):
    """Statements where a motion may slide: before its first leg, behind one, before the next."""
    if not slides:
        return {"press_fresh": "", "endless": "", "press": ""}
    signs = signs[:-1]
    fresh = press("fresh", states, signs, ons, ["0.0 * side"] * len(signs))
    left = [f"where(switches, 0.0, left_{j})" for j in range(len(signs))]
    return {
        "endless": endless(signs),
        "turn": turned(signs),
        "press_fresh": f"if any_lane(fresh):\n{indent(fresh, '    ')}",
        "press": press("moving", states, signs, ons, left),
    }


def _switching(states, signs, ons, results):
    """Statements at a switch; `results` are the places in memory of what is put down there."""
    keep = {"interval": "since"} | {f"at_{s}": s for s in states}
    jump = chosen("switches", states, "jumped") + chosen("switches", signs, "signs")
    near = [
        f"where(magnitude(gaps_behind[{j}]) <= 2.0 * magnitude(gaps[{j}]), {on}, 0.0)" for j, on in enumerate(ons[1:])
    ]
    places = ["time", *results.values()]
    return {
        "shake_start": "\n".join(
            f"{s} = where(fresh, fma({2.0**-52 * (-1) ** j!r} * shake, {s}, {s}), {s})" for j, s in enumerate(states)
        ),
        "shake_event": "\n".join(
            [
                "shaken, shake = moving & (magnitude(shake) > 0.0), -shake",
                *(f"{s} = where(shaken, fma(shake * place, rate[{j}], {s}), {s})" for j, s in enumerate(states)),
            ]
        ),
        "keep": "\n".join(f"{results[r]} = where(watched, {x}, {results[r]})" for r, x in keep.items()),
        "jump": "\n".join(jump + chosen("switches", ons[1:], "kinks_on")),
        "near": listed(near),
        "nothing": "\n".join(f"{place} = where(leg.grazing, math.nan, {place})" for place in places),
    }
