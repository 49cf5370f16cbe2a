"""Motions from switch to switch in 50 digits, by closed forms; imports nothing of ours."""

from mpmath import atanh, cosh, findroot, log, mp, mpf, re, sqrt, tanh


def _leg(v0, force, a, c):
    """v(t), x(t) - x(0) for v' = force - a v - c v^2, by w = v + a/(2c), w' = D - c w^2, D = force + a^2/(4c)."""
    shift, k = a / (2 * c), sqrt(mp.mpc((force + a * a / (4 * c)) * c))
    phase = atanh(c * (v0 + shift) / k)

    def speed(t):
        return re(k / c * tanh(k * t + phase)) - shift

    def way(t):
        return re(log(cosh(k * t + phase) / cosh(phase)) / c) - shift * t

    return speed, way, k, phase, shift


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
            guess = sqrt(2 * to_go / mu) * (1 + a * sqrt(to_go / mu) / 3) + c * to_go / abs(k) / 2
            t = findroot(lambda t, way=way, to_go=to_go: way(t) - to_go, guess)
            assert abs(way(t) - to_go) < mpf(10) ** (6 - digits) * to_go
            time, speed = time + t, v(t)
        return time, speed
