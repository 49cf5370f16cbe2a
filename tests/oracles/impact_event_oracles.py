"""What an impact clock with a flat lever comes to, in 50 digits; imports nothing of ours.

Wheel of mass kappa and pallets of mass 1, force kappa on the rim, lengths in tooth pitches: between impacts x'' = 1 and
y'' = 0. A clock is followed in float64 until its half swings, from the pallets' release at y = -eta to the next one,
all but repeat; the cycle is the fixed point of those half swings, by Newton with differences in mpf. Bounces are
followed until they are slower than `FAINT`, and only their rest is summed.
"""

import math

from mpmath import eig, eye, floor, lu_solve, matrix, mp, mpf, nint, norm, pi, sqrt

DIGITS = 50
FAINT = {float: 1e-13, mpf: mpf(10) ** -27}
TOUCHING = {float: 1e-12, mpf: mpf(10) ** -25}
STEP = mpf(10) ** -20


def root(x):
    return sqrt(x) if isinstance(x, mpf) else math.sqrt(x)


def whole(x):
    """The next whole number above x."""
    return int(floor(x)) + 1


def ahead(gap, rate):
    """Time in which the tooth covers a gap >= 0 to the pallet, which grows less by rate t + t^2/2."""
    gap = max(gap, 0 * gap)
    square = root(rate * rate + 2 * gap)
    return 2 * gap / (rate + square) if rate > 0 else square - rate


def behind(gap, rate):
    """Time in which the pallet covers a gap to the tooth behind it; None if it does not."""
    square = rate * rate - 2 * gap
    return 2 * gap / (root(square) - rate) if rate < 0 <= square else None


class Clock:
    """One clock; `half_swing` adds to time, way, held and the like, and the lowest y of each half swing to `lows`."""

    def __init__(self, kappa, eta, e):
        self.kappa, self.eta, self.e, self.zero, self.pull = kappa, eta, e, 0 * kappa, kappa / (1 + kappa)
        self.depth = self.zero
        self.clear()

    def clear(self):
        self.time = self.way = self.held = self.recoil = self.zero
        self.lows, self.firsts = [], []

    def half_swing(self, start):
        """The start (gap, V, w) of the next half swing, reflected, from the start of this one."""
        gap, self.V, self.w = start
        self.y, self.x = -self.eta, gap - self.eta
        self.lower, self.foremost, begin, self.struck = None, self.x + self.depth, self.x, False
        self.lows.append(self.y)
        while not self.step():
            pass
        self.way += self.x - begin
        self.depth = self.foremost - self.x
        gap = self.x + self.y - self.half()
        gap -= whole(gap)
        return (gap if gap > TOUCHING[type(gap)] - 1 else self.zero), self.V, -self.w

    def half(self):
        """Half a pitch."""
        return 1 / (2 + self.zero)

    def nexts(self):
        """(time, what) of all that may come next: a tooth ahead of a pallet or behind it, or the tip passes a tooth."""
        yield ahead(self.y - self.x, self.V - self.w), ("tooth", 1, 0)
        yield behind(1 + self.x - self.y, self.V - self.w), ("tooth", 1, -1)
        if self.lower is None:
            yield (max((-self.eta - self.y) / self.w, self.zero) if self.w > 0 else None), ("below", 0, 0)
            return
        gap = self.x + self.y - self.half() - self.lower
        yield ahead(-gap, self.V + self.w), ("tooth", -1, 0)
        yield behind(1 + gap, self.V + self.w), ("tooth", -1, -1)
        if self.w != 0:
            yield ((self.eta if self.w > 0 else -self.eta) - self.y) / self.w, ("end" if self.w > 0 else "above", 0, 0)

    def step(self):
        """To the next event; whether the half swing ends with it."""
        t, (what, side, tooth) = min((n for n in self.nexts() if n[0] is not None), key=lambda n: n[0])
        self.fly(t)
        if what == "tooth":
            return self.strike(side, tooth)
        if what == "below":  # the lower pallet begins to be in the way
            self.y = -self.eta
            self.lower = whole(self.x + self.y - self.half())
        elif what == "above":
            self.y, self.lower = -self.eta, None
        else:
            self.y = self.eta
        return what == "end"

    def fly(self, t):
        turn = min(max(-self.V, self.zero), t)
        self.note(self.x + (self.V + turn / 2) * turn)
        self.x, self.y = self.x + (self.V + t / 2) * t, self.y + self.w * t
        self.V, self.time = self.V + t, self.time + t
        self.note(self.x)

    def note(self, x):
        """How far the wheel is behind its foremost."""
        self.recoil = max(self.recoil, self.foremost - x)
        self.foremost = max(self.foremost, x)

    def strike(self, side, tooth):
        blow = (1 + self.e) * (self.V - side * self.w) / (1 / self.kappa + 1)
        self.V, self.w = self.V - blow / self.kappa, self.w + side * blow
        self.lows[-1] = min(self.lows[-1], self.y)
        self.x = self.y + tooth if side > 0 else self.half() + self.lower + tooth - self.y
        if tooth == 0 and side > 0 and not self.struck:
            self.firsts.append((self.V, self.w))
            self.struck = True
        apart = side * self.w - self.V
        return tooth == 0 and apart <= FAINT[type(apart)] and self.stick(side, max(apart, self.zero))

    def stick(self, side, apart):
        """The rest of the bounces, and contact until a tip; whether the half swing ends with it."""
        W, a = (self.kappa * self.V + side * self.w) / (1 + self.kappa), self.pull
        bounces = 2 * apart / (1 - self.e)
        begin = side * self.y
        way, W, self.time = begin + (W + a * bounces / 2) * bounces, W + a * bounces, self.time + bounces
        up = W * W - 2 * a * (way + self.eta)
        goal, fast = self.eta, root(W * W + 2 * a * (self.eta - way))
        if side < 0 and W < 0 <= up:  # the pallet across is left by the way it came
            goal, fast = -self.eta, -root(up)
        t = (fast - W) / a
        turn = min(max(-W / a, self.zero), t)
        lowest = way + (W + a * turn / 2) * turn
        self.note(self.x + lowest - begin)
        if side > 0:
            self.lows[-1] = min(self.lows[-1], lowest)
        self.x, self.y, self.V, self.w = self.x + goal - begin, side * goal, fast, side * fast
        self.note(self.x)
        self.time, self.held, self.lower = self.time + t, self.held + t, None
        return side * goal > 0 or (side < 0 and goal < 0)


