"""Motions that follow a wave or relax, stiff where their time is short; a ball that bounces on a raised floor."""

import bounce_scene

from kernels.scene import Field, cos, scene_kernel, sin


def drawn(force, clock, side, eps, relaxes):
    """Speed and force: to cos(clock) by a law that is not linear, and on it from the start; or to the side."""
    wave = -sin(clock) - (1.0 + force**2) * (force - cos(clock)) / eps
    return (1.0 - relaxes) * force, (1.0 - relaxes) * wave + relaxes * (side - force) / eps, 1.0


def met(speed, force, clock, side, level, relaxes):
    """A speed; or, of what relaxes, first a time, then a force."""
    second = 0.5 * ((1.0 + side) * (1.0 - clock) + (1.0 - side) * (force - level))
    return (1.0 - relaxes) * (level - speed) + relaxes * second


DRAWN = scene_kernel(
    name="drawn",
    doc="a force that follows a wave, Prothero and Robinson's test; or relaxes from 1 to -1, and is met on its way",
    states=(
        Field("speed", "rad/s", "speed at the switch"),
        Field("force", "rad/s^2", "lagging drive"),
        Field("clock", "s", "time by the clock"),
    ),
    parameters=(
        Field("eps", "s", "lag", lower=0.0, open_lower=True),
        Field("level", "1", "speed or force at the switch"),
        Field("relaxes", "1", "1: it relaxes behind the first switch; 0: it follows the wave"),
    ),
    rates=drawn,
    surface=met,
    start=lambda: (0.0, 1.0, 0.0),
    example={"eps": 1e-3, "level": 0.5, "relaxes": 0.0},
)

RAISED = scene_kernel(
    **bounce_scene.SCENE
    | {"name": "raised", "doc": "the ball of `bounce_scene` on a floor at the height 1"}
    | {"surface": lambda height: height - 1.0, "start": lambda above: (1.0 + above, 0.0)},
    example={"g": 9.81, "e": 0.5},
)
