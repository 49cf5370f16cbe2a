"""The general foliot without dimensions, and back; the records of its state.

In units of phi0 and of T0 = sqrt(phi0/mu) the half swing after the switch at x = +1 obeys
    x'' = -1 - (d x' + (rho + gamma abs(x')^n) sgn x') - kappa x                                     (1)
    d = a T0,  rho = R/mu,  rho_s = R_s/mu,  gamma = c (phi0 mu)^(n/2)/mu,  kappa = k T0^2.
It starts with e times the speed before the switch and ends at x = -1; the other half mirrors it. Drive work is 2.
"""

from collections import namedtuple

from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged
from kernels.lanes.records import read
from kernels.lanes.vectors import any_lane, not_, where
from kernels.maths.elementary import is_normal, mantissa_exponent, measured, power, scale, scaled_root
from kernels.maths.pairs import two_sum

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

Units = namedtuple("Units", "t e_t m_phi e_phi fine")
"""T0 = t 2^e_t and phi0 = m_phi 2^e_phi, and whether all groups of (1) are normal numbers."""

Cycle = namedtuple("Cycle", "half_period amplitude speed sensitivity multiplier")
"""A limit cycle: half period, amplitude, speed before the switch, s = -dlnP/dlnmu, multiplier."""


@jit
def without_drag(p):
    """The foliot of a `LinearFoliot`."""
    return Foliot(p.mu, p.phi0, p.a, p.R, p.R_s, 0.0, 1.0, p.k, p.e)


@jit
def errors(swing, sensitivity, multiplier):
    """Relative errors of the outputs; period, amplitude and speed share the first."""
    return Outputs(swing, swing, swing, sensitivity, multiplier)


@jit
def _times(x, unit, e_unit):
    """x times a unit, and whether that is a normal number where x is not zero."""
    m, e = mantissa_exponent(where(x > 0.0, x, 1.0))
    group = where(x > 0.0, scale(m * unit, e + e_unit), 0.0)
    return group, not_(x > 0.0) | is_normal(group)


@jit
def without_dimensions(p):
    """The scene of a record with the parameters of a `Foliot`, and its units."""
    (m_mu, e_mu), (m_phi, e_phi) = mantissa_exponent(p.mu), mantissa_exponent(p.phi0)
    t, e_t = scaled_root(m_phi / m_mu, e_phi - e_mu)
    v, e_v = scaled_root(m_phi * m_mu, e_phi + e_mu)
    (d, fine_d), (kappa, fine_kappa) = _times(p.a, t, e_t), _times(p.k, t * t, 2.0 * e_t)
    powered = p.n > 0.0
    solid, drag = where(powered, 0.0, p.c), where(powered, p.c, 0.0)
    gamma = 0.0 * drag
    if any_lane(drag > 0.0):
        gamma = where(drag > 0.0, drag / p.mu * power(scale(v, e_v), p.n), 0.0)
    rho, slack = (p.R + solid) / p.mu, spare_torque(p.mu, p.R, solid) / p.mu
    fine = fine_d & fine_kappa & (not_(drag > 0.0) | is_normal(gamma)) & (not_(p.R + solid > 0.0) | is_normal(rho))
    scene = Scene(d, rho, (p.R_s + solid) / p.mu, gamma, where(gamma > 0.0, p.n, 1.0), kappa, p.e, slack)
    return scene, Units(t, e_t, m_phi, e_phi, fine)


@jit
def linear(columns, i):
    """The scene of cell i of columns without drag, and its units."""
    return without_dimensions(without_drag(read(LinearFoliot, columns, i)))


@jit
def spare_torque(mu, R, solid):
    """mu - R - solid, rounded once: what is left of the torque may be a small difference of large ones."""
    first, lost = two_sum(mu, -R)
    rest, lost_again = two_sum(first, -solid)
    return rest + (lost + lost_again)


@jit
def speed(units, v):
    """[rad/s], NaN where it is no normal number, as all sizes that are put back here."""
    return measured(units.m_phi / units.t * v, units.e_phi - units.e_t)


@jit
def time(units, t):
    """[s]."""
    return measured(units.t * t, units.e_t)


@jit
def given(units, cycle, verdict):
    """What a method gives of a cycle: its outputs and its status."""
    half_period, amplitude, before, sensitivity, multiplier = cycle
    period, fast = time(units, 2.0 * half_period), speed(units, before)
    swing = measured(units.m_phi * amplitude, units.e_phi)
    verdict = judged(units.fine, (period > 0.0) & (swing > 0.0) & (fast > 0.0), verdict)
    return Outputs(period, swing, fast, sensitivity, multiplier), verdict


UNITS = without_dimensions, given
"""Of a method that solves a `Scene`."""
