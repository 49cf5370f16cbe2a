"""The general foliot without dimensions, and back.

In units of phi0 and of T0 = sqrt(phi0/mu) the half swing after the switch at x = +1 obeys
    x'' = -1 - (d x' + (rho + gamma abs(x')^n) sgn x') - kappa x                                     (1)
    d = a T0,  rho = R/mu,  rho_s = R_s/mu,  gamma = c (phi0 mu)^(n/2)/mu,  kappa = k T0^2.
It starts with e times the speed before the switch and ends at x = -1; the other half mirrors it. Drive work is 2.
A *scene* is the tuple (d, rho, rho_s, gamma, n, kappa, e, slack), slack = 1 - rho without the rounding of rho. Drag of
degree 0 is Coulomb friction: it is counted in rho, rho_s and slack, and gamma is 0.
A *cycle* is the tuple (half period, amplitude, speed before the switch, s = -dlnP/dlnmu, multiplier).
"""

from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none
from kernels.lanes.vectors import isnt, nearest, sqrt, where
from kernels.maths.elementary import is_normal, mantissa_exponent, power, scale
from kernels.maths.pairs import two_sum


@jit
def _root(m, e):
    """Square root of m 2^e, m in [0.5, 4), as a pair again."""
    half = nearest(0.5 * e - 0.25)
    return sqrt(m * where(e - 2.0 * half > 0.5, 2.0, 1.0)), half


@jit
def without_dimensions(mu, phi0, a, R, R_s, c, n, k, e):
    """The scene, and the units: T0 and phi0, each as mantissa and exponent, with whether all groups are normal."""
    (m_mu, e_mu), (m_phi, e_phi) = mantissa_exponent(mu), mantissa_exponent(phi0)
    t, e_t = _root(m_phi / m_mu, e_phi - e_mu)
    v, e_v = _root(m_phi * m_mu, e_phi + e_mu)
    d, kappa = _in_units(a, t, e_t), _in_units(k, t * t, 2.0 * e_t)
    solid, drag = where(n > 0.0, 0.0, c), where(n > 0.0, c, 0.0)
    gamma = _strength(mu, drag, n, scale(v, e_v))
    rho, slack = (R + solid) / mu, spare_torque(mu, R, solid) / mu
    fine = _kept(a, d) & _kept(k, kappa) & _kept(drag, gamma) & _kept(R + solid, rho)
    return (d, rho, (R_s + solid) / mu, gamma, where(n > 0.0, n, 1.0), kappa, e, slack), (t, e_t, m_phi, e_phi, fine)


@jit
def spare_torque(mu, R, solid):
    """mu - R - solid, rounded once: what is left of the torque may be a small difference of large ones."""
    first, lost = two_sum(mu, -R)
    rest, lost_again = two_sum(first, -solid)
    return rest + (lost + lost_again)


@jit
def _in_units(x, unit, e_unit):
    m, e = mantissa_exponent(where(x > 0.0, x, 1.0))
    return where(x > 0.0, scale(m * unit, e + e_unit), 0.0)


@jit
def _strength(mu, c, n, speed):
    """gamma of (1); 0 without drag, whatever n."""
    return where(c > 0.0, c / mu * power(speed, n), 0.0)


@jit
def _kept(x, group):
    """Whether a group is a normal number where its parameter is not zero."""
    return isnt(x > 0.0) | is_normal(group)


@jit
def dimensional(units, cycle):
    """Period [s], amplitude [rad], crossing speed [rad/s], each NaN where it is no normal number.

    Also whether all groups are normal numbers, and whether all of these are.
    """
    t, e_t, m_phi, e_phi, fine = units
    half_period, amplitude, speed, _, _ = cycle
    period = scale(2.0 * t * half_period, e_t)
    swing, fast = scale(m_phi * amplitude, e_phi), scale(m_phi / t * speed, e_phi - e_t)
    timed, wide, moves = is_normal(period), is_normal(swing), is_normal(fast)
    return or_none(period, timed), or_none(swing, wide), or_none(fast, moves), fine, timed & wide & moves
