"""Scenes whose cycles need a drive, several surfaces or a mode of three values, known in closed form.

FORCED : x'' = gear a cos(w t) - omega^2 x - 2 zeta omega x', in a gear that is never changed
TABLE : a ball on a table at A sin(w t), which gives back the share e of the closing speed
RESTING : x'' = -x - 2 zeta x' - mu sign(x') from x = 1
WALLS : a body between walls; it leaves the left one at kick + e u, the right one at e u, and is j times as fast in the
    way of its mode j: 1 behind the left wall, 2 behind the right one, 3 from the middle on
POPULATION : once a season u becomes gain u (1 - bend u) - cube u^3
THROWN : a ball that lands at v and leaves at 2 + e sqrt(v^2 - 1)
PUSHED : a body between walls at -1 and 1, which leave it the share e of its speed, in air that takes 0.1 m/s of it a
    metre; as it passes 0 to the left it is pushed on. A cycle ends there, or at a section that changes nothing
STOPPED : x'' = cos(w t) - x - 2 zeta x' with a stop, at which v becomes -e v
"""

from kernels.cycle import cycle_kernel
from kernels.scene import Field, cos, pi, sign, sin, sqrt, where

MOVING = Field("x", "m", "place"), Field("v", "m/s", "speed")
FORCED = cycle_kernel(
    name="forced",
    doc="oscillator driven by a sine",
    states=(*MOVING, Field("gear", "1", "strength of the drive")),
    parameters=(
        Field("zeta", "1", "damping", default=0.05),
        Field("omega", "1/s", "its own frequency", default=1.0),
        Field("a", "m/s^2", "drive", default=1.0),
        Field("w", "1/s", "frequency of the drive", default=1.3),
    ),
    rates=lambda x, v, gear, t, zeta, omega, a, w: (
        v,
        gear * a * cos(w * t) - omega * omega * x - 2.0 * zeta * omega * v,
        0.0,
    ),
    start=lambda: (0.0, 0.0, 1.0),
    drive=lambda w: 2.0 * pi / w,
)
TABLE = cycle_kernel(
    name="table",
    doc="ball on a table that shakes",
    states=MOVING,
    parameters=(
        Field("A", "m", "amplitude", default=0.1),
        Field("w", "1/s", "frequency of the table", default=10.0),
        Field("e", "1", "restitution", default=0.5),
        Field("x0", "m", "height at the start"),
        Field("v0", "m/s", "speed at the start"),
    ),
    rates=lambda x, v: (v, -9.81),
    surface={"table": lambda x, t, A, w: x - A * sin(w * t)},
    switch={"table": lambda x, v, t, A, w, e: (x, (1.0 + e) * A * w * cos(w * t) - e * v)},
    start=lambda x0, v0: (x0, v0),
    drive=lambda w: 2.0 * pi / w,
)
RESTING = cycle_kernel(
    name="resting",
    doc="oscillator that only loses",
    states=MOVING,
    parameters=(Field("zeta", "1", "damping", default=0.0), Field("mu", "m/s^2", "dry friction", default=0.0)),
    rates=lambda x, v, zeta, mu: (v, -x - 2.0 * zeta * v - mu * sign(v)),
    surface=lambda x, side: side * x,
    start=lambda: (1.0, 0.0),
)
WALLS = cycle_kernel(
    name="walls",
    doc="body between two walls",
    states=(*MOVING, Field("mode", "1", "which way it goes")),
    parameters=(
        Field("kick", "m/s", "speed that the left wall adds", default=1.0),
        Field("e", "1", "restitution", default=0.5),
        Field("length", "m", "between the walls", default=2.0),
        Field("left", "m", "place of the left wall", default=0.0),
    ),
    rates=lambda v, mode: (where(mode > 2.5, 3.0, where(mode > 1.5, 2.0, 1.0)) * v, 0.0, 0.0),
    surface={
        "left": lambda x, left: 2.0 * (x - left),
        "right": lambda x, left, length: left + length - x,
        "middle": lambda x, left, length: x - left - 0.5 * length,
    },
    switch={
        "left": lambda x, v, kick, e: (x, kick - e * v, 1.0),
        "right": lambda x, v, e: (x, -e * v, 2.0),
        "middle": lambda x, v: (x, v, 3.0),
    },
    start=lambda left, length: (left + 0.25 * length, 1.0, 1.0),
)
POPULATION = cycle_kernel(
    name="population",
    doc="what each season leaves of a population",
    states=(Field("u", "1", "share of the largest one"),),
    parameters=(
        Field("gain", "1", "growth"),
        Field("bend", "1", "how that falls", default=1.0),
        Field("cube", "1", "", default=0.0),
        Field("u0", "1", "at the start", default=0.3),
    ),
    rates=lambda u: 0.0 * u,
    surface={"season": lambda t: 0.5 - t},
    switch={"season": lambda u, gain, bend, cube: gain * u * (1.0 - bend * u) - cube * u * u * u},
    start=lambda u0: u0,
    drive=1.0,
    branch="gain",
)
THROWN = cycle_kernel(
    name="thrown",
    doc="ball that is thrown up again as it lands",
    states=MOVING,
    parameters=(Field("e", "1", "restitution"),),
    rates=lambda x, v: (v, -9.81),
    surface=lambda x: x,
    switch=lambda x, v, e: (x, 2.0 + e * sqrt(v * v - 1.0)),
    start=lambda: (1.0, 0.0),
)
_PLACES = {
    "middle": lambda x: x,
    "left": lambda x: x + 1.0,
    "right": lambda x: 1.0 - x,
    "section": lambda x: x - 0.25,
}
PUSHED = {
    first: cycle_kernel(
        name=f"pushed_{first}",
        doc="body between two walls that is pushed half way",
        states=MOVING,
        parameters=(Field("push", "m/s", "what a push adds", default=2.0), Field("e", "1", "restitution", default=0.5)),
        rates=lambda x, v: (v, -0.1 * v),
        surface={first: _PLACES[first]} | _PLACES,
        switch={
            "middle": lambda x, v, push: (x, v - push),
            "left": lambda x, v, e: (x, -e * v),
            "right": lambda x, v, e: (x, -e * v),
        },
        start=lambda: (0.5, 1.0),
    )
    for first in ("middle", "section")
}
STOPPED = cycle_kernel(
    name="stopped",
    doc="driven oscillator beside a stop",
    states=MOVING,
    parameters=(
        Field("zeta", "1", "damping"),
        Field("w", "1/s", "frequency of the drive"),
        Field("e", "1", "restitution"),
        Field("stop", "m", "place of the stop"),
        Field("x0", "m", "place at the start"),
        Field("v0", "m/s", "speed at the start"),
    ),
    rates=lambda x, v, t, zeta, w: (v, cos(w * t) - x - 2.0 * zeta * v),
    surface={"stop": lambda x, stop: stop - x},
    switch={"stop": lambda x, v, e: (x, -e * v)},
    start=lambda x0, v0: (x0, v0),
    drive=lambda w: 2.0 * pi / w,
)
