"""Holzer's walk: the shape in which a chain moves as exp(s t), from both ends to where it is best known.

Real for a natural frequency, s^2 = -w^2 and K_j = k_j, complex for a pole, K_j = k_j + s h_j. With x the angle and g
what torque it takes on its inner side, from the left, beginning with x_1 = 1, g_0 = 0,
    g_j = g_(j-1) + s^2 J_j x_j,  x_(j+1) = x_j + g_j/K_j;                                              (1)
the same from the right, from x_n = 1 and the torque K_n of the last spring. Each step is exact for an inertia and a
spring a few roundings off. Both are joined at the inertia r where J_r x_r(left) x_r(right) is largest: there the torque
that is missing for a rounding in s^2 is least felt. By that a shape is right to the rounding over the relative gap to
the next frequency; small entries keep their digits, and so do the strains g_j/K_j.
Source: Holzer's method; the joint is that of Parlett & Dhillon, Linear Algebra Appl. 267:247 (1997), section 3.
"""

from kernels.lanes.jit import jit_apart
from kernels.lanes.vectors import exponent, fma, pow2, sqrt
from kernels.maths.elementary import scale
from kernels.maths.small_dense import size, square

ROWS = 9
"""Of the buffer `ways`: from the left and the right each x, g and the winding of the spring behind; 1/K; the shape."""
FLEXIBILITY, SHAPE, STRAIN = 6, 7, 8


@jit_apart
def follow(n, J, ground, s_square, ways, e):
    """Both ways (1) into rows 0 .. 5 of `ways`, over 2^e[side]; row FLEXIBILITY holds 1/K, `ground` is K_n."""
    for side in range(2):
        x, g, wound, own = 1.0 + 0.0 * s_square, side * ground, 1.0 + 0.0 * s_square, 0.0
        for left in range(n, 0, -1):
            j = left - 1 if side else n - left
            before, turned = wound, g + s_square * J[j] * x
            if left > 1:
                wound = turned * ways[FLEXIBILITY, j - side]
            ways[side, j], ways[2 + side, j], ways[4 + side, j] = x, g, before if side else wound
            e[side, j] = own
            x, g = x + wound, turned
            largest = size(x) + size(g)
            if not 1e-100 < largest < 1e100:
                unit = pow2(-exponent(largest))
                x, g, wound, own = x * unit, g * unit, wound * unit, own + exponent(largest)


@jit_apart
def joint(n, J, ways, e):
    """The inertia r at which J abs(x(left) x(right)) is largest."""
    best, top, power = 0, 0.0, 0.0
    for j in range(n):
        felt, own = size(ways[0, j]) * size(ways[1, j]) * J[j], e[0, j] + e[1, j]
        if felt > 0.0 and (not top > 0.0 or felt > scale(top, power - own)):
            best, top, power = j, felt, own
    return best


@jit_apart
def join(n, r, J, k, h, ways, e, left, right):
    """The shape and its strains x_j - x_(j+1) into rows SHAPE and STRAIN; sums J abs x^2, h and k abs strain^2.

    `left`, `right` : the number by which either way is multiplied, about 1/x_r
    """
    solid, viscous, elastic = 0.0, 0.0, 0.0
    for j in range(n):
        of_x, of_strain = int(j > r), int(j >= r)
        unit = right if of_x else left
        x = ways[of_x, j] * unit * scale(1.0, e[of_x, j] - e[of_x, r])
        unit = right if of_strain else -left
        strain = ways[4 + of_strain, j] * unit * scale(1.0, e[of_strain, j] - e[of_strain, r])
        ways[SHAPE, j], ways[STRAIN, j] = x, strain
        solid = fma(J[j], square(x), solid)
        viscous, elastic = fma(h[j], square(strain), viscous), fma(k[j], square(strain), elastic)
    return solid, viscous, elastic


@jit_apart
def mode(n, J, k, h, w, ways, e):
    """The shape of a natural frequency w into `ways`, 1 at some inertia in size; sums as of `join`."""
    for j in range(n):
        ways[FLEXIBILITY, j] = 1.0 / k[j]
    follow(n, J, k[n - 1], -w * w, ways, e)
    r = joint(n, J, ways, e)
    side = 1.0 if ways[0, r] > 0.0 else -1.0  # x_1 is positive
    return join(n, r, J, k, h, ways, e, side / ways[0, r], side / ways[1, r])


@jit_apart
def mode_rows(n, J, k, h, w, W, G, ways, e):
    """Rows W = sqrt(J) x and G = sqrt(k) strains (`_modes`) of a mode, with sum J x^2 = 1."""
    solid, _, _ = mode(n, J, k, h, w, ways, e)
    unit = 1.0 / sqrt(solid)
    for j in range(n):
        W[j], G[j] = sqrt(J[j]) * ways[SHAPE, j] * unit, sqrt(k[j]) * ways[STRAIN, j] * unit
