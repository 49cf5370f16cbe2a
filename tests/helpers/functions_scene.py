"""Scenes whose states are integrals: of every function that a scene may use, along a ramp; and of some of the time."""

import math

import numpy as np

from kernels.scene import Field, mod, scene_kernel, tan

NAMES = ("tanh", "arctan", "arcsin", "arccos", "tan", "sinh", "cosh", "hypot", "floor", "mod")


def rates(u, b, c, d):
    """numpy's and math's names beside ours, which are the same; b times each, so that integrals are over u."""
    functions = (
        np.tanh(u), math.atan(u), np.arcsin(u / c), math.acos(u / c), tan(u / c), np.sinh(u), math.cosh(u),
        np.hypot(u, d), np.floor(u), mod(u, d),
    )  # fmt: skip
    return b, *(b * f for f in functions)


FUNCTIONS = scene_kernel(
    name="functions",
    doc="integrals of functions over a ramp",
    states=tuple(Field(name, "1", name) for name in ("u", *NAMES)),
    parameters=tuple(Field(name, "1", name) for name in "abcd"),
    rates=rates,
    surface=lambda u, a, b: a + b - u,
    start=lambda a: (a, *[0.0] * len(NAMES)),
    example={"a": -0.5, "b": 2.0, "c": 3.0, "d": 0.75},
)


SMOOTH = scene_kernel(
    name="steps_in_time",
    doc="a smooth step, a root and a sawtooth of the time, which jumps once between",
    states=(Field("x", "1", "x"), Field("y", "1", "y")),
    parameters=(Field("w", "1", "width"),),
    rates=lambda t, w: (np.tanh((t - 1.0) / w) + math.hypot(t, w), t % 0.7),
    surface={"end": lambda t: 4.0 - t, "half": lambda t: -t},
    switch={"half": lambda x, y: (x, y + 1.0)},
    start=lambda: (0.0, 0.0),
    start_time=-3.0,
    example={"w": 0.1},
)
