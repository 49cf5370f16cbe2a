"""Foliots whose drive lags behind its switch, or follows a wave: stiff where the lag is short; balls that bounce."""

from kernels.scene import Field, cos, scene_kernel, sin

ANGLE, SPEED = Field("angle", "rad", "angle at the switch"), Field("speed", "rad/s", "speed at the switch")
FORCE, EPS = Field("force", "rad/s^2", "lagging drive"), Field("eps", "s", "lag", lower=0.0, open_lower=True)

LAG = scene_kernel(
    name="lag",
    doc="foliot whose drive follows its switch with a lag",
    states=(ANGLE, SPEED, FORCE),
    parameters=(Field("mu", "rad/s^2", "drive"), Field("a", "1/s", "viscous friction"), EPS),
    rates=lambda angle, speed, force, side, mu, a, eps: (speed, force - a * speed, (side * mu - force) / eps),
    surface=lambda angle, side: 1.0 - side * angle,
    start=lambda: (0.0, 0.0, 0.0),
    example={"mu": 1.0, "a": 0.5, "eps": 1e-3},
)


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


def ball(floor):
    """A ball that bounces on a floor at that height."""
    return scene_kernel(
        name=f"ball_{floor}",
        doc="a ball that bounces, with drag by the square of its speed",
        states=(Field("height", "m", "height"), Field("speed", "m/s", "speed")),
        parameters=(
            Field("g", "m/s^2", "gravity"),
            Field("e", "1", "restitution"),
            Field("above", "m", "height over the floor at the start", default=1.0),
            Field("d", "1/m", "drag", default=0.0),
        ),
        rates=lambda speed, g, d: (speed, -g - d * speed * abs(speed)),
        surface=lambda height: height - floor,
        switch=lambda height, speed, e: (height, -e * speed),
        start=lambda above: (floor + above, 0.0),
        example={"g": 9.81, "e": 0.5},
    )


BALL, RAISED = ball(0), ball(1)
