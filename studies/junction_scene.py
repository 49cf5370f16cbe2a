"""Driven Josephson junction: the phase between two superconductors, under a current with a part at high frequency.

    phase' = order w + detuning + ac w cos(w t) - sin(phase)                                            (1)

in units of the critical current and of the time hbar/(2 e R I_c), so that phase' is the voltage; capacity is left out.
On a Shapiro step the phase gains `order` turns a period of the drive, whatever the detuning.
"""

from kernels.cycle import cycle_kernel
from kernels.scene import Field, cos, pi, sin


def rates(phase, order, detuning, ac, w, drive):
    return order * w + detuning + ac * w * cos(drive) - sin(phase), w


KERNEL = cycle_kernel(
    name="junction_scene",
    doc="Josephson junction locked to its drive",
    states=(Field("phase", "rad", "phase across the junction"), Field("drive", "rad", "phase of the drive")),
    parameters=(
        Field("order", "1", "frequency that a constant current gives, over the drive's", lower=0.0, integer=True),
        Field("detuning", "1", "the rest of the constant current, over the critical one"),
        Field("ac", "1", "current at high frequency, over the critical one and w", lower=0.0),
        Field("w", "1/s", "frequency of the drive, times hbar/(2 e R I_c)", lower=0.0, open_lower=True),
    ),
    rates=rates,
    surface=lambda drive: 2.0 * pi - drive,
    switch=lambda phase: (phase, 0.0),
    start=lambda: (0.0, 0.0),
    turns={"phase": 2.0 * pi},
    source="Shapiro, Phys. Rev. Lett. 11:80 (1963); Stewart and McCumber (1968), without capacity",
    example={"order": 1, "detuning": 0.1, "ac": 1.0, "w": 2.0, "flips": 1},
)
