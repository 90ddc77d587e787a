"""Driving runs for the identification in `lanekeep/LaneKeep-v0`: excitation and recording."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_baselines
from lanekeep_baselines.identification.noise import SensorNoise
from lanekeep_baselines.identification.run import DrivenRun
from lanekeep_baselines.policy import Floats, Policy
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.roads import Road

#: Road-wheel angle, rad, for time in s and speed in m/s.
Steering = Callable[[float, float], float]


def multi_sine(
    car: VehicleParameters,
    acceleration: float = 2.0,
    band: tuple[float, float] = (0.5, 2.0),
    seed: int = 0,
    tones: int = 20,
) -> Steering:
    """Return an excitation: ``tones`` sines of random phase, spread evenly over ``band`` in Hz.

    It is scaled with the speed so that the nominal ``car`` would, in the steady state, feel the same lateral
    ``acceleration`` (RMS, m/s²) at every speed: what fits a motorway hardly moves the wheel at 10 m/s.
    """
    random = np.random.default_rng(seed)
    frequency = 2.0 * np.pi * np.linspace(*band, tones)
    phase = random.uniform(0.0, 2.0 * np.pi, tones)
    scale = acceleration * np.sqrt(2.0 / tones)
    slip_front = car.cg_to_rear_axle / car.front_cornering_stiffness
    slip_rear = car.cg_to_front_axle / car.rear_cornering_stiffness
    understeer = max(car.mass / car.wheelbase * (slip_front - slip_rear), 0.0)

    def steering(time: float, speed: float) -> float:
        wave = scale * float(np.sin(frequency * time + phase).sum())
        return wave * (car.wheelbase / max(speed, 1.0) ** 2 + understeer)

    return steering


def record_run(
    env: gym.Env[Any, Any],
    seconds: float,
    *,
    policy: Policy | None = None,
    steering: Steering | None = None,
    noise: SensorNoise | None = None,
    seed: int = 0,
) -> DrivenRun:
    """Drive `lanekeep/LaneKeep-v0` from the start of its first road and return the run, steering as steering wheel.

    Yaw rate, steering and command are what the environment's sensors show; speed, heading and position in the world
    are the truth of ``info`` on the known road; ``noise`` comes on top of all but the command.

    Args:
        env: with time (``episode_steps`` and ``max_episode_steps``) and width (``departure="off"``) for the drive.
        seconds: length of the run.
        policy: keeps the car on the road; None leaves it to ``steering``.
        steering: road-wheel angle to add to the policy's, rad, such as `multi_sine`; None for none.
        noise: None for none.
        seed: of the noise and of the environment.

    Raises:
        ValueError: the drive ended before its time.
    """
    scenario = env.unwrapped.scenario  # type: ignore[attr-defined]
    road: Road = env.unwrapped.road_set()[0][0]  # type: ignore[attr-defined]
    rows = _drive(env, seconds, policy, steering, seed)
    speed, angle, command, yaw_rate, station, lateral, theta = np.array(rows).T
    position, ratio = road.position(station, lateral), scenario.vehicle.steering_ratio
    run = DrivenRun(
        step=scenario.control_step,
        speed=speed,
        # An observation tells the command of the step that led to it.
        command=ratio * np.append(command[1:], command[-1]),
        yaw_rate=yaw_rate,
        steering=ratio * angle,
        heading=road.heading(station) + theta,
        x=position[:, 0],
        y=position[:, 1],
        steering_ratio=ratio,
        delay=scenario.vehicle.steering.delay,
    )
    return run if noise is None else noise.added_to(run, seed)


def _drive(
    env: gym.Env[Any, Any], seconds: float, policy: Policy | None, steering: Steering | None, seed: int
) -> list[list[float]]:
    """Return a `_row` of the start and of each step."""
    scenario = env.unwrapped.scenario  # type: ignore[attr-defined]
    step, by_rate = scenario.control_step, scenario.action == "steering_rate"
    scale = scenario.max_steering_rate * step if by_rate else scenario.max_steering_angle
    column = {channel.name: i for i, channel in enumerate(scenario.channels)}
    options = {"road_index": 0, "arc_length": 0.0, "lateral_error": 0.0, "heading_error": 0.0}
    observation, info = env.reset(seed=seed, options=options)
    rows = [_row(observation, info, column)]
    state, before = None, 0.0
    steps = round(seconds / step)
    for k in range(steps):
        action = np.zeros(1, dtype=np.float32)
        if policy is not None:
            action, state = policy.predict(observation, state, np.array(k == 0))
        if steering is not None:
            wanted = steering(k * step, info["speed"])
            action = action + np.float32((wanted - before) / scale)
            # A rate adds up by itself; a policy's rate aims at an angle of its own, which knows nothing of this.
            before = wanted if by_rate and policy is None else 0.0
        observation, _, terminated, truncated, info = env.step(action)
        rows.append(_row(observation, info, column))
        if (terminated or truncated) and k + 1 < steps:
            cause = (
                "the car left its lane: make the environment with departure='off', or steer less"
                if terminated
                else f"the time is up: make the environment with episode_steps and max_episode_steps of {steps} or more"
            )
            raise ValueError(f"the drive ended after {(k + 1) * step:g} of {seconds:g} s: {cause}")
    return rows


def _row(observation: Floats, info: dict[str, Any], column: dict[str, int]) -> list[float]:
    seen = [observation[column[name]] for name in ("steering_angle", "steering_command", "yaw_rate")]
    return [info["speed"], *seen, info["arc_length"], info["lateral_error"], info["heading_error"]]


def excited_drive(
    seed: int = 0,
    *,
    vehicle: Any = "yin",
    seconds: float = 60.0,
    step: float = 0.01,
    noise: SensorNoise | None = None,
    **keywords: Any,
) -> DrivenRun:
    """Drive a run made for identification: a winding road at 10 to 25 m/s, Stanley at the wheel, a `multi_sine` on top.

    Lateral acceleration 2 m/s² RMS, up to about 6; the car stays within half a metre of the lane's centre.

    Args:
        seed: of the excitation's phases and of the noise.
        vehicle: as `gym.make` takes it.
        seconds: length of the run.
        step: control step and time between samples, s.
        noise: None for the default `SensorNoise`.
        keywords: others of `gym.make`, which may also replace road and speed.
    """
    settings = {
        "road": {"kind": "sine", "peak_curvature": 0.01, "wavelength": 1200.0},
        "speed": {"lateral_acceleration": 1.0, "maximum": 35.0},
        "max_steering_angle": 0.5,
        **keywords,
    }
    env = gym.make(
        "lanekeep_env:lanekeep/LaneKeep-v0",
        vehicle=vehicle,
        control_step=step,
        episode_steps=round(seconds / step),
        max_episode_steps=round(seconds / step),
        departure="off",
        preview=1,
        **settings,
    )
    scenario = env.unwrapped.scenario  # type: ignore[attr-defined]
    policy = lanekeep_baselines.make("stanley", scenario)
    steering = multi_sine(scenario.vehicle, seed=seed)
    run = record_run(env, seconds, policy=policy, steering=steering, noise=noise or SensorNoise(), seed=seed)
    env.close()
    return run
