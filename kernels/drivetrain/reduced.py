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
frequency_error of 1e-6 is one to 1e-6 +- rtol. Only outputs that are asked for decide: at a resonance of damping zeta
the frf_error of n masses is known to 4e-16 n/zeta, the frequencies to all their digits.
"""

import math
from collections import namedtuple

from kernels.drivetrain._chain import MASS_LIMIT, refusal
from kernels.drivetrain._chain_frequencies import natural_frequencies
from kernels.drivetrain._error import reduced, whole
from kernels.drivetrain._modal_masses import TURN
from kernels.drivetrain._model import CHAIN_ROUNDING, Wanted, off_by, reduced_scene, take_units, whole_scene
from kernels.drivetrain._poles import modal_damping
from kernels.drivetrain._reductions import CRAIG_BAMPTON, EXACT, GUYAN, IRS, MODAL, NONE, RIVIN, leaves_chain
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, DAMPERS_OUT_OF_RANGE, OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.ranges import partly
from kernels.lanes.records import largest, read
from kernels.lanes.wiring import kernel, split, tracing
from kernels.maths.elementary import in_unit, is_normal, scale

REDUCTIONS = {
    "none": NONE,
    "rivin": RIVIN,
    "guyan": GUYAN,
    "irs": IRS,
    "craig_bampton": CRAIG_BAMPTON,
    "modal": MODAL,
    "exact": EXACT,
}
ORDERS = {"strict": 0, "paper": 1}
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


@jit_apart
def _clear(i, columns):
    """Every output of a cell to NaN."""
    for j in range(columns.J.shape[1]):
        columns.frequency[i, j] = columns.frequency_error[i, j] = columns.damping[i, j] = math.nan
        columns.J_kept[i, j] = columns.k_kept[i, j] = columns.h_kept[i, j] = math.nan
    columns.n_kept[i] = columns.frf_error[i] = columns.valid_to[i] = columns.error[i] = math.nan


@jit_apart
def _write_modes(i, columns, count, e, scene):
    """Frequencies, their errors and the damping, in Hz. Whether all are in range."""
    fine, full, kept = True, scene.full, scene.kept
    for mode in range(count):
        columns.frequency[i, mode] = _held(kept.f[mode], e)
        columns.frequency_error[i, mode] = off_by(kept.f[mode], full.f[mode])
        fine = fine and columns.frequency[i, mode] >= 0.0
    modal_damping(kept.s[: 2 * count], columns.damping[i])
    return fine


@jit_apart
def _write_chain(i, columns, p, e_J, e_k, kept):
    """The reduced chain in SI units. Whether all is in range."""
    fine = True
    for j in range(p):
        J, k, h = _held(kept.J[j], e_J), _held(kept.k[j], e_k), _held(kept.h[j], 0.5 * (e_J + e_k))
        columns.J_kept[i, j], columns.k_kept[i, j], columns.h_kept[i, j] = J, k, h
        fine = fine and J >= 0.0 and k >= 0.0 and h >= 0.0
    return fine


@jit
def _errors(found):
    """Bounds of each output: lightly damped, a receptance's error has fewer digits than the frequencies."""
    chain = CHAIN_ROUNDING
    return Outputs(found.error, found.error, found.blur, found.choice, found.rounding, chain, chain, chain, chain)


def _filling(solve):
    """Fills a cell by `solve(wanted, scene)`: the choice of what goes and every loop differ by the cell."""

    @jit
    def fill(i, columns, scene):
        _clear(i, columns)
        p, full = read(Drivetrain, columns, i), scene.full
        e_J, e_k = take_units(p.J, p.k, p.h, full)
        e = 0.5 * (e_k - e_J)
        wanted = Wanted(p.reduction, p.n_keep, p.tol, in_unit(p.f_max, e), p.order)
        status = natural_frequencies(p.J.size, full.J, full.k, full.f, scene.spare.work)
        if status > OK:
            columns.status[i] = status
            return
        found = solve(wanted, scene)
        if found.status > OK:
            columns.status[i] = found.status
            return
        fine = _write_modes(i, columns, found.count, e, scene)
        if leaves_chain(p.reduction):
            fine = _write_chain(i, columns, found.p, e_J, e_k, scene.kept) and fine
        limit = SMALL_PHASE / (TURN * found.slower) if found.slower > 0.0 else math.inf
        verdict = OK if limit >= wanted.f_max else DAMPERS_OUT_OF_RANGE
        columns.n_kept[i], columns.frf_error[i] = found.p, found.off
        columns.valid_to[i] = scale(limit, e) if found.slower > 0.0 else p.f_max
        columns.error[i] = largest(_errors(found), columns.asked, Outputs, Outputs)
        columns.status[i] = partly(fine, verdict)

    return fill


