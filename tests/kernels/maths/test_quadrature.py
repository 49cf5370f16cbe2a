"""Adaptive quadrature of a pool of panels against integrals in closed form."""

import math

import numpy as np
import pytest

from kernels.lanes.jit import jit_call
from kernels.maths.quadrature import POOL, adapt, nodes, open_panel

PEAK, OSCILLATION = 0, 1


@jit_call
def integrand(kind, nodes, count, width):
    """A peak at 0.3, which only panels far narrower than the stretch see, or a fast oscillation."""
    for j in range(count):
        x = nodes.x[j]
        nodes.value[j] = 1.0 / (width**2 + (x - 0.3) ** 2) if kind == PEAK else math.cos(x / width)
        nodes.doubt[j] = 0.0


def peak(width, low, high):
    return (math.atan((high - 0.3) / width) - math.atan((low - 0.3) / width)) / width


def integrated(stretches, width, rtol):
    pool = np.zeros(POOL)
    for k, (kind, low, high) in enumerate(stretches):
        open_panel(pool, k, float(kind), low, high - low)
    return adapt(integrand, width, pool, nodes(), len(stretches), rtol)


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
@pytest.mark.parametrize("width", [0.3, 1e-2, 1e-5])
def test_a_peak_is_integrated_within_the_error_told(width, rtol):
    value, error = integrated([(PEAK, 0.0, 1.0)], width, rtol)
    assert abs(value - peak(width, 0.0, 1.0)) <= error
    assert 1.2 * rtol * value < error < 2 * rtol * value


def test_panels_of_several_integrals_add_up():
    value, error = integrated([(PEAK, 0.2, 0.4), (OSCILLATION, 0.0, 2.0)], 0.01, 1e-10)
    expected = peak(0.01, 0.2, 0.4) + 0.01 * math.sin(200.0)
    assert abs(value - expected) <= error < 2e-10 * value
