"""Van der Pol's oscillator: friction drives small swings and brakes large ones.

    x'' - mu (1 - x^2) x' + x = 0                                                                       (1)

Its cycle is a sine for small mu; for large mu x creeps along and then jumps.
"""

from kernels.cycle import cycle_kernel
from kernels.scene import Field


def rates(x, v, mu):
    return v, mu * (1.0 - x**2) * v - x


KERNEL = cycle_kernel(
    name="relaxation_scene",
    doc="limit cycle of van der Pol's oscillator",
    states=(Field("x", "1", "deflection"), Field("v", "1/s", "its rate")),
    parameters=(Field("mu", "1/s", "strength of the friction", lower=0.0, open_lower=True),),
    rates=rates,
    surface=lambda x, side: side * x,
    start=lambda: (2.0, 0.0),
    source="van der Pol, Phil. Mag. 2:978 (1926)",
    example={"mu": 1.0},
)
