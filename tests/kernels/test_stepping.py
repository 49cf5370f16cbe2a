"""Scenes of one's own at a fixed step: which methods can do which, and a scene of one state."""

from kernels.interface import Field
from kernels.scene import sign
from kernels.stepping import METHODS, stepped_kernel


def surface(level, side):
    return 1.0 - side * level


def kernel(name, states, rates, start):
    return stepped_kernel(
        name=name,
        doc="a scene for tests",
        states=[Field(state, "1", "a state") for state in states],
        parameters=[Field("r", "1/s", "a rate", default=1.0)],
        rates=rates,
        surface=surface,
        start=start,
    )


def names(found):
    return {m.name for m in found.methods}


def filling(level, side, r):
    return r * (2.0 * side - level)


def start():
    return 0.0


FILLING = kernel("filling", ["level"], filling, start)


def test_methods_of_pairs_are_kept_from_scenes_that_are_none():
    assert names(FILLING) == {"euler", "rk4", "dopri5", "dop853"}

    def swing(level, speed, side, r):
        return speed, side - r * sign(speed)

    def bent(level, speed, side, r):
        return speed, side - r * abs(level)

    def two():
        return 0.0, 0.0

    assert names(kernel("swing", ["level", "speed"], swing, two)) == set(METHODS)
    assert names(kernel("bent", ["level", "speed"], bent, two)) == set(METHODS) - {"moreau"}
