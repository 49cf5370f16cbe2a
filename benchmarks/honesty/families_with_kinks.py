"""Families of scenes with kinks and jumps: windows, pulses, impacts, relays, sticking and sliding."""

import numpy as np
from family import PI, REAL, Truth, family, scene

from kernels.scene import cos, exp, floor, power, sign, sin, where


def _windows_truth(w, T):
    """y' = window - y with the windows 2 pi k +- a, a = arccos(1 - w)."""
    w, T = REAL(1) * w, REAL(1) * T
    a = 2 * np.arcsin(np.sqrt(w / 2))
    y, top = 0 * T, 0 * T
    for k in range(8):
        start, end = np.maximum(2 * PI * k - a, 0), 2 * PI * k + a
        start, end = np.minimum(start, T), np.minimum(end, T)
        y = y + np.exp(end - T) - np.exp(start - T)
        top = np.maximum(top, -np.expm1(-2 * a) if k else -np.expm1(-a))
    return Truth(T, [T, y], [T, np.maximum(top, abs(y))], 1 / a**2 + T / a)


@family(
    scene(
        "windows", "t y", "w T", lambda t, y, w: (1.0, where(cos(t) > 1.0 - w, 1.0, 0.0) - y),
        lambda t, T: T - t, lambda: (0.0, 0.0),
    ), _windows_truth,
)  # fmt: skip
def windows(random, n):
    """A force that is on while cos(t) is above 1 - w."""
    return {"w": 10.0 ** random.uniform(-7, -0.2, n), "T": random.uniform(7.0, 40.0, n)}


def _stiff_windows_truth(w, T):
    """The lag of 1e-9 takes that much from y at most, which is below the rtol of these cells."""
    found = _windows_truth(w, T)
    x = np.zeros(len(T))
    return Truth(T, [T, np.nan * x, found.states[1]], [T, 1 + x, found.sizes[1]], found.condition * 1e4)


@family(
    scene(
        "stiff_windows", "t x y", "w T",
        lambda t, x, y, w: (1.0, (where(cos(t) > 1.0 - w, 1.0, 0.0) - x) / 1e-9, x - y),
        lambda t, T: T - t, lambda: (0.0, 0.0, 0.0),
    ), _stiff_windows_truth,
)  # fmt: skip
def stiff_windows(random, n):
    """The same through a lag of 1e-9."""
    rtol = 10.0 ** random.uniform(-5, -3, n)
    return {"w": 10.0 ** random.uniform(-3, -0.2, n), "T": random.uniform(7.0, 13.0, n), "rtol": rtol}


def _pulses_truth(p, w, T):
    p, w, T = (REAL(1) * c for c in (p, w, T))
    inside = np.clip(T - (p - w), 0, 2 * w)
    return Truth(T, [T, inside], [T, inside], p / w)


@family(
    scene(
        "pulses", "t y", "p w T", lambda t, p, w: (1.0, where(abs(t - p) < w, 1.0, 0.0)),
        lambda t, T: T - t, lambda: (0.0, 0.0),
    ), _pulses_truth,
)  # fmt: skip
def pulses(random, n):
    """A pulse of width 2 w at t = p."""
    p = random.uniform(5.0, 100.0, n)
    return {"p": p, "w": 10.0 ** random.uniform(-13, 0, n), "T": p * random.uniform(1.3, 2.0, n)}


def _two_sided_truth(p, w, T):
    p, w, T = (REAL(1) * c for c in (p, w, T))
    y = w / 2 * (2 - np.exp(-2 * p / w) - np.exp(-2 * (T - p) / w))
    return Truth(T, [T, y], [T, y], p / w)


@family(
    scene(
        "two_sided", "t y", "p w T", lambda t, p, w: (1.0, exp(-2.0 * abs(t - p) / w)),
        lambda t, T: T - t, lambda: (0.0, 0.0),
    ), _two_sided_truth,
)  # fmt: skip
def two_sided(random, n):
    """A pulse that rises and falls by an exponential."""
    p = random.uniform(1.0, 30.0, n)
    return {"p": p, "w": 10.0 ** random.uniform(-4, 1, n), "T": p * random.uniform(1.3, 2.0, n)}


def _crossed_truth(p, w, v, T):
    p, w, v, T = (REAL(1) * c for c in (p, w, v, T))
    y = w / (2 * v) * (2 - np.exp(-2 * p / w) - np.exp(-2 * (v * T - p) / w))
    return Truth(T, [T, v * T, v, y], [T, v * T, v, y], p / w)


