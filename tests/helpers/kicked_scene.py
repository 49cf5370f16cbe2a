"""A linear oscillator that is kicked as it passes 0, whose cycles are known in closed form.

x'' = -omega^2 x - 2 zeta omega x'; at x = 0 the speed's size u becomes kick + gain u (1 - bend u)
"""

from kernels.cycle import cycle_kernel
from kernels.scene import Field
from kernels.trajectory import section_kernel


def rates(x, v, zeta, omega):
    return v, -omega * omega * x - 2.0 * zeta * omega * v


def surface(x, side):
    return side * x


def switch(x, v, side, kick, gain, bend):
    u = -side * v
    return x, -side * (kick + gain * u * (1.0 - bend * u))


def start(v0):
    return 0.0, v0


PARTS = {
    "doc": "oscillator that is kicked as it passes 0",
    "states": (Field("x", "m", "place"), Field("v", "m/s", "speed")),
    "parameters": (
        Field("zeta", "1", "damping", default=0.0),
        Field("omega", "1/s", "frequency", default=1.0, lower=0.0, open_lower=True),
        Field("kick", "m/s", "speed that a kick adds", default=0.0),
        Field("gain", "1", "share of the speed that a kick keeps", default=1.0),
        Field("bend", "s/m", "how that falls with the speed", default=0.0),
        Field("v0", "m/s", "speed at the start", default=0.3),
    ),
    "rates": rates,
    "surface": surface,
    "start": start,
    "switch": switch,
}
KICKED = cycle_kernel(name="kicked", **PARTS, example={"zeta": 0.1, "kick": 1.0})
SECTION = section_kernel(name="kicked_section", **PARTS)
BRANCHED = {name: cycle_kernel(name="kicked", **PARTS, branch=name) for name in ("gain", "kick")}
