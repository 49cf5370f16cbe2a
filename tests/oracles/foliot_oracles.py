"""Truth about the foliot with any losses, by mpmath; imports nothing of ours.

    phi'' = -mu - (a v + R sgn v + c |v|^n sgn v) - k phi,  v = phi'                                (1)

from phi = +phi0, just after a switch, to phi = -phi0, where the next one follows; a switch changes the speed to e times
what it was. Three ways, each to its own half swing, and one search for the cycle above them:
- c = 0 (or n = 0, 1): the closed flow of a linear piece;
- k = 0: integrals over the speed, dphi = v dv/accel and dt = dv/accel;
- k > 0 and c > 0: Taylor series, in time and, near a turning point, in ln |v|, where |v|^n is smooth.
Period's sensitivity is a difference of solved cycles; the multiplier is one of the map, or, at k = 0, the ratio of the
accelerations at the ends, which differentiating the integrals at their limits gives.

Arguments are float64 and taken as exact. Inside, angles are in phi0 and times in sqrt(phi0/mu).
"""

from dataclasses import dataclass

from mpmath import atan2, atanh, cos_sin, cosh, exp, expm1, fdot, log, log1p, mp, mpf, pi, quad, sinh, sqrt

DIGITS = 40
LIMIT = 5000


class NoCycle(ValueError):
    """There is no limit cycle, and why."""


@dataclass(frozen=True)
class Law:
    """x'' = -1 - (d v + rho sgn v + gamma |v|^n sgn v) - kappa x, and v -> e v at a switch."""

    d: mpf
    rho: mpf
    gamma: mpf
    n: mpf
    kappa: mpf
    e: mpf


@dataclass(frozen=True)
class HalfSwing:
    """Time, largest x and the speed at x = -1 of half a swing."""

    time: mpf
    amplitude: mpf
    speed: mpf


def cycle(mu, phi0, a=0, R=0, c=0, n=0, k=0, e=1, digits=None):
    """(period, amplitude, crossing speed, sensitivity, multiplier) of the limit cycle.

    To at least `digits` digits: 40, and 16 (in fact 25, in some ten seconds) where spring and power law act together.

    Raises
    ------
    NoCycle
        Nothing is lost, the drive never wins over dry friction, or the half swing from rest does not reach -phi0.
    """
    cell = (mu, phi0, a, R, c, n, k, e)
    method = _method(*cell)
    return cycle_by(cell, method, digits or (16 if method is Series else DIGITS))


def _method(mu, phi0, a, R, c, n, k, e):
    if c == 0 or n in (0, 1):
        return Flows
    return Integrals if k == 0 else Series


def law_of(mu, phi0, a, R, c, n, k, e):
    """The law without dimensions; a power-law drag of degree 0 or 1 is counted with R or a."""
    mu, phi0, a, R, c, n, k, e = (mpf(x) for x in (mu, phi0, a, R, c, n, k, e))
    if n in (0, 1):
        a, R, c = a + c * n, R + c * (1 - n), mpf(0)
    gamma = c * phi0 ** (n / 2) * mu ** (n / 2 - 1) if c else mpf(0)
    return Law(a * sqrt(phi0 / mu), R / mu, gamma, n, k * phi0 / mu, e)


def _refuse(law):
    if law.rho >= 1:
        raise NoCycle("dry friction is not less than the drive")
    if law.d == law.rho == law.gamma == 0 and law.e == 1:
        raise NoCycle("nothing is lost")


def _lost(*groups):
    """Digits that differences may cost where groups are far from 1."""
    return 10 + int(2 * sum(abs(log(abs(g), 10)) for g in groups if g))


