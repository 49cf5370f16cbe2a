"""Truth about wear under a polishing machine's tool, by brute force with splitting; imports nothing of ours.

Unlike the kernel it integrates over time outside and over arcs of the ring inside: at each instant the arcs in contact
are found by sampling and bisection; time is split where arcs appear, merge or vanish, where corners of the tool cross
the ring, and where the speed vanishes. Plain float64: right to some 1e-12. Of tools of an exponent below 1 slivers may
be missed, for 3e-7 in one ring of ten; 3841 instants and 2881 samples find them. Lengths in any one unit; rates in
rad/s.
"""

import itertools

import numpy as np

SAMPLES = 361
"""Points of the ring at which contact is looked for, beside those where it crosses the tool's axes."""
INSTANTS = 241
HALVINGS = 60
_GAUSS = np.polynomial.legendre.leggauss(24)


class Machine:
    """Arm, tool and work, of a cell's parameters; `type` 0 for A, 1 for B."""

    def __init__(self, b, d, f, e, type, omega, b_angle, L, beta, w_x, w_y, Omega, tool_a, tool_b, tool_n, tool_m, **_):
        self.links, self.side, self.omega, self.b_angle = (b, d, f, e), -1 if type else 1, omega, b_angle
        self.reach, self.beta, self.centre, self.spin = L, beta, complex(w_x, w_y), Omega
        self.tool = (tool_a, tool_b, tool_n, tool_m)

    def arm(self, theta):
        """Angle of the arm from the x axis and its rate by time, at crank angles `theta` from b."""
        b, d, f, e = self.links
        crank = e * np.exp(1j * theta)
        p = b + crank
        psi = np.arccos((abs(p) ** 2 + d**2 - f**2) / (2 * d * abs(p)))
        alpha = np.angle(p) + self.side * psi
        arm = d * np.exp(1j * alpha)
        coupler = p - arm
        rate = self.omega * cross(crank, coupler) / cross(arm, coupler)
        return alpha + self.b_angle, rate

    def excess(self, theta, x):
        """abs(X/a)^n + abs(Y/b)^m - 1 of points x (complex, from the pivot)."""
        a, width, n, m = self.tool
        z = x * np.exp(-1j * (self.arm(theta)[0] + self.beta)) - self.reach
        with np.errstate(over="ignore"):
            return np.abs(z.real / a) ** n + np.abs(z.imag / width) ** m - 1

    def ring(self, r, psi):
        return self.centre + r * np.exp(1j * psi)

    def speed(self, theta, r, psi):
        rate = self.arm(theta)[1]
        return abs(1j * rate * self.ring(r, psi) - 1j * self.spin * r * np.exp(1j * psi))


def cross(p, q):
    return (np.conj(p) * q).imag


def bisected(function, low, high):
    """Where a function changes its sign between low and high, all at once."""
    rising = function(high) > 0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = (function(middle) > 0) == rising
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)


def lowest(function, low, high):
    """Where a function is least between low and high, by golden section, all at once."""
    share = (np.sqrt(5) - 1) / 2
    for _ in range(45):
        one, two = high - share * (high - low), low + share * (high - low)
        left = function(one) < function(two)
        low, high = np.where(left, low, one), np.where(left, two, high)
    return 0.5 * (low + high)


def samples(machine, r, theta):
    """Angles psi along the ring for each instant, shape (instants, samples), with those on the tool's axes."""
    grid = np.broadcast_to(np.linspace(-np.pi, np.pi, SAMPLES), (theta.size, SAMPLES))
    turned = machine.arm(theta)[0] + machine.beta
    w = machine.centre * np.exp(-1j * turned)
    extra = []
    for offset, turn in ((machine.reach - w.real, 0.0), (-w.imag, np.pi / 2)):
        with np.errstate(invalid="ignore"):
            half = np.arccos(offset / r)
        extra += [np.where(np.isnan(half), 0.0, turned + turn + s * half) for s in (-1, 1)]
    extra = (np.array(extra).T + np.pi) % (2 * np.pi) - np.pi
    return np.sort(np.concatenate([grid, extra], axis=1), axis=1)


