"""Contact with walls, by shapely, and what follows from it."""

import math

import numpy as np
import pytest
import shapely
from between_walls import (
    CIRCUIT,
    LENGTH,
    LIMIT,
    OVAL,
    SQUARE_ON,
    STEP,
    WHEELBASE,
    WIDTH,
    body,
    lines,
    make,
    many,
    on_a_circle,
    pose,
)

from lanekeep_env import Termination


def way_between(start, end, speed, steer, pieces=24):
    """Poses on the way of one control step with a constant steering angle."""
    return [on_a_circle(start, speed, steer, STEP * k / pieces) for k in range(pieces)] + [end]


class TestContact:
    @pytest.mark.parametrize("world", [{"kind": "slalom", "gap": 1.2, "spacing": 1.5}, OVAL], ids=["slalom", "oval"])
    def test_no_car_passes_a_wall_at_any_speed_and_none_is_stopped_without_one(self, world):
        """On the way of each step: while the episode goes on no wall is met; where it ends there is one."""
        rng = np.random.default_rng(11)
        ends, passed = 0, 0
        for episode in range(60):
            speed = float(rng.uniform(0.3, 20.0) if episode % 2 else rng.uniform(0.3, 3.0))
            env = make(world=world, speed=speed)
            walls = shapely.union_all(lines(env.unwrapped.world_set()[0]))
            heading = float(rng.uniform(-math.pi, math.pi))
            env.reset(seed=episode, options={"lateral_error": 0.0, "heading_error": heading})
            ended, start = False, pose(env)
            for _ in range(60):
                action = np.float32(rng.uniform(-1, 1))
                steer = float(action) * LIMIT
                _, _, ended, _, info = env.step(np.array([action]))
                poses = way_between(start, pose(env), speed, steer)
                near = min(body(*one).distance(walls) for one in poses)
                if ended:
                    assert info["termination"] == Termination.CONTACT and info["cost"] == 1.0
                    turn = abs(speed * math.tan(steer) / WHEELBASE * STEP)
                    margin = turn * (speed * STEP + turn * math.hypot(LENGTH, WIDTH) / 2) / 8
                    # Near a corner of the hull half as far again, and the poses here are a 24th apart.
                    assert near < 1.5 * margin + 0.005 + speed * STEP / 24
                    break
                assert near > 0.0
                assert info["clearance"] == pytest.approx(body(*pose(env)).distance(walls), abs=1e-7)
                assert info["cost"] == 0.0 and info["is_success"]
                start, passed = pose(env), passed + 1
            ends += ended
        assert ends > 40 and passed > 200

    @pytest.mark.parametrize("contact", ["cost", "off"])
    @pytest.mark.parametrize(
        "steering", [{}, {"lag": 0.05, "delay": 0.02, "rate_limit": 5.0}], ids=["ideal", "lag and delay"]
    )
    @pytest.mark.parametrize("dtype", ["float64", "float32"])
    def test_walls_hold_cars_whatever_they_do(self, contact, steering, dtype):
        cars = 40
        env = many(
            cars,
            CIRCUIT,
            world={"kind": "random-circuits", "count": 4, "glass_share": 0.5, "longest": 9.0, "widest": 1.6},
            contact=contact,
            max_speed=20.0,
            max_acceleration=60.0,
            vehicle={"base": "knightriders", "steering": {"angle_limit": LIMIT, **steering}},
            laps=1000,
            dtype=dtype,
        )
        worlds = env.unwrapped.world_set()
        which = np.arange(cars) % 4
        walls = [shapely.union_all(lines(world)) for world in worlds]
        _, infos = env.reset(seed=3, options={"world_index": which})
        rng = np.random.default_rng(4)
        actions = rng.uniform(-1, 1, (cars, 2))
        touched = moved = 0
        for step in range(150):
            if step % 10 == 0:
                actions = rng.uniform(-1, 1, (cars, 2)) ** 3 / np.array([1.0, 4.0 if step % 20 else 1.0])
            before = np.column_stack([infos["x"], infos["y"]])
            _, _, ended, _, infos = env.step(actions.astype(np.float32))
            assert not ended.any()
            for i in range(cars):
                x, y, heading = pose(env, i)
                assert body(x, y, heading).distance(walls[which[i]]) == pytest.approx(infos["clearance"][i], abs=1e-5)
                assert infos["clearance"][i] > 0.0
                here = shapely.LineString([before[i], (x, y)]) if (before[i] != (x, y)).any() else shapely.Point(x, y)
                if steering == {}:
                    assert not here.intersects(walls[which[i]])
                if contact == "cost" and infos["cost"][i]:
                    assert (x, y) == tuple(before[i]) and infos["speed"][i] == 0.0
                    touched += 1
            moved += (infos["speed"] != 0.0).sum()
        assert moved > 1000
        assert touched > 100 or contact == "off"

    def test_a_car_may_pass_a_wall_a_hand_away(self):
        """Along a corridor 5 mm wider than the car on each side of it, over its whole length."""
        world = {"kind": "corridor", "length": 12.0, "width": 0.5}
        env = make(world=world, speed=2.0, set_distance=0.1375)
        _, info = env.reset(seed=0, options=SQUARE_ON)
        assert info["clearance"] == pytest.approx(0.005, abs=1e-9)
        while info["x"] < 11.5:
            _, _, ended, truncated, info = env.step(np.zeros(1, np.float32))
            assert not ended and not truncated

    def test_the_end_of_a_wall_is_found_by_a_cars_side(self):
        """Turning on the spot nearly: the wall's end comes in between the body's corners."""
        world = {"kind": "slalom", "count": 1, "gap": 1.5, "width": 3.0, "spacing": 3.0}
        env = make(world=world, speed=0.5)
        walls = shapely.union_all(lines(env.unwrapped.world_set()[0]))
        for lateral in np.linspace(0.0, 0.6, 25):
            env.reset(seed=0, options={"lateral_error": float(lateral), "heading_error": 0.0})
            ended = truncated = False
            while not (ended or truncated) and pose(env)[0] < 6.0:
                _, _, ended, truncated, _ = env.step(np.zeros(1, np.float32))
                assert ended == (body(*pose(env)).distance(walls) < 1e-9)
            blocked = 0.0 + 1.0 - 1.5 + lateral + WIDTH / 2 > 0.0  # the wall's lower end is at y = 0
            assert ended == blocked
