"""A scene of one's own: a foliot whose vanes beat the air, with a drag law that no kernel has.

    phi'' = +-mu - a phi' - b phi' sqrt(phi'^2 + w^2)                                                 (1)

Drag that is linear below the speed w and quadratic above it. Run with

    sweep run studies/own_scene.toml --allow-import
"""

from kernels.scene import Field, scene_kernel, sqrt


def rates(angle, speed, side, mu, a, b, w):
    return speed, side * mu - a * speed - b * speed * sqrt(speed**2 + w**2)


def surface(angle, side, phi0):
    return phi0 - side * angle


def start():
    return 0.0, 0.0


KERNEL = scene_kernel(
    name="vanes",
    doc="foliot with drag that is linear when slow and quadratic when fast",
    states=(Field("angle", "rad", "angle at the switch"), Field("speed", "rad/s", "speed at the switch")),
    parameters=(
        Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
        Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
        Field("a", "1/s", "bearing friction per moment of inertia", default=0.0, lower=0.0),
        Field("b", "1", "drag of the vanes per moment of inertia", default=0.1, lower=0.0),
        Field("w", "rad/s", "speed at which the drag turns quadratic", default=1.0, lower=0.0, open_lower=True),
    ),
    rates=rates,
    surface=surface,
    start=start,
    example={"mu": 1.0, "phi0": 1.0, "a": 0.1},
)
