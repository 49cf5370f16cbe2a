"""Source text of a scene's motion from event to event: what does not fit in one function for all scenes.

The text is of named scalars, one statement per event; what can be said once for all scenes is in `taylor`.
"""

from dataclasses import dataclass

from kernels.source_text.error import carried, not_carried
from kernels.source_text.tangent import short
from kernels.source_text.template import filled, folded, listed

LEG = '''
@jit_call
def doubted_{order}(trial, unsure, facts, series):
    """Steps of the unsure lanes halved until each event is proved to fall or to stay clear; which fall."""
    stays_apart(trial)
    {unpack_facts}
    {unpack_series}
    for _ in range(HALVINGS):
        {judge_all}
        proved = {all_proved}
        {falls_of_unsure}
        unsure = unsure & not_(proved)
        if not any_lane(unsure):
            break
        trial = where(unsure, 0.5 * trial, trial)
    return trial, unsure, {no_falls}


@jit_call
def to_event_{order}(state, side, signs, parameters, unit, h, on, tolerance, active{off_in}):
    """Follow the motion of the active lanes until an event falls through 0, and stop there.

    Parameters
    ----------
    unit : of time, in seconds
    h : first guess of a step, in units
    on : for each event 1 where the motion starts on it, else 0
    tolerance : of a step, relative to each state's own size

    Returns
    -------
    Leg{off_doc}
    """
    {states} = state
    {ons} = on
    moving, t, span, tried = active, 0.0 * h, h, 0.0 * h
    nothing = active & not_(active)
    {no_passed} = {nothings}
    {no_now} = {nothings}
    {no_margins}
    stuck, lost, broken, grazing = nothing, nothing, nothing, nothing
    power_h, allowed = natural_power(h, {order} - 1), SLACK * tolerance
    {longest}
    {reach}
    {off_before}
    for step in range(STEP_LIMIT):
        {cores}
        {series_and_events}{inner} = series_{order}(({states}), side, signs, parameters, unit{all_cores})
        {off_since}
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
            broken = active & not_(last < math.inf)
            {start}
            stuck = active & ({any_stuck})
            trial = where({any_now}, 0.0, h)
            {margins}
            {off_margins}
            moving = moving & not_(broken | stuck)
        tried = where(moving, tried + 1.0, tried)
        {look}
        {judge}
        unsure = moving{and_seen} & not_({all_sure})
        if any_lane(unsure):
            trial, unsure, {no_falls} = doubted_{order}(
                trial, unsure, ({facts_of_all}), ({series_of_all})
            )
        broken = broken | (unsure & not_(power_h < FAR))  # it goes off to where no event is
        grazing = grazing | (unsure & not_(broken))
        moving = moving & not_(unsure)
        steps = moving & fine{and_seen}
        {ends}
        {passed}
        meets = steps & ({any_passed})
        span = where(meets, trial, span)
        steps = steps & not_(meets)
        {off_step}
        {advance}
        {reach_on}
        t = where(steps, t + trial, t)
        {off}
        moving = moving & not_(meets)
        if not any_lane(moving):
            break
    lost = moving
    met = active & not_(lost | stuck | broken | grazing)
    end, which, hangs = span, -1.0 - 0.0 * h, nothing
    {roots}
    {with_it}
    {at_root}
    {on_kink}
    t = where(met, t + end, t)
    h = where(met & (t > 0.0) & (h > LONGEST * t), LONGEST * t, h)
    {off_end}
    {reach_end}
    return Leg(({final}), t, h, ({fired}), stuck, lost, broken, grazing, hangs, tried, ({reaches})){off_out}
'''


LOOK = """\
of_rates, of_events = hidden(({states}), ({boxes}), side, signs, parameters)
{power}
seen = {all_seen}
longest = where(seen, longest / COME_UP, COME_UP * trial)"""