@family(
    scene(
        "crossed", "t x u y", "p w v T", lambda x, u, p, w: (1.0, u, 0.0 * x, exp(-2.0 * abs(x - p) / w)),
        lambda t, T: T - t, lambda v: (0.0, 0.0, v, 0.0),
    ), _crossed_truth,
)  # fmt: skip
def crossed_pulse(random, n):
    """The same at a place that the motion passes at a speed of its own."""
    p, v = random.uniform(1.0, 30.0, n), random.uniform(0.5, 2.0, n)
    return {"p": p, "w": 10.0 ** random.uniform(-4, 1, n), "v": v, "T": p / v * random.uniform(1.3, 2.0, n)}


def _behind_truth(a, v, flips):
    """From x = 1 at rest to 0, then from -a with the speed v up and down again."""
    a, v = REAL(1) * a, REAL(1) * v
    first = np.sqrt(REAL(2))
    rest = np.sqrt(v * v - 2 * a)
    each = v + rest
    time = first + (flips - 1) * each
    speed = np.where(flips > 1, -rest, -first)
    reach = np.maximum(1, np.where(flips > 1, v * v / 2 - a, 1))
    return Truth(time, [0 * a, speed], [reach, np.maximum(v, first)], v * v / rest**2)


@family(
    scene(
        "behind", "x v", "a v0", lambda v: (v, -1.0), lambda x: x, lambda: (1.0, 0.0), lambda a, v0: (-a, v0)
    ), lambda a, v0, flips: _behind_truth(a, v0, flips),
)  # fmt: skip
def behind(random, n):
    """A jump that lands behind the surface, where nothing fires before the motion has come up."""
    a = random.uniform(0.1, 3.0, n)
    flips = random.integers(1, 9, n).astype(float)
    return {"a": a, "v0": np.sqrt(2 * a) * random.uniform(1.01, 3.0, n), "flips": flips}


def _broken_jump_truth(c, d, T, flips):
    """x = t + d jumps to the whole number below it at t = c."""
    c, d, T = REAL(1) * c, REAL(1) * d, REAL(1) * T
    x = c + d
    end = np.floor(x) + T - c
    return Truth(T, [T, end], [T, np.maximum(abs(x), abs(end))], 10 / np.maximum(abs(x - np.rint(x)), 1e-19))


@family(
    scene(
        "broken_jump", "t x", "c d T", lambda t, x: (1.0, 1.0), lambda t, c, T, side: where(side > 0.0, c - t, T - t),
        lambda d: (0.0, d), lambda t, x: (t, floor(x)),
    ), _broken_jump_truth,
)  # fmt: skip
def broken_jump(random, n):
    """A jump that is another one on the other side of a kink, with the kink next to the surface."""
    c = random.uniform(1.0, 5.0, n)
    d = np.rint(c) + 1.0 - c + random.choice([-1.0, 1.0, 0.0], n) * 10.0 ** random.uniform(-17, -1, n)
    return {"c": c, "d": d, "T": c + random.uniform(0.5, 2.0, n), "flips": np.full(n, 2.0)}


def _zeno_truth(h, e, flips):
    """A ball from the height h under gravity 1."""
    h, e = REAL(1) * h, REAL(1) * e
    fall = np.sqrt(2 * h)
    time = fall * (1 + 2 * np.where(e == 1, flips - 1, e * (1 - e ** (flips - 1)) / np.where(e == 1, 1, 1 - e)))
    rests = e ** (flips - 1) < 1e-15
    rest_time = fall * (1 + 2 * e / np.where(e == 1, 1, 1 - e))
    speed = np.where(rests, 0, -fall * e ** (flips - 1))
    return Truth(np.where(rests, rest_time, time), [0 * h, speed], [h, fall], 1 / np.where(e == 1, 1, 1 - e))


@family(
    scene("zeno", "x v", "h e", lambda v: (v, -1.0), lambda x: x, lambda h: (h, 0.0), lambda x, v, e: (x, -e * v)),
    _zeno_truth,
)
def zeno(random, n):
    """A ball that bounces on, or comes to rest."""
    e = random.choice([0.3, 0.8, 0.9, 0.95, 0.99], n) * random.uniform(0.98, 1.0, n)
    return {"h": random.uniform(0.5, 4.0, n), "e": e, "flips": np.floor(10.0 ** random.uniform(0, 3.5, n))}


