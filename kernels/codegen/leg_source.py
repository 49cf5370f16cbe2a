"""Source text of a scene's motion from event to event: what does not fit in one function for all scenes.

The text is of named scalars, one statement per event; what can be said once for all scenes is in `taylor`.
"""

from kernels.codegen.template import filled, folded, listed

LEG = '''
@jit_call
def doubted_{order}(trial, unsure, facts, series):
    """Steps of the unsure lanes halved until each event is proved to fall or to stay clear; which fall."""
    stays_apart(trial)
    {unpack_facts}
    {unpack_series}
    for _ in range(HALVINGS):
        {judge_all}
        known = {all_known}
        {falls_of_unsure}
        unsure = unsure & isnt(known)
        if not some(unsure):
            break
        trial = where(unsure, 0.5 * trial, trial)
    return trial, unsure, {no_falls}


@jit_call
def to_event_{order}(state, side, signs, parameters, unit, h, on, tolerance, active):
    """Follow the motion of the active lanes until an event falls through 0, and stop there.

    Parameters
    ----------
    unit : of time, in seconds
    h : first guess of a step, in units
    on : for each event 1 where the motion starts on it, else 0
    tolerance : of a step, relative to each state's own size

    Returns
    -------
    state, t, h, on : at the event, after the time t; `on` is 1 for the event that fired, and for what fell with it
    stuck, lost, broken : pressed on what it started on; not there within limits; coefficients that are no numbers
    grazing, hangs : neither met nor missed for sure; met, but only just
    tried : steps
    """
    {states} = state
    {ons} = on
    moving, t, span, tried = active, 0.0 * h, h, 0.0 * h
    nothing = active & isnt(active)
    {no_passed} = {nothings}
    {no_now} = {nothings}
    {no_margins}
    stuck, lost, broken, grazing = nothing, nothing, nothing, nothing
    power_h, allowed = natural_power(h, {order} - 1), SLACK * tolerance
    {longest}
    for step in range(STEP_LIMIT):
        {cores}
        {series_and_events} = series_{order}(({states}), side, signs, parameters, unit{all_cores})
        {facts}
        left_out, over = {left_out}
        ratio = where(left_out <= 0.0, 0.0, left_out * power_h / (tolerance * over))
        h = where(moving, next_step(h, ratio, {order}), h)
        {no_longer}
        {not_longest}
        power_h = natural_power(h, {order} - 1)
        fine = {keeps}
        trial = h
        if step == 0:
            {sum_last}
            broken = active & isnt(last < math.inf)
            {start}
            stuck = active & ({any_stuck})
            trial = where({any_now}, 0.0, h)
            {margins}
            moving = moving & isnt(broken | stuck)
        tried = where(moving, tried + 1.0, tried)
        {look}
        {judge}
        unsure = moving{and_seen} & isnt({all_sure})
        if some(unsure):
            trial, unsure, {no_falls} = doubted_{order}(
                trial, unsure, ({facts_of_all}), ({series_of_all})
            )
        grazing = grazing | unsure
        moving = moving & isnt(unsure)
        steps = moving & fine{and_seen}
        {ends}
        {passed}
        meets = steps & ({any_passed})
        span = where(meets, trial, span)
        steps = steps & isnt(meets)
        {advance}
        t = where(steps, t + trial, t)
        {off}
        moving = moving & isnt(meets)
        if not some(moving):
            break
    lost = moving
    met = active & isnt(lost | stuck | broken | grazing)
    part, which, hangs = span, -1.0 - 0.0 * h, nothing
    {roots}
    {with_it}
    {at_root}
    {on_kink}
    t = where(met, t + part, t)
    h = where(met & (t > 0.0) & (h > LONGEST * t), LONGEST * t, h)
    return ({final}), t, h, ({fired}), stuck, lost, broken, grazing, hangs, tried
'''


LOOK = """\
of_rates, of_events = hidden(({states}), ({boxes}), side, signs, parameters)
{power}
seen = {all_seen}
longest = where(seen, longest / COME_UP, COME_UP * trial)"""


