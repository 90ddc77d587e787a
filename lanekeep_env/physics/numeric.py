"""Elementary functions that a compiler can vectorise, the same to the last bit in every column.

Library calls of sin, cos and atan stop SIMD code. The polynomials below are Chebyshev fits with
absolute errors under 1e-12 in float64; in float32 rounding dominates.

The scalar functions of physics and tasks are written with these names and arithmetic alone, and branch on no data. So
one source serves numba, Python's own numbers, and engines that trace (JAX) or work on whole arrays: `select` and
`library` ask these for their functions, by the array API standard.
"""

from __future__ import annotations

import numpy as np
from numba.core import types
from numba.extending import lower_builtin, type_callable

from lanekeep_env.compile import inline


def _is_number(x):
    return isinstance(x, int | float | np.generic)


def like(sample, constant):
    """Return ``constant`` in the precision of ``sample``.

    A bare literal is float64 and would lift a float32 loop to float64, at half the speed. Arrays lift no literal:
    theirs stays a Python number.
    """
    if not _is_number(constant):
        return constant
    return type(sample)(constant) if isinstance(sample, np.floating) else float(constant)


@type_callable(like)
def _type_like(context):
    return lambda sample, constant: sample if isinstance(sample, types.Float) else None


@lower_builtin(like, types.Float, types.Any)
def _lower_like(context, builder, signature, arguments):
    return context.cast(builder, arguments[1], signature.args[1], signature.return_type)


def library(x):
    """Return the module whose functions take ``x``: NumPy, or what an array names as its own."""
    return np if _is_number(x) else x.__array_namespace__()


@type_callable(library)
def _type_library(context):
    return lambda x: types.Module(np)


@lower_builtin(library, types.Any)
def _lower_library(context, builder, signature, arguments):
    return context.get_dummy_value()


def select(condition, a, b):
    """Return ``a if condition else b``, of numbers that are both there: the only branch on data."""
    if _is_number(condition):
        return a if condition else b
    return library(condition).where(condition, a, b)


@type_callable(select)
def _type_select(context):
    return lambda condition, a, b: context.unify_types(a, b)


@lower_builtin(select, types.Any, types.Any, types.Any)
def _lower_select(context, builder, signature, arguments):
    condition, *values = (
        context.cast(builder, value, given, wanted)
        for value, given, wanted in zip(
            arguments, signature.args, (types.boolean, signature.return_type, signature.return_type), strict=True
        )
    )
    return builder.select(condition, *values)


def magnitude(x):
    """Return |x|; engines that differentiate see the slope 1 at 0, where that of their ``abs`` is 0."""
    return abs(x) if _is_number(x) else select(x < 0.0, -x, x)


@type_callable(magnitude)
def _type_magnitude(context):
    return lambda x: x if isinstance(x, types.Float) else None


@lower_builtin(magnitude, types.Float)
def _lower_magnitude(context, builder, signature, arguments):
    return builder.call(builder.module.declare_intrinsic("llvm.fabs", [arguments[0].type]), arguments)


@inline
def floor(x):
    """Return the largest whole number that is not above x."""
    return library(x).floor(x)


@inline
def sqrt(x):
    """Return the square root of x."""
    return library(x).sqrt(x)


@inline
def sin_cos(x):
    """Return sin(x) and cos(x); |error| < 1e-12 for |x| < 1e4 rad in float64, 2e-7 for |x| < 10 in float32."""
    # Reduced by the nearest multiple of pi, in two parts so that the product is exact in float32 as well.
    turns = floor(x * like(x, 0.3183098861837907) + like(x, 0.5))
    y = x - turns * like(x, 3.140625) - turns * like(x, 9.67653589793e-4)
    odd = turns - like(x, 2.0) * floor(turns * like(x, 0.5))
    sign = like(x, 1.0) - like(x, 2.0) * odd
    # Pairs of terms first (Estrin): half the waiting of Horner's rule, which counts with a single car.
    z = y * y
    z2 = z * z
    z4 = z2 * z2
    s01 = like(x, 0.9999999999999497) + z * like(x, -0.16666666666465735)
    s23 = like(x, 0.008333333320306441) + z * like(x, -0.0001984126667292234)
    s45 = like(x, 2.755695201864869e-06) + z * like(x, -2.503023247596401e-08)
    sine = (s01 + z2 * s23) + z4 * (s45 + z2 * like(x, 1.5410689605068871e-10))
    c01 = like(x, 0.9999999999999977) + z * like(x, -0.49999999999988576)
    c23 = like(x, 0.04166666666574571) + z * like(x, -0.0013888888859824458)
    c45 = like(x, 2.4801582743059704e-05) + z * like(x, -2.755692852013183e-07)
    c67 = like(x, 2.0858125609342497e-09) + z * like(x, -1.1005800269238226e-11)
    cosine = (c01 + z2 * c23) + z4 * (c45 + z2 * c67)
    return sign * y * sine, sign * cosine


@inline
def arctan(x):
    """Return atan(x); |error| < 1e-12 in float64."""
    one = like(x, 1.0)
    size = magnitude(x)
    # |x| > 1: atan(x) = pi/2 - atan(1/x); then one step of pi/8 keeps the argument below tan(pi/8).
    large = size > one
    # The inner select keeps engines that differentiate from 1/0; the compiler drops it.
    folded = select(large, one / select(large, size, one), size)
    shifted = folded > like(x, 0.4142135623730950)
    y = select(shifted, (folded - one) / (folded + one), folded)
    z = y * y
    p = like(x, -0.03768135457114816)
    p = p * z + like(x, 0.06975867972742517)
    p = p * z + like(x, -0.08992969475219077)
    p = p * z + like(x, 0.11103508326630032)
    p = p * z + like(x, -0.14285389806870463)
    p = p * z + like(x, 0.19999993151473214)
    p = p * z + like(x, -0.3333333327802739)
    p = p * z + like(x, 0.9999999999992657)
    angle = y * p + select(shifted, like(x, 0.7853981633974483), like(x, 0.0))
    angle = select(large, like(x, 1.5707963267948966) - angle, angle)
    return select(x >= like(x, 0.0), angle, -angle)


@inline
def wrapped(x):
    """Return the angle x (rad) in [-pi, pi)."""
    turns = floor(x * like(x, 0.15915494309189535) + like(x, 0.5))
    return x - turns * like(x, 6.283185307179586)


@inline
def clip(x, low, high):
    """Return x limited to [low, high]."""
    x = select(x < low, low, x)
    return select(x > high, high, x)


@inline
def smaller(x, y):
    """Return the smaller of two numbers."""
    return select(x < y, x, y)


@inline
def larger(x, y):
    """Return the larger of two numbers (the built-in ``max`` costs extra for NaN)."""
    return select(x > y, x, y)
