"""A numba type of WIDTH cells in vector registers, so that physics is written once for one cell and for many.

A function of plain arithmetic compiles for float64 and for `Lanes` alike and gives the same bits in both, because
multiply-adds are explicit (`fma`) and nothing else may be contracted. A column loop is written for one index `i`:
an integer means one cell, `lanes_at(i)` means cells i .. i + WIDTH - 1:

    def body(i, x, y):          # y[i] = x[i]^2 for one cell or WIDTH of them
        y[i] = x[i] * x[i]

Branches become `where(condition, x, y)`; `some(condition)` ends a masked loop. In such a loop a finished lane is frozen
by `where(active, new, old)`, or its bits would depend on its neighbours.
Under NUMBA_DISABLE_JIT=1 only the one-cell form exists.
"""

import math
import operator
from fractions import Fraction

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.extending import intrinsic, lower_cast, models, overload, register_model

from kernels._jit import COMPILED, jit

WIDTH = 32
"""8 lanes reach half the speed, 16 85 %, 64 no more than 32: several registers hide the latency of a recurrence."""

_I64, _F64 = ir.IntType(64), ir.DoubleType()
_MAGIC = 6755399441055744.0  # 1.5 * 2^52: adding it leaves the nearest integer in the low bits


class LanesType(types.Type):
    """WIDTH float64 cells; a float64 beside them is repeated in every lane."""

    def __init__(self):
        super().__init__("Lanes")

    def can_convert_from(self, typing_context, other):
        return Conversion.promote if isinstance(other, types.Number) else None

    def unify(self, typing_context, other):
        return self if isinstance(other, types.Number) else None


class MaskType(types.Type):
    """One bit a lane; a boolean beside it is repeated."""

    def __init__(self):
        super().__init__("Mask")

    def can_convert_from(self, typing_context, other):
        return Conversion.promote if isinstance(other, types.Boolean) else None

    def unify(self, typing_context, other):
        return self if isinstance(other, types.Boolean) else None


class LaneIndexType(types.Type):
    """Cells i .. i + WIDTH - 1 of a column."""

    def __init__(self):
        super().__init__("LaneIndex")


_lanes, _mask, _lane_index = LanesType(), MaskType(), LaneIndexType()


def _primitive(numba_type, llvm_type):
    @register_model(numba_type)
    class Model(models.PrimitiveModel):
        def __init__(self, manager, fe_type):
            super().__init__(manager, fe_type, llvm_type)


_primitive(LanesType, ir.VectorType(_F64, WIDTH))
_primitive(MaskType, ir.VectorType(ir.IntType(1), WIDTH))
_primitive(LaneIndexType, _I64)


def _repeat(builder, value, like):
    """A scalar LLVM value in every lane of a vector type."""
    undefined = ir.Constant(like, ir.Undefined)
    one = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))


@lower_cast(types.Number, LanesType)
def _number_to_lanes(context, builder, source, target, value):
    value = context.cast(builder, value, source, types.float64)
    return _repeat(builder, value, ir.VectorType(_F64, WIDTH))


@lower_cast(types.Boolean, MaskType)
def _boolean_to_mask(context, builder, source, target, value):
    bit = context.cast(builder, value, source, types.boolean)
    bit = builder.icmp_unsigned("!=", bit, ir.Constant(bit.type, 0))
    return _repeat(builder, bit, ir.VectorType(ir.IntType(1), WIDTH))


def _is_wide(*numba_types):
    return any(isinstance(t, LanesType | MaskType) for t in numba_types)


def _elementwise(build, arity, wide_result=_lanes, narrow_result=types.float64):
    """An intrinsic of float64 or Lanes arguments; `build(builder, *values)` emits the instructions for both."""

    def apply(args):
        wide = _is_wide(*args)
        operand = _lanes if wide else types.float64

        def codegen(context, builder, signature, values):
            return build(
                builder, *(context.cast(builder, v, t, operand) for v, t in zip(values, signature.args, strict=True))
            )

        return (wide_result if wide else narrow_result)(*args), codegen

    return (
        intrinsic(lambda typing_context, x: apply((x,))),
        intrinsic(lambda typing_context, x, y: apply((x, y))),
        intrinsic(lambda typing_context, x, y, z: apply((x, y, z))),
    )[arity - 1]


def _operator(python_operator, build, wide_result=_lanes):
    """Gives a Python operator a meaning for Lanes; plain numbers keep numba's own."""
    apply = _elementwise(build, 2, wide_result)

    @overload(python_operator)
    def overloaded(x, y):
        if _is_wide(x, y):
            return lambda x, y: apply(x, y)
        return None


