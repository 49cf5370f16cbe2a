"""Adaptive quadrature of a pool of panels against integrals in closed form."""

import math

import numpy as np
import pytest

from kernels.lanes.jit import jit_call
from kernels.lanes.vectors import magnitude
from kernels.maths.quadrature import POOL, adapt, nodes, open_panel

PEAK, OSCILLATION, ROOT = 0, 1, 2


@jit_call
def integrand(kind, nodes, count, width):
    """A peak at 0.3, which only panels far narrower than the stretch see, a fast oscillation, or a root of abs x."""
    for j in range(count):
        x = nodes.x[j]
        wave = math.cos(x / width) if kind == OSCILLATION else math.sqrt(magnitude(x))
        nodes.value[j] = 1.0 / (width**2 + (x - 0.3) ** 2) if kind == PEAK else wave
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


def test_where_a_root_turns_between_nodes_the_error_told_holds_but_in_a_few_per_cent():
    """In 97 %; the plain difference of the two rules in 91 %."""
    random, held = np.random.default_rng(1), []
    for _ in range(600):
        low, rtol = random.uniform(-0.95, -0.05), 10.0 ** random.uniform(-7, -2)
        value, error = integrated([(ROOT, low, low + 1.0)], 1.0, rtol)
        held.append(abs(value - ((-low) ** 1.5 + (low + 1.0) ** 1.5) / 1.5) <= error)
    assert np.mean(held) > 0.95
