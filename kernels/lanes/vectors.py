"""numba types of cells side by side in vector registers, so that physics is written once for one cell and for many.

A function of plain arithmetic compiles for float64 and for `Lanes` alike and gives the same bits in both, because
multiply-adds are explicit (`fma`) and nothing else may be contracted. A column loop is written for one index `i`:
an integer means one cell, `lanes_at(i)` means cells i .. i + WIDTH - 1, `few_at(i)` means i .. i + FEW - 1:

    def body(i, x, y):          # y[i] = x[i]^2 for one cell or as many as the index means
        y[i] = x[i] * x[i]

Branches become `where(condition, x, y)`; `any_lane(condition)` ends a masked loop. In such a loop a finished lane is
frozen by `where(active, new, old)`, or its bits would depend on its neighbours.
Under NUMBA_DISABLE_JIT=1 only the one-cell form exists. `columns` has the loops.
"""

import inspect
import math
import operator
from fractions import Fraction

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.core.typeconv import Conversion
from numba.extending import lower_builtin, lower_cast, models, register_model, type_callable

from kernels.lanes.jit import jit
from kernels.lanes.symbols import symbolic

REGISTER = 8 if "+avx512f" in cpu_target.target_context.codegen().magic_tuple()[2] else 4
"""Numbers in a vector register of the processor that code is compiled for."""
WIDTH, FEW = 4 * REGISTER, 2 * REGISTER
"""Lanes for formulas, and for what steps: several registers hide the latency of a recurrence; more lanes than that wait
for their slowest, and spill.

With half as many lanes formulas take 1 to 1.35 of the time, with twice as many what steps takes 1 to 2.2.
"""

_I64, _F64 = ir.IntType(64), ir.DoubleType()
_MAGIC = 6755399441055744.0  # 1.5 * 2^52: adding it leaves the nearest integer in the low bits


class _Primitive(types.Type):
    """A type of so many lanes, with a model of its own; a number of type `one` beside it is repeated in every lane."""

    one, element = None, None

    def __init__(self, width):
        super().__init__(f"{type(self).__name__}({width})")
        self.width, self.llvm = width, ir.VectorType(self.element, width) if self.element else _I64

    def __init_subclass__(cls):
        @register_model(cls)
        class Model(models.PrimitiveModel):
            def __init__(self, manager, fe_type):
                super().__init__(manager, fe_type, fe_type.llvm)

    def can_convert_from(self, typing_context, other):
        return Conversion.promote if self.one and isinstance(other, self.one) else None

    def unify(self, typing_context, other):
        return self if self.one and isinstance(other, self.one) else None


class LanesType(_Primitive):
    """A float64 of each cell."""

    one, element = types.Number, _F64


class MaskType(_Primitive):
    """One bit a lane."""

    one, element = types.Boolean, ir.IntType(1)


class LaneIndexType(_Primitive):
    """As many cells of a column, from i on."""


class _Written(ir.Constant):
    """A constant vector in LLVM's words, which llvmlite writes out lane by lane: a tenth of the text and its time."""

    def __init__(self, ty, words):
        self.type, self.constant, self._words = ty, (), words

    def _to_string(self):
        return f"{self.type} {self._words}"

    def _get_reference(self):
        return self._words


def _repeat(builder, value, like):
    """A scalar LLVM value in every lane of a vector type."""
    if isinstance(value, ir.Constant):
        return _Written(like, f"splat ({value})")
    undefined, lanes = _Written(like, "undef"), _Written(ir.VectorType(ir.IntType(32), like.count), "zeroinitializer")
    return builder.shuffle_vector(builder.insert_element(undefined, value, ir.IntType(32)(0)), undefined, lanes)


@lower_cast(types.Number, LanesType)
def _number_to_lanes(context, builder, source, target, value):
    return _repeat(builder, context.cast(builder, value, source, types.float64), target.llvm)


