"""A balance kept up by impulses at any angle, with viscous and solid friction, and out of poise.

    theta'' = -omega_n^2 (theta + r sign(theta') + poise sin(theta + hang)) - 2 zeta omega_n theta'          (1)

angle = side theta, turned round at each impulse, so that the next impulse is always met with angle' > 0: as the balance
passes angle = at (at < 0: before the centre) it is given the energy k w. `hang` is the angle between the heavy point
and the top in the watch's position. Leaves out: what else an escapement does.
"""

from kernels.scene import Field, pi, scene_kernel, sign, sin, sqrt, where


def rates(angle, speed, clock, side, zeta, omega_n, r, poise, hang):
    spring = angle + r * sign(speed) + poise * side * sin(side * angle + hang)
    return speed, -(omega_n**2) * spring - 2.0 * zeta * omega_n * speed, 1.0 + 0.0 * side


def switch(angle, speed, clock, side, omega_n, w):
    return -angle, -sqrt(speed**2 + 2.0 * w * omega_n**2), 0.5 * (1.0 - side) * clock


KERNEL = scene_kernel(
    name="balance_scene",
    doc="balance driven by impulses before, at or behind its centre, in a watch's position",
    source="Theory of Horology, 2-3, eq. (3); impulses and poise added",
    states=(
        Field("angle", "rad", "angle at the last impulse"),
        Field("speed", "rad/s", "speed just before it"),
        Field("clock", "s", "the last whole period, if the number of impulses is odd"),
    ),
    parameters=(
        Field("zeta", "1", "viscous damping ratio", lower=0.0, open_lower=True, upper=0.5),
        Field("omega_n", "rad/s", "angular frequency without friction", lower=0.0, open_lower=True),
        Field("r", "rad", "solid friction torque over spring stiffness", default=0.0, lower=0.0),
        Field("w", "rad^2", "energy of an impulse over spring stiffness", lower=0.0, open_lower=True),
        Field("at", "rad", "angle of the impulse along the motion", default=0.0),
        Field("poise", "rad", "torque of gravity on what is out of poise, over spring stiffness", default=0.0),
        Field("hang", "rad", "where that hangs at rest, from the top", default=0.0),
    ),
    rates=rates,
    surface=lambda angle, speed, at: where(speed > 0.0, at - angle, 1.0),
    start=lambda zeta, r, w: (-(sqrt(r**2 + pi * zeta * w) - r) / (pi * zeta), 0.0, 0.0),
    switch=switch,
    example={"zeta": 0.005, "omega_n": 15.708, "r": 0.01, "w": 0.01},
)
