"""A cross-beat: two foliots geared one to one, each pushed by the crown wheel in turn, on a case that may sway.

    I_l left'' = tau - c_l left' - R_l sign(left') - T - I_l sway cos(nu t)        while it is pushed  (1)
    I_r right'' = -c_r right' - R_r sign(left') + T + I_r sway cos(nu t)                            (2)
    T = stiffness (left - right) + damper (left' - right')                                           (3)

right counts the other way round, so that rigid gears have right = left. The left tooth leaves at left = phi0; then the
wheel pushes the right one by -tau until right = -phi0. side is 1 while the left one is pushed. Both dry frictions have
the sign of left', from which right' differs by the twist's rate alone. Leaves out: play of the gears, and what an
escapement does beside pushing.
"""

from kernels.scene import Field, cos, scene_kernel, sign


def rates(left, speed, right, other, age, side, tau, I_l, I_r, c_l, c_r, R_l, R_r, stiffness, damper, sway, nu):
    torque = stiffness * (left - right) + damper * (speed - other)
    shaken = sway * cos(nu * age)
    on_left, on_right = 0.5 + 0.5 * side, 0.5 - 0.5 * side
    gain = (on_left * tau - c_l * speed - R_l * sign(speed) - torque) / I_l - shaken
    other_gain = (-on_right * tau - c_r * other - R_r * sign(speed) + torque) / I_r + shaken
    return speed, gain, other, other_gain, 1.0 + 0.0 * side


KERNEL = scene_kernel(
    name="cross_beat_scene",
    doc="two geared foliots, pushed in turn, on a case that may sway",
    states=(
        Field("left", "rad", "angle of the left foliot at the last switch"),
        Field("speed", "rad/s", "its speed"),
        Field("right", "rad", "angle of the right foliot, which counts the other way round"),
        Field("other", "rad/s", "its speed"),
        Field("age", "s", "time since the start"),
    ),
    parameters=(
        Field("tau", "N m", "torque of the crown wheel at either foliot", lower=0.0, open_lower=True),
        Field("I_l", "kg m^2", "moment of inertia of the left foliot", lower=0.0, open_lower=True),
        Field("I_r", "kg m^2", "moment of inertia of the right foliot", lower=0.0, open_lower=True),
        Field("phi0", "rad", "angle at which a tooth leaves", lower=0.0, open_lower=True),
        Field("c_l", "N m s/rad", "viscous friction of the left foliot", default=0.0, lower=0.0),
        Field("c_r", "N m s/rad", "viscous friction of the right foliot", default=0.0, lower=0.0),
        Field("R_l", "N m", "dry friction of the left foliot", default=0.0, lower=0.0),
        Field("R_r", "N m", "dry friction of the right foliot", default=0.0, lower=0.0),
        Field("stiffness", "N m/rad", "stiffness of the gear", lower=0.0, open_lower=True),
        Field("damper", "N m s/rad", "damper of the gear", default=0.0, lower=0.0),
        Field("sway", "rad/s^2", "angular acceleration of the case, amplitude", default=0.0, lower=0.0),
        Field("nu", "rad/s", "angular frequency of the sway", default=1.0, lower=0.0),
    ),
    rates=rates,
    surface=lambda left, right, side, phi0: phi0 - (0.5 + 0.5 * side) * left + (0.5 - 0.5 * side) * right,
    start=lambda phi0: (-phi0, 0.0, -phi0, 0.0, 0.0),
    example={
        "tau": 1e-3, "I_l": 5e-5, "I_r": 5e-5, "phi0": 0.35, "c_l": 5e-5, "c_r": 5e-5, "stiffness": 1.0, "damper": 1e-3,
    },
)  # fmt: skip
