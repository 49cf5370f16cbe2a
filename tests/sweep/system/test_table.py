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


def test_a_narrow_terminal_leaves_thirty_columns(terminal):
    terminal(20)
    first = table.columns([("name", WORDS)]).splitlines()[0]
    assert first == "  name  one two three four five six"


def test_a_column_that_is_empty_everywhere_takes_no_room(terminal):
    terminal(80)
    assert table.columns([("a", "", "b"), ("c", "", "d")]) == "  a  b\n  c  d"
