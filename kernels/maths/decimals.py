"""Cosines and nodes in decimal arithmetic, for tables made at import: an entry is the float64 nearest to the exact one.

numpy's and the C library's functions differ in the last digit from processor to processor, and with them every cell
that a table enters.
"""

import math
from decimal import Decimal, localcontext

PI = Decimal("3.1415926535897932384626433832795028841971693993751058209749445923078164062862089986280348253421170679")
DIGITS = 100


def precise():
    """A context of DIGITS digits: `with precise(): ...`."""
    return localcontext(prec=DIGITS)


def cosine(x):
    """cos x of a Decimal of at most 4, to 1e-98."""
    term = total = Decimal(1)
    k = 0
    while abs(term) > Decimal(10) ** -(DIGITS + 2):
        k += 2
        term *= -x * x / (k * (k - 1))
        total += term
    return total


def multiples(cosine_of_x, count):
    """cos(k x) of k = 0 ... count - 1."""
    row = [Decimal(1), cosine_of_x]
    while len(row) < count:
        row.append(2 * row[1] * row[-1] - row[-2])
    return row


def legendre(n):
    """Nodes in (0, 1) and weights of the rule of Gauss-Legendre, to 1e-98, by Newton's method on P_n."""
    rule = []
    for j in range(n):
        x = Decimal(-math.cos(math.pi * (j + 0.75) / (n + 0.5)))
        for _ in range(8):
            before, value = Decimal(1), x
            for k in range(2, n + 1):
                before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
            slope = n * (x * value - before) / (x * x - 1)
            x -= value / slope
        rule.append(((1 + x) / 2, 1 / ((1 - x * x) * slope**2)))
    return rule
