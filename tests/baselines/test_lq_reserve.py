"""The LQ designs' reserve: taken where margins ask for it and nowhere else, and never from weights that are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lanekeep_baselines import lq_schedule
from lanekeep_baselines.lq import LinearQuadraticGaussian, LqPreview, LqPreviewOffsetFree
from lanekeep_baselines.lq_design import Measuring
from lanekeep_baselines.lq_model import StepModel
from lanekeep_baselines.lq_reserve import BOUND, SHARES, Loop, least_share, moved
from lanekeep_baselines.lq_schedule import LEAST_NOISE
from lanekeep_baselines.margins import margins
from lanekeep_env.scenario import LaneKeepScenario


def commands(policy, scenario: LaneKeepScenario, speed: float) -> np.ndarray:
    """What a policy does with twenty observations of one car at random."""
    random, state, told = np.random.default_rng(0), None, []
    for _ in range(20):
        seen = 0.01 * random.normal(size=(1, len(scenario.channels)))
        seen[0, [channel.name for channel in scenario.channels].index("speed")] = speed
        action, state = policy.predict(seen, state)
        told.append(action[0, 0])
    return np.array(told)


@pytest.mark.parametrize("design", [LqPreview, LqPreviewOffsetFree, LinearQuadraticGaussian])
def test_a_car_on_which_the_tuned_weights_keep_the_bound_is_left_alone(design: type[LqPreview]) -> None:
    scenario = LaneKeepScenario(preview=20)
    for speed in (3.0, 17.3, 25.0, 58.0):
        kept, tuned = design(scenario), design(scenario, design.weights)
        np.testing.assert_array_equal(commands(kept, scenario, speed), commands(tuned, scenario, speed))


@pytest.mark.parametrize(
    ("design", "vehicle", "delay", "speed"),
    [
        (LqPreview, "van", 0.05, 60.0),
        (LqPreviewOffsetFree, "commonroad-1", 0.05, 50.0),
        (LinearQuadraticGaussian, "commonroad-2", 0.0, 15.0),
    ],
)
def test_a_car_on_which_they_do_not_gets_a_reserve(
    design: type[LqPreview], vehicle: str, delay: float, speed: float
) -> None:
    scenario = LaneKeepScenario(preview=20, vehicle={"base": vehicle, "steering": {"delay": delay}})
    found = [margins(policy, scenario, speed) for policy in (design(scenario, design.weights), design(scenario))]
    assert found[0].sensitivity > 1.1 * BOUND
    assert found[1].stable and found[1].sensitivity <= 1.002 * BOUND


def test_no_more_is_taken_than_it_takes() -> None:
    assert least_share(lambda share: 2.5 - share) == 0.5
    assert least_share(lambda share: 1.5 + share) == 0.0
    assert least_share(lambda share: 3.0 + (share - 0.75) ** 2) == 0.75
    tuned = replace(LqPreview.weights, lag=0.0845)
    assert moved(tuned, 0.0) == tuned
    way = [moved(tuned, share) for share in SHARES]
    assert all(np.diff([one.lag for one in way]) < 0.0)


@pytest.mark.parametrize(("vehicle", "speeds"), [("yin", (5.0, 30.0)), ("pses", (10.0, 30.0, 50.0, 60.0))])
@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_a_loop_that_is_not_stable_has_no_margin(vehicle: str, speeds: tuple[float, ...], turned: float) -> None:
    """A sensitivity alone says nothing of it; `margins` tells stability from the policy that drives."""
    car = {"base": vehicle, "steering": {"delay": 0.05}}
    scenario = LaneKeepScenario(preview=20, vehicle=car)
    policy = LqPreviewOffsetFree(scenario, LqPreviewOffsetFree.weights)
    for speed in speeds:
        point = policy._design.at(speed, policy.weights, Measuring(LEAST_NOISE, (0, 0, 0, 0)))
        model = StepModel.of(scenario.vehicle, speed, scenario.control_step, slip=True)
        loop = Loop(model, turned * point.states, point.filtering, known=not policy.estimated.curvature)
        assert loop.is_stable() == np.isfinite(loop.sensitivity())
        assert loop.is_stable() == (turned > 0.0 and margins(policy, scenario, speed).stable)


def test_a_design_is_made_once_for_all_roads_and_anew_for_another_car(monkeypatch: pytest.MonkeyPatch) -> None:
    """A suite's scenarios differ in what no design knows of."""
    scenario = LaneKeepScenario(preview=20, reference_lateral_error=0.31)
    first = LqPreviewOffsetFree(scenario)

    def refused(*_: object) -> None:
        raise AssertionError("designed anew")

    monkeypatch.setattr(lq_schedule, "gains", refused)
    again = LqPreviewOffsetFree(replace(scenario, road="yin", tyre="magic_formula", friction=0.5))
    np.testing.assert_array_equal(commands(again, scenario, 20.0), commands(first, scenario, 20.0))
    for change in ({"reference_lateral_error": 0.32}, {"control_step": 0.04}, {"vehicle": "passat"}):
        with pytest.raises(AssertionError, match="designed anew"):
            LqPreviewOffsetFree(replace(scenario, **change))
