"""A car between walls against closed forms in world coordinates, and its encoder."""

import math

import numpy as np
import pytest
from between_walls import CIRCUIT, LIMIT, SQUARE_ON, STEP, WHEELBASE, WIDE, apart, column, make, many, on_a_circle, pose
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats


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
