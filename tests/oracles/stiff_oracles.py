"""Foliots whose drive lags behind its switch, and balls that come to rest, to 50 digits; imports nothing of ours."""

from mpmath import exp, expm1, findroot, mp, mpf


def lagging_foliot(mu, a, eps, flips):
    """Time, angle, speed and force at the last of so many switches of a foliot from rest.

    angle'' = force - a angle',  force' = (side mu - force)/eps; switches at side angle = 1. Both equations are linear.
    """
    mu, a, eps = mpf(mu), mpf(a), mpf(eps)
    time, angle, speed, force, side = mpf(0), mpf(0), mpf(0), mpf(0), 1
    for _ in range(flips):
        rest = side * mu
        part = (force - rest) / (a - 1 / eps)  # of the speed that the lag makes: part (exp(-t/eps) - exp(-a t))

        def speed_at(t, v=speed, rest=rest, part=part):
            return v * exp(-a * t) - rest * expm1(-a * t) / a + part * (exp(-t / eps) - exp(-a * t))

        def angle_at(t, u=angle, v=speed, rest=rest, part=part):
            by_rest = rest * (t + expm1(-a * t) / a) / a
            by_lag = part * (-eps * expm1(-t / eps) + expm1(-a * t) / a)
            return u - v * expm1(-a * t) / a + by_rest + by_lag

        t = _crossing(lambda t, s=side: 1 - s * angle_at(t), mp.sqrt(2 / mu) / 64)
        time, angle, speed = time + t, angle_at(t), speed_at(t)
        force, side = rest + (force - rest) * exp(-t / eps), -side
    return time, angle, speed, force


def _crossing(height, step):
    """Where `height` first falls through 0, by steps in which it does not turn twice."""
    low, high = mpf(0), step
    while height(high) > 0:
        low, high = high, high + step
    return findroot(height, (low, high), solver="anderson", tol=mpf(10) ** (-2 * mp.dps + 10))
