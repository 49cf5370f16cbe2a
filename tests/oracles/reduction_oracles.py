"""Truth about reduced drivetrains in 50 digits, by mpmath; imports nothing of ours.

Everything by matrices: K = B^T diag(k) B, C = B^T diag(h) B; a reduction is a basis T and K_r = T^T K T, or, for
Rivin's, levers on a line of flexibility x. Masses are numbered from 0, the spindle.
"""

from itertools import pairwise

from chain_oracles import numbers, stiffness
from mpmath import diag, eig, eigsy, eye, matrix, mp, mpf, pi, sqrt, zeros

DIGITS = 50


def modes(K, M):
    """(w^2 rising, shapes as columns with x^T M x = 1) of K x = w^2 M x."""
    values, vectors = eigsy(M)
    half = vectors * diag([1 / sqrt(v) for v in values]) * vectors.T
    squares, shapes = eigsy(half * K * half)
    return list(squares), half * shapes


def hertz(squares):
    """Frequencies of squared angular ones; what is 0 but for rounding is 0."""
    floor = max(squares) * mpf(10) ** (-DIGITS // 2)
    return [sqrt(s) / (2 * pi) if s > floor**2 or s > 0 else mpf(0) for s in squares]


def _places(k):
    """Flexibility from each mass to ground, and 0 for the ground."""
    x = [mpf(0)]
    for spring in reversed(k):
        x.append(x[-1] + 1 / spring)
    return x[::-1]


def rivin(J, k, h, steps):
    """(J, k, h) after steps ("a", j) or ("b", j): masses on a line of flexibility, split and joined by levers.

    Dampers by their work: the strain of a spring is its share of the flexibility between masses.
    """
    with mp.workdps(DIGITS):
        J, k, h = numbers(J), numbers(k), numbers(h)
        for kind, j in steps:
            x = _places(k)
            pieces = [(x[i], x[i + 1], h[i]) for i in range(len(J))]
            if kind == "a":
                right = (x[j - 1] - x[j]) / (x[j - 1] - x[j + 1])
                J[j - 1] += J[j] * (1 - right)
                if j + 1 < len(J):
                    J[j + 1] += J[j] * right
                del J[j], x[j]
            else:
                place = (J[j] * x[j] + J[j + 1] * x[j + 1]) / (J[j] + J[j + 1])
                pieces[j : j + 1] = [
                    (x[j], place, h[j] * (x[j] - x[j + 1]) / (x[j] - place)),
                    (place, x[j + 1], h[j] * (x[j] - x[j + 1]) / (place - x[j + 1])),
                ]
                J[j : j + 2] = [J[j] + J[j + 1]]
                x[j : j + 2] = [place]
            k = [1 / (a - b) for a, b in pairwise(x)]
            h = [sum(d * ((u - v) / (a - b)) ** 2 for u, v, d in pieces if u <= a and v >= b) for a, b in pairwise(x)]
        return J, k, h


def static_basis(K, masters):
    """T of Guyan: the others follow as at rest."""
    n = K.rows
    slaves = [i for i in range(n) if i not in masters]
    T = zeros(n, len(masters))
    for c, m in enumerate(masters):
        T[m, c] = 1
    if slaves:
        own = matrix([[K[i, j] for j in slaves] for i in slaves])
        to_masters = matrix([[K[i, m] for m in masters] for i in slaves])
        follow = -(own**-1) * to_masters
        for r, i in enumerate(slaves):
            for c in range(len(masters)):
                T[i, c] = follow[r, c]
    return T


def improved_basis(K, M, masters):
    """T of IRS, by O'Callahan's matrices: T + S M T M_r^-1 K_r."""
    T = static_basis(K, masters)
    slaves = [i for i in range(K.rows) if i not in masters]
    S = zeros(K.rows)
    if slaves:
        own = matrix([[K[i, j] for j in slaves] for i in slaves]) ** -1
        for r, i in enumerate(slaves):
            for c, j in enumerate(slaves):
                S[i, j] = own[r, c]
    return T + S * M * T * (T.T * M * T) ** -1 * (T.T * K * T)


def craig_bampton_basis(K, M, n_kept):
    """The spindle turned by 1 at rest, and the lowest modes with the spindle held."""
    n = K.rows
    T = zeros(n, n_kept)
    T[:, 0] = static_basis(K, [0])
    if n_kept > 1:
        _, shapes = modes(K[1:, 1:], M[1:, 1:])
        for c in range(1, n_kept):
            for i in range(1, n):
                T[i, c] = shapes[i - 1, c - 1]
    return T


def modal_basis(K, M, n_kept):
    """The lowest modes."""
    return modes(K, M)[1][:, :n_kept]


def basis(kind, K, M, n_kept, masters):
    """T of a reduction by name."""
    return {
        "guyan": lambda: static_basis(K, masters),
        "irs": lambda: improved_basis(K, M, masters),
        "craig_bampton": lambda: craig_bampton_basis(K, M, n_kept),
        "modal": lambda: modal_basis(K, M, n_kept),
    }[kind]()


class Reduced:
    """K, C and M of a chain in the basis T; `here` is T's row of the spindle, `rest` is added to its receptance."""

    def __init__(self, kind, J, k, h, n_kept, masters=()):
        with mp.workdps(DIGITS):
            K, C, M = stiffness(numbers(k)), stiffness(numbers(h)), diag(numbers(J))
            T = basis(kind, K, M, n_kept, list(masters))
            self.K, self.C, self.M, self.here = T.T * K * T, T.T * C * T, T.T * M * T, T[0, :]
            self.rest = mpf(0)
            if kind == "modal":
                squares, shapes = modes(K, M)
                self.rest = sum((shapes[0, i] ** 2 / squares[i] for i in range(n_kept, len(squares))), mpf(0))

    def frequencies(self):
        """Without damping [Hz]."""
        with mp.workdps(DIGITS):
            return hertz(modes(self.K, self.M)[0])

    def poles(self):
        """All of them, by rising modulus."""
        return poles(self.K, self.C, self.M)


def poles(K, C, M):
    """Roots of det(s^2 M + s C + K), by rising modulus."""
    with mp.workdps(DIGITS):
        p = K.rows
        A = zeros(2 * p)
        A[:p, p:] = eye(p)
        A[p:, :p] = -(M**-1) * K
        A[p:, p:] = -(M**-1) * C
        return sorted(eig(A, left=False, right=False), key=abs)


def full(J, k, h):
    """A chain as a Reduced of all its masses."""
    return Reduced("guyan", J, k, h, len(J), range(len(J)))


def dampings(roots):
    """zeta by mode: of pairs -Re s/abs(s); of real roots, two at a time in order of size, their pair's."""
    complex_ones = [s for s in roots if s.imag > abs(s) * mpf(10) ** -15]
    real = [s.real for s in roots if abs(s.imag) <= abs(s) * mpf(10) ** -15]
    values = [(abs(s), -s.real / abs(s)) for s in complex_ones]
    values += [(sqrt(a * b), -(a + b) / (2 * sqrt(a * b))) for a, b in zip(real[::2], real[1::2], strict=True)]
    return [zeta for _, zeta in sorted(values, key=lambda pair: pair[0])]


def strict_steps(J, k, h, n_kept):
    """Rivin's steps by the smallest J e, each as ("a", mass) or ("b", spring)."""
    steps = []
    with mp.workdps(DIGITS):
        while len(J) - len(steps) > n_kept:
            now_J, now_k, _ = rivin(J, k, h, steps)
            m = len(now_J)
            systems = [(now_J[j] / (now_k[j - 1] + now_k[j]), ("a", j)) for j in range(1, m)]
            for j in range(m - 1):
                together = now_J[j] * now_J[j + 1] / (now_J[j] + now_J[j + 1])
                systems.append((together / now_k[j], ("b", j)))
            steps.append(min(systems)[1])
    return steps


def masters(J, k, h, n_kept):
    """What is left if only masses are taken out, by the smallest J e."""
    left, steps = list(range(len(J))), []
    with mp.workdps(DIGITS):
        while len(left) > n_kept:
            now_J, now_k, _ = rivin(J, k, h, steps)
            j = min(range(1, len(now_J)), key=lambda j: now_J[j] / (now_k[j - 1] + now_k[j]))
            steps.append(("a", j))
            del left[j]
    return left
