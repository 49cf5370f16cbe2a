"""Functions that run on symbols at compile time; their operations are emitted in place of the call.

numba cannot compile a comprehension over a tuple, and takes some hundredths of a second for each small function. A
`symbolic` function is plain Python without loops over steps and without branches on values. Where compiled code calls
it, it is run once on symbols of its arguments to find the result's type, and again to emit the LLVM code. So tuples of
any length, records and their `_replace`, and branches on None or on lengths cost nothing at run time. It cannot create
arrays. In plain Python it is an ordinary function with the same bits.
"""

import functools
import inspect
import operator
import sys
from types import FunctionType, SimpleNamespace

from llvmlite import ir
from numba import types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import builtin_registry
from numba.extending import lower_builtin, type_callable

from kernels.lanes.jit import COMPILED, F, jit_call

_KINDS, _SIGNATURES, _COUNTED = {}, {}, {}
"""Types of functions, of calls that have been typed, and whether a type has arrays in it, which numba counts."""


class _Symbol:
    """What stands for a value: its type, and where there is a builder its LLVM value, written when it is needed."""

    def __init__(self, writer, kind, write=None):
        self._writer, self._kind, self._write = writer, kind, write

    @functools.cached_property
    def _value(self):
        return self._writer.builder and self._write()

    def __call__(self, *arguments):
        return self._writer.call(self._kind, arguments)

    def __getitem__(self, index):
        return self._writer.call(operator.getitem, (self, index))

    def __setitem__(self, index, value):
        self._writer.call(operator.setitem, (self, index, value))

    def __neg__(self):
        return self._writer.call(operator.neg, (self,))

    def __abs__(self):
        return self._writer.call(abs, (self,))


def _operation(function, turned):
    def write(x, y):
        return x._writer.call(function, (y, x) if turned else (x, y))

    return write


for _name in ("add", "sub", "mul", "truediv", "lt", "le", "gt", "ge", "and_", "or_"):
    _function = getattr(operator, _name)
    setattr(_Symbol, f"__{_name.strip('_')}__", _operation(_function, turned=False))
    setattr(_Symbol, f"__r{_name.strip('_')}__", _operation(_function, turned=True))


class _Rehearsal:
    """In the place of a writer: it only sees what is called."""

    def call(self, function, arguments):
        return ANY


ANY = _Symbol(_Rehearsal(), None)
"""Stands for every number where only the way of a computation is wanted."""


class _Writer:
    """Types calls of compiled functions; with a builder it writes them, too."""

    def __init__(self, typing_context, context=None, builder=None):
        self.typing_context, self.context, self.builder = typing_context, context, builder

    def opened(self, kind, write=None):
        """The symbol of what `write` writes; of a tuple or a record such a one of symbols, and None of nothing.

        Of the class of a record it is that class.
        """
        if isinstance(kind, types.NoneType):
            return None
        if isinstance(kind, types.NamedTupleClass):
            return kind.instance_class
        if not isinstance(kind, types.BaseTuple):
            return _Symbol(self, kind, write)
        whole = functools.cache(lambda: write())
        parts = tuple(
            self.opened(part, lambda j=j: self.builder.extract_value(whole(), j)) for j, part in enumerate(kind)
        )
        return kind.instance_class(*parts) if hasattr(kind, "instance_class") else parts

    def closed(self, x):
        """Type and value of a symbol, a number, or a tuple with such in it."""
        if isinstance(x, _Symbol):
            return x._kind, x._value
        if isinstance(x, tuple):
            kinds, values = zip(*map(self.closed, x), strict=True) if x else ((), ())
            kind = types.BaseTuple.from_types(kinds, type(x) if hasattr(x, "_fields") else None)
            return kind, self.builder and self.context.make_tuple(self.builder, kind, values)
        if isinstance(x, float):
            return types.float64, self.builder and ir.DoubleType()(x)
        kind = types.unliteral(self.typing_context.resolve_value_type(x))
        return kind, self.builder and self.context.get_constant_generic(self.builder, kind, x)

    def call(self, function, arguments):
        """What a compiled function, or one of that type, gives for the arguments."""
        of_arguments = [self.closed(x) for x in arguments]
        if isinstance(function, types.Type):
            kind = function
        elif (kind := _KINDS.get(function)) is None:
            kind = _KINDS[function] = self.typing_context.resolve_value_type(function)
        key = kind, tuple(types.unliteral(of_one) for of_one, _ in of_arguments)
        if key not in _SIGNATURES:
            _SIGNATURES[key] = kind.get_call_type(self.typing_context, key[1], {})
        signature = _SIGNATURES[key]
        if self.builder is None:
            return self.opened(signature.return_type)
        wanted = zip(of_arguments, signature.args, strict=True)
        values = [self.context.cast(self.builder, value, of_one, want) for (of_one, value), want in wanted]
        called = self.context.get_function(kind, signature)
        value = called(self.builder, values)
        returned = signature.return_type
        if returned not in _COUNTED:
            _COUNTED[returned] = self.context.data_model_manager[returned].contains_nrt_meminfo()
        if _COUNTED[returned] and self.context.enable_nrt:  # arrays are their caller's, and counted where handed back
            self.context.nrt.decref(self.builder, returned, value)
        self.context.add_linking_libs(getattr(called, "libs", ()))
        return self.opened(returned, lambda: value)


