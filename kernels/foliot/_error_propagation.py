"""What a half swing makes of an error in its start, and adds of its own; scene and half swing as in `_linear_swing`.

With E = v^2/2 a speed wrong by the share r is an energy wrong by v^2 r. A half swing passes on the share dE_1/dE_0 of
it, and adds what rounding moves in forces (over the way they act) and in speeds:
    v_1^2 r_1 = (dE_1/dE_0) v_0^2 r_0 + noise,  dT = abs(dT/dv_0) v_0 r_0 + ROUNDING (T + way/v_1).          (1)
"""

from kernels.foliot._linear_swing import ROUNDING
from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, magnitude, where
from kernels.maths.elementary import exp


@jit_call
def slopes(scene, start, swing):
    """dE_1/dE_0 and dT/dv_0 of a half swing that began with the speed `start` after the switch."""
    d, rho, _, _, _, kappa, _, _ = scene
    time, top, speed, torque, legs = swing
    _, s1, _, slope1, _, _, s2, c2, _, g2, _ = legs
    rises = start > 0.0
    back = torque + rho + kappa * top
    kept = exp(-d * time) * where(rises, g2 / back, 1.0)
    rising = slope1 / back + s1 * (1.0 - kappa * c2) / speed
    return kept, where(rises, rising, s2 / speed)


@jit
def own_noise(scene, start, swing):
    """What rounding adds to E_1 and to the time."""
    time, top, speed, _, legs = swing
    _, _, _, _, _, _, s2, _, slope2, g2, down = legs
    way = 1.0 + top
    push = magnitude(fma(g2, slope2, -down * fma(scene[0], slope2, scene[5] * s2)))  # at the switch
    energy = 0.5 * (speed * speed + start * start) + way * push
    return ROUNDING * energy, ROUNDING * (time + way / speed)
