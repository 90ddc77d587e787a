"""A car between walls: closed forms in world coordinates, shapely for contact and progress, the rules of the tasks."""

import math

import gymnasium as gym
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from shapely.affinity import rotate, translate

import lanekeep_env  # noqa: F401
from lanekeep_env import Termination

WALL, CIRCUIT = "lanekeep/WallFollow-v0", "lanekeep/Circuit-v0"
STEP, LIMIT, WHEELBASE = 0.045, math.radians(22.0), 0.35
WIDE = {"kind": "circuit", "length": 80.0, "width": 80.0, "corridor": 20.0}
OVAL = {"kind": "circuit", "length": 10.0, "width": 7.0, "corridor": 2.0}
LENGTH, WIDTH = 0.532, 0.265
SQUARE_ON = {"lateral_error": 0.0, "heading_error": 0.0, "start_index": 0}


def make(name=WALL, **keywords):
    return gym.make(name, **{"steering_offset": 0.0, "world": WIDE, **keywords})


def many(cars, name=WALL, **keywords):
    return gym.make_vec(name, cars, "vector_entry_point", **{"steering_offset": 0.0, **keywords})


def column(env, name):
    return [channel.name for channel in env.unwrapped.channels].index(name)


def pose(env, car=0):
    """x, y (m), heading (rad) of the centre of gravity."""
    found = env.unwrapped._core.pose(car)
    return np.array([found.x, found.y, found.heading])


def body(x, y, heading):
    """The car's body; the middle of the knightriders' is its centre of gravity."""
    outline = shapely.box(-LENGTH / 2, -WIDTH / 2, LENGTH / 2, WIDTH / 2)
    return translate(rotate(outline, heading, origin=(0, 0), use_radians=True), x, y)


def lines(world):
    return shapely.linestrings(world.segments.reshape(-1, 2, 2))


def on_a_circle(start, speed, steer, seconds, wheelbase=WHEELBASE, to_rear=WHEELBASE / 2):
    """Pose of the centre of gravity: the rear axle turns on the radius wheelbase/tan(steer)."""
    x, y, heading = start
    x, y = x - to_rear * math.cos(heading), y - to_rear * math.sin(heading)
    turn = speed * math.tan(steer) / wheelbase * seconds
    angle, middle = heading + turn, heading + turn / 2
    chord = speed * seconds * float(np.sinc(turn / 2 / math.pi))  # 2 radius sin(turn/2)
    x, y = x + chord * math.cos(middle), y + chord * math.sin(middle)
    return np.array([x + to_rear * math.cos(angle), y + to_rear * math.sin(angle), angle])


def apart(one, other):
    """Largest difference of two poses; headings by their directions."""
    turn = math.remainder(one[2] - other[2], 2 * math.pi)
    return max(abs(one[0] - other[0]), abs(one[1] - other[1]), abs(turn))


