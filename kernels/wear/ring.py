"""Wear of a turning workpiece under the tool of a polishing machine, along its radius (Preston's law).

    dh/dt = preston p v,  v = alpha' J x - Omega J (x - w)                                           (1)
with x from the arm's pivot, J the turn by 90 degrees and v the speed between tool and workpiece. The tool is fixed to
the arm: its centre at L (cos, sin)(alpha + beta), its X axis along the arm, its outline abs(X/a)^n + abs(Y/b)^m = 1.
Over many turns every point of a ring of the workpiece wears alike (unless the rates of crank and workpiece are in the
ratio of small whole numbers: then this is the mean of the ring), and that is what is given:
    wear(r) = preston p/(4 pi^2) int_0^2pi dtheta int_contact v dpsi                                 (2)
by the exact integral along the tool's outline of `_profile`. p is the pressure given, or
    p = load/A                                                                                       (3)
with A the area of contact at that moment, that of the tool within the workpiece's disc (`_pressure`); without contact
nothing wears, nor does anything beyond workpiece_radius, if that is given. Leaves out: a tool that turns in its socket,
or tilts where it hangs over; pressure that varies under the tool. Source: Preston, J. Soc. Glass Technol. 11:214
(1927); Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (12) and (20), corrected.

LOCK_UP: the crank does not turn fully, so there is no wear (NaN). CHANGE_POINT: values if the arm keeps to its branch.
DOUBLE_CRANK: the arm turns fully, too; values are given. INACCURATE: an error exceeds rtol of the largest wear asked
for; each value has its own error beside it, and is sought to rtol of itself. The very rim of a workpiece that the tool
under a load leaves wholly wears without bound: NaN with an infinite error, hence INACCURATE.
"""

import math

from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT, INACCURATE, OK, OUT_OF_RANGE
from kernels.lanes.columns import entry_of_cells, one_by_one
from kernels.lanes.jit import jit, jit_inline
from kernels.lanes.ranges import partly
from kernels.maths.elementary import in_unit, is_normal
from kernels.wear import _pressure, _profile, _scene
from kernels.wear._scene import allowed, pressed

_FAINT = 2.0**-100
_AT_RIM = 1e-8
"""Distance from the rim, over the radius, within which wear may have no bound."""
_FOUR_PI2 = 4.0 * math.pi * math.pi


@jit_inline
def _wear_at(r, scene, unit, amount, rtol, work):
    """Wear and its error at one radius [m], and whether it is a number that float64 can hold."""
    preston, pressure, units, rim = amount
    if r > rim > 0.0:
        return 0.0, 0.0, True
    if _pressure.leaves(scene[3]) and not r < rim * (1.0 - _AT_RIM):
        return math.nan, math.inf, True
    near = in_unit(r, unit)
    near = near if near > _FAINT or scene[2][3] == 0.0 else 0.0
    value, error, _ = _profile.profile((scene[0], scene[1], scene[2], near, scene[3]), 0.7 * rtol, work)
    wear = _scene.with_units(value / _FOUR_PI2, preston, pressure, units)
    doubt = _scene.with_units(error / _FOUR_PI2, preston, pressure, units)
    return wear, doubt, not value > 0.0 or is_normal(wear)


@jit_inline
def _cell(p, rtol, loaded, radius, wear, wear_error, work):
    """Fills the profile of one cell and returns its status; p: its parameters, loaded: its areas of contact.

    The status is about errors over the largest wear of the profile: that of every radius is stated beside it.
    """
    arm, _, _, verdict = _scene.arm_without_units(p[0], p[1], p[2], p[3])
    tool, ride, unit, pace, fine = _scene.work_without_units(p)
    verdict = verdict if fine or verdict >= FIRST_REFUSAL else OUT_OF_RANGE
    turns = _scene.turns_fully(verdict)
    most, worst, normal = 0.0, 0.0, True
    for k in range(radius.size):
        wear[k], wear_error[k] = math.nan, math.nan
        if turns:
            amount = p[16], max(p[17], p[18]), pace + (unit if loaded[1] == 0 else -unit), p[19]
            value, doubt, held = _wear_at(radius[k], (arm, tool, ride, loaded), unit, amount, rtol, work)
            if held:
                wear[k], wear_error[k] = value, doubt
                most = value if value > most else most
                worst = worst if doubt <= worst else doubt  # NaN stays
            normal = normal and held
    if not turns:
        return verdict
    if not (normal or most > 0.0):
        return OUT_OF_RANGE
    return partly(normal, verdict) if worst <= rtol * most else INACCURATE


@entry_of_cells
def contour(
    b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
    load, workpiece_radius, rtol, radius, wear, wear_error, status,
):  # fmt: skip
    """(2) as integrals along the outline, split where contact ends; one cell at a time, for no two split alike."""
    cells = _scene.side_by_side((
        b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
        load, workpiece_radius,
    ))  # fmt: skip
    work = _profile.room()
    memory = _pressure.room()
    loaded = _pressure.unloaded(memory[0])
    for i in range(status.size):
        if i == 0 or not _pressure.shared(cells[i], rtol[i], cells[i - 1], rtol[i - 1]):
            loaded = _pressure.areas(cells[i], rtol[i], memory)
        status[i] = _cell(cells[i], rtol[i], loaded, radius, wear[i], wear_error[i], work)


@jit
def _check(
    i, b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
    load, workpiece_radius, status,
):  # fmt: skip
    fine = allowed(
        b[i], d[i], f[i], e[i], type[i], omega[i], b_angle[i], L[i], beta[i], w_x[i], w_y[i], Omega[i],
        tool_a[i], tool_b[i], tool_n[i], tool_m[i], preston[i],
    )  # fmt: skip
    status[i] = OK if fine and pressed(pressure[i], load[i], workpiece_radius[i]) else BAD_INPUT


@entry_of_cells
def check(
    b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston, pressure,
    load, workpiece_radius, status,
):  # fmt: skip
    """BAD_INPUT: NaN, infinite or outside its limits."""
    one_by_one(
        _check,
        (
            b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, preston,
            pressure, load, workpiece_radius, status,
        ),
    )  # fmt: skip


POLISHER_WEAR = Kernel(
    name="polisher_wear",
    doc="Preston wear of a turning workpiece along its radius, under the tool of a polishing machine",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), corrected and completed; the integral is ours",
    parameters=(
        *_scene.PARAMETERS,
        *_scene.PRESS,
    ),
    outputs=(
        Field("wear", "m/s", "depth worn away per time, mean of the ring", dims=("radius",)),
        Field("wear_error", "m/s", "what it may be wrong by", dims=("radius",)),
    ),
    along=(Field("radius", "m", "distance from the workpiece's centre", lower=0.0),),
    check=check,
    methods=(Method("contour", "integral along the tool's outline, adaptive to rtol at every radius", contour),),
    example=_scene.EXAMPLE,
)
