"""Laps of rectangular circuits by `knightriders-circuit`, and what its reader of scans sees."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.scan_features import ScanReader, median
from lanekeep_env import CircuitScenario, WallFollowScenario
from lanekeep_env.scenario.scan import SCANS

pytestmark = pytest.mark.long

NAME = "knightriders-circuit"
#: In front of a camera, m: a corridor between -1 and 1.2, its wall ahead, and an opening on one side before that.
RIGHT, LEFT, AHEAD = 1.0, 1.2, 5.0


def drive(circuits: int = 100, seed: int = 2017, **keywords: Any) -> SimpleNamespace:
    """Drive a lap of every circuit of a set: contacts, lap times over that of the centre line at the largest speed."""
    world = {"kind": "random-circuits", "seed": seed, "count": circuits}
    env = gym.make_vec("lanekeep/Circuit-v0", circuits, "vector_entry_point", world=world, **keywords)
    scenario = env.unwrapped.scenario
    policy = lanekeep_baselines.make(NAME, scenario)
    ideal = np.array([one.stations[-1] for one in env.unwrapped.world_set()]) / scenario.max_speed
    observation, info = env.reset(seed=seed, options={"world_index": np.arange(circuits)})
    over, contact = np.zeros(circuits, dtype=bool), np.zeros(circuits, dtype=bool)
    ratio, clearance, state, seen = np.full(circuits, np.inf), np.full(circuits, np.inf), None, []
    while not over.all():
        seen.append(observation)
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(np.clip(action, -1.0, 1.0))
        ends = (terminated | truncated) & ~over
        contact |= ends & (info["cost"] > 0.0)
        ratio = np.where(ends & terminated & (info["cost"] == 0.0), info["lap_time"] / ideal, ratio)
        clearance = np.where(over, clearance, np.minimum(clearance, info["clearance"]))
        over |= ends
    env.close()
    return SimpleNamespace(contact=contact, ratio=ratio, clearance=clearance, seen=seen, policy=policy)


@pytest.fixture(scope="module", params=[30, pytest.param(100, marks=pytest.mark.slow)])
def laps(request: pytest.FixtureRequest) -> SimpleNamespace:
    """Many circuits, perfect sensors, steering offsets of a degree to either side."""
    return drive(request.param)


def test_many_circuits_without_contact_and_fast(laps: SimpleNamespace) -> None:
    assert not laps.contact.any()
    assert laps.clearance.min() > 0.1
    assert laps.ratio.mean() < 1.05 and laps.ratio.max() < 1.2


@pytest.mark.parametrize("cars", [30, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("faults", "failures"),
    [
        ({"sensors": "production"}, 1),
        ({"scan": "kinect"}, 1),
        ({"sensors": "production", "scan": "kinect"}, 1),
        ({"sensors": "poor"}, 2),
        ({"encoder_ticks": 40}, 1),
        ({"dynamics": "dynamic", "sensors": "production"}, 1),
        ({"action": "steering_rate"}, 1),
    ],
)
def test_failures_of_a_hundred_with_faults(cars: int, faults: dict[str, Any], failures: int) -> None:
    run = drive(cars, **faults)
    finished = np.isfinite(run.ratio)
    assert (~finished).sum() <= failures * cars // 100
    assert run.ratio[finished].mean() < 1.05


def test_a_faster_car_brakes_for_corners() -> None:
    run = drive(40, max_speed=3.0)
    assert np.isfinite(run.ratio).sum() >= 39
    assert 1.0 < run.ratio[np.isfinite(run.ratio)].mean() < 1.35


def test_rows_do_not_know_of_each_other(laps: SimpleNamespace) -> None:
    together = alone = part = None
    for observation in laps.seen[:150]:
        action, together = laps.policy.predict(observation, together)
        one, alone = laps.policy.predict(observation[17], alone)
        some, part = laps.policy.predict(observation[20:27], part)
        assert action.shape == (len(observation), 2) and action.dtype == np.float32 and one.shape == (2,)
        assert one.tobytes() == action[17].tobytes() and some.tobytes() == action[20:27].tobytes()
        assert alone.tobytes() == together[17].tobytes() and part.tobytes() == together[20:27].tobytes()


def test_pure_and_fresh_rows_forget(laps: SimpleNamespace) -> None:
    policy, state = laps.policy, None
    for observation in laps.seen[:60]:
        _, state = policy.predict(observation, state)
    seen = laps.seen[60].copy()
    for array in (seen, state):
        array.setflags(write=False)
    action, following = policy.predict(seen, state)
    policy.predict(laps.seen[5], following)
    again, following_again = policy.predict(seen, state)
    assert action.tobytes() == again.tobytes() and following.tobytes() == following_again.tobytes()
    assert np.isfinite(following).all()
    starts = np.arange(len(seen)) % 3 == 0
    mixed, mixed_state = policy.predict(seen, state, starts)
    new, new_state = policy.predict(seen)
    np.testing.assert_array_equal(mixed, np.where(starts[:, None], new, action))
    np.testing.assert_array_equal(mixed_state, np.where(starts[:, None], new_state, following))


def test_it_says_what_it_needs() -> None:
    assert NAME in lanekeep_baselines.names(CircuitScenario())
    assert NAME not in lanekeep_baselines.names(WallFollowScenario())
    with pytest.raises(ValueError, match=r"needs the channel 'scan_0'"):
        lanekeep_baselines.make(NAME, CircuitScenario(scan="none"))
    with pytest.raises(ValueError, match=r"gives 2 number\(s\) an action, the scenario asks for 1"):
        lanekeep_baselines.make(NAME, WallFollowScenario(scan="perfect"))


def ranges(scan: str, heading: float, corner: float, side: float) -> np.ndarray:
    """Ranges (beams, 1) in a corridor whose wall on one ``side`` ends ``corner`` m ahead; no noise."""
    record = SCANS[scan]
    angle = np.arange(record.beams) * record.step - 0.5 * record.field_of_view + heading
    wall = np.where(angle > 0.0, LEFT, RIGHT)
    stop = wall / np.maximum(np.abs(np.tan(angle)), 1e-9)
    passes = (np.sign(angle) == side) & (stop >= corner)
    return (np.where(passes, AHEAD, np.minimum(stop, AHEAD)) / np.cos(angle))[:, None]


@pytest.mark.parametrize("scan", ["perfect", "kinect"])
@pytest.mark.parametrize("heading", [-0.1, 0.0, 0.15])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_reader_finds_the_end_of_a_wall(scan: str, heading: float, side: float) -> None:
    reader, corner = ScanReader(SCANS[scan]), 2.6
    shown = ranges(scan, heading, corner, side)
    if scan == "kinect":
        shown[19::20] = 0.0
        shown[:4] = shown[-4:] = 0.0
    read, turned = reader.ranges(shown), np.array([heading])
    assert reader.ahead(read, turned)[0] == pytest.approx(AHEAD, abs=0.02)
    distance = np.array([LEFT if side > 0.0 else RIGHT])
    end = reader.wall_end(read, turned, distance, side)
    assert end.seen[0] and end.near[0] - 0.05 <= corner <= end.far[0] + 0.05
    assert end.far[0] - end.near[0] < 0.5
    other = reader.wall_end(read, turned, np.array([LEFT + RIGHT]) - distance, -side)
    assert not other.seen[0]
    assert not end.about(np.array([corner + 1.5]), 0.5).seen[0]


def test_no_beam_no_wall() -> None:
    for scan in ("perfect", "kinect"):
        reader, none = ScanReader(SCANS[scan]), np.zeros((SCANS[scan].beams, 3))
        read = reader.ranges(none)
        assert np.isinf(read).all() and np.isinf(reader.ahead(read, np.zeros(3))).all()
        assert not reader.wall_end(read, np.zeros(3), np.ones(3), 1.0).seen.any()


def test_median_leaves_out_what_is_unknown() -> None:
    values = np.array([[3.0, np.inf], [1.0, np.inf], [np.inf, np.inf], [2.0, np.inf]])
    np.testing.assert_array_equal(median(values), [2.0, math.inf])
