"""Cars and controllers from identifications, and the targets: within 5 %, 95 % intervals that are, under 5 % lost."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.identification import (
    PARAMETERS,
    Identification,
    excited_drive,
    identify,
    redesign,
    vehicle_from_identification,
)
from lanekeep_baselines.identification.study import Study, coverage, design_loss
from lanekeep_baselines.yin_design import STEERING_RATIO, YinModel, control_gains
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import LaneKeepScenario

MEASURED = (
    "cg_to_front_axle",
    "cg_to_rear_axle",
    "yaw_inertia",
    "front_cornering_stiffness",
    "rear_cornering_stiffness",
)


def exact(car: VehicleParameters, error: float = 1e-3) -> Identification:
    """An identification that found the car's own coefficients."""
    model = YinModel.of(car)
    values = [model.a11, model.a12, model.a21, model.a22, model.b1, model.b2, car.steering.lag]
    errors = [error * max(abs(value), 1.0) for value in values]
    return Identification(
        values=dict(zip(PARAMETERS, values, strict=True)),
        standard_errors=dict(zip(PARAMETERS, errors, strict=True)),
        covariance=tuple(map(tuple, np.diag(np.square(errors)).tolist())),
        degrees_of_freedom=1000,
        residual_rms={},
        residual_correlation={},
        evaluations=1,
        steering_ratio=car.steering_ratio,
    )


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("scale", ["mass", "yaw_inertia"])
@pytest.mark.parametrize("wheelbase", [False, True])
def test_a_car_comes_back_from_its_coefficients(vehicle: str, scale: str, wheelbase: bool) -> None:
    car = VEHICLES[vehicle]
    known = {"wheelbase": car.wheelbase} if wheelbase else {}
    again = vehicle_from_identification(exact(car), **{scale: getattr(car, scale)}, **known)
    for name in ("mass", *MEASURED):
        assert getattr(again, name) == pytest.approx(getattr(car, name), rel=1e-4), name
    assert again.steering.lag == pytest.approx(car.steering.lag) and again.steering_ratio == car.steering_ratio


def test_only_ratios_are_identified() -> None:
    """Twice the mass and inertia on twice as stiff tyres: the same coefficients, the same controllers."""
    found = exact(VEHICLES["yin"])
    light, heavy = (vehicle_from_identification(found, mass=mass) for mass in (1000.0, 2000.0))
    assert heavy.yaw_inertia == pytest.approx(2.0 * light.yaw_inertia)
    assert YinModel.of(heavy).a12 == pytest.approx(YinModel.of(light).a12)
    assert heavy.cg_to_front_axle == light.cg_to_front_axle
    for mistake in ({}, {"mass": 1000.0, "yaw_inertia": 1500.0}):
        with pytest.raises(ValueError, match="one of them: the coefficients fix only their ratio"):
            vehicle_from_identification(found, **mistake)
    with pytest.raises(ValueError, match=r"mass=-1.0 is not allowed"):
        vehicle_from_identification(found, mass=-1.0)


def test_a_wrong_ratio_or_wheelbase_is_noticed() -> None:
    found = exact(VEHICLES["yin"])
    with pytest.raises(
        ValueError, match=r"no car with a steering ratio of 14 has coefficients near.*standard errors off"
    ):
        vehicle_from_identification(replace(found, steering_ratio=14.0), mass=1700.0)
    with pytest.raises(ValueError, match=r"and a wheelbase of 2.5 m has"):
        vehicle_from_identification(found, mass=1700.0, wheelbase=2.5)


def test_the_rest_of_the_car_is_kept() -> None:
    base = replace(VEHICLES["commonroad-1"], steering=replace(VEHICLES["commonroad-1"].steering, delay=0.05))
    car = vehicle_from_identification(exact(VEHICLES["yin"]), mass=1700.0, base=replace(base, steering_ratio=16.0))
    assert (car.length, car.steering.delay, car.steering.rate_limit) == (base.length, 0.05, 0.4)
    assert car.steering.lag == pytest.approx(1.0 / 11.16) and car.name == "commonroad-1 (identified)"


def test_the_design_accepts_the_model() -> None:
    found = exact(VEHICLES["yin"])
    np.testing.assert_allclose(control_gains(found.model(), 25.0), [0.2994, 2.0638, -13.5262, -0.5271], rtol=3e-4)
    truth = YinModel.of(VEHICLES["yin"], STEERING_RATIO)
    for field in fields(YinModel):
        assert getattr(found.model(), field.name) == pytest.approx(getattr(truth, field.name))
    quick = replace(found, values={**found.values, "lag": 0.0})
    assert quick.model().actuator_rate == 50.0


def test_a_redesign_on_the_truth_is_the_design() -> None:
    scenario = LaneKeepScenario(preview=12)
    observation = np.random.default_rng(0).normal(size=(5, 18)).astype(np.float32) * 0.05
    observation[:, 3] = [5.0, 15.0, 25.0, 35.0, 45.0]
    for name in lanekeep_baselines.names(scenario):
        policy = redesign(name, scenario, exact(VEHICLES["yin"]))
        expected, _ = lanekeep_baselines.make(name, scenario).predict(observation)
        np.testing.assert_allclose(policy.predict(observation)[0], expected, atol=1e-4)


@pytest.fixture(scope="module")
def study() -> Study:
    return coverage(24)


def test_every_parameter_within_five_percent(study: Study) -> None:
    assert np.abs(study.errors).max() < 0.05


def test_intervals_cover_the_truth(study: Study) -> None:
    """95 % of the runs for each parameter; of 24 runs at least 20 (two in a thousand studies would miss that)."""
    assert (study.covered.sum(axis=0) >= 20).all(), str(study)
    assert 0.9 <= study.covered.mean() <= 0.99
    # As large as they say: errors over standard errors have a mean square of 1.
    scores = [
        [
            (one.values[name] - value) / one.standard_errors[name]
            for name, value in zip(PARAMETERS, study.truth, strict=True)
        ]
        for one in study.found
    ]
    assert 0.75 < np.mean(np.square(scores)) < 1.3


@pytest.mark.parametrize("name", ["yin-lqr-observer", "yin-lqr-feedforward", "stanley"])
@pytest.mark.parametrize("road", ["yin", "random"])
def test_redesign_on_identified_parameters_loses_little(study: Study, name: str, road: str) -> None:
    assert design_loss(study.found[:4], name, road=road).max() < 0.05


def test_identified_car_is_near_the_true_one(study: Study) -> None:
    for found in study.found[:6]:
        car = vehicle_from_identification(found, mass=1700.0)
        for name in MEASURED:
            assert getattr(car, name) == pytest.approx(getattr(VEHICLES["yin"], name), rel=0.05), name


def test_a_car_that_is_not_the_nominal_one_is_worth_identifying() -> None:
    """Tyres half as stiff again: the nominal design runs wide, the one on the identification does not."""
    car = replace(VEHICLES["yin"], front_cornering_stiffness=90000.0, rear_cornering_stiffness=150000.0)
    found = identify(excited_drive(0, vehicle=car))
    loss = design_loss([found, exact(VEHICLES["yin"])], "yin-lqr-feedforward", vehicle=car, road="yin")
    assert abs(loss[0]) < 0.05 and loss[1] > 2.0


def test_study_prints_a_table(study: Study) -> None:
    assert str(study).splitlines()[0].startswith("24 runs")
    assert [line.split()[0] for line in str(study).splitlines()[1:]] == list(PARAMETERS)
