"""Units at the border: factors, traps, and what is said of a wrong one."""

import math
import subprocess
import sys
from decimal import Decimal

import pytest

from sweep.study.units import UnitMistake, scale


@pytest.mark.parametrize(
    ("given", "wanted", "factor"),
    [
        ("degree", "rad", math.pi / 180),
        ("ms", "s", 0.001),
        ("g cm^2", "kg m^2", 1e-7),
        ("rpm", "rad/s", 2 * math.pi / 60),
        ("rpm", "Hz", 1 / 60),
        ("percent", "1", 0.01),
        ("", "1", 1),
        ("mm/s", "m/s", 0.001),
        ("degree/s^2", "rad/s^2", math.pi / 180),
        ("N m/degree", "N m/rad", 180 / math.pi),
    ],
)
def test_a_unit_becomes_the_factor_to_the_field(given, wanted, factor):
    assert float(scale(given, wanted, "x")) == pytest.approx(factor, rel=2.3e-16)  # an ulp: factor is rounded too


def test_the_unit_of_the_field_needs_no_conversion_and_no_pint():
    code = (
        "import sys; from sweep.study.units import scale; scale('rad/s', 'rad/s', 'x'); sys.exit('pint' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(("given", "wanted", "turns"), [("Hz", "rad/s", 1), ("kHz", "rad/s", 1000)])
def test_one_hertz_is_a_full_turn_per_second(given, wanted, turns):
    assert float(scale(given, wanted, "omega_n")) == pytest.approx(2 * math.pi * turns, rel=2.3e-16)


def test_radians_per_second_given_for_a_frequency_are_divided_by_a_turn():
    assert float(scale("rad/s", "Hz", "f")) == 1 / (2 * math.pi)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [("1/s", "rad/s"), ("1/s", "Hz"), ("1", "rad"), ("N m", "N m/rad"), ("N m/(kg m^2)", "rad/s^2")],
)
def test_rad_may_be_left_out(given, wanted):
    assert scale(given, wanted, "x") == Decimal(1)


@pytest.mark.parametrize(
    "text", ["m/", "(((", "m*", "rad s-2", "3 m", "m**m", "m^", "\n", "m;m", "__import__('os')", "💥"]
)
def test_malformed_units_are_refused_without_a_traceback(text):
    with pytest.raises(UnitMistake, match=r"is not a known unit|cannot be read as a unit|is a plain number"):
        scale(text, "m", "x")
