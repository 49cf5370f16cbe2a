"""A stone thrown downwards, in plain numpy: small enough to check by hand, complete enough to test the engine with.

    height = v0 t + g t^2 / 2                                     (1)

Named in studies as "toy:KERNEL".
"""

from __future__ import annotations

import numpy as np

from kernels.interface import Field, Kernel, Method, Status


def check(height, v0, g, status):
    """BAD_INPUT where the stone has no height, is thrown upwards, or falls nowhere; NaN fails too."""
    good = (height > 0) & (v0 >= 0) & (g > 0) & np.isfinite(height) & np.isfinite(v0) & np.isfinite(g)
    status[...] = np.where(good, Status.OK, Status.BAD_INPUT)


def exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
    """The larger root of (1), written without cancellation."""
    with np.errstate(all="ignore"):
        impact_speed[...] = np.hypot(v0, np.sqrt(2 * g * height))
        fall_time[...] = 2 * height / (v0 + impact_speed)
        t = phase * fall_time[:, None]
        drop[...] = v0[:, None] * t + g[:, None] * t**2 / 2
    status[...] = Status.OK


def rough(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
    """(1) with v0 = 0."""
    with np.errstate(all="ignore"):
        impact_speed[...] = np.sqrt(2 * g * height)
        fall_time[...] = np.sqrt(2 * height / g)
        drop[...] = height[:, None] * phase**2
    status[...] = Status.OK


def rough_bound(height, v0, g, rtol, phase, asked, out):
    """With s = v0 / sqrt(2 g h): speeds are off by less than s^2/2, times and traces by less than s + s^2/2."""
    with np.errstate(all="ignore"):
        s = v0 / np.sqrt(2 * g * height)
        out[...] = s**2 / 2 + 1e-15
    if asked[0] or asked[2]:
        out += s


KERNEL = Kernel(
    name="toy",
    doc="A stone thrown downwards from a height.",
    source="Newton's second law, integrated twice",
    parameters=(
        Field("height", "m", "height above the ground", lower=0, open_lower=True),
        Field("v0", "m/s", "downward speed at the start", default=0.0, lower=0),
        Field("g", "m/s^2", "acceleration of free fall", default=9.80665, lower=0, open_lower=True),
    ),
    outputs=(
        Field("fall_time", "s", "time until the ground is reached"),
        Field("impact_speed", "m/s", "speed just before the ground"),
        Field("drop", "m", "way fallen", dims=("phase",)),
    ),
    along=(Field("phase", "1", "time over fall time", lower=0, upper=1),),
    check=check,
    methods=(
        Method("rough", "no initial speed", rough, rough_bound),
        Method("exact", "root of the quadratic", exact),
    ),
)

RICH = Kernel(
    name="rich",
    doc="Declared with everything a declaration can have; it cannot be run.",
    source="",
    parameters=(
        Field("load", "N", "load"),
        Field("shape", "1", "shape of the arm", default=0.0, choices={"round": 0, "square": 3}),
        Field("drag", "1/s", "drag", default=0.0),
        Field("grip", "N", "grip", default="load"),
        Field("hold", "N", "hold", default="grip"),
    ),
    outputs=(Field("work", "J", "work done"),),
    check=check,
    methods=(
        Method("quick", "neither drag nor grip", exact, excludes=("drag", "grip")),
        Method("slow", "everything but hold", exact, excludes=("hold",)),
    ),
)
