"""Conditions such as `status == 'OK' and R < 0.1*mu`: read by Python's grammar, never run by it."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from typing import Any

import numpy as np

from kernels.interface import Kernel
from sweep.errors import SweepError
from sweep.study.model import setting
from sweep.study.units import UnitMistake, dimension, scale
from sweep.words import did_you_mean, listed

COMPARE: dict[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
COMPUTE: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: lambda x, y: np.float64(x) ** y if isinstance(x, int | float) else x**y,
}
LONGEST = 1000
"""Letters of a condition."""

GRAMMAR = "names, numbers, 'words', + - * / **, < <= > >= == !=, and, or, not, brackets"

Valued = tuple[Any, Any]
"""What a part of a condition comes to (numbers, words or truth), and its dimension; None: it fits any."""


def is_array(value: Any) -> bool:
    """An array of numpy or xarray, not a number or a word."""
    return hasattr(value, "dtype") and not isinstance(value, np.generic)


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
        Of every name of numbers. If given, only like quantities can be compared and added, "'3 cm'" may stand beside
        a name, and powers are whole numbers, computed by products: those of libraries differ from machine to machine
        in the last digit.

    Raises
    ------
    SweepError
        It is too long or no expression.
    """

    def __init__(
        self,
        text: str,
        variable: Callable[[str], Any],
        words: Callable[[str], Iterable[str]],
        says: str = "",
        units: Mapping[str, str] | None = None,
    ) -> None:
        self.text, self.says, self.units = text, says, units
        self.variable, self.words = variable, words
        if len(text) > LONGEST:
            self.text = text[:40] + "..."
            raise self.refusal(f"is longer than {LONGEST} letters")
        try:
            self.tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self.refusal(f"cannot be read; it may hold {GRAMMAR}") from None

    def truth(self) -> Any:
        """Where it holds. Raises SweepError."""
        try:
            with np.errstate(all="ignore"):
                found, _ = self.value(self.tree)
        except (ValueError, RecursionError, MemoryError, ArithmeticError, TypeError):
            raise self.refusal(f"cannot be read; it may hold {GRAMMAR}") from None
        if not is_array(found) or found.dtype != bool:
            raise self.refusal('is no condition on the cells; write e.g. "R < 0.1" or "status == \'OK\'"')
        return found

    def value(self, node: ast.expr) -> Valued:
        """What a part of it comes to."""
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float() | str() as value):
                return value, None
            case ast.Name(id=name):
                found = self.variable(name)
                return found, dimension(self.units[name]) if self.units is not None and name in self.units else None
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                number, unit = self.number(operand)
                return -number, unit
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return ~self.holds_for(operand), None
            case ast.BinOp(op=op) if type(op) in COMPUTE:
                return self.computed(node)
            case ast.BoolOp(op=op, values=values):
                join = np.logical_and if isinstance(op, ast.And) else np.logical_or
                found = self.holds_for(values[0])
                for part in values[1:]:
                    found = join(found, self.holds_for(part))
                return found, None
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARE for op in ops):
                return self.compared([left, *others], [COMPARE[type(op)] for op in ops]), None
        raise self.refusal(f'"{ast.unparse(node)[:60]}" is not allowed; it may hold {GRAMMAR}')

    def number(self, node: ast.expr) -> Valued:
        """A part that is numbers."""
        found, unit = self.value(node)
        if isinstance(found, str) or (is_array(found) and found.dtype.kind not in "fiu"):
            raise self.refusal(f'"{ast.unparse(node)[:60]}" is no number')
        return found, unit

    def holds_for(self, node: ast.expr) -> Any:
        """A part that is a condition."""
        found, _ = self.value(node)
        if not is_array(found) or found.dtype != bool:
            raise self.refusal(f'"{ast.unparse(node)[:60]}" is no condition')
        return found

    def computed(self, node: ast.BinOp) -> Valued:
        """A sum, product or power."""
        (left, unit), (right, other) = self.number(node.left), self.number(node.right)
        compute = COMPUTE[type(node.op)]
        match node.op:
            case ast.Add() | ast.Sub():
                return compute(left, right), self.agreed(node.left, unit, node.right, other)
            case ast.Pow() if self.units is not None:
                if not isinstance(right, int) or not 1 <= right <= 9:
                    raise self.refusal(f'"{ast.unparse(node)[:60]}": a power is a whole number from 1 to 9')
                found = left
                for _ in range(right - 1):
                    found = found * left
                return found, None if unit is None else unit**right
            case _ if unit is None and other is None:
                return compute(left, right), None
        # a number alone is of no unit in a product
        return compute(left, right), compute(other**0 if unit is None else unit, unit**0 if other is None else other)

    def compared(self, nodes: Sequence[ast.expr], comparisons: Sequence[Callable[[Any, Any], Any]]) -> Any:
        """A chain of comparisons."""
        found: Any = True
        for left, right, compare in zip(nodes, nodes[1:], comparisons, strict=False):
            (value, unit), (other, other_unit) = self.beside(left, right), self.beside(right, left)
            if len({isinstance(v, str) or (is_array(v) and v.dtype.kind in "UO") for v in (value, other)}) > 1:
                raise self.refusal("compares words with numbers")
            if not is_array(value) and not is_array(other):
                raise self.refusal("compares two constants")
            for node, word in ((left, other), (right, value)):
                # a misspelt status would choose nothing, or everything, without a sign
                words = list(self.words(node.id)) if isinstance(node, ast.Name) and isinstance(word, str) else [word]
                if isinstance(word, str) and word not in words:
                    hint = did_you_mean(word, words) or f"; it has {listed(words)}"
                    raise self.refusal(f'{ast.unparse(node)} is never "{word}"{hint}')
            self.agreed(left, unit, right, other_unit)
            found = np.logical_and(found, compare(value, other))
        return found

    def beside(self, node: ast.expr, other: ast.expr) -> Valued:
        """One side of a comparison; '3 cm' is a number in the unit of the name on the other side."""
        value, unit = self.value(node)
        match = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s+(\S.*)", value) if isinstance(value, str) else None
        if match is None or self.units is None:
            return value, unit
        if not isinstance(other, ast.Name) or other.id not in self.units:
            raise self.refusal(f"'{value}' has a unit; compare it with a parameter alone")
        try:
            return float((scale(match[2], self.units[other.id], other.id) or 1) * Decimal(match[1])), None
        except UnitMistake as error:
            raise self.refusal(str(error)) from None

    def agreed(self, left: ast.expr, unit: Any, right: ast.expr, other: Any) -> Any:
        """The dimension of two parts that are alike. Raises SweepError where they are not."""
        if unit is not None and other is not None and unit != other:
            texts = (
                f"{ast.unparse(node)[:40]} is in {str(of).replace(' ** ', '^')}"
                for node, of in ((left, unit), (right, other))
            )
            raise self.refusal(f"{' and '.join(texts)}; they cannot be compared")
        return other if unit is None else unit

    def refusal(self, what: str) -> SweepError:
        """The mistake as the user is told."""
        return SweepError(f"{self.says}{self.text}: {what}")


