"""The vectorisable elementary functions against the library's."""

import math

import numba
import numpy as np
import pytest

from lanekeep_env.physics import numeric


@numba.njit
def functions(x):
    sine, cosine = numeric.sin_cos(x)
    return sine, cosine, numeric.arctan(x), numeric.wrapped(x)


@pytest.mark.parametrize("span", [0.1, 4.0, 1e4])
def test_accuracy_in_float64(span):
    for x in np.linspace(-span, span, 4001):
        sine, cosine, arc, wrapped = functions(x)
        assert abs(sine - math.sin(x)) < 2e-12 and abs(cosine - math.cos(x)) < 2e-12
        assert abs(arc - math.atan(x)) < 1e-12
        assert abs(math.remainder(wrapped - x, 2 * math.pi)) < 1e-11 and -math.pi - 1e-9 <= wrapped <= math.pi


def test_accuracy_in_float32():
    for x in np.linspace(-10, 10, 2001, dtype=np.float32):
        sine, cosine, arc, _ = functions(x)
        assert abs(sine - math.sin(x)) < 5e-7 and abs(cosine - math.cos(x)) < 5e-7 and abs(arc - math.atan(x)) < 3e-7
        assert isinstance(sine, float) or sine.dtype == np.float32
