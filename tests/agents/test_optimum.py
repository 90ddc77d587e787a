"""The optimum with full knowledge against linear-quadratic theory, and against everything that drives."""

import gymnasium as gym
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import lanekeep_baselines
from lanekeep_agents.optimum import Optimiser, best
from lanekeep_baselines.lq_model import StepModel

LANE = "lanekeep/LaneKeep-v0"
STRAIGHT = {"road": {"kind": "sine", "length": 3000.0, "peak_curvature": 1e-9, "wavelength": 400.0}, "speed": 20.0}
#: Of `StepModel` in the order of the teacher's states behind arc length.
ORDER = ["lateral", "heading", "sideslip", "yaw_rate", "steer"]
OURS = [4, 3, 1, 2, 0]


def _straight(seeds=(0,), steps=200):
    start = {"lateral_error": 0.02, "heading_error": 0.0}
    return Optimiser(LANE, STRAIGHT, list(seeds), start, steps)


def _model(scenario):
    model = StepModel.of(scenario.vehicle, 20.0, scenario.control_step)
    a, b = model.a[np.ix_(OURS, OURS)], model.b[OURS]
    return a, b


class Still:
    """Asks for nothing."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros((len(observation), 1), dtype=np.float32), None


def test_gains_on_a_straight_road_are_those_of_scipys_riccati_equation():
    optimiser = _straight()
    teacher = optimiser.teacher
    drives, _ = optimiser.improve(optimiser.drive(Still()))
    law = optimiser.law(drives)
    a, b = _model(teacher.scenario)
    of_error, of_steering = teacher.cost
    y = np.zeros((2, 6))
    y[0] = of_error * np.hstack([a, b])[0]
    y[1] = of_steering * np.hstack([a, b])[4]
    y[1, 4] -= of_steering
    # Actions are shares of the largest angle.
    y[:, 5] *= teacher.scenario.max_steering_angle
    b = b * teacher.scenario.max_steering_angle
    weights = y.T @ y
    q, r, s = weights[:5, :5], weights[5:, 5:], weights[:5, 5:]
    p = solve_discrete_are(a, b, q, r, s=s)
    gain = -np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a + s.T)[0]
    assert [teacher.names[i] for i in range(1, 6)] == ORDER
    assert law.gains[5, 0, 1:] == pytest.approx(gain, rel=2e-3, abs=1e-3 * abs(gain).max())
    assert law.curvature[5, 0] == pytest.approx((r + b.T @ p @ b).item(), rel=2e-3)


def test_actions_on_a_straight_road_are_those_of_least_squares():
    """All steps at once: the cost is a sum of squares that are linear in the actions."""
    steps = 80
    optimiser = _straight(steps=steps)
    teacher = optimiser.teacher
    drives, _ = optimiser.improve(optimiser.drive(Still()))
    a, b = _model(teacher.scenario)
    b = b[:, 0] * teacher.scenario.max_steering_angle
    x = np.zeros((5, steps + 1))  # columns: by the actions, and at the end what there is without any
    x[:, steps] = drives.states[0, 0, 1:6]
    of_error, of_steering = teacher.cost
    rows = []
    for k in range(steps):
        after = a @ x
        after[:, k] += b
        rows += [of_error * after[0], of_steering * (after[4] - x[4])]
        x = after
    rows = np.array(rows)
    wanted, cost, *_ = np.linalg.lstsq(rows[:, :steps], -rows[:, steps], rcond=None)
    assert drives.actions[:, 0] == pytest.approx(wanted, abs=2e-3 * abs(wanted).max())
    assert -drives.returns[0] == pytest.approx(cost[0], rel=1e-3)


SCENARIOS = {
    "nominal": {"preview": 20, "departure": "cost"},
    "noise": {"preview": 20, "departure": "cost", "sensors": "production"},
    "slippery": {"preview": 20, "departure": "cost", "tyre": "magic_formula", "randomisation": {"friction": 0.45}},
    "mismatch": {"preview": 20, "tyre": "magic_formula", "randomisation": "mismatch"},
}


def _check_against(name, others):
    """From two starts: the others are no starts, so that being better is no matter of course."""
    keywords = {"road": {"kind": "random", "seed": 5}, **SCENARIOS[name]}
    optimiser = Optimiser(LANE, keywords, range(40, 46))
    scenario = optimiser.teacher.scenario
    starts = [lanekeep_baselines.make(one, scenario) for one in ("lq-preview-offset-free", "stanley")]
    found = best(optimiser, starts, starts=2)
    assert found.kept.all()
    for other in others or lanekeep_baselines.names(scenario):
        driven = optimiser.drive(lanekeep_baselines.make(other, scenario))
        assert (found.returns >= driven.returns).all(), other


@pytest.mark.parametrize("name", ["noise", "slippery"])
def test_the_best_classical_policies_are_better_on_no_episode(name):
    _check_against(name, ("lq-preview", "lq-preview-offset-free", "lqg", "yin-lqr-feedforward", "pure-pursuit"))


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_no_classical_policy_is_better_on_any_episode(name):
    _check_against(name, ())


@pytest.fixture(scope="module")
def optimal():
    optimiser = Optimiser(LANE, {"road": {"kind": "random", "seed": 5}, **SCENARIOS["mismatch"]}, range(4))
    return optimiser, best(optimiser, [Still(), lanekeep_baselines.make("stanley", optimiser.teacher.scenario)])


def test_single_environment_gives_the_same_returns_for_its_actions(optimal):
    optimiser, drives = optimal
    env = gym.make(LANE, road={"kind": "random", "seed": 5}, **SCENARIOS["mismatch"])
    for episode in (0, 3):
        env.reset(seed=episode)
        total = sum(env.step(np.float32([action]))[1] for action in drives.actions[:, episode])
        assert total == pytest.approx(drives.returns[episode], rel=1e-12)
    assert optimiser.seeds == [0, 1, 2, 3]


@pytest.mark.parametrize("scale", [1e-3, 1e-2])
def test_chance_finds_nothing_better_nearby(optimal, scale):
    optimiser, drives = optimal
    rng = np.random.default_rng(7)

    class Moved:
        def __init__(self):
            self.change = scale * rng.standard_normal(drives.actions.shape)

        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            k = state or 0
            return (drives.actions[k] + self.change[k])[:, None], k + 1

    for _ in range(5):
        assert (optimiser.drive(Moved()).returns < drives.returns).all()
