"""The general foliot without dimensions, and back; the records of its state.

In units of phi0 and of T0 = sqrt(phi0/mu) the half swing after the switch at x = +1 obeys
    x'' = -1 - (d x' + (rho + gamma abs(x')^n) sgn x') - kappa x                                     (1)
    d = a T0,  rho = R/mu,  rho_s = R_s/mu,  gamma = c (phi0 mu)^(n/2)/mu,  kappa = k T0^2.
It starts with e times the speed before the switch and ends at x = -1; the other half mirrors it. Drive work is 2.
"""

from collections import namedtuple

from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged
from kernels.lanes.symbols import symbolic
from kernels.lanes.vectors import any_lane, not_, where
from kernels.maths.elementary import is_normal, power
from kernels.maths.pairs import two_sum
from kernels.maths.wide import number, over, root, size, times, wide

Foliot = namedtuple("Foliot", "mu phi0 a R R_s c n k e")
"""Parameters."""

LinearFoliot = namedtuple("LinearFoliot", [name for name in Foliot._fields if name not in ("c", "n")])
"""Parameters without drag."""

Outputs = namedtuple("Outputs", "period amplitude crossing_speed sensitivity multiplier")
"""Outputs of a limit cycle, or the relative error of each."""

Scene = namedtuple("Scene", "d rho rho_s gamma n kappa e slack")
"""Coefficients of (1), and slack = 1 - rho without the rounding of rho.

Drag of degree 0 is Coulomb friction: it is counted in rho, rho_s and slack. n is 1 where gamma is 0.
"""

Units = namedtuple("Units", "time angle fine")
"""T0 and phi0, as `wide` numbers, and whether all groups of (1) are normal numbers."""

Cycle = namedtuple("Cycle", "half_period amplitude speed sensitivity multiplier")
"""A limit cycle: half period, amplitude, speed before the switch, s = -dlnP/dlnmu, multiplier."""


@symbolic
def errors(swing, sensitivity, multiplier):
    """Relative errors of the outputs; period, amplitude and speed share the first."""
    return Outputs(swing, swing, swing, sensitivity, multiplier)


@symbolic
def drag_of(p):
    """c and n of a `Foliot`, or of a `LinearFoliot`, which has no drag."""
    return (p.c, p.n) if hasattr(p, "c") else (0.0, 1.0)


@jit
def spare_torque(mu, R, solid):
    """mu - R - solid, rounded once: what is left of the torque may be a small difference of large ones."""
    first, lost = two_sum(mu, -R)
    rest, lost_again = two_sum(first, -solid)
    return rest + (lost + lost_again)


@jit
def _sound(x, group):
    """Whether a group is a normal number wherever the term that it is of is not 0."""
    return not_(x > 0.0) | is_normal(group)


@jit
def without_dimensions(p):
    """The scene of a `Foliot` or a `LinearFoliot`, or of a record with more parameters, and its units."""
    mu, phi0, a, k = wide((p.mu, p.phi0, p.a, p.k))
    time, speed = root(over(phi0, mu)), root(times(phi0, mu))
    d, kappa = number(times(a, time)), number(times(k, times(time, time)))
    c, n = drag_of(p)
    powered = n > 0.0
    solid, drag = where(powered, 0.0, c), where(powered, c, 0.0)
    gamma = 0.0 * drag
    if any_lane(drag > 0.0):
        gamma = where(drag > 0.0, drag / p.mu * power(number(speed), n), 0.0)
    rho, slack = (p.R + solid) / p.mu, spare_torque(p.mu, p.R, solid) / p.mu
    fine = _sound(p.a, d) & _sound(p.k, kappa) & _sound(drag, gamma) & _sound(p.R + solid, rho)
    scene = Scene(d, rho, (p.R_s + solid) / p.mu, gamma, where(gamma > 0.0, n, 1.0), kappa, p.e, slack)
    return scene, Units(time, phi0, fine)


@jit
def given(units, cycle, verdict):
    """What a method gives of a cycle: its outputs and its status."""
    half_period, amplitude, speed, sensitivity, multiplier = cycle
    period, swing = size(2.0 * half_period, units.time), size(amplitude, units.angle)
    fast = size(speed, over(units.angle, units.time))
    verdict = judged(units.fine, (period > 0.0) & (swing > 0.0) & (fast > 0.0), verdict)
    return Outputs(period, swing, fast, sensitivity, multiplier), verdict


UNITS = without_dimensions, given
"""Of a method that solves a `Scene`."""
