"""A condition part by part: what it computes, what units it has, and what it refuses."""

import numpy as np
import pytest
from toy import KERNEL

from sweep.study.condition import CellCondition, Condition
from sweep.system.errors import SweepError

COLUMNS = {"x": np.array([1.0, 2.0, 3.0]), "y": np.array([3.0, 2.0, 1.0]), "w": np.array(["a", "b", "a"])}


def truth(text):
    return Condition(text, COLUMNS.__getitem__, lambda name: ["a", "b"] if name == "w" else []).truth().tolist()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("x < 2", [1, 0, 0]), ("x <= 2", [1, 1, 0]), ("x > 2", [0, 0, 1]), ("x >= 2", [0, 1, 1]), ("x == y", [0, 1, 0]),
        ("x != y", [1, 0, 1]), ("x + y == 4", [1, 1, 1]), ("x - y == 2", [0, 0, 1]), ("x*y == 3", [1, 0, 1]),
        ("x/y > 1", [0, 0, 1]), ("x**2 > 3", [0, 1, 1]), ("3**x == 27", [0, 0, 1]), ("-x > -2", [1, 0, 0]),
        ("w == 'a'", [1, 0, 1]), ("'a' != w", [0, 1, 0]), ("not w == 'a'", [0, 1, 0]), ("1 < x < y + 1", [0, 1, 0]),
        ("x < 2 or y < 2", [1, 0, 1]), ("x < 3 and y < 3", [0, 1, 0]), ("x > 1 and y > 1 or w == 'a'", [1, 1, 1]),
        ("x < 2 and y > 2 and w == 'b'", [0, 0, 0]), ("x > 9 or y > 9 or x == 1", [1, 0, 0]),
    ],
)  # fmt: skip
def test_a_condition_holds_where_plain_numpy_says(text, found):
    assert truth(text) == [bool(value) for value in found]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("x", "is no condition on the cells"),
        ("x < True", '"True" is not allowed'),
        ("x and y < 1", '"x" is no condition'),
        ("not x", '"x" is no condition'),
        ("w + 1 < 2", '"w" is no number'),
        ("x + 'a' < 2", "\"'a'\" is no number"),
        ("w < 1", "compares words with numbers"),
        ("'a' == 'b'", "compares two constants"),
        ("x > 1 < 2", "compares two constants"),
        ("1 < 2 > x", "compares two constants"),
        ("w == 'c'", 'w is never "c"; it has a or b'),
        ("'c' == w", 'w is never "c"; it has a or b'),
        ("x < [1]", '"[1]" is not allowed'),
        ("x // 2 < 1", '"x // 2" is not allowed'),
        ("x in y", '"x in y" is not allowed'),
        ("+x < 1", '"+x" is not allowed'),
        ("x <", "cannot be read; it may hold names"),
    ],
)
def test_what_is_no_condition_is_told(text, what):
    with pytest.raises(SweepError) as caught:
        truth(text)
    assert f"{text}: {what}" in str(caught.value)


@pytest.mark.parametrize("power", ["0", "10", "2.0", "v0", "-1"])
def test_other_powers_are_refused(power):
    with pytest.raises(SweepError, match="a power is a whole number from 1 to 9"):
        CellCondition(f"v0**{power} > 1", KERNEL)


@pytest.mark.parametrize(
    "text",
    [
        "v0**2 < g*height", "height/v0 < v0/g", "2*height > height + 1", "height < '3 cm'", "-height < 0 and v0 > 0",
        "height*g > v0*v0", "v0/g/height > 1",
    ],
)  # fmt: skip
def test_like_is_compared_with_like(text):
    assert set(CellCondition(text, KERNEL).names) <= {"g", "height", "v0"}


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("v0**2 < height", "v0 ** 2 is in meter^2 second^-2 and height is in meter"),
        ("height - v0 > 1", "height is in meter and v0 is in meter second^-1"),
        ("height*g < v0", "height * g is in meter^2 second^-2 and v0 is in meter second^-1"),
        ("v0/v0 < height", "v0 / v0 is in 1 and height is in meter"),
        ("v0 > 1 or height > v0", "height is in meter and v0 is in meter second^-1"),
    ],
)
def test_unlike_is_refused_with_both_units(text, what):
    with pytest.raises(SweepError) as caught:
        CellCondition(text, KERNEL)
    assert str(caught.value) == f"{text}: {what}; they cannot be compared"


def test_a_number_with_a_unit_is_brought_to_that_of_its_parameter():
    condition = CellCondition("'1.5e1 cm' < height <= '.3 m'", KERNEL)
    assert condition.holds({"height": np.array([0.15, 0.16, 0.3, 0.31])}).tolist() == [False, True, True, False]
    assert condition._factors == {"1.5e1 cm": 0.15, ".3 m": 0.3}
