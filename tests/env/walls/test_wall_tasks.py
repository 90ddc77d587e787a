"""Rewards and ends of wall following and of circuits; progress and laps, by shapely."""

import math

import numpy as np
import pytest
import shapely
from between_walls import CIRCUIT, LIMIT, OVAL, SQUARE_ON, STEP, WALL, WHEELBASE, WIDE, column, make, many, pose, ring

from lanekeep_env import Termination


class TestRewards:
    def test_following_pays_for_error_and_steering(self):
        env = many(50, world=WIDE, set_distance=1.2, cost_weight=0.7, contact="off")
        observation, infos = env.reset(seed=1)
        rng = np.random.default_rng(3)
        wheel = column(env, "steering_angle")
        for _ in range(60):
            before = observation[:, wheel]
            observation, reward, _, _, infos = env.step(rng.uniform(-1, 1, (50, 1)).astype(np.float32))
            rate = (observation[:, wheel] - before) / STEP
            np.testing.assert_allclose(infos["steering_rate"], rate, atol=1e-4)
            np.testing.assert_allclose(infos["lateral_error"], infos["distance"] - 1.2, atol=1e-12)
            cost = (infos["lateral_error"] / 0.1) ** 2 + 0.7 * (infos["steering_rate"] / 2.0) ** 2
            np.testing.assert_allclose(reward, -np.minimum(cost, 16.0) * STEP, atol=1e-12)

    @pytest.mark.parametrize(("name", "most", "steps"), [(WALL, 16.0, 600), (CIRCUIT, 2.0, 1800)])
    def test_no_drive_without_a_contact_is_worse_than_one(self, name, most, steps):
        """A contact is charged at the largest rate for the rest of the episode, wherever it comes."""
        env = many(60, name, world=OVAL, autoreset_mode="disabled")
        env.reset(seed=5)
        rng = np.random.default_rng(6)
        over = np.zeros(60, dtype=bool)
        returns = np.zeros(60)
        for step in range(1, 400):
            actions = rng.uniform(-1, 1, (60, *env.single_action_space.shape)).astype(np.float32)
            actions[:, 1:] = np.abs(actions[:, 1:])
            _, reward, ended, _, infos = env.step(actions)
            crashed = (infos["termination"] == Termination.CONTACT) & ~over
            np.testing.assert_allclose(reward[crashed], -most * STEP * (steps - step + 1), rtol=1e-12)
            assert (reward[~crashed] >= -most * STEP - 1e-12).all()
            returns += np.where(over, 0.0, reward)
            over |= ended
        assert over.sum() > 50

    def test_a_cost_is_charged_at_each_contact_and_the_drive_goes_on(self):
        env = make(world=OVAL, contact="cost", speed=1.0)
        env.reset(seed=0, options=SQUARE_ON)
        costs = 0
        for _ in range(200):
            _, reward, ended, _, info = env.step(np.ones(1, np.float32))
            assert not ended
            if info["cost"]:
                assert reward == pytest.approx(-16.0 * STEP) and not info["is_success"]
                costs += 1
        assert costs > 0

    def test_a_circuit_pays_for_progress(self):
        env = make(CIRCUIT, world=OVAL, max_speed=3.0, contact="off")
        line = ring(env.unwrapped.world_set()[0])
        _, info = env.reset(seed=0)
        rng = np.random.default_rng(7)
        station = line.project(shapely.Point(info["x"], info["y"]))
        for _ in range(300):
            _, reward, _, _, info = env.step(np.array([rng.uniform(-0.3, 1), rng.uniform(-0.3, 0.5)], np.float32))
            after = line.project(shapely.Point(info["x"], info["y"]))
            progress = (after - station + line.length / 2) % line.length - line.length / 2
            assert info["arc_length"] == pytest.approx(after, abs=1e-9)
            assert reward == pytest.approx(-min(2.0, 1.0 - progress / (3.0 * STEP)) * STEP, abs=1e-9)
            station = after


def pursue(env, line, station, speed, top, ahead=0.5):
    """Pure pursuit on the truth: the action towards a point on the line ``ahead`` m on."""
    x, y, heading = pose(env)
    rear = np.array([x - WHEELBASE / 2 * math.cos(heading), y - WHEELBASE / 2 * math.sin(heading)])
    goal = line.interpolate((station + ahead) % line.length)
    dx, dy = goal.x - rear[0], goal.y - rear[1]
    across = math.cos(heading) * dy - math.sin(heading) * dx
    steer = math.atan2(2 * WHEELBASE * across, dx * dx + dy * dy)
    return np.array([np.clip(steer / LIMIT, -1, 1), speed / top], np.float32)


