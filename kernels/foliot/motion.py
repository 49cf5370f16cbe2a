"""Verge and foliot: angle and speed over one period of the limit cycle.

With t from the switch at +phi0, E = 1 - exp(-a t) and lambda = a v0/mu, over the half period 0 <= a t <= 2 q
    phi/phi0 = 1 + alpha (lambda E - (a t - E)),  v = (mu/a) (lambda - (1 + lambda) E)            (1)
and the other half is its negative. Source: Hoyng & Nieuwenhuizen, arXiv:1604.06681, section 2. With Coulomb friction,
hairspring or restitution the two pieces of the half swing follow `linear_flow`; power-law drag is left out.
"""

from kernels.foliot import _linear_swing, _units, _viscous
from kernels.foliot._units import LinearFoliot
from kernels.foliot.cycle import FOLIOT, check
from kernels.integrate import linear_flow
from kernels.interface import Field
from kernels.lanes.codes import OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit
from kernels.lanes.ranges import judged, or_none
from kernels.lanes.records import read
from kernels.lanes.vectors import fma, where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths.elementary import exp, exp_remainder, scale
from kernels.maths.wide import number, over, times


@jit
def closed(i, columns):
    """Equation (1) on the cycle from fitted polynomials: 4e-15 of amplitude and crossing speed at every drive."""
    (k, rest), units = _viscous.without_dimensions(read(LinearFoliot, columns, i))
    cycle, _ = _viscous.closed((k, rest), 0.0)
    outputs, _ = _viscous.given(units, cycle, OK)
    wide, moves = outputs.amplitude > 0.0, outputs.crossing_speed > 0.0
    for j in range(columns.phase.size):
        phase = columns.phase[j]
        first = phase < 0.5
        sign = where(first, 1.0, -1.0)
        t = 4.0 * cycle.q * where(first, phase, phase - 0.5)
        late = exp_remainder(t)  # a t - E, one function, for it is small at strong drive
        rise = where(t < 1.0, t - late, 1.0 - exp(-t))
        x, u = sign * (1.0 + fma(cycle.lam, rise, -late) / k), sign * (cycle.lam - (1.0 + cycle.lam) * rise)
        columns.angle[i, j] = or_none(scale(units.m_phi * x, units.e_phi), wide)
        columns.speed[i, j] = or_none(scale(units.m_mu / units.m_a * u, units.e_mu - units.e_a), moves)
    columns.status[i] = judged(units.representable & (wide | moves), wide & moves, OK)


@jit
def segments(i, columns):
    """The exact pieces of the swing on the cycle that `foliot` finds with them."""
    scene, units = _units.without_dimensions(read(LinearFoliot, columns, i))
    cycle, errors, legs, verdict = _linear_swing.segments(scene, columns.rtol[i])
    columns.error[i] = errors.period if errors.period > errors.multiplier else errors.multiplier
    start = scene.e * cycle.speed
    outputs, _ = _units.given(units, cycle, verdict)
    wide, moves = outputs.amplitude > 0.0, outputs.crossing_speed > 0.0
    for j in range(columns.phase.size):
        first = columns.phase[j] < 0.5
        sign = where(first, 1.0, -1.0)
        t = 2.0 * legs.time * where(first, columns.phase[j], columns.phase[j] - 0.5)
        rising = t < legs.t1
        v, force = where(rising, where(start > 0.0, start, 0.0), legs.down), where(rising, -legs.g1, legs.g2)
        y, v = linear_flow.motion(0.5 * scene.d, scene.kappa, v, force, where(rising, t, t - legs.t1))
        x, v = where(rising, 1.0 + y, legs.top - y), where(rising, v, -v)
        columns.angle[i, j] = or_none(sign * number(times((x, 0.0), units.angle)), wide)
        columns.speed[i, j] = or_none(sign * number(times((v, 0.0), over(units.angle, units.time))), moves)
    columns.status[i] = judged(units.fine & (wide | moves), wide & moves, verdict)


FOLIOT_MOTION = kernel(
    "foliot_motion",
    doc="angle and speed of a verge and foliot over one period",
    source="Hoyng & Nieuwenhuizen, arXiv:1604.06681",
    parameters=tuple(field for field in FOLIOT.parameters if field.name in LinearFoliot._fields),
    outputs=(
        Field("angle", "rad", "angle of the foliot", dims=("phase",)),
        Field("speed", "rad/s", "angular speed; at phases 0 and 0.5 just after the switch, at 1 just before",
              dims=("phase",)),
    ),
    along=(Field("phase", "1", "time since the switch at +phi0, over the period", lower=0.0, upper=1.0),),
    record=LinearFoliot,
    check=check,
    methods=(
        # the bound is relative to the amplitude and to the crossing speed
        tracing("closed", "viscous friction: exponentials on the closed-form cycle",
                closed, 4.0 * _viscous.ROUNDING, excludes=("R", "k", "e"), loop=cell_by_cell),
        tracing("segments", "exact pieces of linear terms", segments, loop=cell_by_cell, estimates=True),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0},
)  # fmt: skip
