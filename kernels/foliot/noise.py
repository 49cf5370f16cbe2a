"""Verge and foliot: the rate of a clock whose torque differs from half swing to half swing.

The torque of half swing i = 0 ... N - 1, per moment of inertia, is
    mu_i = max(mu (1 + sigma x_i), floor),  x_0 = z_0,  x_i = r x_(i-1) + sqrt(1 - r^2) z_i,  r = exp(-1/tau_c)  (1)
with z standard normal and white, so that x is stationary with variance 1. The viscous friction may be noisy as well,
a max(1 + sigma_a w_i, 0.01), w = shared x + sqrt(1 - shared^2) x', with x' an independent sequence like x: torque and
friction have the same noise for shared = 1, and independent noise for 0. Half swing i has the duration T_i, from the
exact pieces of `_linear_swing`; the first begins on the cycle without noise, whose half swings last T. The clock
counts T for each half swing, so
    its gain at the n-th switch is D_n = sum of T - T_i over i < n, at the true time t_n = sum of T_i,             (2)
and D is linear in time between switches. The mean gain is 86 400 D_N/t_N seconds per day. With
y_j = (D(j tau) - D(j tau - tau))/tau for j = 1 ... M, for M complete averaging times tau, the scatter is 86 400 times
    the Allan deviation, sqrt(sum of (y_(j+1) - y_j)^2/(2 (M - 1))),  M >= 2.                                (3)
floor = h + (mu - h)/100, where h is the least torque at which a swing from rest at the switch reaches the next
switch and is not held by stiction: R_s without a hairspring. So noise of the torque never stops the clock.
To first order and for long times, white noise gives y = s sigma sqrt(T/tau) (s the sensitivity, `foliot`), and
correlated noise that times sqrt((1 + r)/(1 - r)); with noise of the friction, s sigma becomes the root of (s sigma)^2 +
((2 s - 1) sigma_a)^2 - 2 shared s sigma (2 s - 1) sigma_a. To second order, noise of the torque slows the clock in
proportion to sigma^2.
The noise depends on seed and i only: cells with equal seed have the same noise.
Derived here; the model without noise is that of Hoyng & Nieuwenhuizen, arXiv:1604.06681.
"""

import math
from collections import namedtuple

import numpy as np

from kernels.foliot import _linear_swing, _units
from kernels.foliot._units import LinearFoliot, Scene
from kernels.foliot.cycle import FOLIOT, check
from kernels.integrate import linear_flow
from kernels.interface import FIRST_REFUSAL, Field
from kernels.lanes.codes import INACCURATE, NOT_SELF_STARTING, OK, OUT_OF_RANGE, STICKS, TOO_SHORT
from kernels.lanes.columns import GROUP, cells_at
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.records import read
from kernels.lanes.vectors import any_lane, choose, fma, magnitude, nearest, not_, sqrt, where
from kernels.lanes.wiring import kernel, tracing
from kernels.maths import philox
from kernels.maths.elementary import exp, expm1, is_normal, larger
from kernels.maths.wide import number, over, wide

HALF_SWING_LIMIT = 1e9
SECONDS_PER_DAY = 86400.0
HEADROOM = 0.01
"""How far the floor is above the least torque, as a share of what the drive is above it."""
LEAST_FRICTION = 0.01
"""The least viscous friction of a half swing, over a."""
PAIRS = 64
"""Pairs of random numbers that are made at a time."""

_COUNTABLE, _ROUNDING = 2.0**50, 2.0**-51
_WILDEST = 1e100
"""Noise beyond which squares of speeds leave float64."""

Clock = namedtuple("Clock", "scene sigma sigma_a remembered fresh least grip nominal tau shared own")
"""What a half swing needs: (1) in units of mu, the floor less 1, 1 - rho_s, T and the averaging time in those of the
scene."""

Run = namedtuple("Run", "x apart speed gain truncated closed since lead rate squares")
"""x, x', the speed and D of (2) after a half swing, and how many had their torque raised to the floor; how many
averaging times are closed, the time since, the change of D since, y of the last, and the sum of squares in (3)."""


