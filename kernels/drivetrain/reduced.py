"""A drivetrain as a chain of inertias, its reduction to fewer, and the error of the reduced model over frequency.

    J_1 -k_1- J_2 -k_2- ... - J_n -k_n- ground,  a damper h_j beside every spring                    (1)
The spindle J_1 is free, the motor's end is held by k_n; with k_n = 0 it is free too. `reduction` is one of
    none            the full chain
    rivin           partial systems of one or two masses replaced by statically equivalent ones; remains a chain
    guyan           the other masses follow the kept ones statically; full mass matrix
    irs             guyan, with the inertia of the masses that follow
    craig_bampton   static mode of the spindle, and modes of the chain with the spindle held (n_keep counts both)
    modal           the lowest modes, and the static compliance of the others
    exact           rivin's, with masses and springs that depend on the frequency: no error but rounding
to `n_keep` masses (or modes), or to the fewest that keep every frequency up to `f_max` within `tol`: from n downwards
until one fewer would exceed it or lose a frequency. Errors are relative to the full chain. Exact reductions have all
frequencies of the chain, found from the masses that remain; their damping is that of the full chain, and J_kept,
k_kept, h_kept are the static values.
Leaves out: backlash, clearances, gyroscopic and lateral motion, stiffness that varies with the angle.
Source: Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201; see the modules `_rivin` and `_bases`.

Frequencies and damping are accurate to rtol (otherwise INACCURATE); errors are so relative to the compared values: a
frequency_error of 1e-6 means 1e-6 +- rtol. Only requested outputs count: at a resonance with damping zeta the
frf_error of n masses is known to 4e-16 n/zeta, the frequencies to all digits.
"""

import math
from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np

from kernels.drivetrain import _bases, _modes, _rivin
from kernels.drivetrain._chain import (
    CHAIN_POLES,
    CHAIN_ROUNDING,
    ERROR,
    FREQUENCIES,
    MAKE,
    MASS_LIMIT,
    PARTS,
    POLES,
    RITZ,
    STATIC,
    TURN,
    Model,
    new_scene,
    off_by,
    refusal,
    take_units,
)
from kernels.drivetrain._error import receptance_error, reduce_enough
from kernels.drivetrain._frequencies import natural_frequencies
from kernels.drivetrain._poles import modal_damping, poles_of_chain
from kernels.interface import Field
from kernels.lanes.addresses import jit_by_address, table
from kernels.lanes.codes import BAD_INPUT, DAMPERS_OUT_OF_RANGE, OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit, jit_apart
from kernels.lanes.ranges import partly
from kernels.lanes.records import largest, read
from kernels.lanes.wiring import kernel, tracing
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


@jit_apart
def _rows(rows, full, kept, e_J, e_k, count, p):
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


@jit
def _known(error):
    """A bound on an error; inf for NaN."""
    return error if error >= 0.0 else math.inf


@jit_by_address
def whole(p, order, scene):
    """The chain as it is."""
    full, kept = scene.full, scene.kept
    for j in range(full.J.size):
        kept.J[j], kept.k[j], kept.h[j], kept.f[j] = full.J[j], full.k[j], full.h[j], full.f[j]
    return Model(p, CHAIN_ROUNDING, 0.0, 0.0, 0.0)


@jit_by_address
def no_error(f_max, own_poles, model, scene):
    """`receptance_error` of the chain itself."""
    return 0.0, 0.0


@jit_by_address
def error_of_kept(f_max, own_poles, model, scene):
    """`receptance_error` of Rivin's chain."""
    return receptance_error(f_max, own_poles, _rivin.receptance_of_kept, model, scene)


@jit_by_address
def error_of_exact(f_max, own_poles, model, scene):
    """`receptance_error` of the chain that depends on the frequency."""
    return receptance_error(f_max, own_poles, _rivin.receptance_of_exact, model, scene)


