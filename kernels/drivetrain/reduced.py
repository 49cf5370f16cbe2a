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
Source: Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201; see the modules `_rivin` and `_bases`.

Right to rtol are frequencies, damping (where not, INACCURATE), and errors as differences of what they compare: a
frequency_error of 1e-6 is one to 1e-6 +- rtol. Only outputs that are asked for decide: at a resonance of damping zeta
the frf_error of n masses is known to 4e-16 n/zeta, the frequencies to all their digits.
"""

import math
from collections import namedtuple
from typing import Any, NamedTuple

from kernels.drivetrain import _bases, _modes, _rivin
from kernels.drivetrain._chain import (
    CHAIN_ROUNDING,
    MASS_LIMIT,
    TURN,
    new_chain,
    new_room,
    new_scene,
    off_by,
    refusal,
    take_units,
)
from kernels.drivetrain._error import receptance_error, reduce_enough
from kernels.drivetrain._frequencies import natural_frequencies
from kernels.drivetrain._poles import modal_damping, poles_of_chain
from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, DAMPERS_OUT_OF_RANGE, OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit, jit_apart, jit_shared
from kernels.lanes.ranges import partly
from kernels.lanes.records import largest, read
from kernels.lanes.wiring import kernel, split, tracing
from kernels.maths.elementary import in_unit, is_normal, scale


@jit
def _held(x, e):
    """x 2^e; NaN where a float64 cannot hold it."""
    value = scale(x, e)
    return value if is_normal(value) or x == 0.0 else math.nan


class Rows(NamedTuple):
    """A cell's rows of the outputs of these names."""

    frequency: Any
    frequency_error: Any
    damping: Any
    J_kept: Any
    k_kept: Any
    h_kept: Any


@jit_shared
def _begun(J, k, h, rows, full, room):
    """Every row to NaN; the exponents of a cell's units, and the status of the full chain's frequencies."""
    for row in rows:
        row[:] = math.nan
    e_J, e_k = take_units(J, k, h, full)
    return e_J, e_k, natural_frequencies(full.J.size, full.J, full.k, full.f, room.work)


@jit_apart
def _begin(i, columns, full, room):
    """Every output of a cell to NaN, and what `_begun` returns."""
    columns.n_kept[i] = columns.frf_error[i] = columns.valid_to[i] = columns.error[i] = math.nan
    return _begun(columns.J[i], columns.k[i], columns.h[i], read(Rows, columns, i), full, room)


@jit_apart
def _fill(rows, full, kept, e_J, e_k, count, p):
    """Rows in SI units: `count` frequencies, and where p > 0 the reduced chain; whether float64 holds them."""
    fine, e = True, 0.5 * (e_k - e_J)
    for mode in range(count):
        rows.frequency[mode] = _held(kept.f[mode], e)
        rows.frequency_error[mode] = off_by(kept.f[mode], full.f[mode])
        fine = fine and rows.frequency[mode] >= 0.0
    modal_damping(kept.s[: 2 * count], rows.damping)
    for j in range(p):
        J, k, h = _held(kept.J[j], e_J), _held(kept.k[j], e_k), _held(kept.h[j], 0.5 * (e_J + e_k))
        rows.J_kept[j], rows.k_kept[j], rows.h_kept[j] = J, k, h
        fine = fine and J >= 0.0 and k >= 0.0 and h >= 0.0
    return fine


@jit_apart
def _write(i, columns, fine, e, p, slower, frf_error, errors):
    """Outputs without rows in SI units; `errors` as of `Outputs`, `fine` as of `_fill`.

    Merged dampers hold up to w h e = SMALL_PHASE, `slower` being the largest h e.
    """
    limit = SMALL_PHASE / (TURN * slower) if slower > 0.0 else math.inf
    columns.n_kept[i], columns.valid_to[i] = p, scale(limit, e) if slower > 0.0 else columns.f_max[i]
    columns.frf_error[i], columns.error[i] = frf_error, largest(errors, columns.asked, Outputs, Outputs)
    verdict = OK if limit >= in_unit(columns.f_max[i], e) else DAMPERS_OUT_OF_RANGE
    columns.status[i] = partly(fine, verdict)


@jit
def _known(error):
    """A bound on an error; inf for NaN."""
    return error if error >= 0.0 else math.inf


@jit_apart
def _finish(poles, receptance, leaves_chain, has_all, f_max, e_J, e_k, model, rows, scene):
    """Rows of a reduced model, whether float64 holds them, its `receptance_error`; bounds on errors.

    `poles(p, scene)` and `receptance` are those of the model. Bounds of frequencies, of damping, and of that error:
    lightly damped, it has fewer digits than the frequencies.
    """
    off, error, rounding = math.nan, _known(model.error), math.inf
    blur, own_poles = poles(model.p, scene)
    blur = max(error, _known(blur))
    if blur < math.inf:
        off, rounding = receptance_error(f_max, own_poles, receptance, model, scene)
        rounding = max(blur, _known(rounding))
    count, p = scene.full.J.size if has_all else model.p, model.p if leaves_chain else 0
    return _fill(rows, scene.full, scene.kept, e_J, e_k, count, p), off, error, blur, rounding


