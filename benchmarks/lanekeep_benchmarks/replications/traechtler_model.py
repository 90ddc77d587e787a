"""Trächtler, Lohmann, Struck 1992: Figures 2 and 3, the derivative part, and the set point."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_env  # noqa: F401
from lanekeep_baselines.traechtler import TraechtlerPd
from lanekeep_baselines.traechtler_model import CameraModel
from lanekeep_benchmarks.replications import traechtler_plots as plots
from lanekeep_benchmarks.replications.passat import CurvatureSteps
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.van import NO_BACKLASH, Floats, drive

#: The article's van with a road wheel that follows at once, as Figure 2 has it.
IDEAL = {"base": "van", "steering": {"lag": 0.0, "rate_limit": None, "angle_limit": None, "backlash": 0.0}}
MODEL = CameraModel(3.0, 3.5, 0.25)
SPEED, SET = 4.0, 1.5
RADII, ANGLES = (100.0, 50.0, 20.0), (2.0, 5.0, 10.0)


def entering(time: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return (1) and (2): how d grows after the point passed into a right curve, wheels straight, m."""
    way = SPEED * time
    return radius - np.sqrt(radius**2 - way**2), way**2 / (2.0 * radius)


def turning(time: Floats, angle: float) -> tuple[Floats, Floats]:
    """Return (6) and (7): how d grows on a straight with a constant steering angle (rad), m."""
    r = MODEL.wheelbase / math.sin(angle)
    phi = SPEED * time / r
    moved = SET + r * math.cos(angle) - r * np.cos(angle + phi) + MODEL.look_ahead * np.sin(phi)
    linear = MODEL.reach * SPEED * angle / MODEL.wheelbase * time + SPEED**2 * angle / (2.0 * MODEL.wheelbase) * time**2
    return moved / np.cos(phi) - SET, linear


def van_distance(action: float, seconds: float, road: Any) -> tuple[Floats, Floats]:
    """Return station of the look-ahead point (m) and edge distance (m) of a van whose wheel stands still, (steps,)."""
    env = gym.make(
        "lanekeep/CameraLane-v0", road=road, speed=SPEED, vehicle=IDEAL, departure="off", control_step=0.01,
        episode_steps=100_000,
    )  # fmt: skip
    place = {"arc_length": 0.0, "lateral_error": 0.0, "heading_error": 0.0}
    observation, info = env.reset(seed=0, options=place)
    rows = [(info["arc_length"] + MODEL.reach, observation[0])]
    for _ in range(round(seconds / 0.01)):
        observation, _, _, _, info = env.step(np.array([action], dtype=np.float32))
        rows.append((info["arc_length"] + MODEL.reach, observation[0]))
    env.close()
    station, distance = np.array(rows, dtype=np.float64).T
    return station, distance


def figure_2(found: Replication) -> None:
    """Both situations: the exact way, its linear form, and the van with the environment's camera."""
    time: Floats = np.linspace(0.0, 2.0, 81, dtype=np.float64)
    curves: dict[str, dict[str, tuple[Floats, ...]]] = {"a": {}, "b": {}}
    worst = [0.0, 0.0]
    before = 20.0
    for radius in RADII:
        # The edge is 1.5 m right of the road's centre, on the inside of a right curve.
        road = CurvatureSteps(curvatures=(-1.0 / (radius + SET),), before=before)
        station, distance = van_distance(0.0, 6.0, road)
        since = (station - before) / SPEED
        shown = (since >= 0.0) & (since <= 1.5)
        exact, _ = entering(since[shown], radius)
        worst[0] = max(worst[0], float(np.abs(distance[shown] - SET - exact).max()))
        curves["a"][f"R = {radius:.0f} m"] = (*entering(time, radius), since[shown][::10], distance[shown][::10] - SET)
    for angle in ANGLES:
        station, distance = van_distance(math.radians(angle) / 0.6, 2.0, "straight")
        since = 0.01 * np.arange(len(distance), dtype=np.float64)
        exact, _ = turning(since, math.radians(angle))
        shown = SET + exact < 4.9  # within the camera's field of view
        worst[1] = max(worst[1], float(np.abs(distance - SET - exact)[shown].max()))
        seen = since[shown][::10], distance[shown][::10] - SET
        curves["b"][f"δ = {angle:.0f}°"] = (*turning(time, math.radians(angle)), *seen)
    found.pictures["figure_2.png"] = plots.figure_2(time, curves)
    for name, equation, difference in (("a", "(1)", worst[0]), ("b", "(6)", worst[1])):
        quantity = f"Figure 2{name}: largest difference of the van's camera from {equation}"
        found.rows.append(Row(quantity, f"{equation}, Figure 2", 0.0, difference, "m", 3))


