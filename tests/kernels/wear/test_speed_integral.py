"""The speed between tool and work along an arc, against quadrature in 30 digits."""

import mpmath
import pytest

from kernels.wear._speed_integral import along_arc


def by_quadrature(p, q, psi):
    """The left side of (2)."""
    with mpmath.workdps(30):
        p, q, psi = mpmath.mpf(p), mpmath.mpf(q), mpmath.mpf(psi)

        def speed(a):
            return mpmath.sqrt((p * mpmath.cos(a / 2)) ** 2 + (q * mpmath.sin(a / 2)) ** 2)

        return mpmath.quad(speed, mpmath.linspace(0, psi, 9))


@pytest.mark.parametrize("psi", [0.1, 1.0, 2.5, 3.0])
@pytest.mark.parametrize(("p", "q"), [(1.0, 1.0), (1.0, 0.9), (0.3, 2.0), (5.0, 0.01), (1.0, 1e-4), (2.0, 1.2)])
def test_the_integral_along_an_arc_is_right_to_some_ulp(p, q, psi):
    s, c = float(mpmath.sin(mpmath.mpf(psi) / 2)), float(mpmath.cos(mpmath.mpf(psi) / 2))
    assert along_arc(p, q, s, c) == pytest.approx(float(by_quadrature(p, q, psi)), rel=3e-15)
