"""How mistakes are worded: numbers, counts, lists and limits, each from both sides of where the text changes."""

import math
import re

import numpy as np
import pytest

from kernels.interface import Field
from sweep.study import mistakes as module
from sweep.study.mistakes import Mistakes, did_you_mean, exact_float, limits, listed, quoted, show


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        ("x" * 60, '"' + "x" * 60 + '"'),
        ("x" * 61, '"' + "x" * 57 + '..."'),
        ({}, "a table"),
        ((1,), "a list"),
        (None, "nothing"),
        (10**40 - 1, "9" * 40),
        (10**40, "an integer of more than 40 digits"),
        (-(10**40), "an integer of more than 40 digits"),
        (np.float64(0.1), "0.1"),
        (b"x", "a bytes"),
    ],
)
def test_what_was_found_is_shown_in_short(value, text):
    assert show(value) == text


def test_a_dozen_words_are_listed_and_of_more_eleven():
    words = [f"w{k}" for k in range(13)]
    assert listed(words[:12]) == ", ".join(words[:11]) + " or w11"
    assert listed(words) == ", ".join(words[:11]) + " or 2 more"
    assert (listed([]), listed(["a"]), listed(["a", "b"], quote=True, word="and")) == ("", "a", '"a" and "b"')
    assert quoted(["a", "b"]) == '"a", "b"'


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({}, ""),
        ({"lower": 0}, ">= 0"),
        ({"lower": 0, "open_lower": True}, "> 0"),
        ({"upper": 1}, "<= 1"),
        ({"upper": math.nextafter(1, 0)}, "< 1"),
        ({"lower": -2.5, "upper": 10}, ">= -2.5, <= 10"),
        ({"choices": {"a": 0, "b": 1, "c": 2}}, '"a", "b" or "c"'),
    ],
)
def test_limits_of_a_field(keys, text):
    assert limits(Field("x", "1", "", **keys)) == text


def test_the_nearest_name_is_offered_in_its_own_letters_if_it_is_half_alike():
    assert did_you_mean("MU", ["Mu", "a"]) == "; did you mean Mu?"
    assert did_you_mean("abcd", ["abxy"]) == "; did you mean abxy?"  # just half
    assert did_you_mean("abcd", ["axyz"]) == ""
    assert did_you_mean(3, ["3"]) == ""


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("5e-3", 'expected a number, found "5e-3"; drop the quotes'),
        (" 60 degree ", 'expected a number, found " 60 degree "; write { value = 60, unit = "degree" }'),
        ("-1_000", 'expected a number, found "-1_000"; drop the quotes'),
        ("+.5E+3 m", 'expected a number, found "+.5E+3 m"; write { value = +.5E+3, unit = "m" }'),
        ("much", 'expected a number, found "much"'),
        (True, "expected a number, found true"),
        (10**400, "an integer of more than 40 digits is larger than any float64"),
        (2**53 + 1, "9007199254740993 is not exact as a float64; write 9007199254740992.0 if that is meant"),
        ([1], "expected a number, found a list"),
    ],
)
def test_what_is_no_float_is_told_with_the_cure(value, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        exact_float(value)


def test_numbers_of_numpy_and_large_whole_ones_are_taken():
    assert exact_float(np.array(2.5)) == 2.5
    assert exact_float(np.int8(3)) == 3.0
    assert exact_float(2**53) == 2.0**53


@pytest.fixture
def found():
    return Mistakes()


def told(found):
    return [(m.where, m.message) for m in found.found]


def test_a_number_that_is_not_finite_is_told_once(found):
    assert math.isnan(found.finite("x", "a"))
    assert found.finite(math.inf, "b") == math.inf
    assert math.isnan(found.finite(math.nan, "c"))
    assert found.finite(1.0, "d") == 1.0
    assert found.number(math.inf, "e") == math.inf
    assert [where for where, _ in told(found)] == ["a", "b", "c"]
    assert told(found)[1][1] == "expected a finite number, found inf"


def test_a_count_is_from_two_to_the_largest(found):
    assert [found.count(n, "n", 5) for n in (1, 2, 5, 6, 2.0, True, np.int64(3))] == [None, 2, 5, None, None, None, 3]
    found.count(1, "m", 5, "; so")
    assert [message for _, message in told(found)] == [
        "expected at least 2, found 1",
        "expected at most 5, found 6",
        "expected a whole number, found 2.0",
        "expected a whole number, found true",
        "expected at least 2, found 1; so",
    ]


def test_words_are_known_and_stand_once(found):
    assert found.words(["a", "x", "a"], "w", ["a", "b"], "a list") == ["a", "a"]
    assert found.words("a", "v", ["a"], "a list", "; so") == []
    assert found.words([], "u", ["a"], "a list") == []
    assert found.words(["any"], "t", None, "a list") == ["any"]
    assert told(found) == [
        ("w[1]", 'expected "a" or "b", found "x"'),
        ("w[2]", '"a" stands twice'),
        ("v", 'expected a list, found "a"; so'),
        ("u", "expected a list, found an empty list"),
    ]


def test_keys_are_told_where_they_stand(found):
    found.keys({"nun": 1, "num": 2}, ["num"], "axes.mu")
    found.keys({"xyz": 1}, ["num", "start"])
    assert told(found) == [
        ("axes.mu.nun", "no such key; did you mean num?"),
        ("xyz", "no such key; allowed are num or start"),
    ]


def test_texts_and_tables(found):
    assert (found.text("a", "x"), found.text(1, "x")) == ("a", "")
    assert (found.table({"a": 1}, "y", "e"), found.table(1, "y", "e")) == ({"a": 1}, {})
    assert told(found) == [("x", "expected text in quotes, found 1"), ("y", "expected a table, found 1; write e.g. e")]


def test_mistakes_are_raised_together_and_none_is_none(found):
    found.raise_if_any("x.toml")
    found.add("a", "b")
    with pytest.raises(module.StudyError, match=r"x\.toml"):
        found.raise_if_any("x.toml")
