"""Segments of a road: crossed forwards, backwards and far beside the centre line."""

import math
from dataclasses import dataclass
from typing import ClassVar

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env.roads import Road
from lanekeep_env.roads.generators import RoadRecord

ID = "lanekeep/LaneKeep-v0"
STRAIGHT_ON = {"steering": {"lag": 0.0}}


@dataclass(frozen=True)
class Jumps(RoadRecord):
    """Arcs whose curvature jumps from one side to the other."""

    kind: ClassVar[str] = "jumps"
    curvature: float = 0.02
    length: float = 7.3

    def build(self):
        curvature = self.curvature * np.where(np.arange(200) % 2, 1.0, -1.0)
        return (Road("jumps", np.full(200, self.length), curvature, curvature),)


@pytest.mark.parametrize("heading", [0.0, math.pi])
@pytest.mark.parametrize("lateral", [0.0, 3.0, -8.0])
def test_a_straight_line_stays_straight_over_jumps_of_curvature(lateral, heading):
    """Without steering the car goes straight in the world, wherever beside the road and whichever way."""
    env = gym.make(
        ID, road=Jumps(), speed=15.0, dynamics="kinematic", departure="off", vehicle=STRAIGHT_ON, control_step=0.01
    )
    road = env.unwrapped.road_set()[0][0]
    station = 300.0 if heading else 3.0
    _, info = env.reset(seed=0, options={"arc_length": station, "lateral_error": lateral, "heading_error": -heading})
    if heading:
        _, info = env.reset(
            seed=0, options={"arc_length": station, "lateral_error": lateral, "heading_error": -math.pi}
        )
    course = float(road.heading(station)) + heading
    start = road.position(station, lateral)
    steer = np.zeros(1, np.float32)
    for n in range(1, 301):
        info = env.step(steer)[4]
        if abs(info["lateral_error"]) > 15.0:
            break
        here = road.position(info["arc_length"], info["lateral_error"])
        there = start + 15.0 * 0.01 * n * np.array([math.cos(course), math.sin(course)])
        assert np.hypot(*(here - there)) < 2e-3
        turned = float(road.heading(info["arc_length"])) + info["heading_error"] - course
        assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=1e-4)
    assert n > 60


def test_no_step_is_longer_than_the_car_is_fast():
    """Also near the centre of a curve, where path coordinates are stretched: |change of d| <= v dt."""
    env = gym.make_vec(
        ID, 256, "vector_entry_point", departure="off", road=Jumps(0.09, 6.0), speed=20.0, vehicle=STRAIGHT_ON
    )
    rng = np.random.default_rng(0)
    for _ in range(20):
        start = {
            "arc_length": rng.uniform(0, 600, 256),
            "lateral_error": rng.uniform(-18, 18, 256),
            "heading_error": rng.uniform(-3, 3, 256),
        }
        _, infos = env.reset(seed=1, options=start)
        for _ in range(30):
            before = infos["lateral_error"].copy()
            infos = env.step(rng.uniform(-1, 1, (256, 1)).astype(np.float32))[4]
            assert np.abs(infos["lateral_error"] - before).max() <= 20.0 * 0.05 * 1.5


def test_what_is_shown_backwards_is_the_road_there():
    """A car that drives backwards sees the curvature of the road where it is."""
    env = gym.make(ID, road="slalom", speed=15.0, departure="off", preview=1, observation="full", vehicle=STRAIGHT_ON)
    road = env.unwrapped.road_set()[0][0]
    observation, info = env.reset(seed=0, options={"arc_length": 500.0, "lateral_error": 0.0, "heading_error": 3.1})
    names = [c.name for c in env.unwrapped.channels]
    for _ in range(80):
        observation, _, _, _, info = env.step(np.zeros(1, np.float32))
        if abs(info["lateral_error"]) > 10.0:
            break
        expected = float(road.curvature(info["arc_length"]))
        for name in ("curvature", "curvature_preview_0"):
            assert observation[names.index(name)] == pytest.approx(expected, abs=2e-5)
    assert info["arc_length"] < 470.0
