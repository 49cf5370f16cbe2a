"""Text for people: tables, lists, suggestions for misspelt words, times, sizes; checks of arguments."""

from __future__ import annotations

import contextlib
import difflib
import itertools
import math
import operator
import os
import re
import shutil
import textwrap
from collections.abc import Iterable, Sequence
from html import escape
from numbers import Integral, Real
from pathlib import Path
from typing import Any

from sweep.errors import SweepError

CONTROL = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\n\t"}
"""Characters that a terminal interprets as commands, and their printed form."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet interprets a cell that begins with one of these as a formula."""

SHORTEST = 0.1
"""Shortest time that is reported, so that no line says 0."""
LAST = 30
"""Least width of the last column of a table while others can shrink."""


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


class Table:
    """Rows of texts of one length, below headings and a title; as text for a terminal, as HTML for a page.

    Nothing where no rows are.
    """

    def __init__(self, rows: Iterable[Sequence[str]], headings: Sequence[str] = (), title: str = "") -> None:
        self.rows, self.headings, self.title = [list(row) for row in rows], list(headings), title

    def __repr__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        return self.html()

    def text(self, indent: str = "  ", wide: bool = False) -> str:
        """Lines no wider than the terminal, where words allow it.

        The last cell is wrapped, down to `LAST` characters; where that is not enough, so are the widest, unless the
        table may be `wide`.
        """
        if not self.rows:
            return ""
        rows = [self.headings, *self.rows] if self.headings else self.rows
        texts = list(zip(*rows, strict=True))
        widths = [max(map(len, column)) for column in texts]
        words = [max((len(word) for text in column for word in text.split()), default=0) for column in texts]
        # a column that is empty everywhere takes no room
        room = width() - len(indent) - 2 * sum(map(bool, widths[:-1]))
        widths[-1] = min(widths[-1], max(room - sum(widths[:-1]), LAST))
        while not wide and sum(widths) > room and any(map(operator.gt, widths, words)):
            widest = max((size, i) for i, size in enumerate(widths) if size > words[i])[1]
            widths[widest] -= 1
        lines = [self.title] if self.title else []
        for row in rows:
            cells = [_wrapped(text, size) for text, size in zip(row, widths, strict=True)]
            for parts in list(itertools.zip_longest(*cells, fillvalue="")) or [()]:
                beside = zip(parts, widths, strict=False)
                lines.append((indent + "".join(part.ljust(size + 2 if size else 0) for part, size in beside)).rstrip())
        return "\n".join(lines)

    def html(self) -> str:
        """`<h2>` and `<table>`, with the texts escaped; notebooks would align cells to the right by themselves."""
        if not self.rows:
            return ""
        title = f"<h2>{escape(self.title)}</h2>\n" if self.title else ""
        lines = [("th", self.headings)] * bool(self.headings) + [("td", row) for row in self.rows]
        body = ["".join(f"<{tag} style='text-align:left'>{escape(text)}</{tag}>" for text in row) for tag, row in lines]
        return f"{title}<table>{''.join(f'<tr>{cells}</tr>' for cells in body)}</table>"


def paragraph(text: str) -> str:
    """Lines, each wrapped at the terminal's width; continuation lines are indented to its last column."""
    room, lines = width(), list[str]()
    for line in text.splitlines():
        columns = (match.end() for match in re.finditer("^ +|  +", line))
        below = " " * max((column for column in columns if column <= room - LAST), default=0)
        lines += _wrapped(line, room, below) if len(line) > room and " " in line.strip() else [line]
    return "\n".join(lines)


def _wrapped(text: str, size: int, below: str = "") -> list[str]:
    """Words are kept whole, lest a path be torn."""
    return textwrap.wrap(text, max(size, 1), subsequent_indent=below, break_on_hyphens=False, break_long_words=False)


def page(*sections: str) -> str:
    """Sections with an empty line between them."""
    return "\n\n".join(text for text in sections if text)


def listed(words: Iterable[str], quote: bool = False, word: str = "or") -> str:
    """'a, b or c', at most a dozen of them."""
    texts = [f'"{w}"' if quote else w for w in words]
    if len(texts) > 12:
        texts = [*texts[:11], f"{len(texts) - 11} more"]
    return f" {word} ".join([", ".join(texts[:-1]), texts[-1]]) if len(texts) > 1 else "".join(texts)


def counted(count: int, noun: str) -> str:
    """'1 cell', '1,401 cells'."""
    return f"{count:,} {noun}{'s' * (count != 1)}"


def quoted(words: Iterable[str]) -> str:
    """'"a", "b"'."""
    return ", ".join(f'"{word}"' for word in words)


def did_you_mean(found: Any, words: Iterable[str]) -> str:
    """'; did you mean x?', or nothing where no word is near."""
    near = nearest(found, words)
    return f"; did you mean {near}?" if near else ""


def nearest(found: Any, words: Iterable[str]) -> str:
    """The word that is most like what was found; "" where none is."""
    if not isinstance(found, str):
        return ""
    by_lower = {w.lower(): w for w in words}
    near = difflib.get_close_matches(found.lower(), by_lower, n=1, cutoff=0.5)
    return by_lower[near[0]] if near else ""


