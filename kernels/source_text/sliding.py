"""Source text of what a driver does of motion that slides along a kink (`sliding`): when it begins, and how it ends."""

from kernels.source_text.lane import chosen
from kernels.source_text.series import Lines
from kernels.source_text.template import filled, listed

PRESSED = '''
@jit_call
def pressed(state, side, signs, on, left, parameters, margin):
    """The signs, 0 of a kink that is pressed from both sides; and whether a side is too close to pressing to tell.

    Of one kink alone that the state is on, or that it has slid along until another was met: by its speeds ahead and
    behind. Where two are met at once, the signs stay as they are, for the next leg to stick or to go on.
    `on`, `left` : 1 for the kinks that the state is on, for that which it has just slid along to its end
    """
    {unpack}
    {ons} = on
    {lefts} = left
    {lines}
    unsure = margin < 0.0
    among = {among}
    {judge}
    return ({signs}), unsure
'''

JUDGE = """\
asked = (on_{j} > 0.5) & (left_{j} < 0.5) & ((among < 1.5) | (magnitude(sign_{j}) < 0.5))
new = where((ahead_{j} < 0.0) & (behind_{j} > 0.0), 0.0, sign_{j})
new = where((ahead_{j} > 0.0) & (behind_{j} > 0.0), 1.0, where((ahead_{j} < 0.0) & (behind_{j} < 0.0), -1.0, new))
at_end = where(magnitude(ahead_{j}) < magnitude(behind_{j}), 1.0, -1.0)
faint = where(at_end > 0.0, magnitude(ahead_{j}), magnitude(behind_{j}))
unsure = unsure | (asked & (faint <= margin * (magnitude(ahead_{j}) + magnitude(behind_{j}))))
sign_{j} = where(left_{j} > 0.5, at_end, where(asked, new, sign_{j}))"""

ENDLESS = """\
sliding = {among} < {kinks} - 0.5
verdict = where(active & sliding & (leg.lost | leg.broken), STICKS, verdict)"""

LEAVE = """\
held = moving & (magnitude(sign_{j}) < 0.5)
left_{j} = where(held & (on_{k} > 0.5), 1.0, 0.0)
on_{k} = where(held, 1.0, on_{k})
sign_{j} = where(moving & (on_{k} > 0.5), -sign_{j}, sign_{j})"""

PRESS = """\
found, unsure = pressed(({states}), side, ({signs} way), ({ons}), ({lefts}), parameters, BLUR * tolerance)
{take}
verdict = where({lanes} & unsure & (verdict < GRAZING), GRAZING, verdict)"""


def of_sliding(writer):
    """The text of `onto` and `pressed`."""
    recorded, kinks = writer.recorded, range(writer.kinks)
    lines = Lines(writer.names)
    for j, (ahead, behind) in enumerate(recorded.speeds):
        lines.text += [f"ahead_{j} = {lines.value(ahead)}", f"behind_{j} = {lines.value(behind)}"]
    onto = writer.function(
        "onto", "The state on the kink that it slides along.", recorded.onto, ("state", "side", "signs", "parameters")
    )
    return onto + filled(
        PRESSED, unpack=writer.all_unpacked, ons=listed(f"on_{j}" for j in kinks),
        lefts=listed(f"left_{j}" for j in kinks), lines="\n".join(lines.text),
        among=" + ".join(f"on_{j}" for j in kinks), judge="\n".join(JUDGE.format(j=j) for j in kinks),
        signs=listed(f"sign_{j}" for j in kinks),
    )  # fmt: skip


def turned(signs):
    """Statements at the end of a leg: which kinks' signs turn round, along which the motion has slid to its end."""
    return "\n".join(LEAVE.format(j=j, k=1 + j) for j in range(len(signs)))


def endless(signs):
    """Statements for lanes whose slide has no end: they rest, as far as can be told."""
    among = " + ".join(f"magnitude({s})" for s in signs)
    return filled(ENDLESS, among=among, kinks=float(len(signs)))


def press(lanes, states, signs, ons, left):
    """Statements before a leg of the lanes: they slide where they are pressed. `left` is text for each kink."""
    take = chosen(lanes, signs, "found")
    take += [f"{on} = where({lanes} & (magnitude({s}) < 0.5), 0.0, {on})" for s, on in zip(signs, ons[1:], strict=True)]
    return filled(
        PRESS, states=listed(states), signs=", ".join([*signs, ""]), ons=listed(ons[1:]), lanes=lanes,
        take="\n".join(take), lefts=listed(left),
    )  # fmt: skip
