"""Conditions such as `status == 'OK' and R < 0.1*mu`: read by Python's grammar, never run by it."""

from __future__ import annotations

import ast
import itertools
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np

from kernels.interface import Field, Kernel
from sweep.errors import SweepError
from sweep.study.mistakes import did_you_mean, listed
from sweep.study.model import AUTO
from sweep.study.units import UnitMistake, exponents, scale

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

    Raises
    ------
    SweepError
        It is too long or no expression.
    """

    def __init__(
        self, text: str, variable: Callable[[str], Any], words: Callable[[str], Iterable[str]], says: str = ""
    ) -> None:
        self.text, self.says = text, says
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
                found = self.value(self.tree)
        except (ValueError, RecursionError, MemoryError, ArithmeticError, TypeError):
            raise self.refusal(f"cannot be read; it may hold {GRAMMAR}") from None
        if not is_array(found) or found.dtype != bool:
            raise self.refusal('is no condition on the cells; write e.g. "R < 0.1" or "status == \'OK\'"')
        return found

    def value(self, node: ast.expr) -> Any:
        """What a part of it comes to."""
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float() | str() as value):
                return value
            case ast.Name(id=name):
                return self.variable(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.number(operand)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return ~self.condition_of(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in COMPUTE:
                return self.computed(node, COMPUTE[type(op)], self.number(left), self.number(right))
            case ast.BoolOp(op=op, values=values):
                join = np.logical_and if isinstance(op, ast.And) else np.logical_or
                found = self.condition_of(values[0])
                for part in values[1:]:
                    found = join(found, self.condition_of(part))
                return found
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARE for op in ops):
                return self.compared([left, *others], [COMPARE[type(op)] for op in ops])
        raise self.refusal(f'"{ast.unparse(node)[:60]}" is not allowed; it may hold {GRAMMAR}')

    def computed(self, node: ast.BinOp, compute: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
        """A sum, product or power."""
        return compute(left, right)

    def number(self, node: ast.expr) -> Any:
        """A part that is numbers."""
        found = self.value(node)
        if isinstance(found, str) or (is_array(found) and found.dtype.kind not in "fiu"):
            raise self.refusal(f'"{ast.unparse(node)[:60]}" is no number')
        return found

    def condition_of(self, node: ast.expr) -> Any:
        """A part that is a condition."""
        found = self.value(node)
        if not is_array(found) or found.dtype != bool:
            raise self.refusal(f'"{ast.unparse(node)[:60]}" is no condition')
        return found

    def compared(self, nodes: Sequence[ast.expr], comparisons: Sequence[Callable[[Any, Any], Any]]) -> Any:
        """A chain of comparisons."""
        found: Any = True
        values = [self.value(node) for node in nodes]
        for i, compare in enumerate(comparisons):
            left, right = self.alike(nodes[i], nodes[i + 1], values[i], values[i + 1])
            found = np.logical_and(found, compare(left, right))
        return found

    def alike(self, left: ast.expr, right: ast.expr, value: Any, other: Any) -> tuple[Any, Any]:
        """Two sides that may be compared."""
        kinds = {isinstance(v, str) or (is_array(v) and v.dtype.kind in "UO") for v in (value, other)}
        if len(kinds) > 1:
            raise self.refusal("compares words with numbers")
        if not is_array(value) and not is_array(other):
            raise self.refusal("compares two constants")
        self.known_word(left, other)
        self.known_word(right, value)
        return value, other

    def known_word(self, node: ast.expr, word: Any) -> None:
        """A misspelt status would choose nothing, or everything, without a sign."""
        if not (isinstance(node, ast.Name) and isinstance(word, str)):
            return
        words = list(self.words(node.id))
        if word not in words:
            hint = did_you_mean(word, words) or f"; it has {listed(words)}"
            raise self.refusal(f'{node.id} is never "{word}"{hint}')

    def refusal(self, what: str) -> SweepError:
        """The mistake as the user is told."""
        return SweepError(f"{self.says}{self.text}: {what}")


Dimension = dict[str, Fraction]
"""Powers of base units, without the radian."""


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
        super().__init__(text, self._column, self._words)
        self._fields = {field.name: field for field in kernel.parameters if not field.dims}
        if "rtol" in settings:
            self._fields["rtol"] = Field("rtol", "1", "")
        if "method" in settings:
            choices = {"auto": AUTO, **{m.name: i for i, m in enumerate(kernel.methods)}}
            self._fields["method"] = Field("method", "1", "", choices=choices)
        self._columns: Mapping[str, Any] = {name: np.zeros(0) for name in self._fields}
        self._factors: dict[str, float] = {}
        self.names = sorted({node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)})
        self.truth()
        self._dimension(self.tree)

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

    def _words(self, name: str) -> Iterable[str]:
        return self._fields[name].choices

    def computed(self, node: ast.BinOp, compute: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
        """Powers by multiplication: those of libraries differ from machine to machine in the last digit."""
        if not isinstance(node.op, ast.Pow):
            return compute(left, right)
        if not isinstance(right, int) or not 1 <= right <= 9:
            raise self.refusal(f'"{ast.unparse(node)[:60]}": a power is a whole number from 1 to 9')
        found = left
        for _ in range(right - 1):
            found = found * left
        return found

    def alike(self, left: ast.expr, right: ast.expr, value: Any, other: Any) -> tuple[Any, Any]:
        """Numbers with a unit of their own stand beside a parameter."""
        return super().alike(left, right, self._with_unit(value, right), self._with_unit(other, left))

    def _with_unit(self, value: Any, beside: ast.expr) -> Any:
        match = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s+(\S.*)", value) if isinstance(value, str) else None
        if match is None:
            return value
        if not isinstance(beside, ast.Name) or self._fields[beside.id].choices:
            raise self.refusal(f"'{value}' has a unit; compare it with a parameter alone")
        field, (number, unit) = self._fields[beside.id], match.groups()
        if value not in self._factors:
            try:
                self._factors[value] = float((scale(unit, field.unit, field.name) or 1) * Decimal(number))
            except (UnitMistake, ValueError) as error:
                raise self.refusal(str(error)) from None
        return self._factors[value]

    def _dimension(self, node: ast.expr) -> Dimension | None:
        """Of a part that is numbers; None of a constant, which fits any. Raises SweepError where units do not agree."""
        match node:
            case ast.Name(id=name) if not self._fields[name].choices:
                powers = exponents(self._fields[name].unit)
                return {base: power for base, power in powers.items() if base != "radian" and power}
            case ast.UnaryOp(operand=operand):
                return self._dimension(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as power)):
                return _product(self._dimension(left), None, power)
            case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
                return _product(self._dimension(left), self._dimension(right), 1, 1 if isinstance(op, ast.Mult) else -1)
            case ast.BinOp(left=left, right=right):
                return self._agreed([left, right])
            case ast.Compare(left=left, comparators=others):
                self._agreed([left, *others])
            case ast.BoolOp(values=values):
                for value in values:
                    self._dimension(value)
        return None

    def _agreed(self, nodes: Sequence[ast.expr]) -> Dimension | None:
        """What all parts have that are no constants."""
        found = [(node, dimension) for node in nodes if (dimension := self._dimension(node)) is not None]
        for (first, one), (second, other) in itertools.pairwise(found):
            if one != other:
                texts = [f"{ast.unparse(n)[:40]} is in {_unit(d)}" for n, d in ((first, one), (second, other))]
                raise self.refusal(f"{' and '.join(texts)}; they cannot be compared")
        return found[0][1] if found else None


def _product(left: Dimension | None, right: Dimension | None, power: int, other: int = 1) -> Dimension | None:
    if left is None and right is None:
        return None
    found = {base: power * exponent for base, exponent in (left or {}).items()}
    for base, exponent in (right or {}).items():
        found[base] = found.get(base, Fraction(0)) + other * exponent
    return {base: exponent for base, exponent in found.items() if exponent}


def _unit(dimension: Dimension) -> str:
    return " ".join(f"{base}^{exponent}" if exponent != 1 else base for base, exponent in dimension.items()) or "1"
