"""Truth about the balance with solid friction in 50 digits and more, by mpmath; imports nothing of ours.

Arguments are float64 and taken as exact. Angles in rad; r and the like are torques over the hairspring's stiffness.
"""

from mpmath import atan2, atanh, ceil, cos, cosh, coth, exp, inf, log, log1p, mp, mpf, pi, sin, sinh, sqrt, tanh

DIGITS = 120
"""Half swings are counted up to 1e30 by formulas that lose two digits for each of theirs."""


def turning_point(zeta, r, theta0, k):
    """abs(theta) at the k-th turning point, were nothing to hold the balance there."""
    with mp.workdps(DIGITS + (int(-log(mpf(zeta), 10)) if zeta > 0 else 0)):  # coth is large, 1 - share small
        zeta, r, a, k = mpf(zeta), mpf(r), abs(mpf(theta0)), int(k)
        if zeta == 0:
            return a - 2 * k * r
        delta = pi * zeta / sqrt(1 - zeta * zeta)
        share = exp(-k * delta)
        return a * share - r * coth(delta / 2) * (1 - share)


def half_swings(zeta, r, r_s, theta0):
    """Half swings until the first turning point within r_s of the spring's zero, for 0 <= zeta < 1.

    By counting up to 100; beyond that by the formula, moved until the points on both sides confirm it.
    """
    with mp.workdps(DIGITS):
        zeta, r, r_s, a = mpf(zeta), mpf(r), mpf(r_s), abs(mpf(theta0))
        if zeta == 0:
            return max(0, int(ceil((a - r_s) / (2 * r))))
        share = exp(-pi * zeta / sqrt(1 - zeta * zeta))
        for k in range(100):
            if a <= r_s:
                return k
            a = share * a - r * (1 + share)
        a = abs(mpf(theta0))
        delta = pi * zeta / sqrt(1 - zeta * zeta)
        k = int(ceil(log1p((a - r_s) / (r_s + r / tanh(delta / 2))) / delta))
        while turning_point(zeta, r, a, k) > r_s:
            k += 1
        while turning_point(zeta, r, a, k - 1) <= r_s:
            k -= 1
        return k


def balance(zeta, omega_n, r, r_s, theta0):
    """(half_swings, stop_angle, stop_time, margin, period) of a balance released from rest at theta0, zeta < 1."""
    n = half_swings(zeta, r, r_s, theta0)
    with mp.workdps(DIGITS):
        side = (1 if theta0 >= 0 else -1) * (-1) ** n
        half = pi / (mpf(omega_n) * sqrt(1 - mpf(zeta) ** 2))
        last = turning_point(zeta, r, theta0, n)
        margin = (mpf(r_s) - last) / mpf(r_s)
        if n:
            margin = min(margin, (turning_point(zeta, r, theta0, n - 1) - mpf(r_s)) / mpf(r_s))
        return mpf(n), side * last, n * half, margin, 2 * half


def swing_followed(zeta, r, theta0, share):
    """(angle, speed/omega_n) at a share of the first half swing: th'' + 2 zeta th' + th = r from rest at theta0 > r."""
    with mp.workdps(DIGITS):
        zeta, r, theta0 = mpf(zeta), mpf(r), mpf(theta0)
        s = sqrt(1 - zeta * zeta)
        t = mpf(share) * pi / s
        fade = (theta0 - r) * exp(-zeta * t)
        return r + fade * (cos(s * t) + zeta / s * sin(s * t)), -fade * sin(s * t) / s


