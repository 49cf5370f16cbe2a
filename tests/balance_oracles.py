"""Truth about the balance with solid friction in 50 digits and more, by mpmath; imports nothing of ours.

Arguments are float64 and taken as exact. Angles in rad; r and the like are torques over the hairspring's stiffness.
"""

from mpmath import ceil, cos, coth, exp, log, log1p, mp, mpf, pi, sin, sqrt, tanh

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
