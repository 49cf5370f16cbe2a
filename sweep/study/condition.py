"""Conditions such as `status == 'OK' and R < 0.1*mu`: parsed by Python's grammar, never executed."""

from __future__ import annotations

import ast
import functools
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kernels.interface import Kernel
from sweep.errors import SweepError
from sweep.study.model import setting
from sweep.units import UnitMistake, measured, parsed
from sweep.words import did_you_mean, kind, listed

OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge, ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: lambda x, y: np.float64(x) ** y if isinstance(x, int | float) else x**y,
    ast.And: np.logical_and, ast.Or: np.logical_or,
}  # fmt: skip
LONGEST = 1000
"""Longest condition, in characters."""
GRAMMAR = "names, numbers, 'words', + - * / **, < <= > >= == !=, and, or, not, brackets"

Valued = tuple[Any, Any]
"""The value of a part of a condition (numbers, words or truth), and its unit; None fits any unit."""


@dataclass(frozen=True)
class Condition:
    """A condition on arrays by name.

    Parameters
    ----------
    text : str
    variable : callable
        The array of a name; raises SweepError where there is none. Of numbers, or of words.
    words : callable
        What a name of words may be; empty of others.
    says : str
        Begins every message.
    units : mapping of str to str, optional
        Of every name of numbers, beside which "'3 cm'" may stand.
    exact : bool
        Only like quantities can be compared and added, and powers are whole numbers, computed by products: those of
        libraries differ from machine to machine in the last digit.
    """

    text: str
    variable: Callable[[str], Any]
    words: Callable[[str], Iterable[str]]
    says: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    exact: bool = False

    def truth(self) -> Any:
        """Where it holds. Raises SweepError where it is too long or no expression, or compares what is unlike."""
        if not isinstance(self.text, str):
            raise SweepError(f'{self.says.strip()}: expected words such as "R < 0.1", found {kind(self.text)}')
        if len(self.text) > LONGEST:
            raise SweepError(f"{self.says}{self.text[:40]}...: is longer than {LONGEST} characters")
        try:
            with np.errstate(all="ignore"):
                found, _ = self._value(_parsed(self.text))
        except (SyntaxError, ValueError, RecursionError, MemoryError, ArithmeticError, TypeError):
            raise self.refusal(f"cannot be read; it may contain {GRAMMAR}") from None
        if _kind(found) != "b":
            raise self.refusal('is not a condition on the cells; write e.g. "R < 0.1" or "status == \'OK\'"')
        return found

    def refusal(self, what: str, node: ast.expr | None = None) -> SweepError:
        """The mistake as the user is told, of a part or of the whole."""
        part = "" if node is None else f'"{ast.unparse(node)[:60]}" '
        return SweepError(f"{self.says}{self.text}: {part}{what}")

    def _value(self, node: ast.expr) -> Valued:
        """What a part of it comes to."""
        match node:
            case ast.Constant(value=int() | float() | str() as value) if not isinstance(value, bool):
                return value, None
            case ast.Name(id=name):
                found = self.variable(name)
                return found, parsed(self.units[name]) if self.exact and name in self.units else None
            case ast.UnaryOp(op=ast.USub(), operand=part):
                number, unit = self._part(part, "fiu", "number")
                return -number, unit
            case ast.UnaryOp(op=ast.Not(), operand=part):
                return ~self._part(part, "b", "condition")[0], None
            case ast.BoolOp(op=op, values=parts):
                truths = (self._part(part, "b", "condition")[0] for part in parts)
                return functools.reduce(OPERATORS[type(op)], truths), None
            case ast.Compare(left=first, ops=ops, comparators=others) if all(type(op) in OPERATORS for op in ops):
                links = zip([first, *others], ops, others, strict=False)
                return functools.reduce(np.logical_and, (self._compared(a, op, b) for a, op, b in links)), None
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                compute = OPERATORS[type(op)]
                (value, unit), (other, its) = (self._part(part, "fiu", "number") for part in (left, right))
                if isinstance(op, ast.Add | ast.Sub):
                    return compute(value, other), self._agreed(left, unit, right, its)
                if isinstance(op, ast.Pow) and self.exact:
                    if not isinstance(other, int) or not 1 <= other <= 9:
                        raise self.refusal("is not allowed; a power is a whole number from 1 to 9", node)
                    return functools.reduce(operator.mul, [value * 1.0] * other), None if unit is None else unit**other
                if unit is not None or its is not None:  # a number alone is of no unit in a product
                    unit = compute(*(parsed("1") if one is None else one for one in (unit, its)))
                return compute(value, other), unit
        raise self.refusal(f"is not allowed; a condition may contain {GRAMMAR}", node)

    def _part(self, node: ast.expr, kinds: str, what: str) -> Valued:
        """A part whose values are of some kinds of numpy."""
        found, unit = self._value(node)
        if _kind(found) not in kinds:
            raise self.refusal(f"is not a {what}", node)
        return found, unit

    def _compared(self, left: ast.expr, sign: ast.cmpop, right: ast.expr) -> Any:
        """One link of a chain of comparisons."""
        (value, unit), (other, other_unit) = self._beside(left, right), self._beside(right, left)
        if (_kind(value) == "U") != (_kind(other) == "U"):
            raise self.refusal("compares words with numbers")
        if not _is_array(value) and not _is_array(other):
            raise self.refusal("compares two constants")
        for node, word in ((left, other), (right, value)):
            # a misspelt status would choose nothing, or everything, without a sign
            words = list(self.words(node.id)) if isinstance(node, ast.Name) and isinstance(word, str) else [word]
            if isinstance(word, str) and word not in words:
                hint = did_you_mean(word, words) or f"; it has {listed(words)}"
                raise self.refusal(f'{ast.unparse(node)} is never "{word}"{hint}')
        self._agreed(left, unit, right, other_unit)
        return OPERATORS[type(sign)](value, other)

    def _beside(self, node: ast.expr, other: ast.expr) -> Valued:
        """One side of a comparison; '3 cm' is a number in the unit of the name on the other side."""
        value, unit = self._value(node)
        match = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s+(\S.*)", value) if isinstance(value, str) else None
        if match is None:
            return value, unit
        if not isinstance(other, ast.Name) or other.id not in self.units:
            raise self.refusal(f"'{value}' has a unit; compare it with a name alone")
        try:
            return measured(value, self.units[other.id], other.id), None
        except UnitMistake as error:
            raise self.refusal(str(error)) from None

    def _agreed(self, left: ast.expr, unit: Any, right: ast.expr, other: Any) -> Any:
        """The unit of two parts that are alike. Raises SweepError where they are not."""
        if unit is not None and other is not None and unit.dimensionality != other.dimensionality:
            parts = (f"{ast.unparse(node)[:40]} is in {of}" for node, of in ((left, unit), (right, other)))
            raise self.refusal(f"{' and '.join(parts)}; they cannot be compared")
        return other if unit is None else unit


