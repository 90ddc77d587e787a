"""Without the compiler: Python runs every environment (NUMBA_DISABLE_JIT=1), and calls every scalar function itself."""

import inspect
import os
import subprocess
import sys

import gymnasium as gym
import numba
import numpy as np
import pytest

import lanekeep_env
from lanekeep_env import layout as at
from lanekeep_env.physics import integrate, numeric, powertrain, single_track, steering, tyres
from lanekeep_env.physics.numeric import like
from lanekeep_env.sensing import camera, measure
from lanekeep_env.tasks import driving, lane_keeping, wall_driving

IDS = list(lanekeep_env.ENVIRONMENTS)


def drive(name):
    """All numbers of a reset and two control steps, of one car and of a vector environment."""
    env, many = gym.make(name), gym.make_vec(name, num_envs=3, vectorization_mode="vector_entry_point")
    seen = [env.reset(seed=1)[0], many.reset(seed=1)[0]]
    for _ in range(2):
        for one in (env, many):
            observation, reward, *_ = one.step(np.full(one.action_space.shape, 0.1, np.float32))
            seen += [observation, reward]
    return np.concatenate([np.ravel(part) for part in seen]).astype(float).tolist()


@pytest.fixture(scope="module")
def interpreted():
    code = f"""
import warnings
import gymnasium as gym, numpy as np, lanekeep_env
warnings.simplefilter("error")
{inspect.getsource(drive)}
for name in {IDS}:
    print(name, *map(float.hex, drive(name)))
"""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300)
    assert out.returncode == 0, out.stderr[-2000:]
    return {words[0]: [float.fromhex(word) for word in words[1:]] for words in map(str.split, out.stdout.splitlines())}


@pytest.mark.parametrize("name", IDS)
def test_every_environment_runs_without_the_compiler(name, interpreted):
    """No warning, and the numbers of the compiled kernels."""
    compiled = drive(name)
    assert len(compiled) > 50
    np.testing.assert_allclose(interpreted[name], compiled, rtol=1e-9, atol=1e-9)


CAR = (1.2, 1.4, 1 / 1500.0, 1 / 2500.0, 8e4, 9e4, 6e3, 5e3, None)
STATE = (0.3, -0.05, 0.02, 0.1, 0.04, 23.0, 0.002, CAR)
#: Slower than its own slip-speed floor.
SLOW = (0.3, -0.05, 0.02, 0.1, 0.04, 0.1, 0.002, (*CAR[:-1], 0.3))
DRIVE = np.linspace(0.5, 3.0, 40)
#: Four gears.
GEARS = DRIVE.copy()
GEARS[at.D_GEARS], GEARS[at.D_UP] = 4, 300.0
GEARS[at.D_RATIOS : at.D_RATIOS + 4] = 50.0, 35.0, 25.0, 20.0
#: Calls of scalar functions with floats alone.
CALLS = [
    (numeric.sin_cos, (0.7,)),
    (numeric.arctan, (-1.3,)),
    (numeric.wrapped, (7.0,)),
    (numeric.clip, (3.0, -1.0, 2.0)),
    (numeric.floor, (-0.5,)),
    (numeric.sqrt, (2.0,)),
    (numeric.magnitude, (-0.5,)),
    (tyres.linear, (0.05, 8e4)),
    (tyres.magic_formula, (0.05, 8e4, 6e3)),
    (single_track.kinematic, STATE),
    (single_track.front_driven, STATE),
    (single_track.dynamic_linear, STATE),
    (single_track.dynamic_magic_formula, STATE),
    (single_track.dynamic_linear, SLOW),
    (single_track.dynamic_magic_formula, SLOW),
    (single_track.magic_formula_outputs, (0.02, 0.1, 0.04, 23.0, CAR)),
    (steering.advance_steering, (0.1, 0.2, 0.3, 0.05)),
    (steering.advance_gear, (0.1, 0.08, 0.2, 0.3, 0.4, 0.05, 0.01, False)),
    (steering.advance_gear, (0.1, 0.08, 0.2, 0.3, 0.4, 0.05, 0.01, True)),
    (integrate._profile_speed, (12.0, 400.0, -2.0)),
    (powertrain.engine_torque, (200.0, 0.4, DRIVE)),
    (powertrain.resistance, (20.0, 3.0, DRIVE, 1500.0)),
    (powertrain.creep, (0.5, DRIVE)),
    (powertrain.choose_gear, (5.0, GEARS)),
    (powertrain.choose_gear, (9.0, GEARS)),
    (powertrain.choose_gear, (90.0, GEARS)),
    (camera._chord, (0.1, 0.01, 1e-4, 20.0)),
    (measure.normal, (np.uint64(5), np.int64(3))),
    (driving.wanted_speed, (20.0, 30.0, 15.0)),
    (lane_keeping.running_cost, (0.3, 0.2, 0.5, 0.1, 0.4, 10.0)),
    (lane_keeping.judge, (0.3, 0.2, 100.0, 0.05, 1.7, 0.5, 0.1, 0.4, 10.0, True, False)),
    (lane_keeping.steady_turning, (20.0, 0.01, 1.2, 1.4, 1500.0, 8e4, 9e4, False)),
    (wall_driving.judge_following, (0.3, 0.2, 100.0, 0.05, True, 0.5, 0.1, 0.4, 10.0, True)),
    (wall_driving.judge_circuit, (0.04, 100.0, 0.05, False, False, 2.0, True)),
]


