"""A mass on a spring, carried along by a belt through dry friction: it sticks, slips, and sticks again.

x'' = -x + fall x' - mu sign(x' - belt)                                                              (1)

in units of the mass and the spring. `fall` is how friction falls with speed; the motion is counted where the force
of the spring is that of friction, x = mu: on the way up the mass rides on the belt, on the way down it slips.
"""

from kernels.scene import Field, scene_kernel, sign


def rates(place, speed, mu, belt, fall):
    return speed, fall * speed - place - mu * sign(speed - belt)


SCENE = {
    "name": "belt_scene",
    "doc": "mass on a spring and on a belt that drags it by dry friction",
    "states": (Field("place", "1", "place at the last count"), Field("speed", "1", "speed there")),
    "parameters": (
        Field("mu", "1", "dry friction over the spring's stiffness", default=1.0, lower=0.0, open_lower=True),
        Field("belt", "1", "speed of the belt", lower=0.0, open_lower=True),
        Field("fall", "1", "fall of friction with speed", default=0.1),
    ),
    "rates": rates,
    "surface": lambda place, side, mu: side * (mu - place),
    "start": lambda belt: (0.0, belt),
}
KERNEL = scene_kernel(**SCENE, example={"belt": 0.2, "flips": 41.0})
