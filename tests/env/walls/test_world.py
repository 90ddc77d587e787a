"""Walled worlds: checks, geometry, and every generator."""

import json
import math

import numpy as np
import pytest
import shapely
import shapely.affinity

from lanekeep_env.walls import Circuit, Corridor, Ell, RandomCircuits, Slalom, World, pack, world_from

ROOM = np.array([(0, 0, 4, 0), (4, 0, 4, 3), (4, 3, 0, 3), (0, 3, 0, 0)], dtype=float)
RECORDS = [
    Corridor(),
    Corridor(3, 0.5, glass_share=1.0),
    Ell(),
    Ell(turn="right", glass_share=0.25),
    Slalom(),
    Slalom(count=1, glass_share=0.5),
    Circuit(),
    Circuit(6, 6, 1.2, clockwise=True, glass_share=0.3, seed=4),
    RandomCircuits(count=50, glass_share=0.2, seed=3),
    RandomCircuits(count=20, shortest=3.0, longest=20.0),
]


def room(**changes):
    fields = {"name": "room", "segments": ROOM, "glass": np.zeros(4, bool), "start": [(1.0, 1.0, 0.0)]}
    return World(**{**fields, **changes})


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"segments": ROOM[:, :3]}, r"segments has shape \(4, 3\), allowed is \(n, 4\)"),
        ({"segments": ROOM * np.nan}, "segments holds a value that is not finite"),
        ({"segments": ROOM * 0}, "wall 0 has no length"),
        ({"glass": [True]}, r"glass has shape \(1,\), allowed is \(4,\)"),
        ({"start": []}, r"start has shape \(0,\)"),
        ({"start": [(np.inf, 0, 0)]}, "start holds"),
        ({"centre_line": [(0, 0)]}, "centre_line has 1 point"),
        ({"centre_line": [(0, 0)] * 9}, "the points of centre_line are all the same"),
    ],
)
def test_faulty_worlds_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        room(**changes)


def test_arrays_are_frozen_copies():
    segments = ROOM.copy()
    world = room(segments=segments)
    segments[0, 0] = 99.0
    assert world.segments[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        world.segments[0, 0] = 1.0


def test_a_start_near_a_wall_or_in_open_walls_is_refused():
    assert room().check() is not None
    with pytest.raises(ValueError, match=r"the start \(0.100, 1.000\) m is 0.100 m from a wall; allowed are >= 0.2 m"):
        room(start=[(0.1, 1.0, 0.0)]).check()
    with pytest.raises(ValueError, match=r"walls are open: from \(1.000, 1.000\) m one sees out towards -?[\d.]+ rad"):
        room(segments=ROOM[:3], glass=np.zeros(3, bool)).check()
    with pytest.raises(ValueError, match="walls are open"):
        room(start=[(9.0, 9.0, 0.0)]).check()
    with pytest.raises(ValueError, match=r"open: from \(6.000"):
        room(centre_line=[(1, 1), (6, 1)]).check()


def test_the_way_out_is_a_gap_of_any_width():
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = int(rng.integers(3, 12))
        # A convex room: all walls are seen, whatever their direction and order.
        angles = 2 * np.pi * (np.arange(n) + rng.uniform(0.0, 0.4, n)) / n
        points = 5 * np.column_stack([np.cos(angles), np.sin(angles)])
        walls = np.hstack([points, np.roll(points, -1, axis=0)])[rng.permutation(n)]
        flip = rng.random(n) < 0.5
        walls[flip] = walls[flip][:, [2, 3, 0, 1]]
        x, y = rng.uniform(-0.8, 0.8, 2)
        world = room(segments=walls, glass=np.zeros(n, bool))
        assert world.way_out(x, y) is None
        gap = 10 ** rng.uniform(-6, -1)
        walls[0, 2:] += gap * (walls[0, :2] - walls[0, 2:])
        heading = room(segments=walls, glass=np.zeros(n, bool)).way_out(x, y)
        assert heading is not None
        ray = shapely.LineString([(x, y), (x + 30 * math.cos(heading), y + 30 * math.sin(heading))])
        assert not shapely.intersects(ray, shapely.linestrings(walls.reshape(-1, 2, 2))).any()


def test_distance_is_shapelys():
    rng = np.random.default_rng(1)
    walls = rng.uniform(-5, 5, (20, 4))
    world = room(segments=walls, glass=np.zeros(20, bool))
    for x, y in rng.uniform(-6, 6, (50, 2)):
        expected = shapely.distance(shapely.Point(x, y), shapely.linestrings(walls.reshape(-1, 2, 2))).min()
        assert world.distance(x, y) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.kind)
