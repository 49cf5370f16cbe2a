"""Mistakes in a study are collected, not raised one by one; each says what was found and what to do."""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Field
from sweep.errors import Mistake, StudyError, SweepError
from sweep.units import unit_of
from sweep.words import did_you_mean, kind, listed, nearest

T = TypeVar("T")
U = TypeVar("U")


class Mistakes(list[Mistake]):
    """All that is wrong with one study.

    `unread`: something that holds others was no table, so that what stands in it is not known to be missing. `meant`:
    parameters and coordinates that misspelt names are taken for.
    """

    def __init__(self) -> None:
        self.unread, self.meant = False, set[str]()

    def add(self, where: str, message: str) -> None:
        self.append(Mistake(where, message))

    def good(self, *places: str) -> bool:
        """Whether nothing is wrong at these places and in what stands below them, so that they can be compared."""
        below = tuple(f"{place}{sign}" for place in places for sign in ".[")
        return not any(m.where in places or m.where.startswith(below) for m in self)

    def raise_if_any(self, source: str) -> None:
        """Raises StudyError with all mistakes of what is called `source`."""
        if self:
            raise StudyError(source, self)


@dataclass(frozen=True)
class Entry:
    """What a study says at one place, such as "axes.mu.values[2]", or as a whole; None where it says nothing.

    What is wrong goes to `mistakes`; names of files are relative to the `folder`. `unit` is one that the value itself
    has, a DataArray of a result or a quantity of pint.
    """

    value: Any
    where: str
    mistakes: Mistakes
    folder: Path = Path()
    unit: str = ""

    def __contains__(self, key: str) -> bool:
        return key in self.value

    def __getitem__(self, key: str | int) -> Entry:
        """What stands under a key of a table, or at a place of a list; arrays as lists, but for lines of float64."""
        found = self.value[key] if isinstance(key, int) else self.value.get(key)
        unit = ""
        if hasattr(found, "__array__"):
            unit = unit_of(found)
            found = getattr(found, "magnitude", found)
            # what is masked, as netCDF4 does with what is missing, is no number
            masked = isinstance(found, np.ma.MaskedArray) and np.ma.is_masked(found)
            found = found.astype(float).filled(np.nan) if masked else np.asarray(found)
            found = found if found.ndim == 1 and found.dtype == np.float64 else found.tolist()
        at = f"{self.where}[{key}]" if isinstance(key, int) else f"{self.where}.{key}".removeprefix(".")
        return replace(self, value=found, where=at, unit=unit)

    def good(self) -> bool:
        """Whether nothing is wrong here or below."""
        return self.mistakes.good(self.where)

    def wrong(self, message: str) -> None:
        """This place has a mistake."""
        self.mistakes.add(self.where, message)

    def unknown(self, name: Any, words: Iterable[str], what: str, cure: str) -> str:
        """The word that a name is taken for, or ""; it is a mistake, whose cure that word is where there is one."""
        words = list(words)
        self.wrong(what + (did_you_mean(name, words) or cure))
        return nearest(name, words)

    def read(self, otherwise: U, reader: Callable[..., T], *given: Any) -> T | U:
        """What a reader makes of the value; `otherwise` if it raises ValueError or SweepError, which is a mistake."""
        try:
            return reader(self.value, *given)
        except (ValueError, SweepError) as error:
            self.wrong(str(error))
            return otherwise

    def get(self, key: str, otherwise: U, reader: Callable[..., T], *given: Any) -> T | U:
        """What a reader makes of the value under a key that may be left out; `otherwise` without it."""
        return self[key].read(otherwise, reader, *given) if key in self else otherwise

    def table(self, key: str | int, example: str) -> Entry:
        """The table that stands there; an empty one where there is none, or something else, which is a mistake."""
        found = self[key]
        if isinstance(key, str) and key not in self:
            return replace(found, value={})
        if not isinstance(found.value, Mapping):
            self.mistakes.unread = True
            found.wrong(f"expected a table, found {show(found.value)}; write e.g. {example}")
            return replace(found, value={})
        return found

    def keys(self, *allowed: str) -> Entry:
        """The table; a mistake for every key that is not allowed, and it stands for the one that is meant."""
        found = dict(self.value)
        for key in (key for key in self.value if key not in allowed):
            if meant := self[key].unknown(key, allowed, "no such key", f"; allowed are {listed(allowed)}"):
                found.setdefault(meant, found.pop(key))
        return replace(self, value=found)

    def words(self, allowed: Sequence[str], example: str, cure: str = "") -> list[str]:
        """A list of some of the words allowed, none twice and not empty."""
        a_list = isinstance(self.value, Sequence) and not isinstance(self.value, str)
        if not a_list or not self.value:
            self.wrong(f"expected {example}, found {'an empty list' if a_list else show(self.value)}{cure}")
            return []
        found: list[str] = []
        for i in range(len(self.value)):
            word = self[i].read("", one_of, allowed)
            if word in found:
                self[i].wrong(f"{show(word)} occurs twice")
            found += [word] if word else []
        return found


