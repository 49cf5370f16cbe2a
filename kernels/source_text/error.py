"""Source text of the error of a motion by Taylor series, carried along beside it: what each state is off by.

What a step leaves out is told by the defect of its polynomial U(t) of order p at the end, f(U(h)) - U'(h), which grows
as t^p, so that it comes to h/(p + 1) times that; f(U(h)) is the first coefficient of the next step. A state that is the
sum of another one, w, leaves out w_p h^(p+1)/(p + 1). As it grows, what is left out, l, changes the rates too, and with
them the states by h/(p + 2) Df l more. What rounding takes is added so that errors grow. From step to step the error
follows the tangent of the motion, of low order (`tangent`). At an event e the motion is late by
    -(De off)/(De f),                                                                                     (1)
and compared there, each at its own time, states are off by f times that more; behind it goes on what the jump leaves of
it. That is to first order; `late` is infinite, and so is the error, where the event bends, or comes so soon after the
one before, that it may not do.

Errors of some steps may cancel but for what is not known of them, and where states feed back on one another the motion
may make that large again. There what a step leaves out is taken to its next order: with l' = f(U) - U' + Df l and
l'' = f'(U) - U'' at the end, l = h (2 l'/(p + 2) - h l''/((p + 1) (p + 2))). And the *spread* is carried along as the
error is: VAGUE of what each step leaves out, added so that it grows.
"""

from kernels.source_text.rounding import sizes
from kernels.source_text.tangent import SHORT
from kernels.source_text.template import filled, listed

NONE_YET = """\
{offs} = off
{spread_before}
{nothing_yet}
"""

MARGINS = """\
{of_events} = event_changes(({states}), side, signs, parameters, ({offs}))
{margins}
"""

LEFT = """\
{defects}
{mores} = rate_changes(({at}), side, signs, parameters, ({lefts}))
{closer}
{added}"""

STEP = """\
{deltas} = tangent_{order}(({states}), side, signs, parameters, unit, inner, ({offs}){cores})
{sways}
{no_weight}
if any_lane(steps):
    {noises} = made_of_rates(({states}), side, signs, parameters)
    {carried}
    weight = where({plain}, trial * {share}, 0.0)
    {left}
"""

END = """\
{noises} = made_of_rates(({states}), side, signs, parameters)
{rates} = rates(({ends}), side, signs, parameters)
{at_end}
weight = {weight} * {share}
{left}
{of_events} = event_changes(({ends}), side, signs, parameters, ({offs}))
{per_time} = event_changes(({ends}), side, signs, parameters, ({rates}))
{made} = made_of_events(({ends}), side, signs, parameters)
{cut_off}
change, noise, slope_of, bend = change_0, noise_0 + magnitude(offset_0), slope_0, {bend_0}
{choices}
by = -further(change, ULP * noise) / (unit * slope_of)
doubtful = (magnitude(bend * by) * STRAIGHT > magnitude(unit * slope_of)) | (magnitude(by) * ORDERLY > t)
late = where({doubtful}, math.inf, by)
{moved}
{spread_at_end}
"""

SPREAD_AT_END = """\
{of_spread} = event_changes(({ends}), side, signs, parameters, ({spreads}))
vague = vague_0
{choices}
spread_late = -vague / (unit * slope_of)
{moved}"""

CHOICE = """\
own = {own}
change, noise = where(own, change_{j}, change), where(own, noise_{j} + magnitude(offset_{j}), noise)
slope_of, bend = where(own, slope_{j}, slope_of), where(own, {bend}, bend)"""


def of_error(writer):
    """Texts of what rounding and changes of the states do to rates, events, and the state behind a switch."""
    recorded, moving = writer.recorded, ("state", "side", "signs", "parameters", "changes")
    of = writer.tangents.of
    values = [recorded.graph.multiply(factor, u) for _, factor, u in recorded.events]
    events = [of(x) for x in values]
    jumps = [of(u) for u in recorded.switched]
    nothing = recorded.graph.of(0.0)
    made = "What the {} are made of, in size: an ulp of it is what rounding takes."
    return [
        sizes(writer, "made_of_rates", made.format("rates"), recorded.rates),
        sizes(writer, "made_of_events", made.format("events but for their offsets"), values),
    ] + [
        writer.function(name, doc, [nothing if x is None else x for x in found], moving)
        for name, doc, found in (
            ("rate_changes", "What changes of the states change of each rate.", [of(x) for x in recorded.rates]),
            ("event_changes", "What changes of the states change of each event's value.", events),
            ("jump_changes", "What changes of the states before a switch are behind it.", jumps),
        )
    ]


MARGIN = "margin_{j} = where(told, fma(DOUBT, magnitude(change_{j}), margin_{j}), margin_{j})"
MOVED = "{off}_{s} = fma(unit * rate_{s}, {late}, {off}_{s})"


