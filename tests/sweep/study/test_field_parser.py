"""Entries of a study read one by one: values, tables, files and arrays, and every mistake with its place."""

import math
from pathlib import Path

import numpy as np
import pytest

from kernels.interface import Field
from sweep.study import field_parser as module
from sweep.study.field_parser import FieldParser
from sweep.study.mistakes import Mistakes

LENGTH = Field("arm", "m", "length")
WORD = Field("shape", "1", "shape", choices={"round": 0, "square": 3})
ARRAY = Field("J", "kg", "masses", dims=("mass",))
COUNT = Field("n", "1", "how many", integer=True)


@pytest.fixture
def fields(tmp_path):
    return FieldParser(Mistakes(), tmp_path / "study")


@pytest.fixture
def write(fields):
    """Writes a csv file into the study's folder."""
    fields.folder.mkdir()
    return lambda name, text: (fields.folder / name).write_text(text)


def told(fields):
    return {m.where: m.message for m in fields.mistakes.found}


@pytest.mark.parametrize(
    ("entry", "field", "value"),
    [
        (2, LENGTH, 2.0),
        ({"value": 25, "unit": "mm"}, LENGTH, 0.025),
        ({"value": 2.5}, LENGTH, 2.5),
        ("square", WORD, 3.0),
        ({"value": "round"}, WORD, 0.0),
        (7, ARRAY, 7.0),
        ([1, 2.5], ARRAY, [1.0, 2.5]),
        ((1, 2.5), ARRAY, [1.0, 2.5]),
        (np.array([1, 2]), ARRAY, [1.0, 2.0]),
        ({"value": [1, 2], "unit": "g"}, ARRAY, [0.001, 0.002]),
        ({"value": 3, "unit": "g"}, ARRAY, 0.003),
        ("words of what is not known", None, math.nan),
    ],
)
def test_a_quantity_is_a_number_in_the_unit_of_its_field(fields, entry, field, value):
    np.testing.assert_array_equal(fields.quantity(entry, field, "fixed.x"), value)
    assert told(fields) == {}


@pytest.mark.parametrize(
    ("entry", "field", "where", "message"),
    [
        ([1], LENGTH, "fixed.x", "expected a number, found a list; to sweep it, write it under [axes.x]"),
        (
            {"value": [1]},
            LENGTH,
            "fixed.x.value",
            "expected a number, found a list; to sweep it, write it under [axes.x]",
        ),
        ("squar", WORD, "fixed.x", 'expected "round" or "square", found "squar"; did you mean square?'),
        ({"value": 1, "unit": "m"}, WORD, "fixed.x.unit", "shape takes words, which have no unit; leave it out"),
        ({"value": 1, "file": "a"}, ARRAY, "fixed.x", "value and file exclude each other; keep one"),
        ([1, "a"], ARRAY, "fixed.x[1]", 'expected a number, found "a"'),
        ({"value": "a"}, ARRAY, "fixed.x.value", 'expected a number, found "a"'),
        ({"value": 1, "unit": "kg"}, LENGTH, "fixed.x.unit", '"kg" is a mass; arm is a length, e.g. "m" or "mm"'),
    ],
)
def test_a_quantity_that_is_wrong_is_told_where(fields, entry, field, where, message):
    fields.quantity(entry, field, "fixed.x")
    found = told(fields)
    assert found[where] == message
    assert set(found) <= {where, "fixed.x.file", "fixed.x.value"}


def test_an_axis_keeps_how_it_is_written(fields):
    entry = {"spacing": "linear", "start": 1, "stop": 3, "num": 3, "unit": "cm"}
    found = fields.axis("arm", entry, LENGTH, "axes.arm")
    assert found.values.tolist() == [0.01, 0.02, 0.03]
    assert (found.spacing, found.words, found.entry) == ("linear", None, entry)
    assert [type(found.entry[key]) for key in ("start", "num")] == [float, int]
    listed = fields.axis("shape", ["square", "round"], WORD, "axes.shape")
    assert (listed.values.tolist(), listed.words, listed.spacing, listed.entry) == (
        [3.0, 0.0], ("square", "round"), "values", None,
    )  # fmt: skip
    rows = fields.axis("J", {"values": [[1, 2], [3, 4], [5, 6]], "unit": "g"}, ARRAY, "axes.J")
    assert rows.values.tolist() == [[0.001, 0.002], [0.003, 0.004], [0.005, 0.006]]
    assert told(fields) == {}


@pytest.mark.parametrize(
    ("entry", "field", "where", "message"),
    [
        (
            {"spacing": "log", "start": 1, "stop": 2, "num": 3},
            ARRAY,
            ".spacing",
            "x has a value for each mass; give values or a file",
        ),
        (
            {"spacing": "log", "start": 1, "stop": 2, "num": 3},
            WORD,
            "",
            'shape takes words; write e.g. values = ["round", "square"]',
        ),
        ([[1, 2], [3]], ARRAY, "", "expected lists of equal length, found 1 and 2 values"),
        ([[1, 2, 3], [3], [1, 2]], ARRAY, "", "expected lists of equal length, found 1 and 3 values"),
        ([1, 2], ARRAY, "", "expected a list of lists, one for each cell; write e.g. [[1.0, 2.0], [1.5, 2.0]]"),
        ([], ARRAY, "", "has no values; give at least one"),
        (
            {"values": [1], "file": "a", "spacing": "log"},
            LENGTH,
            "",
            "spacing, values and file exclude each other; keep one",
        ),
        ({"file": 3}, ARRAY, ".file", 'expected the name of a csv file, found 3; write e.g. "points.csv"'),
        (
            {"spacing": "linear", "start": 2, "stop": 2, "num": 3},
            LENGTH,
            ".stop",
            "equals start; for a single value write values = [2]",
        ),
        (
            {"spacing": "log", "start": 1e-320, "stop": 1, "num": 3, "unit": "nm"},
            LENGTH,
            "",
            "9.99989e-321 to 1 leaves the range of float64 once converted to the kernel's unit",
        ),
    ],
)
def test_an_axis_that_is_wrong_is_told_where(fields, entry, field, where, message):
    assert len(fields.axis("x", entry, field, "axes.x")) == 0
    assert told(fields) == {f"axes.x{where}": message}


