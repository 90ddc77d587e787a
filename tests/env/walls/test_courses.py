"""Circuits with boxes, parking rows, and what courses judge: against shapely, closed forms and orders of returns."""

import json
import math
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env  # noqa: F401
from lanekeep_env.tasks.parking import judge_parking, share_inside
from lanekeep_env.walls import ObstacleCircuit, ParkingRow, RandomObstacleCircuits, RandomParkingRows, world_from
from lanekeep_env.walls.boxes import box_outline
from lanekeep_env.walls.obstacles import CORNER, SPACING, passage
from lanekeep_env.walls.parking import longest_space

OBSTACLES, PARK = "lanekeep/ObstacleCircuit-v0", "lanekeep/ParallelPark-v0"


def rectangle(x, y, heading, length, width):
    bare = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    return shapely.affinity.translate(shapely.affinity.rotate(bare, heading, (0, 0), use_radians=True), x, y)


def corridor(circuit):
    outer = shapely.box(-circuit.length / 2, -circuit.width / 2, circuit.length / 2, circuit.width / 2)
    inner = outer.buffer(-circuit.corridor, join_style="mitre")
    return outer - inner, inner


def goes_round(circuit, width):
    """Whether a disc of that diameter gets round the circuit."""
    free, inner = corridor(circuit)
    left = (free - shapely.union_all([rectangle(*box) for box in circuit.all_boxes])).buffer(-width / 2)
    parts = getattr(left, "geoms", [left])
    return any(shapely.Polygon(hole).contains(inner) for part in parts for hole in part.interiors)


def drawn(seed, count=12, **settings):
    record, rng = RandomObstacleCircuits(count=count, seed=seed, **settings), np.random.default_rng([seed, 0xB0C5])
    return record, [record._draw(k, rng) for k in range(count)]


@pytest.mark.parametrize("seed", range(3))
def test_random_boxes_leave_the_stated_passage_and_distances(seed):
    record, circuits = drawn(seed)
    counts = set()
    for circuit, world in zip(circuits, record.build(), strict=True):
        free, _ = corridor(circuit)
        boxes = [rectangle(*box) for box in circuit.boxes]
        counts.add(len(boxes))
        width, _ = passage(circuit)
        assert width >= record.passage - 1e-9
        assert goes_round(circuit, width - 1e-3) and not goes_round(circuit, width + 1e-2)
        along = np.array([circuit.length, circuit.width]) / 2 - circuit.corridor
        for k, box in enumerate(boxes):
            assert free.buffer(1e-9).contains(box)
            centre = np.abs(box.centroid.coords[0])
            # In the straight part of a side, whose corners' squares begin at ``along``.
            left, low, right, high = box.bounds
            reach = max(abs(left), abs(right)) if centre[1] > along[1] else max(abs(low), abs(high))
            assert reach <= (along[0] if centre[1] > along[1] else along[1]) - CORNER + 1e-9
            assert all(box.distance(other) >= 1e-3 for other in boxes[:k])
            x, y, _ = world.start[0]
            assert box.distance(shapely.Point(x, y)) > 0.5 * SPACING
        assert world.check() is world and len(world.segments) == 8 + 4 * len(boxes)
    assert min(counts) >= 1 and max(counts) <= record.most


