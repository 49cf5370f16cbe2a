"""A crown wheel and a foliot that collide, followed in the plainest way; imports nothing of ours.

Lengths in tooth pitches, times in sqrt(pitch/g), wheel of mass kappa, foliot of mass 1, force kappa on the rim. All
teeth near both pallets are tried for the next contact, bounces are followed one by one until they are too small to be
told from contact. Numbers are float or mpf, whichever the arguments are.
"""

from math import ceil, floor
from typing import Any, NamedTuple

import numpy as np
from mpmath import mpf


def root(x):
    """Square root of a float or an mpf."""
    return x**0.5


FAINT = {float: 1e-13, mpf: mpf(10) ** -22}


class Passage(NamedTuple):
    """Time and motion where y passes 0 upwards; how many ends and retreats were noted, contact time,
    impacts, and how often a pallet has released the wheel."""

    time: Any
    x: Any
    V: Any
    w: Any
    ends: int
    backs: int
    touched: Any
    impacts: int
    releases: int


class Settled(NamedTuple):
    """What a clock comes to repeat; a period is the time per tooth, passages of y = 0 and half swings, from release
    to release, are those until it repeats."""

    period: Any
    travel: Any
    middle: Any
    teeth: int
    passages: int
    half_swings: int
    recoil: Any
    contact_share: Any
    impacts: Any


class Clock:
    """One clock in motion; `upper` 1 and -1 are the two pallets."""

    def __init__(self, kappa, eta, e, c=0.0, y_i=0.0):
        self.kappa, self.eta, self.e, self.c, self.y_i = kappa, eta, e, c, y_i
        self.time = self.x = self.y = self.V = self.w = 0 * kappa
        self.held = self.last = None
        self.lost, self.lows, self.highs, self.impacts = 0 * kappa, [], [], 0
        self.passages, self.backs = [], []
        self.foremost, self.touched = 0 * kappa, 0 * kappa
        self.holder, self.releases = 1, 0

    def push(self, y):
        """U(y)."""
        return y + self.c / 2 * (y - self.y_i) ** 2

    def slope(self, y):
        """U'(y)."""
        return 1 + self.c * (y - self.y_i)

    def gap(self, side, x, y):
        """Teeth that have passed the plane of a pallet."""
        return x - self.push(y) if side > 0 else x - self.push(-y) - self.kappa / self.kappa / 2

    def energy(self):
        return (self.kappa * self.V**2 + self.w**2) / 2

    def begin(self, **disturbed):
        """Just after an impact on the upper pallet, as the symmetric cycle would have it."""
        kappa, e = self.kappa, self.e
        half = root((1 + e) / (1 - e) / (1 + kappa))
        self.w, self.V = kappa * half / 2, half * (kappa * (1 - e) - 2 * e) / (2 * (1 + e))
        self.y = -kappa * half**2 / 4
        self.x = self.push(self.y)
        for name, factor in disturbed.items():
            setattr(self, name, getattr(self, name) * factor)
        self.foremost = self.x
        self.held, self.last = (1 if e == 0 else None), (1, 0)

    def contacts(self):
        """(time, side, tooth) of all that may come next."""
        for side in (1, -1):
            rate = self.V - side * self.slope(side * self.y) * self.w
            bend = 1 - self.c * self.w**2
            now = self.gap(side, self.x, self.y)
            for tooth in range(floor(now) - 3, ceil(now) + 4):
                away = 0 * now if (side, tooth) == self.last else now - tooth
                for t in roots(away, rate, bend):
                    if t > 0 and side * (self.y + self.w * t) < self.eta:
                        yield t, side, tooth

    def mark(self, time, x, V, w):
        """Remembers that y passes 0 upwards, and how much was counted until then."""
        counts = len(self.lows), len(self.backs), self.touched, self.impacts, self.releases
        self.passages.append(Passage(time, x, V, w, *counts))

    def release(self):
        """Counts that y passes the tip of the pallet that holds the wheel: the other one holds it from there."""
        if self.holder * self.y >= self.eta:
            self.holder, self.releases = -self.holder, self.releases + 1

    def go_back(self, speed, pull, t):
        """Remembers how far the wheel is behind its foremost within t, which begins at that speed."""
        turn = min(max(-speed / pull, 0), t)
        self.backs.append(self.foremost - self.x - (speed + pull * turn / 2) * turn)
        self.foremost = max(self.foremost, self.x + (speed + pull * t / 2) * t)

    def fly(self, t):
        if self.y < 0 <= self.y + self.w * t:
            to = -self.y / self.w
            self.mark(self.time + to, self.x + (self.V + to / 2) * to, self.V + to, self.w)
        self.go_back(self.V, 1, t)
        self.x += self.V * t + t * t / 2
        self.y += self.w * t
        self.V += t
        self.time += t
        self.release()

    def strike(self, side, tooth):
        lever = side * self.slope(side * self.y)
        closing = self.V - lever * self.w
        blow = (1 + self.e) * closing / (1 / self.kappa + lever**2)
        before = self.energy()
        self.V, self.w = self.V - blow / self.kappa, self.w + lever * blow
        self.lost += before - self.energy()
        self.x = tooth + self.x - self.gap(side, self.x, self.y)
        self.impacts, self.last = self.impacts + 1, (side, tooth)
        self.lows.append(self.y)
        self.highs.append(self.y)
        if abs(self.e * closing) < FAINT[type(self.kappa)] and closing > 0:
            self.held = side

    def slide(self):
        """Contact until the tip."""
        side, pull = self.held, self.kappa / (1 + self.kappa)
        W = (self.kappa * self.V + side * self.w) / (1 + self.kappa)
        way = self.eta - side * self.y
        speed = root(W * W + 2 * pull * way)
        t = (speed - W) / pull
        if W < 0:
            turn = side * (side * self.y - W * W / (2 * pull))
            (self.lows if side > 0 else self.highs).append(turn)
        if side > 0 and self.y < 0:
            fast = root(W * W - 2 * pull * self.y)
            self.mark(self.time + (fast - W) / pull, self.x - self.y, fast, fast)
        self.go_back(W, pull, t)
        self.touched += t
        self.x += way
        self.y, self.V, self.w = side * self.eta, speed, side * speed
        self.time += t
        self.held = None
        self.release()

    def step(self):
        """To just after the next contact, or to the end of one that lasts."""
        if self.held:
            self.slide()
            return
        t, side, tooth = min(self.contacts())
        self.fly(t)
        self.strike(side, tooth)


