"""Trächtler, Lohmann, Struck 1992: blind drives by other angles, round an obstacle, and by a plan with errors.

The article expects these errors of maps and positioning and asks for exact landmarks (section 5); it gives no number.
"""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_benchmarks.replications import traechtler_plots as plots
from lanekeep_benchmarks.replications.record import Replication, Table

POLICIES = {"PD": "traechtler-pd", "blind": "traechtler-blind", "inverse": "traechtler-inverse"}
ROADS = 32
SPEEDS = (2.0, 4.0, 6.0)
#: Degrees; sizes of the plan's errors by kind, both signs of each; and where a bend is recognised, m ahead.
TURNS = (30, 60, 90, 120, 150)
SIZES: dict[str, tuple[float, ...]] = {
    "offset": (0.25, 0.5, 1.0, 2.0),
    "radius": (0.05, 0.1, 0.2),
    "angle": (0.05, 0.1, 0.2),
}
RECOGNISED = (20.0, 10.0, 8.0, 7.0, 6.0, 5.0, 3.0, 0.0)


def blind_drives(policy: str, way: float, speed: float, **keywords: Any) -> tuple[float, float]:
    """Drive 32 roads; return the share of those that left the lane (%), and the mean of the largest error (m).

    What left its lane counts with half the lane's width.
    """
    steps = math.ceil(way / speed / 0.04)
    env: Any = gym.make_vec(
        "lanekeep/TurnOff-v0",
        ROADS,
        "vector_entry_point",
        speed=speed,
        departure="cost",
        episode_steps=steps,
        autoreset_mode="disabled",
        **keywords,
    ).unwrapped
    controller = lanekeep_baselines.make(policy, env.scenario)
    observation, _ = env.reset(seed=0, options={"road_index": np.arange(ROADS)})
    state, left, largest = None, np.zeros(ROADS, dtype=bool), np.zeros(ROADS)
    for _ in range(steps):
        action, state = controller.predict(observation, state)
        observation, _, _, _, info = env.step(action)
        left |= np.asarray(info["cost"]) > 0.0
        largest = np.maximum(largest, np.abs(info["lateral_error"]))
    env.close()
    return 100.0 * float(left.mean()), float(np.minimum(largest, env.scenario.lane_width / 2).mean())


def turn(degrees: float) -> dict[str, Any]:
    """Return turns by one angle, of all radii, to both sides."""
    return {
        "kind": "turn-off",
        "count": ROADS,
        "smallest_angle": math.radians(degrees),
        "largest_angle": math.radians(degrees),
    }


def cell(told: tuple[float, float]) -> str:
    """Return error and, where any left its lane, their share."""
    left, error = told
    return f"{error:.2f}" + (f" ({left:.0f} % left)" if left else "")


def angles(found: Replication) -> None:
    """Turns by 30 to 150 degrees, and the bypass, at 2, 4 and 6 m/s."""
    rows, errors = [], {}
    for name, way, road in (
        *((f"turn by {degrees}°", 170.0, turn(degrees)) for degrees in TURNS),
        ("round an obstacle", 90.0, {"kind": "bypass", "count": ROADS}),
    ):
        for speed in SPEEDS:
            told = [blind_drives(policy, way, speed, road=road) for policy in POLICIES.values()]
            rows.append((name, f"{speed:g}", *map(cell, told)))
            errors[name, speed] = [error for _, error in told]
    found.pictures["turns.png"] = plots.turns(errors, SPEEDS, tuple(POLICIES))
    found.tables.append(
        Table(
            "Blind drives by angle, and round an obstacle: mean of the largest error over 32 roads [m] (the lane ends"
            " at 1.5; the PD controller knows no plan)",
            ("drive", "speed [m/s]", *POLICIES),
            tuple(rows),
        )
    )


def plan_errors(found: Replication) -> None:
    """Turns by 90 degrees by a plan that is wrong, by kind and size of the error."""
    rows, curves = [], {}
    road = turn(90)
    right = {name: blind_drives(policy, 170.0, 4.0, road=road) for name, policy in POLICIES.items()}

    def wrong(name: str, kind: str, size: float) -> tuple[float, float]:
        """By a wrong plan; what reads none drives as by the right one."""
        if name == "PD":
            return right[name]
        return blind_drives(POLICIES[name], 170.0, 4.0, road=road, plan_errors={kind: size})

    rows.append(("none", "0", *(cell(one) for one in right.values())))
    for kind, sizes in SIZES.items():
        sized = [0.0, *sizes]
        curves[kind] = {"size": sized, **{name: [one[1]] for name, one in right.items()}}
        for size in sizes:
            cells = []
            for name in POLICIES:
                both = [wrong(name, kind, sign * size) for sign in (-1.0, 1.0)]
                told = float(np.mean([one[0] for one in both])), float(np.mean([one[1] for one in both]))
                cells.append(cell(told))
                curves[kind][name].append(told[1])
            unit = f"± {size:g} m" if kind == "offset" else f"± {100 * size:g} %"
            rows.append((kind, unit, *cells))
    curves["recognised"] = {"size": list(RECOGNISED), **{name: [] for name in POLICIES}}
    for ahead in RECOGNISED:
        told_all = {name: wrong(name, "recognised", ahead) for name in POLICIES}
        for name, one in told_all.items():
            curves["recognised"][name].append(one[1])
        rows.append(("recognised", f"{ahead:g} m ahead", *(cell(one) for one in told_all.values())))
    found.pictures["plan_errors.png"] = plots.plan_errors(curves)
    found.tables.append(
        Table(
            "Turns by 90° at 4 m/s by a plan with errors: mean of the largest error over 32 roads and both signs [m]"
            " (the lane ends at 1.5; look-ahead point 6.5 m ahead of the rear axle; the PD controller reads no plan)",
            ("error of the plan", "size", *POLICIES),
            tuple(rows),
        )
    )
