"""Suites: every scenario can be built, and policies are told of the nominal car, whatever they drive."""

import re
from dataclasses import replace

import pytest

import lanekeep_agents
import lanekeep_baselines
from lanekeep_benchmarks.evaluate import make_cars
from lanekeep_benchmarks.plan import make_plan
from lanekeep_benchmarks.suites import SUITES, check_frozen
from lanekeep_benchmarks.suites.frozen import LOCKED
from lanekeep_env import ENVIRONMENTS, RANDOMISATIONS, SENSOR_SETS
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario.applying import DRAWN_BY_SETS, applying

SCENARIOS = [(suite.name, scenario) for suite in SUITES.values() for scenario in suite.scenarios]
LEARNED = {scenario.name: scenario for scenario in SUITES["learned"].scenarios}


MADE = {}


def definition_of(scenario):
    if repr(scenario) not in MADE:
        env = make_cars(scenario, 1)
        env.close()
        MADE[repr(scenario)] = env.unwrapped.scenario
    return MADE[repr(scenario)]


@pytest.mark.parametrize(("suite", "scenario"), SCENARIOS, ids=[f"{suite}-{s.name}" for suite, s in SCENARIOS])
def test_some_controller_can_drive_every_scenario_and_sees_what_there_is(suite, scenario):
    definition = definition_of(scenario)
    told = scenario.policies_scenario(definition)
    assert [channel.name for channel in told.channels] == [channel.name for channel in definition.channels]
    assert lanekeep_baselines.names(told)


@pytest.mark.parametrize(("suite", "scenario"), SCENARIOS, ids=[f"{suite}-{s.name}" for suite, s in SCENARIOS])
def test_titles_say_what_applies_of_a_set_of_cars(suite, scenario):
    """Where not all of a named set has an effect, its title names what has, or what has not."""
    definition = definition_of(scenario)
    if not hasattr(definition, "randomisation"):  # a task of another package's
        return
    without = [name for name in DRAWN_BY_SETS if name not in applying(definition)]
    if definition.randomisation in (RANDOMISATIONS["mismatch"], RANDOMISATIONS["stress"]) and without:
        told = [name for name in DRAWN_BY_SETS if name in scenario.title]
        assert told in (without, list(applying(definition)))


@pytest.mark.parametrize("name", LEARNED)
def test_policies_know_the_nominal_car_and_see_two_seconds_ahead(name):
    definition = definition_of(LEARNED[name])
    told = LEARNED[name].policies_scenario(definition)
    assert told.vehicle == VEHICLES["yin"]
    assert told.friction == 1.0
    assert dict(told.sensors) in ({}, SENSOR_SETS["production"])
    assert told.preview * told.preview_interval == pytest.approx(2.0)
    assert told.departure == "cost"


def test_the_cars_differ_as_the_names_say():
    drawn = {name: definition_of(scenario).randomisation for name, scenario in LEARNED.items()}
    assert drawn["mass"].mass == (1.2, 1.2)
    assert drawn["stiffness"].front_cornering_stiffness == drawn["stiffness"].rear_cornering_stiffness == (0.8, 0.8)
    assert drawn["lag"].steering_lag == (2.0, 2.0)
    assert drawn["delay"].steering_delay == (0.05, 0.05)
    assert len({*drawn.values()}) == 8  # nominal, noise and road works have the nominal one


@pytest.mark.parametrize("friction", [0.7, 0.45])
def test_slippery_roads_ask_for_the_same_share_of_the_friction(friction):
    definition = definition_of(LEARNED[f"friction-{friction}"])
    assert definition.tyre == "magic_formula"
    assert definition.randomisation.friction == (friction, friction)
    assert definition.speed.lateral_acceleration / (friction * 9.81) == pytest.approx(0.4)


def test_the_noise_is_twice_what_is_told():
    definition = definition_of(LEARNED["noise"])
    told = dict(LEARNED["noise"].policies_scenario(definition).sensors)
    for channel, sensor in definition.sensors:
        assert sensor == replace(told[channel], noise=2 * told[channel].noise)
        assert sensor.noise > 0.0