def look(states, order, hides):
    """The text of what a step may hide; none where rates and events hide nothing.

    Of an event that can, the series is asked for its last term too, for the states' do not tell of it.
    """
    rates, events = hides
    seen = [
        f"(unit * trial * of_rates[{i}] <= tolerance * size(trial, s_{s}))" for i, s in enumerate(states) if rates[i]
    ]
    seen += [
        f"(most(of_events[{j}], magnitude(factor_{j}) * last_term(trial, event_{j}) * power_trial) "
        f"<= tolerance * (magnitude(offset_{j}) + magnitude(factor_{j}) * size(trial, event_{j})))"
        for j, hides_some in enumerate(events)
        if hides_some
    ]
    power = f"power_trial = natural_power(trial, {order} - 1)" if any(events) else ""
    boxes = listed(f"box(trial, s_{s})" for s in states)
    return seen and filled(LOOK, states=listed(states), boxes=boxes, power=power, all_seen=" & ".join(seen))


def leg(states, events, order, nested=0, summed=(), seen=(), kinks_of_powers=(), hides=((), ())):
    """The text of `to_event_{order}`: `states` are names, `events` the number of events."""
    e = range(events)

    def state_at(s, x):
        return f"fma(unit * {x}, mean({x}, s_{summed[s]}), {s})" if s in summed else f"horner({x}, s_{s})"

    def seen_at(j, x):
        return state_at(seen[j], x) if seen[j] else f"horner({x}, event_{j})"

    def curve(j):
        """Of what the event watches: how it is evaluated, its value at the start of the step."""
        s = seen[j]
        if s in summed:
            return f"of_sum, ({s}, unit, s_{summed[s]})", s
        return f"of_series, (event_{j},)", f"event_{j}[0]"

    def root(j):
        among = f"first = first & ((which < 0.0) | (fma(factor_{j}, {seen_at(j, 'part')}, offset_{j}) <= 0.0))"
        watched, value = curve(j)
        return f"""\
first = met & passed_{j}
if some(first):
    {among if j else "# whatever else passed in this step"}
    at, only_just = crossing({watched}, (offset_{j}, factor_{j}, {value}), span, tolerance, first)
    part, which, hangs = where(first, at, part), where(first, {j}.0, which), (hangs & isnt(first)) | only_just"""

    def with_it(j):
        return (
            f"beside_{j} = met & passed_{j} & (magnitude(fma(factor_{j}, {seen_at(j, 'part')}, offset_{j}))"
            f" <= fma(SAME, tolerance, ROUNDING) * (magnitude(offset_{j}) + magnitude(factor_{j} * event_{j}[0])))"
        )

    def fires(j):
        own = f"met & (which > {j - 0.5}) & (which < {j + 0.5})"
        return f"beside_{j} | ({own})" if events > 1 else own

    facts = [
        f"""\
e_{j}, d_{j} = fma(factor_{j}, event_{j}[0], offset_{j}), factor_{j} * event_{j}[1]
dd_{j}, ddd_{j} = factor_{j} * event_{j}[2], factor_{j} * event_{j}[3]"""
        for j in e
    ]
    start = [
        f"""\
away_{j} = (d_{j} > 0.0) | ((d_{j} >= 0.0) & (dd_{j} > 0.0))
now_{j} = (on_{j} < 0.5) & (e_{j} <= 0.0)"""
        for j in e
    ]
    margins = [
        f"margin_{j} = SLACK * tolerance * (magnitude(offset_{j}) + magnitude(factor_{j} * event_{j}[0]))" for j in e
    ]
    by_tails = [
        f"""\
rest_{j} = {"tail" if j else "magnitude(factor_0) * tail"}(trial, event_{j})
clear_{j} = clear(e_{j}, d_{j}, dd_{j}, ddd_{j}, rest_{j}, trial, margin_{j})
falls_{j} = falls(d_{j}, dd_{j}, ddd_{j}, rest_{j}, trial) | now_{j}"""
        for j in e
    ]
    by_kink = f"""\
lead = where(e_{nested} > 0.0, d_0, 0.0)
clear_0 = rises(lead, dd_0) & (clear_{nested} | falls_{nested})
falls_0 = (rises(-lead, -dd_0) & clear_{nested}) | now_0"""
    judge = [*by_tails[1:], by_kink] if nested else by_tails
    doubt = [
        f"""\
rest_{j} = {"tail" if j else "magnitude(factor_0) * tail"}(trial, event_{j})
clear_{j} = clear(e_{j}, d_{j}, dd_{j}, ddd_{j}, rest_{j}, trial, margin_{j})
down_{j} = falls(d_{j}, dd_{j}, ddd_{j}, rest_{j}, trial) | now_{j}"""
        for j in e
    ]

    on_kink = [(1 + j, seen[1 + j]) for j in sorted(set(kinks_of_powers))]
    cores = [
        f"at_core_{i}, longest_{i} = "
        f"core_{i}(({listed(states)}), side, signs, parameters, unit, tolerance,"
        f" (on_{1 + j} > 0.5) & (t <= 0.0), t, margin_{1 + j})"
        for i, j in enumerate(kinks_of_powers)
    ]
    each = ("e", "d", "dd", "ddd", "margin", "now", "falls")
    facts_of = [f"{name}_{j}" for j in e for name in each]
    passed = [f"passed_{j} = passed_{j} | (steps & falls_{j} & (end_{j} <= 0.0))" for j in e]
    looked = look(states, order, hides)
    parts = {
        "longest": "longest = 0.0 * h + FAR" if looked else "",
        "not_longest": "h = where(h < longest, h, longest)" if looked else "",
        "look": looked or "",
        "and_seen": " & seen" if looked else "",
        "series_and_events": ", ".join(
            [f"s_{s}" for s in states] + [f"(offset_{j}, factor_{j}, event_{j})" for j in e]
        ),
        "sum_last": "last = " + " + ".join(f"magnitude(s_{s}[-1])" for s in states),
        "facts": "\n".join(facts),
        "start": "\n".join(start),
        "margins": "\n".join(margins),
        "any_stuck": " | ".join(f"((on_{j} > 0.5) & isnt(away_{j}))" for j in e),
        "any_now": " | ".join(f"now_{j}" for j in e),
        "nothings": listed(["nothing"] * events),
        "no_passed": listed(f"passed_{j}" for j in e),
        "no_now": listed(f"now_{j}" for j in e),
        "no_margins": "\n".join(f"margin_{j} = 0.0 * h" for j in e),
        "judge": "\n".join(judge),
        "judge_all": "\n".join(doubt),
        "all_known": " & ".join(f"(clear_{j} | down_{j})" for j in e),
        "falls_of_unsure": "\n".join(f"falls_{j} = (unsure & down_{j}) | (falls_{j} & isnt(unsure))" for j in e),
        "no_falls": ", ".join(f"falls_{j}" for j in e),
        "facts_of_all": ", ".join(["factor_0", *facts_of]),
        "series_of_all": listed(f"event_{j}" for j in e),
        "unpack_facts": ", ".join(["factor_0", *facts_of]) + " = facts",
        "unpack_series": listed(f"event_{j}" for j in e) + " = series",
        "all_sure": " & ".join(f"(clear_{j} | falls_{j})" for j in e),
        "ends": "\n".join(
            [f"end_{s} = {state_at(s, 'trial')}" for s in states]
            + [
                f"end_{j} = fma(factor_{j}, {f'end_{seen[j]}' if seen[j] else seen_at(j, 'trial')}, offset_{j})"
                for j in e
            ]
        ),
        "passed": "\n".join(passed),
        "any_passed": " | ".join(f"passed_{j}" for j in e),
        "advance": "\n".join(f"{s} = where(steps, end_{s}, {s})" for s in states),
        "off": "\n".join(f"now_{j} = now_{j} & meets" for j in e),
        "cores": "\n".join(cores),
        "all_cores": f", ({listed(f'at_core_{i}' for i in range(len(cores)))})" if cores else "",
        "no_longer": "\n".join(f"h = where(h < longest_{i}, h, longest_{i})" for i in range(len(cores))),
        "roots": "\n".join(root(j) for j in e),
        "at_root": "\n".join(f"end_{s} = where(met, {state_at(s, 'part')}, {s})" for s in states),
        "on_kink": "\n".join(f"end_{u} = where({fires(j)}, 0.0 * end_{u}, end_{u})" for j, u in on_kink),
        "final": listed(f"end_{s}" for s in states),
        "with_it": "\n".join(with_it(j) for j in e) if events > 1 else "",
        "fired": listed(f"where({fires(j)}, 1.0, 0.0)" for j in e),
        "left_out": folded("worse({}, {})", [f"(last_term(h, s_{s}), size(h, s_{s}))" for s in states]),
        "keeps": " & ".join(f"keeps(h, power_h, s_{s}, allowed)" for s in states),
        "states": listed(states),
        "ons": listed(f"on_{j}" for j in e),
    }
    return filled(LEG, order=order, **parts)