_operator(operator.add, lambda b, x, y: b.fadd(x, y))
_operator(operator.sub, lambda b, x, y: b.fsub(x, y))
_operator(operator.mul, lambda b, x, y: b.fmul(x, y))
_operator(operator.truediv, lambda b, x, y: b.fdiv(x, y))
_operator(operator.lt, lambda b, x, y: b.fcmp_ordered("<", x, y), _mask)
_operator(operator.le, lambda b, x, y: b.fcmp_ordered("<=", x, y), _mask)
_operator(operator.gt, lambda b, x, y: b.fcmp_ordered(">", x, y), _mask)
_operator(operator.ge, lambda b, x, y: b.fcmp_ordered(">=", x, y), _mask)


def _logic(python_operator, instruction):
    """& and | of masks, a plain boolean beside a mask included."""

    @intrinsic
    def apply(typing_context, x, y):
        def codegen(context, builder, signature, values):
            bits = (context.cast(builder, v, t, _mask) for v, t in zip(values, signature.args, strict=True))
            return getattr(builder, instruction)(*bits)

        return _mask(x, y), codegen

    @overload(python_operator)
    def overloaded(x, y):
        if _is_wide(x, y):
            return lambda x, y: apply(x, y)
        return None


_logic(operator.and_, "and_")
_logic(operator.or_, "or_")

_negative = _elementwise(lambda b, x: b.fneg(x), 1)


@overload(operator.neg)
def _neg(x):
    return (lambda x: _negative(x)) if _is_wide(x) else None


def _called(name):
    """An LLVM floating-point intrinsic of the operands' own type."""

    def build(builder, *values):
        ty = values[0].type
        suffix = f"v{WIDTH}f64" if isinstance(ty, ir.VectorType) else "f64"
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(ty, [ty] * len(values)), f"llvm.{name}.{suffix}"
        )
        return builder.call(function, values)

    return build


_fma = _elementwise(_called("fma"), 3)
_sqrt = _elementwise(_called("sqrt"), 1)
_fabs = _elementwise(_called("fabs"), 1)


def fma(x, y, z):
    """x*y + z, rounded once, also in plain Python."""
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        return x * y + z
    exact = Fraction(x) * Fraction(y) + Fraction(z)
    try:
        return float(exact) if exact else x * y + z
    except OverflowError:
        return math.copysign(math.inf, exact)


@overload(fma)
def _fma_overload(x, y, z):
    return lambda x, y, z: _fma(x, y, z)


def sqrt(x):
    """Square root; NaN below 0."""
    return math.sqrt(x) if x >= 0.0 else math.nan


@overload(sqrt)
def _sqrt_overload(x):
    return lambda x: _sqrt(x)


def magnitude(x):
    """Absolute value."""
    return abs(x)


@overload(magnitude)
def _magnitude_overload(x):
    return lambda x: _fabs(x)


def _vector_like(ty, element):
    return ir.VectorType(element, WIDTH) if isinstance(ty, ir.VectorType) else element


def _bits(ty, value):
    """The 64-bit constant `value`, in every lane of a vector."""
    return ir.Constant(ty, [value] * WIDTH if isinstance(ty, ir.VectorType) else value)


def _build_pow2(builder, n):
    wide = _vector_like(n.type, _I64)
    magic = ir.Constant(n.type, [_MAGIC + 1023.0] * WIDTH if isinstance(n.type, ir.VectorType) else _MAGIC + 1023.0)
    exponent = builder.bitcast(builder.fadd(n, magic), wide)
    return builder.bitcast(builder.shl(exponent, _bits(wide, 52)), n.type)


def _build_exponent(builder, x):
    wide = _vector_like(x.type, _I64)
    field = builder.and_(builder.lshr(builder.bitcast(x, wide), _bits(wide, 52)), _bits(wide, 0x7FF))
    as_float = builder.bitcast(builder.or_(field, _bits(wide, 0x4330000000000000)), x.type)  # 2^52 + field
    offset = 2.0**52 + 1023.0
    return builder.fsub(as_float, ir.Constant(x.type, [offset] * WIDTH if isinstance(x.type, ir.VectorType) else offset))


_pow2, _exponent = _elementwise(_build_pow2, 1), _elementwise(_build_exponent, 1)


def pow2(n):
    """2^n for an integer-valued n from -1022 to 1023."""
    return math.ldexp(1.0, int(n))


