"""In highway-env's tasks: its lane follower beside itself."""

import numpy as np
import pytest
from highway_env.road.lane import CircularLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.controller import ControlledVehicle

import lanekeep_baselines
from lanekeep_env.adapters.highway import HighwayScenario, look
from lanekeep_env.scenario import LaneKeepScenario


@pytest.mark.parametrize("clockwise", (True, False))
def test_the_lane_follower_is_theirs(clockwise):
    """On a bend, where the heading 0.1 s ahead is exact: the same angle, to the other side."""
    network = RoadNetwork()
    end = 2.0 if clockwise else -2.0
    network.add_lane("a", "b", CircularLane([0.0, 0.0], 60.0, 0.0, end, clockwise=clockwise))
    policy = lanekeep_baselines.make("highway-built-in", HighwayScenario(preview=3))
    rng, index = np.random.default_rng(0), ("a", "b", 0)
    for _ in range(300):
        lane, s, speed = network.get_lane(index), rng.uniform(10.0, 100.0), rng.uniform(0.5, 30.0)
        place, heading = lane.position(s, rng.uniform(-4.0, 4.0)), lane.heading_at(s) + rng.uniform(-1.5, 1.5)
        road = Road(network=network, np_random=rng)
        vehicle = ControlledVehicle(road, place, heading, speed, target_lane_index=index)
        wanted = vehicle.steering_control(index)

        class World:
            road = vehicle.road

        seen = {name: np.array([value]) for name, value in look(World, vehicle, 3, 0.1, index).items()}
        (angle,), _ = policy.command(seen, np.zeros((1, 0)), True)
        assert angle == pytest.approx(-wanted, abs=1e-7)


def test_they_are_for_their_tasks_alone():
    own = {name for name in lanekeep_baselines.names() if name.startswith("highway-")}
    assert own == {"highway-built-in", "highway-p", "highway-zero"}
    assert own <= set(lanekeep_baselines.names(HighwayScenario()))
    assert not own & set(lanekeep_baselines.names(LaneKeepScenario(preview=12)))
    with pytest.raises(ValueError, match="'highway-p' is not for LaneKeepScenario, which has no 'env'"):
        lanekeep_baselines.make("highway-p", LaneKeepScenario())


@pytest.mark.parametrize("name", ("highway-built-in", "highway-p", "highway-zero"))
def test_rows_do_not_know_of_each_other_and_left_and_right_are_alike(name):
    scenario = HighwayScenario(preview=3)
    policy, rng = lanekeep_baselines.make(name, scenario), np.random.default_rng(1)
    spread = [{"lateral_error": 3.0, "heading_error": 1.0}.get(c.name, 0.05) for c in scenario.channels]
    rows = (rng.normal(size=(1000, len(spread))) * spread).astype(np.float32)
    column = [c.name for c in scenario.channels].index("speed")
    rows[:, column] = rng.uniform(0.0, 40.0, 1000)
    actions, state = policy.predict(rows)
    assert state is None and actions.shape == (1000, 1) and actions.dtype == np.float32
    for i in (0, 1, 7, 500, 998, 999):
        assert policy.predict(rows[i])[0].tobytes() == actions[i].tobytes()
    mirrored = -rows
    mirrored[:, column] *= -1.0
    np.testing.assert_array_equal(policy.predict(mirrored)[0], -actions)
