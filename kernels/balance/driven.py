"""Balance with viscous and solid friction, driven once a half swing: the limit cycle.

    th'' + 2 zeta w_n th' + w_n^2 (th +- r) = drive,  + for th' > 0,  r = R/k                        (1)
The drive is either an impulse, the energy k w given at each passage of th = 0, or a lift, the torque k m along the
motion over abs(th) < beta; it turns round once the balance has left the lift. Leaves out: what an escapement does to
the balance outside, and stiction: a cycle turns at more than r. No impulse starts a balance at rest at the zero.
Source: "Theory of Horology", 2-3, for the motion; the cycle, its existence and its multiplier are derived in
`_driven_swing`. A drive too weak to keep a swing up is refused as STICKS; so is an impulse for zeta >= 1, where no
balance released from rest comes to th = 0.
"""

import math

from kernels.balance import _driven_swing
from kernels.interface import Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT, NO_LIMIT_CYCLE, OK, OUT_OF_RANGE
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import jit
from kernels.lanes.ranges import or_none, partly
from kernels.lanes.vectors import isnt, where
from kernels.maths.elementary import is_normal, scale

ROUNDING = 4e-15
"""What `closed` is right to."""


@jit
def _write(i, cycle, units, omega_n, amplitude, period, multiplier, status):
    a, time, kept, verdict = cycle
    e, fine = units
    swing, whole = scale(a, e), 2.0 * time / omega_n
    wide, timed = is_normal(swing), is_normal(whole)
    amplitude[i], period[i], multiplier[i] = or_none(swing, wide), or_none(whole, timed), kept
    status[i] = where(fine, partly(wide & timed, verdict), OUT_OF_RANGE)


@jit
def _closed(i, zeta, omega_n, r, w, m, beta, rtol, *outputs):
    scene, e, fine = _driven_swing.without_units(zeta[i], r[i], w[i], m[i], beta[i])
    _write(i, _driven_swing.closed(scene), (e, fine), omega_n[i], *outputs)


@entry()
def closed(zeta, omega_n, r, w, m, beta, rtol, amplitude, period, multiplier, status):
    """Formulas for r = 0 under impulses and for zeta = 0; NO_METHOD elsewhere."""
    each_cell(_closed, (zeta, omega_n, r, w, m, beta, rtol, amplitude, period, multiplier, status))


@jit
def _closed_bound(i, zeta, r, beta, out):
    known = isnt(zeta[i] > 0.0) | (isnt(r[i] > 0.0) & isnt(beta[i] > 0.0))
    out[i] = where(known, ROUNDING, math.inf)


@entry("asked")
def closed_bound(zeta, omega_n, r, w, m, beta, rtol, asked, out):
    """Rounding where there is a formula, infinite elsewhere."""
    each_cell(_closed_bound, (zeta, r, beta, out))


@jit
def _newton(i, zeta, omega_n, r, w, m, beta, rtol, *outputs):
    scene, e, fine = _driven_swing.without_units(zeta[i], r[i], w[i], m[i], beta[i])
    _write(i, _driven_swing.newton(scene, rtol[i]), (e, fine), omega_n[i], *outputs)


@entry()
def newton(zeta, omega_n, r, w, m, beta, rtol, amplitude, period, multiplier, status):
    """Exact pieces of the half swing and Newton on its map, in 32 digits where conditioning leaves less than rtol."""
    each_cell(_newton, (zeta, omega_n, r, w, m, beta, rtol, amplitude, period, multiplier, status))


@jit
def _check(i, zeta, omega_n, r, w, m, beta, status):
    positive = (zeta[i] >= 0.0) & (omega_n[i] > 0.0) & (r[i] >= 0.0) & (w[i] >= 0.0) & (m[i] >= 0.0) & (beta[i] >= 0.0)
    finite = (zeta[i] < math.inf) & (omega_n[i] < math.inf) & (r[i] < math.inf) & (w[i] < math.inf)
    kicks, lifts = w[i] > 0.0, (m[i] > 0.0) & (beta[i] > 0.0)
    nothing_else = isnt((m[i] > 0.0) | (beta[i] > 0.0))
    one = (kicks & nothing_else) | (lifts & isnt(kicks))
    fine = positive & finite & (m[i] < math.inf) & (beta[i] < math.inf) & one
    lossless = isnt((zeta[i] > 0.0) | (r[i] > 0.0))
    status[i] = where(fine, where(lossless, NO_LIMIT_CYCLE, OK), BAD_INPUT)


@entry()
def check(zeta, omega_n, r, w, m, beta, status):
    """What no method is asked.

    BAD_INPUT: NaN, infinite, outside its limits; no drive, half of one (m without beta) or two. NO_LIMIT_CYCLE: nothing
    that takes energy.
    """
    each_cell(_check, (zeta, omega_n, r, w, m, beta, status))


BALANCE_DRIVEN = Kernel(
    name="balance_driven",
    doc="limit cycle of a balance with viscous and solid friction, kept up by impulses or by a lift",
    source='"Theory of Horology", section 2-3, for the motion; the cycle is derived here',
    parameters=(
        Field("zeta", "1", "viscous damping ratio c/(2 sqrt(I k))", lower=0.0),
        Field("omega_n", "rad/s", "angular frequency without friction, sqrt(k/I)", lower=0.0, open_lower=True),
        Field("r", "rad", "solid friction torque over spring stiffness, R/k", lower=0.0),
        Field(
            "w",
            "rad^2",
            "impulse: energy over spring stiffness given at each passage of 0; or else m and beta",
            default=0.0,
            lower=0.0,
            open_lower=True,
        ),
        Field("m", "rad", "lift torque over spring stiffness", default=0.0, lower=0.0),
        Field("beta", "rad", "the lift acts over abs(theta) < beta", default=0.0, lower=0.0),
    ),
    outputs=(
        Field("amplitude", "rad", "largest angle on the limit cycle"),
        Field("period", "s", "period of the limit cycle"),
        Field(
            "multiplier",
            "1",
            "multiplier of the half-swing map, of the amplitude as of the energy (0 where below 1e-308)",
        ),
    ),
    check=check,
    methods=(
        Method("closed", "formulas: impulses without solid friction, or no viscous damping", closed, closed_bound),
        Method("newton", "exact damped legs, Newton on the map of a half swing", newton),
    ),
    example={"zeta": 0.002, "omega_n": 5 * math.pi, "r": 0.0, "w": 0.1},
)
