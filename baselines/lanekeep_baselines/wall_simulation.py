"""Team KnightRiders 2017: the simulations along a straight wall, the authors' own and the 1:10 car's.

Every controller comes in three variants (`VARIANTS`), because the authors' simulations put metres and degrees into the
same matrices (a start of [0.8; 20], no factor anywhere):

- `published`: their simulation. A heading of 20 degrees moves the car by 20 v T metres in a step. It is no car; for the
  replication of the figures only. Steering limit 22.
- `as-driven`: the gains in degrees per metre on the car, as the authors had them on theirs: the distance weighs 57
  times less than it was designed to, the heading as much.
- `si`: designed and driven in radians.

Starts are given as the authors give theirs, in metres and degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.wall_cascade import LARGEST_HEADING
from lanekeep_baselines.wall_control import Cascade, Measured, Pd, Pi, PiState, PublishedCascade, WallControl
from lanekeep_baselines.wall_design import PD_SENSOR, PD_SPEED, WallCar, misprinted_pd_design, pd_design
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise
from lanekeep_env.sensing.ultrasonic import HALF_CONE

VARIANTS = ("published", "as-driven", "si")
CONTROLLERS = ("pi", "pi-state", "cascade", "cascade-delayed", "cascade-redesigned", "pd", "pd-misprinted")
#: Steering limit of the report, degrees.
LIMIT = 22.0
DEGREE = float(np.pi / 180.0)
#: Gain of the distance in the cascade at 0.4 m/s, per m. The report prints none: with 4 the published simulation swings
#: "hardly" (Figure 3.35), with 2 the car in radians does not either. Other speeds: in proportion to 1/v.
DISTANCE_GAIN = {"published": 4.0, "as-driven": 4.0, "si": 2.0}
DISTANCE_GAIN_SPEED = 0.4


@dataclass(frozen=True)
class Run:
    """Time (s), distance of the sensor (m), heading and steering (degrees): (steps,) each, before each step."""

    time: Floats
    distance: Floats
    heading: Floats
    steering: Floats


#: (distance, heading, steering) to (distance, heading) one step later.
Plant = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]


def linear_plant(car: WallCar, speed: float) -> Plant:
    """Return the design's plant (6), in whatever unit the angles are."""
    a, b = car.plant(speed)

    def advance(distance: Floats, heading: Floats, steering: Floats) -> tuple[Floats, Floats]:
        return distance + a[0, 1] * heading + b[0, 0] * steering, heading + b[1, 0] * steering

    return advance


def kinematic_plant(car: WallCar, speed: float, steering_offset: float = 0.0) -> Plant:
    """Return the 1:10 car without slip, exactly: its rear axle drives an arc of curvature tan(steering)/l in a step.

    Args:
        car: the car.
        speed: m/s.
        steering_offset: what the road wheel has more than asked for, rad.
    """
    way = speed * car.step

    def advance(distance: Floats, heading: Floats, steering: Floats) -> tuple[Floats, Floats]:
        turned = way * np.tan(steering + steering_offset) / car.wheelbase
        half = turned / 2.0
        # The chord of the arc, at the mean heading; sinc(x/pi) = sin(x)/x.
        rear = distance - car.sensor * np.sin(heading) + way * np.sinc(half / np.pi) * np.sin(heading + half)
        return rear + car.sensor * np.sin(heading + turned), heading + turned

    return advance


def controller(name: str, variant: str, car: WallCar, speed: float, limit: float = LIMIT) -> WallControl:
    """Return one of `CONTROLLERS` in the variant's unit; ``limit`` in degrees (`published`: a number)."""
    if name not in CONTROLLERS or variant not in VARIANTS:
        raise ValueError(f"no {name!r} in variant {variant!r}: {', '.join(CONTROLLERS)} in {', '.join(VARIANTS)}")
    unit = DEGREE if variant == "si" else 1.0
    limit = limit * unit
    if name == "pi":
        return Pi(car, limit)
    if name == "pi-state":
        return PiState(car, limit)
    if name in ("cascade", "cascade-delayed"):
        gain = DISTANCE_GAIN[variant] * DISTANCE_GAIN_SPEED / speed
        return PublishedCascade(car, limit, gain, delayed=name == "cascade-delayed")
    if name == "cascade-redesigned":
        if variant != "si":
            raise ValueError(f"{name!r} is designed in radians: variant 'si', not {variant!r}")
        return Cascade(car, limit, LARGEST_HEADING)
    design = (pd_design if name == "pd" else misprinted_pd_design)(car.step)
    return Pd(car, limit, design, kick=variant == "published")