def _writer_of(arguments):
    """The writer of the first symbol in tuples of tuples; None where there is none."""
    for x in arguments:
        writer = x._writer if isinstance(x, _Symbol) else _writer_of(x) if isinstance(x, tuple) else None
        if writer is not None:
            return writer
    return None


def _for_symbols(function):
    """A global function of a symbolic one, for symbols too."""
    if hasattr(function, "on_symbols"):
        return lambda *arguments: function.on_symbols()(*arguments)

    def call(*arguments):
        writer = _writer_of(arguments)
        return function(*arguments) if writer is None else writer.call(function, arguments)

    return call


@functools.cache
def _scope_of(module):
    """Globals of a module, with its functions for symbols."""
    scope = dict(vars(sys.modules[module]))
    for name, x in scope.items():
        if isinstance(x, FunctionType) or isinstance(getattr(x, "_numba_type_", None), types.Callable):
            scope[name] = _for_symbols(x)
    return scope


def taking_symbols(module):
    """A module's functions, which take symbols too: for objects with which a symbolic function works."""
    return SimpleNamespace(**_scope_of(module.__name__))


def written(function):
    """A function with any Python in it, of tuples, numbers or symbols, as one that compiled code can be handed."""
    symbolic(function)
    if COMPILED:
        # not simply the last one there: other threads may have written theirs meanwhile
        function._numba_type_ = next(kind for x, kind in reversed(builtin_registry.globals) if x is function)
    return function


def _on_symbols(function):
    """The function in the scope that is for symbols."""
    scope = _scope_of(function.__module__)
    return FunctionType(function.__code__, scope, function.__name__, function.__defaults__, function.__closure__)


def symbolic(function: F) -> F:
    """Gives a function of plain Python its meaning in compiled code: what it does is written where it is called."""
    if not COMPILED:
        return function
    function.on_symbols = functools.cache(lambda: _on_symbols(function))

    @type_callable(function)
    def _type(context):
        def typer(*kinds):
            writer = _Writer(context)
            return writer.closed(function.on_symbols()(*map(writer.opened, kinds)))[0]

        typer.pysig = inspect.signature(function)
        return typer

    @lower_builtin(function, types.VarArg(types.Any))
    def _lower(context, builder, signature, values):
        writer = _Writer(context.typing_context, context, builder)
        arguments = [
            writer.opened(kind, lambda value=value: value) for kind, value in zip(signature.args, values, strict=True)
        ]
        kind, value = writer.closed(function.on_symbols()(*arguments))
        value = context.cast(builder, value, kind, signature.return_type)
        return impl_ret_borrowed(context, builder, signature.return_type, value)

    return function


def left_a_call(function):
    """As `symbolic`, but left a call: for what is long and used in several places."""
    names = ", ".join(inspect.signature(function).parameters)
    call = eval(f"lambda {names}: inner({names})", {"inner": written(function)})
    call.__name__ = call.__qualname__ = function.__name__
    return jit_call(call)


@symbolic
def fold(function, first, shared, *tuples):
    """function(... function(first, x0, y0, ..., *shared) ..., x1, y1, ..., *shared), from left to right."""
    for entries in zip(*tuples, strict=True):
        first = function(first, *entries, *shared)
    return first