@jit_call
def _beat(run, z, z_apart, clock):
    """One half swing with the torque of (1), and whether it comes to the switch."""
    begun = run.closed + run.since > 0.0
    x = where(begun, fma(clock.remembered, run.x, clock.fresh * z), z)
    apart = where(begun, fma(clock.remembered, run.apart, clock.fresh * z_apart), z_apart)
    more = clock.sigma * x  # torque less mu, of which friction may leave little
    short = not_(more > clock.least)
    more = where(short, clock.least, more)
    friction = larger(fma(clock.sigma_a, fma(clock.shared, x, clock.own * apart), 1.0), LEAST_FRICTION + 0.0 * x)
    d, rho, rho_s, gamma, n, kappa, e, slack = clock.scene
    scene = Scene(d * friction, rho, rho_s, gamma, n, kappa, e, slack)
    start = scene.e * run.speed
    legs = _linear_swing.half_swing(more, scene, start)
    goes_on = legs.comes & ((start < 0.0) | (fma(scene.kappa, legs.top, more) > -clock.grip))
    closed, since, rate, squares, tau = run.closed, run.since + legs.time, run.rate, run.squares, clock.tau
    gained = clock.nominal - legs.time
    lead, passes = run.lead + gained, since >= tau
    if any_lane(passes):  # averaging times end within the half swing; those that lie wholly within it share one y
        slope, ratio = gained / legs.time, since / tau
        ended = nearest(ratio)
        ended = where(ended > ratio, ended - 1.0, ended)
        first = fma(slope, tau - run.since, run.lead) / tau
        total = where(closed > 0.0, fma(first - rate, first - rate, squares), squares)
        more = ended > 1.0
        total = where(more, fma(slope - first, slope - first, total), total)
        rest = fma(-ended, tau, since)
        behind = closed + ended, rest, slope * rest, where(more, slope, first), total
        closed, since, lead, rate, squares = choose(passes, behind, (closed, since, lead, rate, squares))
    truncated = where(short, run.truncated + 1.0, run.truncated)
    return Run(x, apart, legs.speed, run.gain + gained, truncated, closed, since, lead, rate, squares), goes_on


