"""Cells chosen by a condition such as `status == 'OK' and R < 0.1`: read by Python's grammar, never run by it."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from sweep.cells.schema import STATUS
from sweep.results.statuses import flag_words
from sweep.study.mistakes import did_you_mean, listed
from sweep.system.errors import SweepError

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

GRAMMAR = "names of the result, numbers, 'words', + - * / **, < <= > >= == !=, and, or, not, brackets"


def where(dataset: xr.Dataset, condition: str) -> xr.Dataset:
    """The cells for which a condition holds, along one dimension `cell`, with their parameters as coordinates.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`.
    condition : str
        Of names in the result, numbers and words: "status == 'OK' and R < 0.1*mu". Words are those of `status`,
        `method_used` and of axes of words. Outputs along a coordinate of their own cannot be used.

    Raises
    ------
    SweepError
        The condition cannot be read, or names what is not there.
    """
    if STATUS not in dataset:
        raise _refusal(condition, "a summary keeps no cells to choose from")
    truth = _Reader(dataset, condition).truth()
    dims = [str(dim) for dim in dataset[STATUS].dims]
    if set(truth.dims) - set(dims):
        raise _refusal(condition, f"runs along {listed(sorted(map(str, set(truth.dims) - set(dims))))}, not the cells")
    flat = dataset if dims == ["cell"] else dataset.stack(cell=dims, create_index=False)
    flat = flat.transpose("cell", ...)
    mask = truth.broadcast_like(dataset[STATUS]).transpose(*dims).values.ravel()
    return flat.isel(cell=np.flatnonzero(mask))


class _Reader:
    def __init__(self, dataset: xr.Dataset, condition: str) -> None:
        self.dataset, self.condition = dataset, condition

    def truth(self) -> xr.DataArray:
        if len(self.condition) > LONGEST:
            raise _refusal(self.condition[:40] + "...", f"is longer than {LONGEST} letters")
        try:
            tree = ast.parse(self.condition.strip(), mode="eval")
            with np.errstate(all="ignore"):
                found = self.value(tree.body)
        except (SyntaxError, ValueError, RecursionError, MemoryError, ArithmeticError, TypeError):
            raise _refusal(self.condition, f"cannot be read; it may hold {GRAMMAR}") from None
        if not isinstance(found, xr.DataArray) or found.dtype != bool:
            raise _refusal(self.condition, "is no condition on the cells; write e.g. \"status == 'OK' and R < 0.1\"")
        return found

    def value(self, node: ast.expr) -> Any:
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
                return COMPUTE[type(op)](self.number(left), self.number(right))
            case ast.BoolOp(op=op, values=values):
                parts = [self.condition_of(v) for v in values]
                join = np.logical_and if isinstance(op, ast.And) else np.logical_or
                found = parts[0]
                for part in parts[1:]:
                    found = join(found, part)
                return found
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARE for op in ops):
                return self.compared([self.value(n) for n in (left, *others)], [COMPARE[type(op)] for op in ops])
        raise _refusal(self.condition, f'"{ast.unparse(node)[:60]}" is not allowed; it may hold {GRAMMAR}')

    def variable(self, name: str) -> Any:
        if name not in self.dataset.variables:
            hint = did_you_mean(name, map(str, self.dataset.variables))
            raise _refusal(self.condition, f"the result has no {name}{hint}")
        variable = self.dataset[name].compute()
        words = flag_words(variable)
        if not words:
            return variable
        codes, inverse = np.unique(variable.values, return_inverse=True)
        texts = np.array([words.get(int(code), str(code)) for code in codes])
        return variable.copy(data=texts[inverse].reshape(variable.shape))

    def number(self, node: ast.expr) -> Any:
        found = self.value(node)
        if isinstance(found, str) or (isinstance(found, xr.DataArray) and found.dtype.kind not in "fiu"):
            raise _refusal(self.condition, f'"{ast.unparse(node)[:60]}" is no number')
        return found

    def condition_of(self, node: ast.expr) -> Any:
        found = self.value(node)
        if not isinstance(found, xr.DataArray) or found.dtype != bool:
            raise _refusal(self.condition, f'"{ast.unparse(node)[:60]}" is no condition')
        return found

    def compared(self, values: list[Any], comparisons: list[Callable[[Any, Any], Any]]) -> Any:
        found: Any = True
        for left, right, compare in zip(values, values[1:], comparisons, strict=False):
            self.same_kind(left, right)
            self.known_word(left, right)
            self.known_word(right, left)
            found = np.logical_and(found, compare(left, right))
        return found

    def same_kind(self, left: Any, right: Any) -> None:
        kinds = {isinstance(v, str) or (isinstance(v, xr.DataArray) and v.dtype.kind in "UO") for v in (left, right)}
        if len(kinds) > 1:
            raise _refusal(self.condition, "compares words with numbers")
        if not any(isinstance(v, xr.DataArray) for v in (left, right)):
            raise _refusal(self.condition, "compares two constants")

    def known_word(self, variable: Any, word: Any) -> None:
        """A misspelt status would choose nothing, or everything, without a sign."""
        if not (isinstance(variable, xr.DataArray) and isinstance(word, str) and variable.name in self.dataset):
            return
        words = flag_words(self.dataset[variable.name]).values() or set(map(str, np.unique(variable.values)))
        if word not in words:
            hint = did_you_mean(word, words) or f"; it has {listed(words)}"
            raise _refusal(self.condition, f'{variable.name} is never "{word}"{hint}')


def _refusal(condition: str, what: str) -> SweepError:
    return SweepError(f"--where {condition}: {what}")