@jit_by_address
def error_of_modes(f_max, own_poles, model, scene):
    """`receptance_error` of a model of modes."""
    return receptance_error(f_max, own_poles, _modes.receptance_of_modes, model, scene)


@jit
def _scene(columns):
    """The buffers of a cell."""
    return (new_scene(columns.J.shape[1], np.empty_like(columns.parts[0])),)


@jit_apart
def _fill(i, columns, scene):
    """The rows and numbers of a cell."""
    p, rows, full, kept = read(Drivetrain, columns, i), read(Rows, columns, i), scene.full, scene.kept
    columns.n_kept[i] = columns.frf_error[i] = columns.valid_to[i] = columns.error[i] = math.nan
    for row in rows:
        row[:] = math.nan
    n, reduction = full.J.size, int(p.reduction)
    for place in range(PARTS):
        scene.parts[place] = columns.parts[reduction, place]
    e_J, e_k = take_units(p.J, p.k, p.h, full)
    status = FREQUENCIES(scene.parts, n, full.J, full.k, full.f, scene.room.work)
    if status > OK:
        columns.status[i] = status
        return

    # exact models have all frequencies however few their masses: where `tol` is to be met, one
    e, has_all = 0.5 * (e_k - e_J), reduction in (NONE, EXACT)
    n_keep = n if reduction == NONE else 1.0 if has_all and not p.n_keep > 0.0 else p.n_keep
    f_max = in_unit(p.f_max, e)
    model = reduce_enough(n_keep, p.tol, f_max, p.order, scene)
    if model.status > OK:
        columns.status[i] = model.status
        return

    # bounds of frequencies, of damping, and of the receptance's error: lightly damped, it has fewer digits than these
    off, error, rounding = math.nan, _known(model.error), math.inf
    of_chain, blur, own_poles = POLES(scene.parts, model, scene)
    of_chain, blur = _known(of_chain), max(error, _known(blur))
    if max(of_chain, blur) < math.inf:
        off, rounding = ERROR(scene.parts, f_max, own_poles, model, scene)
        rounding = max(of_chain, blur, _known(rounding))
    fine = _rows(rows, full, kept, e_J, e_k, n if has_all else model.p, model.p if has_all or reduction == RIVIN else 0)

    # merged dampers hold up to w h e = SMALL_PHASE, `slower` being the largest h e
    limit = SMALL_PHASE / (TURN * model.slower) if model.slower > 0.0 else math.inf
    columns.n_kept[i], columns.valid_to[i] = model.p, scale(limit, e) if model.slower > 0.0 else p.f_max
    errors = Outputs(error, max(error, CHAIN_ROUNDING), blur, 0.0 if n_keep > 0.0 else error, rounding, *_OF_CHAIN)
    columns.frf_error[i], columns.error[i] = off, largest(errors, columns.asked, Outputs, Outputs)
    columns.status[i] = partly(fine, OK if limit >= f_max else DAMPERS_OUT_OF_RANGE)


