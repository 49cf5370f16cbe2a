"""Source text of the error of a motion by Taylor series, carried along beside it: what each state is off by.

What a step leaves out is told by the defect of its polynomial U(t) of order p at the end, f(U(h)) - U'(h), which grows
as t^p, so that it comes to h/(p + 1) times that; f(U(h)) is the first coefficient of the next step. A state that is the
sum of another one, w, leaves out w_p h^(p+1)/(p + 1). What rounding takes is added so that errors grow. From step to
step the error follows the tangent of the motion, of low order (`tangent`). At an event e the motion is late by
    -(De off)/(De f),                                                                                     (1)
and compared there, each at its own time, states are off by f times that more; behind it goes on what the jump leaves of
it. That is to first order; `late` is infinite, and so is the error, where the event bends, or comes so soon after the
one before, that it may not do.
"""

from kernels.codegen.rounding_source import sizes
from kernels.codegen.template import filled, listed

NONE_YET = """\
{offs} = off
{no_deltas}
{no_dues}
weight, late = 0.0 * h, 0.0 * h
"""

MARGINS = """\
{of_events} = event_changes(({states}), side, signs, parameters, ({offs}))
{margins}
"""

STEP = """\
{deltas} = tangent_{order}(({states}), side, signs, parameters, unit, inner, ({offs}){cores})
weight = 0.0 * h
if any_lane(steps):
    {noises} = made_of_rates(({states}), side, signs, parameters)
    {carried}
    weight = where({plain}, trial * {share}, 0.0)
"""

END = """\
{noises} = made_of_rates(({states}), side, signs, parameters)
{rates} = rates(({ends}), side, signs, parameters)
{at_end}
{of_events} = event_changes(({ends}), side, signs, parameters, ({offs}))
{per_time} = event_changes(({ends}), side, signs, parameters, ({rates}))
{made} = made_of_events(({ends}), side, signs, parameters)
change, noise, slope_of, bend = change_0, noise_0 + magnitude(offset_0), slope_0, {bend_0}
{choices}
by = -further(change, ULP * noise) / (unit * slope_of)
doubtful = (magnitude(bend * by) * STRAIGHT > magnitude(unit * slope_of)) | (magnitude(by) * ORDERLY > t)
late = where(met, where({doubtful}, math.inf, by), late)
{moved}
"""

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
            ("event_changes", "What changes of the states change of each event's value.", events),
            ("jump_changes", "What changes of the states before a switch are behind it.", jumps),
        )
    ]


MARGIN = "margin_{j} = where(told, fma(DOUBT, magnitude(change_{j}), margin_{j}), margin_{j})"
DEFECT = "off_{s} = where(met, fma({weight} * {share}, unit * rate_{s} - slope(end, s_{s}), off_{s}), off_{s})"
MOVED = "off_{s} = where(met, fma(unit * rate_{s}, late, off_{s}), off_{s})"


def carried(source):
    """The texts within a leg, by their places; `source` is its `LegSource`."""
    states, events, plain = source.states, range(source.events), _plain(source)
    one, core = _common(source), _off_core(source)
    zeros, now = listed(["0.0 * h"] * (source.short + 1)), "full_{s}" if core else "s_{s}[1]"
    steps = [f"off_{s} = where(steps, {_after(source, s, 'trial')}, off_{s})" for s in states]
    return {
        "off_before": filled(
            NONE_YET, **one, no_deltas="\n".join(f"delta_{s} = ({zeros})" for s in states),
            no_dues="\n".join(f"due_{s} = 0.0 * h" for s in plain),
        ),
        "off_margins": filled(MARGINS, **one, margins="\n".join(MARGIN.format(j=j) for j in events)),
        "off_since": "\n".join(f"off_{s} = fma(weight, {now.format(s=s)} - due_{s}, off_{s})" for s in plain),
        "off_step": filled(
            STEP, **one, plain=f"steps & {core}" if core else "steps",
            carried="\n".join(steps + [f"due_{s} = slope(trial, s_{s})" for s in plain]),
        ),
        "off_end": _end(source, one, core),
        "off_in": ", off, told", "inner": ", inner", "off_out": f", ({one['offs']}), late",
        "off_doc": ", what each state is off by (`off`: at the start; `told`: where to heed it), how late it is",
    }  # fmt: skip


def _plain(source):
    """The states that are not the sum of another one."""
    return [s for s in source.states if s not in source.summed]


def _off_core(source):
    """That the motion is in no power's core, as text; empty where there is no power."""
    return " & ".join(f"(at_core_{i} < 0.0)" for i in range(len(source.kinks_of_powers)))


def _common(source):
    """Parts of more than one text."""
    states, events, powers = source.states, range(source.events), range(len(source.kinks_of_powers))
    lists = {"offs": "off", "noises": "noise", "deltas": "delta"}
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


def _after(source, s, x):
    """What a state is off by after a step, but for the defect of one that is not the sum of another."""
    if s in source.summed:
        w, n = source.summed[s], source.order + 1
        text = f"fma(unit * {x}, mean({x}, delta_{w}), off_{s})"
        text = f"fma(unit * s_{w}[-1], natural_power({x}, {n}) * {1 / n!r}, {text})"
    else:
        text = f"horner({x}, delta_{s})"
    text = f"further({text}, ULP * fma({x} * unit, noise_{s}, magnitude({s})))"
    for i in range(len(source.kinks_of_powers)):
        text = f"further({text}, coarse_{i}[{source.states.index(s)}])"
    return text


def _end(source, one, core):
    """The text at the end of a leg."""
    states, events, weight = source.states, range(source.events), f"where({core}, end, 0.0)" if core else "end"
    at_end = [f"off_{s} = where(met, {_after(source, s, 'end')}, off_{s})" for s in states]
    at_end += [DEFECT.format(s=s, weight=weight, share=one["share"]) for s in _plain(source)]
    bends = [f"factor_{j} * {_at_end(source, j)}[2]" for j in events]
    choices = [CHOICE.format(j=j, own=source.own(j), bend=bends[j]) for j in events[1:]]
    doubtful = ["doubtful"]
    doubtful += [f"(beside_{j} & not_({source.own(j)}))" for j in events] if len(events) > 1 else []
    return filled(
        END, **one, rates=listed(f"rate_{s}" for s in states), ends=listed(f"end_{s}" for s in states),
        at_end="\n".join(at_end), per_time=listed(f"slope_{j}" for j in events), bend_0=bends[0],
        made=listed(f"noise_{j}" for j in events), choices="\n".join(choices), doubtful=" | ".join(doubtful),
        moved="\n".join(MOVED.format(s=s) for s in states),
    )  # fmt: skip


def _at_end(source, j):
    """Value, rate and bend at the end of what the event watches, as text."""
    at, curve = source.curve(j)[0].split(", ", 1)
    return f"{at}(end, {curve})"
