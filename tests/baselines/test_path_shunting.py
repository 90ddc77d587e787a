"""Moves out of a gap: driven by an integrated body, they touch nothing, and end where they say."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import shapely.affinity

from lanekeep_baselines.path_clearance import Body
from lanekeep_baselines.path_planning import PARKING_ANGLE, drive, roll, shortest_gap
from lanekeep_baselines.path_shunting import MOST, shunts

#: The report's car: rear axle's radius at 22 degrees, overhang, length, width, m.
RADIUS, OVERHANG, LENGTH, WIDTH = 0.35 / np.tan(np.deg2rad(22.0)), 0.091, 0.532, 0.265


def body(left: float, right: float) -> Body:
    return Body(LENGTH - OVERHANG, OVERHANG, 0.5 * WIDTH, left, right)


def corners(pose: np.ndarray) -> np.ndarray:
    """Corners of the body at poses of the rear axle (k, 3): (k, 4, 2)."""
    ahead = np.array([LENGTH - OVERHANG, LENGTH - OVERHANG, -OVERHANG, -OVERHANG])
    left = np.array([0.5, -0.5, -0.5, 0.5]) * WIDTH
    cosine, sine = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    return np.stack([pose[:, :1] + cosine * ahead - sine * left, pose[:, 1:2] + sine * ahead + cosine * left], axis=2)


def swept(segments: np.ndarray, pose: np.ndarray, every: int = 40) -> shapely.Geometry:
    """The bodies at places along segments (k, 2)."""
    found = []
    for way, curvature in segments:
        poses = roll(pose, way * np.linspace(0.0, 1.0, every + 1), curvature)
        found += list(corners(np.atleast_2d(poses)))
        pose = poses[-1]
    return shapely.union_all([shapely.Polygon(one) for one in found])


@pytest.fixture(scope="module")
def drawn() -> tuple[dict[str, np.ndarray], list]:
    random = np.random.default_rng(7)
    n = 150
    given = {
        "gap": random.uniform(0.6, 1.0, n),
        "depth": random.uniform(0.26, 0.4, n),
        "kerb": random.uniform(0.03, 0.12, n),
        "air": random.uniform(0.0, 0.03, n),
        "left": random.uniform(0.8, 1.0, n),
        "right": random.uniform(0.8, 1.0, n),
    }
    rows = zip(*given.values(), strict=True)
    return given, [shunts(g, d, k, body(le, ri), air, 0.02) for g, d, k, air, le, ri in rows]


def test_the_moves_touch_no_box_and_no_kerb_and_the_arc_after_them_passes_the_box_ahead(drawn) -> None:
    given, plans = drawn
    found = 0
    for k, plan in enumerate(plans):
        assert np.isfinite(plan.segments).all() and np.isfinite(plan.line).all()
        if not plan.ok[0]:
            continue
        found += 1
        gap, depth, kerb, air, to_left = (given[name][k] for name in ("gap", "depth", "kerb", "air", "left"))
        parked = np.array([air + OVERHANG, kerb + 0.5 * WIDTH, 0.0])
        (end,) = drive(plan.segments, parked[None])
        # The circle that the arc out is on, and its heading.
        assert end[2] == pytest.approx(plan.heading[0], abs=1e-12) and end[2] <= PARKING_ANGLE
        assert end[0] - to_left * np.sin(end[2]) == pytest.approx(plan.place[0], abs=1e-12)
        assert end[1] - to_left * (1.0 - np.cos(end[2])) == pytest.approx(plan.line[0], abs=1e-12)
        out = np.array([[to_left * (0.5 * np.pi - end[2]), 1.0 / to_left]])
        body_ = swept(np.concatenate([plan.segments[0, : plan.moves[0]], out]), parked)
        boxes = shapely.union_all([shapely.box(-2.0, 0.0, 0.0, depth), shapely.box(gap, 0.0, gap + 2.0, depth)])
        assert body_.distance(boxes) >= air - 1e-3  # to what polygons make of arcs
        assert body_.bounds[1] >= min(0.02, kerb - 0.005) - 1e-9
    assert found > 70


def test_each_move_but_the_last_ends_at_a_box_or_at_the_kerb(drawn) -> None:
    given, plans = drawn
    ends = 0
    for k, plan in enumerate(plans):
        if not plan.ok[0]:
            continue
        gap, air, pose = given["gap"][k], given["air"][k], np.array([given["air"][k] + OVERHANG, 0.0, 0.0])
        pose[1] = given["kerb"][k] + 0.5 * WIDTH
        for number, (way, curvature) in enumerate(plan.segments[0, : plan.moves[0]]):
            pose = roll(pose, way, curvature)
            (at,) = corners(pose[None])
            near = abs(at[:, 0].max() - (gap - air)) if way > 0.0 else abs(at[:, 0].min() - air)
            near = near if number % 2 == 0 else min(near, abs(at[:, 1].min() - 0.02))
            assert near < 1e-9
            ends += 1
    assert ends > 150


def test_more_moves_for_shorter_gaps_none_for_long_ones_and_none_helps_where_the_car_does_not_move() -> None:
    lengths = np.arange(0.54, 1.2, 0.002)
    plan = shunts(lengths, WIDTH + 0.08, 0.08, body(RADIUS, RADIUS), 0.0, 0.02)
    needs = plan.moves[plan.ok]
    assert (np.diff(needs) <= 0).all() and set(needs) >= {0, 2, 4, 6} and needs.max() <= 2 * MOST
    # No shunts from that length on from which one sweep is enough: the box is as wide as the car, and stands level.
    first = lengths[plan.ok & (plan.moves == 0)].min()
    assert first == pytest.approx(shortest_gap(OVERHANG, LENGTH, WIDTH, RADIUS), abs=2e-3)
    assert plan.ok[lengths > 0.64].all() and not plan.ok[lengths < LENGTH + 0.02].any()


def test_rows_do_not_know_of_each_other() -> None:
    lengths, depths = np.linspace(0.6, 1.0, 9), np.linspace(0.28, 0.38, 9)
    together = shunts(lengths, depths, 0.08, body(RADIUS, RADIUS), 0.02, 0.02)
    for k in range(9):
        alone = shunts(lengths[k], depths[k], 0.08, body(RADIUS, RADIUS), 0.02, 0.02)
        for some, one in zip(together, alone, strict=True):
            assert some[k].tobytes() == one[0].tobytes()
