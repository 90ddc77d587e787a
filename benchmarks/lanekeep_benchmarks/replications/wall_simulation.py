"""Team KnightRiders 2017: the simulations along a straight wall, the authors' own and the 1:10 car's.

Every controller comes in three variants (`VARIANTS`), because the authors' simulations put metres and degrees into the
same matrices (a start of [0.8; 20], no factor anywhere):

- `published`: their simulation. A heading of 20 degrees moves the car by 20 v T metres in a step. It is no car; for the
  replication of the figures only. Steering limit 22.
- `as-driven`: the gains in degrees per metre on the car, as the authors had them on theirs: the distance weighs 57
  times less than it was designed to, the heading as much.
- `si`: designed and driven in radians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.wall_cascade import (
    DISTANCE_GAIN_DEGREES,
    DISTANCE_GAIN_RADIANS,
    DISTANCE_GAIN_SPEED,
    LARGEST_HEADING,
)
from lanekeep_baselines.wall_control import Cascade, Measured, Pd, Pi, PiState, PublishedCascade, WallControl
from lanekeep_baselines.wall_design import PD_SENSOR, PD_SPEED, WallCar, misprinted_pd_design, pd_design
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise
from lanekeep_env.sensing.ultrasonic import HALF_CONE

VARIANTS = ("published", "as-driven", "si")
CONTROLLERS = ("pi", "pi-state", "cascade", "cascade-delayed", "cascade-redesigned", "pd", "pd-misprinted")
#: Steering limit, degrees: an assumption, the report prints none.
LIMIT = 22.0
DEGREE = float(np.pi / 180.0)
#: The report's car, and that of the competition's PD.
CAR, PD_CAR = WallCar(), WallCar(sensor=PD_SENSOR)
#: A start as the report gives its own: distance in m, heading in degrees; and the speed, m/s.
Start = tuple[float, float, float]
#: Of the report's comparisons.
STARTS: tuple[Start, Start] = ((0.8, 20.0, 0.4), (0.5, -20.0, 1.0))
#: Distance asked for, m.
WANTED = 1.0


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
        gain = DISTANCE_GAIN_RADIANS if variant == "si" else DISTANCE_GAIN_DEGREES
        return PublishedCascade(car, limit, gain * DISTANCE_GAIN_SPEED / speed, delayed=name == "cascade-delayed")
    if name == "cascade-redesigned":
        if variant != "si":
            raise ValueError(f"{name!r} is designed in radians: variant 'si', not {variant!r}")
        return Cascade(car, limit, LARGEST_HEADING)
    design = (pd_design if name == "pd" else misprinted_pd_design)(car.step)
    return Pd(car, limit, design, kick=variant == "published")


def simulate(
    name: str,
    variant: str,
    start: Start,
    *,
    car: WallCar = CAR,
    plant: Plant | None = None,
    limit: float = LIMIT,
    duration: float = 20.0,
    noise: WallNoise | None = None,
) -> Run:
    """Drive one controller along the wall, `WANTED` beside it.

    Args:
        name: one of `CONTROLLERS`.
        variant: one of `VARIANTS`.
        start: distance, heading and speed.
        car: that the controller is designed for, and that is driven.
        plant: driven in its place; None for the car itself, and for `published` the design's plant.
        limit: of the steering, degrees; inf for none.
        duration: s.
        noise: of the side sensor, whose distance is then measured along its axis; None for the exact distance. Heading
            and yaw rate are exact.
    """
    side, turn, speed = start
    control = controller(name, variant, car, speed, limit)
    # Plant's unit of angles in degrees, and the controller's in the plant's.
    degrees = 1.0 if variant == "published" else DEGREE
    unit = DEGREE if variant == "as-driven" else 1.0
    if plant is None:
        plant = (linear_plant if variant == "published" else kinematic_plant)(car, speed)
    rng = np.random.default_rng(0)
    distance, heading = np.array([side]), np.array([turn * degrees])
    turned, memory = np.zeros(1), np.zeros((1, control.memory))
    speeds, goal = np.array([speed]), np.array([WANTED])
    rows: list[list[float]] = []
    for step in range(round(duration / car.step)):
        seen = distance
        if noise is not None:
            seen = distance / np.cos(heading) + noise.side_distance * rng.standard_normal(1)
        measured = Measured(speeds, seen, heading / unit, turned / unit)
        steering, memory = control.command(measured, goal, memory, step == 0)
        rows.append([step * car.step, distance[0], heading[0] / degrees, steering[0] * unit / degrees])
        distance, after = plant(distance, heading, steering * unit)
        turned, heading = after - heading, after
    return Run(*np.array(rows).T)


def simulate_estimated(
    start: Start,
    *,
    steering_offset: float = 3.0,
    yaw_rate_bias: float = 0.05,
    servo_lag: float = 0.0,
    noise: WallNoise | None = None,
    seed: int = 0,
) -> Run:
    """Drive the redesigned cascade on the Kalman filter for 30 s: side distance and yaw rate are all that is measured.

    Args:
        start: distance, heading and speed; the filter does not know the heading.
        steering_offset: degrees.
        yaw_rate_bias: rad/s.
        servo_lag: time constant of a servo that neither filter nor cascade know of, s.
        noise: of the sensors; None for none. The filter has its own.
        seed: of the noise.
    """
    car, rng = CAR, np.random.default_rng(seed)
    side, turn, speed = start
    distance_noise, rate_noise = (0.0, 0.0) if noise is None else (noise.side_distance, noise.yaw_rate)
    control = Cascade(car, LIMIT * DEGREE, LARGEST_HEADING)
    estimator = WallFilter(car)
    plant = kinematic_plant(car, speed, steering_offset * DEGREE)
    left = 0.0 if servo_lag == 0.0 else float(np.exp(-car.step / servo_lag))
    distance, heading = np.array([side]), np.array([turn * DEGREE])
    turned, steering, wheel = np.zeros(1), np.zeros(1), np.zeros(1)
    known, memory = np.zeros((1, estimator.memory)), np.zeros((1, control.memory))
    speeds, goal = np.array([speed]), np.array([WANTED])
    rows: list[list[float]] = []
    for step in range(round(30.0 / car.step)):
        seen = distance / np.cos(np.maximum(np.abs(heading) - HALF_CONE, 0.0)) + distance_noise * rng.standard_normal(1)
        rate = turned / car.step + yaw_rate_bias + rate_noise * rng.standard_normal(1)
        known = estimator.update(known, step == 0, speeds, steering, seen, rate)
        measured = Measured(speeds, known[:, 0], known[:, 1], (rate - known[:, 3]) * car.step)
        steering, memory = control.command(measured, goal, memory, step == 0)
        rows.append([step * car.step, distance[0], heading[0] / DEGREE, steering[0] / DEGREE])
        wheel = steering + left * (wheel - steering)
        distance, after = plant(distance, heading, wheel)
        turned, heading = after - heading, after
    return Run(*np.array(rows).T)


#: Arguments of `simulate` behind the report's figures, two of one run (distance, steering) under the first's number.
FIGURES: dict[str, dict[str, Any]] = {
    "3.8": {"name": "pi", "start": (0.0, 0.0, 0.4)},
    "3.9": {"name": "pi", "start": (0.8, 20.0, 0.4)},
    "3.10": {"name": "pi-state", "start": (0.8, 20.0, 0.4)},
    "3.12": {"name": "pi-state", "start": (0.0, 0.0, 0.4), "limit": np.inf},
    "3.13": {"name": "pi-state", "start": (0.0, 0.0, 0.4)},
    "3.16": {"name": "pi-state", "start": (0.5, -20.0, 1.0), "limit": np.inf},
    "3.17": {"name": "pi-state", "start": (0.5, -20.0, 1.0)},
    "3.33": {"name": "cascade", "start": (0.0, 0.0, 0.4)},
    "3.35": {"name": "cascade", "start": (0.8, 20.0, 0.4)},
    "3.37": {"name": "cascade", "start": (0.5, -20.0, 1.0)},
    "3.40": {"name": "pd-misprinted", "start": (0.0, 0.0, PD_SPEED), "car": PD_CAR},
}


def figure(number: str) -> Run:
    """Return the run behind a figure, in the authors' own mixed units."""
    return simulate(variant="published", **FIGURES[number])


def settled(run: Run, last: float = 5.0) -> float:
    """Return the largest distance from the wanted one in the ``last`` seconds, m."""
    late = run.distance[run.time >= run.time[-1] - last]
    return float(np.max(np.abs(late - WANTED)))


def at_limit(run: Run) -> float:
    """Share of the time with the steering at its limit, %."""
    return 100.0 * float(np.mean(np.abs(run.steering) > LIMIT - 1e-6))


def lowest_after_peak(run: Run) -> float:
    """Smallest distance behind the largest one, m."""
    return float(run.distance[run.distance.argmax() :].min())
