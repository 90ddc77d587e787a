"""The output-error fit: truth without noise, errors as large as it says with noise, clear words where it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lanekeep_baselines.identification import (
    PARAMETERS,
    DrivenRun,
    Identification,
    SensorNoise,
    UnusableRun,
    excited_drive,
    identify,
)
from lanekeep_baselines.yin_design import YinModel
from lanekeep_env.physics.parameters import SteeringActuator, VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES

SILENT = SensorNoise(speed=0.0, steering=0.0, yaw_rate=0.0, heading=0.0, position=0.0)


def truth(car: VehicleParameters) -> dict[str, float]:
    model = YinModel.of(car)
    values = (model.a11, model.a12, model.a21, model.a22, model.b1, model.b2, car.steering.lag)
    return dict(zip(PARAMETERS, values, strict=True))


def off(found: Identification, expected: dict[str, float]) -> float:
    """Return the largest error in standard errors."""
    return max(
        abs(found.values[name] - expected[name]) / found.standard_errors[name]
        for name in PARAMETERS
        if found.standard_errors[name] > 0.0
    )


@pytest.fixture(scope="module")
def run() -> DrivenRun:
    return excited_drive(0)


@pytest.fixture(scope="module")
def found(run: DrivenRun) -> Identification:
    return identify(run)


def test_truth_comes_back_without_noise() -> None:
    found = identify(excited_drive(0, noise=SILENT, seconds=30.0))
    for name, value in truth(VEHICLES["yin"]).items():
        assert found.values[name] == pytest.approx(value, rel=2e-4), name


def test_a_noisy_minute(run: DrivenRun, found: Identification) -> None:
    expected = truth(VEHICLES["yin"])
    for name in PARAMETERS:
        assert found.values[name] == pytest.approx(expected[name], rel=0.05)
    assert off(found, expected) < 3.5
    # What is left is the noise of the sensors, white.
    noise = {"steering": 2e-3, "yaw_rate": 5e-3, "heading": 3e-3, "along": 0.03, "across": 0.03}
    for name, deviation in noise.items():
        assert found.residual_rms[name] == pytest.approx(deviation, rel=0.05)
        assert abs(found.residual_correlation[name]) < 0.06
    assert 100 < found.evaluations < 1000
    assert found.degrees_of_freedom == 5 * 6001 - 10 - 6 * 3


def test_intervals_and_covariance_are_consistent(found: Identification) -> None:
    for i, name in enumerate(PARAMETERS):
        low, high = found.intervals[name]
        error = found.standard_errors[name]
        assert (high - low) / 2.0 == pytest.approx(1.96 * error, rel=1e-3)
        assert found.covariance_matrix()[i, i] == pytest.approx(error**2)
    assert (
        np.linalg.eigvalsh(found.covariance_matrix() / np.outer(*[list(found.standard_errors.values())] * 2))[0] > 0.0
    )
    assert "a12" in str(found) and "m²/s²" in str(found)
    with pytest.raises(AttributeError):
        found.evaluations = 0  # type: ignore[misc]


def test_half_the_noise_gives_half_the_error() -> None:
    clean = excited_drive(0, noise=SILENT, seconds=30.0)
    errors = []
    for scale in (0.5, 1.0):
        noise = SensorNoise(0.02 * scale, 2e-3 * scale, 5e-3 * scale, 3e-3 * scale, 0.03 * scale)
        errors.append(list(identify(noise.added_to(clean, 1)).standard_errors.values()))
    np.testing.assert_allclose(errors[0], 0.5 * np.array(errors[1]), rtol=0.1)


def test_the_answer_does_not_depend_on_the_guess(run: DrivenRun, found: Identification) -> None:
    """From guesses up to a factor of e off in each coefficient, some of which are cars that skid off."""
    random = np.random.default_rng(0)
    right = np.array([*list(found.values.values())[:6], 1.0 / found.values["lag"]])
    for _ in range(3):
        factors = np.exp(random.uniform(-1.0, 1.0, 7))
        factors[1:3] *= random.choice([-1.0, 1.0], 2)
        again = identify(run, guess=YinModel(*(right * factors).tolist()))
        assert off(again, dict(found.values)) < 0.02


@pytest.mark.parametrize("vehicle", ["commonroad-1", "commonroad-2", "commonroad-3"])
def test_other_cars_without_an_actuator(vehicle: str) -> None:
    """Neutral cars: a12 and a21 are 0. Their rate limit, which the model does not know, is taken off."""
    car = replace(VEHICLES[vehicle], steering=SteeringActuator())
    run = excited_drive(0, vehicle=car)
    found = identify(run, lag=0.0)
    assert found.values["lag"] == found.standard_errors["lag"] == 0.0
    assert off(found, truth(car)) < 3.5
    assert "steering" not in found.residual_rms
    with pytest.raises(UnusableRun, match=r"not identifiable from this run: lag; .*lag=0.0"):
        identify(run)


def test_a_slow_actuator_with_a_known_delay() -> None:
    car = replace(VEHICLES["yin"], steering=SteeringActuator(lag=0.25, delay=0.06))
    run = excited_drive(2, vehicle=car, step=0.02)
    assert run.delay == 0.06
    found = identify(run)
    assert off(found, truth(car)) < 3.5
    # Not told of the delay, the lag takes it up, and the residuals show that something is wrong.
    fooled = identify(replace(run, delay=0.0))
    assert fooled.values["lag"] > 0.26 and fooled.residual_correlation["steering"] > 0.5


def test_road_wheel_angles_serve_as_well(run: DrivenRun, found: Identification) -> None:
    road_wheel = replace(run, command=run.command / 16.0, steering=run.steering / 16.0, steering_ratio=1.0)
    again = identify(road_wheel)
    assert again.values["b1"] == pytest.approx(16.0 * found.values["b1"], rel=1e-5)
    assert again.values["a12"] == pytest.approx(found.values["a12"], rel=1e-4)
    for name in ("a11", "a12", "a21", "a22", "b1", "b2", "actuator_rate"):
        assert getattr(again.model(), name) == pytest.approx(getattr(found.model(), name), rel=1e-4)


def test_which_measurements_are_needed(run: DrivenRun) -> None:
    """The lateral position alone serves on its axis; yaw rate and steering alone leave a12 in the dark."""
    sideways = excited_drive(0, road={"kind": "sine", "peak_curvature": 1e-4, "wavelength": 1200.0}, speed=None)
    sideways = replace(sideways, x=None)
    assert set(identify(sideways).residual_rms) == {"steering", "yaw_rate", "heading", "y"}
    less = replace(run, x=None, y=None)
    assert identify(less).standard_errors["a12"] > 5.0 * identify(run).standard_errors["a12"]
    with pytest.raises(UnusableRun, match=r"not identifiable from this run: a12; .*shows best in the position: log it"):
        identify(replace(less, heading=None))
    unmeasured = identify(replace(run, steering=None))  # the lag shows in the yaw rate as well
    assert off(unmeasured, truth(VEHICLES["yin"])) < 3.5
    unmeasured_command = identify(replace(run, command=None))  # a human driver: the measured angle is the input
    assert unmeasured_command.values["lag"] == 0.0
    assert off(unmeasured_command, {**truth(VEHICLES["yin"]), "lag": 0.0}) < 3.5


def test_too_little_excitation_names_the_parameters(run: DrivenRun) -> None:
    calm = excited_drive(0, road="straight", speed=25.0, seconds=20.0, step=0.05, max_steering_angle=1e-5)
    with pytest.raises(UnusableRun, match=r"not identifiable from this run: .*a12.*; steer more"):
        identify(calm)
    with pytest.raises(UnusableRun, match="steering never changes, so that none of a11, a12, a21, a22, b1, b2, lag"):
        identify(replace(run, command=np.zeros(len(run.command))))


def test_biases_are_found_where_asked_for(run: DrivenRun, found: Identification) -> None:
    biased = replace(run, yaw_rate=run.yaw_rate + 0.01, steering=run.steering + 0.05)
    assert identify(biased).residual_correlation["steering"] > 0.9
    assert off(identify(biased, biases=("yaw_rate", "steering")), dict(found.values)) < 0.1
    with pytest.raises(
        UnusableRun, match="a bias of 'steering' cannot be fitted: it is not measured, or it is the input"
    ):
        identify(replace(run, command=None), biases=("steering",))
    with pytest.raises(ValueError, match=r"'yawrate' is unknown \(did you mean 'yaw_rate'\?\)"):
        identify(run, biases=("yawrate",))


def test_stretches_are_what_keeps_noise_of_the_speed_out() -> None:
    """Fitted as one stretch, a minute of position bends the parameters; in stretches it does not."""
    clean = excited_drive(0, noise=SILENT, step=0.02)
    expected = truth(VEHICLES["yin"])
    whole, cut = [], []
    for seed in range(6):
        run = SensorNoise().added_to(clean, seed)
        whole.append(off(identify(run, stretch=None), expected))
        cut.append(off(identify(run), expected))
    assert np.max(cut) < 3.5 < np.max(whole)
    # Without that noise, the cut costs a third in precision at the most.
    quiet = SensorNoise(speed=0.0).added_to(clean, 0)
    ratio = [
        identify(quiet).standard_errors[name] / identify(quiet, stretch=None).standard_errors[name]
        for name in ("a11", "a12", "a22", "b2")
    ]
    assert max(ratio) < 2.5 and ratio[1] < 1.35


def test_saturating_tyres_show_in_the_residuals() -> None:
    run = excited_drive(0, tyre="magic_formula", friction=0.8, seconds=30.0)
    assert identify(run).residual_correlation["across"] > 0.3