def beginning(kappa, eta, e):
    """The symmetric cycle's half swing, a little off, in float64."""
    half = math.sqrt((1 + e) / (1 - e) / (1 + kappa))
    w, V = kappa * half / 2, half * (kappa * (1 - e) + 2) / (2 * (1 + e))
    t = max(kappa * half * half / 4 - eta, 0) / w
    gap = -(V - t / 2) * t - w * t
    return gap - math.ceil(gap - 4e-16), (V - t) * (1 + 5e-7), -w * (1 + 1e-6)


def settled(kappa, eta, e, half_swings):
    """A start in float64 after which half swings repeat, and after how many they do."""
    clock = Clock(kappa, eta, e)
    start = beginning(kappa, eta, e)
    for _ in range(half_swings):
        start = clock.half_swing(start)
    later = start
    for k in range(1, 17):
        later = clock.half_swing(later)
        if max(abs(a - b) for a, b in zip(start, later, strict=True)) < 1e-7:
            return start, k
    raise ArithmeticError("does not repeat")


def cycle(kappa, eta, e, half_swings=400):
    """The clock on the cycle it comes to, after one whole period, its half swings, and the largest multiplier."""
    start, k = settled(float(kappa), float(eta), float(e), half_swings)
    clock = Clock(kappa, eta, e)

    def after(z):
        z = tuple(z)
        for _ in range(k):
            z = clock.half_swing(z)
        return matrix(z)

    z = matrix([mpf(v) for v in start])
    for _ in range(10):
        there, slopes = after(z), matrix(3, 3)
        for j, by in enumerate((-STEP, STEP, STEP)):
            beside = z.copy()
            beside[j] += by
            slopes[:, j] = (after(beside) - there) / by
        step = lu_solve(eye(3) - slopes, there - z)
        z += step
        z[0] = min(z[0], mpf(0))
        if norm(step) < mpf(10) ** -24:
            break
    else:
        raise ArithmeticError("no cycle")
    whole_period = k if k % 2 == 0 else 2 * k
    after(z)  # now the depth of the rim is that of the cycle
    clock.clear()
    for _ in range(whole_period // k):
        z = after(z)
    return clock, whole_period, max(abs(v) for v in eig(slopes)[0]) ** (mpf(1) / k)


def outputs(torque, I_c, I_v, r_c, r_v, teeth, h, e):
    """Period, swing, speeds of wheel and pallet, multiplier, recoil and share of contact by name, in SI units."""
    with mp.workdps(DIGITS):
        torque, I_c, I_v, r_c, r_v, h, e = (mpf(v) for v in (torque, I_c, I_v, r_c, r_v, h, e))
        pitch, kappa = 2 * pi * r_c / int(teeth), (I_c / r_c**2) / (I_v / r_v**2)
        unit = sqrt(2 * pi * I_c / (int(teeth) * torque))
        clock, half_swings, multiplier = cycle(kappa, h / pitch, e)
        beats = len(clock.firsts)
        return {
            "period": clock.time / min(int(nint(clock.way)), half_swings // 2) * unit,
            "swing": -(min(clock.lows[::2]) + min(clock.lows[1::2])) / 2 * pitch,
            "wheel_speed": sum(V for V, _ in clock.firsts) / beats * pitch / (unit * r_c),
            "pallet_speed": sum(w for _, w in clock.firsts) / beats * pitch / (unit * r_v),
            "multiplier": multiplier,
            "recoil": clock.recoil * pitch / r_c if clock.recoil > TOUCHING[mpf] else mpf(0),
            "contact_share": clock.held / clock.time,
        }
