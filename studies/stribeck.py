"""At which speed of its belt does a mass go over from stick and slip to steady sliding?

    python studies/stribeck.py stribeck.h5 stribeck_unstable.h5

Steady sliding is stable where friction falls by less than the damper takes, abs(F'(belt)) < 2 zeta. Above that speed
an unstable oscillation divides what comes to rest there from what comes to stick and slip. Of small friction its
amplitude A follows from the work of a period,

    zeta A = (still - 1) exp(-belt/fall) I1(A/fall),  I1 Bessel's function,                              (1)

and it ends with stick and slip where A comes to the belt's speed. Stick and slip are followed by scipy too: the slip
alone, to which the ride on the belt adds a time of distance over speed.
"""

import numpy as np
import xarray as xr
from _common import Claims, compared, most, said, script
from _figures import COLOURS, Axis, direct_label, page, panel
from _peers import ended
from scipy.optimize import brentq
from scipy.special import i1

from kernels.interface import Status


def friction(ds: xr.Dataset, slip):
    """Of a belt that is faster by `slip`, over that at high speed."""
    return 1.0 + float(ds.still - 1.0) * np.exp(-slip / float(ds.fall))


def averaged(ds: xr.Dataset, size):
    """The belt's speed at which (1) gives this amplitude."""
    return float(ds.fall) * np.log(float((ds.still - 1.0) / ds.zeta) * i1(size / float(ds.fall)) / size)


def by_hand(ds: xr.Dataset, belt: float) -> float:
    """The period of stick and slip, by scipy from where the spring tears the mass off."""

    def rates(_: float, y):
        return y[1], friction(ds, belt - y[1]) - y[0] - 2.0 * float(ds.zeta) * y[1]

    off = float(ds.still - 2.0 * ds.zeta * belt)
    begin = (off, belt * (1.0 - 1e-13))
    time, (place, _) = ended(rates, begin, (0.0, 50.0), 1e-11, lambda _, y: float(y[1]) - belt, 1)
    return time + (off - place) / belt


def begins(ds: xr.Dataset) -> float:
    """The belt's speed from which on steady sliding is stable."""
    return float(ds.fall * np.log((ds.still - 1.0) / (2.0 * ds.zeta * ds.fall)))


def claims(ds, unstable) -> Claims:
    yield "Stick and slip"
    ok, rests = (ds.where(ds.status == status, drop=True) for status in (Status.OK, Status.COMES_TO_REST))
    off = max(abs(float(ok.period.sel(belt=belt)) / by_hand(ds, belt) - 1.0) for belt in ok.belt.values)
    end = brentq(lambda size: float(averaged(ds, size)) - size, 0.5, 5.0)
    given = int(ok.period.notnull().sum()), rests.belt.size
    yield said("cells that stick and slip, that rest", sum(given) == ds.belt.size, f"{given}", "all")
    yield most("period beside slip by scipy and ride", "", off, 1e-8, "")
    yield most("largest multiplier, as it sticks", "0", ok.multiplier, 1e-8, "")
    yield compared("fastest belt on which it sticks", "end of (1)", ok.belt.max(), end, 0.04)
    yield most("place of steady sliding", "F(belt)", rests.place / friction(ds, rests.belt) - 1.0, 1e-8, "")

    yield "The unstable oscillation"
    size = friction(unstable, unstable.belt.values) - unstable.place.values
    few, grows = size < 0.45, unstable.multiplier.min()
    start = np.polyfit(size[few] ** 2, unstable.belt.values[few], 2)[-1] if few.sum() > 2 else np.nan
    leaves = (unstable.status == Status.UNSTABLE).all() and grows > 1.0
    yield said("it is unstable", leaves, f"multiplier from {grows:.4f}", "all cells")
    yield compared("belt where its amplitude is 0", "F'(belt) = -2 zeta", start, begins(unstable), 2e-4)
    yield most("speed of the belt beside (1), up to 5 %", "", averaged(unstable, size) / unstable.belt - 1.0, 0.05, "")


@panel(Axis("speed of the belt [1]", (0, 2.3)), Axis("amplitude [1]", (-0.15, 2.2)))
@page(80.0, 120.0)
def figure(axes, ds, unstable):
    """Amplitude over the belt's speed."""
    border, shown, place = begins(ds), np.linspace(1e-3, 2.0, 60), ds.place.where(ds.status == Status.OK)
    axes.plot(ds.belt, friction(ds, ds.belt) - place, color=COLOURS[0])
    axes.plot(unstable.belt, friction(ds, unstable.belt) - unstable.place, "o--", color=COLOURS[1], markersize=3)
    axes.plot(averaged(ds, shown), shown, color="0.5", linewidth=0.8)
    axes.plot([0.0, border], [0.0, 0.0], color=COLOURS[2], linestyle="--")
    axes.plot([border, 2.3], [0.0, 0.0], color=COLOURS[2])
    for x, y, text, colour in (
        (0.6, 1.2, "stick and slip", COLOURS[0]), (1.0, 0.55, "unstable", COLOURS[1]),
        (0.55, 0.13, "sliding, unstable", COLOURS[2]), (1.85, 0.13, "sliding, stable", COLOURS[2]),
        (1.75, 2.05, "averaging", "0.4"),
    ):  # fmt: skip
        direct_label(axes, x, y, text, colour)


main = script(__name__, "stribeck.h5 stribeck_unstable.h5", claims, figure)