def carried(source):
    """The texts within a leg, by their places; `source` is its `LegSource`."""
    states, events, plain = source.states, range(source.events), _plain(source)
    one, core = _common(source), _off_core(source)
    now, series = "full_{s}" if core else "s_{s}[1]", [(f"delta_{s}", source.short) for s in states]
    series += [(f"sway_{s}", SHORT[source.order]) for s in _spread(source)]
    no_weight = ["weight = 0.0 * h", *(f"left_{s} = 0.0 * h" for s in _left_later(source))]
    steps = [f"off_{s} = where(steps, {_off_after(source, s, 'trial')}, off_{s})" for s in states]
    steps += [f"spread_{s} = where(steps, {_after(source, s, 'trial', 'spread')}, spread_{s})" for s in _spread(source)]
    return {
        "off_before": filled(
            NONE_YET, **one, spread_before=f"{one['spreads']} = spread" if source.spreads else "",
            nothing_yet="\n".join(
                [f"{x} = ({listed(['0.0 * h'] * (n + 1))})" for x, n in series]
                + [f"due_{s}, bent_{s} = 0.0 * h, 0.0 * h" for s in plain]
                + no_weight
            ),
        ),
        "off_margins": filled(MARGINS, **one, margins="\n".join(MARGIN.format(j=j) for j in events)),
        "off_since": _left(
            source, one, one["states"],
            [f"{now.format(s=s)} - due_{s}" for s in plain], [f"2.0 * s_{s}[2] - bent_{s}" for s in plain],
        ),
        "off_step": filled(
            STEP, **one, plain=f"steps & {core}" if core else "steps", carried="\n".join(steps),
            sways=SWAYS.format(**one) if source.spreads else "", no_weight="\n".join(no_weight),
            left="\n".join(
                [f"due_{s} = slope(trial, s_{s})" for s in plain]
                + [f"bent_{s} = curvature(trial, s_{s})" for s in plain if _closer(source)]
                + _left_of_sums(source, "trial")
            ),
        ),
        "off_end": _end(source, one, core),
        "off_in": f", off{', spread' * source.spreads}, told",
        "inner": ", inner" + ", rough_inner" * source.spreads,
        "off_out": f", ({one['offs']}), late" + f", ({one['spreads']}), spread_late" * source.spreads,
        "off_doc": ", what each state is off by (`off`: at the start; `told`: where to heed it), how late it is",
    }  # fmt: skip


SWAYS = "{sways_of} = rough_tangent_{order}(({states}), side, signs, parameters, unit, rough_inner, ({spreads}){cores})"


def _plain(source):
    """The states that are not the sum of another one."""
    return [s for s in source.states if s not in source.summed]


def _spread(source):
    """The states whose spread is carried."""
    return source.states if source.spreads else []


def _off_core(source):
    """That the motion is in no power's core, as text; empty where there is no power."""
    return " & ".join(f"(at_core_{i} < 0.0)" for i in range(len(source.kinks_of_powers)))


def _common(source):
    """Parts of more than one text."""
    states, events, powers = source.states, range(source.events), range(len(source.kinks_of_powers))
    lists = {"offs": "off", "noises": "noise", "deltas": "delta", "spreads": "spread", "sways_of": "sway"}
    lists |= {"ends": "end", "lefts": "left", "mores": "more", "rates": "rate"}
    return {name: listed(f"{prefix}_{s}" for s in states) for name, prefix in lists.items()} | {
        "states": listed(states),
        "order": source.order,
        "share": repr(1.0 / (source.order + 1)),
        "of_events": listed(f"change_{j}" for j in events),
        "cores": f", ({listed(f'at_core_{i}' for i in powers)})" if powers else "",
    }


def not_carried():
    """The same places, empty."""
    places = ("before", "margins", "since", "step", "end", "in", "out", "doc")
    return {"inner": ""} | {f"off_{place}": "" for place in places}


def _closer(source):
    """Whether what a step leaves out is taken to its next order, for which a power's core has no derivative."""
    return source.spreads and not source.kinks_of_powers


def _left(source, one, at, defects, bends):
    """The text that adds what a step of the length `weight` (p + 1) has left out.

    `defects` and `bends` are f - U' and f' - U'' of the states of `_plain`, as text.
    """
    n, plain = source.order + 1, _plain(source)
    if not source.spreads:
        return "\n".join(f"off_{s} = fma(weight, {d}, off_{s})" for s, d in zip(plain, defects, strict=True))
    left = [f"left_{s} = weight * ({defect})" for s, defect in zip(plain, defects, strict=True)]
    share, twice = f"weight * {n / (n + 1)!r}", 2 * n / (n + 1)
    closer = [
        f"left_{s} = fma({share}, unit * more_{s} - weight * ({bend}), {twice!r} * left_{s})"
        for s, bend in zip(plain, bends, strict=True)
    ]
    added = [f"off_{s} = fma({share}, unit * more_{s}, off_{s} + left_{s})" for s in source.states]
    added += [f"spread_{s} = further(spread_{s}, VAGUE * magnitude(left_{s}))" for s in _spread(source)]
    return filled(
        LEFT, **one, at=at, defects="\n".join(left), closer="\n".join(closer if _closer(source) else []),
        added="\n".join(added),
    )  # fmt: skip