def _is_array(value: Any) -> bool:
    """An array of numpy or xarray, not a number or a word."""
    return hasattr(value, "dtype") and not isinstance(value, np.generic)


def _kind(value: Any) -> str:
    """Kind of values as numpy has it; "b" of arrays alone, "f" of any number, "U" of words."""
    if _is_array(value):
        return {"O": "U", "T": "U"}.get(value.dtype.kind, str(value.dtype.kind))
    return "U" if isinstance(value, str) else "f"


def cells_where(text: str, kernel: Kernel, settings: Iterable[str], column: Callable[[str], Any]) -> Any:
    """For which cells a condition on parameters holds; the same on every machine, as its arithmetic is exact IEEE.

    Parameters
    ----------
    text : str
        Of numbers in SI units, or with a unit beside a parameter: "phi0 < '60 degree'".
    settings : iterable of str
        Axes that are no parameters.
    column : callable
        The numbers of a parameter or setting in all cells.

    Raises
    ------
    SweepError
        It cannot be read, names what is not there, or compares what has other units.
    """
    fields = {field.name: field for field in kernel.parameters if not field.dims}
    fields |= {name: setting(name, kernel) for name in settings}

    @functools.cache
    def variable(name: str) -> Any:
        if name not in fields:
            hint = did_you_mean(name, fields) or f"; there are {listed(fields, word='and')}"
            raise condition.refusal(f"no parameter of one number is called {name}{hint}")
        numbers, choices = column(name), fields[name].choices
        found = np.full(len(numbers), "", "U32") if choices else numbers
        for word, code in choices.items():
            found[numbers == code] = word
        return found

    units = {name: field.unit for name, field in fields.items() if not field.choices}
    condition = Condition(text, variable, lambda name: fields[name].choices, units=units, exact=True)
    return condition.truth()


def names_in(text: str) -> set[str]:
    """The names in a condition."""
    return {node.id for node in ast.walk(_parsed(text)) if isinstance(node, ast.Name)}


@functools.lru_cache(maxsize=16)
def _parsed(text: str) -> ast.expr:
    """The expression that a condition is; the same one holds for block after block of a run."""
    return ast.parse(text.strip(), mode="eval").body
