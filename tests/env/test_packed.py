"""What is packed reaches a kernel as arguments of its own would."""

import subprocess
import sys

import gymnasium as gym
import numba
import numpy as np
import pytest

import lanekeep_env  # noqa: F401
from lanekeep_env.compile import kernel
from lanekeep_env.engine.packed import Packed, unpack


@kernel()
def _sums(packed, told):
    (matrix, (cube, nothing)), number, whole = unpack(packed)
    told[0] = matrix[1, 2] + cube[1, 0, 3] + number + whole[-1]
    told[1] = matrix.sum() + cube.sum()
    told[2] = 1.0 if nothing is None else 0.0
    told[3] = matrix.shape[0] * 100 + cube.shape[1] * 10 + cube.shape[2]
    matrix[0, 0] = -1.0


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_kernel_reads_and_writes_what_is_packed(dtype):
    rng = np.random.default_rng(0)
    matrix, cube = rng.random((4, 3)).astype(dtype), rng.random((2, 5, 6))
    cube.flags.writeable = False
    whole = np.arange(7)
    packed, told = Packed((matrix, (cube, None)), 0.25, whole), np.zeros(4)
    expected = [matrix[1, 2] + cube[1, 0, 3] + 0.25 + 6, matrix.sum(dtype=float) + cube.sum(), 1.0, 456.0]
    packed.entry(_sums, told)(packed.handle, told)
    np.testing.assert_allclose(told, expected, rtol=1e-6)
    assert matrix[0, 0] == -1.0


def test_arrays_with_gaps_are_refused():
    with pytest.raises(ValueError, match="gaps"):
        Packed(np.zeros((4, 4))[:, ::2])


def test_what_is_packed_is_kept_alive():
    packed, told = Packed((np.full((4, 3), 2.0), (np.ones((2, 5, 6)), None)), 0.0, np.zeros(7, np.int64)), np.zeros(4)
    rubbish = [np.full((4, 3), np.nan) for _ in range(1000)]  # takes what is free
    packed.entry(_sums, told)(packed.handle, told)
    assert told[1] == 4 * 3 * 2.0 + 2 * 5 * 6
    assert len(rubbish) == 1000


def test_a_process_with_kept_kernels_reads_no_more_of_numba_than_they_need():
    """SciPy's linear algebra above all, which numba looks for before it compiles."""
    if numba.config.DISABLE_JIT:
        pytest.skip("nothing is kept")
    code = (
        "import sys, gymnasium as gym, numpy as np, lanekeep_env\n"
        "env = gym.make('lanekeep/LaneKeep-v0')\n"
        "env.reset(seed=0)\n"
        "print(env.step(np.zeros(1, np.float32))[0].tolist())\n"
        "unread = 'scipy.linalg', 'numba.np.arraymath', 'numba.typed.typeddict'\n"
        "print([name for name in unread if name in sys.modules])\n"
    )
    env = gym.make("lanekeep/LaneKeep-v0")
    env.reset(seed=0)
    seen = env.step(np.zeros(1, np.float32))[0].tolist()  # keeps the kernels, where none were
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert out.stdout.splitlines() == [str(seen), "[]"]


def test_what_a_kernel_is_called_by_is_counted_by_the_kernel():
    """Where code came from, kept or compiled, is asked of numba's dispatcher."""
    if numba.config.DISABLE_JIT:
        pytest.skip("nothing is compiled")
    env = gym.make("lanekeep/LaneKeep-v0")
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    stats = env.unwrapped._core.step.stats
    assert sum(stats.cache_hits.values()) + sum(stats.cache_misses.values()) >= 1