def _left_later(source):
    """The states that are the sum of another one, and which, where what that leaves out is of use for others."""
    return source.summed if source.spreads else {}


def _left_of_sums(source, x):
    """What a step to x leaves out of states that are the sum of another one, as statements."""
    n = source.order + 1
    power = f"unit * natural_power({x}, {n}) * {1 / n!r}"
    return [f"left_{s} = where(weight > 0.0, {power} * s_{w}[-1], 0.0)" for s, w in _left_later(source).items()]


def _after(source, s, x, off):
    """What a state is off by after a step, or its spread, but for what the step leaves out."""
    series = {"off": "delta", "spread": "sway"}[off]
    if s in source.summed:
        return f"fma(unit * {x}, mean({x}, {series}_{source.summed[s]}), {off}_{s})"
    return f"horner({x}, {series}_{s})"


def _off_after(source, s, x):
    """The same with what rounding and cores of powers take, and of a sum all that is not added later."""
    text = _after(source, s, x, "off")
    if s in source.summed and s not in _left_later(source):
        n = source.order + 1
        text = f"fma(unit * s_{source.summed[s]}[-1], natural_power({x}, {n}) * {1 / n!r}, {text})"
    text = f"further({text}, ULP * fma({x} * unit, noise_{s}, magnitude({s})))"
    for i in range(len(source.kinks_of_powers)):
        text = f"further({text}, coarse_{i}[{source.states.index(s)}])"
    return text


def _end(source, one, core):
    """The text at the end of a leg."""
    states, events = source.states, range(source.events)
    at_end = [f"off_{s} = {_off_after(source, s, 'end')}" for s in states]
    at_end += [f"spread_{s} = {_after(source, s, 'end', 'spread')}" for s in _spread(source)]
    defects = [f"unit * rate_{s} - slope(end, s_{s})" for s in _plain(source)]
    bends = [f"unit * unit * rate_of_rate_{s} - curvature(end, s_{s})" for s in _plain(source)]
    left = [*_left_of_sums(source, "end"), _left(source, one, one["ends"], defects, bends)]
    if _closer(source):
        of_rates = listed(f"rate_of_rate_{s}" for s in states)
        left.insert(0, f"{of_rates} = rate_changes(({one['ends']}), side, signs, parameters, ({one['rates']}))")
    bends = [f"factor_{j} * {_at_end(source, j)}[2]" for j in events]
    choices = [CHOICE.format(j=j, own=source.own(j), bend=bends[j]) for j in events[1:]]
    power = f"natural_power(end, {source.order} - 1)"
    cut_off = [
        f"change_{j} = further(change_{j}, magnitude(factor_{j}) * last_term(end, event_{j}) * {power})"
        for j in events
        if not source.seen[j]
    ]
    doubtful = ["doubtful"]
    doubtful += [f"(beside_{j} & not_({source.own(j)}))" for j in events] if len(events) > 1 else []
    return filled(
        END, **one, cut_off="\n".join(cut_off), at_end="\n".join(at_end),
        weight=f"where({core}, end, 0.0)" if core else "end",
        left="\n".join(left), per_time=listed(f"slope_{j}" for j in events), bend_0=bends[0],
        made=listed(f"noise_{j}" for j in events), choices="\n".join(choices), doubtful=" | ".join(doubtful),
        moved="\n".join(MOVED.format(s=s, off="off", late="late") for s in states),
        spread_at_end=_spread_at_end(source, one) if source.spreads else "",
    )  # fmt: skip


def _spread_at_end(source, one):
    """The text that takes the spread over the event."""
    choices = [f"vague = where({source.own(j)}, vague_{j}, vague)" for j in range(1, source.events)]
    return filled(
        SPREAD_AT_END, **one, of_spread=listed(f"vague_{j}" for j in range(source.events)),
        choices="\n".join(choices),
        moved="\n".join(MOVED.format(s=s, off="spread", late="spread_late") for s in source.states),
    )  # fmt: skip


def _at_end(source, j):
    """Value, rate and bend at the end of what the event watches, as text."""
    at, curve = source.curve(j)[0].split(", ", 1)
    return f"{at}(end, {curve})"
