"""The foliot followed by textbook integrators at a fixed step: what the step and a switch found late do to the period.

    phi'' = +-mu - a phi' - R sign phi' - c phi' abs(phi') - k phi,  speed times e where +-phi passes phi0    (1)

From rest at the centre, through `flips` switches. The methods are euler, semi_implicit, verlet, rk4, dopri5, dop853 and
moreau, `location` says where in a step a switch, or a place of rest, is taken to be (`_locate`). Everything is done a
second time with finer steps: the first run's values are given, and what the two differ by tells their `error`, which
is also what a method states as its bound. STEP_LIMIT: no switch in 20 000 steps, as where a method takes too much
energy, or chatters about a place of rest. OUT_OF_RANGE: the method blew up.
"""

import math

import numpy as np

from kernels import _stepped_solve
from kernels._locate import LOCATIONS, METHODS
from kernels._stepped_source import stepped
from kernels.interface import Field, Kernel, Method, Status
from kernels.scene import Scene, _check, _signed, sign

MOST_FLIPS = 10_000
DOCS = {
    "euler": "explicit Euler, order 1",
    "semi_implicit": "semi-implicit Euler, order 1",
    "verlet": "velocity Verlet, order 2",
    "rk4": "classical Runge-Kutta, order 4",
    "dopri5": "Dormand-Prince at a fixed step, order 5",
    "dop853": "Dormand-Prince at a fixed step, order 8",
    "moreau": "Moreau's time-stepping, order 1: dry friction without location",
}


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
    Field("mu", "rad/s^2", "drive torque per moment of inertia", lower=0.0, open_lower=True),
    Field("phi0", "rad", "angle at which the drive switches", lower=0.0, open_lower=True),
    Field("a", "1/s", "viscous friction per moment of inertia", default=0.0, lower=0.0),
    Field("R", "rad/s^2", "Coulomb friction per moment of inertia", default=0.0, lower=0.0),
    Field("c", "1", "quadratic drag per moment of inertia", default=0.0, lower=0.0),
    Field("k", "1/s^2", "hairspring stiffness per moment of inertia", default=0.0, lower=0.0),
    Field("e", "1", "restitution of the speed at the switch", default=1.0, lower=-1.0, upper=1.0, open_lower=True),
    Field("flips", "1", "switches to follow", default=20.0, lower=1.0, upper=float(MOST_FLIPS), integer=True),
    Field("step", "s", "time step", lower=0.0, open_lower=True),
    Field("location", "1", "how a switch is found in its step", default=3.0, lower=0.0, upper=4.0, choices=LOCATIONS,
          integer=True),
)  # fmt: skip

OUTPUTS = (
    Field("period", "s", "twice the time between the last two switches"),
    Field("time", "s", "time of the last switch"),
    Field("amplitude", "rad", "largest angle since the switch before the last"),
    Field("crossing_speed", "rad/s", "speed just before the last switch"),
    Field("error", "1", "estimated largest relative error of these four"),
    Field("steps", "1", "steps taken", integer=True),
    Field("rate_calls", "1", "evaluations of the right-hand side", integer=True),
)


def _solved(name, mu, phi0, a, R, c, k, e, flips, step, location):
    """The rows of `_stepped_solve.solved`."""
    return _stepped_solve.solved(stepped(SCENE), name, (mu, phi0, a, R, c, k, e, flips), step, location)


def _method(name):
    """A method with its functions of columns."""

    def solve(*columns):
        *inputs, _ = columns[: len(PARAMETERS) + 1]
        period, time, amplitude, crossing_speed, error, steps, rate_calls, status = columns[len(PARAMETERS) + 1 :]
        if len(status):
            found, error[:], status[:] = _solved(name, *inputs)
            time[:], period[:], amplitude[:], crossing_speed[:] = found[0], 2.0 * found[1], found[4], abs(found[3])
            steps[:], rate_calls[:] = found[6], found[7]

    def bound(*columns):
        if len(columns[0]):
            error = _solved(name, *columns[: len(PARAMETERS)])[1]
            columns[-1][:] = np.where(np.isnan(error), math.inf, error)

    parameters, outputs = [f.name for f in PARAMETERS], [f.name for f in OUTPUTS]
    return Method(
        name,
        DOCS[name],
        _signed(solve, [*parameters, "rtol", *outputs, "status"]),
        _signed(bound, [*parameters, "rtol", "asked", "out"]),
    )


def _check_columns(*columns):
    """As of every scene; and NEVER_STARTS where the drive cannot overcome dry friction."""
    _limits(*columns)
    mu, _, _, R, *_, status = columns
    status[(status == Status.OK) & (mu <= R)] = Status.NEVER_STARTS


_limits = _check(PARAMETERS)
check = _signed(_check_columns, [*(f.name for f in PARAMETERS), "status"])

FOLIOT_STEPS = Kernel(
    name="foliot_steps",
    doc="foliot followed at a fixed step by textbook integrators",
    source="as of the kernel foliot; the methods of Hairer, Norsett & Wanner, Moreau and Henon",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    check=check,
    methods=tuple(_method(name) for name in METHODS),
    example={"mu": 1.0, "phi0": 1.0, "a": 0.5, "flips": 2.0, "step": 0.05},
)
