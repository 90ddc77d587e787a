"""Team KnightRiders 2017: the report's rule for poles, and what keeps to it over the speeds of the car.

No closed pole is to lie left of zero, at any speed (3.3.1 and the end of 3.3.3): Figures 3.4 and 3.5 show why.
"""

from __future__ import annotations

import control
import gymnasium as gym
import numpy as np

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_baselines.wall_cascade import HEADING_LOOP_GAIN, heading_locus
from lanekeep_baselines.wall_design import PiDesign, WallCar, bounded_pi_design, pi_design, pi_poles
from lanekeep_benchmarks.replications import knightriders_plots as plots
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.wall_simulation import CAR
from lanekeep_env.physics.vehicles import VEHICLES

SPEEDS = (0.2, 0.4, 0.7, 1.0, 1.2, 1.5, 2.0, 2.5, 3.0)
CARS = {name: VEHICLES[name].wheelbase for name in ("knightriders", "pses")}


def steps(found: Replication) -> None:
    """Figures 3.4 and 3.5: one pole at -0.8 and at 0.8; Figure 3.25: the heading's closed loop."""
    step = CAR.step
    responses = {}
    for number, pole in (("3.4", -0.8), ("3.5", 0.8)):
        time, out = control.step_response(control.tf([1.0 - pole], [1.0, -pole], step), np.arange(41) * step)
        sign = "−" if pole < 0 else ""
        responses[f"Figure {number}: one pole at {sign}{abs(pole):g}"] = (time, out)
        largest = float(np.max(out))
        quantity = f"largest value of a step response with the pole {sign}{abs(pole):g}"
        found.rows.append(Row(quantity, f"(1 − p^k), Figure {number}", 1.8 if pole < 0 else 1.0, largest, "", 2))
    closed = control.feedback(HEADING_LOOP_GAIN * heading_locus(step), 1)
    responses[f"Figure 3.25: heading, loop gain {HEADING_LOOP_GAIN}"] = control.step_response(
        closed, np.arange(21) * step
    )
    found.pictures["figures_3_04_3_05_3_25.png"] = plots.steps(responses)


def poles_text(car: WallCar, speed: float, design: PiDesign) -> str:
    """Return the closed poles as text, largest real part first."""
    parts = []
    for pole in pi_poles(car, speed, design):
        if pole.imag < -1e-9:
            parts.append(f"{pole.real:.3f} ± {abs(pole.imag):.3f}i")
        elif pole.imag < 1e-9:
            parts.append(f"{pole.real:.3f}")
    return ", ".join(parts).replace("-", "−")


def pi_over_speed(found: Replication) -> None:
    """Closed poles of the published PI and of `knightriders-pi` from 0.2 to 3 m/s, on both cars."""
    rows = []
    for name, wheelbase in CARS.items():
        car = WallCar(wheelbase, 0.5 * wheelbase, CAR.step)
        for speed in SPEEDS:
            published, bounded = pi_design(car, speed), bounded_pi_design(car, speed)
            largest = abs(pi_poles(car, speed, published)).max()
            kept = "" if largest < 1.0 else ", unstable"
            texts = (poles_text(car, speed, published) + kept, poles_text(car, speed, bounded))
            rows.append((name, f"{speed:g}", f"{float(car.zero(speed)):.3f}", *texts))
    found.tables.append(
        Table(
            "No pole left of zero at any speed: closed poles of the PI as published and as knightriders-pi has it",
            ("car", "speed [m/s]", "zero of the plant", "published", "knightriders-pi"),
            tuple(rows),
        )
    )


def contacts(speed: float, sensors: str | None, cars: int = 400) -> tuple[int, int]:
    """Drive `WallFollow-v0`; return contacts and how many cars end more than 10 cm off."""
    steps = 1500 if speed < 0.2 else 600
    env = gym.make_vec(
        "lanekeep/WallFollow-v0",
        cars,
        "vector_entry_point",
        speed=speed,
        sensors=sensors,
        contact="cost",
        episode_steps=steps,
        autoreset_mode="disabled",
    )
    policy = lanekeep_baselines.make("knightriders-cascade-kalman", env.unwrapped.scenario)  # type: ignore[attr-defined]
    observation, info = env.reset(seed=0)
    state, touched = None, np.zeros(cars, dtype=bool)
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, _, _, _, info = env.step(action)
        touched |= np.asarray(info["cost"]) > 0.0
    env.close()
    return int(touched.sum()), int((np.abs(info["lateral_error"]) > 0.1).sum())


def slow_cascade(found: Replication) -> None:
    """The cascade on the Kalman filter at low speed, from the environment's starts: ± 0.3 m, ± 20°, ± 3° of offset."""
    rows = []
    for sensors in (None, "production", "poor"):
        for speed in (0.1, 0.3, 0.5):
            rows.append((sensors or "perfect", f"{speed:g}", *(str(count) for count in contacts(speed, sensors))))
    found.tables.append(
        Table(
            "knightriders-cascade-kalman at low speed: 400 cars each, 27 s (0.1 m/s: 68 s)",
            ("sensors", "speed [m/s]", "contacts", "more than 10 cm off at the end"),
            tuple(rows),
        )
    )
