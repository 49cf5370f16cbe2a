"""Truth about the foliot whose torque varies over the swing, by mpmath; imports nothing of ours.

In units of phi0 and sqrt(phi0/mu), x = phi/phi0, s = (1 - x)/2, tau(s) = 1 + depth cos(harmonic pi s).

Without viscous or power-law friction the speed at every x follows from energy: from the turning point A inwards
    v^2/2 = (1 - rho)(A - x) + kappa (A^2 - x^2)/2 + W(x, A),  W = 2 depth/(harmonic pi) [sin(harmonic pi s)] over A..x
and outwards with + rho; the cycle is an energy balance and half the period the integral of dx/v. With more friction
the half swing is followed by Taylor series in time, and the turning point and the switch are roots of these.
Sensitivities are differences of solved cycles at high precision.
"""

from mpmath import cos, fdot, findroot, mp, mpf, pi, quad, sin, sqrt

DIGITS = 22


class NoCycle(ValueError):
    """The motion comes to rest before the switch."""


def by_energy(mu, phi0, R=0, k=0, e=1, depth=0, harmonic=1):
    """(period, amplitude, crossing speed, sensitivity, multiplier) of dry friction, spring and restitution."""
    with mp.workdps(40):
        cell = [mpf(value) for value in (mu, phi0, R, k, e, depth, harmonic)]
        period, amplitude, speed, multiplier = _energy_cycle(*cell)
        step = mpf(10) ** -11
        low, high = (_energy_cycle(cell[0] * (1 + h), *cell[1:])[0] for h in (-step, step))
        return period, amplitude, speed, -(high - low) / (2 * step * period), multiplier


def _energy_cycle(mu, phi0, R, k, e, depth, harmonic):
    rho, kappa = R / mu, k * phi0 / mu

    def work(x):  # of torque and spring from x inwards to 0, but for a constant
        return x + kappa * x**2 / 2 - 2 * depth / (harmonic * pi) * sin(harmonic * pi * (1 - x) / 2)

    def outwards(top):  # v^2/2 at x = 1 that leads to the turning point
        return work(top) - work(mpf(1)) + rho * (top - 1)

    def inwards(x, top):
        return work(top) - work(x) - rho * (top - x)

    if e > 0:
        top = _root(lambda top: inwards(mpf(-1), top) * e**2 - outwards(top))
        rise = _time(lambda x: outwards(top) - outwards(x), mpf(1), top)
    else:
        top, rise = mpf(1), mpf(0)
    start = e**2 * 2 * (1 - rho) / (1 - e**2) if e <= 0 else mpf(0)
    points = [top + (mpf(-1) - top) * j / 200 for j in range(1, 201)]
    if any(inwards(x, top) + start <= 0 for x in points):
        raise NoCycle
    half = rise + _time(lambda x: inwards(x, top) + start, mpf(-1), top)
    speed = sqrt(2 * (inwards(mpf(-1), top) + start))
    pull = 1 + depth * cos(harmonic * pi * (1 - top) / 2) + kappa * top
    if e > 0 and pull <= rho:
        raise NoCycle
    multiplier = e**2 * ((pull - rho) / (pull + rho) if e > 0 else 1)
    return 2 * half * sqrt(phi0 / mu), top * phi0, speed * sqrt(phi0 * mu), multiplier


def _time(energy, low, top):
    """Time from low to the turning point, or to x = 1: with x = top - (top - low) u^2 the root there is gone.

    Panels become shorter towards low, behind which another root may lie.
    """

    def rate(u):
        return 2 * u * (top - low) / sqrt(2 * energy(top - (top - low) * u**2))

    return quad(rate, [*(1 - mpf(j) ** 6 for j in mp.linspace(1, 0, 13))], method="gauss-legendre")


def _root(function):
    low, high = mpf(1), mpf(2)
    while function(high) > 0:
        high *= 2
    return findroot(function, (low, high), solver="anderson", tol=mpf(10) ** -70, maxsteps=400)


def by_taylor(mu, phi0, a=0, R=0, c=0, k=0, e=1, depth=0, harmonic=1):
    """(period, amplitude, crossing speed, sensitivity, multiplier) with drag c v^2, where the motion does not stick."""
    with mp.workdps(DIGITS + 10):
        cell = [mpf(value) for value in (mu, phi0, a, R, c, k, e, depth, harmonic)]
        speed = _settle(cell, sqrt(cell[0] * cell[1]))
        end, half, top = _half_swing(cell, speed)
        step = mpf(10) ** -8
        low, high = (_settled_half([cell[0] * (1 + h), *cell[1:]], speed) for h in (-step, step))
        slow, fast = (_half_swing(cell, speed * (1 + h))[0] for h in (-step, step))
        return 2 * half, top, end, -(high - low) / (2 * step * half), (fast - slow) / (2 * step * speed)


def _settled_half(cell, near):
    return _half_swing(cell, _settle(cell, near))[1]


def _settle(cell, near):
    return findroot(lambda v: _half_swing(cell, v)[0] - v, (near, near * mpf("1.01")), tol=mpf(10) ** (-2 * DIGITS))


def _half_swing(cell, speed):
    """Speed at the switch, time and turning point of the half swing behind a switch that was met at `speed`."""
    phi0, e = cell[1], cell[6]
    up, (top, _) = _follow(cell, 1, phi0, e * speed, lambda x, v: v) if e > 0 else (0, (phi0, e * speed))
    start = mpf(0) if e > 0 else e * speed
    down, (_, end) = _follow(cell, -1, top, start, lambda x, v: x + phi0)
    return -end, up + down, top


def _follow(cell, sign, x, v, event):
    """Time and state at which `event`, a position or a speed, has fallen to 0, by Taylor series of order DIGITS."""
    t = mpf(0)
    while True:
        xs, vs = _series(cell, sign, x, v)
        h = min(
            (mpf(10) ** -DIGITS / max(abs(series[-1]), mpf(10) ** -DIGITS)) ** (mpf(1) / DIGITS) for series in (xs, vs)
        )

        def at(h, xs=xs, vs=vs):
            return fdot(xs, _powers(h)), fdot(vs, _powers(h))

        if event(*at(h)) <= 0:
            h = findroot(lambda h: event(*at(h)), (mpf(0), h), solver="anderson", tol=mpf(10) ** (-2 * DIGITS))
            return t + h, at(h)
        t, (x, v) = t + h, at(h)


def _powers(h):
    """1, h, h^2 ... h^DIGITS."""
    return [h**j for j in range(DIGITS + 1)]


def _series(cell, sign, x, v):
    """Taylor coefficients of position and speed; sign of the speed as told."""
    mu, phi0, a, R, c, k, _, depth, harmonic = cell
    wave = harmonic * pi / 2
    xs, vs, squares = [x], [v], []
    cosines, sines = [cos(wave * (1 - x / phi0))], [sin(wave * (1 - x / phi0))]
    for j in range(DIGITS):
        squares.append(sum(vs[i] * vs[j - i] for i in range(j + 1)))
        steady = mu + sign * R if j == 0 else 0
        force = steady + mu * depth * cosines[j] + a * vs[j] + sign * c * squares[j] + k * xs[j]
        turn = [-wave / phi0 * vs[j - i] for i in range(j + 1)]
        cosines.append(-sum(sines[i] * turn[i] for i in range(j + 1)) / (j + 1))
        sines.append(sum(cosines[i] * turn[i] for i in range(j + 1)) / (j + 1))
        xs.append(vs[j] / (j + 1))
        vs.append(-force / (j + 1))
    return xs, vs
