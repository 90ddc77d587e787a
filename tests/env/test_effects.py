"""Keywords without effect: what is refused changes nothing when it is driven, and what is taken changes something."""

import json
from dataclasses import fields, is_dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from registry_options import COMPILED_OR_NOT, OPTIONS, options_of
from registry_options import alone as each_alone
from with_effect import scenario_class

import lanekeep_env
from lanekeep_env.roads import LimitedSpeed
from lanekeep_env.scenario.applying import sets_table
from lanekeep_env.scenario.base import ScenarioRecord
from lanekeep_env.scenario.guidance import PlanErrors

IDS = sorted(lanekeep_env.ENVIRONMENTS)
CONSTANT = {"minimum": 2.0, "maximum": 2.0, "standstill": 0.0, "lateral_acceleration": None}
#: Scenarios in which something has no effect that has one elsewhere; the defaults are always tried.
ROAD = [{"dynamics": "kinematic"}, {"preview": 1}, {"action": "steering_rate"}, {"cost_weight": 0.0}]
CAMERA = [
    {"plan": 1},
    {"plan": 0},
    {"speed": CONSTANT},
    {"cost_weight": 0.0},
    {"vehicle": {"base": "van", "steering": {"lag": 0.0, "rate_limit": None, "angle_limit": None, "backlash": 0.0}}},
]
WALLS = [{"dynamics": "dynamic"}, {"scan": "perfect"}, {"action": "steering_rate"}]
SCENARIOS = {
    "LaneKeep": [*ROAD, {"tyre": "magic_formula"}],
    "RoadWorks": [ROAD[0], {"speed": {"lateral_acceleration": 0.5}}],
    "LaneSupport": [ROAD[0], {"driver": "attentive"}, {"driver": {"wander": 0.0}}],
    "Evasive": [ROAD[0], {"tyre": "linear"}],
    "CameraLane": CAMERA,
    "TurnOff": [{"speed": {**CONSTANT, "hold": None}}],
    "ReversePath": [*ROAD[1:], {"speed": {**CONSTANT, "hold": None}}, {"road": "random"}],
    "Drive": [ROAD[1], {"traffic": [(0.0, "speed", 8.0)]}, {"powertrain": {"creep": 0.0}}],
    "Traffic": [ROAD[1], {"powertrain": {"creep": 0.0}}],
    "WallFollow": [*WALLS, {"contact": "cost"}, {"speed": {**CONSTANT, "hold": None}}],
    "Circuit": [*WALLS, {"vehicle": {"base": "pses", "steering": {"lag": 0.05}}}],
    "ObstacleCircuit": [WALLS[0]],
    "ParallelPark": [{"modes": [(0.0, "park"), (0.9, "roundtrip")]}],
}
#: Values of fields within records, where a third more of the default would not do.
INNER = {
    "plan_errors": lambda scenario: PlanErrors(offset=1.0),
    "side_sensor": lambda scenario: 0.14,
    "speed.hold": lambda scenario: 10 * scenario.control_step,
    "speed.lateral_acceleration": lambda scenario: 0.2,
    "speed.standstill": lambda scenario: 0.4,
    "speed.minimum": lambda scenario: (
        (0.9 if isinstance(scenario.speed, LimitedSpeed) else 0.35) * scenario.speed.maximum
    ),
    "speed.maximum": lambda scenario: (
        (0.7 if isinstance(scenario.speed, LimitedSpeed) else 1.3) * scenario.speed.maximum
    ),
    "camera.edge": lambda scenario: "left",
    "traffic.hazards": lambda scenario: 0.5,
    "scan.period": lambda scenario: 2 * scenario.control_step,
    "scan.noise": lambda scenario: 0.1,
    "scan.missing_every": lambda scenario: 3,
    "scan.missing_rim": lambda scenario: 3,
    "scan.jump_errors": lambda scenario: 0.9,
    "scan.nearest": lambda scenario: 0.9,
    "randomisation.cg_shift": lambda scenario: 0.05,
    "randomisation.steering_delay": lambda scenario: 0.06,
    "randomisation.steering_offset": lambda scenario: 0.02,
    "bank": lambda scenario: 0.03,
    "crosswind": lambda scenario: 5.0,
    "gusts": lambda scenario: 2.0,
    "gust_time": lambda scenario: 0.5,
    "patches": lambda scenario: {"friction": 0.5},
}