# readers of a value: each raises ValueError with the text for the user


def text(value: Any) -> str:
    """A text of characters that a file can hold."""
    if not isinstance(value, str):
        raise ValueError(f"expected text in quotes, found {show(value)}")
    if bad := re.search("[\0\ud800-\udfff]", value):
        raise ValueError(f"a file cannot contain the character {bad[0]!r}; leave it out")
    return value


def one_of(value: Any, words: Iterable[str]) -> str:
    """A word of those allowed."""
    words = list(words)
    if isinstance(value, str) and value in words:
        return value
    raise ValueError(f"expected {listed(words, quote=True)}, found {show(value)}{did_you_mean(value, words)}")


def whole(value: Any, low: int, high: int, cure: str = "") -> int:
    """A whole number in these limits. The `cure` is for one below."""
    is_whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if is_whole and low <= value <= high:
        return int(value)
    below = cure if is_whole and value < low else ""
    raise ValueError(f"expected a whole number from {low} to {high}, found {show(value)}{below}")


def finite(value: Any) -> float:
    """A number that is neither NaN nor infinite."""
    if math.isfinite(number := exact_float(value)):
        return number
    raise ValueError(f"expected a finite number, found {number}")


def exact_float(value: Any) -> float:
    """A number as float64 without loss."""
    value = value.item() if getattr(value, "ndim", None) == 0 else value  # of numpy
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        cure, match = "", None
        if isinstance(value, str):  # which may look like a number, with a unit behind it
            match = re.fullmatch(r"\s*([-+]?[\d.][\d._]*(?:[eE][-+]?\d+)?)\s*(\D.*)?", value)
        if match:
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
    return {"dict": "a table", "tuple": "a list"}.get(type(value).__name__) or kind(value)


def limits(field: Field) -> str:
    """'> 0', '0 to 1', or the words it takes."""
    if field.choices:
        return listed(field.choices, quote=True)
    low = f"{'>' if field.open_lower else '>='} {field.lower:g}" if field.lower > -math.inf else ""
    # the last float64 below a round number is how a kernel leaves that number out
    below = float(f"{field.upper:g}") > field.upper
    high = f"{'<' if below else '<='} {field.upper:g}" if field.upper < math.inf else ""
    return ", ".join(filter(None, [low, high]))


def check_limits(entry: Entry, found: float | NDArray[np.float64], field: Field, finite: bool = False) -> None:
    """A mistake where some values are outside of the limits of their field, or not whole where they should be."""
    values = np.atleast_1d(found)
    inside = (values > field.lower if field.open_lower else values >= field.lower) & (values <= field.upper)
    inside &= ((np.round(values) == values) | (not field.integer)) & (np.isfinite(values) | (not finite))
    bad = values[~inside & (values != field.default)]
    if len(bad):
        unit = f" {field.unit}" if field.unit != "1" else ""
        wanted = f"{'a whole number ' * field.integer}{limits(field) or 'a number'}{unit}"
        entry.wrong(f"expected {wanted}, found {bad[0]:.6g}{unit}")