class CellCondition(Condition):
    """A condition on the parameters of a study's cells; the same on every machine, as its arithmetic is exact IEEE.

    Parameters
    ----------
    text : str
        Of numbers in SI units, or with a unit beside a parameter: "phi0 < '60 degree'".
    kernel : Kernel
    settings : names of the axes that are no parameters

    Raises
    ------
    SweepError
        It cannot be read, names what is not there, or compares what has other units.
    """

    def __init__(self, text: str, kernel: Kernel, settings: Sequence[str] = ()) -> None:
        self._fields = {field.name: field for field in kernel.parameters if not field.dims}
        self._fields |= {name: setting(name, kernel) for name in settings}
        units = {name: field.unit for name, field in self._fields.items() if not field.choices}
        super().__init__(text, self._column, lambda name: self._fields[name].choices, units=units)
        self.names = sorted({node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)})
        self.holds({name: np.zeros(0) for name in self._fields})

    def holds(self, columns: Mapping[str, Any]) -> Any:
        """Where it holds, of columns of the `names` that it has."""
        self._columns = columns
        return self.truth()

    def _column(self, name: str) -> Any:
        if name not in self._fields:
            hint = did_you_mean(name, self._fields) or f"; there are {listed(self._fields, word='and')}"
            raise self.refusal(f"no parameter of one number is called {name}{hint}")
        column, choices = self._columns[name], self._fields[name].choices
        if not choices:
            return column
        found = np.full(len(column), "", dtype="U32")
        for word, code in choices.items():
            found[column == code] = word
        return found
