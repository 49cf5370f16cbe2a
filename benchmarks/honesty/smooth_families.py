"""Families of scenes whose rates are smooth: poles, flat starts, growth, chaos, and surfaces that are just met."""

import numpy as np
from family import PI, REAL, Truth, family, scene

from kernels.scene import cos, sin, sqrt


def _blow_up_truth(x0, T):
    x0, T = REAL(1) * x0, REAL(1) * T
    rest = 1 - x0 * T
    x = np.where(rest > 0, x0 / np.where(rest > 0, rest, 1), np.nan)
    return Truth(np.where(rest > 0, T, np.nan), [x, T], [abs(x), T], 1 / np.maximum(rest, 1e-30))


@family(
    scene("blow_up", "x t", "x0 T", lambda x: (x * x, 1.0), lambda t, T: T - t, lambda x0: (x0, 0.0)), _blow_up_truth
)
def blow_up(random, n):
    """x' = x^2, up to next to its pole and beyond."""
    rest = 10.0 ** random.uniform(-17, 0, n) * random.choice([1.0, 1.0, 1.0, -1.0, 0.0], n)
    T = random.choice([2.0, 1.0, 3.7], n)
    return {"x0": (1.0 - rest) / T, "T": T}


def _pole_truth(p, T):
    p, T = REAL(1) * p, REAL(1) * T
    inside = p > T
    y = np.where(inside, np.log(np.where(inside, (p - T) / p, 1)), np.nan)
    condition = p / np.where(inside, p - T, 1) / np.maximum(abs(y), 1e-9)
    return Truth(np.where(inside, T, np.nan), [T, y], [T, abs(y)], condition)


@family(
    scene("pole", "t y", "p T", lambda t, p: (1.0, 1.0 / (t - p)), lambda t, T: T - t, lambda: (0.0, 0.0)), _pole_truth
)
def pole(random, n):
    """y' = 1/(t - p), up to next to the pole, and over it."""
    p = random.uniform(0.5, 30.0, n)
    return {"p": p, "T": p * (1.0 - 10.0 ** random.uniform(-16, 0, n) * random.choice([1.0, 1.0, 1.0, -1.0], n))}


def _flat_truth(w, d, T, steep):
    w, d, T = (REAL(1) * c for c in (w, d, T))
    n = np.where(steep > 0, 14, 3)
    phase, start = w * (T - d) ** n, w * (-d) ** n
    y = np.where(steep > 0, T, 0) + np.sin(phase) - np.sin(start)
    crest = np.where(steep > 0, (PI / (2 * w)) ** (REAL(1) / 14), 0) + 1
    size = np.maximum(abs(y), np.where(phase > PI / 2, crest, 0))
    return Truth(T, [T, y], [T, size], n * abs(phase) * (1 + 1 / np.maximum(size, 1e-30)))


def _flat_rate(t, w, d, steep):
    u = t - d
    return 1.0, (1.0 - steep) * 3.0 * w * u**2 * cos(w * u**3) + steep * (
        1.0 + 14.0 * w * u**8 * u**5 * cos(w * u**8 * u**6)
    )


@family(
    scene("flat", "t y", "w d T steep", _flat_rate, lambda t, T: T - t, lambda: (0.0, 0.0)), _flat_truth
)  # fmt: skip
def flat_start(random, n):
    """sin(w t^3), and t + sin(w t^14): the last terms of their series are 0 at the start, or next to it."""
    steep = np.floor(random.uniform(0.0, 2.0, n))
    d = 10.0 ** random.uniform(-12, -0.5, n) * random.choice([-1.0, 0.0, 1.0], n)
    T = random.uniform(0.5, np.where(steep > 0, 1.3, 3.0), n)
    return {"w": random.uniform(0.1, 3.0, n), "d": d, "T": T, "steep": steep}


def _flat_surface_truth(w, d, c):
    w, d, c = (REAL(1) * x for x in (w, d, c))
    angle = np.arccos(c)
    T = d + (angle / w) ** (REAL(1) / 7)
    return Truth(T, [T], [T], 1 + 1 / (angle * np.sqrt(1 - c * c)))


@family(
    scene(
        "flat_surface", "t", "w d c", lambda: (1.0,), lambda t, w, d, c: cos(w * (t - d) ** 7) - c, lambda: (0.0,)
    ), _flat_surface_truth,
)  # fmt: skip
def flat_surface(random, n):
    """A surface whose series at the start has no last terms, or small ones."""
    d = 10.0 ** random.uniform(-2.5, -0.5, n) * random.choice([-1.0, 0.0, 0.0, 1.0], n)
    return {"w": random.uniform(0.1, 3.0, n), "d": d, "c": random.uniform(-0.99, 0.9, n)}


