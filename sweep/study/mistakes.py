"""What a study may hold: mistakes are collected, not raised, and each says what was found and what to do."""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from kernels.interface import Field
from sweep.errors import Mistake, StudyError
from sweep.words import did_you_mean as did_you_mean
from sweep.words import listed as listed
from sweep.words import nearest as nearest
from sweep.words import quoted as quoted


class Mistakes:
    """All that is wrong with one study.

    Attributes
    ----------
    unread : bool
        Whether something that holds others was no table, so that what stands in it is not known to be missing.
    meant : set of str
        Parameters and coordinates that misspelt names are taken for.
    """

    def __init__(self) -> None:
        self.found: list[Mistake] = []
        self.unread = False
        self.meant: set[str] = set()

    def __len__(self) -> int:
        return len(self.found)

    def good(self, *places: str) -> bool:
        """Whether nothing is wrong at these places and in what stands below them, so that they can be compared."""
        below = tuple(f"{place}{sign}" for place in places for sign in ".[")
        return not any(m.where in places or m.where.startswith(below) for m in self.found)

    def add(self, where: str, message: str) -> None:
        self.found.append(Mistake(where, message))

    def raise_if_any(self, source: str) -> None:
        if self.found:
            raise StudyError(source, self.found)

    def number(self, value: Any, where: str) -> float:
        """`value` as a float64 without loss; else a mistake, and NaN."""
        try:
            return exact_float(value)
        except ValueError as error:
            self.add(where, str(error))
            return math.nan

    def finite(self, value: Any, where: str) -> float:
        """As `number`, and neither NaN nor infinite."""
        before = len(self)
        result = self.number(value, where)
        if not math.isfinite(result) and len(self) == before:
            self.add(where, f"expected a finite number, found {result}")
        return result

    def count(self, value: Any, where: str, largest: int, cure: str = "") -> int | None:
        """A whole number of values, from 2 to `largest`."""
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            self.add(where, f"expected a whole number, found {show(value)}")
        elif int(value) < 2:
            self.add(where, f"expected at least 2, found {show(value)}{cure}")
        elif int(value) > largest:
            self.add(where, f"expected at most {largest}, found {show(value)}")
        else:
            return int(value)
        return None

    def word(self, value: Any, where: str, allowed: Iterable[str]) -> str | None:
        """One of the words `allowed`."""
        words = list(allowed)
        if isinstance(value, str) and value in words:
            return value
        self.add(where, f"expected {listed(words, quote=True)}, found {show(value)}{did_you_mean(value, words)}")
        return None

    def words(self, value: Any, where: str, allowed: Iterable[str] | None, example: str, cure: str = "") -> list[str]:
        """A list of some of the words `allowed` (None: of any), none twice and not empty."""
        if isinstance(value, str) or not isinstance(value, Sequence) or not value:
            what = "an empty list" if isinstance(value, Sequence) and not isinstance(value, str) else show(value)
            self.add(where, f"expected {example}, found {what}{cure}")
            return []
        words = list(value if allowed is None else allowed)
        for i, item in enumerate(value):
            self.word(item, f"{where}[{i}]", words)
            if item in list(value)[:i]:
                self.add(f"{where}[{i}]", f"{show(item)} stands twice")
        return [item for item in value if item in words]

    def text(self, value: Any, where: str) -> str:
        if isinstance(value, str):
            return value
        self.add(where, f"expected text in quotes, found {show(value)}")
        return ""

    def table(self, value: Any, where: str, example: str) -> Mapping[str, Any]:
        if isinstance(value, Mapping):
            return value
        self.unread = True
        self.add(where, f"expected a table, found {show(value)}; write e.g. {example}")
        return {}

    def keys(
        self, table: Mapping[str, Any], allowed: Iterable[str], where: str = "", says: str = "no such key"
    ) -> dict[str, Any]:
        """The table; a mistake for every key that is not `allowed`, and it stands for the one that is meant."""
        words, found = list(allowed), dict(table)
        for key in table:
            if key not in words:
                meant = nearest(key, words)
                hint = did_you_mean(key, words) or f"; allowed are {listed(words)}"
                self.add(f"{where}.{key}" if where else str(key), f"{says}{hint}")
                if meant:
                    found.setdefault(meant, found.pop(key))
        return found


def exact_float(value: Any) -> float:
    """A number as float64. Raises ValueError with the text for the user."""
    if getattr(value, "ndim", None) == 0:
        value = value.item()  # of numpy
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ValueError(f"expected a number, found {show(value)}{_cure(value)}")
    try:
        result = float(value)
    except OverflowError:
        raise ValueError(f"{show(value)} is larger than any float64") from None
    if isinstance(value, numbers.Integral) and int(result) != int(value):
        raise ValueError(f"{show(value)} is not exact as a float64; write {result!r} if that is meant")
    return result


def _cure(value: Any) -> str:
    """What to do about a text that looks like a number."""
    if not isinstance(value, str):
        return ""
    match = re.fullmatch(r"\s*([-+]?[\d.][\d._]*(?:[eE][-+]?\d+)?)\s*(\D.*)?", value)
    if not match:
        return ""
    number, unit = match.groups()
    return f'; write {{ value = {number}, unit = "{unit.strip()}" }}' if unit else "; drop the quotes"


def show(value: Any) -> str:
    """A found value, as short text."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= 60 else f'"{value[:57]}..."'
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None:
        return "nothing"
    if isinstance(value, numbers.Integral):
        # str() of more than 4300 digits raises
        return str(value) if abs(int(value)) < 10**40 else "an integer of more than 40 digits"
    if isinstance(value, numbers.Real):
        return repr(float(value))
    return f"a {type(value).__name__}"


def limits(field: Field) -> str:
    """'> 0', '0 to 1', or the words it takes."""
    if field.choices:
        return listed(field.choices, quote=True)
    low = f"{'>' if field.open_lower else '>='} {field.lower:g}" if field.lower > -math.inf else ""
    # the last float64 below a round number is how a kernel leaves that number out
    below = float(f"{field.upper:g}") > field.upper
    high = f"{'<' if below else '<='} {field.upper:g}" if field.upper < math.inf else ""
    return ", ".join(filter(None, [low, high]))
