"""The arrays behind an environment among traffic: those of cars with pedals, and the others around each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.engine.given_state import row_of
from lanekeep_env.families.road.drive_cars import DriveCars
from lanekeep_env.families.road.traffic_kernel import AMONG_TRAFFIC
from lanekeep_env.families.road.traffic_lead import EVENTS
from lanekeep_env.rendering.road_picture import Pose


class TrafficCars(DriveCars):
    """n cars with pedals, each among its own others."""

    family = AMONG_TRAFFIC
    moving: tuple[str, ...] = (*DriveCars.moving, "traffic", "streets", "timelines")

    def __init__(self, scenario: Any, num_cars: int, *arguments: Any) -> None:
        self.traffic = np.zeros((num_cars, at.T_ROWS, 1 + scenario.flow.cars))
        self.streets = np.zeros((num_cars, at.T_ROAD_SIZE))
        self.timelines = np.full((num_cars, EVENTS, 4), np.inf)
        super().__init__(scenario, num_cars, *arguments)

    def _drive(self) -> tuple[np.ndarray | None, ...]:
        s = self.scenario
        return s.powertrain.numbers(s.integration.step).astype(self.dtype), self.timelines, self.traffic, self.streets

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for a state, of the right shapes, that no car has."""
        super().check_state(state)
        count = self.scenario.flow.cars
        leads = row_of(state["cars"], at.LEAD_NUMBER, self.num_cars)
        if not ((leads >= 0) & (leads <= count)).all():
            raise ValueError(f"state: the car ahead must be one from 0, for none, to {count}")
        ours = [0.0, self.scenario.lanes], [0.0, self.scenario.lane_width]
        if not all(np.isin(state["streets"][:, row], allowed).all() for row, allowed in enumerate(ours)):
            raise ValueError("state: lanes are not those of the scenario")

    def pose(self, column: int) -> Pose:
        """Where the car of a column and the others are, for pictures."""
        pose = super().pose(column)
        block, i = divmod(column, self.cars.shape[2])
        x, y, heading = self.traffic[column, [at.T_X, at.T_Y, at.T_HEADING], 1:]
        others = np.stack([pose.s + x - self.traffic[column, at.T_X, 0], y, heading], axis=1)
        return replace(pose, lead_gap=None, others=others, lane=int(self.cars[block, at.LANE, i]))
