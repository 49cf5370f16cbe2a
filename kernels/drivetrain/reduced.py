"""A drivetrain as a chain of inertias, reduced to fewer: what the small model gets right, and up to where.

    J_1 -k_1- J_2 -k_2- ... - J_n -k_n- ground,  a damper h_j beside every spring                    (1)
The spindle J_1 is free, the motor's end is held by k_n; with k_n = 0 it is free too. `reduction` is one of
    none            the full chain
    rivin           partial systems of one or two masses replaced by what is alike at rest; stays a chain
    guyan           the other masses follow those kept as at rest; full mass matrix
    irs             guyan, and the inertia of what follows
    craig_bampton   the spindle at rest, and modes of the chain with the spindle held (n_keep counts both)
    modal           the lowest modes, and what the others give way at rest
    exact           rivin's, with masses and springs that depend on the frequency: no error but rounding
to `n_keep` masses (or modes), or to the fewest that hold every frequency up to `f_max` to `tol`: from n downwards
until one less would break it; a frequency that is missing breaks it. Errors are those against the full chain. Exact
reductions have all its frequencies, found from the masses that are left; their damping is that of the full chain, their
J_kept, k_kept, h_kept are those at rest.
Leaves out: backlash, clearances, gyroscopic and lateral motion, stiffness that varies with the angle.
Source: Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201; see the modules `_reduction_...`.

Right to rtol are frequencies, damping (where not, INACCURATE), and errors as differences of what they compare: a
frequency_error of 1e-6 is one to 1e-6 +- rtol.
"""

import math

from kernels.drivetrain._chain import MASS_LIMIT, refusal
from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._chain_poles import modal_damping
from kernels.drivetrain._error import reduced, whole
from kernels.drivetrain._modal_masses import TURN
from kernels.drivetrain._model import EXACT, RIVIN, new_chain, new_modes, new_rooms, off_by, take_units
from kernels.interface import Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT, DAMPERS_OUT_OF_RANGE, INACCURATE, OK
from kernels.lanes.columns import entry_of_cells
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.ranges import partly
from kernels.lanes.vectors import magnitude, nearest
from kernels.maths.elementary import in_unit, is_normal, scale

REDUCTIONS = {"none": 0, "rivin": 1, "guyan": 2, "irs": 3, "craig_bampton": 4, "modal": 5, "exact": 6}
ORDERS = {"strict": 0, "paper": 1}
FIRST_OUTPUT = 9
"""Columns of parameters and of rtol."""
_REDUCTIONS, _ORDERS = float(len(REDUCTIONS)), float(len(ORDERS))
EVERYTHING = 1e300
"""Band [Hz] that holds every frequency."""
SMALL_PHASE = 0.1
"""w h e up to which (w h e)^2 << 1."""


@jit
def _held(x, e):
    """x 2^e; NaN where a float64 cannot hold it."""
    value = scale(x, e)
    return value if is_normal(value) or x == 0.0 else math.nan


@jit_call
def _write_modes(i, count, e, full, kept, of_poles, frequency, frequency_error, damping):
    """Frequencies, their errors and the damping, in Hz. Whether all are in range."""
    fine = True
    for mode in range(count):
        frequency[i, mode] = _held(kept.f[mode], e)
        frequency_error[i, mode] = off_by(kept.f[mode], full.f[mode])
        fine = fine and frequency[i, mode] >= 0.0
    modal_damping(count, kept.re, kept.im, of_poles, damping[i])
    return fine


@jit_call
def _write_chain(i, p, e_J, e_k, kept, J_kept, k_kept, h_kept):
    """The reduced chain in SI units. Whether all is in range."""
    fine = True
    for j in range(p):
        J_kept[i, j], k_kept[i, j] = _held(kept.J[j], e_J), _held(kept.k[j], e_k)
        h_kept[i, j] = _held(kept.h[j], 0.5 * (e_J + e_k))
        fine = fine and J_kept[i, j] >= 0.0 and k_kept[i, j] >= 0.0 and h_kept[i, j] >= 0.0
    return fine


