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


def one_impact_a_period(zeta, w, e, speed, periods=1):
    """A cycle of x'' = cos(w t) - x - 2 zeta x' that meets a stop, where v becomes -e v, once in `periods`, at a speed.

    Place of the stop; place and speed at t = 0, and their largest sizes on a grid; the multiplier of largest modulus.
    None where the motion passes the stop elsewhere, or where one that does not meet it is a cycle too. Between impacts
    it is the swing of the drive and one that decays, which the impact brings back to what it was.
    """
    with mp.workdps(50):
        zeta, w, e, speed = (mpf(float(x)) for x in (zeta, w, e, speed))
        period, swing = 2 * mp.pi * periods / w, 1 / mp.mpc(1 - w * w, 2 * zeta * w)

        def decayed(t):
            return mp.expm(mp.matrix([[0, 1], [-1, -2 * zeta]]) * t)

        behind = mp.lu_solve(decayed(period) - mp.eye(2), mp.matrix([0, (1 + e) * speed]))
        sine = (behind[1] + e * speed) / (w * abs(swing))
        if abs(sine) >= 1:
            return None
        phase = mp.asin(sine) - mp.arg(swing)
        stop = behind[0] + abs(swing) * sqrt(1 - sine * sine)
        left = period - (phase / w) % period

        def place_and_speed(since):
            turned = swing * mp.expj(w * since + phase)
            own = decayed(since) * behind
            return re(turned) + own[0], re(mp.j * w * turned) + own[1]

        way = [place_and_speed(period * mpf(k) / 64) for k in range(65)]
        force = mp.cos(phase) - stop
        if max(*(x for x, _ in way[1:-1]), stop + force + 2 * zeta * e * speed) > stop or stop >= abs(swing):
            return None
        bent = ((1 + e) * force) / speed
        J = decayed(left) * mp.matrix([[-e, 0], [bent, -e]]) * decayed(period - left)
        half, product = (J[0, 0] + J[1, 1]) / 2, e * e * mp.exp(-2 * zeta * period)
        root = mp.sqrt(mp.mpc(half * half - product))
        multiplier = abs(half + root) if root.imag else half + mp.sign(half) * re(root)
        sizes = (max(abs(one[k]) for one in way) for k in (0, 1))
        return stop, *place_and_speed(left), *sizes, multiplier
