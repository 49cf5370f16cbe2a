"""Motions that follow a wave or relax, stiff where their time is short; a ball that bounces on a raised floor."""

import bounce_scene

from kernels.scene import Field, cos, scene_kernel, sin

SPEED = Field("speed", "rad/s", "speed at the switch")
FORCE, EPS = Field("force", "rad/s^2", "lagging drive"), Field("eps", "s", "lag", lower=0.0, open_lower=True)


def followed_wave(speed, force, clock, side, eps):
    """The force is drawn to cos(clock) by a law that is not linear, and is on it from the start."""
    return force, -sin(clock) - (1.0 + force**2) * (force - cos(clock)) / eps, 1.0 + 0.0 * side


WAVE = scene_kernel(
    name="wave",
    doc="speed by a force that follows a wave; Prothero and Robinson's test",
    states=(SPEED, FORCE, Field("clock", "s", "time by the clock")),
    parameters=(EPS, Field("level", "rad/s", "speed at the switch")),
    rates=followed_wave,
    surface=lambda speed, level: level - speed,
    start=lambda: (0.0, 1.0, 0.0),
    example={"eps": 1e-3, "level": 0.5},
)

PASSED = scene_kernel(
    name="passed",
    doc="a state that relaxes from 1 to -1 behind the first switch, and is met on its way",
    states=(FORCE, Field("clock", "s", "time by the clock")),
    parameters=(EPS, Field("level", "rad/s^2", "force at the second switch")),
    rates=lambda force, side, eps: ((side - force) / eps, 1.0 + 0.0 * force),
    surface=lambda force, clock, side, level: 0.5 * ((1.0 + side) * (1.0 - clock) + (1.0 - side) * (force - level)),
    start=lambda: (1.0, 0.0),
    example={"eps": 1e-3, "level": 0.5},
)


RAISED = scene_kernel(
    name="raised",
    doc="the ball of `bounce_scene` on a floor at the height 1",
    states=bounce_scene.KERNEL.outputs[2:],
    parameters=bounce_scene.KERNEL.parameters[:-1],
    rates=bounce_scene.rates,
    surface=lambda height: height - 1.0,
    switch=bounce_scene.switch,
    start=lambda above: (1.0 + above, 0.0),
    example={"g": 9.81, "e": 0.5},
)
