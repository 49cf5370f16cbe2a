"""Motion that slides along a kink, towards which the vector field points from both sides (Filippov).

With u = 0 on the kink, f+ and f- the rates above and below it and u'(f) the rate of u along them, where
    u'(f+) < 0 < u'(f-):  f = f- + a (f+ - f-),  a = u'(f-)/(u'(f-) - u'(f+))                             (1)
keeps u at 0. The motion leaves to the side whose u' reaches 0: where -u'(f+) u'(f-) falls through 0, which is the
kink's event while the motion slides. All of this is recorded in the graph of the scene itself: the sign of a kink is
0 while the motion slides along it, and signs of 1 and -1 work as before. Sliding along two kinks is not supported.
Source: Filippov, Differential Equations with Discontinuous Righthand Sides (1988), section 4.
"""

from dataclasses import replace

from kernels.expression.graph import ADD, MUL, SCALED
from kernels.expression.tangent import Tangents, along


def _side(graph, signs):
    """A function of expressions: with the signs of kinks replaced, a dict from the number of each."""
    signs, done = {f".sign_{j}": sign for j, sign in signs.items()}, {}
    return lambda x: graph.again(x, signs, done)


def _jump(x, behind, ahead):
    """What an expression is more on one side than on the other: terms that are the same cancel before any rounding."""
    before, after = behind(x), ahead(x)
    if before is after:
        return x.graph.of(0.0)
    if x.kind == ADD:
        return _jump(x.args[0], behind, ahead) + _jump(x.args[1], behind, ahead)
    if x.kind in (MUL, SCALED):
        u, w = x.args
        by_u = ahead(w) * _jump(u, behind, ahead) if behind(u) is not ahead(u) else 0.0
        by_w = behind(u) * _jump(w, behind, ahead) if behind(w) is not ahead(w) else 0.0
        return by_u + by_w
    return after - before


def slid(recorded, states):
    """The recorded scene with (1), for signs that may be 0.

    Its `onto` are the states put back onto the kink, along f+ - f-: only what the kink's force acts on is changed.
    `speeds` are for each kink u'(f+) and u'(f-), the other signs as they are.
    """
    graph, kinks = recorded.graph, list(recorded.graph.kinks)
    signs = [graph.constant(f".sign_{j}") for j in range(len(kinks))]
    free = [sign * sign for sign in signs]  # 0 while the motion slides along the kink, else 1
    slides = [1.0 - f for f in free]
    behind, ahead = (
        _side(graph, {j: sign + way * slide for j, (sign, slide) in enumerate(zip(signs, slides, strict=True))})
        for way in (-1.0, 1.0)
    )
    below, jumps = [behind(r) for r in recorded.rates], [_jump(r, behind, ahead) for r in recorded.rates]
    gradients = [[Tangents.along(graph, s).of(u) for s in states] for u in kinks]
    down = sum((w * along(graph, g, below) for w, g in zip(slides, gradients, strict=True)), graph.of(0.0))
    rise = sum((w * along(graph, g, jumps) for w, g in zip(slides, gradients, strict=True)), graph.of(0.0))
    over = sum(slides, graph.of(0.0))
    share = down / (1.0 - over - rise)
    off = sum((w * u for w, u in zip(slides, kinks, strict=True)), graph.of(0.0)) / (1.0 - over - rise)
    at = [graph.series(s) for s in states]
    stays = [free[graph.kinks[s]] if s in graph.kinks else graph.of(1.0) for s in at]
    rates = tuple(k * (f + share * jump) for k, f, jump in zip(stays, below, jumps, strict=True))
    products = [w * (down + rise) * down for w in slides]
    events = [(graph.of(0.0), graph.of(1.0), signs[j] * u - products[j]) for j, u in enumerate(kinks)]
    unit = graph.constant(".unit")
    return replace(
        recorded,
        rates=rates,
        timed=tuple(graph.timed(rate, unit) for rate in rates),
        events=(recorded.events[0], *events),
        nested=0,
        onto=tuple(k * (s + off * jump) for k, s, jump in zip(stays, at, jumps, strict=True)),
        speeds=tuple(
            tuple(along(graph, g, list(map(_side(graph, {j: graph.of(sign)}), recorded.rates))) for sign in (1.0, -1.0))
            for j, g in enumerate(gradients)
        ),
    )
