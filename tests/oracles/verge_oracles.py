"""A verge in the laboratory's frame, by closed pieces and plain arithmetic, both pallets watched at all times.

The wheel is at x, its tooth m at x - m half pitches; even teeth push the foliot to phi0, odd ones to -phi0. A pallet is
in front of a tooth until the foliot swings beyond phi0 on its side. Which tooth it is in front of when it comes back is
looked up by places, so a tooth that has escaped is met again where the wheel was thrown behind that pallet. Landings
below `DEAD` of the fastest are contact: bounces would be as small as roundings.
"""

import math

import numpy as np

DEAD = 1e-6
STEP = 0.02
"""Most time to the next event, in units of the drive."""
MOST = 4_000
"""Steps of a tooth, on average."""


def _first(f, low, high):
    """Where f stops being positive, by bisection."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if f(middle) > 0 else (low, middle)
    return high


class Verge:
    """From rest with the wheel at its drop.

    `passed` has of each tooth's last escape: time, lost energy, the foliot's way, largest angle and speed, recoil.
    """

    def __init__(self, parameters):
        self.p = p = {name: float(x) for name, x in parameters.items()}
        self.half, self.short = 2 * p["n"] * p["phi0"] + p["drop"], STEP * math.sqrt(p["I_v"] * p["phi0"] / p["n"])
        self.short /= math.sqrt(p["tau"])
        self.x, self.y, self.w, self.v, self.t = -p["n"] * p["phi0"] - p["drop"], -p["phi0"], 0.0, 0.0, 0.0
        self.tooth, self.turned, self.pushed, self.bounced = {1: 0, -1: None}, 0, 0, 0
        self.lost, self.way, self.top, self.fastest, self.passed, self.met = 0.0, 0.0, 0.0, 0.0, {}, {}
        self.landed, self.lowest = None, 0.0

    def ahead(self, side, x, y):
        """How far a pallet is in front of its tooth, on the wheel."""
        return side * self.p["n"] * y - (x - self.tooth[side] * self.half)

    def _braked(self, v, t, push, inertia, sign):
        c, force = self.p["c_v"] / inertia, (push - sign * self.p["R_v"]) / inertia
        if c * t < 1e-9:
            return v + (force - c * v) * t, v * t + 0.5 * (force - c * v) * t * t
        left = -math.expm1(-c * t)
        return v + (force / c - v) * left, force / c * t + (v - force / c) * left / c

    def moved(self, t):
        """x, y, w, v after t, in flight or pushed, if the foliot does not stop on the way."""
        p, side = self.p, self.pushed
        if side:
            both, sign = p["I_v"] + p["n"] ** 2 * p["I_c"], math.copysign(1.0, side * self.v) if self.v else 1.0
            v, way = self._braked(side * self.v, t, p["n"] * p["tau"], both, sign)
            return self.x + p["n"] * way, self.y + side * way, p["n"] * v, side * v
        v, way = self._braked(self.v, t, 0.0, p["I_v"], math.copysign(1.0, self.v)) if self.v else (0.0, 0.0)
        pull = p["tau"] / p["I_c"]
        return self.x + (self.w + 0.5 * pull * t) * t, self.y + way, self.w + pull * t, v

    def stop(self):
        """Time until the foliot stops."""
        p, push, inertia = self.p, 0.0, self.p["I_v"]
        if self.pushed:
            push = math.copysign(p["n"] * p["tau"], self.pushed * self.v)
            inertia += p["n"] ** 2 * p["I_c"]
        against, c = p["R_v"] - push, p["c_v"]
        if not self.v or against <= 0.0:
            return math.inf
        return inertia * (math.log1p(c * abs(self.v) / against) / c if c else abs(self.v) / against)

    def step(self):
        """To the next event, or by a small time."""
        p, stop, event = self.p, self.stop(), None
        dt = min(self.short, stop)
        for side in (1, -1):

            def inside(t, side=side):
                return p["phi0"] - side * self.moved(t)[1]

            def gap(t, side=side):
                return self.ahead(side, *self.moved(t)[:2])

            if inside(0.0) > 0 >= inside(dt):
                dt, event = _first(inside, 0.0, dt), (self.escape, side)
            elif inside(0.0) <= 0 < inside(dt):
                dt, event = (
                    _first(lambda t: -math.copysign(1.0, inside(t)) if inside(t) else 1.0, 0.0, dt),
                    (self.back, side),
                )
            if self.pushed or self.tooth[side] is None:
                continue
            begin = 0.0
            if self.bounced == side:  # a root is beyond the top of the bounce
                begin = _first(lambda t, side=side: side * p["n"] * self.moved(t)[3] - self.moved(t)[2], 0.0, dt)
            if gap(begin) > 0 >= gap(dt):
                dt, event = _first(gap, begin, dt), (self.landing, side)
        if not self.pushed and self.w < 0.0 < self.w + p["tau"] / p["I_c"] * dt:  # the wheel turns on the way
            self.lowest = min(self.lowest, self.x - 0.5 * self.w**2 * p["I_c"] / p["tau"])
        before = self.y
        self.x, self.y, self.w, self.v = self.moved(dt)
        self.lowest, self.way = min(self.lowest, self.x), self.way + abs(self.y - before)
        self.t, self.top, self.bounced = self.t + dt, max(self.top, abs(self.y)), 0
        if event:
            event[0](event[1])
        elif dt == stop:
            self.v, self.w = 0.0, 0.0 if self.pushed else self.w

    def escape(self, side):
        """The pallet lets its tooth pass; teeth are counted from the one that is met next."""
        m = self.tooth[side] + self.turned
        self.top = max(self.top, self.passed.get(m, (0.0,) * 4)[3])
        recoil = 0.0 if self.landed is None else self.landed - self.lowest
        self.passed[m] = self.t, self.lost, self.way, self.top, side * self.v, recoil
        self.met[m], self.landed = self.met.get(m, 0) + 1, None
        self.top, self.y, self.tooth[side] = 0.0, side * self.p["phi0"] * (1 + 1e-15), None
        self.pushed = 0 if self.pushed == side else self.pushed
        turn = self.tooth[-side] // 2 * 2
        self.x, self.turned, self.tooth[-side] = self.x - turn * self.half, self.turned + turn, self.tooth[-side] - turn

    def back(self, side):
        """The pallet comes in front of a tooth, the first of its teeth that is behind it."""
        m = math.ceil((self.x - side * self.p["n"] * self.y) / self.half - 1e-12)
        self.tooth[side] = m + (m + (side < 0)) % 2

    def landing(self, side):
        """An impact, or contact."""
        p, both = self.p, self.p["I_v"] + self.p["n"] ** 2 * self.p["I_c"]
        closing, v = self.w - side * p["n"] * self.v, side * self.v
        self.fastest = max(self.fastest, closing)
        e = p["e"] if p["e"] * closing > DEAD * self.fastest else 0.0
        together = (p["I_v"] * v + p["n"] * p["I_c"] * self.w) / both
        assert e or together >= 0 or p["n"] * p["I_c"] * (p["R_v"] - p["c_v"] * together) < p["tau"] * p["I_v"]
        self.lost += 0.5 * p["I_v"] * p["I_c"] / both * (1 - e * e) * closing**2
        self.v = side * (together + p["n"] * p["I_c"] * e * closing / both)
        self.w = p["n"] * together - p["I_v"] * e * closing / both
        self.x = side * p["n"] * self.y + self.tooth[side] * self.half
        if self.landed is None:
            self.landed = self.lowest = self.x
        self.pushed, self.bounced = (0, side) if e else (side, 0)


def followed(p, teeth):
    """What comes of so many teeth from rest on, a list each: time, lost energy, way, angle, speed and recoil of each
    tooth; and how often it was met."""
    clock = Verge(p)
    for _ in range(MOST * teeth):
        clock.step()
        if len(clock.passed) > teeth:
            break
    else:
        raise ArithmeticError("the clock stands still, or is thrown out of mesh")
    last = max(clock.passed)  # it may be met again
    return np.array([clock.passed[m] for m in range(min(clock.passed), last)]).T, clock.met[last - 1]


def cycle(p, teeth):
    """Of the last of so many teeth: period, amplitude, speed, recoil, shares of impacts and of dry friction; the period
    before; how often its tooth was met; what share of the period one half lasted."""
    (t, lost, way, top, speed, recoil), met = followed(p, teeth)
    work, period = p["tau"] * (2 * p["n"] * p["phi0"] + p["drop"]), t[-1] - t[-3]
    shares = (lost[-1] - lost[-3]) / work / 2, p["R_v"] * (way[-1] - way[-3]) / work / 2
    return period, top[-2:].max(), speed[-1], recoil[-1], *shares, t[-3] - t[-5], met, (t[-1] - t[-2]) / period
