"""What functions of kernels become: compiled once for their types, the same arithmetic wherever they are inlined."""

from collections import Counter

import numba
import numpy as np
import pytest
from numba.core import event

from lanekeep_env.compile import helper, inline, kernel


@pytest.fixture
def both(tmp_path, monkeypatch):
    """Two kernels of the same functions, of one place and of a loop's; no code is kept of them."""
    monkeypatch.setenv("LANEKEEP_CACHE_DIR", str(tmp_path))

    @inline
    def cross(a, b, c, d):
        return a * b - c * d

    @inline
    def doubled(a, b, c, d):
        return cross(a, b, c, d) + cross(b, a, c, d)

    @helper
    def filled(rows, out):
        for i in range(out.shape[0]):
            out[i] = doubled(rows[0, i], rows[1, i], rows[2, i], rows[3, i])

    @kernel()
    def lone(a, b, c, d):
        return doubled(a, b, c, d), cross(a, b, c, d)

    @kernel()
    def looped(rows, out):
        filled(rows, out)

    assert doubled(2.0, 3.0, 1.0, 4.0) == 4.0  # Python calls it as well
    return lone, looped


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_function_is_compiled_once_whoever_calls_it(both):
    lone, looped = both
    with event.install_recorder("numba:compile") as recorded:
        lone(1.0, 2.0, 3.0, 4.0)
        looped(np.ones((4, 8)), np.empty(8))
    counted = Counter(one.data["dispatcher"].__name__ for _, one in recorded.buffer if one.is_start)
    assert counted == {"lone": 1, "looped": 1, "filled": 1, "doubled": 1, "cross": 1}


def test_what_is_fused_does_not_depend_on_where(both):
    lone, looped = both
    rows = np.random.default_rng(5).normal(size=(4, 1001))
    rows[2], rows[3, ::2] = rows[0], rows[1, ::2]  # differences of equal products show each rounding
    out = np.empty(1001)
    looped(rows, out)
    assert out.tolist() == [lone(*map(float, column))[0] for column in rows.T]
    a, b, c, d = rows
    assert np.abs(out - 2.0 * (a * b - c * d)).max() < 1e-13
