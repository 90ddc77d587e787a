"""Policies without training: records for a scenario, and tensors for a record."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lanekeep_agents.policy_record import InputChannel, Network, Normalisation, PolicyRecord, Training


def _record(scenario: Any, hidden: tuple[int, ...] = (8, 8), **changes: Any) -> PolicyRecord:
    """A record of a policy that was trained on ``scenario``, an environment's of lane keeping unless told."""
    values: dict[str, Any] = dict(
        name="ppo-test",
        algorithm="PPO",
        env_id="lanekeep/LaneKeep-v0",
        scenario=scenario.to_dict(),
        scenario_hash=scenario.hash,
        channels=[InputChannel(c.name, c.unit, c.description) for c in scenario.channels],
        actions=scenario.num_actions,
        action=scenario.action,
        max_steering_angle=scenario.max_steering_angle,
        max_steering_rate=scenario.max_steering_rate,
        control_step=scenario.control_step,
        network=Network(hidden, "relu", False),
        normalisation=Normalisation(),
        training=Training("lanekeep train", {"gamma": 0.98}, 0, 1000, 1.5, {"torch": "2"}, {"return": -1.0}),
    )
    return PolicyRecord(**{**values, **changes})


def _tensors(record: PolicyRecord, seed: int = 0) -> dict[str, np.ndarray]:
    """Random tensors that keep the size of what they pass on."""
    rng = np.random.default_rng(seed)
    tensors = {
        name: (rng.normal(size=shape) / np.sqrt(shape[-1])).astype(np.float32) for name, shape in record.shapes.items()
    }
    tensors["variance"] = np.square(tensors["variance"]) + np.float32(0.1)
    return tensors


@pytest.fixture(scope="session")
def make_record():
    return _record


@pytest.fixture(scope="session")
def make_tensors():
    return _tensors
