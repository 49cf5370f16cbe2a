"""Polishing machine: how far a crank swings the arm that carries the tool, and how well.

    eta_+- = +-arccos((b^2 + d^2 - (f +- e)^2)/(2 b d)),  first sign + for type A, - for type B      (1)
    A0 = (eta_plus + eta_minus)/2,  A1 = abs(eta_plus - eta_minus)/2                                 (2)
b is the distance of the motor from the arm's pivot, e the crank (eccentricity), d the arm from its pivot to the coupler
f. Angles are from b: eta_plus, eta_minus those of the arm at its extremes, theta_plus, theta_minus those of the crank
there. Leaves out: play, bending, and the tool itself (`polisher_motion`).
Source: Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (37)-(40), without the misprint in (40). The paper
never asks whether the motor turns at all; here that is the `status`, judged by sums without error.

OK: the crank turns, the arm swings. Remarks, with what exists: LOCK_UP (`theta_lock`: where the crank locks, to either
side of b, nearest first), DOUBLE_CRANK (e > b, the arm turns fully: rates and transmission angle), CHANGE_POINT (a sum
that decides is 0 to within rounding of the lengths, 2^-53 of their sum: angles of the linkage as it is, or flat; no
rates, no derivatives). A crank e = 0 swings nothing; crank angles are those for e towards 0. Too unequal lengths
(1e36) are OUT_OF_RANGE.
"""

import math

import numpy as np

from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method, Status
from kernels.lanes.codes import BAD_INPUT, CHANGE_POINT, DOUBLE_CRANK, INACCURATE, LOCK_UP, OK
from kernels.lanes.columns import each_cell, entry, entry_of_cells, one_by_one
from kernels.lanes.groups import GROUP, cells_at, each_group, room
from kernels.lanes.jit import jit
from kernels.lanes.vectors import isnt, where
from kernels.polisher import _motor_waveform, _sampled_motion, _textbook_angles, extremes
from kernels.polisher._cell import judged, locks, no_rates, said, write
from kernels.polisher.linkage import in_units, larger, margins, side_of

ROUNDING = 3e-15
"""What `stable` is right to."""

_INACCURATE_CODE = int(Status.INACCURATE)
_PRESSED, _FIRST_SLOPE = 8, 12  # positions of the transmission angle and of A0_b among the outputs


@jit
def _stable(i, b, d, f, e, type, *outputs):
    cell = judged(b[i], d[i], f[i], e[i])
    lengths, _, margin, code = cell
    flat = extremes.flattened(margin)
    root = extremes.roots(lengths, flat)
    angles = extremes.extremes(lengths, root)
    crank_angles = extremes.crank_angles(lengths, flat, root)
    pressed = extremes.transmission(lengths, margin)
    slopes = extremes.tolerances(lengths, root)
    stops = locks(code, lengths, margin)
    write(i, side_of(type[i]), cell, angles, crank_angles, stops, pressed, no_rates(code), slopes, code, *outputs)


@entry()
def stable(
    b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
    transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
):  # fmt: skip
    """Half-angle forms of sums without error."""
    columns = (
        b, d, f, e, type, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
        transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
    )  # fmt: skip
    each_cell(_stable, columns)


@entry("asked")
def stable_bound(b, d, f, e, type, rtol, asked, out):
    """Rounding."""
    out[:] = ROUNDING


@jit
def _textbook(i, b, d, f, e, type, *outputs):
    cell = judged(b[i], d[i], f[i], e[i])
    lengths, _, margin, code = cell
    angles = _textbook_angles.extremes(lengths)
    crank_angles = _textbook_angles.crank_angles(lengths)
    pressed = _textbook_angles.transmission(lengths)
    slopes = _textbook_angles.tolerances(lengths)
    stops = locks(code, lengths, margin)
    write(i, side_of(type[i]), cell, angles, crank_angles, stops, pressed, no_rates(code), slopes, code, *outputs)


@entry()
def textbook(
    b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
    transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
):  # fmt: skip
    """The paper's arccos; what that loses is the bound."""
    columns = (
        b, d, f, e, type, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
        transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
    )  # fmt: skip
    each_cell(_textbook, columns)


@jit
def _textbook_bound(i, b, d, f, e, asked, out):
    """The largest of the errors asked for; verdicts and locks are those of `stable`."""
    lengths, _, _, code = judged(b[i], d[i], f[i], e[i])
    angles = _textbook_angles.angle_errors(lengths)
    slopes = _textbook_angles.slope_errors(lengths)
    swings = said(code, OK) | (said(code, CHANGE_POINT) & (lengths[3] <= lengths[0]))
    worst = 0.0 * code + ROUNDING
    for k in range(len(angles)):
        worst = where(swings & (asked[k] > 0), _worse(worst, angles[k]), worst)
    pressed = _textbook_angles.transmission_error(lengths)
    turns = swings | said(code, CHANGE_POINT) | said(code, DOUBLE_CRANK)
    worst = where(turns & (asked[_PRESSED] > 0), _worse(worst, pressed), worst)
    for k in range(len(slopes)):
        worst = where(said(code, OK) & (asked[_FIRST_SLOPE + k] > 0), _worse(worst, slopes[k]), worst)
    out[i] = worst


