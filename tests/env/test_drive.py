"""Driving with pedals: the powertrain against a second one in plain Python, events, gaps and stops in closed form."""

import dataclasses
import math

import gymnasium as gym
import numpy as np
import pytest
from powertrain_oracle import CAR, TRAIN, G, H, Second

import lanekeep_env  # noqa: F401
from lanekeep_env import Termination
from lanekeep_env import layout as at
from lanekeep_env.scenario.traffic import Traffic

DRIVE = "lanekeep/Drive-v0"


def make(speed=0.0, events=(), **keywords):
    """A car on a flat straight road without wind, one control step a sub-step."""
    keywords = {"road": "straight", "slope": 0.0, "wind": 0.0, "control_step": H, "episode_steps": 10_000, **keywords}
    traffic = keywords.pop("traffic", [(0.0, "speed", speed), *events])
    env = gym.make(DRIVE, traffic=traffic, **keywords)
    env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    return env


def row(env, *rows):
    """Rows of the kernel's only car, in its own precision."""
    values = [float(env.unwrapped._core.cars[0, number, 0]) for number in rows]
    return values if len(values) > 1 else values[0]


def column(env, name):
    return [c.name for c in env.unwrapped.channels].index(name)


def drive(env, pedals):
    """Speed, acceleration and gear after each step, starting with the present ones, (steps + 1, 3)."""
    table = [row(env, at.SPEED, at.PULL, at.GEAR)]
    for pedal in pedals:
        env.step(np.array([0.0, pedal], np.float32))
        table.append(row(env, at.SPEED, at.PULL, at.GEAR))
    return np.array(table)


def random_pedals(seed, steps):
    rng = np.random.default_rng(seed)
    wishes = np.where(rng.random(steps) < 0.55, rng.uniform(0, 1, steps), rng.uniform(-0.4, 0.2, steps))
    return np.float32(np.repeat(wishes, 130)[:steps])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    ("train", "slope", "wind", "speed"),
    [({}, 0.0, 0.0, 0.0), ({}, 0.04, -5.0, 12.0), ({"gears": (3.5, 2.0, 1.2), "pedal_lag": 0.0}, -0.03, 8.0, 9.0)],
)
def test_the_powertrain_meets_a_second_one_in_plain_python(seed, train, slope, wind, speed):
    env = make(speed, powertrain=train, slope=slope, wind=wind)
    second = Second(dataclasses.replace(TRAIN, **train), speed, slope=slope, wind=wind)
    pedals = random_pedals(seed, 2000)
    got = drive(env, pedals)
    for k, pedal in enumerate(pedals):
        assert got[k, 0] == pytest.approx(second.v, abs=1e-3), k
        second.step(float(pedal))
        assert got[k + 1, 2] == second.gear, k
    assert np.ptp(got[:, 0]) > 2.0


def test_coasting_without_engine_is_the_closed_form():
    """dv/dt = -(roll g + c v²): v = sqrt(a/c) tan(atan(v0 sqrt(c/a)) - t sqrt(a c))."""
    still = {"drag_torque": 0.0, "drag_slope": 0.0}
    env = make(30.0, powertrain=still)
    got = drive(env, np.zeros(2000))
    a, c = TRAIN.rolling * G, 0.5 * 1.2 * TRAIN.drag_area / CAR.mass
    t = H * np.arange(2001)
    expected = math.sqrt(a / c) * np.tan(math.atan(30.0 * math.sqrt(c / a)) - t * math.sqrt(a * c))
    # the acceleration of a sub-step is that at its start: first order in 10 ms
    np.testing.assert_allclose(got[:, 0], expected, atol=2e-3)


def test_the_closed_throttle_drags_with_the_engine_only_where_the_converter_does_not_slip():
    for speed, gear in ((30.0, 5), (1.0, 0)):
        env = make(speed)
        assert row(env, at.GEAR) == gear
        drive(env, [0.0])
        ratio = TRAIN.gears[gear] * TRAIN.final_drive / TRAIN.wheel_radius
        air = 0.6 * TRAIN.drag_area * speed**2 / CAR.mass + TRAIN.rolling * G
        drag = (TRAIN.drag_torque + TRAIN.drag_slope * speed * ratio) * ratio * TRAIN.efficiency / CAR.mass
        expected = -air - drag if gear else -air + TRAIN.creep * (1.0 - 1.0 / TRAIN.creep_speed)
        assert row(env, at.PULL) == pytest.approx(expected, rel=1e-9)