class TestVehicle:
    @settings(max_examples=40, deadline=None)
    @given(
        action=st.floats(-1.0, 1.0, width=32),
        speed=st.floats(0.1, 4.0),
        offset=st.floats(-0.1, 0.1),
        heading=st.floats(-3.0, 3.0),
        shift=st.floats(-0.05, 0.05),
    )
    def test_the_rear_axle_turns_on_the_radius_of_wheelbase_and_steering(self, action, speed, offset, heading, shift):
        to_rear = WHEELBASE / 2 + shift
        vehicle = {"base": "knightriders", "cg_to_rear_axle": to_rear, "cg_to_front_axle": WHEELBASE - to_rear}
        env = make(speed=speed, steering_offset=offset, vehicle=vehicle, set_distance=5.0)
        env.reset(seed=0, options={**SQUARE_ON, "heading_error": heading})
        start = pose(env)
        for k in range(1, 30):
            observation, _, _, _, info = env.step(np.array([action], np.float32))
            expected = on_a_circle(start, speed, action * LIMIT + offset, k * STEP, to_rear=to_rear)
            assert apart(pose(env), expected) < 1e-7
            assert (info["x"], info["y"]) == tuple(pose(env)[:2])
            steer = action * LIMIT + offset
            assert observation[column(env, "yaw_rate")] == pytest.approx(speed * math.tan(steer) / WHEELBASE, rel=1e-5)
            acceleration = speed**2 * math.tan(steer) / WHEELBASE
            assert info["lateral_acceleration"] == pytest.approx(acceleration, rel=1e-9, abs=1e-12)

    @pytest.mark.parametrize("action", [-1.0, 0.3])
    def test_the_dynamic_car_meets_the_kinematic_one_at_low_speed(self, action):
        steer = 0.2 * action * LIMIT
        kinematic, dynamic = (make(speed=0.3, dynamics=kind) for kind in ("kinematic", "dynamic"))
        for env in (kinematic, dynamic):
            env.reset(seed=0, options=SQUARE_ON)
        for _ in range(100):
            info = [env.step(np.array([0.2 * action], np.float32))[4] for env in (kinematic, dynamic)]
        # The sideslip of the slip-speed floor, m delta/(l (C_f + C_r)), and tan(delta) against delta.
        rates = [env.unwrapped._core.pose(0).heading for env in (kinematic, dynamic)]
        assert rates[1] == pytest.approx(rates[0], rel=0.02 + steer**2 / 3)
        way = 100 * STEP * 0.3
        gap = math.hypot(info[0]["x"] - info[1]["x"], info[0]["y"] - info[1]["y"])
        assert gap < way * (5.0 * abs(steer) / (WHEELBASE * 250.0) + 0.01)

    def test_the_dynamic_car_slips_outwards_at_speed(self):
        """Steady turning of the linear single track: r = v delta/(l + K v²), K from the axles' loads and stiffness."""
        env = make(speed=2.0, dynamics="dynamic")
        env.reset(seed=0, options=SQUARE_ON)
        action = 0.3
        for _ in range(60):
            observation = env.step(np.array([action], np.float32))[0]
        understeer = 2.5 / 120.0 - 2.5 / 130.0
        expected = 2.0 * action * LIMIT / (WHEELBASE + understeer * 4.0)
        assert observation[column(env, "yaw_rate")] == pytest.approx(expected, rel=1e-4)

    @pytest.mark.parametrize(
        ("servo", "expected"),
        [
            (None, lambda a: a * LIMIT),
            ({"left": 0.35, "right": 0.25}, lambda a: a * (0.35 if a > 0 else 0.25)),
            ({"left": 0.3}, lambda a: a * (0.3 if a > 0 else LIMIT)),
            ({"ticks": 50}, lambda a: math.floor(50 * a + 0.5) / 50 * LIMIT),
            (
                {"angles": (-0.38, -0.2, -0.04, 0.1, 0.3)},
                lambda a: float(np.interp(a, np.linspace(-1, 1, 5), (-0.38, -0.2, -0.04, 0.1, 0.3))),
            ),
            (
                {"angles": (-0.3, 0.01, 0.4), "ticks": 4},
                lambda a: float(np.interp(math.floor(4 * a + 0.5) / 4, [-1, 0, 1], (-0.3, 0.01, 0.4))),
            ),
        ],
    )
    def test_the_servo_maps_commands_to_angles(self, servo, expected):
        env = make(servo=servo, steering_offset=0.02, speed=0.3, contact="off")
        observation, _ = env.reset(seed=0, options=SQUARE_ON)
        wheel, command = column(env, "steering_angle"), column(env, "steering_command")
        assert observation[wheel] == pytest.approx(expected(0.0) + 0.02, abs=1e-7)
        for action in np.concatenate([np.linspace(-1, 1, 37), [0.013, -0.987, 1.0]]).astype(np.float32):
            observation = env.step(np.array([action]))[0]
            assert observation[wheel] == pytest.approx(expected(float(action)) + 0.02, abs=1e-6)
            assert observation[command] == pytest.approx(float(action) * LIMIT, abs=1e-6)

    def test_a_rate_action_moves_the_command(self):
        env = make(action="steering_rate", max_steering_rate=2.0, speed=0.3)
        env.reset(seed=0, options=SQUARE_ON)
        command = 0.0
        for action in np.random.default_rng(0).uniform(-1, 1, 80).astype(np.float32):
            command = float(np.clip(command + 2.0 * action * STEP, -LIMIT, LIMIT))
            observation = env.step(np.array([action]))[0]
            assert observation[column(env, "steering_angle")] == pytest.approx(command, abs=1e-6)

    def test_the_steering_offset_is_drawn_once_an_episode_and_hidden(self):
        bounds = (-0.04, 0.02)
        env = many(2000, observation="full", steering_offset=bounds)
        offset = column(env, "steering_offset")
        first = env.reset(seed=0)[0]
        assert stats.kstest(first[:, offset], stats.uniform(-0.04, 0.06).cdf).pvalue > 1e-3
        np.testing.assert_allclose(first[:, column(env, "steering_angle")], first[:, offset], atol=1e-7)
        second = env.step(np.zeros((2000, 1), np.float32))[0]
        np.testing.assert_array_equal(second[:, offset], first[:, offset])
        assert "steering_offset" not in [channel.name for channel in make().unwrapped.channels]

    def test_speed_actions_ramp_and_the_kinematic_car_reverses(self):
        env = make(CIRCUIT, max_speed=1.5, max_acceleration=2.5)
        env.reset(seed=0, options=SQUARE_ON)
        start, speed, way = pose(env), 0.0, 0.0
        for action in [1.0] * 20 + [-1.0] * 60 + [0.4] * 30:
            target = float(np.float32(action)) * 1.5
            ramp = min(STEP, abs(target - speed) / 2.5)
            after = speed + math.copysign(2.5 * ramp, target - speed)
            way += 0.5 * (speed + after) * ramp + after * (STEP - ramp)
            speed = after
            observation, _, _, _, info = env.step(np.array([0.0, action], np.float32))
            assert info["speed"] == pytest.approx(speed, abs=1e-9)
            assert observation[column(env, "speed")] == pytest.approx(speed, abs=1e-6)
            assert observation[column(env, "speed_command")] == pytest.approx(target, abs=1e-6)
            # Exact but for the sub-step in which a ramp ends: less than a twelfth of its gain of speed.
            assert (pose(env)[:2] - start[:2]) @ [math.cos(start[2]), math.sin(start[2])] == pytest.approx(
                way, abs=1e-4
            )
        assert way < 0.0

    def test_the_dynamic_car_brakes_to_a_stop_and_does_not_go_backwards(self):
        env = make(CIRCUIT, dynamics="dynamic")
        env.reset(seed=0, options=SQUARE_ON)
        speeds = [env.step(np.array([0.2, action], np.float32))[4]["speed"] for action in [1.0] * 20 + [-1.0] * 60]
        assert max(speeds) > 1.5 and min(speeds) == 0.0 and speeds[-1] == 0.0
        assert env.unwrapped.clipped_actions == 0