@lower_cast(types.Boolean, MaskType)
def _boolean_to_mask(context, builder, source, target, value):
    bit = context.cast(builder, value, source, types.boolean)
    bit = builder.icmp_unsigned("!=", bit, ir.Constant(bit.type, 0))
    return _repeat(builder, bit, target.llvm)


def _width(*numba_types):
    """How many lanes the wide ones of some types have; 0 where none is wide."""
    return max((t.width for t in numba_types if isinstance(t, LanesType | MaskType)), default=0)


def _number(*numba_types):
    """The type of a number that is computed from these."""
    width = _width(*numba_types)
    return LanesType(width) if width else types.float64


def _emit(build, operand=_number):
    """Lowers a call: casts its arguments to the type `operand(*types)`, then builds."""

    def lower(context, builder, signature, values):
        target = operand(*signature.args)
        return build(
            builder, *(context.cast(builder, v, t, target) for v, t in zip(values, signature.args, strict=True))
        )

    return lower


def _operator(python_operator, build, wide=LanesType, result=LanesType):
    """Gives a Python operator a meaning for lanes of the type `wide`; plain numbers keep numba's own."""

    @type_callable(python_operator)
    def _(context):
        return lambda x, y: result(_width(x, y)) if isinstance(x, wide) or isinstance(y, wide) else None

    for operands in ((wide, wide), (wide, wide.one), (wide.one, wide)):
        lower_builtin(python_operator, *operands)(_emit(build, lambda x, y: wide(_width(x, y))))


def in_place(python_function, arity, result, lower):
    """Gives a Python function a compiled meaning, emitted where it is called; `result(*types)` is what it returns."""

    def typer(*kinds):
        return result(*kinds)

    kind = inspect.Parameter.POSITIONAL_ONLY
    typer.pysig = inspect.Signature([inspect.Parameter(f"x{i}", kind) for i in range(arity)])
    type_callable(python_function)(lambda context: typer)
    lower_builtin(python_function, *[types.Any] * arity)(lower)


def _called(name):
    """An LLVM floating-point intrinsic of the operands' own type."""

    def build(builder, *values):
        ty = values[0].type
        suffix = f"v{ty.count}f64" if isinstance(ty, ir.VectorType) else "f64"
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(ty, [ty] * len(values)), f"llvm.{name}.{suffix}"
        )
        return builder.call(function, values)

    return build


_operator(operator.add, lambda b, x, y: b.fadd(x, y))
_operator(operator.sub, lambda b, x, y: b.fsub(x, y))
_operator(operator.mul, lambda b, x, y: b.fmul(x, y))
_operator(operator.truediv, lambda b, x, y: b.fdiv(x, y))
_operator(operator.lt, lambda b, x, y: b.fcmp_ordered("<", x, y), result=MaskType)
_operator(operator.le, lambda b, x, y: b.fcmp_ordered("<=", x, y), result=MaskType)
_operator(operator.gt, lambda b, x, y: b.fcmp_ordered(">", x, y), result=MaskType)
_operator(operator.ge, lambda b, x, y: b.fcmp_ordered(">=", x, y), result=MaskType)
_operator(operator.and_, lambda b, x, y: b.and_(x, y), wide=MaskType, result=MaskType)
_operator(operator.or_, lambda b, x, y: b.or_(x, y), wide=MaskType, result=MaskType)
type_callable(operator.neg)(lambda context: lambda x: x if isinstance(x, LanesType) else None)
lower_builtin(operator.neg, LanesType)(_emit(lambda b, x: b.fneg(x)))


def fma(x, y, z):
    """x*y + z, rounded once, also in plain Python."""
    x, y, z = np.float64(x), np.float64(y), np.float64(z)
    if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
        return x * y + z
    exact = Fraction(float(x)) * Fraction(float(y)) + Fraction(float(z))
    try:
        return np.float64(float(exact)) if exact else x * y + z
    except OverflowError:
        return np.float64(math.inf if exact > 0 else -math.inf)


def sqrt(x):
    """Square root; NaN below 0."""
    return np.sqrt(np.float64(x))


