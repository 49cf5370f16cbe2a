"""A pendulum with an anchor (recoil) escapement, its torque constant and of one sign between switches.

    phi'' = -w0^2 sin(phi) - (w0/Q) phi' + side mu                                                       (1)

`side` changes where phi passes +phi0 outwards at the right and -phi0 at the left: from there the scape wheel, driven
back, brakes the rest of the swing (recoil), and pushes the way back until the other pallet takes over. It is the
verge's law with a restoring force. Leaves out: drop, the pallets' curves and friction, the wheel's inertia.
"""

from kernels.cycle import cycle_kernel
from kernels.scene import Field, pi, sin, sqrt


def rates(angle, speed, side, mu, Q, phi0, w0):
    return speed, side * mu - w0 / Q * speed - w0**2 * sin(angle)


KERNEL = cycle_kernel(
    name="anchor_scene",
    doc="limit cycle of a pendulum with an anchor escapement",
    states=(Field("angle", "rad", "angle of the pendulum"), Field("speed", "rad/s", "its rate")),
    parameters=(
        Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
        Field("Q", "1", "quality factor of the pendulum", lower=0.0, open_lower=True),
        Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
        Field("w0", "rad/s", "angular frequency of small free swings", lower=0.0, open_lower=True),
    ),
    rates=rates,
    surface=lambda angle, side, phi0: phi0 - side * angle,
    start=lambda mu, Q, phi0, w0: (-sqrt(4 / pi * mu * phi0 * Q) / w0, 0.0),
    source="Airy, Trans. Cambridge Phil. Soc. 3:105 (1830)",
    example={"mu": 1e-3, "Q": 1e3, "phi0": 0.025, "w0": pi},
)
