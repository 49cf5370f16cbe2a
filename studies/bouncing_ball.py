"""How does a ball on a shaken table go over from even bounces to chaos?

    python studies/bouncing_ball.py bouncing_ball.h5

`sweep plot bouncing_ball.h5` draws the diagram alone. A ball that bounces once a period leaves the table at
half of the speed that gravity takes from it in that time, so that it arrives at -pi, and the table moves at

    push cos t = pi (1 - e)/(1 + e)                                                                      (1)

there. The map from bounce to bounce has the determinant e^4, and the trace that follows from (1) is -1 - e^4, where
every second bounce begins to differ, at (push sin t) (1 + e)^2 = 2 (1 + e^2). Both together are the least push of even
bounces, and the push at which they double; from there on the two differ as the square root of what goes beyond it.

INACCURATE bounces lie on the attractor, but are not those of this very start. TOO_SHORT says that the ball comes to
rest on the table before the last bounce that is asked for.
"""

import math

import numpy as np
from _common import Claims, compared, most, said, script
from _figures import COLOURS, Axis, direct_label, page, panel

from kernels.interface import Status

SAME = 1e-3
"""Bounces at heights that differ by less are the same."""


def borders(e: float) -> tuple[float, float]:
    """The least push of even bounces, and that at which they double."""
    least = math.pi * (1.0 - e) / (1.0 + e)
    return least, math.hypot(least, 2.0 * (1.0 + e * e) / (1.0 + e) ** 2)


def claims(ds) -> Claims:
    yield "Bounces"
    least, doubles = borders(float(ds.e))
    ok = ds.where(ds.status == Status.OK, drop=True)
    even, odd = ok.where(ok.push < doubles - 1e-2, drop=True), ok.where(ok.push > doubles + 1e-3, drop=True)
    heights = odd.x.copy(data=np.sort(odd.x, axis=odd.x.dims.index("passage")))
    counts = 1 + (heights.diff("passage") > SAME).sum("passage")
    two = odd.where((counts == 2) & (odd.push < doubles + 0.05), drop=True)
    apart = ((two.x.max("passage") - two.x.min("passage")) ** 2).values
    begins = np.polyval(np.polyfit(apart, two.push.values, 2), 0.0) if apart.size > 2 else math.nan
    found = {int(n) for n in counts.where(odd.push < 1.7, drop=True).values}
    yield most("speed before each even bounce, over -pi", "1", even.v / -math.pi - 1, 1e-6)
    yield most("height of each even bounce, over (1)", "1", even.x / np.sqrt(even.push**2 - least**2) - 1, 1e-6)
    yield most("time between even bounces, over 2 pi", "1", even.time.diff("passage") / (2.0 * math.pi) - 1, 1e-6)
    yield compared("push at which bounces double", f"{doubles:.6f}", begins, doubles, 1e-4)
    yield said("heights beyond it, to 1.7", {2, 4} <= found <= {2, 4, 8}, ", ".join(map(str, sorted(found))), "2, 4, 8")


PUSH, HEIGHT = Axis("acceleration of the table over $g$ [1]"), Axis("height of the bounce [$g/\\omega^2$]")


@panel(PUSH, HEIGHT)
@panel(PUSH.to(1.66, 1.78), HEIGHT)
@page(132.0)
def figure(whole, part, ds):
    """The diagram of bifurcations, and beside it where bounces begin to be chaotic."""
    least, doubles = borders(float(ds.e))
    for axes, size in ((whole, 1.2), (part, 2.0)):
        for status, colour in ((Status.OK, "black"), (Status.INACCURATE, COLOURS[1])):
            some = ds.x.where(ds.status == status)
            axes.plot(ds.push, some, ".", color=colour, markersize=size, markeredgewidth=0.0)
    push = np.linspace(least, 1.8, 200)
    whole.plot(push, np.sqrt(push**2 - least**2), color=COLOURS[0], linewidth=0.7, linestyle="--")
    whole.axvline(doubles, color="0.5", linewidth=0.7, linestyle=":")
    direct_label(whole, 1.2, 0.95, "once a period, theory", COLOURS[0])
    direct_label(whole, doubles - 0.005, -0.3, "doubles", "0.35", ha="right")


main = script(__name__, "bouncing_ball.h5", claims, figure)
