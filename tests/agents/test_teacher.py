"""The teacher's truth and derivatives against the public face of the environment."""

import copy
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_agents.teacher import Teacher
from lanekeep_env import layout as at

LANE = "lanekeep/LaneKeep-v0"
#: Derivatives of the single environment: central differences with steps a hundred times the teacher's.
STEP = 1e-4
HARD = {
    "tyre": "magic_formula",
    "preview": 4,
    "departure": "cost",
    "randomisation": {"mass": 1.2, "steering_lag": 2.0, "steering_delay": 0.06, "friction": 0.7},
}


@pytest.mark.parametrize("keywords", [{}, HARD, {"action": "steering_rate"}, {"vehicle": {"steering": {"lag": 0.0}}}])
def test_derivatives_are_those_of_the_single_environment(keywords):
    teacher, env = Teacher(LANE, 3, **keywords), gym.make(LANE, **keywords).unwrapped
    teacher.reset([4, 5, 6])
    env.reset(seed=5)
    rng = np.random.default_rng(0)
    for actions in rng.uniform(-0.2, 0.2, (25, 3)):
        teacher.step(actions)
        env.step(np.float32([actions[1]]))
    action = 0.05
    found = teacher.linearise(np.full(3, action))

    def after(row, change):
        moved = copy.deepcopy(env)
        if row is not None:
            moved._core.cars[0, row, 0] += change
        asked = np.float32(action + (0.0 if row is not None else change))
        info = moved.step(asked.reshape(1))[4]
        return np.array([info["arc_length"], info["lateral_error"], info["heading_error"]]), float(asked)

    rows = dict(zip(teacher.names, teacher._rows, strict=True))
    for i, row in enumerate(rows.values()):
        slope = (after(row, STEP)[0] - after(row, -STEP)[0]) / (2 * STEP)
        assert found.a[1, :3, i] == pytest.approx(slope, rel=2e-3, abs=2e-5), teacher.names[i]
    (above, high), (below, low) = after(None, 0.02), after(None, -0.02)
    assert found.b[1, :3] == pytest.approx((above - below) / (high - low), rel=2e-3, abs=2e-5)


def test_linearising_moves_nothing_and_tells_the_next_states():
    """With more cars than a block holds, the last block not full."""
    teacher = Teacher(LANE, 301, sensors="production")
    teacher.reset(range(301))
    actions = np.linspace(-1.0, 1.0, 301)
    before = teacher.states
    found = teacher.linearise(actions)
    assert np.array_equal(teacher.states, before)
    teacher.step(actions)
    assert np.array_equal(teacher.states, found.states)
    # Where the action is at its limit, too, it moves the road wheel.
    assert (found.b[:, teacher.names.index("steer")] > 0.0).all()


def test_hidden_car_is_told_by_name():
    teacher = Teacher(LANE, 2, **HARD)
    car = teacher.scenario.vehicle
    teacher.reset([1, 2])
    hidden = teacher.hidden
    assert hidden["mass"] == pytest.approx([1.2 * car.mass] * 2)
    assert hidden["yaw_inertia"] == pytest.approx([1.2 * car.yaw_inertia] * 2)
    assert hidden["steering_lag"] == pytest.approx([2.0 * car.steering.lag] * 2)
    assert hidden["steering_delay"] == pytest.approx([0.06] * 2)
    weight = 1.2 * car.mass * 9.81
    assert hidden["front_peak"] + hidden["rear_peak"] == pytest.approx([0.7 * weight] * 2)


def test_rewards_are_the_squares_that_the_cost_says():
    teacher = Teacher(LANE, 4)
    teacher.reset(range(4))
    before = teacher.states
    _, reward, kept = teacher.step([0.01, 0.0, -0.01, 0.02])
    error, steering = teacher.cost
    turned = teacher.states[:, 5] - before[:, 5]
    assert kept.all()
    assert -reward == pytest.approx((error * teacher.states[:, 1]) ** 2 + (steering * turned) ** 2)


def test_ways_between_states_know_no_turns():
    teacher = Teacher(LANE, 2)
    teacher.reset([0, 1])
    states = teacher.states
    turned = states.copy()
    turned[:, 2] += 2.0 * np.pi
    assert teacher.from_states(turned, states) == pytest.approx(np.zeros_like(states), abs=1e-9)


@pytest.mark.parametrize("env_id", ["Circuit", "CameraLane", "Drive", "LaneSupport", "Traffic"])
def test_other_worlds_are_refused_in_a_line(env_id):
    with pytest.raises(ValueError, match=r"^env_id='lanekeep/.*' has no teacher: ") as refused:
        Teacher(f"lanekeep/{env_id}-v0", 1)
    assert "\n" not in str(refused.value)


def test_out_of_reach_of_what_drives():
    """Policies are made and drive without the teacher's code; what they are handed names no environment."""
    code = (
        "import sys, numpy, lanekeep_agents, lanekeep_baselines as b; from lanekeep_env import LaneKeepScenario as S\n"
        "s = S(preview=20); ps = [b.make('lq-preview', s), lanekeep_agents.load('ppo-lane-keep-seed0', s)]\n"
        "[p.predict(numpy.zeros((2, len(s.channels)), 'f4')) for p in ps]\n"
        "print(any('teacher' in m or 'optimum' in m for m in sys.modules))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "False"


def test_rows_are_those_of_the_layout():
    teacher = Teacher(LANE, 1)
    assert list(teacher._rows) == [at.ALONG, at.LATERAL, at.HEADING, at.SIDESLIP, at.YAW_RATE, at.STEER]
