"""A damped oscillator at a fixed step, followed for a time: whether its integrator makes it grow.

angle'' = -a angle' - w^2 angle                                                                        (1)
"""

from kernels.interface import Field
from kernels.stepping import stepped_kernel


def rates(angle, speed, clock, pace, a, w):
    return speed, -a * speed - w * w * angle, pace, 0.0


KERNEL = stepped_kernel(
    name="oscillator_steps",
    doc="damped oscillator at a fixed step, followed for a time",
    states=(
        Field("angle", "rad", "angle at the end"),
        Field("speed", "rad/s", "speed at the end"),
        Field("clock", "s", "time by the clock"),
        Field("pace", "1", "of the clock"),
    ),
    parameters=(
        Field("a", "1/s", "damping per moment of inertia", lower=0.0),
        Field("w", "rad/s", "angular frequency without damping", lower=0.0),
        Field("end", "s", "time to follow it", lower=0.0, open_lower=True),
    ),
    rates=rates,
    surface=lambda clock, end: end - clock,
    start=lambda: (1.0, 0.0, 0.0, 1.0),
    source="the linear test equation, Hairer & Wanner, Solving ODEs II, section IV.2",
    example={"a": 0.1, "w": 1.0, "end": 6.35, "flips": 1.0, "step": 0.1, "location": 0.0},
)
