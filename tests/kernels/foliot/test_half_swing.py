"""Pieces of the half swing that whole swings hardly show."""

import math
from itertools import product

import numpy as np
import pytest

from kernels.foliot._half_swing import _released
from kernels.foliot._swing_law import Ripple, Terms

DEPTH, KAPPA = 0.6, 0.05


def drive(x, slack, wave):
    """Torque and spring less dry friction."""
    return slack + KAPPA * x + DEPTH * np.cos(wave * (1.0 - x))


CASES = product((1.7, 2.4, 3.1), (-0.55, -0.3, 0.2), (0.5 * math.pi, 2.0 * math.pi, 5.0 * math.pi))
HELD = [case for case in CASES if drive(*case) <= 0.0]


@pytest.mark.parametrize(("x", "slack", "wave"), HELD)
def test_a_held_foliot_is_let_go_at_the_first_place_inwards_where_the_drive_wins(x, slack, wave):
    places = np.linspace(x, -1.0, 2_000_001)
    wins = drive(places, slack, wave) > 0.0
    first = places[np.argmax(wins)] if wins.any() else -1.0
    terms = Terms(0.0, (0.0, 1.0, 0.0), KAPPA, Ripple(DEPTH, wave), (1.0, 1.0, 1.0))
    assert _released(x, slack, terms) == pytest.approx(first, abs=2e-6)
