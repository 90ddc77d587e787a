"""Paired evaluation: same episodes for all, independent of cars and of what else is driven."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_benchmarks.evaluate import drive, episode_seed, evaluate, make_cars
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.suites import Suite, SuiteScenario
from lanekeep_benchmarks.web.drives import recorded

SLALOM = SuiteScenario(
    "slalom", "A slalom", {"road": "slalom", "departure": "cost", "preview": 1}, max_episode_steps=60
)
RANDOM = SuiteScenario("random", "Random roads", {"road": {"kind": "random", "count": 4}}, max_episode_steps=60)
SUITE = Suite("test", "two short scenarios", (SLALOM, RANDOM), episodes=5)


class Proportional:
    """Steers against the lateral error; stateful on purpose: it counts its steps a row."""

    def __init__(self, gain):
        self.gain = gain

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        steps = np.zeros(len(observation)) if state is None else state
        steps = np.where(episode_start, 0, steps) + 1
        return (-self.gain * observation[:, :1] / np.sqrt(steps)[:, None]).astype(np.float32), steps


POLICIES = {"calm": 0.05, "brisk": 0.5, "wild": 50.0}


def make_policy(name, definition):
    return Proportional(POLICIES[name])


def run(policies=tuple(POLICIES), suite=SUITE, episodes=5, seed=0, **keywords):
    batches = evaluate(suite, policies, make_policy, episodes=episodes, seed=seed, **keywords)
    return [result for batch in batches for result in batch]


@pytest.fixture(scope="module")
def results():
    return run()


def test_every_episode_of_every_policy_once(results):
    keys = [(result.scenario, result.policy, result.episode) for result in results]
    assert sorted(keys) == sorted((t.name, p, e) for t in SUITE.scenarios for p in POLICIES for e in range(5))


@pytest.mark.parametrize("cars", [1, 2, 3, 256])
def test_the_number_of_cars_changes_nothing(results, cars):
    def place(result):
        return result.scenario, result.policy, result.episode

    assert sorted(run(cars=cars), key=place) == sorted(results, key=place)


def test_other_policies_change_nothing(results):
    alone = run(policies=("wild",))
    assert alone == [result for result in results if result.policy == "wild"]


class Neighbourly:
    """Its rows depend on each other, as those of a matrix product may in the last bit."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return (-0.1 * observation[:, :1] - 0.01 * observation[:, :1].mean()).astype(np.float32), state


@pytest.mark.parametrize("count", [0, 1, 3, 7, 29, 30])
def test_what_is_done_is_left_out_and_the_rest_is_the_same(count):
    """Whichever lines of a run exist, driving the missing ones gives those lines and no other, neighbours or not."""

    def drive_all(**keywords):
        make = {"episodes": 5, "seed": 0, "cars": 3, **keywords}
        batches = list(evaluate(SUITE, ["a", "b", "c"], lambda *_: Neighbourly(), **make))
        assert all(batches)  # nothing is driven for nothing
        return [result for batch in batches for result in batch]

    whole = drive_all()
    kept = [whole[index] for index in np.random.default_rng(count).permutation(len(whole))[:count]]
    driven = drive_all(done={result.place for result in kept})
    assert driven == [result for result in whole if result not in kept]


def test_more_episodes_keep_the_first_ones(results):
    more = [result for result in run(episodes=7) if result.episode < 5]
    assert more == results


def test_policies_meet_the_same_start():
    """What the environment reports before the first action is equal to the last bit, whatever drove before."""
    env = make_cars(RANDOM, 4)
    seeds = [episode_seed("test", "random", number, 0) for number in range(4)]
    starts = []
    for name in POLICIES:
        observation, info = env.reset(seed=seeds)
        starts.append((observation, info["arc_length"], info["lateral_error"]))
        for _ in drive(env, make_policy(name, None), seeds, {}):
            pass
    for start in starts[1:]:
        for first, other in zip(starts[0], start, strict=True):
            np.testing.assert_array_equal(first, other)
    assert len(set(starts[0][2])) == 4


def test_results_equal_a_plain_loop_over_the_single_environment(results):
    """The evaluator against gym.make and the definitions of the metrics, written out once more."""
    for result in results:
        scenario = next(scenario for scenario in SUITE.scenarios if scenario.name == result.scenario)
        env = gym.make(scenario.env_id, **scenario.keywords, max_episode_steps=scenario.max_episode_steps)
        policy, state = make_policy(result.policy, None), None
        observation, _ = env.reset(seed=result.episode_seed)
        infos, rewards, actions, ended = [], [], [], False
        while not ended:
            action, state = policy.predict(observation[None], state, np.array([not infos]))
            observation, reward, terminated, truncated, info = env.step(action[0])
            infos.append(info)
            rewards.append(reward)
            actions.append(min(abs(float(action[0, 0])), 1.0))
            ended = terminated or truncated
        assert result.steps == len(infos)
        assert result.failed is not infos[-1]["is_success"]
        # Capped where it departed: errors go on as large as they were there, everything else ends.
        outside = [place for place, info in enumerate(infos) if info["cost"] > 0.0]
        last = outside[0] + 1 if outside else len(infos)
        rest = 60 - last if outside else 0
        truth = {key: np.array([info[key] for info in infos[:last]]) for key in infos[0]}
        errors, headings = (
            np.r_[truth[key], np.full(rest, truth[key][-1])] for key in ("lateral_error", "heading_error")
        )
        jerk = np.diff(truth["lateral_acceleration"]) / 0.05
        assert result.metrics == pytest.approx(
            {
                "rms_lateral_error": np.sqrt(np.mean(errors**2)),
                "peak_lateral_error": np.abs(errors).max(),
                "rms_heading_error": np.sqrt(np.mean(headings**2)),
                "rms_steering_rate": np.sqrt(np.mean(truth["steering_rate"] ** 2)),
                "rms_lateral_jerk": np.sqrt(np.mean(jerk**2)) if len(jerk) else 0.0,
                "peak_lateral_acceleration": np.abs(truth["lateral_acceleration"]).max(),
                "rms_action": np.sqrt(np.mean(np.square(actions[:last]))),
                "time": 0.05 * last,
                "return": sum(rewards),
            },
            rel=1e-9,
        )


