"""Numbers too small to be normal, taken for zero while a kernel runs.

Near straight running float32 states and powers of them fall below 1.2e-38, where an x86 processor takes a hundred times
as long for an operation. Two bits of its control register (MXCSR) make it read and write zeros there; other code of the
same thread must find the register as it was. In float64 nothing is flushed: such numbers hardly occur there, and
results stay those of IEEE 754. Processors of other kinds are left as they are.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import lower_builtin, type_callable

#: Flush to zero (results) and denormals are zero (operands).
_FLUSH = 0x8000 | 0x0040


def flush_subnormals(sample: Any) -> int:
    """Take subnormal numbers for zero where ``sample`` is float32; return the register as it was."""
    return 0


def restore_subnormals(sample: Any, before: int) -> None:
    """Set the register to what it was ``before``."""


@type_callable(flush_subnormals)
def _type_flush(context: Any) -> Any:
    return lambda sample: types.uint32 if isinstance(sample, types.Float) else None


@type_callable(restore_subnormals)
def _type_restore(context: Any) -> Any:
    return lambda sample, before: types.none if isinstance(sample, types.Float) else None


@lower_builtin(flush_subnormals, types.Float)
def _lower_flush(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    if not _applies(builder, signature):
        return ir.Constant(ir.IntType(32), 0)
    place = builder.alloca(ir.IntType(32))
    _call(builder, "stmxcsr", place)
    before = builder.load(place)
    builder.store(builder.or_(before, ir.Constant(ir.IntType(32), _FLUSH)), place)
    _call(builder, "ldmxcsr", place)
    return before


@lower_builtin(restore_subnormals, types.Float, types.Integer)
def _lower_restore(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    if _applies(builder, signature):
        place = builder.alloca(ir.IntType(32))
        builder.store(arguments[1], place)
        _call(builder, "ldmxcsr", place)
    return context.get_dummy_value()


def _applies(builder: Any, signature: Any) -> bool:
    """Whether the processor is an x86, whose float32 this is."""
    x86: bool = builder.module.triple.startswith(("x86_64", "i386", "i686"))
    return x86 and signature.args[0] == types.float32


def _call(builder: Any, name: str, place: Any) -> None:
    pointer = ir.IntType(8).as_pointer()
    function = builder.module.declare_intrinsic(f"llvm.x86.sse.{name}", (), ir.FunctionType(ir.VoidType(), [pointer]))
    builder.call(function, [builder.bitcast(place, pointer)])