@pytest.mark.parametrize("function, arguments", CALLS, ids=lambda value: getattr(value, "__name__", ""))
def test_python_calls_scalar_functions_as_compiled_code_does(function, arguments):
    compiled = numba.njit(lambda *arguments: function(*arguments))(*arguments)
    with np.errstate(over="ignore"):  # a hash of 64 bits
        called = function(*arguments)
    # Compiled code fuses multiplications with additions: a rounding less.
    np.testing.assert_allclose(called, compiled, rtol=1e-14, atol=1e-15)
    assert not isinstance(called, np.ndarray)


def spread(value):
    """Two of each number and flag."""
    if isinstance(value, tuple):
        return tuple(map(spread, value))
    return np.array([value, value]) if isinstance(value, float | bool) else value


#: The camera looks along the road piece by piece, and the start asks which model it starts.
BRANCHING = (camera._chord, lane_keeping.steady_turning)


@pytest.mark.parametrize(
    "function, arguments",
    [call for call in CALLS if call[0] not in BRANCHING],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_scalar_functions_do_not_branch_on_data(function, arguments):
    """An array of several has no truth of its own: a branch would raise, as it does for an engine that traces."""
    with np.errstate(over="ignore"):
        one, two = function(*arguments), function(*spread(arguments))
    for single, double in zip(np.atleast_1d(one), two if isinstance(one, tuple) else [two], strict=True):
        np.testing.assert_allclose(np.broadcast_to(double, 2), [single, single], rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize(
    "sample, expected",
    [(2.0, float), (np.float64(2.0), np.float64), (np.float32(2.0), np.float32), (2, float)],
)
def test_a_constant_takes_the_precision_of_its_sample(sample, expected):
    called = like(sample, 0.1)
    assert type(called) is expected
    assert called == (np.float32(0.1) if expected is np.float32 else 0.1)
    if not isinstance(sample, int):
        kind = numba.typeof(sample)
        compiled = numba.njit(lambda x: like(x, 0.1))
        assert compiled(sample) == called
        assert compiled.nopython_signatures[0].return_type == kind


def test_the_lowest_gear_below_the_upshift_speed_is_chosen():
    """0.9 x 300 rad/s is 5.4 m/s in the first of these gears, 7.7 m/s in the second and 10.8 m/s in the third."""
    assert [powertrain.choose_gear(v, GEARS) for v in (5.3, 5.5, 7.8, 10.9, 90.0)] == [0, 1, 2, 3, 3]


def test_compiled_constants_need_a_floating_sample():
    with pytest.raises(numba.TypingError):
        numba.njit(lambda x: like(x, 0.1))(2)
