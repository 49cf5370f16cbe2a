"""A crown wheel and a foliot that collide, followed in the plainest way; imports nothing of ours.

Lengths in tooth pitches, times in sqrt(pitch/g), wheel of mass kappa, foliot of mass 1, force kappa on the rim. All
teeth near both pallets are tried for the next contact, bounces are followed one by one until they are too small to be
told from contact. Numbers are float or mpf, whichever the arguments are.
"""

from math import ceil, floor

from mpmath import mpf


def root(x):
    """Square root of a float or an mpf."""
    return x**0.5


FAINT = {float: 1e-13, mpf: mpf(10) ** -22}


class Clock:
    """One clock in motion; `upper` 1 and -1 are the two pallets."""

    def __init__(self, kappa, eta, e, c=0.0, y_i=0.0):
        self.kappa, self.eta, self.e, self.c, self.y_i = kappa, eta, e, c, y_i
        self.time = self.x = self.y = self.V = self.w = 0 * kappa
        self.held = self.last = None
        self.lost, self.lows, self.highs, self.impacts = 0 * kappa, [], [], 0
        self.passages = []

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

    def fly(self, t):
        if self.y < 0 <= self.y + self.w * t:
            to = -self.y / self.w
            self.passages.append((self.time + to, self.x + (self.V + to / 2) * to, self.V + to, self.w, len(self.lows)))
        self.x += self.V * t + t * t / 2
        self.y += self.w * t
        self.V += t
        self.time += t

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
            self.passages.append((self.time + (fast - W) / pull, self.x - self.y, fast, fast, len(self.lows)))
        self.x += way
        self.y, self.V, self.w = side * self.eta, speed, side * speed
        self.time += t
        self.held = None

    def step(self):
        """To just after the next contact, or to the end of one that lasts."""
        if self.held:
            self.slide()
            return
        t, side, tooth = min(self.contacts())
        self.fly(t)
        self.strike(side, tooth)


def settled(clock, steps, near):
    """(period, half travel, middle of the travel, teeth) of the motion that a clock comes to repeat, or None.

    It has come to a cycle when it passes y = 0 upwards as it did before, within `near`; a period is the time per tooth.
    """
    for _ in range(steps):
        clock.step()
    times, ways, rims, pallets, marks = zip(*clock.passages, strict=True)
    for back in range(2, 40):
        if back > len(times):
            return None
        teeth = ways[-1] - ways[-back]
        apart = max(abs(rims[-1] - rims[-back]), abs(pallets[-1] - pallets[-back]), abs(teeth - round(teeth)))
        if apart < near and round(teeth) > 0:
            low, high = (
                f(extremes[marks[-back] : marks[-1]]) for f, extremes in ((min, clock.lows), (max, clock.highs))
            )
            return (times[-1] - times[-back]) / round(teeth), (high - low) / 2, abs(high + low) / 2, round(teeth)
    return None


def roots(gap, rate, bend):
    """Times at which gap + rate t + bend t^2/2 = 0."""
    if bend == 0:
        return [-gap / rate] if rate else []
    square = rate * rate - 2 * bend * gap
    if square < 0:
        return []
    big = -(rate + root(square)) if rate >= 0 else -(rate - root(square))
    return [big / bend, 2 * gap / big] if big else []