class TestCircuit:
    @pytest.mark.parametrize("clockwise", [False, True])
    @pytest.mark.parametrize("start", [0, 2])
    def test_laps_are_timed_where_the_progress_crosses_the_line(self, clockwise, start):
        world = {**OVAL, "clockwise": clockwise}
        env = make(CIRCUIT, world=world, laps=2)
        line = ring(env.unwrapped.world_set()[0])
        _, info = env.reset(seed=4, options={"start_index": start})
        station = line.project(shapely.Point(info["x"], info["y"]))
        progress, began, laps, step, ended = 0.0, 0.0, 0, 0, False
        while not ended:
            action = pursue(env, line, station, 1.2 + 0.4 * math.sin(0.3 * step), 2.0)
            _, reward, ended, truncated, info = env.step(action)
            assert not truncated
            after = line.project(shapely.Point(info["x"], info["y"]))
            gain = (after - station + line.length / 2) % line.length - line.length / 2
            if (progress + gain) // line.length > laps:
                now = (step + ((laps + 1) * line.length - progress) / gain) * STEP
                assert info["lap_time"] == pytest.approx(now - began, abs=1e-9)
                began, laps = now, laps + 1
                assert ended == (laps == 2)
            elif laps == 0:
                assert info["lap_time"] == 0.0
            progress, station, step = progress + gain, after, step + 1
        assert info["termination"] == Termination.FINISHED and info["is_success"]
        assert reward > -STEP

    def test_the_line_crossed_back_and_forth_is_one_lap(self):
        env = make(CIRCUIT, world=OVAL, laps=2)
        line = ring(env.unwrapped.world_set()[0])
        _, info = env.reset(seed=4, options=SQUARE_ON)
        while info["lap_time"] == 0.0:
            station = line.project(shapely.Point(info["x"], info["y"]))
            info = env.step(pursue(env, line, station, 1.2, 2.0))[4]
        lap = info["lap_time"]
        for speed in [-1.0] * 30 + [1.0] * 40 + [-1.0] * 40 + [1.0] * 40:
            _, _, ended, _, info = env.step(np.array([0.0, 0.4 * speed], np.float32))
            assert info["lap_time"] == lap and not ended

    @pytest.mark.parametrize("dtype", ["float64", "float32"])
    @pytest.mark.parametrize("world", [{"kind": "corridor", "length": 8.3, "width": 2.0}, {"kind": "ell"}])
    def test_an_open_line_is_done_at_its_end(self, world, dtype):
        env = make(CIRCUIT, world=world, dtype=dtype)
        (built,) = env.unwrapped.world_set()
        line = shapely.LineString(built.centre_line)
        _, info = env.reset(seed=0)
        ended, step = False, 0
        while not ended:
            before = line.project(shapely.Point(info["x"], info["y"]))
            heading = pose(env)[2]
            goal = line.interpolate(min(before + 0.5, line.length))
            aim = math.atan2(goal.y - info["y"], goal.x - info["x"])
            steer = np.clip(2.0 * math.remainder(aim - heading, 2 * math.pi), -1, 1)
            _, _, ended, truncated, info = env.step(np.array([steer, 0.4], np.float32))
            assert not truncated
            step += 1
        assert info["termination"] == Termination.FINISHED
        assert before < line.length and line.project(shapely.Point(info["x"], info["y"])) >= line.length * (1 - 2e-6)
        assert info["lap_time"] == pytest.approx(step * STEP, abs=STEP)

    @pytest.mark.parametrize("speed", [2.0, 20.0])
    def test_progress_is_found_at_any_speed(self, speed):
        """Along the walls at random, held by them: the place on the line is the nearest one all the same."""
        env = many(30, CIRCUIT, world=OVAL, max_speed=speed, max_acceleration=200.0, contact="off", laps=1000)
        line = ring(env.unwrapped.world_set()[0])
        _, infos = env.reset(seed=1)
        rng = np.random.default_rng(2)
        for _ in range(100):
            actions = np.column_stack([rng.uniform(-1, 1, 30), rng.uniform(0.2, 1.0, 30)]).astype(np.float32)
            infos = env.step(actions)[4]
            for x, y, station, lateral in zip(
                infos["x"], infos["y"], infos["arc_length"], infos["lateral_error"], strict=True
            ):
                point = shapely.Point(x, y)
                assert abs(lateral) < line.distance(point) + 1e-6
                assert line.interpolate(station).distance(point) < line.distance(point) + 1e-6

    def test_an_episode_that_only_stands_is_truncated(self):
        env = make(CIRCUIT, episode_steps=40)
        env.reset(seed=0)
        for step in range(1, 41):
            _, reward, ended, truncated, info = env.step(np.zeros(2, np.float32))
            assert reward == pytest.approx(-STEP) and not ended and truncated == (step == 40)
        assert info["termination"] == Termination.NONE and info["lap_time"] == 0.0
