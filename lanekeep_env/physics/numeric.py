"""Elementary functions that a compiler can vectorise, the same to the last bit in every lane.

Library calls of sin, cos and atan stop SIMD code. The polynomials below are Chebyshev fits with
absolute errors under 1e-12 in float64; in float32 rounding dominates.
"""

from __future__ import annotations

import numpy as np
from numba.core import types
from numba.extending import lower_builtin, type_callable

from lanekeep_env.compile import inline


def like(sample, constant):
    """Return ``constant`` in the precision of ``sample``.

    A bare literal is float64 and would lift float32 lanes to float64, at half the speed.
    """
    return type(sample)(constant) if isinstance(sample, np.floating) else float(constant)


@type_callable(like)
def _type_like(context):
    return lambda sample, constant: sample if isinstance(sample, types.Float) else None


@lower_builtin(like, types.Float, types.Any)
def _lower_like(context, builder, signature, arguments):
    return context.cast(builder, arguments[1], signature.args[1], signature.return_type)


@inline
def sin_cos(x):
    """Return sin(x) and cos(x); |error| < 1e-12 for |x| < 1e4 rad in float64, 2e-7 for |x| < 10 in float32."""
    # Reduced by the nearest multiple of pi, in two parts so that the product is exact in float32 as well.
    turns = np.floor(x * like(x, 0.3183098861837907) + like(x, 0.5))
    y = x - turns * like(x, 3.140625) - turns * like(x, 9.67653589793e-4)
    odd = turns - like(x, 2.0) * np.floor(turns * like(x, 0.5))
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
    size = abs(x)
    # |x| > 1: atan(x) = pi/2 - atan(1/x); then one step of pi/8 keeps the argument below tan(pi/8).
    large = size > one
    folded = one / size if large else size
    shifted = folded > like(x, 0.4142135623730950)
    y = (folded - one) / (folded + one) if shifted else folded
    z = y * y
    p = like(x, -0.03768135457114816)
    p = p * z + like(x, 0.06975867972742517)
    p = p * z + like(x, -0.08992969475219077)
    p = p * z + like(x, 0.11103508326630032)
    p = p * z + like(x, -0.14285389806870463)
    p = p * z + like(x, 0.19999993151473214)
    p = p * z + like(x, -0.3333333327802739)
    p = p * z + like(x, 0.9999999999992657)
    angle = y * p + (like(x, 0.7853981633974483) if shifted else like(x, 0.0))
    angle = like(x, 1.5707963267948966) - angle if large else angle
    return angle if x >= like(x, 0.0) else -angle


@inline
def wrapped(x):
    """Return the angle x (rad) in [-pi, pi)."""
    turns = np.floor(x * like(x, 0.15915494309189535) + like(x, 0.5))
    return x - turns * like(x, 6.283185307179586)


@inline
def clip(x, low, high):
    """Return x limited to [low, high]."""
    x = low if x < low else x
    return high if x > high else x


@inline
def smaller(x, y):
    """Return the smaller of two numbers."""
    return x if x < y else y


@inline
def larger(x, y):
    """Return the larger of two numbers (the built-in ``max`` costs extra for NaN)."""
    return x if x > y else y