def _torricelli_truth(h, c, share):
    h, c, share = (REAL(1) * v for v in (h, c, share))
    return Truth(2 / c * (np.sqrt(h) - np.sqrt(share * h)), [share * h], [h], 1 / (1 - share) + 0 * h)


@family(
    scene(
        "torricelli", "x", "h c share", lambda x, c: -c * sqrt(x), lambda x, h, share: x - share * h, lambda h: h
    ), _torricelli_truth,
)  # fmt: skip
def torricelli(random, n):
    """x' = -c sqrt(x), to next to empty."""
    return {
        "h": random.uniform(0.5, 4.0, n), "c": random.uniform(0.3, 2.0, n),
        "share": 10.0 ** random.uniform(-16, -0.1, n),
    }  # fmt: skip


def _long_truth(w, x0, T):
    w, x0, T = (REAL(1) * c for c in (w, x0, T))
    x, v = x0 * np.cos(w * T), -x0 * w * np.sin(w * T)
    return Truth(T, [T, x, v], [T, abs(x0), abs(x0 * w)], w * T)


@family(
    scene(
        "long", "t x v", "w x0 T", lambda v, x, w: (1.0, v, -w * w * x), lambda t, T: T - t, lambda x0: (0.0, x0, 0.0)
    ), _long_truth,
)  # fmt: skip
def long_oscillation(random, n):
    """An oscillator over up to 1,600 periods."""
    return {"w": random.uniform(1.0, 10.0, n), "x0": random.uniform(0.5, 2.0, n), "T": 10.0 ** random.uniform(0, 3, n)}


def _growth_truth(x0, T):
    """Below 1e-290 nobody promises anything, so those cannot be solved."""
    x0, T = REAL(1) * x0, REAL(1) * T
    x = x0 * np.exp(T)
    return Truth(T, [T, x], [T, x], np.where(x > 1e-290, T, np.inf))


@family(
    scene("growth", "t x", "x0 T", lambda x: (1.0, x), lambda t, T: T - t, lambda x0: (0.0, x0)), _growth_truth
)  # fmt: skip
def growth(random, n):
    """x' = x from next to the least float64 on."""
    return {"x0": 10.0 ** random.uniform(-307, 0, n), "T": 10.0 ** random.uniform(0, 2.84, n)}


def _logistic_truth(x0, T):
    x0, T = REAL(1) * x0, REAL(1) * T
    x = 1 / (1 + (1 - x0) / x0 * np.exp(-T))
    return Truth(T, [x, T], [x, T], 1 + T)


@family(
    scene("logistic", "x t", "x0 T", lambda x: (x * (1 - x), 1.0), lambda t, T: T - t, lambda x0: (x0, 0.0)),
    _logistic_truth,
)
def logistic(random, n):
    """What grows as e^t for long before it bends: what each step errs by, of x, adds up over all steps."""
    return {"x0": 10.0 ** random.uniform(-120, -1, n), "T": random.uniform(1, 300, n)}


def _quick_start_truth(x0, T):
    x0, T = REAL(1) * x0, REAL(1) * T
    x = np.sqrt(x0 * x0 + 2 * T)
    return Truth(T, [x, T], [x, T], 1 + 0 * T)


@family(
    scene("quick_start", "x t", "x0 T", lambda x: (1 / x, 1.0), lambda t, T: T - t, lambda x0: (x0, 0.0)),
    _quick_start_truth,
)
def quick_start(random, n):
    """Steps that begin 1e27 times shorter than the way: terms of a series in units of it are no numbers."""
    return {"x0": 10.0 ** random.uniform(-12, 0, n), "T": 10.0 ** random.uniform(-3, 3, n)}


def _grazing_truth(h, d, W):
    """x = cos(t) + 1 + d over 0: met at arccos(-1 - d), only where d < 0."""
    d = REAL(1) * d
    meets = d <= 0
    t = np.where(meets, PI - 2 * np.arcsin(np.sqrt(np.where(meets, -d, 0) / 2)), np.nan)
    v = -np.sqrt(np.where(meets, -d * (2 + d), 0))
    return Truth(t, [-1 - d, v], [1 + 0 * d, 1 + 0 * d], 1 / np.maximum(abs(d), 1e-30))


