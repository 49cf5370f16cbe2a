"""The foliot by textbook integrators with a fixed step: the effect of the step and of unlocated switches on the period.

    phi'' = +-mu - a phi' - R sign phi' - c phi' abs(phi') - k phi,  speed times e where +-phi passes phi0    (1)

From rest at the centre, through `flips` switches. The methods are euler, semi_implicit, verlet, rk4, dopri5, dop853 and
moreau; `location` chooses how a switch, or a place of rest, is located within a step (`events`). Two further runs have
finer steps: the outputs are those of the first run, and the differences of the three give `error`, which is also the
bound of the method. INACCURATE: the step is too coarse for this estimate.
STEP_LIMIT: no switch in 20 000 steps, as when a method loses too much energy, or chatters about a place of rest.
OUT_OF_RANGE: the method diverged.
"""

from kernels.foliot.cycle import FOLIOT
from kernels.interface import Field, Kernel, Status
from kernels.scene import Scene, limits_check, sign
from kernels.stepping import COST, stepping_fields, stepping_methods


def rates(angle, speed, side, mu, a, R, c, k):
    return speed, side * mu - a * speed - R * sign(speed) - c * speed * abs(speed) - k * angle


def surface(angle, side, phi0):
    return phi0 - side * angle


def switch(angle, speed, e):
    return angle, e * speed


def start():
    return 0.0, 0.0


SCENE = Scene(
    "foliot_steps", "foliot", ("angle", "speed"), ("mu", "phi0", "a", "R", "c", "k", "e"), rates, surface, start, switch
)

PARAMETERS = (
    *map(FOLIOT.parameter, ("mu", "phi0", "a", "R")),
    Field("c", "1", "quadratic drag per moment of inertia", default=0.0, lower=0.0),
    *map(FOLIOT.parameter, ("k", "e")),
    *stepping_fields(),
)

OUTPUTS = (
    Field("period", "s", "twice the time between the last two switches"),
    Field("time", "s", "time of the last switch"),
    Field("amplitude", "rad", "largest angle since the switch before the last"),
    Field("crossing_speed", "rad/s", "speed just before the last switch"),
    *COST,
)


def _fill(time, interval, states, reach, columns):
    """The outputs but those of the cost."""
    period, last, amplitude, crossing_speed = columns
    period[:], last[:], amplitude[:], crossing_speed[:] = 2.0 * interval, time, reach[0], abs(states[1])


def _never_starts(mu, phi0, a, R, *others):
    """NEVER_STARTS where the drive cannot overcome dry friction."""
    status = others[-1]
    status[(status == Status.OK) & (mu <= R)] = Status.NEVER_STARTS


FOLIOT_STEPS = Kernel(
    name="foliot_steps",
    doc="foliot followed at a fixed step by textbook integrators",
    source="as of the kernel foliot; the methods of Hairer, Norsett & Wanner and Moreau",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    check=limits_check(PARAMETERS, _never_starts),
    methods=stepping_methods(SCENE, PARAMETERS, OUTPUTS, _fill),
    example={"mu": 1.0, "phi0": 1.0, "a": 0.5, "flips": 2.0, "step": 0.05},
)