FACTS = """\
e_{j}, d_{j} = fma(factor_{j}, event_{j}[0], offset_{j}), factor_{j} * event_{j}[1]
dd_{j}, ddd_{j} = factor_{j} * event_{j}[2], factor_{j} * event_{j}[3]"""

START = """\
away_{j} = (d_{j} > 0.0) | ((d_{j} >= 0.0) & (dd_{j} > 0.0))
now_{j} = (on_{j} < 0.5) & (e_{j} <= 0.0)"""

MARGIN = "margin_{j} = SLACK * tolerance * (magnitude(offset_{j}) + magnitude(factor_{j} * event_{j}[0]))"

CLEAR = "clear_{j} = clear(e_{j}, d_{j}, dd_{j}, ddd_{j}, rest_{j}, trial, margin_{j})"

FALLS = "falls(d_{j}, dd_{j}, ddd_{j}, rest_{j}, trial) | now_{j}"

BY_KINK = """\
lead = where(e_{nested} > 0.0, d_0, 0.0)
clear_0 = rises(lead, dd_0) & (clear_{nested} | falls_{nested})
falls_0 = (rises(-lead, -dd_0) & clear_{nested}) | now_0"""

ROOT = """\
first = met & passed_{j}
if any_lane(first):
    {among}
    event, facts = (offset_{j}, factor_{j}, {value}), (e_{j}, d_{j}, dd_{j}, ddd_{j})
    at, only_just = crossing({watched}, event, facts, span, tolerance, first)
    end, which, hangs = where(first, at, end), where(first, {j}.0, which), (hangs & not_(first)) | only_just"""


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


def leg(writer, order, hides, tells=False):
    """The text of `to_event_{order}`.

    Parameters
    ----------
    hides : of each rate and of each event, whether it can hide anything
    tells : whether the error is carried along (`source_text.error`)
    """
    source = LegSource(
        writer.states,
        1 + writer.kinks,
        order,
        writer.recorded.nested,
        writer.summed(),
        writer.seen(),
        writer.kinks_of_powers(),
        hides,
        tells,
        short(writer, order),
        writer.feeds_back(),
    )
    return source.text()


