"""Crown wheel and foliot with friction and restitution in SI units, integrated by scipy from event to event.

From rest on, half period after half period, in the laboratory's own variables: nothing is scaled out, and the tooth
that is met is found by its place on the wheel. Bounces below `DEAD` of the first closing speed end in contact.
"""

import numpy as np
from scipy.integrate import solve_ivp

DEAD = 1e-6
HOW = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}


def _leg(rates, state, events):
    """State, time and number of the event that ends a leg; each is a function of the state."""
    made = []
    for event in events:
        made.append(lambda t, s, event=event: event(s))
        made[-1].terminal, made[-1].direction = True, -1.0
    run = solve_ivp(rates, (0.0, 1e3), state, events=made, first_step=1e-9, max_step=0.5, **HOW)
    which = next(i for i, t in enumerate(run.t_events) if t.size)
    return run.y[:, -1], run.t[-1], which


def half_period(p, state):
    """From (speed, wheel's speed) at an escape to the next: these, the time, largest angle, recoil, impact energy, way.

    The foliot's angle counts along the push of the pallet that is met. None where the wheel is half a pitch back.
    """
    n, I_v, I_c, phi0 = p["n"], p["I_v"], p["I_c"], p["phi0"]
    both = I_v + n**2 * I_c

    def rub(v):
        return p["c_v"] * v + p["R_v"] * np.sign(v)

    def flight(t, s):
        return [s[1], -rub(s[1] if side else 0.0) / I_v, s[3], p["tau"] / I_c]

    def contact(t, s):
        a = (n * p["tau"] - rub(s[1])) / both
        return [s[1], a, n * s[1], n * a]

    speed, spin = state
    s = np.array([-phi0, -speed, -n * phi0 - p["drop"], spin])
    total, swing, lost, landed, first, lowest, way = 0.0, phi0, 0.0, None, 0.0, np.inf, 0.0

    def gap(s):
        return n * s[0] - s[2]

    while True:
        side, before = np.sign(s[1]), s[0]
        events = [gap, lambda s: phi0 - s[0]]
        if side:
            events.append(lambda s, side=side: side * s[1])
        if s[3] < 0.0:
            events.append(lambda s: -s[3])
        s, t, which = _leg(flight, s, events)
        total, way, swing = total + t, way + abs(s[0] - before), max(swing, abs(s[0]))
        lowest = min(lowest, s[2]) if landed is not None else lowest
        if landed is not None and landed - lowest > 2 * n * phi0 + p["drop"]:
            return None
        if which == 1:
            return (s[1], s[3]), total, swing, landed - min(lowest, landed), lost, way
        if which > 1:
            s[1 if side and which == 2 else 3] = 0.0
            continue
        landed = s[2] if landed is None else landed
        lowest = min(lowest, s[2])
        closing = s[3] - n * s[1]
        first = first or closing
        e = p["e"] if p["e"] * closing > DEAD * first else 0.0
        together = (I_v * s[1] + n * I_c * s[3]) / both
        lost += 0.5 * I_v * I_c / both * (1 - e**2) * closing**2
        s[1], s[3] = together + n * I_c * e * closing / both, n * together - I_v * e * closing / both
        if e == 0.0:
            break
        s[2] = n * s[0] - 1e-15 * n * phi0
    if s[1] < 0.0:
        before = s[0]
        s, t, _ = _leg(contact, s, [lambda s: -s[1]])
        total, way, s[1], s[3] = total + t, way + before - s[0], 0.0, 0.0
        swing, lowest = max(swing, -s[0]), min(lowest, n * s[0])
    before = s[0]
    s, t, _ = _leg(contact, s, [lambda s: phi0 - s[0]])
    if landed - lowest > 2 * n * phi0 + p["drop"]:
        return None
    return (s[1], s[3]), total + t, swing, landed - lowest, lost, way + s[0] - before


def cycle(p, half_periods):
    """After so many half periods from rest: period, amplitude, speed, recoil, shares of impacts and dry friction."""
    state = (0.0, 0.0)
    for _ in range(half_periods):
        found = half_period(p, state)
        if found is None:
            return None
        state = found[0]
    _, time, swing, recoil, lost, way = found
    work = p["tau"] * (2 * p["n"] * p["phi0"] + p["drop"])
    return 2 * time, swing, state[0], recoil, lost / work, p["R_v"] * way / work
