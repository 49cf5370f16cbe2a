"""Plain text in columns, for the command line."""

from __future__ import annotations

import itertools
import operator
import shutil
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

CONTROL = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\n\t"}
"""Characters that a terminal takes for commands, and what is shown of them."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet takes a cell that begins so for a formula."""

LAST = 30
"""Characters that the last column of a table keeps as long as others can give way."""


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


def width() -> int:
    """Characters in a line of the terminal; 80 where there is none."""
    return shutil.get_terminal_size((80, 24)).columns


def columns(rows: Iterable[Sequence[str]], indent: str = "  ", wide: bool = False) -> str:
    """Rows with their cells one below the other, no wider than the terminal where words allow it.

    The last cell is wrapped, down to `LAST` characters; where that is not enough, so are the widest, unless the table
    may be `wide`.
    """
    rows = [list(row) for row in rows]
    if not rows:
        return ""
    texts = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in texts]
    words = [max((len(word) for text in column for word in text.split()), default=0) for column in texts]
    # a column that is empty everywhere takes no room
    room = width() - len(indent) - 2 * sum(map(bool, widths[:-1]))
    widths[-1] = min(widths[-1], max(room - sum(widths[:-1]), LAST))
    while not wide and sum(widths) > room and any(map(operator.gt, widths, words)):
        widest = max((size, i) for i, size in enumerate(widths) if size > words[i])[1]
        widths[widest] -= 1
    lines = []
    for row in rows:
        cells = [_wrapped(text, size) for text, size in zip(row, widths, strict=True)]
        for parts in list(itertools.zip_longest(*cells, fillvalue="")) or [()]:
            beside = zip(parts, widths, strict=False)
            lines.append((indent + "".join(part.ljust(size + 2 if size else 0) for part, size in beside)).rstrip())
    return "\n".join(lines)


def paragraph(text: str) -> str:
    """Lines of text, each wrapped at the width of the terminal."""
    return "\n".join("\n".join(_wrapped(line, width())) for line in text.splitlines())


def _wrapped(text: str, size: int) -> list[str]:
    """Words are kept whole, lest a path be torn."""
    return textwrap.wrap(text, max(size, 1), break_on_hyphens=False, break_long_words=False)


def section(title: str, rows: Iterable[Sequence[str]]) -> str:
    """A title with rows below it; nothing where there are none."""
    rows = list(rows)
    return f"{title}\n{columns(rows)}" if rows else ""


def page(*sections: str) -> str:
    """Sections with an empty line between them."""
    return "\n\n".join(text for text in sections if text)
