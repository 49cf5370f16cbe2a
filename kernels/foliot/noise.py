"""Verge and foliot: the rate of a clock whose torque differs from half swing to half swing.

The torque of half swing i = 0 ... N - 1, per moment of inertia, is
    mu_i = max(mu (1 + sigma x_i), floor),  x_0 = z_0,  x_i = r x_(i-1) + sqrt(1 - r^2) z_i,  r = exp(-1/tau_c)  (1)
with z standard normal and white, so x is stationary with variance 1. Each half swing lasts T_i by the exact pieces of
`_linear_swing`; the first begins on the cycle without noise, where it would last T. The clock shows T for each, so
    its gain at the n-th switch is D_n = sum of T - T_i over i < n, at the true time t_n = sum of T_i,             (2)
and between switches D runs straight from D_n to D_(n+1). Over all, it gains 86 400 D_N/t_N seconds a day. With
y_j = (D(j tau) - D(j tau - tau))/tau for j = 1 ... M, M whole averaging times tau, it scatters by 86 400 times
    the Allan deviation, sqrt(sum of (y_(j+1) - y_j)^2/(2 (M - 1))),  M >= 2.                                (3)
floor = h + (mu - h)/100, where h is the least torque with which a swing from rest at the switch comes to the next
switch and is not held by stiction: R_s without a hairspring. So noise never stops the clock.
To first order long times see white noise as y = s sigma sqrt(T/tau) (s the sensitivity, `foliot`), and correlated
noise as that times sqrt((1 + r)/(1 - r)); to second order noise of the torque slows the clock by a share of sigma^2.
The noise hangs on seed and i alone: cells of equal seed have the same noise, whatever else they have.
Derived here; the model without noise is that of Hoyng & Nieuwenhuizen, arXiv:1604.06681.
"""

import math

import numpy as np

from kernels.foliot import _error_propagation, _linear_swing, _units
from kernels.foliot.cycle import PARAMETERS as FOLIOT_PARAMETERS
from kernels.foliot.cycle import refusal
from kernels.integrate import linear_flow
from kernels.interface import FIRST_REFUSAL, Field, Kernel, Method
from kernels.lanes.codes import BAD_INPUT, INACCURATE, NOT_SELF_STARTING, OK, OUT_OF_RANGE, STICKS, TOO_SHORT
from kernels.lanes.columns import each_cell, entry
from kernels.lanes.groups import GROUP, cells_at, each_group
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import choose, fma, isnt, magnitude, nearest, some, sqrt, where
from kernels.maths import philox
from kernels.maths.elementary import exp, expm1, is_normal, mantissa_exponent, scale

HALF_SWING_LIMIT = 1e9
SECONDS_PER_DAY = 86400.0
HEADROOM = 0.01
"""How far the floor is above the least torque, as a share of what the drive is above it."""
PAIRS = 64
"""Pairs of random numbers that are made at a time."""

_COUNTABLE = 2.0**50


@jit_call
def _least_torque(scene):
    """h of (3)'s floor, over mu: the force f from rest at the switch must reach over the way 2, which grows with f."""
    d, rho, rho_s, _, _, kappa, e, _ = scene
    swings = 2.0 / linear_flow.reach(0.5 * d, kappa, 0.0 * d, 0.0 * d + 1.0) + rho - kappa
    frees = where(e >= 0.0, rho_s, rho) - kappa
    least = where(swings > frees, swings, frees)
    return where(least > 0.0, least, 0.0)


@jit_call
def _correlation(tau_c):
    """r and sqrt(1 - r^2) of (1); white where tau_c = 0."""
    white = isnt(tau_c > 0.0)
    tau_c = where(white, 1.0, tau_c)
    return where(white, 0.0, exp(-1.0 / tau_c)), where(white, 1.0, sqrt(-expm1(-2.0 / tau_c)))


@jit
def _whole(ratio):
    """The largest whole number that is not above a ratio >= 0."""
    near = nearest(ratio)
    return where(near > ratio, near - 1.0, near)


@jit_call
def _averages(marks, before, gain, time, nominal, tau):
    """Closes the averaging times that end within a half swing that began at (t, D) = (before, gain) and lasted `time`.

    `marks` are how many are closed, D at the end of the last, its y, and the sum of squares in (3). Those that lie
    wholly within the half swing share one y.
    """
    closed, reading, rate, squares = marks
    slope = (nominal - time) / time
    until = _whole((before + time) / tau)
    at_first = fma(slope, (closed + 1.0) * tau - before, gain)
    first = (at_first - reading) / tau
    squares = where(closed > 0.0, fma(first - rate, first - rate, squares), squares)
    more = until > closed + 1.0
    squares = where(more, fma(slope - first, slope - first, squares), squares)
    return until, fma(slope, until * tau - before, gain), where(more, slope, first), squares