def test_a_departure_counts_the_same_whether_it_ends_the_episode(results):
    """Going on after a departure, or not: the metrics but the return, whose steps are charged otherwise, are equal."""
    going_on, ending = SLALOM, replace(SLALOM, keywords={**SLALOM.keywords, "departure": "terminate"})
    lines = [run(policies=("wild",), suite=replace(SUITE, scenarios=(one,))) for one in (going_on, ending)]
    assert any(line.failed for line in lines[0])
    for first, second in zip(*lines, strict=True):
        assert first.failed == second.failed
        mine, other = dict(first.metrics), dict(second.metrics)
        mine.pop("return"), other.pop("return")
        assert mine == other


METRICS_OF = {
    "lanekeep/Circuit-v0": {"lap_time", "smallest_clearance"},
    "lanekeep/WallFollow-v0": {"smallest_clearance", "rms_lateral_error"},
    "lanekeep/ParallelPark-v0": {"lap_time", "kerb_distance", "space_share", "end_heading_error"},
    "lanekeep/Drive-v0": {"rms_lateral_error", "rms_lateral_jerk", "time"},
}


@pytest.mark.parametrize("env_id", METRICS_OF)
def test_a_task_has_the_metrics_that_fit_it(env_id):
    """Driven ten steps with the wheel straight: every one is a finite number, and says what `info` says."""
    scenario = SuiteScenario("one", "One", env_id=env_id, max_episode_steps=10)
    suite = Suite("tasks", "tasks", (scenario,), episodes=2)

    class Straight:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.zeros((len(observation), actions), dtype=np.float32), state

    env = make_cars(scenario, 1)
    actions = env.unwrapped.single_action_space.shape[0]
    env.close()
    ((first, _),) = evaluate(suite, ["straight"], lambda *_: Straight(), episodes=2, seed=0)
    assert set(first.metrics) >= METRICS_OF[env_id] and "return" in first.metrics
    assert np.isfinite(list(first.metrics.values())).all()
    if "smallest_clearance" in first.metrics:
        steps = list(drive(make_cars(scenario, 1), Straight(), [first.episode_seed], {}))
        clearances = [float(step.info["clearance"][0]) for step in steps if step.alive[0]]
        assert first.metrics["smallest_clearance"] == min(clearances)


def test_a_scenario_names_its_metrics():
    named = replace(SLALOM, metrics=("peak_lateral_error", "return"))
    (line, *_) = run(policies=("calm",), suite=replace(SUITE, scenarios=(named,)), episodes=1)
    assert list(line.metrics) == ["peak_lateral_error", "return"]


def test_a_line_is_read_as_it_was_written(results):
    assert [EpisodeResult.from_json(result.to_json()) for result in results] == results


def test_both_outcomes_occur(results):
    """The scenarios above are worth comparing: some episodes fail, some end early, some do neither."""
    assert {result.failed for result in results} == {True, False}
    assert {result.steps == 60 for result in results} == {True, False}


def test_episode_seeds_are_stable_and_distinct():
    """The numbers are part of published results: they must not change between versions or machines."""
    assert episode_seed("classical", "random-roads", 0, 0) == 3530596072238929
    numbers = {episode_seed(s, t, e, n) for s in ("a", "b") for t in ("a", "b") for e in range(50) for n in range(3)}
    assert len(numbers) == 600
    assert max(numbers) < 2**53


def test_scenario_hash_covers_what_the_scenario_does_not():
    definition = make_cars(SLALOM, 1).unwrapped.scenario
    first = SLALOM.hash(definition.hash)
    changes = [{"max_episode_steps": 61}, {"options": {"arc_length": 0.0}}, {"env_id": "lanekeep/Other-v0"}]
    assert len({first, *(replace(SLALOM, **change).hash(definition.hash) for change in changes)}) == 4
    assert SLALOM.hash("another scenario") != first
    assert replace(SLALOM, title="Another title").hash(definition.hash) == first


def test_options_fix_the_start():
    scenario = replace(SLALOM, options={"arc_length": 0.0, "lateral_error": 0.25})
    env = make_cars(scenario, 2)
    step = next(drive(env, make_policy("calm", None), [1, 2], scenario.options))
    np.testing.assert_allclose(step.info["lateral_error"], 0.25, atol=0.1)
    assert step.info["arc_length"].max() < 3.0


def test_a_recorded_episode_is_the_evaluated_one(results):
    result = next(result for result in results if (result.scenario, result.policy) == ("slalom", "brisk"))
    (trace,) = recorded(SLALOM, make_policy("brisk", None), [result.episode_seed])
    assert len(trace["lateral_error"]) == result.steps
    last = int(np.argmax(trace["cost"] > 0.0)) + 1 if result.failed else result.steps
    assert np.abs(trace["lateral_error"][:last]).max() == result.metrics["peak_lateral_error"]
    assert {"steering_angle", "speed", "curvature_preview_0", "arc_length"} <= set(trace)


def test_the_name_of_a_road_file_does_not_change_what_is_driven():
    assert episode_seed("road-mine", "mine", 3, 0) == episode_seed("road-yours", "yours", 3, 0)
    assert episode_seed("road-mine", "mine", 3, 0) != episode_seed("road-mine", "mine", 4, 0)
