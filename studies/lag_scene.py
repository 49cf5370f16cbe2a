"""A foliot driven by a motor whose current lags: stiff where the lag is short beside the swing.

    phi'' = f - a phi',  eps f' = +-mu - b phi' - f                                                     (1)

eps is the motor's inductance over its resistance, b what its speed takes from its torque. With eps to 0 it is the
foliot with viscous friction a + b.
"""

from kernels.scene import Field, scene_kernel


def rates(angle, speed, force, side, mu, a, b, eps):
    return speed, force - a * speed, (side * mu - b * speed - force) / eps


KERNEL = scene_kernel(
    name="lag_scene",
    doc="foliot driven by a motor whose current lags",
    states=(
        Field("angle", "rad", "angle at the last switch"),
        Field("speed", "rad/s", "speed there"),
        Field("force", "rad/s^2", "drive there"),
    ),
    parameters=(
        Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
        Field("phi0", "rad", "switching angle", default=1.0, lower=0.0, open_lower=True),
        Field("a", "1/s", "viscous friction per moment of inertia", default=0.5, lower=0.0),
        Field("b", "1/s", "what speed takes from the drive, per moment of inertia", default=0.5, lower=0.0),
        Field("eps", "s", "lag of the drive", lower=0.0, open_lower=True),
    ),
    rates=rates,
    surface=lambda angle, side, phi0: phi0 - side * angle,
    start=lambda: (0.0, 0.0, 0.0),
    example={"mu": 1.0, "eps": 1e-6},
)