@jit
def _worse(worst, error):
    """The larger of two errors, inf for NaN."""
    return where(error <= worst, worst, where(error > worst, error, math.inf))


@entry("asked")
def textbook_bound(b, d, f, e, type, rtol, asked, out):
    """What rounding comes to in an arccos and in differences of two of them, for each cell."""
    each_cell(_textbook_bound, (b, d, f, e, asked, out))


@jit
def _over_a_turn(first, b, d, f, e, rtol, buffers, thd, rate_max, rate_min, status):
    i = cells_at(first)
    lengths, _, margin, code = judged(b[i], d[i], f[i], e[i])
    forward, backward, bends, openings = buffers[0], buffers[1], buffers[2], buffers[3]
    scanned = _motor_waveform.scan(lengths, margin, forward, backward, bends, openings)
    distortion, doubt = _motor_waveform.distortion(lengths, margin, scanned, bends, openings)
    most, least, rate_doubt = _motor_waveform.rates(lengths, margin, forward, backward)
    swings, turns = said(code, OK), said(code, OK) | said(code, DOUBLE_CRANK)
    thd[i] = where(swings, distortion, math.nan)
    rate_max[i], rate_min[i] = where(turns, most, math.nan), where(turns, least, math.nan)
    wide = (turns & isnt(rate_doubt <= rtol[i])) | (swings & isnt(doubt <= rtol[i])) | isnt(rtol[i] >= ROUNDING)
    status[i] = where(wide & (code < FIRST_REFUSAL), INACCURATE, code)


@entry()
def over_a_turn(b, d, f, e, rtol, thd, rate_max, rate_min, status):
    """The outputs that `stable` lacks; `_motor_waveform` estimates their rounding."""
    buffers = room(4 * _motor_waveform.NODES).reshape((4, _motor_waveform.NODES * GROUP))
    each_group(_over_a_turn, (b, d, f, e, rtol, buffers, thd, rate_max, rate_min, status))


def waveform(
    b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
    transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
):  # fmt: skip
    """As `stable`, and then the motion over a turn."""
    stable(
        b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
        transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
    )  # fmt: skip
    over_a_turn(b, d, f, e, rtol, thd, rate_max, rate_min, status)


@jit
def _in_samples(
    i, b, d, f, e, type, rtol, alphas, speeds, bends,
    A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer, transmission_angle,
    thd, rate_max, rate_min, status,
):  # fmt: skip
    """`status` comes with the verdict on the linkage."""
    lengths, _, _ = in_units(b[i], d[i], f[i], e[i])
    arm, code, none = (lengths, margins(*lengths)), float(status[i]), math.nan
    angles, cranks, rates = (none, none, none, none), (none, none), (none, none, none)
    stops, pressed, doubt = (none, none), none, math.inf
    if said(code, LOCK_UP):
        stops, doubt = _sampled_motion.locks(arm)
        pressed = 0.0
    elif said(code, OK) or said(code, DOUBLE_CRANK):
        blind = _sampled_motion.sample(arm, alphas, speeds, bends)
        pressed = _sampled_motion.pressed(arm)
        rates, doubt = _sampled_motion.rates(arm, alphas, speeds)
        if said(code, OK):
            angles, cranks, lost = _sampled_motion.extremes(arm, alphas)
            doubt = larger(doubt, lost)
        doubt = larger(doubt, blind)
    kind = side_of(type[i])
    A0[i], A1[i], eta_plus[i], eta_minus[i] = kind * angles[0], angles[1], kind * angles[2], kind * angles[3]
    theta_plus[i], theta_minus[i] = kind * cranks[0], kind * cranks[1]
    theta_lock[i], theta_lock_outer[i] = stops
    transmission_angle[i] = pressed
    thd[i], rate_max[i], rate_min[i] = rates
    if not doubt <= rtol[i] and code < FIRST_REFUSAL:
        status[i] = _INACCURATE_CODE


@entry_of_cells
def in_samples(
    b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
    transmission_angle, thd, rate_max, rate_min, status,
):  # fmt: skip
    """Samples of a turn, followed up; one cell at a time, since every search goes its own way."""
    n = _sampled_motion.SAMPLES
    columns = (
        b, d, f, e, type, rtol, np.empty(n), np.empty(n), np.empty(n),
        A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer, transmission_angle,
        thd, rate_max, rate_min, status,
    )  # fmt: skip
    one_by_one(_in_samples, columns)