def _root_over_level(q, b):
    """The integrals of abs(s^2 + b)^(1/2) and abs(s^2 + b)^(3/2) over s from 0 to q."""
    h, u = np.sqrt(abs(b)), q * q + b
    inside, outside = np.arcsin(np.minimum(q / h, 1)), np.arccosh(np.maximum(q / h, 1))
    over = np.arcsinh(q / h)
    root = (q * np.sqrt(abs(u)) + b * np.where(b > 0, over, outside - inside)) / 2
    signed = (np.sign(u) * q * np.sqrt(abs(u)) + b * np.where(b > 0, over, outside + inside)) / 2
    return root, (q * abs(u) ** REAL(1.5) + 3 * b * signed) / 4


def _power_turns_truth(n, d, p, T):
    n, d, p, T = (REAL(1) * c for c in (n, d, p, T))
    before, behind = _root_over_level(p, 2 * d), _root_over_level(T - p, 2 * d)
    y = np.where(n < 1, before[0] + behind[0], before[1] + behind[1]) / 2**n
    x, v = (T - p) ** 2 / 2 + d, T - p
    z = (p ** (n + 1) + v ** (n + 1)) / (n + 1)
    low, s = p ** (n + 2) / (n + 2), (v ** (n + 2) - p ** (n + 2)) / (n + 2)
    sizes = [T, np.maximum(p * p / 2 + d, abs(x)), np.maximum(p, v), y, z, np.maximum(low, abs(s))]
    return Truth(T, [T, x, v, y, z, s], sizes, 10 + 0 * T)


@family(
    scene(
        "power_turns", "t x v y z s", "n d p T",
        lambda x, v, n: (1.0, v, 1.0, power(abs(x), n), power(abs(v), n), power(abs(v), n) * v), lambda t, T: T - t,
        lambda d, p: (0.0, p * p / 2 + d, -p, 0.0, 0.0, 0.0),
    ), _power_turns_truth,
)  # fmt: skip
def power_turns(random, n):
    """A power of what turns round next to 0, or just behind it; and of its rate, which passes 0 then, or times that."""
    p, d = random.uniform(0.5, 2.0, n), 10.0 ** random.uniform(-8, -0.5, n) * random.choice([-1.0, 1.0], n)
    return {"n": random.choice([0.5, 1.5], n), "d": d, "p": p, "T": p + random.uniform(0.2, 2.0, n)}


def _even_truth(p, d, T):
    """z' = 1 and the surface (t - p)^2 + d as a kink: |.| is never met for d > 0, twice for d < 0."""
    p, d, T = (REAL(1) * c for c in (p, d, T))
    half = np.sqrt(np.maximum(-d, 0))
    y = T - 4 * half
    return Truth(T, [T, y], [T, T], 1 + np.where(d < 0, p / np.maximum(half, 1e-12), p / np.sqrt(abs(d)) * 1e-12))


@family(
    scene(
        "even_roots", "t y", "p d T", lambda t, p, d: (1.0, sign((t - p) ** 2 + d)), lambda t, T: T - t,
        lambda: (0.0, 0.0),
    ), _even_truth,
)  # fmt: skip
def even_roots(random, n):
    """A kink that is met twice close together, or nearly met."""
    p = random.uniform(1.0, 5.0, n)
    d = 10.0 ** random.uniform(-12, -1, n) * random.choice([-1.0, 1.0], n)
    return {"p": p, "d": d, "T": p * random.uniform(1.5, 2.0, n)}


def _relay_oscillation_truth(x0, T):
    """Parabolas, a quarter of a period q = sqrt(2 x0) long; what a turn is off by in time goes on in the amplitude."""
    x0, T = REAL(1) * x0, REAL(1) * T
    q = np.sqrt(2 * x0)
    half = np.floor((T / q + 1) / 2)  # turns so far: x is largest at the times 2 q half
    way, s = 1 - 2 * np.mod(half, 2), T - 2 * half * q
    return Truth(T, [T, way * (x0 - s * s / 2), -way * s], [T, x0, q], (T / q) ** 2)


@family(
    scene("relay_oscillation", "t x v", "x0 T", lambda v, x: (1.0, v, -sign(x)), lambda t, T: T - t,
        lambda x0: (0.0, x0, 0.0)), _relay_oscillation_truth,
)  # fmt: skip
def relay_oscillation(random, n):
    """A relay that switches up to 700 times."""
    x0 = 10.0 ** random.uniform(-4, 1, n)
    return {"x0": x0, "T": random.uniform(3.0, 10.0, n)}


