"""Wear of a turning workpiece under the tool of a polishing machine, along its radius (Preston's law).

    dh/dt = preston p v,  v = alpha' J x - Omega J (x - w)                                           (1)
with x from the arm's pivot, J the turn by 90 degrees and v the speed between tool and workpiece. The tool is fixed to
the arm: its centre at L (cos, sin)(alpha + beta), its X axis along the arm, its outline abs(X/a)^n + abs(Y/b)^m = 1.
Over many turns all points of a ring of the workpiece wear equally (unless the rates of crank and workpiece have a ratio
of small integers: then this is the mean of the ring):
    wear(r) = preston p/(4 pi^2) int_0^2pi dtheta int_contact v dpsi                                 (2)
by the exact integral along the tool's outline of `_contour`. p is the parameter pressure, or
    p = load/A                                                                                       (3)
with A the current area of contact, that of the tool within the workpiece's disc (`_pressure`). Nothing wears without
contact, or beyond workpiece_radius, unless that is 0. Leaves out: a tool that turns in its socket, or tilts where it
hangs over; pressure that varies under the tool. Source: Preston, J. Soc. Glass Technol. 11:214 (1927); Cordero-Davila
et al., Opticheskii Zhurnal 78(3):55 (2011), (12) and (20), corrected.

LOCK_UP: the crank does not turn fully, so there is no wear (NaN). CHANGE_POINT: values for an arm that keeps its
branch. DOUBLE_CRANK: the arm turns fully, too; values are given. INACCURATE: an error exceeds rtol of the largest
requested wear; each value has its own error, `wear_error`, and is computed to rtol of itself. The rim of a workpiece
that a tool under constant load leaves completely wears without bound: NaN with an infinite error, hence INACCURATE.
"""

import math

from kernels.interface import Field
from kernels.lanes.codes import INACCURATE, OUT_OF_RANGE
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit
from kernels.lanes.ranges import partly
from kernels.lanes.records import read
from kernels.lanes.wiring import kernel, tracing
from kernels.maths.elementary import in_unit, is_normal
from kernels.wear import _panels, _pressure, _scene
from kernels.wear._contour import Scene
from kernels.wear._scene import Machine

_FAINT = 2.0**-100
_AT_RIM = 1e-8
"""Distance from the rim, over the radius, within which wear may have no bound."""
_FOUR_PI2 = 4.0 * math.pi * math.pi


@jit
def _contour(i, columns, room, memory):
    """(2) as integrals along the outline, split where contact ends; one cell at a time, for no two split alike.

    The status is about errors over the largest wear of the profile: that of every radius is stated beside it.
    """
    p, rtol = read(Machine, columns, i), columns.rtol[i]
    areas = _pressure.areas_of(i, p, columns, memory)
    setup, rim, hard = _scene.without_units(p), p.workpiece_radius, max(p.pressure, p.load)
    turns = _scene.turns_fully(setup.verdict)
    leaves = areas.panels > 0 and not areas.lowest > _pressure.FAINT * areas.largest  # the tool may leave the workpiece
    units = setup.pace + (setup.unit if areas.panels == 0 else -setup.unit)
    most, worst, normal = 0.0, 0.0, True
    for k in range(columns.radius.size):
        radius, wear, doubt, held = columns.radius[k], math.nan, math.nan, True
        if turns and radius > rim > 0.0:
            wear, doubt = 0.0, 0.0
        elif turns and leaves and not radius < rim * (1.0 - _AT_RIM):
            doubt = math.inf
        elif turns:
            r = in_unit(radius, setup.unit)
            r = r if r > _FAINT or setup.ride.w == 0.0 else 0.0
            scene = Scene(setup.arm, setup.tool, setup.ride, r, areas, room.spare)
            value, error = _panels.profile(scene, 0.7 * rtol, room)
            wear = _scene.with_units(value / _FOUR_PI2, p.preston, hard, units)
            if value > 0.0 and not is_normal(wear):
                wear, held, normal = math.nan, False, False
            else:
                doubt = _scene.with_units(error / _FOUR_PI2, p.preston, hard, units)
        columns.wear[i, k], columns.wear_error[i, k] = wear, doubt
        most = wear if wear > most else most
        worst = worst if doubt <= worst or not held else doubt
    if not turns:
        columns.status[i] = setup.verdict
    elif not (normal or most > 0.0):
        columns.status[i] = OUT_OF_RANGE
    else:
        columns.status[i] = partly(normal, setup.verdict) if worst <= rtol * most else INACCURATE


@jit
def _buffers():
    return _panels.room(), _pressure.memory()


POLISHER_WEAR = kernel(
    "polisher_wear",
    doc="Preston wear of a turning workpiece along its radius, under the tool of a polishing machine",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), corrected and completed; integral derived here",
    parameters=_scene.PARAMETERS,
    outputs=(
        Field("wear", "m/s", "depth worn away per time, averaged over the ring", dims=("radius",)),
        Field("wear_error", "m/s", "error bound of the wear", dims=("radius",), of_method=True),
    ),
    along=(Field("radius", "m", "distance from the workpiece's centre", lower=0.0),),
    record=Machine,
    check=_scene.check,
    methods=(
        tracing("contour", "integral along the tool's outline, adaptive to rtol at every radius",
                _contour, buffers=_buffers, loop=cell_by_cell),
    ),
    example=_scene.EXAMPLE,
)  # fmt: skip