@given(st.integers(0, 10**6), st.booleans())
@settings(max_examples=40, deadline=None)
def test_the_passage_of_any_boxes_is_where_a_disc_still_gets_round(seed, clockwise):
    rng = np.random.default_rng(seed)
    boxes = [
        (rng.uniform(-3.0, 3.0), -rng.uniform(2.2, 3.8), rng.uniform(-1.5, 1.5), rng.uniform(0.1, 0.8), 0.15)
        for _ in range(3)
    ]
    try:
        circuit = ObstacleCircuit(10.0, 8.0, 2.0, clockwise, boxes=boxes)
    except ValueError:
        return
    width, box = passage(circuit)
    assert goes_round(circuit, max(width - 0.01, 0.0)) or width < 0.01
    assert not goes_round(circuit, width + 0.02)
    assert (box == -1) == (width >= 2.0 - 1e-9)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"boxes": [(0.0, -3.5, 0.0, 0.3)]}, ["world.boxes", "length"]),
        ({"boxes": [(3.0, -3.5, 0.0, -0.3, 0.2)]}, ["world.boxes[0].length=-0.3"]),
        ({"boxes": [(3.0, -3.5, 0.0, 0.3, 0.2), (3.1, -3.4, 0.5, 0.3, 0.2)]}, ["world.boxes[1]", "overlaps box 0"]),
        ({"boxes": [(3.0, -5.0, 0.0, 0.3, 0.2)]}, ["world.boxes[0]", "wall"]),
        ({"boxes": [(0.0, 0.0, 0.0, 0.3, 0.2)]}, ["world.boxes[0]", "wall"]),
        ({"boxes": [(0.0, -3.0, 0.0, 0.5, 0.5)]}, ["world.boxes[0]", "start"]),
        ({"boxes": [(3.0, -3.0, 0.0, 0.2, 1.9)]}, ["world.boxes[0]", "blocks", "0.265"]),
        ({"gaps": (3.0, 3.0, 3.0)}, ["world.gaps", "m long"]),
        ({"gaps": (-1.0,)}, ["world.gaps[0]=-1.0"]),
    ],
)
def test_wrong_boxes_are_named(keywords, words):
    with pytest.raises(ValueError) as caught:
        gym.make(OBSTACLES, world={"kind": "obstacle-circuit", **keywords})
    message = str(caught.value)
    assert "\n" not in message and all(word in message for word in words), message


@pytest.mark.parametrize(
    ("world", "words"),
    [
        ({"kind": "parking-row", "gaps": (0.4, 0.5)}, ["world.gaps", "0.5", "0.532"]),
        ({"kind": "parking-row", "gaps": ()}, ["world.gaps"]),
        ({"kind": "parking-row", "gaps": (0.4, 1.0), "width": (0.2, 0.3)}, ["world.width", "3 boxes"]),
        ({"kind": "parking-row", "gaps": (0.4, 1.0), "start_distance": 3.0}, ["world.street"]),
        ({"kind": "random-parking-rows", "longer": (0.5, 0.7)}, ["world.shorter", "longer"]),
        ({"kind": "random-parking-rows", "boxes": (0.6, 0.4)}, ["world.boxes", "low <= high"]),
        ({"kind": "corridor"}, ["no parking space", "modes"]),
    ],
)
def test_wrong_rows_are_named(world, words):
    with pytest.raises(ValueError) as caught:
        gym.make(PARK, world=world)
    message = str(caught.value)
    assert "\n" not in message and all(word in message for word in words), message


