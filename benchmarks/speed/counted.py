"""Counts the arithmetic of a kernel: its source run as plain Python, with numbers that count what is done to them.

Only under NUMBA_DISABLE_JIT=1, and `install` comes before the kernel is imported. Every operation that lanes do with
one instruction for each of their cells counts one: additions and multiplications, an `fma` too; division;
square root; and as `other` comparisons, `where`, signs and the shifts of exponents. Elementary functions are the
kernels' own, so they are counted by what they do. Not counted: integers (indices, random bits), logic of conditions,
loads, stores and copies, which are not arithmetic.

Each number knows the longest chain of operations that it waited for, too; a division or root counts four there. The
chain is forgotten where a number is kept in an array, so that it is a chain that there is, maybe not the longest.
"""

from __future__ import annotations

import builtins
import ctypes
import ctypes.util
import math
import operator
from collections import Counter
from contextlib import contextmanager
from unittest.mock import patch

import numpy as np

DONE: Counter[str] = Counter()
"""Operations by their kind since it was cleared, and the longest `chain`."""
SLOW = 4
"""Latencies of an addition that a division or a root takes, about."""
_KINDS = {"add": "plain", "sub": "plain", "mul": "plain", "truediv": "division"}
_FUNCTIONS = {"add": np.add, "sub": np.subtract, "mul": np.multiply, "truediv": np.divide}
_COMPLEX = {"add": (2, 0), "sub": (2, 0), "mul": (6, 0), "truediv": (6, 3)}
"""Plain operations and divisions of complex numbers; quotients are Smith's."""
_plain_complex = complex
_fma = ctypes.CDLL(ctypes.util.find_library("m")).fma
_fma.restype, _fma.argtypes = ctypes.c_double, [ctypes.c_double] * 3


class Counted(np.float64):
    """A number whose operations are counted; `chain` is how many it waited for."""

    chain = 0


def _new(kind, value, *sources, instructions=1):
    """A number that has been made by so many instructions of one kind."""
    DONE[kind] += instructions
    result = Counted(value)
    waited = max([getattr(source, "chain", 0) for source in sources])
    result.chain = waited + (SLOW if kind in ("division", "root") else instructions)
    DONE["chain"] = max(DONE["chain"], result.chain)
    return result


def _binary(name, turned):
    function, kind = _FUNCTIONS[name], _KINDS[name]

    def operate(self, other):
        if isinstance(other, np.ndarray):
            return NotImplemented
        if isinstance(other, _plain_complex):
            return getattr(CountedComplex(self), operate.__name__)(other)
        pair = (float(other), float(self)) if turned else (float(self), float(other))
        return _new(kind, function(*pair), self, other)

    operate.__name__ = f"__{'r' * turned}{name}__"
    return operate


def _comparison(name):
    compare = getattr(float, name)

    def operate(self, other):
        DONE["other"] += 1
        return compare(self, float(other))

    return operate


for _name in _KINDS:
    setattr(Counted, f"__{_name}__", _binary(_name, False))
    setattr(Counted, f"__r{_name}__", _binary(_name, True))
for _name in ("__lt__", "__le__", "__gt__", "__ge__", "__eq__", "__ne__"):
    setattr(Counted, _name, _comparison(_name))
Counted.__pow__ = lambda self, n: _new("plain", float(self) ** n, self, instructions=n - 1)
Counted.__neg__ = lambda self: _new("other", -float(self), self)
Counted.__abs__ = lambda self: _new("other", abs(float(self)), self)
Counted.__hash__ = np.float64.__hash__


class CountedComplex(np.complex128):
    """A complex number whose operations are counted as those of its parts; it knows no chain."""

    real = property(lambda self: Counted(_plain_complex(self).real))
    imag = property(lambda self: Counted(_plain_complex(self).imag))

    def __neg__(self):
        DONE["other"] += 2
        return CountedComplex(-_plain_complex(self))

    def __abs__(self):
        DONE.update({"plain": 3, "division": 1, "root": 1})
        return Counted(abs(np.complex128(self)))


def _complex_binary(name, turned):
    function, (plain, divisions) = getattr(operator, name), _COMPLEX[name]

    def operate(self, other):
        if isinstance(other, np.ndarray):
            return NotImplemented
        DONE.update({"plain": plain, "division": divisions})
        pair = np.complex128(self), np.complex128(other)  # whose own operators round as compiled code does
        return CountedComplex(function(*(pair[::-1] if turned else pair)))

    return operate


for _name in _COMPLEX:
    setattr(CountedComplex, f"__{_name}__", _complex_binary(_name, False))
    setattr(CountedComplex, f"__r{_name}__", _complex_binary(_name, True))


class CountedArray(np.ndarray):
    """An array of real or complex numbers that count."""

    def __getitem__(self, place):
        found = super().__getitem__(place)
        return _SCALARS.get(type(found), lambda same: same)(found)

    def __iter__(self):
        return (self[i] for i in range(len(self)))

    def __array_ufunc__(self, ufunc, method, *inputs, **options):
        plain = [x.view(np.ndarray) if isinstance(x, CountedArray) else x for x in inputs]
        options["out"] = tuple(x.view(np.ndarray) for x in options["out"]) if "out" in options else None
        result = getattr(ufunc, method)(*plain, **options)
        kinds = {"divide": "division", "sqrt": "root", "add": "plain", "subtract": "plain", "multiply": "plain"}
        DONE[kinds.get(ufunc.__name__, "other")] += np.size(result)
        return counted(result) if isinstance(result, np.ndarray) else result


_SCALARS = {np.float64: Counted, np.complex128: CountedComplex}


def counted(array):
    """The same array, of numbers that count; of other numbers the array itself."""
    return array.view(CountedArray) if array.dtype.type in _SCALARS else array


class _Complex(complex):
    """`complex(re, im)` in a kernel's source."""

    def __new__(cls, *parts):
        return CountedComplex(_plain_complex(*parts))


@contextmanager
def counting_arrays():
    """Arrays that kernels make for themselves count meanwhile."""
    makers = {name: getattr(np, name) for name in ("empty", "zeros", "ones", "full")}
    wrapped = {name: lambda *given, make=make, **named: counted(make(*given, **named)) for name, make in makers.items()}
    with patch.multiple(np, **wrapped), patch.object(builtins, "complex", _Complex):
        yield


def _where(condition, x, y):
    return _new("other", x if condition else y, x, y)


def _sqrt(x):
    return _new("root", math.sqrt(x) if x.__float__() >= 0.0 else math.nan, x)


def install():
    """Has the functions of lanes count; kernels that are imported later have these. Raises RuntimeError."""
    from kernels.lanes import jit, vectors

    if jit.COMPILED:
        raise RuntimeError("operations are counted in plain Python: set NUMBA_DISABLE_JIT=1")
    pow2, exponent = vectors.pow2, vectors.exponent
    vectors.fma = lambda x, y, z: _new("plain", _fma(x, y, z), x, y, z)
    vectors.sqrt, vectors.where = _sqrt, _where
    vectors.pow2 = lambda n: _new("other", pow2(float(n)), n, instructions=2)
    vectors.exponent = lambda x: _new("other", exponent(float(x)), x, instructions=4)