def speed(rate: float) -> str:
    """`5,100 cells/s`, `0.25 cells/s`."""
    return f"{rate:,.0f} cells/s" if rate >= 9.5 else f"{rate:.2g} cells/s"


UNITS = ("d", 86400.0), ("h", 3600.0), ("min", 60.0), ("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)


def duration(seconds: float) -> str:
    """A time in three digits: `5.1 ns`, `20 us`, `3.4 ms`, `42 s`, `3.08 min`, `7.2 h`."""
    seconds = float(f"{seconds:.3g}")
    unit, size = next((unit for unit in UNITS if seconds >= unit[1]), UNITS[-1])
    return f"{seconds / size:.3g} {unit}"


def one_digit(seconds: float) -> str:
    """A time rounded up to one digit, as one tells what is not known better: `0.3 s`, `40 s`, `4 min`, `2 h`."""
    unit, size = next((unit for unit in UNITS[:4] if seconds >= unit[1]), UNITS[3])
    count = max(seconds, SHORTEST) / size
    digit = 10.0 ** math.floor(math.log10(count))
    return f"{math.ceil(count / digit - 1e-9) * digit:g} {unit}"


def number(what: str, value: Any) -> float:
    """A number; raises SweepError for what is none."""
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        if not isinstance(value, str):
            return float(value)
    raise SweepError(f"{what}: expected a number, found {repr(value) if isinstance(value, str) else kind(value)}")


def several(what: str, given: Any) -> list[Any]:
    """Names or numbers in their order, each once, of several or of one alone. Raises SweepError for what is neither."""
    alone = isinstance(given, str | Real) or not isinstance(given, Iterable) or getattr(given, "ndim", 1) == 0
    found = [given] if alone else [*given]
    if not all(isinstance(one, str | Real) for one in found):
        raise SweepError(f"{what}: expected a list of names or numbers, or one alone; found {kind(given)}")
    return list(dict.fromkeys(found))


def whole_number(what: str, value: Any, least: int = 1) -> int:
    """The number, if it is a whole one from the least on. Raises SweepError."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) < 2**63:
        raise SweepError(f"{what}: expected a whole number of at least {least}, found {value!r}")
    return int(value)


def flag(what: str, value: Any) -> bool:
    """A truth value. Raises SweepError for all else, lest force="no" overwrites."""
    if isinstance(value, bool) or type(value).__name__ == "bool":  # of numpy
        return bool(value)
    raise SweepError(f"{what}: expected True or False, found {kind(value)}")


def a_name(what: str, value: Any) -> str:
    """A text. Raises SweepError for all else."""
    if isinstance(value, str):
        return value
    raise SweepError(f"{what}: expected a name, found {kind(value)}")


def function(what: str, value: Any) -> Any:
    """What can be called; a class is no function. Raises SweepError for all else."""
    if callable(value) and not isinstance(value, type):
        return value
    raise SweepError(f"{what}: expected a function, found {kind(value)}")


def seconds_of(name: str, text: float | str) -> float:
    """Seconds, from a number or from words as `duration` says them: "90", "60s", "5 min", "1 h". Raises SweepError."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([a-z]*)\s*", str(text))
    try:
        found = float(match[1]) * dict(UNITS)[match[2] or "s"] if match else math.nan
    except (ValueError, KeyError):
        found = math.nan
    if not 0.0 < found < math.inf:
        raise SweepError(f'{name}: expected a time like "60s", "5 min" or "1 h", found {text!r}')
    return found


def percent(share: float) -> str:
    """`7 %`, `99.9 %`: rounded down, so that 100 % are all; but what rounding of the share took is given back."""
    return f"{math.floor(1000 * share + 1e-9) / 10:g} %"


def quantity(count: float) -> str:
    """Bytes as people say them: `812 B`, `1.3 kB`, `42 MB`."""
    units = ["B", "kB", "MB", "GB", "TB", "PB"]
    while count >= 999.5 and len(units) > 1:
        count, units = count / 1000, units[1:]
    return f"{count:.3g} {units[0]}"


def require_dataset(name: str, given: Any, maker: str = "") -> None:
    """Refuses what is no Dataset: a SweepError with the way from what was given to one, where there is a way.

    `maker` makes those that will do for the function `name`, where not every Dataset will.
    """
    import xarray as xr  # most of a short run's time

    if isinstance(given, xr.Dataset):
        return
    cure = f"sweep.{maker} gives one" if maker else "sweep.run and sweep.open_result give one"
    if not maker and isinstance(given, str | os.PathLike):
        cure = f'open the file first: sweep.open_result("{os.fspath(given)}")'
    elif not maker and hasattr(given, "kernel_name"):
        cure = "run the study first: sweep.run(study)"
    raise SweepError(f"sweep.{name}: expected a Dataset, found {kind(given)}; {cure}")


def as_path(given: Any) -> Path:
    """What names a file or a folder. Raises SweepError where it is no name."""
    if isinstance(given, str | os.PathLike):
        return Path(given)
    raise SweepError(f'expected a path, e.g. "out.h5"; found an object of type {type(given).__name__}')


def kind(value: Any) -> str:
    """'a list', 'an int', 'nothing'."""
    word = type(value).__name__
    return "nothing" if value is None else f"{'an' if word[0].lower() in 'aeiou' else 'a'} {word}"
