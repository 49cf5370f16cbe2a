"""A chain of inertias to 50 digits and more (mpmath), by textbook means: imports nothing that it checks.

J_1 -k_1- J_2 - ... - J_n -k_n- ground, dampers h_j beside the springs; matrices are dense, frequencies in Hz.
"""

from mpmath import eigsy, lu_solve, matrix, mp, mpc, mpf, pi, polyroots, sqrt

DIGITS = 60


def stiffness(springs):
    """The dense matrix of springs of which the last goes to ground."""
    n = len(springs)
    K = matrix(n, n)
    for j, spring in enumerate(springs):
        K[j, j] += spring
        if j < n - 1:
            K[j + 1, j + 1] += spring
            K[j, j + 1] -= spring
            K[j + 1, j] -= spring
    return K


def numbers(values):
    """Exactly what the float64 values are."""
    return [mpf(float(v)) for v in values]


def frequencies(J, k, digits=160):
    """Natural frequencies, rising."""
    with mp.workdps(digits):
        J = numbers(J)
        n = len(J)
        K = stiffness(numbers(k))
        symmetric = matrix(n, n)
        for i in range(n):
            for j in range(n):
                symmetric[i, j] = K[i, j] / sqrt(J[i] * J[j])
        return [sqrt(abs(value)) / (2 * pi) for value in sorted(eigsy(symmetric, eigvals_only=True))]


def count_below(J, k, frequency):
    """How many natural frequencies are below a frequency: the negative pivots of K - w^2 J, in 800 digits."""
    with mp.workdps(800):
        J, k = numbers(J), numbers(k)
        square = (2 * pi * mpf(frequency)) ** 2
        count, pivot = 0, None
        for j in range(len(J)):
            entry = k[j] + (k[j - 1] if j else 0) - square * J[j]
            pivot = entry if pivot is None else entry - k[j - 1] ** 2 / pivot
            count += pivot < 0
        return count


def receptance(J, k, h, frequency, drive, read):
    """Angle at mass `read` per torque at mass `drive` (counted from 1), complex, from the dense equations of motion."""
    with mp.workdps(DIGITS):
        J, w = numbers(J), 2 * pi * mpf(float(frequency))
        dynamic = stiffness([mpc(a, w * b) for a, b in zip(numbers(k), numbers(h), strict=True)])
        for j, inertia in enumerate(J):
            dynamic[j, j] -= w * w * inertia
        torque = matrix(len(J), 1)
        torque[drive - 1] = 1
        return lu_solve(dynamic, torque)[read - 1]


def polynomial(J, k, h):
    """Coefficients of det(s^2 J + s H + K), the lowest power first, by expansion of the determinant."""
    J, k, h = numbers(J), numbers(k), numbers(h)
    before, now = [], [mpf(1)]
    for j in range(len(J)):
        left = [k[j - 1], h[j - 1]] if j else [mpf(0), mpf(0)]
        diagonal = [k[j] + left[0], h[j] + left[1], J[j]]
        new = _product(diagonal, now)
        for power, value in enumerate(_product(_product(left, left), before)):
            new[power] -= value
        before, now = now, new
    return now


def _product(a, b):
    """Product of two polynomials, the lowest power first."""
    out = [mpf(0)] * max(len(a) + len(b) - 1, 0)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def poles(J, k, h, digits=120):
    """All 2n roots of det(s^2 J + s H + K)."""
    with mp.workdps(digits):
        return polyroots(polynomial(J, k, h), maxsteps=2000, extraprec=4 * digits, error=False, asc=True)