def test_rows_have_the_gaps_asked_for_and_the_right_one_behind_shorter_ones():
    row = ParkingRow((0.4, 1.2, 0.7), (0.5, 0.4, 0.6, 0.5), 0.3, (0.02, 0.05, 0.03, 0.08))
    boxes = [rectangle(*box) for box in row.boxes]
    gaps = [b.bounds[0] - a.bounds[2] for a, b in pairwise(boxes)]
    np.testing.assert_allclose(gaps, row.gaps, atol=1e-12)
    assert [round(box.bounds[1], 9) for box in boxes] == [0.02, 0.05, 0.03, 0.08]
    record = RandomParkingRows(count=60, seed=5)
    for world in record.build():
        lengths = world.spaces[:, 3]
        long = lengths >= record.longer[0]
        assert long.sum() == 1 and longest_space(world) == lengths.max() and lengths.max() <= record.longer[1]
        assert (lengths[: int(np.argmax(long))] >= 0.5 * sum(record.shorter) - 1e-9).any()
    for one in (row, record, *drawn(1)[1][:2]):
        assert world_from(json.loads(json.dumps(one.to_dict()))) == one


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_row_in_a_circuit_is_at_the_right_wall_in_the_direction_of_travel(clockwise):
    circuit = ObstacleCircuit(12.0, 8.0, 2.0, clockwise, gaps=(0.6, 1.2))
    (world,) = circuit.build()
    boxes = [rectangle(*box) for box in circuit.all_boxes]
    free, _ = corridor(circuit)
    assert all(free.contains(box) for box in boxes)
    for (x, y, heading, long, deep), gap in zip(world.spaces, circuit.gaps, strict=True):
        assert long == pytest.approx(gap)
        # The corner at the kerb behind the car; ahead and to the left of it is nothing but the space.
        ahead, left = (
            np.array([math.cos(heading), math.sin(heading)]),
            np.array([-math.sin(heading), math.cos(heading)]),
        )
        corners = [(x, y) + u * long * ahead + v * deep * left for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
        space = shapely.Polygon(corners)
        assert free.buffer(1e-9).contains(space)
        assert all(space.intersection(box).area < 1e-9 for box in boxes)
        assert shapely.Point(x, y).distance(free.boundary) < 1e-9
        centre = world.centre_line[np.argmin(np.hypot(*(world.centre_line - corners[0]).T))]
        assert np.dot(centre - corners[0], left) > 0.0  # the road is to the left
    headings = np.diff(world.centre_line, axis=0)
    middles = 0.5 * (world.centre_line[1:] + world.centre_line[:-1])
    beside = np.argmin(np.hypot(*(middles - world.spaces[0, :2]).T))
    assert np.dot(headings[beside], ahead) > 0.0


@given(st.floats(-1.0, 2.0), st.floats(-0.5, 1.0), st.floats(-3.2, 3.2), st.floats(0.3, 2.0), st.floats(0.01, 0.4))
@settings(max_examples=300, deadline=None)
def test_the_share_inside_a_space_is_that_of_areas(ahead, left, turned, long, kerb):
    half_length, half_width = 0.266, 0.1325
    share, distance, inside = share_inside(
        ahead, left, math.cos(turned), math.sin(turned), half_length, half_width, long, kerb
    )
    body = rectangle(ahead, left, turned, 2 * half_length, 2 * half_width)
    around, space = shapely.box(*body.bounds), shapely.box(0.0, 0.0, long, kerb + 2 * half_width)
    assert share == pytest.approx(around.intersection(space).area / around.area, abs=1e-9)
    assert distance == pytest.approx(body.bounds[1], abs=1e-9)
    low, high = body.bounds[0], body.bounds[2]
    if min(abs(low), abs(high - long), abs(body.bounds[1] - kerb)) > 1e-9:
        assert inside == (low >= 0.0 and high <= long and body.bounds[1] <= kerb)


@given(st.integers(1, 400), st.floats(0.0, 0.99), st.floats(0.0, 0.99), st.integers(1, 400))
def test_returns_rank_contact_below_time_out_below_partly_in_below_parked(end, share, more, other):
    horizon = 400

    def total(last, share=0.0, parked=False, touches=False):
        rewards = [
            judge_parking(share, parked and k == last, k, horizon, 1.0, touches and k == last, True, 2.0)
            for k in range(1, last + 1)
        ]
        assert [ended > 0.0 for _, ended in rewards] == [False] * (last - 1) + [parked or touches]
        return sum(reward for reward, _ in rewards)

    contact, parked = total(end, share, touches=True), total(end, parked=True)
    assert contact == pytest.approx(-2.0 * horizon)
    assert contact < total(horizon) <= total(horizon, min(share, more)) <= total(
        horizon, max(share, more)
    ) < parked or (end == horizon and share > 0.98)
    assert (total(other, parked=True) > parked) == (other < end)


def test_modes_follow_each_other_and_a_lap_does_not_end_what_parks_later():
    world = {"kind": "obstacle-circuit", "length": 12.0, "width": 8.0, "gaps": (0.6, 1.2)}
    modes = [(0.0, "roundtrip"), (0.5, "obstacles"), (1.0, "park")]
    env = gym.make(OBSTACLES, world=world, modes=modes, scan="none")
    column = env.unwrapped.scenario.column("mode")
    observation, info = env.reset(seed=0)
    seen = [(0.0, observation[column], info["mode"])]
    for k in range(1, 40):
        observation, _, _, _, info = env.step(np.zeros(2, np.float32))
        seen.append((k * 0.045, observation[column], info["mode"]))
    for time, shown, told in seen:
        assert shown == told == sum(time >= begin - 1e-9 for begin, _ in modes) - 1


@pytest.mark.parametrize(
    ("modes", "words"),
    [
        ("parking", ["modes[0]", "park"]),
        ([(1.0, "park")], ["modes[0]", "first one is 0"]),
        ([(0.0, "park"), (0.0, "roundtrip")], ["modes[1]", "rise"]),
        ([], ["modes"]),
        ([(0.0, "park", 1)], ["modes"]),
    ],
)
def test_wrong_modes_are_named(modes, words):
    with pytest.raises(ValueError) as caught:
        gym.make(PARK, modes=modes)
    assert "\n" not in str(caught.value) and all(word in str(caught.value) for word in words), str(caught.value)


#: A gap as wide as the street, which is driven into forwards: backwards from a start before it there is no way in.
WIDE_GAP = {
    "world": {
        "kind": "parking-row",
        "gaps": (6.0,),
        "width": 0.1,
        "kerb": 0.002,
        "street": 1.0,
        "start_distance": 0.3,
    },
    "scan": "none",
    "steering_offset": 0.0,
    "start_lateral_error": 0.0,
    "start_heading_error": 0.0,
    "kerb_distance": 0.6,
}


def drive_into(env, speed):
    """Drive forwards until 1 m into the space and stand there; yield whether it stands inside, the ends and infos."""
    (space,) = env.unwrapped.world_set()[0].spaces
    _, info = env.reset(seed=0)
    ended = False
    while not ended:
        middle = info["x"]
        inside = space[0] + 0.3 < middle < space[0] + space[3] - 0.3
        go = speed if middle < space[0] + 1.0 else 0.0
        _, _, terminated, truncated, info = env.step(np.array([0.0, go], np.float32))
        ended = terminated or truncated
        yield inside and abs(info["speed"]) < 0.01, terminated, info


def test_a_car_that_stands_in_a_space_for_two_seconds_is_parked():
    env = gym.make(PARK, **WIDE_GAP)
    for speed, wanted in ((0.5, True), (0.0, False)):
        steps = list(drive_into(env, speed))
        _, terminated, info = steps[-1]
        assert (terminated, info["is_success"]) == (wanted, wanted)
        if wanted:
            assert abs(sum(stands for stands, *_ in steps) * 0.045 - 2.0) <= 0.1
            assert info["space_share"] == pytest.approx(1.0)


@pytest.mark.parametrize("last", ["park", "roundtrip"])
def test_what_was_done_in_a_mode_counts_for_none_that_follows(last):
    """The car stands long before the last mode begins: parking begins anew in it, and a round trip is none."""
    begins = 40.0
    env = gym.make(PARK, modes=[(0.0, "park"), (begins, last)], **WIDE_GAP)
    steps = list(drive_into(env, 0.5))
    since = sum(stands for stands, *_ in steps[: int(begins / 0.045)])
    assert since * 0.045 > 10.0
    _, terminated, info = steps[-1]
    assert (terminated, info["is_success"]) == (last == "park", last == "park")
    if last == "park":
        first = math.ceil(begins / 0.045)
        assert len(steps) - first == env.unwrapped.scenario.parking_steps == math.ceil(2.0 / 0.045)


def test_boxes_are_seen_and_touched():
    world = {"kind": "obstacle-circuit", "boxes": [(2.0, -3.0, 0.0, 0.4, 0.4)]}
    env = gym.make(OBSTACLES, world=world, start_lateral_error=0.0, start_heading_error=0.0, steering_offset=0.0)
    observation, info = env.reset(seed=0)
    ahead = box_outline((2.0, -3.0, 0.0, 0.4, 0.4))[:, 0].min() - (0.175 + 0.091)
    front = env.unwrapped.scenario.column("distance_front")
    assert observation[front] == pytest.approx(ahead, abs=1e-6)
    middle = env.unwrapped.scenario.column("scan_0") + 256
    assert observation[middle] == pytest.approx(ahead, abs=1e-3)
    terminated = False
    while not terminated:
        _, _, terminated, _, info = env.step(np.array([0.0, 0.5], np.float32))
    assert info["termination"] == 2 and info["x"] == pytest.approx(ahead, abs=0.06)