def test_three_bad_values_are_told_and_the_rest_counted(fields):
    fields.axis("x", ["a", 1, "b", "c"], LENGTH, "axes.x")
    assert list(told(fields)) == ["axes.x[0]", "axes.x[2]", "axes.x[3]"]
    more = FieldParser(Mistakes(), Path())
    more.axis("x", ["a", 1, "b", "c", "d", "e"], LENGTH, "axes.x")
    assert [m.message for m in more.mistakes.found][3:] == ["and 2 more like these"]


def test_a_list_may_be_as_long_as_the_longest_axis(fields, monkeypatch):
    monkeypatch.setattr(module.axes, "LARGEST_AXIS", 3)
    assert len(fields.axis("x", [1, 2, 3], LENGTH, "axes.x")) == 3
    assert len(fields.axis("x", np.ones(3), LENGTH, "axes.x")) == 3
    assert fields.axis("J", np.ones((3, 2)), ARRAY, "axes.J").values.shape == (3, 2)
    assert told(fields) == {}
    for at, given in enumerate(([1, 2, 3, 4], np.ones(4))):
        fields.axis("x", given, LENGTH, f"axes.x{at}")
    fields.axis("J", np.ones((4, 2)), ARRAY, "axes.J")
    assert set(told(fields).values()) == {"expected at most 3 values, found 4"}
    assert len(told(fields)) == 3


def test_arrays_of_a_file_are_its_numbered_columns(fields, write):
    write("J.csv", "J_1,k,J_2,J_3\n1,0,2,3\n4,0,5,6\n")
    found = fields.axis("J", {"file": "J.csv", "unit": "g"}, ARRAY, "axes.J")
    assert found.values.tolist() == [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]]
    assert fields.quantity({"file": "J.csv"}, Field("k", "1", "", dims=("mass",)), "fixed.k").tolist() == [0.0, 0.0]
    assert told(fields) == {}


def test_a_file_is_in_the_folder_of_the_study_unless_a_program_says_otherwise(fields, write, tmp_path):
    write("a.csv", "x\n1\n")
    (tmp_path / "b.csv").write_text("x\n2\n")
    assert fields.axis("x", {"file": "a.csv"}, LENGTH, "axes.x").values.tolist() == [1.0]
    assert fields.axis("x", {"file": tmp_path / "b.csv"}, LENGTH, "axes.x").values.tolist() == [2.0]
    assert told(fields) == {}
    fields.axis("x", {"file": "../b.csv"}, LENGTH, "axes.x")
    said = '"../b.csv" cannot be read: it is outside of the study\'s folder; put a copy beside it'
    assert told(fields) == {"axes.x.file": said}


def test_words_and_numbers_of_a_file(fields, write):
    write("a.csv", "shape\nsquare\n  round\n")
    assert fields.axis("shape", {"file": "a.csv"}, WORD, "axes.shape").words == ("square", "round")
    write("b.csv", "x\n1e3\n nan\n")
    np.testing.assert_array_equal(fields.axis("x", {"file": "b.csv"}, LENGTH, "axes.x").values, [1e3, np.nan])


@pytest.mark.parametrize("word", ["one", "1_0"])
def test_a_word_among_numbers_of_a_file_is_told_with_its_line(fields, write, word):
    write("c.csv", f"x\n1\n{word}\n")
    fields.axis("x", {"file": "c.csv"}, LENGTH, "axes.x")
    (message,) = told(fields).values()
    assert message.endswith(f'c.csv, line 3: expected a number, found "{word}"')


SHARES = np.array([0.0, 0.5])
ENDS = {"spacing": "linear", "start": 1.0, "stop": 3.0}


def test_a_sampled_axis_lies_at_its_shares(fields):
    found = fields.sampled("arm", {**ENDS, "unit": "cm"}, LENGTH, "axes.arm", SHARES)
    assert (found.values.tolist(), found.spacing) == ([0.01, 0.02], "linear")
    assert found.entry == {**ENDS, "unit": "cm"}


@pytest.mark.parametrize(
    ("entry", "field", "where", "message"),
    [
        (ENDS, ARRAY, "", "x is an array, which is not sampled; sweep it in a block of its own"),
        (ENDS, COUNT, "", "x is a whole number, which is not sampled; sweep it in a block of its own"),
        ({**ENDS, "star": 1}, LENGTH, ".star", "no such key; did you mean start?"),
        ({"spacing": "log", "start": 0, "stop": 3.0}, LENGTH, ".start", "a log axis needs start > 0, found 0"),
        ({"spacing": "log", "start": 1, "stop": -3.0}, LENGTH, ".stop", "a log axis needs stop > 0, found -3"),
        ({"start": 1, "stop": 3.0}, LENGTH, ".spacing", 'missing; write spacing = "linear" or "log"'),
    ],
)
def test_a_sampled_axis_that_is_wrong_is_told_where(fields, entry, field, where, message):
    assert len(fields.sampled("x", entry, field, "axes.x", SHARES)) == 0
    assert told(fields) == {f"axes.x{where}": message}