def ends(machine, r, theta):
    """Ends of the arcs in contact at each instant, as rows (instant, psi) sorted, from -pi to pi."""
    if machine.tool[2:] == (1.0, 1.0):
        return ends_on_edges(machine, r, theta)
    psi = samples(machine, r, theta)
    value = machine.excess(theta[:, None], machine.ring(r, psi))
    i, j = np.nonzero((value[:, 1:-1] > 0) & (value[:, 1:-1] <= value[:, :-2]) & (value[:, 1:-1] <= value[:, 2:]))
    k, m = np.nonzero((value[:, 1:-1] < 0) & (value[:, 1:-1] >= value[:, :-2]) & (value[:, 1:-1] >= value[:, 2:]))
    dips = lowest(lambda s: machine.excess(theta[i], machine.ring(r, s)), psi[i, j], psi[i, j + 2])
    tops = lowest(lambda s: -machine.excess(theta[k], machine.ring(r, s)), psi[k, m], psi[k, m + 2])
    rows, points = np.concatenate([i, k]), np.concatenate([dips, tops])
    found = np.full((theta.size, 2 * psi.shape[1]), np.inf)
    found[:, : psi.shape[1]] = psi
    free = np.full(theta.size, psi.shape[1])
    for row, point in zip(rows, points, strict=True):
        found[row, free[row]] = point
        free[row] += 1
    psi = np.sort(found, axis=1)
    psi = np.where(np.isinf(psi), np.pi, psi)
    value = machine.excess(theta[:, None], machine.ring(r, psi))
    i, j = np.nonzero((value[:, 1:] > 0) != (value[:, :-1] > 0))
    at = bisected(lambda s: machine.excess(theta[i], machine.ring(r, s)), psi[i, j], psi[i, j + 1])
    return i, at, value[:, 0] < 0


def ends_on_edges(machine, r, theta):
    """As `ends`, of a rhombus, by the quadratic equation of each edge: samples may miss a sliver beside a corner."""
    turn = np.exp(1j * (machine.arm(theta)[0] + machine.beta))
    w = machine.centre / turn - machine.reach
    corners = np.array([machine.tool[0], 1j * machine.tool[1], -machine.tool[0], -1j * machine.tool[1]])
    found = []
    for one, two in zip(corners, np.roll(corners, -1), strict=True):
        edge, middle = two - one, (np.conj(two - one) * (w - one)).real / abs(two - one) ** 2
        square = (r**2 - abs(one + middle * edge - w) ** 2) / abs(edge) ** 2
        for sign in (-1, 1):
            share = middle + sign * np.sqrt(np.maximum(square, 0))
            there = (square > 0) & (share >= 0) & (share <= 1)
            found.append(np.where(there, np.angle((one + share * edge - w) * turn), np.inf))
    psi = np.sort(np.array(found).T, axis=1)
    i, j = np.nonzero(np.isfinite(psi))
    return i, psi[i, j], machine.excess(theta, machine.ring(r, -np.pi)) < 0


def shape(machine, r, theta):
    """How many arcs there are, and whether psi = pi is in one."""
    i, _, wraps = ends(machine, r, theta)
    return 2 * np.bincount(i, minlength=theta.size) + wraps


def at_instants(machine, r, theta):
    """The integral of the speed over the arcs in contact, for each instant."""
    i, at, wraps = ends(machine, r, theta)
    total = np.zeros(theta.size)
    for row in range(theta.size):
        cuts = np.concatenate([[-np.pi], at[i == row], [np.pi]])
        for k in range(cuts.size - 1):
            if (k % 2 == 0) == wraps[row]:
                total[row] += along(machine, theta[row], r, cuts[k], cuts[k + 1])
    return total


DOUBLE_EXPONENTIAL = np.linspace(-3.4, 3.4, 69)