def _thrown_truth(c, g, w, flips):
    """Arcs of cos t between the switches; by how much speeds at the end follow that of the start is their condition."""
    c, g, speed = (REAL(1) * column for column in (c, g, w))
    time, last, reach, largest, grown = (0 * speed + x for x in (0, 0, 1, 0, 1))
    for k in range(int(flips.max())):
        going, size = k < flips, np.hypot(1, speed)
        arrived, took = -np.sqrt(size * size - c * c), np.arccos(c / size) - np.arctan2(-speed, 1)
        time, last = np.where(going, time + took, time), np.where(going, arrived, last)
        turns = np.where(speed > 0, size, 1)
        reach, largest = (
            np.where(going, np.maximum(reach, turns), reach),
            np.where(going, np.maximum(largest, size), largest),
        )
        grown = np.where(
            going,
            np.maximum(1, grown) * abs(4 * g * (2 * arrived + REAL(1.1) + REAL(1.6))) * abs(speed / arrived),
            grown,
        )
        speed = np.where(going, 4 * g * (arrived + REAL(1.1)) * (arrived + REAL(1.6)) - 1, speed)
    return Truth(time, [c, last], [reach, largest], 10 + 10 * grown)


@family(
    scene(
        "thrown", "x v", "c g w", lambda x, v: (v, -x), lambda x, c: x - c, lambda w: (1.0, w),
        lambda v, g: (1.0, 4.0 * g * (v + 1.1) * (v + 1.6) - 1.0),
    ), _thrown_truth,
)  # fmt: skip
def thrown(random, n):
    """A swing that is thrown off anew by what it arrives with, so that switches multiply what it is off by."""
    cells = {"c": random.uniform(-0.2, 0.3, n), "g": random.uniform(2.0, 4.0, n), "w": random.uniform(-0.5, 0.5, n)}
    return {**cells, "flips": np.full(n, 8.0), "rtol": 10.0 ** random.uniform(-10, -2, n)}


def _relay_truth(M, T, y0, a):
    """Slides along y = x from the start: x' = -x + y, y' pressed; on y = s(t): see the scene. Formula below."""
    M, T, y0, a = (REAL(1) * c for c in (M, T, y0, a))
    # u = y - a t pressed to 0 by M: reaches it after y0/(M + a), then y = a t; z' = y
    t0 = y0 / (M + a)
    y = a * T
    z = y0 * t0 - M * t0**2 / 2 + a * (T**2 - t0**2) / 2
    return Truth(T, [T, y, z], [T, np.maximum(y, y0), abs(z)], 1 + 0 * T)


@family(
    scene(
        "relay", "t y z", "M T y0 a", lambda t, y, M, a: (1.0, -M * sign(y - a * t), y), lambda t, T: T - t,
        lambda y0: (0.0, y0, 0.0),
    ), _relay_truth,
)  # fmt: skip
def sliding(random, n):
    """A relay that follows a ramp."""
    a = random.uniform(0.1, 0.9, n)
    y0 = random.uniform(0.1, 1.0, n)
    return {"M": 10.0 ** random.uniform(0, 6, n), "T": random.uniform(2.0, 9.0, n), "y0": y0, "a": a}


def _den_hartog_one(w, f, x0, periods):
    """x'' = -x - f sign(v) + cos(w t) from x0 at rest, stuck where |cos(w t) - x| <= f; exact between events."""
    w, f, x, v, t = REAL(w), REAL(f), REAL(x0), REAL(0), REAL(0)
    end, reach, reach_v, least = periods * 2 * PI / w, abs(REAL(x0)), REAL(0), REAL(1)

    def place(t0, x, v, s):
        """x and v of the free motion after t0."""
        b = 1 / (1 - w * w)
        c = x + s * f - b * np.cos(w * t0)
        d = v + b * w * np.sin(w * t0)
        return lambda t: (
            c * np.cos(t - t0) + d * np.sin(t - t0) - s * f + b * np.cos(w * t),
            -c * np.sin(t - t0) + d * np.cos(t - t0) - b * w * np.sin(w * t),
        )

    def first(g, t0):
        """The first sign change of g behind t0, or the end; points are dense behind t0, where a short rest may end."""
        grid = t0 + (end - t0) * (np.arange(8001).astype(REAL) / 8000) ** 2
        values = g(grid)
        signs = np.flatnonzero((values[2:] > 0) != (values[1:-1] > 0))
        if not len(signs):
            return end
        low, high = grid[signs[0] + 1], grid[signs[0] + 2]
        sign_low = g(low) > 0
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (middle, high) if (g(middle) > 0) == sign_low else (low, middle)
        return (low + high) / 2

    for _ in range(200):
        if t >= end:
            break
        force = np.cos(w * t) - x
        if v == 0 and abs(force) < f * (1 + REAL(1e-17)) and not abs(abs(force) - f) < 1e-16:
            t = first(lambda s, x=x: f - abs(np.cos(w * s) - x), t)
            if t >= end:
                break
            force = np.cos(w * t) - x
        s = np.sign(force)
        motion = place(t, x, v, s)
        stop = first(lambda u, motion=motion: motion(u)[1], t)
        inside = motion(np.linspace(float(t), float(stop), 400).astype(REAL))
        reach, reach_v = max(reach, abs(inside[0]).max()), max(reach_v, abs(inside[1]).max())
        x, v = motion(stop)
        t = stop
        if stop < end:
            v = REAL(0)
            least = min(least, abs(abs(np.cos(w * t) - x) - f))
    return end, x, v, reach, reach_v, least


