"""A scene with every kind of term, each switched off by a parameter: compiled once for all tests.

phi'' = side mu - a phi' - c phi' abs(phi') - R sign(phi') - k phi, switch at side phi = phi0, speed times e there
"""

from kernels.scene import Field, scene_kernel, sign


def rates(angle, speed, side, mu, a, c, R, k):
    return speed, side * mu - a * speed - c * speed * abs(speed) - R * sign(speed) - k * angle


def surface(angle, side, phi0):
    return phi0 - side * angle


def switch(angle, speed, e):
    return angle, e * speed


def start(angle0, speed0):
    return angle0, speed0


RICH = scene_kernel(
    name="rich",
    doc="foliot with every term",
    states=(Field("angle", "rad", "angle at the switch"), Field("speed", "rad/s", "speed at the switch")),
    parameters=(
        Field("mu", "rad/s^2", "drive"),
        Field("phi0", "rad", "switching angle"),
        Field("a", "1/s", "viscous friction", default=0.0, lower=0.0),
        Field("c", "1", "quadratic drag", default=0.0, lower=0.0),
        Field("R", "rad/s^2", "dry friction", default=0.0, lower=0.0),
        Field("k", "1/s^2", "stiffness", default=0.0),
        Field("e", "1", "restitution", default=1.0),
        Field("angle0", "rad", "angle at the start", default=0.0),
        Field("speed0", "rad/s", "speed at the start", default=0.0),
    ),
    rates=rates,
    surface=surface,
    start=start,
    switch=switch,
    example={"mu": 1.0, "phi0": 1.0, "a": 0.2},
)