@jit_call
def _solve_cell(
    i, J, k, h, reduction, n_keep, tol, f_max, order, rtol,
    frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
    model, full, kept, modes, rooms,
):  # fmt: skip
    """One cell at a time: the number of masses, the choice of what goes and every loop differ from cell to cell."""
    n, code = J.shape[1], int(reduction[i])
    for j in range(n):
        frequency[i, j], frequency_error[i, j], damping[i, j] = math.nan, math.nan, math.nan
        J_kept[i, j], k_kept[i, j], h_kept[i, j] = math.nan, math.nan, math.nan
    n_kept[i], frf_error[i], valid_to[i] = math.nan, math.nan, math.nan
    e_J, e_k = take_units(J[i], k[i], h[i], full)
    e = 0.5 * (e_k - e_J)
    band = in_unit(f_max[i], e)
    verdict = natural_frequencies(n, full.J, full.k, full.f, rooms.work)
    if verdict > OK:
        status[i] = int(verdict)
        return
    p, slower, off, error, verdict = model(code, n_keep[i], tol[i], band, order[i], full, kept, modes, rooms)
    if verdict > OK:
        status[i] = int(verdict)
        return
    count = n if code == EXACT else p
    fine = _write_modes(i, count, e, full, kept, rooms.angle, frequency, frequency_error, damping)
    if code in (0, RIVIN, EXACT):
        fine = _write_chain(i, p, e_J, e_k, kept, J_kept, k_kept, h_kept) and fine
    n_kept[i], frf_error[i] = p, off
    limit = SMALL_PHASE / (TURN * slower) if slower > 0.0 else math.inf
    valid_to[i] = scale(limit, e) if slower > 0.0 else f_max[i]
    verdict = (OK if limit >= band else DAMPERS_OUT_OF_RANGE) if error <= rtol[i] else INACCURATE
    status[i] = int(partly(fine, verdict))


@jit_call
def _solve_cells(
    J, k, h, reduction, n_keep, tol, f_max, order, rtol,
    frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
    model,
):  # fmt: skip
    n = J.shape[1]
    full, kept, modes, rooms = new_chain(n), new_chain(n), new_modes(n), new_rooms(n)
    for i in range(J.shape[0]):
        _solve_cell(
            i, J, k, h, reduction, n_keep, tol, f_max, order, rtol,
            frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
            model, full, kept, modes, rooms,
        )  # fmt: skip


@entry_of_cells
def _solve_whole(
    J, k, h, reduction, n_keep, tol, f_max, order, rtol,
    frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
):  # fmt: skip
    """Chains that stay as they are: compiled in a third of the time of `_solve_reduced`."""
    _solve_cells(
        J, k, h, reduction, n_keep, tol, f_max, order, rtol,
        frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status, whole,
    )  # fmt: skip


@entry_of_cells
def _solve_reduced(
    J, k, h, reduction, n_keep, tol, f_max, order, rtol,
    frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
):  # fmt: skip
    """Each chain and its reduced model, solved and compared."""
    _solve_cells(
        J, k, h, reduction, n_keep, tol, f_max, order, rtol,
        frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status, reduced,
    )  # fmt: skip


def direct(
    J, k, h, reduction, n_keep, tol, f_max, order, rtol,
    frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
):  # fmt: skip
    """Each chain and what becomes of it, in the columns of `_solve_whole` or of `_solve_reduced`."""
    columns = (
        J, k, h, reduction, n_keep, tol, f_max, order, rtol,
        frequency, frequency_error, damping, n_kept, frf_error, valid_to, J_kept, k_kept, h_kept, status,
    )  # fmt: skip
    for solve, rows in ((_solve_whole, reduction == 0.0), (_solve_reduced, reduction != 0.0)):
        if rows.all():
            solve(*columns)
        elif rows.any():
            part = [column[rows] for column in columns]
            solve(*part)
            for column, result in zip(columns[FIRST_OUTPUT:], part[FIRST_OUTPUT:], strict=True):
                column[rows] = result


@jit
def _is_whole(x, low, high):
    """Whether x is a whole number within limits; NaN is not."""
    return x >= low and x <= high and not magnitude(x - nearest(x)) > 0.0