@dataclass(frozen=True)
class LegSource:
    """What the text of a leg is made of.

    states : names
    events : how many
    order : of the series
    nested : number of the kink whose u is the rate of the surface; 0: none
    summed : the states whose rate is another state, and which
    seen : for each event the state that it watches, or None
    kinks_of_powers : for each power its kink
    hides, tells : see `leg`
    short : order of the changes' series
    spreads : whether the error's spread is carried along too
    """

    states: list
    events: int
    order: int
    nested: int
    summed: dict
    seen: list
    kinks_of_powers: list
    hides: tuple
    tells: bool
    short: int
    spreads: bool

    def text(self):
        return filled(
            LEG,
            order=self.order,
            states=listed(self.states),
            **self._events(),
            **self._facts(),
            **self._start(),
            **self._proofs(),
            **self._doubts(),
            **self._look(),
            **self._cores(),
            **self._step(),
            **self._roots(),
            **(carried(self) if self.tells else not_carried()),
        )

    def _each(self, pattern):
        """The pattern for each event, `{j}` its number."""
        return [pattern.format(j=j) for j in range(self.events)]

    def _lines(self, pattern):
        return "\n".join(self._each(pattern))

    def _state_at(self, s, x):
        return f"fma(unit * {x}, mean({x}, s_{self.summed[s]}), {s})" if s in self.summed else f"horner({x}, s_{s})"

    def _seen_at(self, j, x):
        """What an event watches."""
        return self._state_at(self.seen[j], x) if self.seen[j] else f"horner({x}, event_{j})"

    def _events(self):
        """Tuples with an entry for each event."""
        return {
            "ons": listed(self._each("on_{j}")),
            "nothings": listed(["nothing"] * self.events),
            "no_passed": listed(self._each("passed_{j}")),
            "no_now": listed(self._each("now_{j}")),
            "no_falls": ", ".join(self._each("falls_{j}")),
            "no_margins": self._lines("margin_{j} = 0.0 * h"),
        }

    def _facts(self):
        """Series of the states and of the events, and the first coefficients of these."""
        series = [f"s_{s}" for s in self.states] + self._each("(offset_{j}, factor_{j}, event_{j})")
        told_of = [f"s_{s}" for s in self.states]
        told_of += [f"event_{j}" for j in range(self.events) if not self.seen[j]]
        left_out = [f"(last_term(h, {u}), size(h, {u}))" for u in told_of]
        return {
            "series_and_events": ", ".join(series),
            "facts": self._lines(FACTS),
            "left_out": folded("worse({}, {})", left_out),
            "keeps": " & ".join(f"keeps(h, power_h, {u}, allowed)" for u in told_of),
        }

    def _start(self):
        """What is asked at the start of a leg only."""
        return {
            "sum_last": "last = " + " + ".join(f"magnitude(s_{s}[-1])" for s in self.states),
            "start": self._lines(START),
            "margins": self._lines(MARGIN),
            "any_stuck": " | ".join(self._each("((on_{j} > 0.5) & not_(away_{j}))")),
            "any_now": " | ".join(self._each("now_{j}")),
        }

    def _series(self, j):
        """The series that the proof is of: of a state that is the sum of another one, of that one."""
        summed = self.summed.get(self.seen[j])
        return f"s_{summed}" if summed else f"event_{j}"

    def _tail(self, j):
        """A bound on A of (1) for an event; the factor of one that is a state is 1."""
        tail = "unit * tail_of_sum" if self.seen[j] in self.summed else "tail"
        return f"rest_{j} = {'' if j else 'magnitude(factor_0) * '}{tail}(trial, {self._series(j)})"

    def _proofs(self):
        """What each event is proved to do in a step; where the surface's rate is a kink's u, by that kink."""
        by_tails = [f"{self._tail(j)}\n{CLEAR}\nfalls_{{j}} = {FALLS}".format(j=j) for j in range(self.events)]
        by_kink = BY_KINK.format(nested=self.nested)
        return {
            "judge": "\n".join([*by_tails[1:], by_kink] if self.nested else by_tails),
            "all_sure": " & ".join(self._each("(clear_{j} | falls_{j})")),
        }

    def _doubts(self):
        """The same for lanes whose step is halved until all is proved."""
        names = ("e", "d", "dd", "ddd", "margin", "now", "falls")
        facts = ", ".join(["unit", "factor_0", *(f"{name}_{j}" for j in range(self.events) for name in names)])
        series = listed(dict.fromkeys(self._series(j) for j in range(self.events)))
        doubts = [f"{self._tail(j)}\n{CLEAR}\ndown_{{j}} = {FALLS}".format(j=j) for j in range(self.events)]
        return {
            "judge_all": "\n".join(doubts),
            "all_proved": " & ".join(self._each("(clear_{j} | down_{j})")),
            "falls_of_unsure": self._lines("falls_{j} = (unsure & down_{j}) | (falls_{j} & not_(unsure))"),
            "facts_of_all": facts,
            "series_of_all": series,
            "unpack_facts": f"{facts} = facts",
            "unpack_series": f"{series} = series",
        }

    def _look(self):
        """What a step may hide."""
        looked = look(self.states, self.order, self.hides)
        return {
            "longest": "longest = 0.0 * h + FAR" if looked else "",
            "not_longest": "h = where(h < longest, h, longest)" if looked else "",
            "look": looked or "",
            "and_seen": " & seen" if looked else "",
        }

    def _cores(self):
        """The cores of powers, and the steps that end with them."""
        n = len(self.kinks_of_powers)
        also = f", coarse_{{}}, ({listed(f'full_{s}' for s in self.states)})" if self.tells else ""
        cores = [
            f"at_core_{i}, longest_{i}{also.format(i)} = "
            f"core_{i}(({listed(self.states)}), side, signs, parameters, unit, tolerance,"
            f" (on_{1 + j} > 0.5) & (t <= 0.0), t, margin_{1 + j})"
            for i, j in enumerate(self.kinks_of_powers)
        ]
        return {
            "cores": "\n".join(cores),
            "all_cores": f", ({listed(f'at_core_{i}' for i in range(n))})" if n else "",
            "no_longer": "\n".join(f"h = where(h < longest_{i}, h, longest_{i})" for i in range(n)),
        }

    def _step(self):
        """The end of a step, and which events are behind it."""
        ends = [f"end_{s} = {self._state_at(s, 'trial')}" for s in self.states]
        for j in range(self.events):
            value = f"end_{self.seen[j]}" if self.seen[j] else self._seen_at(j, "trial")
            ends.append(f"end_{j} = fma(factor_{j}, {value}, offset_{j})")
        return {
            "ends": "\n".join(ends),
            "passed": self._lines("passed_{j} = passed_{j} | (steps & falls_{j} & (end_{j} <= 0.0))"),
            "any_passed": " | ".join(self._each("passed_{j}")),
            "advance": "\n".join(f"{s} = where(steps, end_{s}, {s})" for s in self.states),
            "reach": "\n".join(f"reach_{s} = magnitude({s})" for s in self.states),
            "reach_on": "\n".join(
                f"reach_{s} = where(magnitude({s}) > reach_{s}, magnitude({s}), reach_{s})" for s in self.states
            ),
            "reach_end": "\n".join(
                f"reach_{s} = where(met & (magnitude(end_{s}) > reach_{s}), magnitude(end_{s}), reach_{s})"
                for s in self.states
            ),
            "reaches": listed(f"reach_{s}" for s in self.states),
            "off": self._lines("now_{j} = now_{j} & meets"),
        }

    def _roots(self):
        """Where in the last step the first event fires, what fires with it, and the state there."""
        e = range(self.events)
        on_kink = [(1 + j, self.seen[1 + j]) for j in sorted(set(self.kinks_of_powers))]
        at_rest = [f"end_{u} = where({self._fires(j)}, 0.0 * end_{u}, end_{u})" for j, u in on_kink]
        return {
            "roots": "\n".join(self._root(j) for j in e),
            "with_it": "\n".join(self._beside(j) for j in e) if self.events > 1 else "",
            "at_root": "\n".join(f"end_{s} = where(met, {self._state_at(s, 'end')}, {s})" for s in self.states),
            "on_kink": "\n".join(at_rest),
            "final": listed(f"end_{s}" for s in self.states),
            "fired": listed(f"where({self._fires(j)}, 1.0, 0.0)" for j in e),
        }

    def curve(self, j):
        """Of what the event watches: how it is evaluated, its value at the start of the step."""
        s = self.seen[j]
        if s in self.summed:
            return f"of_sum, ({s}, unit, s_{self.summed[s]})", s
        return f"of_series, (event_{j},)", f"event_{j}[0]"

    def _root(self, j):
        among = f"first = first & ((which < 0.0) | (fma(factor_{j}, {self._seen_at(j, 'end')}, offset_{j}) <= 0.0))"
        watched, value = self.curve(j)
        return ROOT.format(
            j=j, among=among if j else "# whatever else passed in this step", watched=watched, value=value
        )

    def _beside(self, j):
        return (
            f"beside_{j} = met & passed_{j} & (magnitude(fma(factor_{j}, {self._seen_at(j, 'end')}, offset_{j}))"
            f" <= fma(SAME, tolerance, ROUNDING) * (magnitude(offset_{j}) + magnitude(factor_{j} * event_{j}[0])))"
        )

    def own(self, j):
        """That the leg ends by this event."""
        return f"met & (which > {j - 0.5}) & (which < {j + 0.5})"

    def _fires(self, j):
        return f"beside_{j} | ({self.own(j)})" if self.events > 1 else self.own(j)
