"""A ball that bounces until it is at rest: each bounce is lower, and infinitely many of them take a finite time.

z'' = -g - d z' abs(z'),  z' times -e where z falls through 0                                        (1)
"""

from kernels.scene import Field, scene_kernel

SCENE = {
    "name": "bounce_scene",
    "doc": "a ball that bounces until it is at rest",
    "states": (Field("height", "m", "height at the last bounce"), Field("speed", "m/s", "speed there")),
    "parameters": (
        Field("g", "m/s^2", "gravity", default=9.81, lower=0.0, open_lower=True),
        Field("e", "1", "restitution: share of the speed kept", lower=0.0, open_lower=True, upper=1.0),
        Field("above", "m", "height of the fall", default=1.0, lower=0.0, open_lower=True),
        Field("d", "1/m", "drag by the square of the speed, per mass", default=0.0, lower=0.0),
    ),
    "rates": lambda speed, g, d: (speed, -g - d * speed * abs(speed)),
    "surface": lambda height: height,
    "switch": lambda height, speed, e: (height, -e * speed),
    "start": lambda above: (above, 0.0),
}
KERNEL = scene_kernel(**SCENE, example={"e": 0.5, "flips": 1e6})