def sampled(
    b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
    transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
):  # fmt: skip
    """The verdict of `stable`, and all its values anew from samples of a turn."""
    stable(
        b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
        transmission_angle, thd, rate_max, rate_min, A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e, status,
    )  # fmt: skip
    in_samples(
        b, d, f, e, type, rtol, A0, A1, eta_plus, eta_minus, theta_plus, theta_minus, theta_lock, theta_lock_outer,
        transmission_angle, thd, rate_max, rate_min, status,
    )  # fmt: skip
    for slope in (A0_b, A0_d, A0_f, A0_e, A1_b, A1_d, A1_f, A1_e):
        slope.fill(math.nan)


@jit
def allowed(b, d, f, e, type):
    """Whether the parameters are numbers within their limits; NaN fails."""
    positive = (b > 0.0) & (d > 0.0) & (f > 0.0) & (e >= 0.0)
    finite = (b < math.inf) & (d < math.inf) & (f < math.inf) & (e < math.inf)
    a_or_b = ((type >= 0.0) & (type <= 0.0)) | ((type >= 1.0) & (type <= 1.0))
    return positive & finite & a_or_b


@jit
def _check(i, b, d, f, e, type, status):
    status[i] = where(allowed(b[i], d[i], f[i], e[i], type[i]), OK, BAD_INPUT)


@entry()
def check(b, d, f, e, type, status):
    """BAD_INPUT: NaN, infinite, a length that is not positive (the crank's may be 0), or a type that is none."""
    each_cell(_check, (b, d, f, e, type, status))


PARAMETERS = (
    Field("b", "m", "distance of the motor's shaft from the arm's pivot", lower=0.0, open_lower=True),
    Field("d", "m", "arm, from its pivot to the coupler", lower=0.0, open_lower=True),
    Field("f", "m", "coupler, from the arm to the crank", lower=0.0, open_lower=True),
    Field("e", "m", "crank, the eccentricity of the motor's pin", lower=0.0),
    Field(
        "type", "1", "straight upper link (A) or one bent by 90 degrees (B): the side of the arm",
        default=0.0, lower=0.0, upper=1.0, choices={"A": 0, "B": 1},
    ),
)  # fmt: skip

EXAMPLE = {"b": 0.6201, "d": 0.38, "f": 0.405, "e": 0.15, "type": 0.0}

OUTPUTS = (
    Field("A0", "rad", "middle between the arm's extremes, from b; negative for type B"),
    Field("A1", "rad", "half amplitude of the arm"),
    Field("eta_plus", "rad", "angle of the arm where crank and coupler are stretched; negative for type B"),
    Field("eta_minus", "rad", "angle of the arm where crank and coupler are folded; negative for type B"),
    Field("theta_plus", "rad", "crank angle from b at eta_plus"),
    Field("theta_minus", "rad", "crank angle from b at eta_minus"),
    Field("theta_lock", "rad", "crank angle from b, to either side, where it locks: the one nearest to 0", gaps=True),
    Field("theta_lock_outer", "rad", "the other one, of a crank that locks at both ends of its way", gaps=True),
    Field("transmission_angle", "rad", "least angle between coupler and arm over the turn"),
    Field("thd", "1", "root of the sum of squares of the harmonics from the second on, over the first"),
    Field("rate_max", "1", "largest angular rate of the arm per rate of the crank"),
    Field("rate_min", "1", "least, that is fastest backward, rate of the arm per rate of the crank"),
    Field("A0_b", "rad/m", "derivative of A0 by b"),
    Field("A0_d", "rad/m", "derivative of A0 by d"),
    Field("A0_f", "rad/m", "derivative of A0 by f"),
    Field("A0_e", "rad/m", "derivative of A0 by e"),
    Field("A1_b", "rad/m", "derivative of A1 by b"),
    Field("A1_d", "rad/m", "derivative of A1 by d"),
    Field("A1_f", "rad/m", "derivative of A1 by f"),
    Field("A1_e", "rad/m", "derivative of A1 by e"),
)

_RATES = ("thd", "rate_max", "rate_min")
_SLOPES = ("A0_b", "A0_d", "A0_f", "A0_e", "A1_b", "A1_d", "A1_f", "A1_e")

POLISHER = Kernel(
    name="polisher",
    doc="how far a polishing machine's crank swings its arm, and how well",
    source="Cordero-Davila et al., Opticheskii Zhurnal 78(3):55 (2011), (37)-(40); stable forms and verdict are ours",
    parameters=PARAMETERS,
    outputs=OUTPUTS,
    check=check,
    methods=(
        Method("stable", "half-angle forms of sums without error", stable, stable_bound, lacks=_RATES),
        Method(
            "textbook",
            "the paper's arccos, which loses digits next to dead points",
            textbook,
            textbook_bound,
            lacks=_RATES,
        ),
        Method("waveform", "stable, and integrals and extremes of the rate over a turn", waveform),
        Method("sampled", "2048 samples of the motion over a turn, followed up", sampled, lacks=_SLOPES),
    ),
    example=EXAMPLE,
)
