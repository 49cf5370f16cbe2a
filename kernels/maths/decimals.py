"""Cosines in decimal arithmetic, for tables made at import: each entry is the float64 nearest to the exact number.

numpy's and the C library's functions differ in the last digit from processor to processor, and with them every cell
that a table enters.
"""

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
