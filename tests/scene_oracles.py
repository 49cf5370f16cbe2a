"""Motions from switch to switch in 50 digits, by closed forms; imports nothing of ours."""

from mpmath import atanh, cosh, log, mp, mpf, re, sqrt, tanh


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