def driven(zeta, omega_n, r, w, m, beta, digits=40):
    """(amplitude, period, multiplier) of the driven balance's cycle, or None where there is none.

    The cycle is where the speed after the drive, followed forward from rest at a, is the speed that a rise to -a needs,
    followed backward from rest there. The multiplier is the slope of the map, by a difference.
    """
    with mp.workdps(digits + 20):
        scene = tuple(map(mpf, (zeta, r, w, m, beta)))
        a = _cycle(*scene)
        if a is None:
            return None
        before, after = _given(*scene, a)[1], _needed(*scene, a)[1]
        step = a * mpf(10) ** -(digits // 2 + 5)
        slope_given = (_given(*scene, a + step)[0] - _given(*scene, a - step)[0]) / (2 * step)
        slope_need = (_needed(*scene, a + step)[0] - _needed(*scene, a - step)[0]) / (2 * step)
        return a, 2 * (before + after) / mpf(omega_n), slope_given / slope_need


def _flow(zeta, y, v, t):
    """Angle and speed after t (of either sign) of y'' + 2 zeta y' + y = 0."""
    square = zeta * zeta - 1
    root = sqrt(abs(square))
    if square == 0:
        c, s = mpf(1), t
    elif square < 0:
        c, s = cos(root * t), sin(root * t) / root
    else:
        c, s = cosh(root * t), sinh(root * t) / root
    fade = exp(-zeta * t)
    return fade * (y * (c + zeta * s) + v * s), fade * (v * (c - zeta * s) - y * s)


def _reversal(zeta, y, v):
    """Time after which a motion towards smaller y turns; inf where it never does, 0 where it does not set out."""
    square = 1 - zeta * zeta
    if v == 0:
        return mpf(0) if y <= 0 else pi / sqrt(square) if square > 0 else inf
    if square > 0:
        return atan2(-sqrt(square) * v, -(zeta * v + y)) / sqrt(square)
    ratio = v / (zeta * v + y) if zeta * v + y else inf
    if ratio <= 0 or ratio * sqrt(-square) >= 1:
        return inf
    return ratio if square == 0 else atanh(sqrt(-square) * ratio) / sqrt(-square)


def _crossing(follow, goal, high):
    """Time in (0, high) at which an angle that falls meets `goal`, or None: Newton, bisection where that is slow."""
    if high == inf:
        high = mpf(1)
        while follow(high)[0] > goal:
            high *= 4
            if high > 10**9:
                return None
    elif follow(high)[0] > goal:
        return None
    low, t, last = mpf(0), high / 2, high
    for _ in range(500):
        y, v = follow(t)
        low, high = (t, high) if y > goal else (low, t)
        new = t - (y - goal) / v if v else high
        if not low < new < high or abs(new - t) > last / 2:
            new = (low + high) / 2
        last = abs(new - t)
        t = new
        if last <= t * mpf(10) ** (-mp.dps // 2 - 3):
            break
    for _ in range(2):  # each squares the error
        y, v = follow(t)
        t -= (y - goal) / v if v else 0
    return t


def _given(zeta, r, w, m, beta, a):
    """v^2/2 with which leg 3 begins, from rest at a, and the time until then; None where it does not come so far."""
    t1 = _crossing(lambda t: _flow(zeta, a - r, mpf(0), t), beta - r, _reversal(zeta, a - r, mpf(0)))
    if t1 is None:
        return None
    v = _flow(zeta, a - r, mpf(0), t1)[1]
    if beta == 0:
        return v * v / 2 + w, t1
    y = beta - r + m
    t2 = _crossing(lambda t: _flow(zeta, y, v, t), y - 2 * beta, _reversal(zeta, y, v))
    return None if t2 is None else (_flow(zeta, y, v, t2)[1] ** 2 / 2, t1 + t2)


def _needed(zeta, r, w, m, beta, a):
    """v^2/2 needed at -beta to rise to -a, and the time of that, backward from rest there."""

    def back(t):
        y, v = _flow(zeta, a + r, mpf(0), -t)
        return y, -v

    high = mpf(1) / 4
    while back(high)[0] > beta + r:
        high *= mpf(3) / 2
    t3 = _crossing(back, beta + r, high)
    return back(t3)[1] ** 2 / 2, t3


def _cycle(zeta, r, w, m, beta):
    """The amplitude at which what is given is what is needed: it is more below, less above. Newton within a bracket.

    Rates of both with a: exp(2 zeta t3)(a + r) of what is needed, exp(-2 zeta (t1 + t2))(a - r) of what is given.
    """
    low, high = max(beta, r), None  # less never comes to the lift
    work = w + 2 * m * beta
    a = max(2 * work / (2 * r + sqrt(4 * r * r + 4 * pi * zeta * work)), low * (1 + mpf(10) ** -9))
    for _ in range(400):
        given = _given(zeta, r, w, m, beta, a)
        if given is None:
            low = a
            a = 2 * a if high is None else (low + high) / 2
        else:
            need, t3 = _needed(zeta, r, w, m, beta, a)
            surplus = given[0] - need
            low, high = (a, high) if surplus > 0 else (low, a)
            new = a + surplus / (exp(2 * zeta * t3) * (a + r) - exp(-2 * zeta * given[1]) * (a - r))
            if abs(new - a) <= a * mpf(10) ** (-mp.dps // 2 - 3):
                return new
            inside = new > low and (high is None or new < high)
            a = new if inside else 2 * a if high is None else (low + high) / 2
        if a > mpf(10) ** 60 * (low + sqrt(work)) or (high is not None and high - low <= high * mpf(10) ** -40):
            return None
    return None