def simulate(
    name: str,
    variant: str,
    start: tuple[float, float],
    speed: float,
    *,
    car: WallCar | None = None,
    wanted: float = 1.0,
    limit: float = LIMIT,
    duration: float = 20.0,
    linear: bool = False,
    steering_offset: float = 0.0,
    noise: WallNoise | None = None,
    seed: int = 0,
) -> Run:
    """Drive one controller along the wall.

    Args:
        name: one of `CONTROLLERS`.
        variant: one of `VARIANTS`.
        start: distance in m, heading in degrees.
        speed: m/s.
        car: the report's, unless given.
        wanted: distance asked for, m.
        limit: of the steering, degrees; inf for none.
        duration: s.
        linear: the design's plant in radians instead of the car; `published` always has the design's plant.
        steering_offset: degrees; of the car only.
        noise: of the side sensor, whose distance is then measured along its axis; None for the exact distance. Heading
            and yaw rate are exact.
        seed: of the noise.
    """
    car = WallCar() if car is None else car
    rng = np.random.default_rng(seed)
    control = controller(name, variant, car, speed, limit)
    mixed = variant == "published"
    # Plant's unit of angles in degrees, and the controller's in the plant's.
    degrees = 1.0 if mixed else DEGREE
    unit = DEGREE if variant == "as-driven" else 1.0
    plant = linear_plant(car, speed) if mixed or linear else kinematic_plant(car, speed, steering_offset * DEGREE)
    distance, heading = np.array([start[0]]), np.array([start[1] * degrees])
    turned, memory = np.zeros(1), np.zeros((1, control.memory))
    speeds, goal = np.array([speed]), np.array([wanted])
    rows: list[list[float]] = []
    for step in range(round(duration / car.step)):
        side = distance
        if noise is not None:
            side = distance / np.cos(heading) + noise.side_distance * rng.standard_normal(1)
        measured = Measured(speeds, side, heading / unit, turned / unit)
        steering, memory = control.command(measured, goal, memory, step == 0)
        rows.append([step * car.step, distance[0], heading[0] / degrees, steering[0] * unit / degrees])
        distance, after = plant(distance, heading, steering * unit)
        turned, heading = after - heading, after
    return Run(*np.array(rows).T)


def simulate_estimated(
    start: tuple[float, float],
    speed: float,
    *,
    car: WallCar | None = None,
    wanted: float = 1.0,
    duration: float = 30.0,
    steering_offset: float = 3.0,
    yaw_rate_bias: float = 0.05,
    servo_lag: float = 0.0,
    noise: WallNoise | None = None,
    seed: int = 0,
) -> Run:
    """Drive the redesigned cascade on the Kalman filter: only side distance and yaw rate are measured, both noisy.

    Args:
        start: distance in m, heading in degrees; the filter does not know the heading.
        speed: m/s.
        car: the report's, unless given.
        wanted: distance asked for, m.
        duration: s.
        steering_offset: degrees.
        yaw_rate_bias: rad/s.
        servo_lag: time constant of a servo that neither filter nor cascade know of, s.
        noise: of the sensors; None for none. The filter has its own.
        seed: of the noise.
    """
    car = WallCar() if car is None else car
    rng = np.random.default_rng(seed)
    distance_noise, rate_noise = (0.0, 0.0) if noise is None else (noise.side_distance, noise.yaw_rate)
    control = Cascade(car, LIMIT * DEGREE, LARGEST_HEADING)
    estimator = WallFilter(car)
    plant = kinematic_plant(car, speed, steering_offset * DEGREE)
    left = 0.0 if servo_lag == 0.0 else float(np.exp(-car.step / servo_lag))
    distance, heading = np.array([start[0]]), np.array([start[1] * DEGREE])
    turned, steering, wheel = np.zeros(1), np.zeros(1), np.zeros(1)
    known, memory = np.zeros((1, estimator.memory)), np.zeros((1, control.memory))
    speeds, goal = np.array([speed]), np.array([wanted])
    rows: list[list[float]] = []
    for step in range(round(duration / car.step)):
        side = distance / np.cos(np.maximum(np.abs(heading) - HALF_CONE, 0.0)) + distance_noise * rng.standard_normal(1)
        rate = turned / car.step + yaw_rate_bias + rate_noise * rng.standard_normal(1)
        known = estimator.update(known, step == 0, speeds, steering, side, rate)
        measured = Measured(speeds, known[:, 0], known[:, 1], (rate - known[:, 3]) * car.step)
        steering, memory = control.command(measured, goal, memory, step == 0)
        rows.append([step * car.step, distance[0], heading[0] / DEGREE, steering[0] / DEGREE])
        wheel = steering + left * (wheel - steering)
        distance, after = plant(distance, heading, wheel)
        turned, heading = after - heading, after
    return Run(*np.array(rows).T)


#: Arguments of `simulate` behind the report's figures, two of one run (distance, steering) under the first's number.
FIGURES: dict[str, dict[str, Any]] = {
    "3.8": {"name": "pi", "start": (0.0, 0.0), "speed": 0.4},
    "3.9": {"name": "pi", "start": (0.8, 20.0), "speed": 0.4},
    "3.10": {"name": "pi-state", "start": (0.8, 20.0), "speed": 0.4},
    "3.12": {"name": "pi-state", "start": (0.0, 0.0), "speed": 0.4, "limit": np.inf},
    "3.13": {"name": "pi-state", "start": (0.0, 0.0), "speed": 0.4},
    "3.16": {"name": "pi-state", "start": (0.5, -20.0), "speed": 1.0, "limit": np.inf},
    "3.17": {"name": "pi-state", "start": (0.5, -20.0), "speed": 1.0},
    "3.33": {"name": "cascade", "start": (0.0, 0.0), "speed": 0.4},
    "3.35": {"name": "cascade", "start": (0.8, 20.0), "speed": 0.4},
    "3.37": {"name": "cascade", "start": (0.5, -20.0), "speed": 1.0},
    "3.40": {"name": "pd-misprinted", "start": (0.0, 0.0), "speed": PD_SPEED, "car": WallCar(sensor=PD_SENSOR)},
}


def figure(number: str) -> Run:
    """Return the run behind a figure, in the authors' own mixed units."""
    return simulate(variant="published", **FIGURES[number])


def settled(run: Run, wanted: ArrayLike = 1.0, last: float = 5.0) -> float:
    """Return the largest distance from the wanted one in the ``last`` seconds, m."""
    late = run.distance[run.time >= run.time[-1] - last]
    return float(np.max(np.abs(late - wanted)))
