"""The foliot with viscous friction alone: its methods, from two series to the iterated map.

They read mu, phi0 and a only; the physics is in `_viscous`, the declaration in `cycle`.
"""

from kernels.foliot import _viscous
from kernels.foliot._units import errors
from kernels.lanes.codes import NOT_CONVERGED, OK
from kernels.lanes.jit import jit
from kernels.lanes.vectors import where


@jit
def closed(p, rtol):
    """The root q of q - tanh q = 1/alpha from fitted polynomials: 1e-15 at every drive, no iteration."""
    k, rest, units = _viscous.without_dimensions(p)
    return _viscous.given(units, _viscous.closed(k, rest), OK)


@jit
def closed_bound(p):
    """`closed` is right to rounding everywhere."""
    return errors(_viscous.ROUNDING, _viscous.ROUNDING, 2.0 * _viscous.ROUNDING)


@jit
def asymptotic(p, rtol):
    """Weak and strong series: the period within 0.5 %, the sensitivity within 2.2 % at every drive."""
    k, _, units = _viscous.without_dimensions(p)
    return _viscous.given(units, _viscous.asymptotic(k), OK)


@jit
def asymptotic_bound(p):
    """Bound on the error of `asymptotic`: the first terms left out."""
    k, _, _ = _viscous.without_dimensions(p)
    return _viscous.asymptotic_bound(k)


@jit
def event_map(p, rtol):
    """The exact map from switch to switch, iterated from rest; slow at strong drive, where a swing forgets little."""
    k, _, units = _viscous.without_dimensions(p)
    cycle, unsettled = _viscous.event_map(k, rtol)
    return _viscous.given(units, cycle, where(unsettled, NOT_CONVERGED, OK))


@jit
def event_map_bound(p):
    """What rounding leaves of the iterated map; that it settles to rtol, its status says."""
    k, _, _ = _viscous.without_dimensions(p)
    return _viscous.event_map_bound(k)