def along(machine, theta, r, low, high):
    """The integral of the speed over one arc, split where the speed is least, by the double exponential rule."""
    facing = np.angle(machine.centre)
    stops = [s for s in facing + np.pi * np.arange(-3, 4) if low < s < high]
    stops = [low, *stops, high]
    t = DOUBLE_EXPONENTIAL
    u, growth = np.tanh(np.pi / 2 * np.sinh(t)), np.pi / 2 * np.cosh(t) / np.cosh(np.pi / 2 * np.sinh(t)) ** 2
    one, two = np.array(stops[:-1])[:, None], np.array(stops[1:])[:, None]
    values = machine.speed(theta, r, 0.5 * (one + two) + 0.5 * (two - one) * u)
    return float((0.5 * (two - one) * growth * values).sum() * (t[1] - t[0]))


def splits(machine, r):
    """Instants at which the integrand over time is not smooth."""
    theta = np.linspace(0, 2 * np.pi, INSTANTS)
    counts = shape(machine, r, theta)
    j = np.nonzero(counts[1:] != counts[:-1])[0]
    before, low, high = counts[j], theta[j].copy(), theta[j + 1].copy()
    for _ in range(HALVINGS if j.size else 0):
        middle = 0.5 * (low + high)
        same = shape(machine, r, middle) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    a, width, n, m = machine.tool
    corners = [complex(x, y) for x, y in ((a, 0), (-a, 0), (0, width), (0, -width))]
    corners += [complex(x * a * 0.5 ** (1 / n), y * width * 0.5 ** (1 / m)) for x in (-1, 1) for y in (-1, 1)]
    w = abs(machine.centre)
    tests = [lambda t, c=c: abs((machine.reach + c) * np.exp(1j * (machine.arm(t)[0] + machine.beta))
                                - machine.centre) - r for c in corners]  # fmt: skip
    tests += [lambda t: machine.arm(t)[1]]
    tests += [lambda t, s=s: (machine.arm(t)[1] - machine.spin) * r + s * machine.arm(t)[1] * w for s in (-1, 1)]
    found = [0.0, 2 * np.pi, *(0.5 * (low + high))]
    for test in tests:
        value = test(theta)
        j = np.nonzero((value[1:] > 0) != (value[:-1] > 0))[0]
        found += list(bisected(test, theta[j], theta[j + 1]))
    return np.unique(found)


def lens(one, two, apart):
    """Area that two discs share, from their radii and the distance of their centres."""
    apart = np.clip(apart, abs(one - two) + 1e-300, one + two)
    first = np.arccos(np.clip((apart**2 + one**2 - two**2) / (2 * apart * one), -1, 1))
    second = np.arccos(np.clip((apart**2 + two**2 - one**2) / (2 * apart * two), -1, 1))
    return one**2 * (first - np.sin(2 * first) / 2) + two**2 * (second - np.sin(2 * second) / 2)


def ring_wear(machine, r, rtol=1e-12):
    """int dtheta int_contact v dpsi over the crank's turn and the ring of radius r."""
    cuts = splits(machine, r)
    y, weight = 0.5 * (_GAUSS[0] + 1), 0.5 * _GAUSS[1]

    def panel(low, high, first, last):
        s = first + (last - first) * y
        theta = low + (high - low) * s * s * (3 - 2 * s)
        inner = at_instants(machine, r, theta)
        return float((weight * inner * 6 * s * (1 - s)).sum() * (high - low) * (last - first))

    total, todo = 0.0, []
    for low, high in itertools.pairwise(cuts):
        if high - low > 1e-13:
            todo.append((low, high, 0.0, 1.0, panel(low, high, 0.0, 1.0)))
    whole = sum(abs(t[4]) for t in todo)
    while todo:
        low, high, first, last, value = todo.pop()
        middle = 0.5 * (first + last)
        one, two = panel(low, high, first, middle), panel(low, high, middle, last)
        if abs(one + two - value) <= rtol * whole or last - first < 1e-10:
            total += one + two
        else:
            todo += [(low, high, first, middle, one), (low, high, middle, last, two)]
    return total