@jit_call
def _run(first, seed, half_swings, clock, speed, active, radii, turns, radii_apart, turns_apart):
    """All half swings of the active cells of a group, and those of them that did not come to a switch."""
    count, zero = half_swings[cells_at(first)], 0.0 * speed
    run = Run(zero, zero, speed, zero, zero, zero, zero, zero, zero, zero)
    two_noises, stopped, most = any_lane(clock.own > 0.0), count < 0.0, 0.0
    for cell in range(GROUP):
        most = max(most, half_swings[first + cell])
    for chunk in range(int(min(most, HALF_SWING_LIMIT)) // (2 * PAIRS) + 1):
        philox.fill(first, seed, chunk * PAIRS, PAIRS, 0, radii, turns)
        if two_noises:
            philox.fill(first, seed, chunk * PAIRS, PAIRS, 1, radii_apart, turns_apart)
        for j in range(PAIRS):
            row = cells_at(j * GROUP)
            z_0, z_1 = philox.gaussians(radii[row], turns[row])
            apart_0, apart_1 = zero, zero
            if two_noises:
                apart_0, apart_1 = philox.gaussians(radii_apart[row], turns_apart[row])
            for second in range(2):
                active = active & (2.0 * (chunk * PAIRS + j) + second < count)
                if not any_lane(active):
                    break
                z, z_apart = where(second > 0, z_1, z_0), where(second > 0, apart_1, apart_0)
                new, goes_on = _beat(run, z, z_apart, clock)
                stopped = stopped | (active & not_(goes_on))
                active = active & goes_on
                run = choose(active, new, run)
    return run, stopped


@jit
def segments(first, columns, radii, turns, radii_apart, turns_apart):
    """Every half swing from exact pieces. `rtol` is meant of rates as fractions: 1e-9 of a day is 8.6e-5 s."""
    i = cells_at(first)
    scene, units = _units.without_dimensions(read(LinearFoliot, columns, i))
    cycle, _, legs, found = _linear_swing.segments(scene, columns.rtol[i])

    # the floor of (1): from rest at the switch the force must reach over the way 2, which grows with it
    d, kappa, e, slack = scene.d, scene.kappa, scene.e, scene.slack
    strain = 2.0 / linear_flow.reach(0.5 * d, kappa, 0.0 * d, 0.0 * d + 1.0) - kappa
    grip = where(magnitude(scene.rho_s - scene.rho) > 0.0, 1.0 - scene.rho_s, slack)
    spare, held = slack - strain, where(e >= 0.0, grip, slack) + kappa  # of the drive, above the least
    spare = where(spare < held, spare, held)
    spare = where(spare < 1.0, spare, 1.0)
    least = (HEADROOM - 1.0) * spare

    # r and sqrt(1 - r^2) of (1); white where tau_c = 0
    white = not_(columns.tau_c[i] > 0.0)
    tau_c = where(white, 1.0, columns.tau_c[i])
    remembered, fresh = where(white, 0.0, exp(-1.0 / tau_c)), where(white, 1.0, sqrt(-expm1(-2.0 / tau_c)))

    (averaging_time,) = wide((columns.averaging_time[i],))
    tau = number(over(averaging_time, units.time))
    sigma, sigma_a, shared = columns.sigma[i], columns.sigma_a[i], columns.shared[i]
    own = sqrt((1.0 - shared) * (1.0 + shared))
    clock = Clock(scene, sigma, sigma_a, remembered, fresh, least, grip, cycle.half_period, tau, shared, own)
    tame = units.fine & (sigma + sigma_a < _WILDEST)
    runs = tame & (found < FIRST_REFUSAL) & (spare > 0.0)
    numbers = radii, turns, radii_apart, turns_apart
    run, stopped = _run(first, columns.seed, columns.half_swings, clock, cycle.speed, runs, *numbers)
    t, enough = where(runs, fma(run.closed, tau, run.since), 1.0), run.closed > 1.0
    deviation = sqrt(run.squares / (2.0 * where(enough, run.closed - 1.0, 1.0)))
    columns.rate_error_s_per_day[i] = SECONDS_PER_DAY * run.gain / t
    columns.rate_scatter_s_per_day[i] = where(enough, SECONDS_PER_DAY * deviation, math.nan)
    columns.truncated[i] = run.truncated / columns.half_swings[i]

    # error of the rate as a fraction: of each half swing, and of all that they pass on; the force that the floor leaves
    # has two digits fewer
    start = e * cycle.speed
    kept, longer, _, energy, late = _linear_swing.passed_on(scene, start, legs.speed, legs)
    passed_on = energy / (cycle.speed * cycle.speed * (1.0 - e * e * kept))
    enough_digits = columns.rtol[i] * where(run.truncated > 0.0, HEADROOM, 1.0)
    accurate = (late + magnitude(longer * start) * passed_on) / cycle.half_period <= enough_digits
    # and of the scatter: averaging times end where time has been rounded
    accurate = accurate & (_ROUNDING * run.closed * deviation <= columns.rtol[i])

    verdict = where(enough, where(magnitude(found - NOT_SELF_STARTING) > 0.0, OK, found), TOO_SHORT)
    verdict = where(stopped | not_(spare > 0.0), STICKS, where(accurate, verdict, INACCURATE))
    verdict = where(found < FIRST_REFUSAL, verdict, found)  # of the cycle without noise
    fine = tame & is_normal(clock.tau) & (t < _COUNTABLE * clock.tau)
    columns.status[i] = where(fine | (verdict >= FIRST_REFUSAL), verdict, OUT_OF_RANGE)


@jit
def _uniforms():
    """Rows for random numbers."""
    n = PAIRS * GROUP
    return np.empty(n), np.empty(n), np.empty(n), np.empty(n)


FOLIOT_NOISE = kernel(
    "foliot_noise",
    doc="rate of a verge and foliot whose torque and friction are noisy",
    source="derived here; the foliot of Hoyng & Nieuwenhuizen, arXiv:1604.06681",
    parameters=(
        *FOLIOT.parameters,
        Field("sigma", "1", "standard deviation of a half swing's torque, relative to mu", lower=0.0),
        Field("tau_c", "1", "correlation time of the noise in half swings (to 1/e); 0: white", default=0.0, lower=0.0),
        Field("half_swings", "1", "length of the run", lower=1.0, upper=HALF_SWING_LIMIT, integer=True),
        Field("seed", "1", "seed of the noise; cells with equal seed share it", default=0.0, lower=0.0,
              upper=philox.SEED_LIMIT, integer=True),
        Field("averaging_time", "s", "averaging time of the scatter", SECONDS_PER_DAY, lower=0.0, open_lower=True),
        Field("sigma_a", "1", "standard deviation of a half swing's friction, relative to a", default=0.0, lower=0.0),
        Field("shared", "1", "correlation between the noise of friction and of torque, 0 to 1",
              default=1.0, lower=-1.0, upper=1.0),
    ),
    outputs=(
        Field("rate_error_s_per_day", "s/day", "gain against the clock without noise; losses are negative"),
        Field("rate_scatter_s_per_day", "s/day", "Allan deviation of the rate at the averaging time"),
        Field("truncated", "1", "share of half swings whose torque was raised to the floor"),
    ),
    check=check,
    methods=(
        tracing("segments", "every half swing from exact pieces of linear terms",
                segments, excludes=("c",), buffers=_uniforms),
    ),
    example={"mu": 1.0, "phi0": 1.0, "a": 1.0, "sigma": 0.01, "half_swings": 1000.0, "averaging_time": 600.0},
)  # fmt: skip
