"""`lanekeep/LaneKeep-v0`, many cars in one compiled step."""

from __future__ import annotations

import numpy as np

from lanekeep_env.envs.vector import ManyEnvs
from lanekeep_env.families.road.cars import RoadLanes
from lanekeep_env.rendering.road_picture import RoadPicture
from lanekeep_env.roads import Road
from lanekeep_env.scenario import LaneKeepScenario, RoadScenario


class LaneKeepVectorEnv(ManyEnvs):
    """Vector form of `LaneKeepEnv`; arguments are those of `ManyEnvs` and `LaneKeepScenario`."""

    scenario_class: type[RoadScenario] = LaneKeepScenario
    lanes_class = RoadLanes
    picture_class = RoadPicture

    def road_set(self) -> tuple[tuple[Road, np.ndarray], ...]:
        """The roads an episode is drawn from, each with its node speeds in m/s."""
        return self._core.road_set()
