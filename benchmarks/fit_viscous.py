"""How few coefficients hold the viscous foliot's limit cycle to a few 1e-16?

    python benchmarks/fit_viscous.py > kernels/foliot/_viscous_fit.py

fits the polynomials of that module in 50-digit arithmetic and prints it.
LOG_TAIL of `kernels/maths/elementary.py` is fitted with it and printed on stderr.

With k = 1/alpha = a^2 phi0/mu, the cycle is q - tanh q = k, and everything is smooth in
    w = y^2, y = cbrt(3 k)            for k <  SPLIT (strong drive)
    x = exp(-2 (k + 1))               for k >= SPLIT (weak drive).
Chebyshev interpolation, then monomials; the leading coefficients are known and kept out of the fit.
"""

import sys
from functools import cache

from mpmath import chebyfit, exp, findroot, log, log1p, mp, mpf, tanh

mp.dps = 50
SPLIT = mpf(7) / 10


def quarter_phase(k):
    """q of q - tanh q = k."""
    return findroot(lambda q: q - tanh(q) - k, (3 * k) ** (mpf(1) / 3) if k < 1 else k + 1)


def strong(w):
    """(q/y - 1)/w, (A y/1.5 - 1)/w, (s - 1/3)/w at w = y^2; lambda = q - k needs no fit of its own."""
    y = w ** (mpf(1) / 2)
    k = y**3 / 3
    q = quarter_phase(k)
    lam = tanh(q)
    amplitude = log(mp.cosh(q)) / k
    s = k / (q * lam**2)
    return (q / y - 1) / w, (amplitude * y * 2 / 3 - 1) / w, (s - mpf(1) / 3) / w


def weak(x):
    """(1 - lambda)/x and (k (A - 1) - (1 - ln 2))/x at x = exp(-2(k + 1))."""
    k = -log(x) / 2 - 1
    gap = findroot(lambda d: d - 2 / (exp(2 * (k + 1 - d)) + 1), 2 * x)  # d = 1 - lambda
    q = k + 1 - gap
    return gap / x, (log1p(exp(-2 * q)) - gap) / x


def interpolate(function, low, high, degree, outputs):
    """Monomial coefficients on [low, high], lowest first, one list for each output of the function."""
    value = cache(function)
    return [chebyfit(lambda z, i=i: value(z)[i], [low, high], degree + 1)[::-1] for i in range(outputs)]


def log_tail(v):
    """(atanh(s)/s - 1)/s^2 at v = s^2: ln((1 + s)/(1 - s)) = 2 s (1 + v T(v))."""
    s = v ** (mpf(1) / 2)
    return ((mp.atanh(s) / s - 1) / v,)


def show(name, doc, coefficients):
    numbers = [f"{float(c)!r}," for c in coefficients]
    rows = "\n".join("    " + " ".join(numbers[j : j + 4]) for j in range(0, len(numbers), 4))
    return f'\n{name} = (\n{rows}\n)  # fmt: skip\n"""{doc}"""\n'


def main():
    top = (3 * SPLIT) ** (mpf(2) / 3)
    tiny = mpf(10) ** -14
    q, amplitude, s = interpolate(strong, tiny, top * mpf("1.0001"), 15, 3)
    gap, overshoot = interpolate(weak, tiny, exp(-2 * (SPLIT + 1)) * mpf("1.0001"), 12, 2)
    (log_coefficients,) = interpolate(log_tail, tiny, mpf("0.112"), 11, 1)
    print('"""Polynomial coefficients, lowest power first, written by benchmarks/fit_viscous.py; not to be edited."""')
    print(f"\nSPLIT = {float(SPLIT)!r}\n", '"""k = 1/alpha at which the fits change over."""', sep="")
    print(show("Q_STRONG", "(q/y - 1)/w, w = y^2, y = cbrt(3 k).", q), end="")
    print(show("AMPLITUDE_STRONG", "(A y/1.5 - 1)/w.", amplitude), end="")
    print(show("SENSITIVITY_STRONG", "(s - 1/3)/w.", s), end="")
    print(show("GAP_WEAK", "(1 - lambda)/x, x = exp(-2(k + 1)).", gap), end="")
    print(show("OVERSHOOT_WEAK", "(k (A - 1) - (1 - ln 2))/x.", overshoot), end="")
    print(show("LOG_TAIL", "(atanh(s)/s - 1)/s^2 in s^2, 0 <= s <= 1/3.", log_coefficients), end="", file=sys.stderr)


if __name__ == "__main__":
    main()
