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


NAN, INF = float("nan"), float("inf")
PAIRS = [(1.5, -2.5), (-2.5, 1.5), (0.0, -0.0), (-0.0, 0.0), (NAN, 1.0), (1.0, NAN), (INF, -INF)]


@numba.njit
def ternary(condition, a, b):
    return a if condition else b


@numba.njit
def selected(condition, a, b):
    return numeric.select(condition, a, b)


def bits(value):
    return type(value), np.asarray(value).tobytes()


@pytest.mark.parametrize("kind", [float, np.float32])
@pytest.mark.parametrize("pair", PAIRS)
def test_select_is_the_conditional_expression(pair, kind):
    """To the last bit and the type, whatever the condition is: a comparison, a flag, a number."""
    a, b = map(kind, pair)
    for condition in (True, False, np.bool_(True), 0.0, 2.0, NAN, 0, 3):
        assert bits(selected(condition, a, b)) == bits(ternary(condition, a, b))
        assert bits(numeric.select(condition, a, b)) == bits(a if condition else b)
        assert bits(numeric.select(np.array([condition] * 2, bool), a, b)[1]) == bits(
            np.asarray(a if condition else b)[()]
        )


def test_select_unites_what_it_chooses_from():
    assert selected(True, 1, 2.5) == 1.0 and isinstance(selected(True, 1, 2.5), float)
    assert selected(False, True, False) is False


@pytest.mark.parametrize("x", [*np.linspace(-3.0, 3.0, 13), 0.0, -0.0, INF, -INF])
def test_magnitude_is_abs(x):
    for kind in (float, np.float32):
        assert bits(numba.njit(lambda x: numeric.magnitude(x))(kind(x))) == bits(numba.njit(lambda x: abs(x))(kind(x)))
        assert bits(numeric.magnitude(kind(x))) == bits(abs(kind(x)))