@overload(pow2)
def _pow2_overload(n):
    return lambda n: _pow2(n)


def exponent(x):
    """floor(log2(abs(x))) as a float64, for normal x."""
    return float(math.frexp(x)[1] - 1)


@overload(exponent)
def _exponent_overload(x):
    return lambda x: _exponent(x)


@jit
def nearest(x):
    """The nearest integer, as a float64, for abs(x) < 2^51."""
    return (x + _MAGIC) - _MAGIC


@intrinsic
def _select(typing_context, condition, x, y):
    def codegen(context, builder, signature, values):
        operands = (context.cast(builder, v, t, _lanes) for v, t in zip(values[1:], signature.args[1:], strict=True))
        return builder.select(values[0], *operands)

    return _lanes(condition, x, y), codegen


def where(condition, x, y):
    """x where the condition holds, else y; both are computed."""
    return x if condition else y


@overload(where)
def _where_overload(condition, x, y):
    if isinstance(condition, MaskType):
        return lambda condition, x, y: _select(condition, x, y)
    return lambda condition, x, y: x if condition else y


@intrinsic
def _any_set(typing_context, condition):
    def codegen(context, builder, signature, values):
        wide = builder.bitcast(values[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", wide, ir.Constant(ir.IntType(WIDTH), 0))

    return types.boolean(condition), codegen


def some(condition):
    """Whether the condition holds in at least one cell."""
    return bool(condition)


@overload(some)
def _some_overload(condition):
    if isinstance(condition, MaskType):
        return lambda condition: _any_set(condition)
    return lambda condition: condition


@intrinsic
def _invert(typing_context, condition):
    def codegen(context, builder, signature, values):
        return builder.not_(values[0])

    return _mask(condition), codegen


def isnt(condition):
    """The opposite of a condition."""
    return not condition


@overload(isnt)
def _isnt_overload(condition):
    if isinstance(condition, MaskType):
        return lambda condition: _invert(condition)
    return lambda condition: not condition


@intrinsic
def _lanes_at(typing_context, i):
    return _lane_index(types.int64), lambda context, builder, signature, values: values[0]


def _cells_pointer(context, builder, array_type, array, i):
    element = context.get_data_type(array_type.dtype)
    first = builder.gep(context.make_array(array_type)(context, builder, array).data, [i])
    return builder.bitcast(first, ir.VectorType(element, WIDTH).as_pointer()), element


def _align(element):
    """Bytes of one cell: a column's cells need not lie on a register's border."""
    return element.width // 8 if isinstance(element, ir.IntType) else 8


@intrinsic
def _load(typing_context, column, i):
    def codegen(context, builder, signature, values):
        pointer, element = _cells_pointer(context, builder, signature.args[0], *values)
        cells = builder.load(pointer, align=_align(element))
        return builder.sitofp(cells, ir.VectorType(_F64, WIDTH)) if isinstance(element, ir.IntType) else cells

    return _lanes(column, i), codegen


@intrinsic
def _store(typing_context, column, i, value):
    def codegen(context, builder, signature, values):
        pointer, element = _cells_pointer(context, builder, signature.args[0], *values[:2])
        cells = context.cast(builder, values[2], signature.args[2], _lanes)
        if isinstance(element, ir.IntType):
            cells = builder.fptosi(cells, ir.VectorType(element, WIDTH))
        builder.store(cells, pointer, align=_align(element))
        return context.get_dummy_value()

    return types.void(column, i, value), codegen


@overload(operator.getitem)
def _getitem(column, i):
    if isinstance(i, LaneIndexType) and isinstance(column, types.Array):
        return lambda column, i: _load(column, i)
    return None


@overload(operator.setitem)
def _setitem(column, i, value):
    if isinstance(i, LaneIndexType) and isinstance(column, types.Array):
        return lambda column, i, value: _store(column, i, value)
    return None


def _each_cell(body, columns):
    for i in range(columns[0].shape[0]):
        body(i, *columns)


@jit
def _each_lane(body, columns):
    n = columns[0].shape[0]
    whole = n - n % WIDTH
    for i in range(0, whole, WIDTH):
        body(_lanes_at(i), *columns)
    for i in range(whole, n):
        body(i, *columns)


each_cell = _each_lane if COMPILED else _each_cell
"""each_cell(body, columns): body(i, *columns) for all cells, WIDTH at a time where there are as many."""

one_by_one = jit(_each_cell)
"""The same one cell at a time: the rival that lanes are measured against."""