def test_full_brake_decelerates_with_its_number_and_the_resistances_until_the_car_stands():
    still = {"drag_torque": 0.0, "drag_slope": 0.0, "pedal_lag": 0.0, "creep": 0.0}
    env = make(20.0, powertrain=still)
    got = drive(env, np.full(400, -1.0))
    moving = got[1:-1, 0] > 0.0
    v = got[:-2, 0][moving]
    expected = 9.0 + TRAIN.rolling * G + 0.6 * TRAIN.drag_area * v**2 / CAR.mass
    np.testing.assert_allclose(-got[1:-1, 1][moving], expected, rtol=1e-9)
    stands = np.flatnonzero(got[:, 0] == 0.0)
    assert len(stands) > 100 and (np.diff(stands) == 1).all() and stands[-1] == 400
    before = env.step(np.array([0.0, -1.0], np.float32))[4]["arc_length"]
    assert env.step(np.array([0.0, -1.0], np.float32))[4]["arc_length"] == before


@pytest.mark.parametrize("circle", [False, True])
@pytest.mark.parametrize(("speed", "pedal", "sign"), [(20.0, -1.0, -1.0), (3.0, -1.0, -1.0), (1.0, 1.0, 1.0)])
def test_tyres_give_engine_and_brake_together_no_more_than_their_friction(speed, pedal, sign, circle):
    """Within the circle anti-lock and traction control leave a part of it."""
    env = make(speed, friction=0.2, slope=0.05, powertrain={"pedal_lag": 0.0}, friction_circle=circle)
    got = drive(env, np.full(60, pedal))
    v = got[:-1, 0]
    others = TRAIN.rolling * G + 0.6 * TRAIN.drag_area * v**2 / CAR.mass + G * math.sin(0.05)
    np.testing.assert_allclose(got[1:, 1], sign * (0.95 if circle else 1.0) * 0.2 * G - others, rtol=1e-9)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_car_that_rolls_out_stands_still_in_the_end(dtype):
    for speed in np.linspace(0.3, 0.4, 9):
        env = make(speed, powertrain={"creep": 0.0, "rolling": 0.003}, dtype=dtype)
        got = drive(env, np.zeros(2000))
        np.testing.assert_array_equal(got[-400:, :2], 0.0)


def test_released_pedals_creep_at_the_speed_where_pull_and_resistance_are_equal():
    c = 0.6 * TRAIN.drag_area / CAR.mass
    for start, creep_speed in ((0.0, 2.0), (2.0, 2.0), (0.0, 1.2)):
        # creep (1 - v/v_c) = roll g + c v²
        b, rest = TRAIN.creep / creep_speed, TRAIN.creep - TRAIN.rolling * G
        expected = (-b + math.sqrt(b * b + 4 * c * rest)) / (2 * c)
        got = drive(
            make(start, powertrain={"creep_speed": creep_speed, "drag_torque": 0.0, "drag_slope": 0.0}), [0] * 4000
        )
        assert got[-1, 0] == pytest.approx(expected, abs=1e-4)
        # with the engine's drag no faster than the converter slips
        got = drive(make(start, powertrain={"creep_speed": creep_speed}), [0] * 4000)
        slips = TRAIN.idle_speed * TRAIN.wheel_radius / (TRAIN.gears[0] * TRAIN.final_drive)
        assert got[-1, 0] == pytest.approx(min(expected, slips), abs=0.01)


@pytest.mark.parametrize("slope", [-0.2, -0.05, 0.05, 0.2, 0.3])
def test_the_brake_holds_a_standing_car_on_a_slope_and_it_never_rolls_backwards(slope):
    env = make(0.0, slope=slope)
    drive(env, np.full(200, -1.0))  # downhill it rolls until the brake has come
    held = drive(env, np.full(300, -1.0))
    np.testing.assert_array_equal(held[:, 0], 0.0)
    released = drive(env, np.zeros(1000))
    assert (released[:, 0] >= 0.0).all()
    resisting = TRAIN.rolling * G + G * math.sin(slope)
    assert (released[-1, 0] > 0.1) == (TRAIN.creep > resisting)


