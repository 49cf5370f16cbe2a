"""Relays and masses on belts, which slide along a kink: every case by its parameters, so that it is compiled once."""

from kernels.scene import Field, scene_kernel, sign, sin

NAMES = ("slope", "belt", "sway", "wave", "press", "drag", "hold", "stiffness", "drive", "wall", "mid", "level")


def rates(place, speed, clock, slope, belt, sway, wave, press, drag, hold, stiffness, drive, wall):
    pressed = press * sign(slope * place + speed - belt - sway * sin(wave * clock))
    held = hold * sign(place - wall)
    return speed - held, drive * sin(clock) - stiffness * place - drag * speed - pressed, 1.0 + 0.0 * clock


def surface(place, side, mid, level):
    return level - side * (place - mid)


def start(place0, speed0):
    return place0, speed0, 0.0


SLIDING = scene_kernel(
    name="sliding",
    doc="a relay or a mass on a belt, that slides along its kink",
    states=(Field("place", "m", "place"), Field("speed", "m/s", "speed"), Field("clock", "s", "time")),
    parameters=(
        *(Field(name, "1", "a number", default=0.0) for name in NAMES),
        Field("place0", "m", "place at the start", default=0.0),
        Field("speed0", "m/s", "speed at the start", default=0.0),
    ),
    rates=rates,
    surface=surface,
    start=start,
    example={"press": 1.0, "belt": 1.0, "speed0": 1.0, "stiffness": 1.0, "mid": 1.0},
)
