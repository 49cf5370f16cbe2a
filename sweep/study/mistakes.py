"""What a study may hold: mistakes are collected, not raised, and each says what was found and what to do."""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from kernels.interface import Field
from sweep.errors import Mistake, StudyError, SweepError
from sweep.words import did_you_mean, listed, nearest

T = TypeVar("T")
U = TypeVar("U")


class Mistakes:
    """All that is wrong with one study.

    Attributes
    ----------
    found : list of Mistake
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
        """Raises StudyError with all mistakes of what is called `source`."""
        if self.found:
            raise StudyError(source, self.found)

    def tried(self, where: str, action: Callable[[], T], otherwise: U) -> T | U:
        """What an action gives; `otherwise` if it raises ValueError or SweepError, whose text is a mistake."""
        try:
            return action()
        except (ValueError, SweepError) as error:
            self.add(where, str(error))
            return otherwise

    def finite(self, value: Any, where: str) -> float:
        """A number that is neither NaN nor infinite; NaN where it is a mistake."""
        before = len(self)
        result = self.tried(where, lambda: exact_float(value), math.nan)
        if not math.isfinite(result) and len(self) == before:
            self.add(where, f"expected a finite number, found {result}")
        return result

    def whole(self, value: Any, where: str, low: int, high: int, cure: str = "") -> int:
        """A whole number in these limits; the lower one where it is a mistake. The `cure` is for one below."""
        number = int(value) if isinstance(value, numbers.Integral) and not isinstance(value, bool) else None
        if number is not None and low <= number <= high:
            return number
        below = cure if number is not None and number < low else ""
        self.add(where, f"expected a whole number from {low} to {high}, found {show(value)}{below}")
        return low

    def word(self, value: Any, where: str, allowed: Iterable[str]) -> str | None:
        """One of the words `allowed`."""
        return self.tried(where, lambda: one_of(value, list(allowed)), None)

    def words(self, value: Any, where: str, allowed: Sequence[str], example: str, cure: str = "") -> list[str]:
        """A list of some of the words `allowed`, none twice and not empty."""
        if isinstance(value, str) or not isinstance(value, Sequence) or not value:
            what = "an empty list" if isinstance(value, Sequence) and not isinstance(value, str) else show(value)
            self.add(where, f"expected {example}, found {what}{cure}")
            return []
        found: list[str] = []
        for i, item in enumerate(value):
            word = self.word(item, f"{where}[{i}]", allowed)
            if word in found:
                self.add(f"{where}[{i}]", f"{show(item)} stands twice")
            found += [word] if word else []
        return found

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

    def keys(self, table: Mapping[str, Any], allowed: Iterable[str], where: str = "") -> dict[str, Any]:
        """The table; a mistake for every key that is not `allowed`, and it stands for the one that is meant."""
        words, found = list(allowed), dict(table)
        for key in table:
            if key not in words:
                hint = did_you_mean(key, words) or f"; allowed are {listed(words)}"
                self.add(f"{where}.{key}" if where else str(key), f"no such key{hint}")
                if meant := nearest(key, words):
                    found.setdefault(meant, found.pop(key))
        return found


def one_of(value: Any, words: Sequence[str]) -> str:
    """A word of those allowed. Raises ValueError with the text for the user."""
    if isinstance(value, str) and value in words:
        return value
    raise ValueError(f"expected {listed(words, quote=True)}, found {show(value)}{did_you_mean(value, words)}")


def exact_float(value: Any) -> float:
    """A number as float64 without loss. Raises ValueError with the text for the user."""
    if getattr(value, "ndim", None) == 0:
        value = value.item()  # of numpy
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        cure = ""
        # a text that looks like a number
        if isinstance(value, str) and (
            match := re.fullmatch(r"\s*([-+]?[\d.][\d._]*(?:[eE][-+]?\d+)?)\s*(\D.*)?", value)
        ):
            number, unit = match.groups()
            cure = f'; write {{ value = {number}, unit = "{unit.strip()}" }}' if unit else "; drop the quotes"
        raise ValueError(f"expected a number, found {show(value)}{cure}")
    try:
        result = float(value)
    except OverflowError:
        raise ValueError(f"{show(value)} is larger than any float64") from None
    if isinstance(value, numbers.Integral) and int(result) != int(value):
        raise ValueError(f"{show(value)} is not exact as a float64; write {result!r} if that is meant")
    return result


def show(value: Any) -> str:
    """A found value, as short text."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= 60 else f'"{value[:57]}..."'
    if isinstance(value, numbers.Integral):
        # str() of more than 4300 digits raises
        return str(value) if abs(int(value)) < 10**40 else "an integer of more than 40 digits"
    if isinstance(value, numbers.Real):
        return repr(float(value))
    words = {"dict": "a table", "list": "a list", "tuple": "a list", "NoneType": "nothing"}
    return words.get(type(value).__name__, f"a {type(value).__name__}")


def limits(field: Field) -> str:
    """'> 0', '0 to 1', or the words it takes."""
    if field.choices:
        return listed(field.choices, quote=True)
    low = f"{'>' if field.open_lower else '>='} {field.lower:g}" if field.lower > -math.inf else ""
    # the last float64 below a round number is how a kernel leaves that number out
    below = float(f"{field.upper:g}") > field.upper
    high = f"{'<' if below else '<='} {field.upper:g}" if field.upper < math.inf else ""
    return ", ".join(filter(None, [low, high]))