@jit_apart
def _finish_rivin(f_max, e_J, e_k, model, rows, scene):
    """`_finish` of Rivin's model: a chain with as many frequencies as masses."""
    poles, receptance = _rivin.poles_of_both, _rivin.receptance_of_kept
    return _finish(poles, receptance, True, False, f_max, e_J, e_k, model, rows, scene)


@jit_apart
def _finish_exact(f_max, e_J, e_k, model, rows, scene):
    """`_finish` of the exact model: a chain with all frequencies of the full one."""
    poles, receptance = _rivin.poles_of_full, _rivin.receptance_of_exact
    return _finish(poles, receptance, True, True, f_max, e_J, e_k, model, rows, scene)


@jit_shared
def _finish_modes(f_max, e_J, e_k, model, rows, scene):
    """`_finish` of a model of modes, which is no chain."""
    poles, receptance = _modes.poles_of_modes, _modes.receptance_of_modes
    return _finish(poles, receptance, False, False, f_max, e_J, e_k, model, rows, scene)


@jit
def _scene(columns):
    """The buffers of a cell."""
    return (new_scene(columns.J.shape[1]),)


def _reducing(name, make, finish, has_all=False):
    """A solver of one reduction, made as `_error` says and finished as by `_finish`.

    It has all frequencies of the full chain however few its masses, or not: where `tol` is to be met, one.
    """

    @jit_apart
    def fill(i, columns, scene):
        p = read(Drivetrain, columns, i)
        e_J, e_k, status = _begin(i, columns, scene.full, scene.room)
        if status > OK:
            columns.status[i] = status
            return
        e, n_keep = 0.5 * (e_k - e_J), 1.0 if has_all and not p.n_keep > 0.0 else p.n_keep
        f_max = in_unit(p.f_max, e)
        model = reduce_enough(make, n_keep, p.tol, f_max, p.order, scene)
        if model.status > OK:
            columns.status[i] = model.status
            return
        fine, off, error, blur, rounding = finish(f_max, e_J, e_k, model, read(Rows, columns, i), scene)
        errors = Outputs(error, error, blur, 0.0 if n_keep > 0.0 else error, rounding, *_OF_CHAIN)
        _write(i, columns, fine, e, model.p, model.slower, off, errors)

    return tracing(name, "", fill, buffers=_scene, loop=cell_by_cell, estimates=True)


@jit_apart
def _whole(i, columns, full, room):
    """A chain that stays as it is."""
    e_J, e_k, status = _begin(i, columns, full, room)
    if status > OK:
        columns.status[i] = status
        return
    n, blur = full.J.size, max(CHAIN_ROUNDING, _known(poles_of_chain(full, full.J.size, room)))
    errors = Outputs(CHAIN_ROUNDING, CHAIN_ROUNDING, blur, 0.0, blur, *_OF_CHAIN)
    fine = _fill(read(Rows, columns, i), full, full, e_J, e_k, n, n)
    _write(i, columns, fine, 0.5 * (e_k - e_J), n, 0.0, 0.0 if blur < math.inf else math.nan, errors)


@jit_apart
def _whole_room(columns):
    n = columns.J.shape[1]
    return new_chain(n), new_room(n)


_OF_CHAIN = (CHAIN_ROUNDING, CHAIN_ROUNDING, CHAIN_ROUNDING, CHAIN_ROUNDING)
"""Bounds of what merging dampers and masses leaves."""
SOLVERS = (
    tracing("none", "", _whole, buffers=_whole_room, loop=cell_by_cell, estimates=True),
    _reducing("rivin", _rivin.rivin, _finish_rivin),
    _reducing("guyan", _bases.guyan, _finish_modes),
    _reducing("irs", _bases.irs, _finish_modes),
    _reducing("craig_bampton", _bases.craig_bampton, _finish_modes),
    _reducing("modal", _bases.modal, _finish_modes),
    _reducing("exact", _rivin.exact, _finish_exact, has_all=True),
)
"""Each is compiled when a cell asks for it first; its machine code is kept by its name."""
REDUCTIONS = {solver.name: code for code, solver in enumerate(SOLVERS)}
ORDERS = {"strict": 0, "paper": 1}
EVERYTHING = 1e300
"""Band [Hz] that holds every frequency."""
SMALL_PHASE = 0.1
"""w h e up to which (w h e)^2 << 1."""


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
    Field("reduction", "1", "how the chain is reduced", default=0.0, lower=0.0, upper=6.0, choices=REDUCTIONS,
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
            {float(code): solver for code, solver in enumerate(SOLVERS)},
        ),
    ),
    example={"J": (0.25, 0.012, 0.06, 0.98), "k": (7e4, 1.3e4, 2.7e4, 1.2e4), "h": (1.8, 0.4, 1.8, 60.0),
             "n_keep": 3.0, "f_max": 200.0},
    same_length={"mode": "mass"},
)  # fmt: skip