WHOLE = tracing("none", "", _filling(whole), buffers=whole_scene, loop=cell_by_cell, estimates=True)
REDUCED = tracing("reduced", "", _filling(reduced), buffers=reduced_scene, loop=cell_by_cell, estimates=True)
"""Apart, because whole chains are compiled in a third of the time."""


@jit
def _is_one_model(p):
    """Whether reduction, size and band are such that one reduced model is meant."""
    one = not (p.n_keep > 0.0 and p.tol > 0.0) and (not p.reduction > 0.0 or p.n_keep > 0.0 or p.tol > 0.0)
    return one and p.n_keep <= p.J.size


@jit
def check(p):
    """BAD_INPUT: more masses kept than there are, a spring of 0 before the last, no reduction meant or two.

    A reduction needs either `n_keep` or `tol`, and no cell has both.
    OUT_OF_RANGE: inertias, or stiffnesses, further apart than 2^300 or no normal float64.
    """
    return refusal(p.J.size, p.J, p.k) if _is_one_model(p) else BAD_INPUT


PARAMETERS = (
    Field("J", "kg m^2", "moments of inertia, from the spindle on", lower=0.0, open_lower=True, dims=("mass",)),
    Field("k", "N m/rad", "stiffness of the spring behind each; only the last, to ground, may be 0", lower=0.0,
          dims=("mass",)),
    Field("h", "N m s/rad", "damping beside each spring", default=0.0, lower=0.0, dims=("mass",)),
    Field("reduction", "1", "how masses are saved", default=0.0, lower=0.0, upper=6.0, choices=REDUCTIONS,
          integer=True),
    Field("n_keep", "1", "masses (or modes) that stay; 0: as many as `tol` needs", default=0.0, lower=0.0,
          upper=float(MASS_LIMIT), integer=True),
    Field("tol", "1", "relative error that frequencies up to `f_max` may have; 0: `n_keep` is given", default=0.0,
          lower=0.0),
    Field("f_max", "Hz", "highest frequency that counts", default=EVERYTHING, lower=0.0, open_lower=True),
    Field("order", "1", "what goes first: strictly the smallest J e, or as in the source, where type a wins a tie",
          default=0.0, lower=0.0, upper=1.0, choices=ORDERS, integer=True),
)  # fmt: skip
"""The chain, and what it is to be reduced to."""

Drivetrain = namedtuple("Drivetrain", [field.name for field in PARAMETERS])

OUTPUTS = (
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
)  # fmt: skip

Outputs = namedtuple("Outputs", [field.name for field in OUTPUTS])

DRIVETRAIN = kernel(
    "drivetrain",
    doc="drivetrain chain and its reduction to fewer masses",
    source="Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201; others in their modules",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    record=Drivetrain,
    check=check,
    loop=cell_by_cell,
    methods=(
        split(
            "direct", "frequencies by dqds, reduced models as they are defined", "reduction",
            {float(code): WHOLE if code == NONE else REDUCED for code in REDUCTIONS.values()},
        ),
    ),
    example={"J": (0.25, 0.012, 0.06, 0.98), "k": (7e4, 1.3e4, 2.7e4, 1.2e4), "h": (1.8, 0.4, 1.8, 60.0),
             "n_keep": 3.0, "f_max": 200.0},
    same_length={"mode": "mass"},
)  # fmt: skip
