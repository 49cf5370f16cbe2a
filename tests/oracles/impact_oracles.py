"""Truth about impact clocks in 50 digits, by mpmath; imports nothing of ours.

Arguments are float64 in SI units and taken as exact. Nothing is taken from a formula of the cycle: both bodies are
followed from impact to impact, the cycle is the fixed point of that map by Newton's method, multipliers are eigenvalues
of its derivative by differences, and every passage of a tooth through a pallet is looked for.
"""

from mpmath import ceil, floor, lu_solve, matrix, mp, mpc, mpf, pi, sqrt

DIGITS = 120


def tiny():
    """Steps of differences, relative to the state: their error is its square."""
    return mpf(10) ** -(mp.dps // 4)


class Clock:
    """Masses at the rim and at the pallets, force, pitch, escape height, restitution, and a lever still flat."""

    def __init__(self, torque, I_c, I_v, r_c, r_v, teeth, h, e, nu=0.0):
        self.r_c, self.r_v, self.h, self.e, self.nu = (mpf(v) for v in (r_c, r_v, h, e, nu))
        self.M, self.m = mpf(I_c) / self.r_c**2, mpf(I_v) / self.r_v**2
        self.F, self.p = mpf(torque) / self.r_c, 2 * pi * self.r_c / int(teeth)
        self.g = self.F / self.M
        self.c, self.y_i = mpf(0), mpf(0)

    def lever(self, y):
        return y + self.c / 2 * (y - self.y_i) ** 2

    def slope(self, y):
        return 1 + self.c * (y - self.y_i)


def first_root(a, b, c):
    """The least positive root of a t^2 + b t + c, for c < 0 < b."""
    return -2 * c / (b + sqrt(b * b - 4 * a * c))


def flight(clock, y, V, w):
    """Time from an impact on the upper pallet, at y, to the one on the lower."""
    x = clock.lever(y)
    met = -y  # where the lower pallet would be met at once, reflected
    slope, bend = -w * clock.slope(met), clock.c * w * w / 2
    return first_root(clock.g / 2 - bend, V - slope, x - clock.p / 2 - clock.lever(met))


def half_map(clock, state):
    """The state (y, V, w) just after the next impact, reflected."""
    y, V, w = state
    t = flight(clock, y, V, w)
    y, V, w = -(y + w * t), V + clock.g * t, -w
    u = clock.slope(y)
    push = (1 + clock.e) * (V - u * w) / (1 / clock.M + u * u / clock.m)
    return matrix([y, V - push / clock.M, w + u * push / clock.m])


def derivative(clock, state):
    """The derivative of the half map, by central differences."""
    columns = []
    for k in range(3):
        step = tiny() * (abs(state[0]) if k == 0 else abs(state[1]) + abs(state[2]))
        beside = [matrix(state), matrix(state)]
        beside[0][k] += step
        beside[1][k] -= step
        columns.append((half_map(clock, beside[0]) - half_map(clock, beside[1])) / (2 * step))
    return matrix([[columns[j][i] for j in range(3)] for i in range(3)])


def fixed_point(clock):
    """The state just after an impact that repeats, by Newton from the balance of momentum."""
    T = sqrt(clock.p / (clock.F * (1 / clock.M + 1 / clock.m) * (1 - clock.e)))
    w = clock.F * T / (2 * clock.m)
    state = matrix([-w * T / 2, clock.p / (2 * T) - clock.g * T / 2, w])
    for _ in range(60):
        jacobian = derivative(clock, state)
        for k in range(3):
            jacobian[k, k] -= 1
        step = lu_solve(jacobian, matrix(state) - half_map(clock, state))
        state = state + step
        if all(abs(step[k]) <= tiny() ** 2 * abs(state[2 if k else 0]) for k in range(3)):
            return state
    raise ArithmeticError("no fixed point")


def multiplier(jacobian):
    """The largest modulus of the eigenvalues of a 3 x 3 matrix, by Cardano's formula."""
    a = jacobian
    trace = a[0, 0] + a[1, 1] + a[2, 2]
    minors = sum(a[i, i] * a[j, j] - a[i, j] * a[j, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    p = minors - trace**2 / 3  # of t^3 + p t + q, t = x - trace/3
    q = trace * minors / 3 - 2 * trace**3 / 27 - mp.det(a)
    width = sqrt(mpc(q * q / 4 + p**3 / 27))
    third = mp.cbrt(max(-q / 2 + width, -q / 2 - width, key=abs))
    turns = [third * mp.expjpi(mpf(2 * k) / 3) for k in range(3)]
    return max(abs(turn - p / (3 * turn) + trace / 3) for turn in turns)


def passages(a, b, c, end, p):
    """Times in (0, end) at which a t^2 + b t + c is a whole number of pitches."""
    top = a * end * end + b * end + c
    values = [c, top]
    if a != 0 and 0 < -b / (2 * a) < end:
        values.append(c - b * b / (4 * a))
    found = []
    for j in range(int(floor(min(values) / p)), int(ceil(max(values) / p)) + 1):
        inside = b * b - 4 * a * (c - j * p)
        if inside < 0:
            continue
        big = -(b + (sqrt(inside) if b >= 0 else -sqrt(inside))) / 2
        found += [(c - j * p) / big] if big != 0 else []
        found += [big / a] if a != 0 else []
    return [t for t in found if tiny() * end < t < end * (1 - tiny())]


def exists(clock, state):
    """Whether, between two impacts on the upper pallet, no tooth passes it while it is in the way (y < h)."""
    y, V, w = state
    T = flight(clock, y, V, w)
    x, g, c = clock.lever(y), clock.g, clock.c
    here, back = clock.lever(y), clock.lever(y + w * T)
    out = (g / 2 - c * w * w / 2, V - w * clock.slope(y), x - here)
    home = (
        g / 2 - c * w * w / 2, V + w * clock.slope(y + w * T), clock.p / 2 + clock.lever(y) - back
    )  # fmt: skip
    if y + w * T <= clock.h:
        return False
    early = any(y + w * t < clock.h for t in passages(*out, T, clock.p))
    return not early and not any(y + w * (T - t) < clock.h for t in passages(*home, T, clock.p))


def bent(clock):
    """The clock with its lever bent about the place of impact, and its cycle."""
    clock.c = mpf(0)
    flat = fixed_point(clock)
    clock.y_i = flat[0]
    clock.c = clock.nu / (clock.g * flight(clock, *flat) ** 2)
    return flat


def impact_cycle(*cell, digits=DIGITS):
    """(period, swing, wheel_speed, pallet_speed, multiplier, recoil, contact_share, impacts, offset); does it exist?"""
    with mp.workdps(digits):
        clock = Clock(*cell)
        state = bent(clock)
        assert mp.norm(half_map(clock, state) - state, mp.inf) < mpf(10) ** -50 * mp.norm(state, mp.inf)
        y, V, w = state
        T = flight(clock, y, V, w)
        recoil = V * V / (2 * clock.g * clock.r_c) if V < 0 else mpf(0)
        largest = multiplier(derivative(clock, state))
        values = (2 * T, -y, V / clock.r_c, w / clock.r_v, largest, recoil, mpf(0), mpf(1), mpf(0))
        return values, exists(clock, state)


def highest_escape(*cell, digits=DIGITS):
    """The largest escape height, up to p/4, with which the cycle of this clock exists, by bisection."""
    with mp.workdps(digits):
        clock = Clock(*cell)
        state = bent(clock)
        low, high = mpf(0), clock.p / 4
        for _ in range(80):
            clock.h = (low + high) / 2
            low, high = (clock.h, high) if exists(clock, state) else (low, clock.h)
        return low


def escape(clock, speed):
    """From one escape to the next with e = 0: times of fall and contact, place and speed of impact, speed of escape."""
    gap = max(clock.p / 2 - 2 * clock.h, mpf(0))
    fall = first_root(clock.g / 2, 2 * speed, -gap) if gap > 0 else mpf(0)
    y = -(clock.h + speed * fall)
    start = (clock.M * (speed + clock.g * fall) - clock.m * speed) / (clock.M + clock.m)
    push = clock.F / (clock.M + clock.m)
    end = sqrt(start * start + 2 * push * (clock.h - y))
    return fall, (end - start) / push, y, start, end


def plastic_cycle(*cell, digits=DIGITS):
    """The same outputs for e = 0, where tooth and pallet stay together until the escape."""
    with mp.workdps(digits):
        clock = Clock(*cell)
        speed = sqrt(clock.F * (clock.p / clock.m + clock.h / clock.M))
        for _ in range(80):
            step = tiny() * speed
            slope = (escape(clock, speed + step)[4] - escape(clock, speed - step)[4]) / (2 * step)
            error = (escape(clock, speed)[4] - speed) / (1 - slope)
            speed += error
            if abs(error) < tiny() ** 2 * speed:
                break
        else:
            raise ArithmeticError("no fixed point")
        fall, held, y, start, _ = escape(clock, speed)
        back = start * start * (clock.M + clock.m) / (2 * clock.F) if start < 0 else mpf(0)
        values = (2 * (fall + held), back - y, start / clock.r_c, start / clock.r_v, slope, back / clock.r_c)
        return (*values, held / (fall + held), mpf(1), mpf(0))