def settled(clock, steps, near):
    """`Settled` of a clock, or None; half travel and its middle are those of the farthest ends.

    It has come to a cycle when it passes y = 0 upwards as it did before, within `near`; impacts are per half period.
    """
    for _ in range(steps):
        clock.step()
    last = clock.passages[-1]
    for back in range(1, min(40, len(clock.passages))):
        first = clock.passages[-1 - back]
        ways = last.x - first.x
        teeth = round(ways)
        if max(abs(last.V - first.V), abs(last.w - first.w), abs(ways - teeth)) < near and teeth > 0:
            low, high = min(clock.lows[first.ends : last.ends]), max(clock.highs[first.ends : last.ends])
            time = last.time - first.time
            return Settled(
                time / teeth, (high - low) / 2, abs(high + low) / 2, teeth, back, last.releases - first.releases,
                max(clock.backs[first.backs : last.backs]), (last.touched - first.touched) / time,
                (last.impacts - first.impacts) / (2 * teeth),
            )  # fmt: skip
    return None


def multiplier(clock, end, step=1e-5):
    """Largest modulus by which disturbances of a settled clock without contact grow in a half swing, by differences."""
    last = clock.passages[-1]

    def image(disturbance):
        other = Clock(clock.kappa, clock.eta, clock.e, clock.c, clock.y_i)
        other.x, other.V, other.w = (v + d for v, d in zip((last.x, last.V, last.w), disturbance, strict=True))
        while len(other.passages) < end.passages:
            other.step()
        there = other.passages[-1]
        return np.array([there.x, there.V, there.w])

    slopes = [(image(step * unit) - image(-step * unit)) / (2 * step) for unit in np.eye(3)]
    return max(abs(np.linalg.eigvals(np.array(slopes)))) ** (1 / end.half_swings)


def roots(gap, rate, bend):
    """Times at which gap + rate t + bend t^2/2 = 0."""
    if bend == 0:
        return [-gap / rate] if rate else []
    square = rate * rate - 2 * bend * gap
    if square < 0:
        return []
    big = -(rate + root(square)) if rate >= 0 else -(rate - root(square))
    return [big / bend, 2 * gap / big] if big else []
