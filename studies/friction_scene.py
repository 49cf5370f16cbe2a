"""A foliot whose viscous friction differs over its swing, as that of a bearing that is worn or dry at places.

    phi'' = +-mu - a (1 + depth cos(harmonic pi phi/phi0)) phi'                                          (1)

The mean of the friction over the way from switch to switch is a, whatever the depth.
"""

from kernels.scene import Field, cos, pi, scene_kernel


def rates(angle, speed, side, mu, phi0, a, depth, harmonic):
    return speed, side * mu - a * (1.0 + depth * cos(harmonic * pi * angle / phi0)) * speed


KERNEL = scene_kernel(
    name="friction_scene",
    doc="foliot with viscous friction that differs over the swing",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681, eq. (1); a(phi) added",
    states=(Field("angle", "rad", "angle at the last switch"), Field("speed", "rad/s", "speed there")),
    parameters=(
        Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
        Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
        Field("a", "1/s", "viscous friction per moment of inertia, mean over the way", lower=0.0, open_lower=True),
        Field("depth", "1", "amplitude of the friction's change over the swing", default=0.0, lower=-1.0, upper=1.0),
        Field("harmonic", "1", "its half waves from the middle to the switch", default=1.0, lower=0.0),
    ),
    rates=rates,
    surface=lambda angle, side, phi0: phi0 - side * angle,
    start=lambda phi0: (-phi0, 0.0),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0, "depth": 0.5},
)