def test_gears_change_in_order_not_before_the_hold_time_and_without_torque_in_between():
    env = make(0.0)
    got = drive(env, np.ones(4000))
    gears = got[:, 2]
    changes = np.flatnonzero(np.diff(gears)) + 1
    np.testing.assert_array_equal(gears[changes], np.arange(1, len(changes) + 1))
    assert len(changes) >= 3
    assert np.diff(changes).min() >= 50
    for k in changes:
        v = got[k - 1 : k + 4, 0]
        coasting = -(TRAIN.rolling * G + 0.6 * TRAIN.drag_area * v**2 / CAR.mass)
        np.testing.assert_allclose(got[k : k + 5, 1], coasting, rtol=1e-9)
        assert got[k - 1, 1] > 0.3 and got[k + 5, 1] >= TRAIN.reserve - 0.02
        ratio = TRAIN.gears[int(gears[k - 1])] * TRAIN.final_drive / TRAIN.wheel_radius
        assert got[k - 1, 0] * ratio == pytest.approx(TRAIN.upshift_full, rel=0.02)


def test_slowing_down_shifts_down_in_order_to_the_first():
    got = drive(make(30.0), np.full(3000, -0.15))
    gears = got[:, 2]
    changes = np.flatnonzero(np.diff(gears)) + 1
    np.testing.assert_array_equal(gears[changes], np.arange(4, -1, -1))
    assert np.diff(changes).min() >= 80


@pytest.mark.parametrize("throttle", np.linspace(0.0, 1.0, 11))
def test_after_a_change_up_the_same_force_does_not_ask_for_the_gear_below(throttle):
    """At a tenth less speed even: the car slows down while the torque is interrupted."""
    beyond = max(throttle - TRAIN.part_throttle, 0.0) / (1.0 - TRAIN.part_throttle)
    after = 0.9 * (TRAIN.upshift + (TRAIN.upshift_full - TRAIN.upshift) * beyond)  # in the gear below
    for below, above in zip(TRAIN.gears[:-1], TRAIN.gears[1:], strict=True):
        needed = min(throttle * below / above, 1.0)
        assert after > TRAIN.downshift + TRAIN.downshift_throttle * needed
    assert throttle < 1.0 or after > TRAIN.kick_down


@pytest.mark.parametrize("start", [3.0, 15.0, 30.0])
def test_the_gearbox_does_not_hunt_at_a_constant_pedal(start):
    for pedal in np.linspace(0.0, 1.0, 21):
        changes = np.diff(drive(make(start), np.full(6000, pedal))[:, 2])
        ways = changes[changes != 0.0]
        assert np.count_nonzero(np.diff(ways)) <= 1, pedal  # down once and up from there, or the other way round


def test_the_pedal_is_throttle_or_brake_and_follows_with_its_lag():
    env = make(20.0)
    for pedal, number, other in ((0.6, at.THROTTLE, at.BRAKE), (-0.8, at.BRAKE, at.THROTTLE)):
        begin = np.array(row(env, number, other))
        for k in range(1, 51):
            env.step(np.array([0.0, pedal], np.float32))
            rest = math.exp(-k * H / 0.1)
            mine, others = row(env, number, other)
            assert mine == pytest.approx(abs(pedal) + (begin[0] - abs(pedal)) * rest, abs=1e-6)
            assert others == pytest.approx(begin[1] * rest, abs=1e-6)


def test_an_episode_starts_in_steady_turning_at_the_first_set_speed():
    for speed in (0.0, 8.0, 25.0):
        env = gym.make(DRIVE, road={"kind": "circle", "radius": 200.0}, traffic=[(0, "speed", speed)])
        observation, info = env.reset(seed=3, options={"lateral_error": 0.0})
        assert info["speed"] == speed
        assert observation[column(env, "yaw_rate")] == pytest.approx(speed / 200.0, abs=1e-7)
        assert info["lateral_acceleration"] == pytest.approx(speed**2 / 200.0, abs=1e-9)
        assert observation[column(env, "set_speed")] == speed
        if speed == 0.0:
            assert observation[column(env, "steering_angle")] == pytest.approx(CAR.wheelbase / 200.0, abs=1e-6)