def test_generated_worlds_are_sound(record):
    worlds = record.build()
    for world in worlds:
        world.check(0.2)
        line = shapely.LinearRing(world.centre_line) if world.closed else shapely.LineString(world.centre_line)
        walls = shapely.linestrings(world.segments.reshape(-1, 2, 2))
        # The car is 0.2 m wide: its middle keeps off the walls all along.
        assert shapely.distance(line, walls).min() > 0.2
        assert world.length == pytest.approx(line.length)
        x, y, heading = world.start[0]
        assert tuple(world.centre_line[0]) == (x, y)
        ahead = world.centre_line[1] - world.centre_line[0]
        assert math.remainder(math.atan2(ahead[1], ahead[0]) - heading, 2 * math.pi) == pytest.approx(0.0, abs=0.06)
        share = np.hypot(*(world.segments[:, 2:] - world.segments[:, :2]).T)
        assert share[world.glass].sum() / share.sum() == pytest.approx(record.glass_share, abs=1e-5)
    again = world_from(json.loads(json.dumps(record.to_dict())))
    assert again == record and again.fingerprint() == record.fingerprint()
    assert np.array_equal(again.build()[-1].segments, worlds[-1].segments)


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_circuit_is_followed_by_its_right_wall(clockwise):
    world = Circuit(10, 8, 2.0, clockwise=clockwise).build()[0]
    assert world.bounds == (-5.0, -4.0, 5.0, 4.0)
    ring = shapely.LinearRing(world.centre_line)
    assert ring.is_ccw != clockwise
    inner = shapely.LinearRing(world.segments[4:, :2])
    outer = shapely.LinearRing(world.segments[:4, :2])
    for x, y, heading in world.start:
        right = shapely.LineString([(x, y), (x + 1.5 * math.sin(heading), y - 1.5 * math.cos(heading))])
        assert right.intersects(inner if clockwise else outer)
        assert not right.intersects(outer if clockwise else inner)
        assert ring.distance(shapely.Point(x, y)) < 1e-12


def test_random_circuits_stay_in_their_bounds_and_go_both_ways():
    worlds = RandomCircuits(count=200, seed=5).build()
    sizes = np.array([world.bounds for world in worlds])[:, 2:] * 2
    inner = np.array([world.segments[4:].max(axis=0)[:2] for world in worlds]) * 2
    corridor = (sizes - inner) / 2
    assert np.allclose(corridor[:, 0], corridor[:, 1])
    assert sizes.min() >= 6.0 and sizes.max() <= 20.0 and np.ptp(sizes) > 12.0
    assert corridor.min() >= 1.2 and corridor.max() <= 3.0 and np.ptp(corridor) > 1.5
    assert sum(shapely.LinearRing(world.centre_line).is_ccw for world in worlds) == 100
    other = RandomCircuits(count=200, seed=6).build()
    assert not np.allclose(worlds[0].segments, other[0].segments)


def test_packed_walls_are_opaque_first():
    worlds = [Corridor(glass_share=0.5).build()[0], Circuit().build()[0]]
    walls, ranges = pack(worlds, np.float32)
    assert walls.dtype == np.float32 and walls.flags.c_contiguous and walls.shape == (4, ranges[-1, 2])
    for world, (first, glass, end) in zip(worlds, ranges, strict=True):
        assert np.allclose(walls[:, first:glass].T, world.segments[~world.glass])
        assert np.allclose(walls[:, glass:end].T, world.segments[world.glass])


@pytest.mark.parametrize(
    "value, words",
    [
        ("circut", r"world='circut' is unknown \(did you mean 'circuit'\?\)"),
        ({"length": 3}, "lacks 'kind'"),
        ({"kind": "circuit", "lenght": 3}, r"no field 'lenght' \(did you mean 'length'\?\)"),
        (3, "must be a name, a mapping"),
        ("map", "'map' is unknown"),
        (
            {"kind": "circuit", "length": 4.0},
            r"world.length=4.0 is not allowed: it must be a finite number >= 4.5 and <= 10000.0 m",
        ),
        ({"kind": "circuit", "clockwise": 1}, "world.clockwise=1 is not allowed"),
        ({"kind": "circuit", "glass_share": 1.5}, r"world.glass_share=1.5 is not allowed: .*<= 1.0"),
        ({"kind": "corridor", "width": -1}, "world.width=-1 is not allowed: .* m"),
        ({"kind": "ell", "turn": "lft"}, r"world.turn='lft' is unknown \(did you mean 'left'\?\)"),
        ({"kind": "ell", "first": 3}, "world.first=3 is not allowed"),
        ({"kind": "slalom", "gap": 3.0}, "world.gap=3.0 is not allowed"),
        ({"kind": "random-circuits", "widest": 1.0}, "world.narrowest=1.2 and world.widest=1.0 are not"),
        ({"kind": "random-circuits", "count": 0}, "world.count=0 is not allowed"),
    ],
)
def test_faulty_settings_are_named(value, words):
    with pytest.raises(ValueError, match=words) as error:
        world_from(value)
    assert "\n" not in str(error.value)


def test_worlds_by_name_and_record():
    assert world_from("circuit") == Circuit()
    assert world_from(Ell()) == Ell()
    assert world_from({"kind": "corridor", "length": np.float32(5)}) == Corridor(5.0)


def test_bodies_that_touch_walls_are_shapelys():
    rng = np.random.default_rng(8)
    found = []
    for _ in range(400):
        walls = rng.uniform(-3, 3, (5, 4))
        world = World("any", walls, np.zeros(5, bool), np.zeros((1, 3)))
        x, y, heading, length, width = *rng.uniform(-3, 3, 2), rng.uniform(-4, 4), *rng.uniform(0.1, 1.5, 2)
        box = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
        box = shapely.affinity.translate(shapely.affinity.rotate(box, heading, (0, 0), use_radians=True), x, y)
        touched = bool(shapely.intersects(box, shapely.linestrings(walls.reshape(-1, 2, 2))).any())
        assert world.touches(x, y, heading, length, width) == touched
        found.append(touched)
    assert 100 < sum(found) < 300
