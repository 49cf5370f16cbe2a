"""Motions from switch to switch in 50 digits, by closed forms; imports nothing of ours."""

from mpmath import atanh, cosh, log, mp, mpf, quad, re, sqrt, tanh


def _leg(v0, force, a, c):
    """v(t), x(t) - x(0) for v' = force - a v - c v^2, by w = v + a/(2c), w' = D - c w^2, D = force + a^2/(4c)."""
    shift, k = a / (2 * c), sqrt(mp.mpc((force + a * a / (4 * c)) * c))
    phase = atanh(c * (v0 + shift) / k)

    def speed(t):
        return re(k / c * tanh(k * t + phase)) - shift

    def way(t):
        return re(log(cosh(k * t + phase) / cosh(phase)) / c) - shift * t

    return speed, way, k, phase, shift


def _reached(way, speed, to_go, t):
    """When the way, convex as the motion speeds up, comes to `to_go`: Newton from behind it."""
    while way(t) < to_go:
        t *= 2
    for _ in range(500):
        step = (way(t) - to_go) / speed(t)
        t -= step
        if abs(step) < t * mpf(10) ** (10 - mp.dps):
            return t
    raise AssertionError("no root")


def quadratic_foliot(mu, phi0, a, c, flips, digits=40):
    """Time of the last of `flips` switches from rest at 0, and the speed before it: v' = +-mu - a v - c v abs(v)."""
    with mp.workdps(digits):
        mu, phi0, a, c = (mpf(float(x)) for x in (mu, phi0, a, c))
        time, speed, x = mpf(0), mpf(0), mpf(0)
        for flip in range(flips):
            if flip:  # outwards: braked by drag and drive until it turns
                _, way, k, phase, shift = _leg(speed, -mu, a, c)
                turn = re((atanh(c * shift / k) - phase) / k)
                if turn < 0:
                    turn += re(mp.pi * mp.j / k)
                time, x = time + turn, phi0 + way(turn)
            to_go = x + phi0 if flip else phi0
            v, way, k, *_ = _leg(mpf(0), mu, a, c)
            t = _reached(way, v, to_go, sqrt(2 * to_go / mu))
            time, speed = time + t, v(t)
        return time, speed


def _swept(force, a, c, n, v):
    """Time and way from rest to the speed v, or from it to rest, with v' = +-(force - a v - c v^n): two integrals."""
    ends = [v * mpf(2) ** -k for k in (12, 4, 0)]  # the integrand bends like v^n at 0

    def over(numerator):
        return quad(lambda x: numerator(x) / (force - a * x - c * x**n), [0, *ends])

    return over(lambda x: mpf(1)), over(lambda x: x)


def power_foliot(mu, phi0, a, c, n, flips, digits=24):
    """As `quadratic_foliot` with a general power: v' = +-mu - a v - c abs(v)^n sgn v."""
    with mp.workdps(digits):
        mu, phi0, a, c, n = (mpf(float(x)) for x in (mu, phi0, a, c, n))
        time, speed, to_go = mpf(0), mpf(0), phi0
        for flip in range(flips):
            if flip:
                turn, way = _swept(-mu, a, c, n, speed)
                time, to_go = time - turn, 2 * phi0 - way
            free = sqrt(2 * mu * to_go)
            speed = _arrives(mu, a, c, n, to_go, _never_reached(lambda v: mu - a * v - c * v**n, free))
            time += _swept(mu, a, c, n, speed)[0]
        return time, speed


def _never_reached(force, most):
    """The speed at which no force is left, or `most` if that is less."""
    low = mpf(0)
    for _ in range(mp.prec + 10 if force(most) < 0 else 0):
        middle = (low + most) / 2
        low, most = (middle, most) if force(middle) > 0 else (low, middle)
    return most


def _arrives(mu, a, c, n, to_go, most):
    """The speed at which the way from rest is `to_go`: Newton within a bracket, below the speed never reached."""
    low, high, v = mpf(0), most, most * mpf("0.7")
    for _ in range(200):
        excess = _swept(mu, a, c, n, v)[1] - to_go
        low, high = (low, v) if excess > 0 else (v, high)
        new = v - excess * (mu - a * v - c * v**n) / v
        if abs(new - v) < v * mpf(10) ** (6 - mp.dps):
            return new
        v = new if low < new < high else (low + high) / 2
    raise AssertionError("no root")