TIMELINE = [(1.0, "speed", 10.0), (2.0, "lead", 35.0, 7.5), (3.0, "lead_gone"), (4.0, "stop", 30.0), (5.5, "stop_gone")]


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("dt", [0.01, 0.02, 0.05])
def test_events_happen_at_their_time(dt, dtype):
    env = make(6.0, TIMELINE, control_step=dt, dtype=dtype)
    names = ("set_speed", "lead_gap", "lead_speed", "stop_gap")
    where = [column(env, name) for name in names]
    gap = stop = 200.0
    v = row(env, at.SPEED)
    for k in range(round(7.0 / dt)):
        # an event at t acts on the step from t on
        for time, kind, *numbers in TIMELINE:
            if abs(time - k * dt) < 1e-9:
                gap = {"lead": numbers[:1], "lead_gone": [200.0]}.get(kind, [gap])[0]
                stop = {"stop": numbers, "stop_gone": [200.0]}.get(kind, [stop])[0]
        observation = env.step(np.zeros(2, np.float32))[0]
        after = row(env, at.SPEED)
        way, v = 0.5 * (v + after) * dt, after
        gap = gap + 7.5 * dt - way if gap < 200.0 else gap
        stop = stop - way if stop < 200.0 else stop
        t = k * dt + 1e-9
        expected = [10.0 if t >= 1.0 else 6.0, gap, 7.5 if 2.0 <= t < 3.0 else 0.0, stop]
        np.testing.assert_allclose(observation[where], expected, atol=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_gaps_are_the_integral_of_the_speed_difference(seed):
    """Speed is linear in a sub-step, so that the trapezoidal rule is exact."""
    env = make(8.0, [(0.0, "lead", 60.0, 9.0), (0.0, "stop", 100.0)])
    speeds, gaps, stops = [8.0], [60.0], [100.0]
    for pedal in random_pedals(seed, 1200) * 0.5:
        env.step(np.array([0.0, pedal], np.float32))
        speed, gap, stop = row(env, at.SPEED, at.LEAD_GAP, at.STOP_GAP)
        if gap <= 0.0 or gap > 199.0:
            break
        speeds.append(speed), gaps.append(gap), stops.append(stop)
    assert len(speeds) > 300
    way = np.concatenate([[0.0], np.cumsum(0.5 * H * (np.array(speeds)[1:] + np.array(speeds)[:-1]))])
    np.testing.assert_allclose(gaps, 60.0 + 9.0 * H * np.arange(len(gaps)) - way, atol=1e-6)
    np.testing.assert_allclose(stops, 100.0 - way, atol=1e-6)
    info = env.step(np.zeros(2, np.float32))[4]
    assert info["arc_length"] > 0.0


def test_driving_over_the_stop_point_goes_on_counting_where_nothing_ends_an_episode():
    env = make(10.0, [(0.0, "stop", 5.0)], departure="cost")
    drive(env, np.zeros(150))
    assert -15.0 < row(env, at.STOP_GAP) < 0.0
    assert not row(env, at.DONE)


@pytest.mark.parametrize("steps", [400, 3000])
def test_meeting_the_car_ahead_ends_the_episode_and_costs_the_cap_for_the_rest(steps):
    events = [(0, "speed", 15.0), (0, "lead", 10.0, 5.0)]
    for dtype in ("float64", "float32"):
        env = make(traffic=events, control_step=0.02, episode_steps=steps, dtype=dtype)
        count, terminated = 0, False
        while not terminated and count < 400:
            observation, reward, terminated, truncated, info = env.step(np.array([0.0, 0.3], np.float32))
            count += 1
        assert terminated and not truncated
        assert 45 <= count <= 55  # 10 m at 10 m/s
        assert reward == pytest.approx(-16.0 * 0.02 * (steps - count + 1), rel=1e-6)
        assert observation[column(env, "lead_gap")] == 0.0
        assert info["termination"] == Termination.CONTACT and not info["is_success"]


def test_with_departure_as_cost_meeting_goes_on_and_costs_the_cap_a_step():
    env = make(traffic=[(0, "speed", 15.0), (0, "lead", 5.0, 5.0)], control_step=0.02, departure="cost")
    rewards = [env.step(np.array([0.0, 0.3], np.float32))[1:3] for _ in range(100)]
    assert not any(terminated for _, terminated in rewards)
    assert all(reward == pytest.approx(-16.0 * 0.02) for reward, _ in rewards[60:])


def wanted(set_speed, gap, stop):
    speeds = [set_speed]
    if gap < 200.0:
        speeds.append(max((gap - 4.0) / 1.5, 0.0))
    if stop < 200.0:
        speeds.append(math.sqrt(2 * 1.7 * max(stop, 0.0)))
    return min(speeds)


def test_the_reward_charges_the_squared_error_of_the_wanted_speed():
    events = [(1.0, "lead", 30.0, 8.0), (4.0, "lead_gone"), (5.0, "stop", 40.0)]
    env = make(10.0, events, control_step=0.02)
    for k in range(400):
        _, reward, _, _, info = env.step(np.array([0.0, 0.2], np.float32))
        gap, stop, v = row(env, at.LEAD_GAP, at.STOP_GAP, at.SPEED)
        cost = (info["lateral_error"] / 0.5) ** 2 + ((v - wanted(10.0, gap, stop)) / 2.0) ** 2
        assert reward == pytest.approx(-min(cost, 16.0) * 0.02, abs=1e-9), k


def follow(v, gap, lead, stop, set_speed):
    """Acceleration of a driver who never brakes harder than 3 m/s²."""
    a = np.clip((set_speed - v) / 0.5, -3.0, 1.5)
    closing = np.maximum(v - lead, 0.0)
    needed = closing**2 / (2 * np.maximum(gap - 2.0, 0.01))
    a = np.where((gap < 200.0) & ((needed > 2.0) | (gap < 4.0 + 0.5 * v)), np.where(closing > 0, -3.0, 0.0), a)
    needed = v**2 / (2 * np.maximum(stop - 1.0, 0.01))
    return np.where((stop < 200.0) & (needed > 2.0), -3.0, a)


@pytest.mark.parametrize("largest", [5.0, 20.0, 30.0])
def test_random_timelines_can_be_driven_with_three_metres_per_second_squared(largest):
    """No lead car is met and every stop point is reached standing; the same rules in plain NumPy, no engine."""
    table = Traffic(count=300, largest_speed=largest, seed=3).build()
    n = len(table)
    v, event = table[:, 0, at.E_FIRST].copy(), np.zeros(n, int)
    gap, lead, stop, wish = np.full(n, 200.0), np.zeros(n), np.full(n, 200.0), v.copy()
    goal, rate = np.zeros(n), np.zeros(n)
    for k in range(6000):
        for i in np.flatnonzero(table[np.arange(n), np.minimum(event, table.shape[1] - 1), 0] <= k * H):
            while event[i] < table.shape[1] and table[i, event[i], 0] <= k * H:
                kind, first, second = table[i, event[i], 1:]
                if kind == at.SPEED_EVENT:
                    wish[i] = first
                elif kind in (at.LEAD_EVENT, at.LEAD_GONE):
                    gap[i], lead[i] = (first, second) if kind == at.LEAD_EVENT else (200.0, 0.0)
                    goal[i] = lead[i]
                elif kind == at.LEAD_SPEED_EVENT:
                    goal[i], rate[i] = first, second
                else:
                    stop[i] = first if kind == at.STOP_EVENT else 200.0
                event[i] += 1
        after = np.maximum(v + follow(v, gap, lead, stop, wish) * H, 0.0)
        way, v = 0.5 * (v + after) * H, after
        ahead = lead + np.clip(goal - lead, -rate * H, rate * H)
        gap, lead = np.where(gap < 200.0, np.minimum(gap + 0.5 * (lead + ahead) * H - way, 199.0), gap), ahead
        stop = np.where(stop < 200.0, stop - way, stop)
        assert gap.min() > 0.0, k
        assert (v[stop < 0.0] < 0.5).all(), k


def test_random_timelines_rise_in_time_and_stay_within_their_numbers():
    table = Traffic(count=200, largest_speed=25.0, duration=45.0).build()
    assert table.shape[0] == 200
    for timeline in table:
        used = timeline[np.isfinite(timeline[:, 0])]
        assert used[0, 0] == 0.0 and used[0, 1] == at.SPEED_EVENT and (np.diff(used[:, 0]) > 0).all()
        speeds = used[used[:, 1] == at.SPEED_EVENT, 2]
        assert (speeds >= 0.2 * 25.0).all() and (speeds <= 25.0).all()
        kinds = used[:, 1].tolist()
        for here, after in zip(kinds, [*kinds[1:], None], strict=True):  # what comes also goes
            if here == at.LEAD_EVENT:
                assert after == at.LEAD_SPEED_EVENT
            if here == at.LEAD_SPEED_EVENT:
                assert after == at.LEAD_GONE
            if here == at.STOP_EVENT:
                assert after == at.STOP_GONE
    np.testing.assert_array_equal(table, Traffic(count=200, largest_speed=25.0, duration=45.0).build())
    assert not np.array_equal(table[0, 0], Traffic(seed=1, largest_speed=25.0).build()[0, 0])


def test_slope_and_wind_are_drawn_within_their_bounds():
    env = gym.make_vec(DRIVE, 2000, "vector_entry_point", slope=(-0.1, 0.05), wind=(2.0, 6.0))
    env.reset(seed=0)
    cars = env.unwrapped._core.cars
    for number, low, high in ((at.SLOPE, math.sin(-0.1), math.sin(0.05)), (at.WIND, 2.0, 6.0)):
        values = np.concatenate([block[number] for block in cars])[:2000]
        assert values.min() >= low and values.max() <= high
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.03 * (high - low))
        assert np.ptp(values) > 0.99 * (high - low)
    used = np.unique(env.unwrapped._core.counters[at.TIMELINE])
    assert len(used) > 250 and used.max() <= 255


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"traffic": [(0, "speed", 5), (3, "lead", 30, 5), (2, "lead_gone")]}, ["traffic.events", "rise"]),
        ({"traffic": [(0, "speed", 5), (3, "laed", 30, 5)]}, ["traffic.events", "laed", "lead"]),
        ({"traffic": [(0, "speed", 5), (3, "lead", 30)]}, ["traffic.events", "lead", "2 numbers"]),
        ({"traffic": [(0, "speed", 5), (3, "lead_gone", 1)]}, ["traffic.events", "lead_gone", "0 numbers"]),
        ({"traffic": [(1, "speed", 5)]}, ["traffic.events", "begin"]),
        ({"traffic": [(0, "stop", 5)]}, ["traffic.events", "begin"]),
        ({"traffic": [(0, "speed", -6)]}, ["traffic.events speed=-6", ">= -5"]),
        ({"traffic": [(0, "speed", math.nan)]}, ["traffic.events speed", "nan"]),
        ({"traffic": [(0, "speed", 150)]}, ["traffic.events speed=150", "<= 100.0 m/s"]),
        ({"traffic": [(0, "speed", 5), (1, "lead", 200, 5)]}, ["traffic.events lead=200", "<= 199.0 m"]),
        ({"traffic": [(0, "speed", 5), (1, "lead", 30, 101)]}, ["traffic.events lead=101", "<= 100.0 m/s"]),
        ({"traffic": [(0, "speed", 5), (1, "stop", 200)]}, ["traffic.events stop=200", "<= 199.0 m"]),
        ({"traffic": [3]}, ["traffic.events", "3"]),
        ({"traffic": {"events": 5}}, ["traffic.events=5", "list"]),
        ({"traffic": "rush hour"}, ["traffic=", "rush hour"]),
        ({"traffic": {"largest_speed": 31.0}}, ["traffic.largest_speed=31.0", "<= 30"]),
        ({"powertrain": {"gears": (2.0, 3.0)}}, ["powertrain.gears", "fall"]),
        ({"powertrain": {"gears": ("low", 2.0)}}, ["powertrain.gears", "low"]),
        ({"powertrain": {"gears": ()}}, ["powertrain.gears", "1 to 8"]),
        ({"powertrain": {"gears": (3.0, 0.0)}}, ["powertrain.gears", ">= "]),
        ({"powertrain": {"hold_time": 0.01}}, ["powertrain.hold_time=0.01", "0.05"]),
        ({"powertrain": {"settle_time": 0.1}}, ["powertrain.settle_time=0.1", "0.5"]),
        ({"powertrain": {"efficiency": 1.1}}, ["powertrain.efficiency=1.1", "<= 1"]),
        ({"powertrain": {"downshift": 150.0}}, ["powertrain.downshift=150.0", "<= 145"]),
        ({"powertrain": {"upshift": 700.0}}, ["powertrain.upshift=700.0", "<= 628"]),
        ({"powertrain": {"kick_down": 700.0}}, ["powertrain.kick_down=700.0", "<= 628"]),
        ({"traffic": [(0, "speed", 5), (1, "lead_speed", 5)]}, ["traffic.events", "lead_speed", "2 numbers"]),
        ({"traffic": [(0, "speed", 5), (1, "lead_speed", 5, 21)]}, ["traffic.events lead_speed=21", "<= 20.0 m/s²"]),
        ({"traffic": {"hazards": 1.5}}, ["traffic.hazards=1.5", "<= 1"]),
        ({"powertrain": {"brakes": 3.0}}, ["brakes", "brake"]),
        ({"powertrain": "tesla"}, ["powertrain='tesla'", "passat"]),
        ({"slope": 0.5}, ["slope=0.5", "0.3"]),
        ({"wind": (5.0, -5.0)}, ["wind=", "low <= high"]),
        ({"reference_speed_error": 0.0}, ["reference_speed_error=0.0", ">= "]),
        ({"tyre": "linear"}, ["tyre='linear'", "magic_formula"]),
    ],
)
def test_wrong_settings_are_named_in_one_line(keywords, words):
    with pytest.raises((ValueError, TypeError)) as caught:
        gym.make(DRIVE, **keywords)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in words), str(caught.value)
