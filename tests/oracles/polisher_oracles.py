"""Truth about the linkage of a polishing machine in 50 digits, by mpmath; imports nothing of ours.

Arguments are float64 and taken as exact. The arm's end is where two circles meet; nothing else is used of a linkage.
"""

from fractions import Fraction

from mpmath import acos, atan2, cos, exp, mp, mpf, pi, quad, sin, sqrt

DIGITS = 50


def arm(b, d, f, e, side, theta):
    """alpha from b: of the two points at d from the pivot and at f from the crank pin, that on `side` of the line."""
    px, py = b + e * cos(theta), e * sin(theta)
    p2 = px * px + py * py
    along = (p2 + d * d - f * f) / (2 * p2)
    high = d * d - along * along * p2
    if high < 0:
        return None
    across = sqrt(high / p2)
    x, y = along * px - side * across * py, along * py + side * across * px
    return atan2(y, x)


def motion(b, d, f, e, side, theta):
    """alpha from b, and its first two derivatives by theta, by differences over 1e-20; None where it is locked."""
    with mp.workdps(120):
        b, d, f, e, theta = map(mpf, (b, d, f, e, theta))
        h = mpf(10) ** -30
        points = [arm(b, d, f, e, side, theta + k * h) for k in (-1, 0, 1)]
        if None in points:
            return None
        low, middle, high = (middle_turn(p, points[1]) for p in points)
        return middle, (high - low) / (2 * h), (high - 2 * middle + low) / (h * h)


def middle_turn(angle, near):
    """The same direction within half a turn of `near`."""
    while angle - near > pi:
        angle -= 2 * pi
    while near - angle > pi:
        angle += 2 * pi
    return angle


def rate(b, d, f, e, side, theta):
    """alpha' as e x f over d x f, of the vectors crank, coupler and arm."""
    alpha = arm(b, d, f, e, side, theta)
    ex, ey, dx, dy = e * cos(theta), e * sin(theta), d * cos(alpha), d * sin(alpha)
    fx, fy = b + ex - dx, ey - dy
    return (ex * fy - ey * fx) / (dx * fy - dy * fx)


def distortion(b, d, f, e):
    """thd of the arm of type A: root of the mean square of alpha without mean and first harmonic, over the first."""
    with mp.workdps(DIGITS):
        b, d, f, e = map(mpf, (b, d, f, e))

        def mean(function):
            return quad(lambda t: function(arm(b, d, f, e, 1, t), t), [-pi, 0, pi]) / (2 * pi)

        middle = mean(lambda a, t: a)
        even, odd = 2 * mean(lambda a, t: a * cos(t)), 2 * mean(lambda a, t: a * sin(t))
        rest = mean(lambda a, t: (a - middle - even * cos(t) - odd * sin(t)) ** 2)
        return sqrt(2 * rest) / sqrt(even**2 + odd**2)


def fastest(b, d, f, e, sign, n=300):
    """The largest sign alpha' over a turn of type A: best of a scan, dense next to 0 and pi, then golden section."""
    with mp.workdps(40):
        b, d, f, e = map(mpf, (b, d, f, e))

        def height(u, half):
            return sign * rate(b, d, f, e, 1, half * pi / (1 + exp(-u)))

        grid = [mpf(60) * k / n - 30 for k in range(n + 1)]
        _, u, half = max((height(u, half), u, half) for u in grid for half in (-1, 1))
        low, high, ratio = u - mpf(60) / n, u + mpf(60) / n, (sqrt(5) - 1) / 2
        while high - low > mpf(10) ** -12:
            first, second = high - ratio * (high - low), low + ratio * (high - low)
            if height(first, half) > height(second, half):
                high = second
            else:
                low = first
        return height((low + high) / 2, half)


def closed(b, d, f, e):
    """Closed outputs for type A by name, from the cosine rule; derivatives are those of the cosine rule."""
    with mp.workdps(DIGITS):
        b, d, f, e = map(mpf, (b, d, f, e))

        def between(x, y, z):
            return acos((x * x + y * y - z * z) / (2 * x * y))

        def slopes(c):
            angle = between(b, d, c)
            by_c = c / (b * d * sin(angle))
            return -by_c * cos(between(b, c, d)), -by_c * cos(between(d, c, b)), by_c

        plus, minus = between(b, d, f + e), between(b, d, f - e)
        far, near = slopes(f + e), slopes(f - e)
        mean, half = ([(x + sign * y) / 2 for x, y in zip(far, near, strict=True)] for sign in (1, -1))
        return {
            "A0": (plus + minus) / 2, "A1": (plus - minus) / 2, "eta_plus": plus, "eta_minus": minus,
            "theta_plus": pi - between(b, f + e, d), "theta_minus": -between(b, f - e, d),
            "transmission_angle": min(between(d, f, b - e), pi - between(d, f, b + e)),
            "A0_b": mean[0], "A0_d": mean[1], "A0_f": mean[2], "A0_e": half[2],
            "A1_b": half[0], "A1_d": half[1], "A1_f": half[2], "A1_e": mean[2],
        }  # fmt: skip


def verdict(b, d, f, e):
    """What the exact lengths are: the shortest link's sum with the longest against the other two (Grashof)."""
    b, d, f, e = map(Fraction, (b, d, f, e))
    short, middle, more, long = sorted((b, d, f, e))
    if long > short + middle + more:
        return "NO_ASSEMBLY"
    if short + long > middle + more:
        return "LOCK_UP"
    if short + long == middle + more:
        return "CHANGE_POINT" if short in (b, e) else "LOCK_UP"
    return "OK" if e == short else "DOUBLE_CRANK" if b == short else "LOCK_UP"


def locks(b, d, f, e):
    """Crank angles at which the linkage lies stretched (towards 0) or folded (towards pi); None where it does not."""
    with mp.workdps(DIGITS):
        b, d, f, e = map(mpf, (b, d, f, e))
        stretched, folded = (((d + s * f) ** 2 - b * b - e * e) / (2 * b * e) for s in (1, -1))
        return acos(stretched) if stretched < 1 else None, acos(folded) if folded > -1 else None
