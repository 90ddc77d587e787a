"""All that a kernel is given, as one number: where a table lies that says where everything else lies.

numba takes longer to look at eleven arguments of a call than a single car's step takes; a number costs next to nothing.
What is packed keeps its types: kernels are compiled for them, as for arguments of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import NativeValue, lower_builtin, models, register_model, type_callable, unbox


class PackedType(types.Type):
    """Type of what is packed: a tuple's."""

    def __init__(self, parts: Any) -> None:
        self.parts = parts
        super().__init__(name=f"packed{parts}")


class Packed:
    """Arrays without gaps, floats and None, in tuples within tuples; kept, since only their places are in the table."""

    def __init__(self, *parts: Any) -> None:
        self.parts = parts
        self._table = np.array(list(_words(parts)), dtype=np.int64)
        #: What kernels are given for it: the address of the table; without the compiler it itself.
        self.handle: Any = self if numba.config.DISABLE_JIT else int(self._table.ctypes.data)

    def entry(self, kernel: Any, *others: Any) -> Callable[..., None]:
        """Return what runs a kernel, compiled for what is packed and for arguments like ``others``.

        It is called with the handle and the others, and looks at no types: arrays have to be without gaps.
        """
        if numba.config.DISABLE_JIT:
            return kernel
        kinds = (PackedType(numba.typeof(self.parts)), *map(numba.typeof, others))
        return kernel.compile(kinds)


def _words(part: Any) -> Iterator[int]:
    """Yield what the table holds of a part, in the order in which `unpack` reads it."""
    if isinstance(part, tuple):
        for one in part:
            yield from _words(one)
    elif isinstance(part, np.ndarray):
        if not part.flags.c_contiguous:
            raise ValueError(f"an array of shape {part.shape} has gaps")
        yield from (part.ctypes.data, *part.shape)
    elif part is not None:
        yield int(np.float64(part).view(np.int64))


def unpack(packed: Packed) -> tuple[Any, ...]:
    """Return what is packed."""
    return packed.parts


register_model(PackedType)(models.OpaqueModel)


@unbox(PackedType)
def _from_address(kind, number, context):
    address = context.pyapi.long_as_longlong(number)
    return NativeValue(context.builder.inttoptr(address, cgutils.voidptr_t))


@type_callable(unpack)
def _type_unpack(context):
    return lambda packed: packed.parts if isinstance(packed, PackedType) else None


@lower_builtin(unpack, PackedType)
def _lower_unpack(context, builder, signature, arguments):
    places = builder.bitcast(arguments[0], ir.IntType(64).as_pointer())
    words = (builder.load(builder.gep(places, [ir.Constant(ir.IntType(32), place)])) for place in count())
    return _read(context, builder, signature.return_type, words)


def _read(context, builder, kind, words):
    """Emit the code that puts a part together from the next ``words`` of the table."""
    if isinstance(kind, types.BaseTuple):
        return context.make_tuple(builder, kind, [_read(context, builder, one, words) for one in kind])
    if isinstance(kind, types.NoneType):
        return context.get_dummy_value()
    if isinstance(kind, types.Float):
        return context.cast(builder, builder.bitcast(next(words), ir.DoubleType()), types.float64, kind)
    # Where nothing is compiled this import of a tenth of a second is not needed.
    from numba.np.arrayobj import make_array, populate_array

    element = context.get_data_type(kind.dtype)
    start, shape = builder.inttoptr(next(words), element.as_pointer()), [next(words) for _ in range(kind.ndim)]
    size = context.get_constant(types.intp, context.get_abi_sizeof(element))
    strides = [size]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    array = make_array(kind)(context, builder)
    populate_array(array, data=start, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return array._getvalue()