def short(env_id):
    return env_id.removeprefix("lanekeep/").removesuffix("-v0")


def value_of(scenario, path):
    for name in path.split("."):
        scenario = getattr(scenario, name)
    return scenario


def another(scenario, path):
    """A legal value of a field beside its own."""
    if path in INNER:
        return INNER[path](scenario)
    value = value_of(scenario, path)
    if isinstance(value, bool):
        return not value
    if path.startswith("randomisation."):
        return 0.8 * value[0]
    options = OPTIONS[next(env_id for env_id in IDS if scenario_class(env_id) is type(scenario))]
    choices = {
        "tyre": ["linear", "magic_formula"],
        "speed": [0.5],
        "effort": ["motor"],
        **{name: v for name, v in options.items() if v},
    }
    for choice in choices.get(path, ()):
        if choice != value:
            return choice
    return value + 3 if isinstance(value, int) else 0.7 * value


def given(scenario, keywords, changes):
    """Keywords with other values at some paths."""
    record, tops = json.loads(json.dumps(scenario.to_dict())), []
    for path, value in changes.items():
        top, _, inner = path.partition(".")
        record[top] = {**record[top], inner: value} if inner else value
        tops.append(top)
    return {**keywords, **{top: record[top] for top in tops}}


def made(env_id, keywords, around=False):
    """The environment; ``around`` the refusal of what has no effect."""
    with pytest.MonkeyPatch.context() as patch:
        if around:
            patch.setattr(ScenarioRecord, "_refused", lambda scenario: {})
        return gym.make_vec(env_id, 12, "vector_entry_point", autoreset_mode="same_step", **keywords)


def driven(env):
    """Yield all that an environment shows of three short drives: gentle, at random, and longer with held actions."""
    yield np.array([f"{channel}" for channel in env.unwrapped.channels])
    yield np.concatenate([env.observation_space.low, env.observation_space.high], dtype=np.float64)
    rng = np.random.default_rng(5)
    for seed, (scale, steps) in enumerate(((0.1, 30), (1.0, 30), (1.0, 400))):
        yield env.reset(seed=seed)[0].astype(np.float64)
        held = rng.uniform(-1.0, 1.0, env.action_space.shape)
        for _ in range(steps):
            action = held if seed == 2 else scale * rng.uniform(-1.0, 1.0, env.action_space.shape)
            observation, *outcome, info = env.step(action.astype(np.float32))
            truth = (info[name] for name in env.unwrapped.truth)
            yield np.concatenate([observation.ravel(), *outcome, *truth], dtype=np.float64)


def same(plain, drive):
    """Whether a drive shows what was kept of another; it ends where they part."""
    return all(
        np.array_equal(a, b, equal_nan=a.dtype.kind == b.dtype.kind == "f") for a, b in zip(plain, drive, strict=True)
    )