def figure_3(found: Replication) -> None:
    """The blocks: G_κ, G_δ and both together, as the model's state equations (10) step them, against (2) and (7)."""
    step, count = 0.02, 101
    time: Floats = step * np.arange(count, dtype=np.float64)
    cases = {"a: G_κ, κ = 1/50 m": (0.02, 0.0), "b: G_δ, δ = 5°": (0.0, math.radians(5.0))}
    cases["c: both"] = (0.02, math.radians(5.0))
    instant, curves, worst = CameraModel(3.0, 3.5, 0.0), {}, 0.0
    for name, (right, angle) in cases.items():
        e, heading, steer = np.zeros(1), np.zeros(1), np.array([angle])
        ways = [0.0]
        for _ in range(count - 1):
            e, heading, steer = instant.advance(
                e, heading, steer, np.array([angle]), np.array([-right]), np.array([SPEED]), step
            )
            ways.append(float(e[0]))
        expected = (
            SPEED**2 * right / 2.0 * time**2 + turning(time, angle)[1] if angle else SPEED**2 * right / 2 * time**2
        )
        worst = max(worst, float(np.abs(np.array(ways) - expected).max()))
        curves[name] = np.array(ways)
    found.pictures["figure_3.png"] = plots.figure_3(time, curves)
    quantity = "Figure 3: largest difference of (10), stepped, from (2) and (7)"
    found.rows.append(Row(quantity, "(10), Figure 3", 0.0, worst, "m", 6))


def derivative_part(found: Replication) -> None:
    """What K3 does: damping of the linear loop, and the van back from 0.3 m."""
    rows = []
    for share in (0.0, 0.25, 0.5, 1.0, 1.5, 2.0):
        policy = type("WithK3", (TraechtlerPd,), {"derivative": share})
        dampings = []
        for speed in (1.0, 4.0, 6.0):
            loop = np.polymul(
                [share * MODEL.derivative_gain, MODEL.proportional_gain],
                [MODEL.reach * speed / MODEL.wheelbase, speed**2 / MODEL.wheelbase],
            )
            poles = np.roots(np.polyadd([MODEL.lag, 1.0, 0.0, 0.0], loop)).astype(complex)
            dampings.append(float((-poles.real / np.abs(poles)).min()))
        driven = drive("CameraLane-v0", policy, 15.0, road="straight", speed=4.0, vehicle=NO_BACKLASH, offset=0.3)
        off = np.flatnonzero(np.abs(driven.lateral) > 0.02)
        beyond = -100.0 * float(driven.lateral.min())
        effort = math.degrees(math.sqrt(float(np.mean(driven.rate[:125] ** 2))))
        numbers = (f"{driven.time[off[-1]]:.1f}", f"{beyond:.1f}", f"{effort:.1f}")
        rows.append((f"{share:g}", *(f"{one:.3f}" for one in dampings), *numbers))
    found.tables.append(
        Table(
            "The derivative part: K3 as a share of T K2 (traechtler-p has 0, traechtler-pd 1)",
            (
                "K3/(T K2)",
                "damping, 1 m/s",
                "4 m/s",
                "6 m/s",
                "van within 2 cm from 0.3 m, 4 m/s [s]",
                "beyond the path [cm]",
                "steering rate, RMS of 5 s [°/s]",
            ),
            tuple(rows),
        )
    )


def set_points(found: Replication) -> None:
    """The set point as a command: kept without a remaining deviation on a straight."""
    hold = 16.0
    driven = drive(
        "CameraLane-v0", "traechtler-pd", 96.0, road="straight", speed=4.0, vehicle=NO_BACKLASH,
        set_points={"minimum": 1.0, "maximum": 2.0, "hold": hold},
    )  # fmt: skip
    found.pictures["set_points.png"] = plots.set_points(driven)
    ends = np.arange(1, 6) * round(hold / 0.04) - 1
    left = float(np.abs(driven.edge - driven.wanted)[ends].max())
    quantity = "deviation from the set point that remains on a straight, 16 s after a change"
    found.rows.append(Row(quantity, "section 3, in words", 0.0, left, "m", 3))