def cycle_by(cell, method, digits):
    """The cycle by `Flows`, `Integrals` or `Series`."""
    mp_digits = mp.dps
    try:
        mp.dps = 60
        law = law_of(*cell)
        _refuse(law)
        spare = method.lost(law)
        mp.dps = 15 + spare
        rough = method.search(law_of(*cell))
        mp.dps = spare + method.working(law, rough, digits)
        law = law_of(*cell)
        v1, slope = _secant(method.miss(law), rough)
        swing = method.swing(law, v1)
        step = mpf(10) ** -(digits // 2 + 5) * (1 - law.rho)
        seconds = sqrt(mpf(cell[1]) / mpf(cell[0]))
        sides = [_period((mpf(cell[0]) * exp(h), *cell[1:]), method, v1, slope) for h in (step, -step)]
        s = log(sides[1] / sides[0]) / (2 * step)
        m = method.multiplier(law, v1, step)
        speed = method.speed(law, v1) * mpf(cell[1]) / seconds
        return 2 * swing.time * seconds, swing.amplitude * mpf(cell[1]), speed, s, m
    finally:
        mp.dps = mp_digits


def _period(cell, method, v1, slope):
    law = law_of(*cell)
    return 2 * method.swing(law, _chord(method.miss(law), v1, slope)).time * sqrt(mpf(cell[1]) / mpf(cell[0]))


def _bracketed(miss, low, high, at_low, at_high):
    """The root of a function that falls from at_low > 0 to at_high < 0, by Ridder's rule in ln x, to 9 digits."""
    last, near = low, mpf(10) ** -9
    for _ in range(LIMIT):
        middle = sqrt(low * high)
        at_middle = miss(middle)
        better = middle * (high / middle) ** (at_middle / sqrt(at_middle**2 - at_low * at_high))
        trials = [(middle, at_middle), (better, miss(better))]
        if abs(better / last - 1) < near**2:  # settled: certify it from both sides
            trials += [(x, miss(x)) for x in (better * (1 - near), better * (1 + near))]
        last = better
        for x, y in trials:
            if y == 0:
                return x
            if low < x < high:
                low, high, at_low, at_high = (x, high, y, at_high) if y > 0 else (low, x, at_low, y)
        if high - low < 4 * low * near:
            return (low + high) / 2
    raise AssertionError("no root")


def _secant(miss, x):
    """The root near x to all digits by secants, and the last slope."""
    other = x * (1 + mpf(10) ** -12)
    y, at_other = miss(x), miss(other)
    slope = mpf(-1)
    for _ in range(LIMIT):
        slope = (y - at_other) / (x - other) if y != at_other else slope
        x, other = x - y / slope, x
        if abs(x - other) < abs(x) * mpf(10) ** (-mp.dps / 2 - 3):  # the next step would be about its square
            return x, slope
        y, at_other = miss(x), y
    raise AssertionError("no root")


def _chord(miss, x, slope):
    """The root very near x, where the slope is known."""
    for _ in range(LIMIT):
        step = miss(x) / slope
        x -= step
        if abs(step) < abs(x) * mpf(10) ** (-mp.dps * 3 / 4):
            return x
    raise AssertionError("no root")


class _Mapped:
    """The search for v1 as the fixed point of a half swing; what Flows and Series share."""

    @staticmethod
    def lost(law):
        return _lost(law.d, law.kappa, 1 - law.rho, law.rho, law.gamma, 1 - law.e * abs(law.e))

    @classmethod
    def search(cls, law):
        """v1 of the cycle, roughly. The loss grows with the swing: it exists if the half swing from rest arrives."""
        low = cls.half_swing(law, mpf(0)).speed
        high, miss = 2 * low, cls.miss(law)
        at_low = miss(low)
        if at_low <= 0 or law.e == 0:
            return low
        while (at_high := miss(high)) > 0:
            low, at_low, high = high, at_high, 4 * high
        return _bracketed(miss, low, high, at_low, at_high)

    @classmethod
    def miss(cls, law):
        return lambda v: cls.half_swing(law, v).speed - v

    @classmethod
    def swing(cls, law, v1):
        return cls.half_swing(law, v1)

    @staticmethod
    def speed(law, v1):
        return v1

    @classmethod
    def multiplier(cls, law, v1, step):
        """Of the map; 0 where exp(-d time) is below any float64."""
        if law.d * cls.half_swing(law, v1).time > 800:
            return mpf(0)
        high, low = (cls.half_swing(law, v1 * (1 + h)).speed for h in (step, -step))
        return (high - low) / (2 * step * v1)


class Flows(_Mapped):
    """Linear pieces: v and x in closed form, with sigma^2 = kappa - d^2/4 of either sign."""

    @staticmethod
    def working(law, v1, digits):
        """Digits; more where the multiplier, about exp(-d time), is small, up to where a float64 holds it."""
        time = Flows.half_swing(law, v1).time
        return digits + 2 * (digits // 2 + 5) + 10 + int(min(law.d * time, 800) / 2)

    @staticmethod
    def half_swing(law, v1):
        """From x = 1 at speed e v1 to x = -1."""
        outward = law.e > 0 and v1 > 0
        if outward:
            pull = 1 + law.rho + law.kappa
            out = _turning(law.e * v1, pull, law)
            top = 1 + _forced(law, -pull, law.e * v1, out)[0]
            time, speed = _arrival(law, top + 1, 1 - law.rho + law.kappa * top, mpf(0))
            return HalfSwing(out + time, top, speed)
        time, speed = _arrival(law, mpf(2), 1 - law.rho + law.kappa, -law.e * v1)
        return HalfSwing(time, mpf(1), speed)


def _sinc(law, t):
    """exp(-d t/2) times cos(sigma t) and sin(sigma t)/sigma; without a spring by one exponential, as sigma = i d/2."""
    if law.d and not law.kappa:
        fall = -expm1(-law.d * t)
        return 1 - fall / 2, fall / law.d
    square, decay = law.kappa - law.d**2 / 4, exp(-law.d * t / 2)
    sigma = sqrt(abs(square))
    if sigma * t < mpf(10) ** -mp.dps:
        return decay, decay * t
    if square > 0:
        cosine, sine = cos_sin(sigma * t)
        return decay * cosine, decay * sine / sigma
    return decay * cosh(sigma * t), decay * sinh(sigma * t) / sigma


def _forced(law, force, v, t):
    """(distance, speed) after t from speed v, where the acceleration at the start but for d v is `force`."""
    c, s = _sinc(law, t)
    b, way = law.d / 2, t**2 / 2
    if law.kappa:
        way = (1 - c - b * s) / law.kappa
    elif law.d:
        way = (t - s) / law.d
    return force * way + v * s, v * c + (force - b * v) * s


def _turning(v, pull, law):
    """Time until the speed v is used up by the pull against it."""
    square, slope = law.kappa - law.d**2 / 4, pull + law.d * v / 2
    sigma = sqrt(abs(square))
    if sigma * v < slope * mpf(10) ** -mp.dps:
        return v / slope
    return atan2(sigma * v, slope) / sigma if square > 0 else atanh(sigma * v / slope) / sigma


def _stop(law, pull, v):
    """Time at which a motion that starts at speed v >= 0 along the pull comes to rest, None: never."""
    square, slope = law.kappa - law.d**2 / 4, pull - law.d * v / 2
    sigma = sqrt(abs(square))
    if square > 0:
        return (pi - atan2(sigma * v, slope)) / sigma
    if slope >= 0 or sigma * v >= -slope:
        return None
    return atanh(sigma * v / -slope) / sigma if sigma else v / -slope


def _arrival(law, distance, pull, v):
    """(time, speed) on arrival at a distance along the pull, from speed v >= 0 along it."""
    if pull <= 0 and v == 0:
        raise NoCycle("the spring holds it")
    stop = _stop(law, pull, v)
    if stop is not None and _forced(law, pull, v, stop)[0] <= distance:
        raise NoCycle("it turns before -phi0")
    if stop is None and law.kappa and pull / law.kappa <= distance:
        raise NoCycle("it creeps to a point before -phi0")
    low, high = mpf(0), stop
    t = 2 * distance / (v + sqrt(v**2 + 2 * abs(pull) * distance))
    for _ in range(LIMIT):
        if high is not None and not low < t < high:
            t = (low + high) / 2
        way, speed = _forced(law, pull, v, t)
        if way < distance:
            low = t
        else:
            high = t
        if high is None and speed * t < distance - way:
            t *= 2
            continue
        step = (distance - way) / speed if speed else mpf(0)
        if abs(step) < t * mpf(10) ** (5 - mp.dps) or (high is not None and high - low < t * mpf(10) ** (3 - mp.dps)):
            return t + step, _forced(law, pull, v, t + step)[1]
        t += step
    raise AssertionError("no arrival")


class Integrals:
    """No spring: the speed is the variable, v = V (1 - exp(-z)) with f(V) = 1 the speed that is never exceeded.

    What is searched for is z of v1, since 1 - f(v1), about exp(-z), may be below any number.
    """

    @staticmethod
    def lost(law):
        """Digits that the energy kept loses where friction is weak, and those of the slope where it is almost 1."""
        losses = (1 - law.e * abs(law.e), law.rho, law.d, law.gamma)
        return 10 - int(log(min(mpf(1), sum(losses)), 10)) - int(2 * log(1 - law.rho, 10))

    @staticmethod
    def working(law, z, digits):
        return digits + 2 * (digits // 2 + 5) + 5

    @staticmethod
    def speed(law, z):
        return _top_speed(law) * -expm1(-z)

    @classmethod
    def search(cls, law):
        """z of v1, roughly: the energy kept grows with z."""
        top, miss = _top_speed(law), cls.miss(law)
        z = mpf(1) if top <= 1 else -log1p(-1 / top)
        low = high = z
        factor = mpf(2)
        at_low = at_high = miss(z)
        while at_low <= 0:
            high, at_high, low, factor = low, at_low, low / factor, factor**2
            at_low = miss(low)
        factor = mpf(2)
        while at_high > 0:
            low, at_low, high, factor = high, at_high, high * factor, factor**2
            at_high = miss(high)
        return _bracketed(miss, low, high, at_low, at_high)

    @staticmethod
    def miss(law):
        top = _top_speed(law)
        return lambda z: 2 - _energy(law, top, z)

    @classmethod
    def swing(cls, law, z):
        top, v1 = _top_speed(law), cls.speed(law, z)
        if law.e > 0:
            top_x = 1 + _brake_integral(law, law.e * v1, lambda v: v)
            time = _drive_integral(law, top, z, lambda v: 1) + _brake_integral(law, law.e * v1, lambda v: 1)
            return HalfSwing(time, top_x, v1)
        start = -log1p(law.e * v1 / top)
        return HalfSwing(_drive_integral(law, top, z, lambda v: 1, start), mpf(1), v1)

    @classmethod
    def multiplier(cls, law, z, step):
        v1 = cls.speed(law, z)
        before = -_gain(law, _top_speed(law), z)
        v0 = law.e * v1
        return law.e**2 * -before / (1 + _loss(law, v0) if law.e > 0 else 1 - _loss(law, -v0))


def _loss(law, v):
    return law.rho + law.d * v + (law.gamma * v**law.n if law.gamma else 0)


def _top_speed(law):
    """V with f(V) = 1, by Newton from above, where f is convex or concave enough to be monotone in ln v."""
    left = 1 - law.rho
    guesses = [left / law.d] if law.d else []
    if law.gamma:
        guesses.append((left / law.gamma) ** (1 / law.n))
    v = min(guesses)
    for _ in range(LIMIT):  # f in ln v is convex: from above each step stays above
        drag = _loss(law, v) - law.rho
        slope = law.d * v + law.gamma * law.n * v**law.n
        step = (drag - left) / slope
        v *= exp(-step)
        if abs(step) < mpf(10) ** (5 - mp.dps):
            return v
    raise AssertionError("no terminal speed")


def _gain(law, top, z):
    """1 - f(V (1 - exp(-z)))."""
    w = exp(-z)
    power = -expm1(law.n * (log1p(-w) if z > 1 else log(-expm1(-z)))) if law.gamma and z else mpf(1)
    return law.d * top * w + (law.gamma * top**law.n * power if law.gamma else 0)


def _drive_integral(law, top, z, weight, start=0):
    """Integral of weight(v) dv/(1 - f) over v(z) from `start` to z."""

    flat = mp.dps * log(mpf(10)) + 10

    def slice_(z):
        w = exp(-z)
        return weight(-top * expm1(-z)) * top * w / _gain(law, top, z)

    marks = [*(m for m in (mpf(1), mpf(4), mpf(12), mpf(40), flat) if start < m < z), min(z, max(flat, start))]
    total = quad(slice_, [start, marks[0]])
    if len(marks) > 1:  # smooth here
        total += quad(slice_, marks, method="gauss-legendre")
    return total + (z - marks[-1]) * slice_(marks[-1]) if z > marks[-1] else total


def _brake_integral(law, v, weight):
    """Integral of weight(v) dv/(1 + f) from 0 to v."""
    return quad(lambda v: weight(v) / (1 + _loss(law, v)), [0, v])


def _energy(law, top, z):
    """Integral of v dv over the acceleration, from switch to switch: the way travelled, 2 in a cycle."""
    v0 = law.e * top * -expm1(-z)
    if law.e > 0:
        return _drive_integral(law, top, z, lambda v: v) - _brake_integral(law, v0, lambda v: v)
    return _drive_integral(law, top, z, lambda v: v, -log1p(v0 / top))


class Series(_Mapped):
    """Spring and power law together: Taylor series. From u = |v| follow u^n in time, and x, t in ln u near u = 0."""

    @staticmethod
    def working(law, v1, digits):
        return digits + 2 * (digits // 2 + 5) + 5

    @staticmethod
    def half_swing(law, v1):
        if law.e > 0 and v1 > 0:
            out, top = _series_in_speed(law, 1, mpf(1), law.e * v1, _tiny())
        else:
            out, top = mpf(0), mpf(1)
        u = -law.e * v1
        back = mpf(0)
        x = top
        if u <= 0:
            if 1 + law.kappa * x <= law.rho:
                raise NoCycle("the spring holds it")
            u = _small_speed(law)
            back, x = _series_in_speed(law, -1, top, _tiny(), u)
        time, speed = _series_in_time(law, x, u)
        return HalfSwing(out + back + time, top, speed)


def _tiny():
    return mpf(10) ** -mp.dps


def _small_speed(law):
    """A speed at which the drive still rules and the way from rest is short."""
    left = 1 - law.rho
    u = sqrt(left) / 2
    while _loss(law, u) - law.rho > left / 4:
        u /= 2
    return u


def _step_of(*series):
    """A step within which the last terms are below the last digit of the largest."""
    steps = []
    for p in series:
        largest = max(abs(p[0]), _tiny())
        steps += [(_tiny() * largest / abs(c)) ** (mpf(1) / k) for k, c in list(enumerate(p))[-2:] if c]
    return min(steps) if steps else mpf(1)


def _sum(p, h):
    total = mpf(0)
    for c in reversed(p):
        total = total * h + c
    return total


def _series_in_speed(law, side, x, u, u_end):
    """(time, x) when the speed has gone from u to u_end: dx/dtau = side u^2/D, dt/dtau = u/D, tau = ln u.

    D = -side (1 + kappa x) - f(u) is du/dt; side is +1 on the way out and -1 on the way back.
    """
    t, tau, end = mpf(0), log(u), log(u_end)
    order = int(mp.dps * 1.3) + 10
    for _ in range(LIMIT):
        u, power = exp(tau), law.gamma * exp(law.n * tau)
        xs, ts = [x], [t]
        fall, dt, dx = [], [], []  # D, u/D and side u^2/D
        us, ps, squares = u, power, u * u
        for k in range(order):
            fall.append(-side * (law.kappa * xs[k] + (1 if k == 0 else 0)) - (law.rho if k == 0 else 0))
            fall[k] -= law.d * us + ps
            earlier = fall[:0:-1]
            dt.append((us - fdot(earlier, dt)) / fall[0])
            dx.append((side * squares - fdot(earlier, dx)) / fall[0])
            ts.append(dt[k] / (k + 1))
            xs.append(dx[k] / (k + 1))
            us, ps, squares = us / (k + 1), ps * law.n / (k + 1), squares * 2 / (k + 1)
        h = _step_of(xs, [u, *dt[1:]])
        last = abs(end - tau) <= h
        h = end - tau if last else (h if end > tau else -h)
        x, t, tau = _sum(xs, h), _sum(ts, h), tau + h
        if last:
            return t, x
    raise AssertionError("too many steps")


def _series_in_time(law, x, u):
    """(time, speed) at x = -1 of the way back: x' = -u, u' = 1 + kappa x - f(u)."""
    t = mpf(0)
    order = int(mp.dps * 1.3) + 10
    for _ in range(LIMIT):
        xs, us, ps, rates = [x], [u], [law.gamma * u**law.n], [mpf(0)]
        for k in range(order):
            rate = law.kappa * xs[k] - law.d * us[k] - ps[k] + (1 - law.rho if k == 0 else 0)
            xs.append(-us[k] / (k + 1))
            us.append(rate / (k + 1))
            m = k + 1
            rates.append(us[m] * m)
            falls = [(m - j) * ps[m - j] for j in range(1, m + 1)]
            ps.append((law.n * fdot(rates[1:], ps[::-1]) - fdot(us[1:], falls)) / (m * u))
        h = _step_of(us, xs)
        h = min(h, *((u / abs(c)) ** (mpf(1) / i) / 3 for i, c in enumerate(us[1:], 1) if c))  # so that u > u/2 stays
        new_x, new_u = _sum(xs, h), _sum(us, h)
        if new_x <= -1:
            part = h * (x + 1) / (x - new_x)
            for _ in range(LIMIT):
                step = (_sum(xs, part) + 1) / _sum(us, part)
                part += step
                if abs(step) < abs(h) * mpf(10) ** (5 - mp.dps):
                    return t + part, _sum(us, part)
        if new_u < mpf(10) ** -12 or h < mpf(10) ** -12:
            raise NoCycle("it turns before -phi0")
        t, x, u = t + h, new_x, new_u
    raise NoCycle("it creeps to a point before -phi0")


def flips(mu, phi0, phi_start, count, a=0, R=0, k=0, e=1, digits=DIGITS):
    """(times, speeds) of the first `count` switches from rest at phi_start < phi0; fewer where the motion ends.

    Drive is +mu until phi rises through +phi0; speeds are those just before each switch.
    """
    mp_digits = mp.dps
    try:
        mp.dps = 60
        cell = (mu, phi0, a, R, 0, 0, k, e)
        law = law_of(*cell)
        spare = _lost(law.d, law.kappa, 1 - law.rho, law.rho)
        mp.dps = digits + spare + count
        law = law_of(*cell)
        seconds, start = sqrt(mpf(phi0) / mpf(mu)), -mpf(phi_start) / mpf(phi0)
        times, speeds, t, v = [], [], mpf(0), None
        while len(times) < count:
            try:
                if v is None:
                    lasted, v = _arrival(law, start + 1, 1 - law.rho + law.kappa * start, mpf(0))
                else:
                    swing = Flows.half_swing(law, v)
                    lasted, v = swing.time, swing.speed
            except NoCycle:
                break
            t += lasted
            times.append(t * seconds)
            speeds.append(v * mpf(phi0) / seconds)
        return times, speeds
    finally:
        mp.dps = mp_digits
