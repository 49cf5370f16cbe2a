"""Complex numbers as tuples (re, im), of one cell or lanes: numba's own have no lanes and no explicit multiply-adds.

Products and quotients are right to 4 roundings of the modulus.
"""

from kernels.lanes.jit import jit, jit_call
from kernels.lanes.vectors import fma, magnitude
from kernels.maths.elementary import scale


@jit
def square(z):
    """Squared modulus."""
    return fma(z[0], z[0], z[1] * z[1])


@jit
def product(y, z):
    """Product of two complex numbers."""
    return fma(y[0], z[0], -(y[1] * z[1])), fma(y[0], z[1], y[1] * z[0])


@jit
def over(y, z):
    """Quotient of two complex numbers, z between 1e-150 and 1e150."""
    inverse = 1.0 / square(z)
    return product(y, (z[0] * inverse, -z[1] * inverse))


@jit_call
def scaled(z, n):
    """z 2^n."""
    return scale(z[0], n), scale(z[1], n)


@jit
def size(z):
    """Modulus, or up to sqrt 2 more."""
    return magnitude(z[0]) + magnitude(z[1])