def magnitude(x):
    """Absolute value."""
    return abs(x)


in_place(fma, 3, _number, _emit(_called("fma")))
in_place(sqrt, 1, _number, _emit(_called("sqrt")))
in_place(magnitude, 1, _number, _emit(_called("fabs")))


@symbolic
def dot(weights, terms):
    """Sum of weights[j] terms[j] by a chain of multiply-adds from the first term on; both are tuples."""
    total = weights[0] * terms[0]
    for weight, term in zip(weights[1:], terms[1:], strict=True):
        total = fma(weight, term, total)
    return total


@symbolic
def horner(x, coefficients):
    """Polynomial in x, lowest power first; the coefficients are a tuple."""
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value = fma(value, x, coefficient)
    return value


def pow2(n):
    """2^n for an integer-valued n from -1022 to 1023."""
    return np.float64(math.ldexp(1.0, int(n)) if -1023.0 < n < 1024.0 else math.nan)


def exponent(x):
    """floor(log2(abs(x))) as a float64, for normal x."""
    return np.float64(math.frexp(x)[1] - 1)


def _constant(ty, value):
    """A constant of the type `ty`: in every lane of a vector."""
    return _repeat(None, ty.element(value), ty) if isinstance(ty, ir.VectorType) else ty(value)


def _as_integers(ty):
    return ir.VectorType(_I64, ty.count) if isinstance(ty, ir.VectorType) else _I64


def _build_pow2(builder, n):
    integers = _as_integers(n.type)
    biased = builder.bitcast(builder.fadd(n, _constant(n.type, _MAGIC + 1023.0)), integers)
    return builder.bitcast(builder.shl(biased, _constant(integers, 52)), n.type)


def _build_exponent(builder, x):
    integers = _as_integers(x.type)
    biased = builder.lshr(builder.bitcast(x, integers), _constant(integers, 52))
    biased = builder.and_(biased, _constant(integers, 0x7FF))
    shifted = builder.bitcast(builder.or_(biased, _constant(integers, 0x4330000000000000)), x.type)  # 2^52 + biased
    return builder.fsub(shifted, _constant(x.type, 2.0**52 + 1023.0))


in_place(pow2, 1, _number, _emit(_build_pow2))
in_place(exponent, 1, _number, _emit(_build_exponent))


@jit
def nearest(x):
    """The nearest integer, as a float64, for abs(x) < 2^51."""
    return (x + _MAGIC) - _MAGIC


def where(condition, x, y):
    """x where the condition holds, else y; both are computed."""
    return x if condition else y


@symbolic
def choose(condition, xs, ys):
    """`where` for each pair of numbers in two tuples of tuples, or records; shaped as the first."""
    if not isinstance(xs, tuple):
        return where(condition, xs, ys)
    chosen = tuple(choose(condition, x, y) for x, y in zip(xs, ys, strict=True))
    return type(xs)(*chosen) if hasattr(xs, "_fields") else chosen


def _lower_where(context, builder, signature, values):
    wide = isinstance(signature.return_type, LanesType)
    mask = signature.args[0] if wide and isinstance(signature.args[0], MaskType) else types.boolean
    condition = context.cast(builder, values[0], signature.args[0], mask)
    if mask is types.boolean:
        condition = builder.icmp_unsigned("!=", condition, ir.Constant(condition.type, 0))
    operands = (
        context.cast(builder, v, t, signature.return_type) for v, t in zip(values[1:], signature.args[1:], strict=True)
    )
    return builder.select(condition, *operands)


def any_lane(condition):
    """Whether the condition holds in at least one cell."""
    return bool(condition)


def _lower_any_lane(context, builder, signature, values):
    if not isinstance(signature.args[0], MaskType):
        return context.cast(builder, values[0], signature.args[0], types.boolean)
    bits = builder.bitcast(values[0], ir.IntType(signature.args[0].width))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


def is_rare(condition, among):
    """Whether a condition holds in a quarter, or less, of the cells in which another one does that it is a case of; or
    in one of several."""
    return condition < among