@family(
    scene(
        "grazing", "x v", "h d W", lambda x, v: (v, -x), lambda x, d: x + 1.0 + d, lambda: (1.0, 0.0)
    ), _grazing_truth,
)  # fmt: skip
def grazing(random, n):
    """An oscillator that only just meets a level, or only just misses it for ever."""
    d = -(10.0 ** random.uniform(-16, 0, n)) * random.choice([1.0, 1.0, 1.0, -1.0], n)
    return {"h": np.ones(n), "d": d, "W": np.ones(n)}


def _touching_truth(level, flips):
    """x = cos(s) - cos(2 s), s = 1 + t: falls over the level between turns, and before 2 pi only where that is > 0."""
    level = REAL(1) * level
    root = np.sqrt(9 - 8 * level)
    again = 2 * PI - 2 * np.arcsin(np.sqrt(np.maximum(level, 0) / (3 + root)))
    turns, odd = np.divmod(flips - 1, np.where(level > 0, 2, 1))
    s = 2 * PI * turns + np.where(odd > 0, again, np.arccos((1 - root) / 4))
    v, fastest = -np.sin(s) + 2 * np.sin(2 * s), REAL("2.7")
    return Truth(s - 1, [level, v], [2 + 0 * s, fastest + 0 * s], 1 / np.maximum(abs(level), 1e-30))


@family(
    scene(
        "touching", "x v", "level", lambda x, v, t: (v, 3.0 * cos(2.0 * (t + 1.0)) - x), lambda x, level: x - level,
        lambda: (cos(1.0) - cos(2.0), 2.0 * sin(2.0) - sin(1.0)),
    ), _touching_truth,
)  # fmt: skip
def touching(random, n):
    """A driven oscillator that just meets a level on its way, or just misses it, by less than it need be right to."""
    rtol = 10.0 ** random.uniform(-9, -3, n)
    level = rtol * 10.0 ** random.uniform(-3, 0, n) * random.choice([1.0, -1.0], n)
    return {"level": level, "flips": random.integers(2, 6, n).astype(float), "rtol": rtol}


def integrated(coefficients, state, span, step):
    """States after `span` and their largest sizes, by Taylor series: coefficients(state) -> [of each state, order 24].

    Two runs whose steps differ by 4 % and agree to 1e-3 of what is asked are believed.
    """
    state, reach = [np.asarray(s, REAL) for s in state], [abs(np.asarray(s, REAL)) for s in state]
    count = int(np.ceil(float(np.max(span)) / step))
    h = np.asarray(span, REAL) / count
    for _ in range(count):
        series = coefficients(state)
        state = [np.sum([c * h**k for k, c in enumerate(one)], axis=0) for one in series]
        reach = [np.maximum(r, abs(s)) for r, s in zip(reach, state, strict=True)]
    return state, reach


def product(u, w, k):
    return sum(u[j] * w[k - j] for j in range(k + 1))


def _duffing_truth(g, T):
    def coefficients(state):
        t, x, v = ([s] for s in state)
        c, s = [np.cos(t[0])], [np.sin(t[0])]
        square = []
        t.append(1 + 0 * t[0])
        for k in range(24):
            square.append(product(x, x, k))
            cube = product(square, x, k)
            x.append(v[k] / (k + 1))
            v.append((x[k] - cube - REAL("0.25") * v[k] + g * c[k]) / (k + 1))
            c.append(-s[k] / (k + 1))
            s.append(c[k] / (k + 1))
        return t, x, v

    g, T = REAL(1) * g, REAL(1) * T
    start = [0 * T, 1 + 0 * T, 0 * T]
    state, reach = integrated(coefficients, start, T, 0.1)
    other, _ = integrated(coefficients, start, T, 0.104)
    off = np.max([abs(a - b) / r for a, b, r in zip(state, other, reach, strict=True)], axis=0)
    return Truth(T, state, reach, np.maximum(off / 1e-19, 1))


@family(
    scene(
        "duffing", "t x v", "g T", lambda t, x, v, g: (1.0, v, x - x**3 - 0.25 * v + g * cos(t)), lambda t, T: T - t,
        lambda: (0.0, 1.0, 0.0),
    ), _duffing_truth,
)  # fmt: skip
def chaos(random, n):
    """Duffing's oscillator where errors grow by e^(0.15 t)."""
    return {"g": random.uniform(0.3, 0.5, n), "T": random.uniform(5.0, 240.0, n)}