def driven(actions, max_speed, max_acceleration):
    """Way after each control step, m, of set speeds reached by ramps."""
    speed, ways = 0.0, [0.0]
    for action in actions:
        target = action * max_speed
        ramp = min(STEP, abs(target - speed) / max_acceleration)
        after = speed + math.copysign(max_acceleration * ramp, target - speed)
        ways.append(ways[-1] + 0.5 * (speed + after) * ramp + after * (STEP - ramp))
        speed = after
    return np.array(ways)


class TestEncoder:
    @pytest.mark.parametrize("dtype", ["float64", "float32"])
    @pytest.mark.parametrize("ticks", [8, 40])
    def test_its_speeds_add_up_to_the_way_to_one_tick(self, dtype, ticks):
        """Forwards and backwards, with ramps that end inside control steps."""
        env = make(CIRCUIT, encoder_ticks=ticks, dtype=dtype, world=WIDE)
        env.reset(seed=0, options=SQUARE_ON)
        actions = np.random.default_rng(1).uniform(-1, 1, 900).astype(np.float32)
        ways = driven(actions.tolist(), 2.0, 2.0)
        tick = 2 * math.pi * 0.033 / ticks
        counted = 0.0
        for action, way in zip(actions, ways[1:], strict=True):
            observation, _, ended, _, _ = env.step(np.array([0.0, action], np.float32))
            assert not ended
            step = observation[column(env, "speed")] * STEP / tick
            assert step == pytest.approx(round(step), abs=1e-4)
            counted += step * tick
            assert abs(counted - way) < 1.05 * tick
        assert np.ptp(ways) > 20 * tick

    @pytest.mark.parametrize("dtype", ["float64", "float32"])
    def test_nothing_is_lost_on_a_long_way(self, dtype):
        world = {"kind": "corridor", "length": 1000.0, "width": 2.5}
        speed = 1.2345
        env = make(encoder_ticks=40, dtype=dtype, speed=speed, world=world)
        env.reset(seed=0, options=SQUARE_ON)
        where, tick = column(env, "speed"), 2 * math.pi * 0.033 / 40
        counted = sum(float(env.step(np.zeros(1, np.float32))[0][where]) for _ in range(8000)) * STEP
        # Rounding of the way on one turn of the counter, a step: 1e-7 of some metres.
        assert counted == pytest.approx(8000 * STEP * speed, abs=(1.01 if dtype == "float64" else 2.5) * tick)

    def test_the_hall_sensor_does_not_know_the_sign(self):
        signed, hall = (make(CIRCUIT, encoder_ticks=8, encoder_direction=known) for known in (True, False))
        for env in (signed, hall):
            env.reset(seed=0, options=SQUARE_ON)
        seen = []
        for action in np.random.default_rng(2).uniform(-1, 1, 200).astype(np.float32):
            a, b = (env.step(np.array([0.0, action]))[0][column(env, "speed")] for env in (signed, hall))
            assert b == abs(a)
            seen.append(a)
        assert min(seen) < 0.0 < max(seen)


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


def ring(world):
    """The closed centre line as shapely knows it."""
    return shapely.LineString(np.concatenate([world.centre_line, world.centre_line[:1]]))


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
