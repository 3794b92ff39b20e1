"""Numbers eight abreast, for the kernel: one machine instruction does eight bodies at once.

A ``Lanes`` is a vector of ``LANES`` doubles in LLVM's sense, a ``Mask`` one of as many bits. They
exist in compiled code only, where ``+ - * /`` and comparisons take two of them, or one and a plain
number; the machine code is what the processor at hand has: one, two or four instructions for each.
Each lane is computed by itself, to IEEE's letter, so what is in it never depends on its neighbours.

In memory a ``Lanes`` is a row of an array of shape (n, LANES), float64, contiguous.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any, Final, TypeAlias

from llvmlite import ir
from numba import extending
from numba.core import cgutils, types

LANES: Final = 8

Lanes: TypeAlias = Any
Mask: TypeAlias = Any

_DOUBLE: Final = ir.DoubleType()
_INDEX: Final = ir.IntType(64)
_DOUBLES: Final = ir.VectorType(_DOUBLE, LANES)
_TRUTHS: Final = ir.VectorType(ir.IntType(1), LANES)
_ALIGNED: Final = 8  # bytes; all that NumPy promises

_Function: TypeAlias = Callable[..., Any]
_intrinsic: Final[Callable[[_Function], _Function]] = extending.intrinsic
_overload: Final[Callable[..., Callable[[_Function], _Function]]] = extending.overload
_function_named: Final[_Function] = cgutils.get_or_insert_function
_primitive: Final[Any] = extending.models.PrimitiveModel


def _vector_type(name: str, of: Any) -> Any:
    """A type of compiled code that is a vector in LLVM."""
    kind: Any = type(name, (types.Type,), {})

    def start(self: Any, manager: Any, kind: Any) -> None:
        _primitive.__init__(self, manager, kind, of)

    extending.register_model(kind)(type(f"{name}Model", (_primitive,), {"__init__": start}))
    return kind(name)


_lanes: Final = _vector_type("Lanes", _DOUBLES)
_mask: Final = _vector_type("Mask", _TRUTHS)


def _instruction(result: Any, emit: _Function, *kinds: Any) -> _Function:
    """A function for compiled code that is one instruction on values of the given types."""

    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return emit(builder, values)

    if len(kinds) == 1:
        return _intrinsic(lambda _typing, a: (result(*kinds), generate))
    return _intrinsic(lambda _typing, a, b: (result(*kinds), generate))


def _method(name: str, *first: str) -> _Function:
    """An instruction that the builder has a method for."""
    return lambda builder, values: getattr(builder, name)(*first, *values)


def _repeated(builder: Any, number: Any) -> Any:
    first = builder.insert_element(
        ir.Constant(_DOUBLES, ir.Undefined), number, ir.Constant(ir.IntType(32), 0)
    )
    order = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, first, order)


def _called(name: str) -> _Function:
    """A call of one of LLVM's functions of one vector."""

    def emit(builder: Any, values: Any) -> Any:
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES])
        function_name = f"llvm.{name}.v{LANES}f64"
        return builder.call(_function_named(builder.module, kind, function_name), values)

    return emit


every: Final = _instruction(
    _lanes, lambda builder, values: _repeated(builder, values[0]), types.float64
)
"""every(number): the same number in each lane."""

_root: Final = _instruction(_lanes, _called("sqrt"), _lanes)

size: Final = _instruction(_lanes, _called("fabs"), _lanes)
"""size(a): the absolute value."""

bits: Final = _instruction(
    types.int64,
    lambda builder, values: builder.zext(builder.bitcast(values[0], ir.IntType(LANES)), _INDEX),
    _mask,
)
"""bits(mask): a number whose lowest bit is the first lane's truth, and so on."""


@_intrinsic
def load(_typing: Any, array: Any, row: Any) -> Any:
    """A row of an array: ``load(array, row)``."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = _place(context, builder, signature.args[0], values[0], values[1])
        return builder.load(builder.bitcast(place, _DOUBLES.as_pointer()), align=_ALIGNED)

    return _lanes(array, types.int64), generate


@_intrinsic
def store(_typing: Any, array: Any, row: Any, value: Any) -> Any:
    """Puts a value into a row of an array: ``store(array, row, value)``."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = _place(context, builder, signature.args[0], values[0], values[1])
        builder.store(values[2], builder.bitcast(place, _DOUBLES.as_pointer()), align=_ALIGNED)
        return context.get_dummy_value()

    return types.void(array, types.int64, _lanes), generate


@_intrinsic
def gather(_typing: Any, array: Any, numbers: Any, which: Any, scale: Any, shift: Any) -> Any:
    """Values of each lane's own row of an array: ``gather(array, numbers, which, scale, shift)``.

    The row is ``scale`` times ``numbers[which]`` of the lane, plus ``shift``.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data, numbers_, which_, scale_, shift_ = values
        first = _place(context, builder, signature.args[1], numbers_, which_)
        result = ir.Constant(_DOUBLES, ir.Undefined)
        for lane in range(LANES):
            number = builder.load(builder.gep(first, [ir.Constant(_INDEX, lane)]))
            row = builder.add(builder.mul(number, scale_), shift_)
            place = _place(context, builder, signature.args[0], data, row)
            value = builder.load(builder.gep(place, [ir.Constant(_INDEX, lane)]))
            result = builder.insert_element(result, value, ir.Constant(ir.IntType(32), lane))
        return result

    return _lanes(array, numbers, types.int64, types.int64, types.int64), generate


def _place(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.gep(data, [builder.mul(row, ir.Constant(_INDEX, LANES))])


def root(a: Lanes) -> Lanes:
    """The square root; also of a plain number."""
    return math.sqrt(a)


@_overload(root, strict=False)
def _root_of(a: Any) -> Any:
    if a is _lanes:
        return lambda a: _root(a)  # noqa: PLW0108  numba compiles a function's text
    return lambda a: math.sqrt(a)  # noqa: PLW0108


def choose(mask: Mask, yes: Lanes, no: Lanes) -> Lanes:
    """``yes`` where the mask is true, else ``no``; also of plain numbers."""
    return yes if mask else no


@_intrinsic
def _select(_typing: Any, mask: Any, yes: Any, no: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.select(*values)

    return _lanes(_mask, _lanes, _lanes), generate


@_overload(choose, strict=False)
def _choose(mask: Any, yes: Any, no: Any) -> Any:
    if mask is _mask:
        return lambda mask, yes, no: _select(mask, yes, no)  # noqa: PLW0108
    return lambda mask, yes, no: yes if mask else no


def _define(function: Any, instruction: _Function, kind: Any) -> None:
    """Makes an operator of two vectors an instruction; a plain number counts for all lanes."""

    @_overload(function, strict=False)
    def _(a: Any, b: Any) -> Any:
        if a == kind and b == kind:
            return lambda a, b: instruction(a, b)  # noqa: PLW0108  numba compiles a function's text
        if kind == _lanes and a == kind and isinstance(b, types.Number):
            return lambda a, b: instruction(a, every(float(b)))
        if kind == _lanes and b == kind and isinstance(a, types.Number):
            return lambda a, b: instruction(every(float(a)), b)
        return None


for _operator, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define(_operator, _instruction(_lanes, _method(_name), _lanes, _lanes), _lanes)
for _operator, _name in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _compared = _instruction(_mask, _method("fcmp_ordered", _name), _lanes, _lanes)
    _define(_operator, _compared, _lanes)
for _operator, _name in ((operator.and_, "and_"), (operator.or_, "or_")):
    _define(_operator, _instruction(_mask, _method(_name), _mask, _mask), _mask)