@pytest.mark.parametrize("alone", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("env_id", IDS)
def test_what_is_refused_changes_nothing(env_id, alone):
    """Each is refused; all at once change nothing, nor does one ``alone``."""
    tried = set()
    for keywords in ({}, *SCENARIOS[short(env_id)]):
        scenario = made(env_id, keywords).unwrapped.scenario
        plain, changes = list(driven(made(env_id, keywords))), {}
        for path, need in scenario.without_effect.items():
            if not hasattr(
                value_of(scenario, path.rpartition(".")[0]) if "." in path else scenario, path.split(".")[-1]
            ):
                continue
            changes[path] = another(scenario, path)
            changed = given(scenario, keywords, {path: changes[path]})
            with pytest.raises(ValueError, match="has no effect in this scenario") as error:
                made(env_id, changed)
            text = str(error.value)
            assert text.startswith(f"{path}=") and need.why in text and "; allowed: " in text and "\n" not in text
            assert not alone or same(plain, driven(made(env_id, changed, around=True))), (keywords, path)
        together = given(scenario, keywords, changes)
        with pytest.raises(ValueError, match="has no effect in this scenario") as error:
            made(env_id, together)
        text = str(error.value)
        assert all(f"{path}=" in text for path in changes) and "\n" not in text and len(text) < 1500
        assert same(plain, driven(made(env_id, together, around=True))), (keywords, changes)
        tried |= changes.keys()
    assert tried


@COMPILED_OR_NOT
@pytest.mark.parametrize("env_id", IDS)
def test_what_is_taken_changes_something(env_id, compiled):
    """Some value of each option does; only who is done sees how many laps are asked for, and what it takes to park."""
    plain, changes = {}, {}
    options = {name: values for name, values in options_of(env_id, compiled).items() if name != "dtype"}
    for chosen in each_alone(options, OPTIONS[env_id]):
        *beside, name = chosen
        keywords = {other: chosen[other] for other in beside}
        key = json.dumps(keywords)
        plain[key] = plain.get(key) or list(driven(made(env_id, keywords)))
        changes[name] = changes.get(name, False) or not same(plain[key], driven(made(env_id, chosen)))
    unseen = [name for name in changes if name in ("laps", "parking_angle", "parking_time")]
    assert [name for name, change in changes.items() if not change] == unseen


@pytest.mark.parametrize("env_id", IDS)
def test_entries_of_records_that_are_taken_change_something(env_id):
    """Those of a randomisation in every scenario that takes them, others in some: no bend may be sharp enough."""
    changes = {}
    for keywords in ({}, *SCENARIOS[short(env_id)]):
        scenario = made(env_id, keywords).unwrapped.scenario
        plain = list(driven(made(env_id, keywords)))
        for top in ("randomisation", "speed", "scan", "camera"):
            record = getattr(scenario, top, None)
            for field in fields(record) if is_dataclass(record) and top not in scenario.without_effect else ():
                path = f"{top}.{field.name}"
                if path not in scenario.without_effect:
                    changed = given(scenario, keywords, {path: another(scenario, path)})
                    change = not same(plain, driven(made(env_id, changed)))
                    assert change or top != "randomisation", (keywords, path)
                    changes[path] = changes.get(path, False) or change
    assert [path for path, change in changes.items() if not change] == []


def test_the_table_of_the_named_sets_is_the_generated_one():
    text = (Path(__file__).parents[2] / "benchmarks" / "README.md").read_text()
    assert sets_table() in text


@pytest.mark.parametrize("env_id", IDS)
def test_records_are_read_back_and_named_sets_are_taken(env_id):
    """Whatever has no effect: a record says all its fields, and a set is made for many scenarios."""
    record = scenario_class(env_id)
    for keywords in ({}, *SCENARIOS[short(env_id)]):
        for drawn in lanekeep_env.RANDOMISATIONS:
            scenario = record.from_keywords(**keywords, randomisation=drawn, sensors="poor")
            assert scenario.randomisation == lanekeep_env.RANDOMISATIONS[drawn]
            back = record.from_keywords(**json.loads(json.dumps(scenario.to_dict())))
            assert back == scenario and back.hash == scenario.hash


@pytest.mark.parametrize(("entry", "other"), [("jump", "jump_rate"), ("jump_rate", "jump")])
def test_half_of_a_sensor_s_jumps_is_refused(entry, other):
    with pytest.raises(ValueError, match=rf"sensors\.yaw_rate\.{entry}=0\.1 has no effect: it takes a {other} > 0"):
        gym.make("lanekeep/LaneKeep-v0", sensors={"yaw_rate": {entry: 0.1}})