@jit_call
def _choices(n, reduction, n_keep, tol, f_max, order):
    """Whether reduction, size and band are such that one reduced model is meant."""
    named = _is_whole(reduction, 0.0, _REDUCTIONS - 1.0) and _is_whole(order, 0.0, _ORDERS - 1.0)
    numbers = _is_whole(n_keep, 0.0, float(n)) and tol >= 0.0 and tol < math.inf
    one = not (n_keep > 0.0 and tol > 0.0) and (not reduction > 0.0 or n_keep > 0.0 or tol > 0.0)
    return named and numbers and one and f_max > 0.0 and f_max < math.inf


@entry_of_cells
def check(J, k, h, reduction, n_keep, tol, f_max, order, status):
    """BAD_INPUT: NaN, infinite or outside its limits; a reduction without `n_keep` and `tol`, or any cell with both.

    OUT_OF_RANGE: inertias, or stiffnesses, further apart than 2^300 or no normal float64.
    """
    for i in range(J.shape[0]):
        fine = _choices(J.shape[1], reduction[i], n_keep[i], tol[i], f_max[i], order[i])
        status[i] = int(refusal(J.shape[1], J[i], k[i], h[i]) if fine else BAD_INPUT)


PARAMETERS = (
    Field("J", "kg m^2", "moments of inertia, from the spindle on", lower=0.0, open_lower=True, dims=("mass",)),
    Field("k", "N m/rad", "stiffness of the spring behind each; the last, to ground, may be 0",
          lower=0.0, open_lower=True, dims=("mass",)),
    Field("h", "N m s/rad", "damping beside each spring", default=0.0, lower=0.0, dims=("mass",)),
)  # fmt: skip

DRIVETRAIN = Kernel(
    name="drivetrain",
    doc="drivetrain chain and its reduction to fewer masses",
    source="Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201; others in their modules",
    parameters=(
        *PARAMETERS,
        Field("reduction", "1", "how masses are saved", default=0.0, lower=0.0, upper=6.0, choices=REDUCTIONS,
              integer=True),
        Field("n_keep", "1", "masses (or modes) that stay; 0: as many as `tol` needs", default=0.0, lower=0.0,
              upper=float(MASS_LIMIT), integer=True),
        Field("tol", "1", "relative error that frequencies up to `f_max` may have; 0: `n_keep` is given", default=0.0,
              lower=0.0),
        Field("f_max", "Hz", "highest frequency that counts", default=EVERYTHING, lower=0.0, open_lower=True),
        Field("order", "1", "what goes first: strictly the smallest J e, or as in the source, where type a wins a tie",
              default=0.0, lower=0.0, upper=1.0, choices=ORDERS, integer=True),
    ),
    outputs=(
        Field("frequency", "Hz", "natural frequencies without damping, rising", dims=("mode",), gaps=True),
        Field("frequency_error", "1", "frequency over that of the full chain, minus 1", dims=("mode",), gaps=True),
        Field("damping", "1", "-Re s/abs(s) of the damped poles; of two real ones above 1", dims=("mode",), gaps=True),
        Field("n_kept", "1", "masses (or modes) of the reduced model", integer=True),
        Field("frf_error", "1", "largest error of the spindle's receptance up to `f_max` over its largest value; NaN "
              "where that is infinite: an undamped resonance, a free end", gaps=True),
        Field("valid_to", "Hz", "frequency up to which merged dampers hold, w h e = 0.1; `f_max` where none is"),
        Field("J_kept", "kg m^2", "moments of inertia of the reduced chain", dims=("mass",), gaps=True),
        Field("k_kept", "N m/rad", "its springs", dims=("mass",), gaps=True),
        Field("h_kept", "N m s/rad", "its dampers", dims=("mass",), gaps=True),
    ),
    check=check,
    methods=(Method("direct", "frequencies by dqds, reduced models as they are defined", direct),),
    example={"J": (0.25, 0.012, 0.06, 0.98), "k": (7e4, 1.3e4, 2.7e4, 1.2e4), "h": (1.8, 0.4, 1.8, 60.0),
             "n_keep": 3.0, "f_max": 200.0},
    same_length={"mode": "mass"},
)  # fmt: skip
