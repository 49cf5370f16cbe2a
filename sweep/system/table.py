"""Plain text in columns, for the command line."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

CONTROL = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\n\t"}
"""Characters that a terminal takes for commands, and what is shown of them."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet takes a cell that begins so for a formula."""


def printable(text: str) -> str:
    """A text from elsewhere, which a terminal shows and does not obey."""
    return text.translate(CONTROL).encode(errors="backslashreplace").decode()


def cell(value: Any) -> Any:
    """A value of a csv table; a text that a spreadsheet would run begins with an apostrophe, a number does not."""
    if not isinstance(value, str) or not value.startswith(FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def columns(rows: Iterable[Sequence[str]], indent: str = "  ") -> str:
    """Rows with their cells one below the other; the last cell is wrapped at the width of the terminal."""
    rows = [list(row) for row in rows]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)] if rows else []
    # a column that is empty everywhere takes no room
    widths = [width + 2 if width else 0 for width in widths]
    room = max(shutil.get_terminal_size((120, 24)).columns - len(indent) - sum(widths), 30)
    lines = []
    for *cells, last in rows:
        start = indent + "".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        wrapped = textwrap.wrap(last, room) or [""]
        lines.append(start + ("\n" + " " * len(start)).join(wrapped))
    return "\n".join(line.rstrip() for line in "\n".join(lines).splitlines())


def section(title: str, rows: Iterable[Sequence[str]]) -> str:
    """A title with rows below it; nothing where there are none."""
    rows = list(rows)
    return f"{title}\n{columns(rows)}" if rows else ""


def page(*sections: str) -> str:
    """Sections with an empty line between them."""
    return "\n\n".join(text for text in sections if text)
