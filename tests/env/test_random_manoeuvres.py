"""Two thousand episodes over the whole range of parameters: numbers stay numbers and inside their spaces."""

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at

EVASIVE, REVERSE, DRIVE = "lanekeep/Evasive-v0", "lanekeep/ReversePath-v0", "lanekeep/Drive-v0"
CARS = {"mass": (0.7, 1.6), "friction": (0.2, 1.0), "cg_shift": (-0.3, 0.3), "steering_lag": (0.5, 3.0)}
SLOW = {"minimum": 0.1, "maximum": 3.0, "hold": 1.0, "standstill": 0.3}
BUSY = [(0, "speed", 0), (1, "speed", 30), (2, "lead", 30, 8), (8, "lead_gone"), (9, "stop", 60), (20, "stop_gone")]
CASES = [
    (EVASIVE, {}),
    (EVASIVE, {"speed": 2.0, "road": {"kind": "evasive", "shift": 5.0, "shift_length": 12.0}}),
    (EVASIVE, {"speed": 40.0, "action": "steering_rate", "departure": "off"}),
    (REVERSE, {}),
    (REVERSE, {"speed": SLOW, "road": {"kind": "parking", "smallest_radius": 3.0, "largest_radius": 40.0}}),
    (REVERSE, {"departure": "off", "road": {"kind": "parking", "smallest_radius": 4.0}}),
    (DRIVE, {"slope": (-0.2, 0.2), "wind": (-20.0, 20.0)}),
    (DRIVE, {"traffic": {"largest_speed": 30.0}, "road": {"kind": "circle", "radius": 40.0}, "departure": "off"}),
    (DRIVE, {"traffic": BUSY, "sensors": "poor", "slope": (0.0, 0.3)}),
    (DRIVE, {"traffic": BUSY, "departure": "cost", "action": "steering_rate"}),
]


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize(("name", "keywords"), CASES)
def test_no_episode_gives_anything_but_numbers_inside_the_space(name, keywords, dtype):
    """Per case and precision 100 lanes that hold random actions, some gentle, some at the limits."""
    lanes, steps = 100, 1600
    cars = CARS if name != REVERSE else {key: CARS[key] for key in ("mass", "friction", "steering_lag")}
    env = gym.make_vec(
        name,
        lanes,
        "vector_entry_point",
        observation="full",
        randomisation=cars,
        dtype=dtype,
        episode_steps=steps // 2,
        **keywords,
    )
    space, rng = env.single_observation_space, np.random.default_rng(1)
    observation, _ = env.reset(seed=1)
    shape = env.action_space.shape
    size = rng.uniform(0.0, 1.0, lanes)[:, None] ** 3
    ended = 0
    for k in range(steps):
        if k % 25 == 0:
            action = np.clip(rng.normal(0.0, 1.0, shape) * size, -1.0, 1.0).astype(np.float32)
            action[:, 1:] = np.clip(rng.normal(0.2, 0.6, (lanes, shape[1] - 1)), -1.0, 1.0)
        observation, reward, terminated, truncated, info = env.step(action)
        assert (observation >= space.low).all() and (observation <= space.high).all(), k
        assert np.isfinite(reward).all() and (reward <= 0.0).all()
        ended += np.count_nonzero(terminated | truncated)
        if k % 100 == 0:
            assert all(np.isfinite(values).all() for values in info.values() if values.dtype.kind == "f")
            state = env.unwrapped._core.lanes[:, at.ALONG : at.COMMAND + 1]
            assert np.isfinite(state).all()
            if name == DRIVE:
                assert (env.unwrapped._core.lanes[:, at.SPEED] >= 0.0).all()
    assert ended >= lanes
