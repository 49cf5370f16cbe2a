"""Tables in a terminal."""

import os

import pytest

from sweep.system import table

WORDS = "one two three four five six seven eight nine ten eleven twelve thirteen fourteen"


@pytest.fixture
def terminal(monkeypatch):
    """A function that makes the terminal so many columns wide."""
    return lambda wide: monkeypatch.setattr(
        table.shutil, "get_terminal_size", lambda fallback: os.terminal_size((wide, 24))
    )


@pytest.mark.parametrize("wide", [50, 61, 80])
def test_the_last_cell_is_wrapped_at_the_width_of_the_terminal(terminal, wide):
    terminal(wide)
    lines = table.columns([("name", "unit", WORDS), ("n", "m", "short")]).splitlines()
    beside = len("  name  unit  ")
    assert max(map(len, lines)) <= wide
    assert len(lines[0]) + 1 + len(lines[1].split()[0]) > wide  # no word that still had room is below
    assert all(line.startswith(" " * beside) for line in lines[1:-1])
    assert lines[-1] == "  n     m     short"
    assert " ".join(word for line in lines[:-1] for word in line.split()).endswith(WORDS)


@pytest.mark.parametrize("wide", [20, 30, 40, 60, 80, 200])
def test_cells_are_wrapped_until_the_table_is_no_wider_than_the_terminal(terminal, wide):
    terminal(wide)
    told = table.columns([("name", WORDS[:30], WORDS), (WORDS[10:40], "n", "short")])
    assert max(map(len, told.splitlines())) <= max(wide, len("  three  three  fourteen"))
    assert sorted(told.split()) == sorted(f"name {WORDS[:30]} {WORDS} {WORDS[10:40]} n short".split())
    assert len(table.columns([(WORDS, WORDS)], wide=True).splitlines()[0]) > len(WORDS) + 10


def test_a_word_is_never_torn(terminal):
    terminal(20)
    path = "/a/path/that/is/longer/than/the/terminal"
    assert path in table.columns([("name", path)])
    assert path in table.paragraph(f"in {path}")


def test_a_column_that_is_empty_everywhere_takes_no_room(terminal):
    terminal(80)
    assert table.columns([("a", "", "b"), ("c", "", "d")]) == "  a  b\n  c  d"


@pytest.mark.parametrize("wide", range(40, 60))
def test_text_beside_an_empty_column_is_wrapped_where_it_would_be_without(terminal, wide):
    terminal(wide)
    assert table.columns([("a", "", WORDS)]) == table.columns([("a", WORDS)])


def test_what_a_terminal_would_obey_is_shown():
    assert table.printable("a\x1b[31m\x7f\x9f\xa0\n\tb\r") == "a\\x1b[31m\\x7f\\x9f\xa0\n\tb\\x0d"
    assert table.printable("\x00\x1f \udc80") == "\\x00\\x1f \\udc80"


@pytest.mark.parametrize("text", ["=1+1", "+x", "-x", "@x", "\tx", "\rx"])
def test_a_formula_of_a_spreadsheet_begins_with_an_apostrophe(text):
    assert table.cell(text) == f"'{text}"


@pytest.mark.parametrize("value", ["-1.5", "+3e4", "-inf", "x=1", "", 3.0, None])
def test_numbers_and_plain_texts_are_left_alone(value):
    assert table.cell(value) == value


def test_sections_and_pages(terminal):
    terminal(80)
    assert table.section("Title", [("a", "b")]) == "Title\n  a  b"
    assert table.section("Title", []) == ""
    assert table.page("one", "", "two") == "one\n\ntwo"
    assert table.columns([]) == ""
    assert table.columns([("a", "b")], indent="") == "a  b"
    assert table.columns([("a", ""), ("bcd", "e")]) == "  a\n  bcd  e"
