"""Where episodes between walls start: free of walls, as drawn, as asked for."""

import math

import numpy as np
import pytest
import shapely
from between_walls import CIRCUIT, OVAL, SQUARE_ON, STEP, WHEELBASE, WIDE, body, lines, make, many, pose, ring
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats


class TestStart:
    @settings(max_examples=60, deadline=None)
    @given(
        lateral=st.floats(-0.4, 0.4),
        heading=st.floats(-0.39, 0.39),
        shift=st.floats(-0.05, 0.05),
        width=st.sampled_from([2.5, 3.0, 7.0, 30.0]),
    )
    def test_distance_and_heading_are_exactly_as_asked(self, lateral, heading, shift, width):
        to_rear = WHEELBASE / 2 + shift
        vehicle = {"base": "knightriders", "cg_to_rear_axle": to_rear, "cg_to_front_axle": WHEELBASE - to_rear}
        env = make(world={"kind": "corridor", "length": 20.0, "width": width}, vehicle=vehicle)
        _, info = env.reset(seed=0, options={"lateral_error": lateral, "heading_error": heading})
        assert info["lateral_error"] == pytest.approx(lateral, abs=1e-9)
        assert info["heading_error"] == pytest.approx(heading, abs=1e-9)
        assert info["distance"] == pytest.approx(1.0 + lateral, abs=1e-9)
        # The sensor, not the centre of gravity: it stands half the wheelbase ahead of the rear axle.
        sensor = info["y"] + (WHEELBASE / 2 - to_rear) * math.sin(heading)
        assert sensor == pytest.approx(-width / 2 + 1.0 + lateral, abs=1e-9)

    def test_starts_are_drawn_uniformly_within_their_bounds(self):
        env = many(3000, world=WIDE)
        _, infos = env.reset(seed=1)
        assert stats.kstest(infos["lateral_error"], stats.uniform(-0.3, 0.6).cdf).pvalue > 1e-3
        wide = math.radians(20.0)
        assert stats.kstest(infos["heading_error"], stats.uniform(-wide, 2 * wide).cdf).pvalue > 1e-3
        sides = {(round(x / 10), round(y / 10)) for x, y in zip(infos["x"], infos["y"], strict=True)}
        assert len(sides) == 4  # each of the circuit's sides

    def test_no_drawn_start_lies_in_or_beyond_a_wall(self):
        env = many(600, world=OVAL, start_lateral_error=9.0, start_heading_error=math.pi)
        (world,) = env.unwrapped.world_set()
        _, infos = env.reset(seed=3)
        walls = shapely.union_all(lines(world))
        outside, inside = sorted(shapely.polygonize(shapely.get_parts(walls)).geoms, key=lambda one: -one.area)
        for car, (x, y) in enumerate(zip(infos["x"], infos["y"], strict=True)):
            assert outside.contains(shapely.Point(x, y)) and not inside.contains(shapely.Point(x, y))
            assert body(*pose(env, car)).distance(walls) > 0.0
        assert np.ptp(infos["lateral_error"]) > 1.3

    def test_a_circuits_car_starts_at_rest_beside_the_centre_line(self):
        env = many(500, CIRCUIT)
        worlds = env.unwrapped.world_set()
        _, infos = env.reset(seed=2)
        assert not infos["speed"].any() and np.abs(infos["lateral_error"]).max() <= 0.1 + 1e-12
        for i in range(60):
            line = ring(worlds[int(env.unwrapped._core.counters[4, i])])
            off = line.distance(shapely.Point(infos["x"][i], infos["y"][i]))
            assert abs(infos["lateral_error"][i]) == pytest.approx(off, abs=1e-9)

    def test_a_speed_is_drawn_once_an_episode(self):
        env = many(2000, world=WIDE)
        _, infos = env.reset(seed=0)
        assert stats.kstest(infos["speed"], stats.uniform(0.3, 1.7).cdf).pvalue > 1e-3
        np.testing.assert_array_equal(env.step(np.zeros((2000, 1), np.float32))[4]["speed"], infos["speed"])

    def test_set_speeds_in_time_change_with_limited_acceleration(self):
        speed = {"minimum": 0.5, "maximum": 2.0, "hold": 0.9, "standstill": 0.25, "acceleration": 5.0}
        env = many(400, world=WIDE, speed=speed, contact="off")
        _, infos = env.reset(seed=0, options=SQUARE_ON)
        speeds = [infos["speed"]]
        for _ in range(120):
            speeds.append(env.step(np.zeros((400, 1), np.float32))[4]["speed"])
        speeds = np.array(speeds)
        assert np.abs(np.diff(speeds, axis=0)).max() <= 5.0 * STEP + 1e-9
        settled = speeds[20::20]  # a set speed is reached in 0.4 s, and holds 20 steps
        np.testing.assert_allclose(speeds[19:-1:20], settled[:6], atol=1e-9)
        assert (settled == 0.0).mean() == pytest.approx(0.25, abs=0.03)
        moving = settled[settled > 0.0]
        assert stats.kstest(moving, stats.uniform(0.5, 1.5).cdf).pvalue > 1e-3
