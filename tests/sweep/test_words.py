"""Tables in a terminal."""

import os
import re

import pytest

from sweep import words as table

WORDS = "one two three four five six seven eight nine ten eleven twelve thirteen fourteen"


@pytest.mark.parametrize("wide", [20, 30, 40, 60, 80, 200])
def test_cells_are_wrapped_until_the_table_is_no_wider_than_the_terminal(monkeypatch, wide):
    monkeypatch.setattr("shutil.get_terminal_size", lambda fallback: os.terminal_size((wide, 24)))
    told = table.Table([("name", WORDS[:30], WORDS), (WORDS[10:40], "n", "short")]).text()
    assert max(map(len, told.splitlines())) <= max(wide, len("  three  three  fourteen"))
    assert sorted(told.split()) == sorted(f"name {WORDS[:30]} {WORDS} {WORDS[10:40]} n short".split())
    assert len(table.Table([(WORDS, WORDS)]).text(wide=True).splitlines()[0]) > len(WORDS) + 10


def test_a_table_is_text_and_html_and_nothing_without_rows():
    told = table.Table([("a<b", "1"), ("c", "22")], ("name", "count"), "Title")
    assert told.text() == "Title\n  name  count\n  a<b   1\n  c     22"
    assert re.sub(" style='[^']*'", "", told.html()) == (
        "<h2>Title</h2>\n<table><tr><th>name</th><th>count</th></tr>"
        "<tr><td>a&lt;b</td><td>1</td></tr><tr><td>c</td><td>22</td></tr></table>"
    )
    assert table.Table([], ("name",), "Title").text() == table.Table([], ("name",)).html() == ""


def test_the_rest_of_a_long_line_stands_below_its_last_column(monkeypatch):
    monkeypatch.setattr("shutil.get_terminal_size", lambda fallback: os.terminal_size((80, 24)))
    path = "/a/path/that/is/longer/than/any/line/of/a/terminal/and/must/not/be/torn/results.h5"
    told = table.paragraph(f"study.toml: 1 mistake\n  axes.mu  {WORDS}, see\n  axes.mu  {path}").splitlines()
    assert told[0] == "study.toml: 1 mistake"
    assert all(len(row) <= 80 or path in row for row in told)
    assert {row.index(row.split()[0]) for row in told[2:] if "axes" not in row} == {11}


def test_what_a_terminal_would_obey_is_shown():
    assert table.printable("a\x1b[31m\x7f\x9f\xa0\n\tb\r") == "a\\x1b[31m\\x7f\\x9f\xa0\n\tb\\x0d"
    assert table.printable("\x00\x1f \udc80") == "\\x00\\x1f \\udc80"


@pytest.mark.parametrize("text", ["=1+1", "+x", "-x", "@x", "\tx", "\rx"])
def test_a_formula_of_a_spreadsheet_begins_with_an_apostrophe_and_no_number_does(text):
    assert table.cell(text) == f"'{text}"
    for value in ("-1.5", "+3e4", "-inf", "x=1", "", 3.0, None):
        assert table.cell(value) == value