@jit_call
def _beat(state, z, clock):
    """One half swing with the torque of (1). A *run* is (x, speed, t, D, half swings cut, *marks)."""
    scene, (sigma, remembered, fresh, floor), nominal, tau = clock
    x, before, t, gain, truncated, closed, reading, rate, squares = state
    x = where(t > 0.0, fma(remembered, x, fresh * z), z)
    torque = fma(sigma, x, 1.0)
    short = isnt(torque > floor)
    torque = where(short, floor, torque)
    start = scene[6] * before
    time, top, speed, comes, _ = _linear_swing.half_swing(torque, scene, start)
    goes_on = comes & ((start < 0.0) | (fma(scene[5], top, torque) > scene[2]))
    marks = (closed, reading, rate, squares)
    later = t + time
    passes = later >= (closed + 1.0) * tau
    if some(passes):
        marks = choose(passes, _averages(marks, t, gain, time, nominal, tau), marks)
    run = (x, speed, later, gain + (nominal - time), where(short, truncated + 1.0, truncated))
    return (*run, *marks), goes_on


@jit
def _longest(first, half_swings):
    most = 0.0
    for cell in range(GROUP):
        most = max(most, half_swings[first + cell])
    return min(most, HALF_SWING_LIMIT)


@jit_call
def _run(first, seed, half_swings, clock, speed, active, radii, turns):
    """All half swings of the active cells of a group, and those of them that did not come to a switch."""
    count = half_swings[cells_at(first)]
    zero = 0.0 * speed
    state = (zero, speed, zero, zero, zero, zero, zero, zero, zero)
    stopped = count < 0.0
    for chunk in range(int(_longest(first, half_swings)) // (2 * PAIRS) + 1):
        philox.fill(first, seed, chunk * PAIRS, PAIRS, radii, turns)
        for j in range(PAIRS):
            row = cells_at(j * GROUP)
            z_0, z_1 = philox.gaussians(radii[row], turns[row])
            for second in range(2):
                active = active & (2.0 * (chunk * PAIRS + j) + second < count)
                if not some(active):
                    break
                new, goes_on = _beat(state, where(second > 0, z_1, z_0), clock)
                stopped = stopped | (active & isnt(goes_on))
                active = active & goes_on
                state = choose(active, new, state)
    return state, stopped


@jit_call
def _uncertainty(scene, nominal, speed):
    """Error of the rate as a fraction: of each half swing, and of all that they pass on."""
    start = scene[6] * speed
    time, top, after, _, legs = _linear_swing.half_swing(1.0, scene, start)
    swing = (time, top, after, 1.0, legs)
    kept, longer = _error_propagation.slopes(scene, start, swing)
    energy, late = _error_propagation.own_noise(scene, start, swing)
    remembered = energy / (speed * speed * (1.0 - scene[6] * scene[6] * kept))
    return (late + magnitude(longer * start) * remembered) / nominal


@jit
def _cells(
    first, mu, phi0, a, R, R_s, c, n, k, e, sigma, tau_c, half_swings, seed, averaging_time, rtol,
    rate_error_s_per_day, rate_scatter_s_per_day, truncated, status, radii, turns,
):  # fmt: skip
    i = cells_at(first)
    scene, units = _units.without_dimensions(mu[i], phi0[i], a[i], R[i], R_s[i], 0.0 * c[i], 1.0, k[i], e[i])
    (nominal, _, speed, _, _), _, found = _linear_swing.limit_cycle(scene)
    m_tau, e_tau = mantissa_exponent(averaging_time[i])
    tau = scale(m_tau / units[0], e_tau - units[1])
    least = _least_torque(scene)
    floor = fma(HEADROOM, 1.0 - least, least)
    runs = units[4] & (found < FIRST_REFUSAL) & (least < 1.0)
    clock = (scene, (sigma[i], *_correlation(tau_c[i]), floor), nominal, tau)
    state, stopped = _run(first, seed, half_swings, clock, speed, runs, radii, turns)
    _, _, t, gain, short, closed, _, _, squares = state
    t = where(runs, t, 1.0)
    enough = closed > 1.0
    deviation = sqrt(squares / (2.0 * where(enough, closed - 1.0, 1.0)))
    rate_error_s_per_day[i] = SECONDS_PER_DAY * gain / t
    rate_scatter_s_per_day[i] = where(enough, SECONDS_PER_DAY * deviation, math.nan)
    truncated[i] = short / half_swings[i]
    starts = magnitude(found - NOT_SELF_STARTING) > 0.0
    verdict = where(enough, where(starts, OK, found), TOO_SHORT)
    verdict = where(_uncertainty(scene, nominal, speed) <= rtol[i], verdict, INACCURATE)
    verdict = where(stopped | isnt(least < 1.0), STICKS, verdict)
    verdict = where(found < FIRST_REFUSAL, verdict, found)
    fine = units[4] & is_normal(tau) & (t < _COUNTABLE * tau)
    status[i] = where(fine | (verdict >= FIRST_REFUSAL), verdict, OUT_OF_RANGE)


@entry()
def segments(
    mu, phi0, a, R, R_s, c, n, k, e, sigma, tau_c, half_swings, seed, averaging_time, rtol,
    rate_error_s_per_day, rate_scatter_s_per_day, truncated, status,
):  # fmt: skip
    """Every half swing from exact pieces. `rtol` is meant of rates as fractions: 1e-9 of a day is 8.6e-5 s."""
    radii, turns = np.empty(PAIRS * GROUP), np.empty(PAIRS * GROUP)
    each_group(
        _cells,
        (
            mu, phi0, a, R, R_s, c, n, k, e, sigma, tau_c, half_swings, seed, averaging_time, rtol,
            rate_error_s_per_day, rate_scatter_s_per_day, truncated, status, radii, turns,
        ),
    )  # fmt: skip


@jit
def _counts(x, low, high):
    """Whether x is a whole number within limits below 2^51."""
    inside = (x >= low) & (x <= high)
    whole = where(inside, x, 0.5)
    return inside & isnt(magnitude(whole - nearest(whole)) > 0.0)


@jit
def _check(
    i, mu, phi0, a, R, R_s, c, n, k, e, sigma, tau_c, half_swings, seed, averaging_time, status
):  # fmt: skip
    noise = (sigma[i] >= 0.0) & (sigma[i] < math.inf) & (tau_c[i] >= 0.0) & (tau_c[i] < math.inf)  # NaN fails
    run = _counts(half_swings[i], 1.0, HALF_SWING_LIMIT) & _counts(seed[i], 0.0, philox.SEED_LIMIT)
    time = (averaging_time[i] > 0.0) & (averaging_time[i] < math.inf)
    verdict = refusal(mu[i], phi0[i], a[i], R[i], R_s[i], c[i], n[i], k[i], e[i])
    status[i] = where(noise & run & time, verdict, BAD_INPUT)


@entry()
def check(mu, phi0, a, R, R_s, c, n, k, e, sigma, tau_c, half_swings, seed, averaging_time, status):
    """As for `foliot`; BAD_INPUT, too, for a count or a seed that is no whole number within its limits."""
    each_cell(
        _check, (mu, phi0, a, R, R_s, c, n, k, e, sigma, tau_c, half_swings, seed, averaging_time, status)
    )  # fmt: skip


NOISE = (
    Field("sigma", "1", "standard deviation of the torque of a half swing over mu", lower=0.0),
    Field("tau_c", "1", "half swings over which the noise forgets all but 1/e; 0: white", default=0.0, lower=0.0),
    Field("half_swings", "1", "length of the run", lower=1.0, upper=HALF_SWING_LIMIT, integer=True),
    Field("seed", "1", "names the noise; cells of equal seed share it", default=0.0, lower=0.0,
          upper=philox.SEED_LIMIT, integer=True),
    Field("averaging_time", "s", "averaging time of the scatter", default=SECONDS_PER_DAY, lower=0.0, open_lower=True),
)  # fmt: skip

FOLIOT_NOISE = Kernel(
    name="foliot_noise",
    doc="rate of a verge and foliot whose torque is noisy",
    source="derived here; the foliot of Hoyng & Nieuwenhuizen, arXiv:1604.06681",
    parameters=(*FOLIOT_PARAMETERS, *NOISE),
    outputs=(
        Field("rate_error_s_per_day", "s/day", "gain against the clock without noise; losses are negative"),
        Field("rate_scatter_s_per_day", "s/day", "Allan deviation of the rate at the averaging time"),
        Field("truncated", "1", "share of half swings whose torque was raised to the floor"),
    ),
    check=check,
    methods=(Method("segments", "every half swing from exact pieces of linear terms", segments, excludes=("c",)),),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0, "sigma": 0.01, "half_swings": 1000.0, "averaging_time": 600.0},
)
