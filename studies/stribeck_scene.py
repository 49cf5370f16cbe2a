"""Mass on a spring and on a belt, with friction that falls with speed as Stribeck found: it sticks and slips or slides.

    x'' + 2 zeta x' + x = F(belt - x'),    F(v) = sign(v) (1 + (still - 1) exp(-abs(v)/fall))              (1)

in units of the mass, the spring and the friction at high speed. A cycle is counted where the mass turns back, x' = 0.
"""

from kernels.cycle import cycle_kernel
from kernels.scene import Field, exp, sign


def rates(place, speed, belt, zeta, still, fall):
    slip = belt - speed
    friction = sign(slip) * (1.0 + (still - 1.0) * exp(-abs(slip) / fall))
    return speed, friction - place - 2.0 * zeta * speed


def start(belt, still, fall, zeta, size):
    steady = 1.0 + (still - 1.0) * exp(-belt / fall)
    return steady - size, 0.0


KERNEL = cycle_kernel(
    name="stribeck_scene",
    doc="oscillation of a mass on a spring and on a belt with Stribeck friction",
    states=(Field("place", "1", "place"), Field("speed", "1", "speed")),
    parameters=(
        Field("belt", "1", "speed of the belt", lower=0.0, open_lower=True),
        Field("zeta", "1", "damping ratio", default=0.05, lower=0.0),
        Field("still", "1", "friction at rest over that at high speed", default=1.5, lower=1.0),
        Field("fall", "1", "speed over which friction falls to 1/e", default=0.5, lower=0.0, open_lower=True),
        Field("size", "1", "how far from steady sliding it begins", default=2.0),
    ),
    rates=rates,
    surface=lambda speed, side: side * speed,
    start=start,
    source="Stribeck, Z. VDI 46:1341 (1902)",
    example={"belt": 0.2, "flips": 2},
)