def _lower_is_rare(context, builder, signature, values):
    if not isinstance(signature.args[0], MaskType):
        return builder.icmp_unsigned("<", *values)
    bits = ir.IntType(signature.args[0].width)
    few, many = (builder.ctpop(builder.bitcast(value, bits)) for value in values)
    one = builder.icmp_unsigned("<=", few, bits(1))
    quarter = builder.icmp_unsigned("<=", builder.shl(few, bits(2)), many)
    return builder.and_(builder.or_(one, quarter), builder.icmp_unsigned("<", few, many))


def not_(condition):
    """The opposite of a condition."""
    return not condition


in_place(where, 3, lambda condition, x, y: _number(condition, x, y), _lower_where)
in_place(any_lane, 1, lambda condition: types.boolean, _lower_any_lane)
in_place(is_rare, 2, lambda condition, among: types.boolean, _lower_is_rare)
in_place(not_, 1, lambda condition: condition, lambda context, builder, signature, values: builder.not_(values[0]))


def lanes_at(i):
    """The index of cells i .. i + WIDTH - 1; in plain Python of cell i alone."""
    return operator.index(i)


def few_at(i):
    """The index of cells i .. i + FEW - 1; in plain Python of cell i alone."""
    return operator.index(i)


for _at, _wide in ((lanes_at, WIDTH), (few_at, FEW)):
    in_place(_at, 1, lambda i, n=_wide: LaneIndexType(n), lambda context, builder, signature, values: values[0])


def _lanes_of(array, i):
    """The type of the lanes at i, if any can be there: cells in one dimension, or a row of a memory of so many lanes.

    Anything else is a TypingError.
    """
    if not isinstance(array, types.Array) or array.layout != "C" or array.dtype not in (types.float64, types.int8):
        return None
    if array.ndim == 2 and isinstance(i, types.BaseTuple) and len(i) == 2:
        i = i[1]
    elif array.ndim != 1:
        return None
    return LanesType(i.width) if isinstance(i, LaneIndexType) else None


def _cells_pointer(context, builder, array_type, index_type, array, i):
    """Where lanes are, their type, and the bytes of one: a column's cells need not lie on a register's border."""
    element = context.get_data_type(array_type.dtype)
    width = _lanes_of(array_type, index_type).width
    if array_type.ndim == 2:
        row, first = cgutils.unpack_tuple(builder, i)
        i = builder.add(builder.mul(row, _I64(width)), first)
    first = builder.gep(context.make_array(array_type)(context, builder, array).data, [i])
    align = element.width // 8 if isinstance(element, ir.IntType) else 8
    return builder.bitcast(first, ir.VectorType(element, width).as_pointer()), element, align


@type_callable(operator.getitem)
def _type_load(context):
    return _lanes_of


def _lower_load(context, builder, signature, values):
    pointer, element, align = _cells_pointer(context, builder, *signature.args, *values)
    cells = builder.load(pointer, align=align)
    return builder.sitofp(cells, signature.return_type.llvm) if isinstance(element, ir.IntType) else cells


@type_callable(operator.setitem)
def _type_store(context):
    def typer(column, i, value):
        lanes = _lanes_of(column, i)
        return lanes and types.void(column, i, lanes)

    return typer


def _lower_store(context, builder, signature, values):
    pointer, element, align = _cells_pointer(context, builder, *signature.args[:2], *values[:2])
    cells = values[2]
    if isinstance(element, ir.IntType):
        cells = builder.fptosi(cells, ir.VectorType(element, cells.type.count))
    builder.store(cells, pointer, align=align)
    return context.get_dummy_value()


for _index in (LaneIndexType, *(types.Tuple((types.int64, LaneIndexType(n))) for n in (WIDTH, FEW))):
    lower_builtin(operator.getitem, types.Array, _index)(_lower_load)
    lower_builtin(operator.setitem, types.Array, _index, LanesType)(_lower_store)