def _den_hartog_truth(w, f, x0, periods):
    rows = [_den_hartog_one(*cell) for cell in zip(w, f, x0, periods, strict=True)]
    end, x, v, reach, reach_v, least = (np.array(r, REAL) for r in zip(*rows, strict=True))
    return Truth(end, [end, x, v], [end, reach, np.maximum(reach_v, 1e-300)], 100 / least)


@family(
    scene(
        "den_hartog", "p x v", "w f x0 periods",
        lambda p, x, v, w, f: (1.0, v, -x - f * sign(v) + cos(w * p)),
        lambda p, w, periods: periods * float(2 * PI) / w - p,
        lambda x0: (0.0, x0, 0.0),
    ), _den_hartog_truth,
)  # fmt: skip
def stick_and_break_away(random, n):
    """Den Hartog's mass, from rest within its friction."""
    return {
        "w": random.uniform(0.3, 0.9, n), "f": random.uniform(0.5, 0.98, n), "x0": random.uniform(0.05, 0.5, n),
        "periods": random.integers(1, 4, n).astype(float),
    }  # fmt: skip


def _ball_one(h, G, W, e, flips):
    """Ball from h on a floor G sin(W t): time, place and speed before the last bounce, sizes, condition."""
    h, G, W, e = (REAL(v) for v in (h, G, W, e))
    t, x, v = REAL(0), h, REAL(0)
    reach, reach_v, growth, slow = h, REAL(0), REAL(1), REAL(1)
    for k in range(int(flips)):

        def gap(s, x=x, v=v, t=t):
            return x + v * (s - t) - (s - t) ** 2 / 2 - G * np.sin(W * s)

        step = REAL(0.02) / max(W, 1)
        high = t + 1e-9 if k else t
        while True:
            grid = high + step * np.arange(400).astype(REAL)
            below = np.flatnonzero(gap(grid)[1:] < 0)
            if len(below):
                break
            high = grid[-1]
        low, high = grid[below[0]], grid[below[0] + 1]
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (middle, high) if gap(middle) > 0 else (low, middle)
        s = (low + high) / 2
        reach = max(reach, abs(x + max(v, 0) ** 2 / 2))
        x, v, t = x + v * (s - t) - (s - t) ** 2 / 2, v - (s - t), s
        reach_v = max(reach_v, abs(v))
        floor = G * W * np.cos(W * t)
        before = (x, v, t)
        slow = min(slow, abs(v - floor))
        growth = growth * (1 + e + (1 + e) * abs(G * W * W * np.sin(W * t) + 1) / abs(v - floor))
        v = floor - e * (v - floor)
    x, v, t = before
    return t, x, v, reach, reach_v, growth / slow**2


def _ball_truth(h, G, W, e, flips):
    rows = [_ball_one(*cell) for cell in zip(h, G, W, e, flips, strict=True)]
    t, x, v, reach, reach_v, growth = (np.array(r, REAL) for r in zip(*rows, strict=True))
    return Truth(t, [x, v, t], [reach, reach_v, t], growth)


@family(
    scene(
        "ball", "x v t", "h G W e", lambda v: (v, -1.0, 1.0), lambda x, t, G, W: x - G * sin(W * t),
        lambda h: (h, 0.0, 0.0),
        lambda x, v, t, G, W, e: (x, G * W * cos(W * t) - e * (v - G * W * cos(W * t)), t),
    ), _ball_truth,
)  # fmt: skip
def moving_surface(random, n):
    """A ball on a table that swings."""
    return {
        "h": random.uniform(1.0, 3.0, n), "G": random.uniform(0.02, 0.3, n), "W": random.choice([1.0, 1.0, 10.0], n),
        "e": random.uniform(0.5, 0.9, n), "flips": random.choice([1.0, 1.0, 2.0, 3.0, 6.0], n),
    }  # fmt: skip
