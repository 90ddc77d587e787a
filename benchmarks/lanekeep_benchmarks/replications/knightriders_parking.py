"""Team KnightRiders 2017, chapter 5: how long a gap must be for the report's parking and for those after it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from matplotlib.figure import Figure

import lanekeep_baselines
from lanekeep_baselines.path_planning import shortest_gap
from lanekeep_benchmarks.plots import GRID, colour_of, png
from lanekeep_benchmarks.replications.record import Replication, Row, Table

#: Rows for each length; their seed is no other's.
ROWS, SEED = 24, 20170515
#: Lengths of the gap that is long enough, if any is, m.
GAPS = (0.6, 0.64, 0.68, 0.75, 0.85, 0.9, 0.92, 0.95, 1.0, 1.2, 1.5, 1.8, 2.2)
NOISY: dict[str, Any] = {"sensors": "production", "encoder_ticks": 40}
#: A start along the row, and wheels that go straight: the report's car corrects neither.
EXACT: dict[str, Any] = {"steering_offset": 0.0, "start_heading_error": 0.0, "start_lateral_error": 0.0}
#: What is compared: controller and keywords.
CURVES: dict[str, tuple[str, dict[str, Any]]] = {
    "one sweep": ("knightriders-park", {}),
    "one sweep, noise": ("knightriders-park", NOISY),
    "several moves": ("knightriders-shunt", {}),
    "several moves, noise": ("knightriders-shunt", NOISY),
    "published": ("knightriders-park-published", {}),
    "published, parallel start": ("knightriders-park-published", EXACT),
}
#: The report's car, of assumed size: rear overhang, length and width, m, and its rear axle's turning radius at the
#: assumed steering limit of 22 degrees.
CAR = (0.091, 0.532, 0.265, float(0.35 / np.tan(np.deg2rad(22.0))))


def parked(policy: str, gap: float, rows: int, keywords: dict[str, Any]) -> float:
    """Return the share of random rows, whose longest gap is ``gap`` m, in which a controller parks."""
    world = {"kind": "random-parking-rows", "count": rows, "seed": SEED, "longer": gap, "shorter": (0.1, 0.5)}
    env = gym.make_vec(
        "lanekeep/ParallelPark-v0", rows, vectorization_mode="vector_entry_point", world=world, scan="none", **keywords
    )
    cars: Any = env.unwrapped
    driver = lanekeep_baselines.make(policy, cars.scenario)
    observation, _ = env.reset(seed=SEED, options={"world_index": np.arange(rows)})
    state, over, success = None, np.zeros(rows, dtype=np.bool_), np.zeros(rows, dtype=np.bool_)
    while not over.all():
        action, state = driver.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        success |= terminated & ~over & info["is_success"]
        over |= terminated | truncated
    return float(success.mean())


def parking(found: Replication) -> None:
    """The shortest gap, and how many rows are parked in over its length."""
    needed = shortest_gap(*CAR)
    found.rows.append(Row("shortest gap of one sweep, 22 degrees", "checked", 0.8995, needed, "m", 4))
    shares = {
        label: [100.0 * parked(name, gap, ROWS, keywords) for gap in GAPS] for label, (name, keywords) in CURVES.items()
    }
    rows = tuple((f"{gap:.2f}", *(f"{shares[label][k]:.0f}" for label in CURVES)) for k, gap in enumerate(GAPS))
    headings = ("longest gap [m]", *(f"{label} [%]" for label in CURVES))
    found.tables.append(Table(f"Rows parked in, of {ROWS}", headings, rows))
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for k, (label, values) in enumerate(shares.items()):
        axes.plot(GAPS, values, marker="os^vDX"[k], color=colour_of(k), label=label)
    axes.axvline(needed, color="#606060", linestyle="--", linewidth=1.0)
    axes.annotate("shortest gap\nof one sweep", (needed, 50.0), xytext=(26, 0), textcoords="offset points", ha="left")
    axes.set(xlabel="length of the longest gap [m]", ylabel="parked [%]", ylim=(-4.0, 104.0), xlim=(0.5, None))
    axes.grid(**GRID)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False, fontsize=8)
    found.pictures["parking_gaps.png"] = png(figure)