def test_what_policies_are_told_is_part_of_the_scenario():
    scenario = LEARNED["noise"]
    assert scenario.hash("0") != replace(scenario, told={}).hash("0")


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["two", "every"])
@pytest.mark.parametrize("suite", [name for name, suite in SUITES.items() if not suite.per_environment])
def test_the_policies_of_every_suite_can_drive_it_and_its_reference_is_first(suite, every):
    """`make_plan` refuses policies that cannot; classical ones are in the registry's order. All are designed."""
    scenarios = SUITES[suite].scenarios
    scenarios = scenarios if every else scenarios[:1] + scenarios[1:][-1:]
    plan = make_plan(replace(SUITES[suite], scenarios=scenarios), None, None, 1, 0)
    reference = SUITES[suite].reference
    assert plan.policies[0] == reference or not reference
    assert len(set(plan.policies)) == len(plan.policies)
    rest = plan.policies[1:] if reference else plan.policies
    classical = [name for name in rest if name in lanekeep_baselines.names()]
    assert classical == [name for name in lanekeep_baselines.names() if name in classical]
    assert rest[: len(classical)] == classical


@pytest.mark.parametrize("suite", LOCKED)
def test_frozen_scenarios_are_those_that_were_frozen(suite):
    hashes = {one.name: one.hash(definition_of(one).hash) for one in SUITES[suite].scenarios}
    assert hashes == LOCKED[suite]


def test_a_frozen_suite_that_was_changed_is_not_driven():
    frozen = SUITES["lanekeep-2026.1"]
    (*rest, last) = frozen.scenarios
    for scenarios, words in (
        ([*rest, replace(last, max_episode_steps=9)], f"scenario {last.name} has the hash '"),
        (rest, f"scenario {last.name} has the hash None"),
        ([*rest, last, replace(last, name="another")], "scenario another has the hash '"),
    ):
        hashes = {each.name: each.hash(definition_of(each).hash) for each in scenarios}
        with pytest.raises(ValueError, match=words):
            check_frozen(frozen, hashes)
    with pytest.raises(ValueError, match="is frozen: scenario lane-keep has the hash None"):
        make_plan(replace(frozen, scenarios=(last,)), ["knightriders-circuit"], None, 1, 0)


def test_the_frozen_suite_has_every_environment_and_every_policy():
    frozen = SUITES["lanekeep-2026.1"]
    kinds = {}
    for one in frozen.scenarios:
        kinds.setdefault(one.env_id, []).append(one)
    assert list(kinds) == list(ENVIRONMENTS)
    reached = set()
    for those in kinds.values():
        drawn = [definition_of(one).randomisation for one in those]
        named = [next((name for name, of in RANDOMISATIONS.items() if of == one), "") for one in drawn]
        assert named[:3] == ["nominal", "mismatch", "stress"] and named[3:] in ([], ["nominal"])
        assert [one.name.endswith("-low-speed") for one in those[3:]] in ([], [True])
        able = [
            {*lanekeep_baselines.names(told), *lanekeep_agents.names(told)}
            for told in (one.policies_scenario(definition_of(one)) for one in those)
        ]
        drivers = [name for name in frozen.policies if all(name in names for names in able)]
        assert drivers
        reached.update(drivers)
    one_seed = [name for name in lanekeep_agents.names() if not re.search("-seed[1-9]", name)]
    shipped = {name for name in (*lanekeep_baselines.names(), *one_seed) if "highway" not in name}  # another's worlds
    assert reached == shipped == set(frozen.policies)


@pytest.mark.slow
def test_the_frozen_suite_is_driven_by_whom_it_names():
    plan = make_plan("lanekeep-2026.1", None, None, 1, 0)
    assert {name for names in plan.drivers.values() for name in names} == set(plan.policies)
    assert plan.scenario_hash == LOCKED["lanekeep-2026.1"]
