"""Truth about the linkage of a polishing machine in 50 digits, by mpmath; imports nothing of ours.

Arguments are float64 and taken as exact. The arm's end is where two circles meet; nothing else is used of a linkage.
"""

from mpmath import atan2, cos, mp, mpf, pi, sin, sqrt

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
