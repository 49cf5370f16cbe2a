"""Crown wheel and foliot as two bodies with friction: pushed in contact, flying apart through the drop, landing.

    contact:  (I_v + n^2 I_c) angle'' = n tau - (c_v + n^2 c_c) angle' - (R_v + n R_c) sign(angle')     (1)
    flight:   I_v angle'' = -c_v angle' - R_v sign(angle'),  I_c wheel' = tau - c_c wheel - R_c,  R_c < tau         (2)
    landing:  both go on in contact, with the speed that keeps I_v angle' + n I_c wheel, e = 0                      (3)

In contact wheel = n angle'. Angles count along the push, so they change sign from pallet to pallet. The tooth leaves at
phi0; the next one lands when wheel and pallet have closed the drop. side is 1 in contact, -1 in flight. Without
friction this is `impact` at e = 0, without inertia of the wheel `foliot`. Nothing is scaled out. Leaves out: recoil
that frees the tooth.
"""

from kernels.scene import Field, scene_kernel, sign


def rates(angle, speed, wheel, side, tau, I_v, I_c, n, c_v, c_c, R_v, R_c):
    pushed = (n * tau - (c_v + n**2 * c_c) * speed - (R_v + n * R_c) * sign(speed)) / (I_v + n**2 * I_c)
    free = (-c_v * speed - R_v * sign(speed)) / I_v
    contact, flight = 0.5 + 0.5 * side, 0.5 - 0.5 * side
    spin = contact * n * pushed + flight * (tau - c_c * wheel - R_c) / I_c
    drag = c_v * speed**2 + c_c * wheel**2
    rubbing = R_v * abs(speed) + R_c * (contact * n * abs(speed) + flight * wheel)
    closing = flight * (wheel + n * speed)
    back = contact * 0.5 * n * (abs(speed) - speed)
    return speed, contact * pushed + flight * free, spin, -closing, 1.0 + 0.0 * side, drag, rubbing, back


def switch(angle, speed, wheel, gap, clock, drag, rubbing, recoil, side, I_v, I_c, n, drop):
    contact, flight = 0.5 + 0.5 * side, 0.5 - 0.5 * side
    together = (n * I_c * wheel - I_v * speed) / (I_v + n**2 * I_c)
    return (
        side * angle, contact * speed + flight * together, contact * wheel + flight * n * together,
        drop, contact * clock, contact * drag, contact * rubbing, contact * recoil,
    )  # fmt: skip


KERNEL = scene_kernel(
    name="verge_scene",
    doc="crown wheel and foliot in plastic impact with viscous and dry friction, in SI units",
    states=(
        Field("angle", "rad", "foliot at the last event, along its push"),
        Field("speed", "rad/s", "its speed"),
        Field("wheel", "rad/s", "speed of the crown wheel"),
        Field("gap", "rad", "free travel of the wheel to the next pallet"),
        Field("clock", "s", "time since the landing before: half a period if the last event is a landing"),
        Field("drag", "J", "energy that viscous friction took in that time"),
        Field("rubbing", "J", "energy that dry friction took in that time"),
        Field("recoil", "rad", "travel of the wheel backwards in that time"),
    ),
    parameters=(
        Field("tau", "N m", "torque on the crown wheel", lower=0.0, open_lower=True),
        Field("I_v", "kg m^2", "moment of inertia of foliot and verge", lower=0.0, open_lower=True),
        Field("I_c", "kg m^2", "moment of inertia of crown wheel and train", lower=0.0, open_lower=True),
        Field("n", "1", "angle of the wheel over that of the foliot, in contact", lower=0.0, open_lower=True),
        Field("phi0", "rad", "angle at which the tooth leaves the pallet", lower=0.0, open_lower=True),
        Field("drop", "rad", "free travel of the wheel from pallet to pallet", lower=0.0, open_lower=True),
        Field("c_v", "N m s/rad", "viscous friction of the foliot", default=0.0, lower=0.0),
        Field("c_c", "N m s/rad", "viscous friction of the wheel", default=0.0, lower=0.0),
        Field("R_v", "N m", "dry friction of the foliot", default=0.0, lower=0.0),
        Field("R_c", "N m", "dry friction of the wheel", default=0.0, lower=0.0),
    ),
    rates=rates,
    surface=lambda angle, gap, side, phi0: (0.5 + 0.5 * side) * (phi0 - angle) + (0.5 - 0.5 * side) * gap,
    start=lambda phi0, drop: (-phi0, 0.0, 0.0, drop, 0.0, 0.0, 0.0, 0.0),
    switch=switch,
    example={"tau": 1e-3, "I_v": 1e-4, "I_c": 1e-4, "n": 0.2, "phi0": 0.25, "drop": 0.001},
)  # fmt: skip
