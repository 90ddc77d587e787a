"""Lane keeping support, a use case that Yin 2010 names without a figure: how often, how hard, how smoothly."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_benchmarks.replications import yin_plots as plots
from lanekeep_benchmarks.replications.passat import Floats
from lanekeep_benchmarks.replications.record import Replication, Table

CARS, STEPS = 256, 1200


def supported(driver: str, assisted: bool, sensors: str | None = None) -> dict[str, Floats]:
    """Drive 256 episodes of a minute; return errors (m), the driver's angle, and what was added (rad), (steps, cars).

    Beside them whether each car left its lane, and how often the assistant intervened, (cars,).
    """
    env: Any = gym.make_vec(
        "lanekeep/LaneSupport-v0",
        CARS,
        "vector_entry_point",
        driver=driver,
        sensors=sensors,
        departure="cost",
        episode_steps=STEPS,
        autoreset_mode="disabled",
    ).unwrapped
    policy = lanekeep_baselines.make("lane-support", env.scenario)
    observation, _ = env.reset(seed=0)
    place = env.scenario.column("driver_steering")
    state, left, rows = None, np.zeros(CARS, dtype=bool), []
    for _ in range(STEPS):
        angle = observation[:, place]
        action, state = policy.predict(observation, state)
        observation, _, _, _, info = env.step(action if assisted else np.zeros_like(action))
        left |= np.asarray(info["cost"]) > 0.0
        rows.append((np.array(info["lateral_error"]), angle, np.array(info["assistance"])))
    env.close()
    error, asked, added = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    return {
        "error": error,
        "driver": asked,
        "added": added,
        "left": left,
        "interventions": np.array(info["interventions"]),
    }


def support(found: Replication) -> None:
    """With an attentive and a drowsy driver, without and with the assistant."""
    rows, minutes = [], CARS * STEPS * 0.05 / 60.0
    for driver in ("attentive", "drowsy"):
        for assisted, sensors in ((False, None), (True, None), (True, "production")):
            run = supported(driver, assisted, sensors)
            added, change = np.degrees(np.abs(run["added"])), np.degrees(np.abs(np.diff(run["added"], axis=0)))
            busy = added > 0.0
            rows.append(
                (
                    driver,
                    f"lane-support, {sensors or 'perfect'} sensors" if assisted else "none",
                    f"{100.0 * run['left'].mean():.1f}",
                    f"{run['interventions'].sum() / minutes:.2f}",
                    f"{100.0 * busy.mean():.1f}",
                    f"{added[busy].mean() if busy.any() else 0.0:.2f}",
                    f"{added.max():.2f}",
                    f"{change.max():.2f}",
                )
            )
            if driver == "drowsy" and assisted and sensors is None:
                shown = int(np.argmax(run["interventions"]))
                found.pictures["lane_keeping_support.png"] = plots.support(
                    0.05 * np.arange(STEPS, dtype=np.float64),
                    *(run[name][:, shown] for name in ("error", "driver", "added")),
                )
    found.tables.append(
        Table(
            "Lane keeping support: 256 minutes on motorway roads, angles at the road wheel",
            (
                "driver",
                "assistant",
                "left the lane [% of the episodes]",
                "interventions a minute",
                "share of the time [%]",
                "added while it intervenes, mean [°]",
                "largest [°]",
                "largest change in a control step [°]",
            ),
            tuple(rows),
        )
    )
