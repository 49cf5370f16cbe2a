"""A verge and foliot in SI units, followed swing by swing: nothing is scaled out before it is solved.

    phi'' = +-mu - a f phi' - c phi' abs(phi') - R sign(phi'),  speed times e at each switch             (1)

f = 1 + depth cos(harmonic pi phi/phi0), as of a bearing that is worn or dry at places; its mean over the way from
switch to switch is 1. The kernel `foliot` solves (1) in units of phi0 and sqrt(phi0/mu), so an exponent -1/2 of its
period may be built in. Here it can only come out.
"""

from kernels.scene import Field, cos, pi, scene_kernel, sign


def rates(angle, speed, side, mu, phi0, a, c, R, depth, harmonic):
    viscous = a * (1.0 + depth * cos(harmonic * pi * angle / phi0)) * speed
    return speed, side * mu - viscous - c * speed * abs(speed) - R * sign(speed)


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
        Field("depth", "1", "amplitude of the friction's change over the swing", default=0.0, lower=-1.0, upper=1.0),
        Field("harmonic", "1", "its half waves from the middle to the switch", default=1.0, lower=0.0),
    ),
    "rates": rates,
    "surface": lambda angle, side, phi0: phi0 - side * angle,
    "switch": lambda angle, speed, e: (angle, e * speed),
    "start": lambda phi0: (-phi0, 0.0),
}
KERNEL = scene_kernel(**SCENE, example={"mu": 1.0, "phi0": 1.0, "a": 1.0})
