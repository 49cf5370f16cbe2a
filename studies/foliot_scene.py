"""A verge and foliot in SI units, followed swing by swing: nothing is scaled out before it is solved.

    phi'' = +-mu - a phi' - c phi' abs(phi') - R sign(phi'),  speed times e at each switch               (1)

The kernel `foliot` solves (1) in units of phi0 and sqrt(phi0/mu), so an exponent -1/2 of its period may be built in.
Here it can only come out.
"""

from kernels.scene import Field, scene_kernel, sign


def rates(angle, speed, side, mu, a, c, R):
    return speed, side * mu - a * speed - c * speed * abs(speed) - R * sign(speed)


SCENE = {
    "name": "foliot_scene",
    "doc": "verge and foliot with four losses, followed from rest in SI units",
    "source": "Hoyng & Nieuwenhuizen, arXiv:1604.06681, eq. (1); other losses added",
    "states": (Field("angle", "rad", "angle at the switch"), Field("speed", "rad/s", "speed at the switch")),
    "parameters": (
        Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
        Field("phi0", "rad", "switching angle", lower=0.0, open_lower=True),
        Field("a", "1/s", "viscous friction per moment of inertia", default=0.0, lower=0.0),
        Field("c", "1", "drag by the square of the speed, per moment of inertia", default=0.0, lower=0.0),
        Field("R", "rad/s^2", "Coulomb friction per moment of inertia", default=0.0, lower=0.0),
        Field("e", "1", "restitution: share of the speed kept at a switch", default=1.0, lower=0.0, upper=1.0),
    ),
    "rates": rates,
    "surface": lambda angle, side, phi0: phi0 - side * angle,
    "switch": lambda angle, speed, e: (angle, e * speed),
    "start": lambda phi0: (-phi0, 0.0),
}
KERNEL = scene_kernel(**SCENE, example={"mu": 1.0, "phi0": 1.0, "a": 1.0})