_OF_CHAIN = (CHAIN_ROUNDING, CHAIN_ROUNDING, CHAIN_ROUNDING, CHAIN_ROUNDING)
"""Bounds of what merging dampers and masses leaves."""
_COMMON = {FREQUENCIES: natural_frequencies, CHAIN_POLES: poles_of_chain}
_EXACT = _COMMON | {POLES: _rivin.poles_of_full, ERROR: error_of_exact}
_MODES = _COMMON | {POLES: _modes.poles_of_modes, ERROR: error_of_modes, RITZ: _modes.ritz}
WAYS = {
    "none": _EXACT | {MAKE: whole, ERROR: no_error},
    "rivin": _COMMON | {MAKE: _rivin.rivin, POLES: _rivin.poles_of_both, ERROR: error_of_kept},
    "guyan": _MODES | {MAKE: _bases.guyan},
    "irs": _MODES | {MAKE: _bases.irs, STATIC: _bases.guyan},
    "craig_bampton": _MODES | {MAKE: _bases.craig_bampton},
    "modal": _MODES | {MAKE: _bases.modal},
    "exact": _EXACT | {MAKE: _rivin.exact},
}
"""What each reduction consists of; compiled when a cell asks for it first."""
REDUCTIONS = {name: code for code, name in enumerate(WAYS)}
NONE, RIVIN, EXACT = REDUCTIONS["none"], REDUCTIONS["rivin"], REDUCTIONS["exact"]
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
    Field("J", "kg m^2", "moments of inertia, beginning at the spindle", lower=0.0, open_lower=True, dims=("mass",)),
    Field("k", "N m/rad", "stiffness of the spring after each inertia; only the last, to ground, may be 0", lower=0.0,
          dims=("mass",)),
    Field("h", "N m s/rad", "damping parallel to each spring", default=0.0, lower=0.0, dims=("mass",)),
    Field("reduction", "1", "how the chain is reduced", default=0.0, lower=0.0, upper=6.0, choices=REDUCTIONS,
          integer=True),
    Field("n_keep", "1", "masses (or modes) to keep; 0: as few as `tol` allows", default=0.0, lower=0.0,
          upper=float(MASS_LIMIT), integer=True),
    Field("tol", "1", "allowed relative error of frequencies up to `f_max`; 0: `n_keep` decides", default=0.0,
          lower=0.0),
    Field("f_max", "Hz", "highest frequency of interest", default=EVERYTHING, lower=0.0, open_lower=True),
    Field("order", "1", "order of elimination: the smallest J e first, or as in the source, where type a wins a tie",
          default=0.0, lower=0.0, upper=1.0, choices=ORDERS, integer=True),
)  # fmt: skip
"""The chain, and what it is to be reduced to."""

Drivetrain = namedtuple("Drivetrain", [field.name for field in PARAMETERS])

OUTPUTS = (
    Field("frequency", "Hz", "undamped natural frequencies, ascending", dims=("mode",), gaps=True),
    Field("frequency_error", "1", "relative error of each, against the full chain", dims=("mode",), gaps=True),
    Field("damping", "1", "damping ratio -Re s/abs(s) of poles; above 1: two real ones", dims=("mode",), gaps=True),
    Field("n_kept", "1", "masses (or modes) of the reduced model", integer=True),
    Field("frf_error", "1", "largest error of the spindle's receptance up to `f_max` over its largest value; NaN "
          "if that is infinite: an undamped resonance, a free end", gaps=True),
    Field("valid_to", "Hz", "frequency up to which merged dampers hold, omega h/k = 0.1; `f_max` without any"),
    Field("J_kept", "kg m^2", "moments of inertia of the reduced chain", dims=("mass",), gaps=True),
    Field("k_kept", "N m/rad", "stiffnesses of the reduced chain", dims=("mass",), gaps=True),
    Field("h_kept", "N m s/rad", "dampers of the reduced chain", dims=("mass",), gaps=True),
)  # fmt: skip

Outputs = namedtuple("Outputs", [field.name for field in OUTPUTS])

DRIVETRAIN = kernel(
    "drivetrain",
    doc="drivetrain chain and its reduction to fewer masses",
    source="Baran & Marchelek, Mechanika Teoretyczna i Stosowana 9 (1971) 201; other reductions in their modules",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    record=Drivetrain,
    check=check,
    loop=cell_by_cell,
    methods=(
        tracing(
            "direct", "frequencies by dqds; reduced models from their definitions", _fill,
            buffers=_scene, loop=cell_by_cell, estimates=True, parts=table("reduction", dict(enumerate(WAYS.values()))),
        ),
    ),
    example={"J": (0.25, 0.012, 0.06, 0.98), "k": (7e4, 1.3e4, 2.7e4, 1.2e4), "h": (1.8, 0.4, 1.8, 60.0),
             "n_keep": 3.0, "f_max": 200.0},
    same_length={"mode": "mass"},
)  # fmt: skip
