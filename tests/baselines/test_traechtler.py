"""The camera-guided van under PD control: the checked figures of the 1992 article, and the limit of small curvature."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.traechtler_model import CameraModel
from lanekeep_env.physics.parameters import SteeringActuator
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import CameraLaneScenario

VAN = VEHICLES["van"]
SMOOTH = replace(VAN, steering=SteeringActuator(lag=0.25))  # neither backlash nor a limit of the motor's speed
MODEL = CameraModel(wheelbase=3.0, look_ahead=3.5, lag=0.25)

#: Rear wheel's steady error, mm, by the radius of the right edge, m: right curves, left curves.
STATIONARY = {100.0: (3.0, 3.0), 50.0: (14.5, 11.0), 30.0: (43.0, 25.0), 20.0: (105.0, 44.0)}


@pytest.mark.parametrize("speed", [2.0, 6.0])
@pytest.mark.parametrize("turn", [-1, 1], ids=["right", "left"])
@pytest.mark.parametrize("edge_radius", STATIONARY)
def test_rear_wheel_keeps_its_distance_in_steady_curves(bench, oracle, edge_radius, turn, speed) -> None:
    """Whatever the speed; the edge is on the right, 1.5 m from the path, so inside a right curve."""
    road = {"kind": "circle", "radius": turn * (edge_radius - turn * 1.5)}
    drive = bench.drive_van("traechtler-pd", 120.0 / speed, vehicle=SMOOTH, speed=speed, road=road)
    error = drive.lateral[-1]
    assert abs(1e3 * error) == pytest.approx(STATIONARY[edge_radius][turn > 0], abs=1.0 + 0.5)
    assert error == pytest.approx(oracle.stationary(edge_radius, turn), abs=1e-5)


@pytest.mark.parametrize(("speed", "share"), [(3.0, 0.9), (6.0, 0.8), (8.0, 0.8)])
def test_lowered_gains_cost_a_rear_offset(bench, speed: float, share: float) -> None:
    """(l + f)²/2 (1/k - 1) kappa, outwards, with a share k of the gains."""
    offsets = []
    for name in ("traechtler-pd", "traechtler-pd-lowered"):
        road = {"kind": "circle", "radius": 200.0}
        offsets.append(bench.drive_van(name, 40.0, vehicle=SMOOTH, speed=speed, road=road).lateral[-1])
    assert offsets[1] - offsets[0] == pytest.approx(-(6.5**2) / 2 * (1.0 / share - 1.0) / 200.0, rel=0.02)


def test_damping_falls_with_speed_without_the_derivative_part(oracle) -> None:
    found = [oracle.damping(v, MODEL.proportional_gain, 0.0, 3.0, 6.5, 0.25) for v in np.arange(1.0, 6.5, 0.5)]
    assert found[0] == pytest.approx(0.706, abs=5e-4) and found[-1] == pytest.approx(0.540, abs=5e-4)
    assert (np.diff(found) < 0.0).all()


@pytest.mark.parametrize("model", [MODEL, CameraModel(4.2, 6.0, 0.4), CameraModel(2.5, 0.5, 0.1)])
def test_derivative_part_makes_damping_the_same_at_every_speed(oracle, model: CameraModel) -> None:
    assert model.derivative_gain == pytest.approx(model.lag * model.proportional_gain)
    for v in (0.5, 1.0, 3.0, 6.0, 20.0):
        gains = model.proportional_gain, model.derivative_gain
        found = oracle.damping(v, *gains, model.wheelbase, model.reach, model.lag)
        assert found == pytest.approx(math.sqrt(0.5), abs=1e-9)


LIMIT_CYCLES = {("motor", 2.0): 0.16, ("motor", 4.0): 0.16, ("motor", 6.0): 0.16}
LIMIT_CYCLES |= {("road_wheel", 2.0): 0.023, ("road_wheel", 4.0): 0.043, ("road_wheel", 6.0): 0.061}


@pytest.mark.parametrize(("feedback", "speed"), LIMIT_CYCLES)
def test_backlash_makes_a_limit_cycle(bench, oracle, feedback: str, speed: float) -> None:
    """The figures are for a controller in continuous time; sampling at 40 ms and the D part's filter change 5 %.

    The same sampling and filter in the independent simulation leave 2 %.
    """
    van = replace(VAN, steering=replace(VAN.steering, feedback=feedback))
    drive = bench.drive_van("traechtler-pd", 250.0 / speed, vehicle=van, speed=speed, road="straight", start=(0.3, 0.0))
    edge = drive.seen[int(0.6 * len(drive.seen)) :, 0]
    found = (edge.max() - edge.min()) / 2
    assert found == pytest.approx(LIMIT_CYCLES[feedback, speed], rel=0.05)
    truth = oracle.limit_cycle(speed, feedback == "motor", start=0.3, metres=250.0, sample=0.04, smooth=0.1)
    assert found == pytest.approx(truth, rel=0.02)


@pytest.mark.parametrize("speed", [2.0, 6.0])
@pytest.mark.parametrize("turn", [-1, 1], ids=["right", "left"])
def test_van_and_linear_model_agree_in_the_limit_of_small_curvature(bench, turn: int, speed: float) -> None:
    """From a straight into a bend: over |curvature|, what the camera shows differs in proportion to |curvature|."""
    radii = np.array([800.0, 400.0, 200.0, 100.0, 50.0])
    step, seconds = 0.01, 40.0 / speed
    differences = []
    for radius in radii:
        # The look-ahead point is at the start of the bend at first.
        road = bench.Bend(before=MODEL.reach, radius=turn * (radius - turn * 1.5), turn=60.0 / radius)
        settings = {"vehicle": SMOOTH, "speed": speed, "road": road, "control_step": step}
        seen = bench.drive_van("traechtler-pd", seconds, **settings).seen[:, 0] - 1.5
        curvature = np.array([1.0 / road.radius])
        linear = linear_drive(CameraLaneScenario(**settings), curvature, np.array([speed]), len(seen))
        differences.append(np.abs(seen - linear).max() / abs(curvature[0]))
    order = np.diff(np.log(differences)) / np.diff(np.log(1.0 / radii))
    # Linear in the limit: a kappa + b kappa² has order 1 + b kappa/a, halfway to 1 with half the curvature.
    assert 2.0 * order[0] - order[1] > 0.99, order
    assert (order > 0.9).all(), order
    assert (np.diff(differences) > 0.0).all()


def linear_drive(scenario: CameraLaneScenario, curvature: np.ndarray, speed: np.ndarray, n: int) -> np.ndarray:
    """Return the deviation over ``n`` control steps of the linear model with the same controller."""
    policy = lanekeep_baselines.make("traechtler-pd", scenario)
    e = heading = delta = np.zeros(1)
    state, deviations = None, []
    for _ in range(n):
        deviations.append(e[0])
        seen = np.zeros(len(scenario.channels))
        seen[:4] = 1.5 + e[0], 1.0, speed[0], delta[0]
        action, state = policy.predict(seen, state)
        command = action.astype(np.float64) * scenario.max_steering_angle
        e, heading, delta = MODEL.advance(e, heading, delta, command, curvature, speed, scenario.control_step)
    return np.array(deviations)
